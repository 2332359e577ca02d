"""The five answers that a report gives first, as data: words and counts that no format computes again.

What is claimed, on what is it based, what is the weakest evidence, what is supposed without being shown, and what
changed since the last signed report. Evidence and assumptions are two orders, never one: a person's reason is not weak
evidence, it is none.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field
from enum import StrEnum

from avow.base.codec import LATER
from avow.base.records import dataclass
from avow.system.statements import GENERAL


class Tone(StrEnum):
    """A colour; it never stands without a mark and a word."""

    GREEN = "green"
    """Derived without bounds, on proofs and exhaustive checks only, every assumption owned and in date."""
    AMBER = "amber"
    """It holds, but less is known than that."""
    RED = "red"
    """Open, refuted, or a gate fails."""
    GREY = "grey"
    """Not relied upon: as bad as was expected."""

    @property
    def rank(self) -> int:
        """Greater is better; grey is no place in this order."""
        return {Tone.GREEN: 2, Tone.AMBER: 1, Tone.RED: 0, Tone.GREY: 0}[self]

    @property
    def mark(self) -> str:
        """Stands beside the word."""
        return {Tone.GREEN: "✔", Tone.AMBER: "◐", Tone.RED: "✘", Tone.GREY: "▽"}[self]


class Level(StrEnum):
    """How far a requirement, or the whole case, is shown: the least of what lies below it. Best first."""

    SHOWN = "shown"
    """Every guarantee below is proved, or checked exhaustively, of what runs."""
    MODELS = "shown of models"
    """Some guarantee below is proved or checked of a model only: what runs may differ."""
    TESTS = "shown by tests"
    """Some guarantee below, or the requirement itself, is sampled: tests, recordings, measurements."""
    ARGUED = "argued"
    """A person says that the guarantees named amount to the sentence, or that some guarantee below holds."""
    NOT_SHOWN = "not shown"
    """Missing, stale, refuted below, not validated, or resting on an assumption that has expired."""
    REFUTED = "refuted"
    """There is a counterexample."""
    EXAMINED = "examined, not relied upon"
    """Of a case only: known-bad material that is as bad as its plan expects, or a plan that names no requirement."""

    @property
    def holds(self) -> bool:
        return self in (Level.SHOWN, Level.MODELS, Level.TESTS, Level.ARGUED)


MEANINGS = {
    Level.SHOWN: "everything below is proved, or checked exhaustively, of what runs",
    Level.MODELS: "something below is proved or checked of a model only: what runs may differ",
    Level.TESTS: "something below is sampled: tests, recordings or measurements",
    Level.ARGUED: "something below rests on a person's word",
    Level.NOT_SHOWN: "missing, stale, not validated, or resting on what is not shown",
    Level.REFUTED: "there is a counterexample",
    Level.EXAMINED: "known-bad material, or a plan that names no requirement",
}
"""The words of verdicts, in a phrase each; docs/reading-a-report.md has the same table."""


class Sort(StrEnum):
    """What an assumption is about."""

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
    Sort.MEANING: "about requirements' meaning",
    Sort.TOOLS: "about trusted tools",
}
"""What an assumption of each sort is about, after its number: ``2 about the world``."""


PLATFORM, MODELS, SAMPLES, RECORDINGS, START, TOOLS = GENERAL


@dataclass(frozen=True, slots=True)
class Assumption:
    """Something that requirements, or other guarantees, rest on without its being shown, each once."""

    number: str
    """``A1``: on this report's pages only; `key` is what stays."""
    key: str
    sort: Sort
    says: str
    """Plain words from the plan; empty where nobody has found any yet."""
    text: str
    """All of it, as the plan or the method has it."""
    because: str
    who: str
    until: str
    expired: bool
    needed_by: tuple[str, ...]
    """Requirements; empty where only guarantees need it that no requirement rests on."""
    where: tuple[str, ...]
    """Places of the plan, or claims whose evidence says it."""
    date: str = field(default="", metadata=LATER)
    """The day on which it was supposed (the latest, where it was said more than once); empty: no day is named."""

    @property
    def owned(self) -> bool:
        """Whether somebody keeps it true, and until when."""
        return bool(self.who and (self.until or self.sort is Sort.MEANING))  # a validation ends when a text changes

    @property
    def general(self) -> bool:
        """Whether it arises with any evidence of its kind."""
        return self.key in GENERAL

    @property
    def term(self) -> str:
        """``A. Person, 2026-11-21, until 2030-12-31``: who keeps it true, since when, until when."""
        ended = "expired" if self.expired else "until"
        parts = (self.who or "no owner", self.date, f"{ended} {self.until}" if self.until else "no last day")
        return ", ".join(part for part in parts if part)

    @property
    def words(self) -> str:
        """Plain words, or where to write them."""
        if self.says:
            return self.says
        section, _, rest = self.key.partition(".")
        method, of_text, _ = rest.partition(":")
        if section == "assumptions":
            where = f"assumptions.{method}.WORD, with a word of its text" if of_text else self.key
        elif section == "assumption":
            where = "environment, in an entry that assumes it"
        else:
            where = self.key
        return f"(no plain words yet: write says: … under {where}, in plan.yaml)"

    @property
    def needing(self) -> tuple[str, ...]:
        """Whose assumption it is, for the column *needed by*."""
        return self.needed_by or ("guarantees only",)


