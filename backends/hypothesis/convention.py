"""Conversion between the contract's values and the program's inputs and outputs (`host` has the Python side of it).

A program that computes with floating-point numbers, as robots do, gets inputs that are rounded to doubles before
anything is judged, so that judge and program use the same numbers; the judge stays exact. Values that are not REAL
(NaN, the infinities) are tried separately, and so is the negative zero.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from typing import Any

from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value, show
from avow.isolation.host import coded, plain
from avow.language import sorts
from avow.language.printer import show_sort

from .exchange import Pairs

Inputs = dict[str, Value]
Case = tuple[Inputs, dict[str, Value]]
"""A unit's inputs in one step, and its outputs."""


class Malformed(Exception):  # noqa: N818 - it names what is wrong
    """The program returned something that is not a value of the output's type."""


def sent(value: Value, *, doubles: bool, lists: bool = False) -> Any:
    """A value as JSON data for the program. `doubles`: its numbers are floats; `lists`: its sequences are lists."""

    def part(inner: Value) -> Any:
        return sent(inner, doubles=doubles, lists=lists)

    match value:
        case bool() | str():
            return value
        case int():
            return {"i": str(value)}
        case Fraction():
            return {"f": float(value).hex()} if doubles else {"q": [str(value.numerator), str(value.denominator)]}
        case Element(name=name):
            return name
        case Opaque():
            return str(value)
        case Data(constructor=constructor, arguments=arguments):
            return {"t": [constructor, *map(part, arguments)]}
        case SequenceValue(items=items):
            return {"l" if lists else "t": [*map(part, items)]}
        case FunctionValue(table=table, default=default):
            return {"f": [[[*map(part, point)], part(v)] for point, v in table.items()], "e": part(default)}
        case tuple():
            return {"t": [*map(part, value)]}


def received(data: Any, sort: sorts.Sort, what: str) -> Value:
    """The value of the sort that the program's data stands for. Raises Malformed, in terms of `what`."""
    match sort, data:
        case sorts.BoolSort(), bool():
            return data
        case ((sorts.IntegerSort() | sorts.NaturalSort() | sorts.RealSort()), _):
            number = _number(data)
            if number is not None and isinstance(sort, sorts.RealSort):
                return number
            if number is not None and number.denominator == 1 and (number >= 0 or isinstance(sort, sorts.IntegerSort)):
                return int(number)
        case sorts.StringSort(), str():
            return data
        case sorts.EnumSort(members=members), str() if data in members:
            return Element(data)
        case sorts.OpaqueSort(name=name), str() if data.startswith(f"{name}#") and data[len(name) + 1 :].isdecimal():
            return Opaque(name, int(data[len(name) + 1 :]))
        case sorts.DataSort(), _:
            made = _data(data, sort, what)
            if made is not None:
                return made
        case sorts.TupleSort(items=items), ({"t": parts} | {"l": parts}) if len(parts) == len(items):
            return tuple(received(part, item, what) for part, item in zip(parts, items, strict=True))
        case sorts.TupleSort(items=items, labels=labels), {"d": pairs} if sorted(map(_label, pairs)) == sorted(labels):
            named = {_label(pair): pair[1] for pair in pairs}
            return tuple(received(named[label], item, what) for label, item in zip(labels, items, strict=True))
        case sorts.SequenceSort(item=item), ({"t": parts} | {"l": parts}):
            return SequenceValue(tuple(received(part, item, what) for part in parts))
        case sorts.FunctionSort(), _:
            table = _function(data, sort, what)
            if table is not None:
                return table
        case sorts.SetSort(), _:
            pass
    raise Malformed(f"{what} is {_shown(data)}, which is no value of {show_sort(sort)}")


def _number(data: Any) -> Fraction | None:
    match data:
        case int() if not isinstance(data, bool):
            return Fraction(data)
        case {"i": digits}:
            return Fraction(int(digits))
        case {"q": [numerator, denominator]}:
            return Fraction(int(numerator), int(denominator))
        case {"f": str(text)} if math.isfinite(float.fromhex(text)):
            return Fraction(float.fromhex(text))
        case _:  # no number
            return None


def _label(pair: Any) -> str:
    """The field named by a pair of a dict; none if it is not a text."""
    return pair[0] if isinstance(pair[0], str) else ""


def _data(data: Any, sort: sorts.DataSort, what: str) -> Value | None:
    name, arguments = (data, []) if isinstance(data, str) else _head(data)
    for constructor in sort.constructors:
        if constructor.name == name and len(constructor.parameters) == len(arguments):
            pairs = zip(arguments, constructor.parameters, strict=True)
            return Data(constructor.name, tuple(received(a, p, what) for a, p in pairs))
    return None


