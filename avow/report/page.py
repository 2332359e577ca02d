"""The report on every claim: an overview, and a page for each node, the whole system and the contracts. The pages need
no network, are readable without a script, and are printable."""

from __future__ import annotations

import base64
import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, __version__
from jinja2.bccache import Bucket, BytecodeCache
from markupsafe import Markup, escape

from avow.assurance.answers import MEANINGS, Tone
from avow.assurance.certification import ProofView
from avow.assurance.model import Case, DerivationView, Handled, ObligationView, OpenItem
from avow.assurance.naming import short
from avow.assurance.remarks import REMARK
from avow.assurance.traceability import Row
from avow.backend_kit.timeline import in_words, picture, timelines
from avow.base.plain import count
from avow.base.records import dataclass
from avow.base.remembered import Kept, by_identity
from avow.base.tuning.shown import FINDING_CHARACTERS, GUARANTEE_ROWS, OBLIGATIONS_IN_FULL, ROWS_UNFOLDED
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.evidence.record import IN_PART
from avow.evidence.status import Status, weigh
from avow.report import example, source, wording
from avow.report.parts import NOTHING_KEPT, Parts
from avow.report.wording import history, of_nodes, proof_runs

KINDS = (Kind.GUARANTEE, Kind.SANITY, Kind.COMPOSITION, Kind.REQUIREMENT, Kind.PROGRAM, Kind.WELL_FORMED)
_KIND = {kind: at for at, kind in enumerate(KINDS)}

_Stands = list[tuple[str, str, int]]
_Matrix = list[tuple[str, str, list[tuple[ObligationView, list[tuple[str, Status | None]]]]]]


class Compiled(BytecodeCache):
    """Compiled templates, kept in this user's cache: compiling takes longer than rendering.

    The cached data is code, so Jinja binds it to the template's text, and a seal to its path: data that was edited,
    forged or made by another version of Jinja is ignored and compiled again.
    """

    def __init__(self) -> None:
        self._kept = Kept("templates", Path(__file__))

    def load_bytecode(self, bucket: Bucket) -> None:
        kept = self._kept.get(bucket.key, __version__)
        if kept is not None:
            bucket.load_bytecode(io.BytesIO(kept))

    def dump_bytecode(self, bucket: Bucket) -> None:
        made = io.BytesIO()
        bucket.write_bytecode(made)
        self._kept.put(bucket.key, __version__, made.getvalue())


