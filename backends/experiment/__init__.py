"""Recorded runs as evidence for a guarantee (see `docs/backends/experiment.md`).

`table` reads the data, `binding` converts cells to values of ports, `options` reads the plan. `judging` judges each run
by the guarantee's formula, and `verdict` derives the verdict, with the bounds of `statistics`.
"""

from .backend import ExperimentBackend

BACKEND = ExperimentBackend()
