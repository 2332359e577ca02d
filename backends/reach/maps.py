"""Runs of an affine map ``x' = A x + B u + c`` with inputs in a box, in exact fractions.

The outputs are further rows: ``y = C x' + D u + d`` becomes a row over x and u, and a column of zeros.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import islice

from .expressions import Expression, value
from .truth import Span
from .tuning import INDUCTION, MARGINS

Spans = tuple[Span, ...]
ZERO = Fraction(0)


class NotAffine(Exception):  # noqa: N818 - it says what it is
    """A term is not affine."""


@dataclass(frozen=True, slots=True)
class Affine:
    """The sum of factors times names, and a constant."""

    factors: Mapping[str, Fraction] = field(default_factory=dict)
    constant: Fraction = ZERO

    def __add__(self, other: Affine) -> Affine:
        names = dict.fromkeys((*self.factors, *other.factors))
        sums = {name: self.factors.get(name, ZERO) + other.factors.get(name, ZERO) for name in names}
        return Affine({name: by for name, by in sums.items() if by}, self.constant + other.constant)

    def scaled(self, by: Fraction) -> Affine:
        return Affine({name: by * factor for name, factor in self.factors.items() if by}, by * self.constant)

    def __sub__(self, other: Affine) -> Affine:
        return self + other.scaled(Fraction(-1))

    def __mul__(self, other: Affine) -> Affine:
        if self.factors and other.factors:
            raise NotAffine
        return self.scaled(other.constant) if self.factors else other.scaled(self.constant)

    def __truediv__(self, other: Affine) -> Affine:
        if other.factors or not other.constant:
            raise NotAffine
        return self.scaled(1 / other.constant)

    def __pow__(self, exponent: int) -> Affine:
        whole = Affine({}, Fraction(1))
        for _ in range(exponent):
            whole = whole * self
        return whole

    def sqrt(self) -> Affine:
        raise NotAffine

    sin = cos = sqrt


def affine(name: str, term: Expression, of: Mapping[str, Affine]) -> Affine:
    """Raises NotAffine with the name."""
    try:
        found: Affine = value(term, of, lambda number: Affine({}, number))
    except NotAffine:
        raise NotAffine(name) from None
    return found


@dataclass(frozen=True, slots=True)
class Map:
    """Each row has the factors of the states, those of the inputs, and the constant. The rows of the outputs follow
    those of the states."""

    states: tuple[tuple[Fraction, ...], ...]
    inputs: tuple[tuple[Fraction, ...], ...]
    constants: tuple[Fraction, ...]
    size: int
    """The number of states."""

    @classmethod
    def of(cls, equations: Mapping[str, Expression], outputs: Mapping[str, Expression], inputs: Sequence[str]) -> Map:
        """Raises NotAffine."""
        names = {name: Affine({name: Fraction(1)}) for name in (*equations, *inputs)}
        moved = {name: affine(name, term, names) for name, term in equations.items()}
        rows = [*moved.values(), *(affine(name, term, {**names, **moved}) for name, term in outputs.items())]
        return cls(
            tuple(tuple(row.factors.get(name, ZERO) for name in equations) for row in rows),
            tuple(tuple(row.factors.get(name, ZERO) for name in inputs) for row in rows),
            tuple(row.constant for row in rows),
            len(equations),
        )

    def boxes(self, initial: Spans, inputs: Spans) -> Iterator[Spans]:
        """The least box around all values of states and outputs after 1, 2, 3, … steps."""
        own = [_image(row, inputs) + Span(c, c) for row, c in zip(self.inputs, self.constants, strict=True)]
        gone = [Span(ZERO, ZERO)] * len(self.states)
        rows = self.states  # C A^k, of each row
        while True:
            # x_k+1 = A^k+1 x_0 + the sum of A^j (B u + c): a row of it is independent in each of its inputs
            yield tuple(_image(row, initial) + g + o for row, g, o in zip(rows, gone, own, strict=True))
            gone = [
                g + _image(_product(row, self.inputs[: self.size]), inputs) + _point(row, self.constants)
                for g, row in zip(gone, rows, strict=True)
            ]
            rows = tuple(_product(row, self.states[: self.size]) for row in rows)

    def returning(self, initial: Spans, inputs: Spans) -> Iterator[list[Spans]]:
        """Lists of boxes that hold all runs after each number of steps: the first steps from the initial box into
        another box, and the steps from there till all are in that box again."""
        exact = list(islice(self.boxes(initial, inputs), INDUCTION))
        first = 0
        while first < INDUCTION:
            hull = ([initial, *exact][first])[: self.size]
            for box in exact[first : 2 * first + 1]:
                hull = tuple(a | b for a, b in zip(hull, box[: self.size], strict=True))
            for margin in MARGINS:
                begin = tuple(span.widened(margin) for span in hull)
                found: list[Spans] = []
                for box in islice(self.boxes(begin, inputs), first + 1):
                    found.append(box)
                    if all(a.within(b) for a, b in zip(box[: self.size], begin, strict=True)):
                        yield exact[:first] + found
                        break
            first = 2 * first or 1


def _dot(one: Sequence[Fraction], other: Sequence[Fraction]) -> Fraction:
    return sum((a * b for a, b in zip(one, other, strict=True)), ZERO)


def _point(row: Sequence[Fraction], constants: Sequence[Fraction]) -> Span:
    total = _dot(row, constants[: len(row)])
    return Span(total, total)


def _image(row: Sequence[Fraction], box: Spans) -> Span:
    total = Span(ZERO, ZERO)
    for by, span in zip(row, box, strict=True):
        total = total + Span(by, by) * span
    return total


def _product(row: Sequence[Fraction], matrix: Sequence[Sequence[Fraction]]) -> tuple[Fraction, ...]:
    columns = len(matrix[0]) if matrix else 0
    return tuple(sum((by * line[k] for by, line in zip(row, matrix, strict=True)), ZERO) for k in range(columns))
