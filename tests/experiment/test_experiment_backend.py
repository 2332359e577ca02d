"""Runs judged by the guarantee's own formula: what they show, what they do not, and what is told of bad input."""

from __future__ import annotations

import csv
import io
import random
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.assurance.rates import sample
from avow.backend_kit.protocol import Job, Limits
from avow.backends.experiment import BACKEND
from avow.base.verdict import Link, Outcome, Verdict
from avow.conformance.seeded import Seeded

ROOT = Path(__file__).resolve().parents[2] / "contracts"

RCL = """context {{ Tolerance = 0.25; Kind : {{human, dog}}; At : REAL x REAL --> BOOL;
  Command : {{ move(REAL, REAL), inspect(NATURAL) }}; }}
node n {{
  inputs( speed : REAL, person : BOOL, kind : Kind, command : Command, last : At )
  outputs( distance : REAL, detected : BOOL, seen : Kind, at : At )
  topics()
  {assume}
  guarantee g ( {guarantee} )
}}
"""
BRAKES = "in.speed >= 5 -> out.distance <= 3"
DETECTS = "in.person <=> out.detected"


def job(folder: Path, guarantee: str, table: str, assume: str = "", criticality: str = "medium", **options: Any) -> Job:
    text = RCL.format(guarantee=guarantee, assume=assume)
    seeded = Seeded("s", text, {"data": "runs.csv", **options}, {"g": Verdict.TESTED}, {"runs.csv": table})
    made = seeded.written(BACKEND, folder)
    (node,) = made.system.plan.nodes
    plan = replace(made.system.plan, nodes=(replace(node, criticality=criticality),))
    return replace(made, system=replace(made.system, plan=plan))


def settle(asked: Job) -> Outcome:
    (outcome,) = BACKEND.discharge(asked, asked.root, Limits()).outcomes
    return outcome


def rows(columns: str, *cells: str) -> str:
    """A table with the column `run` before the others."""
    return f"run,{columns}\n" + "".join(f"{n},{line}\n" for n, line in enumerate(cells, 1))


BRAKING = {"mapping": {"in.speed": "v", "out.distance": "d"}}
DETECTION = {"mapping": {"in.person": "person", "out.detected": "found"}}


# -- what counts as a trial -------------------------------------------------------------------------------------------


def test_runs_that_do_not_meet_the_trigger_show_nothing(tmp_path: Path) -> None:
    """40 brakings at 1 m/s say nothing of braking at 5 m/s."""
    outcome = settle(job(tmp_path, BRAKES, rows("v,d", *["1,0.2"] * 40), **BRAKING))
    assert (outcome.verdict, outcome.vacuous) == (Verdict.TESTED, True)
    assert "in none of 40 runs was its condition met" in outcome.summary
    assert not sample_of(outcome)


def test_the_rate_is_of_triggered_runs(tmp_path: Path) -> None:
    outcome = settle(job(tmp_path, BRAKES, rows("v,d", *["1,9"] * 88, *["5,2"] * 17), **BRAKING))
    assert outcome.verdict is Verdict.TESTED
    assert outcome.summary == "17 triggered runs of 105, 0 failed: at most 16.2 % fail at 95 % confidence"
    assert [(s.trials, s.failures) for s in sample_of(outcome)] == [(17, 0)]


@pytest.mark.parametrize("guarantee", [DETECTS, "in.person -> out.detected", "not in.person or out.detected"])
def test_a_detector_without_recall_is_refuted_however_many_empty_frames_there_are(
    tmp_path: Path, guarantee: str
) -> None:
    frames = rows("person,found", *["yes,no"] * 20, *["no,no"] * 380)
    assert settle(job(tmp_path, guarantee, frames, **DETECTION)).verdict is Verdict.REFUTED
    claimed = settle(job(tmp_path, guarantee, frames, at_least=0.9, **DETECTION))
    assert claimed.verdict is Verdict.REFUTED, claimed.summary
    assert claimed.bound["failure probability at most"] == 1.0


