"""Why a contract is not realizable: the conflicting guarantees, the inputs, and what each guarantee demands there.

A conflict is a set of guarantees that no output meets together at some allowed input, while every smaller set can be
met there. For an input it shows the relevant part: the comparisons that cause the conflict, and the inputs in them.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from avow.base.tuning.effort import CONFLICT_EFFORT
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.formula import free_variables, negation
from avow.formulas.values import Data, Value, show
from avow.formulas.written import show_values
from avow.language.operators import OPPOSITE
from avow.language.printer import show_term
from avow.language.sorts import BoolSort, DataSort, FunctionSort
from avow.language.subterms import subterms
from avow.language.terms import Apply, Compare, Construct, In, Not, Quantified, Quantifier, Role, Term, Variable
from avow.sanity.realizability import realizable
from avow.sanity.witness_search import Formulas, Given, Group, Realizability, groups
from avow.solving.limits import effort_left, until
from avow.solving.questions import solve
from avow.solving.replay import replay


@dataclass(frozen=True, slots=True)
class Conflict:
    """A minimal set of guarantees that cannot all be met, with an input and what each demands there. `where` describes
    the inputs for which this is true; None if unknown."""

    clauses: tuple[str, ...]
    inputs: Given
    demands: tuple[str, ...]
    where: tuple[Term, ...] | None = None

    def counterexample(self) -> Counterexample:
        demands = ", ".join(self.demands)
        region = " and ".join(map(show_term, self.where or ()))
        return Counterexample(show_values(self.inputs), f"wherever {region}: {demands}" if region else demands)


def conflicts(
    inputs: Sequence[Variable],
    outputs: Sequence[Variable],
    assumptions: Formulas,
    guarantees: Formulas,
    answer: Realizability,
    *,
    effort: int = 4_000,
    seed: int = 0,
) -> tuple[Conflict, ...]:
    """Conflicts among guarantees, given one in `answer`: those of its group first. Without the first clause of each
    of them nothing more is found. The effort is for each group of guarantees that share outputs."""
    found: list[Conflict] = []
    for group in groups(guarantees, outputs):
        deadline, left = until(effort), dict(group.guarantees)
        at: Given | None = answer.inputs if tuple(left) == answer.group else None
        while left and effort_left(deadline):
            if at is None:
                limit = min(effort // 2, effort_left(deadline))
                other = realizable(inputs, group.outputs, assumptions, left, effort=limit, seed=seed)
                if other.verdict is not Verdict.REFUTED:
                    break
                at = other.inputs
            found.append(_explained(tuple(inputs), Group(left, group.outputs), assumptions, at, seed))
            left.pop(found[-1].clauses[0])
            at = None
    found.sort(key=lambda conflict: not set(conflict.clauses) <= set(answer.group))
    return tuple(found)


def _explained(inputs: Sequence[Variable], group: Group, assumptions: Formulas, at: Given, seed: int) -> Conflict:
    """The conflict of a group at an allowed input for which no output meets all of it."""
    core = solve(
        group.guarantees, given=at, variables=group.outputs, effort=CONFLICT_EFFORT, seed=seed, values="unused"
    ).core
    clauses = core or tuple(group.guarantees)
    conflicting = {label: group.guarantees[label] for label in clauses}
    demands = tuple(
        f"guarantee {label} {_demand(formula, group.outputs, at, seed)}" for label, formula in conflicting.items()
    )
    where, matter = _region(inputs, {**assumptions, **conflicting}, at, seed)
    return Conflict(clauses, {v: value for v, value in at.items() if v in matter}, demands, where)


def _region(
    inputs: Sequence[Variable], wanted: Formulas, at: Given, seed: int
) -> tuple[tuple[Term, ...] | None, frozenset[Variable]]:
    """Comparisons in the formulas that are true at this input, such that no output meets the formulas wherever they
    hold (None if unknown); and the inputs that they mention or whose exact values are needed."""
    known = [v for v in inputs if v in at]
    found = (_reading(atom, at) for atom in _about(wanted.values(), known))
    readings: list[Term] = list(dict.fromkeys(reading for reading in found if reading is not None))
    labelled: dict[str, Term] = {f"where {k}": reading for k, reading in enumerate(readings)}
    fixed: list[Variable] = []
    for tried in ([], [v for v in known if not isinstance(v.sort, FunctionSort)], known):
        fixed = tried
        answer = solve({**wanted, **labelled}, given={v: at[v] for v in fixed}, effort=CONFLICT_EFFORT, seed=seed)
        if answer.status == "unsat":
            break
    else:
        return None, frozenset(known)
    for variable in list(fixed):
        fewer = {v: at[v] for v in fixed if v != variable}
        without = solve({**wanted, **labelled}, given=fewer, effort=CONFLICT_EFFORT, seed=seed)
        if without.status == "unsat":
            fixed.remove(variable)
            answer = without
    where = tuple(labelled[label] for label in answer.core if label in labelled)
    return where, frozenset(fixed).union(*map(free_variables, where))


def _about(formulas: Iterable[Term], inputs: Sequence[Variable]) -> list[Term]:
    """The comparisons in the formulas that mention only inputs."""
    found = (
        part
        for formula in formulas
        for part in subterms(formula)
        if isinstance(part, Compare | In | Apply | Variable) and isinstance(part.sort, BoolSort)
    )
    return [part for part in dict.fromkeys(found) if (used := free_variables(part)) and used <= set(inputs)]


def _reading(atom: Term, at: Given) -> Term | None:
    """The comparison or its negation, whichever is true at this input; None if it has no value there."""
    if replay((atom,), at, effort=CONFLICT_EFFORT) is True:
        return atom
    match atom:
        case Compare(operator=sign, left=left, right=right):
            other: Term = Compare(OPPOSITE[sign], left, right)
        case _:  # not a comparison of two values
            other = negation(atom)
    return other if replay((other,), at, effort=CONFLICT_EFFORT) is True else None


def _demand(formula: Term, outputs: Sequence[Variable], at: Mapping[Variable, Value], seed: int) -> str:
    """What a guarantee demands at this input, in the contract's terms."""
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
    """The value if no other is allowed, its constructor if no other is, otherwise empty."""
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
