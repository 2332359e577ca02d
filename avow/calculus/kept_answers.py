"""What was proved before, by what was asked: after an edit only other questions are put to the solver.

An answer depends on the question alone: the hypotheses with their labels, the goal, effort and seed; or a script of the
kernel. Kept are proofs, what the kernel was told, and that some hypotheses are too few. Of a side condition that does
not stand it is kept that it does not, under its obligation's digest: it is asked again only where it is asked for. All
of it is a hint as any proof of the engines: whether a claim is proved decides the kernel, which asks everything itself
in every run (`avow.pipeline.recheck`).
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
from avow.base.tuning.sizes import ANSWERS_KEPT
from avow.base.verdict import Verdict
from avow.formulas.formula import digest
from avow.kernel.solvers import Said, ask_z3
from avow.language.terms import Term
from avow.solving.questions import Entailment


@dataclass(frozen=True, slots=True)
class NotProved:
    """What others look at of a side condition that does not stand, or of a question."""

    verdict: Verdict
    used: tuple[str, ...] = ()
    used_before: tuple[str, ...] = ()


_Kept = tuple[tuple[str, ...], bool] | Said | NotProved


@dataclass(slots=True)
class KeptAnswers:
    """`before`: what earlier runs left; `now`: what was used or found in this one. What a proof needs and whether its
    premises contradict, what a solver said of a script, or that something was not proved."""

    before: dict[str, _Kept] = field(default_factory=dict)
    now: dict[str, _Kept] = field(default_factory=dict)
    asked: int = 0
    """Questions that were put to the solver."""

    @classmethod
    def read(cls, text: str) -> KeptAnswers:
        """What cannot be read is nothing."""
        try:
            return cls(from_text(dict[str, _Kept], text))
        except Unreadable:
            return cls()

    def written(self) -> str:
        """For the next run: those of this one, and as many of the earlier ones as there is room for."""
        return json.dumps(to_json(dict(list({**self.before, **self.now}.items())[-ANSWERS_KEPT:])))

    def find(self, mark: str) -> _Kept | None:
        found = self.now.get(mark) or self.before.pop(mark, None)
        if found is not None:
            self.now[mark] = found
        return found


_kept: ContextVar[KeptAnswers | None] = ContextVar("kept answers", default=None)


@contextmanager
def keeping(answers: KeptAnswers) -> Iterator[None]:
    """What is asked within the block is looked up there first."""
    token = _kept.set(answers)
    try:
        yield
    finally:
        _kept.reset(token)


def entailed_before(
    hypotheses: Mapping[str, Term], goal: Term, effort: int, seed: int, whether: bool
) -> tuple[str, Entailment | None]:
    """The question's mark, none outside such a block; and the answer, if it was proved before, or refuted where only
    `whether` it is proved matters."""
    kept = _kept.get()
    if kept is None:
        return "", None
    asked = [[label, digest(term)] for label, term in hypotheses.items()]
    mark = sha256(json.dumps([asked, digest(goal), effort, seed]))
    found = kept.find(mark)
    if whether and isinstance(found, NotProved):
        return mark, Entailment(found.verdict)
    if not isinstance(found, tuple):
        kept.asked += 1
        return mark, None
    needed, vacuous = found
    return mark, Entailment(Verdict.PROVED, needed=needed, vacuous=vacuous)


def keep_entailed(mark: str, answer: Entailment) -> None:
    kept = _kept.get()
    if kept is not None and answer.verdict is Verdict.PROVED:
        kept.now[mark] = answer.needed, answer.vacuous
    elif kept is not None and answer.verdict is Verdict.REFUTED:
        kept.now[mark] = NotProved(answer.verdict)


def not_proved_before(mark: str) -> NotProved | None:
    """That a side condition was not proved, by a digest of all that the answer depends on."""
    kept = _kept.get()
    found = kept.find(mark) if kept is not None and mark else None
    return found if isinstance(found, NotProved) else None


def keep_not_proved(mark: str, verdict: Verdict, used: tuple[str, ...], used_before: tuple[str, ...]) -> None:
    kept = _kept.get()
    if kept is not None and mark:
        kept.now[mark] = NotProved(verdict, used, used_before)


def ask_once(script: str, budget: int) -> Said:
    """As `avow.kernel.solvers.ask_z3`, while it is only to be found out what the kernel will say."""
    kept = _kept.get()
    if kept is None:
        return ask_z3(script, budget)
    mark = sha256(f"{budget}\n{script}")
    found = kept.find(mark)
    if not isinstance(found, Said):
        kept.asked += 1
        found = ask_z3(script, budget)
        if found in (Said.SAT, Said.UNSAT):
            kept.now[mark] = found
    return found
