"""The changes between two cases: requirements with the edits behind each, claims, gates; reasons from the evidence."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import SequenceMatcher
from typing import assert_never

from avow.assurance.answers import Baseline, Level
from avow.assurance.model import Case, Currency, EvidenceView, ObligationView
from avow.assurance.naming import short
from avow.base.diagnostics import Span
from avow.base.plain import listed
from avow.base.tuning.shown import EDIT_CHARACTERS
from avow.evidence.ledger import Entry
from avow.evidence.record import Evidence
from avow.evidence.status import Status, effective, roll_up
from avow.system.statements import GENERAL

ORDER = ("requirement", "gate", "worse", "removed", "assumption", "meaning", "added", "better", "rerun")
"""Kinds of changes, the most important first."""


@dataclass(frozen=True, slots=True)
class Answer:
    """The newest record of one method that counts for a claim; `gone` says why it no longer counts, if so."""

    record: Evidence
    mark: str
    """The ledger line's hash."""
    gone: str = ""


@dataclass(frozen=True, slots=True)
class ClaimFacts:
    """The known facts about a claim besides its status."""

    title: str = ""
    answers: Mapping[str, Answer] = field(default_factory=dict)
    """Method → its newest answer."""
    below: tuple[str, ...] = ()
    """Claims that it rests on and that fail."""
    formula: str = ""
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Required:
    """A requirement: how far it is shown, and every claim below it."""

    words: str
    level: Level
    meaning: str
    formal: str
    closure: tuple[str, ...] = ()
    span: Span | None = None


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The comparable part of a case: claim → (digest of its meaning, status). Requirements and gates if there are
    any."""

    name: str
    claims: Mapping[str, tuple[str, Status]]
    gates: Mapping[str, bool]
    told: Mapping[str, ClaimFacts] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)
    """Gate → the reason why it fails or passes."""
    assumptions: Mapping[str, str] | None = None
    """Key → words; None if nothing is known of them (a bare ledger)."""
    requirements: Mapping[str, Required] = field(default_factory=dict)
    sources: Mapping[str, str] = field(default_factory=dict)
    """Contracts and plan: path → text."""
    signed: bool = False
    """Whether it is the content of a signature: only guarantees among the claims, and no method's answers."""


@dataclass(frozen=True, slots=True)
class Change:
    """One difference. `kind` is one of `ORDER`; ``rerun``: re-run, and the answer is the same."""

    kind: str
    subject: str
    before: str
    after: str
    title: str = ""
    why: tuple[str, ...] = ()
    old_formula: str = ""
    """If the meaning changed: the old and the new formula."""
    new_formula: str = ""

    @property
    def is_worse(self) -> bool:
        """Whether less is shown than before, or more is assumed."""
        if self.kind == "gate":
            return self.after == "fails"
        if self.kind == "requirement":
            return bool(self.before) and _RANK.get(self.after, len(_RANK)) > _RANK.get(self.before, 0)
        if self.kind == "meaning":
            return {self.before, self.after} <= set(Status) and Status(self.after).rank < Status(self.before).rank
        return self.kind in ("worse", "removed", "assumption")

    @property
    def text(self) -> str:
        match self.kind:
            case "requirement":
                moved = f"{self.before or 'new'} → {self.after or 'not claimed any more'}"
                return f"{self.subject}: {f'still {self.after}' if self.before == self.after else moved}"
            case "added":
                return f"new: {self.subject} ({self.after})"
            case "removed":
                return f"gone: {self.subject} (was {self.before})"
            case "meaning":
                return f"changed meaning: {self.subject} ({self.before} → {self.after})"
            case "assumption":
                return f"assumed now: {self.after}" + (f" (was: {self.before})" if self.before else "")
            case "gate":
                return f"gate {self.subject}: {self.before} → {self.after}"
            case "rerun":
                return f"re-run: {self.subject} (still {self.after})"
            case _:  # worse and better have the same form
                return f"{self.kind}: {self.subject}: {self.before} → {self.after}"


