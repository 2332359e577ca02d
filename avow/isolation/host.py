"""Runs the subject, and nothing else, in a process of its own: what it prints, patches or breaks stays here.

A script without imports from Avow. Each line of JSON that comes in holds the inputs of some
cases; a line with an answer for each goes out.
Values of the contract are given to the subject as plain Python: an element of an enumeration is a string, a REAL is a
`Fraction`, ``move(1, 2)`` is ``("move", 1, 2)``, a sequence is a tuple, a function or relation is a `Table`.
"""

from __future__ import annotations

import _posixsubprocess
import datetime
import enum
import functools
import importlib.machinery
import importlib.util
import inspect
import json
import os
import posix
import random
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any


class Table:
    """A function given by finitely many points and a default; call it, or look at its points.

    ``wayP(x, y, 3)``; ``wayP.points()`` are the points at which a relation holds, or at which another function differs
    from its default (without their values; those come from calling it); ``before.updated(4, True)`` is a changed copy.
    """

    def __init__(self, table: Mapping[Any, Any], default: Any) -> None:
        self._table = {k if isinstance(k, tuple) else (k,): v for k, v in table.items()}
        self.default = default

    def __call__(self, *arguments: Any) -> Any:
        return self._table.get(arguments, self.default)

    def points(self) -> list[Any]:
        """Points whose value is not the default; bare values where the function has one parameter."""
        different = (k for k, v in self._table.items() if v != self.default)
        return [k[0] if len(k) == 1 else k for k in different]

    def items(self) -> list[tuple[Any, Any]]:
        """(point, value) pairs for `points()`."""
        return [(k, self(*k) if isinstance(k, tuple) else self(k)) for k in self.points()]

    def updated(self, *point_and_value: Any) -> Table:
        """A copy with another value at one point: ``t.updated(x, y, value)``."""
        *point, value = point_and_value
        return Table({**self._table, tuple(point): value}, self.default)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.points())

    def __contains__(self, point: object) -> bool:
        return point in self.points()

    def __len__(self) -> int:
        return len(self.points())

    def __repr__(self) -> str:
        return f"Table({dict(self.items())!r}, default={self.default!r})"


def plain(data: Any) -> Any:
    """A value as the judge sends it, as the subject gets it."""
    match data:
        case {"q": [numerator, denominator]}:
            return Fraction(numerator, denominator)
        case {"r": text}:
            return float.fromhex(text)
        case {"t": items}:
            return tuple(plain(item) for item in items)
        case {"f": rows, "d": default}:
            return Table({tuple(plain(a) for a in point): plain(value) for point, value in rows}, plain(default))
        case _:  # a value that is its own JSON
            return data


def coded(value: Any, depth: int = 0) -> Any:
    """Whatever the subject returned, as JSON; what no contract has is named by its type."""
    if depth > 20:
        return {"?": "something nested too deeply"}
    inner = depth + 1
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, enum.Enum):
        return str(value.name)
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, int):
        return {"q": [str(int(value)), "1"], "w": True}
    if isinstance(value, Fraction | Decimal | float):
        try:
            numerator, denominator = value.as_integer_ratio()
        except (ValueError, OverflowError):
            return {"?": f"the number {value}"}
        return {"q": [str(numerator), str(denominator)]}
    if isinstance(value, Table):
        rows = [[[coded(a, inner) for a in k], coded(v, inner)] for k, v in value._table.items()]
        return {"f": rows, "d": coded(value.default, inner)}
    if isinstance(value, Mapping):
        rows = [[coded(k, inner) if k is not ... else {"...": True}, coded(v, inner)] for k, v in value.items()]
        return {"m": rows}
    if isinstance(value, set | frozenset):
        return {"s": [coded(item, inner) for item in value]}
    if isinstance(value, tuple | list):
        return {"t": [coded(item, inner) for item in value]}
    return {"?": f"a value of type {type(value).__name__}"}


def load(path: str, function: str) -> Any:
    spec = importlib.util.spec_from_loader("avow_subject", _FromSource("avow_subject", path))
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    spec.origin, spec.has_location = path, True
    module = importlib.util.module_from_spec(spec)
    sys.modules["avow_subject"] = module
    sys.path.insert(0, os.path.dirname(path))  # noqa: PTH120 - its own neighbours, as if it were run
    spec.loader.exec_module(module)
    return getattr(module, function)


