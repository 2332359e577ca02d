"""Works on other machines, by Dask.distributed (the extra ``avow[cluster]``).

The scheduler and its connections are Dask's; what travels is bytes, both ways: nothing that a worker says is unpickled
here, and nothing that it prints is shown. What a worker does is in `avow.pipeline.cluster_worker`. Who reaches a
scheduler can run code on its workers, so that connections to other machines are by TLS with certificates on both sides.
"""

from __future__ import annotations

import contextlib
import ipaddress
import logging
import os
import queue
import socket
import ssl
import sys
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

from avow.base.codec import Unreadable, from_text
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.tuning.running import (
    CLUSTER_ANSWER,
    CLUSTER_CONNECT,
    CLUSTER_LOOK,
    CLUSTER_PATIENCE,
    CLUSTER_RETRIES,
    WORKER_GRACE,
)
from avow.pipeline.cluster_worker import needs, own_code, perform, tools_of
from avow.pipeline.executors import Asked, Came, Failed

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


class Cluster:
    """An executor (`avow.pipeline.executors.Executor`)."""

    def __init__(self, address: Address) -> None:
        """Raises Rejected (``CLUSTER003``) where there is no such cluster, or it does not know us."""
        try:
            from distributed import Client
        except ImportError as error:
            raise not_installed() from error
        security = address.security()
        address.greet()
        _unpickle_nothing()
        _say_nothing()
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
        for topic in ("print", "warn"):  # else a worker writes on our terminal, and into our answer
            self._client.unsubscribe_topic(topic)
        self._under_way: dict[str, tuple[Asked, Any]] = {}
        self._tries: dict[str, int] = {}
        self._wanted: set[frozenset[str]] = set()
        self._lock = threading.Lock()
        self._closed = threading.Event()
        self._came: queue.SimpleQueue[Came | None] = queue.SimpleQueue()
        threading.Thread(target=self._watch, daemon=True).start()

    def offers(self) -> Mapping[str, frozenset[tuple[str, ...]]]:
        """Raises Rejected (``CLUSTER004``) where there are workers, but none that could answer us."""
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
                "and get no work",
                file=sys.stderr,
            )
        return {name: tools_of(offered) for name, offered in fit.items()}

    @property
    def slots(self) -> int:
        """How many works it does at once."""
        return sum(offered[own_code()] for offered in self._workers().values() if own_code() in offered)

    def submit(self, asked: Asked) -> None:
        wanted = needs(asked.request)
        with self._lock:
            if asked.key in self._under_way:
                return
            self._wanted.add(frozenset(wanted))
            try:
                future = self._client.submit(
                    perform,
                    asked.data,
                    asked.key,
                    asked.request.seconds + WORKER_GRACE,
                    key=f"avow-{asked.key}",
                    pure=False,
                    resources=dict.fromkeys(wanted, 1),
                )
            except Exception as error:  # of a client that lost its cluster, whatever it is
                self._came.put(Came(asked.key, failure=f"{_GONE} ({type(error).__name__})"))
                return
            self._under_way[asked.key] = asked, future
        # Dask has one thread for what is to be done at the end of all works, and an answer may take a while to come
        future.add_done_callback(
            lambda done: threading.Thread(target=self._fetch, args=(asked, done), daemon=True).start()
        )

    def results(self) -> Iterator[Came]:
        while (came := self._came.get()) is not None:
            yield came

    def cancel(self, keys: Collection[str]) -> None:
        self._drop(keys)

    def close(self) -> None:
        self._closed.set()
        self.cancel(tuple(self._under_way))
        self._came.put(None)
        with contextlib.suppress(Exception):  # as above; also what its reader failed of
            self._client.close(timeout=5)

    # -- inside ------------------------------------------------------------------------------------------

    def _drop(self, keys: Collection[str]) -> list[str]:
        """Those of the keys that were under way still."""
        with self._lock:
            found = {key: self._under_way.pop(key)[1] for key in keys if key in self._under_way}
        with contextlib.suppress(Exception):  # who lost its cluster has nothing there to cancel
            self._client.cancel(list(found.values()), force=True)
        return list(found)

    def _fetch(self, asked: Asked, future: Any) -> None:
        came = _fetched(asked, future)
        with self._lock:
            known = self._under_way.get(asked.key)
            if known is None or known[1] is not future:  # cancelled, or given up
                return
            del self._under_way[asked.key]
            tries = self._tries[asked.key] = self._tries.get(asked.key, 0) + 1
        future.release()
        if came is None and tries <= CLUSTER_RETRIES:  # the scheduler was lost, and may come again
            self.submit(asked)
        else:
            self._came.put(came or Came(asked.key, failure=_GONE))

    def _workers(self, seconds: float = CLUSTER_CONNECT) -> dict[str, Mapping[str, int]]:
        """What each worker offers. Raises whatever a client raises that has no cluster any more."""
        if (reader := self._client._handle_report_task) is not None and reader.done():
            raise OSError("it hears nothing any more")  # Dask does not notice: a message could not be read
        found = self._client.sync(self._client.scheduler.identity, n_workers=-1, callback_timeout=seconds)
        return {str(name): info["resources"] for name, info in found["workers"].items() if info["status"] == "running"}

    def _watch(self) -> None:
        """What nobody can do any more is not waited for: Dask would, for ever."""
        alone: dict[frozenset[str], float] = {}
        while not self._closed.wait(CLUSTER_LOOK):
            try:
                workers, why = self._workers(CLUSTER_ANSWER), "no worker of the cluster is left that could do it"
            except Exception:  # of whatever kind: there is no answer
                workers, why = {}, _GONE
            now, was = time.monotonic(), bool(alone)
            with self._lock:
                asked_for, under_way = tuple(self._wanted), [asked for asked, _ in self._under_way.values()]
            lacking = [w for w in asked_for if not any(w <= offered.keys() for offered in workers.values())]
            alone = {wanted: alone.get(wanted, now) for wanted in lacking}
            waiting = [asked for asked in under_way if frozenset(needs(asked.request)) in alone]
            if waiting and not was and not self._closed.is_set():
                print(f"warning: {why}; waited for, {CLUSTER_PATIENCE:.0f} s", file=sys.stderr)
            late = [a for a in waiting if now - alone[frozenset(needs(a.request))] > CLUSTER_PATIENCE]
            for key in self._drop([asked.key for asked in late]):
                self._came.put(Came(key, failure=why))


