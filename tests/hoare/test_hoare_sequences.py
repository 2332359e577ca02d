"""Sequences, tuples and named sets in programs: what is proved is so, and what goes beyond an end is shown by a run."""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path

import pytest
from helpers import some

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND
from avow.backends.hoare.backend import load
from avow.backends.hoare.interpreter import Machine
from avow.base.verdict import Outcome, Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Element, SequenceValue
from avow.solving.models import default_value
from hoare.systems import make_job

CONTRACT = """
context {{ Mode : {{off, slow, fast}}; Moving = {{slow, fast}};
          Pair : (Mode, REAL); Path : <REAL>; Counts : <NATURAL>; }}
node n {{
  inputs( loads : Path, counts : Counts, mode : Mode, k : INTEGER )
  outputs( total : REAL, pair : Pair, path : Path, seen : BOOL, many : Counts )
  topics()
  {assume}
  guarantee g ( {formula} )
}}
"""
SUM = (
    "total := 0\nn := 0\nWHILE n < length(loads) INVARIANT n <= length(loads) and total >= 0 "
    "VARIANT length(loads) - n DO\n   total := total + loads(n)\n   n := n + 1"
)


def settle(folder: Path, program: str, formula: str, assume: str = "") -> Outcome:
    contract = CONTRACT.format(formula=formula, assume=f"assume( {assume} )" if assume else "")
    job = make_job(folder, contract, "n", {"program": "n.imp"}, {"n.imp": program}, "hoare")
    assert not [d for d in BACKEND.check(job) if d.is_error], BACKEND.check(job)
    return BACKEND.discharge(job, folder, Limits(seconds=20)).outcomes[0]


@pytest.mark.parametrize(
    ("program", "formula", "assume"),
    some(
        [
            ("total := loads(0) + loads[1]", "total == loads(0) + loads(1)", "length(loads) == 2"),
            ("pair := (mode, 1)", "pair == (mode, 1.0)", ""),
            ("path := [1, 0.5, k]", "path(2) == k and length(path) == 3 and path == <1, 0.5, k>", ""),
            ("path := []", "path == <>", ""),
            ("seen := mode in Moving", "seen <=> mode != off", ""),
            ("seen := mode !in Moving", "seen <=> mode == off", ""),
            ("seen := 2 in loads", "seen <=> 2 in loads", ""),
            ("seen := 2 !in [1, 2.5]", "seen", "length(loads) == 0"),
            (
                "IF length(loads) > 0 THEN\n   total := loads(length(loads) - 1)",
                "length(loads) == 1 -> total == loads(0)",
                "",
            ),
            ("IF k >= 0 THEN\n   many := [k]\nELSE\n   many := []", "k >= 0 -> many == <k>", ""),
            ("path := loads\nloads := []", "path == in.loads", ""),
            (
                SUM,
                "total >= 0",
                "forall(i in NATURAL | i < length(loads) -> loads(i) >= 0)",
            ),
        ],
        5,
    ),
)
def test_is_proved(tmp_path: Path, program: str, formula: str, assume: str) -> None:
    outcome = settle(tmp_path, program + "\n", formula, assume)
    assert outcome.verdict is Verdict.PROVED, outcome.summary


