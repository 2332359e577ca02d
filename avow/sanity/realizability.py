"""Is a contract realizable: for all inputs that it allows, is there an output that meets every guarantee?

Three methods are tried, first in short rounds, and each answer is sound by itself:
- the question itself, given to the solver (if no output is a function);
- witnesses (`avow.sanity.witnesses`): if no allowed input defeats them all, the contract is realizable;
- a search for an input that defeats them all, which counts only when the solver shows, with the input's values put in,
  that *no* output meets the guarantees there; an output found instead becomes another witness, and the search goes on.

Guarantees that share no output are checked separately: the contract is realizable only if each group is. Sequences are
replaced by functions, tuples by their items, and functions by their values at a point, if that is equivalent.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from avow.base.tuning.effort import CONFIRMING_EFFORT, REALIZABLE_SHARE
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, free_variables, substitute
from avow.formulas.pointwise import pointwise
from avow.formulas.sequences import Flat, flatten
from avow.formulas.tuples import Untupled, untupled
from avow.language.definedness import defined
from avow.language.sorts import SequenceSort
from avow.language.terms import Apply, Quantified, Quantifier, Role, Term, Variable
from avow.sanity.proofs import confirmed, implied, refutes
from avow.sanity.witness_search import Formulas, Given, Group, Realizability, Search, groups
from avow.solving.limits import budget, effort_left, spent
from avow.solving.translation import same_session


@dataclass(frozen=True, slots=True)
class Question:
    """Is there, for all `inputs` that satisfy the assumptions, an output that meets the guarantees? `doubtful`:
    probably not, so inputs without an output are searched for first."""

    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    assumptions: Formulas
    guarantees: Formulas
    effort: int = 10_000
    seed: int = 0
    doubtful: bool = False

    def group(self, labels: Collection[str]) -> Group:
        """The group that these guarantees belong to."""
        return next(g for g in groups(self.guarantees, self.outputs) if set(labels) <= set(g.guarantees))

    def search(self, group: Group, effort: int) -> Search:
        return Search(self.inputs, group, self.assumptions, effort, self.seed)


@same_session()
def realizable(
    inputs: Sequence[Variable],
    outputs: Sequence[Variable],
    assumptions: Formulas,
    guarantees: Formulas,
    *,
    effort: int = 10_000,
    seed: int = 0,
    doubtful: bool = False,
) -> Realizability:
    """Decides the `Question`."""
    return _decided(Question(tuple(inputs), tuple(outputs), assumptions, guarantees, effort, seed, doubtful))


def _decided(asked: Question) -> Realizability:
    end = spent() + asked.effort
    with budget(asked.effort * REALIZABLE_SHARE):
        for method in (_with_items, _with_functions):
            answer = method(asked)
            if answer is not None:
                return answer
        left = max(100, effort_left(end))
        return _grouped(replace(asked, effort=left))


def possible(formulas: Formulas, *, effort: int, seed: int = 0) -> bool:
    """Whether formulas hold together for some values: as the question whether some output meets them, without inputs.
    This helps if functions without a finite table are needed, such as ``f(x) = x``. False proves nothing."""
    wanted = sorted(frozenset().union(*map(free_variables, formulas.values())), key=lambda v: v.qualified)
    return realizable((), wanted, {}, formulas, effort=effort, seed=seed).verdict is Verdict.PROVED


def _grouped(asked: Question) -> Realizability:
    needed: set[str] = set()
    engines: list[str] = []
    open_question: Realizability | None = None
    for group in groups(asked.guarantees, asked.outputs):
        answer = _at_a_point(asked, group) or _searched(asked, group, asked.effort)
        if answer.verdict is Verdict.REFUTED:
            return answer
        if answer.verdict is not Verdict.PROVED:
            open_question = open_question or answer
        needed |= set(answer.needed)
        engines.append(answer.engine)
    if open_question is not None:
        return open_question
    ordered = tuple(label for label in asked.assumptions if label in needed)
    return Realizability(Verdict.PROVED, needed=ordered, engine=", ".join(dict.fromkeys(engines)) or "z3")


def _searched(asked: Question, group: Group, effort: int) -> Realizability:
    """The search's answer for a group, if a separate query confirms it."""
    answer = asked.search(group, effort).decide(asked.doubtful)
    limit = max(CONFIRMING_EFFORT, effort)
    match answer.verdict:
        case Verdict.PROVED:
            good = confirmed(answer.proofs, asked.assumptions, group.guarantees, effort=limit, seed=asked.seed)
        case Verdict.REFUTED:
            good = _refutes(asked, group, answer.inputs, limit)
        case _:  # undecided: nothing to confirm
            return answer
    return answer if good else Realizability(Verdict.UNKNOWN, reason=_UNCONFIRMED, engine=answer.engine)


def _refutes(asked: Question, group: Group, inputs: Given, limit: int) -> bool:
    return refutes(inputs, asked.assumptions, group.guarantees, group.outputs, effort=limit, seed=asked.seed)


