"""A formula as a disjunction of conjunctions, one level at a time: the search for a quantifier's values handles one
conjunction at a time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.base.records import dataclass
from avow.formulas.formula import opposite
from avow.formulas.renaming import bound_names
from avow.language import terms as t
from avow.language.operators import definition
from avow.language.sorts import BOOL, BoolSort, FunctionSort
from avow.language.subterms import subterms


@dataclass(frozen=True, slots=True)
class Part:
    """A formula that has to be true, or false."""

    term: t.Term
    positive: bool
    names: frozenset[str]


def branches(
    term: t.Term, positive: bool, variables: tuple[t.Variable, ...]
) -> Iterator[tuple[list[Part], tuple[t.Variable, ...]]]:
    parts, inner = conjunction(term, positive)
    variables = (*variables, *inner)
    options = alternatives(parts[0].term, parts[0].positive) if len(parts) == 1 else None
    if options is None:
        yield parts, variables
    else:
        for option, truth in options:
            yield from branches(option, truth, variables)


def conjunction(term: t.Term, positive: bool) -> tuple[list[Part], list[t.Variable]]:
    """The conjuncts of a formula, and the variables of the existential quantifiers around them."""
    variables: list[t.Variable] = []
    parts = [Part(part, truth, bound_names(part)) for part, truth in _apart(term, positive, variables)]
    return parts, variables


def conjuncts(term: t.Term, positive: bool) -> list[t.Term]:
    """The conjuncts of a formula, or of its negation; a quantified part is not split."""
    parts = (part if truth else opposite(part) for part, truth in _apart(term, positive, None))
    return [part for part in parts if part != t.TRUE]


def _apart(term: t.Term, positive: bool, variables: list[t.Variable] | None) -> Iterator[tuple[t.Term, bool]]:
    stack = [(term, positive)]
    while stack:
        term, positive = stack.pop()
        match term:
            case t.Not(body=body):
                stack.append((body, not positive))
            case t.And(items=items) if positive:
                stack.extend((item, True) for item in reversed(items))
            case t.Or(items=items) if not positive:
                stack.extend((item, False) for item in reversed(items))
            case t.Implies(left=left, right=right) if not positive:
                stack.extend(((right, False), (left, True)))
            case t.Quantified(quantifier=t.Quantifier.EXISTS) if positive and variables is not None:
                variables.extend(term.variables)
                stack.append((term.body, True))
            case t.Quantified(quantifier=t.Quantifier.FORALL) if not positive and variables is not None:
                variables.extend(term.variables)
                stack.append((term.body, False))
            case t.Compare(operator="==" | "!=" as operator, left=left, right=t.Literal(value=bool() as value)):
                stack.append((left, positive is ((operator == "==") is value)))
            case t.Compare(operator="==" | "!=" as operator, left=t.Literal(value=bool() as value), right=right):
                stack.append((right, positive is ((operator == "==") is value)))
            case _:  # a part that is evaluated as a whole
                yield term, positive


def alternatives(term: t.Term, positive: bool) -> tuple[tuple[t.Term, bool], ...] | None:
    """The disjuncts of a formula; None if it is not a disjunction."""
    match term:
        case t.Or(items=items) if positive:
            return tuple((item, True) for item in items)
        case t.And(items=items) if not positive:
            return tuple((item, False) for item in items)
        case t.Implies(left=left, right=right) if positive:
            return ((left, False), (right, True))
        case t.Compare(operator="==" | "!=" as operator) if term.left.sort == BOOL:
            return alternatives(t.Iff(term.left, term.right), positive is (operator == "=="))
        case t.Iff(left=left, right=right):
            if positive:
                return ((t.And((left, right)), True), (t.And((t.Not(left), t.Not(right))), True))
            return ((t.And((left, t.Not(right))), True), (t.And((t.Not(left), right)), True))
        case t.Operation(sort=BoolSort()) if (defined := definition(term)) is not None:
            return alternatives(defined, positive)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            return ((_both(condition, then, positive), True), (_both(t.Not(condition), otherwise, positive), True))
        case _:  # not a disjunction: evaluated as a whole
            return None


def _both(condition: t.Term, branch: t.Term, positive: bool) -> t.Term:
    return t.And((condition, branch if positive else t.Not(branch)))


def occurring(parts: Sequence[Part], unbound: set[str]) -> list[t.Variable]:
    """The unbound variables that the parts mention."""
    found = {
        term.name: term
        for part in parts
        for term in subterms(part.term)
        if isinstance(term, t.Variable) and term.qualified in unbound
    }
    return [found[name] for name in sorted(found)]


def relations(term: t.Term) -> Iterator[t.Variable]:
    for part in subterms(term):
        if isinstance(part, t.Variable) and isinstance(part.sort, FunctionSort) and part.sort.result == BOOL:
            yield part
