"""The plan's finite scenario as values: which inputs its tables fix, and to what."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from avow.formulas.values import Element, FunctionValue, Value
from avow.language.contract import Node, Port
from avow.language.sorts import BoolSort, EnumSort, FunctionSort, IntegerSort, NaturalSort, RealSort, Sort, StringSort
from avow.language.terms import Variable
from avow.system.plan import Scenario


def interpretation(node: Node, scenario: Scenario | None) -> dict[Variable, Value]:
    """The inputs of a node that are relations given by the scenario's tables: each holds at the rows and nowhere else.

    A function with another result is not fixed: a table says nothing of its value elsewhere. Cells that are no value of
    their sort leave the input open, too (the plan's checks report them).
    """
    found: dict[Variable, Value] = {}
    for port in node.inputs:
        sort = port.sort
        if scenario is None or not isinstance(sort, FunctionSort) or not isinstance(sort.result, BoolSort):
            continue
        rows = rows_of(node, port, sort.parameters, scenario)
        if rows is not None:
            found[port.variable] = FunctionValue(dict.fromkeys(rows, True), False)
    return found


def rows_of(node: Node, port: Port, sorts: Sequence[Sort], scenario: Scenario) -> list[tuple[Value, ...]] | None:
    """The rows of the table that interprets a port; None where there is none of such columns."""
    said = scenario.interpreted(node.name, port)
    if said is None or len(said[1]) != len(sorts):
        return None
    try:
        table = scenario.table(said[0])
        cells = [[_value(t, s) for t in table.column(c)] for c, s in zip(said[1], sorts, strict=True)]
    except (KeyError, ValueError, ZeroDivisionError):
        return None
    return list(zip(*cells, strict=True))


def _value(text: str, sort: Sort) -> Value:
    """Raises ValueError."""
    match sort:
        case RealSort():
            return Fraction(text)
        case IntegerSort():
            return int(text)
        case NaturalSort() if int(text) >= 0:
            return int(text)
        case StringSort():
            return text
        case EnumSort(members=members) if text in members:
            return Element(text)
        case BoolSort() if text.lower() in {"true", "false"}:
            return text.lower() == "true"
    raise ValueError(text)
