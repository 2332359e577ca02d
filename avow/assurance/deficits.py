"""The reasons for which a case says less than it seems to: each kind counted once, with its meaning for the reader."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from avow.assurance.answers import Assumption, Deficit, Level
from avow.assurance.hazards import HazardView
from avow.assurance.model import Handled, ObligationView, OpenItem, RequirementView
from avow.assurance.policy import CRITICALITIES
from avow.assurance.relied import EXHAUSTIVE, Relied, looked_at
from avow.base.plain import count
from avow.base.verdict import Link, Object, Verdict
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh

_WORDS = {
    "withdrawn": ("refutation{s} by what the plan no longer uses", "no longer used", "It refuted, and left the plan."),
    "open": ("guarantee{s} without support", "without support", "Missing, unanswered, vacuous or refuted."),
    "premises": ("premise{s} of the composition without support", "open premises", "What follows is conditional."),
    "underrated": (
        "guarantee{s} of lower criticality than a hazard's severity",
        "rated below a hazard",
        "The policy asks less of their nodes than the hazard suggests.",
    ),
    "argued": ("argued, not derived", "argued", "A person must agree that what is named amounts to the sentence."),
    "unvalidated": (
        "sentence{s} without a validation",
        "not validated",
        "Nobody has read the sentence against the formula (`avow validate`).",
    ),
    "models": ("guarantee{s} shown of a model only", "of models", "What runs may differ from the model."),
    "bounded": ("requirement{s} within bounds only", "bounded", "Nothing is said outside what was searched."),
    "unowned": ("assumption{s} without owner or end", "without owner", "Nobody keeps them true, or they never end."),
    "bare": ("assumption{s} without a reason", "without a reason", "No reason says more than the assumption itself."),
    "wordless": (
        "assumption{s} without plain words",
        "without plain words",
        "A reader cannot judge what is accepted; the table of assumptions names the place in the plan.",
    ),
    "sampled": ("claim{s} sampled, not proved", "sampled", "Other inputs and other runs may behave otherwise."),
    "unanswered": ("claim{s} with unanswered inputs", "unanswered", "The evidence says nothing of these inputs."),
    "nan": ("claim{s} broken by NaN or infinity", "broken by NaN", "The contract is about numbers only."),
    "read": ("guarantee{s} on a person's reading only", "only read", "No tool has looked at them."),
    "single": ("guarantee{s} with one method only", "by one method", "An error of that tool would not be noticed."),
    "idle": ("guarantee{s} serving no requirement", "serving none", "No requirement needs them."),
    "tied": (
        "guarantee{s} translated by a person for the tool",
        "translated by a person",
        "Nothing shows that the person's table or measure is right.",
    ),
    "unrun": ("planned method{s} without an answer", "not answered", "A tool is missing, failed or gave no verdict."),
    "programs": (
        "claim{s} about a node's program not run",
        "programs not run",
        "The tool that would run the program is missing: nothing is known of these claims.",
    ),
    "advice": ("open remark{s}", "remarks", "They fail no gate; read them."),
    "excused": ("finding{s} accepted by a person", "excused", "A named person takes responsibility for a finding."),
}
"""For each kind its name, with its number before it; the name on the first screen; and its meaning for the reader. The
weightiest kind comes first: refutations, what lacks support, what lies under a hazard."""


_LEAST = {"catastrophic": "high", "critical": "high", "marginal": "medium", "negligible": "low"}
"""A hazard's severity (MIL-STD-882E, table I) → the least criticality of the nodes that its mitigations rest on."""
SEVERITIES = tuple(_LEAST)
"""Worst first."""


def of_deficits(kinds: int) -> str:
    """``6 kinds of assurance deficit``: the wording that every text uses."""
    return f"{count(kinds, 'kind')} of assurance deficit"


def briefly(found: Iterable[Deficit]) -> str:
    """``2 argued, 19 by one method``."""
    return ", ".join(f"{w.count} {_WORDS[w.key][1]}" for w in found)


