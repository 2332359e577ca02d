"""Timers over silences (the time between steps) and steps: the state of ``F since G`` if the time between steps
matters."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from fractions import Fraction

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import CELL
from avow.language import terms as t
from avow.language.sorts import BOOL, REAL

CLOCK = t.Variable(t.Role.INPUT, f"dt{CELL}", REAL)
"""The time since the previous step, in seconds; meaningless at the first step of a run."""

ELAPSED = t.Variable(t.Role.INPUT, f"elapsed{CELL}", REAL)
"""The time since the latest step, in seconds, within a silence."""


class Side(StrEnum):
    BEFORE = "just before"
    AT = "at"
    AFTER = "just after"


@dataclass(frozen=True, slots=True)
class Instant:
    """An instant of the silence after a step: `elapsed` seconds after it."""

    elapsed: t.Term
    side: Side = Side.AT


class Trend(StrEnum):
    """How a formula's value changes in a silence."""

    STAYS = "stays"
    FALLS = "falls"
    """Once false, it stays false."""
    RISES = "rises"
    """Once true, it stays true."""
    CHANGES = "changes"

    def flipped(self) -> Trend:
        return {Trend.FALLS: Trend.RISES, Trend.RISES: Trend.FALLS}.get(self, self)


@dataclass(frozen=True, slots=True)
class Lasting:
    """A term over positions."""

    now: t.Term
    """Its value at a step."""
    silent: Callable[[Instant], t.Term]
    """Its value in the silence before a step, over the state that the previous step left (none before the first)."""
    last: t.Term | None
    """If its value is constant throughout a silence: that value in the silence after a step, over the step's own
    values."""
    breaks: tuple[t.Term, ...] = ()
    """The times after a step at which it may change, over the state that the step left."""
    trend: Trend = Trend.STAYS

    @property
    def steady(self) -> bool:
        """Whether its value in a silence is that at the step."""
        return self.last == self.now


class Kind(StrEnum):
    LATEST = "latest"
    EARLIEST = "earliest"
    EVER = "ever"


NO_TIME = t.Literal(Fraction(0), REAL)
NONE: t.Term = t.Literal(Fraction(-1), REAL)


