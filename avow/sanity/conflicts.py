"""Why a contract is not realizable: the conflicting guarantees, the inputs, and what each guarantee demands there.

A conflict is a set of guarantees that no output meets together at some allowed input, while every smaller set can be
met at all of them. Avow searches for every conflict (`minimal_sets`) and reports if the search was cut short. For an
input it shows the relevant part: the comparisons that cause the conflict, and the inputs in them.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

from avow.base.tuning.bounds import CONFLICTS
from avow.base.tuning.effort import CONFLICT_EFFORT, CONFLICT_SEARCH_EFFORT
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
from avow.solving.limits import effort_left, spent, until
from avow.solving.questions import solve
from avow.solving.replay import replay
from avow.solving.translation import Translator
from avow.solving.z3_module import z3


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
) -> tuple[tuple[Conflict, ...], bool]:
    """The conflicts among guarantees, given one in `answer`: first those of its group, and within a group those with
    the fewest clauses; and whether these are all. The effort is for each group of guarantees that share outputs."""
    found: list[Conflict] = []
    complete = True
    for group in groups(guarantees, outputs):
        at: Given | None = answer.inputs
        if tuple(group.guarantees) != answer.group:
            other = realizable(inputs, group.outputs, assumptions, group.guarantees, effort=effort // 2, seed=seed)
            at = other.inputs if other.verdict is Verdict.REFUTED else None
            complete = complete and other.verdict is not Verdict.UNKNOWN
        if at is not None:
            search = _Search(tuple(inputs), group, assumptions, until(effort), seed, [at])
            labels = tuple(group.guarantees)
            sets = minimal_sets(labels, search.core, most=CONFLICTS, ended=search.ended)
            complete = complete and sets.complete
            found += (search.explained(tuple(label for label in labels if label in chosen)) for chosen in sets.sets)
    found.sort(key=lambda conflict: not set(conflict.clauses) <= set(answer.group))
    return tuple(found), complete


@dataclass(slots=True)
class _Search:
    """The search for one group's conflicts."""

    inputs: tuple[Variable, ...]
    group: Group
    assumptions: Formulas
    deadline: float
    seed: int
    shown: list[Given]
    """Allowed inputs for which no output meets all of the group."""
    refuted: dict[frozenset[str], Given] = field(default_factory=dict)
    """Sets of guarantees → an allowed input at which no output meets them."""

    def ended(self) -> bool:
        return spent() > self.deadline

    def core(self, chosen: frozenset[str]) -> frozenset[str] | None:
        """A subset of these guarantees that no output meets at some allowed input; None if all can always be met."""
        for at in self.shown:
            if (core := self._core_at(at, chosen)) is not None:
                return core
        left = min(CONFLICT_SEARCH_EFFORT, effort_left(self.deadline))
        if left <= 0:
            raise UndecidedError
        formulas, outputs = self._part(chosen)
        found = realizable(self.inputs, outputs, self.assumptions, formulas, effort=left, seed=self.seed)
        if found.verdict is Verdict.PROVED:
            return None
        if found.verdict is not Verdict.REFUTED:
            raise UndecidedError
        self.shown.append(found.inputs)
        self.refuted.setdefault(chosen, found.inputs)
        return self._core_at(found.inputs, chosen) or chosen

    def _core_at(self, at: Given, chosen: frozenset[str]) -> frozenset[str] | None:
        formulas, outputs = self._part(chosen)
        answer = solve(formulas, given=at, variables=outputs, effort=CONFLICT_EFFORT, seed=self.seed, values="unused")
        if answer.status != "unsat":
            return None
        core = frozenset(answer.core)
        self.refuted.setdefault(core, at)
        return core

    def _part(self, chosen: frozenset[str]) -> tuple[dict[str, Term], tuple[Variable, ...]]:
        formulas = {label: formula for label, formula in self.group.guarantees.items() if label in chosen}
        mentioned = frozenset[Variable]().union(*map(free_variables, formulas.values()))
        return formulas, tuple(v for v in self.group.outputs if v in mentioned)

    def explained(self, clauses: tuple[str, ...]) -> Conflict:
        at = self.refuted[frozenset(clauses)]
        demands = tuple(
            f"guarantee {label} {_demand(self.group.guarantees[label], self.group.outputs, at, self.seed)}"
            for label in clauses
        )
        wanted = {**self.assumptions, **self._part(frozenset(clauses))[0]}
        where, matter = _region(self.inputs, wanted, at, self.seed)
        return Conflict(clauses, {v: value for v, value in at.items() if v in matter}, demands, where)


