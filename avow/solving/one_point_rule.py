"""``exists(i | c == inspect(i) and P(i))`` without its quantifier: c is an `inspect`, and P holds of what is in it.

The one-point rule, for constructors (and tuples) too: where a quantified variable can have one value only, that value
stands for it. Solvers apply the rule to ``i == t`` by themselves, but not through a constructor, and what is left of a
contract's formulas is then often free of quantifiers. The meaning stays the same, whatever the sorts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.solving.z3_module import z3
from avow.solving.z3_sorts import Expr
from avow.tuning.bounds import NUMBERS_WRITTEN_OUT, PARTS_SEARCHED


def eliminate_points(constants: Sequence[Expr], conjuncts: Sequence[Expr]) -> tuple[list[Expr], list[Expr]]:
    """Of "there are `constants` such that all of the `conjuncts` hold": the constants that are still needed, and the
    conjuncts then."""
    left = list(constants)
    parts = _flat(conjuncts)
    while len(parts) <= PARTS_SEARCHED:
        step = _step(left, parts)
        if step is None:
            break
        left, parts = step
        parts = _flat(parts)
    return left, parts


def expand(constants: Sequence[Expr], conjuncts: Sequence[Expr]) -> Iterator[tuple[list[Expr], list[Expr]]]:
    """The same for each of a variable's few values, where the conjuncts bound a whole number by numbers."""
    left, parts = list(constants), list(conjuncts)
    for constant in left:
        values = _range(constant, parts) if z3.is_int(constant) and len(parts) <= PARTS_SEARCHED else None
        if values is not None:
            rest = [c for c in left if c is not constant]
            for number in values:
                value = z3.IntVal(number, constant.ctx)
                yield from expand(rest, [z3.simplify(z3.substitute(p, (constant, value))) for p in parts])
            return
    yield left, parts


def _range(constant: Expr, parts: Sequence[Expr]) -> range | None:
    low: int | None = None
    high: int | None = None
    for part in parts:
        for one, two, upper, strict in _bounds(part):
            if one.eq(constant) and z3.is_int_value(two):
                number = two.as_long()
                if upper:
                    high = min(number - strict, number if high is None else high)
                else:
                    low = max(number + strict, number if low is None else low)
    if low is None or high is None or high - low >= NUMBERS_WRITTEN_OUT:
        return None
    return range(low, high + 1)


def _bounds(part: Expr) -> Iterator[tuple[Expr, Expr, bool, bool]]:
    """(x, t, whether t is an upper bound of x, whether it is out of bounds itself), for each side of a comparison."""
    operator = _operator(part)
    negated = operator == z3.Z3_OP_NOT
    atom = part.arg(0) if negated else part
    operator = _operator(atom) if negated else operator
    for comparison, upper, strict in (
        (z3.Z3_OP_LE, True, False),
        (z3.Z3_OP_LT, True, True),
        (z3.Z3_OP_GE, False, False),
        (z3.Z3_OP_GT, False, True),
    ):
        if operator == comparison:
            one, two = (z3.simplify(side) if not z3.is_const(side) else side for side in atom.children())
            yield one, two, upper != negated, strict != negated
            yield two, one, upper == negated, strict != negated


def _flat(conjuncts: Sequence[Expr]) -> list[Expr]:
    """The conjuncts of the conjuncts, negations pushed in as far as that takes."""
    found: list[Expr] = []
    stack = list(reversed(conjuncts))
    while stack:
        part = stack.pop()
        operator = _operator(part)
        if operator == z3.Z3_OP_AND:
            stack.extend(reversed(part.children()))
            continue
        inside: Expr = part.arg(0) if operator == z3.Z3_OP_NOT else None
        denied = _operator(inside) if operator == z3.Z3_OP_NOT else None
        if denied == z3.Z3_OP_NOT:
            stack.append(inside.arg(0))
        elif denied == z3.Z3_OP_OR:
            stack.extend(z3.Not(item) for item in reversed(inside.children()))
        elif denied == z3.Z3_OP_IMPLIES:
            stack.extend((z3.Not(inside.arg(1)), inside.arg(0)))
        else:
            found.append(part)
    return found


def _operator(expr: Expr) -> int | None:
    """The kind of an expression's outermost operator: one question to Z3, where each of its ``is_and``, ``is_or`` and
    so on asks anew."""
    return int(expr.decl().kind()) if z3.is_app(expr) else None


def _step(constants: list[Expr], parts: list[Expr]) -> tuple[list[Expr], list[Expr]] | None:
    """One equation used up; None if there is none of use."""
    for position, part in enumerate(parts):
        if not z3.is_eq(part):
            continue
        for built, other in (part.children(), reversed(part.children())):
            fields = _fields(built, other)
            solved = [(field, value) for field, value in fields if _among(field, constants)]
            if not solved or _mentions(other, constants):
                continue
            values: dict[int, tuple[Expr, Expr]] = {}
            rest = []
            for field, value in fields:
                if _among(field, constants) and field.get_id() not in values:
                    values[field.get_id()] = (field, value)
                else:
                    rest.append(field == value)
            shape = [] if built.eq(fields[0][0]) else [_recognised(built, other)]
            known = list(values.values())
            replaced = [z3.substitute(p, *known) for k, p in enumerate(parts) if k != position]
            kept = [c for c in constants if c.get_id() not in values]
            return kept, [*shape, *(z3.substitute(p, *known) for p in rest), *replaced]
    return None


def _fields(built: Expr, other: Expr) -> list[tuple[Expr, Expr]]:
    """(x, t) for ``x == t``; for ``C(a, b) == t``, each argument with what t has in its place."""
    if z3.is_const(built):
        return [(built, other)]
    sort = built.sort()
    if not (z3.is_app(built) and isinstance(sort, z3.DatatypeSortRef)):
        return []
    for index in range(sort.num_constructors()):
        if built.decl().eq(sort.constructor(index)):
            return [(a, sort.accessor(index, k)(other)) for k, a in enumerate(built.children())]
    return []


def _recognised(built: Expr, other: Expr) -> Expr:
    sort = built.sort()
    index = next(k for k in range(sort.num_constructors()) if built.decl().eq(sort.constructor(k)))
    return sort.recognizer(index)(other)


def _among(expr: Expr, constants: Sequence[Expr]) -> bool:
    return any(expr.eq(constant) for constant in constants)


def _mentions(expr: Expr, constants: Sequence[Expr]) -> bool:
    wanted = {constant.get_id() for constant in constants}
    seen: set[int] = set()
    stack = [expr]
    while stack:
        part = stack.pop()
        if part.get_id() in wanted:
            return True
        if part.get_id() not in seen:
            seen.add(part.get_id())
            stack.extend([part.body()] if z3.is_quantifier(part) else part.children())
    return False