_OF_RUN = ("integrity", "certified")
"""Gates about a run's audit: a case that is concluded without a run cannot answer them."""
_RANK: Mapping[str, int] = {level: at for at, level in enumerate(Level)}


def of_case(case: Case) -> Snapshot:
    views = [v for v in case.obligations if not v.advice]
    return Snapshot(
        case.system,
        {v.id: (v.obligation.digest, v.standing) for v in views},
        {g.title: g.passed for g in case.gates if case.audited or g.id not in _OF_RUN},
        {
            v.id: ClaimFacts(v.obligation.claim, _answers(v), v.below, v.obligation.formula, v.obligation.span)
            for v in views
        },
        {g.title: g.reason for g in case.gates},
        {s.key: f"{s.words}{' (expired)' if s.expired else ''}" for s in case.assumptions if not s.general},
        {r.id: Required(r.words, r.level, r.meaning, r.formal, r.closure, r.span) for r in case.requirements}
        | {
            f"hazard {h.hazard.id}": Required(h.hazard.text, h.level, h.meaning, h.meaning, h.closure)
            for h in case.hazards
        },
        {source.path: source.text for source in case.sources},
    )


def of_signature(name: str, signed: Baseline) -> Snapshot:
    """The content of a signature."""
    return Snapshot(
        name,
        {claim: (digest, Status(status)) for claim, digest, status, _, _ in signed.guarantees},
        {title: passed for _, title, passed in signed.gates},
        {claim: ClaimFacts(formula=formula) for claim, _, _, formula, _ in signed.guarantees},
        {},
        {key: words for key, words, _ in signed.assumptions if key not in GENERAL},
        {name: Required(name, Level(level), meaning, formal) for name, meaning, level, formal in signed.requirements}
        | {
            f"hazard {name}": Required(meaning, Level(level), meaning, meaning)
            for name, meaning, level in signed.hazards
        },
        signed=True,
    )


def of_ledger(name: str, entries: Iterable[Entry]) -> Snapshot:
    """A ledger without its contract: each method's newest record and those with the same key count."""
    newest: dict[tuple[str, str], list[Entry]] = {}
    digests: dict[str, str] = {}
    for entry in entries:
        record = entry.evidence
        pair = (record.obligation, record.method)
        newest[pair] = [*(e for e in newest.get(pair, []) if e.evidence.key == record.key), entry]
        digests[record.obligation] = record.obligation_digest
    grouped: dict[str, list[Evidence]] = {}
    answers: dict[str, dict[str, Answer]] = {}
    for (obligation, method), found in sorted(newest.items()):
        counting = [e for e in found if e.evidence.obligation_digest == digests[obligation]]
        grouped.setdefault(obligation, []).extend(e.evidence for e in counting)
        if counting:
            answers.setdefault(obligation, {})[method] = Answer(counting[-1].evidence, counting[-1].hash)
    return Snapshot(
        name,
        {o: (digests[o], roll_up(records)) for o, records in grouped.items()},
        {},
        {o: ClaimFacts("", found) for o, found in answers.items()},
    )


def compare(old: Snapshot, new: Snapshot) -> tuple[Change, ...]:
    """Every difference, the worst first."""
    if old.signed:
        kept = {name: replace(told, answers={}) for name, told in new.told.items() if "/guarantee/" in name}
        new = replace(new, claims={name: new.claims[name] for name in kept}, told=kept)
    changes: list[Change] = []
    for name in dict.fromkeys((*old.claims, *new.claims)):
        before, after = old.told.get(name, ClaimFacts()), new.told.get(name, ClaimFacts())
        title = after.title or before.title
        if name not in new.claims:
            changes.append(Change("removed", name, old.claims[name][1], "", title))
        elif name not in old.claims:
            changes.append(Change("added", name, "", new.claims[name][1], title, tuple(_why(before, after))))
        else:
            (meaning, was), (now, is_) = old.claims[name], new.claims[name]
            why = tuple(_why(before, after))
            if meaning != now:
                changes.append(Change("meaning", name, was, is_, title, why, before.formula, after.formula))
            elif was is not is_:
                changes.append(Change("better" if is_.rank > was.rank else "worse", name, was, is_, title, why))
            elif any(_asked_again(before, after)):
                changes.append(Change("rerun", name, was, is_, title, why))
    changes += list(_requirements(old, new, changes))
    lost = any(change.kind in ("worse", "removed") for change in changes)  # a smaller claim also has fewer assumptions
    changes += (c for c in _assumptions(old, new) if not lost or c.kind != "better")
    word = {True: "passes", False: "fails"}
    for gate, passed in new.gates.items():
        if gate in old.gates and old.gates[gate] != passed:
            reason = (new.reasons[gate],) if new.reasons.get(gate) else ()
            changes.append(Change("gate", gate, word[old.gates[gate]], word[passed], "", reason))
    return tuple(sorted(changes, key=lambda change: ORDER.index(change.kind)))


