"""What the commands about evidence share: which ledgers there are, which reports, and how a claim is looked up."""

from __future__ import annotations

import difflib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from avow.assurance.codec import from_json
from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import short
from avow.diagnostics import Diagnostic, Rejected
from avow.evidence.audit import Discrepancy, Fault, audit
from avow.evidence.encoding import Unreadable
from avow.evidence.ledger import Ledger
from avow.registry import backend, names
from avow.workspace import Workspace


def ledger_names(place: Workspace, wanted: Sequence[str]) -> tuple[str, ...]:
    """The systems named, or all that have a ledger. Raises Rejected for one that has none."""
    known = sorted(path.stem for path in place.ledgers.glob("*.jsonl")) if place.ledgers.is_dir() else []
    for name in wanted:
        if name not in known:
            raise Rejected(_unknown(f"there is no ledger of a system '{name}'", name, known))
    return tuple(wanted) or tuple(known)


def audit_system(place: Workspace, name: str, public_key: str | None = None) -> tuple[tuple[Discrepancy, ...], int]:
    """The discrepancies of one system's ledger, and how many records it has. Raises Rejected if it cannot be read."""
    ledger = Ledger(place.ledger(name))
    try:
        found = audit(ledger, place.root, system=name, strengths={b: backend(b, ()).strength for b in names()})
        count = len(ledger.records())
    except OSError as error:
        raise Rejected(Diagnostic("LEDGER001", f"{place.ledger(name)} cannot be read: {error.strerror}")) from None
    return (*found, *_signature(place, name, ledger, public_key)), count


def _signature(place: Workspace, name: str, ledger: Ledger, public_key: str | None) -> Iterable[Discrepancy]:
    from avow.evidence.signing import signature_path, verify_signature

    path = signature_path(place.ledger(name))
    if not path.exists():
        if public_key:
            yield Discrepancy(Fault.SIGNATURE, path.name, f"{path.name}: the ledger is not signed")
        return
    problem = verify_signature(ledger, Path(public_key) if public_key else None)
    if problem:
        yield Discrepancy(Fault.SIGNATURE, path.name, problem)


def sign_system(place: Workspace, name: str, private_key: Path) -> Path:
    """Sign the ledger's head. Raises Rejected."""
    from avow.evidence.signing import sign

    return sign(Ledger(place.ledger(name)), private_key)


def read_case(path: Path) -> Case:
    """The case of a report (its folder, or report.json). Raises Rejected."""
    file = path / "report.json" if path.is_dir() else path
    try:
        return from_json(json.loads(file.read_text(encoding="utf-8")))
    except OSError as error:
        raise Rejected(Diagnostic("REPORT001", f"{file} cannot be read: {error.strerror}")) from None
    except (ValueError, RecursionError, Unreadable) as error:
        message = f"{file} is no report of this version of Avow: {error}"
        raise Rejected(Diagnostic("REPORT002", message, hint="`doit report` renders it again")) from None


def reported_cases(place: Workspace) -> tuple[Case, ...]:
    """Every report in the workspace that can be read. Raises Rejected where there is none."""
    files = sorted(place.reports.glob("*/report.json")) if place.reports.is_dir() else []
    if not files:
        raise Rejected(Diagnostic("REPORT001", f"no report under {place.reports}", hint="run `avow verify` first"))
    found: list[Case] = []
    faults: list[Diagnostic] = []
    for file in files:
        try:
            found.append(read_case(file))
        except Rejected as rejected:  # of an older version: no reason not to speak of the others
            faults += rejected.diagnostics
    if not found:
        raise Rejected(*faults)
    return tuple(found)


def find_claim(cases: Sequence[Case], wanted: str) -> tuple[tuple[Case, ObligationView], ...]:
    """The obligations that a name means: a whole id, one without the system, ``agent.low``, or the end of one.

    Raises Rejected where nothing is called so.
    """
    named = [(case, view) for case in cases for view in case.obligations]
    for test in (
        lambda view: view.id == wanted,
        lambda view: wanted in (view.obligation.local_id, short(view.id)),
        lambda view: wanted and (view.id.endswith("/" + wanted) or view.obligation.digest.startswith(wanted)),
    ):
        found = tuple((case, view) for case, view in named if test(view))
        if found:
            return found
    known = [name for _, view in named for name in (view.id, short(view.id))]
    raise Rejected(_unknown(f"there is no obligation '{wanted}'", wanted, known))


def _unknown(message: str, name: str, known: Sequence[str]) -> Diagnostic:
    near = difflib.get_close_matches(name, known, n=3)
    hint = f"did you mean {' or '.join(near)}?" if near else (f"known: {', '.join(known[:8])}" if known else None)
    return Diagnostic("LEDGER002", message, hint=hint)
