"""Ages along silences and steps: what is kept of ``F since G`` where the time between steps counts."""

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
"""The time since the step before, in seconds; it says nothing at the first step of a run."""

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

    now: t.Term
    """Its value at a step."""
    silent: Callable[[Instant], t.Term]
    """Its value in the silence before a step, over what the step before has left (nothing, before the first)."""
    last: t.Term | None
    """Where it has one value all through a silence: that of the silence after a step, over the step's own values."""
    breaks: tuple[t.Term, ...] = ()
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


NO_TIME: t.Term = t.Literal(Fraction(0), REAL)
NONE: t.Term = t.Literal(Fraction(-1), REAL)


@dataclass(slots=True)
class Record:
    """What is kept of ``holds since began`` (`holds` None: always) along silences and steps: whether it is so, or the
    age of the latest (earliest) beginning since which `holds` was so, -1 for none."""

    begun: Callable[[Lasting, Instant], t.Term]
    """That there is a silence before a step, and a formula is so at an instant of it."""
    longest: Fraction | None
    """Older than that, nothing is told apart."""
    kind: Kind
    holds: Lasting | None
    began: Lasting
    inside: bool
    """Whether `holds` is so wherever it begins, as what is written says."""
    breaks: tuple[t.Term, ...]
    """In order."""
    relation: str
    limit: t.Term
    limit_in_silence: Callable[[Instant], t.Term]
    most: Fraction | None
    left: t.Term = t.FALSE
    """What the step before has left."""

    def step(self, left: t.Term) -> t.Term:
        """What a step leaves."""
        self.left = left
        holds = t.TRUE if self.holds is None else self.holds.now
        return self._point(self._until(CLOCK), holds, self.began.now)

    def silent(self, instant: Instant) -> t.Term:
        """Whether it is so at an instant of the silence before a step."""
        begins = instant.elapsed == NO_TIME
        kept = self.left if begins else self._until(instant.elapsed)
        if instant.side is Side.AFTER and not begins:
            kept = self._point(kept, *self._there(Instant(instant.elapsed)))
        holds, began = self._there(instant)
        if self.kind is Kind.EVER:
            return disjunction((began, conjunction((holds, kept))))
        limit = self.limit_in_silence(instant)
        counts = conjunction((holds, t.Compare("<=", NO_TIME, kept)))
        old = conjunction((counts, t.Compare(sided(self.relation, instant.side), kept, limit)))
        fresh = conjunction((began, t.Compare(self.relation, NO_TIME, limit)))
        if self.kind is Kind.EARLIEST and instant.side is Side.AFTER:  # it begins here, and grows while that holds
            at_once = conjunction((began, holds, t.Compare(sided(self.relation, Side.AFTER), NO_TIME, limit)))
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

    def _there(self, instant: Instant) -> tuple[t.Term, t.Term]:
        holds = t.TRUE if self.holds is None else self.begun(self.holds, instant)
        return holds, self.begun(self.began, instant)

    def _until(self, end: t.Term) -> t.Term:
        """What is kept at the end of the silence's first so many seconds, of which some may have gone by."""
        once = self._changing_once(end)
        if once is not None:
            return choice(t.Compare("<", NO_TIME, end), once, self.left)
        kept, start = self.left, NO_TIME
        for at in self.breaks:
            here = within(start, at, end)
            kept = self._interval(kept, start, here)
            met = conjunction((t.Compare("<", start, here), t.Compare("<", here, end)))
            kept = choice(met, self._point(kept, *self._there(Instant(here))), kept)
            start = here
        return self._interval(kept, start, end)

    def _changing_once(self, end: t.Term) -> t.Term | None:
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
            case _:  # piece by piece
                return None

    def _interval(self, kept: t.Term, start: t.Term, end: t.Term) -> t.Term:
        """What is kept at the end of a time without change: what had begun all through it ends with it, and `holds`
        need not be so before that."""
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
        """A silence of no length leaves what it finds, without being told apart."""
        steady = self.began.steady and (self.holds is None or self.holds is self.began)
        waiting = self.holds is not None and self.holds.steady and self.began.last in (self.began.now, t.FALSE)
        return steady or (waiting and self.inside)

    def _older(self, kept: t.Term, length: t.Term) -> t.Term:
        older = t.Arithmetic("+", kept, length, REAL)
        if self.kind is Kind.EARLIEST:
            return self._at_most(older)
        young = [t.Compare("<=", NO_TIME, kept)]
        if self.longest is not None:
            young.append(t.Compare("<=", kept, t.Literal(self.longest, REAL)))
        return choice(conjunction(young), older, NONE)

    def _at_most(self, age: t.Term) -> t.Term:
        """Beyond a limit that is written down an age stays."""
        if self.longest is None:
            return age
        return t.Operation(t.Builtin.MIN, (age, t.Literal(self.longest + 1, REAL)), REAL)

    def _point(self, kept: t.Term, holds: t.Term, began: t.Term) -> t.Term:
        """What is kept after a step, or an instant."""
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
    """How an age that grows is held against a limit just before (after) an instant, by its value there."""
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
