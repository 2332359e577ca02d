"""Solvers in processes of their own: a crash, or a solver that exceeds its time, is an unknown answer.

``python -P -m avow.solving.apart PARENT`` reads questions as lines of JSON, ``[solver, script, limit]``, and writes a
line for each, ``[answer, steps]``: starting Python and a solver costs more than most questions. On some scripts cvc5
does not keep its own limits (seen: sequences of tuples), and a call into a library cannot be ended from Python.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import re
import select
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from importlib import util
from typing import Any

from avow.base import process
from avow.base.tuning.effort import KERNEL_SECOND_STEPS
from avow.base.tuning.sizes import ANSWERED_BY_ONE
from avow.kernel.solvers import NET_MS, Reply, Solvers, ask_z3


class NoAnswer(Exception):  # noqa: N818 - it says what it is
    """The process ended without an answer."""


@dataclass(slots=True)
class Apart:
    """A solver (`z3` or `cvc5`). Its process is started at the first question, and again after a question that it did
    not answer and in a fork of this process. Thread-safe. `steps`: its own, for all questions together; the answer to
    later ones is `unknown`."""

    solver: str
    steps: float = math.inf
    _owner: int = 0
    _asked: int = 0
    _process: subprocess.Popen[bytes] | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _known: dict[tuple[str, int], Reply] = field(default_factory=dict)

    def __call__(self, script: str, limit: int = KERNEL_SECOND_STEPS) -> Reply:
        """`limit`: of its own steps."""
        question = (script, limit)
        if question not in self._known:
            if self.steps <= 0:
                return Reply.UNKNOWN
            self._known[question], used = self._said(script, int(min(limit, self.steps)))
            self.steps -= used
        return self._known[question]

    def _said(self, script: str, limit: int) -> tuple[Reply, int]:
        try:
            answer, used = self.ask(script if self.solver == "z3" else f"{script}(check-sat)\n", limit, NET_MS / 1000)
            return Reply(answer or Reply.UNKNOWN), used
        except TimeoutError:
            return Reply.LATE, limit
        except NoAnswer:
            return Reply.UNKNOWN, limit

    def ask(self, script: str, limit: int, seconds: float) -> tuple[str, int]:
        """The answer to a script (empty if it cannot be read), and the steps that it took, of `limit`. Raises NoAnswer,
        and TimeoutError after so many seconds."""
        if self._owner != os.getpid():  # the process, and the lock, belong to the parent of this fork
            self._process, self._lock, self._owner = None, threading.Lock(), os.getpid()
        with self._lock:
            try:
                answer, used = json.loads(self._answer(_line([self.solver, script, limit]), time.monotonic() + seconds))
                return answer, used
            except TimeoutError:
                self._end()
                raise
            except (OSError, ValueError) as error:
                self._end()
                raise NoAnswer(str(error)) from error

    def close(self) -> None:
        """End the process; the next question starts another."""
        with self._lock:
            if self._owner == os.getpid():
                self._end()

    def _answer(self, asked: bytes, end: float) -> bytes:
        if self._process is None or self._asked >= ANSWERED_BY_ONE or self._process.poll() is not None:
            self._end()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "avow.solving.apart", str(os.getpid())],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                start_new_session=True,
            )
            process.watch(self._process.pid)
            self._asked = 0
        self._asked += 1
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(asked)
        self._process.stdin.flush()
        answer = b""
        while not answer.endswith(b"\n"):
            left = end - time.monotonic()
            if left <= 0 or not select.select([self._process.stdout], [], [], left)[0]:
                raise TimeoutError
            part = os.read(self._process.stdout.fileno(), 1 << 16)
            if not part:
                raise ValueError("it ended")
            answer += part
        return answer

    def _end(self) -> None:
        if self._process is None:
            return
        process.kill_tree(self._process.pid)
        self._process.wait()
        process.unwatch(self._process.pid)
        for stream in (self._process.stdin, self._process.stdout):
            with contextlib.suppress(OSError):  # its input can no longer be written
                stream.close() if stream is not None else None
        self._process = None


def _line(message: object) -> bytes:
    return json.dumps(message).encode() + b"\n"


@dataclass(slots=True)
class Both:
    """Z3 and, if it is installed, cvc5, each in a process of its own, for the duration of a ``with``. `steps`: of cvc5,
    for all questions together. `known`: answers of Z3 to be used and extended."""

    steps: float = math.inf
    known: dict[tuple[str, int], Reply] = field(default_factory=dict)
    _started: tuple[Apart, ...] = ()

    def __enter__(self) -> Solvers:
        first, second = self._started = (Apart("z3"), Apart("cvc5", self.steps))
        return Solvers(z3=first, second=second if "cvc5" in versions() else None, known=self.known)

    def __exit__(self, *_: object) -> None:
        for solver in self._started:
            solver.close()


def versions() -> dict[str, str]:
    """The installed solvers, with their versions."""
    from importlib import metadata  # a process for one question would spend a fifth of its time on it

    found = {"z3": metadata.version("z3-solver")}
    if util.find_spec("cvc5") is not None:
        found["cvc5"] = metadata.version("cvc5")
    return found


_PRODUCT = re.compile(r"\(\* (?!\(?[-/]? ?\d)(?!\S+ \(?[-/]? ?\d)")
"""A product of factors that are not literals."""

_ROOT = re.compile("(sqrt|sin|cos|atan2)!")
"""The constant for a root, a sine, a cosine or an angle."""


def _ask_cvc5(script: str, limit: int) -> tuple[str, int]:
    """``sat``, ``unsat`` or ``unknown``, empty if cvc5 cannot read the script; and the number of its own steps that it
    took, of `limit`."""
    import cvc5

    terms = cvc5.TermManager()
    solver = cvc5.Solver(terms)
    solver.setOption("rlimit-per", str(limit))
    solver.setOption("full-saturate-quant", "true")
    if _ROOT.search(script):  # without, it looks for an irrational number for ever, and counts no steps
        solver.setOption("nl-cov", "true")
    if _PRODUCT.search(script) and re.search(r"\((forall|exists) ", script):
        solver.setOption("cegqi", "false")  # it never ends there, and counts no steps (seen: ``exists x. x * x == y``)
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script, "query")
    symbols = parser.getSymbolManager()
    found = ""
    try:
        while True:
            command = parser.nextCommand()
            if command.isNull():
                return found, _steps(solver)
            answer = command.invoke(solver, symbols).strip()
            if answer.split(" ")[0] in {"sat", "unsat", "unknown"}:
                found = answer.split(" ")[0]  # "unknown (INCOMPLETE)"
            elif answer and answer != "success":
                return "", 0
    except RuntimeError:
        return "", 0


def _steps(solver: Any) -> int:
    counted = solver.getStatistics().get(internal=True).get("resource::resourceUnitsUsed", {})
    return int(counted.get("value", 0))


def _serve() -> None:
    """The main loop of the process, until there are no more questions."""
    process.die_with(int(sys.argv[1]))
    for asked in sys.stdin.buffer:
        solver, script, limit = json.loads(asked)
        answer = (ask_z3(script, limit), 0) if solver == "z3" else _ask_cvc5(script, limit)
        sys.stdout.buffer.write(_line(answer))
        sys.stdout.buffer.flush()


if __name__ == "__main__":
    _serve()