class _FromSource(importlib.machinery.SourceFileLoader):
    """Never believes a compiled file: it may be of another source than the one that is recorded."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        return self.source_to_code(self.get_data(path), path)


def read_sources_only(root: str) -> None:
    """Modules from within `root` are compiled anew."""
    suffixes = (_FromSource, importlib.machinery.SOURCE_SUFFIXES)
    extensions = (importlib.machinery.ExtensionFileLoader, importlib.machinery.EXTENSION_SUFFIXES)
    finder = importlib.machinery.FileFinder.path_hook(extensions, suffixes)

    def hook(path: str) -> Any:
        inside = os.path.realpath(path)
        if inside != root and not inside.startswith(root + os.sep):
            raise ImportError(path)
        return finder(path)

    sys.path_hooks.insert(0, hook)
    sys.path_importer_cache.clear()


# -- what the subject does besides answering ----------------------------------------------------------------------

_READS = frozenset({"os.chdir"})
_LISTS = frozenset({"os.listdir", "os.scandir"})
_CHANGES = frozenset(
    {"os.remove", "os.rename", "os.rmdir", "os.mkdir", "os.link", "os.symlink", "os.truncate", "os.chmod", "os.chown"}
    | {"os.utime", "os.setxattr", "os.removexattr", "os.mkfifo", "os.mknod"}
)
_PROCESSES = frozenset({"os.fork", "os.forkpty", "os.kill", "os.killpg", "os.exec", "signal.pthread_kill", "pty.spawn"})
_PROGRAMS = frozenset({"subprocess.Popen", "os.posix_spawn", "os.spawn", "os.system"})
_NETWORK = ("socket.", "urllib.", "http.", "ftplib.", "smtplib.", "telnetlib.", "imaplib.", "poplib.", "nntplib.")
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def watch(scratch: str, end: Callable[[str], None]) -> tuple[list[list[str]], Callable[[], None]]:
    """What it looks at, as [event, path], growing as it runs, and what is to be called at the end. What no subject may
    do ends the process by `end`, before it is done: nothing can catch that, or have it forgotten. A hook cannot be
    taken away."""
    seen: list[list[str]] = []
    known: set[tuple[str, str]] = set()
    fspath, isabs, join, getcwd, norm = os.fspath, os.path.isabs, os.path.join, os.getcwd, os.path.normpath

    def path_of(place: Any) -> str | None:
        if place is None or isinstance(place, int):  # an open descriptor: told when it was opened
            return None
        place = fspath(place)
        if isinstance(place, bytes):
            place = bytes.decode(place, sys.getfilesystemencoding(), "surrogateescape")
        text = str.__str__(place)  # of no class of the subject's own
        path = norm(text if isabs(text) else join(getcwd(), text))
        return None if path == scratch or path.startswith(scratch + os.sep) else path

    def told(event: str, place: Any) -> None:
        path = place if event in ("outside", "program") else path_of(place)
        if path is not None and (event, path) not in known:
            known.add((event, path))
            seen.append([event, path])

    def fault(what: str) -> None:
        end(what)
        raise PermissionError(f"a subject {what}")

    def changes(place: Any, what: str) -> None:
        path = path_of(place)
        if path is not None and path != "/dev/null":
            fault(f"{what} {path}")

    def opens(place: Any, mode: Any, flags: Any) -> None:
        path = path_of(place)
        if path is None:
            return
        if (isinstance(mode, str) and set(mode) & set("wax+")) or (isinstance(flags, int) and flags & _WRITES):
            changes(path, "writes")
        elif path.startswith("/proc/") and path.split("/")[2] not in _HARMLESS:
            fault(f"looks at another process ({path})")
        else:
            told("read", path)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            opens(*arguments)
        elif event in _LISTS:
            told("list", arguments[0] if arguments[0] is not None else ".")
        elif event == "import":
            told("read", arguments[1])
        elif event == "ctypes.dlopen" and arguments[0] is not None:  # of None: `import ctypes` itself
            told("outside", f"the library {arguments[0]}")
        elif event.startswith("ctypes.dlsym"):
            told("outside", "a library's functions")
        elif event == "sqlite3.connect":
            name = str(arguments[0])
            if name.startswith("file:") and "mode=ro" in name:
                told("read", name.removeprefix("file:").partition("?")[0])
            elif name not in ("", ":memory:"):
                changes(arguments[0], "writes")
        elif event in _READS:
            told("read", arguments[0])
        elif event in _CHANGES:
            changes(arguments[0], event)
        elif event in _PROCESSES:
            fault(f"calls {event}")
        elif event in _PROGRAMS:
            told("program", f"the program {str(arguments[0])[:200]}")
        elif event.startswith(_NETWORK):
            told("outside", "the network")

    sys.addaudithook(hook)
    _look_out(told)
    return seen, watch_chance(told)


_HARMLESS = ("self", "thread-self", "cpuinfo", "meminfo", "stat", "version", "filesystems", "mounts", "sys")


def _look_out(told: Callable[[str, Any], None]) -> None:
    """No audit event tells of a file that is looked at without being opened, nor of a program started by hand."""

    def outer(inner: Callable[..., Any], event: str, what: str | None = None) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            told(event, what or (arguments or (None,))[0])
            return inner(*arguments, **named)

        return functools.wraps(inner)(call)

    for name in ("stat", "lstat", "access", "readlink"):
        setattr(os, name, outer(getattr(os, name), "state"))
    _posixsubprocess.fork_exec = outer(_posixsubprocess.fork_exec, "program", "a program")


# -- clock and chance ----------------------------------------------------------------------------------------------

_CLOCKS = ("time", "monotonic", "perf_counter", "process_time", "thread_time")
_NOW = {"localtime": 0, "gmtime": 0, "ctime": 0, "asctime": 0, "strftime": 1}
"""Functions of `time` that take now where they are given no more than so many arguments."""

_STDLIB = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120
_OWN_USE: tuple[str, ...] = (
    "tempfile.py",
    "logging/",
    "threading.py",
    "queue.py",
    "asyncio/",
    "selectors.py",
    "subprocess.py",
)
_OWN_USE += ("socket.py", "concurrent/", "multiprocessing/", "warnings.py", "unittest/", "importlib/")
"""Parts of the library that look at the clock, or draw names, for their own business."""


def _asked() -> bool:
    """Whether it is the subject that asks for a clock or a random number: no module that is just imported, and not the
    library for its own business."""
    frame: Any = sys._getframe(2)
    while frame is not None:
        file = frame.f_code.co_filename
        inner = file.removeprefix(_STDLIB)
        if file.startswith("<frozen importlib") or (inner != file and inner.startswith(_OWN_USE)):
            return False
        if file != __file__ and (inner == file or "-packages" in inner):
            return True
        frame = frame.f_back
    return False


def watch_chance(told: Callable[[str, Any], None]) -> Callable[[], None]:
    """Tells when the subject reads a clock or draws what nobody seeded, as far as Python does it; returns what is to be
    asked once more at the end."""

    def outer(inner: Callable[..., Any], what: str, most: int | None = None) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if (most is None or len([a for a in arguments if a is not None]) <= most) and _asked():
                told("outside", what)
            return inner(*arguments, **named)

        return functools.wraps(inner)(call)

    clock, chance = "the clock", "random numbers"
    for name in _CLOCKS:
        setattr(time, name, outer(getattr(time, name), clock))
        setattr(time, f"{name}_ns", outer(getattr(time, f"{name}_ns"), clock))
    for name, most in _NOW.items():
        setattr(time, name, outer(getattr(time, name), clock, most))
    for name in ("clock_gettime", "clock_gettime_ns"):
        setattr(time, name, outer(getattr(time, name), clock))
    _watch_dates(lambda: told("outside", clock))
    for module, names in ((os, ("urandom", "getrandom")), (posix, ("urandom", "getrandom")), (random, ("_urandom",))):
        for name in names:
            setattr(module, name, outer(getattr(module, name), chance))
    for name in ("times", "getloadavg"):
        setattr(os, name, outer(getattr(os, name), clock))
    seed, set_state = random.Random.seed, random.Random.setstate
    shared = random._inst
    started: list[Any] = [random.Random.getstate(shared)]

    def drawn() -> None:
        if started and random.Random.getstate(shared) != started[0]:
            told("outside", chance)

    def seeded(own: random.Random, a: Any = None, version: int = 2) -> None:
        if a is None and _asked():
            told("outside", chance)
        if own is shared and a is not None:
            drawn()
            started.clear()
        seed(own, a, version)

    def restored(own: random.Random, state: Any) -> None:
        if own is shared:
            drawn()
            started.clear()
        set_state(own, state)

    for name, function in (("seed", seeded), ("setstate", restored)):
        setattr(random.Random, name, function)
        setattr(random, name, getattr(shared, name))
    return drawn


def _watch_dates(told: Callable[[], None]) -> None:
    """`datetime.now` asks the system by itself; a class in its place tells, and stands for it wherever one looks."""
    real: Any = datetime.datetime

    class Meta(type):
        def __instancecheck__(cls, instance: Any) -> bool:
            return isinstance(instance, real)

        def __subclasscheck__(cls, subclass: type) -> bool:
            return issubclass(subclass, real)

    class Watched(real, metaclass=Meta):  # type: ignore[misc]
        __slots__ = ()

        @classmethod
        def now(cls, tz: Any = None) -> Any:
            if _asked():
                told()
            return super().now(tz)

        @classmethod
        def utcnow(cls) -> Any:
            if _asked():
                told()
            return super().utcnow()

    Watched.__name__, Watched.__qualname__, Watched.__module__ = "datetime", "datetime", "datetime"
    datetime.datetime = Watched  # type: ignore[misc]


def accepted(function: Any) -> frozenset[str] | None:
    """The keyword arguments that it takes; None: all."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return None
    return frozenset(p.name for p in parameters)


