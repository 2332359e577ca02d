"""Clauses with limits in seconds, as formulas of one step over cells and the time since the step before.

A run's positions are its steps and every instant between them. In the silence after a step ports keep their values,
events are false, `previous`, counts and what is counted in steps stay, and ages grow; a clause is demanded at every
position. An age counts from where something ended (began), also where a silence ended with it.

In a silence each record with a limit changes once, when its age meets the limit. A step therefore looks at the silence
before it at these instants only, and between them: no formula of a step speaks of all instants.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
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
from avow.language.subterms import histories, timed

_EVER = (t.Past.ONCE, t.Past.HISTORICALLY, t.Past.SINCE)
GOES_ON = t.Compare("<", NO_TIME, CLOCK)
"""From step to step, time goes by."""


def compile_timed(node: Node, longest: Fraction | None = None) -> Remembering:
    """As `compile_node`, also of clauses with limits in seconds: they read `CLOCK` (and so do cells). `longest`: beyond
    which no age is told apart, where others than this node's clauses matter."""
    return compiled(node, Timed(longest=longest or longest_limit(c.formula for c in node.clauses)))


def longest_limit(formulas: Iterable[t.Term]) -> Fraction | None:
    """The longest limit in seconds; None where one is not written down."""
    limits = [h.limit for formula in formulas for h in histories(formula) if h.limit is not None]
    seconds = [limit.amount for limit in limits if not limit.steps]
    known = [Fraction(a.value) for a in seconds if isinstance(a, t.Literal) and not isinstance(a.value, bool | str)]
    return max(known, default=None) if len(known) == len(seconds) else None


def arrival(term: t.History) -> t.Variable:
    """Whether a message of an input has come since the step before; at the first step all inputs' have."""
    (port,) = term.arguments
    assert isinstance(port, t.Variable)
    return t.Variable(t.Role.INPUT, f"arrived {port.name}{CELL}", BOOL)


def is_arrival(variable: t.Variable) -> bool:
    """Whether it says that a message has arrived."""
    return variable.name.endswith(CELL) and variable.name.startswith("arrived ")


def events(remembering: Remembering) -> tuple[t.Variable, ...]:
    """What a step's formulas read beside ports and cells: `CLOCK`, and which messages have arrived."""
    spoken = (*(clause.formula for clause in remembering.node.clauses), *(cell.now for cell in remembering.cells))
    cells = set(remembering.before)
    found = {v for term in spoken for v in free_variables(term) if v.name.endswith(CELL) and v not in cells}
    return tuple(sorted(found, key=lambda v: v.name))


def pace_of(node: Node) -> t.Limit | None:
    """How far apart the node's steps are, as far as its contract says (``steps(every 20 ms)``)."""
    return next((clause.pace for clause in node.guarantees if clause.pace is not None), None)


def one_step(node: Node) -> Remembering:
    """As `compile_timed`; what else a step reads are inputs of the node, and what is known of the time between steps
    are assumptions: it comes from outside."""
    paced = tuple(replace(c, kind=ClauseKind.ASSUMPTION) for c in node.guarantees if c.pace is not None)
    others = tuple(c for c in node.guarantees if c.pace is None)
    made = compile_timed(replace(node, assumptions=(*node.assumptions, *paced), guarantees=others))
    read = events(made)
    ports = tuple(Port(t.Role.INPUT, v.name, v.sort, str(v.sort)) for v in read)
    goes_on = Clause(ClauseKind.ASSUMPTION, "time goes on", 0, GOES_ON)
    assumed = (*made.node.assumptions, *((goes_on,) if CLOCK in read else ()))
    return replace(made, node=replace(made.node, inputs=(*node.inputs, *ports), assumptions=assumed))


def one_pace(nodes: Iterable[Node]) -> bool:
    """Whether the steps of all these nodes can be the same steps."""
    paces = [pace for node in nodes if (pace := pace_of(node)) is not None]
    lengths = [(pace.relation, pace.amount.value) for pace in paces if isinstance(pace.amount, t.Literal)]
    every = {value for relation, value in lengths if relation == "=="}
    return len(every) <= 1 and all(v <= most for v in every for _, most in lengths)  # type: ignore[operator]


