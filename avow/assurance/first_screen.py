"""The first screen in words and numbers, computed once; formats only lay it out."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from operator import attrgetter

from avow.assurance.answers import (
    Answers,
    Assumption,
    Changes,
    Deficit,
    Failure,
    Level,
    NodeBasis,
    Sort,
    SupposedLine,
    Tone,
    TrustLine,
    WeakestEvidence,
)
from avow.assurance.changes import MARKS
from avow.assurance.deficits import briefly, of_deficits
from avow.assurance.model import Case, Gate, NodeView, ObligationView, RequirementView
from avow.assurance.naming import cut
from avow.assurance.rates import NO_RATE
from avow.assurance.relied import (
    EVIDENCE,
    EXHAUSTIVE,
    LETTERS,
    OBJECTS,
    Relied,
    agrees,
    bound_of,
    examined,
    looked_at,
    seen,
    weakness,
)
from avow.assurance.summary import refutation
from avow.base.plain import count, listed
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.system.statements import GENERAL

ROWS, WORST, NODES, SQUARES, LINES, OWNERS, REASON = 6, 3, 8, 12, 3, 3, 72
"""The most requirements that have a row each; else the number of the worst, and of refutations; nodes; squares for a
node; changes; owners; characters of a counterexample."""
_FELLED = (Kind.GUARANTEE, Kind.REQUIREMENT, Kind.COMPOSITION, Kind.PROGRAM, Kind.SANITY, Kind.WELL_FORMED)
_WORST_FIRST = tuple(reversed(Level))
_rank = attrgetter("rank")


def tone_of(level: Level, supposed: Iterable[Assumption], *, bounded: bool = False) -> Tone:
    """A requirement's colour. Green is for a requirement shown of the program that runs, without bounds, every
    assumption owned and in date."""
    if not level.holds:
        return Tone.RED
    return Tone.GREEN if level is Level.SHOWN and not bounded and all(s.owned for s in supposed) else Tone.AMBER


def weakest_of(
    claims: Iterable[str],
    views: Mapping[str, ObligationView],
    relied: Mapping[str, Relied],
    titles: Mapping[str, str],
) -> WeakestEvidence | None:
    """The weakest evidence among claims."""
    found = [
        name
        for name in claims
        if name in relied
        and relied[name].status in EVIDENCE
        and views[name].obligation.kind in (Kind.GUARANTEE, Kind.REQUIREMENT)
    ]
    own = [name for name in found if views[name].obligation.kind is Kind.GUARANTEE]
    if not found:
        return None
    name = min(own or found, key=lambda n: (*weakness(relied[n]), n))
    o = views[name].obligation
    return WeakestEvidence(
        name,
        o.node,
        titles.get(o.node, "the whole"),
        relied[name].status.value,
        o.claim.rstrip("."),
        seen(relied[name]),
        bound_of(relied[name]),
    )


def answers(
    requirements: Sequence[RequirementView],
    nodes: Sequence[NodeView],
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    assumptions: Sequence[Assumption],
    deficits: Sequence[Deficit],
    gates: Sequence[Gate],
    weakest: WeakestEvidence | None,
    following: WeakestEvidence | None,
    unneeded: int,
    trusted: tuple[TrustLine, ...],
    *,
    strict: bool,
    passed: bool,
) -> Answers:
    """The content of the first screen, except the signature and what changed since."""
    number = Counter(r.level for r in requirements)
    headline, verdict, tone = _verdict(requirements, gates, strict=strict, passed=passed)
    unrun = next((d.count for d in deficits if d.key == "programs"), 0)
    if unrun and headline.holds:  # the programs were not examined
        verdict = f"{verdict}; {count(unrun, 'claim')} about programs not run"
        tone = min(tone, Tone.AMBER, key=_rank)
    warned = ""
    known = [view for view in views if view.handled and not view.standing.supports]
    if known and passed:  # whatever else holds: with a known-bad finding the case is not green
        of = Counter("remarked" if view.advice else view.standing.value for view in known)
        told = ", ".join(f"{many} {status}" for status, many in of.items())
        warned = f"{count(len(known), 'finding')} against it, which the plan lists: {told}"
        tone = Tone.RED if strict else min(tone, Tone.AMBER, key=_rank)
    by_level = tuple((level, number[level]) for level in _WORST_FIRST if number[level])
    asked = [gate for gate in gates if not gate.idle]
    good = sum(gate.passed for gate in asked)
    relaxed = sum(gate.relaxed for gate in asked)
    idle = f", {relaxed} relaxed by the plan" if relaxed else ""
    idle += f", {off} do{'es' * (off == 1)} not apply" if (off := len(gates) - len(asked)) else ""
    kinds = len(deficits)
    by_node: dict[str, list[ObligationView]] = {node.name: [] for node in nodes}
    for view in views:
        by_node.setdefault(view.obligation.node, []).append(view)
    ranked = [_basis(node, by_node[node.name], relied) for node in nodes]
    basis = [b for b, _ in (sorted(ranked, key=lambda pair: pair[1]) if len(ranked) > NODES else ranked)]
    owned = sum(s.owned for s in assumptions)
    return Answers(
        headline=headline,
        verdict=verdict,
        tone=tone,
        by_level=by_level,
        counts=" · ".join(f"{many} {level}" for level, many in by_level) or "no requirement",
        weakened=of_deficits(kinds) if kinds else "no deficit",
        gates=f"policy: {good} of {count(len(asked), 'gate')} pass" + "es" * (len(asked) == 1) + idle,
        listed=_listed(requirements, relied),
        based_on=tuple(basis[:NODES]),
        bases=tuple(sorted(basis, key=lambda b: b.node)),
        more_nodes=f"and {count(len(basis) - NODES, 'node')} on no less" if len(basis) > NODES else "",
        weakest=weakest,
        next_weakest=(
            f"{following.title}: “{following.quote}”: {following.words}"
            if following and following.status not in EXHAUSTIVE
            else ""
        ),
        refuted=_refuted(requirements, views, nodes),
        unneeded=f"{count(unneeded, 'guarantee')} needed by no requirement or hazard: not compared" if unneeded else "",
        supposed=tuple(_lines(assumptions)),
        owned=f"{owned} of {len(assumptions)}" if assumptions else "",
        changed_against="",
        changed=(),
        signed="not signed",
        statement=_statement(f"{verdict} ({warned})" if warned else verdict, assumptions, kinds),
        warned=warned,
        unrated=_rate(requirements, headline)[1] if headline.holds else "",
        owners=_owners(assumptions),
        weakened_by=briefly(deficits),
        trusted=trusted,
        failures=tuple(
            Failure(gate.title, gate.reason, gate.suggestions[0].text if gate.suggestions else "")
            for gate in gates
            if not gate.passed
        ),
        objects=_objects(views, relied),
    )


def _verdict(
    requirements: Sequence[RequirementView], gates: Sequence[Gate], *, strict: bool, passed: bool
) -> tuple[Level, str, Tone]:
    """The headline, the text beside it on the first line, and its colour: the lowest of the requirements' levels."""

    def said(level: Level, more: str = "") -> str:
        return level.capitalize() + (f": {more}" if more else "")

    if strict and passed:
        return Level.EXAMINED, said(Level.EXAMINED), Tone.GREY
    if refuted := [r.id for r in requirements if r.level is Level.REFUTED]:
        return Level.REFUTED, said(Level.REFUTED, listed(refuted, ROWS)), Tone.RED
    missing = [r for r in requirements if not r.level.holds]
    of_all = f"of {count(len(requirements), 'requirement')}"
    if lost := sum(not r.awaits_validation for r in missing):
        return Level.NOT_SHOWN, said(Level.NOT_SHOWN, f"{lost} {of_all}"), Tone.RED
    if not passed:
        failed = sum(not gate.passed for gate in gates)
        return Level.NOT_SHOWN, said(Level.NOT_SHOWN, f"{count(failed, 'gate')} fail{'s' * (failed == 1)}"), Tone.RED
    if not requirements:
        return Level.EXAMINED, said(Level.EXAMINED, "no requirement is named"), Tone.GREY
    if missing:
        return Level.NOT_SHOWN, said(Level.NOT_SHOWN, f"{len(missing)} {of_all} not validated"), Tone.AMBER
    level = Level.lowest(r.level for r in requirements) or Level.NOT_SHOWN
    tone = min((r.tone for r in requirements), key=_rank)
    brief, _ = _rate(requirements, level)
    return level, said(level) + (f" ({brief})" if brief else ""), tone


