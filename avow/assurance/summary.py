"""The open items of a case: what a reader has to know before believing the rest."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from avow.assurance.facts import Facts
from avow.assurance.findings import accepts
from avow.assurance.model import Currency, DerivationView, Handled, ObligationView, OpenItem, RequirementView
from avow.assurance.naming import derivation_claim, requirement_claim, short
from avow.assurance.state import ended
from avow.base.plain import count, listed
from avow.base.verdict import Object, Verdict
from avow.evidence.record import CASE, Evidence
from avow.evidence.status import Status, weigh

_PROGRAM = (Object.SOURCE, Object.BINARY)
_WORST_FIRST = (
    Status.CONTRADICTORY,
    Status.REFUTED,
    Status.CIRCULAR,
    Status.VACUOUS,
    Status.PARTIAL,
    Status.ERROR,
    Status.UNKNOWN,
    Status.NOT_RUN,
    Status.STALE,
    Status.MISSING,
    Status.UNWRITTEN,
)


def open_items(
    facts: Facts,
    views: Sequence[ObligationView],
    requirements: Sequence[RequirementView],
    derivations: Sequence[DerivationView],
    findings: Sequence[Handled],
) -> tuple[OpenItem, ...]:
    """Everything that a reader must know before believing the rest, worst first."""
    said: dict[str, str] = {}
    for f in findings:
        for name in f.obligations:
            said[name] = said.get(name) or f.reason
    items = [OpenItem("discrepancy", d.subject, d.text, advice=not d.serious) for d in facts.discrepancies or ()]
    by_status: dict[Status, list[ObligationView]] = {}
    for view in views:
        by_status.setdefault(view.status, []).append(view)
    for status in _WORST_FIRST:
        items += [_open(view, said) for view in by_status.get(status, ()) if not view.advice]
        if status is Status.ERROR:
            items += _failed_attempts(views)
    items += [_vacuous(view) for view in views if view.status is not Status.VACUOUS and _has_vacuous(view)]
    items += [item for view in views if view.status.supports for item in _given_up(view, views)]
    for d in derivations:
        if not d.status.supports and not d.below:
            text = f"the derivation is {d.status.value}: a premise or a side condition stands for nothing"
            items.append(OpenItem(d.status.value, derivation_claim(d.derivation.name), text))
    for r in requirements:
        if not r.status.supports and not r.below:
            items.append(OpenItem(r.status.value, requirement_claim(r.id), r.answer))
    for f in findings:
        if f.unlisted:
            whole = ", ".join(dict.fromkeys((*f.matched, *f.unlisted)))
            text = (
                f"{f.how} as {f.verdict}, it matches what it did not when it was written: {listed(f.unlisted, 12)}; "
                f"if these are meant too, write  matched: [{whole}]"
            )
            items.append(OpenItem("unlisted", f.pattern, text))
        if f.now and f.found:
            text = (
                f"{f.how} as {f.verdict} by {f.who or 'nobody'}, but what is found now is not what was found then; "
                f"if this is meant too, write  found: {f.now}"
            )
            items.append(OpenItem("another finding", f.pattern, text))
        elif f.now and f.how == "accepted":
            supposed = f.verdict == Status.MISSING
            why = (
                "whatever refutes it: for this finding, and no worse one,"
                if not supposed
                else "without its text's mark:"
            )
            text = f"accepted {why} write  found: {f.now}"
            items.append(OpenItem("unmarked", f.pattern, text, advice=not supposed))
        if f.expired:
            text = f"{f.how} by {f.who or 'nobody'} until {f.expires}: {f.reason}"
            items.append(OpenItem("expired", f.pattern, text))
        elif f.how == "accepted" and not (f.obligations or f.now or f.verdict == Status.NOT_RUN or _used(f, views)):
            items.append(
                OpenItem("unused", f.pattern, f"accepted as {f.verdict}, but nothing is so: remove it", advice=True)
            )
    items += [
        OpenItem(
            "advice",
            view.id,
            decisive(view),
            advice=True,
            handled=view.handled,
            title=view.obligation.claim,
            reason=said.get(view.id, ""),
        )
        for view in views
        if view.advice and view.status in (Status.REFUTED, Status.UNKNOWN, Status.ERROR)
    ]
    return tuple(items)


def _used(accepted: Handled, views: Sequence[ObligationView]) -> bool:
    """Whether evidence rests on an assumption that is accepted, or may once a method of its node has run."""
    own = [r for v in views if accepted.pattern.startswith(f"{v.obligation.node}/assumption/") for r in v.records]
    supposed = any(accepts(accepted.pattern, accepted.found, h) for r in own for h in r.rests_on)
    return supposed or any(r.verdict is Verdict.NOT_RUN for r in own)


def _failed_attempts(views: Sequence[ObligationView]) -> Iterable[OpenItem]:
    """A planned method that failed while another one decides the status: otherwise the claim's own line would hide that
    one of two methods never gave an answer. Reported once for each failure, whatever the number of claims."""
    told: dict[tuple[str, str], list[ObligationView]] = {}
    for view in views:
        if view.status is not Status.ERROR and not view.advice:
            for record in view.records:
                if weigh(record).status is Status.ERROR:
                    told.setdefault((record.method, record.summary), []).append(view)
    for (method, summary), failed in told.items():
        first, *others = failed
        stands = f"{short(first.id)} is {first.status.value} by other evidence alone"
        same = f"; the same for {listed([short(view.id) for view in others], 12)}" if others else ""
        title = f"{method} gives no answer: {first.obligation.claim}"
        yield OpenItem(Status.ERROR.value, first.id, f"{method}: {summary} ({stands}{same})", title=title)


def worst_first(names: Iterable[str], statuses: Mapping[str, Status]) -> tuple[str, ...]:
    """The causes of a failure in reading order: those without a status of their own last, and of two equal ones the
    contract's fault first, as nothing follows from a contract that cannot be met."""
    rank = {status: at for at, status in enumerate(_WORST_FIRST)}

    def key(name: str) -> tuple[int, bool]:
        return rank.get(statuses[name], 98) if name in statuses else 99, "/sanity/" not in name

    return tuple(sorted(names, key=key))


