"""The memory of a clause that speaks of other steps: the state variables of `avow.formulas.temporal`.

A step is a judgement of the clause. After a step that was not seen (a message was lost or unreadable, an answer was
incomplete), the memory is unknown until later steps determine it. Limits in seconds are judged between steps too.
"""

from __future__ import annotations

import numbers
from collections.abc import Collection, Iterable, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from fractions import Fraction
from typing import Any, NoReturn

from avow.evaluation.evaluate import NotEvaluable, compile_counterexample, compile_term, free_names
from avow.evaluation.running import Keeper
from avow.formulas.formula import conjunction, free_variables
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.cell import CELL, Cell, Unsaid
from avow.formulas.temporal.clock import Timed, is_arrival, longest_limit
from avow.formulas.temporal.responses import due, fulfilled, in_the_past, pending, responding
from avow.formulas.values import Value
from avow.language.contract import Clause, ClauseKind
from avow.language.printer import show_term
from avow.language.sorts import BOOL, INTEGER, NATURAL, REAL
from avow.language.subterms import histories, timed
from avow.language.terms import History, Implies, Past, Quantified, Role, Term, Variable

from .options import Setup
from .pace import Leeway, Silence, moments
from .rules import Parameter, Previous
from .watched import Tally, Watched, conditions_of
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
        self.broke = self.blind = False
        """It was broken there, which is reported; the silence that begins with it need not be reported."""
        self.awaits = self.missed = False
        """It requires a response within a limit, which did not come in time (reported) and has not come since."""
        self.judged: Mapping[str, Value] = {}
        """The valuation of that step."""
        self.silence = silence
        self._arrivals = {v.qualified: _port_of(v.qualified) for v in arrivals}
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
        self._first, self.apart = dict(self._keeper.memory), False
        """The memory before the first step; whether what it says of time depends on no step."""
        read = {v.qualified for term in (formula, *(c.now for c in cells)) for v in free_variables(term)}
        self._ports = {name: _port_of(name) for name in read if name.endswith(THEN)}
        spoken = {c.before.qualified: free_variables(c.record) for c in cells if c.record is not None}
        self._stepped = {name for name in spoken if any(v.name.endswith(THEN) for v in spoken[name])}
        """The state variables that only steps change."""
        self._then: dict[str, Any] | None = None
        """From the first step on: what the latest step read of these, and the ports."""

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
        values = {**{name: values[port] for name, port in self._ports.items() if port in values}, **values}
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
        if silence is None or silence.latest is None or silence.reported or (self.answers and self._then is None):
            return None
        if silence.passed_by is not None:
            return silence.passed_by
        memory = self._keeper.memory
        if self._breaks is None or self._breaks[0] is not memory:
            try:
                self._breaks = memory, silence.broken(memory)
            except (NotEvaluable, KeyError):
                self._breaks = memory, None
        after = self._breaks[1]
        return None if after is None or (silence.asked and not after) else silence.latest + after

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
                silence.spared, silence.elapsed = silence.elapsed, max(allowed, Fraction(0))
        silence.latest = now if silence.latest is None else max(now, silence.latest)
        silence.reported, silence.asked, silence.passed_by = False, False, None

    def between(self, names: Collection[str], values: Mapping[str, Value], supposed: Set[str], now: Fraction) -> None:
        """A message has come that makes no step: it changes what operators with limits in seconds remember. What it
        demands at once is judged at the next step; a deadline that has passed remains."""
        silence, first = self.silence, self._then is None
        lacking = [name for name in names if name not in values or name in supposed]
        if silence is None or (first and any(name.startswith(f"{Role.INPUT}.") for name in lacking)):
            return
        deadline = self.deadline
        silence.passed(now)
        silence.latest = now if silence.latest is None else max(now, silence.latest)
        if not self.apart or (FIRST in self._cells if first else lacking or (self._stepped and not self._then)):
            self.forget()
            self.blind = True
            return
        unknown = {name: _Unknown() for name in lacking}
        self._pass({**values, **unknown, **(self._then or {})}, self._stepped, first=first)
        silence.asked, silence.passed_by = False, None
        remains = deadline is not None and (deadline < now or self.deadline == silence.latest)
        silence.asked, silence.passed_by = True, deadline if remains else None

    def restart(self) -> None:
        """A new run begins: pending responses are dropped."""
        self._keeper.restart()
        self._arrived.clear()
        self._then = None
        self.lost = self.open = self.missed = False
        if self.silence is not None:
            self.silence.latest, self.silence.elapsed, self.silence.reported = None, Fraction(0), False
            self.silence.asked, self.silence.passed_by = False, None

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
        self._then = {name: valuation.get(name, _Unknown()) for name in (*self._ports, *self._stepped)}
        self._pass(values)
        self._arrived.clear()

    def _pass(self, values: Mapping[str, Any], kept: Collection[str] = (), *, first: bool = False) -> None:
        """A step is over, or a message between steps, which leaves some state as it is (before the first step, also
        what an output would change)."""
        before = self._keeper.memory
        self._keeper.memory = {n: v for n, v in self.at(values).items() if n in self._cells}
        self._keeper.advance(self._around(values))
        after = {n: v for n, v in self._keeper.memory.items() if not isinstance(v, _Unknown)}
        kept = [n for n in before if n in kept or (first and n not in after and before[n] == self._first.get(n))]
        self._keeper.memory = {**after, **{n: before[n] for n in kept}}
        self.lost = self.lost and self._keeper.memory.keys() != self._cells

    def step(self, watched: Watched, values: Mapping[str, Value], event: int, supposed: bool) -> bool | None:
        """Judge the clause at a step, which is then over. Initial values of the plan are not remembered."""
        truth = watched.truth_of(values)
        if self.silence is not None and self.silence.spared is not None:
            self.silence.elapsed, self.silence.spared = self.silence.spared, None
            if truth and watched.clause.kind is ClauseKind.GUARANTEE:
                truth, watched.tally.reason = None, watched.tally.reason or self._leeway.late
        if truth and self.blind:
            truth, watched.tally.reason = None, watched.tally.reason or BLIND
        self.broke, self.blind = truth is False, False
        if truth is False and self.mute:
            truth, watched.tally.reason = None, watched.tally.reason or MUTE
        if supposed:
            self.stepped = event
            self.forget()
            return truth
        watched.tally.met |= watched.met(self.at(values))
        self.advance(values, event)
        return truth

    def forget(self) -> None:
        """A step was not seen."""
        self.lost, self.open = True, self._waiting is not None
        self._keeper.memory = {}
        self._then = None if self._then is None else {}


