"""A normal form of formulas for matching against a plan's table: formulas that differ only in notation must look the
same.

Negation normal form over ``== < <= in`` and applications; ``f(x) == TRUE`` is ``f(x)``; ``t != s`` and ``!in`` are
negations; quantifiers are as far inside as possible: ``exists(x | P or Q)`` is two, and parts that do not mention x are
outside. (All sorts are non-empty, so that is sound.) The meaning is preserved.
"""

from __future__ import annotations

from fractions import Fraction

from avow.formulas.flattening import joined
from avow.formulas.negation_normal_form import push_negations
from avow.formulas.renaming import bound_names
from avow.language import terms as t
from avow.language.operators import FLIPPED
from avow.language.sorts import BOOL, INTEGER, NATURAL, BoolSort, IntegerSort, NaturalSort, RealSort

from .tuning import MULTIPLIED_OUT, PARTS


class TooComplex(Exception):  # noqa: N818 - it names what happened
    """The formula multiplies out to too many parts."""


def shape(term: t.Term) -> t.Term:
    """The normal form of a formula. Raises TooComplex."""
    if _written_out(term) > PARTS:
        raise TooComplex
    return _shaped(term)


def _written_out(term: t.Term) -> int:
    """How many parts the formula has once `<=>`, `xor` and conditionals are written out, which doubles theirs."""
    sizes = [_written_out(child) for child in term.children]
    match term:
        case t.Conditional(sort=sort) if sort == BOOL:
            return 1 + sum(sizes) + sizes[0]
        case t.Iff() | t.Operation(sort=BoolSort()):
            return 1 + 2 * sum(sizes)
        case t.Compare(left=left) if left.sort == BOOL:
            return 1 + 2 * sum(sizes)
        case _:  # its parts occur in it once
            return 1 + sum(sizes)


def conjuncts(term: t.Term) -> tuple[t.Term, ...]:
    return term.items if isinstance(term, t.And) else (() if term == t.TRUE else (term,))


def disjuncts(term: t.Term) -> tuple[t.Term, ...]:
    return term.items if isinstance(term, t.Or) else (() if term == t.FALSE else (term,))


def conjunction(items: list[t.Term]) -> t.Term:
    return joined(items, t.And, t.TRUE, t.FALSE, once=True)


def disjunction(items: list[t.Term]) -> t.Term:
    return joined(items, t.Or, t.FALSE, t.TRUE, once=True)


def _shaped(term: t.Term) -> t.Term:
    return _formula(push_negations(term))


def _formula(term: t.Term) -> t.Term:
    """The normal form of a formula whose negations are at its atoms."""
    match term:
        case t.And(items=items):
            return conjunction([_formula(i) for i in items])
        case t.Or(items=items):
            return disjunction([_formula(i) for i in items])
        case t.Iff(left=left, right=right):
            one = disjunction([_shaped(t.Not(left)), _formula(right)])
            return conjunction([one, disjunction([_formula(left), _shaped(t.Not(right))])])
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            yes = disjunction([_shaped(t.Not(condition)), _formula(then)])
            return conjunction([yes, disjunction([_formula(condition), _formula(otherwise)])])
        case t.Quantified(quantifier=t.Quantifier.UNIQUE, variables=variables, body=body):
            return t.Quantified(t.Quantifier.UNIQUE, variables, _shaped(body), term.span)
        case t.Quantified(quantifier=quantifier, variables=variables, body=body):
            return _quantified(quantifier is t.Quantifier.EXISTS, variables, _formula(body))
        case t.Literal():
            return term
        case t.Not(body=t.Compare() as body):
            return _comparison(body, False)
        case t.Not(body=body):
            return t.Not(_formula(body))
        case t.Compare():
            return _comparison(term, True)
        case t.In(item=item, collection=t.SetTerm(items=items) as collection):
            members = tuple(sorted({_value(m) for m in items}, key=repr))
            return t.In(_value(item), t.SetTerm(members, collection.sort), term.span)
        case _:  # an atom: its terms normalised
            return _value(term)


