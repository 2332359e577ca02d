"""Probabilistic models in PRISM, checked by Storm (see `docs/backends/storm.md`).

`options` connects ports to the model's variables, `writing` writes guarantees as labels, rewards and properties,
`asking` (a script in a process of its own) runs Storm, and `settle` derives the verdicts.
"""

from .backend import StormBackend

BACKEND = StormBackend()