EARLIER = "As of an earlier state"
"""Before the title of a case whose system cannot be read as it stands now, or is gone."""


@dataclass(frozen=True, slots=True)
class Deficit:
    """One kind of reason for which the case says less than it seems to. `why` says what a reader should make of it."""

    key: str
    count: int
    claims: tuple[str, ...]
    words: str
    why: str


@dataclass(frozen=True, slots=True)
class WeakestEvidence:
    """The least evidence under a requirement, or under the whole case: evidence only, no reasons."""

    claim: str
    node: str
    title: str
    """What people call the node."""
    status: str
    """``tested``, ``observed``…: the words of a page, not of the ledger."""
    quote: str
    """The guarantee in English."""
    words: str
    """What was seen, with its bound, as a sentence without its full stop."""
    needed_by: tuple[str, ...] = ()
    beside: int = field(default=0, metadata=LATER)
    """So many requirements have their weakest evidence in another guarantee of the same node."""

    @property
    def others(self) -> str:
        """After the requirements that need it: why more of them name the same node."""
        return f"; {self.beside} on other guarantees of this node" if self.beside else ""


@dataclass(frozen=True, slots=True)
class NodeBasis:
    """On what a node's guarantees stand: a letter and a colour each, and the same counted in words."""

    node: str
    title: str
    squares: tuple[tuple[str, Tone], ...]
    words: str


@dataclass(frozen=True, slots=True)
class SupposedLine:
    """One line for all assumptions of a sort: how many, and the most needed."""

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
        """``also A2 to A6``: where the others of the sort are; empty where there is no other."""
        return f"also {', '.join(_ranges(self.others))}" if self.others else ""


def _ranges(numbers: Sequence[str]) -> Iterator[str]:
    """``A1``, ``A3 to A6``: three or more that follow one another as their ends."""
    at = 0
    while at < len(numbers):
        end = at
        while end + 1 < len(numbers) and int(numbers[end + 1][1:]) == int(numbers[end][1:]) + 1:
            end += 1
        yield from (f"{numbers[at]} to {numbers[end]}",) if end > at + 1 else numbers[at : end + 1]
        at = end + 1


@dataclass(frozen=True, slots=True)
class Baseline:
    """What was signed, as far as a later case is compared with it."""

    name: str
    """The file, relative to the workspace."""
    who: str
    signed_on: str
    until: str
    content: str
    """Digest of the signed case's content."""
    verdict: str
    requirements: tuple[tuple[str, str, str, str], ...]
    """(id, digest of its words and formula, how, formula)."""
    guarantees: tuple[tuple[str, str, str, str, str], ...]
    """(id, digest of its meaning, status, formula, mark of the records that count)."""
    assumptions: tuple[tuple[str, str, str], ...]
    """(key, words, until)."""
    deficits: tuple[tuple[str, int], ...]
    checked: str = ""
    """How its signature was verified, in words."""