def _comparison(term: t.Compare, positive: bool) -> t.Term:
    operator, left, right = term.operator, term.left, term.right
    if operator in (">", ">="):
        operator, left, right = FLIPPED[operator], right, left
    if not positive and operator in ("<", "<="):
        operator, left, right, positive = {"<": "<=", "<=": "<"}[operator], right, left, True
    made_left, made_right = _value(left), _value(right)
    if isinstance(made_left, t.Literal) and isinstance(made_right, t.Literal):
        a, b = made_left.value, made_right.value
        holds = a == b if operator == "==" else (a < b if operator == "<" else a <= b)  # type: ignore[operator]
        return t.TRUE if holds is positive else t.FALSE
    made = t.Compare(operator, made_left, made_right, term.span)
    return made if positive else t.Not(made)


def _value(term: t.Term) -> t.Term:
    """A term of another sort than BOOL, or an atom: literals folded, the formulas within it normalised."""
    if isinstance(term, t.Literal):
        if isinstance(term.sort, IntegerSort | NaturalSort) and isinstance(term.value, int):
            return _integer(term.value)
        return t.Literal(Fraction(term.value), term.sort) if isinstance(term.sort, RealSort) else term
    parts = tuple(_shaped(p) if p.sort == BOOL and p.children else _value(p) for p in term.children)
    made = term.rebuild(parts)
    match made:
        case t.Widen(term=t.Literal(value=value)) if not isinstance(value, str):
            return t.Literal(Fraction(value), made.sort)
        case t.Negative(term=t.Literal(value=value)) if not isinstance(value, str):
            return _integer(-value) if isinstance(value, int) else t.Literal(-value, made.sort)
        case t.Arithmetic(operator=operator, left=t.Literal(value=a), right=t.Literal(value=b)):
            if isinstance(a, int) and isinstance(b, int) and operator in ("+", "-", "*"):
                return _integer(a + b if operator == "+" else a - b if operator == "-" else a * b)
    return made


def _integer(value: int) -> t.Literal:
    return t.Literal(value, NATURAL if value >= 0 else INTEGER)


def _quantified(exists: bool, variables: tuple[t.Variable, ...], body: t.Term) -> t.Term:
    """``exists`` distributes over ``or`` and encloses only what it binds (``forall`` the other way round)."""
    outer = disjuncts if exists else conjuncts
    join_outer = disjunction if exists else conjunction
    blocks = []
    for block in outer(_multiplied(exists, variables, body)):
        blocks.append(_scoped(exists, variables, block))
    return join_outer(blocks)


def _multiplied(exists: bool, variables: tuple[t.Variable, ...], body: t.Term) -> t.Term:
    """Disjunctive form (for ``exists``) of the parts that mention the variables."""
    names = {v.name for v in variables}
    inner = conjuncts if exists else disjuncts
    outer = disjuncts if exists else conjuncts
    join_inner = conjunction if exists else disjunction
    join_outer = disjunction if exists else conjunction
    kind = t.Or if exists else t.And
    if isinstance(body, kind):
        return join_outer([_multiplied(exists, variables, part) for part in body.items])
    rows: list[list[t.Term]] = [[]]
    for item in inner(body):
        choices = outer(item) if isinstance(item, kind) and names & bound_names(item) else (item,)
        rows = [[*row, choice] for row in rows for choice in choices]
        if len(rows) > MULTIPLIED_OUT:
            raise TooComplex
    if len(rows) == 1:
        return body
    return join_outer([_multiplied(exists, variables, join_inner(row)) for row in rows])


def _scoped(exists: bool, variables: tuple[t.Variable, ...], block: t.Term) -> t.Term:
    """Conjuncts (for ``exists``) that share no variable are separated."""
    inner = conjuncts if exists else disjuncts
    join = conjunction if exists else disjunction
    names = {v.name for v in variables}
    groups: list[tuple[set[str], list[t.Term]]] = []
    outside: list[t.Term] = []
    for item in inner(block):
        mentioned = set(bound_names(item)) & names
        if not mentioned:
            outside.append(item)
            continue
        joined = [item]
        for group in [g for g in groups if g[0] & mentioned]:
            mentioned |= group[0]
            joined = group[1] + joined
            groups.remove(group)
        groups.append((mentioned, joined))
    quantifier = t.Quantifier.EXISTS if exists else t.Quantifier.FORALL
    made = [
        t.Quantified(quantifier, tuple(v for v in variables if v.name in mentioned), join(items), items[0].span)
        for mentioned, items in groups
    ]
    return join([*outside, *made]) if inner(block) else block
