"""The report's first page with the answers on one screen, and the argument behind them. Neither needs a network."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from avow.assurance.answers import MEANINGS, Assumption, Level, NodeBasis, Tone
from avow.assurance.first_screen import basis_of
from avow.assurance.model import Case, NodeView, ObligationView
from avow.assurance.relied import kept_apart, shade
from avow.assurance.state import baseline_of
from avow.base.plain import count, listed
from avow.base.tuning.shown import NODE_BOXES
from avow.evidence.obligation import Kind
from avow.evidence.record import Evidence
from avow.evidence.status import Status, weigh
from avow.report import wording
from avow.report.goals import doubts
from avow.report.modules import RequirementModule, conditions, node_modules, requirement_modules
from avow.report.page import fill, known_pages, pages
from avow.report.parts import NOTHING_KEPT, Parts
from avow.report.wording import of_nodes

KINDS = 6
"""Kinds of deficit in words on the first screen, the weightiest first: a link counts and explains all."""
_ORDER = (Tone.RED, Tone.AMBER, Tone.GREEN, Tone.GREY)
WORDS = (
    *((level.value, meaning) for level, meaning in MEANINGS.items()),
    *((status.value, wording.MEANINGS[status]) for status in Status if status.supports),
    ("guarantee", "what a node's contract promises, if its assumptions hold"),
    ("assumption", "something that requirements rest on without its being shown"),
    ("deficit", "a reason for which the report says less than it seems to"),
    ("policy, gate", "what this system's owners ask of the evidence, demand by demand"),
    ("open remark", "something to know about a contract or a model; no gate fails for it"),
    ("triggered run", "a run, or case, in which a guarantee's condition was met"),
    ("unanswered input", "an input for which the node gave no output: the evidence says nothing of it"),
    ("percept", "what an agent's program gets to know of its environment"),
    ("tie", "how the thing that a tool checked was made from the formula: by translation, by a table, or by a person"),
    ("kernel", "a small program that establishes a proof again: certified-1 with one solver, certified-2 with two"),
    ("bow-tie", "a picture of a hazard between its causes and its consequences, with what mitigates it"),
)


def render_answers(case: Case, json_digest: str = "") -> str:
    """The first page. Deterministic: same case, same bytes."""
    by_level = [(one, [r.id for r in case.requirements if r.level is one]) for one, _ in case.answers.by_level]
    return _render(
        "answers.html.j2",
        case,
        json_digest,
        brief=wording.gate_line,
        dangers=wording.dangers(case),
        weakest=wording.weakest,
        by_level=by_level,
        content=baseline_of(case).content,
        kinds=KINDS,
        listed=case.listed,
        many=_many(case),
        refuted=_refuted,
        some=listed,
        worded={line.number for line in case.answers.supposed},
        tone_of_level={level: _tone_of(case, level) for level in Level},
    )


def render_argument(case: Case, json_digest: str = "", parts: Parts = NOTHING_KEPT) -> str:
    """The page behind the first: requirements and nodes with their evidence, each assumption, and what is not shown."""
    bases, nodes = {basis.node: basis for basis in case.answers.bases}, []
    for node, guarantees in ((module.node, module.guarantees) for module in node_modules(case)):
        basis = bases.get(node.name) or basis_of(node, case)
        said = {view.id: told.reason for view in guarantees if (told := case.said(view.id)) and told.reason}
        nodes.append(parts.text(node.name, "argument", _node, node, of_nodes(case).get(node.name, ()), basis, said))
    return _render(
        "argument.html.j2",
        case,
        json_digest,
        conditions=conditions(case),
        doubts=doubts(case),
        full_reason=full_reason,
        shade=shade,
        some=listed,
        modules=[_requirement(case, m) for m in requirement_modules(case)],
        node_modules=nodes,
        said_of=lambda name: ((said := case.said(name)) and said.reason) or "",
        word=_word,
        words=WORDS,
    )


def _render(template: str, case: Case, json_digest: str, **more: Any) -> str:
    return fill(
        template,
        case=case,
        known=known_pages(case),
        titles={node.name for node in case.nodes},
        json_digest=json_digest,
        **more,
    )


def full_reason(assumption: Assumption) -> str:
    """Everything stated for an assumption beyond its one-line text."""
    parts = [assumption.because] if assumption.because else []
    parts += [text for text in assumption.text.split("\n") if text not in (assumption.because, assumption.says)]
    longer = ""
    for part in sorted({*parts}, key=len, reverse=True):  # a search in one text: there is a part for each claim
        longer += f"\0{part}\0" if part and part not in longer else ""
    return "; ".join(dict.fromkeys(part for part in parts if part and f"\0{part}\0" in longer))


def _many(case: Case) -> bool:
    return len(case.answers.listed) < len(case.requirements)


def _tone_of(case: Case, level: Level) -> Tone:
    return min((r.tone for r in case.requirements if r.level is level), key=lambda t: t.rank, default=Tone.GREY)


def _requirement(case: Case, module: RequirementModule) -> dict[str, Any]:
    own = []
    for name in module.requirement.obligations:
        view = case.obligation(name)
        own += [(view, r) for r in view.records]
    fields = {name: getattr(module, name) for name in RequirementModule.__slots__}
    return {**fields, "own": own}


def _node(node: NodeView, views: Sequence[ObligationView], basis: NodeBasis, said: Mapping[str, str]) -> str:
    guarantees = [view for view in views if view.obligation.kind is Kind.GUARANTEE]
    return fill(
        "argument_node.html.j2",
        node=node,
        guarantees=guarantees,
        basis=basis,
        said=said,
        boxes=_boxes(guarantees, basis),
        kept_apart=kept_apart,
        known=pages(guarantees),
        shade=shade,
        where=wording.where,
        word=_word,
    )


def _boxes(views: Sequence[ObligationView], basis: NodeBasis) -> list[tuple[Tone, tuple[str, str]]]:
    if len(views) <= NODE_BOXES:
        return [(shade(view), (view.standing.value, view.obligation.claim)) for view in views]
    tones = {view.standing.value: shade(view) for view in views}
    return [(tones.get(part.split(" ")[1], Tone.RED), (part, "")) for part in re.split("[,;] ", basis.words)]


def _word(record: Evidence) -> str:
    return weigh(record).status.value


def _refuted(text: str) -> Markup:
    """The text of a refutation: all but its first word is of the contract and its evidence."""
    return Markup('<b>Refuted:</b> <span class="said">{}</span>').format(text.removeprefix("Refuted: "))


def render_index(cases: Sequence[Case], earlier: Sequence[str] = ()) -> str:
    """The page over all systems: a row each, the worst first; then those whose reports are as of an earlier state."""
    ranked = sorted(
        cases,
        key=lambda case: (
            case.good,
            _ORDER.index(case.answers.tone),
            case.answers.headline is not Level.EXAMINED,
            case.system,
        ),
    )
    relied = [case for case in cases if case.answers.headline is not Level.EXAMINED]
    failing = [case for case in relied if case.answers.tone is Tone.RED]
    if failing:
        line, tone = f"{len(failing)} of {count(len(cases), 'system')} not shown", Tone.RED
    elif not relied:
        line, tone = "None is relied upon", Tone.GREY
    else:
        rest = f"; {len(cases) - len(relied)} only examined" if len(relied) < len(cases) else ""
        tone = min((case.answers.tone for case in relied), key=lambda t: t.rank)
        least = max((case.answers.headline for case in relied), key=tuple(Level).index)
        lowest = "the lowest verdict: " if len(relied) > 1 else ""
        line = f"{count(len(relied), 'system')}, {lowest}{least}{rest}"
    if earlier:
        line += f"; {count(len(earlier), 'report')} as of an earlier state"
        tone = Tone.AMBER if tone is Tone.GREEN else tone
    return fill(
        "systems.html.j2",
        rows=ranked,
        earlier=earlier,
        titles=Counter(case.title for case in cases),
        line=line,
        tone=tone,
        quote=quote,
    )
