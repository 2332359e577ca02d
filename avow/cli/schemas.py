"""The published JSON schemas that follow from dataclasses: of reports, ledgers, and the commands' output for machines.

python -m avow.cli.schemas docs/schemas
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from avow.assurance.codec import case_schema, evidence_schema
from avow.base import codec
from avow.base.files import write
from avow.base.rendering import CheckDocument
from avow.calculus.document import ComposeDocument
from avow.sanity.document import SanityDocument

_PLACE = "https://avow.example/schemas/"


def schemas() -> dict[str, dict[str, Any]]:
    """The schemas by their file names."""
    return {
        "case": case_schema(),
        "evidence": evidence_schema(),
        "check": codec.published(CheckDocument, f"{_PLACE}check.schema.json", "avow check --json"),
        "compose": codec.published(ComposeDocument, f"{_PLACE}compose.schema.json", "avow compose --json"),
        "sanity": codec.published(SanityDocument, f"{_PLACE}sanity.schema.json", "avow sanity --json"),
    }


if __name__ == "__main__":
    for name, found in schemas().items():
        write(Path(sys.argv[1]) / f"{name}.schema.json", codec.document(found) + "\n")
