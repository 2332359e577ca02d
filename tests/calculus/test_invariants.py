"""Invariants that nobody wrote down: what is proved by one, and that it is shown like any other claim."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from random import Random

import pytest
from helpers import some

from avow.base.codec import from_json, to_json
from avow.base.verdict import Outcome, Verdict
from avow.calculus.certificates import Certificates, requirement_scope
from avow.calculus.composition import compose
from avow.calculus.discharge import Bounds
from avow.calculus.finder import Hint
from avow.calculus.induction import read, write
from avow.calculus.variables import frame, system_variable
from avow.calculus.wiring import wiring
from avow.kernel.certificate import Certificate
from avow.kernel.statements import Claimed
from avow.language.sorts import INTEGER, REAL
from avow.language.terms import Compare, Literal
from avow.solving.invariants import invariant

from .make import make, node, outcomes

Port = tuple[str, str, str]


def loop(ports: list[Port], *clauses: str) -> tuple[str, str]:
    """A node whose outputs it reads itself, a step later: name, type, first value."""
    text = node(
        "c",
        ", ".join(f"l{name} : {sort}" for name, sort, _ in ports),
        ", ".join(f"{name} : {sort}" for name, sort, _ in ports),
        *clauses,
    )
    edges = [f"{{from: c.{n}, to: c.l{n}, delayed: true, initial: '{first}'}}" for n, _, first in ports]
    return text, f"connections: [{', '.join(edges)}]\n"


def required(folder: Path, made: tuple[str, str], claim: str, more: str = "") -> Outcome:
    text, plan = made
    return outcomes(make(folder, text, f"{plan}{more}requirements: {{R: {{text: test, formula: '{claim}'}}}}\n"))["R"]


def adding(first: str, sort: str = "INTEGER") -> tuple[str, str]:
    return loop([("x", sort, first), ("y", sort, first)], "G gx: out.x == in.lx + in.ly", "G gy: out.y == in.ly")


STAYS = loop([("n", "INTEGER", "0")], "G: (in.ln < 5 -> out.n == 0) and (in.ln >= 5 -> out.n == in.ln + 1)")
PAIR = loop(
    [("x", "NATURAL", "0"), ("y", "NATURAL", "0")],
    "G: (out.x == in.lx + 1 and out.y == in.ly + 1) or (out.x == 0 and out.y == 0)",
)
MODES = loop(
    [("m", "BOOL", "TRUE"), ("v", "REAL", "0")], "G: out.m <=> not in.lm", "G: out.v == (if in.lm then 1 else 0)"
)
DECAY = loop([("x", "REAL", "1"), ("y", "REAL", "2")], "G: 2 * out.x == in.lx + in.ly", "G: out.y == in.ly")
TANK = node(
    "tank", "flow : REAL, last : REAL", "level : REAL", "A slow: abs(in.flow) <= 1", "G: out.level == in.last + in.flow"
) + node(
    "valve",
    "level : REAL",
    "flow : REAL",
    "G: out.flow == (if in.level > 5 then -1 else (if in.level < 4 then 1 else 0))",
)
TANK_PLAN = """connections:
  - {from: tank.level, to: tank.last, delayed: true, initial: "4"}
  - {from: tank.level, to: valve.level, delayed: true, initial: "4"}
