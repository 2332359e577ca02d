"""Requirements whose sentence says otherwise than their formula: the sentence is what an assessor reads."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.language.contract import Contract
from avow.language.sentences import differences, elements_of
from avow.system.plan import System
from avow.system.temporal import written_state


def requirement_sentences(system: System) -> Iterator[Diagnostic]:
    """The lints RCL413 to RCL415 of the plan's requirements that have a formula."""
    elements = elements_of(system.contract.nodes)
    for requirement in system.plan.requirements:
        if requirement.formula is not None:
            yield from said_otherwise(
                requirement.text, requirement.formula, system.contract, elements, requirement.span
            )


def said_otherwise(
    text: str, formula: str, contract: Contract, elements: Mapping[str, str], span: Span | None
) -> Iterator[Diagnostic]:
    """What a requirement's sentence says otherwise than its formula; `elements` are the contract's (`elements_of`).
    Raises Rejected where that is no formula."""
    for found in differences(text, written_state(formula, contract, span, clause=True), elements):
        yield Diagnostic(found.code, found.message, span, Severity.WARNING, found.hint)