def _rate(requirements: Sequence[RequirementView], level: Level) -> tuple[str, str]:
    """The least favourable failure rate, and why none is known; empty if nothing is sampled."""
    rates = [r.rate for r in requirements if r.rate is not None]
    worst = max(rates, key=lambda rate: Fraction(rate.bound or 1), default=None)
    if worst and level not in (Level.TESTS, Level.TESTED_MODELS):
        return NO_RATE, "no sample gives a rate of what a person argues"
    return (worst.brief, worst.lacks) if worst else ("", "")


def _listed(requirements: Sequence[RequirementView], relied: Mapping[str, Relied]) -> tuple[str, ...]:
    """The requirements with a row each: if there are too many, the worst by colour, level, weakest evidence and number
    of assumptions."""
    if len(requirements) <= ROWS:
        return tuple(r.id for r in requirements)

    def badness(view: RequirementView) -> tuple[object, ...]:
        found = relied.get(view.weakest_evidence.claim) if view.weakest_evidence else None
        evidence = weakness(found) if found else (-1,)
        return view.tone.rank, _WORST_FIRST.index(view.level), evidence, -len(view.supposes)

    return tuple(r.id for r in sorted(requirements, key=badness)[:WORST])


def _basis(
    node: NodeView, views: Sequence[ObligationView], relied: Mapping[str, Relied]
) -> tuple[NodeBasis, tuple[int, float]]:
    """A node's line, and how weak it is: its worst colour, then the share with that colour. `views`: the node's."""
    own = [v for v in views if v.obligation.kind is Kind.GUARANTEE]
    others = [v for v in views if v.obligation.kind is not Kind.GUARANTEE and v.status.refuted and not v.advice]
    marks = [(_mark(view, relied), view) for view in own]
    by_object: dict[str, Counter[str]] = {}
    for (said, _), view in marks:
        by_object.setdefault(_examined(view, relied, views), Counter())[said] += 1
    counted = {what: ", ".join(f"{many} {said}" for said, many in of.items()) for what, of in by_object.items()}
    words = "; ".join(" ".join((many, what)).strip() for what, many in counted.items()) or "no guarantees"
    wrong = {v.obligation.kind is Kind.PROGRAM for v in others}
    words += "".join(f"; a check of its {'program' if program else 'contract'} fails" for program in sorted(wrong))
    squares = tuple((LETTERS.get(said, "✘"), tone) for (said, tone), _ in marks)
    worst = min((tone.rank for _, tone in squares), default=Tone.GREEN.rank)
    share = sum(tone.rank == worst for _, tone in squares) / max(1, len(squares))
    return NodeBasis(node.name, node.title, squares if len(squares) <= SQUARES else (), words), (worst, -share)


