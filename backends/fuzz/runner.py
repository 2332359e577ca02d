"""Runs what was built, apart from everything: a script that says through its channel what came of it.

``python runner.py CHANNEL FILE``: the file's question is a campaign of libFuzzer, or runs for the plain program.
"""

from __future__ import annotations

import json
import os
import resource
import secrets
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from avow.base import process
from avow.base.codec import to_json
from avow.base.verdict import Isolation
from avow.isolation import judge
from avow.isolation.level import available, sealed
from avow.isolation.program import Program
from avow.isolation.subject import SubjectFailed
from avow.tuning.running import SUBJECT_PATIENCE

_OPTIONS = {
    "ASAN_OPTIONS": "detect_leaks=0:symbolize=1:handle_abort=0:allocator_may_return_null=0",
    "UBSAN_OPTIONS": "print_stacktrace=0:halt_on_error=1",
}
_SCRATCH = "/tmp/avow-scratch"


def campaign(question: dict[str, Any]) -> dict[str, Any]:
    """One run of libFuzzer. `done`: it ended as it should, with so many runs; nothing that the subject prints says
    so."""
    level = available()
    folder, kept = Path(question["folder"]), Path(question["kept"])
    nonce = secrets.token_hex(16)
    channel = judge.Channel()
    source, nonces = os.pipe()
    os.write(nonces, nonce.encode() + b"\n")
    os.close(nonces)
    command = [str(folder / "fuzz"), *question["options"], f"-artifact_prefix={kept}/fault-", str(kept / "corpus")]
    if level is Isolation.SEALED:
        command = sealed(command, (folder, Path(question["root"])), _SCRATCH, (kept,))
    told = {"AVOW_CHANNEL": str(channel.theirs), "AVOW_NONCE": str(source), "HOME": str(kept), "TMPDIR": str(kept)}
    code, left, said, text = _ended(command, kept, question["seconds"], channel, told, source)
    words = said.split()
    closed = len(words) == 3 and said.endswith("\n") and words[0] == nonce
    done = closed and words[1] == "done" and code == 0
    fault = "the source left processes behind" if left and level is not Isolation.SEALED else ""
    if closed and words[1] == "left":
        fault = fault or "the source ended the process within a step"
    return {
        "code": code,
        "done": int(words[2]) if done and words[2].isdigit() else 0,
        "fault": fault,
        "log": text[-20_000:],
        "isolation": level.value,
    }


def _ended(
    command: list[str],
    cwd: Path,
    seconds: float,
    channel: judge.Channel,
    told: Mapping[str, str],
    given: int,
) -> tuple[int | None, bool, str, str]:
    """Run a build with sanitizers to its end, and end all that it leaves; `given` is a descriptor that it reads. Its
    exit code (None: its time was up), whether it left something, what came through the channel, and its log."""
    with tempfile.TemporaryFile() as log:
        started = subprocess.Popen(
            command,
            cwd=cwd,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=log,
            env={**_OPTIONS, "PATH": os.environ.get("PATH", os.defpath), **told, "LC_ALL": "C.UTF-8"},
            start_new_session=True,
            pass_fds=(channel.theirs, given),
        )
        process.watch(started.pid)
        os.close(channel.theirs)
        try:
            code: int | None = started.wait(seconds)
        except subprocess.TimeoutExpired:
            code = None
        process.kill_tree(started.pid)
        started.wait()
        process.unwatch(started.pid)
        left = process.end_orphans()
        said = channel.close() or b""
        log.seek(0)
        return code, left, said.decode("utf-8", "replace"), log.read(1 << 20).decode("utf-8", "replace")


def asked(question: dict[str, Any]) -> dict[str, Any]:
    """The runs, each on a node of its own; and once more in the other order, by another process, of a build in which
    what nothing was written to holds other bytes: what comes of chance, of the clock, of such bytes, or of the runs
    before is no answer to a run."""
    end = time.monotonic() + question["seconds"]
    runs: list[list[str]] = question["runs"]
    first, faults, program = _all(question, Path(question["program"]), runs, end)
    silent = bool(program.silent)
    unsteady = None
    if question["twin"] and not faults:
        order = [k for k in reversed(range(len(first))) if not first[k]["crash"]]
        again, faults, twin = _all(question, Path(question["twin"]), [runs[k] for k in order], end)
        silent = bool(twin.silent)
        for k, other in zip(order, again, strict=False):
            if other != first[k]:
                unsteady = k
    return {
        "runs": first,
        "fault": faults,
        "silent": silent,
        "unsteady": unsteady,
        "observed": to_json(program.observed()[1:]),  # no interpreter runs it
        "isolation": program.isolation.value,
    }


def _all(
    question: dict[str, Any], path: Path, runs: list[list[str]], end: float
) -> tuple[list[dict[str, Any]], str, Program]:
    program = Program(path, SUBJECT_PATIENCE, Path(question["root"]))
    found: list[dict[str, Any]] = []
    crashes = 0
    fault = ""
    try:
        for run in runs:
            if time.monotonic() > end:
                break
            replies = program.ask_all([{"command": command} for command in ("N", *run)])
            failed = next((r for r in replies if isinstance(r, SubjectFailed)), None)
            crash = program.crashed() if failed is not None else ""
            if failed is not None and (program.fault or not crash):
                fault = str(failed)
                break
            found.append({"replies": [r for r in replies if not isinstance(r, SubjectFailed)], "crash": crash})
            crashes += bool(crash)
            if crashes >= question["crashes"]:
                break
    finally:
        fault = program.close() or fault
    return found, fault, program


def shown(question: dict[str, Any]) -> dict[str, Any]:
    """One run by the program with sanitizers: its answers as far as they go, and the report with which it ends."""
    level = available()
    program = Path(question["program"])
    channel = judge.Channel()
    with tempfile.TemporaryFile() as lines:
        for k, command in enumerate(("N", *question["runs"][0])):
            lines.write(f"{k}|{command}\n".encode())
        lines.flush()
        lines.seek(0)
        command = [str(program), str(lines.fileno()), str(channel.theirs), "/avow-unmarked", "alone"]
        if level is Isolation.SEALED:
            command = sealed(command, (program.parent, Path(question["root"])), _SCRATCH)
        code, _, said, text = _ended(command, Path(question["root"]), question["seconds"], channel, {}, lines.fileno())
    replies: list[Any] = []
    for line in said.splitlines():
        try:
            message = json.loads(line)
        except ValueError:
            break
        if message.get("turn") == str(len(replies)):
            replies.append(message["replies"][0]["value"])
    return {"replies": replies, "code": code, "log": text[:20_000]}


_QUESTIONS = {"campaign": campaign, "runs": asked, "shown": shown}


def main() -> None:
    channel = int(sys.argv[1])
    os.set_inheritable(channel, False)
    process.adopt_orphans()
    question = json.loads(Path(sys.argv[2]).read_text(encoding="utf-8"))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    judge.say(channel, _QUESTIONS[question["what"]](question))


if __name__ == "__main__":
    main()
