"""Writes a person's validation of a requirement into the text of plan.yaml. All other text stays as it is."""

from __future__ import annotations

import json
from collections.abc import Mapping

from avow.system.plan import Requirement
from avow.system.strict_yaml import Piece, read_yaml


def with_validation(text: str, requirement: Requirement, who: str, date: str) -> str:
    """A plan's text in which a person has validated one of its requirements, as the requirement is now. The other keys
    of the entry (`says`, `because`, `until`) are kept."""
    words = {
        "who": json.dumps(who, ensure_ascii=False),
        "date": date,
        "sentence": f'"{requirement.sentence_digest}"',
        "formula": f'"{requirement.formula_digest}"',
    }
    root, _ = read_yaml(text.encode(), "plan.yaml")
    piece = root.at("requirements", requirement.id)
    assert piece is not None
    assert piece.entries is not None
    lines = text.splitlines(keepends=True)
    if "validation" in piece.entries:
        return _replaced(lines, piece.entries["validation"], words)
    if _is_flow(lines, piece):
        first = min(piece.keys.values(), key=lambda span: (span.line, span.column))
        return _spliced(lines, [((first.line, first.column), (first.line, first.column), f"{_entry(words)}, ")])
    return _added(lines, piece, words)


def _entry(words: Mapping[str, str]) -> str:
    return f"validation: {{{', '.join(f'{key}: {value}' for key, value in words.items())}}}"


def _is_flow(lines: list[str], piece: Piece) -> bool:
    return lines[piece.span.line - 1][piece.span.column - 1] == "{"


def _replaced(lines: list[str], entry: Piece, words: Mapping[str, str]) -> str:
    edits = []
    first = min(entry.keys.values(), key=lambda span: (span.line, span.column))
    between = ", " if _is_flow(lines, entry) else "\n" + " " * (first.column - 1)
    for key, value in words.items():
        old = entry.at(key)
        if old is not None:
            edits.append(((old.span.line, old.span.column), (old.span.end_line, old.span.end_column), value))
        else:
            edits.append(((first.line, first.column), (first.line, first.column), f"{key}: {value}{between}"))
    return _spliced(lines, edits)


def _added(lines: list[str], piece: Piece, words: Mapping[str, str]) -> str:
    """At the end of a requirement in block style."""
    column = min(span.column for span in piece.keys.values()) - 1
    end = last = max(span.line for span in piece.keys.values())
    for number in range(last + 1, len(lines) + 1):
        line = lines[number - 1]
        if line.strip() and len(line) - len(line.lstrip()) < column:
            break
        end = number if line.strip() else end
    kept = "".join(lines[:end])
    return "".join([kept, "" if kept.endswith("\n") else "\n", " " * column, _entry(words), "\n", *lines[end:]])


def _spliced(lines: list[str], edits: list[tuple[tuple[int, int], tuple[int, int], str]]) -> str:
    """The text with each part (from, to: line and column, from 1) replaced."""
    text = "".join(lines)
    begins = [0]
    for line in lines:
        begins.append(begins[-1] + len(line))
    for (begin, column), (end, end_column), new in sorted(edits, key=lambda edit: edit[0], reverse=True):
        text = text[: begins[begin - 1] + column - 1] + new + text[begins[end - 1] + end_column - 1 :]
    return text
