"""What the language checker remarks about the contracts' text (formulas that another bracketing would change, names
that nothing uses, sentences that say otherwise), and methods about their own input. Nothing fails for them, but a claim
about a formula that was read otherwise than it was meant is a claim about something else: so a report that keeps silent
on them would mislead.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from avow.assurance.model import ObligationView, OpenItem, SourceView
from avow.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.evidence.obligation import Kind
from avow.evidence.record import REMARKS
from avow.language.load import check_sources
from avow.language.source import Source
from avow.system.strict_yaml import read_yaml

REMARK = "remark"
"""The kind of these open items; all of them are advice."""
_FIRST = ("RCL401", "RCL413", "RCL414", "RCL415", "RCL412")
"""Another bracketing means something else, a sentence says otherwise, a function cannot say what is meant: remarks that
change what a verdict is about."""


def remarks(sources: Sequence[SourceView], views: Sequence[ObligationView]) -> tuple[OpenItem, ...]:
    """An advice for each lint of the contracts, with the guarantee or assumption that it stands in, and for each remark
    of a method: first what changes what a verdict is about, then the methods', then the rest."""
    contracts = tuple((s.path, s.text) for s in sources if s.is_contract)
    off = _switched_off(sources)
    weighty, rest = list[OpenItem](), list[OpenItem]()
    for found in sorted(
        _lints(contracts, off), key=lambda d: _FIRST.index(d.code) if d.code in _FIRST else len(_FIRST)
    ):
        if found.span:
            (weighty if found.code in _FIRST else rest).append(_item(found, found.span, views))
    return (*weighty, *_of_methods(views, off), *rest)


def _of_methods(views: Sequence[ObligationView], off: frozenset[str]) -> Iterator[OpenItem]:
    """What the methods' checks remarked when they gave the answers that count; each once, at the first claim."""
    seen = set[tuple[str, str, str]]()
    for view in views:
        for evidence in view.counting:
            record = evidence.entry.evidence
            listed = record.details.get(REMARKS)
            for told in listed if isinstance(listed, list) else ():
                match told:
                    case {"code": str(code), "place": str(place), "message": str(message)}:
                        if code in off or (record.method, place, message) in seen:
                            continue
                        seen.add((record.method, place, message))
                        where = f"{code}, {place}" if place else code
                        yield OpenItem(REMARK, view.id, f"{where}; method {record.method}", advice=True, title=message)


@lru_cache(maxsize=64)
def _lints(contracts: tuple[tuple[str, str], ...], off: frozenset[str]) -> tuple[Diagnostic, ...]:
    if not contracts:
        return ()
    _, found = check_sources([Source(path, text) for path, text in contracts], off=off)
    return tuple(d for d in found if d.severity is Severity.WARNING)


def _switched_off(sources: Sequence[SourceView]) -> frozenset[str]:
    """The plan's `lints_off`, read from its text: the report is concluded from what it holds, on any machine."""
    names: set[str] = set()
    for source in sources:
        if source.path.rpartition("/")[2] == "plan.yaml":
            try:
                root, _ = read_yaml(source.text.encode("utf-8", "replace"), source.path)
            except Rejected:
                continue  # somebody edited the text that a report holds; `avow report --check` tells
            listed = root.at("lints_off")
            names |= {piece.text for piece in (listed.items or [listed])} if listed else set()
    return frozenset(names)


def _item(found: Diagnostic, span: Span, views: Sequence[ObligationView]) -> OpenItem:
    claim = next((v.id for v in views if v.obligation.kind is Kind.GUARANTEE and _within(span, v.obligation.span)), "")
    hint = f": {found.hint}" if found.hint else ""
    return OpenItem(
        REMARK,
        claim or f"{span.file}:{span.line}",
        f"{found.code}, {span.file}:{span.line}{hint}",
        advice=True,
        title=found.message,
    )


def _within(inner: Span, outer: Span | None) -> bool:
    return outer is not None and inner.file == outer.file and outer.line <= inner.line <= outer.end_line