def _requirements(old: Snapshot, new: Snapshot, changes: Sequence[Change]) -> Iterator[Change]:
    """Each requirement that changed, or below which a claim changed: old and new level, and the edits that may be the
    reason."""
    edits = list(_edits(old, new))
    for name in dict.fromkeys((*old.requirements, *new.requirements)):
        was, now = old.requirements.get(name), new.requirements.get(name)
        reached = {claim for one in (was, now) if one is not None for claim in one.closure}
        moved = [c for c in changes if c.subject in reached and c.kind != "rerun"]
        moved = [c for c in moved if c.kind != "meaning" or c.is_worse or "/guarantee/" in c.subject]
        if not moved and was and now and (was.level, was.meaning) == (now.level, now.meaning):
            continue
        why = ["its text, formula or support is another"] if was and now and was.meaning != now.meaning else []
        why += [text for owners, text in edits if not owners or owners & {*reached, name}]
        why += [f"{short(change.subject)}: {_move(change)}" for change in moved]
        before, after = was.level if was else "", now.level if now else ""
        formal = was.formal if was else "", now.formal if now else ""
        words = (now or was or Required(name, Level.NOT_SHOWN, "", "")).words
        yield Change("requirement", name, before, after, words, tuple(why), *formal)


def _move(change: Change) -> str:
    if change.old_formula != change.new_formula:
        return f"was {change.old_formula}, is {change.new_formula}"
    cause = f" ({change.why[0]})" if change.why else ""
    return f"{change.before or 'new'} → {change.after or 'gone'}{cause}"


def _edits(old: Snapshot, new: Snapshot) -> Iterator[tuple[set[str], str]]:
    """Edits of contract and plan: the claims and requirements whose text contains each (none: others may use it), and
    its position, the old text, and the new text."""
    spans = [(name, told.span) for name, told in new.told.items() if "/guarantee/" in name]
    spans += [(name, required.span) for name, required in new.requirements.items()]
    for path, text in new.sources.items():
        was, now = old.sources.get(path, "").splitlines(), text.splitlines()
        if not old.sources or was == now:
            continue
        for kind, a, b, start, end in SequenceMatcher(None, was, now).get_opcodes():
            if kind != "equal":
                owners = {
                    name
                    for name, s in spans
                    if s and s.file == path and s.line <= max(end, start + 1) and start < s.end_line
                }
                yield owners, f"{path}:{start + 1}: {_lines(was[a:b])} → {_lines(now[start:end])}"


def _lines(lines: Sequence[str]) -> str:
    text = " ".join(line.strip() for line in lines)
    return (text if len(text) <= EDIT_CHARACTERS else f"{text[: EDIT_CHARACTERS - 1]}…") or "(nothing)"


def _assumptions(old: Snapshot, new: Snapshot) -> Iterator[Change]:
    if old.assumptions is None or new.assumptions is None:
        return
    for key, words in new.assumptions.items():
        if old.assumptions.get(key) != words:
            yield Change("assumption", key, old.assumptions.get(key, ""), words)
    for key, words in old.assumptions.items():
        if key not in new.assumptions:
            yield Change("better", key, f"assumed: {words}", "assumed no more")


