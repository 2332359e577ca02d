"""Clauses with limits in seconds, as formulas of one step over state variables (cells) and the time since the previous
step.

A run's positions are its steps and every instant between them. In the silence after a step ports keep their values,
events are false, `previous`, counts and records with limits in steps are constant, and timers grow; a clause is
demanded at every position. A timer runs from the position where something ended (began), also if a silence ended with
it.

In a silence each record with a limit changes once, when its timer reaches the limit. A step therefore checks the
silence before it only at these instants and between them: no formula of a step quantifies over all instants.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.tuning.bounds import CLOCKED_SIZE, LIMITS_NESTED
from avow.formulas.formula import conjunction, digest, disjunction, free_variables, negation
from avow.formulas.temporal.ages import (
    CLOCK,
    ELAPSED,
    NO_TIME,
    NONE,
    Instant,
    Kind,
    Lasting,
    Record,
    Side,
    Trend,
    sided,
)
from avow.formulas.temporal.cell import CELL, Cell, Unsaid, at_the_parameters, some_value
from avow.formulas.temporal.cells import Records, Remembering, compiled
from avow.formulas.temporal.responses import in_the_past
from avow.language import terms as t
from avow.language.contract import Clause, ClauseKind, Node, Port
from avow.language.sorts import BOOL, REAL
from avow.language.subterms import counts_steps, histories, timed

_EVER = (t.Past.ONCE, t.Past.HISTORICALLY, t.Past.SINCE)
GOES_ON = t.Compare("<", NO_TIME, CLOCK)
"""Time passes from step to step."""


def longest_limit(formulas: Iterable[t.Term]) -> Fraction:
    """The longest limit in seconds; 0 if there is none."""
    limits = [h.limit for formula in formulas for h in histories(formula) if h.limit is not None]
    return max((limit.number for limit in limits if not limit.steps), default=Fraction(0))


def arrival(term: t.History) -> t.Variable:
    """The variable for whether a message of an input arrived since the previous step; at the first step all did."""
    (port,) = term.arguments
    assert isinstance(port, t.Variable)
    return t.Variable(t.Role.INPUT, f"arrived {port.name}{CELL}", BOOL)


def is_arrival(variable: t.Variable) -> bool:
    """Whether the variable is an `arrival`."""
    return variable.name.endswith(CELL) and variable.name.startswith("arrived ")


def events(remembering: Remembering) -> tuple[t.Variable, ...]:
    """The variables that a step's formulas read besides ports and cells: `CLOCK`, and which messages have arrived."""
    spoken = (*(clause.formula for clause in remembering.node.clauses), *(cell.now for cell in remembering.cells))
    cells = set(remembering.before)
    found = {v for term in spoken for v in free_variables(term) if v.name.endswith(CELL) and v not in cells}
    return tuple(sorted(found, key=lambda v: v.name))


def pace_of(node: Node) -> t.Limit | None:
    """The time between the node's steps (``steps(every 20 ms)``); None if its contract does not give it."""
    return next((clause.pace for clause in node.guarantees if clause.pace is not None), None)


def one_step(node: Node) -> Remembering:
    """As `compile_node`, also with limits in seconds. Other variables that a step reads are inputs of the node, and the
    constraints on the time between steps are assumptions, since the environment determines it."""
    paced = tuple(replace(c, kind=ClauseKind.ASSUMPTION) for c in node.guarantees if c.pace is not None)
    others = tuple(c for c in node.guarantees if c.pace is None)
    longest = longest_limit(clause.formula for clause in node.clauses)
    made = compiled(replace(node, assumptions=(*node.assumptions, *paced), guarantees=others), Timed(longest=longest))
    read = events(made)
    ports = tuple(Port(t.Role.INPUT, v.name, v.sort, str(v.sort)) for v in read)
    goes_on = Clause(ClauseKind.ASSUMPTION, "time goes on", 0, GOES_ON)
    assumed = (*made.node.assumptions, *((goes_on,) if CLOCK in read else ()))
    return replace(made, node=replace(made.node, inputs=(*node.inputs, *ports), assumptions=assumed))


