"""Works on other machines, by Dask.distributed (the extra ``avow[cluster]``).

The scheduler and its connections are Dask's; what travels is bytes, both ways: nothing that a worker says is unpickled
here. A worker runs each work in a fork of its own (`avow.pipeline.forks`), which ends with its tools when it is done,
out of time, cancelled, or when the worker dies. Who reaches a scheduler can run code on its workers, so that
connections to other machines are by TLS with certificates on both sides.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import json
import os
import queue
import socket
import ssl
import tempfile
import threading
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.pipeline.engine_code import code_mark
from avow.pipeline.executors import Asked, Came, answered
from avow.pipeline.forks import Forks
from avow.pipeline.requests import Tools
from avow.tuning.running import CLUSTER_CONNECT, CLUSTER_RETRIES, WORKER_GRACE

_TLS = {"ca": "AVOW_TLS_CA", "cert": "AVOW_TLS_CERT", "key": "AVOW_TLS_KEY"}
"""Environment: files of the certificate authority, of this side's certificate and of its key."""


@dataclass(frozen=True, slots=True)
class Address:
    """Of a scheduler."""

    url: str
    secure: bool

    @classmethod
    def read(cls, text: str) -> Address:
        """Of ``dask+tls://HOST:PORT`` or ``dask+tcp://HOST:PORT``. Raises Rejected (``CLUSTER001``)."""
        scheme, found, rest = text.partition("://")
        host = rest.rpartition(":")[0].strip("[]")
        if not found or scheme not in ("dask+tls", "dask+tcp") or not host or not rest.rpartition(":")[2].isdigit():
            hint = "dask+tls://HOST:PORT, or dask+tcp://127.0.0.1:PORT on this machine"
            raise Rejected(Diagnostic("CLUSTER001", f"'{text}' is no cluster's address", hint=hint))
        if scheme == "dask+tcp" and not _is_loopback(host):
            hint = "without TLS, whoever reaches the scheduler runs code on its workers: use dask+tls://"
            raise Rejected(
                Diagnostic("CLUSTER001", f"dask+tcp:// leads to this machine only, not to {host}", hint=hint)
            )
        return cls(f"{scheme.removeprefix('dask+')}://{rest}", scheme == "dask+tls")

    def security(self) -> Any:
        """Raises Rejected (``CLUSTER002``) where a certificate is missing."""
        from distributed.security import Security

        if not self.secure:
            return Security(require_encryption=False)
        paths = {name: os.environ.get(variable, "") for name, variable in _TLS.items()}
        missing = [_TLS[name] for name, path in paths.items() if not path or not Path(path).is_file()]
        if missing:
            message = f"dask+tls:// needs certificates: {', '.join(missing)} must name files"
            raise Rejected(Diagnostic("CLUSTER002", message))
        parts = {f"tls_{side}_{part}": paths[part] for side in ("client", "worker") for part in ("cert", "key")}
        return Security(require_encryption=True, tls_ca_file=paths["ca"], **parts)

    def greet(self) -> None:
        """Raises Rejected (``CLUSTER005``) where a certificate, of either side, is not accepted: Dask would only try
        again and again, and not say why. That nobody is there yet is no matter of certificates."""
        if not self.secure:
            return
        paths = {name: os.environ.get(variable, "") for name, variable in _TLS.items()}
        host, _, port = self.url.partition("://")[2].rpartition(":")
        try:
            context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=paths["ca"])
            context.check_hostname = False  # as Dask has it: who has a certificate of the authority belongs to it
            context.load_cert_chain(paths["cert"], paths["key"])
            with (
                socket.create_connection((host.strip("[]"), int(port)), timeout=CLUSTER_CONNECT) as plain,
                context.wrap_socket(plain) as secure,
            ):
                secure.recv(1)  # with TLS 1.3 the other side says only now that it does not accept us
        except ssl.SSLError as error:
            why = getattr(error, "verify_message", "") or error.reason or str(error)
            whose = "the cluster's" if isinstance(error, ssl.SSLCertVerificationError) else "this side's"
            told = f"{whose} certificate is not accepted at {self.url}: {why.replace('_', ' ').lower()}"
            raise Rejected(Diagnostic("CLUSTER005", told)) from error
        except OSError:
            return


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


_BEGAN = "avow began"
"""On a worker: of which code it is. Its forks have that in memory, and would answer for what lies there now."""


def perform(data: bytes, key: str, seconds: float) -> bytes:
    """Runs on a worker: the work in a fork; the answer's bytes, or why there is none as JSON."""
    from distributed import get_worker

    extensions = get_worker().extensions
    if extensions.get(_BEGAN) != code_mark():
        return (
            b"-" + json.dumps([f"Avow is another on {socket.gethostname()} since its worker began", False, ""]).encode()
        )
    forks = extensions.setdefault("avow forks", Forks())
    # one folder for all works of this process: a fork server is of one
    came = answered(forks, data, key, seconds, Path(tempfile.gettempdir()), _cancelled())
    if isinstance(came.data, bytes):
        return b"+" + came.data
    return b"-" + json.dumps([came.failure, came.timed_out, came.log]).encode()


