"""Tells what a subject asks by way of modules in C, which ask the system by themselves.

Loaded by `host` from beside it, as `senses` is.
"""

from __future__ import annotations

import _locale
import importlib.machinery
import sqlite3
import sys
import time
from collections.abc import Callable
from typing import Any

Told = Callable[[str, Any], None]
"""Takes an event and a path, or ``outside`` and what it is."""


def instead(call: Callable[..., Any], inner: Any) -> Callable[..., Any]:
    """That of `senses` is given in its place."""
    raise NotImplementedError


_OF_MODULES = {
    "_lsprof": ("the clock", ""),
    "_signal": ("the clock", "alarm getitimer setitimer"),
    "_socket": ("the network", "if_nameindex if_nametoindex if_indextoname socketpair"),
    "_ssl": ("random numbers", "RAND_bytes RAND_pseudo_bytes"),
    "_thread": ("the numbers of a process", "get_native_id"),
    "_uuid": ("random numbers", "generate_time_safe"),
}
"""Modules in C: what their functions ask for that no record can hold; of one without functions, what it is for."""
_OF_LOOPS = {
    "asyncio.base_events": "BaseEventLoop.call_at",
    "asyncio.events": "TimerHandle.when TimerHandle.__repr__ TimerHandle.__hash__",
    "asyncio.timeouts": "timeout_at Timeout.when Timeout.reschedule Timeout.__repr__",
}
"""Of modules of the library, what tells by a loop's clock when something is due, or takes such a time."""
_SOCKETS = ("getsockopt", "setsockopt", "recvmsg", "recvmsg_into")
"""What asks a socket, even one of a pair, for the user, the numbers of a process or the clock; no audit event tells."""


def watch_modules(told: Told, asked: Callable[..., bool]) -> None:
    """Tells when the subject calls a function of a module in C, whenever that is loaded; and what the C library reads
    by itself, which a trace of system calls tells where there is one."""

    def outer(inner: Callable[..., Any], event: str, what: str) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if asked(importing=False):
                told(event, what)
            return inner(*arguments, **named)

        return instead(call, inner)

    def loaded(module: Any) -> None:
        what, names = _OF_MODULES.get(module.__name__, ("", ""))
        if what and not names:
            told("outside", what)
        for name in names.split():
            if hasattr(module, name):
                setattr(module, name, outer(getattr(module, name), "outside", what))
        for names in _OF_LOOPS.get(module.__name__, "").split():
            of, _, name = names.rpartition(".")
            owner = getattr(module, of) if of else module
            setattr(owner, name, outer(getattr(owner, name), "outside", "the clock"))
        if module.__name__ == "_signal":
            module.signal = _frameless(module.signal)
        elif module.__name__ == "_socket":
            module.socket = module.SocketType = told_of(module.socket)

    def told_of(kind: Any) -> Any:
        class Watched(kind):  # type: ignore[misc]
            __slots__ = ()

        for name in _SOCKETS:
            setattr(Watched, name, outer(getattr(kind, name), "outside", "the network"))
        Watched.__name__, Watched.__qualname__, Watched.__module__ = "socket", "socket", "_socket"
        return Watched

    for name in (_OF_MODULES | _OF_LOOPS).keys() & sys.modules.keys():
        loaded(sys.modules[name])
    if "threading" in sys.modules:
        setattr(sys.modules["threading"], "get_native_id", sys.modules["_thread"].get_native_id)  # noqa: B010
    machinery = importlib.machinery
    loaders: tuple[Any, ...] = (machinery.BuiltinImporter, machinery.ExtensionFileLoader, machinery.SourceFileLoader)
    for loader in loaders:
        inner = loader.exec_module

        def executed(*arguments: Any, inner: Callable[..., Any] = inner) -> None:
            inner(*arguments)
            loaded(arguments[-1])

        loader.exec_module = executed if loader is not loaders[0] else staticmethod(executed)
    time.tzset = outer(time.tzset, "program", "the C library")
    _locale.setlocale = outer(_locale.setlocale, "program", "the C library")
    if "locale" in sys.modules:
        setattr(sys.modules["locale"], "_setlocale", _locale.setlocale)  # noqa: B010


def _frameless(install: Callable[..., Any]) -> Callable[..., Any]:
    """As `_signal.signal`, of handlers that get no frame: it leads to what runs the subject."""

    def call(number: int, handler: Any) -> Any:
        return install(number, (lambda signal, frame: handler(signal, None)) if callable(handler) else handler)

    return instead(call, install)


def watch_sqlite(told: Told) -> None:
    """Tells when the subject has SQLite tell the time or draw a number, or open another file."""
    connect, kind = sqlite3.connect, sqlite3.Connection

    def allowed(action: int, first: Any, name: Any, *more: Any) -> int:
        if action == sqlite3.SQLITE_FUNCTION and str(name).lower() in _SQLITE:
            told("outside", "the clock" if "random" not in str(name) else "random numbers")
        elif action == sqlite3.SQLITE_ATTACH and first not in ("", ":memory:"):
            told("program", "SQLite")
        return sqlite3.SQLITE_OK

    def connected(*arguments: Any, **named: Any) -> Any:
        connection = connect(*arguments, **named)
        connection.set_authorizer(allowed)
        return connection

    class Watched(kind):  # type: ignore[misc, valid-type]
        def __init__(self, *arguments: Any, **named: Any) -> None:
            super().__init__(*arguments, **named)
            self.set_authorizer(allowed)

    sqlite3.connect = sqlite3.dbapi2.connect = instead(connected, connect)
    sqlite3.Connection = sqlite3.dbapi2.Connection = Watched  # type: ignore[misc]


_SQLITE = frozenset(
    {"date", "time", "datetime", "julianday", "unixepoch", "strftime", "timediff", "current_date", "current_time"}
    | {"current_timestamp", "random", "randomblob"}
)
