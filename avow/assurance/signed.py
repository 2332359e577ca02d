"""Signed cases: an in-toto statement over what a case claims, in ``signed/<system>/``; the newest that verifies is the
baseline with which later cases are compared."""

from __future__ import annotations

from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

from avow.assurance.answers import Baseline
from avow.assurance.model import Case
from avow.assurance.state import baseline_of, content_of
from avow.base.codec import Unreadable, from_json, to_json
from avow.base.files import digest_file, read_regular, write
from avow.evidence.envelope import Opened, seal, unseal

PREDICATE = "https://avow.invalid/signed-case/v3"
KEYS = "keys"
"""In ``signed/``: public keys (``*.pub``). If there are any, only a signature by one of them is a baseline."""


def sign_case(
    case: Case, report: Path, signed: Path, *, who: str, until: date, today: date, private: Path | None
) -> Path:
    """Write a signature of the case to ``signed/<system>/`` and return its path. Raises Rejected for an unusable key,
    OSError if nothing can be written."""
    told = baseline_of(case, who=who, signed_on=today.isoformat(), until=until.isoformat())
    folder = signed / case.system
    number = 1 + max((_number(path) for path in folder.glob("*.json")), default=0)
    path = folder / f"{number:04d}-{today.isoformat()}.json"
    predicate = {
        "as": who,
        "signedOn": today.isoformat(),
        "until": until.isoformat(),
        "system": case.system,
        "says": case.answers.statement,
        "assumes": [f"{s.number} ({s.sort}): {s.words}" for s in case.assumptions],
        "baseline": to_json(told),
    }
    statement: dict[str, Any] = {
        "_type": "https://in-toto.io/Statement/v1",
        "subject": [
            {"name": f"case/{case.system}", "digest": {"sha256": told.content}},
            {"name": "report.json", "digest": {"sha256": digest_file(report)}},
            *({"name": name, "digest": {"sha256": mark}} for name, mark in case.digests),
        ],
        "predicateType": PREDICATE,
        "predicate": predicate,
    }
    write(path, seal(statement, private))
    return path


def newest_signed(signed: Path, system: str) -> tuple[Baseline | None, tuple[str, ...]]:
    """The newest signature of a system's case that verifies, and the reasons why newer ones do not. Raises Rejected for
    a key in ``signed/keys`` that cannot be read."""
    refused: list[str] = []
    for path in sorted((signed / system).glob("*.json"), key=_number, reverse=True):
        found = read_signed(path)
        if isinstance(found, Baseline):
            return found, tuple(refused)
        refused.append(f"{path.name}: {found}")
    return None, tuple(refused)


def read_signed(path: Path) -> Baseline | str:
    """A signature in ``signed/<system>/``, or the reason why it does not count. Raises Rejected as `newest_signed`
    does."""
    system, trusted = path.parent.name, sorted((path.parent.parent / KEYS).glob("*.pub"))
    try:
        opened = unseal(read_regular(path).decode("utf-8"), trusted)
    except (OSError, ValueError) as error:
        return f"it cannot be read: {error}"
    if not isinstance(opened, Opened):
        return opened
    predicate = opened.statement.get("predicate")
    if opened.statement.get("predicateType") != PREDICATE or not isinstance(predicate, dict):
        return "it is no signature of a case in this version's form: sign again"
    try:
        found = from_json(Baseline, predicate.get("baseline"))
    except Unreadable as error:
        return str(error)
    if predicate.get("system") != system:
        return "it is of another system"
    if found.content != content_of(found) or (found.who, found.until) != (predicate.get("as"), predicate.get("until")):
        return "what it names is not what it signs"
    return replace(found, name=path.name, checked=opened.checked, says=str(predicate.get("says", "")))


def _number(path: Path) -> int:
    text = path.name.partition("-")[0]
    return int(text) if text.isascii() and text.isdigit() else 0
