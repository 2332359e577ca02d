"""Entailment between clauses of contracts: cached, and with help if the solver gives up on quantifiers.

"There is a place around which all reports lie" follows from "there is exactly one place that is reported": the witness
of the one also serves for the other. Solvers with linear arithmetic do not find this by themselves, so they get it as a
query: an existential hypothesis holds for some values (its witnesses), and an existential goal is proved once it is
proved for these. This claim is stronger: if it fails, the original query is made.

Within `keeping`, answers of earlier runs are reused, so that after an edit only changed queries go to the solver. An
answer depends on the query alone: the hypotheses with their labels, the goal, effort and seed; or a script of the
kernel. The cache keeps proofs, the kernel's answers, and refutations. A side condition that does not hold is kept under
its obligation's digest, and re-run only if it is requested. All of this only guides the search: the kernel decides
whether a claim is proved, and makes all its queries itself in every run (`avow.pipeline.recheck`).
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import field

from avow.base.codec import Unreadable, from_text, to_json
from avow.base.files import sha256
from avow.base.records import dataclass
from avow.base.tuning.bounds import WITNESSES_TRIED
from avow.base.tuning.effort import QUICK_EFFORT
from avow.base.tuning.sizes import ANSWERS_KEPT
from avow.base.verdict import Verdict
from avow.formulas.formula import digest, substitute
from avow.kernel.solvers import Reply, ask_z3
from avow.language.terms import And, Quantified, Quantifier, Role, Term, Variable
from avow.solving.questions import Entailment, entails
from avow.solving.translation import new_session


@dataclass(frozen=True, slots=True)
class NotProved:
    """The cached result of a side condition that does not hold, or of a query."""

    verdict: Verdict
    used: tuple[str, ...] = ()
    used_before: tuple[str, ...] = ()


_Kept = tuple[tuple[str, ...], bool] | Reply | NotProved


@dataclass(slots=True)
class KeptAnswers:
    """`before`: answers of earlier runs; `now`: those used or found in this one. An answer is what a proof needs and
    whether its premises are contradictory, a solver's result for a script, or that something was not proved."""

    before: dict[str, _Kept] = field(default_factory=dict)
    now: dict[str, _Kept] = field(default_factory=dict)
    asked: int = 0
    """The number of queries to the solver."""

    @classmethod
    def read(cls, text: str) -> KeptAnswers:
        """Unreadable text gives an empty cache."""
        try:
            return cls(from_text(dict[str, _Kept], text))
        except Unreadable:
            return cls()

    def written(self) -> str:
        """The text for the next run: the answers of this one, and as many of the earlier ones as fit."""
        return json.dumps(to_json(dict(list({**self.before, **self.now}.items())[-ANSWERS_KEPT:])))

    def find(self, mark: str) -> _Kept | None:
        found = self.now.get(mark) or self.before.pop(mark, None)
        if found is not None:
            self.now[mark] = found
        return found


_kept: ContextVar[KeptAnswers | None] = ContextVar("kept answers", default=None)


@contextmanager
def keeping(answers: KeptAnswers) -> Iterator[None]:
    """Queries within the block are looked up there first."""
    token = _kept.set(answers)
    try:
        yield
    finally:
        _kept.reset(token)


def kept_answers() -> KeptAnswers | None:
    """The answers that are kept; None outside `keeping`."""
    return _kept.get()


def ask_once(script: str, budget: int) -> Reply:
    """The same as `avow.kernel.solvers.ask_z3`, cached: only to predict the answer that the kernel will get."""
    kept = _kept.get()
    if kept is None:
        return ask_z3(script, budget)
    mark = sha256(f"{budget}\n{script}")
    found = kept.find(mark)
    if not isinstance(found, Reply):
        kept.asked += 1
        found = ask_z3(script, budget)
        if found in (Reply.SAT, Reply.UNSAT):
            kept.now[mark] = found
    return found


def implied(
    hypotheses: Mapping[str, Term], goal: Term, *, effort: int, seed: int = 0, whether: bool = False
) -> Entailment:
    """The same as `avow.solving.questions.entails`: first a quick query, then with witnesses, then at full effort. A
    cached refutation has no counterexample, and is used only if it matters only `whether` the goal is proved."""
    kept = _kept.get()
    if kept is None:
        return _implied(hypotheses, goal, effort, seed, whether)
    asked = [[label, digest(term)] for label, term in hypotheses.items()]
    mark = sha256(json.dumps([asked, digest(goal), effort, seed]))
    match kept.find(mark):
        case (needed, vacuous):
            return Entailment(Verdict.PROVED, needed=needed, vacuous=vacuous)
        case NotProved(verdict=verdict) if whether:
            return Entailment(verdict)
    kept.asked += 1
    answer = _implied(hypotheses, goal, effort, seed, whether)
    if answer.verdict is Verdict.PROVED:
        kept.now[mark] = answer.needed, answer.vacuous
    elif answer.verdict is Verdict.REFUTED:
        kept.now[mark] = NotProved(answer.verdict)
    return answer


@new_session()
def _implied(hypotheses: Mapping[str, Term], goal: Term, effort: int, seed: int, whether: bool) -> Entailment:
    quick = min(QUICK_EFFORT, effort)
    answer = entails(hypotheses, goal, effort=quick, seed=seed, whether=whether)
    if answer.verdict is not Verdict.UNKNOWN:
        return answer
    opened, witnesses = _opened(hypotheses)
    for stronger in _witnessed(goal, witnesses):
        found = entails(opened, stronger, effort=quick, seed=seed, whether=True)
        if found.verdict is Verdict.PROVED:
            return found
    return entails(hypotheses, goal, effort=effort, seed=seed, whether=whether) if effort > quick else answer


def _opened(hypotheses: Mapping[str, Term]) -> tuple[dict[str, Term], list[tuple[Variable, ...]]]:
    """The hypotheses with names for the witnesses of their outermost existential quantifiers, and these names."""
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