def test_each_direction_of_an_equivalence_has_its_own_bound(tmp_path: Path) -> None:
    frames = rows("person,found", *["yes,yes"] * 20, *["no,no"] * 380)
    outcome = settle(job(tmp_path, DETECTS, frames, **DETECTION))
    assert sorted(s.trials for s in sample_of(outcome)) == [20, 380]
    assert {s.confidence for s in sample_of(outcome)} == {"0.975"}
    assert "worst of 2 strata" in outcome.summary
    assert "0 of 20 failed" in outcome.summary
    assert "0 of 20 failed" in str(outcome.bound["worst stratum"])
    never = settle(job(tmp_path / "never", DETECTS, rows("person,found", *["no,no"] * 380), **DETECTION))
    assert never.vacuous


CASES = {
    "(in.speed > 10 or in.person) -> out.detected": ["in.speed > 10", "in.person"],
    "not in.person and in.speed <= 10 or out.detected": ["in.speed > 10", "in.person"],
    "in.person and (in.speed > 10 or in.kind == dog) -> out.detected": ["in.speed > 10", "in.kind == dog"],
    "out.distance == (if in.person then 1 else 2)": ["in.person", "not in.person"],
    "out.distance <= 1 + (if in.person then 1 else if in.speed > 10 then 2 else 3)": [
        "in.person",
        "not in.person and in.speed > 10",
        "not in.person and in.speed <= 10",
    ],
    "out.distance <= max(in.speed, 3)": ["in.speed > 3", "in.speed <= 3"],
    "out.seen == (if in.person then human else in.kind)": ["in.person", "not in.person"],
    "in.speed > 10 -> out.distance <= (if in.person then 1 else 2)": [
        "in.speed > 10 and in.person",
        "in.speed > 10 and not in.person",
    ],
}


@pytest.mark.parametrize("guarantee", CASES)
def test_each_case_and_each_way_to_meet_a_condition_has_its_own_bound(tmp_path: Path, guarantee: str) -> None:
    """Data that leave one of them out show nothing; all of them together are counted one by one."""
    mapping = {"in.speed": "v", "in.person": "p", "in.kind": "k", "out.distance": "d", "out.detected": "f"}
    mapping |= {"out.seen": "s"}

    def cell(speed: int, person: bool, kind: str) -> str:
        distance = "1" if person else "2" if speed > 10 or "1 else 2" in guarantee else "3"
        return f"{speed},{person},{kind},{distance},true,{'human' if person else kind}".lower()

    every = [(v, p, k) for v in (1, 20) for p in (False, True) for k in ("human", "dog")]
    asked = [part.replace("in.kind == dog", "k == 'dog'") for part in CASES[guarantee]]
    asked = [part.replace("in.speed", "v").replace("in.person", "p") for part in asked]
    met = [{one for one in every if eval(part, {}, dict(zip("vpk", one, strict=True)))} for part in asked]
    base = {"guarantee": guarantee, "mapping": mapping}
    for at, part in enumerate(met):
        without = rows("v,p,k,d,f,s", *(cell(*one) for one in every if one not in part for _ in range(30)))
        assert settle(job(tmp_path / str(at), table=without, **base)).vacuous
    whole = rows("v,p,k,d,f,s", *(cell(*one) for one in every for _ in range(30)))
    outcome = settle(job(tmp_path / "all", table=whole, **base))
    assert (outcome.verdict, outcome.vacuous) == (Verdict.TESTED, False), outcome.summary
    trials = [s.trials for s in sample_of(outcome)]
    wide = "in.person and (" in guarantee  # a part of the condition that is no choice holds in each way
    assert sorted(trials) == sorted(30 * len({o for o in part if o[1] or not wide}) for part in met)


@pytest.mark.parametrize("guarantee", ["out.distance == (if in.person then 1 else 2)", DETECTS])
def test_a_case_that_the_assumptions_exclude_is_not_asked_for(tmp_path: Path, guarantee: str) -> None:
    table = rows("p,d,f", *["yes,1,yes"] * 47)
    mapping = {"in.person": "p", "out.distance": "d", "out.detected": "f"}
    asked = {"guarantee": guarantee, "table": table, "mapping": mapping}
    assert settle(job(tmp_path / "a", **asked)).vacuous
    outcome = settle(job(tmp_path / "b", assume="assume someone ( in.person )", **asked))
    assert [s.trials for s in sample_of(outcome)] == [47]


