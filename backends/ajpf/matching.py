"""Matching of normal forms (`shape`) against patterns: up to renaming of bound variables and the order of ``and``,
``or``, ``==`` and sets. Pattern variables stand for terms; ``i + 1`` in a pattern matches the number 5 with i = 4."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from avow.language.sorts import NATURAL, IntegerSort, NaturalSort, Sort
from avow.language.terms import And, Arithmetic, Compare, Literal, Or, Quantified, Role, SetTerm, Term, Variable

Binding = Mapping[str, Term]


def match(pattern: Term, term: Term, names: frozenset[str], binding: Binding) -> Iterator[Binding]:
    """Every way to bind the pattern variables `names` so that the pattern is the term."""
    if isinstance(pattern, Variable) and pattern.role is Role.BOUND and pattern.name in names:
        known = binding.get(pattern.name)
        if known is None:
            if _fits(pattern.sort, term.sort):
                yield {**binding, pattern.name: term}
        elif known == term:
            yield binding
        return
    if isinstance(pattern, Arithmetic) and isinstance(term, Literal):
        yield from _solve(pattern, term, names, binding)
        return
    if type(pattern) is not type(term):
        return
    if isinstance(pattern, Quantified):
        assert isinstance(term, Quantified)
        yield from _match_quantified(pattern, term, names, binding)
    elif isinstance(pattern, And | Or | SetTerm):
        ours, theirs = pattern.items, term.children
        if len(ours) == len(theirs):
            for found, _ in choose(ours, theirs, names, binding):
                yield found
    elif isinstance(pattern, Compare) and pattern.operator == "==":
        assert isinstance(term, Compare)
        if term.operator == "==":
            for sides in ((term.left, term.right), (term.right, term.left)):
                yield from _match_all((pattern.left, pattern.right), sides, names, binding)
    else:
        ours, theirs = pattern.children, term.children
        if len(ours) == len(theirs) and (not ours or pattern.rebuild(theirs) == term) and (ours or pattern == term):
            yield from _match_all(ours, theirs, names, binding)


def choose(
    patterns: Sequence[Term], terms: Sequence[Term], names: frozenset[str], binding: Binding
) -> Iterator[tuple[Binding, tuple[int, ...]]]:
    """Every way to match each pattern with a different term; with the indices of the terms used."""
    if not patterns:
        yield binding, ()
        return
    for at, term in enumerate(terms):
        for found in match(patterns[0], term, names, binding):
            rest = [*terms[:at], *terms[at + 1 :]]
            for final, places in choose(patterns[1:], rest, names, found):
                yield final, (at, *(p if p < at else p + 1 for p in places))


def _match_all(
    patterns: Sequence[Term], terms: Sequence[Term], names: frozenset[str], binding: Binding
) -> Iterator[Binding]:
    if not patterns:
        yield binding
        return
    for found in match(patterns[0], terms[0], names, binding):
        yield from _match_all(patterns[1:], terms[1:], names, found)


def _match_quantified(
    pattern: Quantified, term: Quantified, names: frozenset[str], binding: Binding
) -> Iterator[Binding]:
    """The pattern's bound variables become pattern variables that must stand for the term's, one to one."""
    if pattern.quantifier is not term.quantifier or len(pattern.variables) != len(term.variables):
        return
    inner = {v.name for v in pattern.variables}
    theirs = {v.name for v in term.variables}
    hidden = {name: value for name, value in binding.items() if name not in inner}
    for found in match(pattern.body, term.body, names | inner, hidden):
        values = [found.get(name) for name in inner]
        stands_for = {v.name for v in values if isinstance(v, Variable) and v.role is Role.BOUND}
        escaped = any(isinstance(v, Variable) and v.name in theirs for name, v in found.items() if name not in inner)
        if stands_for == theirs and not escaped:
            outer = {name: value for name, value in found.items() if name not in inner}
            yield {**outer, **{name: value for name, value in binding.items() if name in inner}}


def _solve(pattern: Arithmetic, term: Literal, names: frozenset[str], binding: Binding) -> Iterator[Binding]:
    """``i + 1`` against a number."""
    if pattern.operator not in ("+", "-") or not isinstance(term.value, int) or isinstance(term.value, bool):
        return
    sides = [pattern.left, pattern.right]
    values = [_number(side, binding) for side in sides]
    sign = 1 if pattern.operator == "+" else -1
    if values[0] is not None and values[1] is not None:
        if values[0] + sign * values[1] == term.value:
            yield binding
        return
    for at, other in ((0, values[1]), (1, values[0])):
        side = sides[at]
        if other is not None and isinstance(side, Variable) and side.name in names and side.name not in binding:
            value = term.value - sign * other if at == 0 else sign * (term.value - other)
            if value >= 0:
                yield {**binding, side.name: Literal(value, NATURAL)}
            return


def _number(term: Term, binding: Binding) -> int | None:
    if isinstance(term, Variable):
        term = binding.get(term.name, term)
    return term.value if isinstance(term, Literal) and type(term.value) is int else None


def _fits(pattern: Sort, term: Sort) -> bool:
    whole = (IntegerSort, NaturalSort)
    return pattern == term or (isinstance(pattern, whole) and isinstance(term, whole))
