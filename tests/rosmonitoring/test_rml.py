"""RML texts: golden files, our grammar's refusals, names that could do harm, and guarantees that are refused."""

from __future__ import annotations

import json
import os
import random
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from oracle.rml import Interpreter
from oracle.rml_reader import Malformed, read

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.rml.translate import Translation, translate
from avow.system.load import load_system
from avow.system.plan import Method, System

GOLDEN = Path(__file__).parent / "golden"


def method(system: System, node: str, name: str = "") -> Method:
    """The node's first method, or the first of that name."""
    return next(m for m in system.plan.node(node).methods if name in ("", m.id))


def rml_of(system: System, name: str, of: str = "") -> Translation:
    node = system.contract.node(name)
    found, faults = setup(system, node, method(system, name, of).options if system.plan.node(name).methods else None)
    assert faults == ()
    return translate(found, node.guarantees)


@pytest.mark.parametrize("name", ["localisation", "navigation", "agent", "radiationSensor"])
def test_the_case_studys_files(name: str, case: System) -> None:
    """`AVOW_GOLDEN=1 pytest` rewrites them."""
    made = rml_of(case, name)
    read(made.text)
    path = GOLDEN / f"{name}.rml"
    if os.environ.get("AVOW_GOLDEN"):
        path.parent.mkdir(exist_ok=True)
        path.write_text(made.text, encoding="utf-8")
    assert made.text == path.read_text(encoding="utf-8")


PUBLISHED = Path(__file__).parents[2] / "contracts" / "remote_inspection_published"


def test_the_papers_listing_5_comes_from_its_published_contract() -> None:
    """The paper's terms t1 to t3, with a meaning that RML gives them. `AVOW_GOLDEN=1 pytest` rewrites the file."""
    made = rml_of(load_system(PUBLISHED), "agent", "rosmonitoring")
    assert made.refused == {}
    read(made.text)
    path = GOLDEN / "published_agent.rml"
    if os.environ.get("AVOW_GOLDEN"):
        path.write_text(made.text, encoding="utf-8")
    assert made.text == path.read_text(encoding="utf-8")


def snapshot(rng: random.Random) -> dict[str, Any]:
    """A message with all that the agent knows; the listing's fields."""

    def place() -> dict[str, int]:
        return {"posX": rng.randrange(2), "posY": rng.randrange(2)}

    command = {"command": "move", **place()} if rng.random() < 0.6 else {"command": "inspect", "id": rng.randrange(3)}
    return {
        "topic": "gazebo_radiation_plugin/Snapshot",
        "at": place(),
        "wayPNow": {**place(), "id": rng.choice((0, 0, 1, 2, 13))},
        "radiationStatus": {"level": rng.choice(("red", "orange", "green", "green"))},
        "inspected": {"id": rng.choice((0, 1, 2, 13))},
        "command": command,
    }


def kept(event: dict[str, Any]) -> dict[str, bool]:
    """The three published guarantees at one message, by hand: quantifiers run through every number that occurs, its
    neighbours, and one beyond."""
    places = [(x, y) for x in range(3) for y in range(3)]
    numbers = range(16)
    now, here, command = event["wayPNow"], (event["at"]["posX"], event["at"]["posY"]), event["command"]

    def way(place: tuple[int, int]) -> int:
        return int(now["id"]) if place == (now["posX"], now["posY"]) else 13

    goal = (command.get("posX"), command.get("posY"))  # of no place, where it inspects
    danger = event["radiationStatus"]["level"] != "green"

    def moves_on(i: int) -> bool:
        last = all(way(p) != i + 1 for p in places)
        return any((way(p) == i + 1 or (last and way(p) == 0)) and goal == p for p in places)

    def returns() -> bool:
        return any(way(p) == 0 and goal == p for p in places)

    inspected = event["inspected"]["id"]
    return {
        "G1": all(moves_on(i) for i in numbers if way(here) == i == inspected and not danger),
        "G2": all(command.get("id") == i for i in numbers if way(here) == i != inspected),
        "G3": all(returns() for i in numbers if danger or all(way(p) != i + 1 for p in places)),
    }