@pytest.mark.parametrize(
    ("program", "formula", "assume", "why"),
    [
        ("total := loads(0) + loads(1)", "total == loads(0) + loads(1)", "", "an element that the sequence"),
        ("total := loads(2)", "total == loads(2)", "length(loads) == 2", "an element that the sequence"),
        ("total := loads(k)", "k >= 0 -> total == loads(k)", "length(loads) == 9 and k < 9", "an element that"),
        ("many := [k]", "many == <k> or k < 0", "", "a negative number for a natural one"),
        ("many := [k - 1, 2]", "many(0) == k - 1 or k < 1", "k >= 0", "a negative number for a natural one"),
        ("pair := (mode, 2)", "pair == (mode, 1.0)", "", ", 2)"),
        ("path := [1, 0.5]", "length(path) == 3", "", "path = <1, 0.5>"),
        ("seen := mode in Moving", "seen <=> mode == fast", "", "slow"),
        (
            "IF length(loads) > 1 THEN\n   total := 1\nELSE\n   total := 0",
            "length(loads) == 2 -> total == 0",
            "",
            "total = 1",
        ),
    ],
)
def test_is_refuted_by_a_run(tmp_path: Path, program: str, formula: str, assume: str, why: str) -> None:
    outcome = settle(tmp_path, program + "\n", formula, assume)
    assert outcome.verdict is Verdict.REFUTED, outcome.summary
    shown = outcome.counterexample
    assert shown is not None
    assert why in outcome.summary + str(shown.values)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        ("loads[0] := 1", "no map"),
        ("x := []\ntotal := 1", "nothing says of what this sequence is"),
        ("seen := [] == []", "nothing says of what this sequence is"),
        ("total := length(mode)", "`length` is of a sequence"),
        ("seen := mode in k", "wants a set or a sequence"),
        ("total := loads(0.5)", "a position in a sequence is a whole number"),
        ("total := loads(0, 1)", "takes one position"),
        ("pair := (mode, 1, 2)", "is wanted here"),
        ("path := [mode]", "is wanted here"),
        ("path := [1, mode]", "the items of a sequence are of one type"),
    ],
)
def test_is_rejected_with_its_place(tmp_path: Path, program: str, message: str) -> None:
    contract = CONTRACT.format(formula="TRUE", assume="")
    job = make_job(tmp_path, contract, "n", {"program": "n.imp"}, {"n.imp": program + "\n"}, "hoare")
    found = [d for d in BACKEND.check(job) if d.is_error]
    assert any(message in d.message for d in found), found
    assert all(d.span is not None and d.span.file.endswith("n.imp") for d in found)


def test_the_test_around_a_loop_goes_on_holding_in_it(tmp_path: Path) -> None:
    program = (
        "IF mode == fast THEN\n   n := 0\n   WHILE n < 3 INVARIANT n <= 3 VARIANT 3 - n DO\n      n := n + 1\n"
        "   IF n == 3 THEN\n      seen := TRUE\n   ELSE\n      seen := FALSE\nELSE\n   seen := FALSE\n"
    )
    assert settle(tmp_path / "a", program, "seen <=> mode == fast").verdict is Verdict.PROVED


def test_a_test_of_what_is_assigned_does_not(tmp_path: Path) -> None:
    program = (
        "IF mode == fast THEN\n   mode := off\n   n := 0\n   WHILE n < 3 INVARIANT n <= 3 VARIANT 3 - n DO\n"
        "      n := n + 1\n   seen := mode == fast\nELSE\n   seen := TRUE\n"
    )
    assert settle(tmp_path / "a", program, "seen").verdict is not Verdict.PROVED


@pytest.mark.parametrize(
    ("program", "verdict"),
    [
        ("IF k > 0 THEN\n   total := 1\nELSE\n   total := 1 / k", Verdict.REFUTED),
        ("IF k > 0 THEN\n   total := 1\nELSE\n   total := 1 / (k - 1)", Verdict.PROVED),
        ("total := 1\nWHILE k <= 0 INVARIANT TRUE VARIANT k DO\n   SKIP", Verdict.REFUTED),
    ],
)
def test_also_runs_of_which_a_guarantee_asks_nothing_have_an_output(
    tmp_path: Path, program: str, verdict: Verdict
) -> None:
    """The node promises an output for every input that its assumptions allow; this guarantee only speaks of k > 0."""
    outcome = settle(tmp_path, program + "\n", "k > 0 -> total == 1")
    assert outcome.verdict is verdict, outcome.summary


# -- random programs: what is proved survives every run ----------------------------------------------------------------


