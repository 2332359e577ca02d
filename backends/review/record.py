"""A review as a person records it: who read what, the questions, the conclusion, and the contract.

The file is YAML, with one digest for each file read and each guarantee judged: a review is of *these* bytes and *this*
meaning, and becomes stale like a proof. `avow review stamp` fills in the digests.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from avow.backend_kit.given import file_bytes
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import digest_file, inside
from avow.base.persons import unreadable, wrong_day
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.formulas.formula import node_digest
from avow.language.contract import Node
from avow.system.strict_yaml import Piece, read_yaml

FORMAT = 1
"""The version of the record. A later one is rejected, not guessed."""
CONCLUSIONS = ("accepted", "conditional", "rejected")
"""From best to worst."""
ANSWERS = ("yes", "no", "n/a")

_SHA256 = re.compile(r"[0-9a-f]{64}")
_KEYS = ("format", "system", "node", "reviewer", "role", "date", "valid_until", "read", "clauses", "checklist",
         "conclusion", "conditions", "remarks")  # fmt: skip


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


def read_record(path: Path) -> Record:
    """Raises Rejected, with every problem and its place."""
    return record_in(*load(path))


def record_in(piece: Piece, problems: Sequence[Diagnostic]) -> Record:
    """The record in a YAML text. Raises Rejected, with every problem and its place."""
    return _RecordReader(piece, list(problems)).read()


def load(path: Path) -> tuple[Piece, tuple[Diagnostic, ...]]:
    """The record's YAML. Raises Rejected."""
    return read_yaml(file_bytes(path, "REV102"), str(path))


