"""Runtime monitors: ROSMonitoring configurations, RML, and an engine of our own."""

from __future__ import annotations

from .backend import RosMonitoringBackend

BACKEND = RosMonitoringBackend()
