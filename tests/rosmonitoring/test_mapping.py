"""Messages to values: the paper's Scalar, Collection and Function rules, and the plan's own; faults have places."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.rml.translate import translate
from avow.backends.rosmonitoring.watched import Fault
from avow.base.diagnostics import Diagnostic
from avow.formulas.values import Data, Element, FunctionValue, SequenceValue, Value
from avow.ros.bags import enveloped
from avow.system.plan import System

MESSAGES = {
    "a/N": "string note\nuint32 count",
    "a/B": "bool on",
    "a/S": "std_msgs/Header header\nstring data",
    "a/C": "string level",
    "a/At": "std_msgs/Header header\nfloat64 posX\nstring frame\nfloat64 posY",
    "a/Map": "float64 x\nfloat64 y\nint32 id",
    "a/L": "int16[] data",
    "std_msgs/Header": "uint32 seq\ntime stamp\nstring frame_id",
}
RCL = """
context {
  Colour : {red, green};
  Command : { move(REAL, REAL), inspect(NATURAL), stop };
  At : REAL x REAL --> BOOL;
  Map : REAL x REAL --> NATURAL;
  Sensors : {};
}
node n {
  inputs( r : REAL, n : NATURAL, b : BOOL, s : STRING, c : Colour, at : At, map : Map, list : <INTEGER>, raw : Sensors )
  outputs( cmd : Command )
  topics( std_msgs/Float64 r matches(in.r), a/N n matches(in.n), a/B b matches(in.b), a/S s matches(in.s),
          a/C c matches(in.c), a/At at matches(in.at), a/Map map matches(in.map), a/L list matches(in.list),
          a/Raw raw matches(in.raw), a/Cmd cmd matches(out.cmd) )
  guarantee g ( out.cmd == stop or in.r >= 0 )
}
"""


def monitor_of(system: System) -> Monitor:
    found, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert faults == ()
    return Monitor(found)


def value_of(system: System, name: str, *events: dict[str, Any]) -> Value | str:
    monitor = monitor_of(system)
    trouble = ""
    for event in events:
        for violation in monitor.step(event):
            trouble = violation.explanation
    return trouble or monitor.values[name]


def faults_of(system: System) -> tuple[Diagnostic, ...]:
    return setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)[1]


@pytest.mark.parametrize(
    ("name", "event", "expected"),
    [
        ("in.r", {"topic": "r", "data": 1.25}, Fraction(5, 4)),
        ("in.r", {"topic": "/r", "data": -3}, Fraction(-3)),
        ("in.r", {"topic": "r", "data": 0.1}, Fraction(0.1)),
        ("in.n", {"topic": "n", "count": 3}, 3),
        ("in.n", {"topic": "n", "count": 3.0}, 3),
        ("in.n", {"topic": "n", "note": "7", "count": 3}, 3),
        ("in.b", {"topic": "b", "on": True}, True),
        ("in.s", {"topic": "s", "header": {"frame_id": "map"}, "data": "it's"}, "it's"),
        ("in.c", {"topic": "c", "level": "red"}, Element("red")),
        ("in.at", {"topic": "at", "posX": 1, "frame": "map", "posY": 2.5}, {(Fraction(1), Fraction(5, 2))}),
        ("in.at", {"topic": "at", "data": {"posX": 1, "posY": 2}}, {(Fraction(1), Fraction(2))}),
        ("in.list", {"topic": "list", "data": [1, 2]}, SequenceValue((1, 2))),
    ],
)
def test_the_definition_decides_the_field(
    make_system: Callable[..., System], name: str, event: dict[str, Any], expected: Any
) -> None:
    found = value_of(make_system(RCL, messages=MESSAGES), name, event)
    if isinstance(expected, set):
        expected = FunctionValue(dict.fromkeys(expected, True), False)
    assert found == expected


@pytest.mark.parametrize(
    ("event", "words"),
    [
        ({"topic": "n", "count": -1}, "no uint32"),
        ({"topic": "n", "count": 1.5}, "not a whole number"),
        ({"topic": "n", "count": 2**32}, "no uint32"),
        ({"topic": "n", "note": 3}, "no field count"),
        ({"topic": "b", "on": 1}, "not a truth value"),
        ({"topic": "c", "level": "blue"}, "outside {red, green}"),
        ({"topic": "at", "posX": 1}, "no field posY"),
        ({"topic": "r"}, "no field data"),
        ({"topic": "r", "data": float("nan"), "other": 1.0}, "nan is not a number"),
        ({"topic": "r", "data": float("-inf")}, "-inf is not a number"),
        ({"topic": "list", "data": [1, 40000]}, "no int16"),
    ],
)
def test_what_does_not_fit_is_reported_and_never_replaced(
    make_system: Callable[..., System], event: dict[str, Any], words: str
) -> None:
    found = value_of(make_system(RCL, messages=MESSAGES), "in.r", event)
    assert isinstance(found, str)
    assert words in found


def test_function_with_a_result(make_system: Callable[..., System]) -> None:
    """The last fitting field is the result; elsewhere the function has the value that the plan says."""
    system = make_system(RCL, {"in.map": {"elsewhere": 99, "hold": "seen"}}, messages=MESSAGES)
    found = value_of(
        system, "in.map", {"topic": "map", "x": 1, "y": 2, "z": 0, "id": 7}, {"topic": "map", "x": 3, "y": 4, "id": 8}
    )
    assert isinstance(found, FunctionValue)
    assert (found(Fraction(1), Fraction(2)), found(Fraction(3), Fraction(4)), found(Fraction(0), Fraction(0))) == (
        7,
        8,
        99,
    )


def test_a_total_function_is_not_guessed(make_system: Callable[..., System]) -> None:
    system = make_system(RCL)
    found, _ = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert "elsewhere" in found.hidden["in.map"]
    assert "unspecified" in found.hidden["in.raw"]
    assert "move, inspect, stop" in found.hidden["out.cmd"]


COMMAND = {"constructor": "command", "move": ["pose.x", "pose.y"], "inspect": ["id"], "values": {"halt": "stop"}}


@pytest.mark.parametrize(
    ("message", "expected"),
    [
        ({"command": "move", "pose": {"x": 1, "y": 2}}, Data("move", (Fraction(1), Fraction(2)))),
        ({"command": "inspect", "id": 4}, Data("inspect", (4,))),
        ({"command": "halt"}, Data("stop")),
        ({"command": "stop"}, Data("stop")),
        ({"command": "fly"}, "none of the constructors"),
        ({"command": "move", "pose": {"x": 1}}, "no field pose.y"),
        ({"command": None}, "none of the constructors"),
    ],
)
def test_constructors_by_a_field(make_system: Callable[..., System], message: dict[str, Any], expected: Any) -> None:
    found = value_of(make_system(RCL, {"out.cmd": COMMAND}), "out.cmd", {"topic": "cmd", **message})
    assert expected in found if isinstance(expected, str) and isinstance(found, str) else found == expected


def test_an_argument_of_an_algebraic_type_is_named_by_its_field(make_system: Callable[..., System]) -> None:
    """Where the message's type is known, too: the monitor could not be made, and died with a traceback."""
    rcl = """
context { Gear : { up(REAL), down }; Command : { go(Gear), stop }; }
node n {
  inputs( b : BOOL ) outputs( cmd : Command ) topics( a/Cmd cmd matches(out.cmd) )
  guarantee g ( out.cmd != stop )
}
"""
    mapping = {"out.cmd": {"constructor": "kind", "go": ["gear"]}}
    system = make_system(rcl, mapping, messages={"a/Cmd": "string kind\nstring gear"})
    event = {"topic": "cmd", "kind": "go", "gear": "down"}
    assert value_of(system, "out.cmd", event) == Data("go", (Data("down"),))
    assert "up takes 1 arguments" in str(value_of(system, "out.cmd", {**event, "gear": "up"}))