def _answers(view: ObligationView) -> dict[str, Answer]:
    """For each method its newest record that counts; if none counts, the newest, with the reason why it does not."""
    found: dict[str, Answer] = {}
    for item in view.evidence:
        record = item.entry.evidence
        known = found.get(record.method)
        if item.counts or known is None or known.gone:
            found[record.method] = Answer(record, item.entry.hash, "" if item.counts else _gone(item, view))
    return found


def _gone(item: EvidenceView, view: ObligationView) -> str:
    match item.currency:
        case Currency.STALE if item.entry.evidence.obligation_digest != view.obligation.digest:
            return "the claim means something else now"
        case Currency.STALE:
            return "an input, an option or a tool has changed since"
        case Currency.EXPIRED:
            return "it was given until a day that is past"
        case Currency.WITHDRAWN:
            return "the plan no longer uses the method for this claim"
        case Currency.SET_ASIDE:
            return "this run believed no earlier answer"
        case Currency.CURRENT | Currency.SUPERSEDED:  # current: another answer was preferred to it
            return "a newer answer takes its place"
        case _:
            assert_never(item.currency)


def _asked_again(before: ClaimFacts, after: ClaimFacts) -> Iterator[str]:
    for method, answer in after.answers.items():
        known = before.answers.get(method)
        if known is not None and not answer.gone and known.mark != answer.mark:
            yield method


def _why(before: ClaimFacts, after: ClaimFacts) -> Iterator[str]:
    """The reasons for a difference: the evidence, method by method; then the claims below."""
    for method in dict.fromkeys((*after.answers, *before.answers)):
        yield from _of_method(method, before.answers.get(method), after.answers.get(method))
    came = [name for name in after.below if name not in before.below]
    went = [name for name in before.below if name not in after.below]
    if came:
        yield f"it rests on {listed(list(map(short, came)), 4)}, which {_be(came)} not shown now"
    if went:
        yield f"{listed(list(map(short, went)), 4)}, on which it rested, {_be(went)} no obstacle any more"


def _be(names: Sequence[str]) -> str:
    return "is" if len(names) == 1 else "are"


def _of_method(method: str, old: Answer | None, new: Answer | None) -> Iterator[str]:
    was = old if old is not None and not old.gone else None
    now = new if new is not None and not new.gone else None
    if now is not None and was is None and (old is None or old.mark != now.mark):
        yield f"{method} answers now: {_said(now)}"
    elif now is not None and was is None:
        yield f"{method}'s answer counts again: {_said(now)}"
    elif was is not None and now is None:
        reason = f"does not count any more: {new.gone}" if new is not None else "is not there any more"
        yield f"{method}'s answer ({effective(was.record)}) {reason}"
    elif was is not None and now is not None and was.mark != now.mark:
        changed = listed(list(_changed(was.record, now.record)), 4)
        reason = f"since {changed}" if changed else "with nothing changed that it depends on"
        same = effective(was.record) is effective(now.record)
        answer = f"{effective(now.record)} as before" if same else f"{effective(was.record)} → {_said(now)}"
        yield f"{method} was re-run, {reason}: {answer}"


def _said(answer: Answer) -> str:
    summary = " ".join(answer.record.summary.split())
    return f"{effective(answer.record)}{f', {summary}' if summary else ''}"


def _changed(was: Evidence, now: Evidence) -> Iterator[str]:
    """The inputs of an answer that have changed."""
    if was.obligation_digest != now.obligation_digest:
        yield "the claim means something else"
    for path in dict.fromkeys((*was.inputs, *now.inputs)):
        if was.inputs.get(path) != now.inputs.get(path):
            yield f"{path} {'is new' if path not in was.inputs else 'is gone' if path not in now.inputs else 'changed'}"
    if (was.tool, was.tool_version) != (now.tool, now.tool_version):
        yield f"the tool is another ({was.tool} {was.tool_version} → {now.tool} {now.tool_version})"
    if was.key != now.key and not (was.obligation_digest != now.obligation_digest or was.inputs != now.inputs):
        yield "its options, the scenario, the wiring or a version changed"
