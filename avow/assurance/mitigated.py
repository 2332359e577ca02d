"""Each hazard with its mitigations: how far each mitigation is shown, and the weakest of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from avow.assurance.answers import Assumption, Level, Tone
from avow.assurance.closure import Closure
from avow.assurance.first_screen import tone_of, weakest_of
from avow.assurance.hazards import WORST_FIRST, HazardView, Mitigation
from avow.assurance.model import NodeView, ObligationView, RequirementView
from avow.assurance.naming import requirement_claim
from avow.assurance.relied import Opinion, Relied, relied_upon, weakness
from avow.assurance.requirement_views import failing_of, is_bounded, level_of
from avow.evidence.obligation import Kind
from avow.system.plan import Hazard


def hazard_views(
    hazards: Iterable[Hazard],
    requirements: Sequence[RequirementView],
    views: Mapping[str, ObligationView],
    relied: Mapping[str, Relied],
    closure: Closure,
    supposed: Sequence[Assumption],
    nodes: Sequence[NodeView],
    opinion: Opinion,
) -> tuple[HazardView, ...]:
    """The hazards, the least mitigated first: by level, then by the weakest evidence. Guarantees as mitigations are
    judged like a requirement that rests on them, with everything that they rest on and assume; `relied`: claim → the
    record that it relies on."""
    known = {r.id: r for r in requirements}
    titles = {node.name: node.title for node in nodes}
    clauses = {f"{node.name}.{clause}" for node in nodes for clause, _ in node.guarantees}
    fed = {f"{node.name}.{port}": source for node in nodes for port, source in node.inputs}

    def mitigation(name: str) -> tuple[Mitigation, Tone, Mapping[str, Relied]]:
        if name in known:
            r = known[name]
            return Mitigation(name, r.words, r.level, r.obligations), r.tone, {}
        if name in fed and name not in clauses:
            source = fed[name]
            who = f"only {titles.get(source, source)}" if source else "the environment"
            level, tone = (Level.ARGUED, Tone.AMBER) if source else (Level.NOT_SHOWN, Tone.RED)
            return Mitigation(name, f"in the graph {who} reaches {name}", level, ()), tone, {}
        node, slash, method = name.partition("/")
        owner, _, clause = (node if slash else name).partition(".")
        own = [
            view
            for view in views.values()
            if view.obligation.kind is Kind.GUARANTEE
            and view.obligation.node == owner
            and clause in ("", view.obligation.name)
            and (not slash or method in {planned for planned, _ in view.planned})
        ]
        by = {v.id: one for v in own if (one := _of_method(v, method, opinion))} if slash else relied
        claims = tuple(view.id for view in own)
        level, tone = judged(claims, by)
        title = titles.get(owner, owner)
        words = own[0].obligation.claim if clause and own else f"{title}: {method}" if slash else title
        return Mitigation(name, words, level, claims), tone, {claim: by[claim] for claim in claims if claim in by}

    def judged(own: Sequence[str], by: Mapping[str, Relied]) -> tuple[Level, Tone]:
        """How far guarantees are shown by their records `by`, and by the records of everything that they rest on."""
        closed = closure.of(own)
        mine = [s for s in supposed if not set(closed.claims).isdisjoint(s.where)]
        taken = {name: one for name, one in {**relied, **by}.items() if name not in own or name in by}
        if any(views[name].standing.refuted for name in own):
            return Level.REFUTED, Tone.RED
        if not own or closed.failing or any(name not in taken for name in own) or any(s.expired for s in mine):
            return Level.NOT_SHOWN, Tone.RED
        level = level_of(closed.claims, views, taken)
        bounded = is_bounded(closed.claims, taken) or any(taken[name] != relied[name] for name in own)
        return level, tone_of(level, mine, bounded=bounded)

    found: list[tuple[tuple[object, ...], HazardView]] = []
    for hazard in hazards:
        items = list(map(mitigation, hazard.mitigated_by))
        level = Level.lowest(m.level for m, _, _ in items) or Level.NOT_SHOWN
        tone = min((tone for _, tone, _ in items), key=lambda t: t.rank, default=Tone.RED)
        own = (name for m, _, _ in items for name in ((requirement_claim(m.name),) if m.name in known else m.claims))
        below = closure.of(own)
        taken: dict[str, Relied] = {}  # of a claim that several methods are named for, the weaker record
        for name, one in (pair for _, _, by in items for pair in by.items()):
            taken[name] = min(one, taken.get(name, one), key=weakness)
        by_claim = {**relied, **taken}
        weakest = weakest_of(below.claims, views, by_claim, titles)
        order = weakness(by_claim[weakest.claim]) if weakest else ()
        if not level.holds:
            claims = [claim for m, _, _ in items for claim in m.claims]
            weakest = failing_of(claims, below.failing, views, titles)
        named = tuple(m for m, _, _ in items)
        view = HazardView(hazard, named, level, tone, below.claims, below.failing, weakest)
        found.append(((WORST_FIRST.index(level), order if level.holds else ()), view))
    return tuple(view for _, view in sorted(found, key=lambda pair: pair[0]))


def _of_method(view: ObligationView, method: str, opinion: Opinion) -> Relied | None:
    """The record of one method that may be relied upon for a guarantee; None if one of its assumptions has expired."""
    own = tuple(item for item in view.evidence if item.entry.evidence.method == method)
    found = relied_upon(replace(view, evidence=own), opinion)
    late = found is not None and any(opinion(method, text).expired for text in found.assumptions)
    return None if late else found
