"""Evidence records as JSON, there and back: what the ledger's lines are made of (`avow.base.codec`)."""

from __future__ import annotations

from typing import Any

from avow.base.codec import from_json, plain, to_json
from avow.evidence.record import Evidence


def encode(evidence: Evidence) -> dict[str, Any]:
    """A record as plain JSON data."""
    found: dict[str, Any] = to_json(evidence)
    return {**found, "seconds": plain(float(evidence.seconds))}  # one spelling, whichever number was given


def decode(data: object) -> Evidence:
    """The record that plain JSON data stands for. Raises Unreadable where a field is missing, unknown or ill-typed."""
    return from_json(Evidence, data)