BLIND = "messages came between answers, and what it says of steps and of seconds depends on each other"
MUTE = "a response is due of which no message was ever heard: its topic may not have been recorded"


def watch(clause: Clause, tally: Tally, setup: Setup) -> Watched:
    """A clause under watch. Raises NotEvaluable if it cannot be judged."""
    formula, triggers, steps = clause.formula, conditions_of(clause.formula), None
    names = set[str]()
    if histories(formula):
        in_time = timed(formula) is not None
        arrives = any(each.operator is Past.ARRIVED for each in histories(formula))
        every, separate = in_time and (arrives or _answers_inputs(formula)), False
        never = _unsaid(formula) if in_time else frozenset[str]()
        asked = _once_said(formula) if never else formula
        records = Timed(longest=longest_limit((formula,)))
        silence: Silence | None = None
        try:
            demanded, waiting = in_the_past(asked), pending(asked)
            triggers = (met,) if (met := fulfilled(asked)) else conditions_of(demanded)
            if in_time and not every:
                with suppress(Unsaid):
                    demanded, separate = _apart(demanded), True
                    triggers, waiting = tuple(map(_apart, triggers)), waiting and _apart(waiting)
            if in_time:
                positions = records.positions(demanded)
                holds, breaks = records.instants(positions)
                formula = positions.now
                compiled = {side: compile_term(held) for side, held in holds.items()}
                moved = tuple(map(moments, breaks))
                regular = clause.pace.number if clause.pace is not None and clause.pace.relation == "==" else None
                silence = Silence(compiled, moved, regular, setup.leeway)
            else:
                formula = records.clause(formula)
            triggers = tuple(records.past(trigger, in_time=in_time) for trigger in triggers)
            waiting = None if waiting is None else records.past(waiting, in_time=in_time)
        except Unsaid as unsaid:
            raise NotEvaluable(f"the monitors have no {unsaid.reason}") from None
        read = {v for term in (formula, *(c.now for c in records.cells)) for v in free_variables(term)}
        arrivals = tuple(v for v in read if is_arrival(v))
        steps = Memory(tuple(records.cells), formula, waiting, silence, arrivals, setup.leeway)
        response = responding(clause.formula)
        steps.awaits = response is not None and not response[0] and response[2].operator is Past.WITHIN
        steps.every, steps.apart = every, separate
        names = {n for c in records.cells for n in free_names(c.now) - {p.name for p in c.parameters}}
        for term in (formula, waiting, *triggers):
            names |= free_names(term) if term is not None else set()
        names -= {CLOCK.qualified, ANSWERED.qualified, *(cell.before.qualified for cell in records.cells)}
        names = set(map(_port_of, names))
        steps.unsaid = never
        steps.alone = bool(arrivals) and names == {_port_of(v.qualified) for v in arrivals}
        if clause.pace is not None:  # its steps are the node's answers
            names = {n for n in setup.rules if n.startswith(f"{Role.OUTPUT}.") and n not in setup.hidden}
        # as it was written: the compiled formula has internal names
        clause = replace(clause, formula=formula, text=clause.text or show_term(clause.formula, "unicode"))
    return Watched(
        clause,
        tuple(sorted(names if steps is not None else free_names(formula))),
        compile_term(formula),
        tuple(map(compile_term, triggers)),
        compile_counterexample(formula),
        tally,
        steps=steps,
    )


