"""Replays a refuting run, independently of the search that found it, from the contracts and the plan alone.

Each clause, each wire and each initial value is checked again in the values that the run shows; then the property is
evaluated on it by its definition. Formulas that cannot be evaluated exactly go to the solver, which has to prove them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

from avow.base.tuning.bounds import COMPLETIONS
from avow.base.tuning.effort import REPLAY_EFFORT
from avow.calculus.narrowing import Undecided, closed, is_open
from avow.calculus.node_outputs import Doubts, judge
from avow.calculus.scenario import CannotRun, key
from avow.calculus.transition import Machine, Step
from avow.calculus.variables import system_term
from avow.evaluation.evaluate import NotEvaluable
from avow.formulas.formula import free_variables, negation
from avow.formulas.values import Value
from avow.language.subterms import ports_of
from avow.language.terms import Role, Term
from avow.solving.replay import replay
from avow.system.formulas import initial_condition
from avow.system.temporal import Operator, Property, State, states_of

Truth = Mapping[State, bool]


def completions(machine: Machine, steps: Sequence[Step]) -> Iterator[tuple[Step, ...]]:
    """The run as found, and versions with its open values decided: each function and each sequence gets one value for
    all its open points."""
    yield tuple(steps)
    if any(is_open(value) for step in steps for value in step.values.values()):
        for choice in range(COMPLETIONS):
            yield tuple(replace(step, values=_completed(machine, step.values, choice)) for step in steps)


def _completed(machine: Machine, values: Mapping[str, Value], choice: int) -> dict[str, Value]:
    found = dict(values)
    for name, value in values.items():
        if is_open(value):
            node, _, port = name.partition("@")[0].partition(".")
            choices = machine.nodes[node].choices[f"out.{port}"].values or ()
            if choices:
                found[name] = closed(value, choices[choice % len(choices)])
    return found


def unsupported(machine: Machine, steps: Sequence[Step], back: int | None) -> Iterator[str]:
    """The parts of a run that are not shown to agree with the contracts and the plan. `back`: the step to which the
    last one returns; None for a run that does not continue, or stays as it is for ever."""
    for number, step in enumerate(steps, start=1):
        at = f" at step {number}"
        for label, term in machine.frame.environment().items():
            if _truth(machine, term, step.values) is not True:
                yield label + at
        for name in machine.order:
            yield from (clause + at for clause in _node(machine, name, step.values))
    for number, (one, other) in enumerate(_moves(steps, back), start=1):
        yield from (f"{what} after step {number}" for what in _wires(machine, one.values, other.values))
    if steps:
        yield from _start(machine, steps[0].values)


def _moves(steps: Sequence[Step], back: int | None) -> Iterator[tuple[Step, Step]]:
    yield from pairwise(steps)
    if back is not None and steps:
        yield steps[-1], steps[back]


def _wires(machine: Machine, before: Mapping[str, Value], after: Mapping[str, Value]) -> Iterator[str]:
    """Cells, delayed edges and environment constants whose values do not carry over from one step to the next."""
    for name, cell in machine.cells.items():
        try:
            left = cell.now(before)
        except (NotEvaluable, Undecided):
            left = None
        if left is None or key(after[f"{name}@before"]) != key(left):
            yield f"what {name} remembers"
    for name in machine.freed.values():
        if after[f"{name}@before"] and not before[name]:
            yield f"an earlier {name}"
    for endpoint in machine.memory:
        if key(after[f"{endpoint}@before"]) != key(before[str(endpoint)]):
            yield f"the delayed {endpoint}"
    for name in machine.constants:
        if key(before[name]) != key(after[name]):
            yield f"the constant {name}"


def _start(machine: Machine, values: Mapping[str, Value]) -> Iterator[str]:
    for name in machine.freed.values():
        if values[f"{name}@before"]:
            yield f"an earlier {name}"
    for name, cell in machine.cells.items():
        if key(values[f"{name}@before"]) != key(cell.initial):
            yield f"what {name} begins with"
    for edge in machine.graph.edges:
        condition = initial_condition(machine.frame.system, edge) if edge.delayed else None
        if condition is None:
            continue
        node = edge.source.node
        inputs = {v.name: machine.frame.input(node, v.name) for v in ports_of(condition) if v.role is Role.INPUT}
        found = {f"in.{name}": values[read.qualified] for name, read in inputs.items()}
        found[f"out.{edge.source.port}"] = values[f"{edge.source}@before"]
        if _truth(machine, condition, found) is not True:
            yield f"the initial value of {edge.source}"


def _node(machine: Machine, name: str, values: Mapping[str, Value]) -> Iterator[str]:
    """The guarantees of a node that are not shown to hold; none if an assumption is shown not to hold."""
    node = machine.frame.node(name)
    found = {own: values[meant] for own, meant in machine.reads[name]}
    found |= {f"out.{port.name}": values[f"{name}.{port.name}"] for port in node.outputs}
    doubtful = [c for c in node.guarantees if _truth(machine, c.formula, found) is not True]
    freed = machine.freed.get(name)
    broken = any(_truth(machine, c.formula, found) is False for c in node.assumptions) if doubtful or freed else False
    if freed:
        if values[freed] and not (broken or values[f"{freed}@before"]):
            yield f"a broken assumption of {name}"
        broken = bool(values[freed])
    if doubtful and not broken:
        yield from (f"{name}.{clause.name}" for clause in doubtful)


def _truth(machine: Machine, formula: Term, values: Mapping[str, Value]) -> bool | None:
    """Whether a formula holds for values, by exact evaluation or by proof; None if undecided."""
    doubts = Doubts()
    try:
        found = judge(machine.world, formula, doubts=doubts)(values)
    except (CannotRun, Undecided):
        return None
    if not doubts.inexact:
        return found
    given = {v: values[v.name if v.role is Role.BOUND else v.qualified] for v in free_variables(formula)}
    if any(map(is_open, given.values())):
        return None
    wanted = formula if found else negation(formula)
    return found if replay((wanted,), given, effort=REPLAY_EFFORT) else None


# -- the property ------------------------------------------------------------------------------------------------------


def truths(machine: Machine, formula: Property, step: Step) -> Truth | None:
    """The exact truth of a property's state formulas at a step; None if some is not known."""
    found = {s: _truth(machine, system_term(machine.frame, s.term), step.values) for s in states_of(formula)}
    known = {state: truth for state, truth in found.items() if truth is not None}
    return known if len(known) == len(found) else None


