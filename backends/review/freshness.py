"""Whether a review still speaks of what is there now."""

from __future__ import annotations

from pathlib import Path

from avow.base.files import digest_file
from avow.formulas.formula import node_digest
from avow.language.contract import Node
from avow.system.paths import inside

from .record import Record


def current_meaning(node: Node, clause: str) -> str:
    """The digest of a guarantee under its node's assumptions: a threshold changes it, a comment does not."""
    return node_digest(node, node.clause(clause))


def current_file(root: Path, name: str) -> str | None:
    """The digest of a file of the system's folder; None where it is not there."""
    path = inside(root, name)
    try:
        return digest_file(path) if path is not None and path.is_file() else None
    except OSError:
        return None


def stale_files(record: Record, root: Path) -> tuple[str, ...]:
    """What has happened to the files since they were read, in words."""
    found = []
    for reading in record.read:
        if reading.file is None:
            continue
        now = current_file(root, reading.file)
        if now is None:
            found.append(f"{reading.file} is gone since the review of {record.date}")
        elif reading.sha256 is None:
            found.append(f"the digest of {reading.file} was never stamped")
        elif now != reading.sha256:
            found.append(f"{reading.file} changed since the review of {record.date}")
    return tuple(found)


def stale_clause(record: Record, node: Node, clause: str) -> str | None:
    """What has happened to a guarantee since it was judged, in words; None: nothing."""
    judged = next((j for j in record.clauses if j.clause == clause), None)
    if judged is None:
        return f"the review of {record.date} does not speak of {clause}"
    if judged.meaning is None:
        return f"the meaning of {clause} was never stamped"
    if judged.meaning != current_meaning(node, clause):
        return f"{clause}, or an assumption that it rests on, changed its meaning since the review of {record.date}"
    return None