@dataclass(slots=True)
class Record:
    """The state of ``holds since began`` (`holds` None: always) over silences and steps: whether it is true, or a timer
    since the latest (earliest) beginning since which `holds` was true, -1 for none."""

    begun: Callable[[Lasting, Instant], t.Term]
    """The condition that there is a silence before a step, and a formula is true at an instant of it."""
    longest: Fraction
    """Timer values above this are not distinguished."""
    kind: Kind
    holds: Lasting | None
    began: Lasting
    inside: bool
    """Whether `holds` is syntactically implied by `began`."""
    breaks: tuple[t.Term, ...]
    """In ascending order."""
    relation: str
    limit: t.Literal
    left: t.Term = t.FALSE
    """The state that the previous step left."""

    def step(self, left: t.Term) -> t.Term:
        """The state that a step leaves."""
        self.left = left
        holds = t.TRUE if self.holds is None else self.holds.now
        return self._point(self._until(CLOCK), holds, self.began.now)

    def silent(self, instant: Instant) -> t.Term:
        """Whether it is true at an instant of the silence before a step."""
        begins = instant.elapsed == NO_TIME
        kept = self.left if begins else self._until(instant.elapsed)
        if instant.side is Side.AFTER and not begins:
            kept = self._point(kept, *self._there(Instant(instant.elapsed)))
        holds, began = self._there(instant)
        if self.kind is Kind.EVER:
            return disjunction((began, conjunction((holds, kept))))
        counts = conjunction((holds, t.Compare("<=", NO_TIME, kept)))
        old = conjunction((counts, t.Compare(sided(self.relation, instant.side), kept, self.limit)))
        fresh = conjunction((began, t.Compare(self.relation, NO_TIME, self.limit)))
        if self.kind is Kind.EARLIEST and instant.side is Side.AFTER:  # begins here, and grows while it holds
            at_once = conjunction((began, holds, t.Compare(sided(self.relation, Side.AFTER), NO_TIME, self.limit)))
            fresh = disjunction((fresh, at_once)) if at_once != fresh else fresh
        if self.kind is Kind.LATEST:
            return disjunction((fresh, conjunction((negation(began), old))))
        return disjunction((old, conjunction((negation(counts), fresh))))

    @property
    def trend(self) -> Trend:
        """How it changes in a silence."""
        began, holds = self.began.trend, Trend.STAYS if self.holds is None else self.holds.trend
        match self.kind:
            case Kind.LATEST:
                falls = began in (Trend.STAYS, Trend.FALLS) and holds in (Trend.STAYS, Trend.FALLS)
                return Trend.FALLS if falls else Trend.CHANGES
            case Kind.EARLIEST:
                if self.holds is self.began:
                    return Trend.RISES if began in (Trend.STAYS, Trend.RISES) else Trend.CHANGES
                long = self.limit != NO_TIME or self.relation == ">"
                rises = holds is Trend.STAYS and (long or began in (Trend.STAYS, Trend.RISES))
                return Trend.RISES if rises else Trend.CHANGES
            case Kind.EVER:
                rises = holds is Trend.STAYS and (self.holds is None or began in (Trend.STAYS, Trend.RISES))
                return Trend.RISES if rises else Trend.CHANGES

    def _there(self, instant: Instant) -> tuple[t.Term, t.Term]:
        holds = t.TRUE if self.holds is None else self.begun(self.holds, instant)
        return holds, self.begun(self.began, instant)

    def _until(self, end: t.Term) -> t.Term:
        """The state `end` seconds into the silence."""
        once = self._changing_once(end)
        if once is not None:
            return choice(t.Compare("<", NO_TIME, end), once, self.left)
        kept = self.left
        start: t.Term = NO_TIME
        for at in self.breaks:
            here = within(start, at, end)
            kept = self._interval(kept, start, here)
            met = conjunction((t.Compare("<", start, here), t.Compare("<", here, end)))
            kept = choice(met, self._point(kept, *self._there(Instant(here))), kept)
            start = here
        return self._interval(kept, start, end)

    def _changing_once(self, end: t.Term) -> t.Term | None:
        """The same, if `began` changes at most once and `holds` is `began` or constant; otherwise None."""
        if not self.breaks:
            return None
        together = self.holds is self.began
        trend = self.began.trend
        single = len(self.breaks) == 1
        if trend is Trend.CHANGES or not (together or self.holds is None or self.holds.last is not None):
            return None
        first = self.begun(self.began, Instant(NO_TIME, Side.AFTER))
        last = self.begun(self.began, Instant(end, Side.BEFORE))
        on = t.TRUE if together else self._there(Instant(end, Side.BEFORE))[0]
        rest = t.Arithmetic("-", end, self.breaks[0], REAL)
        known = t.Compare("<=", NO_TIME, self.left)
        ended = NONE if self.inside else choice(last, NO_TIME, NONE)
        match self.kind, trend:
            case Kind.EVER, _ if not together:
                kept = self.left if trend is Trend.RISES else disjunction((self.left, first))
                return disjunction((last, conjunction((on, kept))))
            case Kind.LATEST, Trend.RISES if not together:
                return choice(last, NO_TIME, choice(on, self._older(self.left, end), NONE))
            case Kind.LATEST, Trend.FALLS if single and not together:
                before = choice(first, rest, self._older(self.left, end))
                return choice(last, NO_TIME, choice(on, before, NONE))
            case Kind.EARLIEST, Trend.FALLS:
                if together:
                    return choice(last, choice(known, self._older(self.left, end), self._at_most(end)), NONE)
                begins = choice(first, self._at_most(end), NONE)
                return choice(on, choice(known, self._older(self.left, end), begins), ended)
            case Kind.EARLIEST, Trend.RISES if single:
                later = choice(last, self._at_most(rest), NONE)
                going_on = choice(known, self._older(self.left, end), self._at_most(end))
                if together:
                    return choice(first, going_on, later)
                begins = choice(first, self._at_most(end), later)
                return choice(on, choice(known, self._older(self.left, end), begins), ended)
            case _:  # interval by interval
                return None

    def _interval(self, kept: t.Term, start: t.Term, end: t.Term) -> t.Term:
        """The state at the end of an interval without change: if `began` is true throughout, it ends with the interval,
        and `holds` need not be true before that."""
        holds, began = self._there(Instant(end, Side.BEFORE))
        length = end if start == NO_TIME else t.Arithmetic("-", end, start, REAL)
        match self.kind:
            case Kind.EVER:
                after = disjunction((began, conjunction((holds, kept))))
            case Kind.LATEST:
                after = choice(began, NO_TIME, choice(holds, self._older(kept, length), NONE))
            case Kind.EARLIEST:
                first = self._at_most(length)
                after = choice(
                    holds,
                    choice(t.Compare("<=", NO_TIME, kept), self._older(kept, length), choice(began, first, NONE)),
                    NONE if self.inside else choice(began, NO_TIME, NONE),
                )
        if start == NO_TIME and self._never_matters:
            return after
        return choice(t.Compare("<", start, end), after, kept)

    @property
    def _never_matters(self) -> bool:
        """Whether a silence of length zero leaves the state unchanged without a case distinction."""
        steady = self.began.steady and (self.holds is None or self.holds is self.began)
        waiting = self.holds is not None and self.holds.steady and self.began.last in (self.began.now, t.FALSE)
        return steady or (waiting and self.inside)

    def _older(self, kept: t.Term, length: t.Term) -> t.Term:
        older = t.Arithmetic("+", kept, length, REAL)
        if self.kind is Kind.EARLIEST:
            return self._at_most(older)
        young = (t.Compare("<=", NO_TIME, kept), t.Compare("<=", kept, t.Literal(self.longest, REAL)))
        return choice(conjunction(young), older, NONE)

    def _at_most(self, age: t.Term) -> t.Term:
        """The timer, which does not grow beyond the longest limit."""
        return t.Operation(t.Builtin.MIN, (age, t.Literal(self.longest + 1, REAL)), REAL)

    def _point(self, kept: t.Term, holds: t.Term, began: t.Term) -> t.Term:
        """The state after a step, or an instant."""
        match self.kind:
            case Kind.EVER:
                return disjunction((began, conjunction((holds, kept))))
            case Kind.LATEST:
                there = kept if holds == t.TRUE else choice(holds, kept, NONE)
                return choice(began, NO_TIME, there)
            case Kind.EARLIEST:
                counts = conjunction((holds, t.Compare("<=", NO_TIME, kept)))
                return choice(counts, kept, choice(began, NO_TIME, NONE))


def sided(relation: str, side: Side) -> str:
    """The relation of a growing timer to a limit just before (after) an instant, by its value at the instant."""
    match side:
        case Side.AT:
            return relation
        case Side.BEFORE:
            return {"<": "<=", ">=": ">"}.get(relation, relation)
        case Side.AFTER:
            return {"<=": "<", ">": ">="}.get(relation, relation)


def within(low: t.Term, at: t.Term, high: t.Term) -> t.Term:
    return t.Operation(t.Builtin.MIN, (t.Operation(t.Builtin.MAX, (at, low), REAL), high), REAL)


def choice(condition: t.Term, then: t.Term, otherwise: t.Term) -> t.Term:
    if condition == t.TRUE or then == otherwise:
        return then
    if condition == t.FALSE:
        return otherwise
    if then.sort == BOOL:
        return disjunction((conjunction((condition, then)), conjunction((negation(condition), otherwise))))
    return t.Conditional(condition, then, otherwise, then.sort)
