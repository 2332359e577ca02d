"""Certificates as data, and as JSON.

A certificate is a list of entries; an entry's place in it is its rank. It holds no formula and no hypothesis: claims
are named by digest and looked up in the system as it is now, hypotheses are computed (`avow.kernel.check`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from avow.base import codec

FORMAT = "avow/certificate/2"


class How(StrEnum):
    """How an entry is known."""

    SHOWN = "shown"
    """By the questions `base` and `step`."""
    GUARANTEE = "guarantee"
    """A node's own evidence, as long as all of its assumptions (`conds`) have held."""
    ENVIRONMENT = "environment"
    """Of values that no node provides: a person's reason."""
    OPEN = "open"
    """Assumed by the contract that is derived here; never under a requirement."""
    POSSIBLE = "possible"
    """By an example: that some values are as it says. No other entry may use it."""


@dataclass(frozen=True, slots=True)
class Use:
    """An entry used as a premise: of the step in question, or `back` steps earlier."""

    entry: int
    back: int = field(default=0, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Question:
    """Premises from which an entry's claim has to follow: entries, and (in a base question) initial conditions.

    `witness`: the premise (of the uses, then of the initials) and the part of its conjunction that says that something
    exists; that thing is to serve for what the claim says exists.
    """

    uses: tuple[Use, ...] = ()
    initials: tuple[str, ...] = field(default=(), metadata=codec.LATER)
    witness: tuple[int, int] | None = field(default=None, metadata=codec.LATER)


@dataclass(frozen=True, slots=True)
class Entry:
    """One claim, by its digest, and how it is known. `base` has a question for each of the first steps, `step` is about
    every later one."""

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
    """`scope`: the derivation that it was made for; a name for people."""

    scope: str
    entries: tuple[Entry, ...]


def to_json(certificate: Certificate) -> dict[str, Any]:
    return {"format": FORMAT, **codec.to_json(certificate)}


def from_json(data: object) -> Certificate:
    """Strict. Raises codec.Unreadable."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise codec.Unreadable(f"no certificate of format {FORMAT}")
    return codec.from_json(Certificate, {key: value for key, value in data.items() if key != "format"})
