"""Does a node's contract look like an agent's? Agents decide: they believe things and command one thing of several.
What compares or computes measured values is a program's affair, and Gwendolen has no arithmetic for it."""

from __future__ import annotations

from avow.language.contract import Node
from avow.language.sorts import DataSort, EnumSort, FunctionSort, RealSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Compare, Negative, Operation, Term


def looks_like_an_agent(node: Node) -> bool:
    """Some output is a choice, none is a number or a table of numbers, and no clause measures."""
    sorts = [port.sort for port in node.outputs]
    decides = any(
        isinstance(sort, DataSort) or (isinstance(sort, EnumSort) and len(sort.members) > 1) for sort in sorts
    )
    return decides and not any(map(_is_measured, sorts)) and not any(_measures(c.formula) for c in node.clauses)


def _is_measured(sort: Sort) -> bool:
    return isinstance(sort, RealSort) or (isinstance(sort, FunctionSort) and isinstance(sort.result, RealSort))


def _measures(formula: Term) -> bool:
    for term in subterms(formula):
        match term:
            case Arithmetic(sort=RealSort()) | Negative(sort=RealSort()) | Operation(sort=RealSort()):
                return True
            case Compare(operator="<" | "<=" | ">" | ">=", left=left) if isinstance(left.sort, RealSort):
                return True
    return False
