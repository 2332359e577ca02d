"""The Dafny backend (see `docs/backends/dafny.md`)."""

from avow.backends.dafny.backend import DafnyBackend

BACKEND = DafnyBackend()
