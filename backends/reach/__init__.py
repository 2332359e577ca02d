"""Motion: differential equations and affine maps with bounded inputs (see `docs/backends/reach.md`).

`options` reads the plan, `expressions` its terms. `flow` encloses the solutions of a differential equation over each
time step by Taylor `series` in intervals and zonotopes, `maps` the runs of an affine map in exact fractions. `truth`
evaluates a guarantee over a box, `settle` derives the verdicts, and `picture` writes the enclosures.
"""

from .backend import ReachBackend

BACKEND = ReachBackend()
