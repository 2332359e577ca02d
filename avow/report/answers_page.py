"""The report's first page: five answers on one screen, the argument behind them in folds. One file, no network."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from markupsafe import Markup, escape

from avow.assurance.answers import Headline, How, NodeBasis, SupposedLine, Supposition, Tone
from avow.assurance.changes import baseline_of
from avow.assurance.first_screen import basis_of
from avow.assurance.model import Case, ObligationView
from avow.assurance.modules import NodeModule, RequirementModule, node_modules, requirement_modules
from avow.assurance.relied import kept_apart, shade, stands, word
from avow.base.plain import count, listed
from avow.base.tuning.shown import NODE_BOXES, SHEET_LETTERS
from avow.evidence.record import Evidence
from avow.evidence.status import weigh
from avow.report import wording
from avow.report.page import asset, environment

_ORDER = (Tone.RED, Tone.AMBER, Tone.GREEN, Tone.GREY)
WORDS = (
    ("proved", "for all inputs, by a sound method"),
    ("checked", "every case of a bounded model was looked at"),
    ("tested", "on a number of cases"),
    ("observed", "by a monitor, on recorded runs"),
    ("reviewed", "read by a person who says what was read"),
    ("supposed", "no evidence; a reason, an owner and a date"),
    ("derived", "a tool concluded the requirement's formula from guarantees, each as strong as its own evidence"),
    ("argued", "a person says that guarantees amount to the requirement's sentence"),
    ("open", "refuted, missing or stale, or resting on something that is, or on a supposition that has expired"),
    ("guarantee", "what a node's contract promises, if its assumptions hold"),
    ("supposition", "something that requirements rest on without its being shown"),
    ("weakening", "a reason for which the report says less than it seems to"),
    ("policy, gate", "what this system's owners ask of the evidence, demand by demand"),
)


def render_answers(case: Case, json_digest: str = "") -> str:
    """The page. Deterministic: same case, same bytes."""
    known = {view.id for view in case.obligations}
    return (
        environment()
        .get_template("answers.html.j2")
        .render(
            case=case,
            style=Markup(asset("answers.css")),
            script=Markup(asset("answers.js")),
            brief=wording.gate_line,
            by_how=[(how, [r.id for r in case.requirements if r.how is how]) for how, _ in case.answers.by_how],
            content=baseline_of(case).content,
            full_reason=full_reason,
            kept_apart=kept_apart,
            known=known,
            listed=case.listed,
            many=_many(case),
            modules=[_requirement(case, m) for m in requirement_modules(case)],
            node_modules=[_node(case, m) for m in node_modules(case)],
            json_digest=json_digest,
            others=lambda line: others(case, line),
            refuted=_refuted,
            said_of=lambda name: ((said := case.said(name)) and said.reason) or "",
            some=listed,
            titles={node.name for node in case.nodes},
            tone_of_how={how: _tone_of(case, how) for how in How},
            word=_word,
            worded=worded(case),
            words=WORDS,
        )
    )


def full_reason(supposition: Supposition) -> str:
    """All that is said for a supposition beyond its plain words."""
    parts = [supposition.because] if supposition.because else []
    parts += [text for text in supposition.text.split("\n") if text not in (supposition.because, supposition.says)]
    told = list(dict.fromkeys(p for p in parts if p and not any(p != q and p in q for q in parts)))
    return "; ".join(told)


def others(case: Case, line: SupposedLine) -> list[Supposition]:
    """The suppositions of a line's sort that it gives by number only."""
    return [s for s in case.suppositions if s.number in line.others]


def worded(case: Case) -> bool:
    """Whether a printed first sheet has room for all suppositions in words; a sheet has no folds to open."""
    return sum(len(s.words) for s in case.suppositions) + sum(len(r.text) for r in case.listed) <= SHEET_LETTERS


def _many(case: Case) -> bool:
    return len(case.answers.listed) < len(case.requirements)


def _tone_of(case: Case, how: How) -> Tone:
    return min((r.tone for r in case.requirements if r.how is how), key=lambda t: t.rank, default=Tone.GREY)


def _requirement(case: Case, module: RequirementModule) -> dict[str, Any]:
    own = []
    for name in module.requirement.obligations:
        view = case.obligation(name)
        own += [(view, r) for r in view.records]
    fields = {name: getattr(module, name) for name in RequirementModule.__slots__}
    return {**fields, "own": own}


def _node(case: Case, module: NodeModule) -> dict[str, Any]:
    basis = basis_of(module.node, case)
    cells = [_guarantee(case, view) for view in module.guarantees]
    return {"node": module.node, "basis": basis, "guarantees": cells, "boxes": _boxes(cells, basis)}


def _guarantee(case: Case, view: ObligationView) -> dict[str, Any]:
    said = case.said(view.id)
    return {
        "view": view,
        "word": stands(view),
        "tone": shade(view),
        "where": wording.where(view),
        "reason": said.reason if said else "",
        "records": view.records,
        "history": len(view.evidence) - len(view.counting),
    }


def _boxes(cells: Sequence[dict[str, Any]], basis: NodeBasis) -> list[tuple[Tone, tuple[str, str]]]:
    if len(cells) <= NODE_BOXES:
        return [(cell["tone"], (cell["word"], cell["view"].obligation.claim)) for cell in cells]
    tones = {cell["word"]: cell["tone"] for cell in cells}
    return [(tones.get(part.split(" ")[1], Tone.RED), (part, "")) for part in re.split("[,;] ", basis.words)]


def _word(record: Evidence) -> str:
    status = weigh(record).status
    return word(status) if status.supports else status.value


def _refuted(text: str) -> Markup:
    """What is refuted, its quotation marked as one."""
    before, mark, rest = text.partition("“")
    quote, end, after = rest.rpartition("”")
    if not mark or not end:
        return escape(text)
    return Markup('<b>{}</b> <span class="said">“{}”</span>{}').format(before.strip(), quote, after)


def render_index(cases: Sequence[Case], earlier: Sequence[str] = ()) -> str:
    """The page over all systems: a row each, the worst first; then those whose reports are as of an earlier state."""
    ranked = sorted(
        cases,
        key=lambda case: (
            case.good,
            _ORDER.index(case.answers.tone),
            case.answers.headline is not Headline.EXAMINED,
            case.system,
        ),
    )
    relied = [case for case in cases if case.answers.headline is not Headline.EXAMINED]
    failing = [case for case in relied if case.answers.tone is Tone.RED]
    if failing:
        line, tone = f"{len(failing)} of {count(len(cases), 'system')} not shown", Tone.RED
    elif not relied:
        line, tone = "None is relied upon", Tone.GREY
    else:
        rest = f"; {len(cases) - len(relied)} only examined" if len(relied) < len(cases) else ""
        tone = min((case.answers.tone for case in relied), key=lambda t: t.rank)
        supposing = ", on suppositions" if any(case.suppositions for case in relied) else ""
        line = f"{count(len(relied), 'system')} {'holds' if len(relied) == 1 else 'hold'}{supposing}{rest}"
    if earlier:
        line += f"; {count(len(earlier), 'report')} as of an earlier state"
        tone = Tone.AMBER if tone is Tone.GREEN else tone
    return (
        environment()
        .get_template("systems.html.j2")
        .render(
            rows=[(case, case.history.points) for case in ranked],
            earlier=earlier,
            line=line,
            tone=tone,
            style=Markup(asset("answers.css")),
            quote=quote,
        )
    )
