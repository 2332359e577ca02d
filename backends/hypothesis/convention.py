"""Between the contract's values and what a subject gets and returns (`host` has the Python side of it).

What computes with floating-point numbers, as robots do, gets inputs that are rounded to doubles before anything is
judged, so that judge and subject speak of the same numbers; the judge stays exact. What no REAL is (NaN, the
infinities) is tried apart, and so is the negative zero.
"""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.base.codec import from_text
from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value, show
from avow.language.printer import show_sort
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)

from .exchange import Pairs, Question
from .generate import Inputs
from .pools import parse_cell


class Malformed(Exception):  # noqa: N818 - it names what is wrong
    """The subject returned something that is no value of the output's type."""


def sent(value: Value) -> Any:
    """A value as JSON data for the host."""
    match value:
        case bool() | str():
            return value
        case int():
            return value
        case Fraction():
            return {"q": [value.numerator, value.denominator]}
        case Element(name=name):
            return name
        case Opaque():
            return str(value)
        case Data(constructor=constructor, arguments=arguments):
            return {"t": [constructor, *map(sent, arguments)]}
        case SequenceValue(items=items):
            return {"t": [sent(item) for item in items]}
        case FunctionValue(table=table, default=default):
            return {"f": [[[sent(a) for a in point], sent(v)] for point, v in table.items()], "d": sent(default)}
        case tuple():
            return {"t": [sent(item) for item in value]}


def received(data: Any, sort: Sort, what: str) -> Value:
    """The value of the sort that the host's data stands for. Raises Malformed, in terms of `what`."""
    match sort, data:
        case BoolSort(), bool():
            return data
        case ((IntegerSort() | NaturalSort() | RealSort()), int()) if not isinstance(data, bool):
            return received({"q": [data, 1]}, sort, what)  # as `sent` has it
        case ((IntegerSort() | NaturalSort() | RealSort()), {"q": [numerator, denominator]}):
            number = Fraction(int(numerator), int(denominator))
            if isinstance(sort, RealSort):
                return number
            if number.denominator == 1 and (number >= 0 or isinstance(sort, IntegerSort)):
                return int(number)
        case StringSort(), str():
            return data
        case EnumSort(members=members), str() if data in members:
            return Element(data)
        case OpaqueSort(name=name), str() if data.startswith(f"{name}#") and data[len(name) + 1 :].isdecimal():
            return Opaque(name, int(data[len(name) + 1 :]))
        case DataSort(), _:
            made = _data(data, sort, what)
            if made is not None:
                return made
        case TupleSort(items=items), {"t": parts} if len(parts) == len(items):
            return tuple(received(part, item, what) for part, item in zip(parts, items, strict=True))
        case TupleSort(items=items, labels=labels), {"m": pairs} if sorted(map(_label, pairs)) == sorted(labels):
            named = {_label(pair): pair[1] for pair in pairs}
            return tuple(received(named[label], item, what) for label, item in zip(labels, items, strict=True))
        case SequenceSort(item=item), {"t": parts}:
            return SequenceValue(tuple(received(part, item, what) for part in parts))
        case FunctionSort(), _:
            table = _function(data, sort, what)
            if table is not None:
                return table
        case SetSort(), _:
            pass
    raise Malformed(f"{what} is {_shown(data)}, which is no value of {show_sort(sort)}")


def _label(pair: Any) -> str:
    """The field that a pair of a dict is about; no text: none."""
    return pair[0] if isinstance(pair[0], str) else ""


def _data(data: Any, sort: DataSort, what: str) -> Value | None:
    name, arguments = (data, []) if isinstance(data, str) else _head(data)
    for constructor in sort.constructors:
        if constructor.name == name and len(constructor.parameters) == len(arguments):
            pairs = zip(arguments, constructor.parameters, strict=True)
            return Data(constructor.name, tuple(received(a, p, what) for a, p in pairs))
    return None


def _head(data: Any) -> tuple[str | None, list[Any]]:
    match data:
        case {"t": [str(name), *arguments]}:
            return name, arguments
        case _:  # nothing applied
            return None, []


