"""Formulas as meanings: normal form, digest, free variables, substitution.

Two formulas with the same digest mean the same; the converse need not hold (equivalence is for a solver). The digest
does not change under renaming of bound variables, reordering or bracketing of `and` and `or`, the side on which an
equation is written, `a > b` for `b < a`, `p == TRUE` for `p`, or the order in which a type's elements are listed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable, Mapping
from typing import assert_never

from avow.base.remembered import by_identity
from avow.formulas.flattening import joined
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.contract import Clause, Node
from avow.language.operators import OPPOSITE

# -- building ----------------------------------------------------------------------------------------------------------


def conjunction(terms: Iterable[t.Term]) -> t.Term:
    """``and`` of all the terms, flattened; TRUE if there are none."""
    return joined(terms, t.And, t.TRUE, t.FALSE)


def disjunction(terms: Iterable[t.Term]) -> t.Term:
    """``or`` of all the terms, flattened; FALSE if there are none."""
    return joined(terms, t.Or, t.FALSE, t.TRUE)


def negation(term: t.Term) -> t.Term:
    """``not``, without doubling it."""
    if isinstance(term, t.Not):
        return term.body
    if isinstance(term, t.Literal) and isinstance(term.value, bool):
        return t.FALSE if term.value else t.TRUE
    return t.Not(term)


def opposite(term: t.Term) -> t.Term:
    """An equivalent of ``not term``, without a leading `not` if there is such a form."""
    return t.Compare(OPPOSITE[term.operator], term.left, term.right) if isinstance(term, t.Compare) else negation(term)


def equation(one: t.Term, other: t.Term) -> t.Term:
    """The equation of two terms; ``<=>`` for formulas."""
    return t.Iff(one, other) if one.sort == s.BOOL else t.Compare("==", one, other)


# -- variables ---------------------------------------------------------------------------------------------------------


def free_variables(term: t.Term) -> frozenset[t.Variable]:
    """Inputs, outputs, and bound variables whose quantifier is not in the term."""
    free: set[t.Variable] = set()
    stack: list[tuple[t.Term, frozenset[t.Variable]]] = [(term, frozenset())]
    while stack:
        current, bound = stack.pop()
        if isinstance(current, t.Variable):
            if current not in bound:
                free.add(current)
            continue
        if isinstance(current, t.Quantified):
            bound = bound | frozenset(current.variables)
        stack.extend((child, bound) for child in current.children)
    return frozenset(free)


def substitute(term: t.Term, mapping: Mapping[t.Variable, t.Term]) -> t.Term:
    """Replace free variables by terms, all at once; bound variables are renamed if they would capture one."""
    if not mapping:
        return term
    taken = {variable.name for replacement in mapping.values() for variable in free_variables(replacement)}
    taken |= {variable.name for variable in free_variables(term)}

    def changed(current: t.Term, active: Mapping[t.Variable, t.Term]) -> t.Term:
        if isinstance(current, t.Variable):
            return active.get(current, current)
        if isinstance(current, t.Quantified):
            inner = {v: term for v, term in active.items() if v not in current.variables}
            renewed: list[t.Variable] = []
            for variable in current.variables:
                name = fresh(variable.name, taken) if inner and variable.name in taken else variable.name
                renamed = t.Variable(t.Role.BOUND, name, variable.sort, variable.span)
                if renamed != variable:
                    taken.add(name)
                    inner[variable] = renamed
                renewed.append(renamed)
            return t.Quantified(current.quantifier, tuple(renewed), changed(current.body, inner), current.span)
        parts = tuple(changed(child, active) for child in current.children)
        return current.rebuild(parts) if parts else current

    return changed(term, dict(mapping))


def fresh(name: str, taken: Collection[str]) -> str:
    """The name, with as many primes as needed to differ from those taken."""
    while name in taken:
        name += "'"
    return name


# -- normal form and digest --------------------------------------------------------------------------------------------


def normalise(term: t.Term) -> t.Term:
    """The normal form: same meaning, bound variables renamed by depth, commutative parts in a fixed order."""
    return _normal(term, {}, 0)[0]


def digest(*terms: t.Term) -> str:
    """SHA-256 of the meaning of some formulas; their order is irrelevant."""
    return _hash("formulas", *sorted(set(map(meaning, terms))), "sorts")


@by_identity(50_000)
def meaning(term: t.Term) -> str:
    """SHA-256 of the meaning of one formula."""
    return _normal(term, {}, 0)[1]


@by_identity(50_000)
def node_digest(node: Node, clause: Clause) -> str:
    """SHA-256 of one clause under its node's assumptions: the identity that evidence refers to."""
    assumed = digest(*(a.formula for a in node.assumptions if a != clause))
    return _hash(str(clause.kind), clause_digest(clause), assumed)


