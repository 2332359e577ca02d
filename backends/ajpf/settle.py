"""From results for properties to one outcome for each guarantee, in words."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Sized
from dataclasses import dataclass, field

from avow.base.verdict import Counterexample, Link, Outcome, Verdict, bound
from avow.evidence.obligation import Obligation
from avow.evidence.record import IN_PART
from avow.formulas.ltl import TooLarge

from . import psl
from .checker import Property
from .instances import Claim, Instantiation
from .options import Extra, Setup
from .syntax import RECEIVED, Program
from .tautology import is_valid
from .terms import Struct
from .words import together

ENGINE = "Avow's own Gwendolen checker"


@dataclass(frozen=True, slots=True)
class Settled:
    """The result for one property. `verdict` is checked, refuted, unknown, error or not-run."""

    verdict: Verdict
    reason: str = ""
    answer: Verdict | None = None
    """Whether the property as written holds (checked) or fails (refuted) for the agent, if known."""
    vacuous: bool = False
    immediate: bool = False
    valid: bool = False
    """True for every agent, through the table alone."""
    opinions: Mapping[str, str] = field(default_factory=dict)
    """Other engines' answers: ``{"AIL (…)": "does the same run"}``."""


@dataclass(frozen=True, slots=True)
class Frame:
    """The parts that all outcomes of a method share."""

    setup: Setup
    made: Instantiation
    results: Mapping[str, Settled]
    counterexamples: Mapping[str, Counterexample]
    """For some of the refuted properties, by key."""
    bound: Mapping[str, object]


def outcome(obligation: Obligation, claim: Claim, frame: Frame) -> Outcome:
    """The verdict is checked only if every property of the guarantee is."""
    attached = [(e, ps) for e, ps in frame.made.extras if e.guarantee in (claim.guarantee, None)]
    hypotheses = (
        *_left_to_a_person(claim, attached),
        *((claim.hypothesis,) if claim.hypothesis else ()),
        "the plan's table says truly which agent formulas stand for which contract formulas",
        f"percepts become events as in '{frame.setup.semantics}' percept semantics, in the order of their groups",
    )
    limits = (*frame.setup.environment.describe(), *_no_messages(frame.setup.programs))
    late = (bound("deadline", claim.hypothesis),) if claim.hypothesis else ()
    details: dict[str, object] = {"engine": ENGINE, "percept_semantics": str(frame.setup.semantics)}
    if claim.not_covered is not None:
        summary = f"not covered: {claim.not_covered}"
        return Outcome(obligation.id, Verdict.UNKNOWN, summary, details=details, link=Link.MAPPED)
    counted = [*claim.properties, *(p for e, ps in attached if e.counts for p in ps)]
    verdict = _worst(frame.results[p.key].verdict for p in counted)
    stand_ins = [p for e, ps in attached for p in ps if e.name in [left.extra for left in claim.left]]
    own = [*claim.properties, *stand_ins]
    hollow = [p for p in own if frame.results[p.key].vacuous or frame.results[p.key].valid]
    details["properties"] = [_entry(p, frame.results[p.key]) for p in claim.properties]
    optional: dict[str, Sized] = {
        "taken_for_granted": list(claim.granted),
        "left_to_properties": {left.forbidden: left.extra for left in claim.left},
        "settled_by_the_scenario": list(claim.settled),
        "further_properties": [
            {"name": e.name, "counts": e.counts, "because": e.because}
            | {"properties": [_entry(p, frame.results[p.key]) for p in ps]}
            for e, ps in attached
        ],
    }
    details |= {key: value for key, value in optional.items() if value}
    counterexample = None
    if verdict is Verdict.REFUTED:
        shown = (p for p in counted if frame.results[p.key].verdict is Verdict.REFUTED)
        counterexample = next((frame.counterexamples[p.key] for p in shown if p.key in frame.counterexamples), None)
    return Outcome(
        obligation.id,
        verdict,
        _summary(claim, counted, own, attached, verdict, frame),
        counterexample,
        hypotheses,
        {
            **frame.bound,
            "properties": len(counted),
            "indices": list(claim.indices),
            IN_PART: [p.about or p.key for p in hollow],
        },
        details,
        Link.MAPPED,
        vacuous=verdict is Verdict.CHECKED and len(hollow) == len(own),
        rests_on=(*late, *(bound(f"environment.{at}", text) for at, text in enumerate(limits, start=1))),
    )


def _no_messages(programs: Sequence[Program]) -> Iterator[str]:
    plans = (plan for program in programs for plan in program.plans)
    if any(isinstance(p.event.term, Struct) and p.event.term.functor == RECEIVED for p in plans):
        yield "no message ever comes to the agent" if len(programs) == 1 else "no message comes from outside the system"
    if len(programs) > 1:
        yield "agents take turns as AJPF's ActionScheduler has it, in every way; all of them perceive the same"