class _RecordReader:
    def __init__(self, piece: Piece, problems: list[Diagnostic]) -> None:
        self.piece = piece
        self.problems = problems

    def read(self) -> Record:
        top = self.mapping(self.piece, _KEYS)
        form = top.get("format")
        if form is not None and form.value != FORMAT:
            raise Rejected(Diagnostic("REV111", f"format {form.text} is not known here; this is {FORMAT}", form.span))
        system, node = self.text("system", top, ""), self.text("node", top, "")
        reviewer, role = self.text("reviewer", top), self.text("role", top)
        if reviewer and (why := unreadable(reviewer)):
            hint = "write the name in the letters of one script"
            self.add("REV124", f"nobody can tell this reviewer's name: {why}", top["reviewer"].span, hint)
        date = self.date("date", top)
        valid_until = self.date("valid_until", top, past=False) if "valid_until" in top else None
        if date and valid_until and valid_until < date:
            self.add("REV112", "the review expires before its own date", top["valid_until"].span)
        read = tuple(self.reading(p) for p in self.items("read", top, "what was read"))
        clauses = self.clauses(top.get("clauses"))
        checklist = tuple(self.question(p) for p in self.items("checklist", top, "what was asked"))
        conclusion = self.word("conclusion", top, CONCLUSIONS)
        conditions = tuple(self.sentence(p) for p in self.items("conditions", top, None))
        remarks = self.text("remarks", top, "")
        self.agree(conclusion, conditions, checklist, clauses, top)
        if self.problems:
            raise Rejected(*self.problems)
        return Record(
            system, node, reviewer, role, date or "", valid_until, read, clauses, checklist, conclusion, conditions,
            remarks, self.piece.span,
        )  # fmt: skip

    def agree(
        self,
        conclusion: str,
        conditions: tuple[str, ...],
        checklist: tuple[Question, ...],
        clauses: tuple[Judged, ...],
        top: dict[str, Piece],
    ) -> None:
        """Report a conclusion that contradicts its own answers."""
        place = top["conclusion"].span if "conclusion" in top else self.piece.span
        if conclusion == "conditional" and not conditions:
            self.add("REV113", "a conditional acceptance must list its 'conditions'", place)
        if conclusion == "accepted":
            if conditions:
                self.add("REV113", "a review with conditions is 'conditional', not 'accepted'", place)
            for number, question in enumerate(checklist, 1):
                if not question.good:
                    message = f"accepted, although question {number} is answered '{question.answer}'"
                    hint = "conclude 'conditional' or 'rejected', or say 'wanted: no' where 'no' is the good answer"
                    self.add("REV113", message, place, hint)
        if checklist and all(question.answer == "n/a" for question in checklist):
            self.add("REV113", "every question is answered 'n/a': nothing was reviewed", place)
        for judged in clauses:
            if judged.conclusion == "conditional" and not conditions:
                self.add("REV113", f"'{judged.clause}' is accepted on conditions, but there are none", judged.span)

    def reading(self, piece: Piece) -> Reading:
        if piece.entries is None:
            return Reading(self.sentence(piece) or None, None, None, piece.span)
        entries = self.mapping(piece, ("file", "sha256", "material"))
        if ("file" in entries) == ("material" in entries):
            self.add("REV114", "name either a 'file' of the system's folder or 'material' kept elsewhere", piece.span)
        file, material = self.text("file", entries, ""), self.text("material", entries, "")
        return Reading(file or None, self.digest("sha256", entries), material or None, piece.span)

    def clauses(self, piece: Piece | None) -> tuple[Judged, ...]:
        if piece is None or (piece.entries is None and piece.value is None and piece.items is None):
            return ()
        if piece.entries is None:
            self.add("REV115", "'clauses' must say, by guarantee, of which meaning it was judged", piece.span)
            return ()
        judged = []
        for name, entry in piece.entries.items():
            if entry.entries is None:
                judged.append(Judged(name, self.digest(name, {name: entry}), None, "", piece.key_span(name)))
                continue
            inner = self.mapping(entry, ("meaning", "conclusion", "remark"))
            conclusion = self.word("conclusion", inner, CONCLUSIONS) if "conclusion" in inner else None
            remark = self.text("remark", inner, "")
            judged.append(Judged(name, self.digest("meaning", inner), conclusion, remark, piece.key_span(name)))
        return tuple(judged)

    def question(self, piece: Piece) -> Question:
        entries = self.mapping(piece, ("question", "answer", "wanted", "note"))
        question = self.text("question", entries, where=piece)
        answer = self.word("answer", entries, ANSWERS, where=piece)
        wanted = self.word("wanted", entries, ("yes", "no")) if "wanted" in entries else "yes"
        note = self.text("note", entries, "")
        if answer and answer != wanted and not note:
            self.add("REV116", f"the answer '{answer}' needs a 'note' that explains it", piece.span)
        return Question(question, answer, wanted, note)

    def mapping(self, piece: Piece, known: tuple[str, ...]) -> dict[str, Piece]:
        if piece.entries is None:
            self.add("REV111", f"expected keys and values ({', '.join(known)})", piece.span)
            return {}
        for key in piece.entries:
            if key not in known:
                value = piece.entries[key].data
                comma = f"a text with a comma needs quotes here: “…, {key}”" if value is None else None
                self.add("REV111", f"unknown key '{key}'", piece.key_span(key), comma or suggest(key, known))
        return piece.entries

    def items(self, key: str, top: dict[str, Piece], wanted: str | None) -> list[Piece]:
        piece = top.get(key)
        if piece is None or not piece.items:
            if wanted is not None:
                place = piece.span if piece else self.piece.span
                self.add("REV117", f"the review does not say {wanted}: '{key}' is missing or empty", place)
            elif piece is not None and piece.items is None:
                self.add("REV111", f"'{key}' must be a list", piece.span)
            return []
        return piece.items

    def sentence(self, piece: Piece) -> str:
        if piece.items is not None or piece.entries is not None or not piece.text.strip():
            self.add("REV111", "expected text", piece.span)
            return ""
        return " ".join(piece.text.split())

    def text(self, key: str, top: dict[str, Piece], default: str | None = None, where: Piece | None = None) -> str:
        piece = top.get(key)
        empty = piece is None or (piece.items is None and piece.entries is None and not piece.text.strip())
        if piece is None or empty:
            if default is not None:
                return default
            place = piece.span if piece else (where or self.piece).span
            self.add("REV117", f"'{key}' is missing or empty", place)
            return ""
        return self.sentence(piece)

    def word(self, key: str, top: dict[str, Piece], known: tuple[str, ...], where: Piece | None = None) -> str:
        text = self.text(key, top, where=where)
        if not text:
            return ""
        # some editors write YAML's yes and no as true and false
        text = {"true": "yes", "false": "no"}.get(text, text) if "yes" in known else text
        if text not in known:
            self.add("REV118", f"'{key}' cannot be '{text}'", top[key].span, f"one of {', '.join(known)}")
            return ""
        return text

    def date(self, key: str, top: dict[str, Piece], *, past: bool = True) -> str | None:
        text = self.text(key, top)
        if not text:
            return None
        if wrong := wrong_day(text, past=past):
            self.add("REV112", f"'{key}': {wrong}", top[key].span)
            return None
        return text

    def digest(self, key: str, top: dict[str, Piece]) -> str | None:
        """None if it has not been filled in yet."""
        piece = top.get(key)
        if piece is None or (piece.items is None and piece.entries is None and piece.text.strip() in ("", "?", "~")):
            return None
        if piece.items is not None or piece.entries is not None or not _SHA256.fullmatch(piece.text):
            hint = "'avow review stamp' fills digests in"
            self.add("REV119", f"'{key}' must be a SHA-256 in 64 small hexadecimal digits", piece.span, hint)
            return None
        return piece.text

    def add(self, code: str, message: str, span: Span, hint: str | None = None) -> None:
        self.problems.append(Diagnostic(code, message, span, hint=hint))


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
