"""Runs a program under test, and nothing else, in a process of its own.

A script without imports from Avow: it is read at every start. Each incoming line of JSON has the inputs of some cases;
a line with an answer for each goes out (`subject.Message`) over a pipe that is not standard output. The program gets
values of the contract as plain Python: an element of an enumeration is a string, a REAL is a
`Fraction`, ``move(1, 2)`` is ``("move", 1, 2)``, a sequence is a tuple, a function or relation is a `Table`.
"""

from __future__ import annotations

import enum
import faulthandler
import importlib.machinery
import importlib.util
import inspect
import itertools
import json
import os
import random
import signal
import sys
import tempfile
import traceback
from collections.abc import Iterator, Mapping
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
    """Converts a value from the judge's form to the program's: the form of `avow.drive.steps`, and tables."""
    match data:
        case {"q": [numerator, denominator]}:
            return Fraction(int(numerator), int(denominator))
        case {"i": digits}:
            return int(digits)
        case {"t": items}:
            return tuple(plain(item) for item in items)
        case {"f": rows, "e": default}:
            return Table({tuple(plain(a) for a in point): plain(value) for point, value in rows}, plain(default))
        case {"f": text}:
            return float.fromhex(text)
        case _:  # a value that is its own JSON
            return data


def coded(value: Any, depth: int = 0) -> Any:
    """The program's return value as JSON; a value outside the contract's types is named by its type."""
    if depth > 20:
        return {"?": "something nested too deeply"}
    inner = depth + 1
    match value:
        case None | bool():
            return value
        case enum.Enum():
            return value.name
        case str():
            return str(value)
        case int():
            return {"i": str(int(value))}
        case float():
            return {"f": float(value).hex()}
        case Fraction() | Decimal():
            try:
                return {"q": [str(part) for part in value.as_integer_ratio()]}
            except (ValueError, OverflowError):
                return {"?": f"the number {value}"}
        case Table():
            rows = [[[coded(a, inner) for a in k], coded(v, inner)] for k, v in value._table.items()]
            return {"f": rows, "e": coded(value.default, inner)}
        case Mapping():
            rows = [[coded(k, inner) if k is not ... else {"...": True}, coded(v, inner)] for k, v in value.items()]
            return {"d": rows}
        case set() | frozenset():
            return {"s": [coded(item, inner) for item in value]}
        case tuple() | list():
            return {"l": [coded(item, inner) for item in value]}
    return {"?": f"a value of type {type(value).__name__}"}


def load(path: str, name: str, function: str, drive: Any = None) -> Any:
    """The function of the file, which is the module of that name; with `drive`, which `driving` gives, the class that
    the JSON in `function` names."""
    if package := name.rpartition(".")[0]:
        importlib.import_module(package)
    spec = importlib.util.spec_from_loader(name, _FromSource(name, path))
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    spec.origin, spec.has_location = path, True
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    try:
        spec.loader.exec_module(module)
    except ModuleNotFoundError as error:
        package, _, last = str(error.name).rpartition(".")
        places = list(getattr(sys.modules.get(package), "__path__", ()))
        if places:  # the package is there, and not its module
            near = f": {os.path.relpath(places[0])} has no {last}.py"
            near += _near(last, {os.path.splitext(file)[0] for file in os.listdir(places[0])})  # noqa: PTH122, PTH208
        else:
            near = _near(str(error.name), {name.partition(".")[0] for name in sys.modules})
        near = near or f": install it where Avow runs, or put its file beside {os.path.basename(path)}"  # noqa: PTH119
        error.msg += near if error.msg.startswith("No module") else ""
        raise
    driven = json.loads(function) if drive is not None else None
    wanted = function if driven is None else driven["class"]
    try:
        found = getattr(module, wanted)
    except AttributeError:
        kind = "function" if driven is None else "class"
        near = _near(wanted, {each for each in vars(module) if not each.startswith("_")})
        raise AttributeError(f"{os.path.basename(path)} has no {kind} {wanted!r}{near}") from None  # noqa: PTH119
    return found if driven is None else drive(found, driven)


def _near(name: str, known: set[str]) -> str:
    """The known name that was probably meant, as the end of a message."""
    import difflib

    near = difflib.get_close_matches(name, sorted(known), 1, 0.75)
    return f": did you mean {near[0]}?" if near else ""


def places(path: str, root: str) -> tuple[str, list[str], list[tuple[str, str]]]:
    """The name of the file's module; the folders of its imports: its own, as if it were run, and those of the ament or
    catkin package that it is in; what decided it."""
    looked: list[tuple[str, str]] = []

    def has(folder: str, file: str) -> bool:
        looked.append(("kind", os.path.join(folder, file)))  # noqa: PTH118
        return os.path.isfile(looked[-1][1])  # noqa: PTH113

    folder, stem = os.path.split(path)
    folders, names = [folder], [os.path.splitext(stem)[0]]  # noqa: PTH122
    while folder.startswith(root + os.sep) and has(folder, "__init__.py"):
        folder, name = os.path.split(folder)
        names.insert(0, name)
    folders.append(folder)
    while not has(folder, "package.xml") and folder.startswith(root + os.sep):
        folder = os.path.dirname(folder)  # noqa: PTH120
    if os.path.isfile(looked[-1][1]):  # noqa: PTH113
        folders += [folder, os.path.join(folder, "src")]  # noqa: PTH118
    return ".".join(names) if len(names) > 1 else "avow_subject", list(dict.fromkeys(folders)), looked


