"""Signed records: an in-toto statement about a record's bytes in a DSSE envelope, beside it as ``<record>.sig``.

A name in a record is only text. With a signature the holder of a key vouches for the text; the plan says whose key
counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from avow.base.diagnostics import Rejected
from avow.base.files import digest_file, read_regular, sha256, write
from avow.evidence.envelope import Opened, seal, unseal
from avow.evidence.signing import signature_path

from .record import Record, read_record

PREDICATE = "https://avow.invalid/signed-review/v1"


def sign_record(path: Path, private: Path) -> Path:
    """Sign a record as it is now; the signature's path. Raises Rejected if record or key do not exist; OSError."""
    record = read_record(path)
    statement = {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [{"name": path.name, "digest": {"sha256": digest_file(path)}}],
        "predicateType": PREDICATE,
        "predicate": {"reviewer": record.reviewer, "role": record.role, "date": record.date},
    }
    found = signature_path(path)
    write(found, seal(statement, private))
    return found


def signed(path: Path, record: Record, trusted: Sequence[Path]) -> Opened | str | None:
    """The signer of a record's bytes, or why its signature does not count; None if there is none and none is required.
    With `trusted` public keys, one of them must have signed it."""
    place = signature_path(path)
    if not place.exists():
        return f"no key of the plan has signed it ({place.name} is not there)" if trusted else None
    try:
        opened = unseal(read_regular(place).decode("utf-8"), trusted)
        text = sha256(read_regular(path))
    except Rejected as error:
        return error.diagnostics[0].message
    except (OSError, ValueError) as error:
        return f"{place.name} cannot be read: {error}"
    if isinstance(opened, str):
        return f"{place.name}: {opened}"
    if not opened.key:
        return f"{place.name} bears no signature"
    stated = {"reviewer": record.reviewer, "role": record.role, "date": record.date}
    subjects = [{"name": path.name, "digest": {"sha256": text}}]
    if opened.statement.get("predicateType") != PREDICATE or opened.statement.get("subject") != subjects:
        return f"{place.name} is not a signature of this text: sign it again once it is read"
    if opened.statement.get("predicate") != stated:
        return f"{place.name} names another review than it signs"
    return opened