TABLE = {"scenario": {"waypoints": [{"id": 3, "x": 1.5, "y": "-2.0"}, {"id": 4, "x": 0, "y": 0}]}}


def test_the_papers_command_mapping(make_system: Callable[..., System]) -> None:
    """A string and an id become move to that waypoint's coordinates."""
    cell = {"table": "waypoints", "key": "id", "by": "id"}
    mapping = {
        "out.cmd": {
            "constructor": "command",
            "move": [{**cell, "column": "x"}, {**cell, "column": "y"}],
            "inspect": ["id"],
        }
    }
    system = make_system(RCL, mapping, plan=TABLE)
    event = {"topic": "cmd", "command": "move", "id": 3}
    assert value_of(system, "out.cmd", event) == Data("move", (Fraction(3, 2), Fraction(-2)))
    assert "no row" in str(value_of(system, "out.cmd", {**event, "id": 9}))


def test_a_cell_that_is_no_number_is_told(make_system: Callable[..., System]) -> None:
    """Also with a letter e in it, as an exponent has: the monitor died with a traceback."""
    cell = {"table": "waypoints", "key": "id", "by": "id"}
    move = [{**cell, "column": "x"}, {**cell, "column": "y"}]
    rows = {"scenario": {"waypoints": [{"id": 3, "x": "west", "y": 0}]}}
    system = make_system(RCL, {"out.cmd": {"constructor": "command", "move": move}}, plan=rows)
    assert "not a number" in str(value_of(system, "out.cmd", {"topic": "cmd", "command": "move", "id": 3}))


