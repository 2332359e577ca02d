"""The two nodes, in exact numbers."""

from fractions import Fraction

MARGIN, STEP = 5, Fraction(1, 2)


def guard(distance):
    return {"cap": (distance - MARGIN) / STEP}


def vehicle(cap, last):
    return {"distance": last - cap * STEP * Fraction(9, 10)}