def _examined(view: ObligationView, relied: Mapping[str, Relied], views: Sequence[ObligationView]) -> str:
    """The examined object, if the claim is relied upon; else empty."""
    if view.id not in relied or not view.standing.supports:
        return ""
    return examined(relied[view.id], agrees(views, view.obligation, relied[view.id].record.method))


def _objects(views: Sequence[ObligationView], relied: Mapping[str, Relied]) -> str:
    """The meaning of the words that name examined objects, for those that the nodes' lines use."""
    shown = [v for v in views if v.obligation.kind is Kind.GUARANTEE and v.id in relied and v.standing.supports]
    used = {looked_at(relied[view.id]) for view in shown}
    return "; ".join(told for what, told in OBJECTS.items() if what in used)


def basis_of(node: NodeView, case: Case) -> NodeBasis:
    """A node's line of the first screen, for any node of a finished case."""
    found = next((b for b in case.answers.bases if b.node == node.name), None)
    return found or NodeBasis(node.name, node.title, (), "no guarantees")


def _mark(view: ObligationView, relied: Mapping[str, Relied]) -> tuple[str, Tone]:
    if view.id not in relied or not view.standing.supports:
        return view.standing.value, Tone.RED
    found = relied[view.id]
    return found.status.value, Tone.GREEN if found.status in EXHAUSTIVE else Tone.AMBER


def felled(views: Iterable[ObligationView]) -> tuple[ObligationView, ...]:
    """The refuted claims, the first of each node and of the whole system: a guarantee before the claims that rest on
    it."""
    first: dict[str, ObligationView] = {}
    wrong = (v for v in views if v.status.refuted and not v.advice)
    for view in sorted(wrong, key=lambda v: (_FELLED.index(v.obligation.kind), v.obligation.node == SYSTEM_LEVEL)):
        first.setdefault(view.obligation.node, view)
    worst, others = tuple(first.values())[:1], tuple(first.values())[1:]
    return (*worst, *sorted(others, key=lambda v: v.obligation.node != SYSTEM_LEVEL))


def _refuted(
    requirements: Sequence[RequirementView], views: Sequence[ObligationView], nodes: Sequence[NodeView]
) -> str:
    """The refutations with their counterexamples, and the requirements that do not hold. Empty if nothing is
    refuted."""
    wrong = sum(v.status.refuted and not v.advice for v in views)
    if not wrong:
        return ""
    titles = {node.name: node.title for node in nodes}
    shown = felled(views)[:WORST]
    told = [
        f"{titles.get(v.obligation.node, 'the whole')}: “{v.obligation.claim.rstrip('.')}”"
        f" ({cut(refutation(v)[1], REASON)})"
        for v in shown
    ]
    more = f"; and {count(wrong - len(shown), 'more claim')}, {wrong} in all" if wrong > len(shown) else ""
    names = {level: [r.id for r in requirements if r.level is level] for level in (Level.REFUTED, Level.NOT_SHOWN)}
    takes = "".join(f" Requirements {level}: {listed(of, 6)}." for level, of in names.items() if of)
    return "Refuted: " + "; ".join(told) + f"{more}.{takes}"


