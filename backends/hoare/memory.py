"""Programs that keep something from step to step, and contracts that remember: the steps of a node as triples.

An invariant over what the program keeps and what the contract remembers is shown to hold first and to be kept; it is
then known before every step. Guesses that runs of the program do not contradict are tried beside the plan's own.

What runs from the start show is so. Their inputs are drawn, the same ones every time: at, beside and between the
numbers of program and contract, often those of the step before. A run ends where no input is found that the
assumptions allow.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from fractions import Fraction

from avow.backend_kit.protocol import Job
from avow.backend_kit.stepping import Held, Invariant, Stepping, guesses, stepping
from avow.base.diagnostics import Rejected, Span
from avow.base.records import dataclass
from avow.evaluation.compiler import member_of
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term, evaluate
from avow.evaluation.running import Keeper
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import longest_limits, remembers
from avow.formulas.values import Value, show
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.printer import show_sort
from avow.language.scope import of_contract
from avow.language.terms import Role, Term, Variable

from .checker import Checked
from .guesses import Draw, expressions, filled, numbers, strings
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .syntax import Memory, ProgramText
from .triples import Triple, triples
from .tuning import DRAWS, GUESSES, LONGEST_RUN, RUN_LENGTH, RUNS, STICKY
from .typing import Expressions, Names, rejected
from .wp import Condition, TooLarge, conditions


def steps_of(job: Job, source: ProgramText) -> Stepping | None:
    """The steps of the job's node with this program; None where neither remembers anything. Raises Rejected."""
    stated = _stated(job)
    if not source.memory and not stated and not remembers(job.node):
        return None
    held = tuple(_held(each, source, job) for each in source.memory)
    return stepping(job.node, (o.name for o in job.obligations), held, stated, job.contract)


def _stated(job: Job) -> tuple[tuple[str, Span], ...]:
    given = job.options.get("invariants") or ()
    texts = (given,) if isinstance(given, str) else tuple(given) if isinstance(given, Sequence) else ()
    place = job.method.options
    if isinstance(given, str):
        return ((given, place.at("invariants")),)
    return tuple((str(text), place.at("invariants", k)) for k, text in enumerate(texts))


def _held(memory: Memory, source: ProgramText, job: Job) -> Held:
    names = Names(of_contract(job.contract))
    sort = names.type(memory.sort)
    if sort is None:
        raise Rejected(names.unknown_type(memory.sort, memory.span))
    initial = Expressions(names, source.text, {}).read(memory.initial, sort)
    try:
        value = None if free_variables(initial) else evaluate(initial, {})
    except NotEvaluable:
        value = None
    fits = member_of(sort, {})
    if value is None or (fits is not None and not fits(value)):
        message = f"what `{memory.name.name}` is first has to be a constant of {show_sort(sort)}"
        raise rejected("HOARE300", message, memory.span)
    return Held(memory.name.name, sort, initial)


def kept(invariant: Invariant, name: str, steps: Stepping, node: Node, checked: Checked) -> tuple[Triple, ...]:
    """{assumptions and invariants} program {the invariant, of what the step leaves}: `node` has the assumptions."""
    formula = steps.after(invariant.formula)
    clause = Clause(ClauseKind.GUARANTEE, name, 0, formula, None, invariant.text, invariant.span or node.span)
    return triples("", clause, node, checked)


@dataclass(frozen=True, slots=True)
class Established:
    """Invariants that hold before every step, and why others of the plan's are not among them."""

    invariants: tuple[Invariant, ...]
    lacking: tuple[str, ...]


def establish(
    guessed: Sequence[Iterator[Invariant]], steps: Stepping, checked: Checked, proves: Callable[[Condition], bool]
) -> Established:
    """The largest part of the plan's invariants, and of guesses, that hold first and that together each step keeps. Of
    each guess there are forms, of which the first that lasts is taken."""

    def begins(each: Invariant) -> bool:
        return proves(Condition("first", (), steps.first(each.formula), "it holds before the first step"))

    def lasts(each: Invariant, node: Node) -> bool:
        found = kept(each, "invariant", steps, node, checked)
        try:
            return all(proves(c) for t in found for c in conditions(t, checked.program.body))
        except TooLarge:
            return False

    left = [each for each in steps.invariants if begins(each)]
    lacking = [
        f"not shown that `{each.text}` holds before the first step" for each in steps.invariants if each not in left
    ]
    forms = [filter(begins, form) for form in guessed]
    now = [next(form, None) for form in forms]
    while True:
        known = [*left, *(each for each in now if each is not None)]
        node = steps.knowing(known)
        lost = [each for each in known if not lasts(each, node)]
        if not lost:
            return Established(tuple(known), tuple(lacking))
        lacking += [f"not shown that a step keeps `{each.text}`" for each in left if each in lost]
        left = [each for each in left if each not in lost]
        now = [next(forms[k], None) if each in lost else each for k, each in enumerate(now)]


