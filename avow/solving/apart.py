"""Solvers in processes of their own: a crash of one, or one that does not keep its time, is an unknown answer.

``python -m avow.solving.apart`` reads lines ``[solver, script, limit]`` and writes a line for each: the answer, and the
digest of what it is the answer to, so that no answer is taken for another's.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import subprocess
import sys
import threading
from dataclasses import dataclass, field
from importlib import metadata, util

from avow.base.files import digest
from avow.base.process import die_with
from avow.kernel.solvers import NET_MS, Said, Solvers, ask_z3
from avow.solving.cvc5_process import answer
from avow.tuning.effort import KERNEL_SECOND_STEPS


@dataclass(slots=True)
class Apart:
    """A solver (`z3` or `cvc5`). `steps`: its own, for all questions together; what is asked later is `unknown`."""

    solver: str
    steps: float = math.inf
    _owner: int = 0
    _process: subprocess.Popen[str] | None = None
    _known: dict[tuple[str, int], Said] = field(default_factory=dict)

    def __call__(self, script: str, limit: int = KERNEL_SECOND_STEPS) -> Said:
        """`limit`: of its own steps."""
        question = (script, limit)
        if question not in self._known:
            if self.steps <= 0:
                return Said.UNKNOWN
            self._known[question], used = self._ask(script, int(min(limit, self.steps)))
            self.steps -= used
        return self._known[question]

    def _ask(self, script: str, limit: int) -> tuple[Said, int]:
        if self._owner != os.getpid():
            self._process = None  # of the process that this one is a fork of
        if self._process is None or self._process.poll() is not None:
            self.close()
            self._owner = os.getpid()
            command = [sys.executable, "-P", "-m", "avow.solving.apart", str(self._owner)]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        net = threading.Timer(NET_MS / 1000, process.kill)
        net.start()
        try:
            process.stdin.write((line := json.dumps([self.solver, script, limit])) + "\n")
            process.stdin.flush()
            said, used, about = process.stdout.readline().split()
            return (Said(said), int(used)) if about == digest(line) else (Said.UNKNOWN, limit)
        except (OSError, ValueError):
            return Said.UNKNOWN, limit
        finally:
            net.cancel()

    def close(self) -> None:
        if self._process is None:
            return
        self._process.kill()
        self._process.wait()
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):  # what it was to read can no longer be written
                stream.close() if stream is not None else None
        self._process = None


@dataclass(slots=True)
class Both:
    """Z3 and, where it is installed, cvc5, each in a process of its own, for as long as a ``with`` lasts. `steps`: of
    cvc5, for all questions together. `known`: answers of Z3 to be used and added to."""

    steps: float = math.inf
    known: dict[tuple[str, int], Said] = field(default_factory=dict)
    _started: tuple[Apart, ...] = ()

    def __enter__(self) -> Solvers:
        first, second = self._started = (Apart("z3"), Apart("cvc5", self.steps))
        return Solvers(z3=first, second=second if "cvc5" in versions() else None, known=self.known)

    def __exit__(self, *_: object) -> None:
        for solver in self._started:
            solver.close()


def versions() -> dict[str, str]:
    """The solvers that are here, with their versions."""
    found = {"z3": metadata.version("z3-solver")}
    if util.find_spec("cvc5") is not None:
        found["cvc5"] = metadata.version("cvc5")
    return found


if __name__ == "__main__":
    die_with(int(sys.argv[1]))
    for line in map(str.strip, sys.stdin):
        solver, script, limit = json.loads(line)
        if solver == "z3":
            print(ask_z3(script, limit), 0, digest(line), flush=True)
        else:
            said, used = answer(f"{script}(check-sat)\n", limit)
            print(said or Said.UNKNOWN, used, digest(line), flush=True)
