"""A review as a person records it: who read what, the questions, the conclusion, and the contract.

The file is YAML, with one digest for each file read and each guarantee judged: a review is of *these* bytes and *this*
meaning, and becomes stale like a proof. `avow review stamp` fills in the digests.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.given import file_bytes, schema
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import digest_file, inside
from avow.base.persons import unreadable, wrong_day
from avow.base.records import dataclass
from avow.formulas.formula import node_digest
from avow.language.contract import Node
from avow.system.schema import violations
from avow.system.strict_yaml import Piece, read_yaml

FORMAT = 1
"""The version of the record. A later one is rejected, not guessed."""
CONCLUSIONS = ("accepted", "conditional", "rejected")
"""From best to worst."""


@dataclass(frozen=True, slots=True)
class Reading:
    """Something that was read: a file of the system's folder with its digest then, or material kept elsewhere."""

    file: str | None
    sha256: str | None
    material: str | None
    span: Span


@dataclass(frozen=True, slots=True)
class Judged:
    """A guarantee in the review, the digest of its meaning at that time, and its own conclusion, if any."""

    clause: str
    meaning: str | None
    conclusion: str | None
    remark: str
    span: Span


@dataclass(frozen=True, slots=True)
class Question:
    """One line of the checklist. `wanted` is the answer that speaks for the guarantee."""

    question: str
    answer: str
    wanted: str
    note: str

    @property
    def good(self) -> bool:
        return self.answer in (self.wanted, "n/a")


@dataclass(frozen=True, slots=True)
class Record:
    system: str
    node: str
    reviewer: str
    role: str
    date: str
    valid_until: str | None
    read: tuple[Reading, ...]
    clauses: tuple[Judged, ...]
    checklist: tuple[Question, ...]
    conclusion: str
    conditions: tuple[str, ...]
    remarks: str
    span: Span


_TEXT = {"type": "string", "pattern": r"\S", "description": "text"}
_REMARK = {"type": ["string", "null"]}
_DIGEST = {
    "type": ["string", "null"],
    "pattern": "^([0-9a-f]{64}|[?~]?)$",
    "description": "a SHA-256 in 64 small hexadecimal digits, which `avow review stamp` fills in",
}
_CONCLUSION = {"enum": CONCLUSIONS}
_YES_NO = ("yes", "no", True, False)  # some editors write YAML's yes and no as true and false
_QUESTION = {
    "question": _TEXT,
    "answer": {"enum": (*_YES_NO, "n/a")},
    "wanted": {"enum": _YES_NO},
    "note": _REMARK,
}
_JUDGED = schema({"meaning": _DIGEST, "conclusion": _CONCLUSION, "remark": _REMARK})
_READ = (
    _TEXT,
    schema({"file": _TEXT, "sha256": _DIGEST}, "file"),
    schema({"material": _TEXT}, "material"),
)
SCHEMA = schema(
    {
        "format": {"const": FORMAT},
        "system": _REMARK,
        "node": _REMARK,
        "reviewer": _TEXT,
        "role": _TEXT,
        "date": _TEXT,
        "valid_until": _TEXT,
        "read": {"type": "array", "minItems": 1, "items": {"oneOf": _READ}, "description": "what was read"},
        "clauses": {"type": ["object", "null"], "additionalProperties": {"anyOf": (_DIGEST, _JUDGED)}},
        "checklist": {
            "type": "array",
            "minItems": 1,
            "items": schema(_QUESTION, "question", "answer"),
            "description": "what was asked",
        },
        "conclusion": _CONCLUSION,
        "conditions": {"type": "array", "items": _TEXT},
        "remarks": _REMARK,
    },
    *("reviewer", "role", "date", "read", "checklist", "conclusion"),
)


def read_record(path: Path) -> Record:
    """Raises Rejected, with every problem and its place."""
    return record_in(*load(path))


def load(path: Path) -> tuple[Piece, tuple[Diagnostic, ...]]:
    """The record's YAML. Raises Rejected."""
    return read_yaml(file_bytes(path, "REV102"), str(path))


def record_in(piece: Piece, problems: Sequence[Diagnostic]) -> Record:
    """The record in a YAML text. Raises Rejected: with every problem of its form, else with every contradiction."""
    wrong = violations(piece.located(), SCHEMA, "the record")
    if problems or wrong:
        raise Rejected(*problems, *(replace(d, code="REV111") for d in wrong))
    data = piece.data
    record = Record(
        _text(data.get("system")),
        _text(data.get("node")),
        _text(data["reviewer"]),
        _text(data["role"]),
        _text(data["date"]),
        _text(data.get("valid_until")) or None,
        tuple(map(_reading, piece.each("read"))),
        tuple(_judged(name, entry.data, at) for name, at, entry in piece.keyed("clauses")),
        tuple(map(_question, data["checklist"])),
        data["conclusion"],
        tuple(map(_text, data.get("conditions", ()))),
        _text(data.get("remarks")),
        piece.span,
    )
    if found := tuple(_contradictions(record, piece)):
        raise Rejected(*found)
    return record


