"""The assurance report: every format rendered from one `avow.assurance.model.Case`, so that they cannot disagree.

    render_all(case, folder)            writes index.html report.json report.md report.pdf report.sarif findings.sarif
                                        junit.xml attestation.jsonl gsn.yaml gsn.svg traceability.html/.csv report.tex
    write_index(cases, folder)          writes <folder>/index.html over all systems, with the trend over runs

Both are idempotent and write each file in one step. They return what they wrote, and what they left out and why.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from avow.assurance.model import Case


@dataclass(frozen=True, slots=True)
class Rendered:
    """`left_out` maps a file name to the reason why it was not written (an extra that is not installed)."""

    written: tuple[Path, ...]
    left_out: tuple[tuple[str, str], ...] = ()


def render_all(case: Case, folder: Path) -> Rendered:
    """Write every format of one case into `folder`. Raises OSError."""
    raise NotImplementedError


def write_index(cases: Sequence[Case], folder: Path) -> Rendered:
    """Write the page over all systems, `folder`/index.html; a system's own page is `folder`/<system>/index.html."""
    raise NotImplementedError
