"""Every diagnostic code of the language, declared once: what it means, why, and an example of each.

Numbers: 0xx the file, 1xx the syntax, 2xx names, 3xx sorts, 4xx lints (warnings that can be switched off).
"""

from __future__ import annotations

from dataclasses import dataclass

from avow.diagnostics import Severity


@dataclass(frozen=True, slots=True)
class Code:
    """One thing that can be wrong. `example` is text that triggers it (a file, or a node's clause for short)."""

    code: str
    title: str
    explanation: str
    example: str = ""
    severity: Severity = Severity.ERROR


CODES: dict[str, Code] = {}
