"""Conversion between the contract's values and the program's inputs and outputs (`host` has the Python side of it).

A program that computes with floating-point numbers, as robots do, gets inputs that are rounded to doubles before
anything is judged, so that judge and program use the same numbers; the judge stays exact. Values that are not REAL
(NaN, the infinities) are tried separately, and so is the negative zero.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction
from typing import Any, assert_never

from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value, show
from avow.language import sorts
from avow.language.printer import show_sort

from .exchange import Pairs

Inputs = dict[str, Value]
Case = tuple[Inputs, dict[str, Value]]
"""A unit's inputs in one step, and its outputs."""


class Malformed(Exception):  # noqa: N818 - it names what is wrong
    """The program returned something that is not a value of the output's type."""


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


def received(data: Any, sort: sorts.Sort, what: str) -> Value:
    """The value of the sort that the host's data stands for. Raises Malformed, in terms of `what`."""
    match sort, data:
        case sorts.BoolSort(), bool():
            return data
        case ((sorts.IntegerSort() | sorts.NaturalSort() | sorts.RealSort()), int()) if not isinstance(data, bool):
            return received({"q": [data, 1]}, sort, what)  # as `sent` has it
        case ((sorts.IntegerSort() | sorts.NaturalSort() | sorts.RealSort()), {"q": [numerator, denominator]}):
            number = Fraction(int(numerator), int(denominator))
            if isinstance(sort, sorts.RealSort):
                return number
            if number.denominator == 1 and (number >= 0 or isinstance(sort, sorts.IntegerSort)):
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
        case sorts.TupleSort(items=items), {"t": parts} if len(parts) == len(items):
            return tuple(received(part, item, what) for part, item in zip(parts, items, strict=True))
        case sorts.TupleSort(items=items, labels=labels), {"m": pairs} if sorted(map(_label, pairs)) == sorted(labels):
            named = {_label(pair): pair[1] for pair in pairs}
            return tuple(received(named[label], item, what) for label, item in zip(labels, items, strict=True))
        case sorts.SequenceSort(item=item), {"t": parts}:
            return SequenceValue(tuple(received(part, item, what) for part in parts))
        case sorts.FunctionSort(), _:
            table = _function(data, sort, what)
            if table is not None:
                return table
        case sorts.SetSort(), _:
            pass
    raise Malformed(f"{what} is {_shown(data)}, which is no value of {show_sort(sort)}")


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
        case {"t": [str(name), *arguments]}:
            return name, arguments
        case _:  # nothing applied
            return None, []


def _function(data: Any, sort: sorts.FunctionSort, what: str) -> Value | None:
    """A Table; a set of points, for a relation; a dict from points, with `...` for the default."""
    relation = isinstance(sort.result, sorts.BoolSort)
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


def _point(data: Any, parameters: Sequence[sorts.Sort], what: str) -> tuple[Value, ...]:
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
    """The returned data, for people."""
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


def outputs(data: Any, ports: Mapping[str, sorts.Sort]) -> dict[str, Value]:
    """Every output from the returned data: a dict by name, or the one output itself. Raises Malformed."""
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


def sent_inputs(inputs: Inputs, *, doubles: bool = False) -> dict[str, Any]:
    """Inputs as JSON data for the host; `doubles`: the values are rounded, and numbers are sent as doubles."""
    made = {name: sent(value) for name, value in inputs.items()}
    return {name: _as_double(data) for name, data in made.items()} if doubles else made


# -- machine numbers ---------------------------------------------------------------------------------------------------


EXACT, FINITE, ANY = "exact", "float64", "float64-with-nan"
"""The option `numbers`: fractions; doubles; doubles, where a failure on NaN or an infinity refutes."""

SPECIAL = {"-0": "-0x0.0p+0", "NaN": "nan", "infinity": "inf", "-infinity": "-inf"}
"""Names, and texts for Python (`float.fromhex`)."""


