"""Why a case says less than it seems to: each kind counted once, with what a reader should make of it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from avow.assurance.answers import How, Supposition, Weakening
from avow.assurance.model import Handled, ObligationView, OpenItem, RequirementView
from avow.assurance.relied import EXHAUSTIVE, Relied
from avow.base.plain import count
from avow.base.verdict import Link, Verdict
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh

_WORDS = {
    "argued": ("argued, not derived", "A person must agree that the guarantees amount to the sentence."),
    "unconfirmed": (
        "sentence{s} that nobody has confirmed",
        "A changed sentence would not be noticed (`confirmed`).",
    ),
    "bounded": ("derived within bounds only", "Nothing is said outside the finite scenario."),
    "unowned": ("supposition{s} without owner or date", "Nobody is named to keep them true, or they never expire."),
    "sampled": ("guarantee{s} sampled, not proved", "Other inputs and other runs may behave otherwise."),
    "read": ("guarantee{s} on a person's reading only", "No tool has looked at them."),
    "single": ("guarantee{s} with one method only", "An error of that tool would not be noticed."),
    "tied": (
        "guarantee{s} translated by a person for the tool",
        "That a person's table or measure fits is not shown.",
    ),
    "unrun": (
        "planned method{s} without an answer",
        "A tool is missing, gave up or failed; others answer for it.",
    ),
    "conditional": ("review{s} with conditions", "The reviewer names what must be so besides."),
    "advice": ("open remark{s}", "They fail nothing; read them."),
    "excused": ("finding{s} accepted by a person", "Somebody takes responsibility for what is not so."),
    "believed": ("answer{s} from earlier runs", "They were not computed afresh for this report."),
}


_BRIEFLY = {
    "argued": "argued",
    "unconfirmed": "unconfirmed",
    "bounded": "bounded",
    "unowned": "without owner",
    "sampled": "sampled",
    "read": "only read",
    "single": "by one method",
    "tied": "translated by a person",
    "unrun": "not answered",
    "conditional": "reviewed with conditions",
    "advice": "remarks",
    "excused": "excused",
    "believed": "answered earlier",
}
"""The same for the first screen, where it leads to the words."""


def of_weakening(kinds: int) -> str:
    """``6 kinds of weakening``: the one way in which any text counts them."""
    return f"{count(kinds, 'kind')} of weakening"


def briefly(found: Iterable[Weakening]) -> str:
    """``2 argued, 19 by one method``."""
    return ", ".join(f"{w.count} {_BRIEFLY[w.key]}" for w in found)


def weakenings(
    views: Sequence[ObligationView],
    requirements: Sequence[RequirementView],
    suppositions: Sequence[Supposition],
    open_items: Sequence[OpenItem],
    findings: Sequence[Handled],
    relied: Mapping[str, Relied],
    single: Sequence[str],
    basis: Iterable[str],
    run: str,
) -> tuple[Weakening, ...]:
    """`basis`: the obligations that matter (all that requirements rest on); `single`: guarantees with one method."""
    within = set(basis)
    guarantees = [v for v in views if v.id in within and v.obligation.kind is Kind.GUARANTEE]
    found: dict[str, Iterable[str]] = {
        "argued": [r.id for r in requirements if r.how is How.ARGUED],
        "unconfirmed": [r.id for r in requirements if r.how is How.ARGUED and r.confirmed is None],
        "bounded": [r.id for r in requirements if r.how is How.BOUNDED],
        "unowned": [s.key for s in suppositions if not s.owned],
        "sampled": [v.id for v in guarantees if _status(v, relied) in (Status.TESTED, Status.MONITORED)],
        "read": [v.id for v in guarantees if _status(v, relied) is Status.REVIEWED],
        "single": [name for name in single if name in within],
        "tied": [v.id for v in guarantees if v.id in relied and _by_hand(v, relied[v.id])],
        "unrun": [f"{v.id}: {method}" for v in guarantees for method in _unanswered(v)],
        "conditional": [v.id for v in guarantees if _on_conditions(v)],
        "advice": [item.claim for item in open_items if item.kind == "advice" and not item.handled],
        "excused": [name for f in findings if f.how == "accepted" and not f.expired for name in f.obligations],
        "believed": [v.id for v in views if v.id in within and any(e.entry.evidence.run != run for e in v.counting)],
    }
    listed = {key: tuple(claims) for key, claims in found.items()}
    return tuple(_weakening(key, claims) for key, claims in listed.items() if claims)


def _weakening(key: str, claims: tuple[str, ...]) -> Weakening:
    return Weakening(key, len(claims), claims, words_of(key, len(claims)), _WORDS[key][1])


def words_of(key: str, number: int) -> str:
    """What so many weakenings of a kind are called, without the number; of a kind that there is no more, its key."""
    return _WORDS[key][0].format(s="" if number == 1 else "s") if key in _WORDS else key


def _status(view: ObligationView, relied: Mapping[str, Relied]) -> Status | None:
    return relied[view.id].status if view.id in relied else None


def _by_hand(view: ObligationView, relied: Relied) -> bool:
    """Whether what gives the claim its status is tied to the formula by a person, in a table or by judgement."""
    alike = [
        v.entry.evidence
        for v in view.counting
        if weigh(v.entry.evidence).support is relied.status
        or (relied.status in EXHAUSTIVE and weigh(v.entry.evidence).support in EXHAUSTIVE)
    ]
    return relied.status is not Status.REVIEWED and all(record.link is not Link.GENERATED for record in alike)


def _unanswered(view: ObligationView) -> Iterator[str]:
    silent = (Verdict.NOT_RUN, Verdict.ERROR, Verdict.UNKNOWN)
    for method, _ in view.planned:
        said = [v.entry.evidence.verdict for v in view.counting if v.entry.evidence.method == method]
        if all(verdict in silent for verdict in said):
            yield method


def _on_conditions(view: ObligationView) -> bool:
    return any(
        weigh(v.entry.evidence).support is Status.REVIEWED and v.entry.evidence.hypotheses for v in view.counting
    )
