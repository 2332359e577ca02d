"""``avow worker``: a Dask worker that executes each job in a process of its own.

That process (`avow.pipeline.processes`) ends with its tools when it is done, out of time, cancelled, or when the worker
dies. A worker offers, as Dask's resources, its own code, its backends' code, and its tools, so that a job only goes to
a worker whose answer fits its key.
"""

from __future__ import annotations

import contextlib
import functools
import platform
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NoReturn

from avow import __version__
from avow.backend_kit.registry import backend, names
from avow.base.codec import Unreadable, canonical, from_text
from avow.base.files import sha256
from avow.base.tools import package_version
from avow.pipeline.engine_code import backend_digest, code_mark, reading_digest
from avow.pipeline.methods import is_portable, tool_identities
from avow.pipeline.processes import Processes
from avow.pipeline.requests import Request, read_request, response_bytes
from avow.pipeline.work import ENGINES, engine_identity


@functools.cache
def own_code() -> str:
    """This Avow and its Z3, as a resource."""
    mark = sha256(canonical([reading_digest(), engine_identity()]))[:12]
    return f"avow:{__version__} ({mark}) with Z3 {package_version('z3-solver')}"


def needs(request: Request) -> tuple[str, ...]:
    """The resources that a worker must have for a job."""
    own = () if request.engine in ENGINES else (_backend(request.engine),)
    return (own_code(), *own, *map(_tool, request.wanted))


def offered() -> tuple[str, ...]:
    """The resources of this machine."""
    portable = {name: tool for name in names() if is_portable(tool := backend(name))}
    tools = dict.fromkeys(identity for tool in portable.values() for identity in tool_identities(tool))
    return (own_code(), *map(_backend, portable), *(_tool(tool) for tool in tools if tool[1]))


def tools_of(resources: Iterable[str]) -> frozenset[tuple[str, ...]]:
    """The tools among a worker's resources, as `tool_identities` has them."""
    found = set()
    for text in (resource[5:] for resource in resources if resource.startswith("tool:")):
        with contextlib.suppress(Unreadable):  # no job asks for such a resource
            found.add(from_text(tuple[str, str, str], text))
    return frozenset(found)


def _backend(name: str) -> str:
    return f"backend:{name} {backend_digest(backend(name))}"


def _tool(tool: Sequence[str]) -> str:
    return f"tool:{canonical(tool)}"


@dataclass(slots=True)
class Own:
    """A worker's state."""

    began: str
    """The code that it has in memory; the keys that it computes name the code on disk."""
    processes: Processes = field(default_factory=Processes)
    unfit: str = ""
    """The reason why it leaves the cluster."""


OWN = "avow"


def perform(data: bytes) -> bytes:
    """Execute the request on this worker; the response. A worker that cannot execute jobs any more leaves the cluster:
    otherwise it would take all jobs, as it fails faster than others finish."""
    from distributed import get_worker  # an extra

    worker = get_worker()
    own: Own = worker.extensions[OWN]
    if own.began != code_mark():
        _leave(worker, own, "Avow is another since this worker began: start it again")
    try:
        response = own.processes.run(read_request(data), Path(tempfile.gettempdir()), _cancelled(worker))
    except OSError as error:
        _leave(worker, own, f"it cannot do works any more: {error}")
    if response.failure:
        response = replace(response, failure=f"{response.failure} (on {platform.node()})")
    return response_bytes(response)


def _leave(worker: Any, own: Own, why: str) -> NoReturn:
    """Have another worker execute the job, and execute no more."""
    from distributed import Reschedule  # an extra

    own.unfit = own.unfit or why
    worker.loop.add_callback(worker.close)
    raise Reschedule


def _cancelled(worker: Any) -> Callable[[], bool]:
    """Whether the task that this thread runs was cancelled."""
    task = worker.get_current_task()

    def cancelled() -> bool:
        found = worker.state.tasks.get(task)
        return found is None or found.state in ("cancelled", "released", "forgotten") or worker.status.name == "closed"

    return cancelled
