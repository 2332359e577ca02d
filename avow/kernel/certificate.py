"""Certificates as data, and as canonical JSON (``avow/certificate/1``).

A certificate is a list of entries; an entry's place in it is its rank. It holds no formula and no hypothesis: claims
are named by digest and looked up in the system as it is now, hypotheses are computed (`avow.kernel.check`).
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

FORMAT = "avow/certificate/1"


class Malformed(Exception):  # noqa: N818 - it says what the text is
    """Text that is no certificate."""


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


@dataclass(frozen=True, slots=True)
class Use:
    """An entry used as a premise: of the step in question, or `back` steps earlier."""

    entry: int
    back: int = 0


@dataclass(frozen=True, slots=True)
class Question:
    """Premises from which an entry's claim has to follow: entries, and (in a base question) initial conditions.

    `witness`: the premise (of the uses, then of the initials) and the part of its conjunction that says that something
    exists; that thing is to serve for what the claim says exists.
    """

    uses: tuple[Use, ...] = ()
    initials: tuple[str, ...] = ()
    witness: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class Entry:
    """One claim, by its digest, and how it is known. `base` has a question for each of the first steps, `step` is about
    every later one."""

    how: How
    node: str
    digest: str
    conds: tuple[int, ...] = ()
    base: tuple[Question, ...] = ()
    step: Question | None = None


@dataclass(frozen=True, slots=True)
class Certificate:
    """`scope`: the derivation that it was made for; a name for people."""

    scope: str
    entries: tuple[Entry, ...]


def to_json(certificate: Certificate) -> dict[str, Any]:
    return {
        "format": FORMAT,
        "scope": certificate.scope,
        "entries": [_entry(entry) for entry in certificate.entries],
    }


def canonical(certificate: Certificate) -> str:
    """The one text of a certificate."""
    return json.dumps(to_json(certificate), sort_keys=True, separators=(",", ":"), ensure_ascii=True)


def from_json(data: object) -> Certificate:
    """Strict. Raises Malformed."""
    match data:
        case {"format": "avow/certificate/1", "scope": str(scope), "entries": list(entries), **rest} if not rest:
            return Certificate(scope, tuple(map(_read_entry, entries)))
    raise Malformed(f"no certificate of format {FORMAT}")


def _entry(entry: Entry) -> dict[str, Any]:
    found: dict[str, Any] = {"how": str(entry.how), "node": entry.node, "digest": entry.digest}
    if entry.how is How.SHOWN:
        found["base"] = [_question(question) for question in entry.base]
        found["step"] = _question(entry.step) if entry.step is not None else None
    if entry.how is How.GUARANTEE:
        found["conds"] = list(entry.conds)
    return found


def _question(question: Question) -> dict[str, Any]:
    found: dict[str, Any] = {"uses": [[use.entry, use.back] for use in question.uses]}
    if question.initials:
        found["initials"] = list(question.initials)
    if question.witness is not None:
        found["witness"] = list(question.witness)
    return found


def _read_entry(data: object) -> Entry:
    match data:
        case {"how": "shown", "node": str(n), "digest": str(d), "base": list(base), "step": step, **rest} if not rest:
            return Entry(How.SHOWN, n, d, (), tuple(map(_read_question, base)), _read_question(step))
        case {"how": "guarantee", "node": str(n), "digest": str(d), "conds": list(conds), **rest} if not rest:
            return Entry(How.GUARANTEE, n, d, tuple(map(_index, conds)))
        case {"how": "environment" | "open" as how, "node": str(n), "digest": str(d), **rest} if not rest:
            return Entry(How(how), n, d)
    raise Malformed("no entry of a certificate")


def _read_question(data: object) -> Question:
    if not isinstance(data, dict) or not {"uses"} <= data.keys() <= {"uses", "initials", "witness"}:
        raise Malformed("no question of a certificate")
    uses, initials, witness = data["uses"], data.get("initials", []), data.get("witness")
    if not (isinstance(uses, list) and isinstance(initials, list) and all(isinstance(i, str) for i in initials)):
        raise Malformed("no question of a certificate")
    read = []
    for use in uses:
        match use:
            case [entry, back]:
                read.append(Use(_index(entry), _index(back)))
            case _:
                raise Malformed("a use is an entry and a number of steps")
    match witness:
        case None:
            return Question(tuple(read), tuple(initials))
        case [use, at]:
            return Question(tuple(read), tuple(initials), (_index(use), _index(at)))
    raise Malformed("a witness is a use and a part")


def _index(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise Malformed("an index is a number from 0 on")
    return value