@dataclass(frozen=True, slots=True)
class ChangeLine:
    """One change since the signed report, worst kinds first."""

    kind: str
    """``open``, ``weaker``, ``gone``, ``meaning``, ``assumption``, ``expired``, ``deficit``, ``better``."""
    subject: str
    words: str
    before: str = ""
    after: str = ""
    edits: tuple[str, ...] = field(default=(), metadata=LATER)
    """Of a requirement: what changed beneath it."""

    @property
    def worse(self) -> bool:
        return self.kind != "better"


@dataclass(frozen=True, slots=True)
class Changes:
    """What changed since the last signed report. `against` names it; empty: none has been signed."""

    against: str
    entries: tuple[ChangeLine, ...] = ()
    again: int = 0
    """So many guarantees were re-run with the same answer."""


@dataclass(frozen=True, slots=True)
class TrustLine:
    """A part of what has to be trusted: what it is, which one, and what was done about it."""

    what: str
    which: str
    mitigation: str
    partly: bool = field(default=False, metadata=LATER)
    """Whether that was not done, or not for all of it."""


@dataclass(frozen=True, slots=True)
class Failure:
    """A gate that fails, for the banner: its title, why, and the next step; empty where there is none to suggest."""

    title: str
    reason: str
    remedy: str


@dataclass(frozen=True, slots=True)
class Answers:
    """The first screen in words."""

    headline: Level
    verdict: str
    """The headline with what bounds it: ``Shown by tests (failure rate: at most 6.2 % …)``."""
    tone: Tone
    by_level: tuple[tuple[Level, int], ...]
    counts: str
    weakened: str
    gates: str
    listed: tuple[str, ...]
    """The requirements that have a row of their own: all of them, or the worst."""
    based_on: tuple[NodeBasis, ...]
    bases: tuple[NodeBasis, ...]
    """Of every node, by name."""
    more_nodes: str
    weakest: WeakestEvidence | None
    next_weakest: str
    refuted: str
    """What is refuted, in place of the weakest evidence; empty where nothing is."""
    supposed: tuple[SupposedLine, ...]
    owned: str
    changed_against: str
    changed: tuple[tuple[str, str], ...]
    """(mark, sentence), five at most."""
    signed: str
    """``not signed``, or by whom and whether the case is still that one."""
    statement: str
    """What a signature says."""
    warned: str = field(default="", metadata=LATER)
    """``WARNED: 13 findings known``, beside the verdict; empty where nothing is known to be bad."""
    owners: str = field(default="", metadata=LATER)
    """Who answers for the assumptions, and until when; empty where nobody does."""
    weakened_by: str = field(default="", metadata=LATER)
    """Which the ways are in which the case is weakened; empty where there is none."""

    trusted: tuple[TrustLine, ...] = field(default=(), metadata=LATER)
    """What has to be trusted."""
    failures: tuple[Failure, ...] = field(default=(), metadata=LATER)
    """The gates that fail, in the order of the gates."""
    objects: str = field(default="", metadata=LATER)
    """What the words mean that say what was looked at: *model*, *source*…"""

    @property
    def legend(self) -> str:
        """What the words in the column *how it stands* mean, of those that are used."""
        return "; ".join(f"{level}: {MEANINGS[level]}" for level, _ in self.by_level)

    @property
    def beside(self) -> str:
        """What stands beside the verdict in every format."""
        return " · ".join(part for part in (self.warned, self.counts, self.weakened, self.gates) if part)

    @property
    def told(self) -> str:
        """The verdict where nothing stands beside it."""
        return f"{self.verdict} ({self.warned})" if self.warned else self.verdict
