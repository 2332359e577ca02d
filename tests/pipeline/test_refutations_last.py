"""A counterexample belongs to claim and subject: it is tried first on every later run, whatever the options say."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import edit

from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import ledger_of
from avow.evidence.record import CASE
from avow.pipeline.discharge import discharge, open_obligations
from avow.pipeline.run_info import Run
from avow.pipeline.work import Work
from avow.pipeline.workload import Survey, survey

RCL = "node n { inputs( x : REAL, k : INTEGER ) outputs( y : REAL ) topics() guarantee small (out.y <= 10) }\n"
PLAN = "system: s\nnodes: {n: {methods: [{hypothesis: {subject: 'm.py:step', cases: 300, seed: 0}}]}}\n"
GOOD = "def step(x, k):\n    return min(x, 10)\n"
RUN = Run("later", False)


@pytest.fixture
def place(tmp_path: Path) -> Workspace:
    folder = tmp_path / "contracts" / "s"
    folder.mkdir(parents=True)
    (tmp_path / "dodo.py").write_text("")
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(PLAN)
    return Workspace(tmp_path)


def work(place: Workspace) -> Work:
    found = survey(place.contracts / "s")
    assert isinstance(found, Survey), found
    return found.work("hypothesis")


def ask(place: Workspace, subject: str) -> Verdict:
    (place.contracts / "s" / "m.py").write_text(subject)
    (outcome,) = discharge(place, work(place), RUN)
    return outcome.verdict


def case(place: Workspace) -> dict[str, object]:
    found: dict[str, object] = ledger_of(place.ledger("s")).records()[-1].evidence.details[CASE]
    return found


def test_data_of_before_a_run_failed_are_judged_again_when_they_are_put_back(tmp_path: Path) -> None:
    folder = tmp_path / "contracts" / "s"
    folder.mkdir(parents=True)
    (folder / "s.rcl").write_text(RCL)
    (folder / "plan.yaml").write_text(
        "system: s\nnodes: {n: {methods: [{experiment: {data: runs.csv, mapping: {out.y: d}}}]}}\n"
    )
    place, clean = Workspace(tmp_path), "run,d\n" + "".join(f"{at},{at / 100}\n" for at in range(60))

    def judged(data: str) -> Verdict:
        (folder / "runs.csv").write_text(data)
        found = survey(place.contracts / "s")
        assert isinstance(found, Survey), found
        for outcome in discharge(place, found.work("experiment"), RUN):
            return outcome.verdict
        raise AssertionError("nothing was asked: an earlier answer counts")

    assert judged(clean) is Verdict.TESTED
    assert judged(clean + "60,11\n") is Verdict.REFUTED
    assert judged(clean) is Verdict.UNKNOWN


@pytest.mark.slow
def test_a_case_is_tried_first_whatever_the_plan_asks_for(place: Workspace) -> None:
    assert ask(place, "def step(x, k):\n    return x\n") is Verdict.REFUTED
    value = case(place)["x"]["q"]  # type: ignore[index]
    edit(place.contracts / "s" / "plan.yaml", ("cases: 300", "cases: 1"), ("seed: 0", "seed: 77"))
    rare = f"def step(x, k):\n    return 99 if x * {value[1]} == {value[0]} else 0\n"
    assert ask(place, rare) is Verdict.REFUTED
    assert ask(place, GOOD) is Verdict.TESTED
    assert ledger_of(place.ledger("s")).records()[-1].evidence.bound["replayed"] == 1
    edit(place.contracts / "s" / "s.rcl", ("<= 10", "<= 9"))
    edit(place.contracts / "s" / "plan.yaml", ("seed: 77", "seed: 78"))
    assert ask(place, rare) is Verdict.REFUTED, "another threshold is another claim, but the case is tried"


@pytest.mark.nightly
def test_what_was_good_before_the_refutation_is_asked_again(place: Workspace) -> None:
    assert ask(place, GOOD) is Verdict.TESTED
    assert not open_obligations(place, work(place), RUN)
    ledger = ledger_of(place.ledger("s"))
    good = ledger.records()[-1].evidence
    found = {"x": {"q": [12, 1]}, "k": 3}
    ledger.append(replace(good, verdict=Verdict.REFUTED, key="another seed", details={**good.details, CASE: found}))
    assert open_obligations(place, work(place), RUN)
    assert ask(place, GOOD) is Verdict.TESTED
    assert not open_obligations(place, work(place), RUN), "the case was tried, and refutes no more"


@pytest.mark.nightly
def test_a_case_that_is_no_input_any_more_is_left_out(place: Workspace) -> None:
    assert ask(place, "def step(x, k):\n    return x\n") is Verdict.REFUTED
    edit(place.contracts / "s" / "s.rcl", ("x : REAL", "x : {low, high}"))
    assert ask(place, "def step(x, k):\n    return 0\n") is Verdict.TESTED


@pytest.mark.slow
def test_a_refutation_outlives_its_method_in_the_plan_but_not_the_repair_of_the_program(place: Workspace) -> None:
    assert ask(place, "def step(x, k):\n    return x\n") is Verdict.REFUTED
    plan = place.contracts / "s" / "plan.yaml"
    plan.write_text("system: s\nnodes: {n: {criticality: low, methods: []}}\n")
    command = [sys.executable, "-m", "avow", "verify"]

    def verified() -> tuple[int, str]:
        done = subprocess.run(command, cwd=place.root, capture_output=True, text=True, timeout=120, check=False)
        return done.returncode, done.stdout + done.stderr

    code, told = verified()
    assert code == 1, told
    assert "refuted" in told
    (program,) = (place.contracts / "s").glob("*.py")
    program.write_text("def step(x, k):\n    return 0\n")
    code, told = verified()
    assert "n.g: refuted" not in told, told
