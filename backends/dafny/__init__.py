"""The Dafny backend (see `docs/backends/dafny.md`)."""

from .backend import DafnyBackend

BACKEND = DafnyBackend()
