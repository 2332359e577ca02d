"""The memory of a clause that speaks of other steps: the state variables of `avow.formulas.temporal`.

A step is a judgement of the clause. After a step that was not seen (a message was lost or unreadable, an answer was
incomplete), the memory is unknown until later steps determine it. Limits in seconds are judged between steps too.
"""

from __future__ import annotations

import math
import numbers
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import product
from typing import Any, NoReturn

from avow.base.tuning.bounds import POINTS_OF_ARGUMENTS
from avow.evaluation.evaluate import NotEvaluable, compile_counterexample, compile_term, free_names
from avow.evaluation.running import Keeper, unnamed
from avow.formulas.formula import conjunction, free_variables
from avow.formulas.temporal.ages import CLOCK, ELAPSED, Side
from avow.formulas.temporal.cell import CELL, Cell, Unsaid
from avow.formulas.temporal.clock import Timed, is_arrival, longest_limit
from avow.formulas.temporal.responses import due, fulfilled, in_the_past, pending, responding
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Clause, ClauseKind
from avow.language.printer import show_term
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL
from avow.language.subterms import histories, subterms, timed
from avow.language.terms import Apply, History, Implies, Past, Quantified, Role, Term, Variable

from .options import Setup
from .pace import Leeway
from .pairing import time_of
from .rules import Previous
from .watched import Tally, Watched, trigger_of
from .word import undetermined


class _Unknown:
    """An unknown value: an operation on it cannot be evaluated. Each is a new object, so that no two are the same."""

    __slots__ = ()

    def _look(self, *_: object) -> NoReturn:
        raise NotEvaluable("what the steps before have left is not known")

    __bool__ = __eq__ = __ne__ = __lt__ = __le__ = __gt__ = __ge__ = __hash__ = _look
    __add__ = __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __neg__ = __abs__ = _look
    __floordiv__ = __rfloordiv__ = __truediv__ = __rtruediv__ = __mod__ = __rmod__ = _look

    def __getattr__(self, name: str) -> NoReturn:
        self._look()


numbers.Rational.register(_Unknown)  # a Fraction of it reads its numerator


Moments = Callable[[Mapping[str, Value]], Iterator[Value]]


@dataclass(slots=True)
class Silence:
    """A clause with limits in seconds between steps, and when its steps were."""

    holds: Mapping[Side, Callable[[Mapping[str, Value]], Value]]
    """Whether it holds `ELAPSED` seconds after a step."""
    breaks: tuple[Moments, ...]
    """The numbers of seconds after a step at which its truth may change."""
    period: Fraction | None
    """For a clause that says that steps come periodically, the period in seconds."""
    leeway: Leeway
    latest: Fraction | None = None
    """The time of its latest step."""
    elapsed: Fraction = Fraction(0)
    """The time from the latest step to the next, which is being judged."""
    reported: bool = False
    """Whether a breach since the latest step has been reported."""
    spared: Fraction | None = None
    """If the step that is being judged came a little after a deadline: the time to it, `elapsed` to the deadline."""

    def broken(self, memory: Mapping[str, Value]) -> Fraction | None:
        """The time after the latest step at which silence breaks the clause, or None. Raises NotEvaluable."""

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


def _moments(at: Term) -> Moments:
    """The values of a term over memory; if it depends on quantified variables, at all remembered values of these and at
    values that are not remembered. The returned function raises NotEvaluable."""
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


