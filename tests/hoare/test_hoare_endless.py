"""Loops: partial correctness is no proof, a repeated state is found, random programs are held against runs."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from helpers import some

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND
from avow.backends.hoare.backend import load
from avow.backends.hoare.interpreter import Endless, Machine, NoEnd
from avow.base.verdict import Outcome, Verdict
from avow.evaluation.evaluate import evaluate
from avow.evidence.status import Status
from avow.formulas.values import SequenceValue
from avow.solving.models import default_value
from hoare.systems import make_job

CONTRACT = """
context {{ Path : <INTEGER>; Map : INTEGER --> INTEGER; Mode : {{off, on}}; }}
node n {{
  inputs( a : INTEGER, b : INTEGER, s : Path, x : REAL, mode : Mode, m : Map )
  outputs( y : INTEGER, q : REAL, path : Path )
  topics()
  {assume}
  guarantee g ( {formula} )
}}
"""


def settle(folder: Path, program: str, formula: str = "y == 0", assume: str = "", **options: object) -> Outcome:
    contract = CONTRACT.format(formula=formula, assume=f"assume( {assume} )" if assume else "")
    job = make_job(folder, contract, "n", {"program": "n.imp", **options}, {"n.imp": program}, "hoare")
    assert not [d for d in BACKEND.check(job) if d.is_error], BACKEND.check(job)
    return BACKEND.discharge(job, folder, Limits(seconds=20)).outcomes[0]


@pytest.mark.parametrize(
    ("loop", "assume"),
    some(
        [
            ("WHILE a == 7777 INVARIANT TRUE DO\n  SKIP", ""),  # one input in all
            ("WHILE a * a == 49 and b > 3 INVARIANT TRUE DO\n  SKIP", ""),
            ("n := 0\nWHILE n < length(s) INVARIANT TRUE DO\n  IF s(n) != 5 THEN\n    n := n + 1", ""),
            ("IF mode == on THEN\n  IF b == 12345 THEN\n    WHILE a != b INVARIANT TRUE DO\n      SKIP", ""),
            ("n := 0\nWHILE m(n) == 1 INVARIANT TRUE DO\n  SKIP", ""),
            (
                (
                    "n := 0\nk := 0\nWHILE n < 3 INVARIANT TRUE DO\n  k := 0\n"
                    "  WHILE k < 3 INVARIANT TRUE DO\n    k := k + 1"
                ),
                "",
            ),
        ],
        3,
        slow=2,
    ),
)
def test_a_run_that_comes_back_to_a_state_is_found(tmp_path: Path, loop: str, assume: str) -> None:
    outcome = settle(tmp_path, f"y := 0\n{loop}\n", assume=assume)
    assert outcome.verdict is Verdict.REFUTED, outcome.summary
    assert "no output" in outcome.summary
    assert outcome.counterexample is not None


@pytest.mark.parametrize(
    ("loop", "verdict"),
    [
        ("n := a\nWHILE n != 0 INVARIANT TRUE DO\n  n := n - 1", Verdict.PARTIAL),
        ("q := x\nWHILE q > 0 INVARIANT TRUE DO\n  q := q / 2", Verdict.PARTIAL),
        ("n := 0\nWHILE n < a INVARIANT TRUE VARIANT a - n DO\n  n := n - 1", Verdict.UNKNOWN),
    ],
)
def test_a_run_without_an_end_supports_nothing_if_no_state_comes_twice(
    tmp_path: Path, loop: str, verdict: Verdict
) -> None:
    assert settle(tmp_path, f"y := 0\n{loop}\n").verdict is verdict


@pytest.mark.parametrize(
    ("loop", "verdict"),
    some(
        [
            ("n := 0\nWHILE n < a INVARIANT y == 0 DO\n  n := n + 1", Verdict.PARTIAL),
            ("n := 0\nWHILE n < a INVARIANT y == 0 VARIANT a - n DO\n  n := n + 1", Verdict.PROVED),
            ("q := 0\nWHILE q < 10000 INVARIANT y == 0 DO\n  q := q + 1", Verdict.PARTIAL),  # long, and it ends
            ("n := 0\nWHILE n * n < 50000000 INVARIANT y == 0 DO\n  n := n + 1", Verdict.PARTIAL),
        ],
        1,
        slow=1,
    ),
)
def test_a_loop_that_ends_is_not_called_endless(tmp_path: Path, loop: str, verdict: Verdict) -> None:
    assert settle(tmp_path, f"y := 0\n{loop}\n").verdict is verdict


def test_partial_correctness_supports_nothing_until_a_person_answers_for_the_end(tmp_path: Path) -> None:
    program = "y := 0\nn := 0\nWHILE n < a INVARIANT y == 0 DO\n  n := n + 1\n"
    partial = settle(tmp_path / "a", program)
    assert (partial.verdict, partial.verdict.supports, Status.PARTIAL.supports) == (Verdict.PARTIAL, False, False)
    word = {"because": "n rises to a", "who": "A. Person", "until": "2031-01-01"}
    accepted = settle(tmp_path / "b", program, termination=word)
    assert accepted.verdict is Verdict.JUSTIFIED  # a person's word, and counted as no more than that
    assert accepted.details["valid_until"] == "2031-01-01"
    assert "A. Person" in accepted.summary
    assert accepted.hypotheses == partial.hypotheses != ()
    hangs = program.replace("n := n + 1", "SKIP")
    assert settle(tmp_path / "c", hangs, termination=word).verdict is Verdict.REFUTED  # whoever says what


def test_a_word_without_a_day_is_a_fault_of_the_plan(tmp_path: Path) -> None:
    word = {"because": "n rises to a", "who": "A. Person", "until": "soon"}
    job = make_job(
        tmp_path,
        CONTRACT.format(formula="y == 0", assume=""),
        "n",
        {"program": "n.imp", "termination": word},
        {"n.imp": "y := 0\nn := 0\nWHILE n < a INVARIANT TRUE DO\n  n := n + 1\n"},
        "hoare",
    )
    (fault,) = BACKEND.check(job)
    assert (fault.code, fault.is_error) == ("HOARE400", True)
    assert "soon" in fault.message


@pytest.mark.parametrize(
    ("program", "formula", "assume"),
    [
        # the sum forgets the last element; the largest starts from 0; the last match is wanted, the first found
        ("n := 0\ny := 0\nWHILE n < length(s) - 1 INVARIANT TRUE DO\n  y := y + s(n)\n  n := n + 1",
         "length(s) == 2 -> y == s(0) + s(1)", ""),
        ("n := 0\ny := 0\nWHILE n < length(s) INVARIANT TRUE DO\n  IF s(n) > y THEN\n    y := s(n)\n  n := n + 1",
         "length(s) > 0 -> y in s", ""),
        ("n := 0\ny := 0 - 1\nWHILE n < length(s) INVARIANT TRUE DO\n  IF s(n) == 3 and y < 0 THEN\n    y := n\n  n := n + 1",  # noqa: E501
         "forall(i in NATURAL | i < length(s) and s(i) == 3 -> i <= y)", ""),
        ("n := 1\nWHILE n < length(s) INVARIANT TRUE DO\n  y := 1\n  IF s(n) < s(n - 1) THEN\n    y := 0\n  n := n + 1",
         "y == 1 -> forall(i in NATURAL | 0 < i and i < length(s) -> s(i - 1) <= s(i))", ""),
        ("n := 0\ny := 0\nWHILE n < length(s) INVARIANT TRUE DO\n  y := y + s(n)\n  n := n + 2",
         "y == 0 or length(s) != 3 or y == s(0) + s(1) + s(2)", "forall(i in NATURAL | i < length(s) -> s(i) > 0)"),
    ],
)  # fmt: skip
def test_wrong_loops_over_sequences_are_refuted_by_running_them(
    tmp_path: Path, program: str, formula: str, assume: str
) -> None:
    outcome = settle(tmp_path, program + "\n", formula, assume)
    assert outcome.verdict is Verdict.REFUTED, outcome.summary


# -- random programs with loops: what is said of them survives every run -----------------------------------------------


def term(rng: random.Random) -> str:
    return rng.choice(("a", "b", "y", "n", "n + 1", "n - 1", "y + 1", "a - 1", "b - n", "0", "2", "length(s)"))


def comparison(rng: random.Random) -> str:
    return f"{term(rng)} {rng.choice(('<', '<=', '==', '!='))} {term(rng)}"


def lines(rng: random.Random, depth: int, indent: str) -> list[str]:
    found: list[str] = []
    for _ in range(rng.randint(1, 2)):
        match rng.choice(("set", "set", "if", "while") if depth else ("set",)):
            case "set":
                found.append(f"{indent}{rng.choice(('y', 'n'))} := {term(rng)}")
            case "if":
                found += [f"{indent}IF {comparison(rng)} THEN", *lines(rng, depth - 1, indent + "  ")]
            case _:
                variant = rng.choice(("", "", " VARIANT a - n", " VARIANT b - y", " VARIANT y"))
                invariant = rng.choice(("TRUE", "TRUE", "n >= 0", "y <= n"))
                found.append(f"{indent}WHILE {comparison(rng)} INVARIANT {invariant}{variant} DO")
                found += lines(rng, depth - 1, indent + "  ")
    return found


@pytest.mark.nightly
@pytest.mark.parametrize("seed", range(4))
def test_random_loops_against_running_them(tmp_path: Path, seed: int) -> None:
    rng = random.Random(seed)
    seen: list[Verdict] = []
    for at in range(16):
        program = "\n".join(["y := 0", "n := 0", *lines(rng, 2, ""), *lines(rng, 2, "")]) + "\n"
        formula = rng.choice(("y >= 0 or n < 0 or TRUE", "y <= 2 or y > 2 + 0", "y == 0 -> y < 1", "y >= 0"))
        formula = formula.replace(" or n < 0", "")
        outcome = settle(tmp_path / str(at), program, formula)
        seen.append(outcome.verdict)
        if outcome.verdict not in (Verdict.PROVED, Verdict.PARTIAL):
            continue
        contract = CONTRACT.format(formula=formula, assume="")
        job = make_job(tmp_path / str(at), contract, "n", {"program": "n.imp"}, {"n.imp": program}, "hoare")
        checked = load(job).checked.program
        unended = 0
        for _ in range(60):
            given = {
                "a": rng.randrange(-3, 6),
                "b": rng.randrange(-3, 6),
                "s": SequenceValue(tuple(rng.randrange(3) for _ in range(rng.randrange(4)))),
            }
            state = {v.name: given.get(v.name, default_value(v.sort)) for v in checked.state}
            state |= {g.name: state[v.name] for v, g in checked.ghosts.items()}
            try:
                end = Machine().run(checked.body, state)  # a fault would contradict the verdict
            except (Endless, NoEnd):
                unended += 1
                continue
            values = {f"in.{p.name}": given.get(p.name, default_value(p.sort)) for p in job.node.inputs}
            values |= {f"out.{p.name}": end.get(p.name, default_value(p.sort)) for p in job.node.outputs}
            assert evaluate(job.node.guarantees[0].formula, values) is True, (program, given)
        assert not (unended and outcome.verdict is Verdict.PROVED), program
    assert {Verdict.PARTIAL, Verdict.REFUTED} & set(seen)