def one_pace(nodes: Iterable[Node]) -> bool:
    """Whether the steps of all these nodes can be the same steps."""
    paces = [pace for node in nodes if (pace := pace_of(node)) is not None]
    every = {pace.number for pace in paces if pace.relation == "=="}
    return len(every) <= 1 and all(v <= pace.number for v in every for pace in paces)


def other_paces(nodes: Sequence[Node]) -> tuple[frozenset[str], str]:
    """The nodes whose pace does not bound the steps of every node that counts its steps; and why limits are about
    different steps in different nodes, if they are."""
    paces = {node.name: pace for node in nodes if (pace := pace_of(node)) is not None}
    counting = [n.name for n in nodes if any(counts_steps(clause.formula) for clause in n.clauses)]
    counted = {paces.get(name) for name in counting}
    others = frozenset(name for name, pace in paces.items() if counted - {pace})
    apart = not one_pace(nodes) or (counting and len(counted - {None}) > 1)
    return others, f"{' and '.join(sorted(paces))} declare different `steps(…)`" if apart else ""


@dataclass(slots=True)
class Timed(Records):
    """The cells of some formulas, which may have limits in seconds."""

    _positions: dict[str, Lasting] = field(default_factory=dict)
    _in_time: bool = False
    longest: Fraction = field(kw_only=True)
    """Timer values above this are not distinguished."""
    _machines: dict[str, Cell] = field(default_factory=dict)

    def clause(self, formula: t.Term) -> t.Term:
        """A clause at a step and in the silence before it. Raises Unsaid without having made a cell."""
        if timed(formula) is None or (self.apart and counts_steps(formula)):
            return Records.clause(self, formula)
        with self._undone():
            held = self.positions(formula)
            silence = disjunction((self._is_first(), t.Compare("<=", CLOCK, NO_TIME), self.throughout(held)))
            return _small(conjunction((silence, held.now)), formula)

    def positions(self, formula: t.Term) -> Lasting:
        """A clause with a limit in seconds, which may be a response, over positions. Raises Unsaid."""
        with self._timing():
            return self.over(in_the_past(formula))

    def past(self, formula: t.Term, *, in_time: bool) -> t.Term:
        """A past-time formula at a step, over positions if `in_time`. Raises Unsaid."""
        if not in_time:
            return Records.term(self, formula)
        with self._timing():
            return self.over(formula).now

    def instants(self, formula: Lasting) -> tuple[Mapping[Side, t.Term], tuple[t.Term, ...]]:
        """A formula in the silence after a step, over the state that the step left: its values `ELAPSED` seconds after
        the step, and the times at which it may change. A quantified variable occurs in these times only as an argument
        of a cell."""
        found = {side: formula.silent(Instant(ELAPSED, side)) for side in Side}
        begun = t.Compare("<=", ELAPSED, NO_TIME)  # right after the step, whose instant is not in the silence
        found[Side.AFTER] = t.Conditional(begun, formula.silent(Instant(NO_TIME, Side.AFTER)), found[Side.AFTER], BOOL)
        return found, formula.breaks

    def throughout(self, formula: Lasting) -> t.Term:
        """The condition that a formula is true throughout the silence before a step. Raises Unsaid."""
        match formula.trend:
            case Trend.STAYS:
                assert formula.last is not None
                return t.TRUE if formula.steady else self._held(formula.last)
            case Trend.FALLS:
                return formula.silent(Instant(CLOCK, Side.BEFORE))
            case Trend.RISES:
                return formula.silent(Instant(NO_TIME, Side.AFTER))
            case Trend.CHANGES:
                demanded = [formula.silent(Instant(NO_TIME, Side.AFTER))]
                for at in _closed(formula):
                    inside = conjunction((t.Compare("<", NO_TIME, at), t.Compare("<", at, CLOCK)))
                    both = conjunction((formula.silent(Instant(at)), formula.silent(Instant(at, Side.AFTER))))
                    demanded.append(t.Implies(inside, both))
                return conjunction(demanded)

    def over(self, term: t.Term) -> Lasting:
        """A term over positions. Raises Unsaid."""
        if isinstance(term, t.History):
            meaning = digest(term)
            if meaning not in self._positions:
                self._positions[meaning] = self._over_history(term)
            return self._positions[meaning]
        parts = tuple(map(self.over, term.children))
        now = _remade(term, [part.now for part in parts])
        last = [part.last for part in parts]
        if all(each is not None for each in last):
            return self._constant(now, _remade(term, [each for each in last if each is not None]))

        def silent(instant: Instant) -> t.Term:
            return _remade(term, [part.silent(instant) for part in parts])

        breaks = tuple(dict.fromkeys(at for part in parts for at in part.breaks))
        return Lasting(now, silent, None, breaks, _trend(term, parts))

    def term(self, term: t.Term) -> t.Term:
        """A term at a step."""
        return self.over(term).now if self._in_time else Records.term(self, term)

    def _record(self, term: t.History) -> t.Term:
        if term.operator is t.Past.ARRIVED:
            return disjunction((self._is_first(), arrival(term)))
        return Records._record(self, term)

    # -- records -------------------------------------------------------------------------------------------------------

    def _over_history(self, term: t.History) -> Lasting:
        limited = term.limit is not None and not term.limit.steps
        match term.operator:
            case t.Past.STEPS:
                return self._pace(term)
            case t.Past.WITHIN if limited and len(term.arguments) == 2:
                return self._just_missed(term)
            case operator if limited or (operator in _EVER and term.limit is None):
                return self._aged(term)
            case operator if operator in t.RESPONSES:
                raise Unsaid(f"`{operator}` in a place where no response stands", term.span)
            case t.Past.ROSE | t.Past.FELL | t.Past.CHANGED | t.Past.ARRIVED:
                if any(self.over(part).last is None for part in term.arguments):
                    raise Unsaid(f"`{term.operator}` of what may change between steps", term.span)
                return self._constant(self._record(term), t.FALSE)
            case _:  # the others only change at steps
                now = self._record(term)
                return self._constant(now, now)

    def _pace(self, term: t.History) -> Lasting:
        assert term.limit is not None
        amount, relation = term.limit.amount, term.limit.relation
        now = disjunction((self._is_first(), t.Compare(relation, CLOCK, amount)))
        return Lasting(now, lambda i: t.Compare(sided("<=", i.side), i.elapsed, amount), None, (amount,), Trend.FALLS)

    def _aged(self, term: t.History) -> Lasting:
        """A past-time record over positions, by a timer since the latest or the earliest beginning."""
        if term.operator is t.Past.HISTORICALLY:
            unmet = negation(term.arguments[0])
            return self._negated(self._machine(term, _kind(term), None, self.over(unmet)))
        parts = tuple(map(self.over, term.arguments))
        if term.operator is t.Past.HELD:
            return self._machine(term, Kind.EARLIEST, parts[0], parts[0])
        return self._machine(term, _kind(term), parts[0] if len(parts) == 2 else None, parts[-1])

    def _just_missed(self, term: t.History) -> Lasting:
        """Whether a limit has just ended: a timer since a beginning at an instant, through that of the limit."""
        assert term.limit is not None
        holds, began = map(self.over, term.arguments)
        through = replace(holds, silent=lambda i: t.TRUE if i.side is Side.AFTER else holds.silent(i), last=None)
        points = replace(began, silent=lambda i: began.silent(i) if i.side is Side.AT else t.FALSE, last=None)
        ended = replace(term, limit=replace(term.limit, relation="=="))
        timer = self._machine(ended, Kind.EARLIEST, through, replace(points, trend=Trend.CHANGES))
        after = lambda i: timer.silent(i) if i.side is Side.AFTER else t.FALSE  # noqa: E731
        return replace(timer, now=t.FALSE, silent=after, trend=Trend.CHANGES)

    def _negated(self, part: Lasting) -> Lasting:
        if part.last is not None:
            return self._constant(negation(part.now), negation(part.last))
        return Lasting(negation(part.now), lambda i: negation(part.silent(i)), None, part.breaks, part.trend.flipped())

    def _machine(self, term: t.History, kind: Kind, holds: Lasting | None, began: Lasting) -> Lasting:
        inner = tuple(dict.fromkeys((*(_closed(holds) if holds is not None else ()), *_closed(began))))
        if len(inner) > LIMITS_NESTED:
            raise Unsaid(f"`{term.operator}` of what has more than {LIMITS_NESTED} limits in seconds", term.span)
        limit = NO_TIME if term.limit is None else term.limit.amount
        named = "" if term.limit is None else term.limit.relation
        relation = named or (">=" if term.operator is t.Past.HELD else "<=")
        record = Record(self.begun, self.longest, kind, holds, began, _inside(term), _sorted(inner), relation, limit)
        cell = self._kept_for(record)
        record.left = cell.read
        _small(cell.now, term)
        constant = not inner
        if kind is Kind.EVER:
            if constant and began.last is not None and (holds is None or holds.last is not None):
                if began.steady and (holds is None or holds.steady):
                    return self._constant(cell.now, cell.now)
                gone_on = conjunction(((t.TRUE if holds is None else holds.last) or t.FALSE, cell.now))
                return self._constant(cell.now, disjunction((began.last, gone_on)))
            return Lasting(cell.now, record.silent, None, inner, record.trend)
        now = conjunction((t.Compare("<=", NO_TIME, cell.now), t.Compare(relation, cell.now, limit)))
        breaks: list[t.Term] = [t.Arithmetic("-", limit, cell.read, REAL)]
        if not constant or (kind is Kind.EARLIEST and began.last not in (began.now, t.FALSE)):
            breaks += [*inner, limit, *(t.Arithmetic("+", at, limit, REAL) for at in inner)]
        trend = record.trend
        return Lasting(now, record.silent, None, tuple(dict.fromkeys(breaks)), trend)

    def _kept_for(self, record: Record) -> Cell:
        """The cell of a record; records with the same `holds` and `began` share it, whatever their limits."""
        began, holds = record.began.now, t.TRUE if record.holds is None else record.holds.now
        parts = [part for part in (record.holds, record.began) if part is not None]
        silent = [p.last for p in parts if p.last is not None and p.last != p.now]  # an event, and a formula like one
        kind = "begun at an instant" if record.relation == "==" else record.kind
        name = f"{kind}{CELL}{digest(t.History(t.Past.SINCE, (holds, began, *silent), BOOL))[:12]}"
        if name not in self._machines:
            ever = record.kind is Kind.EVER
            before, parameters = at_the_parameters(name, (holds, began), BOOL if ever else REAL)
            cell = Cell(before, parameters, t.FALSE if ever else NONE, t.TRUE)
            self._machines[name] = replace(cell, now=record.step(cell.read))
            self.cells.append(self._machines[name])
        return self._machines[name]

    # -- what a silence is like ----------------------------------------------------------------------------------------

    def _constant(self, now: t.Term, last: t.Term) -> Lasting:
        return Lasting(now, lambda _: self._held(last), last)

    def _held(self, last: t.Term) -> t.Term:
        """The value that the previous step left for the silence after it; a formula is false before the first step."""
        if last.sort != BOOL and not free_variables(last):
            return last
        if last == t.FALSE:
            return t.FALSE
        name = f"silence{CELL}{digest(last)[:12]}"
        known = next((cell for cell in self.cells if cell.name == name), None)
        if known is None:
            initial = t.FALSE if last.sort == BOOL else some_value(last.sort)
            known = Cell(*at_the_parameters(name, (last,), last.sort), initial, last)
            self.cells.append(known)
        return known.read

    def begun(self, formula: Lasting, instant: Instant) -> t.Term:
        """The condition that there is a silence before this step, and a formula is true in it."""
        found = formula.silent(instant)
        return found if formula.last is not None else conjunction((negation(self._is_first()), found))

    def _named(self, term: t.History) -> str:
        return f"{'timed ' if self._in_time else ''}{Records._named(self, term)}"

    @contextmanager
    def _timing(self) -> Iterator[None]:
        """Inside, terms are over positions: records with another meaning there have another name."""
        before, self._in_time = self._in_time, True
        try:
            yield
        finally:
            self._in_time = before

    @contextmanager
    def _undone(self) -> Iterator[None]:
        """Remove the cells made inside if a clause has no formula of one step."""
        positions, machines = dict(self._positions), dict(self._machines)
        with Records._undone(self):
            try:
                yield
            except Unsaid:
                self._positions, self._machines = positions, machines
                raise


