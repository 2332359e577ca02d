"""Runs the subject, and nothing else, in a process of its own: what it prints, patches or breaks stays here.

A script without imports from Avow, so without its codec: each module here is one that the subject can change, and is
read at every start. What asks and answers runs in a copy of this file that no name leads to (`_apart`), with functions
and types that are not looked up where the subject could put others. Each line of JSON that comes in holds the inputs of
some cases; a line with an answer for each goes out (`subject.Message`, read there, strictly).
Values of the contract are given to the subject as plain Python: an element of an enumeration is a string, a REAL is a
`Fraction`, ``move(1, 2)`` is ``("move", 1, 2)``, a sequence is a tuple, a function or relation is a `Table`.
"""

from __future__ import annotations

import _thread
import builtins
import contextlib
import enum
import importlib.machinery
import importlib.util
import inspect
import itertools
import json
import os
import posix
import sys
import tempfile
import threading
import time
import traceback
import types
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
            number = object.__new__(Fraction)  # in lowest terms; its own constructor is one that the subject can change
            _NUMERATOR.__set__(number, numerator)
            _DENOMINATOR.__set__(number, denominator)
            return number
        case {"r": text}:
            return float.fromhex(text)
        case {"t": items}:
            return tuple(plain(item) for item in items)
        case {"f": rows, "d": default}:
            return Table({tuple(plain(a) for a in point): plain(value) for point, value in rows}, plain(default))
        case _:  # a value that is its own JSON
            return data


def coded(value: Any, depth: int = 0) -> Any:
    """Whatever the subject returned, as JSON; what no contract has is named by its type. Of a number, a text or a
    container of a class of the subject's own counts what it is, not what that class says of it."""
    if depth > 20:
        return {"?": "something nested too deeply"}
    inner = depth + 1
    if value is None or value is True or value is False:
        return value
    kinds = _MRO(type(value))
    if enum.Enum in kinds:
        return str.__str__(object.__getattribute__(value, "_name_"))
    if str in kinds:
        return str.__str__(value)
    if int in kinds:
        return {"q": [int.__repr__(int.__index__(value)), "1"], "w": True}
    if Fraction in kinds:
        return _ratio(_NUMERATOR.__get__(value), _DENOMINATOR.__get__(value))
    if float in kinds or Decimal in kinds:
        try:
            return _ratio(*(float.as_integer_ratio(value) if float in kinds else _DECIMAL(value)))
        except (ValueError, OverflowError):
            return {"?": f"the number {float.__repr__(value) if float in kinds else value}"}
    if Table in kinds:
        rows = [[[coded(a, inner) for a in k], coded(v, inner)] for k, v in value._table.items()]
        return {"f": rows, "d": coded(value.default, inner)}
    if dict in kinds or isinstance(value, Mapping):
        items = dict.items(value) if dict in kinds else value.items()
        return {"m": [[coded(k, inner) if k is not ... else {"...": True}, coded(v, inner)] for k, v in items]}
    for kind, mark in _MANY.items():
        if kind in kinds:
            return {mark: [coded(item, inner) for item in kind.__iter__(value)]}
    return {"?": f"a value of type {type(value).__name__}"}


def _ratio(numerator: int, denominator: int) -> dict[str, Any]:
    return {"q": [int.__repr__(numerator), int.__repr__(denominator)]}


_MRO: Any = type.__dict__["__mro__"].__get__
_NUMERATOR: Any = Fraction.__dict__["_numerator"]
_DENOMINATOR: Any = Fraction.__dict__["_denominator"]
_DECIMAL = Decimal.as_integer_ratio
_MANY: dict[Any, str] = {set: "s", frozenset: "s", tuple: "t", list: "t"}
_READS_JSON = json.JSONDecoder().scan_once  # type: ignore[attr-defined]
_WRITES_JSON: Any = json.encoder.c_make_encoder(  # type: ignore[attr-defined]
    None, None, json.encoder.encode_basestring_ascii, None, ": ", ", ", False, False, True
)


def loads(text: str) -> Any:
    """As `json.loads`, by nothing that the subject can change."""
    return _READS_JSON(text, 0)[0]


def dumps(data: Any) -> str:
    """As `json.dumps`."""
    return "".join(_WRITES_JSON(data, 0))


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
        driven = loads(function)
        return drive(getattr(module, driven["class"]), driven)
    return getattr(module, function)


def driving(function: str) -> Any:
    """What drives the class that the JSON in `function` names; nothing of a function. What stands in for ROS is there
    before the file is loaded."""
    if not function.startswith("{"):
        return None
    steps = _beside("../drive/steps.py", apart=True)
    steps.json = types.SimpleNamespace(loads=loads, dumps=dumps)
    ros = loads(function).get("ros")
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


def _found_before() -> list[tuple[str, str]]:
    """What is imported already, and the folders in which it was looked for before Python's own."""
    files = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
    ours = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep  # noqa: PTH100, PTH120
    first = itertools.takewhile(lambda folder: folder != os.path.dirname(os.__file__), sys.path)  # noqa: PTH120
    read = [("read", file) for file in files if isinstance(file, str) and not file.startswith(ours)]
    return [*read, *(("list", folder) for folder in first)]