def _reading(piece: Piece) -> Reading:
    given = piece.data if isinstance(piece.data, dict) else {"file": piece.data}
    return Reading(_text(given.get("file")) or None, _digest(given), _text(given.get("material")) or None, piece.span)


def _judged(name: str, given: Any, span: Span) -> Judged:
    given = given if isinstance(given, dict) else {"meaning": given}
    return Judged(name, _digest(given, "meaning"), given.get("conclusion"), _text(given.get("remark")), span)


def _question(given: dict[str, Any]) -> Question:
    words = {True: "yes", False: "no"}
    answer, wanted = (words.get(word, word) for word in (given["answer"], given.get("wanted", "yes")))
    return Question(_text(given["question"]), answer, wanted, _text(given.get("note")))


def _text(value: str | None) -> str:
    return " ".join((value or "").split())


def _digest(given: dict[str, Any], key: str = "sha256") -> str | None:
    """None if it has not been filled in yet."""
    value = given.get(key) or ""
    return value if len(value) > 1 else None


def _contradictions(record: Record, piece: Piece) -> Iterator[Diagnostic]:
    """A name that cannot be told, impossible days, and a conclusion that contradicts its own answers."""
    top = piece.entries or {}
    place = top["conclusion"].span
    if why := unreadable(record.reviewer):
        hint = "write the name in the letters of one script"
        yield Diagnostic("REV124", f"the reviewer's name is not readable: {why}", top["reviewer"].span, hint=hint)
    days = {"date": wrong_day(record.date)}
    if record.valid_until:
        days["valid_until"] = wrong_day(record.valid_until, past=False)
    yield from (Diagnostic("REV112", f"'{key}': {why}", top[key].span) for key, why in days.items() if why)
    if record.valid_until and not any(days.values()) and record.valid_until < record.date:
        yield Diagnostic("REV112", "the review expires before its own date", top["valid_until"].span)
    for question, asked in zip(record.checklist, piece.each("checklist"), strict=True):
        if question.answer != question.wanted and not question.note:
            message = f"the answer '{question.answer}' needs a 'note' that explains it"
            yield Diagnostic("REV116", message, asked.span)
    if record.conclusion == "conditional" and not record.conditions:
        yield Diagnostic("REV113", "a conditional acceptance must list its 'conditions'", place)
    if record.conclusion == "accepted" and record.conditions:
        yield Diagnostic("REV113", "a review with conditions is 'conditional', not 'accepted'", place)
    for number, question in enumerate(record.checklist if record.conclusion == "accepted" else (), 1):
        if not question.good:
            message = f"accepted, although question {number} is answered '{question.answer}'"
            hint = "conclude 'conditional' or 'rejected', or say 'wanted: no' where 'no' is the good answer"
            yield Diagnostic("REV113", message, place, hint=hint)
    if all(question.answer == "n/a" for question in record.checklist):
        yield Diagnostic("REV113", "every question is answered 'n/a': nothing was reviewed", place)
    for judged in record.clauses:
        if judged.conclusion == "conditional" and not record.conditions:
            message = f"'{judged.clause}' is accepted on conditions, but there are none"
            yield Diagnostic("REV113", message, judged.span)


# Whether a review is still about the current files and guarantees


def current_meaning(node: Node, clause: str) -> str:
    """The digest of a guarantee under its node's assumptions: a threshold changes it, a comment does not."""
    return node_digest(node, node.clause(clause))


def current_file(root: Path, name: str) -> str | None:
    """The digest of a file of the system's folder; None if it does not exist."""
    path = inside(root, name)
    try:
        return digest_file(path) if path is not None and path.is_file() else None
    except OSError:
        return None


def stale_files(record: Record, root: Path) -> tuple[str, ...]:
    """The changes of the files since they were read, in words."""
    found = []
    for reading in record.read:
        if reading.file is None:
            continue
        now = current_file(root, reading.file)
        if now is None:
            found.append(f"{reading.file} is gone since the review of {record.date}")
        elif reading.sha256 is None:
            found.append(f"the digest of {reading.file} was never stamped")
        elif now != reading.sha256:
            found.append(f"{reading.file} changed since the review of {record.date}")
    return tuple(found)


def stale_clause(record: Record, node: Node, clause: str) -> str | None:
    """The change of a guarantee since it was judged, in words; None if it is unchanged."""
    judged = next((j for j in record.clauses if j.clause == clause), None)
    if judged is None:
        return f"the review of {record.date} does not speak of {clause}"
    if judged.meaning is None:
        return f"the meaning of {clause} was never stamped"
    if judged.meaning != current_meaning(node, clause):
        return f"{clause}, or an assumption that it rests on, changed its meaning since the review of {record.date}"
    return None