def _as_double(data: Any) -> Any:
    """The result of `sent` for a rounded value, with doubles in it."""
    match data:
        case {"q": [numerator, denominator]}:
            return {"r": float(Fraction(numerator, denominator)).hex()}
        case dict():
            return {key: _as_double(part) for key, part in data.items()}
        case list():
            return [_as_double(part) for part in data]
        case _:  # not a number
            return data


# -- values of the generated test --------------------------------------------------------------------------------------


def as_value(given: Any, sort: sorts.Sort) -> Value:
    """The contract's value for a drawn one. Raises ValueError or OverflowError if a float is not a number."""
    match sort:
        case sorts.BoolSort() | sorts.StringSort() | sorts.IntegerSort() | sorts.NaturalSort():
            return given  # type: ignore[no-any-return]
        case sorts.RealSort():
            return Fraction(given)
        case sorts.EnumSort():
            return Element(given)
        case sorts.OpaqueSort(name=name):
            return Opaque(name, int(given.removeprefix(f"{name}#")))
        case sorts.DataSort():
            constructor, *arguments = given
            parameters = sort.constructor(constructor).parameters
            return Data(constructor, tuple(map(as_value, arguments, parameters)))
        case sorts.TupleSort(items=items):
            return tuple(map(as_value, given, items))
        case sorts.SequenceSort(item=item):
            return SequenceValue(tuple(as_value(one, item) for one in given))
        case sorts.FunctionSort(parameters=parameters, result=result):
            default = as_value(given.default, result)
            rows = {tuple(map(as_value, point, parameters)): as_value(v, result) for point, v in given.table.items()}
            return FunctionValue({point: value for point, value in rows.items() if value != default}, default)
        case sorts.SetSort():
            raise ValueError("a set is no input")
        case _:
            assert_never(sort)


def as_plain(value: Value, table: Any) -> Any:
    """A value as the generated test has it; `table` is its class of functions."""
    match value:
        case Element(name=name):
            return name
        case Opaque():
            return str(value)
        case Data(constructor=constructor, arguments=arguments):
            return (constructor, *(as_plain(one, table) for one in arguments))
        case SequenceValue(items=items) | (tuple() as items):
            return tuple(as_plain(item, table) for item in items)
        case FunctionValue(table=rows, default=default):
            points = {tuple(as_plain(p, table) for p in point): as_plain(v, table) for point, v in rows.items()}
            return table(points, as_plain(default, table))
        case _:  # a number, a truth value, a text
            return value


# -- a driven class (`avow.drive.steps`) -------------------------------------------------------------------------------


def as_step(value: Value, *, doubles: bool) -> Any:
    """An input as a driven class gets it. Raises Malformed."""
    match value:
        case bool():
            return value
        case Fraction():
            return {"f": float(value).hex()} if doubles else {"q": [str(value.numerator), str(value.denominator)]}
        case int():
            return {"i": str(value)}
        case Element(name=name):
            return name
        case SequenceValue(items=items):
            return {"l": [as_step(item, doubles=doubles) for item in items]}
        case Data(constructor=constructor, arguments=arguments):
            return {"t": [constructor, *(as_step(one, doubles=doubles) for one in arguments)]}
        case tuple():
            return {"t": [as_step(item, doubles=doubles) for item in value]}
        case _:  # `subject` rejects such ports
            raise Malformed(f"a step class is not given {value}")


def from_step(data: Any, but: Collection[str] = ()) -> Any:
    """The returned data of a class, in the form of a function's host; `but`: names of a dict that are left out."""
    match data:
        case {"f": str(text)}:
            number = float.fromhex(text)
            if not math.isfinite(number):
                return {"?": f"the number {number}"}
            return {"q": [str(part) for part in number.as_integer_ratio()]}
        case {"i": str(digits)}:
            return {"q": [digits, "1"], "w": True}
        case {"l": items} | {"t": items}:
            return {"t": [from_step(item) for item in items]}
        case {"d": pairs}:
            return {"m": [[key, from_step(value)] for key, value in pairs if key not in but]}
        case _:  # its own JSON
            return data