def _head(data: Any) -> tuple[str | None, list[Any]]:
    match data:
        case {"t": [str(name), *arguments]} | {"l": [str(name), *arguments]}:
            return name, arguments
        case _:  # nothing applied
            return None, []


def _function(data: Any, sort: sorts.FunctionSort, what: str) -> Value | None:
    """A Table; a set of points, for a relation; a dict from points, with `...` for the default."""
    relation = isinstance(sort.result, sorts.BoolSort)
    rows: list[tuple[Any, Any]]
    match data:
        case {"f": points, "e": rest} | {"f": points, "d": rest}:  # the latter from an earlier ledger
            rows, default = [({"t": point}, value) for point, value in points], rest
        case {"s": points} | {"t": points} | {"l": points} if relation:
            rows, default = [(point, True) for point in points], False
        case {"d": pairs}:
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


def _point(data: Any, parameters: Sequence[sorts.Sort], what: str) -> tuple[Value, ...]:
    place = f"a point of {what}"
    match data:
        case {"t": parts} | {"l": parts} if len(parts) == len(parameters):
            try:
                return tuple(received(part, sort, place) for part, sort in zip(parts, parameters, strict=True))
            except Malformed:
                if len(parameters) != 1:
                    raise
    if len(parameters) == 1:
        return (received(data, parameters[0], place),)
    raise Malformed(f"{place} is {_shown(data)}; it needs {len(parameters)} values")


def _shown(data: Any) -> str:
    """The returned data, for people."""
    match data:
        case {"?": what}:
            return str(what)
        case {"t": parts} | {"l": parts}:
            return f"({', '.join(map(_shown, parts))})"
        case {"s": parts}:
            return f"{{{', '.join(map(_shown, parts))}}}"
        case {"f": str(text)} if not math.isfinite(float.fromhex(text)):
            return f"the number {float.fromhex(text)}"
        case {"f": list()}:
            return "a table"
        case {"d": _}:
            return "a dict"
        case _:  # a number, or shown as JSON
            number = _number(data)
            return repr(data) if number is None else str(number)


def outputs(data: Any, ports: Mapping[str, sorts.Sort], but: Collection[str] = ()) -> dict[str, Value]:
    """Every output from the returned data: a dict by name (except the names `but`), or the one output itself. Raises
    Malformed."""
    found: dict[str, Any] = {}
    names = set(ports)
    match data:
        case {"d": pairs} if all(isinstance(key, str) for key, _ in pairs) and (
            len(names) != 1 or {key for key, _ in pairs} - {*but} == names
        ):
            found = {key: value for key, value in pairs if key not in but}
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


def valuation(inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
    """Qualified names to values."""
    return {f"in.{n}": v for n, v in inputs.items()} | {f"out.{n}": v for n, v in found.items()}


def told(inputs: Inputs, found: Mapping[str, Value]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in pairs(inputs, found))


def pairs(inputs: Inputs, found: Mapping[str, Value]) -> Pairs:
    return tuple((name, show(value)) for name, value in valuation(inputs, found).items())


def asked_with(inputs: Inputs, name: str, word: str) -> Pairs:
    """The inputs, with the word as the value of one."""
    return tuple((n, word if n == f"in.{name}" else value) for n, value in pairs(inputs, {}))


# -- machine numbers ---------------------------------------------------------------------------------------------------


EXACT, FINITE, ANY = "exact", "float64", "float64-with-nan"
"""The option `numbers`: fractions; doubles; doubles, where a failure on NaN or an infinity refutes."""

SPECIAL = {"-0": "-0x0.0p+0", "NaN": "nan", "infinity": "inf", "-infinity": "-inf"}
"""Names, and texts for Python (`float.fromhex`)."""


# -- values of the generated test --------------------------------------------------------------------------------------


def as_value(given: Any, sort: sorts.Sort) -> Value:
    """The contract's value for a drawn one. Raises Malformed if it is not of the sort, as NaN is not."""
    if not isinstance(sort, sorts.FunctionSort):
        return received(coded(given), sort, "a drawn value")
    rows = [[[coded(part) for part in point], coded(value)] for point, value in given.table.items()]
    return received({"f": rows, "e": coded(given.default)}, sort, "a drawn function")


def as_plain(value: Value, table: Any) -> Any:
    """A value as the generated test has it; `table` is its class of functions."""
    if not isinstance(value, FunctionValue):
        return plain(sent(value, doubles=False))
    rows = {tuple(as_plain(p, table) for p in point): as_plain(v, table) for point, v in value.table.items()}
    return table(rows, as_plain(value.default, table))
