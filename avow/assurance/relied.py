"""The record of each guarantee that is relied upon, and what was observed, in words with its bound.

If several records support a claim, one is chosen: first one whose assumptions have neither expired nor been refuted,
then one that is a proof or an exhaustive check, then one of the program itself before one of a model that is no
stronger, then one whose assumptions all have an owner, then of samples the one with the least bound: more evidence
never makes a claim look weaker. A proof of the node's source states assumptions that a proof of a model leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from avow.assurance.answers import Tone
from avow.base.percent import at_least, at_most
from avow.base.plain import count
from avow.base.records import dataclass
from avow.base.verdict import HypothesisKind, Isolation, Object, in_words
from avow.evidence.obligation import Kind, Obligation, ProgramClaim
from avow.evidence.record import AGREES, ISOLATION, RATE, Evidence
from avow.evidence.status import Status, weigh

if TYPE_CHECKING:
    from avow.assurance.model import ObligationView

LETTERS = {"proved": "P", "checked": "C", "tested": "T", "monitored": "M", "reviewed": "R", "justified": "J"}
EXHAUSTIVE = frozenset({Status.PROVED, Status.CHECKED})
SAMPLED = frozenset({Status.TESTED, Status.MONITORED})
EVIDENCE = frozenset({*EXHAUSTIVE, *SAMPLED, Status.REVIEWED})
"""The findings of tools and readers; a reason in the plan is not among them."""


@dataclass(frozen=True, slots=True)
class Judged:
    """The state of one hypothesis of a record: whether it has expired, and whether it has an owner."""

    expired: bool
    owned: bool


@dataclass(frozen=True, slots=True)
class Relied:
    """The record relied upon, the status that it counts as, and its assumptions (hypotheses that are no claims of the
    case)."""

    record: Evidence
    status: Status
    assumptions: tuple[str, ...]
    scenario: frozenset[str] = frozenset()
    """Those of them that are limits of the plan's scenario."""

    @property
    def bounded(self) -> bool:
        """Whether it holds only within a finite scenario or model."""
        return self.status is Status.CHECKED or any(h.kind is HypothesisKind.BOUND for h in self.record.rests_on)


Opinion = Callable[[str, str], Judged]
"""(method, hypothesis) → the state of the hypothesis."""


def relied_upon(view: ObligationView, opinion: Opinion, views: Iterable[ObligationView] = ()) -> Relied | None:
    """None if nothing supports the claim. Of two models, one that the program was compared with (`views`) is
    preferred."""
    if not view.status.supports:
        return None
    ways = []
    records = view.records
    supporting = [(record, status) for record in records if (status := weigh(record).support) is not None]
    used = max((_placed(record) for record, _ in supporting if RATE in record.details), default=0.0)
    for record, status in supporting:
        outdone = record.of is Object.MODEL and any(
            other.of is not Object.MODEL and rank.rank >= status.rank for other, rank in supporting
        )
        way = relied_of(record, status)
        thought = [opinion(record.method, text) for text in way.assumptions]
        badness = (
            any(t.expired for t in thought) or differs(views, view.obligation, record) is not None,
            status not in EXHAUSTIVE,
            outdone,
            not all(t.owned for t in thought),
            -status.rank,
            RATE in record.details and _placed(record) < used,  # the rate counts the worst of the experiments
            _placed(record) if status in SAMPLED else 0.0,
            agrees(views, view.obligation, record.method) is None,
            len(way.assumptions),
            record.method,
        )
        ways.append((badness, way))
    return min(ways, key=lambda way: way[0], default=(None, None))[1]


def relied_of(record: Evidence, status: Status) -> Relied:
    """A record with the status that it counts as, and its assumptions."""
    limits = (h for h in record.rests_on if h.kind is HypothesisKind.BOUND and h.name.startswith("scenario."))
    return Relied(record, status, in_words(record.rests_on, record.hypotheses), frozenset(h.text for h in limits))