@pytest.mark.parametrize("guarantee", ["G1", "G2", "G3"])
def test_the_published_agents_monitor_says_what_its_contract_says(guarantee: str) -> None:
    system = load_system(PUBLISHED)
    found, _ = setup(system, system.contract.node("agent"), method(system, "agent", "rosmonitoring").options)
    text = translate(found, [system.contract.node("agent").clause(guarantee)]).text
    rng, verdicts = random.Random(0), set()
    for _ in range(300):
        event = snapshot(rng)
        expected = kept(event)[guarantee]
        verdicts.add(expected)
        assert (Interpreter(text).step(event) == "currently_true") is expected, event
    assert verdicts == {True, False}


def test_what_is_refused_says_why(case: System) -> None:
    assert rml_of(case, "agent").refused == {}
    navigation, sensor = rml_of(case, "navigation"), rml_of(case, "radiationSensor")
    assert set(navigation.refused) == {"somewhere"}
    assert set(sensor.refused) == {"marks_inspected"}
    for made in (navigation, sensor):
        for name, reason in made.refused.items():
            assert f"guarantee {name}: {reason}" in made.text


@pytest.mark.nightly
def test_the_papers_agent_is_monitored_in_rml_as_by_the_engine(case: System, nominal: list[dict[str, Any]]) -> None:
    """On the nominal run, and on it with each command's place, constructor or waypoint changed."""
    found, _ = setup(case, case.contract.node("agent"), case.plan.node("agent").methods[0].options)
    text = translate(found, case.contract.node("agent").guarantees).text
    commands = [k for k, e in enumerate(nominal) if e["topic"] == "command"]
    changes = [{}, {"posX": 1.5}, {"id": 11}, {"command": "inspect"}, {"command": "move"}]
    differing = 0
    for at in commands[1::4]:
        for change in changes:
            events = [{**e, **change} if k == at else e for k, e in enumerate(nominal)]
            interpreter, monitor = Interpreter(text), Monitor(found)
            rejected = next((k for k, e in enumerate(events) if interpreter.step(e) == "false"), None)
            faults = [monitor.step(e) for e in events]
            guarantees = {g.name for g in case.contract.node("agent").guarantees}
            reported = next((k for k, f in enumerate(faults) if any(v.clause in guarantees for v in f)), None)
            assert rejected == reported, (at, change)
            differing += rejected is not None
    assert differing >= 5


GOOD = """
// a comment
ev(x) matches {topic: 'r', data: x} | {topic: 'r', data: {data: x}}
  with (x >= 0 && x < 12.5);
t matches {topic: 'r'};
G<a> = (empty \\/ {let x; ev(x) G<max(x, a)>} \\/ (t G<(0 - 3)>));
Main = (t >> G<0>);
"""


def test_the_grammar_accepts_what_the_writer_writes() -> None:
    read(GOOD)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("Main =", "main ="),
        ("Main =", "Other ="),
        ("G<0>", "G<0, 1>"),
        ("G<0>", "H<0>"),
        ("G<max(x, a)>", "G<y>"),
        ("ev(x) G", "ev G"),
        ("max(x, a)", "max(x)"),
        ("max(x, a)", "max(x, b)"),
        ("ev(x) G", "unknown(x) G"),
        ("'r', data: x", "'it's', data: x"),
        ("data: x}", "data: y}"),
        ("x < 12.5", "y < 12.5"),
        ("0 - 3", "0 - "),
        ("t matches {topic: 'r'};", "t matches {topic: 'r'}"),
        ("t matches {topic: 'r'};", "t matches {topic: 'r'}; t matches {topic: 's'};"),
        ("t matches {topic: 'r'};", "Upper matches {topic: 'r'};"),
        ("{let x;", "{let a;"),
        ("data: x", "Data: x"),
        ("data: x", "data: -3"),
    ],
)
def test_the_grammar_and_its_checks_refuse(old: str, new: str) -> None:
    assert old in GOOD
    with pytest.raises(Malformed):
        read(GOOD.replace(old, new, 1))


SMALL = """
context {{ Colour : {{red, green}}; }}
node n {{
  inputs( r : REAL, s : STRING, c : Colour )
  outputs( o : REAL )
  topics( a/R r matches(in.r), a/S s matches(in.s), a/C c matches(in.c), a/O o matches(out.o) )
  guarantee g ( {formula} )
}}
"""


