"""The network in onnxruntime, in float32, and its answers as values of the ports."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np

from avow.backend_kit.network import Session
from avow.formulas.values import Binary, Element, Value
from avow.language.contract import Node
from avow.language.sorts import TupleSort

from .cases import Box, Side
from .options import Argmax, Given, Scaled, Threshold
from .reading import Network, Relu, Sum
from .tuning import ALIKE
from .two_steps import BEFORE

Point = tuple[float, ...]
"""Inputs of the network, each a float32."""


class Runtime:
    """One network."""

    def __init__(self, path: Path, given: Given) -> None:
        """Raises an exception of onnxruntime if it does not accept the file."""
        self._given = given
        self._session = Session(path)
        self.points = 0
        self.difference = 0.0
        """The greatest difference so far between an output and its value from `reading`, computed in float64."""

    def outputs(self, point: Point) -> list[float]:
        return self._session.outputs(point)

    def compare(self, point: Point) -> bool:
        """Whether the outputs are about those that `reading` has, computed in float64."""
        known, found = values(self._given.network, point), self.outputs(point)
        self.points += 1
        if len(known) != len(found) or not np.isfinite(found).all():
            return False
        apart = [abs(ours - theirs) for ours, theirs in zip(known, found, strict=True)]
        self.difference = max(self.difference, *apart)
        return all(by <= ALIKE * (1 + abs(ours)) for by, ours in zip(apart, known, strict=True))

    def two(self, node: Node, point: Point) -> dict[str, Value] | None:
        """As `ports`, at two steps (`two_steps`): the inputs before, those now, and their rises. One that does not rise
        is the same at both."""
        count = self._given.network.inputs
        first, second, rises = (point[k * count : (k + 1) * count] for k in range(3))
        before = self.ports(node, first)
        now = self.ports(node, tuple(x if d else b for b, x, d in zip(first, second, rises, strict=True)))
        return None if before is None or now is None else {**now, **{n + BEFORE: v for n, v in before.items()}}

    def ports(self, node: Node, point: Point) -> dict[str, Value] | None:
        """The values of the connected ports; None if an output is not finite."""
        found = self.outputs(point)
        if not np.isfinite(found).all():
            return None
        made = dict[str, Value]()
        for port in node.inputs:
            name = port.variable.qualified
            if (each := self._given.inputs.get(name)) is not None:
                items = tuple(_unscaled(one, point[one.index]) for one in each)
                made[name] = items if isinstance(port.sort, TupleSort) else items[0]
        for name, output in self._given.outputs.items():
            match output:
                case Scaled(index=index, scale=scale, offset=offset):
                    plain = scale == 1 and offset == 0
                    made[name] = _single(found[index]) if plain else scale * Fraction(found[index]) + offset
                case Threshold(index=index, least=least):
                    made[name] = Fraction(found[index]) >= least
                case Argmax(members=members, first=first):
                    scores = found[first : first + len(members)]
                    made[name] = Element(members[scores.index(max(scores))])
        return made


def values(network: Network, point: Sequence[float]) -> list[float]:
    """The outputs according to `reading`, in float64."""
    found = list(point)
    for neuron in network.neurons:
        match neuron:
            case Relu(of=of):
                found.append(max(0.0, found[of]))
            case Sum(of=of, weights=weights, bias=bias):
                found.append(sum((w * found[k] for k, w in zip(of, weights, strict=True)), bias))
    return [found[k] for k in network.outputs]


def sides(box: Box) -> tuple[tuple[float, float], ...] | None:
    """The least and greatest float32 of each interval; None if an interval has none."""
    found = []
    for low, high in box:
        assert low is not None
        assert high is not None
        found.append((_inside(low, 1), _inside(high, -1)))
    return tuple(found) if all(low <= high for low, high in found) else None


def corners(within: Sequence[tuple[float, float]], draw: random.Random, most: int) -> Iterator[Point]:
    """The least, the greatest and the middle point, then points drawn from the box, some of them with inputs at their
    bounds."""
    yield tuple(low for low, _ in within)
    yield tuple(high for _, high in within)
    yield nearest(tuple((low + high) / 2 for low, high in within), within)
    for _ in range(most - 3):
        share = draw.choice((0.0, 0.3, 0.9))
        yield nearest(
            tuple(draw.choice(pair) if draw.random() < share else draw.uniform(*pair) for pair in within), within
        )


def nearest(point: Sequence[float], within: Sequence[tuple[float, float]]) -> Point:
    """The float32s next to a point, in the box."""
    return tuple(min(max(float(np.float32(x)), low), high) for x, (low, high) in zip(point, within, strict=True))


def _inside(side: Side, sign: int) -> float:
    """The first float32 that is not outside; `sign` 1: of a lower bound."""
    found = np.float32(float(side.value))
    while sign * Fraction(float(found)) < sign * side.value or (side.strict and Fraction(float(found)) == side.value):
        found = np.nextafter(found, np.float32(sign * np.inf))
    return float(found)


def _single(value: float) -> Value:
    return Binary.held(Fraction(value), str(np.float32(value)))


def _unscaled(one: Scaled, x: float) -> Value:
    return _single(x) if one.scale == 1 and one.offset == 0 else (Fraction(x) - one.offset) / one.scale
