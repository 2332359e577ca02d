"""Runs the subject, and nothing else, in a process of its own: what it prints, patches or breaks stays here.

A script without imports from Avow, so without its codec: each module here is one that the subject can change, and
is read at every start. Each line of JSON that comes in holds the inputs of some cases; a line with an answer for each
goes out (`subject.Message`, read there, strictly).
Values of the contract are given to the subject as plain Python: an element of an enumeration is a string, a REAL is a
`Fraction`, ``move(1, 2)`` is ``("move", 1, 2)``, a sequence is a tuple, a function or relation is a `Table`.
"""

from __future__ import annotations

import contextlib
import enum
import importlib.machinery
import importlib.util
import inspect
import json
import os
import posix
import sys
import tempfile
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


def load(path: str, function: str, drive: Any = None) -> Any:
    """The function of the file; with `drive`, which `driving` gives, the class that the JSON in `function` names."""
    spec = importlib.util.spec_from_loader("avow_subject", _FromSource("avow_subject", path))
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    spec.origin, spec.has_location = path, True
    module = importlib.util.module_from_spec(spec)
    sys.modules["avow_subject"] = module
    sys.path.insert(0, os.path.dirname(path))  # noqa: PTH120 - its own neighbours, as if it were run
    spec.loader.exec_module(module)
    if drive is not None:
        driven = json.loads(function)
        return drive(getattr(module, driven["class"]), driven)
    return getattr(module, function)


def driving(function: str) -> Any:
    """What drives the class that the JSON in `function` names; nothing of a function. What stands in for ROS is there
    before the file is loaded."""
    if not function.startswith("{"):
        return None
    steps = _beside("../drive/steps.py")
    ros = json.loads(function).get("ros")
    if ros is None:
        return steps.driver
    return _beside(f"../drive/{ros['kind']}.py").modules(_beside("../drive/callbacks.py"), ros, steps)


class _FromSource(importlib.machinery.SourceFileLoader):
    """Never believes a compiled file: it may be of another source than the one that is recorded."""

    eyes: Any = None
    """What compiles in its place, where the subject is only looked at (`sights`)."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
        if self.eyes is not None:
            return self.eyes.compiled(self.get_data(path), path)
        return self.source_to_code(self.get_data(path), path)


def _read_sources_only(root: str) -> None:
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
_CHANGES = {
    **dict.fromkeys(("os.remove", "os.rmdir"), ((0, 1),)),
    **dict.fromkeys(("os.mkdir", "os.chmod"), ((0, 2),)),
    **dict.fromkeys(("os.chown", "os.utime"), ((0, 3),)),
    **dict.fromkeys(("os.rename", "os.link"), ((0, 2), (1, 3))),  # what is linked to can be written by its new name
    **dict.fromkeys(("os.truncate", "os.setxattr", "os.removexattr"), ((0, -1),)),
    "os.symlink": ((1, 2),),
}
"""Event → where among its arguments the paths are that it changes, each with its folder's descriptor, if any."""

_PROCESSES = frozenset({"os.fork", "os.forkpty", "os.kill", "os.killpg", "os.exec", "signal.pthread_kill", "pty.spawn"})
_PROGRAMS = frozenset({"subprocess.Popen", "os.posix_spawn", "os.spawn", "os.system"})
_NETWORK = ("socket.", "urllib.", "http.", "ftplib.", "smtplib.", "telnetlib.", "imaplib.", "poplib.", "nntplib.")
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def _beside(file: str) -> Any:
    """A module near this one, which is no package's here."""
    place = os.path.join(os.path.dirname(__file__), file)  # noqa: PTH118, PTH120
    name = "avow_" + os.path.basename(file).partition(".")[0]  # noqa: PTH119
    loader = importlib.machinery.SourceFileLoader(name, place)
    spec = importlib.util.spec_from_loader(name, loader)
    module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
    loader.exec_module(module)
    return module