def test_a_confidence_is_never_said_to_be_more_than_it_is(tmp_path: Path) -> None:
    for confidence in ("0.95", "0.9999999", "0.99999999999", "19/20"):
        asked = job(
            tmp_path / confidence.replace("/", "-"),
            "out.detected",
            rows("f", *["yes"] * 300),
            mapping={"out.detected": "f"},
            confidence=confidence,
        )
        said = settle(asked).summary.partition(" fail at ")[2].partition(" % ")[0]
        assert Fraction(said) / 100 <= Fraction(confidence)


def test_yes_and_no_trials_count_each(tmp_path: Path) -> None:
    outcome = settle(job(tmp_path, "out.detected", rows("found", *["yes"] * 47), mapping={"out.detected": "found"}))
    assert outcome.summary == "47 runs, 0 failed: at most 6.18 % fail at 95 % confidence"


def test_a_column_of_noise_changes_nothing(tmp_path: Path) -> None:
    cells, source = [*["5,2"] * 30, *["1,9"] * 10], random.Random(3)
    plain = settle(job(tmp_path / "a", BRAKES, rows("v,d", *cells), **BRAKING))
    noisy = settle(job(tmp_path / "b", BRAKES, rows("v,d,n", *(f"{c},{source.random()}" for c in cells)), **BRAKING))
    assert replace(plain, obligation="") == replace(noisy, obligation="")


def test_runs_that_break_an_assumption_are_no_trials_and_are_counted(tmp_path: Path) -> None:
    slow = "assume slow ( in.speed <= 20 )"
    data = rows("v,d", *["5,2"] * 20, *["25,9"] * 4)
    outcome = settle(job(tmp_path, BRAKES, data, slow, **BRAKING))
    assert outcome.verdict is Verdict.TESTED
    assert "20 triggered runs of 24 (4 broke an assumption), 0 failed" in outcome.summary
    none = settle(job(tmp_path / "none", BRAKES, rows("v,d", *["25,9"] * 4), slow, **BRAKING))
    assert none.vacuous
    assert "each breaks an assumption" in none.summary


def test_an_assumption_that_is_not_in_the_data_is_supposed_of_each_run(tmp_path: Path) -> None:
    outcome = settle(job(tmp_path, BRAKES, rows("v,d", *["5,2"] * 20), "assume a ( in.person )", **BRAKING))
    assert any("each run meets the assumptions a" in text for text in outcome.hypotheses)


# -- the verdict ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("criticality", "number"), [("high", 29), ("medium", 14), ("low", 5)])
def test_the_least_success_rate_follows_from_the_criticality(tmp_path: Path, criticality: str, number: int) -> None:
    for made, verdict in ((number - 1, Verdict.UNKNOWN), (number, Verdict.TESTED)):
        data = rows("v,d", *["5,2"] * made)
        outcome = settle(job(tmp_path / f"{made}", BRAKES, data, criticality=criticality, **BRAKING))
        assert outcome.verdict is verdict, outcome.summary
        assert verdict is Verdict.TESTED or f"{number} runs without a failure would" in outcome.summary


@pytest.mark.parametrize(("distance", "holds"), [("3", True), ("3.0000001", False), ("2.9", True)])
def test_one_failing_run_refutes_exactly_and_is_shown(tmp_path: Path, distance: str, holds: bool) -> None:
    outcome = settle(job(tmp_path, BRAKES, rows("v,d", *["5,2"] * 46, f"5,{distance}"), **BRAKING))
    assert outcome.verdict is (Verdict.TESTED if holds else Verdict.REFUTED)
    if not holds:
        assert outcome.summary == "47 runs, 1 failed"
        assert outcome.counterexample is not None
        assert dict(outcome.counterexample.values) == {"run": "47", "in.speed": "5", "out.distance": distance}


def test_a_claimed_rate_allows_failures_only_as_far_as_the_runs_show_it(tmp_path: Path) -> None:
    data = rows("v,d", *["5,2"] * 46, "5,9")
    good = settle(job(tmp_path, BRAKES, data, at_least=0.9, **BRAKING))
    assert good.verdict is Verdict.TESTED
    assert "statistically" in " ".join(good.hypotheses)
    assert [s.failures for s in sample_of(good)] == [1]
    assert settle(job(tmp_path, BRAKES, data, at_least=0.95, **BRAKING)).verdict is Verdict.REFUTED
    few = settle(job(tmp_path, BRAKES, rows("v,d", *["5,2"] * 28), at_least=0.9, **BRAKING))
    assert few.verdict is Verdict.UNKNOWN


