"""Runtime monitors: ROSMonitoring configurations, RML (`rml`), and an engine of our own.

Messages become values by rules (`options`, `rules`, `reading`). The engine (`engine`) judges the clauses of one node
(`watched`): by the latest values; by those of the inputs that an answer answered (`pairing`); or, for a clause that
speaks of other steps (`memory`), in the order of the steps (`word`). A `session` has the engines of several nodes,
`columns` counts the events of a trace at which every clause holds, and `live` brings the messages of a running graph.
"""

from __future__ import annotations

from .backend import RosMonitoringBackend

BACKEND = RosMonitoringBackend()