def shade(view: ObligationView) -> Tone:
    """A claim's colour: green is for proofs and exhaustive checks."""
    good = Tone.GREEN if view.standing in EXHAUSTIVE else Tone.AMBER
    return good if view.standing.supports else Tone.RED


_APART: Mapping[str, str] = {
    Isolation.SEALED: "run sealed",
    Isolation.PROCESSES: "run in a process of its own",
    Isolation.NONE: "run without isolation",
}
OBJECTS: Mapping[Object, str] = {
    Object.MODEL: "model: what runs may differ",
    Object.SOURCE: "source: the node's program as written",
    Object.BINARY: "binary: the node's program as built",
    Object.RECORDING: "recordings: of its runs",
}
"""The examined objects, explained for new readers."""


def looked_at(relied: Relied) -> Object | None:
    """None for a person's statement."""
    return relied.record.of if relied.status in (*EXHAUSTIVE, Status.TESTED, Status.MONITORED) else None


def agrees(views: Iterable[ObligationView], guarantee: Obligation, method: str) -> Status | None:
    """The status of the claim that the node's program agrees with the model by which a method supports a guarantee;
    None if it was not compared with that model, or not in the outputs that the guarantee is about."""
    compared = _comparison(views, guarantee, method)
    return compared.standing if compared else None


def differs(views: Iterable[ObligationView], guarantee: Obligation, record: Evidence) -> ObligationView | None:
    """The refuted claim by which the node's program is known to differ from the model that a record is of."""
    compared = _comparison(views, guarantee, record.method) if record.of is Object.MODEL else None
    return compared if compared and compared.standing.refuted else None


def _comparison(views: Iterable[ObligationView], guarantee: Obligation, method: str) -> ObligationView | None:
    """The claim that decides whether the program agrees with a method's model. A program that fails where its
    assumptions hold gives no answer there, and its model gives one."""
    of_program = (v for v in views if v.obligation.kind is Kind.PROGRAM and v.obligation.node == guarantee.node)
    claims = {view.obligation.name: view for view in of_program}
    faultless, linked = claims.get(ProgramClaim.FAULTLESS), claims.get(ProgramClaim.LINKED)
    if faultless and faultless.standing.refuted:
        return faultless
    if linked is None:
        return None
    compared = [r.details.get(AGREES) for r in linked.records if weigh(r).support]
    same = any(isinstance(c, Mapping) and guarantee.name in c.get(method, ()) for c in compared)
    return linked if same or not linked.standing.supports else None


def examined(relied: Relied, link: Status | None = None) -> str:
    """The examined object: ``(source in float64)``; empty for a person's statement. `link` is the result of
    `agrees`."""
    match looked_at(relied):
        case None:
            return ""
        case Object.MODEL:
            return f"(model; program agrees: {link.value})" if link else "(model)"
        case Object.SOURCE:
            return f"(source in {relied.record.numbers})"
        case Object.BINARY:
            return f"(binary in {relied.record.numbers})"
        case Object.RECORDING:
            return "(recordings)"


def kept_apart(record: Evidence) -> str:
    """How the program was isolated from the oracle's files and processes, in words; empty if nothing is recorded."""
    return _APART.get(str(record.details.get(ISOLATION, "")), "")


def upper_bound(record: Evidence) -> float | None:
    """The greatest share of cases that may fail, at the record's confidence: if the claim has a condition, among those
    that met it. None if the record gives no such bound."""
    found = [
        float(value)
        for key, value in record.bound.items()
        if isinstance(value, int | float)
        and not isinstance(value, bool)
        and "failure" in key.lower().replace("_", " ")
        and any(word in key.lower() for word in ("below", "at most"))
    ]
    return max(found, default=None)


def judgements(record: Evidence) -> int:
    """The number of cases, runs or judgements that it rests on; 0 if it names none."""
    for key in ("triggered", "judged", "runs", "cases"):
        value = record.bound.get(key)
        if isinstance(value, int) and not isinstance(value, bool):
            return value
    return 0


