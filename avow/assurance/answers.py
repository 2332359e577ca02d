"""The five answers that a report gives first, as data: words and counts that no format computes again.

What is claimed, on what is it based, what is the weakest evidence, what is assumed without being shown, and what
changed since the last signed report. Evidence and assumptions are ordered separately: a person's reason is not weak
evidence; it is no evidence.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import field
from enum import StrEnum

from avow.assurance.naming import short
from avow.base.codec import LATER
from avow.base.records import dataclass
from avow.system.statements import GENERAL


class Tone(StrEnum):
    """A colour; it is always shown with a mark and a word."""

    GREEN = "green"
    """Derived without bounds, on proofs and exhaustive checks only, every assumption owned and in date."""
    AMBER = "amber"
    """It holds, but on less than green needs."""
    RED = "red"
    """Open, refuted, or a gate fails."""
    GREY = "grey"
    """Not relied upon: as bad as expected."""

    @property
    def rank(self) -> int:
        """Greater is better; grey has no place in this order."""
        return {Tone.GREEN: 2, Tone.AMBER: 1, Tone.RED: 0, Tone.GREY: 0}[self]

    @property
    def mark(self) -> str:
        """The mark shown beside the word."""
        return {Tone.GREEN: "✔", Tone.AMBER: "◐", Tone.RED: "✘", Tone.GREY: "▽"}[self]


class Level(StrEnum):
    """How far a requirement, or the whole case, is shown: the lowest level of the claims below it. Best first."""

    SHOWN = "shown"
    """Every guarantee below is proved, or checked exhaustively, of the program that runs."""
    MODELS = "shown of models"
    """Some guarantee below is proved or checked of a model only, or the wiring alone implies the requirement: the
    program that runs may differ."""
    TESTS = "shown by tests"
    """Some guarantee below, or the requirement itself, is sampled: tests, recordings, measurements."""
    TESTED_MODELS = "shown by tests and of models"
    """Some claim below is sampled, and some guarantee below is shown of a model only: other inputs may differ, and so
    may the program that runs."""
    ARGUED = "argued"
    """A person states that the guarantees named amount to the sentence, or that some guarantee below holds."""
    NOT_SHOWN = "not shown"
    """Missing, stale, refuted below, not validated, or resting on an assumption that has expired."""
    REFUTED = "refuted"
    """There is a counterexample."""
    EXAMINED = "examined, not relied upon"
    """For a case only: known-bad material that is as bad as its plan expects, or a plan that names no requirement."""

    @property
    def holds(self) -> bool:
        return self in (Level.SHOWN, Level.MODELS, Level.TESTS, Level.TESTED_MODELS, Level.ARGUED)

    @staticmethod
    def lowest(levels: Iterable[Level]) -> Level | None:
        """The worst of some levels. Samples and models are two weaknesses: with one of each, there are both."""
        found = set(levels)
        if {Level.MODELS, Level.TESTS} <= found:
            found.add(Level.TESTED_MODELS)
        return max(found, key=tuple(Level).index, default=None)


MEANINGS = {
    Level.SHOWN: "all evidence is proof, or exhaustive, of the program as written or built",
    Level.MODELS: "some evidence is only of a model or the wiring",
    Level.TESTS: "some evidence is sampled: tests, recordings or measurements",
    Level.TESTED_MODELS: "some evidence is sampled, some only of a model",
    Level.ARGUED: "a person vouches for the sentence or for a guarantee below",
    Level.NOT_SHOWN: "evidence is missing or stale, it is not validated, or a claim below is not shown or refuted",
    Level.REFUTED: "there is a counterexample",
    Level.EXAMINED: "a plan that lists its expected findings, or names no requirement",
}
"""The meaning of each verdict's word, in a phrase; docs/reading-a-report.md has the same table."""


class Sort(StrEnum):
    """The topic of an assumption."""

    WORLD = "the world"
    PLATFORM = "the platform"
    MODELS = "models"
    SAMPLING = "sampling"
    MEANING = "meaning"
    TOOLS = "tools"


ABOUT = {
    Sort.WORLD: "about the world",
    Sort.PLATFORM: "about the platform",
    Sort.MODELS: "about models",
    Sort.SAMPLING: "about samples",
    Sort.MEANING: "about meaning",
    Sort.TOOLS: "about trusted tools",
}
"""The topic of each sort of assumption, after a count: ``2 about the world``."""


_WORD = re.compile(r"\w+")
PLATFORM, MODELS, SAMPLES, RECORDINGS, START, REACTION, TOOLS = GENERAL


