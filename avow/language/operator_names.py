"""The names that terms are made with: roles of variables, quantifiers, operators of one step and over steps.

`avow.language.terms` re-exports them.
"""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """The source of a variable's value."""

    INPUT = "in"
    OUTPUT = "out"
    BOUND = "bound"


class Quantifier(StrEnum):
    FORALL = "forall"
    EXISTS = "exists"
    UNIQUE = "exists_unique"
    """Existence and uniqueness of the whole tuple of bound variables."""


class Builtin(StrEnum):
    """An operator that is written like a function: ``xor(p, q)``. `avow.language.operators` defines their meanings."""

    XOR = "xor"
    ABS = "abs"
    MIN = "min"
    MAX = "max"
    MOD = "mod"
    DIV = "div"


class Past(StrEnum):
    """An operator that refers to more than one step of a run. `avow.formulas.temporal` defines their meanings."""

    PREVIOUS = "previous"
    ROSE = "rose"
    FELL = "fell"
    CHANGED = "changed"
    ONCE = "once"
    HISTORICALLY = "historically"
    HELD = "held"
    SINCE = "since"
    COUNTED = "counted"
    NEXT = "next"
    WITHIN = "within"
    FOR = "for"
    UNTIL = "until"
    EVENTUALLY = "eventually"
    ARRIVED = "arrived"
    STEPS = "steps"
    """A node's pace, as a clause by itself: ``steps(at most 100 ms)``; its limit is the time between steps."""


RESPONSES = frozenset((Past.NEXT, Past.WITHIN, Past.FOR, Past.UNTIL, Past.EVENTUALLY))
"""Operators that refer to later steps; allowed only as a clause, or as the right side of its outermost `->`."""