def knowing(job: Job, steps: Stepping, invariants: Sequence[Invariant]) -> Job:
    """The job of the larger node, in which invariants are known before every step."""
    return replace(job, node=steps.knowing(invariants))


def remembered(
    steps: Stepping, checked: Checked, wanted: Sequence[Clause], proves: Callable[[Condition], bool]
) -> tuple[Seen, Established]:
    """What runs from the start show of some guarantees, and the invariants that hold."""
    try:
        limits = longest_limits(clause.formula for clause in steps.own.clauses)
        seen = look(Runner(steps.own, steps, checked, wanted), min(limits, LONGEST_RUN))
    except NotEvaluable:
        seen = Seen()
    if seen.fault is not None or len(seen.broken) == len(wanted) > 0:  # nothing is left to be proved
        return seen, Established((), ())
    memories = [dict(pairs) for pairs in dict.fromkeys(tuple(sorted(m.items())) for m in seen.memories)]
    forms = [(each for each in family if not _contradicted(each, memories)) for family in guesses(steps)]
    found = establish(forms[:GUESSES], steps, checked, proves)
    refuted = tuple(f"a run contradicts `{each.text}`" for each in steps.invariants if _contradicted(each, memories))
    return seen, replace(found, lacking=refuted or found.lacking)


def _contradicted(invariant: Invariant, memories: Sequence[Step]) -> bool:
    """Whether a memory that a run came to breaks it."""
    try:
        holds = compile_term(invariant.formula)
    except NotEvaluable:
        return False
    for memory in memories:
        try:
            if holds(memory) is False:
                return True
        except NotEvaluable:
            continue
    return False


# -- runs from the start -----------------------------------------------------------------------------------------------


Step = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Run:
    """Its steps, each with the node's inputs and outputs by qualified name; the last has no outputs where the program
    stops at a fault."""

    steps: tuple[Step, ...]
    why: str

    def shown(self, node: Node) -> list[tuple[tuple[str, str], ...]]:
        """The steps in the contract's words."""
        ports = [p.variable.qualified for p in (*node.inputs, *node.outputs)]
        return [tuple((name, show(step[name])) for name in ports if name in step) for step in self.steps]


@dataclass(slots=True)
class Seen:
    """What the runs have shown."""

    broken: dict[str, Run] = field(default_factory=dict)
    """Guarantee → a run whose last step breaks it."""
    fault: Run | None = None
    """A run at whose last step the program stops without an output."""
    memories: list[Step] = field(default_factory=list)
    """What cells and program had before a step, by qualified name."""


class Runner:
    """Runs a program step after step. `node` is the contract's own; a reading that cannot be run is reported by
    NotEvaluable."""

    def __init__(self, node: Node, steps: Stepping, checked: Checked, wanted: Iterable[Clause]) -> None:
        self.node, self.steps, self.checked = node, steps, checked
        self.machine = Machine()
        if checked.reading.predicates:
            raise NotEvaluable("a relation is read as a formula")
        terms = checked.reading.terms
        self.inputs = {
            p.variable.qualified: terms[Role.INPUT, p.name] for p in node.inputs if (Role.INPUT, p.name) in terms
        }
        self.outputs = {
            p.variable.qualified: terms[Role.OUTPUT, p.name] for p in node.outputs if (Role.OUTPUT, p.name) in terms
        }
        self.assumptions = [compile_term(a.formula) for a in steps.node.assumptions]
        self.wanted: dict[str, Evaluator] = {c.name: compile_term(c.formula) for c in wanted}
        self.keeper = Keeper(steps.cells)
        held = {h.name for h in steps.held}
        cells = {c.name for c in steps.cells}
        self.given = sorted({v for t in self.inputs.values() for v in free_variables(t)}, key=lambda v: v.name)
        ghosts = {ghost: v for v, ghost in checked.program.ghosts.items()}
        self.given = [ghosts.get(v, v) for v in self.given]
        drawn = {*self.given}
        self.locals = [
            v for v in checked.program.state if v not in drawn and v.name not in held and v.name not in cells
        ]
        formulas = [c.formula for c in steps.node.clauses]
        texts = (*formulas, *expressions(checked.program))
        between, at = numbers(texts)
        beside = {n + d for n in at for d in (-1, 1)}
        pool = sorted({*between, *at, *beside, *map(Fraction, range(4))})
        self.draw = Draw(random.Random(0), pool, sorted(strings(texts)))
        self.memory: dict[str, Value] = {}

    def begin(self) -> None:
        """Before the first step."""
        self.keeper.restart()
        self.memory = {h.name: evaluate(h.initial, {}) for h in self.steps.held}

    def before(self) -> Step:
        """Cells and memory, by qualified name."""
        return {**self.keeper.memory, **{f"in.{name}": value for name, value in self.memory.items()}}

    def allowed(self, given: Mapping[Variable, Value]) -> bool:
        """Whether the assumptions certainly hold of these inputs now."""
        values = {**self.before(), **self._read(self.inputs, self._start(given))}
        return all(holds(values) is True for holds in self.assumptions)

    def step(self, given: Mapping[Variable, Value]) -> tuple[Step, tuple[str, ...]]:
        """One step: its ports, and the guarantees that it breaks. Raises Fault, NoEnd, Endless, NotEvaluable."""
        end = self.machine.run(self.checked.program.body, self._start(given))
        ports = {**self._read(self.inputs, end), **self._read(self.outputs, end)}
        values = {**self.before(), **ports}
        broken = tuple(name for name, holds in self.wanted.items() if holds(values) is False)
        self.keeper.advance(ports)
        self.memory = {name: end[name] for name in self.memory}
        return ports, broken

    def inputs_of(self, given: Mapping[Variable, Value]) -> Step:
        """The contract's inputs."""
        return self._read(self.inputs, self._start(given))

    def _start(self, given: Mapping[Variable, Value]) -> State:
        start: State = {v.name: value for v, value in filled(given, self.locals).items()} | self.memory
        for v, ghost in self.checked.program.ghosts.items():
            if v.name in start:
                start[ghost.name] = start[v.name]
        return start

    def _read(self, terms: Mapping[str, Term], state: State) -> dict[str, Value]:
        return {name: evaluate(term, state) for name, term in terms.items()}


