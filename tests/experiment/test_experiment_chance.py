"""Guarantees with a probability, judged by recorded runs; and every other method refuses them by name."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import pytest

from avow.backend_kit.protocol import Limits
from avow.backend_kit.registry import backend, names
from avow.backends.experiment import BACKEND
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import Seeded, settle
from avow.evidence.record import RATE
from avow.kernel.rates import shows
from avow.pipeline.methods import method_job
from avow.system.load import load_system

RCL = """node n {{
  inputs( person : BOOL ) outputs( found : BOOL ) topics()
  guarantee g with probability >= {head} ( {claim} )
}}
"""
COLUMNS = {"mapping": {"in.person": "person", "out.found": "found"}}
SEEN, MISSED, NOBODY = "yes,yes", "yes,no", "no,no"


def judged(folder: Path, head: str, claim: str, cells: list[str], **options: object) -> Outcome:
    table = "run,person,found\n" + "".join(f"{n},{line}\n" for n, line in enumerate(cells, 1))
    options = {"data": "runs.csv", **COLUMNS, **options}
    case = Seeded("s", RCL.format(head=head, claim=claim), options, {"g": Verdict.TESTED}, {"runs.csv": table})
    (outcome,) = settle(BACKEND, case.written(BACKEND, folder), folder / "out", Limits()).outcomes
    return outcome


@pytest.mark.parametrize("failures", [0, 1, 5, 10, 30, 60])
def test_the_verdict_is_that_of_the_binomial_tails(tmp_path: Path, failures: int) -> None:
    """Rows without a person are no trials. The verdict is recomputed from the tails of the binomial distribution."""
    outcome = judged(
        tmp_path, "0.9 given (in.person)", "out.found", [SEEN] * (100 - failures) + [MISSED] * failures + [NOBODY] * 50
    )
    shown = shows(failures, 100, Fraction(1, 10), Fraction(95, 100))
    refuted = shows(100 - failures, 100, Fraction(9, 10), Fraction(95, 100))
    assert outcome.verdict is (Verdict.TESTED if shown else Verdict.REFUTED if refuted else Verdict.UNKNOWN)
    assert (outcome.bound["triggered"], outcome.bound["failures"]) == (100, failures)
    assert (RATE in outcome.details) == shown
    assert bool(outcome.counterexample) == refuted


def test_what_counts_as_a_trial(tmp_path: Path) -> None:
    """Without `given` every row counts; an inner condition of the claim leaves none out; nothing given is vacuous."""
    every = judged(tmp_path / "a", "0.9", "in.person -> out.found", [SEEN] * 30 + [NOBODY] * 30)
    assert (every.verdict, every.bound["triggered"]) == (Verdict.TESTED, 60)
    for head, claim in (("0.9 given (in.person)", "out.found"), ("0.9", "in.person -> out.found")):
        none = judged(tmp_path / claim.replace(" ", ""), head, claim, [NOBODY] * 60)
        assert (none.verdict, none.vacuous) == (Verdict.TESTED, True)


def test_steps_and_runs_are_different_trials(tmp_path: Path) -> None:
    rows = judged(tmp_path / "a", "0.9 per run", "in.person -> out.found", [SEEN] * 60)
    assert (rows.verdict, "per run, and each row is one step" in rows.summary) == (Verdict.UNKNOWN, True)
    runs = judged(tmp_path / "b", "0.9 given (in.person)", "out.found", [SEEN] * 60, steps=True)
    assert (runs.verdict, "trials are runs" in runs.summary) == (Verdict.UNKNOWN, True)
    right = judged(tmp_path / "c", "0.9 per run", "in.person -> out.found", [SEEN] * 60, steps=True)
    assert right.verdict is Verdict.TESTED


@pytest.mark.parametrize("name", sorted(set(names()) - {"experiment", "storm"}))
def test_other_methods_refuse_it(tmp_path: Path, name: str) -> None:
    """Its formula is TRUE: a method that judged that would find it proved."""
    (tmp_path / "system.rcl").write_text(RCL.format(head="0.9 given (in.person)", claim="out.found"))
    (tmp_path / "plan.yaml").write_text(f"contract: system.rcl\nnodes: {{n: {{methods: [{{{name}: {{}}}}]}}}}\n")
    system = load_system(tmp_path)
    (method,) = system.plan.node("n").methods
    job = method_job(system, system.contract.node("n"), method, backend(name))
    for outcome in settle(backend(name), job, tmp_path / "out", Limits()).outcomes:
        assert (outcome.verdict, "shows no probability" in outcome.summary) == (Verdict.UNKNOWN, True)
