"""Why a contract is not realizable: which guarantees conflict, at which inputs, and what each demands there.

A conflict is a set of guarantees that no output meets together at some allowed input, though without any one of them
some output would. Different inputs can show different conflicts; each is shown once, with its input. Conflicts of more
than three guarantees are found only at inputs that came up for another reason.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

from avow.base.verdict import Counterexample, Verdict
from avow.formulas.formula import free_variables
from avow.formulas.values import Data, Value, show
from avow.language.sorts import DataSort, FunctionSort
from avow.language.terms import Compare, Construct, Not, Quantified, Quantifier, Role, Term, Variable
from avow.sanity.realizability import Formulas, Given, Group, Search
from avow.solving.counterexample import show_values
from avow.solving.limits import spent, until
from avow.solving.questions import Unsupported, solve
from avow.solving.z3_module import z3
from avow.tuning.bounds import CONFLICTS
from avow.tuning.effort import CONFLICT_EFFORT


@dataclass(frozen=True, slots=True)
class Conflict:
    """A minimal set of guarantees that cannot all be met, with an input and what each demands there."""

    clauses: tuple[str, ...]
    inputs: Mapping[Variable, Value]
    demands: tuple[str, ...]

    def counterexample(self) -> Counterexample:
        return Counterexample(show_values(self.inputs), ", ".join(self.demands))


def conflicts(
    inputs: Sequence[Variable],
    group: Group,
    assumptions: Formulas,
    first: Mapping[Variable, Value],
    *,
    given: Given | None = None,
    effort: int = 4_000,
    seed: int = 0,
) -> tuple[Conflict, ...]:
    """The conflicts among a group's guarantees: those at the input `first`, and others found within the time."""
    deadline = until(effort)
    found: dict[frozenset[str], Mapping[Variable, Value]] = {}

    def learn(at: Mapping[Variable, Value]) -> None:
        for clauses in _minimal_sets(group, at, deadline, seed):
            found.setdefault(clauses, at)

    learn(first)
    labels = tuple(group.guarantees)
    # Two guarantees against each other are what people want to see first, and what happens most.
    for size, patience in ((2, 1_000), (1, 400), (3, 400)):
        for chosen in combinations(labels, size):
            left = int(deadline - spent())
            if frozenset(chosen) in found or left <= 0:
                continue
            formulas = {label: group.guarantees[label] for label in chosen}
            possible = [{other: formulas[other] for other in chosen if other != label} for label in chosen if size > 1]
            mentioned = frozenset(v for formula in formulas.values() for v in free_variables(formula))
            outputs = tuple(v for v in group.outputs if v in mentioned)
            limit = min(left, patience)
            search = Search(inputs, Group(formulas, outputs), assumptions, given or {}, limit, seed)
            try:
                answer = search.refute(possible, limit)
            except (Unsupported, z3.Z3Exception):  # what is not found is only not shown
                continue
            if answer is not None and answer.verdict is Verdict.REFUTED:
                learn(answer.inputs)
    order = {label: k for k, label in enumerate(labels)}
    listed = sorted(found.items(), key=lambda pair: (len(pair[0]), sorted(order[label] for label in pair[0])))
    return tuple(_explain(tuple(sorted(clauses, key=order.__getitem__)), group, at, seed) for clauses, at in listed)


def contradictions(
    formulas: Mapping[str, Term], first: Iterable[str], *, effort: int, seed: int = 0
) -> tuple[tuple[str, ...], ...]:
    """The minimal sets of formulas that cannot hold together, `first` before the others that are found within the time
    (eight at most): a set other than these lacks a formula of each of them (Reiter, "A theory of diagnosis from first
    principles", 1987)."""
    deadline = until(effort)
    found = [frozenset(first)]
    waiting: list[frozenset[str]] = [frozenset()]
    for without in waiting:  # which grows
        if spent() > deadline or len(found) >= CONFLICTS:
            break
        core = next((known for known in found if not known & without), None)
        if core is None:
            kept = {label: formula for label, formula in formulas.items() if label not in without}
            answer = solve(kept, effort=min(500, effort), seed=seed, shown=False)
            if answer.status != "unsat":
                continue
            core = frozenset(answer.core)
            found.append(core)
        further = (without | {label} for label in formulas if label in core)
        waiting.extend(labels for labels in further if labels not in waiting)
    return tuple(tuple(label for label in formulas if label in core) for core in found)


def _minimal_sets(group: Group, at: Mapping[Variable, Value], deadline: float, seed: int) -> Iterable[frozenset[str]]:
    """The minimal sets of guarantees that no output meets at this input, smallest first."""
    minimal: list[frozenset[str]] = []
    for size in range(1, len(group.guarantees) + 1):
        for chosen in map(frozenset, combinations(group.guarantees, size)):
            if any(smaller <= chosen for smaller in minimal):
                continue
            if spent() > deadline and size > 2:
                return minimal
            formulas = {label: group.guarantees[label] for label in group.guarantees if label in chosen}
            if solve(formulas, given=at, variables=group.outputs, effort=CONFLICT_EFFORT, seed=seed).status == "unsat":
                minimal.append(chosen)
    return minimal


def _explain(clauses: tuple[str, ...], group: Group, at: Mapping[Variable, Value], seed: int) -> Conflict:
    demands = tuple(
        f"guarantee {label} {_demand(group.guarantees[label], group.outputs, at, seed)}" for label in clauses
    )
    return Conflict(clauses, at, demands)


def _demand(formula: Term, outputs: Sequence[Variable], at: Mapping[Variable, Value], seed: int) -> str:
    """What a guarantee asks for at this input, in the contract's words."""
    mentioned = [output for output in outputs if output in free_variables(formula)]
    answer = solve([formula], given=at, variables=mentioned, effort=CONFLICT_EFFORT, seed=seed)
    if answer.status == "unsat":
        return "cannot be met"
    if answer.status != "sat":
        return "cannot be met together with the others"
    firm: list[str] = []
    loose: list[str] = []
    for output in mentioned:
        value = answer.values[output]
        text = _shown(formula, output, value, at, seed)
        (firm if text else loose).append(f"{output.qualified} = {text or show(value)}")
    return f"demands {' and '.join(firm)}" if firm else f"allows for example {' and '.join(loose)}"


def _shown(formula: Term, output: Variable, value: Value, at: Mapping[Variable, Value], seed: int) -> str:
    """The value if no other is allowed, its constructor if no other is, else nothing."""
    if isinstance(output.sort, FunctionSort):
        return ""
    other = Variable(Role.INPUT, "the value shown", output.sort)
    different = Not(Compare("==", output, other))
    if solve([formula, different], given={**at, other: value}, effort=CONFLICT_EFFORT, seed=seed).status == "unsat":
        return show(value)
    if isinstance(output.sort, DataSort) and isinstance(value, Data):
        fields = output.sort.constructor(value.constructor).parameters
        bound = tuple(Variable(Role.BOUND, f"field {k}", sort) for k, sort in enumerate(fields))
        built = Compare("==", output, Construct(value.constructor, bound, output.sort))
        made: Term = Quantified(Quantifier.EXISTS, bound, built) if bound else built
        if solve([formula, Not(made)], given=at, effort=CONFLICT_EFFORT, seed=seed).status == "unsat":
            return f"{value.constructor}(…)" if bound else value.constructor
    return ""
