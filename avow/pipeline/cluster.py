"""Jobs on other machines, by Dask.distributed (the extra ``avow[cluster]``).

Dask has the scheduler and the connections; what travels is a request's bytes and a response's bytes. A worker is in
`avow.pipeline.cluster_worker`. Anyone who can connect to a scheduler can run code on its workers, so connections to
other machines use TLS with certificates on both sides.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import os
import socket
import ssl
import sys
import tempfile
import threading
import time
from collections.abc import Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.running import CLUSTER_ANSWER, CLUSTER_CONNECT, CLUSTER_LOOK, CLUSTER_PATIENCE, CLUSTER_RETRIES
from avow.pipeline.cluster_worker import OWN, Own, needs, offered, own_code, perform, tools_of
from avow.pipeline.engine_code import code_mark
from avow.pipeline.requests import Request, Response, read_response, request_bytes, request_digest

_TLS = {"ca": "AVOW_TLS_CA", "cert": "AVOW_TLS_CERT", "key": "AVOW_TLS_KEY"}
"""Environment: files of the certificate authority, of this side's certificate and of its key."""
_GONE = "the cluster's scheduler does not answer any more"
_NOBODY = "no worker of the cluster is left that could do it"


@dataclass(frozen=True, slots=True)
class Address:
    """Of a scheduler."""

    url: str
    secure: bool

    @classmethod
    def read(cls, text: str) -> Address:
        """From ``dask+tls://HOST:PORT`` or ``dask+tcp://HOST:PORT``. Raises Rejected (``CLUSTER001``)."""
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
        """Raises Rejected: ``CLUSTER002`` where a certificate is missing, ``CLUSTER005`` where one, of either side, is
        not accepted (Dask would retry without a reason given)."""
        from distributed.security import Security  # an extra

        if not self.secure:
            return Security(require_encryption=False)
        paths = {name: os.environ.get(variable, "") for name, variable in _TLS.items()}
        missing = [_TLS[name] for name, path in paths.items() if not path or not Path(path).is_file()]
        if missing:
            message = f"dask+tls:// needs certificates: {', '.join(missing)} must name files"
            raise Rejected(Diagnostic("CLUSTER002", message))
        self._greet(paths)
        parts = {f"tls_{side}_{part}": paths[part] for side in ("client", "worker") for part in ("cert", "key")}
        return Security(require_encryption=True, tls_ca_file=paths["ca"], **parts)

    def _greet(self, paths: Mapping[str, str]) -> None:
        host, _, port = self.url.partition("://")[2].rpartition(":")
        try:
            context = ssl.create_default_context(ssl.Purpose.SERVER_AUTH, cafile=paths["ca"])
            context.check_hostname = False  # as Dask has it: a certificate of the authority is enough
            context.load_cert_chain(paths["cert"], paths["key"])
            with (
                socket.create_connection((host.strip("[]"), int(port)), timeout=CLUSTER_CONNECT) as plain,
                context.wrap_socket(plain) as secure,
            ):
                secure.recv(1)  # with TLS 1.3 the other side rejects us only now
        except ssl.SSLError as error:
            why = getattr(error, "verify_message", "") or error.reason or str(error)
            whose = "the cluster's" if isinstance(error, ssl.SSLCertVerificationError) else "this side's"
            told = f"{whose} certificate is not accepted at {self.url}: {why.replace('_', ' ').lower()}"
            raise Rejected(Diagnostic("CLUSTER005", told)) from error
        except OSError:
            return  # a scheduler that is not up yet has no fault of certificates


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Cluster:
    """A remote executor (`avow.pipeline.dispatch.Executor`)."""

    def __init__(self, address: Address) -> None:
        """Raises Rejected (``CLUSTER003``) if there is no such cluster, or it rejects us."""
        try:
            from distributed import Client  # an extra
        except ImportError as error:
            raise _not_installed() from error
        security = address.security()
        _log_nothing()
        try:
            self._client = Client(
                address.url, security=security, set_as_default=False, timeout=CLUSTER_CONNECT, name="avow"
            )
        except (OSError, TimeoutError, ValueError) as error:
            raise Rejected(Diagnostic("CLUSTER003", f"no cluster answers at {address.url}: {error}")) from error
        self._looking = threading.Lock()
        self._looked: tuple[float, Mapping[str, Mapping[str, int]] | None] = (float("-inf"), None)
        """When the scheduler was last asked for its workers, and what it answered."""
        self._warned = ""

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        """Raises Rejected (``CLUSTER004``) if there are workers, but none of them fits."""
        workers = self._workers()
        fit = {name: offered for name, offered in workers.items() if own_code() in offered}
        if workers and not fit:
            found = sorted({name[5:] for offered in workers.values() for name in offered if name.startswith("avow:")})
            message = f"the cluster's workers have another Avow or Z3: {', '.join(found) or 'none that says so'}"
            hint = f"{own_code()[5:]} is here; install the same there, and start the workers again"
            raise Rejected(Diagnostic("CLUSTER004", message, hint=hint))
        if len(fit) < len(workers):
            print(
                f"warning: {len(workers) - len(fit)} of the cluster's {len(workers)} workers have another Avow or Z3 "
                "and get no jobs",
                file=sys.stderr,
            )
        return {name: tools_of(offered) for name, offered in fit.items()}

    @property
    def slots(self) -> int:
        """How many jobs it executes at once."""
        return sum(offered[own_code()] for offered in self._workers().values() if own_code() in offered)

    def run(self, request: Request) -> Response:
        data = request_bytes(request)
        digest = request_digest(data)
        for _ in range(1 + CLUSTER_RETRIES):
            try:
                future = self._client.submit(
                    perform, data, key=f"avow-{digest}", pure=False, resources=dict.fromkeys(needs(request), 1)
                )
                response = self._awaited(future, request, digest)
            except CancelledError:  # the connection was lost; the scheduler may come again
                continue
            except Exception as error:  # a client that lost its cluster raises anything
                return Response(digest, failure=f"{_GONE} ({type(error).__name__})")
            return response
        return Response(digest, failure=_GONE)

    def close(self) -> None:
        """Ends what is under way, and its tools with it."""
        with contextlib.suppress(Exception):  # as above
            self._client.close(timeout=5)

    def _awaited(self, future: Any, request: Request, digest: str) -> Response:
        """Dask waits without limit for a worker that can execute the job, so this wait has a limit of its own. Raises
        CancelledError if the connection was lost."""
        lacking_since: float | None = None
        while True:
            try:
                return read_response(future.result(timeout=CLUSTER_LOOK), digest)
            except TimeoutError:
                why = self._unable(request)
            except CancelledError:
                raise
            except Exception as error:  # KilledWorker, or anything that kept a worker from starting
                why = "worker after worker was lost over it, or could not begin it"
                return Response(digest, failure=f"{why} ({type(error).__name__})")
            lacking_since = (lacking_since or time.monotonic()) if why else None
            if why and why != self._warned:
                print(f"warning: {why}; waited for, {CLUSTER_PATIENCE:.0f} s", file=sys.stderr)
            self._warned = why
            if lacking_since and time.monotonic() - lacking_since > CLUSTER_PATIENCE:
                future.cancel(force=True)
                return Response(digest, failure=why)

    def _unable(self, request: Request) -> str:
        """Why no worker can execute the job now; empty if one can. The scheduler is asked once for all threads."""
        with self._looking:
            when, workers = self._looked
            if time.monotonic() - when > CLUSTER_LOOK:
                try:
                    workers = self._workers(CLUSTER_ANSWER)
                except Exception:  # of any kind: there is no answer
                    workers = None
                self._looked = time.monotonic(), workers
        if workers is None:
            return _GONE
        return "" if any(set(needs(request)) <= offered.keys() for offered in workers.values()) else _NOBODY

    def _workers(self, seconds: float = CLUSTER_CONNECT) -> Mapping[str, Mapping[str, int]]:
        """The resources of each worker. Raises whatever a client raises that has lost its cluster."""
        found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=seconds)
        return {str(name): info["resources"] for name, info in found["workers"].items() if info["status"] == "running"}


