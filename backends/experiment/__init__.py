"""What measured runs justify of a guarantee (see `docs/backends/experiment.md`).

`runs` reads a table of runs, or `figures` printed ones; `expression` is what is measured of each, `statistics` what
that shows, `bound` the tolerance that the guarantee allows. `judge` says it.
"""

from .backend import ExperimentBackend

BACKEND = ExperimentBackend()