def _lines(assumptions: Sequence[Assumption]) -> Iterable[SupposedLine]:
    for sort in Sort:
        of_sort = [s for s in assumptions if s.sort is sort]
        if of_sort:
            most = max(of_sort, key=lambda s: (s.expired, bool(s.says), _ideal(s), len(s.needed_by)))
            others = tuple(s.number for s in of_sort if s is not most)
            yield SupposedLine(sort, len(of_sort), most.words, most.number, others)


def _ideal(assumption: Assumption) -> int:
    """Ranks what a model leaves out (a reaction takes no time) before what a plan adds: its reader is the last to think
    of it."""
    return list(GENERAL).index(assumption.key) if assumption.general else -1


def _owners(assumptions: Sequence[Assumption]) -> str:
    """``A. Person (3), B. Person (1), assumed since 2026-11-21; the first ends 2027-01-31``, and others."""
    owned = [s for s in assumptions if s.owned]
    number = Counter(s.who for s in owned).most_common()
    if not number:
        return ""
    ends = sorted({s.until for s in owned if s.until})
    named = listed([f"{who} ({many})" if len(number) > 1 else who for who, many in number], OWNERS)
    made = sorted({s.date for s in owned})
    since = f", assumed since {' to '.join(dict.fromkeys((made[0], made[-1])))}" if all(made) else ""
    all_end = len(ends) == 1 and all(s.until for s in owned)
    until = f", until {ends[0]}" if all_end else f"; the first ends {ends[0]}" if ends else ""
    lasting = sum(not s.until for s in owned)
    unneeded = sum(not s.needed_by for s in assumptions)
    counts = {f"end{'s' * (lasting == 1)} when a text changes": lasting, "needed by no requirement": unneeded}
    return f"{named}{since}{until}" + "".join(f"; {many} {what}" for what, many in counts.items() if many)


def _changed(changes: Changes) -> tuple[tuple[str, str], ...]:
    if not changes.against:
        return (("", "None has been signed."),)
    edits = [e for e in changes.entries if e.kind in ("edit", "meaning")][:1]  # the cause before what came of it
    ordered = [*edits, *(e for e in changes.entries if e not in edits)]
    shown = [(MARKS.get(e.kind, "▼"), e.words) for e in ordered]
    if len(shown) > LINES:
        left = ordered[LINES - 1 :]
        better = sum(e.kind == "better" for e in left)
        shown = [*shown[: LINES - 1], ("…", f"{len(left)} more" + (f", {better} of them better" if better else ""))]
    if not shown:
        shown = [("=", "Nothing.")]
    again = [("⟲", f"re-run: {count(changes.again, 'guarantee')}, same answer")] * bool(changes.again)
    return (*shown, *(again if not changes.entries else ()))


def with_signature(case: Case) -> Answers:
    """The answers, with the changes since the last signature, the signature line (the signer, and whether the case is
    still the signed one), and of a signed case the sentence that was signed."""
    signed, said, against = _signed(case), case.baseline.says if case.baseline else "", case.changes.against
    kept = said if signed.startswith("signed") and said else case.answers.statement
    head = f"Against the report signed by {against}:" if against else ""
    return replace(case.answers, signed=signed, statement=kept, changed_against=head, changed=_changed(case.changes))


def _signed(case: Case) -> str:
    if (baseline := case.baseline) is None:
        return "not signed"
    same = not case.changes.entries and case.answers.verdict == baseline.verdict
    if same and baseline.until and baseline.until < case.today:
        return f"not signed; what {baseline.who} signed on {baseline.signed_on} stood until {baseline.until}"
    until = f" until {baseline.until}" if baseline.until else ""
    if same:
        return f"signed by {baseline.who} on {baseline.signed_on}{until}"
    edits = (e.subject.rpartition("/")[2].partition(":")[0] for e in case.changes.entries if e.kind == "edit")
    since = f"; since then: {listed(names, 2)}" if (names := list(dict.fromkeys(edits))) else ""
    return f"not signed: {baseline.who} signed another state on {baseline.signed_on}{since}"


def _statement(verdict: str, assumptions: Sequence[Assumption], kinds: int) -> str:
    if not assumptions:
        accepted = "it rests on no assumptions"
    elif len(assumptions) == 1:
        accepted = "I accept assumption A1 as listed"
    else:
        accepted = f"I accept assumptions A1 to A{len(assumptions)} as listed"
    known = f"I know of the {of_deficits(kinds)}" if kinds else "no deficit is known"
    return f"By signing I say: I agree with the verdict “{verdict}”, {accepted}, and {known}."
