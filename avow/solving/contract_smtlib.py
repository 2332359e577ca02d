"""A contract's nodes as SMT-LIB 2.6: for each, whether its assumptions and guarantees can hold together.

Of clauses that speak of other steps it is one step, whatever was before: what is remembered are constants, and what the
step leaves is said by an equation for each. First values are told in the comment.
"""

from __future__ import annotations

from dataclasses import replace

from avow.base.diagnostics import Diagnostic, Rejected
from avow.formulas.temporal.cells import compile_node
from avow.language.contract import Contract
from avow.language.printer import show_term
from avow.solving.smtlib import formulas_script
from avow.solving.translation import Unsupported


def to_smtlib(contract: Contract) -> str:
    """One script; between nodes the solver is reset. Raises `Rejected` where SMT-LIB cannot say a formula."""
    scripts = []
    for node in contract.nodes:
        compiled = compile_node(node)
        for name, unsaid in compiled.unsaid.items():
            message = f"node `{node.name}` has no SMT-LIB form: {name} speaks of {unsaid.reason}"
            raise Rejected(Diagnostic("SMT001", message, node.clause(name).span))
        formulas = {clause.name: clause.formula for clause in compiled.node.clauses}
        comment = f"node {node.name}: {', '.join(formulas)}"
        for cell in compiled.cells:
            formulas[f"next {cell.name}"] = cell.leaves(replace(cell.before, name=f"{cell.name}'"))
            first = " ".join(show_term(cell.begins(), "rcl").split())
            comment += f"\nbefore the first step: {first}" if cell.initial is not None else ""
        try:
            scripts.append(formulas_script(formulas, comment=comment))
        except Unsupported as unsupported:
            raise Rejected(
                Diagnostic("SMT001", f"node `{node.name}` has no SMT-LIB form: {unsupported}", node.span)
            ) from None
    return "(reset)\n".join(scripts)
