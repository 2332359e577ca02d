"""A question put to Z3, and to cvc5 where it is installed, within a budget that does not depend on the machine.

Z3 counts its own steps (`rlimit`): the same question gets the same answer on a slow machine. Wall-clock time is only a
net for where it does not count. Each question has a context of its own, so that none can see another's declarations.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
import threading
import time
from dataclasses import dataclass, field
from enum import StrEnum
from importlib import metadata, util
from typing import Any

BUDGET = 8_000_000
"""Z3's steps for one question: a second or two."""

LOOK = 400_000
"""Steps to look for a contradiction among premises: it decides nothing but whether a claim is called vacuous."""

NET_MS = 60_000
"""For what Z3's steps do not count; it is met only by a fault of the solver."""

SECOND_MS = 5_000
"""For the second solver's answer to one question: cvc5 counts no steps that mean the same on every version."""


class Said(StrEnum):
    UNSAT = "unsat"
    SAT = "sat"
    UNKNOWN = "unknown"


@dataclass(slots=True)
class Solvers:
    """Answers of this process, by the text of the question: each is asked once."""

    budget: int = BUDGET
    asked: dict[str, Said] = field(default_factory=dict)
    second: Second | None = None

    def first(self, script: str, budget: int | None = None) -> Said:
        """Z3's answer."""
        key = script if budget is None else f"{budget} {script}"
        if key not in self.asked:
            self.asked[key] = ask_z3(script, budget or self.budget)
        return self.asked[key]

    def close(self) -> None:
        if self.second is not None:
            self.second.close()


def ask_z3(script: str, budget: int = BUDGET) -> Said:
    """What Z3 says of a script; a text that it does not read, or a crash that it tells of, is `unknown`."""
    import z3

    try:
        context = z3.Context()
        solver = z3.Solver(ctx=context)
        solver.set("rlimit", budget)
        solver.set("timeout", NET_MS)
        # its Gröbner bases of non-linear integer terms cannot be interrupted
        solver.set("smt.arith.nl.grobner", False)
        solver.from_string(script)
        return Said(str(solver.check()))
    except z3.Z3Exception:
        return Said.UNKNOWN


def versions() -> dict[str, str]:
    """The solvers that are here, with their versions."""
    found = {"z3": metadata.version("z3-solver")}
    if util.find_spec("cvc5") is not None:
        found["cvc5"] = metadata.version("cvc5")
    return found


class Second:
    """cvc5 in a process of its own, ended where it does not keep its time. `seconds`: for all questions together, if
    not without end; what is asked later is `unknown`."""

    def __init__(self, seconds: float = math.inf) -> None:
        self._left = seconds
        self._process: subprocess.Popen[str] | None = None
        self._known: dict[str, Said] = {}

    def ask(self, script: str) -> Said:
        if script not in self._known:
            if self._left <= 0:
                return Said.UNKNOWN
            start = time.monotonic()
            self._known[script] = self._ask(script, int(min(SECOND_MS, 1 + self._left * 1000)))
            self._left -= time.monotonic() - start
        return self._known[script]

    def _ask(self, script: str, milliseconds: int) -> Said:
        if self._process is None or self._process.poll() is not None:
            command = [sys.executable, "-P", "-m", "avow.kernel.second"]
            self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        process = self._process
        assert process.stdin is not None
        assert process.stdout is not None
        net = threading.Timer(milliseconds / 1000 + 5, process.kill)
        net.start()
        try:
            process.stdin.write(json.dumps([milliseconds, script]) + "\n")
            process.stdin.flush()
            return Said(process.stdout.readline().strip() or "unknown")
        except (OSError, ValueError):
            return Said.UNKNOWN
        finally:
            net.cancel()

    def close(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            for stream in (self._process.stdin, self._process.stdout):
                if stream is not None:
                    stream.close()
            self._process = None


def answer_cvc5(script: str, milliseconds: int) -> Said:
    """cvc5's answer, in this process."""
    import cvc5

    solver: Any = cvc5.Solver(cvc5.TermManager())
    solver.setOption("tlimit-per", str(milliseconds))
    solver.setOption("full-saturate-quant", "true")
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script + "(check-sat)\n", "question")
    symbols = parser.getSymbolManager()
    found = Said.UNKNOWN
    try:
        while not (command := parser.nextCommand()).isNull():
            said = command.invoke(solver, symbols).strip().split(" ")[0]
            if said in set(Said):
                found = Said(said)
            elif said and said != "success":
                return Said.UNKNOWN
    except RuntimeError:
        return Said.UNKNOWN
    return found
