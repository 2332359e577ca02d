"""All runs of a node ``in.a`` -> ``out.b`` over truth values, and the game that it plays against its inputs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from reference.meaning import Step, keeps

from avow.language.terms import Term

BOTH = (False, True)


def step(a: bool, b: bool) -> Step:
    return {"in.a": a, "out.b": b, "in.n": 1}


def longer(run: Sequence[Step]) -> list[list[Step]]:
    return [[*run, step(a, b)] for a in BOTH for b in BOTH]


def runs(clauses: Iterable[Term], length: int) -> list[list[Step]]:
    """All of so many steps that keep the clauses at every one."""
    listed, found = list(clauses), list[list[Step]]([[]])
    for _ in range(length):
        found = [more for run in found for more in longer(run) if all(keeps(c, more) for c in listed)]
    return found


def environment_wins(assumed: Term, promised: Sequence[Term], depth: int, run: Sequence[Step] = ()) -> bool:
    """Whether inputs can be chosen, step by step, so that within so many steps no output keeps the guarantees."""
    if not depth:
        return False
    for a in BOTH:
        if not keeps(assumed, [*run, step(a, False)]):
            continue
        answers = [[*run, step(a, b)] for b in BOTH]
        kept = [more for more in answers if all(keeps(g, more) for g in promised)]
        if all(environment_wins(assumed, promised, depth - 1, more) for more in kept):
            return True
    return False
