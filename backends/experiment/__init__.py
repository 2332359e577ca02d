"""What recorded runs show of a guarantee (see `docs/backends/experiment.md`).

`table` reads the data, `binding` says how cells become values of ports, `options` reads the plan. `judging` judges each
run by the guarantee's formula, and `verdict` says what that shows, with the bounds of `statistics`.
"""

from .backend import ExperimentBackend

BACKEND = ExperimentBackend()
