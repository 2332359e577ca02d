"""A work's process, forked or started anew: bounded, killed with all that it started, its end turned into a verdict."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from helpers import alive, wait_for

from avow.backend_kit.protocol import Limits, Report
from avow.base import process
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.pipeline import asking, forks
from avow.pipeline.run_info import Run
from avow.pipeline.workload import Survey, survey

RUN = Run("a", False)

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
    (root / "odd_backend_of_test_forks.py").write_text(BACKEND)
    for does in ("answers", "exits", "aborts", "raises", "hangs"):
        folder = root / "contracts" / does
        folder.mkdir(parents=True)
        (folder / "system.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee g (out.b) }")
        methods = f"methods: [{{odd: {{does: {does}}}}}]"
        (folder / "plan.yaml").write_text(
            f"plugins: [odd_backend_of_test_forks]\nnodes: {{n: {{criticality: low, {methods}}}}}\n"
        )
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(root))
        patch.setenv("PYTHONPATH", str(root))  # where a worker stands is not where it looks for modules
        yield root


@pytest.fixture(params=["forked", "anew"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    way: str = request.param
    if way == "anew":
        monkeypatch.setenv(forks.PLAIN, "1")
    elif sys.platform != "linux":
        pytest.skip("only Linux forks")
    return way


def settle(root: Path, does: str) -> tuple[Outcome, Report]:
    os.environ.pop("PYTEST_CURRENT_TEST", None)  # with another environment it is another server
    found = survey(root / "contracts" / does)
    assert isinstance(found, Survey)
    work = found.work("odd")
    folder = root / "artifacts" / does
    folder.mkdir(parents=True, exist_ok=True)
    report = asking.settle(Workspace(root), work, work.obligations, folder, RUN)
    (outcome,) = report.outcomes
    return outcome, report


def pids(root: Path) -> list[int]:
    """Of the hanging work and of what it started, once it hangs."""
    path = root / "pids"
    wait_for(path.is_file)
    return [int(word) for word in path.read_text().split()]


def server() -> int:
    assert RUN.forks._server is not None
    return RUN.forks._server._process.pid


@pytest.mark.slow
def test_it_answers_from_a_session_of_its_own(odd: Path, way: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for said in ("this", "that"):  # a fork has the environment of now, not of the server's start
        monkeypatch.setenv("SAID", said)
        outcome, _ = settle(odd, "answers")
        assert (outcome.verdict, outcome.summary) == (Verdict.TESTED, f"{odd} {said} True {odd}")
    if way == "forked":
        first = server()
        settle(odd, "answers")
        assert server() == first


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
    settle(odd, "answers")  # from here on, a server is there
    for limit in (1.0, 4.0, 16.0, 64.0):  # until the work gets far enough to hang, on a busy machine
        monkeypatch.setattr(asking, "WORKER_GRACE", limit - 2 * Limits().seconds)
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
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED, "what was killed is started again for the next run"


def test_works_at_once_do_not_hold_each_other(odd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fork that kept another's connection open would keep it from being killed, or from being heard to end."""
    (odd / "pids").unlink(missing_ok=True)
    monkeypatch.delenv(forks.PLAIN, raising=False)
    thread = threading.Thread(target=settle, args=(odd, "hangs"))
    thread.start()
    started = pids(odd)
    for _ in range(3):
        assert settle(odd, "answers")[0].verdict is Verdict.TESTED
    assert all(map(alive, started))
    process.kill_all()
    thread.join(120)


@pytest.mark.slow
def test_nothing_outlives_a_killed_avow(odd: Path, way: str) -> None:
    (odd / "pids").unlink(missing_ok=True)
    script = f"""
        from pathlib import Path
        from avow.backend_kit.registry import trust_plugins
        from avow.pipeline import asking
        from avow.pipeline.run_info import new_run
        from avow.pipeline.workload import survey
        from avow.base.workspace import Workspace
        root = Path({str(odd)!r})
        trust_plugins()
        work = survey(root / "contracts" / "hangs").work("odd")
        asking.settle(Workspace(root), work, work.obligations, root, new_run())
    """
    run = subprocess.Popen([sys.executable, "-c", textwrap.dedent(script)], cwd=odd)
    started = pids(odd)
    family = process._descendants(run.pid)
    assert started[0] in family
    assert set(started) <= set(family)
    run.send_signal(signal.SIGKILL)
    run.wait()
    wait_for(lambda: not any(map(alive, family)))


@pytest.mark.slow
@pytest.mark.parametrize("whose", ["the work's process", "the server"])
def test_nothing_outlives_a_process_that_is_killed_on_the_way(odd: Path, way: str, whose: str) -> None:
    """The run itself goes on."""
    if whose == "the server" and way == "anew":
        pytest.skip("there is none")
    (odd / "pids").unlink(missing_ok=True)
    found: list[Outcome] = []
    thread = threading.Thread(target=lambda: found.append(settle(odd, "hangs")[0]))
    thread.start()
    started = pids(odd)
    (above,) = [pid for pid in process._descendants(os.getpid()) if started[0] in process.children(pid)]
    os.kill(started[0] if whose == "the work's process" else above, signal.SIGKILL)
    thread.join(120)
    assert found[0].verdict is Verdict.ERROR
    wait_for(lambda: not any(map(alive, started)))
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED


@pytest.mark.nightly
def test_without_a_server_there_is_a_new_python(odd: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SAID", "without")
    monkeypatch.setattr(forks, "FORK_START", 0.0)
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED
    monkeypatch.setattr(forks, "_Server", None)  # it is not tried again
    assert settle(odd, "answers")[0].verdict is Verdict.TESTED