class Memory:
    """The memory of one clause."""

    def __init__(
        self, cells: tuple[Cell, ...], formula: Term, waiting: Term | None, silence: Silence | None,
        arrivals: tuple[Variable, ...], leeway: Leeway,
    ) -> None:  # fmt: skip
        self.formula = formula
        """The clause as a formula of one step."""
        self.open = False
        """After the latest step, a response is required of later ones (or may be)."""
        self.lost = False
        """Steps were not seen, and the memory is not completely known again."""
        self.alone = False  # it speaks of arrivals alone
        self.every = False
        """Its steps are all messages of its variables: if they were the node's answers, a dead node would have none."""
        self.answers = False  # its steps are answers of the node
        self.unsaid = frozenset[str]()
        """The outputs of a response to inputs: while one of them was never received, the response has not come."""
        self.mute = False
        """One was never received: the response may be missing because its topic was not recorded."""
        self.stepped = 0
        """The event of its latest step."""
        self.broke = False
        """It was broken there, which is reported; the silence that begins with it need not be reported."""
        self.awaits = self.missed = False
        """It requires a response within a limit, which did not come in time (reported) and has not come since."""
        self.judged: Mapping[str, Value] = {}
        """The valuation of that step."""
        self.silence = silence
        self._arrivals = {v.qualified: _port_of(v) for v in arrivals}
        self._arrived = set[str]()
        self._keeper = Keeper(cells, leeway.instances)
        self._leeway = leeway
        self._waiting = None if waiting is None else compile_term(waiting)
        self._breaks: tuple[Mapping[str, Value], Fraction | None] | None = None
        """The latest memory, and the time after the latest step at which silence breaks it."""
        self._cells = {cell.before.qualified for cell in cells}
        whole = not any(_quantified(term) for term in (formula, *(cell.now for cell in cells)))
        plain = (BOOL, INTEGER, NATURAL, REAL)
        self._open = {c.before.qualified for c in cells if c.sort in plain} if whole else set[str]()
        """The state variables that may be unknown when a formula is evaluated: if they do not matter, it is decided."""

    @property
    def unknown(self) -> str:
        """Why a part of the memory has no value; empty if all parts have one."""
        missing = self._cells - self._keeper.memory.keys()
        return (self._keeper.why or "what the steps before have left is not known") if missing else ""

    def known(self, values: Mapping[str, Value]) -> dict[str, Value]:
        """The known part of a step's valuation."""
        return self._keeper.at(self._around(values))

    def _around(self, values: Mapping[str, Value]) -> Mapping[str, Value]:
        """The values with the time since the step before, and the arrivals since."""
        arrived = {name: port in self._arrived for name, port in self._arrivals.items()}
        if self.unsaid:
            missing: dict[str, Any] = {name: _Unknown() for name in self.unsaid if name not in values}
            arrived[ANSWERED.qualified] = not missing
            values, self.mute = {**values, **missing}, bool(missing)
        if self.silence is None:
            return {**values, **arrived} if arrived else values
        return {**values, **arrived, CLOCK.qualified: self.silence.elapsed}

    def early(self, names: Iterable[str], values: Mapping[str, Value]) -> bool:
        """Whether a variable that it speaks of has no value yet, except outputs of a response that never came."""
        return any(name not in values and name not in self.unsaid for name in names)

    def hears(self, names: Iterable[str]) -> None:
        """Messages of these variables have come."""
        self._arrived.update(names)

    def begins(self, now: Fraction) -> None:
        """A run begins, which counts as an arrival of everything: a clause that speaks of arrivals alone begins with
        it."""
        if self.silence is None or self.silence.latest is not None or not self.alone:
            return
        self._keeper.advance(self._around({}))
        self.silence.latest = now

    def late(self, now: Fraction) -> Fraction | None:
        """The time at which silence broke the clause, if no message under way matters any more; returned once."""
        silence = self.silence
        if silence is None or silence.reported or silence.latest is None or self.lost:
            return None
        deadline = self.deadline
        if deadline is None or now <= deadline + self._leeway.grace:
            return None
        silence.reported = True
        return None if self.mute or (self.broke and deadline == silence.latest) else deadline

    @property
    def deadline(self) -> Fraction | None:
        """The time at which silence breaks the clause, unless a step comes before; None if it does not."""
        silence = self.silence
        if silence is None or silence.latest is None or silence.reported:
            return None
        memory = self._keeper.memory
        if self._breaks is None or self._breaks[0] is not memory:
            try:
                self._breaks = memory, silence.broken(memory)
            except (NotEvaluable, KeyError):
                self._breaks = memory, None
        after = self._breaks[1]
        return None if after is None else silence.latest + after

    def comes(self, now: Fraction) -> None:
        """A step comes at a time."""
        silence = self.silence
        if silence is None:
            return
        silence.passed(now)
        if (
            (deadline := self.deadline) is not None
            and silence.latest is not None
            and now <= deadline + self._leeway.grace
        ):
            allowed = deadline - silence.latest
            if silence.elapsed > allowed:
                silence.spared, silence.elapsed = silence.elapsed, allowed
        silence.latest = now if silence.latest is None else max(now, silence.latest)
        silence.reported = False

    def restart(self) -> None:
        """A new run begins: pending responses are dropped."""
        self._keeper.restart()
        self._arrived.clear()
        self.lost = self.open = self.missed = False
        if self.silence is not None:
            self.silence.latest, self.silence.elapsed, self.silence.reported = None, Fraction(0), False

    def at(self, values: Mapping[str, Value]) -> dict[str, Any]:
        """A step's valuation, in which operations on unknown values cannot be evaluated."""
        known = self.known(values)
        return {**{name: _Unknown() for name in self._open if name not in known}, **known}

    def advance(self, values: Mapping[str, Value], event: int) -> None:
        """The step is over."""
        self.stepped = event
        self.judged = valuation = self.at(values)
        if self._waiting is not None:
            try:
                self.open = bool(self._waiting(valuation))
            except NotEvaluable:
                self.open = True
        self._keeper.memory = {n: v for n, v in valuation.items() if n in self._cells}
        self._keeper.advance(self._around(values))
        self._arrived.clear()
        self._keeper.memory = {n: v for n, v in self._keeper.memory.items() if not isinstance(v, _Unknown)}
        self.lost = self.lost and self._keeper.memory.keys() != self._cells

    def step(self, watched: Watched, values: Mapping[str, Value], event: int, supposed: bool) -> bool | None:
        """Judge the clause at a step, which is then over. Initial values of the plan are not remembered."""
        truth = watched.truth_of(values)
        if self.silence is not None and self.silence.spared is not None:
            self.silence.elapsed, self.silence.spared = self.silence.spared, None
            if truth and watched.clause.kind is ClauseKind.GUARANTEE:
                truth, watched.tally.reason = None, watched.tally.reason or self._leeway.late
        self.broke = truth is False
        if truth is False and self.mute:
            truth, watched.tally.reason = None, watched.tally.reason or MUTE
        if supposed:
            self.stepped = event
            self.forget()
            return truth
        watched.tally.triggered = watched.tally.triggered or watched.triggered(self.at(values))
        self.advance(values, event)
        return truth

    def forget(self) -> None:
        """A step was not seen."""
        self.lost, self.open = True, self._waiting is not None
        self._keeper.memory = {}