@dataclass(frozen=True, slots=True)
class Assumption:
    """Something that requirements, or other guarantees, rest on without its being shown, each once."""

    number: str
    """``A1``: valid on this report's pages only; `key` is stable."""
    key: str
    sort: Sort
    says: str
    """Plain words from the plan; empty if none have been written yet."""
    text: str
    """The full text, as in the plan or the method's record."""
    because: str
    who: str
    until: str
    expired: bool
    needed_by: tuple[str, ...]
    """Requirements; empty if only guarantees need it on which no requirement rests."""
    where: tuple[str, ...]
    """Places in the plan, or claims whose evidence states it."""
    date: str = field(default="", metadata=LATER)
    """The day on which the assumption was made (the latest, if it was made more than once); empty if no day is
    named."""

    @property
    def owned(self) -> bool:
        """Whether a person is responsible for it, until a named day."""
        return bool(self.who and (self.until or self.sort is Sort.MEANING))  # a validation ends when a text changes

    @property
    def reasoned(self) -> bool:
        """Whether a reason says more than the assumption itself."""
        reason = f"{self.because} {self.text}".casefold()
        return not set(_WORD.findall(reason)) <= set(_WORD.findall(self.says.casefold()))

    @property
    def general(self) -> bool:
        """Whether it arises with any evidence of its kind."""
        return self.key in GENERAL

    @property
    def term(self) -> str:
        """``A. Person, 2026-11-21, until 2030-12-31``: who is responsible for it, since when, until when."""
        ended = "expired" if self.expired else "until"
        last = "until a text changes" if self.sort is Sort.MEANING and self.who else "no last day"
        parts = (self.who or "no owner", self.date, f"{ended} {self.until}" if self.until else last)
        return ", ".join(part for part in parts if part)

    @property
    def words(self) -> str:
        """The plain words, or a note where to write them."""
        if self.says:
            return self.says
        section, _, rest = self.key.partition(".")
        method, of_text, _ = rest.partition(":")
        if section == "assumptions":
            where = f"assumptions.{method}.WORD, with a word of its text" if of_text else self.key
        elif section == "assumption":
            where = "environment, in an entry that assumes it"
        elif "/assumption/" in self.key:
            return f"(no plain words yet: {self.text})"
        else:
            where = self.key
        return f"(no plain words yet: write says: … under {where}, in plan.yaml)"

    @property
    def needing(self) -> tuple[str, ...]:
        """The requirements that need it, for the column *needed by*."""
        return self.needed_by or ("guarantees only",)


EARLIER = "As of an earlier state"
"""The prefix of the title of a case whose system cannot be read now, or is gone."""


@dataclass(frozen=True, slots=True)
class Deficit:
    """One kind of reason for which the case says less than it seems to. `why` explains its meaning for the reader."""

    key: str
    count: int
    claims: tuple[str, ...]
    words: str
    why: str


@dataclass(frozen=True, slots=True)
class WeakestEvidence:
    """The weakest evidence under a requirement, or under the whole case: evidence only, no reasons."""

    claim: str
    node: str
    title: str
    """The node's name for readers."""
    status: str
    """``tested``, ``observed``…: the terms of a page, not of the ledger."""
    quote: str
    """The guarantee in English."""
    words: str
    """What was observed, with its bound, as a sentence without its full stop."""
    bound: str = field(default="", metadata=LATER)
    """For a sample, ``bound 13 %``: its bound on failures, at the confidence that `words` has; or ``no bound``."""
    needed_by: tuple[str, ...] = ()

    @property
    def brief(self) -> str:
        """``navigation.stays, tested, bound 13 %``."""
        name = short(self.claim).removeprefix("system/requirement/")
        return ", ".join(part for part in (name, self.status, self.bound) if part)


@dataclass(frozen=True, slots=True)
class NodeBasis:
    """The evidence behind a node's guarantees: a letter and a colour each, and counts in words."""

    node: str
    title: str
    squares: tuple[tuple[str, Tone], ...]
    words: str


@dataclass(frozen=True, slots=True)
class SupposedLine:
    """One line for all assumptions of a sort: their number, and one of them in words."""

    sort: Sort
    count: int
    says: str
    number: str
    others: tuple[str, ...] = field(default=(), metadata=LATER)
    """The numbers of the others of this sort."""

    @property
    def about(self) -> str:
        """``2 about the world``."""
        return f"{self.count} {ABOUT[self.sort]}"

    @property
    def more(self) -> str:
        """``also A2 to A6``: the numbers of the others of the sort; empty if there are none."""
        return f"also {', '.join(_ranges(self.others))}" if self.others else ""


def _ranges(numbers: Sequence[str]) -> Iterator[str]:
    """``A1``, ``A3 to A6``: three or more consecutive numbers are written as a range."""
    at = 0
    while at < len(numbers):
        end = at
        while end + 1 < len(numbers) and int(numbers[end + 1][1:]) == int(numbers[end][1:]) + 1:
            end += 1
        yield from (f"{numbers[at]} to {numbers[end]}",) if end > at + 1 else numbers[at : end + 1]
        at = end + 1