def clause_digest(clause: Clause) -> str:
    """SHA-256 of what a clause claims, with its probability."""
    if (chance := clause.chance) is None:
        return digest(clause.formula)
    unit = "run" if chance.per_run else "step"
    return _hash("chance", str(chance.least), unit, meaning(chance.given), meaning(chance.claim))


def sort_digest(sort: s.Sort) -> str:
    """SHA-256 of a sort by its definition: the name of an enumeration or a data type is irrelevant."""
    match sort:
        case s.BoolSort() | s.RealSort() | s.IntegerSort() | s.NaturalSort() | s.StringSort():
            return _hash(type(sort).__name__)
        case s.EnumSort(members=members):
            return _hash("enum", *sorted(members))
        case s.DataSort(constructors=constructors):
            made = (_hash(c.name, *map(sort_digest, c.parameters)) for c in constructors)
            return _hash("data", *sorted(made))
        case s.OpaqueSort(name=name):
            return _hash("opaque", name)
        case s.FunctionSort(parameters=parameters, result=result):
            return _hash("function", *map(sort_digest, parameters), sort_digest(result))
        case s.TupleSort(items=items):
            return _hash("tuple", *map(sort_digest, items), *(f"label {name}" for name in sort.labels))
        case s.SequenceSort(item=item):
            return _hash("sequence", sort_digest(item))
        case s.SetSort(item=item):
            return _hash("set", sort_digest(item))


def _hash(*parts: str) -> str:
    # Lengths make the encoding injective, whatever characters a name holds.
    return hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode("utf-8", "surrogatepass")).hexdigest()


_Keyed = tuple[t.Term, str]
"""A normal term and its digest: hashes of hashes, so that deep terms cost no more than wide ones."""

_FLIPPED = {">": "<", ">=": "<="}


def _normal(term: t.Term, scope: Mapping[t.Variable, t.Variable], level: int) -> _Keyed:
    if isinstance(term, t.Quantified):
        return _normal_quantified(term, scope, level)
    if isinstance(term, t.Variable):
        return _keyed(scope.get(term, term))
    if isinstance(term, t.And | t.Or):
        return _normal_junction(term, scope, level)
    parts = [_normal(child, scope, level) for child in term.children]
    match term:
        case t.Not():
            return _not(parts[0])
        case t.Iff():
            return _iff(*parts)
        case t.Compare(operator=operator):
            return _compare(operator, *parts)
        case t.Operation(operator=t.Builtin.XOR):
            return _not(_iff(*parts))
        case t.Arithmetic(operator="+" | "*") | t.Operation(operator=t.Builtin.MIN | t.Builtin.MAX):
            return _make(term, sorted(parts, key=_key))
        case t.SetTerm():
            return _make(term, sorted({key: (part, key) for part, key in parts}.values(), key=_key))
        case t.Literal() | t.EnumValue():
            return _keyed(term)
        case _:  # normal once its parts are, in their order
            return _make(term, parts)


def _normal_quantified(term: t.Quantified, scope: Mapping[t.Variable, t.Variable], level: int) -> _Keyed:
    variables, body = list(term.variables), term.body
    while (
        term.quantifier is not t.Quantifier.UNIQUE
        and isinstance(body, t.Quantified)
        and body.quantifier is term.quantifier
    ):
        variables.extend(body.variables)
        body = body.body
    inner = dict(scope)
    fresh: list[t.Variable] = []
    for offset, variable in enumerate(variables):
        canonical = t.Variable(t.Role.BOUND, f"${level + offset}", variable.sort)
        fresh.append(canonical)
        inner[variable] = canonical
    part = _normal(body, inner, level + len(variables))
    sorts = (sort_digest(v.sort) for v in fresh)
    return t.Quantified(term.quantifier, tuple(fresh), part[0]), _hash(term.quantifier, *sorts, part[1])


