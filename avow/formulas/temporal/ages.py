"""Ages along silences and steps: what is kept of ``F since G`` where the time between steps counts."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from fractions import Fraction

from avow.base.records import dataclass
from avow.formulas.formula import conjunction, disjunction, negation
from avow.formulas.temporal.cell import CELL
from avow.language.sorts import BOOL, REAL
from avow.language.terms import (
    FALSE,
    TRUE,
    And,
    Arithmetic,
    Builtin,
    Compare,
    Conditional,
    Literal,
    Operation,
    Role,
    Term,
    Variable,
)

CLOCK = Variable(Role.INPUT, f"dt{CELL}", REAL)
"""The time since the step before, in seconds; it says nothing at the first step of a run."""

ELAPSED = Variable(Role.INPUT, f"elapsed{CELL}", REAL)
"""The time since the latest step, in seconds, within a silence."""


class Side(StrEnum):
    BEFORE = "just before"
    AT = "at"
    AFTER = "just after"


@dataclass(frozen=True, slots=True)
class Instant:
    """An instant of the silence after a step: `elapsed` seconds after it."""

    elapsed: Term
    side: Side = Side.AT


class Trend(StrEnum):
    """What a formula does in a silence."""

    STAYS = "stays"
    FALLS = "falls"
    """Once false, it stays so."""
    RISES = "rises"
    """Once true, it stays so."""
    CHANGES = "changes"

    def flipped(self) -> Trend:
        return {Trend.FALLS: Trend.RISES, Trend.RISES: Trend.FALLS}.get(self, self)


@dataclass(frozen=True, slots=True)
class Lasting:
    """A term over positions."""

    now: Term
    """Its value at a step."""
    silent: Callable[[Instant], Term]
    """Its value in the silence before a step, over what the step before has left (nothing, before the first)."""
    last: Term | None
    """Where it has one value all through a silence: that of the silence after a step, over the step's own values."""
    breaks: tuple[Term, ...] = ()
    """How long after a step it may change, over what that step has left."""
    trend: Trend = Trend.STAYS

    @property
    def steady(self) -> bool:
        """In a silence it is as it was at the step."""
        return self.last == self.now


class Kind(StrEnum):
    LATEST = "latest"
    EARLIEST = "earliest"
    EVER = "ever"


NO_TIME: Term = Literal(Fraction(0), REAL)
NONE: Term = Literal(Fraction(-1), REAL)


