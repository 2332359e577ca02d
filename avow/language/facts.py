"""What solvers assume of `sin`, `cos` and `atan2`: facts about the real numbers, as formulas of RCL.

A solver gets an unknown number for each value, and these facts. They do not determine it: a contradiction is one in the
reals, but a model need not be. `3.1415926 < π < 3.1415927`, and half of each bounds π/2.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import TypeVar

from avow.base.tuning.bounds import ROOTS_COMPARED
from avow.language import terms as t
from avow.language.enclosures import Irrational, Number
from avow.language.load import check_text
from avow.language.sorts import REAL

_TEXT = Path(__file__).with_suffix(".rcl")
_OF = {
    "angle": "x s c",
    "angles": "x s c u p q",
    "vector": "y x a",
    "vectors": "y x a v u b",
    "turned": "y x a v u b",
    "polar": "y x a s c",
}
"""The variables of each, in order: arguments, then values."""

Part = TypeVar("Part")
Fact = tuple[t.Term, Mapping[t.Variable, Part]]
"""A formula, and what its variables are: texts, or expressions of a solver."""


def together(operator: t.Builtin) -> tuple[t.Builtin, ...]:
    """The values that are named together: a sine with its cosine."""
    return (operator,) if operator is t.Builtin.ATAN2 else (t.Builtin.SIN, t.Builtin.COS)


def known(
    operators: tuple[t.Builtin, ...],
    parts: Sequence[Part],
    values: Iterable[Number | None],
    earlier: Sequence[Sequence[Part]],
    inner: Sequence[Part] | None,
) -> Iterator[Fact[Part]]:
    """What is known of values that are named together. `parts`: arguments and values; `values`: these, if the arguments
    have no variables; `earlier`: the parts of others; `inner`: those of the angle that this is the sine of."""
    name = "vector" if t.Builtin.ATAN2 in operators else "angle"
    yield fact(name, *parts)
    for other in earlier[:ROOTS_COMPARED]:
        yield fact(f"{name}s", *other, *parts)
    if inner:
        yield fact("polar", *inner, *parts[1:])
    number, _, _ = facts()["angle"][0]
    for value, part in zip(values, parts[-len(operators) :], strict=True):
        if isinstance(value, Irrational):
            low, high = (t.Literal(end, REAL) for end in value.closely())
            yield t.And((t.Compare("<=", low, number), t.Compare("<=", number, high))), {number: part}


def fact(name: str, *parts: Part) -> Fact[Part]:
    variables, formula = facts()[name]
    return formula, dict(zip(variables, parts, strict=True))


@cache
def facts() -> dict[str, tuple[tuple[t.Variable, ...], t.Term]]:
    """By its name in the text: the variables of a fact, and the formula."""
    contract, found = check_text(_TEXT.read_text("utf-8"), "facts")
    assert contract is not None, found
    node = contract.nodes[0]
    ports = {port.name: port.variable for port in (*node.inputs, *node.outputs)}
    formulas = {clause.name: clause.formula for clause in node.guarantees}
    return {name: (tuple(map(ports.__getitem__, of.split())), formulas[name]) for name, of in _OF.items()}