@dataclass(frozen=True, slots=True)
class Baseline:
    """The part of a signed case that later cases are compared with."""

    name: str
    """The file, relative to the workspace."""
    who: str
    signed_on: str
    until: str
    content: str
    """Digest of the signed case's content."""
    verdict: str
    items: tuple[tuple[str, str, str, tuple[str, ...]], ...]
    """(kind of subject, subject, name, value) of everything that is compared (`avow.assurance.state`)."""
    sources: tuple[tuple[str, str], ...]
    """Contracts and plan as signed: (path, text)."""
    checked: str = ""
    """How its signature was verified, in words."""
    says: str = field(default="", metadata=LATER)
    """The sentence that was signed, of a signature that was read."""


@dataclass(frozen=True, slots=True)
class ChangeLine:
    """One change since the signed report, worst kinds first."""

    kind: str
    """One of `avow.assurance.changes.KINDS`."""
    subject: str
    words: str
    before: str = ""
    after: str = ""
    edits: tuple[str, ...] = field(default=(), metadata=LATER)
    """The edits and the changes below it that may be the reason."""
    about: str = field(default="", metadata=LATER)
    """The kind of subject."""


@dataclass(frozen=True, slots=True)
class Changes:
    """What changed since the last signed report. `against` names that report; empty: none has been signed."""

    against: str
    entries: tuple[ChangeLine, ...] = ()
    again: int = 0
    """The number of guarantees that were re-run with the same answer."""


@dataclass(frozen=True, slots=True)
class TrustLine:
    """A part that has to be trusted: what it is, which one, and the mitigation."""

    what: str
    which: str
    mitigation: str
    partly: bool = field(default=False, metadata=LATER)
    """Whether the mitigation is missing, or does not cover all of it."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A gate that fails, for the banner: its title, the reason, and the next step; empty if there is none to
    suggest."""

    title: str
    reason: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Answers:
    """The first screen in words."""

    headline: Level
    verdict: str
    """The headline with its bound: ``Shown by tests (failure rate: at most 6.2 % …)``."""
    tone: Tone
    by_level: tuple[tuple[Level, int], ...]
    counts: str
    weakened: str
    gates: str
    listed: tuple[str, ...]
    """The requirements that have a row of their own: all of them, or the worst."""
    based_on: tuple[NodeBasis, ...]
    bases: tuple[NodeBasis, ...]
    """The basis of every node, by name."""
    more_nodes: str
    weakest: WeakestEvidence | None
    next_weakest: str
    refuted: str
    """The refutation, in place of the weakest evidence; empty if nothing is refuted."""
    supposed: tuple[SupposedLine, ...]
    owned: str
    changed_against: str
    changed: tuple[tuple[str, str], ...]
    """(mark, sentence), five at most."""
    signed: str
    """``not signed``, or the signer and whether the case is still the signed one."""
    statement: str
    """The statement that a signer makes."""
    warned: str = field(default="", metadata=LATER)
    """``13 findings against it, which the plan lists: 11 refuted, 2 vacuous``, beside the verdict; empty if nothing is
    known to be bad."""
    unrated: str = field(default="", metadata=LATER)
    """Why no failure rate is known, beside a verdict that rests on samples."""
    owners: str = field(default="", metadata=LATER)
    """The owners of the assumptions, and the day on which the first one ends; empty if there are none."""
    weakened_by: str = field(default="", metadata=LATER)
    """The ways in which the case is weakened; empty if there are none."""
    unneeded: str = field(default="", metadata=LATER)
    """The number of guarantees that are not compared for the weakest evidence; empty if there are none."""
    trusted: tuple[TrustLine, ...] = field(default=(), metadata=LATER)
    """The parts that have to be trusted."""
    failures: tuple[Failure, ...] = field(default=(), metadata=LATER)
    """The gates that fail, in the order of the gates."""
    objects: str = field(default="", metadata=LATER)
    """The meaning of the words that name the examined object: *model*, *source*…"""

    @property
    def legend(self) -> str:
        """The meaning of the verdicts that hold, for those that are used."""
        return "; ".join(f"{level}: {MEANINGS[level]}" for level, _ in self.by_level if level.holds)

    @property
    def beside(self) -> str:
        """The text beside the verdict in every format."""
        return " · ".join(part for part in (self.warned, self.unrated, self.counts, self.weakened, self.gates) if part)

    @property
    def told(self) -> str:
        """The verdict with its warning, for use without the text beside it."""
        return f"{self.verdict} ({self.warned})" if self.warned else self.verdict
