"""Limits that are no numbers are told at their place; an answer is recorded only of the question that was asked."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.pipeline import dispatch
from avow.pipeline.run_info import new_run
from avow.pipeline.work import SANITY
from avow.pipeline.workload import Survey, survey

TEMPLATE = Path(__file__).parents[2] / "avow" / "cli" / "template" / "contracts" / "thermostat"


@pytest.fixture
def thermostat(workspace: Path) -> Path:
    return Path(shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat"))


@pytest.mark.parametrize(
    "wrong",
    [
        *("seconds: abc", "seconds: -1", "seconds: 0", "seconds: .nan", "seconds: {}", "seconds: 1e999"),
        *("seconds: '60'", "megabytes: 100.5", "megabytes: -3", "megabytes: 99999999999999999999", "megabytes: true"),
        *("seed: [1]", "seed: 1.5", "seed: -1", "seed: 99999999999999999999"),
    ],
)
def test_a_limit_that_is_none_is_told_at_its_place(thermostat: Path, wrong: str) -> None:
    plan = thermostat / "plan.yaml"
    plan.write_text(plan.read_text().replace("hoare: {program", f"hoare: {{{wrong}, program"))
    found = survey(thermostat)
    assert isinstance(found, Rejected)
    (problem,) = found.diagnostics
    assert problem.span is not None
    assert "hoare:" in plan.read_text().splitlines()[problem.span.line - 1]
    assert wrong.partition(":")[0] in problem.message


def test_limits_are_taken_as_given(thermostat: Path) -> None:
    plan = thermostat / "plan.yaml"
    given = "seconds: 2.5, megabytes: 512, seed: 7"
    plan.write_text(plan.read_text().replace("hoare: {program", f"hoare: {{{given}, program"))
    found = survey(thermostat)
    assert isinstance(found, Survey)
    limits = found.work("hoare").limits
    assert (limits.seconds, limits.megabytes, limits.seed) == (2.5, 512, 7)


@pytest.mark.parametrize("method", [SANITY, "hoare"])
def test_a_contract_edited_between_question_and_answer(thermostat: Path, tmp_path: Path, method: str) -> None:
    """The record would say `proved` of the old text, which nobody looked at."""
    found = survey(thermostat)
    assert isinstance(found, Survey)
    works = [w for w in found.catalogue.works if w.method == method and w.node == "thermostat"]
    contract = thermostat / "system.rcl"
    contract.write_text(contract.read_text().replace("Low = 18", "Low = 17"))
    asked = replace(works[0], obligations=works[0].obligations[:1])
    report = dispatch.settle(Workspace(tmp_path), asked, asked.obligations, tmp_path / "artifacts", new_run())
    (outcome,) = report.outcomes
    assert outcome.verdict is Verdict.ERROR
    assert outcome.details["retry"]
    assert "changed while" in outcome.summary
