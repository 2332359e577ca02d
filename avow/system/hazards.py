"""Hazards of a system and the mitigations of each: a YAML file of one entry per hazard, or an STPA table in CSV.

Severity and exposure have the levels of MIL-STD-882E, tables I and II. A mitigation is a requirement (``REQ1``), a node
(``agent``: all of its guarantees), a guarantee (``agent.stop``), an input (``agent.command``: no message from outside
the graph reaches it), or a method of a node (``agent/monitor``), such as a monitor that runs on the robot. A security
goal is a hazard with ``kind: security``.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import read_regular
from avow.base.packaged import packaged
from avow.base.plain import bare
from avow.base.suggestions import nearest, suggest
from avow.language.contract import Node
from avow.system.plan import Hazard, Plan
from avow.system.schema import violations
from avow.system.strict_yaml import Piece, read_yaml
from avow.system.tables import csv_rows

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "id": ("id", "uca", "uca id", "hazard id"),
    "text": ("text", "hazard", "unsafe control action", "description"),
    "severity": ("severity",),
    "exposure": ("exposure", "probability", "likelihood"),
    "source": ("source", "reference", "document"),
    "kind": ("kind",),
    "causes": ("causes", "causal scenarios", "causal scenario", "loss scenarios", "scenarios"),
    "consequences": ("consequences", "losses", "loss", "effects"),
    "mitigated_by": ("mitigated_by", "mitigated by", "mitigations", "constraints", "safety constraints"),
}
"""Field of a hazard → the headings that it may have in a CSV file, in any case."""
_HEADINGS = f"its first line has headings: {', '.join(COLUMNS)}"
_SCHEMA = "avow.system", "hazards.schema.json"
_LISTS = ("causes", "consequences", "mitigated_by")


def read_hazards(files: Iterable[Path]) -> tuple[tuple[Hazard, ...], tuple[Diagnostic, ...]]:
    """The hazards in these files, and the faults in them."""
    found: list[Hazard] = []
    faults: list[Diagnostic] = []
    for path in files:
        try:
            root, wrong = (_table if path.suffix.lower() == ".csv" else read_yaml)(read_regular(path), str(path))
            wrong += violations(root.located(), packaged(*_SCHEMA), "the hazards")
        except OSError as error:
            message = f"{path.name} cannot be read: {error.strerror}"
            wrong = (Diagnostic("PLAN107", message, Span(str(path), 1, 1, 1, 1)),)
        except Rejected as rejected:
            wrong = rejected.diagnostics
        faults += wrong
        for hazard in () if wrong else [_hazard(*each) for each in root.keyed()]:
            first = next((other for other in found if other.id == hazard.id), None)
            if first is not None:
                notes = (("first declared here", first.span),)
                faults.append(
                    Diagnostic("PLAN110", f"hazard {hazard.id!r} is declared twice", hazard.span, notes=notes)
                )
            found.append(hazard)
    return tuple(found), tuple(faults)


def _table(data: bytes, file: str) -> tuple[Piece, tuple[Diagnostic, ...]]:
    """Rows of a CSV file with a line of headings, as a document of YAML has them; several causes, consequences or
    mitigations are separated by `;`. Raises Rejected."""
    try:
        rows = [(line, row) for line, row in csv_rows(data) if any(row)]
    except ValueError as error:
        raise Rejected(Diagnostic("PLAN109", f"not a CSV file: {error}", Span(file, 1, 1, 1, 2))) from None
    if not rows:
        raise Rejected(Diagnostic("PLAN109", "the table is empty", Span(file, 1, 1, 1, 2), hint=_HEADINGS))
    (line, header), *entries = rows
    fields = {bare(word): field for field, words in COLUMNS.items() for word in words}
    at = {fields[bare(word)]: place for place, word in enumerate(header) if bare(word) in fields}
    missing = [field for field in ("id", "text") if field not in at]
    if missing:
        message = f"the table has no column for {' and '.join(missing)}"
        hint = "; ".join(f"{field}: {', '.join(COLUMNS[field])}" for field in missing)
        raise Rejected(Diagnostic("PLAN109", message, Span(file, line, 1, line, 2), hint=hint))
    hazards, spans, faults = dict[str, Piece](), dict[str, Span](), list[Diagnostic]()
    lost = [field for field in COLUMNS if field not in at]
    for word in (word for word in header if bare(word) not in fields):
        if near := nearest(bare(word), (bare(name) for field in lost for name in COLUMNS[field])):
            message = f"the column {word!r} is not read: did you mean {near[0]!r}?"
            faults.append(Diagnostic("PLAN109", message, Span(file, line, 1, line, 2)))
    whole = Span(file, 1, 1, line, 2)
    for line, row in entries:
        span = Span(file, line, 1, line, 2)
        if len(row) > len(header):
            message = f"{len(row)} cells, but {len(header)} columns"
            faults.append(Diagnostic("PLAN109", message, span, hint="put a text that has a comma in quotes"))
        cells = {field: row[place] for field, place in at.items() if place < len(row) and row[place]}
        name = cells.pop("id", "")
        if name in spans:
            notes = (("first declared here", spans[name]),)
            faults.append(Diagnostic("PLAN110", f"hazard {name!r} is declared twice", span, notes=notes))
        parts = {}
        for field, text in cells.items():
            words = [Piece(span, part.strip(), part.strip()) for part in text.split(";") if part.strip()]
            plain = text.lower() if field in ("severity", "exposure", "kind") else text
            parts[field] = Piece(span, items=words) if field in _LISTS else Piece(span, plain, plain)
        spans[name] = span
        hazards[name] = Piece(span, entries=parts)
    if any(len(row) > len(header) for _, row in entries):  # what its cells mean is not known
        raise Rejected(*faults)
    return Piece(whole, entries=hazards, keys=spans), tuple(faults)


def _hazard(name: str, span: Span, entry: Piece) -> Hazard:
    said: dict[str, Any] = {**entry.words(), **{key: entry.texts(key) for key in _LISTS}}
    return Hazard(name, span=span, mitigation_spans=tuple(p.span for p in entry.each("mitigated_by")), **said)


def check_mitigations(plan: Plan, nodes: Mapping[str, Node]) -> Iterator[Diagnostic]:
    """A diagnostic for each mitigation that names no requirement, node, guarantee or method of the system."""
    known = [r.id for r in plan.requirements] + list(nodes)
    known += [f"{node.name}.{clause.name}" for node in nodes.values() for clause in node.guarantees]
    known += [f"{node.name}.{port.name}" for node in nodes.values() for port in node.inputs]
    known += [f"{entry.node}/{method.id}" for entry in plan.nodes for method in entry.methods]
    for hazard in plan.hazards:
        for name, span in zip(hazard.mitigated_by, hazard.mitigation_spans, strict=True):
            if name not in known:
                kinds = "requirement, node, guarantee, input or method"
                message = f"hazard {hazard.id}: mitigated by {name!r}, which is no {kinds}"
                yield Diagnostic("PLAN106", message, span, hint=suggest(name, known))
