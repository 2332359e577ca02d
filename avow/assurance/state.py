"""The state of a case as plain items: what a signature covers, and what is compared with later cases.

An item is a subject (a requirement, a claim, the policy …) with named values. Whole records (policy, hazards) are taken
field by field, so that a new field is compared without a line here.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Any

from avow.assurance.answers import Baseline
from avow.assurance.model import Case, Currency, EvidenceView, Gate, ObligationView, RequirementView
from avow.assurance.policy import Policy
from avow.assurance.relied import judgements, upper_bound
from avow.base.codec import canonical, to_json
from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.percent import at_most
from avow.evidence.ledger import Entry
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.evidence.status import Status, effective, roll_up
from avow.system.plan import Hazard

Value = tuple[str, ...]
Items = Mapping[tuple[str, str], Mapping[str, Value]]
OF_RECORDS = ("mark", "tool")
"""Values of evidence that another run with the same answer changes: no signature covers them."""
_OF_RUN = ("integrity", "certified")
"""Gates about a run's audit: a case that is concluded without a run cannot answer them."""


@dataclasses.dataclass(frozen=True, slots=True)
class State:
    """`items`: (kind of subject, subject) → name → value. The rest is about today's case only and gives reasons."""

    items: Items = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    """Contracts and plan: path → text."""
    known: frozenset[str] | None = None
    """The kinds of subjects that it can have; None: all."""
    unanswered: frozenset[tuple[str, str]] = frozenset()
    """Subjects that it could not answer."""
    titles: Mapping[str, str] = field(default_factory=dict)
    below: Mapping[tuple[str, str], Sequence[str]] = field(default_factory=dict)
    """Requirement or hazard → every claim below it."""
    spans: Mapping[str, Span] = field(default_factory=dict)
    """Guarantee or requirement → its text's position."""
    reads: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Claim → the files that its evidence depends on."""
    ended: Mapping[str, str] = field(default_factory=dict)
    """Evidence that does not count → the reason."""


def state_of(case: Case) -> State:
    """The state of a case, with its reasons."""
    views = [view for view in case.obligations if not view.advice]
    every = [(view, item) for view in views for item in view.evidence]
    spans = {v.id: v.obligation.span for v in views if v.obligation.kind is Kind.GUARANTEE}
    spans |= {r.id: r.span for r in case.requirements}
    return State(
        *_compared(case),
        None,
        frozenset(("gate", g.title) for g in case.gates if _unanswered(g, case)),
        {view.id: view.obligation.claim for view in views},
        {("requirement", r.id): r.closure for r in case.requirements}
        | {("hazard", h.hazard.id): h.closure for h in case.hazards},
        {name: span for name, span in spans.items() if span is not None},
        {view.id: frozenset(path for r in view.records for path in r.inputs) for view in views},
        {_evidence_name(item.entry.evidence): ended(item, view) for view, item in every if not item.counts},
    )


def state_of_signature(signed: Baseline) -> State:
    """The state that was signed."""
    items: dict[tuple[str, str], dict[str, Value]] = {}
    for about, subject, name, value in signed.items:
        items.setdefault((about, subject), {})[name] = value
    return State(items, dict(signed.sources))


def state_of_ledger(entries: Iterable[Entry]) -> State:
    """A ledger without its contract: each method's newest record and those with the same key count."""
    newest: dict[tuple[str, str], list[Entry]] = {}
    digests: dict[str, str] = {}
    for entry in entries:
        record = entry.evidence
        pair = (record.obligation, record.method)
        newest[pair] = [*(e for e in newest.get(pair, []) if e.evidence.key == record.key), entry]
        digests[record.obligation] = record.obligation_digest
    items: dict[tuple[str, str], Mapping[str, Value]] = {}
    grouped: dict[str, list[Evidence]] = {}
    for (claim, _), found in sorted(newest.items()):
        counting = [e for e in found if e.evidence.obligation_digest == digests[claim]]
        grouped.setdefault(claim, []).extend(e.evidence for e in counting)
        items |= dict(_evidence(counting))
    for claim, records in grouped.items():
        items["claim", claim] = {"status": (roll_up(records).value,), "meaning": (digests[claim],)}
    return State(items, known=frozenset({"claim", "evidence"}))


def baseline_of(case: Case, name: str = "", who: str = "", signed_on: str = "", until: str = "") -> Baseline:
    """The part of a case that is signed, and compared with later cases."""
    subjects, sources = _compared(case)
    items = ((about, subject, name, value) for (about, subject), of in subjects.items() for name, value in of.items())
    found = Baseline(name, who, signed_on, until, "", case.answers.verdict, tuple(items), tuple(sources.items()))
    return replace(found, content=content_of(found))


def content_of(of: Baseline) -> str:
    """SHA-256 of everything that a signature covers."""
    items = sorted([about, subject, name, *value] for about, subject, name, value in of.items if name not in OF_RECORDS)
    return sha256(canonical([of.verdict, items, sorted(map(list, of.sources))]))


def _compared(case: Case) -> tuple[Items, Mapping[str, str]]:
    """The items, without empty values, and the texts of contracts and plan."""
    items = {at: {name: value for name, value in values.items() if any(value)} for at, values in _items(case)}
    return items, {source.path: source.text for source in case.sources}


