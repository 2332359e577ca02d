"""The AJPF backend (see `docs/backends/ajpf.md`)."""

from .backend import AjpfBackend

BACKEND = AjpfBackend()
