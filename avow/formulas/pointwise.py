"""Outputs that are functions, one point at a time.

If each guarantee mentions ``out.f`` at one point, for all points (``forall(x | out.f(x) > in.g(x))``), some function
meets them all if and only if at every point some value does: the values at other points do not matter, and one can be
chosen for each. So ``for all inputs some function`` becomes ``for all inputs and points some value``: no function has
to be found, and it does not matter whether it has a description or is bounded.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from avow.base.tuning.bounds import POINTWISE_PARTS
from avow.base.tuning.sizes import CONDITION_DEPTH
from avow.formulas.formula import conjunction, disjunction, free_variables, substitute
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.renaming import map_children, rename_apart
from avow.formulas.traversal import depth
from avow.language.sorts import FunctionSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import And, Apply, Compare, Implies, Or, Quantified, Quantifier, Role, Term, Variable

Values = Mapping[Variable, Variable]


@dataclass(frozen=True, slots=True)
class Pointwise:
    """Guarantees about one point. `values` maps each function to the output that represents its value at `point`."""

    point: tuple[Variable, ...]
    guarantees: Mapping[str, Term]
    values: Values

    @property
    def outputs(self) -> tuple[Variable, ...]:
        return tuple(self.values.values())


def pointwise(guarantees: Mapping[str, Term], outputs: Sequence[Variable]) -> Pointwise | None:
    """The equivalent guarantees about one point; None if they relate several points, or if the outputs are not
    functions with parameters of the same sorts."""
    kinds = {v.sort.parameters if isinstance(v.sort, FunctionSort) else None for v in outputs}
    if len(kinds) != 1 or any(depth(formula) > CONDITION_DEPTH for formula in guarantees.values()):
        return None
    parameters = kinds.pop()
    if parameters is None:
        return None
    point = tuple(Variable(Role.INPUT, f"point {k}", sort) for k, sort in enumerate(parameters))
    values = {v: Variable(Role.OUTPUT, f"{v.name} there", _result(v.sort)) for v in outputs}
    found: dict[str, Term] = {}
    for label, formula in guarantees.items():
        parts: list[Term] = []
        for over, body in _parts(rename_apart(push_negations(formula)), (), values):
            part = _at(over, body, point, values)
            if part is None or len(parts) >= POINTWISE_PARTS:
                return None
            parts.append(part)
        found[label] = conjunction(parts)
    return Pointwise(point, found, values)


def _result(sort: Sort) -> Sort:
    assert isinstance(sort, FunctionSort)
    return sort.result


def _parts(term: Term, over: tuple[Variable, ...], values: Values) -> Iterator[tuple[tuple[Variable, ...], Term]]:
    """The formula as parts, each demanded for all values of some variables. No name is bound twice."""
    match term:
        case And(items=items):
            for item in items:
                yield from _parts(item, over, values)
        case Quantified(quantifier=Quantifier.FORALL, variables=variables, body=body):
            yield from _parts(body, (*over, *variables), values)
        case Or(items=items):
            opens = next((item for item in items if _is_several(item) and _speaks(item, values)), None)
            if opens is None:
                yield over, term
                return
            others = [item for item in items if item is not opens]
            for inner, part in _parts(opens, (), values):
                yield from _parts(disjunction((*others, part)), (*over, *inner), values)
        case _:  # a single part
            yield over, term


def _is_several(term: Term) -> bool:
    return isinstance(term, And) or (isinstance(term, Quantified) and term.quantifier is Quantifier.FORALL)


def _at(over: Sequence[Variable], body: Term, point: Sequence[Variable], values: Values) -> Term | None:
    """A part restated for the point; None if it mentions several points."""
    places = {term.arguments for term in subterms(body) if isinstance(term, Apply) and term.function in values}
    if not places:
        return None if _speaks(body, values) else _for_all(over, body)
    place, *others = places
    if others or any(_speaks(a, values) or not free_variables(a) <= free_variables(body) for a in place):
        return None  # points that differ, or depend on a function's value, or on a variable bound further inside
    body = _replace(body, values)
    if _speaks(body, values):
        return None  # a function that is used as a whole
    direct: dict[Variable, Term] = {}
    elsewhere: list[Term] = []
    for parameter, argument in zip(point, place, strict=True):
        new = isinstance(argument, Variable) and argument in over and argument not in direct
        if isinstance(argument, Variable) and new and argument.sort == parameter.sort:
            direct[argument] = parameter
        else:
            elsewhere.append(Compare("==", parameter, argument))
    here = Implies(conjunction(elsewhere), body) if elsewhere else body
    return _for_all(over, substitute(here, direct))


def _speaks(term: Term, values: Values) -> bool:
    return not values.keys().isdisjoint(free_variables(term))


def _for_all(over: Sequence[Variable], body: Term) -> Term:
    used = tuple(variable for variable in over if variable in free_variables(body))
    return Quantified(Quantifier.FORALL, used, body) if used else body


def _replace(term: Term, values: Values) -> Term:
    if isinstance(term, Apply) and isinstance(term.function, Variable) and term.function in values:
        return values[term.function]
    return map_children(term, lambda child: _replace(child, values))
