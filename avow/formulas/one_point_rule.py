"""The one-point rule: a quantified variable that can have only one value is replaced by that value.

``exists(i | c == inspect(i) and P(i))`` means that c is an `inspect` and that P holds for its argument: the rule goes
through constructors, tuples, sums and differences. A whole number between two literals has few values, and is replaced
by each in turn. The meaning is the same for all sorts: a variable's value must be of its sort, which is stated if the
sort of the term is wider.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from fractions import Fraction

from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.tuning.bounds import NUMBERS_WRITTEN_OUT, PARTS_SEARCHED
from avow.formulas.disjunctions import conjuncts
from avow.formulas.formula import conjunction, disjunction, free_variables, opposite, substitute
from avow.formulas.traversal import transform
from avow.language import terms as t
from avow.language.bounds import constant
from avow.language.operators import FLIPPED
from avow.language.sorts import INTEGER, NATURAL, REAL, IntegerSort, NaturalSort, Sort, TupleSort
from avow.language.subterms import subterms


@dataclass(frozen=True, slots=True)
class Solved:
    """The solution of an equation for some variables: their `values`, which mention none of them, and the `rest` that
    must hold as well."""

    values: Mapping[t.Variable, t.Term]
    rest: tuple[t.Term, ...]


def solved(equation: t.Term, unknown: Collection[t.Variable]) -> Solved | None:
    """An equation solved for those of the `unknown` variables that it determines; None if it determines none."""
    if not isinstance(equation, t.Iff) and not (isinstance(equation, t.Compare) and equation.operator == "=="):
        return None
    for pattern, known in (equation.children, reversed(equation.children)):
        if _mentions(pattern, unknown) and not _mentions(known, unknown):
            found = _matched(pattern, known, set(unknown))
            if found.values:
                return found
    return None


def made_with(term: t.Term) -> str | None:
    """The constructor with which a value was made (for ``!=``: was not made), if the term is such a condition as
    `solved` writes it; otherwise None."""
    match term:
        case t.Compare(operator="==" | "!=", left=left, right=t.Construct(constructor=name, arguments=arguments)):
            own = (isinstance(a, t.Argument) and a.constructor == name and a.value == left for a in arguments)
            return name if arguments and all(own) else None
        case _:  # not such a condition
            return None


@by_identity(10_000)
def without_points(formula: t.Term) -> t.Term:
    """The formula without the quantified variables that can have only one value, or few between two literals."""
    if not any(isinstance(part, t.Quantified) for part in subterms(formula)):
        return formula
    return transform(formula, _without)


def _mentions(term: t.Term, unknown: Collection[t.Variable]) -> bool:
    return any(variable in unknown for variable in free_variables(term))


def _matched(pattern: t.Term, known: t.Term, unknown: set[t.Variable]) -> Solved:
    """``pattern == known`` solved; `known` mentions none of the unknown variables."""
    values: dict[t.Variable, t.Term] = {}
    rest: list[t.Term] = []
    waiting = [(pattern, known)]
    while waiting:
        pattern, known = waiting.pop()
        turned = _turned(pattern, known, unknown) if isinstance(pattern, t.Arithmetic) else None
        match pattern:
            case t.Variable() if pattern in unknown and (within := _within(known, pattern.sort)) is not None:
                values[pattern] = known
                rest += within
                unknown.remove(pattern)
            case t.Construct(constructor=name, arguments=arguments, sort=sort) if arguments and _mentions(
                pattern, unknown
            ):
                parameters = enumerate(sort.constructor(name).parameters)
                own = tuple(t.Argument(known, name, k, s).rebuild((known,)) for k, s in parameters)
                rest.append(t.Compare("==", known, t.Construct(name, own, sort)))
                waiting.extend(reversed(tuple(zip(arguments, own, strict=True))))
            case t.TupleTerm(items=items) if _mentions(pattern, unknown):
                assert isinstance(known.sort, TupleSort)
                parts = (t.Item(known, k, s).rebuild((known,)) for k, s in enumerate(known.sort.items))
                waiting.extend(reversed(tuple(zip(items, parts, strict=True))))
            case _ if turned is not None:
                waiting.append(turned)
            case _:  # determines no variable
                rest.append(t.Compare("==", pattern, known))
    return Solved(values, tuple(rest))


def _turned(pattern: t.Arithmetic, known: t.Term, unknown: Collection[t.Variable]) -> tuple[t.Term, t.Term] | None:
    """``s + t == known`` as ``s == known - t``, if only s is unknown, or only t; likewise for a difference."""
    left, right, sort = pattern.left, pattern.right, REAL if pattern.sort == REAL else INTEGER
    if pattern.operator not in ("+", "-") or _mentions(left, unknown) == _mentions(right, unknown):
        return None
    if _mentions(left, unknown):
        return left, t.Arithmetic("-" if pattern.operator == "+" else "+", known, right, sort)
    if pattern.operator == "+":
        return right, t.Arithmetic("-", known, left, sort)
    return right, t.Arithmetic("-", left, known, sort)


def _within(value: t.Term, sort: Sort) -> tuple[t.Term, ...] | None:
    """The conditions for a term's value to be of a sort; None if no formula expresses them. For NATURAL the condition
    is always stated: if a solver substitutes for a variable, its sort is at best known outside the formula."""
    if sort == NATURAL and value.sort in (INTEGER, NATURAL):
        return (t.Compare(">=", value, t.Literal(0, INTEGER)),)
    return () if value.sort == sort or (sort == INTEGER and value.sort == NATURAL) else None


# -- quantifiers -------------------------------------------------------------------------------------------------------


def _without(term: t.Term) -> t.Term:
    if not isinstance(term, t.Quantified) or term.quantifier is t.Quantifier.UNIQUE:
        return term
    exists = term.quantifier is t.Quantifier.EXISTS
    variables, parts = _eliminated(term.variables, conjuncts(term.body, exists))
    found = list(_cases(variables, parts))
    if len(found) == 1 and found[0][0] == term.variables:
        return term
    cases = [_closed(term, rest, case) for rest, case in found]
    return disjunction(cases) if exists else conjunction(cases)


def _eliminated(variables: tuple[t.Variable, ...], parts: list[t.Term]) -> tuple[tuple[t.Variable, ...], list[t.Term]]:
    """The variables still needed in "there are `variables` such that all `parts` hold", and the remaining parts."""
    while variables and len(parts) <= PARTS_SEARCHED:
        for at, part in enumerate(parts):
            found = solved(part, variables)
            if found is not None:
                variables = tuple(v for v in variables if v not in found.values)
                left = conjunction((*found.rest, *parts[:at], *parts[at + 1 :]))
                parts = conjuncts(substitute(left, found.values), True)
                break
        else:
            break
    return variables, parts


def _cases(
    variables: tuple[t.Variable, ...], parts: list[t.Term]
) -> Iterator[tuple[tuple[t.Variable, ...], list[t.Term]]]:
    """The same for each of a variable's few values, if the parts bound a whole number by literals."""
    for variable in variables:
        values = _range(variable, parts) if len(parts) <= PARTS_SEARCHED else None
        if values is not None:
            rest = tuple(v for v in variables if v != variable)
            for number in values:
                value = t.Literal(number, variable.sort)
                yield from _cases(rest, [substitute(part, {variable: value}) for part in parts])
            return
    yield variables, parts