def _kind(term: t.History) -> Kind:
    if term.limit is None:
        return Kind.EVER
    return Kind.EARLIEST if term.limit.relation in (">", ">=") else Kind.LATEST


def _trend(term: t.Term, parts: tuple[Lasting, ...]) -> Trend:
    match term:
        case t.Not():
            return parts[0].trend.flipped()
        case t.And() | t.Or() | t.Quantified(quantifier=t.Quantifier.FORALL | t.Quantifier.EXISTS):
            return _together(part.trend for part in parts)
        case t.Implies():
            return _together((parts[0].trend.flipped(), parts[1].trend))
        case t.Conditional() if parts[0].trend is Trend.STAYS and term.sort == BOOL:
            return _together((parts[1].trend, parts[2].trend))
        case _:  # it may change either way
            return Trend.CHANGES


def _inside(term: t.History) -> bool:
    """Whether the formula that must hold since the beginning is a conjunct of the beginning."""
    holds, *others = term.arguments
    return all(began == holds or (isinstance(began, t.And) and holds in began.items) for began in others)


def _together(trends: Iterable[Trend]) -> Trend:
    found = set(trends) - {Trend.STAYS}
    return Trend.STAYS if not found else found.pop() if len(found) == 1 else Trend.CHANGES


def _closed(formula: Lasting) -> tuple[t.Term, ...]:
    """The breaks of a formula. Raises Unsaid if one depends on a bound variable that is not free in the formula."""
    own = free_variables(formula.now)
    for at in formula.breaks:
        if any(v.role is t.Role.BOUND and v not in own for v in free_variables(at)):
            raise Unsaid("limits in seconds under a quantifier, inside another")
    return formula.breaks


