"""What a backend that judges runs of steps can be asked about, said in one way for all of them."""

from __future__ import annotations

from avow.formulas.temporal.cell import Unsaid
from avow.formulas.temporal.cells import Records
from avow.language.contract import Clause, Node
from avow.language.subterms import histories


def unsaid(judge: str, node: Node, clause: Clause, *, functions: bool = False) -> str | None:
    """Why whoever judges runs of steps by cells (`avow.formulas.temporal`) cannot be asked about a guarantee, if he
    cannot: the guarantee, or an assumption of the node, has no cells, or such as keep something for each value of a
    quantified variable (`functions` says that he can do with those)."""
    for each in (clause, *node.assumptions):
        reason = _reason(each, functions)
        if reason is not None:
            about = f"{node.name}.{each.name}" if each is clause else f"{node.name}'s assumption {each.name}"
            return f"{judge} judges runs of steps and has no {reason}, of which {about} speaks"
    return None


def _reason(clause: Clause, functions: bool) -> str | None:
    for record in histories(clause.formula):
        if record.limit is not None and not record.limit.steps:
            return f"`{record.operator}` with a limit in seconds"
    records = Records()
    try:
        records.clause(clause.formula)
    except Unsaid as unsaid:
        return unsaid.reason
    for cell in records.cells:
        if cell.parameters and not functions:
            return f"record of each value of {cell.parameters[0].name}"
    return None