def _range(variable: t.Variable, parts: Sequence[t.Term]) -> range | None:
    if not isinstance(variable.sort, IntegerSort | NaturalSort):
        return None
    low: list[Fraction] = [Fraction(0)] if variable.sort == NATURAL else []
    high: list[Fraction] = []
    for sign, number in (bound for part in parts for bound in _bounds(part, variable)):
        if sign in ("<", "<="):
            high.append(Fraction(math.ceil(number) - 1) if sign == "<" else number)
        else:
            low.append(Fraction(math.floor(number) + 1) if sign == ">" else number)
    if not low or not high or min(high) - max(low) >= NUMBERS_WRITTEN_OUT:
        return None
    return range(math.ceil(max(low)), math.floor(min(high)) + 1)


def _bounds(part: t.Term, variable: t.Variable) -> Iterator[tuple[str, Fraction]]:
    """``("<", 3)`` if a part states that the variable is less than 3."""
    if isinstance(part, t.Compare) and part.operator in FLIPPED:
        flipped = part.right, part.left, FLIPPED[part.operator]
        for one, other, sign in ((part.left, part.right, part.operator), flipped):
            inside = one.term if isinstance(one, t.Widen) else one
            if inside == variable and (number := constant(other)) is not None:
                yield sign, number


def _closed(term: t.Quantified, variables: tuple[t.Variable, ...], parts: Sequence[t.Term]) -> t.Term:
    """The formula that such values exist, or (for `forall`) that none do, with the last part as the consequence of the
    others, which reads better."""
    if term.quantifier is t.Quantifier.EXISTS:
        body = conjunction(parts)
    else:
        consequence = opposite(conjunction(parts[-1:]))
        body = t.Implies(conjunction(parts[:-1]), consequence) if len(parts) > 1 else consequence
    return t.Quantified(term.quantifier, variables, body, term.span) if variables else body
