"""Runs killed at any point, interrupted, out of space, or with a worker killed under them: the next run ends as an
undisturbed one does, nothing is lost or doubled, and the audit is clean."""

from __future__ import annotations

import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import evidence

from avow.base.files import write
from avow.base.verdict import Verdict
from avow.base.workspace import Workspace
from avow.evidence.ledger import Ledger
from avow.pipeline import assess
from avow.pipeline.reporter import _sweep
from avow.pipeline.run_info import Run
from avow.pipeline.state import State
from avow.pipeline.workload import Survey, survey

TEMPLATE = Path(__file__).parents[2] / "avow" / "cli" / "template" / "contracts" / "thermostat"
TIMES = int(os.environ.get("AVOW_CRASHES", "1"))
"""How many runs of each kind are disturbed; some dozens were, when this was written."""


def test_an_answer_that_a_killed_worker_did_not_give_is_asked_for_again(
    workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Such a run is not remembered as settled: else the next one would find nothing to do."""
    place = Workspace(workspace)
    surveyed = survey(Path(shutil.copytree(TEMPLATE, workspace / "contracts" / "thermostat")))
    assert isinstance(surveyed, Survey)
    state = State(place, Run("r", False))
    state.surveyed.append(surveyed)
    assess.ledger_of.cache_clear()
    work = surveyed.work("hoare")
    record = replace(evidence(work.obligations[0]), method="hoare", key=work.keys[work.obligations[0].id])
    assert assess.is_settled(state)
    Ledger(place.ledger("thermostat")).append(replace(record, verdict=Verdict.ERROR, details={"retry": True}))
    assert not assess.is_settled(state)
    Ledger(place.ledger("thermostat")).append(record)
    assert assess.is_settled(state)


@pytest.mark.filterwarnings("ignore:This process .*multi-threaded:DeprecationWarning")
def test_what_was_left_half_written_is_swept_away(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    place = Workspace(workspace)
    kept = place.artifacts / "s" / ".export.json"
    write(kept, "whole")

    def killed(*_: object) -> None:
        os._exit(9)

    child = os.fork()
    if child == 0:
        monkeypatch.setattr(os, "replace", killed)
        write(kept, "half")
    os.waitpid(child, 0)
    assert len(list(kept.parent.iterdir())) == 2
    _sweep(place)
    assert list(kept.parent.iterdir()) == [kept]
    assert kept.read_text() == "whole"


# -- for real -------------------------------------------------------------------------------------------------------


def avow(folder: Path, *command: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "avow", *command], cwd=folder, capture_output=True, text=True, timeout=300, check=False
    )


def begin(folder: Path) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "avow", "verify"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


def standing(folder: Path) -> object:
    """What a report says, without what may differ between two runs."""
    case = json.loads((folder / "reports" / "thermostat" / "report.json").read_text())
    statuses = {json.dumps(o["obligation"], sort_keys=True): (o["status"], o["standing"]) for o in case["obligations"]}
    return statuses, [(g["id"], g["passed"]) for g in case["gates"]], case["exit_code"]


def answers(folder: Path) -> list[tuple[str, str, str]]:
    """Every answer that the ledger has; an attempt that broke is none."""
    records = Ledger(Workspace(folder).ledger("thermostat")).records()
    return [(r.obligation, r.method, r.key) for r in (e.evidence for e in records) if r.verdict is not Verdict.ERROR]


def is_whole(folder: Path, undisturbed: object, before: list[tuple[str, str, str]]) -> None:
    done = avow(folder, "verify")
    assert done.returncode == 0, done.stdout + done.stderr
    assert standing(folder) == undisturbed
    after = answers(folder)
    assert len(after) == len(set(after)), "doubled"
    assert after[: len(before)] == before, "lost"
    told = avow(folder, "audit", "--json")
    assert (told.returncode, json.loads(told.stdout)["systems"]["thermostat"]["discrepancies"]) == (0, [])
    assert avow(folder, "report", "--check", "reports/thermostat").returncode == 0
    assert not list(folder.rglob("*.part"))


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fresh") / "robot"
    assert avow(folder.parent, "init", "robot").returncode == 0
    return folder


@pytest.fixture(scope="module")
def undisturbed(fresh: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[object, float]:
    """What a run comes to, and how many seconds it takes here and now."""
    folder = tmp_path_factory.mktemp("undisturbed") / "robot"
    shutil.copytree(fresh, folder)
    start = time.monotonic()
    assert avow(folder, "verify").returncode == 0
    return standing(folder), time.monotonic() - start


@pytest.mark.nightly
@pytest.mark.parametrize("how", ["killed", "interrupted", "a worker killed"])
def test_a_disturbed_run_is_taken_up(fresh: Path, undisturbed: tuple[object, float], tmp_path: Path, how: str) -> None:
    rng = random.Random(how)
    for time_number in range(TIMES):
        folder = tmp_path / str(time_number)
        shutil.copytree(fresh, folder)
        run = begin(folder)
        time.sleep(rng.uniform(0.1, undisturbed[1]))
        match how:
            case "killed":
                run.kill()
            case "interrupted":
                run.send_signal(signal.SIGINT)
            case _:
                kill_one_below(run.pid, rng)
        text = run.communicate(timeout=200)[0]
        assert "Traceback" not in text
        is_whole(folder, undisturbed[0], answers(folder))


def command_of(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def kill_one_below(pid: int, rng: random.Random) -> None:
    children: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent = int(stat.read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
        children.setdefault(parent, []).append(int(stat.parent.name))
    found, todo = list[int](), [pid]
    while todo:
        below = children.get(todo.pop(), [])
        found += below
        todo += below
    # a subject that dies under its test is a finding about the subject
    found = [child for child in found if b"host.py" not in command_of(child)]
    if found:
        try:
            os.kill(rng.choice(found), signal.SIGKILL)
        except ProcessLookupError:
            return


@pytest.mark.nightly
@pytest.mark.parametrize("kilobytes", [8, 24, 40])
def test_a_file_that_cannot_grow(
    fresh: Path, undisturbed: tuple[object, float], tmp_path: Path, kilobytes: int
) -> None:
    """As a full disk does, at different points: the ledger, the artifacts, the report."""
    folder = tmp_path / "robot"
    shutil.copytree(fresh, folder)
    limited = subprocess.run(
        [sys.executable, "-m", "avow", "verify"],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (kilobytes * 1024,) * 2),
        env={**os.environ, "PYTHONDONTWRITEBYTECODE": "1"},
    )
    assert limited.returncode != 0, limited.stdout
    assert "Traceback" not in limited.stdout + limited.stderr
    is_whole(folder, undisturbed[0], answers(folder))