"""


@pytest.mark.parametrize(
    ("made", "claim", "verdict"),
    some(
        [
            (adding("0"), "c.x >= 0", Verdict.PROVED),
            (adding("1", "REAL"), "c.x >= 0", Verdict.PROVED),
            (adding("-1"), "c.x >= -9", Verdict.REFUTED),
            (STAYS, "c.n < 9", Verdict.PROVED),
            (STAYS, "c.n != 12", Verdict.PROVED),
            (PAIR, "c.x == c.y", Verdict.PROVED),
            (PAIR, "c.x < 3", Verdict.REFUTED),
            (MODES, "c.v <= 2", Verdict.PROVED),
            (MODES, "c.v < 1", Verdict.REFUTED),
            (DECAY, "c.x < 2", Verdict.PROVED),
            (DECAY, "c.x < 1.9", Verdict.REFUTED),
            ((TANK, TANK_PLAN), "tank.level <= 6", Verdict.PROVED),
            ((TANK, TANK_PLAN), "tank.level >= 3", Verdict.PROVED),
        ],
        7,
        slow=6,
    ),
)
def test_known_answers(tmp_path: Path, made: tuple[str, str], claim: str, verdict: Verdict) -> None:
    found = required(tmp_path, made, claim)
    assert found.verdict is verdict, found.summary
    if verdict is Verdict.PROVED:
        assert "certificate" in found.details


def test_the_invariant_is_told(tmp_path: Path) -> None:
    found = required(tmp_path, adding("0"), "c.x >= 0")
    assert found.details["invariants"]
    assert "by an invariant that was found: " in found.summary


@pytest.mark.slow
def test_a_run_is_looked_for_where_there_is_one(tmp_path: Path) -> None:
    """Further than runs are looked for otherwise."""
    found = required(tmp_path, adding("1"), "c.x <= 30")
    assert found.verdict is Verdict.REFUTED
    assert found.counterexample is not None
    assert len(found.counterexample.trace) == 30


def test_what_is_remembered_is_told_by_its_record(tmp_path: Path) -> None:
    a = node("a", "e : BOOL", "x : BOOL", "G keep: once(in.e) -> out.x")
    found = required(tmp_path, (a, ""), "historically(not a.e) or a.x")
    assert found.summary.endswith("by an invariant that was found: once(in.e) <=> not historically(not in.e)")


def test_a_proof_that_rests_on_what_does_not_stand_says_so(tmp_path: Path) -> None:
    text, plan = adding("0")
    use = node("use", "x : INTEGER", "z : INTEGER", "A pos: in.x > 0", "G up: out.z >= in.x")
    apart = node("apart", "y : INTEGER", "", "A big: in.y > 9")
    last = node("last", "z : INTEGER", "", "A pos: in.z > 0")
    system = make(tmp_path, text + use + apart + last, plan + "requirements: {R: {text: t, formula: 'use.z > 0'}}\n")
    found = outcomes(system)
    of_all, of_one = found["R"], found["whole.last.pos"]
    assert {of_all.verdict, of_one.verdict} == {Verdict.UNKNOWN}
    assert of_all.summary.endswith("nothing may rest on them: whole.use.pos, whole.apart.big")
    assert of_one.summary.endswith("nothing may rest on them: whole.use.pos"), (
        "what does not reach it changes no answer"
    )
    assert "invariant" not in of_all.summary


def test_an_assumption_is_shown_by_an_invariant(tmp_path: Path) -> None:
    text, plan = adding("0")
    use = node("use", "x : INTEGER", "", "A pos: in.x >= 0")
    found = outcomes(make(tmp_path, text + use, plan))["whole.use.pos"]
    assert found.verdict is Verdict.PROVED, found.summary
    assert found.details["invariants"]
    worse = use.replace("in.x >= 0", "in.x > 0")
    assert outcomes(make(tmp_path / "worse", text + worse, plan))["whole.use.pos"].verdict is Verdict.REFUTED


def test_memories_that_say_the_same_in_other_words(tmp_path: Path) -> None:
    a = node("a", "e : BOOL", "x : BOOL", "G keep: once(in.e) -> out.x")
    found = required(tmp_path, (a, ""), "historically(not a.e) or a.x")
    assert found.verdict is Verdict.PROVED, found.summary
    assert required(tmp_path / "no", (a, ""), "historically(not a.x) or a.e").verdict is Verdict.REFUTED


def requiring(folder: Path, formula: str) -> Certificates:
    text, plan = adding("0")
    return compose(make(folder, text, f"{plan}requirements: {{R: {{text: t, formula: '{formula}'}}}}\n")).certificates


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    """With the certificate of a requirement that an invariant shows."""
    made = requiring(tmp_path_factory.mktemp("found"), "c.x >= 0")
    lemma = ("v0 >= 0 and v1 >= 0", "out.c.x", "out.c.y")
    assert made.requirement("R", Hint(()), Bounds(), (lemma,)) is not None
    return made


@pytest.fixture(scope="module")
def other(tmp_path_factory: pytest.TempPathFactory) -> Certificates:
    """Of a requirement that no invariant shows."""
    return requiring(tmp_path_factory.mktemp("other"), "c.x != 7")


def test_a_certificate_has_the_invariant_as_a_claim_of_its_own(found: Certificates) -> None:
    scope = requirement_scope("R")
    kept = from_json(Certificate, to_json(found.made[scope]))
    assert kept == found.made[scope]
    assert kept.lemmas
    again = Certificates(found.composition, {scope: kept})
    assert again.kept_for(scope, Claimed.REQUIREMENT, "R") is not None


@pytest.mark.parametrize(
    "lemma",
    [
        ("v0 >= 1 and v1 >= 0", "out.c.x", "out.c.y"),  # false at the first step
        ("v0 >= 0", "out.c.x"),  # not kept
        ("v0 >= 0 and v1 >= 0", "out.c.x", "in.c.ly"),  # of another value
        ("v0 >= 0 and v1 >= 0", "out.c.x", "out.c.z"),  # of what is not there
        ("v0 >= 0 and", "out.c.x"),
        ("FALSE",),
    ],
)
def test_another_formula_in_its_place_shows_nothing(
    found: Certificates, other: Certificates, lemma: tuple[str, ...]
) -> None:
    scope = requirement_scope("R")
    forged = Certificates(found.composition, {scope: replace(found.made[scope], lemmas=(lemma,))})
    assert forged.kept_for(scope, Claimed.REQUIREMENT, "R") is None
    assert other.requirement("R", Hint(()), Bounds(), (lemma,)) is None, "no false help"


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    text, plan = adding("0")
    of = frame(make(tmp_path, text, plan))
    term = Compare("<=", system_variable("c.x", INTEGER), Literal(3, INTEGER))
    written = write(of, term)
    assert written == ("v0 <= 3", "out.c.x")
    again = read(written, of.system.contract, wiring(of))
    assert again is not None
    assert "c.x" in repr(again)


def test_the_search_is_the_same_every_time() -> None:
    """Steps bound it and no clock; the answer hangs neither on the order of sets nor on what was asked before."""
    x, y = (system_variable(f"c.{name}", REAL) for name in "xy")
    before = {system_variable(f"c.{name}@before", REAL): system_variable(f"c.{name}", REAL) for name in "xy"}
    zero = Literal(Fraction(0), REAL)
    bx, by = before
    begins = [Compare("==", bx, zero), Compare("==", by, zero)]
    step = [Compare("<=", bx, x), Compare("==", y, by)]
    found = [invariant([*begins, *step], step, [*step, Compare("<", x, zero)], before, 500) for _ in range(3)]
    assert found[0].invariant is not None
    assert found[0] == found[1] == found[2]


CLAIMS = ("c.x >= 0", "c.x <= {0}", "c.x != {0}", "c.x <= c.y", "c.x + c.y >= 0", "c.m or c.x <= {0}")


def drawn(random: Random) -> tuple[tuple[str, str], str, list[tuple[bool, int, int, int, bool]]]:
    """A system of two numbers and a mode, which follows one of two rules by its mode; and a claim."""
    rules = [
        (random.choice([0, 1, -1]), random.choice([0, 1]), random.randint(-1, 2), random.random() < 0.5) for _ in "ab"
    ]
    ports = [("x", "INTEGER", "0"), ("y", "INTEGER", "1"), ("m", "BOOL", "TRUE")]
    clauses = []
    for when, (a, b, c, flips) in zip(("in.lm", "not in.lm"), rules, strict=True):
        clauses.append(f"G: {when} -> (out.x == {a} * in.lx + {b} * in.ly + {c} and (out.m <=> {'not ' * flips}in.lm))")
    clauses.append(f"G: out.y == {random.choice(['in.ly', 'in.lx', 'in.ly + 1'])}")
    claim = random.choice(CLAIMS).format(random.randint(-2, 5))
    return loop(ports, *clauses), claim, [(k == 0, *rule) for k, rule in enumerate(rules)]


def states(clauses: str, rules: list[tuple[bool, int, int, int, bool]], count: int) -> list[dict[str, object]]:
    """The system's one run, worked out apart from Avow."""
    x, y, m = 0, 1, True
    found: list[dict[str, object]] = []
    for _ in range(count):
        _, a, b, c, flips = next(rule for rule in rules if rule[0] is m)
        x, y, m = (
            a * x + b * y + c,
            (y + 1 if "out.y == in.ly + 1" in clauses else x if "out.y == in.lx" in clauses else y),
            m != flips,
        )
        found.append({"x": x, "y": y, "m": m})
    return found


def compared(folder: Path, seeds: range) -> int:
    """How many claims are proved. Asserts that none is false, and that what is refuted is."""
    count = 0
    for seed in seeds:
        made, claim, rules = drawn(Random(seed))
        found = required(folder / str(seed), made, claim)
        run = states(made[0], rules, 60)
        true = [eval(claim.replace("c.", ""), {}, dict(state)) for state in run]
        if found.verdict is Verdict.PROVED:
            assert all(true), (seed, claim)
            count += 1
        elif found.verdict is Verdict.REFUTED:
            assert not all(true), (seed, claim)
    return count


@pytest.mark.slow
def test_nothing_proved_is_false(tmp_path: Path) -> None:
    assert compared(tmp_path, range(8)) > 1


@pytest.mark.nightly
def test_nothing_proved_is_false_at_length(tmp_path: Path) -> None:
    assert compared(tmp_path, range(100, 400)) > 80
