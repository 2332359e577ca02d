"""A contract's nodes as SMT-LIB 2.6: for each, whether its assumptions and guarantees can hold together."""

from __future__ import annotations

from avow.base.diagnostics import Diagnostic, Rejected
from avow.language.contract import Contract
from avow.solving.smtlib import export
from avow.solving.translation import Unsupported


def to_smtlib(contract: Contract) -> str:
    """One script; between nodes the solver is reset. Raises `Rejected` where SMT-LIB cannot say a formula."""
    scripts = []
    for node in contract.nodes:
        formulas = {clause.name: clause.formula for clause in node.clauses}
        comment = f"node {node.name}: {', '.join(formulas)}"
        try:
            scripts.append(export(formulas, comment=comment))
        except Unsupported as unsupported:
            raise Rejected(
                Diagnostic("SMT001", f"node `{node.name}` has no SMT-LIB form: {unsupported}", node.span)
            ) from None
    return "(reset)\n".join(scripts)
