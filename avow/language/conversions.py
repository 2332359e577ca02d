"""Conversions between sorts: INTEGER and NATURAL widen to REAL; there are no others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

from avow.base.optional import complete
from avow.language import sorts as s
from avow.language.terms import Conditional, Literal, SequenceTerm, Term, TupleTerm, Widen

WHOLE = (s.IntegerSort, s.NaturalSort)
NUMERIC = (s.IntegerSort, s.NaturalSort, s.RealSort)


def alike(left: s.Sort, right: s.Sort) -> bool:
    """Whether the sorts are the same for a comparison: equal, with NATURAL and INTEGER identified."""
    return left == right or (isinstance(left, WHOLE) and isinstance(right, WHOLE)) or _in_parts(left, right, alike)


def fits(sort: s.Sort, wanted: s.Sort) -> bool:
    """Whether every value of `sort` is a value of `wanted` without conversion."""
    return sort == wanted or (sort == s.NATURAL and wanted == s.INTEGER) or _in_parts(sort, wanted, fits)


def _in_parts(left: s.Sort, right: s.Sort, same: Callable[[s.Sort, s.Sort], bool]) -> bool:
    """Whether the sorts are two tuples or two sequences, with items that are pairwise the `same`."""
    match left, right:
        case s.TupleSort(items=a), s.TupleSort(items=b):
            return left.labels == right.labels and len(a) == len(b) and all(map(same, a, b))
        case s.SequenceSort(item=a_), s.SequenceSort(item=b_):
            return same(a_, b_)
    return False


def widen(term: Term) -> Term:
    """A whole-numbered term as a REAL."""
    if term.sort == s.REAL:
        return term
    if isinstance(term, Literal) and not isinstance(term.value, bool | str):
        return Literal(Fraction(term.value), s.REAL, term.span)
    return Widen(term, s.REAL, term.span)


def convert(term: Term, wanted: s.Sort) -> Term | None:
    """The term converted to sort `wanted`; None if that is impossible."""
    if fits(term.sort, wanted):
        return term
    if wanted == s.REAL and isinstance(term.sort, WHOLE):
        return widen(term)
    match term, wanted:
        case TupleTerm(items=items), s.TupleSort(items=sorts) if _as_record(term.sort, wanted):
            made: list[Term] | None = complete(map(convert, items, sorts))
            if made is not None:
                return replace(term, items=tuple(made), sort=s.TupleSort(tuple(m.sort for m in made), wanted.labels))
        case Conditional(then=then, otherwise=otherwise), _:
            one, other = convert(then, wanted), convert(otherwise, wanted)
            if one is not None and other is not None:
                return replace(term, then=one, otherwise=other, sort=joined([one, other]))
        case SequenceTerm(items=items), s.SequenceSort(item=item):
            made = complete(convert(i, item) for i in items)
            if made is not None:
                return replace(term, items=tuple(made), sort=s.SequenceSort(joined(made) if made else item))
    return None


def _as_record(sort: s.Sort, wanted: s.Sort) -> bool:
    """Whether a tuple term may be used as a record (or tuple) of that sort: the items of a record are in declared
    order."""
    if not isinstance(sort, s.TupleSort) or not isinstance(wanted, s.TupleSort):
        return False
    return len(sort.items) == len(wanted.items) and sort.labels in ((), wanted.labels)


def widest(left: s.Sort, right: s.Sort) -> s.Sort | None:
    """The smallest sort to which both convert, or None."""
    if left == right:
        return left
    if isinstance(left, NUMERIC) and isinstance(right, NUMERIC):
        return s.REAL if s.REAL in (left, right) else s.INTEGER
    match left, right:
        case s.TupleSort(items=a), s.TupleSort(items=b) if _as_record(left, right) or _as_record(right, left):
            items: list[s.Sort] | None = complete(map(widest, a, b))
            return None if items is None else s.TupleSort(tuple(items), left.labels or right.labels)
        case s.SequenceSort(item=a_), s.SequenceSort(item=b_):
            item = widest(a_, b_)
            return None if item is None else s.SequenceSort(item)
    return None


def common(terms: list[Term]) -> list[Term] | None:
    """The terms converted to one sort, or None."""
    if not terms or all(alike(t.sort, terms[0].sort) for t in terms):
        return terms
    target = _widest(terms)
    if target is None:
        return None
    return complete(t if alike(t.sort, target) else convert(t, target) for t in terms)


def joined(terms: list[Term]) -> s.Sort:
    """The item sort of a set or sequence of these terms (non-empty, already `common`): INTEGER if some may be negative,
    also within tuples and sequences. Each term is a value of it: a variable that ranges over them has this sort."""
    found = _widest(terms)
    assert found is not None, "they are alike"
    return found


def _widest(terms: list[Term]) -> s.Sort | None:
    """The smallest sort to which all of them convert, or None."""
    found: s.Sort | None = terms[0].sort
    for term in terms:
        found = None if found is None else widest(found, term.sort)
    return found
