"""A guarantee that compares a step with the step before: ``in.x >= previous(in.x, in.x) -> out.z >= previous(out.z,
out.z)``. A network has no memory, so any two inputs that the assumptions allow may follow each other: the guarantee is
judged of two copies of the network, and of one copy for a first step.

Beside the two copies, the network has the rise of each neuron, from the step before to this one: interval bounds of it
are closer than those of a difference of two copies. Closer still are bounds by slopes: a rise is the sum of each
input's rise times an average of the slopes on the way. Marabou is not asked: on two copies it was seen to ignore its
limit of time, in a step of its simplex method.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, combinations
from time import monotonic

from avow.formulas.formula import free_variables, substitute
from avow.formulas.traversal import transform
from avow.language.subterms import histories
from avow.language.terms import History, Past, Term

from .cases import Affine, Box, Case, Quantity, Side, by_rises
from .intervals import Interval, bounds, least, slopes
from .options import Argmax, Given, Output
from .reading import Network, Neuron, Relu, Sum
from .tuning import CELLS

BEFORE = " before"
"""After the name of a port: its value at the step before."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A formula, under assumptions, of one step or of two."""

    formula: Term
    assumed: Mapping[str, Term]
    given: Given


def compares_steps(formula: Term) -> bool:
    """Whether it speaks of no other step than this one and the one before."""
    return all(
        part.operator is Past.PREVIOUS and not any(map(histories, part.arguments)) for part in histories(formula)
    )


def claims(formula: Term, assumed: Mapping[str, Term], given: Given) -> list[Claim]:
    """What makes the guarantee hold: the formula, or what it says at a first step and at later ones."""
    if not histories(formula):
        return [Claim(formula, assumed, given)]
    first = transform(formula, lambda part: part.arguments[1] if isinstance(part, History) else part)
    later = transform(formula, lambda part: _before(part.arguments[0]) if isinstance(part, History) else part)
    both = {**assumed, **{name + BEFORE: _before(term) for name, term in assumed.items()}}
    return [Claim(first, assumed, given), Claim(later, both, _twice(given))]


def _before(term: Term) -> Term:
    return substitute(term, {v: replace(v, name=v.name + BEFORE) for v in free_variables(term)})


def _twice(given: Given) -> Given:
    """Its ports, and those of the step before, connected to the two copies."""
    count, outputs = given.network.inputs, len(given.network.outputs)
    inputs = {name: tuple(replace(one, index=one.index + count) for one in each) for name, each in given.inputs.items()}
    now = {name: _moved(output, outputs) for name, output in given.outputs.items()}
    return replace(
        given,
        network=_copies(given.network),
        inputs={**inputs, **{name + BEFORE: each for name, each in given.inputs.items()}},
        outputs={**now, **{name + BEFORE: output for name, output in given.outputs.items()}},
        one=given,
    )


def _moved(output: Output, by: int) -> Output:
    if isinstance(output, Argmax):
        return replace(output, first=output.first + by)
    return replace(output, index=output.index + by)


def _copies(network: Network) -> Network:
    """Inputs, and outputs: those of the step before, those of this step, and their rises."""
    count = network.inputs
    before, now, rise = ([*range(k * count, (k + 1) * count)] for k in range(3))
    neurons = list[Neuron]()

    def put(neuron: Neuron) -> int:
        neurons.append(neuron)
        return 3 * count + len(neurons) - 1

    for neuron in network.neurons:
        match neuron:
            case Relu(of=of):
                before.append(put(Relu(before[of])))
                now.append(put(Relu(now[of])))
                rise.append(put(Sum((now[-1], before[-1]), (1.0, -1.0), 0.0)))
            case Sum(of=parts, weights=weights):
                for copy in (before, now):
                    copy.append(put(replace(neuron, of=tuple(copy[k] for k in parts))))
                rise.append(put(Sum(tuple(rise[k] for k in parts), weights, 0.0)))
    outputs = tuple(copy[k] for copy in (before, now, rise) for k in network.outputs)
    return Network(3 * count, (3 * count,), tuple(neurons), outputs)


# -- slopes ------------------------------------------------------------------------------------------------------------

_Ends = tuple[Fraction, Fraction]


def excluded_by_slopes(case: Case, given: Given, within: Box, end: float) -> bool:
    """Whether some constraint of the case, or the sum of two, would have a sum of rises be negative that never is.
    `within` bounds the inputs of the copies, and their rises; `end` is the time to stop at."""
    assert given.one is not None
    sides = [(low.value, high.value) for low, high in within if low is not None and high is not None]
    count, outputs = given.one.network.inputs, len(given.one.network.outputs)
    hull = [(min(a, c), max(b, d)) for (a, b), (c, d) in zip(sides[:count], sides[count : 2 * count], strict=True)]
    of_outputs = [each for each in case if any(kind == "Y" for kind, _ in each.left.terms)]
    sums = ((by_rises(a.left.plus(b.left), given), a.strict or b.strict) for a, b in combinations(of_outputs, 2))
    return any(
        _is_positive(left, strict, given.one.network, hull, sides[2 * count :], end)
        for left, strict in chain(((each.left, each.strict) for each in of_outputs), sums)
        if all(index >= 2 * (count if kind == "X" else outputs) for kind, index in left.terms)
    )


def _is_positive(
    left: Affine, strict: bool, network: Network, hull: list[_Ends], rises: list[_Ends], end: float
) -> bool:
    """Whether a sum of rises is positive (at least zero, if `strict`) for all rises of the inputs within bounds. On the
    way from one point of the box to the other the slopes are those of ever smaller cells, whose average counts."""
    plain, cells, tried = Affine(left.terms), [hull], 0
    while cells:
        tried, cell = tried + 1, cells.pop()
        known = bounds(network, tuple((Side(low, False), Side(high, False)) for low, high in cell))
        sure = best = left.constant
        for k, (low, high) in enumerate(rises):
            if low or high:
                ends = _slopes_of_rises(network, slopes(network, known, k))
                least_slope, most = least(plain, ends), least(plain.times(Fraction(-1)), ends)
                if least_slope is None or most is None:
                    return False
                sure += min(slope * by for slope in (least_slope, -most) for by in (low, high))
                best += min(max(least_slope * by, -most * by) for by in (low, high))
        if tried > CELLS or monotonic() > end or best < 0:
            return False
        if sure < 0 or (sure == 0 and not strict):
            shares = [(b - a) / (d - c) if d > c else Fraction(0) for (a, b), (c, d) in zip(cell, hull, strict=True)]
            at = shares.index(max(shares))
            middle = (cell[at][0] + cell[at][1]) / 2
            cells += [[*cell[:at], part, *cell[at + 1 :]] for part in ((cell[at][0], middle), (middle, cell[at][1]))]
    return True


def _slopes_of_rises(network: Network, found: Sequence[Interval]) -> Callable[[Quantity], Interval]:
    outputs = network.outputs
    return lambda q: found[q[1] - 2 * network.inputs if q[0] == "X" else outputs[q[1] - 2 * len(outputs)]]