def serve(address: Address, slots: int) -> None:
    """Be a worker of that cluster, until it ends or this process is told to end. Raises Rejected (``CLUSTER003``), and
    ``CLUSTER006`` if this machine can execute no more jobs."""
    own = Own(code_mark())
    own.processes.prepare(Path(tempfile.gettempdir()))  # Dask starts threads
    try:
        from distributed import Worker  # an extra
    except ImportError as error:
        raise _not_installed() from error

    security, resources = address.security(), dict.fromkeys(offered(), slots)

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
        worker.extensions[OWN] = own
        async with worker:
            await worker.finished()

    try:
        asyncio.run(work())
    except (OSError, TimeoutError) as error:
        raise Rejected(Diagnostic("CLUSTER003", f"no cluster answers at {address.url}: {error}")) from error
    if own.unfit:
        raise Rejected(Diagnostic("CLUSTER006", f"this worker has left the cluster: {own.unfit}"))


def _not_installed() -> Rejected:
    """``CLUSTER003``."""
    message = "other machines are reached by Dask, which is not installed"
    return Rejected(Diagnostic("CLUSTER003", message, hint="pip install 'avow[cluster]'"))


def _log_nothing() -> None:
    """Dask's log is of no use on the user's terminal: a response states the failure."""
    for name in ("asyncio", "tornado", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("asyncio", "tornado", "distributed"):
            logging.getLogger(name).disabled = True
