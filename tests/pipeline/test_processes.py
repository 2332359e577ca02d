"""A job's process, forked or started anew: bounded, killed with all that it started, its end turned into a verdict."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import alive, wait_for

from avow.backend_kit.protocol import Limits, Report
from avow.base import process
from avow.base.tuning.running import WALL
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.pipeline import dispatch, processes
from avow.pipeline.run_info import new_run
from avow.pipeline.workload import Survey, survey

BACKEND = """
import os, signal, subprocess, sys, time
from pathlib import Path
from avow.base import process
from avow.backend_kit.protocol import Backend, Report
from avow.base.verdict import Link, Outcome, Verdict

class Odd(Backend):
    name, title, version, green_means = "odd", "does as it is told", "1", ""
    strength, link = Verdict.TESTED, Link.GUIDED
    options_schema = {"type": "object"}
    def discharge(self, job, folder, limits):
        match job.options["does"]:
            case "answers":
                print("never mind")
            case "exits":
                os._exit(3)
            case "aborts":
                os.abort()
            case "raises":
                raise ValueError("of its own")
            case "hangs":
                pids = [os.getpid()]
                for own_session in (False, True):
                    pids.append(subprocess.Popen(["sleep", "300"], start_new_session=own_session).pid)
                Path("pids.tmp").write_text(" ".join(map(str, pids)))
                os.replace("pids.tmp", "pids")
                process.run(["sleep", "300"], seconds=300)
        text = f"{os.getcwd()} {os.environ.get('SAID')} {os.getpgid(0) == os.getsid(0) == os.getpid()} {sys.path[0]}"
        return Report(tuple(Outcome(o.id, Verdict.TESTED, text) for o in job.obligations), "odd", "1")

BACKEND = Odd()
"""


@pytest.fixture(scope="module")
def odd(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A workspace with a system for each thing that the backend may do."""
    root = tmp_path_factory.mktemp("odd")
    (root / "odd_backend_of_test_processes.py").write_text(BACKEND)
    for does in ("answers", "exits", "aborts", "raises", "hangs"):
        folder = root / "contracts" / does
        folder.mkdir(parents=True)
        (folder / "system.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee g (out.b) }")
        methods = f"methods: [{{odd: {{does: {does}}}}}]"
        (folder / "plan.yaml").write_text(
            f"plugins: [odd_backend_of_test_processes]\nnodes: {{n: {{criticality: low, {methods}}}}}\n"
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(root))
        patch.setenv("PYTHONPATH", str(root))  # where a worker stands is not where it looks for modules
        yield root


@pytest.fixture(params=["forked", "anew"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    way: str = request.param
    if way == "anew":
        monkeypatch.setenv(processes.PLAIN, "1")
    elif sys.platform != "linux":
        pytest.skip("only Linux forks")
    return way


def settle(root: Path, does: str) -> tuple[Outcome, Report]:
    """With a server of its own, where this process can be forked."""
    found = survey(root / "contracts" / does)
    assert isinstance(found, Survey)
    work = found.work("odd")
    folder = root / "artifacts" / does
    folder.mkdir(parents=True, exist_ok=True)
    report = dispatch.settle(Workspace(root), work, work.obligations, folder, new_run())
    (outcome,) = report.outcomes
    return outcome, report


def pids(root: Path) -> list[int]:
    """Of the hanging job and of what it started, once it hangs."""
    path = root / "pids"
    wait_for(path.is_file)
    return [int(word) for word in path.read_text().split()]


@pytest.mark.slow
def test_it_answers_from_a_session_of_its_own(odd: Path, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for said in ("this", "that"):
        monkeypatch.setenv("SAID", said)
        outcome, _ = settle(odd, "answers")
        assert (outcome.verdict, outcome.summary) == (Verdict.TESTED, f"{odd} {said} True {odd}")


@pytest.mark.parametrize(
    ("does", "why"),
    [("exits", "ended with code 3"), ("aborts", f"ended with code -{int(signal.SIGABRT)}"), ("raises", "of its own")],
)
def test_a_crash_is_a_verdict_and_takes_nothing_with_it(odd: Path, does: str, why: str) -> None:
    outcome, report = settle(odd, does)
    assert outcome.verdict is Verdict.ERROR
    assert why in outcome.summary
    assert ("Traceback" in report.logs.get("worker.log", "")) == (does == "raises")
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED


@pytest.mark.slow
def test_a_work_that_hangs_is_killed_with_all_that_it_started(
    odd: Path, way: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    (odd / "pids").unlink(missing_ok=True)
    for limit in (1.0, 4.0, 16.0, 64.0):  # until the work gets far enough to hang, on a busy machine
        monkeypatch.setattr(processes, "WORKER_GRACE", limit - (WALL + 1) * Limits().seconds)
        outcome, _ = settle(odd, "hangs")
        assert outcome.verdict is Verdict.UNKNOWN
        assert "no answer within" in outcome.summary
        if (odd / "pids").exists():
            break
    started = pids(odd)
    wait_for(lambda: not any(map(alive, started)))


@pytest.mark.slow
def test_an_interrupt_ends_all_works(odd: Path, way: str) -> None:
    (odd / "pids").unlink(missing_ok=True)
    found: list[Outcome] = []
    thread = threading.Thread(target=lambda: found.append(settle(odd, "hangs")[0]))
    thread.start()
    started = pids(odd)
    process.kill_all()
    thread.join(120)
    assert found[0].verdict is Verdict.ERROR
    wait_for(lambda: not any(map(alive, started)))
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED


_RUN = """
import sys, threading
from pathlib import Path
from avow.backend_kit.registry import trust_plugins
from avow.base.workspace import Workspace
from avow.pipeline import dispatch
from avow.pipeline.run_info import new_run
from avow.pipeline.workload import survey

root, run = Path(sys.argv[1]), new_run()
trust_plugins()

def settle(does):
    work = survey(root / "contracts" / does).work("odd")
    print(dispatch.settle(Workspace(root), work, work.obligations, root, run).outcomes[0].verdict, flush=True)

run.processes.prepare(root)
for does in sys.argv[2:]:
    threading.Thread(target=settle, args=(does,)).start()
"""


def _run(root: Path, *words: str) -> subprocess.Popen[str]:
    """A process with one thread, which settles these systems at once."""
    return subprocess.Popen(
        [sys.executable, "-P", "-c", _RUN, str(root), *words], cwd="/", text=True, stdout=-1, stderr=-1
    )


def test_jobs_at_once_do_not_wait_for_each_other(odd: Path) -> None:
    (odd / "pids").unlink(missing_ok=True)
    with _run(odd, "hangs") as first:
        started = pids(odd)
        with _run(odd, *["answers"] * 3) as run:
            assert run.communicate()[0].split() == ["tested"] * 3
        assert all(map(alive, started))
        first.kill()
    wait_for(lambda: not any(map(alive, started)))


@pytest.mark.slow
@pytest.mark.parametrize("whose", ["the run", "the job's process"])
def test_nothing_outlives_what_is_killed(odd: Path, way: str, whose: str) -> None:
    (odd / "pids").unlink(missing_ok=True)
    with _run(odd, "hangs") as run:
        started = pids(odd)
        family = process._descendants(run.pid)
        assert set(started) <= set(family)
        os.kill(run.pid if whose == "the run" else started[0], signal.SIGKILL)
        said, _ = run.communicate(timeout=120)
    wait_for(lambda: not any(map(alive, family)))
    assert ("error" in said) == (whose != "the run")
