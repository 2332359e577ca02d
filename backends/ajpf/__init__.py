"""BDI agents in Gwendolen, model checked (see `docs/backends/ajpf.md`).

A guarantee becomes properties of the agent by the plan's table (`options`, `mapping`). The agents' states are explored
(`society`, `explore`) and the properties are checked on them (`checker`); AIL itself (`replay`) gives a second
opinion. `settle` combines all results into one outcome for each guarantee.
"""

from .backend import AjpfBackend

BACKEND = AjpfBackend()
