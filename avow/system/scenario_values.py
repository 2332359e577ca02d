"""Are a scenario's values values? What a domain or a table gives must be of the type that it is given for."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.tuning.bounds import VALUES_LOOKED_AT
from avow.language.contract import Contract
from avow.language.load import parse_term
from avow.language.printer import show_type
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    Sort,
    StringSort,
    TupleSort,
)

BASE_SORTS: dict[str, Sort] = {"BOOL": BOOL, "INTEGER": INTEGER, "NATURAL": NATURAL, "REAL": REAL, "STRING": STRING}


def unusable(where: str, texts: tuple[str, ...], sort: Sort, contract: Contract, span: Span) -> Iterator[Diagnostic]:
    """The first of the values that is none of the sort."""
    for text in list(dict.fromkeys(texts))[:VALUES_LOOKED_AT]:
        reason = _wrong(text, sort, contract)
        if reason is not None:
            message = f"{where}: {text!r} is no value of {show_type(sort)}: {reason}"
            yield Diagnostic("PLAN109", message, span)
            return


def domain_sort(sort: Sort) -> Sort:
    """What the values under ``domains`` of a port are: a relation's are places, another function's its results."""
    if not isinstance(sort, FunctionSort):
        return sort
    if sort.result != BOOL:
        return sort.result
    return sort.parameters[0] if len(sort.parameters) == 1 else TupleSort(sort.parameters)


def _wrong(text: str, sort: Sort, contract: Contract) -> str | None:
    match sort:
        case OpaqueSort() | StringSort():
            return None
        case RealSort() | IntegerSort() | NaturalSort():
            try:
                number = Fraction(text)
            except (ValueError, ZeroDivisionError):
                pass  # perhaps arithmetic, or a constant's name
            else:
                if isinstance(sort, RealSort) or number.denominator == 1:
                    return "it is negative" if isinstance(sort, NaturalSort) and number < 0 else None
                return "it is not whole"
    try:
        parse_term(text, None, contract, sort=sort)
    except Rejected as rejected:
        return rejected.diagnostics[0].message
    return None
