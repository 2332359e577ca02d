"""A clause with memory along a run, a step at a time: what it remembers is finite, so that all runs can be walked
through. `oracle.test_stepping` holds it against `reference.meaning`, which looks at all steps."""

from __future__ import annotations

from typing import Any

from reference.meaning import COMPARED, NOWHERE, Meaning, Run, Step

from avow.language.subterms import subterms
from avow.language.terms import RESPONSES, History, Implies, Literal, Past, Term

Memory = tuple[Any, ...]


class Watch(Meaning):
    """`begins` is its memory before the first step."""

    def __init__(self, term: Term) -> None:
        super().__init__()
        self.term = term
        self.response: tuple[Term, History] | None = None
        if isinstance(term, Implies) and isinstance(term.right, History) and term.right.operator in RESPONSES:
            self.response = term.left, term.right
        found = [t for t in subterms(term) if isinstance(t, History) and t.operator not in RESPONSES]
        self.histories = list(dict.fromkeys(sorted(found, key=lambda t: sum(1 for _ in subterms(t)))))
        self.begins: Memory = (None,) * (len(self.histories) + (self.response is not None))
        self.now: dict[Term, Any] = {}

    def step(self, step: Step, memory: Memory) -> tuple[bool, Memory]:
        """Whether it holds at a step, and what it remembers then."""
        self.now, after, run = {}, list[Any](), [step]
        for term, kept in zip(self.histories, memory, strict=False):
            self.now[term], left = self._advanced(term, kept, run)
            after.append(left)
        if self.response is None:
            return bool(self.value(self.term, run)), tuple(after)
        held, left = self._demanded(*self.response, memory[-1], run)
        return held, (*after, left)

    def history(self, term: History, run: Run, k: int, bound: Step = NOWHERE) -> Any:
        return self.now[term]

    def _advanced(self, term: History, kept: Any, run: Run) -> tuple[Any, Any]:
        """Its value now, and what it remembers of this step."""
        now, *others = (self.value(argument, run) for argument in term.arguments)
        most = _most(term)
        match term.operator:
            case Past.PREVIOUS:
                return (others[0] if kept is None else kept[0]), (now,)
            case Past.ROSE:
                return now and not (kept and kept[0]), (now,)
            case Past.FELL:
                return bool(kept and kept[0] and not now), (now,)
            case Past.CHANGED:
                return kept is not None and kept[0] != now, (now,)
            case Past.ONCE | Past.HISTORICALLY:  # how long ago it was so (was not so)
                once = term.operator is Past.ONCE
                age = 0 if bool(now) is once else None if kept is None else min(kept + 1, (most or 0) + 1)
                return (age is not None and (most is None or age <= most)) is once, age
            case Past.HELD:  # for how many steps
                assert most is not None
                count = min((kept or 0) + 1, most + 1) if now else 0
                return count > most, count
            case Past.SINCE:  # how long ago it began
                limit, fits = most or 0, COMPARED[term.limit.relation if term.limit is not None else ">="]
                ages = {min(age + 1, limit + 1) for age in kept or () if now} | ({0} if others[0] else set())
                return any(fits(age, limit) for age in ages), tuple(sorted(ages))
            case Past.COUNTED:
                count = 0 if others[0] else (kept or 0) + bool(now)
                return count, count
        raise AssertionError(term.operator)

    def _demanded(self, trigger: Term, response: History, kept: Any, run: Run) -> tuple[bool, Any]:
        asked, wanted = bool(self.value(trigger, run)), bool(self.value(response.arguments[0], run))
        most = _most(response) or 0
        match response.operator:
            case Past.NEXT:
                return not kept or wanted, asked
            case Past.WITHIN:  # how long the oldest demand waits
                age = None if wanted else 0 if kept is None and asked else None if kept is None else min(kept + 1, most)
                return age is None or age < most, age
            case Past.FOR:  # at how many steps still
                left = max(most + 1 if asked else 0, kept or 0)
                return not left or wanted, max(left - 1, 0)
            case Past.UNTIL:
                waits = bool((kept or asked) and not self.value(response.arguments[1], run))
                return not waits or wanted, waits
        raise AssertionError(response.operator)


def _most(term: History) -> int | None:
    if term.limit is None:
        return None
    assert isinstance(term.limit.amount, Literal)
    return int(term.limit.amount.value)