MUTE = "a response is due of which no message was ever heard: its topic may not have been recorded"


def watch(clause: Clause, tally: Tally, setup: Setup) -> Watched:
    """A clause under watch. Raises NotEvaluable if it cannot be judged."""
    formula, trigger, steps = clause.formula, trigger_of(clause.formula), None
    names = set[str]()
    if histories(formula):
        in_time = timed(formula) is not None
        never = _unsaid(formula) if in_time else frozenset[str]()
        asked = _once_said(formula) if never else formula
        records = Timed(longest=longest_limit((formula,)))
        silence: Silence | None = None
        try:
            if in_time:
                positions = records.positions(asked)
                holds, breaks = records.instants(positions)
                formula = positions.now
                compiled = {side: compile_term(held) for side, held in holds.items()}
                moved = tuple(map(_moments, breaks))
                every = clause.pace.number if clause.pace is not None and clause.pace.relation == "==" else None
                silence = Silence(compiled, moved, every, setup.leeway)
            else:
                formula = records.clause(formula)
            trigger = fulfilled(asked) or trigger_of(in_the_past(asked))
            trigger = None if trigger is None else records.past(trigger, in_time=in_time)
            waiting = pending(asked)
            waiting = None if waiting is None else records.past(waiting, in_time=in_time)
        except Unsaid as unsaid:
            raise NotEvaluable(f"the monitors have no {unsaid.reason}") from None
        read = {v for term in (formula, *(c.now for c in records.cells)) for v in free_variables(term)}
        arrivals = tuple(v for v in read if is_arrival(v))
        steps = Memory(tuple(records.cells), formula, waiting, silence, arrivals, setup.leeway)
        response = responding(clause.formula)
        steps.awaits = response is not None and not response[0] and response[2].operator is Past.WITHIN
        steps.every = in_time and (bool(arrivals) or _answers_inputs(clause.formula))
        names = {n for c in records.cells for n in free_names(c.now) - {p.name for p in c.parameters}}
        names |= free_names(waiting) if waiting is not None else set()
        names |= free_names(trigger) if trigger is not None else set()
        names = (names | free_names(formula)) - {cell.before.qualified for cell in records.cells}
        names = names - {CLOCK.qualified, ANSWERED.qualified, *(v.qualified for v in arrivals)} | set(
            map(_port_of, arrivals)
        )
        steps.unsaid = never
        steps.alone = bool(arrivals) and names == set(map(_port_of, arrivals))
        if clause.pace is not None:  # its steps are the node's answers
            names = {n for n in setup.rules if n.startswith(f"{Role.OUTPUT}.") and n not in setup.hidden}
        # as it was written: the compiled formula has internal names
        clause = replace(clause, formula=formula, text=clause.text or show_term(clause.formula, "unicode"))
    return Watched(
        clause,
        tuple(sorted(names if steps is not None else free_names(formula))),
        compile_term(formula),
        None if trigger is None else compile_term(trigger),
        compile_counterexample(formula),
        tally,
        steps=steps,
    )


