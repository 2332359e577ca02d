"""A question put to Z3 within a budget of its own steps, and to a second solver if there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

BUDGET = 8_000_000
"""Z3's steps for one question: a second or two."""

LOOK = 400_000
"""Steps to look for a contradiction among premises: it decides nothing but whether a claim is called vacuous."""

NET_MS = 60_000
"""For what Z3's steps do not count; it is met only by a fault of the solver."""


class Said(StrEnum):
    UNSAT = "unsat"
    SAT = "sat"
    UNKNOWN = "unknown"


def ask_z3(script: str, budget: int) -> Said:
    """What Z3 says of a script within so many of its own steps; `unknown` of what it cannot read."""
    import z3

    try:
        solver = z3.Solver(ctx=z3.Context())  # of its own: it sees no other question's declarations
        solver.set(rlimit=budget, timeout=NET_MS)
        solver.set("smt.arith.nl.grobner", False)  # of non-linear integer terms: they cannot be interrupted
        solver.from_string(script)
        return Said(str(solver.check()))
    except z3.Z3Exception:
        return Said.UNKNOWN


@dataclass(slots=True)
class Solvers:
    """Each question is asked once. Both solvers may be other processes (`avow.solving.apart`)."""

    budget: int = BUDGET
    z3: Callable[[str, int], Said] = ask_z3
    second: Callable[[str], Said] | None = None
    known: dict[tuple[str, int], Said] = field(default_factory=dict)

    def ask(self, script: str, wanted: Said) -> int:
        """How many solvers answer as is wanted; 0 where Z3 does not."""
        if self.first(script, self.budget) is not wanted:
            return 0
        return 2 if self.second is not None and self.second(script) is wanted else 1

    def first(self, script: str, budget: int) -> Said:
        """Z3's answer."""
        if (script, budget) not in self.known:
            self.known[script, budget] = self.z3(script, budget)
        return self.known[script, budget]