_GONE = "the cluster's scheduler does not answer any more"


def _fetched(asked: Asked, future: Any) -> Came | None:
    """At once: an answer that was not fetched dies with its worker, and is waited for once more. None: whoever had the
    work lost us, or we them."""
    if future.status in ("cancelled", "lost"):
        return None
    if future.status == "error":
        return Came(asked.key, failure="worker after worker was lost over it, or could not begin it")
    try:
        said = future.result(timeout=asked.request.seconds + WORKER_GRACE)
    except Exception as error:  # what cannot be read is no answer, whatever it is
        lost = future.status in ("cancelled", "lost")
        return None if lost else Came(asked.key, failure=f"the answer cannot be read: {type(error).__name__}"[:200])
    if not isinstance(said, bytes) or said[:1] not in (b"+", b"-"):
        return Came(asked.key, failure="the answer is none")
    if said[:1] == b"+":
        return Came(asked.key, said[1:])
    try:
        why = from_text(Failed, said[1:])
    except Unreadable as error:
        return Came(asked.key, failure=f"the answer is none: {error}"[:300])
    return Came(asked.key, failure=why.failure[:500], timed_out=why.timed_out, log=why.log)


def not_installed() -> Rejected:
    """``CLUSTER003``."""
    message = "other machines are reached by Dask, which is not installed"
    return Rejected(Diagnostic("CLUSTER003", message, hint="pip install 'avow[cluster]'"))


# -- what comes from a cluster is data -----------------------------------------------------------------------------


def _unpickle_nothing() -> None:
    """Answers are bytes, but Dask also unpickles errors, warnings and parts of its own messages, which a worker can
    make, and a pickle can run anything. In this process Dask finds nothing for one to run: only the name of the type
    of bytes, which it writes so."""
    if not _guarded:
        sys.addaudithook(_refuse)  # it cannot be taken away again
        _guarded.append(True)


_guarded: list[bool] = []


def _refuse(event: str, arguments: tuple[object, ...]) -> None:
    if event == "pickle.find_class" and arguments != ("builtins", "bytes"):
        frame: FrameType | None = sys._getframe(1)
        while frame is not None:
            if str(frame.f_globals.get("__name__")).partition(".")[0] == "distributed":
                raise TypeError("what comes from a cluster is not unpickled")
            frame = frame.f_back


def _say_nothing() -> None:
    """What Dask logs here is of no use to who reads our terminal: what matters is said as an answer's failure."""
    for name in ("asyncio", "tornado", *logging.root.manager.loggerDict):
        if name.partition(".")[0] in ("asyncio", "tornado", "distributed"):
            logging.getLogger(name).disabled = True
