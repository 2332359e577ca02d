"""RML texts: golden files, our grammar's refusals, names that could do harm, and guarantees that are refused."""

from __future__ import annotations

import json
import os
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
from avow.system.plan import System

GOLDEN = Path(__file__).parent / "golden"


def rml_of(system: System, name: str) -> Translation:
    node = system.contract.node(name)
    methods = system.plan.node(name).methods
    found, faults = setup(system, node, methods[0].options if methods else None)
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
            interpreter, monitor = Interpreter(text), Monitor(found, solver=False)
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
both matches t | any;
G<a> = (empty \\/ {let x; ev(x) G<x>} \\/ (t G<(0 - 3)>));
Main = (both >> G<0>);
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
        ("G<x>", "G<y>"),
        ("ev(x) G", "ev G"),
        ("ev(x) G", "unknown(x) G"),
        ("'r', data: x", "'it's', data: x"),
        ("data: x}", "data: y}"),
        ("x < 12.5", "y < 12.5"),
        ("0 - 3", "0 - "),
        ("t matches {topic: 'r'};", "t matches {topic: 'r'}"),
        ("t matches {topic: 'r'};", "t matches {topic: 'r'}; t matches {topic: 's'};"),
        ("t matches {topic: 'r'};", "Upper matches {topic: 'r'};"),
        ("both matches t | any;", "both matches t | nothing;"),
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
