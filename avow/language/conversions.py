"""Where a term of one sort may stand for another: INTEGER and NATURAL widen to REAL, and nothing else changes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from avow.base.optional import complete
from avow.language.sorts import (
    INTEGER,
    NATURAL,
    REAL,
    IntegerSort,
    NaturalSort,
    RealSort,
    SequenceSort,
    Sort,
    TupleSort,
)
from avow.language.terms import Conditional, Literal, SequenceTerm, Term, TupleTerm, Widen

WHOLE = (IntegerSort, NaturalSort)
NUMERIC = (IntegerSort, NaturalSort, RealSort)


def alike(left: Sort, right: Sort) -> bool:
    """Whether the sorts are one for a comparison: equal, NATURAL and INTEGER counting as one."""
    return left == right or (isinstance(left, WHOLE) and isinstance(right, WHOLE)) or _in_parts(left, right, alike)


def fits(sort: Sort, wanted: Sort) -> bool:
    """Whether every value of `sort` is one of `wanted` as it stands."""
    return sort == wanted or (sort == NATURAL and wanted == INTEGER) or _in_parts(sort, wanted, fits)


def _in_parts(left: Sort, right: Sort, same: Callable[[Sort, Sort], bool]) -> bool:
    """Whether two tuples or sequences are of a kind, and their items are the `same`."""
    match left, right:
        case TupleSort(items=a), TupleSort(items=b):
            return left.labels == right.labels and len(a) == len(b) and all(map(same, a, b))
        case SequenceSort(item=a_), SequenceSort(item=b_):
            return same(a_, b_)
    return False


def widen(term: Term) -> Term:
    """A whole-numbered term as a REAL."""
    if term.sort == REAL:
        return term
    if isinstance(term, Literal) and not isinstance(term.value, bool | str):
        return Literal(Fraction(term.value), REAL, term.span)
    return Widen(term, REAL, term.span)


def convert(term: Term, wanted: Sort) -> Term | None:
    """The term as one of sort `wanted`; None where that cannot be."""
    if fits(term.sort, wanted):
        return term
    if wanted == REAL and isinstance(term.sort, WHOLE):
        return widen(term)
    match term, wanted:
        case TupleTerm(items=items), TupleSort(items=sorts) if _as_record(term.sort, wanted):
            made: list[Term] | None = complete(map(convert, items, sorts))
            if made is not None:
                return replace(term, items=tuple(made), sort=TupleSort(tuple(m.sort for m in made), wanted.labels))
        case Conditional(then=then, otherwise=otherwise), _:
            one, other = convert(then, wanted), convert(otherwise, wanted)
            if one is not None and other is not None:
                return replace(term, then=one, otherwise=other, sort=joined([one, other]))
        case SequenceTerm(items=items), SequenceSort(item=item):
            made = complete(convert(i, item) for i in items)
            if made is not None:
                return replace(term, items=tuple(made), sort=SequenceSort(joined(made) if made else item))
    return None


def _as_record(sort: Sort, wanted: Sort) -> bool:
    """Whether a tuple that is written down may stand for one of that sort: a record's items stand in their order."""
    if not isinstance(sort, TupleSort) or not isinstance(wanted, TupleSort):
        return False
    return len(sort.items) == len(wanted.items) and sort.labels in ((), wanted.labels)


def widest(left: Sort, right: Sort) -> Sort | None:
    """The sort in which both have a place, if there is one."""
    if left == right:
        return left
    if isinstance(left, NUMERIC) and isinstance(right, NUMERIC):
        return REAL if REAL in (left, right) else INTEGER
    match left, right:
        case TupleSort(items=a), TupleSort(items=b) if _as_record(left, right) or _as_record(right, left):
            items: list[Sort] | None = complete(map(widest, a, b))
            return None if items is None else TupleSort(tuple(items), left.labels or right.labels)
        case SequenceSort(item=a_), SequenceSort(item=b_):
            item = widest(a_, b_)
            return None if item is None else SequenceSort(item)
    return None


def common(terms: list[Term]) -> list[Term] | None:
    """The terms brought to one sort, or None."""
    if not terms or all(alike(t.sort, terms[0].sort) for t in terms):
        return terms
    target = _widest(terms)
    if target is None:
        return None
    return complete(t if alike(t.sort, target) else convert(t, target) for t in terms)


def joined(terms: list[Term]) -> Sort:
    """The sort of a set or sequence of these (non-empty, already `common`): INTEGER where some may be negative, also
    within tuples and sequences. Every one of them is a value of it: a variable that ranges over them has this sort."""
    found = _widest(terms)
    assert found is not None, "they are alike"
    return found


def _widest(terms: list[Term]) -> Sort | None:
    """The sort in which each of them has a place, if there is one."""
    found: Sort | None = terms[0].sort
    for term in terms:
        found = None if found is None else widest(found, term.sort)
    return found
