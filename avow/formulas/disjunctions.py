"""A formula as a disjunction of conjunctions, one level at a time: a quantifier searches one conjunction at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.base.records import dataclass
from avow.formulas.formula import opposite
from avow.formulas.renaming import bound_names
from avow.language.operators import definition
from avow.language.sorts import BOOL, BoolSort, FunctionSort
from avow.language.subterms import subterms
from avow.language.terms import (
    TRUE,
    And,
    Compare,
    Conditional,
    Iff,
    Implies,
    Literal,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Term,
    Variable,
)


@dataclass(frozen=True, slots=True)
class Part:
    """A formula that has to be true, or false."""

    term: Term
    positive: bool
    names: frozenset[str]


def branches(
    term: Term, positive: bool, variables: tuple[Variable, ...]
) -> Iterator[tuple[list[Part], tuple[Variable, ...]]]:
    parts, inner = conjunction(term, positive)
    variables = (*variables, *inner)
    options = alternatives(parts[0].term, parts[0].positive) if len(parts) == 1 else None
    if options is None:
        yield parts, variables
    else:
        for option, truth in options:
            yield from branches(option, truth, variables)


def conjunction(term: Term, positive: bool) -> tuple[list[Part], list[Variable]]:
    """The conjunction that a formula is, and the variables of the existential quantifiers on the way to its parts."""
    variables: list[Variable] = []
    parts = [Part(part, truth, bound_names(part)) for part, truth in _apart(term, positive, variables)]
    return parts, variables


def conjuncts(term: Term, positive: bool) -> list[Term]:
    """The conjunction that a formula, or its negation, is; a quantified part stays one."""
    parts = (part if truth else opposite(part) for part, truth in _apart(term, positive, None))
    return [part for part in parts if part != TRUE]


def _apart(term: Term, positive: bool, variables: list[Variable] | None) -> Iterator[tuple[Term, bool]]:
    stack = [(term, positive)]
    while stack:
        term, positive = stack.pop()
        match term:
            case Not(body=body):
                stack.append((body, not positive))
            case And(items=items) if positive:
                stack.extend((item, True) for item in reversed(items))
            case Or(items=items) if not positive:
                stack.extend((item, False) for item in reversed(items))
            case Implies(left=left, right=right) if not positive:
                stack.extend(((right, False), (left, True)))
            case Quantified(quantifier=Quantifier.EXISTS) if positive and variables is not None:
                variables.extend(term.variables)
                stack.append((term.body, True))
            case Quantified(quantifier=Quantifier.FORALL) if not positive and variables is not None:
                variables.extend(term.variables)
                stack.append((term.body, False))
            case Compare(operator="==" | "!=" as operator, left=left, right=Literal(value=bool() as value)):
                stack.append((left, positive is ((operator == "==") is value)))
            case Compare(operator="==" | "!=" as operator, left=Literal(value=bool() as value), right=right):
                stack.append((right, positive is ((operator == "==") is value)))
            case _:  # a part that is judged as a whole
                yield term, positive


def alternatives(term: Term, positive: bool) -> tuple[tuple[Term, bool], ...] | None:
    """The sides of a formula that is a disjunction."""
    match term:
        case Or(items=items) if positive:
            return tuple((item, True) for item in items)
        case And(items=items) if not positive:
            return tuple((item, False) for item in items)
        case Implies(left=left, right=right) if positive:
            return ((left, False), (right, True))
        case Compare(operator="==" | "!=" as operator) if term.left.sort == BOOL:
            return alternatives(Iff(term.left, term.right), positive is (operator == "=="))
        case Iff(left=left, right=right):
            if positive:
                return ((And((left, right)), True), (And((Not(left), Not(right))), True))
            return ((And((left, Not(right))), True), (And((Not(left), right)), True))
        case Operation(sort=BoolSort()) if (defined := definition(term)) is not None:
            return alternatives(defined, positive)
        case Conditional(condition=condition, then=then, otherwise=otherwise):
            return ((_both(condition, then, positive), True), (_both(Not(condition), otherwise, positive), True))
        case _:  # no disjunction: evaluated as a whole
            return None


def _both(condition: Term, branch: Term, positive: bool) -> Term:
    return And((condition, branch if positive else Not(branch)))


def occurring(parts: Sequence[Part], unbound: set[str]) -> list[Variable]:
    """The unbound variables that the parts mention."""
    found = {
        term.name: term
        for part in parts
        for term in subterms(part.term)
        if isinstance(term, Variable) and term.qualified in unbound
    }
    return [found[name] for name in sorted(found)]


def relations(term: Term) -> Iterator[Variable]:
    for part in subterms(term):
        if isinstance(part, Variable) and isinstance(part.sort, FunctionSort) and part.sort.result == BOOL:
            yield part
