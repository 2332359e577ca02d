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
from avow.formulas.traversal import Steps, run
from avow.language.contract import Clause, Node
from avow.language.operators import OPPOSITE
from avow.language.sorts import (
    BOOL,
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import (
    FALSE,
    TRUE,
    And,
    Apply,
    Argument,
    Arithmetic,
    Builtin,
    Compare,
    Conditional,
    Construct,
    EnumValue,
    History,
    Iff,
    Implies,
    In,
    Index,
    Item,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Role,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
)

# -- building ----------------------------------------------------------------------------------------------------------


def conjunction(terms: Iterable[Term]) -> Term:
    """``and`` of all of them, flattened; TRUE of none."""
    return joined(terms, And, TRUE, FALSE)


def disjunction(terms: Iterable[Term]) -> Term:
    """``or`` of all of them, flattened; FALSE of none."""
    return joined(terms, Or, FALSE, TRUE)


def negation(term: Term) -> Term:
    """``not``, without doubling it."""
    if isinstance(term, Not):
        return term.body
    if isinstance(term, Literal) and isinstance(term.value, bool):
        return FALSE if term.value else TRUE
    return Not(term)


def opposite(term: Term) -> Term:
    """An equivalent of ``not term``, without a `not` in front if there is one."""
    return Compare(OPPOSITE[term.operator], term.left, term.right) if isinstance(term, Compare) else negation(term)


def equation(one: Term, other: Term) -> Term:
    """That two terms have one value: ``<=>`` of formulas."""
    return Iff(one, other) if one.sort == BOOL else Compare("==", one, other)


# -- variables ---------------------------------------------------------------------------------------------------------


def free_variables(term: Term) -> frozenset[Variable]:
    """Inputs, outputs, and bound variables whose quantifier is not in the term."""
    free: set[Variable] = set()
    stack: list[tuple[Term, frozenset[Variable]]] = [(term, frozenset())]
    while stack:
        current, bound = stack.pop()
        if isinstance(current, Variable):
            if current not in bound:
                free.add(current)
            continue
        if isinstance(current, Quantified):
            bound = bound | frozenset(current.variables)
        stack.extend((child, bound) for child in current.children)
    return frozenset(free)


def substitute(term: Term, mapping: Mapping[Variable, Term]) -> Term:
    """Put terms for free variables, all at once; bound variables are renamed where they would capture one."""
    if not mapping:
        return term
    taken = {variable.name for replacement in mapping.values() for variable in free_variables(replacement)}
    taken |= {variable.name for variable in free_variables(term)}

    def steps(current: Term, active: Mapping[Variable, Term]) -> Steps[Term]:
        if isinstance(current, Variable):
            return active.get(current, current)
        if isinstance(current, Quantified):
            inner = {v: t for v, t in active.items() if v not in current.variables}
            renewed: list[Variable] = []
            for variable in current.variables:
                name = fresh(variable.name, taken) if inner and variable.name in taken else variable.name
                renamed = Variable(Role.BOUND, name, variable.sort, variable.span)
                if renamed != variable:
                    taken.add(name)
                    inner[variable] = renamed
                renewed.append(renamed)
            body: Term = yield steps(current.body, inner)
            return Quantified(current.quantifier, tuple(renewed), body, current.span)
        parts: list[Term] = []
        for child in current.children:
            part: Term = yield steps(child, active)
            parts.append(part)
        return current.rebuild(tuple(parts)) if parts else current

    return run(steps(term, dict(mapping)))


def fresh(name: str, taken: Collection[str]) -> str:
    """The name, with as many primes as it needs to be none of those taken."""
    while name in taken:
        name += "'"
    return name


# -- normal form and digest --------------------------------------------------------------------------------------------


def normalise(term: Term) -> Term:
    """The normal form: same meaning, bound variables renamed by depth, commutative parts in a fixed order."""
    return run(_normal(term, {}, 0))[0]


def digest(*terms: Term) -> str:
    """SHA-256 of the meaning of some formulas; their order does not count."""
    return _hash("formulas", *sorted(set(map(meaning, terms))), "sorts")


@by_identity(50_000)
def meaning(term: Term) -> str:
    """SHA-256 of the meaning of one formula."""
    return run(_normal(term, {}, 0))[1]


@by_identity(50_000)
def node_digest(node: Node, clause: Clause) -> str:
    """SHA-256 of one clause under its node's assumptions: what evidence for it is about."""
    assumed = digest(*(a.formula for a in node.assumptions if a != clause))
    return _hash(str(clause.kind), digest(clause.formula), assumed)


def sort_digest(sort: Sort) -> str:
    """SHA-256 of a sort by its definition: the name of an enumeration or a data type does not count."""
    match sort:
        case BoolSort() | RealSort() | IntegerSort() | NaturalSort() | StringSort():
            return _hash(type(sort).__name__)
        case EnumSort(members=members):
            return _hash("enum", *sorted(members))
        case DataSort(constructors=constructors):
            made = (_hash(c.name, *map(sort_digest, c.parameters)) for c in constructors)
            return _hash("data", *sorted(made))
        case OpaqueSort(name=name):
            return _hash("opaque", name)
        case FunctionSort(parameters=parameters, result=result):
            return _hash("function", *map(sort_digest, parameters), sort_digest(result))
        case TupleSort(items=items):
            return _hash("tuple", *map(sort_digest, items), *(f"label {name}" for name in sort.labels))
        case SequenceSort(item=item):
            return _hash("sequence", sort_digest(item))
        case SetSort(item=item):
            return _hash("set", sort_digest(item))


def _hash(*parts: str) -> str:
    # Lengths make the encoding injective, whatever characters a name holds.
    return hashlib.sha256("".join(f"{len(part)}:{part}" for part in parts).encode("utf-8", "surrogatepass")).hexdigest()


_Keyed = tuple[Term, str]
"""A normal term and its digest: hashes of hashes, so that deep terms cost no more than wide ones."""

_FLIPPED = {">": "<", ">=": "<="}


def _normal(term: Term, scope: Mapping[Variable, Variable], level: int) -> Steps[_Keyed]:
    if isinstance(term, Quantified):
        quantified: _Keyed = yield _normal_quantified(term, scope, level)
        return quantified
    if isinstance(term, Variable):
        return _keyed(scope.get(term, term))
    if isinstance(term, And | Or):
        junction: _Keyed = yield _normal_junction(term, scope, level)
        return junction
    parts: list[_Keyed] = []
    for child in term.children:
        part: _Keyed = yield _normal(child, scope, level)
        parts.append(part)
    match term:
        case Not():
            return _not(parts[0])
        case Iff():
            return _iff(*parts)
        case Compare(operator=operator):
            return _compare(operator, *parts)
        case Operation(operator=Builtin.XOR):
            return _not(_iff(*parts))
        case Arithmetic(operator="+" | "*") | Operation(operator=Builtin.MIN | Builtin.MAX):
            return _make(term, sorted(parts, key=_key))
        case SetTerm():
            return _make(term, sorted({key: (part, key) for part, key in parts}.values(), key=_key))
        case Literal() | EnumValue():
            return _keyed(term)
        case _:  # its normal form is that of its parts, in their order
            return _make(term, parts)


def _normal_quantified(term: Quantified, scope: Mapping[Variable, Variable], level: int) -> Steps[_Keyed]:
    variables, body = list(term.variables), term.body
    while (
        term.quantifier is not Quantifier.UNIQUE and isinstance(body, Quantified) and body.quantifier is term.quantifier
    ):
        variables.extend(body.variables)
        body = body.body
    inner = dict(scope)
    fresh: list[Variable] = []
    for offset, variable in enumerate(variables):
        canonical = Variable(Role.BOUND, f"${level + offset}", variable.sort)
        fresh.append(canonical)
        inner[variable] = canonical
    part: _Keyed = yield _normal(body, inner, level + len(variables))
    sorts = (sort_digest(v.sort) for v in fresh)
    return Quantified(term.quantifier, tuple(fresh), part[0]), _hash(term.quantifier, *sorts, part[1])


def _normal_junction(term: And | Or, scope: Mapping[Variable, Variable], level: int) -> Steps[_Keyed]:
    kind = type(term)
    unit, zero = (TRUE, FALSE) if kind is And else (FALSE, TRUE)
    unique: dict[str, Term] = {}
    stack: list[Term] = list(reversed(term.items))
    while stack:
        item = stack.pop()
        if isinstance(item, kind):
            stack.extend(reversed(item.items))
            continue
        part: _Keyed = yield _normal(item, scope, level)
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
        if left[0].sort == BOOL:
            return _iff(left, right)
        left, right = sorted((left, right), key=_key)
    return _make(Compare(operator, left[0], right[0]), [left, right])


def _iff(left: _Keyed, right: _Keyed) -> _Keyed:
    for one, other in ((left, right), (right, left)):
        if one[0] == TRUE:
            return other
        if one[0] == FALSE:
            return _not(other)
    left, right = sorted((left, right), key=_key)
    return _make(Iff(left[0], right[0]), [left, right])


def _not(part: _Keyed) -> _Keyed:
    if isinstance(part[0], Not):
        return _keyed(part[0].body)
    if part[0] == TRUE:
        return _keyed(FALSE)
    if part[0] == FALSE:
        return _keyed(TRUE)
    return _make(Not(part[0]), [part])


def _key(part: _Keyed) -> str:
    return part[1]


def _make(term: Term, parts: Iterable[_Keyed]) -> _Keyed:
    parts = tuple(parts)
    return term.rebuild(tuple(part for part, _ in parts)), _hash(*_head(term), *(key for _, key in parts))


def _keyed(term: Term) -> _Keyed:
    return term, _term_key(term)


def _term_key(term: Term) -> str:
    """The digest of a term that is normal already."""

    def steps(current: Term) -> Steps[str]:
        keys: list[str] = []
        for child in current.children:
            key: str = yield steps(child)
            keys.append(key)
        return _hash(*_head(current), *keys)

    return run(steps(term))


def _head(term: Term) -> tuple[str, ...]:
    """What a term says beside its direct subterms."""
    match term:
        case Literal(value=value, sort=sort):
            return (
                "literal",
                type(value).__name__ if isinstance(value, bool | str) else "",
                str(value),
                sort_digest(sort),
            )
        case EnumValue(name=name, sort=sort):
            return ("element", name, sort_digest(sort))
        case Variable(role=role, name=name, sort=sort):
            return ("variable", role, name, sort_digest(sort))
        case Construct(constructor=constructor, sort=data):
            return ("construct", constructor, sort_digest(data))
        case Arithmetic(operator=operator, sort=sort):
            return ("arithmetic", operator, sort_digest(_integers(sort)))
        case Compare(operator=operator):
            return ("compare", operator)
        case Quantified(quantifier=quantifier, variables=variables):
            return (quantifier, *(sort_digest(v.sort) for v in variables))
        case Item(position=position):
            return ("item", str(position))
        case Argument(constructor=constructor, position=position):
            return ("argument", constructor, str(position))
        case SequenceTerm(sort=sort) | SequenceRange(sort=sort) | SetTerm(sort=sort) | TupleTerm(sort=sort):
            return (type(term).__name__, sort_digest(sort))
        case Operation(operator=operator, sort=sort):
            return ("operation", operator, sort_digest(_integers(sort)))
        case History(operator=operator, sort=sort, limit=limit):
            bound = () if limit is None else (limit.relation, "steps" if limit.steps else "seconds")
            return ("history", operator, sort_digest(_integers(sort)), *bound)
        case (
            Apply()
            | Index()
            | Length()
            | Widen()
            | Negative()
            | In()
            | Not()
            | And()
            | Or()
            | Implies()
            | Iff()
            | Conditional()
        ):
            return (type(term).__name__,)
        case _:
            assert_never(term)


def _integers(sort: Sort) -> Sort:
    """NATURAL and INTEGER arithmetic is the same arithmetic."""
    return IntegerSort() if isinstance(sort, NaturalSort) else sort
