"""Certificates as data. An entry's index is its rank; its hypotheses are computed (`avow.kernel.check`).

Claims are named by digest, and looked up in the current system and among the lemmas: any formulas, to be shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum

from avow.base import codec
from avow.base.records import dataclass

Format = StrEnum("Format", {"NOW": "avow/certificate/2"})


class How(StrEnum):
    """How an entry is established: by its questions; by a node's own evidence, while all its assumptions (`conds`) have
    held; by a person, for values that no node provides; not at all (open: assumed by the derived contract, never under
    a requirement); by an example (possible: never a premise); by definition (a memory: such a value exists for any
    ports). Together is not an entry, but a hypothesis that the kernel adds (`avow.kernel.check.Needed`)."""

    SHOWN = "shown"
    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    OPEN = "open"
    POSSIBLE = "possible"
    DEFINED = "defined"
    TOGETHER = "together"


@dataclass(frozen=True, slots=True)
class Use:
    """An entry used as a premise: at the step in question, or `back` steps earlier."""

    entry: int
    back: int = field(default=0, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Question:
    """Premises from which an entry's claim has to follow: entries, and (in a base question) initial conditions.
    `witness`: the premise, and the part of its conjunction, whose existential gives witnesses for the claim's."""

    uses: tuple[Use, ...] = ()
    initials: tuple[str, ...] = field(default=(), metadata=codec.LATER)
    witness: tuple[int, int] | None = field(default=None, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Entry:
    """A claim by its digest, and how it is established: `base`: a question for each first step; `step`: for later."""

    how: How
    node: str
    digest: str
    conds: tuple[int, ...] = field(default=(), metadata=codec.LATER)
    base: tuple[Question, ...] = field(default=(), metadata=codec.LATER)
    step: Question | None = field(default=None, metadata=codec.LATER)

    @property
    def questions(self) -> tuple[Question, ...]:
        return (*self.base, *((self.step,) if self.step is not None else ()))

    def named(self) -> Iterator[int]:
        """`Named`: the entries named in its conditions and in all of its questions."""
        yield from self.conds
        yield from (use.entry for question in self.questions for use in question.uses)


@dataclass(frozen=True, slots=True)
class Certificate:
    """`scope`: the derivation that it was made for, for people. `lemmas`: as `avow.calculus.induction` writes them."""

    format: Format = field(default=Format.NOW, kw_only=True)
    scope: str
    entries: tuple[Entry, ...]
    lemmas: tuple[tuple[str, ...], ...] = field(default=(), metadata=codec.LATER)
