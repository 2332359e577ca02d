"""The names that terms are made with: roles of variables, quantifiers, operators of one step and over steps.

`avow.language.terms` offers them as well, beside the nodes that they name.
"""

from __future__ import annotations

from enum import StrEnum


class Role(StrEnum):
    """Where a variable's value comes from."""

    INPUT = "in"
    OUTPUT = "out"
    BOUND = "bound"


class Quantifier(StrEnum):
    FORALL = "forall"
    EXISTS = "exists"
    UNIQUE = "exists_unique"
    """Existence and uniqueness of the whole tuple of bound variables."""


class Builtin(StrEnum):
    """An operator that is written like a function: ``xor(p, q)``. `avow.language.operators` has what each means."""

    XOR = "xor"
    ABS = "abs"
    MIN = "min"
    MAX = "max"
    MOD = "mod"
    DIV = "div"


class Past(StrEnum):
    """An operator that speaks of more than one step of a run. `avow.formulas.temporal` has what each means."""

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
    """A node's pace, as a clause of its own: ``steps(at most 100 ms)``; its limit says how far apart steps are."""


RESPONSES = frozenset((Past.NEXT, Past.WITHIN, Past.FOR, Past.UNTIL, Past.EVENTUALLY))
"""They speak of later steps, and stand only as the right side of a clause's outermost `->`, or as the clause."""
