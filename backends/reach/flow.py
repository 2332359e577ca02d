"""Encloses all solutions of ``x' = f(x, u)`` with measurable inputs ``u(t)`` in a box, over each step of time.

A step has five parts, each rigorous in floating point:

1. A box B with ``X + [0, h] f(B, U)`` in B holds all solutions during the step (Picard's operator).
2. With the inputs' middle u, a Taylor polynomial with its remainder over B encloses the solution from the middle of X.
3. The polynomial's Jacobian over X carries the zonotope X along (the mean value form).
4. Other inputs move a solution by e with ``e' <= |df/dx| e + |df/du| |U - u|``, slopes over B and U (as in T. Kapela,
   P. Zgliczynski: A Lohner-type algorithm for control systems and ordinary differential inclusions, 2009).
5. The errors of 2 to 4 become a box that is added to the zonotope.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from .expressions import Expression
from .intervals import Interval, outward
from .series import ZERO, Dual, Undefined, interval, taylor, values
from .tuning import GENERATORS, ORDER, PICARD, TOO_WIDE

Box = tuple[Interval, ...]


class Stuck(Exception):  # noqa: N818 - it says what happened
    """Why there is no enclosure from here on, in words."""


@dataclass(frozen=True, slots=True)
class Step:
    """All solutions between two times, in seconds, and at the second one."""

    start: Fraction
    end: Fraction
    during: Box
    after: Box


@dataclass(frozen=True, slots=True)
class Motion:
    """``x' = f(x, u)``: `equations` by state, and the inputs' box."""

    equations: Mapping[str, Expression]
    inputs: Mapping[str, Interval]

    def steps(self, initial: Box, horizon: Fraction, step: Fraction) -> Iterator[Step]:
        """Steps from time 0 to the horizon. Raises Stuck when there is no further one."""
        now, zonotope, before = Fraction(0), _Zonotope.of(initial), initial
        while now < horizon:
            then = min(now + step, horizon)
            try:
                found, zonotope = self._step(zonotope, before, now, then)
            except (Undefined, OverflowError) as error:
                raise Stuck(str(error)) from None
            yield found
            now, before = then, found.after

    @outward()
    def _step(self, zonotope: _Zonotope, before: Box, start: Fraction, end: Fraction) -> tuple[Step, _Zonotope]:
        """All that the zonotope holds goes on, though solutions are in the box `before` too."""
        h, hull = interval(end - start), zonotope.hull()
        within = self._picard(hull, h)
        nominal = {name: Interval(given.mid()) for name, given in self.inputs.items()}
        center = taylor(self.equations, [(Interval(c),) for c in zonotope.center], nominal, ORDER)
        remainder = taylor(self.equations, [(b,) for b in within], nominal, ORDER + 1)
        last = _power(h)
        moved = [_at([c[0] for c in one], h) + last * rest[-1][0] for one, rest in zip(center, remainder, strict=True)]
        size = len(hull)
        seeds: list[Dual] = [(x, *(Interval(int(i == k)) for i in range(size))) for k, x in enumerate(hull)]
        slopes = [
            [_at([part[1 + j] if len(part) > 1 else ZERO for part in one], h) for j in range(size)]
            for one in taylor(self.equations, seeds, nominal, ORDER)
        ]
        following = zonotope.moved(moved, slopes, self._spread(within, h))
        slope, within = self._slope(within), self._barred(before, within)
        after = tuple(x & z & (y + h * v) for x, y, z, v in zip(following.hull(), before, within, slope, strict=True))
        if any(x.is_empty() or x.is_unbounded() or x.diam() > TOO_WIDE for x in after):
            raise Stuck("the enclosure grows without bounds")
        during = tuple(map(_during, before, within, after, slope, [h] * size))
        return Step(start, end, during, after), following

    def _slope(self, box: Box) -> list[Interval]:
        of = [(x,) for x in (*box, *self.inputs.values())]
        return [found[0] for found in values([*self.equations.values()], [*self.equations, *self.inputs], of)]

    def _picard(self, before: Box, h: Interval) -> Box:
        whole = Interval(0, h.ub())
        box = before
        for _ in range(PICARD):
            found = tuple(x + whole * slope for x, slope in zip(before, self._slope(box), strict=True))
            if any(x.is_empty() or x.is_unbounded() for x in found):
                break
            if all(x.is_subset(y) for x, y in zip(found, box, strict=True)):
                return found
            box = tuple(x + 0.1 * (x - Interval(x.mid())) + Interval(-1e-12, 1e-12) for x in found)
        raise Stuck("no box encloses the step: shorter ones may have one")

    def _barred(self, before: Box, within: Box) -> Box:
        """Where a state's slope points inward beyond an end of its interval, no solution passes that end."""
        found = []
        for k, (x, y) in enumerate(zip(before, within, strict=True)):
            above, below = Interval(x.ub(), y.ub()), Interval(y.lb(), x.lb())
            up, down = (self._slope((*within[:k], face, *within[k + 1 :]))[k] for face in (above, below))
            found.append(Interval(x.lb() if down.lb() >= 0 else y.lb(), x.ub() if up.ub() <= 0 else y.ub()))
        return tuple(found)

    def _spread(self, within: Box, h: Interval) -> list[float]:
        """How far other inputs than the middle ones move the end of the step, at most."""
        whole = (*within, *self.inputs.values())
        size, total = len(within), len(whole)
        duals: list[Dual] = [(x, *(Interval(int(i == k)) for i in range(total))) for k, x in enumerate(whole)]
        found = values([*self.equations.values()], [*self.equations, *self.inputs], duals)
        slopes = [[Interval(part.mag()) for part in (*one[1:], *[ZERO] * (total + 1 - len(one)))] for one in found]
        widths = [Interval((given - Interval(given.mid())).mag()) for given in self.inputs.values()]
        forced = [_dot(row[size:], widths) for row in slopes]
        least = [h * force for force in forced]
        if all(one.ub() == 0 for one in least):
            return [0.0] * size
        bound = [Interval(2 * one.ub() + 1e-300) for one in least]
        for _ in range(PICARD):  # `bound` bounds e during the step once h (|df/dx| bound + forced) is below it
            speed = [_dot(row[:size], bound) + force for row, force in zip(slopes, forced, strict=True)]
            reached = [h * one for one in speed]
            if all(one.ub() <= other.lb() for one, other in zip(reached, bound, strict=True)):
                half = h * h / 2
                ends = [a + half * _dot(row[:size], speed) for a, row in zip(least, slopes, strict=True)]
                return [one.ub() for one in ends]
            bound = [
                old if one.ub() <= old.lb() else Interval(2 * one.ub()) for one, old in zip(reached, bound, strict=True)
            ]
        raise Stuck("the inputs move the solution too far within a step")