def test_of_strata_the_worst_counts_and_they_share_the_confidence(tmp_path: Path) -> None:
    data = rows("v,d,floor", *["5,2,dry"] * 200, *["5,2,wet"] * 20)
    outcome = settle(job(tmp_path, BRAKES, data, strata="floor", **BRAKING))
    by_name = {s.name: s for s in sample_of(outcome)}
    assert {name: (s.trials, s.confidence) for name, s in by_name.items()} == {
        "floor = dry": (200, "0.975"),
        "floor = wet": (20, "0.975"),
    }
    assert outcome.bound["failure probability at most"] == float(by_name["floor = wet"].bound)
    assert Fraction(by_name["floor = dry"].bound) < Fraction(1, 50) < Fraction(by_name["floor = wet"].bound)
    failing = rows("v,d,floor", *["5,2,dry"] * 400, *["5,2,wet"] * 10, *["5,9,wet"] * 10)
    assert settle(job(tmp_path, BRAKES, failing, at_least=0.9, **BRAKING)).verdict is Verdict.TESTED
    assert settle(job(tmp_path, BRAKES, failing, at_least=0.9, strata="floor", **BRAKING)).verdict is Verdict.REFUTED
    untried = rows("v,d,floor", *["5,2,dry"] * 400, *["1,2,wet"] * 10)
    assert settle(job(tmp_path, BRAKES, untried, strata="floor", **BRAKING)).verdict is Verdict.UNKNOWN


@pytest.mark.parametrize("change", ["deleted", "renamed", "corrected", "looser", "another column"])
def test_a_failing_run_is_not_forgotten_by_deleting_it(tmp_path: Path, change: str) -> None:
    """Whoever leaves it out says so, and why; that is then an assumption."""
    good = ["5,2"] * 46
    first = job(tmp_path / "first", BRAKES, rows("v,d", *good, "5,9"), **BRAKING)
    refuted = settle(first)
    assert refuted.verdict is Verdict.REFUTED
    case = refuted.details["case"]
    data, guarantee, options, wanted = rows("v,d", *good), BRAKES, dict[str, Any](BRAKING), Verdict.UNKNOWN
    match change:
        case "renamed":
            data += "x,5,9\n"
            options["at_least"] = 0.8
        case "corrected":
            data += "47,5,2\n"
        case "looser":
            guarantee, wanted = BRAKES.replace("3", "10"), Verdict.TESTED
        case "another column":
            data, options["mapping"] = data.replace("v,d", "v,e"), {"in.speed": "v", "out.distance": "e"}

    def settled(**more: Any) -> Outcome:
        asked = job(tmp_path / "again", guarantee, data, **options, **more)
        return settle(replace(asked, kept={o.id: (case,) for o in asked.obligations}))

    outcome = settled()
    assert outcome.verdict is wanted, outcome.summary
    if wanted is Verdict.UNKNOWN:
        assert "missing in the data: 47; put them back" in outcome.summary
        for run, expected in ((47, Verdict.TESTED), (46, Verdict.UNKNOWN)):
            told = settled(left_out={"runs": [run], "because": "it hit the door"})
            assert told.verdict is expected
            assert (
                expected is Verdict.UNKNOWN or "that run 47 failed does not count: it hit the door" in told.hypotheses
            )


def test_a_failing_run_that_is_still_there_says_nothing_new(tmp_path: Path) -> None:
    first = job(tmp_path / "a", BRAKES, rows("v,d", "5,9", *["5,2"] * 20), at_least=0.9, **BRAKING)
    refuted = settle(first)
    more = job(tmp_path / "b", BRAKES, rows("v,d", "5,9", *["5,2"] * 70), at_least=0.9, **BRAKING)
    kept = {o.id: (refuted.details["case"],) for o in more.obligations}
    assert settle(replace(more, kept=kept)).verdict is Verdict.TESTED


# -- runs of several steps --------------------------------------------------------------------------------------------

WITHIN = "in.person -> within[2 steps](out.detected)"


def runs_of(*runs: str) -> str:
    """Each run as ``10 01``: a step a word, whether a person is there and whether it was found."""
    return "run,person,found\n" + "".join(
        f"{n},{step[0]},{step[1]}\n" for n, run in enumerate(runs) for step in run.split()
    )


