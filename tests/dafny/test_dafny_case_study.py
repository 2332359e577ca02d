"""The case study's Dafny implementations, and the paper's listing, through the whole backend."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backend_kit.protocol import Backend, Job, Limits
from avow.backends.dafny import BACKEND
from avow.base.verdict import Link, Outcome, Verdict
from avow.system.load import load_system

CONTRACTS = Path(__file__).resolve().parents[2] / "contracts"
MakeJob = Callable[..., Job]


def settle(job: Job) -> dict[str, Outcome]:
    report = BACKEND.discharge(job, job.root, Limits(seconds=120))
    return {o.obligation.rsplit("/", 1)[1]: o for o in report.outcomes}


def job_for(make_job: MakeJob, system: str, node: str, file: str) -> Job:
    root = CONTRACTS / system
    return make_job(root / "system.rcl", node, root, implementation=file)


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_the_radiation_sensor_is_proved(make_job: MakeJob) -> None:
    job = job_for(make_job, "remote_inspection", "radiationSensor", "models/radiation_sensor_impl.dfy")
    assert BACKEND.check(job) == ()
    for outcome in settle(job).values():
        assert outcome.verdict is Verdict.PROVED, outcome
        assert outcome.link is Link.GENERATED
        assert outcome.hypotheses == ()


@pytest.mark.needs_dafny
@pytest.mark.nightly
def test_the_agent_is_proved_for_its_map(make_job: MakeJob) -> None:
    job = job_for(make_job, "remote_inspection", "agent", "models/agent_impl.dfy")
    assert BACKEND.check(job) == ()
    outcomes = settle(job)
    assert len(outcomes) == 5
    for outcome in outcomes.values():
        assert outcome.verdict is Verdict.PROVED, outcome
        assert outcome.hypotheses == ("added assumption of the implementation, Env: IsMap(in_wayP, Map())",)


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_the_papers_listing_is_not_accepted(make_job: MakeJob) -> None:
    job = job_for(make_job, "remote_inspection_published", "agent", "models/agent_paper.dfy")
    outcomes = settle(job)
    assert len(outcomes) == 3
    for outcome in outcomes.values():
        assert outcome.verdict is Verdict.ERROR
        assert "13 errors" in outcome.summary
        assert "unresolved identifier" in outcome.summary
        assert "module AgentImpl refines AgentSpec" in outcome.summary


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_dafny_opens_a_skeleton(tmp_path: Path) -> None:
    system = load_system(CONTRACTS / "remote_inspection")
    for name, text in BACKEND.translate("dafny", system, system.contract.node("radiationSensor")).files.items():
        (tmp_path / name).write_text(text)
    skeleton = tmp_path / "radiationSensor_impl.dfy"
    done = subprocess.run(["dafny", "/compile:0", "/noVerify", skeleton], capture_output=True, text=True, check=False)
    assert (done.returncode, "Error" in done.stdout) == (0, False), done.stdout


_MUTANTS: tuple[tuple[str, str, str, set[str]], ...] = (
    ("next := Types.Phase.exploring;", "next := Types.Phase.leaving;", "agent", {"end_of_mission"}),
    ("r >= 120.0", "r > 120.0", "radiationSensor", {"medium"}),
    ("i == here || in_before(i)", "i == here", "radiationSensor", {"marks_inspected"}),
)


@pytest.mark.needs_dafny
@pytest.mark.slow
@pytest.mark.parametrize(("old", "new", "node", "broken"), some(_MUTANTS[1:] + _MUTANTS[:1], 1))
def test_a_wrong_implementation_is_not_proved(
    make_job: MakeJob, tmp_path: Path, old: str, new: str, node: str, broken: set[str]
) -> None:
    file = {"agent": "agent_impl.dfy", "radiationSensor": "radiation_sensor_impl.dfy"}[node]
    text = (CONTRACTS / "remote_inspection/models" / file).read_text()
    assert old in text
    (tmp_path / file).write_text(text.replace(old, new))
    job = make_job(CONTRACTS / "remote_inspection/system.rcl", node, tmp_path, implementation=file)
    verdicts = {name: outcome.verdict for name, outcome in settle(job).items()}
    assert all(verdicts[name] is Verdict.UNKNOWN for name in broken), verdicts


def test_nothing_is_run_where_dafny_is_missing(make_job: MakeJob, monkeypatch: Any) -> None:
    from avow.backends.dafny import backend
    from avow.base.tools import Tool

    monkeypatch.setattr(backend, "dafny", lambda: Tool("dafny", None, None, "sudo apt install dafny"))
    job = job_for(make_job, "remote_inspection", "radiationSensor", "models/radiation_sensor_impl.dfy")
    for outcome in settle(job).values():
        assert outcome.verdict is Verdict.NOT_RUN
        assert "sudo apt install dafny" in outcome.summary