@cache
def environment() -> Environment:
    """Strict: a name that a template does not get is an error; every text is escaped."""
    found = Environment(
        loader=PackageLoader("avow.report"),
        bytecode_cache=Compiled(),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    found.globals |= {
        "MARKS": wording.MARKS,
        "MEANINGS": wording.MEANINGS,
        "LEVELS": MEANINGS,
        "Status": Status,
        "Tone": Tone,
        "anchor": wording.anchor,
        "asset": asset,
        "page_of": wording.page_of,
        "ticks": _ticks,
        "bound_text": wording.bound_text,
        "gate_line": wording.gate_line,
        "derivation": _derivation,
        "draw_timelines": _timelines,
        "example_run": example.run,
        "example_values": example.values,
        "small_values": example.small_values,
        "in_lines": wording.in_lines,
        "location": source.location,
        "source_lines": source.lines_of,
        "math": _math,
        "count": count,
        "clean": wording.clean,
        "q": quoted,
        "mutation": wording.mutation,
        "details_text": wording.details_text,
        "outline": wording.outline,
        "NOT_SHOWN": wording.NOT_SHOWN,
        "NO_HAZARD": wording.NO_HAZARD,
        "not_shown": wording.not_shown,
        "overhead": wording.overhead,
        "protocol": wording.protocol,
        "rerun": wording.rerun,
        "short": short,
        "within": wording.within,
        "worth": wording.worth,
        "tone": wording.tone,
        "tool_command": wording.tool_command,
        "weigh": weigh,
    }
    return found


_BLANKS = {ord(blank): f"&#{ord(blank)};" for blank in "\t\n\r"}
"""Blanks that a reader of XML would make spaces in an attribute."""


def quoted(text: str) -> Markup:
    """The text as an XML attribute's value, with its quotation marks."""
    return Markup(Markup('"{}"').format(wording.clean(text)).translate(_BLANKS))  # escaped by format


def fill(template: str, **given: Any) -> str:
    """The text of a template."""
    return environment().get_template(template).render(given)


def render_page(case: Case, json_digest: str = "", parts: Parts = NOTHING_KEPT) -> str:
    """The overview of every claim. Deterministic: same case, same bytes. `json_digest` is the digest of the report.json
    beside it: with it no edit of that file goes unnoticed, not even of a part that no other format shows."""
    listed = [item for item in case.open_items if not item.advice]
    nodes, standings = by_node(case), {view.standing for view in case.obligations}
    found = {view.obligation.kind for view in case.obligations}
    groups = [
        (node, _stands(views), Markup(parts.text(node, "claims", _rows, of_nodes(case)[node])))  # a template's own text
        for node, views in nodes.items()
    ]
    return _fill(
        "claims.html.j2",
        case,
        groups=groups,
        total=len(case.obligations),
        counts=_counts(case.obligations),
        partly={(r.obligation, r.method) for v in case.guarantees for r in v.records if r.bound.get(IN_PART)},
        matrix=_matrix(case) if len(case.guarantees) <= GUARANTEE_ROWS else [],
        graph=_svg_image(case.graph_svg),
        open_items=listed,
        open_line=wording.open_line(case),
        remark_line=wording.remark_line(case),
        open_kinds=list(Counter(item.kind for item in listed).items()),
        do_first=None if case.good else next((i for i in listed if i.suggestion and not i.handled), None),
        findings={view.id: _found(view) for view in case.obligations},
        advice=[item for item in case.open_items if item.advice and item.kind != REMARK],
        remarks=[item for item in case.open_items if item.kind == REMARK],
        justified=_justified(case),
        used_methods=_used_methods(case),
        statuses=[s for s in Status if s in standings],
        json_digest=json_digest,
        kinds=[kind for kind in KINDS if kind in found],
        open_at_once=ROWS_UNFOLDED,
        proofs=Markup("".join(parts.text(node, n, _proofs, run) for node, n, run in proof_runs(case))),  # as above
    )


def _proofs(proofs: Sequence[ProofView]) -> str:
    return fill("proofs.html.j2", proofs=proofs)


def _rows(views: Sequence[ObligationView]) -> str:
    """A line for each claim of a node."""
    return fill("rows.html.j2", views=_in_order(views), known=pages(views))


def render_details(case: Case, parts: Parts = NOTHING_KEPT) -> Iterator[tuple[str, str | None]]:
    """Every claim in full, as (file name, page): the whole system with its derivations, each node, the contracts. None
    for a page that is there as it is to be (`Parts.file`).

    They name neither run nor date: a run that changes nothing of a node leaves its page unchanged.
    """
    nodes = {SYSTEM_LEVEL: tuple[ObligationView, ...](), **by_node(case)}
    links = [("the whole system" if node == SYSTEM_LEVEL else node, wording.page_of(node)) for node in nodes]
    links += [("contracts", "contracts.html")] if case.sources else []
    head = _Head(case.title, case.run.avow_version, case.earlier, tuple(links), tuple(source.places(case).items()))
    full = _in_full([view for views in nodes.values() for view in views])
    numbered, known = wording.numbered(case), known_pages(case)
    remarked = _by_item([item for item in case.open_items if item.kind == REMARK])
    told = {name for finding in case.findings for name in finding.obligations}
    for (title, name), node in zip(links, nodes, strict=False):
        views = of_nodes(case).get(node, ())
        derived = case.derivations if node == SYSTEM_LEVEL else ()
        below = {name for d in derived for name in (*d.rests_on, *(c.obligation for c in d.derivation.side_conditions))}
        named = below.union(*(v.below for v in views), *(d.below for d in derived))
        texts = (text for v in views for e in v.evidence for text in e.entry.evidence.hypotheses)
        beside = _Beside(
            tuple(view.id for view in views if view.id in full),
            {text: numbered[text] for text in texts if text in numbered},
            {view.id: remarked[view.id] for view in views if view.id in remarked},
            {view.id: case.said(view.id) for view in views if view.id in told},
            {name: known[name] for name in sorted(named) if name in known},
            {name: case.obligation(name).standing for name in sorted(below) if name in known},
        )
        yield name, parts.file(node, name, _details, head, title, views, beside, derived)
    if case.sources:
        yield "contracts.html", _fill("contracts.html.j2", case, head=head, title="contracts", parts=parts)


@dataclass(frozen=True, slots=True)
class _Head:
    """What all pages of nodes have at their head, and the texts that they lead to."""

    title: str
    version: str
    earlier: bool
    pages: tuple[tuple[str, str], ...]
    places: tuple[tuple[str, tuple[int, int]], ...]


@dataclass(frozen=True, slots=True)
class _Beside:
    """What other parts of the case say about a node's claims, or about those that derivations rest on."""

    full: tuple[str, ...]
    numbered: Mapping[str, str]
    remarked: Mapping[str, Sequence[OpenItem]]
    said: Mapping[str, Handled | None]
    known: Mapping[str, str]
    standing: Mapping[str, Status]


def _details(
    head: _Head,
    title: str,
    views: Sequence[ObligationView],
    beside: _Beside,
    derivations: Sequence[DerivationView],
) -> str:
    """A page of claims in full."""
    return fill(
        "details.html.j2",
        head=head,
        title=title,
        views=_in_order(views),
        beside=beside,
        places=dict(head.places),
        full=frozenset(beside.full),
        known={**beside.known, **pages(views)},
        derivations=derivations,
    )


def _fill(template: str, case: Case, **more: Any) -> str:
    return fill(template, case=case, known=known_pages(case), **more)


@by_identity(1)
def known_pages(case: Case) -> dict[str, str]:
    """Each obligation, with the page that shows all of it."""
    return pages(case.obligations)


def pages(views: Iterable[ObligationView]) -> dict[str, str]:
    return {view.id: wording.page_of(view.obligation.node) for view in views}


@by_identity(1)
def by_node(case: Case) -> Mapping[str, tuple[ObligationView, ...]]:
    """Every obligation, in reading order: the nodes in the contract's order, then the whole system."""
    place = {node.name: at for at, node in enumerate(case.nodes)}
    nodes = sorted(of_nodes(case).items(), key=lambda found: place.get(found[0], len(place)))
    return {node: _in_order(views) for node, views in nodes}


def _in_order(views: Iterable[ObligationView]) -> tuple[ObligationView, ...]:
    return tuple(sorted(views, key=lambda v: _KIND[v.obligation.kind]))


_SUBSCRIPT = re.compile(r"(?<!\w)([𝒜𝒢io])_([A-Za-z0-9_]+)")
_RULE = re.compile(r"^[─—-]{5,}$")


def _derivation(text: str, title: str) -> Markup:
    """A derivation in the paper's notation: premises over a line over the conclusion, with subscripts."""
    rows = []
    below = False
    for line in text.splitlines():
        if line == title:
            continue
        if _RULE.match(line.strip()):
            below = True
            continue
        shown, _, remark = str(escape(line)).partition("    [")
        note = f' <span class="quiet">[{remark}</span>' if remark else ""
        prose = line.lstrip().startswith("provided")
        kind = ("said" if prose else "line") + (" under" if below else "")
        below = False
        shown = shown if prose else _subscripts(shown)
        rows.append(f'<div class="{kind}">{shown}{note}</div>')
    return Markup("\n".join(rows))  # escaped line by line above


def _subscripts(escaped: str) -> str:
    """``𝒢_agent`` with a subscript; the streams i and o with the paper's line above."""

    def typeset(found: re.Match[str]) -> str:
        symbol, node = found.groups()
        written = f"{symbol}<sub>{node}</sub>"
        return f'<span class="stream">{written}</span>' if symbol in "io" else written

    return _SUBSCRIPT.sub(typeset, escaped)


def _timelines(details: Mapping[str, Any]) -> Markup:
    """Timelines of the recorded runs, with the places where they fail; empty if no evidence has any."""
    figures = [
        Markup('<figure class="lanes">{}<figcaption>{}</figcaption></figure>').format(picture(one), in_words(one))
        for one in timelines(details)
    ]
    return Markup("\n").join(figures)


def _math(text: str) -> Markup:
    return Markup(_subscripts(str(escape(text))))  # escaped first


def _ticks(text: str) -> Markup:
    """A sentence of Avow's with its `commands` set as code; everything in it is escaped first."""
    return Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def render_traceability(case: Case, rows: Sequence[Row]) -> str:
    """The traceability matrix as a page: coverage and orphans first, then each requirement with the claims below it."""
    guarantees = {view.id for view in case.guarantees}
    serving = {row.obligation for row in rows if row.requirement and row.obligation in guarantees}
    reached = {row.requirement for row in rows if row.requirement and row.evidence}
    return fill(
        "traceability.html.j2",
        case=case,
        orphans=_by_claim([row for row in rows if row.remark]),
        paths={r.id: _by_claim([row for row in rows if row.requirement == r.id]) for r in case.requirements},
        others=_by_claim([row for row in rows if not row.requirement]),
        reached=len(reached),
        guarantees=len(guarantees),
        serving=len(serving),
        known={view.id for view in case.obligations},
        total=len(rows),
    )


def _by_claim(rows: Sequence[Row]) -> list[tuple[Row, list[Row]]]:
    """Paths to one claim, grouped: the first of them, and all that have evidence."""
    found: dict[tuple[str, ...], list[Row]] = {}
    for row in rows:
        key = (row.requirement, row.derivation, row.obligation, row.remark, "" if row.obligation else str(len(found)))
        found.setdefault(key, []).append(row)
    return [(group[0], [row for row in group if row.method]) for group in found.values()]


@cache
def asset(name: str) -> Markup:
    """The text of a file of Avow's own beside the templates."""
    return Markup(resources.files("avow.report").joinpath("templates", name).read_text(encoding="utf-8"))


def _in_full(views: Sequence[ObligationView]) -> set[str]:
    if len(views) <= OBLIGATIONS_IN_FULL:
        return {view.id for view in views}
    telling = [view.id for view in views if not view.standing.supports or view.handled or history(view)]
    return set(telling[:OBLIGATIONS_IN_FULL])


def _found(view: ObligationView) -> str:
    """The counterexample of a claim, in a line; empty if there is none."""
    shown = next((e.counterexample for e in view.records if e.counterexample), None)
    text = shown.text() if shown is not None and not view.status.supports else ""
    return text if len(text) <= FINDING_CHARACTERS else text[: FINDING_CHARACTERS - 1] + "…"


def _by_item(items: Sequence[OpenItem]) -> dict[str, list[OpenItem]]:
    found: dict[str, list[OpenItem]] = {}
    for item in items:
        found.setdefault(item.claim, []).append(item)
    return found


def _counts(views: Sequence[ObligationView]) -> list[tuple[str, _Stands, int]]:
    """GNATprove's table: for each kind of claim, how many stand how."""
    table = []
    for kind in KINDS:
        for advice in (False, True):
            of_kind = [v for v in views if v.obligation.kind is kind and v.advice is advice]
            if of_kind:
                label = f"{kind}, as advice" if advice else kind.value
                table.append((label, _stands(of_kind), len(of_kind)))
    return table


def _stands(views: Iterable[ObligationView]) -> _Stands:
    """How the claims stand, best first, in the word and colour that each one's own line has."""
    return [(word, wording.tone(word), number) for word, number in wording.tally(views).items()]


def _used_methods(case: Case) -> list[str]:
    """Ids of the methods planned for guarantees or used for them, in the plan's order."""
    planned = [name for view in case.guarantees for name, _ in view.planned]
    in_plan = [name for node in case.nodes for name, _ in node.methods if name in planned]
    return list(dict.fromkeys((*in_plan, *planned)))


def _matrix(case: Case) -> _Matrix:
    """For each node: each guarantee with the status that each method gives it (None: the method is not used for it)."""
    methods = _used_methods(case)
    rows: dict[str, list[tuple[ObligationView, list[tuple[str, Status | None]]]]] = {}
    for view in case.guarantees:
        rows.setdefault(view.obligation.node, []).append((view, [(m, _cell(view, m)) for m in methods]))
    levels = {node.name: node.criticality for node in case.nodes}
    return [(node, levels.get(node, ""), found) for node, found in rows.items()]


def _cell(view: ObligationView, method: str) -> Status | None:
    from avow.evidence.status import roll_up

    mine = [item for item in view.evidence if item.entry.evidence.method == method]
    if not mine and method not in dict(view.planned):
        return None
    return roll_up((item.entry.evidence for item in mine if item.counts), outdated=bool(mine))


def _svg_image(text: str) -> str:
    """A picture as the source of an image: no script in it can run. Empty if there is no picture."""
    if not text:
        return ""
    return "data:image/svg+xml;base64," + base64.b64encode(text.encode("utf-8", "replace")).decode()


def _justified(case: Case) -> list[tuple[ObligationView, Any]]:
    return [
        (view, record)
        for view in case.obligations
        for record in view.records
        if weigh(record).support is Status.JUSTIFIED
    ]