def number(rng: random.Random) -> str:
    return rng.choice(
        ("0", "1", "k", "loads(0)", "loads(1)", "loads(k)", "total", "length(loads)", "loads(length(loads) - 1)")
    )


def condition(rng: random.Random) -> str:
    compare = f"{number(rng)} {rng.choice(('<', '<=', '==', '!='))} {number(rng)}"
    return rng.choice(
        (
            compare,
            compare,
            "length(loads) > 1",
            "k in [0, 1]",
            "mode in Moving",
            "0 <= k and k < length(loads)",
            "1 in loads",
        )
    )


def block(rng: random.Random, depth: int, indent: str) -> str:
    lines = []
    for _ in range(rng.randint(1, 2)):
        if depth and rng.random() < 0.6:
            lines.append(f"{indent}IF {condition(rng)} THEN\n{block(rng, depth - 1, indent + '   ')}")
            lines.append(f"{indent}ELSE\n{block(rng, depth - 1, indent + '   ')}")
        else:
            lines.append(
                indent
                + rng.choice(
                    (
                        f"total := {number(rng)}",
                        f"loads := [{number(rng)}, {number(rng)}]",
                        f"path := [{number(rng)}, {number(rng)}]",
                        "path := loads",
                        f"pair := (mode, {number(rng)})",
                        f"seen := {condition(rng)}",
                        "many := [k]",
                    )
                )
            )
    return "\n".join(lines)


CLAIMS = (
    "length(path) == length(in.loads) or length(path) == 2",
    "pair == (in.mode, total)",
    "seen <=> in.mode in Moving",
    "seen -> total >= 0",
    "length(many) <= 1",
    "length(in.loads) == 2 -> path == in.loads",
    "total == in.loads(0) or total == 0 or total == in.k",
)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_proved_survives_random_runs(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    start = "total := 0\npath := loads\npair := (mode, 0)\nseen := FALSE\nmany := []\n"
    proved = refuted = 0
    for at in range(14):
        assume = rng.choice(("", "length(loads) == 2 and 0 <= k and k < 2", "length(loads) > 0"))
        program = start + block(rng, 2, "") + "\n"
        contract = CONTRACT.format(formula=rng.choice(CLAIMS), assume=f"assume( {assume} )" if assume else "")
        job = make_job(tmp_path / str(at), contract, "n", {"program": "n.imp"}, {"n.imp": program}, "hoare")
        assert not [d for d in BACKEND.check(job) if d.is_error], BACKEND.check(job)
        outcome = BACKEND.discharge(job, tmp_path, Limits(seconds=20)).outcomes[0]
        refuted += outcome.verdict is Verdict.REFUTED
        if outcome.verdict is not Verdict.PROVED:
            continue
        proved += 1
        checked = load(job).checked.program
        for _ in range(60):
            inputs = {
                "loads": SequenceValue(
                    tuple(Fraction(rng.choice((-1, 0, 1, 2))) for _ in range(rng.choice((0, 1, 2, 2, 3))))
                ),
                "counts": SequenceValue(()),
                "mode": Element(rng.choice(("off", "slow", "fast"))),
                "k": rng.choice((-1, 0, 1, 2)),
            }
            values = {f"in.{name}": v for name, v in inputs.items()}
            try:
                if not all(evaluate(a.formula, values) for a in job.node.assumptions):
                    continue
            except NotEvaluable:
                continue
            state = {v.name: inputs.get(v.name, default_value(v.sort)) for v in checked.state}
            end = Machine().run(checked.body, {**state, **{g.name: state[v.name] for v, g in checked.ghosts.items()}})
            values |= {f"out.{p.name}": end.get(p.name, default_value(p.sort)) for p in job.node.outputs}
            try:
                assert evaluate(job.node.guarantees[0].formula, values) is True, (program, inputs)
            except NotEvaluable:
                continue
    assert proved > 0
    assert refuted > 0