def _left_to_a_person(claim: Claim, attached: Sequence[tuple[Extra, Sequence[Property]]]) -> Iterator[str]:
    """A property of the plan stands for what the guarantee forbids, whatever the property's trigger is: that the
    trigger is the guarantee's is reported as an assumption. The part that can be decided without the agent is decided.
    """
    for name in dict.fromkeys(left.extra for left in claim.left):
        bans = list(dict.fromkeys(left.ban for left in claim.left if left.extra == name))
        stated = psl.conjunction([p.formula for e, ps in attached for p in ps if e.name == name])
        forbidden = "; ".join(dict.fromkeys(left.forbidden for left in claim.left if left.extra == name))
        if all(_rules_out(stated, ban) for ban in bans):
            found = "it rules out, of every agent, that this comes while the guarantee's condition holds"
        else:
            found = "that it forbids no less than the guarantee does, under the guarantee's condition, was not shown"
        yield f"the plan's property '{name}' says rightly when {forbidden} must not be: {found}"


def _rules_out(stated: psl.Formula, ban: psl.Formula) -> bool:
    try:
        return is_valid(psl.Implies(stated, ban))
    except TooLarge:
        return False


_ORDER = (Verdict.REFUTED, Verdict.ERROR, Verdict.NOT_RUN, Verdict.UNKNOWN)


def _worst(verdicts: Iterable[Verdict]) -> Verdict:
    found = set(verdicts)
    return next((v for v in _ORDER if v in found), Verdict.CHECKED)


def _summary(
    claim: Claim,
    counted: Sequence[Property],
    own: Sequence[Property],
    attached: Sequence[tuple[Extra, Sequence[Property]]],
    verdict: Verdict,
    frame: Frame,
) -> str:
    results = frame.results
    by_verdict = {v: [p for p in counted if results[p.key].verdict is v] for v in (*_ORDER, Verdict.CHECKED)}
    parts = []
    if not counted:
        who = "the scenario and the table settle" if claim.granted else "the plan's scenario alone settles"
        parts.append(f"nothing to check: {who} every instance")
    elif verdict is Verdict.CHECKED:
        parts.append(f"{_count(counted)} {'holds' if len(counted) == 1 else 'hold'} in every reachable state")
    elif verdict is Verdict.REFUTED:
        failing = by_verdict[Verdict.REFUTED]
        parts.append(f"{_some(failing, counted)} fail{'s' if len(failing) == 1 else ''}{_which(failing)}")
    else:
        failing = by_verdict[verdict]
        parts.append(f"{_some(failing, counted)}: {verdict}: {results[failing[0].key].reason}")
    parts += _nothing_shown(own, results)
    for name in dict.fromkeys(left.extra for left in claim.left):
        forbidden = [left.forbidden for left in claim.left if left.extra == name]
        shown = f"{'; '.join(forbidden[:2])}{' …' if len(forbidden) > 2 else ''}"
        parts.append(f"when {shown} must not be is left to '{name}'")
    if claim.granted:
        parts.append(f"the table takes for granted: {', '.join(f'“{text}”' for text in claim.granted)}")
    at_once = [p for p in claim.properties if results[p.key].immediate and results[p.key].verdict is Verdict.CHECKED]
    if at_once:
        parts.append(f"{len(at_once)} hold{'s' if len(at_once) == 1 else ''} at once, the goal coming with the trigger")
    for extra, properties in attached:
        failing = [p for p in properties if results[p.key].verdict is Verdict.REFUTED]
        if failing and not extra.counts:
            parts.append(f"'{extra.name}' (listed, not counted) fails{_which(failing)}")
    if claim.indices:
        parts.append(", ".join(claim.indices))
    parts.append(f"{ENGINE}, {frame.setup.semantics} percepts")
    states = frame.bound.get("states")
    if isinstance(states, int):
        parts[-1] += f", {states} states"
    return "; ".join(parts)


def _nothing_shown(own: Sequence[Property], results: Mapping[str, Settled]) -> Iterator[str]:
    """Triggers that are never met, and tautologies."""
    valid = [p for p in own if results[p.key].valid]
    unmet = [p for p in own if results[p.key].vacuous and not results[p.key].valid]
    every = len(valid) + len(unmet) == len(own)
    if unmet and every and not valid:
        yield "but no trigger is ever met, so that nothing is shown"
    elif unmet:
        yield f"the trigger{_which(unmet)} is never met, so that nothing is shown there"
    if valid and every:
        yield "but the table makes it a tautology, true of every agent with these rules, so that nothing is shown"
    elif valid:
        yield f"the table makes a tautology of the property{_which(valid)}, so that nothing is shown there"


def _count(properties: Sequence[Property]) -> str:
    return "the property" if len(properties) == 1 else f"{len(properties)} properties"


def _some(these: Sequence[Property], all_of_them: Sequence[Property]) -> str:
    every = _count(all_of_them)
    return every if len(these) == len(all_of_them) == 1 else f"{len(these)} of {every}"


def _which(properties: Sequence[Property]) -> str:
    """`` for i = 2, 3, 5`` as far as that helps."""
    return f" for {together((p.about or p.key for p in properties), 6)}"


def _entry(p: Property, result: Settled) -> dict[str, object]:
    entry: dict[str, object] = {
        "key": p.key,
        "instance": p.about,
        "property": psl.show(p.formula),
        "verdict": str(result.verdict),
    }
    if p.trigger is not None:
        entry["vacuous"] = result.vacuous
    optional = {
        "immediate": result.immediate,
        "tautology": result.valid,
        "answer": "" if result.answer in (None, result.verdict) else str(result.answer),
        "reason": result.reason,
        "second_opinions": dict(result.opinions),
    }
    return entry | {key: value for key, value in optional.items() if value}
