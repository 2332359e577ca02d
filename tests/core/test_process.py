"""Outside tools are bounded, and nothing that they start outlives them."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers import alive

from avow.base import process
from avow.base.tuning.running import WALL
from avow.base.tuning.sizes import OUTPUT_KEPT


def test_output_and_code_are_the_tools() -> None:
    done = process.run([sys.executable, "-c", "import sys; print('out'); print('err', file=sys.stderr); sys.exit(7)"])
    assert (done.code, done.stdout, done.stderr) == (7, "out\n", "err\n")


def test_a_tool_ends_when_nobody_waits_for_it_any_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process, "FORK_LOOK", 0.01)
    looks = iter([False, False, True])
    assert process.run(["sleep", "60"], seconds=60, stopped=lambda: next(looks)).timed_out
    assert not list(looks)
    assert process.run(["sleep", "0.1"], seconds=60, stopped=lambda: False).code == 0


def test_a_missing_tool_is_named() -> None:
    with pytest.raises(process.ToolMissing, match="no-such-tool"):
        process.run(["no-such-tool"])


def test_no_shell_sees_the_arguments() -> None:
    assert process.run(["echo", "$(id); `id` && x"]).stdout == "$(id); `id` && x\n"


def test_a_hanging_tool_is_killed_with_all_that_it_started(tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    script = f"sleep 60 & echo $! > {pids}; setsid sleep 60 & echo $! >> {pids}; sleep 60"
    start = time.monotonic()
    done = process.run(["bash", "-c", script], seconds=0.5)
    assert done.timed_out
    assert time.monotonic() - start < 50  # not as long as they sleep
    time.sleep(0.1)
    assert [pid for pid in map(int, pids.read_text().split()) if alive(pid)] == []


def test_a_tool_does_not_outlive_a_killed_avow(tmp_path: Path) -> None:
    pid_file = tmp_path / "pid"
    code = f"from avow.base import process; process.run(['bash', '-c', 'echo $$ > {pid_file}; exec sleep 60'])"
    avow = subprocess.Popen([sys.executable, "-c", code])
    deadline = time.monotonic() + 20
    while not (pid_file.is_file() and pid_file.read_text().strip()) and time.monotonic() < deadline:
        time.sleep(0.02)
    pid = int(pid_file.read_text())
    avow.kill()
    avow.wait()
    while alive(pid) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert not alive(pid)


def test_memory_is_bounded() -> None:
    done = process.run([sys.executable, "-c", "x = bytearray(2_000_000_000)"], megabytes=500, seconds=20)
    assert done.code not in (0, None)
    assert "MemoryError" in done.stderr


def test_endless_output_is_cut() -> None:
    done = process.run(["bash", "-c", "yes | head -c 9000000"], seconds=20)
    assert len(done.stdout) == OUTPUT_KEPT


def test_standard_input_is_closed_unless_given() -> None:
    assert process.run(["cat"], seconds=5).stdout == ""
    assert process.run(["cat"], seconds=5, stdin="héllo").stdout == "héllo"


def test_no_variable_of_ours_reaches_a_program(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("AVOW_Y", "JAVA_TOOL_OPTIONS", "DAFNY_HOME", "LD_LIBRARY_PATH", "CPATH", "HOME"):
        monkeypatch.setenv(name, "/ours")
    done = process.run(["env"], env={"AVOW_X": "1"})
    told = dict(line.split("=", 1) for line in done.stdout.splitlines())
    assert told.keys() <= {"AVOW_X", "PATH", "HOME", "TMPDIR", "LANG", "LC_ALL", "TZ"}
    assert told["AVOW_X"] == "1"
    assert told["HOME"] != "/ours"


@pytest.mark.parametrize(
    ("signal_name", "by_others"), [("SIGKILL", True), ("SIGTERM", True), ("SIGSEGV", False), ("SIGABRT", False)]
)
def test_who_ended_a_tool_is_known(monkeypatch: pytest.MonkeyPatch, signal_name: str, by_others: bool) -> None:
    monkeypatch.setattr(process.here, "ended_by_others", False)
    process.run([sys.executable, "-c", f"import os, signal; os.kill(os.getpid(), signal.{signal_name})"])
    assert process.ended_by_others() is by_others


def test_what_we_end_ourselves_was_not_ended_by_others(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process.here, "ended_by_others", False)
    assert process.run([sys.executable, "-c", "import time; time.sleep(60)"], seconds=0.2).timed_out
    assert not process.ended_by_others()


def test_a_stopwatch_counts_processor_seconds_of_all_that_was_started_and_not_the_machines_load() -> None:
    watch = process.Stopwatch()
    busy = "import time\nend = time.process_time() + 0.6\nwhile time.process_time() < end: pass\n{}"
    with subprocess.Popen([sys.executable, "-c", busy.format("input()")], stdin=subprocess.PIPE) as lasting:
        process.run([sys.executable, "-c", busy.format("")])
        begun = time.monotonic()
        while watch() < 1.1 and time.monotonic() < begun + 60:
            time.sleep(0.05)
        assert watch() >= 1.1, "both, the one that has ended and the one that still runs"
        lasting.kill()
    still, begun = process.Stopwatch(), time.monotonic()
    time.sleep(0.5)
    assert (time.monotonic() - begun) / WALL <= still() < 0.4
