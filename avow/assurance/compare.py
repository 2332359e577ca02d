"""What changed between two cases: claims, their meaning, statuses, gates, requirements."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from avow.assurance.model import Case
from avow.assurance.naming import requirement_claim
from avow.evidence.ledger import Entry
from avow.evidence.record import Evidence
from avow.evidence.status import Status, roll_up


@dataclass(frozen=True, slots=True)
class Snapshot:
    """What can be compared: claim → (digest of its meaning, status). Gates where there are any."""

    name: str
    claims: Mapping[str, tuple[str, Status]]
    gates: Mapping[str, bool]


@dataclass(frozen=True, slots=True)
class Change:
    """One difference. `kind` is one of ``added``, ``removed``, ``meaning``, ``better``, ``worse``, ``gate``."""

    kind: str
    subject: str
    before: str
    after: str

    @property
    def text(self) -> str:
        match self.kind:
            case "added":
                return f"new: {self.subject} ({self.after})"
            case "removed":
                return f"gone: {self.subject} (was {self.before})"
            case "meaning":
                return f"changed meaning: {self.subject} ({self.before} → {self.after})"
            case "gate":
                return f"gate {self.subject}: {self.before} → {self.after}"
            case _:
                return f"{self.kind}: {self.subject}: {self.before} → {self.after}"


def of_case(case: Case) -> Snapshot:
    claims = {v.id: (v.obligation.digest, v.standing) for v in case.obligations if not v.advice}
    claims |= {requirement_claim(r.id): (r.text + r.formula + r.temporal, r.status) for r in case.requirements}
    return Snapshot(case.system, claims, {gate.title: gate.passed for gate in case.gates})


def of_ledger(name: str, entries: Iterable[Entry]) -> Snapshot:
    """A ledger without its contract: each method's newest record and those that answer the same question count."""
    newest: dict[tuple[str, str], list[Evidence]] = {}
    digests: dict[str, str] = {}
    for entry in entries:
        record = entry.evidence
        pair = (record.obligation, record.method)
        newest[pair] = [*(e for e in newest.get(pair, []) if e.key == record.key), record]
        digests[record.obligation] = record.obligation_digest
    grouped: dict[str, list[Evidence]] = {}
    for (obligation, _), records in newest.items():
        grouped.setdefault(obligation, []).extend(r for r in records if r.obligation_digest == digests[obligation])
    return Snapshot(name, {o: (digests[o], roll_up(records)) for o, records in grouped.items()}, {})


def compare(old: Snapshot, new: Snapshot) -> tuple[Change, ...]:
    """Every difference: what got worse first."""
    changes: list[Change] = []
    for name in dict.fromkeys((*old.claims, *new.claims)):
        if name not in new.claims:
            changes.append(Change("removed", name, old.claims[name][1], ""))
        elif name not in old.claims:
            changes.append(Change("added", name, "", new.claims[name][1]))
        else:
            (meaning, before), (now, after) = old.claims[name], new.claims[name]
            if meaning != now:
                changes.append(Change("meaning", name, before, after))
            elif before is not after:
                changes.append(Change("better" if after.rank > before.rank else "worse", name, before, after))
    word = {True: "passes", False: "fails"}
    for title, passed in new.gates.items():
        if title in old.gates and old.gates[title] != passed:
            changes.append(Change("gate", title, word[old.gates[title]], word[passed]))
    order = ("gate", "worse", "removed", "meaning", "added", "better")
    return tuple(sorted(changes, key=lambda change: order.index(change.kind)))
