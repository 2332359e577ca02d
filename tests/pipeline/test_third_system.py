"""A system with other names and types works without touching the code: Hoare, Hypothesis and the agent checker."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from calculus.make import discharge as discharge_composition

from avow.backend_kit.protocol import Limits
from avow.base.files import write
from avow.base.verdict import Outcome, Verdict
from avow.pipeline.methods import method_backend, method_job
from avow.pipeline.slices import SanitySlice
from avow.pipeline.work import Work, planned_method
from avow.pipeline.worker import discharge_sanity
from avow.pipeline.workload import Survey, survey

FERRY = Path(__file__).parent / "fixtures" / "ferry"


@pytest.fixture
def harbour(workspace: Path) -> Path:
    shutil.copytree(FERRY, workspace / "contracts" / "ferry")
    return workspace


def verify(folder: Path) -> tuple[int, dict[tuple[str, str], dict[str, object]], str]:
    done = subprocess.run(
        [sys.executable, "-m", "doit", "verify"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=200,
        env=os.environ,
        check=False,
    )
    lines = (folder / "artifacts" / "ledger" / "ferry.jsonl").read_text().splitlines()
    records = [json.loads(line)["evidence"] for line in lines]
    found = {(r["obligation"].removeprefix("ferry/"), r["method"]): r for r in records}
    return done.returncode, found, done.stdout + done.stderr


def settle(work: Work, folder: Path) -> tuple[Outcome, ...]:
    """What a worker does, here: `doit verify` starts some twenty processes for it."""
    limits = Limits(seconds=60)
    match work.engine:
        case "language":
            return ()
        case "sanity":
            assert work.cut is not None
            cut = work.cut()
            assert isinstance(cut, SanitySlice)
            return discharge_sanity(cut, work.obligations, limits).outcomes
        case "compose":
            return discharge_composition(work.system, work.obligations, limits)
    method = planned_method(work)
    backend = method_backend(work.system, method)
    job = method_job(work.system, work.system.contract.node(work.node), method)
    assert not [d for d in backend.check(job) if d.is_error]
    for name, text in backend.export(job).items():
        write(folder / name, text)
    return backend.discharge(job, folder, limits).outcomes


@pytest.mark.nightly
def test_each_engine_settles_its_part(tmp_path: Path) -> None:
    system = survey(FERRY)
    assert isinstance(system, Survey)
    found = {
        (outcome.obligation.removeprefix("ferry/"), work.method): outcome.verdict
        for work in system.catalogue.works
        for outcome in settle(work, tmp_path / work.node / work.method)
    }
    assert found["gauge/guarantee/good", "hoare"] is Verdict.PROVED
    assert found["gauge/guarantee/good", "hypothesis"] is Verdict.TESTED
    assert found["pilot/guarantee/docks", "ajpf"] is Verdict.CHECKED
    assert found["pilot/guarantee/docks", "hypothesis"] is Verdict.TESTED
    assert found["pilot/sanity/realizable", "sanity"] is Verdict.PROVED
    assert found["system/requirement/SAFE", "compose"] is Verdict.PROVED
    assert not {Verdict.UNKNOWN, Verdict.ERROR, Verdict.NOT_RUN} & set(found.values())


@pytest.mark.nightly
def test_it_verifies(harbour: Path) -> None:
    code, found, text = verify(harbour)
    assert code == 0, text
    assert found["gauge/guarantee/good", "hoare"]["verdict"] == "proved"
    assert found["pilot/guarantee/docks", "ajpf"]["verdict"] == "checked"
    assert found["pilot/guarantee/docks", "hypothesis"]["verdict"] == "tested"
    assert found["pilot/sanity/realizable", "sanity"]["verdict"] == "proved"
    assert found["system/requirement/SAFE", "compose"]["verdict"] == "proved"


@pytest.mark.nightly
def test_a_careless_pilot_is_caught_by_both_of_its_methods(harbour: Path) -> None:
    models = harbour / "contracts" / "ferry" / "models"
    program, function = models / "skipper.gwen", models / "harbour.py"
    program.write_text(program.read_text().replace("+high", "+never"))
    function.write_text(function.read_text().replace('level != "ok"', 'level == "low"'))
    code, found, text = verify(harbour)
    assert code == 1, text
    assert found["pilot/guarantee/waits", "ajpf"]["verdict"] == "refuted"
    assert found["pilot/guarantee/waits", "ajpf"]["counterexample"]["trace"]
    assert found["pilot/guarantee/waits", "hypothesis"]["verdict"] == "refuted"
    assert ["in.level", "high"] in found["pilot/guarantee/waits", "hypothesis"]["counterexample"]["values"]


@pytest.mark.nightly
def test_a_requirement_that_does_not_follow_is_refuted(harbour: Path) -> None:
    plan = harbour / "contracts" / "ferry" / "plan.yaml"
    plan.write_text(plan.read_text().replace("gauge.depth < 2.5 ->", "gauge.depth < 2.6 ->"))
    code, found, text = verify(harbour)
    assert code == 1, text
    record = found["system/requirement/SAFE", "compose"]
    assert record["verdict"] == "refuted"
    depth = next(v for name, v in record["counterexample"]["values"] if name.endswith("depth"))
    assert 2.5 <= float(depth) < 2.6