def _same(asked: Question, assumptions: Formulas, guarantees: Formulas) -> bool:
    """Whether a proof for these formulas is a proof for the question."""
    limit = max(CONFIRMING_EFFORT, asked.effort)
    return implied(guarantees, asked.guarantees, effort=limit, seed=asked.seed) and implied(
        asked.assumptions, assumptions, effort=limit, seed=asked.seed
    )


_UNCONFIRMED = "an answer was found, but a separate question does not confirm it"


def _at_a_point(asked: Question, group: Group) -> Realizability | None:
    """Decide one group with values in place of functions; None if that is not possible, or not decided."""
    there = pointwise(group.guarantees, group.outputs)
    if there is None:
        return None
    inputs = (*asked.inputs, *there.point)
    answer = _searched(replace(asked, inputs=inputs), Group(there.guarantees, there.outputs), asked.effort // 2)
    limit = max(CONFIRMING_EFFORT, asked.effort // 2)
    match answer.verdict:
        case Verdict.PROVED:
            point = tuple(replace(v, role=Role.BOUND) for v in there.point)
            put: dict[Variable, Term] = dict(zip(there.point, point, strict=True))
            put |= {value: Apply(f, point, value.sort) for f, value in there.values.items()}
            everywhere = {
                label: Quantified(Quantifier.FORALL, point, substitute(formula, put))
                for label, formula in there.guarantees.items()
            }
            good = implied(everywhere, group.guarantees, effort=limit, seed=asked.seed)
        case Verdict.REFUTED:
            answer = replace(answer, inputs={v: x for v, x in answer.inputs.items() if v not in there.point})
            good = _refutes(asked, group, answer.inputs, limit)
        case _:  # some other way may tell more
            good = False
    return answer if good else None


def _with_items(asked: Question) -> Realizability | None:
    """Decide the question with each tuple replaced by its items; None if there are none, or that does not help."""
    formulas = {(True, label): formula for label, formula in asked.assumptions.items()}
    formulas |= {(False, label): formula for label, formula in asked.guarantees.items()}
    apart = untupled(formulas, (*asked.inputs, *asked.outputs))
    if apart is None:
        return None
    assumed, wanted = _halves(apart.formulas)
    answer = _decided(_changed(asked, apart, assumed, wanted))
    match answer.verdict:
        case Verdict.PROVED:
            whole = replace(
                asked,
                assumptions={k: substitute(f, apart.parts) for k, f in asked.assumptions.items()},
                guarantees={k: substitute(f, apart.parts) for k, f in asked.guarantees.items()},
            )
            return answer if _same(whole, assumed, wanted) else None
        case Verdict.REFUTED:
            group = asked.group(answer.group)
            at = apart.values(asked.inputs, answer.inputs)
            good = _refutes(asked, group, at, max(CONFIRMING_EFFORT, asked.effort // 2))
            return replace(answer, inputs=at, group=tuple(group.guarantees)) if good else None
        case _:  # some other way may tell more
            return None


def _with_functions(asked: Question) -> Realizability | None:
    """Decide the question with functions in place of sequences; None if that is not possible, or does not help.

    An output counts only if elements beyond its length do not matter. An input without such an output is then checked
    in the original question: another output may exist there.
    """
    inputs, outputs = asked.inputs, asked.outputs
    sequences = [v for v in (*inputs, *outputs) if isinstance(v.sort, SequenceSort)]
    formulas = {(True, label): formula for label, formula in asked.assumptions.items()}
    formulas |= {
        (False, label): conjunction((formula, defined(formula, [v for v in outputs if v in sequences])))
        for label, formula in asked.guarantees.items()
    }
    flat = flatten(formulas, sequences) if sequences else None
    if flat is None:
        return None
    assumed, wanted = _halves(flat.formulas)
    answer = _grouped(_changed(asked, flat, assumed, wanted))
    if answer.verdict is Verdict.REFUTED:
        values = flat.values(answer.inputs)
        at = None if values is None else {v: values[v] for v in inputs if v in values}
        limit = asked.effort // 4
        return asked.search(asked.group(answer.group), limit).judge(at, limit) if at is not None else None
    if answer.verdict is not Verdict.PROVED:
        return None
    shown, supposed = ({k: flat.restored(f) for k, f in formulas.items()} for formulas in (wanted, assumed))
    return answer if _same(asked, supposed, shown) else None


def _changed(asked: Question, by: Untupled | Flat[Any], assumed: Formulas, wanted: Formulas) -> Question:
    """The question over other variables, with half the effort."""
    inputs, outputs = by.variables(asked.inputs), by.variables(asked.outputs)
    half = asked.effort // 2
    return replace(asked, inputs=inputs, outputs=outputs, assumptions=assumed, guarantees=wanted, effort=half)


def _halves(formulas: Mapping[tuple[bool, str], Term]) -> tuple[dict[str, Term], dict[str, Term]]:
    """Splits formulas that were transformed together into assumptions and guarantees."""
    assumed, wanted = (
        {label: formula for (kind, label), formula in formulas.items() if kind is which} for which in (True, False)
    )
    return assumed, wanted
