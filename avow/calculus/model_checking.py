"""Temporal requirements, checked on the composed contracts over the plan's scenario, before anything is implemented.

The verdict is `checked` only if every step that the scenario allows was explored, and its domains leave out no output
that the contracts allow; a search cut short is `tested` at best. A run that violates the property is shown step by
step, with the step to which it returns, or up to the step after which no continuation has the property. A system that
cannot take another step stays as it is for ever, and the report says which node has no output.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import field
from random import Random

from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.tuning.bounds import RUN_LENGTH, RUNS_TRIED, STATES_CHECKED
from avow.base.tuning.shown import STEP_VARIABLES
from avow.base.verdict import Counterexample, Verdict
from avow.base.verdict import bound as named
from avow.calculus.discharge import Bounds
from avow.calculus.ltl import Lasso, TooLong, demands_progress, refuted_at, refuted_prefix, violation
from avow.calculus.narrowing import Holds
from avow.calculus.node_outputs import Stuck
from avow.calculus.questions import Answer
from avow.calculus.replaying import completions, holds, truths, unsupported
from avow.calculus.scenario import CannotRun, key, restrictions
from avow.calculus.transition import Machine, Step, Walk
from avow.calculus.variables import Frame, system_term
from avow.formulas.formula import free_variables
from avow.solving.limits import spent, tried, until
from avow.system.temporal import Operator, Property, State, Temporal, states_of

_Memory = tuple[object, ...]


@dataclass(slots=True)
class Explored:
    """The steps reached so far. Steps that agree in the state formulas and in the memory after them are one."""

    machine: Machine
    judges: dict[State, Holds]
    deepest: int | None
    """The number of steps after which a run is no longer followed; None: no limit."""
    steps: list[Step] = field(default_factory=list)
    index: dict[object, int] = field(default_factory=dict)
    following: dict[_Memory, tuple[int, ...]] = field(default_factory=dict)
    truth: list[dict[State, bool]] = field(default_factory=list)
    initial: list[int] = field(default_factory=list)
    cannot_start: Stuck | None = None
    waiting: deque[tuple[_Memory, int]] = field(default_factory=deque)
    depth: int = 0

    def open(self, memory: _Memory) -> tuple[int, ...]:
        """The steps from a memory, each once."""
        if memory not in self.following:
            found: dict[int, None] = {}
            for step in self.machine.judged(memory, tuple(self.judges.values())):
                truth = {state: judge(step.values) for state, judge in self.judges.items()}
                index = (tuple(truth.values()), step.memory)
                if index not in self.index:
                    self.index[index] = len(self.steps)
                    self.steps.append(step)
                    self.truth.append(truth)
                found[self.index[index]] = None
            self.following[memory] = tuple(found)
        return self.following[memory]

    def kind(self, step: Step) -> int:
        """The index of the explored step that this one is identified with."""
        truth = tuple(judge(step.values) for judge in self.judges.values())
        return self.index[(truth, step.memory)]

    def concrete(self, run: list[int]) -> list[Step]:
        """A run of these kinds of steps in which each step starts from the memory after the one before it."""
        found: list[Step] = []
        memories = self.machine.initial()
        judges = tuple(self.judges.values())
        for kind in run:
            step = next((s for m in memories for s in self.machine.judged(m, judges) if self.kind(s) == kind), None)
            if step is None:  # the system stays as it is: there is no further step
                break
            found.append(step)
            memories = (step.memory,)
        return found

    def successors(self, step: int) -> tuple[int, ...]:
        """The explored successors of a step; a step without one is its own successor."""
        memory = self.steps[step].memory
        if memory not in self.following:
            return ()
        stays = (step,) if memory in self.machine.stuck or not self.following[memory] else ()
        return self.following[memory] + stays


def judge_property(machine: Machine, name: str, formula: Property, bounds: Bounds) -> Answer:
    """Whether every run of the composed contracts has the property, within the scenario. Raises CannotRun: see
    `cannot_run`."""
    return _tried(machine, name, formula, bounds) or explored(
        machine, name, formula, bounds, machine.world.scenario.steps
    )


def explored(machine: Machine, name: str, formula: Property, bounds: Bounds, deepest: int | None) -> Answer:
    """The same as `judge_property`, by exploring the reachable steps breadth first; no run is followed for more than
    `deepest` steps."""
    found = _begin(machine, formula, deepest)
    stopped = found.cannot_start is not None and demands_progress(formula)
    done = stopped or _explore(found, formula, bounds)
    if isinstance(done, Lasso):
        answer = _broken(found, name, formula, done)
        bad = _prefix(found, formula, bounds) if answer.verdict is not Verdict.REFUTED else None
        return answer if bad is None else _broken_prefix(found, name, formula, bad)
    if isinstance(done, tuple):
        return _broken_prefix(found, name, formula, done)
    if found.cannot_start is not None and stopped:
        text = f"the system cannot take a first step: {found.cannot_start.text()}"
        verdict = Verdict.REFUTED if found.cannot_start.genuine else Verdict.UNKNOWN
        return Answer(verdict, text, Counterexample(explanation=text), bound=_bound(found))
    within = restrictions(found.machine.world, found.machine.given)
    if done and not machine.short:
        machine.look_for_cuts(until(bounds.effort))
    if done and not machine.short:
        return Answer(
            Verdict.CHECKED,
            f"every run within the scenario has it: {len(found.steps)} kinds of steps, all looked at",
            within=within,
            bound=_bound(found),
            details={"exhaustive": True},
        )
    why = "; ".join(machine.short) or _ended_by(found, bounds)
    if demands_progress(formula):
        why += "; that what it demands never comes can only be shown by a run that repeats or stops, and none was found"
    return Answer(
        Verdict.TESTED,
        f"no run of the first {found.depth} steps was found to break it; not exhaustive: {why}",
        within=(
            *within,
            named("scenario.steps", f"scenario.steps: no run breaks it after its first {found.depth} steps"),
        ),
        bound=_bound(found) | {"n": len(found.steps)},
        details={"exhaustive": False},
    )


def _on_the_way(steps: Sequence[Step]) -> str:
    broken = sorted({clause for step in steps for clause in step.broken})
    return f"; on the way an assumption does not hold: {', '.join(broken)}" if broken else ""


def _tried(machine: Machine, name: str, formula: Property, bounds: Bounds) -> Answer | None:
    """Tries some random runs: most systems that violate a property do so soon, which saves the search."""
    random = Random(bounds.seed)
    deadline = until(bounds.effort / 4)
    judges = _judges(machine, formula)
    best: tuple[Walk, int | None] | None = None  # a run that gets stuck is preferred to one that repeats
    for _ in range(RUNS_TRIED):
        walk = machine.walk(random, RUN_LENGTH, until_repeat=True, judges=tuple(judges.values()))
        if walk.steps and (walk.back is not None or (walk.stuck is not None and walk.stuck.genuine)):
            back = len(walk.steps) - 1 if walk.back is None else walk.back
            if (best is None or walk.stuck is not None) and _breaks(walk.steps, back, formula, judges):
                best = (walk, back)
        elif best is None and _refuted_at(walk.steps, formula, judges) is not None:
            best = (walk, None)
        if spent() > deadline or (best is not None and best[0].stuck is not None):
            break
    if best is None:
        return None
    walk, closes = best
    stuck = None if closes is None else walk.stuck
    return _shown_run(machine, name, formula, list(walk.steps), closes, stuck, {"runs": RUNS_TRIED})


def _breaks(steps: Sequence[Step], back: int, formula: Property, judges: dict[State, Holds]) -> bool:
    """Whether a run that continues with step `back` after its last violates the property."""
    truth = [{state: judge(step.values) for state, judge in judges.items()} for step in steps]
    following = [(k + 1,) for k in range(len(steps) - 1)] + [(back,)]
    return violation(formula, [0], following.__getitem__, lambda k, state: truth[k][state]) is not None


def _refuted_at(steps: Sequence[Step], formula: Property, judges: dict[State, Holds]) -> int | None:
    """The first step after which every continuation of a run violates the property."""
    try:
        return refuted_at(formula, [{state: judge(step.values) for state, judge in judges.items()} for step in steps])
    except TooLong:
        return None


def _judges(machine: Machine, formula: Property) -> dict[State, Holds]:
    return {state: machine.judge(system_term(machine.frame, state.term)) for state in states_of(formula)}


def _begin(machine: Machine, formula: Property, deepest: int | None) -> Explored:
    explored = Explored(machine, _judges(machine, formula), deepest)

    found: dict[int, None] = {}
    for memory in machine.initial():
        first = explored.open(memory)
        explored.cannot_start = explored.cannot_start or machine.stuck.get(memory)
        if explored.cannot_start is not None and demands_progress(formula):
            break

        found.update(dict.fromkeys(first))
    explored.initial = list(found)
    explored.waiting.extend((explored.steps[k].memory, 1) for k in explored.initial)
    return explored


def _explore(explored: Explored, formula: Property, bounds: Bounds) -> Lasso | tuple[int, ...] | bool:
    """Explores breadth first and checks for a violation from time to time. True: nothing is left to explore."""
    deadline = until(bounds.effort)
    deepest = explored.deepest
    next_look, stuck_seen, cut = 64, 0, False
    while explored.waiting:
        memory, depth = explored.waiting.popleft()
        explored.depth = max(explored.depth, depth)
        if memory in explored.following:
            continue
        if (deepest is not None and depth >= deepest) or len(explored.steps) > STATES_CHECKED:
            cut = True
            continue
        if spent() > deadline:
            cut = True
            break
        following = explored.open(memory)
        explored.waiting.extend((explored.steps[k].memory, depth + 1) for k in following)
        stuck = len(explored.machine.stuck)
        if len(explored.steps) >= next_look or stuck > stuck_seen:
            next_look, stuck_seen = 2 * len(explored.steps), stuck if stuck > stuck_seen else stuck_seen
            try:
                found = _violation(explored, formula, deadline)
            except TooLong:
                cut = True
                break
            if found is not None:
                return found
    try:
        found = _violation(explored, formula, max(deadline, spent()) + bounds.effort / 4)
    except TooLong:
        found, cut = None, True
    return found or _prefix(explored, formula, bounds) or not cut


def _ended_by(explored: Explored, bounds: Bounds) -> str:
    """Which limit ended the search."""
    deepest = explored.deepest
    if deepest is not None and explored.depth >= deepest:
        return f"the scenario's `steps` end a run after {deepest}"
    if len(explored.steps) > STATES_CHECKED:
        return f"there are more than {STATES_CHECKED:,} kinds of steps"
    return tried("", bounds.effort)


def _violation(explored: Explored, formula: Property, deadline: float) -> Lasso | None:
    """A violation of the property among the steps explored so far. Raises TooLong."""
    truth = explored.truth
    return violation(formula, explored.initial, explored.successors, lambda k, state: truth[k][state], deadline)


def _prefix(explored: Explored, formula: Property, bounds: Bounds) -> tuple[int, ...] | None:
    """A prefix of a run all of whose continuations violate the property: such a run need not repeat."""
    truth, deadline = explored.truth, until(bounds.effort / 4)
    try:
        return refuted_prefix(
            formula, explored.initial, explored.successors, lambda k, state: truth[k][state], deadline
        )
    except TooLong:
        return None


def _broken_prefix(explored: Explored, name: str, formula: Property, prefix: tuple[int, ...]) -> Answer:
    machine, steps = explored.machine, explored.concrete(list(prefix))
    return _shown_run(machine, name, formula, steps, None, None, _bound(explored))


def _broken(explored: Explored, name: str, formula: Property, lasso: Lasso) -> Answer:
    run = [*lasso.prefix, *lasso.cycle]
    machine = explored.machine
    last = explored.steps[run[-1]]
    stays = len(lasso.cycle) == 1 and run[-1] not in explored.following.get(last.memory, ())
    stuck = machine.stuck.get(last.memory) if stays else None
    steps = explored.concrete(run)
    return _shown_run(machine, name, formula, steps, len(lasso.prefix), stuck, _bound(explored))


def _shown_run(
    machine: Machine,
    name: str,
    formula: Property,
    steps: list[Step],
    back: int | None,
    stuck: Stuck | None,
    bound: dict[str, object],
) -> Answer:
    """A run that violates the property, as a counterexample."""
    trace = tuple(step.shown(_interesting(machine, formula)) for step in steps)
    false = _false_at(machine, formula, steps)
    bad = _refuted_at(steps, formula, _judges(machine, formula)) if false is None and back is None else None
    if stuck is not None:
        text = f"stuck after step {len(steps)}: {stuck.text()}"
    elif false is not None:
        text = f"at step {false + 1} it is false"
        steps, trace, back = steps[: false + 1], trace[: false + 1], None
    else:
        if bad is not None:
            steps, trace = steps[: bad + 1], trace[: bad + 1]
        text = (
            f"from step {back + 1} on, the run repeats"
            if back is not None
            else f"after step {len(steps)} nothing can mend it"
        )
    text += _on_the_way(steps)
    shown = Counterexample(trace[-1] if trace else (), text, trace, back)
    if stuck is not None and not stuck.genuine:
        doubt = "perhaps only because the scenario lacks the value"
    else:
        doubt = _doubt(machine, formula, steps, back, stays=stuck is not None, cut=false is not None or back is None)
    if doubt:
        return Answer(Verdict.UNKNOWN, f"{text}: {doubt}", shown, bound=bound, details={"exhaustive": False})
    return Answer(Verdict.REFUTED, f"a run of the composed contracts breaks {name}: {text}", shown, bound=bound)


def _doubt(
    machine: Machine, formula: Property, steps: Sequence[Step], back: int | None, *, stays: bool, cut: bool
) -> str:
    """Why the replayed run may not be a run, or may not violate the property; empty if both are certain."""
    doubts = [_doubt_of(machine, formula, run, back, stays, cut) for run in completions(machine, steps)]
    return "" if "" in doubts else doubts[0]


def _doubt_of(
    machine: Machine, formula: Property, steps: Sequence[Step], back: int | None, stays: bool, cut: bool
) -> str:
    loose = tuple(unsupported(machine, steps, None if stays or cut else back))
    if loose:
        return f"but over the scenario's values only is it sure that {', '.join(loose[:4])} holds"
    known = complete(truths(machine, formula, step) for step in steps)
    if known is None:
        return "but over the scenario's values only is it sure that the property is broken"
    # violated after its last step for every continuation, or the run repeats
    broken = refuted_at(formula, known) is not None if cut else back is not None and not holds(formula, known, back)
    return "" if broken else "but replayed it does not break the property"


def _false_at(machine: Machine, formula: Property, steps: Sequence[Step]) -> int | None:
    """For ``always F``: the step at which F is false. Later steps do not matter."""
    match formula:
        case Temporal(operator=Operator.ALWAYS, parts=(State() as state,)):
            holds = _judges(machine, state)[state]
            return next((number for number, step in enumerate(steps) if not holds(step.values)), None)
    return None


def _interesting(machine: Machine, formula: Property) -> list[str]:
    """The variables to show: the environment's choices, the outputs, and those that the property mentions."""
    about = [
        variable.qualified
        for state in states_of(formula)
        for variable in sorted(free_variables(system_term(machine.frame, state.term)), key=lambda v: v.qualified)
    ]
    given = [values for choices in machine.environment.values() for values in choices]
    chosen = [name for name in given[0] if len({key(values[name]) for values in given}) > 1]
    outputs = [f"{node}.{port.name}" for node in machine.order for port in machine.frame.node(node).outputs]
    return list(dict.fromkeys([*about, *chosen, *outputs]))[:STEP_VARIABLES]


def cannot_run(frame: Frame, name: str, formula: Property, reason: CannotRun) -> Answer:
    """The answer if the contracts cannot be run: a system that never takes a step meets no progress property."""
    text = str(reason)
    if frame.graph.deadlocks and demands_progress(formula) and text.startswith("start-up deadlock"):
        summary = f"no run ever takes a step, so {name} is not met: {text}"
        return Answer(Verdict.REFUTED, summary, Counterexample(explanation=text))
    return Answer(Verdict.UNKNOWN, f"the contracts cannot be run over the scenario: {text}")


def _bound(explored: Explored) -> dict[str, object]:
    scenario = explored.machine.world.scenario
    return {
        "steps": len(explored.steps),
        "memories": len(explored.following),
        "depth": explored.depth,
        "scenario": scenario.digest,
        "tables": {table.name: len(table.rows) for table in scenario.tables},
        "domains": {domain: len(values) for domain, values in scenario.domains.items()},
    }