def _function(data: Any, sort: FunctionSort, what: str) -> Value | None:
    """A Table; a set of points, for a relation; a dict from points, with `...` for the default."""
    relation = isinstance(sort.result, BoolSort)
    rows: list[tuple[Any, Any]]
    match data:
        case {"f": points, "d": rest}:
            rows, default = [({"t": point}, value) for point, value in points], rest
        case {"s": points} if relation:
            rows, default = [(point, True) for point in points], False
        case {"t": points} if relation:
            rows, default = [(point, True) for point in points], False
        case {"m": pairs}:
            given = [value for point, value in pairs if point == {"...": True}]
            if not given and not relation:
                raise Malformed(f"{what} is a dict without a default (the key ...)")
            rows = [(point, value) for point, value in pairs if point != {"...": True}]
            default = given[0] if given else False
        case _:  # no mapping
            return None
    other = received(default, sort.result, f"{what}'s default")
    table: dict[tuple[Value, ...], Value] = {}
    for point, value in rows:
        table[_point(point, sort.parameters, what)] = received(value, sort.result, f"{what} at a point")
    return FunctionValue({p: v for p, v in table.items() if v != other}, other)


def _point(data: Any, parameters: Sequence[Sort], what: str) -> tuple[Value, ...]:
    place = f"a point of {what}"
    match data:
        case {"t": parts} if len(parts) == len(parameters):
            try:
                return tuple(received(part, sort, place) for part, sort in zip(parts, parameters, strict=True))
            except Malformed:
                if len(parameters) != 1:
                    raise
    if len(parameters) == 1:
        return (received(data, parameters[0], place),)
    raise Malformed(f"{place} is {_shown(data)}; it needs {len(parameters)} values")


def _shown(data: Any) -> str:
    """What the subject returned, for people."""
    match data:
        case {"?": what}:
            return str(what)
        case {"q": [numerator, denominator]}:
            return str(Fraction(int(numerator), int(denominator)))
        case {"t": parts}:
            return f"({', '.join(map(_shown, parts))})"
        case {"s": parts}:
            return f"{{{', '.join(map(_shown, parts))}}}"
        case {"m": _}:
            return "a dict"
        case {"f": _}:
            return "a table"
        case _:  # shown as JSON
            return repr(data)


def outputs(data: Any, ports: Mapping[str, Sort]) -> dict[str, Value]:
    """Every output from what the subject returned: a dict by name, or the one output itself. Raises Malformed."""
    found: dict[str, Any] = {}
    names = set(ports)
    match data:
        case {"m": pairs} if all(isinstance(key, str) for key, _ in pairs) and (
            len(names) != 1 or {key for key, _ in pairs} == names
        ):
            found = dict(pairs)
        case _ if len(names) == 1:
            found = {next(iter(names)): data}
        case _:  # several names
            listed = ", ".join(sorted(names))
            raise Malformed(f"the subject returned {_shown(data)}; it has to return a dict of {listed}")
    if set(found) != names:
        missing, extra = sorted(names - set(found)), sorted(set(found) - names)
        parts = [f"lacks {', '.join(missing)}"] if missing else []
        parts += [f"has {', '.join(map(repr, extra))}, which the node has not"] if extra else []
        raise Malformed(f"the dict that the subject returned {' and '.join(parts)}")
    return {name: received(found[name], sort, f"out.{name}") for name, sort in ports.items()}


# -- cases in the contract's words -------------------------------------------------------------------------------------


Case = tuple[Inputs, dict[str, Value]]


