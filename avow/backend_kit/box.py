"""The option `box`: bounds of a node's inputs, which are a further assumption, NODE/assumption/box."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.files import inside, read_regular, sha256
from avow.base.plain import decimal, exact
from avow.base.records import dataclass
from avow.base.suggestions import nearby, suggest
from avow.base.verdict import Hypothesis, HypothesisKind
from avow.language.contract import Node
from avow.language.sorts import REAL
from avow.language.terms import Compare, Literal, Term

BOX = "box"


@dataclass(frozen=True, slots=True)
class Box:
    """The bounds as formulas, and for people."""

    terms: tuple[Term, ...] = ()
    text: str = ""

    def hypotheses(self, node: str) -> tuple[Hypothesis, ...]:
        """What evidence within the box rests on."""
        name, text = f"{node}/assumption/{BOX}", f"the plan's box: {self.text}"
        return (Hypothesis(HypothesisKind.ASSUMPTION, name, sha256(text), text),) if self.terms else ()


def read_box(
    entries: Mapping[str, Any], node: Node, root: Path, code: str, span: Span | None
) -> tuple[Box, tuple[Diagnostic, ...]]:
    """The option's value, and its faults, which have this code if they are not in a file."""
    known = {port.variable.qualified: port.variable for port in node.inputs if port.sort == REAL}
    terms, shown, faults = list[Term](), list[str](), list[Diagnostic]()
    for name, entry in entries.items():
        try:
            if name not in known:
                raise Rejected(Diagnostic(code, f"'{name}' is no input of type REAL", span, hint=suggest(name, known)))
            low, high = _ends(name, entry, root, code, span)
            if low > high:
                raise Rejected(Diagnostic(code, f"{name} is an interval without values", span))
        except Rejected as rejected:
            faults += rejected.diagnostics
        else:
            terms += [Compare("<=", Literal(low, REAL), known[name]), Compare("<=", known[name], Literal(high, REAL))]
            shown.append(f"{decimal(low) or low} <= {name} <= {decimal(high) or high}")
    return Box(tuple(terms), " and ".join(shown)), tuple(faults)


def box_files(options: Mapping[str, Any], root: Path) -> Iterator[Path]:
    """The tables whose ranges are bounds."""
    named = (entry["data"] for entry in options.get(BOX, {}).values() if isinstance(entry, Mapping))
    yield from (path for name in named if (path := inside(root, name)) is not None)


def _ends(name: str, entry: Any, root: Path, code: str, span: Span | None) -> tuple[Fraction, Fraction]:
    """Numbers of the plan, or the least and the greatest of a table's column. Raises Rejected."""
    from avow.system.tables import csv_rows  # importing a backend needs no reader of plans

    if not isinstance(entry, Mapping):
        return Fraction(str(entry[0])), Fraction(str(entry[1]))
    path, column = inside(root, entry["data"]), entry["column"]
    try:
        (_, header), *rows = csv_rows(read_regular(path)) if path is not None else []
        at, _ = header.index(column), rows[0]
    except (OSError, ValueError, IndexError):
        message = f"{name}: '{entry['data']}' is no table in the system's folder with values in a column '{column}'"
        hint = nearby(path, entry["data"]) if path and not path.exists() else None
        raise Rejected(Diagnostic(code, message, span, hint=hint)) from None
    found = []
    for line, cells in rows:
        try:
            found.append(exact(cells[at]))
        except (ValueError, IndexError):
            message = f"{name}: no number in column '{column}'"
            raise Rejected(Diagnostic(code, message, Span(str(path), line, 1, line + 1, 1))) from None
    return min(found), max(found)
