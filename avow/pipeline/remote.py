"""Where a run sends jobs that other machines can execute."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Mapping
from dataclasses import field
from typing import Protocol

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.pipeline.requests import Request, Response


class Executor(Protocol):
    """Executes jobs on other machines."""

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        """Worker → the identities of the tools that it has."""
        ...

    def run(self, request: Request) -> Response:
        """Called by many threads at once; a failure is a response, too."""
        ...


@dataclass(frozen=True, slots=True)
class Remote:
    """Other machines, where a run sends what can be sent."""

    executor: Executor
    tools: Mapping[str, tuple[str, str]]
    """Tool → version and program's digest there, which the keys of this run name."""
    again: threading.BoundedSemaphore = field(
        default_factory=lambda: threading.BoundedSemaphore(os.cpu_count() or 1), repr=False
    )
    """Limits what is re-run on this machine, which executes less at once than a cluster."""
    _warned: set[str] = field(default_factory=set, repr=False)

    def warn(self, text: str) -> None:
        """On standard error, once."""
        if text not in self._warned:
            self._warned.add(text)
            print(f"warning: {text}", file=sys.stderr)


def remote(executor: Executor) -> Remote:
    """What an executor offers. Raises Rejected if it has no worker."""
    offers = executor.offers()
    if not offers:
        raise Rejected(Diagnostic("CLUSTER004", "the cluster has no workers", hint="start one: avow worker --on …"))
    chosen: dict[str, tuple[str, str]] = {}
    for tools in offers.values():
        for name, version, program in sorted(tools):
            chosen[name] = max(chosen.get(name, ("", "")), (version, program))
    return Remote(executor, chosen)
