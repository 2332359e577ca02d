"""The AJPF backend (see `docs/backends/ajpf.md`)."""

from avow.backends.ajpf.backend import AjpfBackend

BACKEND = AjpfBackend()