Given = dict[Variable, Value]


def look(runner: Runner, longer: int) -> Seen:
    """What some runs show, the first of them short; `longer` steps are added for limits."""
    seen, rng = Seen(), random.Random(1)
    for k in range(RUNS):
        length = RUN_LENGTH if k % 3 else RUN_LENGTH + longer
        _run(runner, rng, length, rng.choice(STICKY), seen)
        if seen.fault is not None or len(seen.broken) == len(runner.wanted) > 0:
            break
    return seen


def _run(runner: Runner, rng: random.Random, length: int, sticky: float, seen: Seen) -> None:
    runner.begin()
    taken: list[Given] = []
    try:
        for _ in range(length):
            given = _drawn(runner, rng, taken[-1] if taken else None, sticky)
            if given is None:
                return
            seen.memories.append(runner.before())
            taken.append(given)
            _, broken = runner.step(given)
            for name in broken:
                if name not in seen.broken:
                    held = runner.keeper.memory, runner.memory
                    seen.broken[name] = _shortest(runner, taken, name)
                    runner.keeper.memory, runner.memory = held
    except Fault as fault:
        seen.fault = _faulting(runner, taken, f"the program asks for {fault}: there is no output")
    except (NoEnd, Endless, NotEvaluable):
        return


def _drawn(runner: Runner, rng: random.Random, last: Given | None, sticky: float) -> Given | None:
    for _ in range(DRAWS):
        if last is not None and rng.random() < sticky:
            given = dict(last)
            if given and rng.random() < 0.5:
                changed = rng.choice(runner.given)
                given[changed] = runner.draw.value(changed.sort)
        else:
            given = {v: runner.draw.value(v.sort) for v in runner.given}
        if runner.allowed(given):
            return given
    return None


def _replayed(runner: Runner, taken: list[Given], name: str) -> Run | None:
    """The run of these inputs up to a step that breaks the guarantee, if it is allowed and one does."""
    runner.begin()
    steps: list[Step] = []
    try:
        for given in taken:
            if not runner.allowed(given):
                return None
            ports, broken = runner.step(given)
            steps.append(ports)
            if name in broken:
                return Run(tuple(steps), f"guarantee {name} does not hold of the last of {len(steps)} steps")
    except (Fault, NoEnd, Endless, NotEvaluable):
        return None
    return None


def _shortest(runner: Runner, taken: list[Given], name: str) -> Run:
    best, at = list(taken), len(taken) - 2
    while at >= 0:
        tried = [given for k, given in enumerate(best) if k != at]
        if _replayed(runner, tried, name) is not None:
            best = tried
        at -= 1
    found = _replayed(runner, best, name)
    assert found is not None, "the run that was taken breaks it"
    return found


def _faulting(runner: Runner, taken: list[Given], why: str) -> Run | None:
    runner.begin()
    steps: list[Step] = []
    for given in taken[:-1]:
        steps.append(runner.step(given)[0])
    return Run((*steps, runner.inputs_of(taken[-1])), why)