def driving(function: str, folders: list[str]) -> Any:
    """The driver of the class that the JSON in `function` names, whose own modules are in the folders; None for a
    function. The substitute for ROS is in place before the file is loaded."""
    if not function.startswith("{"):
        return None
    ros = json.loads(function).get("ros")
    _beside("../drive/__init__.py", "avow_drive")
    driver = importlib.import_module("avow_drive.steps" if ros is None else f"avow_drive.{ros['kind']}")
    return driver.driver if ros is None else driver.modules(ros, folders)


class _FromSource(importlib.machinery.SourceFileLoader):
    """Never uses a compiled file: it may be older than an edit within the same second."""

    def get_code(self, fullname: str) -> Any:
        path = self.get_filename(fullname)
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
    """The modules imported already, and the folders that are searched before Python's own."""
    files = [getattr(module, "__file__", None) for module in list(sys.modules.values())]
    ours = os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep  # noqa: PTH100, PTH120
    first = itertools.takewhile(lambda folder: folder != os.path.dirname(os.__file__), sys.path)  # noqa: PTH120
    read = [("read", file) for file in files if isinstance(file, str) and not file.startswith(ours)]
    return [*read, *(("list", folder) for folder in first)]


def _hide(folders: list[str]) -> list[tuple[str, str]]:
    """Forget the imported modules that a file of these folders replaces when the program is run from there, as it has
    then to find that file; returns where it was looked for."""
    for name, module in list(sys.modules.items()):
        origin = getattr(getattr(module, "__spec__", None), "origin", None)
        if "." in name or origin in ("built-in", "frozen"):  # found before any folder is searched
            continue
        paths = [os.path.join(folder, name) for folder in folders]  # noqa: PTH118
        if any(os.path.isfile(f"{path}.py") or os.path.isfile(f"{path}/__init__.py") for path in paths):  # noqa: PTH113
            for known in [each for each in sys.modules if each == name or each.startswith(f"{name}.")]:
                del sys.modules[known]
    return [("list", folder) for folder in folders]


def _folders_only() -> list[tuple[str, str]]:
    """Namespace packages: a file ``__init__.py`` that appears there would be imported."""
    found = (module for module in list(sys.modules.values()) if getattr(module, "__file__", None) is None)
    return [("list", folder) for module in found for folder in getattr(module, "__path__", ())]


def _beside(file: str, name: str) -> Any:
    """Loads a module or a package from this folder under a name of its own, outside of Avow's package."""
    place = os.path.normpath(os.path.join(os.path.dirname(__file__), file))  # noqa: PTH118, PTH120
    spec = importlib.util.spec_from_file_location(name, place)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


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
    """The error and where in the program it came from."""
    try:
        ours = os.path.dirname(os.path.dirname(os.path.realpath(__file__))) + os.sep  # noqa: PTH120
        frames = [f for f in traceback.extract_tb(error.__traceback__) if not f.filename.startswith("<")]
        own = [frame for frame in frames if not os.path.realpath(frame.filename).startswith(ours)]
        where = f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""  # noqa: PTH119
        relative = isinstance(error, ImportError) and "no known parent package" in str(error)
        hint = "; a relative import needs the file in the folder of its package, with `__init__.py`" if relative else ""
        return f"{type(error).__name__}: {error}"[:500] + where + hint
    except BaseException:
        return type(error).__name__


def main() -> None:
    path, function, root = sys.argv[1:4]
    source, sink = int(sys.argv[4]), int(sys.argv[5])
    sys.argv[:], sys.orig_argv[:] = [path], [sys.executable, path]  # the same at every run
    with os.fdopen(source, "r", encoding="utf-8") as requests, os.fdopen(sink, "w", encoding="utf-8") as answers:
        faulthandler.register(signal.SIGUSR1, answers.fileno(), all_threads=False)  # as `SubjectProcess._place` asks
        random.seed(0)
        name, folders, looked = places(path, os.path.realpath(root))
        drive = driving(function, folders)
        _read_sources_only(os.path.realpath(root))
        seen = _beside("watching.py", "avow_watching").watch(tempfile.gettempdir())
        before = [*_found_before(), *looked, *_hide(folders)]
        sys.path[:0] = folders

        def say(message: dict[str, Any], earlier: list[tuple[str, str]] = before[:0]) -> None:
            answers.write(json.dumps({**message, "seen": [*earlier, *seen()]}) + "\n")
            answers.flush()

        try:
            subject = load(path, name, function, drive)
            known = accepted(subject)
        except BaseException as error:
            say({"error": _told(error)}, before)
            return
        say({"ready": True}, [*before, *_folders_only()])
        for line in requests:
            say({"replies": [answer(subject, known, request) for request in json.loads(line)]})


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    main()
    os._exit(0)
