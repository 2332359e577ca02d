"""What a command costs, with all processes that it starts, whoever waits for them."""

from __future__ import annotations

import contextlib
import ctypes
import os
import resource
import subprocess
import threading
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

SUBREAPER = 36  # PR_SET_CHILD_SUBREAPER of Linux: orphaned descendants become children of this process


@dataclass(frozen=True, slots=True)
class Cost:
    """Processor seconds of all descendants, and the peak of their memory together, in megabytes."""

    seconds: float
    megabytes: float
    output: str

    def __str__(self) -> str:
        return f"{self.seconds:7.2f} CPU s, {self.megabytes:6.0f} MB"


def cost(command: Sequence[str | Path], folder: Path, environment: Mapping[str, str] | None = None) -> Cost:
    """Runs the command; Linux only. Memory is proportional: a page shared by n processes counts as 1/n in each. A
    command that fails measures nothing: only the codes 0 and 1 (a gate fails) are accepted."""
    ctypes.CDLL(None).prctl(SUBREAPER, 1, 0, 0, 0)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    process = subprocess.Popen(
        list(map(str, command)),
        cwd=folder,
        env={**os.environ, **(environment or {})},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    over, peaks = threading.Event(), [0]
    watch = threading.Thread(target=_watch, args=(over, peaks))
    watch.start()
    output, told = process.communicate()
    over.set()
    watch.join()
    with contextlib.suppress(ChildProcessError):
        while os.waitpid(-1, os.WNOHANG)[0]:  # those that ended; a child of ours that goes on is none of the command's
            pass
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if process.returncode not in (0, 1):
        raise SystemExit(f"{told}\n{command[0]} ended with code {process.returncode}")
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return Cost(seconds, peaks[0] / 1024, output)


def _watch(over: threading.Event, peaks: list[int]) -> None:
    while not over.wait(0.05):
        peaks.append(sum(map(_kilobytes, _descendants())))
        peaks[:] = [max(peaks)]


def _descendants() -> list[int]:
    parents: dict[int, list[int]] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                parents.setdefault(int((entry / "stat").read_text().rpartition(")")[2].split()[1]), []).append(
                    int(entry.name)
                )
    found, at = list(parents.get(os.getpid(), ())), 0
    while at < len(found):
        found.extend(parents.get(found[at], ()))
        at += 1
    return found


def _kilobytes(pid: int) -> int:
    with contextlib.suppress(OSError):
        for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
            if line.startswith("Pss:"):
                return int(line.split()[1])
    return 0
