"""What ``avow worker`` is: a worker of Dask's that does each work in a fork of its own.

The fork (`avow.pipeline.forks`) ends with its tools when it is done, out of time, cancelled, or when the worker dies.
What a worker offers are resources of Dask's: its own code, its backends' code, and its tools. So a work only comes to
one whose answer would fit its key.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import socket
import tempfile
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from avow import __version__
from avow.backend_kit.registry import backend, names
from avow.base.codec import Unreadable, canonical, from_text, line
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import sha256
from avow.base.tools import package_version
from avow.base.tuning.running import CLUSTER_CONNECT
from avow.pipeline.engine_code import backend_digest, code_mark, reading_digest
from avow.pipeline.executors import Failed, answered
from avow.pipeline.forks import Forks
from avow.pipeline.requests import Request
from avow.pipeline.work import ENGINES, engine_identity, is_portable, tool_identities

if TYPE_CHECKING:
    from avow.pipeline.cluster import Address


@functools.cache
def own_code() -> str:
    """This Avow and its Z3, as a resource."""
    mark = sha256(canonical([reading_digest(), engine_identity()]))[:12]
    return f"avow:{__version__} ({mark}) with Z3 {package_version('z3-solver')}"


def needs(request: Request) -> tuple[str, ...]:
    """The resources that a worker must have for a work."""
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
        with contextlib.suppress(Unreadable):  # whatever it offers, nobody asks for it
            found.add(from_text(tuple[str, str, str], text))
    return frozenset(found)


def _backend(name: str) -> str:
    return f"backend:{name} {backend_digest(backend(name))}"


def _tool(tool: Sequence[str]) -> str:
    return f"tool:{canonical(tool)}"


@dataclass(slots=True)
class _Own:
    """What a worker knows of itself."""

    began: str
    """Of which code it is. Its forks have that in memory, and would answer for what lies there now."""
    forks: Forks = field(default_factory=Forks)
    unfit: str = ""
    """Why it leaves the cluster."""


_OWN = "avow"


def perform(data: bytes, key: str, seconds: float) -> bytes:
    """Runs on a worker: the work in a fork; the answer's bytes, or why there is none as JSON. A worker that cannot do
    works any more leaves: else it would take them all, and fail faster than others are done."""
    from distributed import get_worker

    worker = get_worker()
    own: _Own = worker.extensions[_OWN]
    if own.began != code_mark():
        _leave(worker, own, "Avow is another since this worker began: start it again")
    try:
        # one folder for all works of this process: a fork server is of one
        came = answered(own.forks, data, key, seconds, Path(tempfile.gettempdir()), _cancelled(worker))
    except OSError as error:
        _leave(worker, own, f"it cannot do works any more: {error}")
    if isinstance(came.data, bytes):
        return b"+" + came.data
    said = f"{came.failure} (on {socket.gethostname()})"
    return b"-" + line(Failed(said, came.timed_out, came.log))


def _leave(worker: Any, own: _Own, why: str) -> NoReturn:
    """Have the work done elsewhere, and do no other."""
    from distributed import Reschedule

    own.unfit = own.unfit or why
    worker.loop.add_callback(worker.close)
    raise Reschedule


def _cancelled(worker: Any) -> Callable[[], bool]:
    """Whether nobody waits for the task any more that this thread is running."""
    task = worker.get_current_task()

    def cancelled() -> bool:
        found = worker.state.tasks.get(task)
        return found is None or found.state in ("cancelled", "released", "forgotten") or worker.status.name == "closed"

    return cancelled


def serve(address: Address, slots: int) -> None:
    """Be a worker of that cluster, until it ends or this process is told to end. Raises Rejected (``CLUSTER003``), and
    ``CLUSTER006`` where this machine can do no works any more."""
    from avow.pipeline.cluster import not_installed

    try:
        from distributed import Worker
    except ImportError as error:
        raise not_installed() from error

    own = _Own(code_mark())
    security, resources = address.security(), dict.fromkeys(offered(), slots)
    address.greet()

    async def work() -> None:
        worker = Worker(
            address.url,
            nthreads=slots,
            security=security,
            resources=resources,
            host="127.0.0.1" if not address.secure else None,
            dashboard=False,
            death_timeout=CLUSTER_CONNECT,
        )
        worker.extensions[_OWN] = own
        async with worker:
            await worker.finished()

    try:
        asyncio.run(work())
    except (OSError, TimeoutError) as error:
        raise Rejected(Diagnostic("CLUSTER003", f"no cluster answers at {address.url}: {error}")) from error
    if own.unfit:
        raise Rejected(Diagnostic("CLUSTER006", f"this worker has left the cluster: {own.unfit}"))