def test_a_run_of_several_steps_is_one_trial(tmp_path: Path) -> None:
    data = runs_of(*["10 00 01 00"] * 20, *["00 00 00"] * 5)
    outcome = settle(job(tmp_path, WITHIN, data, steps=True, **DETECTION))
    assert outcome.summary.startswith("20 triggered runs of 25, 0 failed")
    late = settle(job(tmp_path, WITHIN, data + "99,1,0\n99,0,0\n99,0,0\n", steps=True, **DETECTION))
    assert late.verdict is Verdict.REFUTED
    assert late.counterexample is not None
    assert len(late.counterexample.trace) == 3


def test_a_run_that_ends_before_its_answer_is_due_is_no_trial_and_named(tmp_path: Path) -> None:
    some = runs_of(*["10 00 01 00"] * 20, "10 00", "10 01", "10 00 01 10")
    told = settle(job(tmp_path / "some", WITHIN, some, steps=True, **DETECTION))
    assert told.summary.startswith("21 triggered runs of 23, 0 failed")
    assert told.bound["runs that end before an answer"] == 2
    assert "an answer would be in time and right in runs that end before it: 20, 22" in told.hypotheses
    outcome = settle(job(tmp_path, WITHIN, runs_of(*["10 00"] * 30), steps=True, **DETECTION))
    assert outcome.vacuous
    assert outcome.summary.endswith("in.person → within[2 steps](out.detected) is due before the run ends")


def test_what_speaks_of_other_steps_asks_for_runs(tmp_path: Path) -> None:
    asked = job(tmp_path, "previous(in.person, FALSE) -> out.detected", runs_of("10"), **DETECTION)
    assert any("steps: true" in (d.hint or "") for d in BACKEND.check(asked))
    assert settle(asked).verdict is Verdict.ERROR


def test_a_run_ends_with_the_first_step_that_breaks_an_assumption(tmp_path: Path) -> None:
    assume, data = (
        "assume a ( in.speed <= 20 )",
        "run,v,d\n" + "".join(f"{n},5,2\n{n},25,2\n{n},5,9\n" for n in range(20)),
    )
    outcome = settle(job(tmp_path, BRAKES, data, assume, steps=True, **BRAKING))
    assert outcome.vacuous
    before = settle(job(tmp_path, BRAKES, data + "x,5,9\nx,25,2\n", assume, steps=True, **BRAKING))
    assert before.verdict is Verdict.REFUTED


# -- columns and ports ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("guarantee", "mapping", "columns", "good", "bad"),
    [
        (
            "in.kind == human -> out.seen == human",
            {"in.kind": "k", "out.seen": "s"},
            "k,s",
            "human,human",
            "human,dog",
        ),
        (
            "out.seen == in.kind",
            {"in.kind": {"field": "k", "values": {"P": "human", "D": "dog"}}, "out.seen": "s"},
            "k,s",
            "P,human",
            "D,human",
        ),
        (
            "forall(x, y in REAL | in.command == move(x, y) -> out.at(x, y))",
            {"in.command": {"constructor": "c", "move": ["x", "y"], "inspect": ["i"]}, "out.at": ["p", "q"]},
            "c,x,y,i,p,q",
            "move,1,2,0,1,2",
            "move,1,2,0,1,2.1",
        ),
        ("out.distance <= in.speed", {}, "in.speed,out.distance", "5,2", "2,5"),
    ],
)
def test_columns_become_values_of_ports(
    tmp_path: Path, guarantee: str, mapping: Mapping[str, Any], columns: str, good: str, bad: str
) -> None:
    options = {"mapping": mapping} if mapping else {}
    outcome = settle(job(tmp_path, guarantee, rows(columns, *[good] * 30), **options))
    assert (outcome.verdict, outcome.vacuous) == (Verdict.TESTED, False), outcome.summary
    assert outcome.link is Link.MAPPED
    assert settle(job(tmp_path, guarantee, rows(columns, *[good] * 30, bad), **options)).verdict is Verdict.REFUTED


ARRIVES = "forall(x, y in REAL | in.command == move(x, y) -> out.at(x, y))"
STAYS = "forall(i in NATURAL | in.command == inspect(i) -> forall(x, y in REAL | out.at(x, y) <=> in.last(x, y)))"
SOMEWHERE = (
    "exists(a, b in REAL | forall(x, y in REAL | out.at(x, y) -> "
    "(a - Tolerance <= x <= a + Tolerance and b - Tolerance <= y <= b + Tolerance)))"
)