def _beside(file: str, *, apart: bool = False) -> Any:
    """A module near this one, which is no package's here; `apart`, with builtin functions of its own."""
    place = os.path.join(os.path.dirname(__file__), file)  # noqa: PTH118, PTH120
    name = "avow_" + os.path.basename(file).partition(".")[0]  # noqa: PTH119
    loader = importlib.machinery.SourceFileLoader(name, place)
    spec = importlib.util.spec_from_loader(name, loader)
    module = importlib.util.module_from_spec(spec)  # type: ignore[arg-type]
    if apart:
        vars(module)["__builtins__"] = vars(builtins).copy()
    loader.exec_module(module)
    return module


def _apart() -> Any:
    """This file once more, as a module that nothing leads to which the subject can get hold of: whatever it puts in the
    place of what it finds here answers nothing. What it does get hold of is of here."""
    own = _beside("host.py", apart=True)
    own.Table, own._FromSource = Table, _FromSource
    return own


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


def _kept(*places: Mapping[str, Any]) -> Callable[[], bool]:
    """What tells whether each of these names still is of what it is now."""
    names = [(place, name, value) for place in places for name, value in place.items()]
    return lambda: all(place.get(name) is value for place, name, value in names)


def _threads() -> Callable[[], bool]:
    """What tells whether a thread is left that Python would wait for at its end; those that are just ending, and the
    idle ones of a pool, end within a second."""
    count, listed = _thread._count, threading.enumerate
    ending: Any = threading.Thread.__dict__["daemon"]
    clock, wait = time.monotonic, time.sleep

    def left() -> bool:
        return count() > len([thread for thread in listed() if ending.__get__(thread)])

    def found() -> bool:
        pool = sys.modules.get("concurrent.futures.thread")
        if pool is not None and left():
            threading.Thread(target=pool._python_exit, daemon=True).start()
        end = clock() + 1.0
        while left() and clock() < end:
            wait(0.01)
        return left()

    return found


def _print_all(is_extension: Callable[[Any], bool]) -> None:
    """What machine code printed and the C library still holds, as at the end of any process."""
    modules = list(sys.modules.items())
    if any(name == "_ctypes" or is_extension(getattr(module, "__file__", None)) for name, module in modules):
        import _ctypes

        library: Any = _ctypes
        library.call_function(library.dlsym(library.dlopen(None, 0), "fflush"), (None,))


def main() -> None:
    path, function, root, level = sys.argv[1:5]
    source, sink, mark = int(sys.argv[5]), int(sys.argv[6]), sys.argv[7]
    eyes = _FromSource.eyes = _beside("sights.py").Eyes(loads(sys.argv[8])) if sys.argv[8:] else None
    sys.argv[:], sys.orig_argv[:] = [path], [sys.executable, path]  # the same at every run
    look = posix.access  # without an audit event: for whoever traces system calls
    with os.fdopen(source, "r", encoding="utf-8") as requests, os.fdopen(sink, "w", encoding="utf-8") as answers:
        drive = driving(function)
        _read_sources_only(os.path.realpath(root))
        write, leave = os.write, os._exit
        streams = [sys.stdout.flush, sys.stderr.flush]

        def end(fault: str) -> None:
            write(sink, (dumps({"faults": [fault]}) + "\n").encode())
            leave(1)

        watching = _beside("watching.py")
        seen, drawn, names = watching.watch(tempfile.gettempdir(), end, _beside)
        before = tuple(_found_before())

        others = _threads()
        whole = _kept(vars(sys.modules["__main__"]), vars(Table), vars(_FromSource), *names)

        def say(message: dict[str, Any], earlier: tuple[Any, ...] = ()) -> None:
            if not whole():
                end("patches what runs it")
            for flush in streams:  # what it printed comes before its answer
                with contextlib.suppress(Exception):
                    flush()
            answers.write(dumps({**message, "seen": (*earlier, *seen())}) + "\n")
            answers.flush()

        look(f"{mark}-begin", os.F_OK)
        try:
            subject = load(path, function, drive)
            known = accepted(subject)
            ready: dict[str, Any] = {"ready": True}
        except BaseException as error:
            ready = {"error": _told(error)}
        say(ready, before)
        if "error" in ready:
            return
        if eyes is not None:
            held = eyes.loaded(sys.modules.copy().values)
            for line in requests:
                said = [answer(subject, known, r) | {"sights": eyes.told()} for r in loads(line)]
                said[0]["sights"] += held
                held = []
                say({"replies": said})
        for line in requests:
            say({"replies": [answer(subject, known, request) for request in loads(line)]})
        drawn()
        if others():
            end("left threads running")
        told = tuple(seen())
        look(f"{mark}-end", os.F_OK)
        with contextlib.suppress(Exception):
            _print_all(watching.is_extension)
        processes = [int(name) for name in os.listdir("/proc") if name.isdigit()] if level == "sealed" else []  # noqa: PTH208
        seen()  # that was us
        if set(processes) - {1, os.getpid()}:
            end("left processes behind")
        say({"end": True}, told)


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    _apart().main()
    os._exit(0)