def deficits(
    views: Sequence[ObligationView],
    requirements: Sequence[RequirementView],
    assumptions: Sequence[Assumption],
    open_items: Sequence[OpenItem],
    findings: Sequence[Handled],
    relied: Mapping[str, Relied],
    single: Sequence[str],
    hazards: Sequence[HazardView],
    missing: Mapping[tuple[str, str], str],
) -> tuple[Deficit, ...]:
    """Of the whole case, whether or not a requirement rests on it, as in the tables of nodes and of assumptions. The
    weightiest kind is first. `single`: guarantees with one method; `missing`: (node, method) → the command that
    installs the missing tool."""
    guarantees = [v for v in views if v.obligation.kind is Kind.GUARANTEE]
    leaves = [v for v in views if v.obligation.kind in (Kind.GUARANTEE, Kind.REQUIREMENT)]
    unrun = [(v, method) for v in guarantees for method in _unanswered(v)]
    programs = [v for v in views if v.obligation.kind is Kind.PROGRAM and v.status is Status.NOT_RUN]
    found = {
        "withdrawn": [item.claim for item in open_items if item.kind == "withdrawn"],
        "open": [v.id for v in guarantees if not v.standing.supports],
        "premises": [v.id for v in views if v.obligation.kind is Kind.COMPOSITION and not v.standing.supports],
        "underrated": [v.id for v in guarantees if any(v.id in h.closure and _below(v, h) for h in hazards)],
        "argued": [r.id for r in requirements if r.level is Level.ARGUED],
        "unvalidated": [r.id for r in requirements if not r.validated],
        "bounded": [r.id for r in requirements if r.bounded and r.level.holds],
        "models": [v.id for v in guarantees if v.id in relied and looked_at(relied[v.id]) is Object.MODEL],
        "unowned": [s.key for s in assumptions if not s.owned],
        "wordless": [s.key for s in assumptions if not s.says],
        "bare": [s.key for s in assumptions if not s.reasoned],
        "sampled": [v.id for v in views if _status(v, relied) in (Status.TESTED, Status.MONITORED)],
        "unanswered": [v.id for v in leaves if any(_silences(e.entry.evidence.bound) for e in v.counting)],
        "nan": [v.id for v in leaves if any(e.entry.evidence.details.get("no numbers") for e in v.counting)],
        "read": [v.id for v in guarantees if _status(v, relied) is Status.REVIEWED],
        "single": list(single),
        "idle": [v.id for v in guarantees if requirements and not any(v.id in r.closure for r in requirements)],
        "tied": [v.id for v in guarantees if v.id in relied and _by_hand(v, relied[v.id])],
        "unrun": [f"{v.id}: {method}" for v, method in unrun],
        "programs": [v.id for v in programs],
        "advice": [item.claim for item in open_items if item.advice and not item.handled],
        "excused": [name for f in findings if f.how == "accepted" and not f.expired for name in f.obligations],
    }
    silent = [(v, method) for v in programs for method, _ in v.planned]
    most = max((_unanswered_share(v) for v in leaves), default=0)
    share = {"unanswered": f", up to {most} % of them" if most else ""}
    remedies = {"unrun": _install(unrun, missing), "programs": _install(silent, missing)}
    return tuple(
        Deficit(
            key,
            len(claims),
            tuple(claims),
            words_of(key, len(claims)) + share.get(key, ""),
            _WORDS[key][2] + remedies.get(key, ""),
        )
        for key, claims in found.items()
        if claims
    )


def _install(silent: Iterable[tuple[ObligationView, str]], missing: Mapping[tuple[str, str], str]) -> str:
    """The commands that install the missing tools of these methods."""
    found = sorted({missing.get((v.obligation.node, method), "") for v, method in silent} - {""})
    return f" Install: {'; '.join(found)}." if found else ""


def words_of(key: str, number: int) -> str:
    """The name for so many deficits of a kind, without the number; for a kind that no longer exists, its key."""
    return _WORDS[key][0].format(s="" if number == 1 else "s") if key in _WORDS else key


def _status(view: ObligationView, relied: Mapping[str, Relied]) -> Status | None:
    return relied[view.id].status if view.id in relied else None


def _below(view: ObligationView, hazard: HazardView) -> bool:
    known, least = CRITICALITIES, _LEAST[hazard.hazard.severity]
    return view.criticality in known and known.index(view.criticality) > known.index(least)


def _by_hand(view: ObligationView, relied: Relied) -> bool:
    """Whether the records that give the claim its status were linked to the formula by a person, in a table or by
    judgement."""
    sure = relied.status in EXHAUSTIVE
    alike = [r for r in view.records if weigh(r).support is relied.status or (sure and weigh(r).support in EXHAUSTIVE)]
    return relied.status is not Status.REVIEWED and all(record.link is not Link.GENERATED for record in alike)


def _silences(bound: Mapping[str, object]) -> bool:
    """Whether an input had no answer, or none before the end of a trace."""
    return bool(bound.get("unanswered") or bound.get("open"))


def _unanswered_share(view: ObligationView) -> int:
    """The greatest share of a record's drawn inputs that got no answer, in percent, rounded up."""
    bounds = [e.entry.evidence.bound for e in view.counting]
    counts = [(b.get("unanswered"), b.get("cases")) for b in bounds]
    return max((-(-100 * n // of) for n, of in counts if isinstance(n, int) and isinstance(of, int) and of), default=0)


def _unanswered(view: ObligationView) -> Iterator[str]:
    silent = (Verdict.NOT_RUN, Verdict.ERROR, Verdict.UNKNOWN)
    for method, _ in view.planned:
        said = [r.verdict for r in view.records if r.method == method]
        if all(verdict in silent for verdict in said):
            yield method
