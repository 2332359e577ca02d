"""What the commands about evidence share: which ledgers there are, which reports, and how a claim is looked up."""

from __future__ import annotations

import contextlib
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from avow.assurance.codec import read_case
from avow.assurance.model import Case, ObligationView
from avow.assurance.naming import short
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.suggestions import did_you_mean, suggest
from avow.base.workspace import Workspace, name_of
from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.heads import Anchor, Index, index_path, read_index, stated_heads
from avow.evidence.ledger import Ledger
from avow.evidence.obligation import Kind
from avow.evidence.signing import Signed, sign, signature_path, verify_signature
from avow.pipeline.integrity import confirm, discrepancies
from avow.pipeline.workload import Survey, survey
from avow.system.names import renamed


def ledger_names(place: Workspace, wanted: Sequence[str], anchors: Sequence[Anchor] = ()) -> tuple[str, ...]:
    """The systems named, or all that have a ledger, or had one by what the index of ledgers and `anchors` say. Raises
    Rejected for one that never had any."""
    there = [path.stem for path in place.ledgers.glob("*.jsonl")] if place.ledgers.is_dir() else []
    known = sorted({*there, *_index(place).systems, *(anchor.system for anchor in anchors)})
    wanted = [name_of(place, name) for name in wanted]
    for name in wanted:
        if name not in known:
            raise Rejected(_unknown(f"there is no ledger of a system '{name}'", name, known))
    return tuple(wanted) or tuple(known)


def outside_heads(path: Path) -> tuple[Anchor, ...]:
    """The ledgers' heads that a report or attestation, kept elsewhere, names. Raises Rejected where it names none."""
    try:
        found = stated_heads(path, "")
    except OSError as error:
        raise Rejected(Diagnostic("REPORT001", f"{path} cannot be read: {error.strerror}")) from None
    if not found:
        raise Rejected(Diagnostic("REPORT002", f"{path} names no ledger: it is no report, and no attestation"))
    return found


def audit_system(
    place: Workspace, name: str, public_key: str | None = None, anchors: Sequence[Anchor] = ()
) -> tuple[tuple[Discrepancy, ...], int]:
    """The discrepancies of one system's ledger, and how many records it has. Raises Rejected if it cannot be read."""
    ledger = Ledger(place.ledger(name))
    with readable(ledger.path):
        found = discrepancies(place, ledger, _surveyed(place, name), anchors, strict=True)
        count = len(ledger.records())
    return (*found, *_signature(place.ledger(name), _head_of(ledger), public_key)), count


def _surveyed(place: Workspace, name: str) -> Survey | None:
    for folder in sorted(place.systems(), key=lambda folder: folder.name != name):
        found = survey(folder)
        if isinstance(found, Survey) and found.system.name == name:
            return found
    return None


def audit_index(place: Workspace, public_key: str | None = None) -> tuple[Discrepancy, ...]:
    """What is wrong with the index of ledgers as a whole. Raises Rejected if it cannot be read."""
    path, index = index_path(place.ledgers), _index(place)
    damage = tuple(Discrepancy(Fault.LEDGER, "index", text) for text in index.damage)
    if not index.exists and not public_key:
        return ()
    return (*damage, *_signature(path, Signed("index of ledgers", index.marks), public_key, grows=True))


def _index(place: Workspace) -> Index:
    path = index_path(place.ledgers)
    with readable(path):
        return read_index(path)


@contextlib.contextmanager
def readable(path: Path) -> Iterator[None]:
    """Raises Rejected (``LEDGER001``) for the OSError of a ledger, or their index, that is there and cannot be read."""
    try:
        yield
    except OSError as error:
        raise Rejected(Diagnostic("LEDGER001", f"{path} cannot be read: {error.strerror}")) from None


def _head_of(ledger: Ledger) -> Signed:
    return Signed(ledger.path.stem, tuple(entry.hash for entry in ledger.records()))


def _signature(file: Path, signed: Signed, public_key: str | None, grows: bool = False) -> Iterable[Discrepancy]:
    """With a key of the auditor's own everything must be covered by a signature of it."""
    path = signature_path(file)
    if not path.exists():
        if public_key:
            yield Discrepancy(Fault.SIGNATURE, path.name, f"{path.name}: it is not signed")
        return
    problem, covered = verify_signature(path, signed, Path(public_key) if public_key else None)
    if problem:
        yield Discrepancy(Fault.SIGNATURE, path.name, problem)
    elif covered < len(signed.marks) and not grows:
        text = f"{len(signed.marks) - covered} of {len(signed.marks)} records are newer than the signature"
        yield Discrepancy(Fault.SIGNATURE, path.name, text, serious=bool(public_key))


def sign_all(place: Workspace, systems: Sequence[str], private_key: Path) -> Iterable[Path]:
    """Sign each system's ledger, and the index of ledgers. Raises Rejected."""
    for name in systems:
        ledger = Ledger(place.ledger(name))
        if ledger.damage:
            raise Rejected(Diagnostic("SIGN002", f"{ledger.path.name} is damaged: it is not signed"))
        yield sign(signature_path(ledger.path), _head_of(ledger), private_key)
        confirm(place, ledger)
    path = index_path(place.ledgers)
    yield sign(signature_path(path), Signed("index of ledgers", _index(place).marks), private_key)


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


def unreported(place: Workspace, cases: Sequence[Case]) -> tuple[str, ...]:
    """Systems of the workspace of which there is no report that can be read."""
    folders = sorted(f.name for f in place.contracts.iterdir() if f.is_dir()) if place.contracts.is_dir() else []
    return tuple(name for name in folders if name not in {case.system for case in cases})


def find_claim(
    cases: Sequence[Case], wanted: str, without_report: Sequence[str] = ()
) -> tuple[tuple[Case, ObligationView], ...]:
    """The obligations that a name means: a whole id, one without the system, ``agent.low``, or the end of one.

    Raises Rejected where nothing is called so. `without_report`: systems of which nothing can be known here.
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
    system = wanted.partition("/")[0]
    if system in without_report:
        hint = f"`avow verify {system}` makes one; it says why, if there is something wrong with the system's files"
        raise Rejected(Diagnostic("REPORT001", f"there is no report of {system} yet", hint=hint))
    known = [name for _, view in named for name in (short(view.id), view.id)]
    known += [name for case in cases for name in _others(case)]
    today = renamed(wanted)
    guarantees = [short(view.id) for _, view in named if view.obligation.kind is Kind.GUARANTEE]
    such = f" (such as {guarantees[0]})" if guarantees else ""
    kinds = (
        f"a guarantee{such}, a requirement, node, supposition, gate or file, a diagnostic's code, a word of the report"
    )
    hint = f"did you mean `{today}`?" if today else did_you_mean(wanted, known, 3) or f"known: {kinds}"
    raise Rejected(Diagnostic("LEDGER002", f"nothing in the reports is called '{wanted}'", hint=hint))


def _others(case: Case) -> Iterator[str]:
    """Names in a case that are no obligations'."""
    yield case.system
    yield from (node.name for node in case.nodes)
    yield from (r.id for r in case.requirements)
    yield from (name for s in case.suppositions for name in (s.number, s.key))
    yield from (w.key for w in case.weakenings)
    yield from (gate.id for gate in case.gates)
    yield from (d.derivation.name for d in case.derivations)
    yield from (method.name for method in case.methods)


def _unknown(message: str, name: str, known: Sequence[str]) -> Diagnostic:
    return Diagnostic("LEDGER002", message, hint=did_you_mean(name, known, 3) or suggest(name, known))