def triggers_of(setup: Setup, names: tuple[str, ...], *, every: bool = False) -> tuple[str, ...]:
    """Those of a clause's variables whose publication triggers its judgement."""
    carried = setup.carried
    direct = tuple(n for n in names if n in carried)
    outputs = tuple(n for n in direct if n.startswith(f"{Role.OUTPUT}."))
    sources = tuple(rule.source for n in names if isinstance(rule := setup.rules[n], Previous))
    if outputs and setup.when != "every" and not every:
        return outputs
    return direct or sources


def watching(
    setup: Setup, clause: Clause, tally: Tally, previous: Sequence[tuple[str, str]], values: Mapping[str, Value],
    pairs: bool,
) -> tuple[Watched, tuple[str, ...]] | None:  # fmt: skip
    """A node's clause under watch, and the variables whose publication triggers its judgement; None, with the reason in
    the tally, if it cannot be judged. `previous`: (variable, its source) for values of the step before; `pairs`:
    whether answers are paired with their inputs."""
    try:
        if reason := unmonitored(setup, clause):
            raise NotEvaluable(reason)
        watched = watch(clause, tally, setup)
    except NotEvaluable as error:
        tally.reason = error.reason
        return None
    names = watched.names
    if hidden := [setup.hidden[n] for n in names if n in setup.hidden]:
        tally.reason, tally.hidden = hidden[0], True
        return None
    tally.triggered = watched.trigger is None
    every = watched.steps is not None and watched.steps.every
    triggers = triggers_of(setup, names, every=every)
    answers = any(n.startswith(f"{Role.OUTPUT}.") for n in triggers)
    if setup.when == "outputs" and answers and not every:
        watched.outputs = frozenset(triggers)
        if len(triggers) > 1:
            watched.held = tuple((n, s) for n, s in previous if n in names and s in triggers)
            # before the first answer: the initial values
            watched.memory = {n: values[n] for n, _ in watched.held if n in values}
    if answers:
        watched.inputs = tuple(n for n in names if n in setup.heard)
        tally.unpaired = bool(watched.inputs) and setup.answers is None
        watched.paired = watched.inputs if pairs else ()
    if watched.steps is not None:
        watched.steps.answers = answers and not every
    return watched, triggers


