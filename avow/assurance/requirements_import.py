"""Requirements from other tools: CSV and ReqIF 1.x, as `Requirement`s and as the ``requirements:`` section of a plan.

CSV has a header row; its columns are found by their names (``id``, ``statement``, ``text``…), whatever their case.
ReqIF: every SPEC-OBJECT that is no heading, in the order of the specification (`avow.assurance.reqif`). Errors are
diagnostics with codes REQS001 to REQS004, located if there is a line.
"""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

from avow.assurance.reqif import read_objects
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.plain import bare
from avow.system.plan import Requirement
from avow.system.strict_yaml import read_yaml

_COLUMNS: Mapping[str, tuple[str, ...]] = {
    "id": ("id", "requirement", "requirement id", "identifier", "key", "req", "reqif.foreignid", "object identifier"),
    "text": (
        "text",
        "statement",
        "description",
        "sentence",
        "reqif.text",
        "title",
        "name",
        "reqif.name",
        "requirement text",
        "object text",
        "primary text",
    ),
    "formula": ("formula", "formalised as", "formalization", "formalisation", "rcl"),
    "temporal": ("temporal", "temporal property", "ltl"),
    "supported_by": ("supported_by", "supported by", "guarantees", "allocated to"),
}
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,99}\Z")


def read_requirements(path: Path) -> tuple[Requirement, ...]:
    """The requirements in a .csv or .reqif file, in its order. Raises Rejected with all faults found."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise Rejected(Diagnostic("REQS001", f"{path} cannot be read: {error.strerror}")) from None
    if path.suffix.lower() in (".reqif", ".reqifz", ".xml"):
        return read_reqif(data, str(path))
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise Rejected(Diagnostic("REQS001", f"{path} is not UTF-8 (byte {error.start}): export it as CSV")) from None
    return read_csv(text, str(path))


def read_csv(text: str, file: str) -> tuple[Requirement, ...]:
    """Raises Rejected."""
    try:
        dialect: type[csv.Dialect] | str = csv.Sniffer().sniff(text[:4096], delimiters=",;\t")
    except csv.Error:
        dialect = "excel"
    reader = csv.reader(io.StringIO(text, newline=""), dialect)
    rows: list[tuple[int, list[str]]] = []
    try:
        rows.extend((reader.line_num, row) for row in reader if any(cell.strip() for cell in row))
    except csv.Error as error:
        raise Rejected(Diagnostic("REQS001", f"{file} is no CSV: {error}", _at(file, reader.line_num))) from None
    if not rows:
        raise Rejected(Diagnostic("REQS002", f"{file} is empty: a header row is wanted", _at(file, 1)))
    header = [bare(cell) for cell in rows[0][1]]
    columns = {field: header.index(name) for field, names in _COLUMNS.items() for name in names[::-1] if name in header}
    if "text" not in columns:
        known = ", ".join(_COLUMNS["text"])
        fault = f"{file} has no column with the requirements' text; its columns: {', '.join(rows[0][1])}"
        raise Rejected(Diagnostic("REQS002", fault, _at(file, 1), hint=f"name it one of: {known}"))
    found = []
    for line, row in rows[1:]:
        cells = {field: row[at].strip() if at < len(row) else "" for field, at in columns.items()}
        found.append((line, cells))
    return _requirements(found, file)


def read_reqif(data: bytes, file: str) -> tuple[Requirement, ...]:
    """Raises Rejected."""
    found = []
    for line, name, values in read_objects(data, file):
        cells = {field: next((values[n] for n in known if values.get(n)), "") for field, known in _COLUMNS.items()}
        cells["id"] = cells["id"] or name
        found.append((line, cells))
    if not found:
        raise Rejected(Diagnostic("REQS002", f"{file} holds no requirement, but for headings", _at(file, 1)))
    if not any(cells["text"] for _, cells in found):
        raise Rejected(
            Diagnostic("REQS002", _no_text(data, file), hint=f"name it one of: {', '.join(_COLUMNS['text'])}")
        )
    return _requirements(found, file)


def _no_text(data: bytes, file: str) -> str:
    names = dict.fromkeys(name for _, _, values in read_objects(data, file) for name in values if name)
    return f"{file} has no attribute with the requirements' text; its attributes: {', '.join(names)}"[:400]


def plan_section(requirements: Iterable[Requirement]) -> str:
    """The ``requirements:`` section of a plan.yaml; every text is quoted. Raises Rejected if a requirement would not
    read back unchanged."""
    requirements = tuple(requirements)
    lines = ["requirements:"]
    for r in requirements:
        parts = [f"text: {_quoted(r.text)}"]
        parts += [f"formula: {_quoted(r.formula)}"] if r.formula else []
        parts += [f"temporal: {_quoted(r.temporal)}"] if r.temporal else []
        parts += [f"supported_by: [{', '.join(map(_quoted, r.supported_by))}]"]
        lines += [f"  {_quoted(r.id)}:", *(f"    {part}" for part in parts)]
    text = "\n".join(lines) + "\n"
    try:
        read = read_yaml(text.encode("utf-8", "surrogatepass"), "requirements")[0].at("requirements")
    except Rejected:
        read = None
    again = (read.entries or {}) if read is not None else {}
    lost = [r for r in requirements if r.id not in again or again[r.id].data != _content(r)]
    if lost or len(again) != len(requirements):
        message = "as a section of a plan, requirement '{}' does not read back as it is"
        raise Rejected(*(Diagnostic("REQS005", message.format(r.id), r.span) for r in lost or requirements[:1]))
    return text


def _content(requirement: Requirement) -> dict[str, object]:
    """The content of a requirement's entry in a plan."""
    said = {"text": requirement.text, "formula": requirement.formula, "temporal": requirement.temporal}
    return {**{k: v for k, v in said.items() if v or k == "text"}, "supported_by": list(requirement.supported_by)}


def _requirements(rows: Iterable[tuple[int, Mapping[str, str]]], file: str) -> tuple[Requirement, ...]:
    faults: list[Diagnostic] = []
    found: dict[str, Requirement] = {}
    for number, (line, cells) in enumerate(rows, 1):
        name = re.sub(r"[^A-Za-z0-9_.-]+", "_", cells.get("id", "")).strip("_") or f"REQ{number}"
        name = name if name[0].isalpha() else f"R{name}"
        if not _NAME.match(name):
            faults.append(Diagnostic("REQS004", f"'{cells.get('id', '')}' cannot name a requirement", _at(file, line)))
        elif name in found:
            faults.append(Diagnostic("REQS004", f"two requirements are called '{name}'", _at(file, line)))
        elif not cells["text"]:
            faults.append(Diagnostic("REQS004", f"requirement '{name}' has no text", _at(file, line)))
        else:
            supports = tuple(part for part in re.split(r"[\s,;]+", cells.get("supported_by", "")) if part)
            found[name] = Requirement(
                name,
                " ".join(cells["text"].split()),
                cells.get("formula") or None,
                cells.get("temporal") or None,
                supports,
                _at(file, line),
            )
    if faults or not found:
        raise Rejected(*faults or [Diagnostic("REQS002", f"{file} has no requirement below its header", _at(file, 1))])
    return tuple(found.values())


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=max(text, default="") <= "\uffff")


def _at(file: str, line: int) -> Span:
    return Span(file, line, 1, line, 1)
