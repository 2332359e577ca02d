"""The remarks of the language checker on the contracts' text (formulas that another bracketing would change, names that
nothing uses, sentences that differ from their formulas), and of methods on their own input. No gate fails for them, but
if a formula was read otherwise than it was meant, its claim is about something else: a report without them would
mislead."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache

from avow.assurance.model import ObligationView, OpenItem, SourceView
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.evidence.obligation import Kind
from avow.evidence.record import REMARKS
from avow.language.contract import Contract
from avow.language.load import warnings_of
from avow.language.sentences import elements_of
from avow.system.statements import said_otherwise
from avow.system.strict_yaml import Piece, read_yaml

REMARK = "remark"
"""The kind of these open items; all of them are advice."""
_FIRST = ("RCL401", "RCL413", "RCL414", "RCL415", "RCL412")
"""Another bracketing has another meaning, a sentence differs from its formula, a function cannot express what is meant:
remarks that change what a verdict is about."""


_READ = ("lints_off", "requirements", "\\")
"""A plan without any of these has no key that is read here: a backslash may spell a key otherwise."""


def remarks(sources: Sequence[SourceView], views: Sequence[ObligationView]) -> tuple[OpenItem, ...]:
    """Advice for each lint of the contracts, with the guarantee or assumption that contains it, of the plan's
    requirements, and for each remark of a method: first those that change what a verdict is about, then the methods',
    then the rest."""
    contract, found = _checked(tuple((s.path, s.text) for s in sources if s.is_contract))
    plans = [root for source in sources if (root := _plan(source)) is not None]
    off = _switched_off(plans)
    weighty, rest = list[OpenItem](), list[OpenItem]()
    clauses = _clauses(views)
    for lint in sorted(found, key=lambda d: _FIRST.index(d.code) if d.code in _FIRST else len(_FIRST)):
        if lint.span and lint.code not in off:
            (weighty if lint.code in _FIRST else rest).append(
                _item(lint, lint.span, clauses.get((lint.span.file, lint.span.line), ""))
            )
    if contract is not None:
        weighty += [item for plan in plans for item in _of_requirements(plan, contract, views, off)]
    return (*weighty, *_of_methods(views, off), *rest)


def _of_requirements(
    plan: Piece, contract: Contract, views: Sequence[ObligationView], off: frozenset[str]
) -> Iterator[OpenItem]:
    """The differences between requirements' sentences and their formulas."""
    elements = elements_of(contract.nodes)
    for name, _, piece in plan.keyed("requirements"):
        text, formula = piece.at("text"), piece.at("formula")
        if text is None or formula is None:
            continue
        claim = next((v.id for v in views if v.obligation.kind is Kind.REQUIREMENT and v.obligation.name == name), "")
        try:
            told = tuple(said_otherwise(text.text, formula.text, contract, elements, text.span))
        except Rejected:
            continue  # of an included system: its own report has it
        yield from (_item(d, text.span, claim or name) for d in told if d.code not in off)


def _of_methods(views: Sequence[ObligationView], off: frozenset[str]) -> Iterator[OpenItem]:
    """The remarks of the methods' checks with the answers that count; each once, at the first claim."""
    seen = set[tuple[str, str, str]]()
    for view in views:
        for record in view.records:
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
def _checked(contracts: tuple[tuple[str, str], ...]) -> tuple[Contract | None, tuple[Diagnostic, ...]]:
    return warnings_of(contracts) if contracts else (None, ())


def _plan(source: SourceView) -> Piece | None:
    if source.path.rpartition("/")[2] != "plan.yaml" or not any(word in source.text for word in _READ):
        return None
    try:
        return read_yaml(source.text.encode("utf-8", "replace"), source.path)[0]
    except Rejected:
        return None  # the text in the report was edited; `avow report --check` reports it


def _switched_off(plans: Sequence[Piece]) -> frozenset[str]:
    """The plans' `lints_off`, read from their texts: the report is concluded from its own data, on any machine."""
    listed = [found for plan in plans if (found := plan.at("lints_off"))]
    return frozenset(piece.text for found in listed for piece in (found.items or [found]))


def _item(found: Diagnostic, span: Span, claim: str) -> OpenItem:
    hint = f": {found.hint}" if found.hint else ""
    place = f"{span.file}:{span.line}"
    return OpenItem(REMARK, claim or place, f"{found.code}, {place}{hint}", advice=True, title=found.message)


def _clauses(views: Sequence[ObligationView]) -> dict[tuple[str, int], str]:
    """File and line → the first guarantee there."""
    found: dict[tuple[str, int], str] = {}
    for view in views:
        span = view.obligation.span
        if view.obligation.kind is Kind.GUARANTEE and span is not None:
            for line in range(span.line, span.end_line + 1):
                found.setdefault((span.file, line), view.id)
    return found
