"""A Dafny implementation of the node, verified against the contract (see `docs/backends/dafny.md`).

`modules` writes the specification, `scanner` finds what a person's file leaves unproved, `runner` runs Dafny, and
`judge` derives verdicts from its answers.
"""

from .backend import DafnyBackend

BACKEND = DafnyBackend()