@dataclass(slots=True)
class Record:
    """What is kept of ``holds since began`` (`holds` None: always) along silences and steps: whether it is so, or the
    age of the latest (earliest) beginning since which `holds` was so, -1 for none."""

    begun: Callable[[Lasting, Instant], Term]
    """That there is a silence before a step, and a formula is so at an instant of it."""
    longest: Fraction | None
    """Older than that, nothing is told apart."""
    kind: Kind
    holds: Lasting | None
    began: Lasting
    breaks: tuple[Term, ...]
    """In order."""
    relation: str
    limit: Term
    limit_in_silence: Callable[[Instant], Term]
    most: Fraction | None
    left: Term = FALSE
    """What the step before has left."""

    def step(self, left: Term) -> Term:
        """What a step leaves."""
        self.left = left
        holds = TRUE if self.holds is None else self.holds.now
        return self._point(self._until(CLOCK), holds, self.began.now)

    def silent(self, instant: Instant) -> Term:
        """Whether it is so at an instant of the silence before a step."""
        begins = instant.elapsed == NO_TIME
        kept = self.left if begins else self._until(instant.elapsed)
        if instant.side is Side.AFTER and not begins:
            kept = self._point(kept, *self._there(Instant(instant.elapsed)))
        holds, began = self._there(instant)
        if self.kind is Kind.EVER:
            return disjunction((began, conjunction((holds, kept))))
        limit = self.limit_in_silence(instant)
        counts = conjunction((holds, Compare("<=", NO_TIME, kept)))
        old = conjunction((counts, Compare(sided(self.relation, instant.side), kept, limit)))
        fresh = conjunction((began, Compare(self.relation, NO_TIME, limit)))
        if self.kind is Kind.EARLIEST and instant.side is Side.AFTER:  # it begins here, and grows while that holds
            at_once = conjunction((began, holds, Compare(sided(self.relation, Side.AFTER), NO_TIME, limit)))
            fresh = disjunction((fresh, at_once)) if at_once != fresh else fresh
        if self.kind is Kind.LATEST:
            return disjunction((fresh, conjunction((negation(began), old))))
        return disjunction((old, conjunction((negation(counts), fresh))))

    @property
    def trend(self) -> Trend:
        """What it does in a silence."""
        began, holds = self.began.trend, Trend.STAYS if self.holds is None else self.holds.trend
        match self.kind:
            case Kind.LATEST:
                falls = began in (Trend.STAYS, Trend.FALLS) and holds in (Trend.STAYS, Trend.FALLS)
                return Trend.FALLS if falls else Trend.CHANGES
            case Kind.EARLIEST:
                if self.holds is self.began:
                    return Trend.RISES if began in (Trend.STAYS, Trend.RISES) else Trend.CHANGES
                long = self.most is not None and (self.most > 0 or (self.most == 0 and self.relation == ">"))
                rises = holds is Trend.STAYS and (long or began in (Trend.STAYS, Trend.RISES))
                return Trend.RISES if rises else Trend.CHANGES
            case Kind.EVER:
                rises = holds is Trend.STAYS and (self.holds is None or began in (Trend.STAYS, Trend.RISES))
                return Trend.RISES if rises else Trend.CHANGES

    def _there(self, instant: Instant) -> tuple[Term, Term]:
        holds = TRUE if self.holds is None else self.begun(self.holds, instant)
        return holds, self.begun(self.began, instant)

    def _until(self, end: Term) -> Term:
        """What is kept at the end of the silence's first so many seconds, of which some may have gone by."""
        once = self._changing_once(end)
        if once is not None:
            return choice(Compare("<", NO_TIME, end), once, self.left)
        kept, start = self.left, NO_TIME
        for at in self.breaks:
            here = within(start, at, end)
            kept = self._interval(kept, start, here)
            met = conjunction((Compare("<", start, here), Compare("<", here, end)))
            kept = choice(met, self._point(kept, *self._there(Instant(here))), kept)
            start = here
        return self._interval(kept, start, end)

    def _changing_once(self, end: Term) -> Term | None:
        """The same, where something begins (or ceases to) once at most, and what holds is told by that or stays."""
        if not self.breaks:
            return None
        together = self.holds is self.began
        trend = self.began.trend
        single = len(self.breaks) == 1
        if trend is Trend.CHANGES or not (together or self.holds is None or self.holds.last is not None):
            return None
        first = self.begun(self.began, Instant(NO_TIME, Side.AFTER))
        last = self.begun(self.began, Instant(end, Side.BEFORE))
        on = TRUE if together else self._there(Instant(end, Side.BEFORE))[0]
        rest = Arithmetic("-", end, self.breaks[0], REAL)
        known = Compare("<=", NO_TIME, self.left)
        match self.kind, trend:
            case Kind.EVER, _ if not together:
                return conjunction((on, disjunction((self.left, last if trend is Trend.RISES else first))))
            case Kind.LATEST, Trend.RISES if not together:
                return choice(on, choice(last, NO_TIME, self._older(self.left, end)), NONE)
            case Kind.LATEST, Trend.FALLS if single and not together:
                before = choice(first, rest, self._older(self.left, end))
                return choice(on, choice(last, NO_TIME, before), NONE)
            case Kind.EARLIEST, Trend.FALLS:
                if together:
                    return choice(last, choice(known, self._older(self.left, end), self._at_most(end)), NONE)
                begins = choice(first, self._at_most(end), NONE)
                return choice(on, choice(known, self._older(self.left, end), begins), NONE)
            case Kind.EARLIEST, Trend.RISES if single:
                later = choice(last, self._at_most(rest), NONE)
                going_on = choice(known, self._older(self.left, end), self._at_most(end))
                if together:
                    return choice(first, going_on, later)
                begins = choice(first, self._at_most(end), later)
                return choice(on, choice(known, self._older(self.left, end), begins), NONE)
            case _:  # piece by piece
                return None

    def _interval(self, kept: Term, start: Term, end: Term) -> Term:
        """What is kept at the end of a time without change."""
        holds, began = self._there(Instant(end, Side.BEFORE))
        length = end if start == NO_TIME else Arithmetic("-", end, start, REAL)
        match self.kind:
            case Kind.EVER:
                after = conjunction((holds, disjunction((kept, began))))
            case Kind.LATEST:
                after = choice(holds, choice(began, NO_TIME, self._older(kept, length)), NONE)
            case Kind.EARLIEST:
                first = self._at_most(length)
                after = choice(
                    holds,
                    choice(Compare("<=", NO_TIME, kept), self._older(kept, length), choice(began, first, NONE)),
                    NONE,
                )
        if start == NO_TIME and self._never_matters:
            return after
        return choice(Compare("<", start, end), after, kept)

    @property
    def _never_matters(self) -> bool:
        """A silence of no length leaves what it finds, without being told apart."""
        steady = self.began.steady and (self.holds is None or self.holds is self.began)
        waiting = self.holds is not None and self.holds.steady and self.began.last in (self.began.now, FALSE)
        items = self.began.now.items if isinstance(self.began.now, And) else (self.began.now,)
        return steady or (waiting and self.holds is not None and self.holds.now in items)

    def _older(self, kept: Term, length: Term) -> Term:
        older = Arithmetic("+", kept, length, REAL)
        if self.kind is Kind.EARLIEST:
            return self._at_most(older)
        young = [Compare("<=", NO_TIME, kept)]
        if self.longest is not None:
            young.append(Compare("<=", kept, Literal(self.longest, REAL)))
        return choice(conjunction(young), older, NONE)

    def _at_most(self, age: Term) -> Term:
        """Beyond a limit that is written down an age stays."""
        if self.longest is None:
            return age
        return Operation(Builtin.MIN, (age, Literal(self.longest + 1, REAL)), REAL)

    def _point(self, kept: Term, holds: Term, began: Term) -> Term:
        """What is kept after a step, or an instant."""
        match self.kind:
            case Kind.EVER:
                return disjunction((began, conjunction((holds, kept))))
            case Kind.LATEST:
                there = kept if holds == TRUE else choice(holds, kept, NONE)
                return choice(began, NO_TIME, there)
            case Kind.EARLIEST:
                counts = conjunction((holds, Compare("<=", NO_TIME, kept)))
                return choice(counts, kept, choice(began, NO_TIME, NONE))


def sided(relation: str, side: Side) -> str:
    """How an age that grows is held against a limit just before (after) an instant, by its value there."""
    match side:
        case Side.AT:
            return relation
        case Side.BEFORE:
            return {"<": "<=", ">=": ">"}.get(relation, relation)
        case Side.AFTER:
            return {"<=": "<", ">": ">="}.get(relation, relation)


def within(low: Term, at: Term, high: Term) -> Term:
    return Operation(Builtin.MIN, (Operation(Builtin.MAX, (at, low), REAL), high), REAL)


def choice(condition: Term, then: Term, otherwise: Term) -> Term:
    if condition == TRUE or then == otherwise:
        return then
    if condition == FALSE:
        return otherwise
    if then.sort == BOOL:
        return disjunction((conjunction((condition, then)), conjunction((negation(condition), otherwise))))
    return Conditional(condition, then, otherwise, then.sort)
