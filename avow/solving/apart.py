"""Solvers in processes of their own: a crash of one, or one that does not keep its time, is an unknown answer.

Questions are ``[solver, script, limit]``, answers ``[answer, steps]`` (`avow.solving.question_process`). There are
scripts on which cvc5 does not keep its own limits (seen: sequences of tuples), and no call into a library can be ended
from Python.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from importlib import metadata, util
from typing import Any

from avow.base.tuning.effort import KERNEL_SECOND_STEPS
from avow.kernel.solvers import NET_MS, Said, Solvers, ask_z3
from avow.solving.question_process import Answering, NoAnswer, serve


@dataclass(slots=True)
class Apart:
    """A solver (`z3` or `cvc5`). `steps`: its own, for all questions together; what is asked later is `unknown`."""

    solver: str
    steps: float = math.inf
    _process: Answering = field(default_factory=lambda: Answering("avow.solving.apart"))
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
        try:
            asked = script if self.solver == "z3" else f"{script}(check-sat)\n"
            said, used = self._process.ask((self.solver, asked, limit), tuple[str, int], NET_MS / 1000)
            return Said(said or Said.UNKNOWN), used
        except TimeoutError:
            return Said.LATE, limit
        except (NoAnswer, ValueError):  # no word, or one that is no answer
            return Said.UNKNOWN, limit

    def close(self) -> None:
        self._process.close()


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


_PRODUCT = re.compile(r"\(\* (?!\(?[-/]? ?\d)(?!\S+ \(?[-/]? ?\d)")
"""Of what are not numbers."""


def _ask_cvc5(script: str, limit: int) -> tuple[str, int]:
    """``sat``, ``unsat`` or ``unknown``, nothing where cvc5 cannot read the script; and how many of its own steps it
    took, of so many that it has."""
    import cvc5

    terms = cvc5.TermManager()
    solver = cvc5.Solver(terms)
    solver.setOption("rlimit-per", str(limit))
    solver.setOption("full-saturate-quant", "true")
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
            said = command.invoke(solver, symbols).strip()
            if said.split(" ")[0] in {"sat", "unsat", "unknown"}:
                found = said.split(" ")[0]  # "unknown (INCOMPLETE)"
            elif said and said != "success":
                return "", 0
    except RuntimeError:
        return "", 0


def _steps(solver: Any) -> int:
    counted = solver.getStatistics().get(internal=True).get("resource::resourceUnitsUsed", {})
    return int(counted.get("value", 0))


def _said(question: tuple[str, str, int]) -> tuple[str, int]:
    solver, script, limit = question
    return (ask_z3(script, limit), 0) if solver == "z3" else _ask_cvc5(script, limit)


if __name__ == "__main__":
    serve(_said, tuple[str, str, int])