@pytest.mark.parametrize(
    ("guarantee", "options", "columns", "good", "bad"),
    [
        (
            ARRIVES,
            {
                "mapping": {"in.command": {"move": ["gx", "gy"]}},
                "interpret": {"out.at(x, y)": "(x - px) * (x - px) + (y - py) * (y - py) <= Tolerance * Tolerance"},
            },
            "gx,gy,px,py",
            "1,2,1.15,2.2",
            "1,2,1.15,2.2000000001",
        ),
        (  # a column has the name of a variable of the guarantee
            ARRIVES,
            {
                "mapping": {"in.command": {"move": ["gx", "gy"]}},
                "interpret": {"out.at(p, q)": "p - x <= 0.1 and x - p <= 0.1 and q == y"},
            },
            "gx,gy,x,y",
            "1,2,1.1,2",
            "1,2,1.2,2",
        ),
        (
            STAYS,
            {
                "mapping": {"in.command": {"inspect": ["run"]}},
                "interpret": {"forall(p, q in REAL | out.at(p, q) <=> in.last(p, q))": "moved <= 0.005"},
            },
            "moved",
            "0.005",
            "0.0051",
        ),
        (STAYS, {"mapping": {"in.command": {"inspect": ["run"]}, "in.last": ["x", "y"], "out.at": ["p", "q"]}},
         "x,y,p,q", "1,2,1,2", "1,2,1,3"),
        (
            SOMEWHERE,
            {"interpret": {"out.at(x, y)": "(x == x0 or x == x1) and (y == y0 or y == y1)"}},
            "x0,x1,y0,y1",
            "1,1.5,2,2.5",
            "1,1.5001,2,2.5",
        ),
        ("in.person -> out.at(1, 2)", {"interpret": {"out.at(x, y)": "there"}, "mapping": {"in.person": "p"}},
         "p,there", "yes,yes", "yes,no"),
    ],
)  # fmt: skip
def test_a_predicate_is_judged_by_what_it_means_in_columns(
    tmp_path: Path, guarantee: str, options: dict[str, Any], columns: str, good: str, bad: str
) -> None:
    outcome = settle(job(tmp_path, guarantee, rows(columns, *[good] * 20), **options))
    assert (outcome.verdict, outcome.vacuous) == (Verdict.TESTED, False), outcome.summary
    for pattern in options.get("interpret", {}):
        assert any(text.startswith(f"{pattern} means ") for text in outcome.hypotheses)
        assert outcome.link is Link.GUIDED
    assert settle(job(tmp_path, guarantee, rows(columns, *[good] * 20, bad), **options)).verdict is Verdict.REFUTED


# -- bad input --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "line", "word"),
    [
        ("", 1, "names of the columns"),
        ("run,v,d\n", 1, "at least one row"),
        ("run,v,e\n1,5,2\n", 1, "no column 'd'"),
        ("run,v,d,d\n1,5,2,2\n", 1, "twice"),
        ("v,d\n5,2\n", 1, "no column identifies a run"),
        ("runn,v,d\n1,5,2\n", 1, "no column identifies a run (`runn`: did you mean `run`?"),
        ("run,v,d\n1,5,nan\n", 2, "not a number"),
        ("run,v,d\n1,5,2\n2,5,inf\n", 3, "not a number"),
        ("run,v,d\n1,5,\n", 2, "an empty cell"),
        ("run,v,d\n1,5,21 cm\n", 2, "not a number"),
        ("run,v,d\n1,5,2\n1,5,2\n", 3, "a second run named '1'; the first is in line 2"),
        ("run,v,d\n1,5,2\n01,5,2\n", 3, "'01' may be the run '1' of line 2"),
        ("run,v,d\nrun 1,5,2\nRun  01,5,2\n", 3, "'Run  01' may be the run 'run 1' of line 2"),
        ("run,v,d\n1.0,5,2\n1,5,2\n", 3, "'1' may be the run '1.0' of line 2"),
        ("run,v,d\n1,5\n", 2, "2 cells"),
        ('run,v,d\n1,5,"0.1\n', 2, "not CSV"),
        ("run,v,d\n1,5,2\n\n ,5,2\n", 4, "no name"),
        ("run,v,d\n1,5,=1+1\n", 2, "not a number"),
        ("run,v,d,D\n1,5,2,2\n", 1, "the column 'd' looks like 'D'"),
        ("run,v,d,\u0501\n1,5,2,2\n", 1, "looks like"),
        ("run,v,d,d\u200b\n1,5,2,2\n", 1, "looks like"),
        ('run,v,d\n1,5,"0,1"\n', 2, "not a number"),
        ("run;v;d\n1;5;2\n", 1, "';' separates the columns"),
        ("run\tv\td\n1\t5\t2\n", 1, "separate them by commas"),
        ("run,v,d\r1,5,2\r2,5,x\n", 3, "not a number"),
        ("run,v,d\n1,5,1e99999999\n", 2, "not a number"),
    ],
)
def test_bad_data_is_told_with_its_line_and_never_green(tmp_path: Path, text: str, line: int, word: str) -> None:
    asked = job(tmp_path, BRAKES, text, **BRAKING)
    found = [d for d in BACKEND.check(asked) if word in f"{d.message} ({d.hint})"]
    assert [d.span.line for d in found if d.span] == [line], BACKEND.check(asked)
    outcome = settle(asked)
    assert outcome.verdict is Verdict.ERROR
    assert f"runs.csv:{line}" in outcome.summary