def _normal_junction(term: t.And | t.Or, scope: Mapping[t.Variable, t.Variable], level: int) -> _Keyed:
    kind = type(term)
    unit, zero = (t.TRUE, t.FALSE) if kind is t.And else (t.FALSE, t.TRUE)
    unique: dict[str, t.Term] = {}
    stack: list[t.Term] = list(reversed(term.items))
    while stack:
        item = stack.pop()
        if isinstance(item, kind):
            stack.extend(reversed(item.items))
            continue
        part = _normal(item, scope, level)
        if isinstance(part[0], kind):  # such as the normal form of "p and q == TRUE"
            unique.update((_term_key(inner), inner) for inner in part[0].items)
        elif part[0] == zero:
            return _keyed(zero)
        elif part[0] != unit:
            unique[part[1]] = part[0]
    items = [(inner, key) for key, inner in sorted(unique.items())]
    if not items:
        return _keyed(unit)
    return items[0] if len(items) == 1 else _make(kind(()), items)


def _compare(operator: str, left: _Keyed, right: _Keyed) -> _Keyed:
    if operator == "!=":
        return _not(_compare("==", left, right))
    if operator in _FLIPPED:
        operator, left, right = _FLIPPED[operator], right, left
    if operator == "==":
        if left[0].sort == s.BOOL:
            return _iff(left, right)
        left, right = sorted((left, right), key=_key)
    return _make(t.Compare(operator, left[0], right[0]), [left, right])


def _iff(left: _Keyed, right: _Keyed) -> _Keyed:
    for one, other in ((left, right), (right, left)):
        if one[0] == t.TRUE:
            return other
        if one[0] == t.FALSE:
            return _not(other)
    left, right = sorted((left, right), key=_key)
    return _make(t.Iff(left[0], right[0]), [left, right])


def _not(part: _Keyed) -> _Keyed:
    if isinstance(part[0], t.Not):
        return _keyed(part[0].body)
    if part[0] == t.TRUE:
        return _keyed(t.FALSE)
    if part[0] == t.FALSE:
        return _keyed(t.TRUE)
    return _make(t.Not(part[0]), [part])


def _key(part: _Keyed) -> str:
    return part[1]


def _make(term: t.Term, parts: Iterable[_Keyed]) -> _Keyed:
    parts = tuple(parts)
    return term.rebuild(tuple(part for part, _ in parts)), _hash(*_head(term), *(key for _, key in parts))


def _keyed(term: t.Term) -> _Keyed:
    return term, _term_key(term)


def _term_key(term: t.Term) -> str:
    """The digest of a term that is already normal."""
    return _hash(*_head(term), *map(_term_key, term.children))


def _head(term: t.Term) -> tuple[str, ...]:
    """The data of a term besides its direct subterms."""
    match term:
        case t.Literal(value=value, sort=sort):
            return (
                "literal",
                type(value).__name__ if isinstance(value, bool | str) else "",
                str(value),
                sort_digest(sort),
            )
        case t.EnumValue(name=name, sort=sort):
            return ("element", name, sort_digest(sort))
        case t.Variable(role=role, name=name, sort=sort):
            return ("variable", role, name, sort_digest(sort))
        case t.Construct(constructor=constructor, sort=data):
            return ("construct", constructor, sort_digest(data))
        case t.Arithmetic(operator=operator, sort=sort):
            return ("arithmetic", operator, sort_digest(_integers(sort)))
        case t.Compare(operator=operator):
            return ("compare", operator)
        case t.Quantified(quantifier=quantifier, variables=variables):
            return (quantifier, *(sort_digest(v.sort) for v in variables))
        case t.Item(position=position):
            return ("item", str(position))
        case t.Argument(constructor=constructor, position=position):
            return ("argument", constructor, str(position))
        case t.SequenceTerm(sort=sort) | t.SequenceRange(sort=sort) | t.SetTerm(sort=sort) | t.TupleTerm(sort=sort):
            return (type(term).__name__, sort_digest(sort))
        case t.Operation(operator=operator, sort=sort):
            return ("operation", operator, sort_digest(_integers(sort)))
        case t.History(operator=operator, sort=sort, limit=limit):
            bound = () if limit is None else (limit.relation, "steps" if limit.steps else "seconds")
            return ("history", operator, sort_digest(_integers(sort)), *bound)
        case (
            t.Apply()
            | t.Index()
            | t.Length()
            | t.Widen()
            | t.Negative()
            | t.In()
            | t.Not()
            | t.And()
            | t.Or()
            | t.Implies()
            | t.Iff()
            | t.Conditional()
        ):
            return (type(term).__name__,)
        case _:
            assert_never(term)


def _integers(sort: s.Sort) -> s.Sort:
    """NATURAL and INTEGER arithmetic is the same arithmetic."""
    return s.IntegerSort() if isinstance(sort, s.NaturalSort) else sort
