"""Can a system's ledger be believed? All that is known of it, gathered for the gates and for ``avow audit``."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime

from avow.backend_kit.registry import backend, names
from avow.base.workspace import Workspace
from avow.evidence.audit import Discrepancy, Fault, audit
from avow.evidence.continuity import began, continuity
from avow.evidence.heads import Anchor, Event, index_path, note, read_index, stated_heads
from avow.evidence.ledger import Ledger
from avow.pipeline.workload import Survey


def discrepancies(
    workspace: Workspace,
    ledger: Ledger,
    surveyed: Survey | None,
    anchors: Sequence[Anchor] = (),
    strict: bool = False,
) -> tuple[Discrepancy, ...]:
    """Everything that the audit finds. Without a survey (a contract that cannot be read) keys are not compared, and
    that is told. `anchors` name heads that the ledger must hold. Raises OSError."""
    system = ledger.path.stem
    plugins = surveyed.system.plan.plugins if surveyed else ()
    works = surveyed.catalogue.works if surveyed else ()
    planned = {work.engine for work in works if not work.is_engine}
    found = audit(
        ledger,
        workspace.root,
        system=system,
        obligations={o.id: o.digest for o in surveyed.catalogue.obligations} if surveyed else None,
        keys=surveyed.keys if surveyed else None,
        strengths={name: backend(name, plugins).strength for name in (*names(), *planned)},
        engines={(o.id, work.method): work.engine for work in works for o in work.obligations},
        now=datetime.now(UTC),
        strict=strict,
    )
    index = read_index(index_path(workspace.ledgers))
    unread = () if surveyed else (_unread(system),)
    return (*continuity(ledger, index, anchors), *found, *unread)


def _unread(system: str) -> Discrepancy:
    text = f"there is no contract of {system} that can be read: its records were not compared with today's claims"
    return Discrepancy(Fault.OUTDATED, system, text, serious=False)


def acknowledge(workspace: Workspace, ledger: Ledger) -> None:
    """Before a new report takes the place of the old one: what the old one says of the ledger, and is not so, is kept
    in the index. Otherwise the next run could not know of it. Raises OSError."""
    system, path = ledger.path.stem, index_path(workspace.ledgers)
    entries = ledger.records()
    if not entries:
        return
    known = {*(entry.hash for entry in entries), *(s.head for s in read_index(path).of(system))}
    for anchor in reported_heads(workspace, system):
        if anchor.head not in known:
            event = Event.LOST if began(read_index(path), system) else Event.REACHED
            note(path, event, system, 0, anchor.head)
    if not read_index(path).of(system):  # made by an older version, or the index was deleted: told from now on
        note(path, Event.REACHED, system, entries[-1].number + 1, entries[-1].hash)


def confirm(workspace: Workspace, ledger: Ledger) -> None:
    """Note how far the ledger reaches, unless it is not the one that it should be. Raises OSError."""
    entries, path = ledger.records(), index_path(workspace.ledgers)
    if entries and not ledger.damage and not any(d.serious for d in continuity(ledger, read_index(path))):
        note(path, Event.REACHED, ledger.path.stem, entries[-1].number + 1, entries[-1].hash)


def reported_heads(workspace: Workspace, system: str | None = None) -> tuple[Anchor, ...]:
    """What the reports on disk say of ledgers' heads; of one system's, or of all."""
    pattern = f"{system}/report.json" if system else "*/report.json"
    found: list[Anchor] = []
    for file in sorted(workspace.reports.glob(pattern)) if workspace.reports.is_dir() else ():
        try:
            found += stated_heads(file, workspace.relative(file))
        except OSError:  # a report that cannot be read says nothing
            continue
    return tuple(found)