def test_data_that_are_not_text(tmp_path: Path) -> None:
    for data in (b"run,v,d\n1,\xff,2\n", b"run,v,d\n1,\0,2\n"):
        asked = job(tmp_path, BRAKES, "", **BRAKING)
        (asked.root / "runs.csv").write_bytes(data)
        assert settle(asked).verdict is Verdict.ERROR


AT = "in.person -> out.at(1, 2)"


@pytest.mark.parametrize(
    ("guarantee", "options", "code", "word"),
    [
        (BRAKES, {"data": "nowhere.csv"}, "EXP102", "no file"),
        (BRAKES, {"data": "../runs.csv"}, "EXP101", "system's folder"),
        (BRAKES, {"confidence": 1}, "EXP101", "confidence"),
        (BRAKES, {"confidence": 0.5}, "EXP101", "confidence"),
        (BRAKES, {"confidence": "high"}, "EXP101", "number"),
        (BRAKES, {"at_least": 1}, "EXP101", "between"),
        (BRAKES, {"at_least": 0.1}, "EXP105", "is below the 0.8"),
        (BRAKES, {"run_column": "who"}, "EXP112", "no column 'who'"),
        (BRAKES, {"strata": "floor"}, "EXP112", "no column 'floor'"),
        (BRAKES, {"mapping": {**BRAKING["mapping"], "in.person": "p"}}, "EXP112", "no column 'p'"),
        (BRAKES, {"mapping": {"in.speed": "v"}}, "EXP103", "g speaks of out.distance"),
        (BRAKES, {"mapping": {"in.sped": "v"}}, "EXP103", "no port 'in.sped'"),
        (BRAKES, {"mapping": {"in.speed": ["v", "d"], "out.distance": "d"}}, "EXP103", "2 columns"),
        (BRAKES, {"mapping": {"in.command": {"move": ["v"]}}}, "EXP103", "'move' is no constructor"),
        (BRAKES, {"mapping": {"in.command": {"move": ["v", "d"], "inspect": ["v"]}}}, "EXP103", "'constructor' names"),
        (AT, {"interpret": {"out.at(x, y)": "TRUE"}}, "EXP106", "names no column"),
        (AT, {"interpret": {"out.at(x)": "v == x"}}, "EXP106", "2 different variables"),
        (AT, {"interpret": {"out.on(x)": "v == x"}}, "EXP106", "no predicate"),
        (BRAKES, {"interpret": {"out.at(x, y)": "v == x"}}, "EXP106", "occurs in no guarantee"),
        (AT, {"interpret": {"in.last(1, 2)": "v == 6", "out.at(x, y)": "v == x"}}, "EXP106", "occurs in no guarantee"),
        (BRAKES, {"interpret": {"in.speed >= 5": "v >= 0"}}, "EXP106", "each of its ports can have a column"),
        (BRAKES, {"mapping": {"in.speed": "v", "out.distance": "v"}}, "EXP103", "measures no output"),
        (
            ARRIVES,
            {"mapping": {"in.command": {"move": ["v", "d"]}}, "interpret": {"out.at(x, y)": "x == v and y == d"}},
            "EXP106",
            "only columns that are bound to inputs",
        ),
        (
            "out.seen == in.kind",
            {"mapping": {"in.kind": {"field": "v", "values": {"dog": "human"}}, "out.seen": "d"}},
            "EXP103",
            "'dog' is itself a value",
        ),
        (
            "out.seen == in.kind",
            {"mapping": {"in.kind": {"field": "v", "values": {"5": "cat"}}, "out.seen": "d"}},
            "EXP103",
            "'cat' is none of human, dog",
        ),
        *(
            (
                guarantee,
                {"mapping": {port: {"field": "v", "values": values}, other: "d"}},
                "EXP103",
                f"'{word}' is itself a value",
            )
            for guarantee, port, other, values, word in (
                (DETECTS, "out.detected", "in.person", {"no": "yes", "yes": "no"}, "no"),
                (DETECTS, "in.person", "out.detected", {"0": "true"}, "0"),
                (BRAKES, "out.distance", "in.speed", {"9": "1"}, "9"),
                (BRAKES, "in.speed", "out.distance", {"5.0": "5.1"}, "5.0"),
            )
        ),
        (
            BRAKES,
            {"mapping": {"in.speed": {"field": "v", "values": {"fast": "quick"}}, "out.distance": "d"}},
            "EXP103",
            "'quick' is no value",
        ),
        (AT, {"interpret": {"out.at(x, y)": "v =="}}, "RCL", ""),
        (AT, {"interpret": {"out.at(x, y)": "speeds == x"}}, "RCL", "speeds"),
    ],
)
def test_bad_options_are_told(tmp_path: Path, guarantee: str, options: dict[str, Any], code: str, word: str) -> None:
    asked = job(tmp_path, guarantee, rows("v,d", *["5,2"] * 47), **{**BRAKING, **options})
    problems = BACKEND.check(asked)
    assert any(word in p.message and p.code.startswith(code) for p in problems), problems
    assert all(p.is_error for p in problems)
    assert settle(asked).verdict is Verdict.ERROR
    BACKEND.files(asked)