def _sorted(breaks: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """In ascending order, whatever their values."""
    if len(breaks) < 2:
        return breaks
    one, other = breaks
    return t.Operation(t.Builtin.MIN, (one, other), REAL), t.Operation(t.Builtin.MAX, (one, other), REAL)


def _remade(term: t.Term, parts: list[t.Term]) -> t.Term:
    """The term with other parts, simplified where a part is a truth value."""
    match term:
        case t.And():
            return conjunction(parts)
        case t.Or():
            return disjunction(parts)
        case t.Not():
            return negation(parts[0])
        case t.Implies() if t.FALSE in parts[:1] or t.TRUE in parts[1:]:
            return t.TRUE
        case _:  # nothing to simplify
            same = all(one is other for one, other in zip(term.children, parts, strict=True))
            return term if same else term.rebuild(tuple(parts))


def _small(made: t.Term, whole: t.Term) -> t.Term:
    """The formula. Raises Unsaid if it is too large: each limit inside another doubles the formula a few times."""
    sizes: dict[int, int] = {}

    def size(term: t.Term) -> int:
        if id(term) not in sizes:
            sizes[id(term)] = 1 + sum(map(size, term.children))
        return sizes[id(term)]

    if size(made) > CLOCKED_SIZE:
        raise Unsaid("limits in seconds inside one another, of which there are too many", whole.span)
    return made
