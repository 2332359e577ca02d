"""Values in the contract's own words: ``in.status = red, in.at = {(0, 0)}``."""

from __future__ import annotations

from collections.abc import Mapping

from avow.formulas.values import Value, show
from avow.language.terms import Role, Variable

_ORDER = {Role.INPUT: 0, Role.OUTPUT: 1, Role.BOUND: 2}


def show_values(values: Mapping[Variable, Value]) -> tuple[tuple[str, str], ...]:
    """(name, value) pairs, inputs first, then outputs, by name."""
    ordered = sorted(values.items(), key=lambda pair: (_ORDER[pair[0].role], pair[0].name))
    return tuple((variable.qualified, show(value)) for variable, value in ordered)