def valuation(inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
    """Qualified names to values."""
    return {f"in.{n}": v for n, v in inputs.items()} | {f"out.{n}": v for n, v in found.items()}


def told(inputs: Inputs, found: Mapping[str, Value]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in pairs(inputs, found))


def pairs(inputs: Inputs, found: Mapping[str, Value]) -> Pairs:
    return tuple((name, show(value)) for name, value in valuation(inputs, found).items())


def asked_with(inputs: Inputs, name: str, word: str) -> Pairs:
    """The inputs, of which one is what the word says."""
    return tuple((n, word if n == f"in.{name}" else value) for n, value in pairs(inputs, {}))


def sent_inputs(inputs: Inputs, *, doubles: bool = False) -> dict[str, Any]:
    """Inputs as JSON data for the host; `doubles`: of rounded values, with doubles in it."""
    made = {name: sent(value) for name, value in inputs.items()}
    return {name: _as_double(data) for name, data in made.items()} if doubles else made


# -- machine numbers ---------------------------------------------------------------------------------------------------


EXACT, FINITE, ANY = "exact", "float64", "float64-with-nan"
"""The option `numbers`: fractions; doubles; doubles, and whoever fails on one that is no number is refuted."""

SPECIAL = {"-0": "-0x0.0p+0", "NaN": "nan", "infinity": "inf", "-infinity": "-inf"}
"""In words, and as Python reads them (`float.fromhex`)."""


def rounded(value: Value) -> Value:
    """Every REAL in it as the nearest double."""
    match value:
        case Fraction():
            try:
                return Fraction(float(value))
            except OverflowError:
                return Fraction(sys.float_info.max) * (1 if value > 0 else -1)
        case Data(constructor=constructor, arguments=arguments):
            return Data(constructor, tuple(map(rounded, arguments)))
        case SequenceValue(items=items):
            return SequenceValue(tuple(map(rounded, items)))
        case FunctionValue(table=table, default=default):
            other = rounded(default)
            points = {tuple(map(rounded, point)): rounded(v) for point, v in table.items()}
            return FunctionValue({point: v for point, v in points.items() if v != other}, other)
        case tuple():
            return tuple(map(rounded, value))
        case _:  # no number, or a whole one
            return value


def _as_double(data: Any) -> Any:
    """What `sent` made of a rounded value, with doubles in it."""
    match data:
        case {"q": [numerator, denominator]}:
            return {"r": float(Fraction(numerator, denominator)).hex()}
        case dict():
            return {key: _as_double(part) for key, part in data.items()}
        case list():
            return [_as_double(part) for part in data]
        case _:  # no number
            return data


# -- what lies beside a generated test: kept cases, the scenario's rows ------------------------------------------------


def kept_inputs(path: Path, sorts: Mapping[str, Sort]) -> tuple[Inputs, ...]:
    """The kept cases that are inputs of the contract as it is now; of a run, those of its steps."""
    found: list[Inputs] = []
    for case in (step for run in kept_runs(path) for step in run):
        with contextlib.suppress(Malformed, KeyError, ValueError, TypeError, AttributeError):
            found.append({name: received(case[name], sort, name) for name, sort in sorts.items()})
    return tuple(found)


def kept_runs(path: Path) -> tuple[tuple[Any, ...], ...]:
    """The kept cases as data: each the inputs of the steps of a run; of a function that is asked one step, of one."""
    return from_text(tuple[tuple[Any, ...], ...], path.read_bytes()) if path.is_file() else ()


def table_rows(
    scenario: Mapping[str, Sequence[Sequence[str]]], sorts: Mapping[str, Sort]
) -> dict[str, tuple[tuple[Value, ...], ...]]:
    """The scenario's rows for the ports that it interprets, as values; a row that does not fit is left out."""
    found: dict[str, tuple[tuple[Value, ...], ...]] = {}
    for name, table in scenario.items():
        sort = sorts.get(name)
        if isinstance(sort, FunctionSort):
            columns = sort.parameters if isinstance(sort.result, BoolSort) else (*sort.parameters, sort.result)
            read = [tuple(parse_cell(cell, s) for cell, s in zip(row, columns, strict=False)) for row in table]
            fitting = [row for row in read if len(row) == len(columns) and None not in row]
            found[name] = tuple(tuple(v for v in row if v is not None) for row in fitting)
    return found


def system_root(asked: Question, folder: Path) -> Path:
    """The system's folder: known from the environment, or beside the artifacts."""
    root = os.environ.get("AVOW_SYSTEM_ROOT")
    if root:
        return Path(root)
    for parent in folder.resolve().parents:
        candidate = parent / "contracts" / asked.folder
        if (candidate / asked.subject.file).is_file():
            return candidate
    return folder