def _given_up(view: ObligationView, views: Sequence[ObligationView]) -> Iterable[OpenItem]:
    """A refutation of the claim as it is now, by a method that the plan no longer uses for it, or by one that now reads
    other files or has other options and supports the claim: none of these changes refutes the refutation."""
    for item in view.evidence:
        record = item.entry.evidence
        if record.obligation_digest != view.obligation.digest or not weigh(record).refuted:
            continue
        missed = _no_longer_asked(record, view, views) if item.currency is Currency.STALE else ""
        if item.currency is Currency.WITHDRAWN or missed:
            what = missed or f"uses {record.method} for it"
            text = f"{record.method} refuted it on {record.started[:10]}; the plan no longer {what}"
            yield OpenItem("withdrawn", view.id, text, title=view.obligation.claim)


def _no_longer_asked(refuting: Evidence, view: ObligationView, views: Sequence[ObligationView]) -> str:
    """What the plan no longer has a method do that refuted a claim of the same program; empty if the program, a file or
    the tool is another, or if the refuting case was run again. A recording does not name its program: whether it
    changed is known from the files of the methods that run it."""
    recorded = refuting.of is Object.RECORDING
    entries = [item.entry.evidence for item in view.evidence]
    then = [r for r in entries if r.run == refuting.run or r.started < refuting.started]
    programs = _read(r for r in then if r.of in _PROGRAM) if recorded else {}
    now = _read(r for r in view.records if r.of in _PROGRAM) if recorded else {}
    same = bool(programs.keys() & now.keys())
    for record in (r for r in view.records if r.method == refuting.method and weigh(r).support):
        before, after = (programs, now) if same else (refuting.inputs, record.inputs)
        if any(after.get(path, mark) != mark for path, mark in before.items()):
            continue
        missed = sorted(path for path, mark in refuting.inputs.items() if record.inputs.get(path) != mark)
        if missed and (recorded or record.inputs.items() <= refuting.inputs.items()):
            return f"has it read {listed(missed, 3)}{_relying(missed, refuting, views)}"
        alike = (record.inputs, record.tool_version) == (refuting.inputs, refuting.tool_version)
        if alike and CASE not in refuting.details:
            return "has the options with which it did"
    return ""


def _relying(missed: Sequence[str], refuting: Evidence, views: Sequence[ObligationView]) -> str:
    """How many other claims count evidence from the files by which a claim was refuted."""
    files = {(path, refuting.inputs[path]) for path in missed}
    many = sum(any(files <= r.inputs.items() for r in v.records) for v in views if v.id != refuting.obligation)
    return f", on which {count(many, 'other claim')} still rel{'ies' if many == 1 else 'y'}" if many else ""


def _read(records: Iterable[Evidence]) -> dict[str, str]:
    """The files that the newest of some records, oldest first, depend on."""
    return {path: mark for record in records for path, mark in record.inputs.items()}


def _open(view: ObligationView, said: Mapping[str, str]) -> OpenItem:
    suggestion = view.suggestion.text if view.suggestion and not view.handled else ""
    return OpenItem(
        view.status.value,
        view.id,
        decisive(view),
        suggestion,
        view.handled,
        title=view.obligation.claim,
        reason=said.get(view.id, ""),
    )


def decisive(view: ObligationView) -> str:
    """The decisive evidence in a line: a refutation's counterexample, else the last attempt's summary."""
    if view.obligation.unwritten:
        return "nothing: it is a draft's placeholder"
    method, found = refutation(view)
    if method:
        return f"{method}: {found}"
    telling = [r for r in view.records if weigh(r).status is view.status]
    if telling:
        record = telling[-1]
        return f"{record.method}: {record.summary}"
    if view.evidence:
        record = view.evidence[-1].entry.evidence
        why = ended(view.evidence[-1], view)
        return f"was {record.verdict} by {record.method} on {record.started[:10]}; {why}"
    return "no method is planned for it" if not view.planned else "its methods have not run"


def refutation(view: ObligationView) -> tuple[str, str]:
    """The method that refuted a claim last, and its counterexample, the values that the formula names first, or its
    summary; both empty if none did."""
    record = next((r for r in reversed(view.records) if weigh(r).refuted), None)
    if record is None:
        return "", ""
    example, formula = record.counterexample, view.obligation.formula
    if example is None:
        return record.method, record.summary
    names = {name: formula.find(name) % (len(formula) + 1) for name, _ in example.values}  # -1: after all others
    ordered = replace(example, values=tuple(sorted(example.values, key=lambda value: names[value[0]])))
    return record.method, ordered.text() or record.summary


def _has_vacuous(view: ObligationView) -> bool:
    return any(r.vacuous and r.verdict.supports for r in view.records)


def _vacuous(view: ObligationView) -> OpenItem:
    methods = ", ".join(r.method for r in view.records if r.vacuous)
    return OpenItem(
        "vacuous",
        view.id,
        f"{methods} passed without its trigger ever being met: that supports nothing",
        advice=True,
        title=view.obligation.claim,
    )