THEN = f" then{CELL}"
"""The end of the name of a port's value at the latest step."""
FIRST = f"{Role.INPUT}.first step{CELL}"


def _apart(term: Term, stepped: bool = False) -> Term:
    """The formula in which operators over steps read the ports as they were at the latest step; those over instants
    depend on every message. Raises Unsaid if they depend on each other."""
    if isinstance(term, Variable) and stepped and term.role is not Role.BOUND:
        return replace(term, name=term.name + THEN)
    if isinstance(term, History):
        if _over_instants(term):
            edges = (Past.ROSE, Past.FELL, Past.CHANGED)
            if stepped or any(not _over_instants(h) and h.operator not in edges for h in histories(term)):
                raise Unsaid("steps among instants")
            return term
        first = term.operator is Past.PREVIOUS and free_variables(term.arguments[1])
        if first or term.operator is Past.CHANGED or not free_variables(term):
            raise Unsaid("what the first step is")
        stepped = True
    return term.rebuild(tuple(_apart(part, stepped) for part in term.children)) if term.children else term


def _over_instants(term: History) -> bool:
    unlimited = (Past.ONCE, Past.HISTORICALLY, Past.SINCE)
    return term.operator in unlimited if term.limit is None else not term.limit.steps


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
    # that a parameter keeps its value counts only where it does not
    tally.hidden = all(
        isinstance(rule := setup.rules[n], Parameter) and rule.variable != rule.of.variable for n in names
    )
    tally.conditions, tally.met = len(watched.triggers), 0
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


def _port_of(name: str) -> str:
    """``in.scan``, for the variable of its arrival or of its value at the latest step; a port is itself."""
    return name.replace(".arrived ", ".", 1).removesuffix(THEN).removesuffix(CELL) if CELL in name else name


def _quantified(term: Term) -> bool:
    return isinstance(term, Quantified) or any(map(_quantified, term.children))