def watch(scratch: str, end: Callable[[str], None]) -> tuple[list[list[str]], Callable[[], None]]:
    """What it looks at, as [event, path], growing as it runs, and what is to be called at the end. What no subject may
    do ends the process by `end`, before it is done: nothing can catch that, or have it forgotten. A hook cannot be
    taken away."""
    seen: list[list[str]] = []
    known: set[tuple[str, str]] = set()
    fspath, isabs, join, getcwd, norm = os.fspath, os.path.isabs, os.path.join, os.getcwd, os.path.normpath
    readlink, dirname = os.readlink, os.path.dirname

    def written(place: Any) -> str:
        place = fspath(place)
        if isinstance(place, bytes):
            place = bytes.decode(place, sys.getfilesystemencoding(), "surrogateescape")
        return str.__str__(place)  # of no class of the subject's own

    def path_of(place: Any) -> str | None:
        if place is None or isinstance(place, int):  # an open descriptor: told when it was opened
            return None
        text = written(place)
        path = norm(text if isabs(text) else join(getcwd(), text))
        return None if path == scratch or path.startswith(scratch + os.sep) else path

    def opened(descriptor: int) -> str:
        try:
            return readlink(f"/proc/self/fd/{descriptor}")
        except OSError:
            return f"/a file of descriptor {descriptor}"

    def at(place: Any, folder: Any) -> str:
        """The path of what a call names, also by descriptors."""
        if isinstance(place, int):
            return opened(place)
        return join(opened(folder), written(place)) if isinstance(folder, int) and folder >= 0 else written(place)

    def told(event: str, place: Any) -> None:
        path = place if event in ("outside", "program", "variable") else path_of(place)
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
            told("list", at(arguments[0] if arguments[0] is not None else ".", None))
        elif event == "import":
            told("read", arguments[1])
            if arguments[0] in _READING or _is_extension(arguments[1]):
                told("program", f"the module {arguments[0]}")
        elif event == "cpython.PyInterpreterState_New":
            told("outside", "another interpreter")  # which no hook looks into
        elif event == "sqlite3.load_extension":
            told("outside", "an extension of SQLite")
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
            for place, folder in _CHANGES[event]:
                changes(at(arguments[place], arguments[folder] if folder > 0 else None), event)
            if event == "os.symlink":  # by which what it leads to could be written or read unseen
                changes(join(dirname(at(arguments[1], arguments[2])), written(arguments[0])), event)
        elif event in _PROCESSES:
            fault(f"calls {event}")
        elif event in _PROGRAMS:
            told("program", f"the program {str(arguments[0])[:200]}")
        elif event.startswith(_NETWORK):
            told("outside", "the network")

        elif event in _AROUND and not looking and (event != "object.__getattr__" or arguments[1] in _LEADING):
            looking.append(event)
            if senses.looks_around(event):
                told("outside", "what runs it")
            looking.clear()

    looking: list[str] = []  # what it looks at itself to answer that is nothing that the subject asks for
    senses = _beside("senses.py")
    machine_code = _beside("machine_code.py")
    drawn = senses.watch_all(told)
    machine_code.watch_modules(told, senses.asked)
    machine_code.watch_sqlite(told)
    sys.addaudithook(hook)
    return seen, drawn


_AROUND = frozenset(
    {"sys._getframe", "sys._current_frames", "gc.get_objects", "gc.get_referrers", "gc.get_referents"}
    | {"object.__getattr__"}
)
"""Events by which a subject may find out that it is run by a judge and not by what it is made for."""
_LEADING = ("tb_frame", "__code__")

_READING = frozenset(
    {"_ssl", "_dbm", "_gdbm", "_curses", "_posixshmem", "_tkinter", "nis", "ossaudiodev", "readline", "spwd", "syslog"}
)
"""Modules of Python's own in C that open files by themselves: a trace of system calls tells which."""
_STDLIB = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120


def _is_extension(file: Any) -> bool:
    """Whether a module is of machine code, and not Python's own."""
    return (
        isinstance(file, str)
        and file.endswith(tuple(importlib.machinery.EXTENSION_SUFFIXES))
        and (not file.startswith(_STDLIB) or "-packages" in file)
    )


_HARMLESS = ("self", "thread-self", "cpuinfo", "meminfo", "stat", "version", "filesystems", "mounts", "sys")


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


def _print_all() -> None:
    """What machine code printed and the C library still holds, as at the end of any process."""
    modules = list(sys.modules.items())
    if any(name == "_ctypes" or _is_extension(getattr(module, "__file__", None)) for name, module in modules):
        import _ctypes

        library: Any = _ctypes
        library.call_function(library.dlsym(library.dlopen(None, 0), "fflush"), (None,))


def main() -> None:
    path, function, root, level = sys.argv[1:5]
    source, sink, mark = int(sys.argv[5]), int(sys.argv[6]), sys.argv[7]
    eyes = _FromSource.eyes = _beside("sights.py").Eyes(json.loads(sys.argv[8])) if sys.argv[8:] else None
    sys.argv[:], sys.orig_argv[:] = [path], [sys.executable, path]  # the same at every run
    look = posix.access  # without an audit event: for whoever traces system calls
    with os.fdopen(source, "r", encoding="utf-8") as requests, os.fdopen(sink, "w", encoding="utf-8") as answers:
        drive = driving(function)
        _read_sources_only(os.path.realpath(root))
        dumps, write, leave = json.dumps, os.write, os._exit
        streams = [sys.stdout.flush, sys.stderr.flush]

        def end(fault: str) -> None:
            write(sink, (dumps({"faults": [fault]}) + "\n").encode())
            leave(1)

        seen, drawn = watch(tempfile.gettempdir(), end)

        def say(message: dict[str, Any]) -> None:
            for flush in streams:  # what it printed comes before its answer
                with contextlib.suppress(Exception):
                    flush()
            told, seen[:] = seen[:], []
            answers.write(dumps({**message, "seen": told}) + "\n")
            answers.flush()

        look(f"{mark}-begin", os.F_OK)
        try:
            subject = load(path, function, drive)
            known = accepted(subject)
            ready: dict[str, Any] = {"ready": True}
        except BaseException as error:
            ready = {"error": _told(error)}
        say(ready)
        if "error" in ready:
            return
        if eyes is not None:
            held = eyes.loaded(sys.modules.copy().values)
            for line in requests:
                said = [answer(subject, known, r) | {"sights": eyes.told()} for r in json.loads(line)]
                said[0]["sights"] += held
                held = []
                say({"replies": said})
        for line in requests:
            say({"replies": [answer(subject, known, request) for request in json.loads(line)]})
        drawn()
        told = seen[:]
        look(f"{mark}-end", os.F_OK)
        with contextlib.suppress(Exception):
            _print_all()
        processes = [int(name) for name in os.listdir("/proc") if name.isdigit()] if level == "sealed" else []  # noqa: PTH208
        seen[:] = told  # that was us
        if set(processes) - {1, os.getpid()}:
            end("left processes behind")
        say({"end": True})


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    main()
    os._exit(0)
