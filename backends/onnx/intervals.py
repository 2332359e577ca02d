"""Interval bounds of every neuron over a box of inputs, rounded outward, so that they contain the values in exact reals
(S. Gowal et al., On the effectiveness of interval bound propagation, 2018)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from fractions import Fraction

from .cases import Affine, Box, Case, Quantity
from .reading import Network, Relu, Sum

Interval = tuple[float, float]
_SLACK = 2.0**-50
"""More than the relative error of a product and of `math.fsum`, which rounds once: 2**-52 together."""


def bounds(network: Network, box: Box) -> list[Interval]:
    """Of the inputs, then of the neurons. Every input has to be bounded."""
    found = []
    for low, high in box:
        assert low is not None
        assert high is not None
        found.append((_below(low.value), _above(high.value)))
    for neuron in network.neurons:
        match neuron:
            case Relu(of=of):
                found.append((max(0.0, found[of][0]), max(0.0, found[of][1])))
            case Sum(of=of, weights=weights, bias=bias):
                found.append(_sum([found[k] for k in of], weights, bias))
    return found


def slopes(network: Network, known: Sequence[Interval], at: int) -> list[Interval]:
    """By how much each neuron rises with the input `at`, anywhere within the bounds that are known of the neurons."""
    found = [(float(k == at), float(k == at)) for k in range(network.inputs)]
    for neuron in network.neurons:
        match neuron:
            case Relu(of=of):
                (low, high), (least, most) = known[of], found[of]
                some = (min(least, 0.0), max(most, 0.0))
                found.append((least, most) if low >= 0 else (0.0, 0.0) if high <= 0 else some)
            case Sum(of=of, weights=weights):
                found.append(_sum([found[k] for k in of], weights, 0.0))
    return found


def excluded(case: Case, network: Network, known: Sequence[Interval]) -> bool:
    """Whether some constraint holds at no point within the bounds."""
    for constraint in case:
        found = least(constraint.left, lambda q: known[q[1] if q[0] == "X" else network.outputs[q[1]]])
        if found is not None and (found > 0 or (found == 0 and constraint.strict)):
            return True
    return False


def least(left: Affine, ends: Callable[[Quantity], Interval]) -> Fraction | None:
    """A lower bound of a sum, from bounds of its quantities; None if there is none."""
    found = left.constant
    for quantity, by in left.terms.items():
        end = ends(quantity)[0 if by > 0 else 1]
        if not math.isfinite(end):
            return None
        found += by * Fraction(end)
    return found


def _sum(of: Sequence[Interval], weights: Sequence[float], bias: float) -> Interval:
    low = [w * end for w, (a, b) in zip(weights, of, strict=True) if w and (end := a if w > 0 else b)]
    high = [w * end for w, (a, b) in zip(weights, of, strict=True) if w and (end := b if w > 0 else a)]
    return -_upper([-x for x in low], -bias), _upper(high, bias)


def _upper(products: list[float], bias: float) -> float:
    """No less than the exact sum, of which each product was rounded to nearest."""
    if not products:
        return bias
    try:
        error = math.fsum(map(abs, products)) * _SLACK + (len(products) + 1) * 5e-324
        return math.nextafter(math.fsum((*products, bias, error, abs(bias) * _SLACK)), math.inf)
    except (OverflowError, ValueError):  # infinities, or a sum beyond all floats
        return math.inf


def _below(value: Fraction) -> float:
    return -_above(-value)


def _above(value: Fraction) -> float:
    """The least float that is no less."""
    try:
        found = float(value)
    except OverflowError:
        return math.inf
    return found if Fraction(found) >= value else math.nextafter(found, math.inf)