def holds(formula: Property, run: Sequence[Truth], back: int) -> bool:
    """Whether a property holds at the first step of a run that continues with step `back` after its last: by the
    definition of linear temporal logic, from the inner formulas outwards."""
    return _everywhere(formula, run, back)[0]


def _everywhere(formula: Property, run: Sequence[Truth], back: int) -> list[bool]:
    """The truth of a formula at each step."""
    if isinstance(formula, State):
        return [truth[formula] for truth in run]
    parts = [_everywhere(part, run, back) for part in formula.parts]
    following = [*range(1, len(run)), back]
    first, second = parts[0], parts[-1]
    match formula.operator:
        case Operator.NOT:
            return [not one for one in first]
        case Operator.AND:
            return [all(each) for each in zip(*parts, strict=True)]
        case Operator.OR:
            return [any(each) for each in zip(*parts, strict=True)]
        case Operator.IMPLIES:
            return [not one or other for one, other in zip(first, second, strict=True)]
        case Operator.IFF:
            return [one == other for one, other in zip(first, second, strict=True)]
        case Operator.NEXT:
            return [first[k] for k in following]
        case Operator.ALWAYS:
            return [not found for found in _until([True] * len(run), [not one for one in first], following)]
        case Operator.EVENTUALLY:
            return _until([True] * len(run), first, following)
        case Operator.UNTIL:
            return _until(first, second, following)


def _until(left: Sequence[bool], right: Sequence[bool], following: Sequence[int]) -> list[bool]:
    """The least fixed point: two backward passes suffice for one loop."""
    found = list(right)
    for _ in range(2):
        for k in reversed(range(len(found))):
            found[k] = found[k] or (left[k] and found[following[k]])
    return found
