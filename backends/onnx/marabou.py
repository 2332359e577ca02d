"""Marabou's answer to one case (G. Katz et al., The Marabou framework for verification and analysis of deep neural
networks, CAV 2019). It computes in floating point with tolerances: its `unsat` is no exact proof."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction

from .cases import Affine, Case
from .intervals import Interval
from .reading import Network, Relu, Sum

UNSAT, SAT = "unsat", "sat"


def ask(
    network: Network, case: Case, known: Sequence[Interval], seconds: float, margin: float = 0.0
) -> tuple[str, tuple[float, ...]]:
    """The answer in Marabou's word (`unsat`, `sat`, `TIMEOUT`, …), and the inputs if it is `sat`. `known` are bounds of
    every neuron; with a `margin`, strict inequalities hold by so much, relative to their bound."""
    from maraboupy import MarabouCore

    if seconds < 1:
        return "TIMEOUT", ()
    query = MarabouCore.InputQuery()
    query.setNumberOfVariables(len(known))
    for k, (low, high) in enumerate(known):
        query.setLowerBound(k, low)
        query.setUpperBound(k, high)
    for k in range(network.inputs):
        query.markInputVariable(k, k)
    for k, output in enumerate(dict.fromkeys(network.outputs)):
        query.markOutputVariable(output, k)

    def add(kind: object, terms: Mapping[int, float], scalar: float) -> None:
        equation = MarabouCore.Equation(kind)
        for variable, by in terms.items():
            equation.addAddend(by, variable)
        equation.setScalar(scalar)
        query.addEquation(equation)

    for number, neuron in enumerate(network.neurons, network.inputs):
        match neuron:
            case Relu(of=of):
                MarabouCore.addReluConstraint(query, of, number)
            case Sum(of=of, weights=weights, bias=bias):
                terms = _gathered(of, weights)
                terms[number] = terms.get(number, 0.0) - 1.0
                add(MarabouCore.Equation.EQ, terms, -bias)
    for constraint in case:
        left = _by_variable(network, constraint.left)
        least = margin * (1 + abs(float(constraint.left.constant))) if constraint.strict else 0.0
        add(MarabouCore.Equation.LE, left, -float(constraint.left.constant) - least)
    options = MarabouCore.Options()
    options._timeoutInSeconds = int(seconds)
    options._verbosity = 0
    with _quiet():
        word, values, _ = MarabouCore.solve(query, options)
    return word, tuple(values[k] for k in range(network.inputs)) if word == SAT else ()


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """Keeps what the library prints from standard output. Its own `redirect` does not give standard output back."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def _gathered(of: Sequence[int], weights: Sequence[float]) -> dict[int, float]:
    found: dict[int, float] = {}
    for k, weight in zip(of, weights, strict=True):
        found[k] = found.get(k, 0.0) + weight
    return {k: weight for k, weight in found.items() if weight}


def _by_variable(network: Network, left: Affine) -> dict[int, float]:
    found: dict[int, Fraction] = {}
    for (kind, index), by in left.terms.items():
        variable = index if kind == "X" else network.outputs[index]
        found[variable] = found.get(variable, Fraction(0)) + by
    return {variable: float(by) for variable, by in found.items() if by}