def _at(coefficients: Sequence[Interval], h: Interval) -> Interval:
    """Horner's scheme."""
    total = ZERO
    for each in reversed(coefficients):
        total = total * h + each
    return total


def _power(h: Interval) -> Interval:
    total = h
    for _ in range(ORDER):
        total = total * h
    return total


def _dot(row: Sequence[Interval], column: Sequence[Interval]) -> Interval:
    total = ZERO
    for one, other in zip(row, column, strict=True):
        total = total + one * other
    return total


def _during(before: Interval, within: Interval, after: Interval, slope: Interval, h: Interval) -> Interval:
    """A state during a step, from its values at both ends and its slope: where that has one sign, the values at the
    ends are the extremes."""
    whole = Interval(0, h.ub())
    found = (before + whole * slope) & (after - whole * slope) & within
    if slope.lb() >= 0:
        return found & Interval(before.lb(), after.ub())
    if slope.ub() <= 0:
        return found & Interval(after.lb(), before.ub())
    return found


def _above(number: float) -> float:
    return math.nextafter(number, math.inf)


@dataclass(frozen=True, slots=True)
class _Zonotope:
    """The center plus each generator times a number from -1 to 1."""

    center: tuple[float, ...]
    generators: tuple[tuple[float, ...], ...]

    @classmethod
    @outward()
    def of(cls, box: Box) -> _Zonotope:
        center = tuple(x.mid() for x in box)
        return cls(center, _diagonal([(x - Interval(c)).mag() for x, c in zip(box, center, strict=True)]))

    @outward()
    def hull(self) -> Box:
        found = []
        for k, center in enumerate(self.center):
            radius = _above(math.fsum(abs(g[k]) for g in self.generators))  # fsum rounds once
            found.append(Interval(center) + Interval(-radius, radius))
        return tuple(found)

    def moved(
        self, center: Sequence[Interval], slopes: Sequence[Sequence[Interval]], more: Sequence[float]
    ) -> _Zonotope:
        """The image by the mean value form, and a box of the given radii added to it."""
        middle = tuple(x.mid() for x in center)
        errors = [[r, (x - Interval(m)).mag()] for r, x, m in zip(more, center, middle, strict=True)]
        generators = []
        for generator in self.generators:
            column = [Interval(g) for g in generator]
            image = [_dot(row, column) for row in slopes]
            generators.append(tuple(x.mid() for x in image))
            for error, x in zip(errors, image, strict=True):
                error.append((x - Interval(x.mid())).mag())
        generators += _diagonal([_above(math.fsum(error)) for error in errors])
        return _Zonotope(middle, _merged(generators, GENERATORS * len(middle)))


def _diagonal(radii: Sequence[float]) -> tuple[tuple[float, ...], ...]:
    size = len(radii)
    if not all(r >= 0 for r in radii):  # NaN
        raise Stuck("the enclosure has no finite bounds")
    return tuple((*[0.0] * k, r, *[0.0] * (size - k - 1)) for k, r in enumerate(radii) if r > 0)


def _merged(generators: list[tuple[float, ...]], most: int) -> tuple[tuple[float, ...], ...]:
    """At most so many: those that are nearest to a box become one (A. Girard: Reachability of uncertain linear systems
    using zonotopes, 2005)."""
    size = len(generators[0]) if generators else 0
    if len(generators) <= most:
        return tuple(generators)
    ordered = sorted(generators, key=lambda g: sum(map(abs, g)) - max(map(abs, g)))
    small, kept = ordered[: len(generators) - most + size], ordered[len(generators) - most + size :]
    box = [_above(math.fsum(abs(g[k]) for g in small)) for k in range(size)]
    return (*kept, *_diagonal(box))
