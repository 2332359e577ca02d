"""Recorded proofs of the calculus are not trusted: the kernel re-establishes each in every run.

A record of the calculus keeps the certificates beside it, as hints. This module decides from the current contract and
plan whether a record still counts. If the kernel does not establish its claim under its key, the record counts as
stale, and the claim is re-run.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from dataclasses import field
from pathlib import Path

from avow.assurance.certification import KernelRun
from avow.base.codec import Unreadable, from_text, to_json
from avow.base.files import read_text, sha256
from avow.base.records import dataclass
from avow.base.tuning.effort import KERNEL_SECOND_ALL
from avow.base.verdict import Verdict
from avow.calculus.certificates import Certificates
from avow.calculus.composition import compose
from avow.calculus.obligations import reestablished
from avow.evidence.claims import Reestablished
from avow.evidence.currency import as_of_now, not_established, stands
from avow.evidence.ledger import Entry, Ledger
from avow.evidence.record import Evidence
from avow.kernel.certificate import Certificate
from avow.kernel.solvers import Solvers
from avow.pipeline.engine_code import trusted_parts
from avow.pipeline.run_info import Run
from avow.pipeline.work import COMPOSE, texts_digest
from avow.solving.apart import Apart, Both, versions
from avow.system.plan import System

FILE = "certificates.json"


@dataclass(slots=True)
class Checked:
    """What the kernel established in a run for one system as it is now (`Run.checked`).

    `kernels`: one for each file of certificates, by its digest."""

    texts: str
    kernels: dict[str, Certificates] = field(default_factory=dict)
    solvers: Solvers = field(default_factory=lambda: Solvers(z3=Apart("z3")))
    answers: dict[tuple[str, str, str], Reestablished | None] = field(default_factory=dict)
    runs: dict[str, KernelRun] = field(default_factory=dict)
    counting: tuple[tuple[object, ...], tuple[Entry, ...]] | None = None
    """A ledger's path, head and length, and its entries that count."""


def written(certificates: Certificates) -> str:
    """The certificates made, as the text that is kept beside the evidence."""
    return json.dumps(to_json(certificates.made), sort_keys=True)


def still_counts(record: Evidence, root: Path, system: System, run: Run) -> bool:
    """Whether a record is as good as when it was made."""
    return stands(record, root) and _established(record, root, system, run)


def counting_now(ledger: Ledger, root: Path, system: System, run: Run) -> tuple[Entry, ...]:
    """The entries; those that no longer count get an unused key. Computed once in a run for the same ledger, so that a
    run's answers are of one moment."""
    checked, state = _checked(system, run), (ledger.path, ledger.head, len(ledger.records()))
    if checked.counting is None or checked.counting[0] != state:
        counting = tuple(
            entry if _established(entry.evidence, root, system, run) else not_established(entry)
            for entry in as_of_now(ledger, root)
        )
        checked.counting = state, counting
    return checked.counting[1]


def kernel_run(entries: Sequence[Entry], root: Path, system: System, run: Run) -> KernelRun:
    """What the kernel establishes in this run of the calculus' proofs, by cvc5 as well if it is installed, within the
    given number of its steps. Computed once in a run for the same entries."""
    records = [e.evidence for e in entries if e.evidence.method == COMPOSE and e.evidence.verdict is Verdict.PROVED]
    records = [r for r in records if isinstance(r.details.get("certificate"), dict)]
    texts = {_kept(r): _kept_text(r, root) for r in records}
    asked = sha256(json.dumps([run.id, [[r.obligation, r.key, r.details["certificate"]] for r in records], texts]))
    checked = _checked(system, run)
    if asked not in checked.runs:
        # Z3's answers first: cvc5 only gets what Z3 established
        good = [r for r in records if _holds(r, root, system, run) is not None]
        checked.runs[asked] = _twice(good, texts, system, run.id, checked.solvers)
    return checked.runs[asked]


def _twice(records: Sequence[Evidence], texts: dict[str, str], system: System, run: str, asked: Solvers) -> KernelRun:
    found: dict[str, Reestablished] = {}
    used: dict[str, object] = {}
    composition = compose(system)
    with Both(KERNEL_SECOND_ALL, asked.known) as solvers:
        each = {text: Certificates(composition, _read(text), solvers=solvers) for text in texts.values()}
        for record in records:
            certificates = each[texts[_kept(record)]]
            one = reestablished(certificates, record.obligation)
            if one is not None and one.key == record.details["certificate"].get("key"):
                found[record.obligation] = one
                if one.scope in certificates.kept:  # a loop without claims needs no certificate
                    used[one.scope] = to_json(certificates.kept[one.scope])
    version = f"{sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}"
    parts = (*trusted_parts(), ("Python", version))
    return KernelRun(run, tuple(found[name] for name in sorted(found)), versions(), used, parts)


def _checked(system: System, run: Run) -> Checked:
    texts = texts_digest(system)
    checked = run.checked.get(system.plan.root)
    if checked is None or checked.texts != texts:
        checked = run.checked[system.plan.root] = Checked(texts)
    return checked


def _kept(record: Evidence) -> str:
    """The file of certificates that a record keeps; empty if it needs none, as a loop without claims."""
    return next((path for path in record.outputs if path.endswith(f"/{FILE}")), "")


def _kept_text(record: Evidence, root: Path) -> str:
    path = _kept(record)
    try:
        return read_text(root / path) if path else ""
    except (OSError, UnicodeDecodeError):
        return ""


def _established(record: Evidence, root: Path, system: System, run: Run) -> bool:
    if record.method != COMPOSE or record.verdict is not Verdict.PROVED:
        return True
    return isinstance(record.details.get("certificate"), dict) and _holds(record, root, system, run) is not None


def _holds(record: Evidence, root: Path, system: System, run: Run) -> Reestablished | None:
    """What the kernel establishes for a record with a certificate, provided its key is the record's."""
    told, text, checked = record.details["certificate"], _kept_text(record, root), _checked(system, run)
    question = (record.obligation, str(told.get("key")), sha256(text))
    if question not in checked.answers:
        certificates = checked.kernels.get(question[2])
        if certificates is None:
            kept = Certificates(compose(system), _read(text), solvers=checked.solvers)
            certificates = checked.kernels[question[2]] = kept
        found = reestablished(certificates, record.obligation)
        checked.answers[question] = found if found is not None and found.key == told.get("key") else None
    return checked.answers[question]


def _read(text: str) -> dict[str, Certificate]:
    """Text that cannot be read is no certificate."""
    try:
        return from_text(dict[str, Certificate], text)
    except Unreadable:
        return {}
