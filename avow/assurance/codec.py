"""Cases as JSON, both directions, and their published schema (`avow.base.codec`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from avow.assurance.model import Case
from avow.base import codec
from avow.base.codec import Unreadable
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import read_regular
from avow.evidence.ledger import Line

SCHEMA = "https://avow.invalid/schemas/case-7"
"""The format's name in ``report.json``; its number increases with incompatible changes."""


def to_json(case: Case) -> dict[str, Any]:
    """A case as plain data."""
    return {"schema": SCHEMA, **codec.to_json(case)}


def from_json(data: object) -> Case:
    """The case that plain data represents. Raises Unreadable."""
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise Unreadable(f"not a case of format {SCHEMA}")
    return codec.from_json(Case, {key: value for key, value in data.items() if key != "schema"})


def read_case(path: Path) -> Case:
    """The case of a report (its folder, or report.json). Raises Rejected."""
    file = path / "report.json" if path.is_dir() else path
    try:
        return from_json(codec.parsed(read_regular(file)))
    except OSError as error:
        raise Rejected(
            Diagnostic("REPORT001", f"{file} cannot be read: {error.strerror}", hint="`avow verify` writes it")
        ) from None
    except ValueError as error:
        message = f"{file} is no report of this version of Avow: {error}"
        raise Rejected(Diagnostic("REPORT002", message, hint="`doit report` renders it again")) from None


def case_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of ``report.json``."""
    whole = codec.published(Case, SCHEMA, "Avow assurance case")
    properties, required = {"schema": {"const": SCHEMA}, **whole["properties"]}, ["schema", *whole["required"]]
    return {**whole, "properties": properties, "required": required}


def evidence_schema() -> dict[str, Any]:
    """The JSON schema (2020-12) of one line of the ledger."""
    return codec.published(Line, "https://avow.invalid/schemas/evidence-1", "A line of Avow's evidence ledger")
