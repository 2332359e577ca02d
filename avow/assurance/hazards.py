"""Each hazard with its mitigations: how far each mitigation is shown, and the weakest of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING

from avow.assurance.answers import Level, Tone
from avow.base.records import dataclass
from avow.base.verdict import Object
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh
from avow.system.plan import Hazard

if TYPE_CHECKING:
    from avow.assurance.model import NodeView, ObligationView, RequirementView
    from avow.assurance.relied import Relied

_WORST_FIRST = tuple(level for level in reversed(Level) if level is not Level.EXAMINED)


@dataclass(frozen=True, slots=True)
class Mitigation:
    """One entry under `mitigated_by`."""

    name: str
    """As the hazards' file names it."""
    words: str
    """What it is, for people."""
    level: Level
    """How far it is shown: the least of the claims that it stands for."""
    claims: tuple[str, ...]
    """A requirement's own claims, or the guarantees that the name stands for."""


@dataclass(frozen=True, slots=True)
class HazardView:
    """A hazard with its mitigations. `level` is that of the weakest; *not shown* where there is none."""

    hazard: Hazard
    mitigations: tuple[Mitigation, ...]
    level: Level
    tone: Tone

    @property
    def weakest(self) -> Mitigation | None:
        return min(self.mitigations, key=lambda m: _WORST_FIRST.index(m.level), default=None)

    @property
    def stands(self) -> str:
        """How it stands, in a phrase."""
        weakest = self.weakest
        return f"{self.level} (weakest: {weakest.name})" if weakest else "no mitigation"


def hazard_views(
    hazards: Iterable[Hazard],
    requirements: Sequence[RequirementView],
    views: Sequence[ObligationView],
    relied: Mapping[str, Relied],
    nodes: Sequence[NodeView],
) -> tuple[HazardView, ...]:
    """The hazards in their order. `relied`: claim → the record that it relies on."""
    known = {r.id: r for r in requirements}
    titles = {node.name: node.title for node in nodes}

    def mitigation(name: str) -> Mitigation:
        if name in known:
            return Mitigation(name, known[name].words, known[name].level, known[name].obligations)
        node, slash, method = name.partition("/")
        owner, _, clause = (node if slash else name).partition(".")
        own = [
            view
            for view in views
            if view.obligation.kind is Kind.GUARANTEE
            and view.obligation.node == owner
            and clause in ("", view.obligation.name)
        ]
        levels = [_by_method(view, method) if slash else _level(view, relied.get(view.id)) for view in own]
        if slash:  # a method takes on some of the guarantees only
            taken = [(view, level) for view, level in zip(own, levels, strict=True) if level is not None]
            own, levels = [view for view, _ in taken], [level for _, level in taken]
        level = min((found for found in levels if found), key=_WORST_FIRST.index, default=Level.NOT_SHOWN)
        title = titles.get(owner, owner)
        words = own[0].obligation.claim if clause and own else f"{title}: {method}" if slash else title
        return Mitigation(name, words, level, tuple(view.id for view in own))

    found = []
    for hazard in hazards:
        mitigations = tuple(map(mitigation, hazard.mitigated_by))
        level = min((m.level for m in mitigations), key=_WORST_FIRST.index, default=Level.NOT_SHOWN)
        tone = Tone.RED if not level.holds else Tone.GREEN if level is Level.SHOWN else Tone.AMBER
        found.append(HazardView(hazard, mitigations, level, tone))
    return tuple(found)


def _level(view: ObligationView, relied: Relied | None) -> Level:
    """How far a guarantee is shown, in the words of requirements."""
    if view.standing in (Status.REFUTED, Status.CONTRADICTORY):
        return Level.REFUTED
    if not view.standing.supports or relied is None:
        return Level.NOT_SHOWN
    return _of_status(relied.status, relied.record.of)


def _by_method(view: ObligationView, method: str) -> Level | None:
    """How far one method shows a guarantee; None where the plan does not ask the method about it."""
    if method not in {name for name, _ in view.planned}:
        return None
    weighed = [(weigh(record), record.of) for record in view.records if record.method == method]
    if any(weight.refuted for weight, _ in weighed):
        return Level.REFUTED
    supports = [(weight.support, of) for weight, of in weighed if weight.support is not None]
    if not supports:
        return Level.NOT_SHOWN
    return max((_of_status(status, of) for status, of in supports), key=_WORST_FIRST.index)


def _of_status(status: Status, of: Object | None) -> Level:
    match status:
        case Status.PROVED | Status.CHECKED:
            return Level.MODELS if of is Object.MODEL else Level.SHOWN
        case Status.TESTED | Status.MONITORED:
            return Level.TESTS
        case _:  # reviewed, justified: a person's word
            return Level.ARGUED
