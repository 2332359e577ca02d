"""Definitions decide fields, once: one way is taken, several or none are told with the message's fields; numbers are
those of the wire; no reading is no value."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import Setup, setup
from avow.backends.rosmonitoring.wires import MappingError, converter
from avow.base.diagnostics import Diagnostic
from avow.formulas.values import Element, FunctionValue, Value
from avow.language.sorts import REAL
from avow.ros.definitions import Definitions, Scalar
from avow.system.plan import System

NODE = """
context {{ Level : {{ok, error}}; Near : REAL --> BOOL; Two : (REAL, REAL);
  Rec : [y : REAL, x : REAL]; Deep : [id : NATURAL, at : Rec]; }}
node n {{
  inputs( v : {sort} )
  outputs( o : BOOL )
  topics( {kind} v matches(in.v), bool o matches(out.o) )
  guarantee g ( {formula} )
}}
"""
FORMULAS = {
    "REAL": "out.o or in.v > 0",
    "INTEGER": "out.o or in.v > 0",
    "NATURAL": "out.o or in.v > 0",
    "Level": "out.o or in.v == ok",
    "Near": "out.o or exists(x in REAL | in.v(x))",
    "Two": "out.o or in.v == (1.0, 2.0)",
    "Rec": "out.o or in.v.x > 0",
    "Deep": "out.o or in.v.at.x > in.v.id",
}


def system_of(make: Callable[..., System], sort: str, kind: str, entry: Any = None, **more: Any) -> System:
    mapping = {} if entry is None else {"in.v": entry}
    return make(NODE.format(sort=sort, kind=kind, formula=FORMULAS[sort]), mapping, **more)


def told(system: System) -> tuple[Setup, tuple[Diagnostic, ...]]:
    return setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)


def value(system: System, **fields: Any) -> Value | str | None:
    found, faults = told(system)
    assert faults == ()
    monitor = Monitor(found)
    trouble = [v.explanation for v in monitor.step({"topic": "v", **fields})]
    return trouble[0] if trouble else monitor.values.get("in.v")


NOETIC = {"plan": {"ros": {"distro": "noetic"}}}
HUMBLE = {"plan": {"ros": {"distro": "humble"}}}


@pytest.mark.parametrize(
    ("sort", "kind", "more", "words"),
    [
        ("REAL", "sensor_msgs/Range", NOETIC, "field_of_view : float32, min_range : float32"),
        ("REAL", "sensor_msgs/msg/Range", HUMBLE, "field_of_view : float32"),
        ("REAL", "sensor_msgs/Range", {}, "nothing defines the messages sensor_msgs/Range"),
        ("REAL", "std_msgs/String", {}, "its fields are data : string"),
        ("NATURAL", "std_msgs/Float64", {}, "no field of std_msgs/Float64"),
        ("REAL", "a/V", {"messages": {"a/V": "b/W inner"}}, "nothing defines b/W"),
        ("Level", "a/V", {"messages": {"a/V": "uint8 level"}}, "its fields are level : uint8"),
        ("Near", "geometry_msgs/Point", NOETIC, "x : float64, y : float64, z : float64"),
    ],
)
def test_what_is_not_said_is_asked_for(
    make_system: Callable[..., System], sort: str, kind: str, more: dict[str, Any], words: str
) -> None:
    if more.get("plan"):
        pytest.importorskip("rosbags")
    _, faults = told(system_of(make_system, sort, kind, **more))
    assert [words in d.message for d in faults] == [True], faults
    assert faults[0].span is not None
    assert faults[0].hint


def test_headers_are_never_meant(make_system: Callable[..., System]) -> None:
    """A range is not its time stamp, though the stamp comes first and is a number."""
    pytest.importorskip("rosbags")
    found, faults = told(system_of(make_system, "REAL", "sensor_msgs/Temperature", "temperature", **NOETIC))
    assert faults == ()
    rule = found.rules["in.v"]
    assert getattr(rule, "wires", None) == (Scalar("float64"),)
    _, faults = told(system_of(make_system, "REAL", "sensor_msgs/Temperature", **NOETIC))
    assert "stamp" not in faults[0].message
    assert "temperature : float64, variance : float64" in faults[0].message


@pytest.mark.parametrize(
    ("sort", "entry", "definition", "words"),
    [
        ("NATURAL", "x", "float64 x", "x is float64, which cannot be read as NATURAL"),
        ("REAL", "x", "string x", "x is string, which cannot be read as REAL"),
        ("REAL", "b", "float64 x\nbool b\nint8 c", "read as REAL (fields that can be read as it: x, c)"),
        ("REAL", "gone", "float64 x\nbool b", "(fields that can be read as it: x)"),
        ("REAL", "y", "float64 x", "has no field 'y'; it has x"),
        ("REAL", "distence", "float64 distance", "has no field 'distence'; it has distance (did you mean `distance`?)"),
        ("REAL", "yaw", "float64 x", "(a/Turn has such a field)"),
        ("REAL", "x.y", "float64 x", "x (float64) has no fields"),
        ("REAL", "x[3]", "float64[3] x", "x has 3 items"),
        ("REAL", {"field": "x", "take": "min"}, "float64 x", "x is float64, and no array"),
        ("REAL", {"field": "x", "nan": "none"}, "float64 x", "`none` wants a relation"),
        ("Level", {"field": "x", "values": {"BAD": "error"}}, "uint8 OK=0\nuint8 x", "neither a number nor a constant"),
        ("Level", "x", "uint8 OK=0\nuint8 x", "no number is known for error"),
        ("NATURAL", {"field": "x", "values": {"on": "1"}}, "uint8 x", "gives names to values, and NATURAL has none"),
        ("REAL", {"field": "x", "values": {"1": "2"}}, "float64 x", "gives names to values, and REAL has none"),
        ("Two", "x", "float64[3] x", "x is float64[3], which cannot be read as (REAL, REAL)"),
        ("Rec", None, "float64 x\nfloat64 z", "no field of a/V can be read as it"),
    ],
)
def test_wrong_paths_and_types_are_faults_of_the_plan(
    make_system: Callable[..., System], sort: str, entry: Any, definition: str, words: str
) -> None:
    _, faults = told(system_of(make_system, sort, "a/V", entry, messages={"a/V": definition, "a/Turn": "float64 yaw"}))
    assert [words in f"{d.message} ({d.hint})" for d in faults] == [True], faults


@pytest.mark.parametrize(
    ("sort", "entry", "definition", "fields", "expected"),
    [
        ("Level", None, "uint8 OK=0\nuint8 WARN=1\nuint8 ERROR=2\nuint8 level", {"level": 2}, Element("error")),
        ("Level", None, "uint8 OK=0\nuint8 WARN=1\nuint8 ERROR=2\nuint8 level", {"level": 1}, "1 is outside"),
        (
            "Level",
            {"field": "level", "values": {"FINE": "ok", "7": "error"}},
            "uint8 FINE=3\nuint8 level",
            {"level": 3},
            Element("ok"),
        ),
        (
            "Level",
            {"field": "level", "values": {"FINE": "ok"}},  # ERROR has the element's own name
            "uint8 FINE=3\nuint8 ERROR=2\nuint8 level",
            {"level": 2},
            Element("error"),
        ),
        ("REAL", None, "time t", {"t": {"secs": 1, "nsecs": 500_000_000}}, Fraction(3, 2)),
        ("REAL", None, "duration t", {"t": {"sec": -1, "nanosec": 1}}, Fraction(-999_999_999, 10**9)),
        ("Two", None, "float64[2] p", {"p": [1, 2]}, (1, 2)),
        ("Two", None, "float64[2] p", {"p": [1, 2, 3]}, "has 3 items, not 2"),
        ("Two", None, "float64 x\nfloat64 y", {"x": 1, "y": 2}, (1, 2)),
        ("Rec", None, "float64 x\nstring name\nfloat64 y", {"x": 1, "name": "n", "y": 2}, (2, 1)),
        ("Rec", "p", "a/P p\na/P q", {"p": {"x": 1, "y": 2, "z": 3}, "q": {}}, (2, 1)),
        ("Rec", "p", "a/P p", {"p": {"x": 1, "z": 3}}, "no field y"),
        ("Deep", None, "uint8 id\na/P at", {"id": 7, "at": {"x": 1, "y": 2, "z": 3}}, (7, (2, 1))),
        ("REAL", "ranges[1]", "float32[] ranges", {"ranges": [1, 2]}, Fraction(2)),
        ("REAL", "ranges[-1]", "float32[] ranges", {"ranges": [1, 2, 3]}, Fraction(3)),
        ("REAL", "ranges[4]", "float32[] ranges", {"ranges": [1, 2]}, "no field ranges[4]"),
        (
            "REAL",
            {"field": "ranges", "take": "min", "nan": "none", "inf": "none", "elsewhere": 30},
            "float32[] ranges",
            {"ranges": [math.inf, math.nan, 2.5, 1.5]},
            Fraction(3, 2),
        ),
        (
            "REAL",
            {"field": "ranges", "take": "max", "nan": "none", "inf": "none", "elsewhere": 30},
            "float32[] ranges",
            {"ranges": [math.inf, math.nan]},
            Fraction(30),
        ),
        ("REAL", {"field": "ranges", "take": "min"}, "float32[] ranges", {"ranges": [math.nan]}, "nan is not a number"),
        (
            "NATURAL",
            {"field": "ranges", "take": "count", "inf": "none"},
            "float32[] ranges",
            {"ranges": [math.inf, 2.0, 1.0]},
            2,
        ),
        ("Near", {"field": "r", "nan": "none"}, "float32 r", {"r": math.nan}, FunctionValue({}, False)),
        ("Near", {"field": "r", "nan": "none"}, "float32 r", {"r": 2}, FunctionValue({(Fraction(2),): True}, False)),
        ("Near", {"field": "r", "nan": "none"}, "float32 r", {"r": math.inf}, "inf is not a number"),
        ("REAL", {"field": "r", "nan": "none", "elsewhere": -1}, "float32 r", {"r": math.nan}, Fraction(-1)),
    ],
)
def test_readings(
    make_system: Callable[..., System], sort: str, entry: Any, definition: str, fields: dict[str, Any], expected: Any
) -> None:
    messages = {"a/V": definition, "a/P": "float64 x\nfloat64 y\nfloat64 z"}
    found = value(system_of(make_system, sort, "a/V", entry, messages=messages), **fields)
    assert expected in found if isinstance(expected, str) and isinstance(found, str) else found == expected


NOTHING = Definitions({})
LARGEST = struct.unpack("<f", b"\xff\xff\x7f\x7f")[0]
"""The largest finite float32."""


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float32_is_its_binary_number_however_it_is_written(number: float) -> None:

    read = converter(REAL, Scalar("float32"), {}, NOTHING, frozenset())
    written = (f"{number:.{p}e}" for p in range(17))
    shortest = next(w for w in written if abs(float(w)) <= LARGEST and struct.pack("<f", float(w)) == pack(number))
    assert read(number) == read(repr(number).encode()) == read(shortest.encode()) == Fraction(number)


@given(st.decimals(min_value=-(10**9), max_value=10**9, allow_nan=False, places=12))
def test_digits_are_rounded_to_the_nearest_number_of_the_type(digits: Any) -> None:

    exact = Fraction(digits)
    for name, form, count in (("float32", "<f", "<i"), ("float64", "<d", "<q")):
        found = converter(REAL, Scalar(name), {}, NOTHING, frozenset())(f"{digits:f}".encode())
        assert isinstance(found, Fraction)
        bits = struct.unpack(count, struct.pack(form, float(found)))[0]
        near = [struct.unpack(form, struct.pack(count, bits + k))[0] for k in (-1, 1) if bits + k not in (-1,)]
        finite = [Fraction(n) for n in near if math.isfinite(n)]
        assert all(abs(exact - found) <= abs(exact - other) for other in finite)


def test_too_large_for_the_type() -> None:

    for name in ("float32", "float64"):
        with pytest.raises(MappingError):
            converter(REAL, Scalar(name), {}, NOTHING, frozenset())(b"1e399")


@pytest.mark.parametrize("number", [3.5e38, -3.5e38, 1.7e308])
def test_too_large_for_a_float32_however_it_is_written(number: float) -> None:

    read = converter(REAL, Scalar("float32"), {}, NOTHING, frozenset())
    for raw in (number, repr(number).encode()):
        with pytest.raises(MappingError):
            read(raw)
    assert read(math.nextafter(LARGEST, math.inf)) == Fraction(LARGEST)  # which is the nearest


def pack(number: float) -> bytes:
    return struct.pack("<f", number)


@pytest.mark.parametrize(
    ("sort", "text", "hint"),
    [
        ("REAL", "float32 a\nfloat32 b\nfloat32[] ranges", "`{field: ranges, take: min}`"),
        ("NATURAL", "float32[] ranges", "`{field: ranges, take: count}`"),
        ("Level", "uint8 OK=0\nuint8 LOW=1\nuint8 level", "(OK, LOW): `{field: level, values: {OK: error, …}}`"),
        ("REAL", "float32 a\nfloat32 b", "name the field under `mapping`"),
    ],
)
def test_what_may_be_written_of_arrays_and_numbers_is_told(
    sort: str, text: str, hint: str, make_system: Callable[..., System]
) -> None:
    _, (fault,) = told(system_of(make_system, sort, "p/M", messages={"p/M": text}))
    assert fault.hint is not None
    assert hint in fault.hint