@dataclass(slots=True)
class Timed(Records):
    """The cells of some formulas, of which some may have limits in seconds."""

    _positions: dict[str, Lasting] = field(default_factory=dict)
    _in_time: bool = False
    longest: Fraction | None = None
    """Older than that, nothing is told apart."""
    _machines: dict[str, Cell] = field(default_factory=dict)

    def clause(self, formula: t.Term) -> t.Term:
        """A clause at a step and in the silence before it. Raises Unsaid, and has then made no cell."""
        if timed(formula) is None:
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
        """A formula of the past at a step, over positions where that is wanted. Raises Unsaid."""
        if not in_time:
            return Records.term(self, formula)
        with self._timing():
            return self.over(formula).now

    def instants(self, formula: Lasting) -> tuple[Mapping[Side, t.Term], tuple[t.Term, ...]]:
        """Of a formula in the silence after a step, over what that has left: its values so many seconds (`ELAPSED`)
        after the step, and when it may change: for each value of a quantified variable, which is then only an argument
        of what is remembered. Raises Unsaid."""
        for at in formula.breaks:
            if any(v.role is t.Role.BOUND for v in free_variables(_unapplied(at))):
                raise Unsaid("limits in seconds that hang on a quantified variable")
        found = {side: formula.silent(Instant(ELAPSED, side)) for side in Side}
        begun = t.Compare("<=", ELAPSED, NO_TIME)  # right after the step: what that itself demands, it may have had
        found[Side.AFTER] = t.Conditional(begun, formula.silent(Instant(NO_TIME, Side.AFTER)), found[Side.AFTER], BOOL)
        return found, formula.breaks

    def throughout(self, formula: Lasting) -> t.Term:
        """That a formula is true all through the silence before a step. Raises Unsaid."""
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
            case operator if limited or (operator in _EVER and term.limit is None):
                return self._aged(term)
            case operator if operator in t.RESPONSES:
                raise Unsaid(f"`{operator}` in a place where no response stands", term.span)
            case t.Past.ROSE | t.Past.FELL | t.Past.CHANGED | t.Past.ARRIVED:
                if any(self.over(part).last is None for part in term.arguments):
                    raise Unsaid(f"`{term.operator}` of what may change between steps", term.span)
                return self._constant(self._record(term), t.FALSE)
            case _:  # what is of steps only stays as it was at the last
                now = self._record(term)
                return self._constant(now, now)

    def _pace(self, term: t.History) -> Lasting:
        assert term.limit is not None
        amount, relation = term.limit.amount, term.limit.relation
        now = disjunction((self._is_first(), t.Compare(relation, CLOCK, amount)))
        return Lasting(now, lambda i: t.Compare(sided("<=", i.side), i.elapsed, amount), None, (amount,), Trend.FALLS)

    def _aged(self, term: t.History) -> Lasting:
        """A record of the past that looks at positions: by the age of the latest or the earliest that counts."""
        if term.operator is t.Past.HISTORICALLY:
            unmet = negation(term.arguments[0])
            return self._negated(self._machine(term, _kind(term), None, self.over(unmet)))
        parts = tuple(map(self.over, term.arguments))
        if term.operator is t.Past.HELD:
            return self._machine(term, Kind.EARLIEST, parts[0], parts[0])
        return self._machine(term, _kind(term), parts[0] if len(parts) == 2 else None, parts[-1])

    def _negated(self, part: Lasting) -> Lasting:
        if part.last is not None:
            return self._constant(negation(part.now), negation(part.last))
        return Lasting(negation(part.now), lambda i: negation(part.silent(i)), None, part.breaks, part.trend.flipped())

    def _machine(self, term: t.History, kind: Kind, holds: Lasting | None, began: Lasting) -> Lasting:
        inner = tuple(dict.fromkeys((*(_closed(holds) if holds is not None else ()), *_closed(began))))
        if len(inner) > LIMITS_NESTED:
            raise Unsaid(f"`{term.operator}` of what has more than {LIMITS_NESTED} limits in seconds", term.span)
        relation, amount, most = self._seconds(term)
        record = Record(
            self.begun,
            self.longest,
            kind,
            holds,
            began,
            _inside(term),
            _sorted(inner),
            relation,
            amount.now,
            amount.silent,
            most,
        )
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
        now = conjunction((t.Compare("<=", NO_TIME, cell.now), t.Compare(relation, cell.now, amount.now)))
        limit = amount.silent(Instant(NO_TIME, Side.AFTER))
        breaks: list[t.Term] = [t.Arithmetic("-", limit, cell.read, REAL)]
        if not constant or (kind is Kind.EARLIEST and began.last not in (began.now, t.FALSE)):
            breaks += [*inner, limit, *(t.Arithmetic("+", at, limit, REAL) for at in inner)]
        trend = record.trend
        return Lasting(now, record.silent, None, tuple(dict.fromkeys(breaks)), trend)

    def _kept_for(self, record: Record) -> Cell:
        """The cell of a record, which all with the same beginnings share, whatever their limits."""
        began, holds = record.began.now, t.TRUE if record.holds is None else record.holds.now
        parts = [part for part in (record.holds, record.began) if part is not None]
        silent = [p.last for p in parts if p.last is not None and p.last != p.now]  # an event, and what is said as one
        name = f"{record.kind}{CELL}{digest(t.History(t.Past.SINCE, (holds, began, *silent), BOOL))[:12]}"
        if name not in self._machines:
            ever = record.kind is Kind.EVER
            before, parameters = at_the_parameters(name, (holds, began), BOOL if ever else REAL)
            cell = Cell(before, parameters, t.FALSE if ever else NONE, t.TRUE)
            self._machines[name] = replace(cell, now=record.step(cell.read))
            self.cells.append(self._machines[name])
        return self._machines[name]

    def _seconds(self, term: t.History) -> tuple[str, Lasting, Fraction | None]:
        """The limit: how an age is held against it, its length, and the length where it is written down."""
        if term.limit is None:
            return "", self._constant(NO_TIME, NO_TIME), None
        amount = self.over(term.limit.amount)
        if amount.last is None:
            raise Unsaid("a limit that changes between steps", term.span)
        value = amount.now.value if isinstance(amount.now, t.Literal) else None
        most = Fraction(value) if value is not None and not isinstance(value, bool | str) else None
        relation = term.limit.relation or (">=" if term.operator is t.Past.HELD else "<=")
        return relation, amount, most

    # -- what a silence is like ----------------------------------------------------------------------------------------

    def _constant(self, now: t.Term, last: t.Term) -> Lasting:
        return Lasting(now, lambda _: self._held(last), last)

    def _held(self, last: t.Term) -> t.Term:
        """What the step before has left to the silence after it; a formula is false before the first step."""
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
        """That there is a silence before this step, and a formula is so in it."""
        found = formula.silent(instant)
        return found if formula.last is not None else conjunction((negation(self._is_first()), found))

    def _named(self, term: t.History) -> str:
        return f"{'timed ' if self._in_time else ''}{Records._named(self, term)}"

    @contextmanager
    def _timing(self) -> Iterator[None]:
        """Inside, terms are over positions: what means another thing there has another name."""
        before, self._in_time = self._in_time, True
        try:
            yield
        finally:
            self._in_time = before

    @contextmanager
    def _undone(self) -> Iterator[None]:
        """What was made is taken back where a clause has no formula of one step."""
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
        case _:  # it may go either way
            return Trend.CHANGES