@pytest.mark.parametrize("name", ["Tolerance", "distance"])
def test_a_column_in_a_formula_is_no_name_of_the_contract(tmp_path: Path, name: str) -> None:
    asked = job(tmp_path, "out.at(1, 2)", rows(name, *["9"] * 30), interpret={"out.at(p, q)": f"{name} <= 10"})
    assert any(f"'{name}' is a column, and a constant or a port" in d.message for d in BACKEND.check(asked))


def test_a_variable_of_a_predicate_is_no_column(tmp_path: Path) -> None:
    flatters = {"out.at(x, y)": "x - x <= 1 and v == 1"}
    asked = job(tmp_path, "out.at(1, 2)", rows("x,v", *["9,1"] * 30), interpret=flatters)
    assert any("'x' is a column too" in d.message for d in BACKEND.check(asked))


def test_a_run_has_one_condition(tmp_path: Path) -> None:
    data = "run,v,d,floor\n1,5,2,dry\n1,5,2,wet\n"
    asked = job(tmp_path, BRAKES, data, steps=True, strata="floor", **BRAKING)
    assert any("several conditions" in d.message for d in BACKEND.check(asked))


def test_export_says_what_will_be_judged(tmp_path: Path) -> None:
    asked = job(tmp_path, BRAKES, rows("v,d", "5,2"), protocol='quotes " and */ {braces}', **BRAKING)
    assert BACKEND.export(asked) == BACKEND.export(asked)
    assert "in.speed" in BACKEND.export(asked)["claim.json"]
    assert BACKEND.export(job(tmp_path, BRAKES, "", **BRAKING)) == {}


def sample_of(outcome: Outcome) -> Any:
    class Record:
        details = outcome.details

    return sample(Record())  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_simulation_reproduces_its_data_byte_for_byte() -> None:
    program = ROOT / "remote_inspection/models/simulate_navigation.py"
    made = subprocess.run([sys.executable, program], capture_output=True, check=True, timeout=60).stdout
    kept = (ROOT / "remote_inspection/data/navigation_runs.csv").read_bytes()
    assert made == kept
    runs = list(csv.DictReader(io.StringIO(kept.decode())))
    assert len(runs) == 47
    assert len({(r["goal_x"], r["goal_y"]) for r in runs}) == 47
