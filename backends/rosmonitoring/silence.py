"""A clause with limits in seconds between its steps: when silence breaks it."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from avow.base.tuning.bounds import POINTS_OF_ARGUMENTS
from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.evaluation.running import unnamed
from avow.formulas.formula import free_variables
from avow.formulas.temporal.ages import ELAPSED, Side
from avow.formulas.values import FunctionValue, Value
from avow.language.subterms import subterms
from avow.language.terms import Apply, Role, Term, Variable

from .pace import Leeway

Moments = Callable[[Mapping[str, Value]], Iterator[Value]]


@dataclass(slots=True)
class Silence:
    """What a clause with limits in seconds is like between steps, and when its steps were."""

    holds: Mapping[Side, Callable[[Mapping[str, Value]], Value]]
    """Whether it holds so many seconds (`ELAPSED`) after a step."""
    breaks: tuple[Moments, ...]
    """How many seconds after a step it may change."""
    period: Fraction | None
    """Of a clause that says that steps come every so many seconds."""
    leeway: Leeway
    latest: Fraction | None = None
    """When its latest step was."""
    elapsed: Fraction = Fraction(0)
    """The time from the latest step to the next, which is being judged."""
    told: bool = False
    """That it was broken since, has been told."""
    spared: Fraction | None = None
    """Where the step that is being judged came a little after a deadline: the time to it, `elapsed` to the deadline."""

    def broken(self, memory: Mapping[str, Value]) -> Fraction | None:
        """How long after the latest step silence breaks the clause; None where it never does. Raises NotEvaluable."""

        def at(side: Side, elapsed: Fraction) -> bool:
            return bool(self.holds[side]({**memory, ELAPSED.qualified: elapsed}))

        if not at(Side.AFTER, Fraction(0)):
            return Fraction(0)
        times = {Fraction(t) for each in self.breaks for t in each(memory) if isinstance(t, int | Fraction)}
        for time in sorted(t for t in times if t > 0):
            if not at(Side.AT, time) or not at(Side.AFTER, time):
                return time
        return None

    def passed(self, now: Fraction) -> None:
        """A step comes."""
        self.elapsed = max(now - self.latest, Fraction(0)) if self.latest is not None else Fraction(0)
        if self.period is not None and abs(self.elapsed - self.period) <= self.leeway.jitter:
            self.elapsed = self.period


def moments(at: Term) -> Moments:
    """The values of a term over memory; where it hangs on quantified variables, at all that is remembered of these and
    at values of which nothing is. They raise NotEvaluable."""
    value = compile_term(at)
    bound = sorted({v for v in free_variables(at) if v.role is Role.BOUND}, key=lambda v: v.name)
    if not bound:
        return lambda memory: iter((value(memory),))
    applied = [t for t in subterms(at) if isinstance(t, Apply) and isinstance(t.function, Variable)]
    places = {v: [(t.function, t.arguments.index(v)) for t in applied if v in t.arguments] for v in bound}

    def each(memory: Mapping[str, Value]) -> Iterator[Value]:
        known: list[list[Value]] = []
        for variable in bound:
            found = dict.fromkeys((unnamed(variable.sort),))
            for function, place in places[variable]:
                table = memory[function.qualified] if isinstance(function, Variable) else None
                found |= dict.fromkeys(k[place] for k in table.table) if isinstance(table, FunctionValue) else {}
            known.append(list(found))
        for count, point in enumerate(product(*known)):
            if count >= POINTS_OF_ARGUMENTS:
                raise NotEvaluable("too many combinations of values are remembered")
            yield value({**memory, **{v.name: p for v, p in zip(bound, point, strict=True)}})

    return each
