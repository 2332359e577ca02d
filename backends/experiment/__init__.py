"""The experiment backend (see `docs/backends/experiment.md`)."""

from avow.backends.experiment.backend import ExperimentBackend

BACKEND = ExperimentBackend()
