"""Is a system's ledger intact? Gathers every finding for the gates and for ``avow audit``."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime

from avow.backend_kit.registry import backend, names
from avow.base.files import sha256
from avow.base.workspace import Workspace
from avow.evidence.audit import Discrepancy, Fault, audit
from avow.evidence.continuity import acknowledged, began, continuity
from avow.evidence.heads import GENESIS, Anchor, Event, Index, index_path, note, read_index, stated_heads
from avow.evidence.ledger import Damage, Ledger
from avow.pipeline.workload import Survey


def discrepancies(
    workspace: Workspace, ledger: Ledger, surveyed: Survey | None, anchors: Sequence[Anchor] = (), strict: bool = False
) -> tuple[Discrepancy, ...]:
    """Everything that the audit finds. Without a survey (a contract that cannot be read) keys are not compared, and the
    audit reports that. `anchors` name heads that the ledger must hold. Raises OSError."""
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
    known = _known_damage(ledger, index)
    found = tuple(replace(d, serious=False) if d.subject in known else d for d in found)
    return (*continuity(ledger, index, anchors), *found, *unread)


def _known_damage(ledger: Ledger, index: Index) -> frozenset[str]:
    """The damaged lines that a person has acknowledged, as the audit names them; none as soon as one differs."""
    statement = acknowledged(index, ledger.path.stem)
    if statement is None:
        return frozenset()
    old = [d for d in ledger.damage if d.line <= statement.records]
    return frozenset(f"line {d.line}" for d in old) if _state(old) == statement.state else frozenset()


def _state(damage: Sequence[Damage]) -> str:
    return sha256(json.dumps([[d.line, d.reason] for d in damage]))


def settle_losses(workspace: Workspace, system: str, who: str, why: str) -> tuple[Discrepancy, ...]:
    """Note in the index that a person has seen what is lost or damaged in a ledger. Returns what was open; writes
    nothing if nothing was. Raises OSError."""
    ledger, path = Ledger(workspace.ledger(system)), index_path(workspace.ledgers)
    acknowledge(workspace, ledger)
    index, anchors = read_index(path), reported_heads(workspace, system)
    known = _known_damage(ledger, index)
    lines = [d for d in ledger.damage if f"line {d.line}" not in known]
    found = [d for d in continuity(ledger, index, anchors) if d.serious]
    found += [Discrepancy(Fault.LEDGER, f"line {d.line}", f"ledger line {d.line} {d.reason}") for d in lines]
    if not found:
        return ()
    if index.damage:
        path.rename(path.with_name(f"{path.name}.damaged-{datetime.now(UTC):%Y%m%dT%H%M%S%f}"))
        for other in index.systems:  # keep what is known about the others
            for statement in index.of(other):
                more = {"note": statement.note, "state": statement.state} if statement.note else {}
                note(path, statement.event, other, statement.records, statement.head, **more)
    ledger.accept_end()
    entries, damage = ledger.records(), ledger.damage
    head = entries[-1].hash if entries else GENESIS
    lines_now = max([e.number + 1 for e in entries] + [d.line for d in damage], default=0)
    note(path, Event.ACKNOWLEDGED, system, lines_now, head, note=f"{who}: {why}", state=_state(damage))
    return tuple(found)


def _unread(system: str) -> Discrepancy:
    text = f"there is no contract of {system} that can be read: its records were not compared with today's claims"
    return Discrepancy(Fault.OUTDATED, system, text, serious=False)


def acknowledge(workspace: Workspace, ledger: Ledger) -> None:
    """Before a new report replaces the old one, keep in the index what the old one says about the ledger and is not so.
    Otherwise the next run could not know it. Raises OSError."""
    system, path = ledger.path.stem, index_path(workspace.ledgers)
    entries = ledger.records()
    if not entries:
        return
    known = {*(entry.hash for entry in entries), *(s.head for s in read_index(path).of(system))}
    for anchor in reported_heads(workspace, system):
        if anchor.head not in known:
            event = Event.LOST if began(read_index(path), system) else Event.REACHED
            note(path, event, system, 0, anchor.head)
    if not read_index(path).of(system):  # made by an older version, or the index was deleted: reported from now on
        note(path, Event.REACHED, system, entries[-1].number + 1, entries[-1].hash)


def confirm(workspace: Workspace, ledger: Ledger) -> None:
    """Note the ledger's length, unless it is another ledger than expected. Raises OSError."""
    entries, path = ledger.records(), index_path(workspace.ledgers)
    known = _known_damage(ledger, read_index(path))
    damaged = any(f"line {d.line}" not in known for d in ledger.damage)
    if entries and not damaged and not any(d.serious for d in continuity(ledger, read_index(path))):
        note(path, Event.REACHED, ledger.path.stem, entries[-1].number + 1, entries[-1].hash)


def reported_heads(workspace: Workspace, system: str | None = None) -> tuple[Anchor, ...]:
    """What the reports on disk say about the heads of ledgers, for one system or for all."""
    pattern = f"{system}/report.json" if system else "*/report.json"
    found: list[Anchor] = []
    for file in sorted(workspace.reports.glob(pattern)) if workspace.reports.is_dir() else ():
        try:
            found += stated_heads(file, workspace.relative(file))
        except OSError:  # a report that cannot be read says nothing
            continue
    return tuple(found)
