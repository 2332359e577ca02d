"""No proof of the calculus is believed because it was recorded: the kernel establishes it again, in every run.

A record of the calculus keeps the certificates beside it, as hints. Whether a record still counts is decided here from
contract and plan as they are now; a record whose claim the kernel does not establish, with the key that it told, counts
as one of an earlier state, and is asked anew.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, replace
from pathlib import Path

from avow.base.files import digest
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.obligations import established_key
from avow.evidence.currency import as_of_now, stands
from avow.evidence.ledger import Entry, Ledger
from avow.evidence.record import Evidence
from avow.kernel.certificate import Certificate, Malformed, from_json, to_json
from avow.pipeline.work import COMPOSE, texts_digest
from avow.system.plan import System

FILE = "certificates.json"

EXISTENCE = ("start", "joint")
"""What these obligations say is that something is possible: an example shows it, and nothing is derived."""


def written(certificates: Certificates) -> str:
    """The certificates made, as the text that is kept beside the evidence."""
    return json.dumps({scope: to_json(found) for scope, found in sorted(certificates.made.items())}, sort_keys=True)


def still_counts(record: Evidence, root: Path, system: System) -> bool:
    """Whether a record is as good as when it was made."""
    return stands(record, root) and _established(record, root, system)


def counting_now(ledger: Ledger, root: Path, system: System) -> tuple[Entry, ...]:
    """The entries; those that do not count any more with a key that is nobody's."""
    return tuple(
        entry
        if _established(entry.evidence, root, system)
        else replace(entry, evidence=replace(entry.evidence, key=digest(f"not established: {entry.hash}")))
        for entry in as_of_now(ledger, root)
    )


@dataclass(slots=True)
class _Checked:
    """One system as it stands, in this process. `kernels`: one for each file of certificates, by its digest."""

    texts: str
    kernels: dict[str, Certificates] = field(default_factory=dict)
    answers: dict[tuple[str, str, str], bool] = field(default_factory=dict)


_known: dict[Path, _Checked] = {}


def _established(record: Evidence, root: Path, system: System) -> bool:
    if record.method != COMPOSE or record.verdict is not Verdict.PROVED:
        return True
    name = record.obligation.split("/", 3)[-1]
    told = record.details.get("certificate")
    if not isinstance(told, dict):
        return name.split(".")[0] in EXISTENCE
    texts = texts_digest(system)
    checked = _known.get(system.plan.root)
    if checked is None or checked.texts != texts:
        checked = _known[system.plan.root] = _Checked(texts)
    kept = next((root / path for path in record.outputs if path.endswith(f"/{FILE}")), None)
    try:
        text = kept.read_text() if kept is not None else ""
    except OSError:
        return False
    question = (record.obligation, str(told.get("key")), digest(text))
    if question not in checked.answers:
        certificates = checked.kernels.get(question[2])
        if certificates is None:
            certificates = checked.kernels[question[2]] = Certificates(compose(system), _read(text))
        key = established_key(certificates, record.obligation)
        checked.answers[question] = key is not None and key == told.get("key")
    return checked.answers[question]


def _read(text: str) -> dict[str, Certificate]:
    """What cannot be read is no certificate."""
    try:
        data = json.loads(text)
        return {str(scope): from_json(found) for scope, found in data.items()}
    except (ValueError, AttributeError, Malformed):
        return {}
