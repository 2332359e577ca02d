"""Inputs at which a proof failed, from the prover's model: candidates, never counterexamples.

The prover gives up with a model of what it could not rule out, which may be no behaviour at all. Only what it says of
inputs of simple sorts is read, and only where the contract's assumptions, replayed in Z3, do not forbid it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from fractions import Fraction

from avow.base.tuning.effort import JUDGE_EFFORT
from avow.formulas.formula import free_variables
from avow.formulas.values import Value, show
from avow.language.contract import Node
from avow.language.sorts import BoolSort, IntegerSort, NaturalSort, RealSort
from avow.language.subterms import histories
from avow.language.terms import Variable

from .names import Names
from .printer import Vocabulary
from .tuning import VALUES_SHOWN

_LINE = re.compile(r"(?P<name>[\w'?]+)#\d+(?:@@\d+)? -> (?P<value>\(- \d+(?:\.\d+)?\)|-?\d+(?:\.\d+)?|true|false)\s*")


def candidates(model: str, node: Node) -> tuple[Mapping[str, str], ...]:
    """Up to three candidates, as ``{"in.r": "125"}``; none where the node has inputs of other sorts alone."""
    found: list[Mapping[str, str]] = []
    for text in _models(model):
        values = _values(text, node)
        shown = {variable.qualified: show(value) for variable, value in values.items()}
        if shown and shown not in found and _allowed(node, values):
            found.append(shown)
        if len(found) == VALUES_SHOWN:
            break
    return tuple(found)


def _models(text: str) -> Iterator[str]:
    for part in text.split("*** MODEL")[1:]:
        yield part.split("*** END_MODEL")[0]


def _values(model: str, node: Node) -> dict[Variable, Value]:
    words = Vocabulary(Names(), Names(), ())
    ports = {words.local(port.variable): port.variable for port in node.inputs}
    values: dict[Variable, Value] = {}
    for line in model.splitlines():
        match = _LINE.fullmatch(line)
        variable = ports.get(match["name"]) if match else None
        if match is None or variable is None or variable in values:
            continue
        value = _value(match["value"], variable)
        if value is not None:
            values[variable] = value
    return values


def _value(text: str, variable: Variable) -> Value | None:
    if text in ("true", "false"):
        return text == "true" if isinstance(variable.sort, BoolSort) else None
    number = Fraction(text.strip("()").replace("- ", "-"))
    match variable.sort:
        case RealSort():
            return number
        case IntegerSort() | NaturalSort() if number.denominator == 1:
            return int(number)
        case _:  # no number of this sort
            return None


def _allowed(node: Node, values: Mapping[Variable, Value]) -> bool:
    """Whether no assumption about these inputs alone is known to be false of them."""
    from avow.solving.replay import replay  # Z3 is slow to import

    spoken = [
        a.formula for a in node.assumptions if free_variables(a.formula) <= values.keys() and not histories(a.formula)
    ]
    return not spoken or replay(spoken, values, effort=JUDGE_EFFORT) is not False
