"""Conditionals lifted to the atom: ``max(a, b) < c`` as ``(b > a -> b < c) and (not b > a -> a < c)``.

For targets whose terms have no conditionals (such as RML's conditions). `xor`, `abs`, `min`, `max` and conditionals are
eliminated, except in a quantified formula within a term; `mod` and `div` remain, since they do not choose between
terms. The meaning is the same. The size may double with each conditional in one atom; more than `ATOMS_MADE` atoms are
refused.
"""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.tuning.bounds import ATOMS_MADE
from avow.language import terms as t
from avow.language.operators import definition
from avow.language.sorts import BOOL


class TooManyCases(Exception):  # noqa: N818 - it names what the formula has
    """The conditionals of the formula make more than `ATOMS_MADE` atoms."""


def lifted(formula: t.Term) -> t.Term:
    """The formula without operators that choose between terms. Raises TooManyCases."""
    return _formula(formula, iter(range(ATOMS_MADE)))


def _formula(term: t.Term, left: Iterator[int]) -> t.Term:
    match term:
        case t.Operation() if (made_of := definition(term)) is not None:
            return _formula(made_of, left)
        case t.Conditional(condition=condition, then=then, otherwise=otherwise):
            parts = (t.Implies(condition, then, term.span), t.Implies(t.Not(condition), otherwise, term.span))
            return _formula(t.And(parts, term.span), left)
        case t.Not() | t.And() | t.Or() | t.Implies() | t.Iff() | t.Quantified():
            return term.rebuild(tuple(_formula(child, left) for child in term.children))
        case _:  # an atom
            if next(left, None) is None:
                raise TooManyCases
            chosen = _choice(term)
            if chosen is None:
                return term
            condition, one, other = chosen
            return _formula(t.Conditional(condition, one, other, BOOL, term.span), left)


def _choice(term: t.Term) -> tuple[t.Term, t.Term, t.Term] | None:
    """The first choice within a term: its condition and the two terms to choose between; None if there is none."""
    match term:
        case t.Conditional():
            return term.condition, term.then, term.otherwise
        case t.Operation() if (made_of := definition(term)) is not None:
            return _choice(made_of) if isinstance(made_of, t.Conditional) else (made_of, t.TRUE, t.FALSE)
        case t.Quantified() | t.History():
            return None  # a choice within depends on its variables, or on the step
        case _:  # not a choice itself: the first one within it
            parts = term.children
            for place, part in enumerate(parts):
                inside = _choice(part)
                if inside is not None:
                    condition, yes, no = inside
                    before, after = parts[:place], parts[place + 1 :]
                    return condition, term.rebuild((*before, yes, *after)), term.rebuild((*before, no, *after))
            return None