def _inside(term: t.History) -> bool:
    """Whether what has to hold since the beginning is a part of the beginning."""
    holds, *others = term.arguments
    return all(began == holds or (isinstance(began, t.And) and holds in began.items) for began in others)


def _together(trends: Iterable[Trend]) -> Trend:
    found = set(trends) - {Trend.STAYS}
    return Trend.STAYS if not found else found.pop() if len(found) == 1 else Trend.CHANGES


def _closed(formula: Lasting) -> tuple[t.Term, ...]:
    """The breaks of a formula, none of which may be of one of many values of a variable. Raises Unsaid."""
    own = free_variables(formula.now)
    for at in formula.breaks:
        if any(v.role is t.Role.BOUND and v not in own for v in free_variables(at)):
            raise Unsaid("limits in seconds under a quantifier, inside another")
    return formula.breaks


def _unapplied(term: t.Term) -> t.Term:
    """The term without what functions that have kept something are given."""
    if isinstance(term, t.Apply) and isinstance(term.function, t.Variable) and term.function.name.find(CELL) >= 0:
        return term.function
    return term.rebuild(tuple(map(_unapplied, term.children))) if term.children else term


def _sorted(breaks: tuple[t.Term, ...]) -> tuple[t.Term, ...]:
    """In order, whatever their values are."""
    if len(breaks) < 2:
        return breaks
    one, other = breaks
    return t.Operation(t.Builtin.MIN, (one, other), REAL), t.Operation(t.Builtin.MAX, (one, other), REAL)


def _remade(term: t.Term, parts: list[t.Term]) -> t.Term:
    """The term with other parts; what is sure is not kept in formulas."""
    match term:
        case t.And():
            return conjunction(parts)
        case t.Or():
            return disjunction(parts)
        case t.Not():
            return negation(parts[0])
        case t.Implies() if t.FALSE in parts[:1] or t.TRUE in parts[1:]:
            return t.TRUE
        case _:  # nothing to leave out
            same = all(one is other for one, other in zip(term.children, parts, strict=True))
            return term if same else term.rebuild(tuple(parts))


def _small(made: t.Term, said: t.Term) -> t.Term:
    """A formula that can be worked with. Raises Unsaid: each limit inside another doubles the formula a few times."""
    sizes: dict[int, int] = {}

    def size(term: t.Term) -> int:
        if id(term) not in sizes:
            sizes[id(term)] = 1 + sum(map(size, term.children))
        return sizes[id(term)]

    if size(made) > CLOCKED_SIZE:
        raise Unsaid("limits in seconds inside one another, of which there are too many", said.span)
    return made
