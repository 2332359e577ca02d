"""This backend's numbers, each with its reason."""

ORDER = 4
"""Order of the Taylor polynomials: with steps that a person chooses, a higher one gains less than it costs."""

GENERATORS = 16
"""Generators of a zonotope for each state: more are merged into a box. Some percent of width, at half the time."""

PICARD = 12
"""Attempts to enclose a step: each widens the box, and few need more than three."""

TOO_WIDE = 1e9
"""Width of an enclosure at which it is given up: it grows without bounds, and says nothing."""

STEPS = 20_000
"""Steps of a run: each takes some milliseconds, and is a line of a file."""

STATES = 12
"""States and inputs each: a step's cost grows with the cube of the states."""

INDUCTION = 128
"""Steps of an affine map after which a box has to have returned into itself: the fractions grow with each step."""

MARGINS = (0, 20, 5)
"""By which share of its width the box of an induction is widened on each side: none, a twentieth, a fifth."""

CORNERS = 64
"""Corners of the boxes that are run for a counterexample."""

EXPONENT = 16
"""The greatest exponent in a term."""

LENGTH = 2_000
"""Characters of a term."""