def unmonitored(setup: Setup, clause: Clause) -> str:
    """Why a clause that speaks of other steps, or one whose node's assumptions do, is not monitored; empty if it is."""
    for about in dict.fromkeys((clause, *setup.node.assumptions)):
        if not histories(about.formula):
            continue
        where = "" if about is clause else f"the assumption {about.name}: "
        if setup.answers is not None and setup.answers.by != "arrival" and (reason := undetermined(setup, about)):
            return where + reason
        try:
            names = watch(about, Tally(), setup).names
        except NotEvaluable as error:
            return where + error.reason
        hidden = [setup.hidden[name] for name in names if name in setup.hidden]
        if hidden and about is not clause:
            return where + hidden[0]
        if not hidden and not triggers_of(setup, names):
            return f"{where}it refers to other steps, and no message makes one"
    return ""


def hear(remembering: Iterable[Watched], names: Iterable[str]) -> None:
    """Messages of these variables have come."""
    for watched in remembering:
        if watched.steps is not None:
            watched.steps.hears(names)


def overdue(timed: Sequence[Watched], event: Mapping[str, Any]) -> list[tuple[Watched, Fraction]]:
    """The clauses that silence has broken by the time of an event, with the time of the breach, in order of time (at
    the same time: assumptions first); each is reported once."""
    now = time_of(event) if timed else Fraction(0)
    found: list[tuple[Watched, Fraction]] = []
    for watched in timed:
        assert watched.steps is not None
        watched.steps.begins(now)
        if (deadline := watched.steps.late(now)) is not None and not watched.steps.missed:
            watched.steps.missed = watched.steps.awaits
            watched.truth, watched.tally.published = False, watched.tally.published + 1
            found.append((watched, deadline))
    return sorted(found, key=lambda each: (each[1], each[0].clause.kind is not ClauseKind.ASSUMPTION))


def soonest(timed: Sequence[Watched]) -> float:
    """Silence breaks nothing before this time."""
    left = (watched.steps.deadline for watched in timed if watched.steps is not None)
    return min((math.nextafter(float(at), 0.0) for at in left if at is not None), default=math.inf)


def _answers_inputs(formula: Term) -> bool:
    """Whether a clause requires something of later positions, by a trigger about inputs only."""
    found = due(formula)
    spoken = {v.role for t in found.triggers for v in free_variables(t)} if found is not None else set()
    return Role.INPUT in spoken and Role.OUTPUT not in spoken


ANSWERED = Variable(Role.INPUT, f"answered{CELL}", BOOL)
"""Whether every variable of a response has been received."""


def _unsaid(formula: Term) -> frozenset[str]:
    """The outputs of a response to inputs, which may never have been received; empty for one under a quantifier: there,
    no part of a formula may be unknown."""
    found = responding(formula)
    within = found is not None and found[2].operator is Past.WITHIN  # the others are due at once
    if found is None or not within or _quantified(formula) or not _answers_inputs(formula):
        return frozenset()
    spoken = {v for part in found[2].arguments for v in free_variables(part)}
    return frozenset(v.qualified for v in spoken if v.role is Role.OUTPUT)


def _once_said(formula: Term) -> Term:
    """A response that must have been received: a claim without a value is not met."""
    if isinstance(formula, Implies):
        return Implies(formula.left, _once_said(formula.right), formula.span)
    assert isinstance(formula, History)
    return replace(formula, arguments=tuple(conjunction((ANSWERED, part)) for part in formula.arguments))


def _port_of(arrival: Variable) -> str:
    """``in.scan``, for the variable that records whether a message of it has arrived."""
    return f"in.{arrival.name.removeprefix('arrived ').removesuffix(CELL)}"


def _quantified(term: Term) -> bool:
    return isinstance(term, Quantified) or any(map(_quantified, term.children))
