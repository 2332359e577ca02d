"""Entailment between clauses of contracts, helped where the solver's instantiation of quantifiers gives up.

"There is a place around which all reports lie" follows from "there is exactly one place that is reported": the witness
of the one serves for the other. Solvers with linear arithmetic do not find that by themselves, so it is put to them:
an existential hypothesis holds of some values (its witnesses), and an existential goal is proved once it is proved of
these. That is a stronger claim: when it fails, nothing is said, and the question is asked as it stands.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from avow.base.tuning.bounds import WITNESSES_TRIED
from avow.base.tuning.effort import QUICK_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.kept_answers import entailed_before, keep_entailed
from avow.formulas.formula import substitute
from avow.language.terms import And, Quantified, Quantifier, Role, Term, Variable
from avow.solving.questions import Entailment, entails


def implied(
    hypotheses: Mapping[str, Term], goal: Term, *, effort: int, seed: int = 0, whether: bool = False
) -> Entailment:
    """As `avow.solving.questions.entails`: the quick question first, then with witnesses, then at length. What was
    proved before is not asked again, within `avow.calculus.kept_answers.keeping`; nor what was refuted, where only
    `whether` it is proved matters."""
    mark, answer = entailed_before(hypotheses, goal, effort, seed, whether)
    if answer is None:
        answer = _implied(hypotheses, goal, effort, seed)
        keep_entailed(mark, answer)
    return answer


def _implied(hypotheses: Mapping[str, Term], goal: Term, effort: int, seed: int) -> Entailment:
    quick = min(QUICK_EFFORT, effort)
    answer = entails(hypotheses, goal, effort=quick, seed=seed)
    if answer.verdict is not Verdict.UNKNOWN:
        return answer
    opened, witnesses = _opened(hypotheses)
    for stronger in _witnessed(goal, witnesses):
        found = entails(opened, stronger, effort=quick, seed=seed)
        if found.verdict is Verdict.PROVED:
            return found
    return entails(hypotheses, goal, effort=effort, seed=seed) if effort > quick else answer


def _opened(hypotheses: Mapping[str, Term]) -> tuple[dict[str, Term], list[tuple[Variable, ...]]]:
    """The hypotheses with names for what their outermost existential quantifiers say there is, and these names."""
    opened: dict[str, Term] = {}
    witnesses: list[tuple[Variable, ...]] = []
    for label, hypothesis in hypotheses.items():
        items = hypothesis.items if isinstance(hypothesis, And) else (hypothesis,)
        parts: list[Term] = []
        for number, item in enumerate(items):
            if isinstance(item, Quantified) and item.quantifier is Quantifier.EXISTS:
                names = tuple(Variable(Role.BOUND, f"{v.name} of {label}#{number}", v.sort) for v in item.variables)
                parts.append(substitute(item.body, dict(zip(item.variables, names, strict=True))))
                witnesses.append(names)
            else:
                parts.append(item)
        opened[label] = And(tuple(parts)) if isinstance(hypothesis, And) else parts[0]
    return opened, witnesses


def _witnessed(goal: Term, witnesses: list[tuple[Variable, ...]]) -> Iterator[Term]:
    if not (isinstance(goal, Quantified) and goal.quantifier is Quantifier.EXISTS):
        return
    sorts = [v.sort for v in goal.variables]
    fitting = [names for names in witnesses if [name.sort for name in names] == sorts]
    for names in fitting[:WITNESSES_TRIED]:
        yield substitute(goal.body, dict(zip(goal.variables, names, strict=True)))
