"""Certificates as data. An entry's place is its rank; its hypotheses are computed (`avow.kernel.check`).

Claims are named by digest, and looked up in the system as it is now and among the lemmas: any formulas, to be shown.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum

from avow.base import codec
from avow.base.records import dataclass

Format = StrEnum("Format", {"NOW": "avow/certificate/2"})


class How(StrEnum):
    """How an entry is known: by its questions; by a node's own evidence, while all its assumptions (`conds`) have held;
    by a person, of values that no node provides; not at all (open: assumed by the derived contract, never under a
    requirement); by an example (possible: never a premise); by definition (a memory: whatever the ports are, there is
    one such). Together is no entry, but a hypothesis that the kernel adds (`avow.kernel.check.Needed`)."""

    SHOWN = "shown"
    GUARANTEE = "guarantee"
    ENVIRONMENT = "environment"
    OPEN = "open"
    POSSIBLE = "possible"
    DEFINED = "defined"
    TOGETHER = "together"


@dataclass(frozen=True, slots=True)
class Use:
    """An entry used as a premise: of the step in question, or `back` steps earlier."""

    entry: int
    back: int = field(default=0, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Question:
    """Premises from which an entry's claim has to follow: entries, and (in a base question) initial conditions.
    `witness`: the premise of all these, and the part of its conjunction, that names what the claim says exists."""

    uses: tuple[Use, ...] = ()
    initials: tuple[str, ...] = field(default=(), metadata=codec.LATER)
    witness: tuple[int, int] | None = field(default=None, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Entry:
    """A claim by its digest, and how it is known: `base` asks of each of the first steps, `step` of every later one."""

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
        """`Named`: the entries that it names, in its conditions and in all of its questions."""
        yield from self.conds
        yield from (use.entry for question in self.questions for use in question.uses)


@dataclass(frozen=True, slots=True)
class Certificate:
    """`scope`: the derivation that it was made for, for people. `lemmas`: as `avow.calculus.induction` writes them."""

    format: Format = field(default=Format.NOW, kw_only=True)
    scope: str
    entries: tuple[Entry, ...]
    lemmas: tuple[tuple[str, ...], ...] = field(default=(), metadata=codec.LATER)
