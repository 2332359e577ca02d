"""Properties as automata over *leaves*: the greatest parts without temporal operators, which are tests of one state."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import assert_never

from avow.formulas import ltl
from avow.formulas.ltl import Automaton

from .psl import Always, And, Atom, Eventually, Formula, Implies, Not, Or, Release, Truth, Until, is_temporal


def build(formula: Formula) -> Automaton[Formula]:
    """The automaton that accepts just the runs on which the formula holds. Raises TooLarge."""
    return ltl.build(_normal(formula, True))


def _normal(formula: Formula, positive: bool) -> ltl.Normal[Formula]:
    if isinstance(formula, Truth):
        return ltl.join((), formula.value is positive)
    if isinstance(formula, Not):
        return _normal(formula.body, not positive)
    if not is_temporal(formula):
        return ltl.Lit(formula, positive)
    match formula:
        case And(items=items) | Or(items=items):
            return ltl.join([_normal(i, positive) for i in items], isinstance(formula, And) is positive)
        case Implies(left=left, right=right):
            return ltl.join([_normal(left, not positive), _normal(right, positive)], not positive)
        case Always(body=body):
            return ltl.always(_normal(body, positive), positive)
        case Eventually(body=body):
            return ltl.eventually(_normal(body, positive), positive)
        case Until(left=left, right=right):
            return ltl.until(_normal(left, positive), _normal(right, positive), positive)
        case Release(left=left, right=right):
            return ltl.until(_normal(left, positive), _normal(right, positive), not positive)
        case Atom():
            raise AssertionError("an atom is not temporal")
        case _:
            assert_never(formula)


def compiled(formula: Formula, places: Mapping[Atom, int]) -> Callable[[int], bool]:
    """A formula without temporal operators as a test of a state's label, a bit set of atoms."""
    match formula:
        case Atom():
            bit = 1 << places[formula]
            return lambda label: bool(label & bit)
        case Truth(value=value):
            return lambda label: value
        case Not(body=body):
            inner = compiled(body, places)
            return lambda label: not inner(label)
        case And(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: all(test(label) for test in tests)
        case Or(items=items):
            tests = [compiled(i, places) for i in items]
            return lambda label: any(test(label) for test in tests)
        case Implies(left=left, right=right):
            first, second = compiled(left, places), compiled(right, places)
            return lambda label: not first(label) or second(label)
    raise AssertionError(formula)
