"""Clauses about future steps, as temporal properties: the part that needs no counting.

`T -> eventually(R)` is ``[] (T -> <> R)``. `within` and `next` become the same, and the time limit is a hypothesis.
`T -> R until U` is ``[] (T -> (U R (R || U)))``, of the agent's states: they are finer than the contract's steps, so
that a run on which it fails refutes nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from avow.formulas.formula import conjunction, free_variables
from avow.formulas.temporal.responses import responding
from avow.language.contract import Clause, Node
from avow.language.printer import show_term
from avow.language.subterms import histories
from avow.language.terms import TRUE, History, Implies, Past, Quantified, Quantifier, Role, Term


@dataclass(frozen=True, slots=True)
class Timed:
    """A guarantee about future steps. `formula` is ``T -> R`` under the quantifiers around it."""

    operator: Past
    formula: Term
    ends: Term | None
    """U, of `until`."""
    hypothesis: str
    """The part of it that is not shown."""


def timed(formula: Term) -> Timed | None:
    """A clause that is a response; None for one about a single step."""
    found = responding(formula)
    if found is None:
        return None
    outer, triggers, response = found
    trigger, wanted = conjunction(triggers), response.arguments[0]
    body: Term = wanted if trigger == TRUE else Implies(trigger, wanted)
    whole = Quantified(Quantifier.FORALL, outer, body) if outer else body
    ends = response.arguments[1] if response.operator is Past.UNTIL else None
    return Timed(response.operator, whole, ends, _hypothesis(response))


def _hypothesis(response: History) -> str:
    match response.operator:
        case Past.WITHIN:
            assert response.limit is not None
            limit = show_term(response.limit.amount)
            return f"that it comes within {limit} steps: it was shown to come at some time"
        case Past.NEXT:
            return "that it comes at the next step: it was shown to come at some time"
        case _:  # as it is written
            return ""


def unsaid(judge: str, node: Node, clause: Clause) -> str | None:
    """Why a guarantee about other steps, or whose node has an assumption about other steps, cannot be checked."""
    for each in node.assumptions:
        for record in histories(each.formula):
            about = f"of which {node.name}'s assumption {each.name} speaks"
            return f"{judge} judges runs of an agent and has no `{record.operator}`, {about}"
    why = next(_lacking(clause.formula), None)
    return (
        None
        if why is None
        else f"{judge} judges runs of an agent and has no {why}, of which {node.name}.{clause.name} speaks"
    )


def _lacking(formula: Term) -> Iterator[str]:
    found = responding(formula)
    response = found[2] if found is not None else None
    for record in histories(formula):
        if record is not response:
            yield f"`{record.operator}`"
    if response is None:
        return
    if response.operator is Past.FOR:
        yield "`for`"
    if response.limit is not None and not response.limit.steps:
        yield f"`{response.operator}` with a limit in seconds"
    inputs = sorted(v.qualified for v in free_variables(response.arguments[0]) if v.role is Role.INPUT)
    if inputs and response.operator is not Past.UNTIL:
        yield f"`{response.operator}` of an input ({inputs[0]})"