def contradictions(
    formulas: Formulas, first: Iterable[str], *, effort: int, seed: int = 0
) -> tuple[tuple[tuple[str, ...], ...], bool]:
    """The minimal sets of formulas that cannot hold together, `first` before the others; and whether these are all."""
    deadline = until(effort)
    known = frozenset(first)

    def core(chosen: frozenset[str]) -> frozenset[str] | None:
        if known <= chosen:
            return known
        kept = {label: formula for label, formula in formulas.items() if label in chosen}
        answer = solve(kept, effort=min(CONFLICT_EFFORT, effort), seed=seed, values="unused")
        if answer.status == "unknown":
            raise UndecidedError
        return frozenset(answer.core) if answer.status == "unsat" else None

    sets = minimal_sets(tuple(formulas), core, most=CONFLICTS, ended=lambda: spent() > deadline)
    ordered = sorted(sets.sets, key=lambda chosen: chosen != known)
    return tuple(tuple(label for label in formulas if label in chosen) for chosen in ordered), sets.complete


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


# -- minimal sets ------------------------------------------------------------------------------------------------------


class UndecidedError(Exception):
    """It is undecided whether a set has the property."""


@dataclass(frozen=True, slots=True)
class _MinimalSets:
    """The sets, smallest first, and whether they are certainly all sets and minimal."""

    sets: tuple[frozenset[str], ...]
    complete: bool


def minimal_sets(
    labels: Sequence[str],
    core: Callable[[frozenset[str]], frozenset[str] | None],
    *,
    most: int,
    ended: Callable[[], bool],
) -> _MinimalSets:
    """All minimal sets of labels with a monotone property (every superset also has it). Seeds are maximal sets of
    unknown status; one with the property is shrunk to a minimal set, one without it decides all its subsets (Liffiton,
    Previti, Malik and Marques-Silva, "Fast, flexible MUS enumeration", 2016).

    `core` returns a subset of a set that has the property, or None if the set does not have it; it raises
    `UndecidedError`. The search stops after `most` sets, or when `ended`.
    """
    known = _Known(labels)
    found: list[frozenset[str]] = []
    complete = True
    while (seed := known.seed()) is not None:
        if ended() or len(found) >= most:
            complete = False
            break
        try:
            having = core(seed)
        except UndecidedError:
            known.without(seed)
            complete = False
            continue
        if having is None:
            known.lack(seed)
            continue
        for label in labels:
            if label not in having or len(having) == 1:
                continue
            try:
                if not ended():
                    having = core(having - {label}) or having
                else:
                    complete = False
            except UndecidedError:
                complete = False
        found.append(having)
        known.have(having)
    order = {label: k for k, label in enumerate(labels)}
    found.sort(key=lambda chosen: (len(chosen), sorted(order[label] for label in chosen)))
    return _MinimalSets(tuple(found), complete)


class _Known:
    """The sets of known status, as clauses over a Boolean for each label."""

    def __init__(self, labels: Sequence[str]) -> None:
        context = Translator().context
        self._solver = z3.Solver(ctx=context)
        self._chosen = {label: z3.Bool(f"{k}", context) for k, label in enumerate(labels)}

    def seed(self) -> frozenset[str] | None:
        """A maximal set of unknown status; None if there is none."""
        if self._solver.check() != z3.sat:
            return None
        seed = self._true()
        for label in self._chosen:
            together = [v for k, v in self._chosen.items() if k in seed or k == label]
            if label not in seed and self._solver.check(*together) == z3.sat:
                seed |= self._true()
        return frozenset(seed)

    def _true(self) -> set[str]:
        model = self._solver.model()
        return {label for label, chosen in self._chosen.items() if z3.is_true(model.eval(chosen))}

    def lack(self, labels: Collection[str]) -> None:
        self._solver.add(z3.Or([v for label, v in self._chosen.items() if label not in labels] or [self._false()]))

    def have(self, labels: Collection[str]) -> None:
        self._solver.add(z3.Or([z3.Not(v) for label, v in self._chosen.items() if label in labels] or [self._false()]))

    def without(self, labels: Collection[str]) -> None:
        """Exclude only this set from further seeds."""
        self._solver.add(z3.Or([z3.Not(v) if label in labels else v for label, v in self._chosen.items()]))

    def _false(self) -> object:
        return z3.BoolVal(False, self._solver.ctx)