@pytest.mark.parametrize(
    ("mapping", "words"),
    [
        ({"in.rr": "data"}, "no variable 'in.rr'"),
        ({"in.at": ["x"]}, "2 fields are wanted"),
        ({"in.r": ["x", "y"]}, "1 field is wanted"),
        ({"out.cmd": {"constructor": "c", "fly": []}}, "no constructor 'fly'"),
        ({"out.cmd": {"constructor": "c", "move": ["x"]}}, "move takes 2 arguments"),
        ({"out.cmd": {"constructor": "c", "values": {"a": "fly"}}}, "no constructor 'fly'"),
        ({"in.at": {"scenario": True}}, "does not interpret"),
        ({"in.r": {"previous": "out.nothing"}}, "no output 'out.nothing'"),
        ({"in.r": {"previous": "out.cmd"}}, "another type"),
        ({"in.r": {"field": "x", "initial": "green"}}, "not a number"),
        ({"in.c": {"field": "x", "initial": "blue"}}, "outside {red, green}"),
        (
            {"out.cmd": {"constructor": "c", "inspect": [{"table": "t", "key": "a", "by": "b", "column": "c"}]}},
            "no table 't'",
        ),
    ],
)
def test_faults_of_the_plan_have_their_place(
    make_system: Callable[..., System], mapping: dict[str, Any], words: str
) -> None:
    faults = faults_of(make_system(RCL, mapping))
    assert [d for d in faults if words in d.message], faults
    assert all(d.span is not None and d.span.file.endswith("plan.yaml") for d in faults)


def test_relations_latest_or_seen(make_system: Callable[..., System]) -> None:
    events = [{"topic": "at", "x": 1, "y": 2}, {"topic": "at", "x": 3, "y": 4}]
    latest = value_of(make_system(RCL, {"in.at": ["x", "y"]}), "in.at", *events)
    seen = value_of(make_system(RCL, {"in.at": {"fields": ["x", "y"], "hold": "seen"}}), "in.at", *events)
    assert isinstance(latest, FunctionValue)
    assert isinstance(seen, FunctionValue)
    assert (len(latest.table), len(seen.table)) == (1, 2)


SHARED = """
node n {
  inputs( x : REAL, y : REAL, word : {go, stop} )
  outputs( o : BOOL )
  topics( p/Pose pose matches(in.x), p/Pose pose matches(in.y), p/Pose pose matches(in.word), bool o matches(out.o) )
  guarantee g ( out.o <=> in.x < in.y and in.word == go )
}
"""


POSE = {"p/Pose": "float64 px\nfloat64 py\nstring mode"}


def test_one_topic_carries_several_variables(make_system: Callable[..., System]) -> None:
    system = make_system(SHARED, {"in.x": "px", "in.y": "py", "out.o": "data"}, messages=POSE)
    event = {"topic": "pose", "py": 2, "px": 1, "mode": "stop"}
    for name, value in (("in.x", Fraction(1)), ("in.y", Fraction(2)), ("in.word", Element("stop"))):
        assert value_of(system, name, event) == value


def test_variables_that_look_alike_need_their_fields(make_system: Callable[..., System]) -> None:
    """Otherwise both would be given the first number of the message, and the guarantee judged by that."""
    faults = faults_of(make_system(SHARED, {"in.y": "py"}, messages=POSE))
    assert ["px : float64, py : float64" in d.message for d in faults] == [True]
    one = {"p/Pose": "float64 px\nstring mode"}
    faults = faults_of(make_system(SHARED, {}, messages=one))
    assert ["would both be read from" in d.message for d in faults] == [True]


@pytest.mark.parametrize("field", ["topic", "time"])
def test_a_field_named_as_what_the_event_says_itself_is_the_messages(
    field: str, make_system: Callable[..., System]
) -> None:
    rcl = "node n { inputs( r : REAL ) outputs( s : REAL ) topics( a/S s matches(out.s) ) guarantee g ( out.s <= 4 ) }"
    system = make_system(rcl, messages={"a/S": f"float64 {field}\nstring data"})
    found, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    assert not faults
    monitor = Monitor(found)
    assert monitor.step(enveloped({field: 3.5, "data": "x"}, "s", 9.0)) == []
    assert [v.fault for v in monitor.step(enveloped({field: 5.5, "data": "x"}, "s", 1.0))] == [Fault.GUARANTEE]
    assert [v.fault for v in monitor.step({"topic": "s", "time": 2, "data": {field: 5.5}})] == [Fault.GUARANTEE]
    assert [v.fault for v in monitor.step({"topic": "s", "time": 2, "data": "x"})] == [Fault.MAPPING]
    assert monitor.values == {}
    assert (
        "has the name of a key of the event itself"
        in translate(found, system.contract.node("n").guarantees).refused["g"]
    )