def weakness(relied: Relied) -> tuple[int, float, int]:
    """Sorts the weakest first: by status, then of all samples the greatest bound on failures."""
    sampled = relied.status in SAMPLED
    return Status.MONITORED.rank if sampled else relied.status.rank, -_placed(relied.record), relied.status.rank


def _placed(record: Evidence) -> float:
    """The bound by which samples are ordered. One without a bound is placed as if its judgements were trials drawn at
    random, at 95 % confidence: an order, no claim."""
    bound, many = upper_bound(record), judgements(record)
    return bound if bound is not None else 1 - 0.05 ** (1 / many) if many else 1.0


def bound_of(relied: Relied) -> str:
    """The number by which samples are ordered, as in ``bound 13 %``; empty if it is no sample."""
    bound = upper_bound(relied.record)
    told = "no bound" if bound is None else f"bound {at_most(bound)}"
    return told if relied.status in SAMPLED else ""


def seen(relied: Relied) -> str:
    """What was observed, with its bound: ``47 runs, 0 failed (95 % confidence: at most 6.2 % fail)``."""
    bound = relied.record.bound
    match relied.status:
        case Status.PROVED if relied.record.hypotheses:
            return "proved under added hypotheses"
        case Status.PROVED if relied.record.method == "compose":
            return "proved from the nodes' contracts and what is assumed"
        case Status.PROVED:
            return "proved for all inputs that the contract allows"
        case Status.CHECKED if relied.record.method == "compose" and isinstance(bound.get("steps"), int):
            many = count(bound["steps"], "kind of steps", "kinds of steps")
            return f"every run within the plan's scenario was looked at, with {many}"
        case Status.CHECKED:
            states = bound.get("states")
            many = f", with {count(states, 'state')}" if isinstance(states, int) else ""
            return f"every case of a bounded model was looked at{many}"
        case Status.TESTED if isinstance(bound.get("runs"), int):
            failures = bound.get("failures", 0)
            runs, triggered = count(bound["runs"], "run"), bound.get("triggered", bound["runs"])
            of = runs if triggered == bound["runs"] else f"{count(triggered, 'triggered run')} of {bound['runs']}"
            worst = f"; the worst stratum: {bound['worst stratum']}" if "worst stratum" in bound else ""
            return f"{of}, {failures} failed{worst}{_at_most(relied.record, 'runs')}"
        case Status.TESTED if isinstance(bound.get("cases"), int):
            cases, triggered = bound["cases"], bound.get("triggered")
            if isinstance(triggered, int):
                few = "only " if triggered < cases / 2 else ""
                told = f"{few}{triggered} of {count(cases, 'case')} met its condition, none failed"
            else:
                told = f"{count(cases, 'case')}, none failed"
            return told + _at_most(relied.record, "cases")
        case Status.TESTED if isinstance(bound.get("depth"), int):
            return f"searched to step {bound['depth']}, not exhaustively"
        case Status.MONITORED if isinstance(bound.get("judged"), int):
            traces = bound.get("traces")
            on = f" on {count(len(traces), 'recorded run')}" if isinstance(traces, Mapping | list) and traces else ""
            return f"observed {count(bound['judged'], 'time')}{on}, none against it"
        case Status.REVIEWED:
            return "read by a person who accepts it" + (" on conditions" if relied.record.hypotheses else "")
        case _:  # no other status bounds how often it fails
            return f"{relied.status}, without a bound on failures"


def _at_most(record: Evidence, trials: str) -> str:
    """Always with the confidence: without it the bound would seem certain. Only an experiment's runs represent the
    robot's use; a generator draws cases of its own."""
    bound, confidence = upper_bound(record), record.bound.get("confidence")
    if bound is None:
        return ", with no bound on failures"
    if isinstance(confidence, int | float) and not isinstance(confidence, bool):
        sure = f"{at_least(confidence)} confidence"
    else:
        sure = "confidence not recorded"
    of = "" if RATE in record.details else f" of {trials} drawn like these"
    return f" ({sure}: at most {at_most(bound)}{of} fail)"
