"""Certificates as JSON."""

from __future__ import annotations

from typing import Any

from avow.base import codec
from avow.kernel.certificate import FORMAT, Certificate


def to_json(certificate: Certificate) -> dict[str, Any]:
    return {"format": FORMAT, **codec.to_json(certificate)}


def from_json(data: object) -> Certificate:
    """Strict. Raises codec.Unreadable."""
    if not isinstance(data, dict) or data.get("format") != FORMAT:
        raise codec.Unreadable(f"no certificate of format {FORMAT}")
    return codec.from_json(Certificate, {key: value for key, value in data.items() if key != "format"})