@pytest.mark.parametrize(
    ("values", "word"),
    [
        ({"green": "red", "red": "green"}, "green"),
        ({"green": "red"}, "green"),
        ({"GREEN": "red"}, "GREEN"),
        ({"green": "green", "GREEN": "red"}, "GREEN"),
        ({"green": "green", "Red": "red"}, ""),
        ({"g": "red", "r": "green"}, ""),
    ],
)
def test_a_word_that_is_an_elements_name_means_that_element(
    values: dict[str, str], word: str, make_system: Callable[..., System]
) -> None:
    system = make_system(RCL, {"in.c": {"field": "level", "values": values}})
    _, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    told = [fault for fault in faults if "is an element too" in fault.message]
    assert len(told) == (1 if word else 0)
    assert all(repr(word) in fault.message and fault.span is not None for fault in told)


@pytest.mark.parametrize(
    ("values", "number"),
    [
        ({"0": "red", "1": "green"}, "0"),
        ({"1": "green"}, "1"),
        ({"0": "green", "7": "red"}, ""),
        ({"7": "red", "8": "green"}, ""),
        ({"OTHER": "red"}, ""),
    ],
)
def test_a_number_whose_constant_has_an_elements_name_means_that_element(
    values: dict[str, str], number: str, make_system: Callable[..., System]
) -> None:
    rcl = """context { L : {green, red}; } node n { inputs( c : L ) outputs( o : BOOL )
      topics( a/S c matches(in.c), bool o matches(out.o) ) guarantee g ( out.o <=> in.c == red ) }"""
    definition = "uint8 GREEN=0\nuint8 RED=1\nuint8 OTHER=7\nuint8 level"
    system = make_system(rcl, {"in.c": {"field": "level", "values": values}}, messages={"a/S": definition})
    _, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    told = [fault for fault in faults if "by its name in a/S it means" in fault.message]
    assert [fault.message.startswith(f"mapping.in.c.values.{number}: {number} is to mean") for fault in told] == (
        [True] if number else []
    )


BOTH = """node n { inputs( r : REAL, q : REAL ) outputs( v : REAL, at : REAL x REAL --> BOOL )
  topics( a/R r matches(in.r), a/R q matches(in.q), a/V v matches(out.v), a/R at matches(out.at) )
  guarantee g ( out.v == in.r ) guarantee h ( out.at(in.r, in.q) ) }"""
INPUTS = {"in.r": "data", "in.q": "data"}


@pytest.mark.parametrize(
    ("mapping", "told"),
    [
        ({**INPUTS, "out.v": {"topic": "r", "field": "data"}}, "in.r"),
        ({**INPUTS, "in.r": {"topic": "v", "field": "data"}}, "in.r"),
        ({**INPUTS, "out.v": {"topic": "r", "field": "other"}}, ""),  # a message may carry input and answer
        ({**INPUTS, "out.at": {"topic": "r", "fields": ["data", "other"]}}, ""),
        (
            {**INPUTS, "in.q": {"topic": "r", "field": "other"}, "out.at": {"topic": "r", "fields": ["data", "other"]}},
            "in.r, in.q",
        ),
    ],
)
def test_what_a_node_is_told_is_no_answer_of_it(
    mapping: dict[str, object], told: str, make_system: Callable[..., System]
) -> None:
    types = {"a/R": "float64 data\nfloat64 other", "a/V": "float64 data"}
    system = make_system(BOTH, mapping, messages=types)
    _, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    found = [fault for fault in faults if "it is read from the message that gives" in fault.message]
    assert [fault.message.partition("gives ")[2] for fault in found] == ([told] if told else []), faults
    assert all(fault.span is not None for fault in found)


def test_a_variable_on_two_topics_is_read_from_neither_unless_the_plan_names_one(
    make_system: Callable[..., System],
) -> None:
    rcl = """node n { inputs( v : REAL ) outputs( w : REAL )
      topics( float64 a matches(in.v), float64 b matches(in.v), float64 w matches(out.w) )
      guarantee g ( out.w == in.v ) }"""
    events = [{"topic": "a", "data": 1.0}, {"topic": "b", "data": 2.0}, {"topic": "w", "data": 2.0}]
    unsaid = monitor_of(make_system(rcl))
    assert [v for e in events for v in unsaid.step(e)] == []
    assert unsaid.tallies["g"].judged == 0
    assert "in.v" not in unsaid.setup.carried
    named = monitor_of(make_system(rcl, {"in.v": {"topic": "b"}}))
    assert [v for e in events for v in named.step(e)] == []
    assert (named.tallies["g"].judged, named.tallies["g"].broken) == (1, 0)