@pytest.mark.parametrize(
    ("formula", "mapping", "words"),
    [
        ("out.o == in.r + 1", {"in.r": "data", "out.o": "data"}, "calculates with REAL"),
        ('out.o > 0 or in.s == "x"', {"in.s": "data", "out.o": "data"}, "is a string"),
        ("exists(x in REAL | x > in.r and x < out.o)", {"in.r": "data", "out.o": "data"}, "nothing fixes x"),
        ("out.o == in.r", {"in.r": "Data", "out.o": "data"}, "no field name 'Data'"),
        ("out.o == in.r", {"in.r": "with", "out.o": "data"}, "no field name 'with'"),
        ("out.o == in.r", {"in.r": "a b", "out.o": "data"}, "no field name 'a b'"),
        ("out.o == in.r", {"in.r": "x'} | {y", "out.o": "data"}, "no field name"),
        (
            "out.o > 0 or in.c == red",
            {"out.o": "data", "in.c": {"field": "c", "values": {"r'}; Main = all; //": "red"}}},
            "no string constant",
        ),
        ("out.o > 0.3333333333333333333", {"out.o": "data"}, "no decimal of fifteen digits"),
    ],
)
def test_refused_never_approximated(
    make_system: Callable[..., System], formula: str, mapping: dict[str, object], words: str
) -> None:
    made = rml_of(make_system(SMALL.format(formula=formula), mapping), "n")
    assert words in made.refused["g"]
    assert "Main = any*;" in made.text
    read(made.text)


def test_unfolding_is_bounded(make_system: Callable[..., System]) -> None:
    many = " or ".join(f"(out.o > {k} and in.r < {k})" for k in range(400))
    made = rml_of(make_system(SMALL.format(formula=many), {"in.r": "data", "out.o": "data"}), "n")
    assert "more than" in made.refused["g"]


def test_comments_hold_whatever_a_sentence_holds(make_system: Callable[..., System]) -> None:
    """A plan that holds an end of a line that nobody sees is refused; what came by another way ends no comment."""
    system = make_system(SMALL.format(formula="out.o == in.r"), {"in.r": "weird*/ 'x'", "out.o": "data"})
    node, given = system.contract.node("n"), system.plan.node("n").methods[0].options
    told = json.dumps(given.data)
    assert "weird" in told
    known, faults = setup(system, node, replace(given, data=json.loads(told.replace("weird", r"we\u2028ird"))))
    assert faults == ()
    made = translate(known, node.guarantees)
    for line in made.text.splitlines():
        assert line == "" or line.startswith(("//", "Main = any*;"))


def test_names_that_the_file_itself_uses_stay_apart(make_system: Callable[..., System]) -> None:
    rcl = """
node n {
  inputs( last : REAL, set : REAL, last_set : REAL )
  outputs( main : REAL, fresh : REAL )
  topics( a/R a matches(in.last), a/R b matches(in.set), a/R c matches(in.last_set), a/O d matches(out.main),
          a/O relevant matches(out.fresh) )
  guarantee main ( out.main > in.last or out.fresh > in.set or in.last_set > 0 )
  guarantee Main ( out.main > 0 )
}
"""
    ports = ("in.last", "in.set", "in.last_set", "out.main", "out.fresh")
    made = rml_of(make_system(rcl, {**dict.fromkeys(ports, "data"), "in.set": ["set"]}), "n")
    assert not made.refused
    interpreter = Interpreter(made.text)
    messages = [("a", 5), ("c", 0), ("d", 1), ("relevant", 0)]
    events = [{"topic": "b", "set": 3}, *({"topic": topic, "data": value} for topic, value in messages)]
    assert [interpreter.step(event) for event in events] == [*["currently_true"] * 4, "false"]


def test_primes_in_names_are_no_part_of_the_text(make_system: Callable[..., System]) -> None:
    rcl = """
node n' {
  inputs( x' : REAL, x'' : REAL )
  outputs( y' : BOOL )
  topics( a/R a matches(in.x'), a/R b matches(in.x''), a/O c matches(out.y') )
  guarantee g ( out.y' <=> in.x' < in.x'' )
}
"""
    mapping = {"in.x'": "data", "in.x''": "data", "out.y'": "data"}
    made = rml_of(make_system(rcl, mapping), "n'")
    assert not made.refused
    read(made.text)
    assert made.text.count("x'") == 0