def _items(case: Case) -> Iterator[tuple[tuple[str, str], Mapping[str, Value]]]:
    yield ("policy", ""), dict(_flat(_fields(case.policy, Policy, "name", "title", "about")))
    for node in case.nodes:
        yield ("node", node.name), {"criticality": (node.criticality,)}
    unproved = {v.id for v in case.obligations if v.status is not Status.PROVED}
    for r in case.requirements:
        yield (
            ("requirement", r.id),
            {
                "level": (r.level.value,),
                "text": (r.text,),
                "formula": (_formula(r, case.obligations),),
                "probability": (r.probability.words if r.probability else "",),
                "supported by": r.supported_by,
                "failure rate": (r.rate.bound if r.rate else "",),
                "weakest evidence": (r.weakest_evidence.bound if r.weakest_evidence else "",),
                "search": (r.searched if unproved.intersection(r.obligations) else "",),  # others: of claims below it
                "source": (r.source,),
            },
        )
    for h in case.hazards:
        yield ("hazard", h.hazard.id), {"level": (h.level.value,), **dict(_flat(_fields(h.hazard, Hazard, "id")))}
    for g in case.gates:
        if not g.idle and not _unanswered(g, case):
            yield ("gate", g.title), {"state": (g.state,)}
    for v in case.obligations:
        if not v.advice:
            told: dict[str, Value] = {"status": (v.standing.value,)}
            if v.obligation.kind is Kind.GUARANTEE:
                told["meaning"] = (v.obligation.digest, v.obligation.formula)
            yield ("claim", v.id), told
            yield from _evidence(view.entry for view in v.counting)
    for s in case.assumptions:
        values = {
            "words": (s.words,),
            "owner": (s.who,),
            "until": (s.until,),
            "expired": (s.until if s.expired else "",),
        }
        yield ("assumption", s.key), values
    for w in case.deficits:
        yield ("deficit", w.key), {"count": (str(w.count),)}
    for f in case.findings:
        values = {"reason": (f.reason,), "owner": (f.who,), "until": (f.expires,)}
        yield (f.how, " ".join(filter(None, (f.pattern, f.verdict, f.method)))), values
    files = dict(case.digests)
    for v in case.obligations:
        for record in v.records if not v.advice else ():
            files |= record.inputs
    for path, mark in sorted(files.items()):
        yield ("file", path), {"digest": (mark,)}


def _unanswered(gate: Gate, case: Case) -> bool:
    return not case.audited and gate.id in _OF_RUN


def _fields(value: object, kind: type, *but: str) -> Mapping[str, Any]:
    """The fields by which two values of a class differ, as plain data."""
    data = to_json(value)
    return {f.name: data.get(f.name) for f in dataclasses.fields(kind) if f.compare and f.name not in but}


def _flat(data: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Value]]:
    """``guarantees.high.one_of`` → its words; what is empty or false has no value."""
    for name, value in data.items():
        where = f"{above}{name}"
        match value:
            case [[str(), _], *_]:
                yield from _flat(dict(value), f"{where}.")
            case Mapping():
                yield from _flat(value, f"{where}.")
            case list():
                yield where, tuple(map(str, value))
            case bool() | None:
                yield where, ("yes",) if value else ()
            case _:  # a text or a number
                yield where, (str(value),)


def _evidence(entries: Iterable[Entry]) -> Iterator[tuple[tuple[str, str], Mapping[str, Value]]]:
    """What each method's newest record shows: its verdict, of what, on how many samples."""
    for entry in {entry.evidence.method: entry for entry in entries}.values():
        record, bound = entry.evidence, upper_bound(entry.evidence)
        of = " ".join(filter(None, (record.of.value, record.numbers if record.numbers != "exact" else "")))
        shown = {
            "verdict": ("vacuous" if record.vacuous else effective(record).value,),
            "object": (of,),
            "judged": (str(judgements(record) or ""),),
            "bound": (f"{bound:.6f}" if bound is not None else "",),
            "mark": (f"{record.run} {entry.hash[:16]}",),
            "tool": (record.tool_told,),
        }
        yield ("evidence", _evidence_name(record)), {name: value for name, value in shown.items() if any(value)}


def _evidence_name(record: Evidence) -> str:
    return f"{record.obligation} {record.method}"


def shown_by(values: Mapping[str, Value]) -> str:
    """``tested (model), 22 judged, at most 12.8 % fail``."""
    told = {name: value[0] for name, value in values.items()}
    parts = [f"{told['verdict']} ({told['object']})" if "object" in told else told["verdict"]]
    parts += [f"{told['judged']} judged"] if "judged" in told else []
    parts += [f"at most {at_most(told['bound'])} fail"] if "bound" in told else []
    return ", ".join(parts)


def _formula(requirement: RequirementView, views: Sequence[ObligationView]) -> str:
    """A requirement's formula with the values of constants; else as its plan states it."""
    own = {
        v.obligation.formula for v in views if v.id in requirement.obligations and v.obligation.name == requirement.id
    }
    return "; ".join(sorted(own - {""})) or requirement.formal


def ended(item: EvidenceView, view: ObligationView) -> str:
    """Why a record does not count."""
    if item.currency is Currency.STALE and item.entry.evidence.obligation_digest != view.obligation.digest:
        return "the claim means something else now"
    return _ENDED[item.currency]


_ENDED = {
    Currency.CURRENT: "another answer was preferred to it",
    Currency.SUPERSEDED: "a newer answer takes its place",
    Currency.STALE: "an input, an option or a tool has changed since",
    Currency.EXPIRED: "it was given until a day that is past",
    Currency.WITHDRAWN: "the plan no longer uses the method for this claim",
    Currency.SET_ASIDE: "this run believed no earlier answer",
}