def answer(function: Any, known: frozenset[str] | None, request: Mapping[str, Any]) -> dict[str, Any]:
    try:
        inputs = {name: plain(value) for name, value in request.items() if known is None or name in known}
        return {"value": coded(function(**inputs))}
    except BaseException as error:
        return {"error": _told(error)}


def _told(error: BaseException) -> str:
    """The error and where in the subject it came from."""
    try:
        place = next((f for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename != __file__), None)
        where = f" ({os.path.basename(place.filename)}, line {place.lineno})" if place else ""  # noqa: PTH119
        return f"{type(error).__name__}: {error}"[:500] + where
    except BaseException:
        return type(error).__name__


def main() -> None:
    path, function, root, level = sys.argv[1:5]
    source, sink, mark = int(sys.argv[5]), int(sys.argv[6]), sys.argv[7]
    look = posix.access  # without an audit event: for whoever traces system calls
    with os.fdopen(source, "r", encoding="utf-8") as requests, os.fdopen(sink, "w", encoding="utf-8") as answers:
        read_sources_only(os.path.realpath(root))
        dumps, write, leave = json.dumps, os.write, os._exit

        def end(fault: str) -> None:
            write(sink, (dumps({"faults": [fault]}) + "\n").encode())
            leave(1)

        seen, drawn = watch(tempfile.gettempdir(), end)

        def say(message: dict[str, Any]) -> None:
            told, seen[:] = seen[:], []
            answers.write(dumps({**message, "seen": told}) + "\n")
            answers.flush()

        look(f"{mark}-begin", os.F_OK)
        try:
            subject = load(path, function)
            known = accepted(subject)
            ready: dict[str, Any] = {"ready": True}
        except BaseException as error:
            ready = {"error": _told(error)}
        say(ready)
        if "error" in ready:
            return
        for line in requests:
            say({"replies": [answer(subject, known, request) for request in json.loads(line)]})
        drawn()
        told = seen[:]
        look(f"{mark}-end", os.F_OK)
        processes = [int(name) for name in os.listdir("/proc") if name.isdigit()] if level == "sealed" else []  # noqa: PTH208
        seen[:] = told  # that was us
        if set(processes) - {1, os.getpid()}:
            end("left processes behind")
        say({"end": True})


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    main()
    os._exit(0)