def _cancelled() -> Callable[[], bool]:
    """Whether nobody waits for the task any more that this thread is running."""
    from distributed import get_worker

    worker = get_worker()
    task = worker.get_current_task()

    def cancelled() -> bool:
        found = worker.state.tasks.get(task)
        return found is None or found.state in ("cancelled", "released", "forgotten") or worker.status.name == "closed"

    return cancelled


class Cluster:
    """An executor (`avow.pipeline.executors.Executor`)."""

    def __init__(self, address: Address) -> None:
        """Raises Rejected (``CLUSTER003``) where there is no such cluster, or it does not know us."""
        try:
            from distributed import Client
        except ImportError as error:
            message = "other machines are reached by Dask, which is not installed"
            raise Rejected(Diagnostic("CLUSTER003", message, hint="pip install 'avow[cluster]'")) from error
        security = address.security()
        address.greet()
        try:
            self._client = Client(
                address.url,
                security=security,
                deserializers=["msgpack"],
                set_as_default=False,
                timeout=CLUSTER_CONNECT,
                name="avow",
            )
        except (OSError, TimeoutError, ValueError) as error:
            raise Rejected(Diagnostic("CLUSTER003", f"no cluster answers at {address.url}: {error}")) from error
        self._futures: dict[str, Any] = {}
        self._lock = threading.Lock()
        self._came: queue.SimpleQueue[Came | None] = queue.SimpleQueue()

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        workers = self._client.scheduler_info(n_workers=-1)["workers"]
        return {
            str(name): frozenset(tuple(json.loads(r[5:])) for r in info["resources"] if r.startswith("tool:"))
            for name, info in workers.items()
        }

    @property
    def slots(self) -> int:
        """How many works it does at once."""
        return sum(info["nthreads"] for info in self._client.scheduler_info(n_workers=-1)["workers"].values())

    def submit(self, asked: Asked) -> None:
        seconds = asked.request.seconds + WORKER_GRACE
        with self._lock:
            if asked.key in self._futures:
                return
            future = self._client.submit(
                perform,
                asked.data,
                asked.key,
                seconds,
                key=f"avow-{asked.key}",
                pure=False,
                retries=CLUSTER_RETRIES,
                resources={resource(tool): 1 for tool in asked.request.wanted},
            )
            self._futures[asked.key] = future
        future.add_done_callback(lambda done: self._came.put(_fetched(asked, done)))

    def results(self) -> Iterator[Came]:
        while (came := self._came.get()) is not None:
            with self._lock:
                future = self._futures.pop(came.key, None)
            if future is not None:
                future.release()
                yield came

    def cancel(self, keys: Collection[str]) -> None:
        with self._lock:
            futures = [found for key in keys if (found := self._futures.pop(key, None)) is not None]
        self._client.cancel(futures, force=True)

    def close(self) -> None:
        self.cancel(tuple(self._futures))
        self._came.put(None)
        with contextlib.suppress(OSError, TimeoutError):
            self._client.close(timeout=5)


def _fetched(asked: Asked, future: Any) -> Came:
    """At once: an answer that was not fetched dies with its worker."""
    if future.status != "finished":
        return Came(asked.key, failure="the workers that had it were lost, or did not take it on")
    try:
        said = future.result(timeout=CLUSTER_CONNECT)
    except Exception as error:  # what cannot be read is no answer, whatever it is
        return Came(asked.key, failure=f"the answer cannot be read: {type(error).__name__}"[:200])
    if not isinstance(said, bytes) or said[:1] not in (b"+", b"-"):
        return Came(asked.key, failure="the answer is none")
    if said[:1] == b"+":
        return Came(asked.key, said[1:])
    try:
        failure, timed_out, log = json.loads(said[1:])
        return Came(asked.key, failure=str(failure)[:500], timed_out=timed_out is True, log=str(log))
    except ValueError:
        return Came(asked.key, failure="the answer is none")


def resource(tool: tuple[str, ...]) -> str:
    """A tool as a resource of Dask's."""
    return f"tool:{json.dumps(list(tool))}"


def serve(address: Address, slots: int, tools: Tools) -> None:
    """Be a worker of that cluster, until it ends or this process is told to end. Raises Rejected (``CLUSTER003``)."""
    try:
        from distributed import Worker
    except ImportError as error:
        message = "other machines are reached by Dask, which is not installed"
        raise Rejected(Diagnostic("CLUSTER003", message, hint="pip install 'avow[cluster]'")) from error

    security, began = address.security(), code_mark()
    address.greet()

    async def work() -> None:
        worker = Worker(
            address.url,
            nthreads=slots,
            security=security,
            resources={resource(tool): slots for tool in tools if tool[1]},
            host="127.0.0.1" if not address.secure else None,
            dashboard=False,
            death_timeout=CLUSTER_CONNECT,
        )
        worker.extensions[_BEGAN] = began
        async with worker:
            await worker.finished()

    try:
        asyncio.run(work())
    except (OSError, TimeoutError) as error:
        raise Rejected(Diagnostic("CLUSTER003", f"no cluster answers at {address.url}: {error}")) from error
