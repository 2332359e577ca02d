"""An invariant of a transition system, found by Z3's Spacer (Komuravelli, Gurfinkel and Chaki, 2016).

The result is only a guess: the caller has to check that it holds initially, is preserved by every step, and implies the
claim. Anything that Spacer cannot express is therefore left out.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from avow.base.records import dataclass
from avow.formulas.formula import free_variables
from avow.formulas.negation_normal_form import push_negations
from avow.language.sorts import BOOL, DataSort, TupleSort
from avow.language.subterms import subterms
from avow.language.terms import TRUE, Apply, History, Index, Length, Quantified, Term, Variable
from avow.solving.checking import put
from avow.solving.quantifier_elimination import ELIMINABLE, TermReader
from avow.solving.translation import Expr, Translator, Unsupported
from avow.solving.z3_module import z3


@dataclass(frozen=True, slots=True)
class Found:
    """`invariant`: over the variables after a step; None if none was found. `broken`: a run exists at the end of which
    the claim is false, as far as Spacer can express it."""

    invariant: Term | None = None
    broken: bool = False


def invariant(
    begins: Sequence[Term],
    goes_on: Sequence[Term],
    last: Sequence[Term],
    state: Mapping[Variable, Variable],
    effort: int,
) -> Found:
    """A formula that holds after every step, and excludes the `last` one. `state`: variables before a step → after it.
    `begins` and `goes_on` describe a first step and a later one, `last` one that violates the claim. The answer is the
    same on every machine: Spacer's steps bound it."""
    kept = {
        v: after
        for v, after in sorted(state.items(), key=lambda item: item[1].qualified)
        if isinstance(v.sort, ELIMINABLE)
    }
    if not kept or not all(map(_sayable, last)):
        return Found()
    # each setting of global guidance over lemmas finds invariants where the other does not end
    for guided in (True, False):
        try:
            found = _asked(begins, goes_on, last, kept, guided, effort)
        except (Unsupported, z3.Z3Exception, RecursionError):
            return Found()
        if found is not None:
            return found
    return Found()


def _asked(
    begins: Sequence[Term],
    goes_on: Sequence[Term],
    last: Sequence[Term],
    state: Mapping[Variable, Variable],
    guided: bool,
    effort: int,
) -> Found | None:
    translator = Translator()
    solver = z3.SolverFor("HORN", ctx=translator.context)
    solver.set("fp.spacer.global", guided)
    sorts = [translator.sort(v.sort) for v in state]
    holds = z3.Function("invariant", *sorts, translator.sort(BOOL))
    before = holds(*map(translator.variable, state))
    after = holds(*map(translator.variable, state.values()))
    nothing = z3.BoolVal(False, ctx=translator.context)

    def rule(premises: Iterable[Term], more: Sequence[Expr], conclusion: Expr) -> None:
        usable = [term for term in premises if _sayable(term)]
        spoken = {*state, *state.values()}.union(*map(free_variables, usable))
        parts = [*map(translator.term, usable), *translator.background(spoken), *more]
        constants = [translator.variable(v) for v in sorted(spoken, key=lambda v: (v.qualified, repr(v.sort)))]
        body = z3.And(*parts) if parts else z3.BoolVal(True, ctx=translator.context)
        solver.add(z3.ForAll(constants, z3.Implies(body, conclusion)))

    rule(begins, [], after)
    rule(goes_on, [before], after)
    rule(last, [before], nothing)
    answer = put(translator, solver, effort, None)
    if answer.status == "unsat":
        return Found(broken=True)
    if answer.status != "sat":
        return None
    meaning = solver.model()[holds]
    if meaning is None or meaning.num_entries() > 0:
        return None
    body = z3.substitute_vars(meaning.else_value(), *map(translator.variable, state.values()))
    found = TermReader(translator, {v.qualified: v for v in state.values()}).formula(body)
    found = push_negations(found)
    return Found(found) if found != TRUE else None


def _sayable(term: Term) -> bool:
    """Whether it has no quantifier, function or sequence."""
    unsaid = (Quantified, Apply, Index, Length, History)
    return all(map(_sayable_sort, free_variables(term))) and not any(isinstance(t, unsaid) for t in subterms(term))


def _sayable_sort(variable: Variable) -> bool:
    return isinstance(variable.sort, (*ELIMINABLE, DataSort, TupleSort))
