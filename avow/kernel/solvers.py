"""A question to Z3 within a budget of its own steps, and to a second solver if there is one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum

BUDGET = 8_000_000
"""Z3's steps for one question: one or two seconds."""

LOOK = 400_000
"""Steps to look for a contradiction among premises: it only decides whether a claim is called vacuous."""

NET_MS = 60_000
"""A limit for work that Z3's steps do not count; it is reached only by a fault of the solver."""


BOUNDED = "(set-logic ALL)\n; only bounds of a value are known: `sat` says nothing"  # how such a script begins


class Reply(StrEnum):
    UNSAT = "unsat"
    SAT = "sat"
    UNKNOWN = "unknown"
    LATE = "stopped by the clock"  # and not by its steps: another run may give another answer


def ask_z3(script: str, budget: int) -> Reply:
    """Z3's answer to a script within a number of its own steps; `unknown` if it cannot read the script."""
    import z3

    try:
        solver = z3.Solver(ctx=z3.Context())  # its own: it sees no other question's declarations
        solver.set(rlimit=budget, timeout=NET_MS)
        solver.set("smt.arith.nl.grobner", False)  # for non-linear integer terms: they cannot be interrupted
        solver.from_string(script)
        answer = Reply(str(solver.check()))
        if answer is Reply.SAT and script.startswith(BOUNDED):
            return Reply.UNKNOWN  # the bounds may be all that it meets
        return Reply.LATE if answer is Reply.UNKNOWN and solver.reason_unknown() == "timeout" else answer
    except z3.Z3Exception:
        return Reply.UNKNOWN


@dataclass(slots=True)
class Solvers:
    """Each question is asked once. Both solvers may be other processes (`avow.solving.apart`)."""

    z3: Callable[[str, int], Reply] = ask_z3
    second: Callable[[str], Reply] | None = None
    known: dict[tuple[str, int], Reply] = field(default_factory=dict)

    def ask(self, script: str, wanted: Reply) -> tuple[Reply, int]:
        """The answer; how many solvers give the wanted one: 0 if Z3 does not, or the second says the opposite."""
        if (answer := self.first(script, BUDGET)) is not wanted or self.second is None:
            return answer, int(answer is wanted)
        second = self.second(script)
        return (second, 0) if {wanted, second} == {Reply.SAT, Reply.UNSAT} else (answer, 1 + (second is wanted))

    def first(self, script: str, budget: int) -> Reply:
        """Z3's answer."""
        if (script, budget) not in self.known:
            self.known[script, budget] = self.z3(script, budget)
        return self.known[script, budget]
