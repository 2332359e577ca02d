"""The experiment backend (see `docs/backends/experiment.md`)."""

from .backend import ExperimentBackend

BACKEND = ExperimentBackend()
