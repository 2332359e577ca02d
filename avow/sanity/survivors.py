"""What would tell a mutant from the guarantee in whose place it stands: why a method may have let it pass.

Two cases differ in what is to be done about them. At some input, *every* answer that the contract allows may break the
mutant: a program that keeps the contract breaks it there, so a method that accepts the mutant has not looked there. Or
the contract allows an answer that the mutant forbids, and others too: then only a program that gives that answer shows
the difference, and the method need not be to blame.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from avow.base.verdict import Verdict
from avow.formulas.formula import free_variables
from avow.formulas.values import Value
from avow.language.contract import Node
from avow.language.printer import show_term
from avow.language.terms import Role, Term, Variable
from avow.sanity.mutants import Mutant
from avow.solving.counterexample import show_values


@dataclass(frozen=True, slots=True)
class Difference:
    """`formula` is the mutant. `at` is an input and `answer` an output that the contract allows there and the mutant
    does not, in the contract's words; with `forced`, every output that it allows there is such a one. Both are empty
    where none was found in time."""

    change: str
    formula: str
    at: tuple[tuple[str, str], ...] = ()
    answer: tuple[tuple[str, str], ...] = ()
    forced: bool = False

    @property
    def why(self) -> str:
        """One sentence: where the two differ, and what would see it."""
        if not self.at and not self.answer:
            return "where the two differ was not found in time"
        if self.forced:
            place = f"at {_listed(self.at)}" if self.at else "at every input"
            return f"{place} every answer that the contract allows breaks it, {_listed(self.answer)} too"
        place = f" at {_listed(self.at)}" if self.at else ""
        return f"the contract also allows {_listed(self.answer)}{place}, which breaks it, and others, which do not"


def difference(node: Node, mutant: Mutant, effort: int = 4_000) -> Difference:
    """What distinguishes the mutant of one of the node's guarantees from the node's contract; at most so much
    effort for each of two questions."""
    from avow.sanity.realizability import realizable
    from avow.solving.questions import entails, solve

    told = Difference(mutant.change, show_term(mutant.formula))
    assumptions = {f"assumed {c.name}": c.formula for c in node.assumptions}
    guarantees = {c.name: c.formula for c in node.guarantees}
    inputs = tuple(port.variable for port in node.inputs)
    outputs = tuple(port.variable for port in node.outputs)
    wanted = {**guarantees, " mutant": mutant.formula}
    kept = realizable(inputs, outputs, assumptions, wanted, effort=effort, doubtful=True)
    if kept.verdict is Verdict.REFUTED:
        found = solve(guarantees, given=kept.inputs, variables=outputs, effort=effort)
        if found.status == "sat":  # else the contract itself has no answer there, and shows no difference
            concerned = [formula for name, formula in guarantees.items() if name in kept.group]
            return _shown(told, {**kept.inputs, **found.values}, [mutant.formula, *concerned], forced=True)
    answer = entails({**assumptions, **guarantees}, mutant.formula, effort=effort)
    return _shown(told, answer.values, [mutant.formula]) if answer.verdict is Verdict.REFUTED else told


def _shown(
    told: Difference, values: Mapping[Variable, Value], formulas: list[Term], forced: bool = False
) -> Difference:
    """With the inputs of which the formulas speak, and the outputs of which the mutant (the first of them) does."""
    inputs = frozenset[Variable]().union(*map(free_variables, formulas))
    outputs = free_variables(formulas[0])

    def of(role: Role, spoken: frozenset[Variable]) -> tuple[tuple[str, str], ...]:
        names = {v.qualified for v in spoken if v.role is role}
        return show_values({v: value for v, value in values.items() if v.qualified in names})

    return replace(told, at=of(Role.INPUT, inputs), answer=of(Role.OUTPUT, outputs), forced=forced)


def _listed(values: tuple[tuple[str, str], ...]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values) or "this"
