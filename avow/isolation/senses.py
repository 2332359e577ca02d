"""Tells what a subject asks of the running system: clocks, chance, the machine, the state of files.

Loaded by `host` from beside it, so without imports from Avow. What Python's functions are told of here can be recorded
(the kind, size, mode and link target of a file), or it is an undeclared input (the rest). The library's own use counts
as nobody's.
"""

from __future__ import annotations

import _datetime  # type: ignore[import-not-found]
import _posixsubprocess
import _random
import datetime
import functools
import grp
import logging
import os
import platform
import posix
import pwd
import random
import resource
import stat
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

Told = Callable[[str, Any], None]
"""Takes an event and a path, or ``outside`` and what it is."""


def closed(call: Callable[..., Any]) -> Any:
    """`call`, which does not show what it holds, as a function does in its `__closure__`. (Of a cache that keeps
    nothing, Python shows neither the function nor what it knows.)"""
    return functools._lru_cache_wrapper(call, 0, False, tuple)  # type: ignore[call-arg]


def instead(call: Callable[..., Any], inner: Any) -> Callable[..., Any]:
    """`call`, which stands in the place of `inner` and does not lead to it."""
    found: Callable[..., Any] = functools.update_wrapper(closed(call), inner)
    del found.__dict__["__wrapped__"]
    return found


# -- clock and chance ----------------------------------------------------------------------------------------------

_CLOCKS = ("time", "monotonic", "perf_counter", "process_time", "thread_time")
_NOW = {"localtime": 0, "gmtime": 0, "ctime": 0, "asctime": 0, "strftime": 1}
"""Functions of `time` that take now where they are given no more than so many arguments."""

_HOST = tuple(
    os.path.join(os.path.dirname(__file__), name)  # noqa: PTH118, PTH120
    for name in ("host.py", "watching.py", "senses.py", "machine_code.py")
)
_INSTALLED = tuple(place + os.sep for place in sys.path if place.endswith("-packages"))
_IMPORT = ("<frozen importlib", "<frozen zipimport")
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


def asked(*, importing: bool = True) -> bool:
    """Whether it is the subject that asks for a clock or a random number: no module that is just imported, and not the
    library for its own business. `importing`: an installed package that is just imported counts as the subject."""
    frame: Any = sys._getframe(2)
    while frame is not None:
        file = frame.f_code.co_filename
        inner = file.removeprefix(_STDLIB)
        handed_on = inner == "asyncio/base_events.py" and frame.f_code.co_name == "time"
        if file.startswith(_IMPORT) or (inner != file and inner.startswith(_OWN_USE) and not handed_on):
            return False
        if (
            file not in _HOST
            and not file.startswith("<frozen ")
            and (inner == file or "-packages" in inner)
            and (importing or not file.startswith(_INSTALLED))
        ):
            return True
        frame = frame.f_back
    return False


def _from(depth: int, part: str) -> bool:
    """Whether it is called from that part of the library."""
    return sys._getframe(depth).f_code.co_filename.startswith(_STDLIB + part)


def _watch_chance(told: Told) -> Callable[[], None]:
    """Tells when the subject reads a clock or draws what nobody seeded, as far as Python does it; returns what is to be
    asked once more at the end."""

    def outer(inner: Callable[..., Any], what: str, most: int | None = None) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if (most is None or len([a for a in arguments if a is not None]) <= most) and asked():
                told("outside", what)
            return inner(*arguments, **named)

        return instead(call, inner)

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

    class Unseeded(_random.Random):
        def __new__(cls, *arguments: Any) -> Any:
            if (not arguments or arguments[0] is None) and asked():
                told("outside", chance)
            return super().__new__(cls, *arguments)

    _random.Random = Unseeded  # type: ignore[misc]
    seed, set_state = random.Random.seed, random.Random.setstate
    shared = random._inst
    started: list[Any] = [random.Random.getstate(shared)]

    def drawn() -> None:
        if started and random.Random.getstate(shared) != started[0]:
            told("outside", chance)

    def seeded(own: random.Random, a: Any = None, version: int = 2) -> None:
        if a is None and asked():
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
            if asked():
                told()
            return super().now(tz)

        @classmethod
        def utcnow(cls) -> Any:
            if asked():
                told()
            return super().utcnow()

    Watched.__name__, Watched.__qualname__, Watched.__module__ = "datetime", "datetime", "datetime"
    datetime.datetime = _datetime.datetime = Watched  # type: ignore[misc]


# -- the running system --------------------------------------------------------------------------------------------

_SYSTEM: tuple[tuple[Any, str, str], ...] = (
    (os, "the clock", "times getloadavg wait3 wait4"),
    (
        os,
        "the machine",
        "uname cpu_count process_cpu_count sched_getaffinity sysconf confstr pathconf fpathconf get_terminal_size",
    ),
    (os, "the state of a disk", "statvfs fstatvfs"),
    (os, "the numbers of a process", "getpid getppid getpgid getpgrp getsid getpriority nice umask"),
    (os, "the numbers of a process", "sched_getscheduler sched_getparam sched_rr_get_interval"),
    (os, "the user", "getuid geteuid getgid getegid getresuid getresgid getgroups getgrouplist getlogin ttyname"),
    (os, "a file's attributes", "getxattr listxattr"),
    (resource, "the clock", "getrusage"),
    (resource, "the limits of a process", "getrlimit prlimit"),
    (pwd, "the user", "getpwuid getpwnam getpwall"),
    (grp, "the user", "getgrgid getgrnam getgrall"),
    (platform, "the machine", "node release version platform processor uname"),
)
"""Functions whose answer no record can hold: (module, what is asked for, names). Constant for every subject, and so not
here: its arguments, its standard streams, the names of its environment."""

_THROUGH = {"uname": "platform.py", "listxattr": "shutil.py", "getxattr": "shutil.py"}
"""A module of the library with functions that ask for more than they tell: those that tell are in the table."""


def _watch_system(told: Told) -> None:
    """Tells when the subject calls a function of the running system, or has SQLite tell the time."""

    def outer(inner: Callable[..., Any], name: str, what: str) -> Callable[..., Any]:
        library = _STDLIB + _THROUGH.get(name, " ")

        def call(*arguments: Any, **named: Any) -> Any:
            handed_on = name == "cpu_count" and _from(2, "multiprocessing/")
            if sys._getframe(1).f_code.co_filename != library and (handed_on or asked(importing=False)):
                told("outside", what)
            return inner(*arguments, **named)

        return instead(call, inner)

    for module, what, names in _SYSTEM:
        for name in names.split():
            if hasattr(module, name):
                wrapped = outer(getattr(module, name), name, what)
                for place in (module, posix) if module is os else (module,):
                    if hasattr(place, name):
                        setattr(place, name, wrapped)

    def time_of(name: str, record: Any) -> Any:
        if asked():
            told("outside", "the clock")
        return record.__dict__[name]

    for name in ("created", "msecs", "relativeCreated"):
        kept = functools.partial(lambda name, record, value: record.__dict__.update({name: value}), name)
        setattr(logging.LogRecord, name, property(functools.partial(time_of, name), kept))


# -- the state of files ----------------------------------------------------------------------------------------------

_OF_KIND: tuple[str, ...] = tuple(_STDLIB + name for name in ("genericpath.py", "posixpath.py", "pathlib", "glob.py"))
_OF_KIND += (_STDLIB + "os.py", "<frozen os>", "<frozen genericpath>", "<frozen posixpath>")
"""Modules of the library that look at a mode for the kind of file only."""


class _State:
    """In place of an `os.stat_result`: tells what of it is looked at."""

    __slots__ = ("_path", "_real", "_told")
    __class__ = property(lambda self: os.stat_result)

    def __init__(self, real: os.stat_result, told: Told, path: Any) -> None:
        self._real, self._told, self._path = real, told, path

    def _looked(self, name: str) -> None:
        caller = sys._getframe(2).f_code.co_filename
        match name:
            case "st_size" | "st_mode" if name == "st_mode" or not stat.S_ISDIR(self._real.st_mode):
                if self._path is not None and not (name == "st_mode" and caller.startswith(_OF_KIND)):
                    self._told("state", self._path)
            case "st_ino" | "st_dev" if caller.startswith(_OF_KIND):
                pass  # whether two names are of one file
            case _ if asked(importing=False) and not caller.startswith(
                (_STDLIB + "linecache.py", _STDLIB + "shutil.py")
            ):
                self._told("outside", "the clock" if "time" in name else "a file's place on its disk")

    def __getattr__(self, name: str) -> Any:
        if name.startswith("st_"):
            self._looked(name)
        return getattr(self._real, name)

    def __getitem__(self, index: Any) -> Any:
        for name in _FIELDS[index] if isinstance(index, slice) else (_FIELDS[index],):
            self._looked(name)
        return self._real[index]

    def __iter__(self) -> Iterator[Any]:
        return iter(self[:])

    def __len__(self) -> int:
        return len(_FIELDS)

    def __eq__(self, other: object) -> bool:
        return tuple(self) == other

    def __hash__(self) -> int:
        return hash(tuple(self))

    def __repr__(self) -> str:
        return f"os.stat_result{tuple(self)}"


_FIELDS = tuple(
    f"st_{name}" for name in ("mode", "ino", "dev", "nlink", "uid", "gid", "size", "atime", "mtime", "ctime")
)


class _Entry:
    """In place of an `os.DirEntry`: what is asked of it is asked of its file."""

    __slots__ = ("_at", "_real", "_told", "name", "path")

    def __init__(self, real: Any, told: Told, folder: str | None = None) -> None:
        self._real, self._told, self.name, self.path = real, told, real.name, real.path
        self._at = self.path if folder is None else os.path.join(folder, self.name)  # noqa: PTH118

    def _kind(self, name: str, **named: Any) -> bool:
        self._told("kind", self._at)
        return bool(getattr(self._real, name)(**named))

    def is_dir(self, *, follow_symlinks: bool = True) -> bool:
        return self._kind("is_dir", follow_symlinks=follow_symlinks)

    def is_file(self, *, follow_symlinks: bool = True) -> bool:
        return self._kind("is_file", follow_symlinks=follow_symlinks)

    def is_symlink(self) -> bool:
        return self._kind("is_symlink")

    def is_junction(self) -> bool:
        return False

    def inode(self) -> int:
        self._told("outside", "a file's place on its disk")
        return int(self._real.inode())

    def stat(self, *, follow_symlinks: bool = True) -> Any:
        self._told("kind", self._at)
        return _State(self._real.stat(follow_symlinks=follow_symlinks), self._told, self._at)

    def __fspath__(self) -> Any:
        return self.path

    def __repr__(self) -> str:
        return f"<DirEntry {self.name!r}>"


class _Entries:
    """In place of what `os.scandir` returns."""

    def __init__(self, real: Any, told: Told, folder: str | None = None) -> None:
        self._real, self._told, self._folder = real, told, folder

    def __iter__(self) -> _Entries:
        return self

    def __next__(self) -> _Entry:
        return _Entry(next(self._real), self._told, self._folder)

    def __enter__(self) -> _Entries:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def close(self) -> None:
        self._real.close()


def _watch_state(told: Told) -> None:
    """Tells which files are looked at without being opened, of which no audit event tells, and programs started by
    hand."""
    readlink, scandir, open_ = os.readlink, os.scandir, os.open

    def opened(path: Any, flags: int, mode: int = 0o777, *, dir_fd: int | None = None) -> int:
        folder = place(dir_fd) if dir_fd is not None else None
        if folder is None:
            return open_(path, flags, mode, dir_fd=dir_fd)
        return open_(os.path.join(os.fsencode(folder), os.fsencode(path)), flags, mode)  # noqa: PTH118

    def mine(named: dict[str, Any]) -> bool:
        if named.get("dir_fd") is not None and asked():
            told("outside", "a file by its folder's descriptor")
        return not sys._getframe(2).f_code.co_filename.startswith(_IMPORT)

    def place(file: Any) -> Any:
        """Of an open descriptor, the path; None where it has none."""
        if not isinstance(file, int):
            return file
        try:
            path = readlink(f"/proc/self/fd/{file}")
        except OSError:
            return None
        return path if path.startswith("/") else None

    def state(inner: Callable[..., Any]) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if not mine(named):
                told("import", arguments[0])
                return inner(*arguments, **named)
            path = place(arguments[0] if arguments else named.get("path", named.get("fd")))
            told("kind", path)
            return _State(inner(*arguments, **named), told, path)

        return instead(call, inner)

    def outer(inner: Callable[..., Any], event: str, what: str | None = None) -> Callable[..., Any]:
        def call(*arguments: Any, **named: Any) -> Any:
            if mine(named):
                told(event, what or place(arguments[0] if arguments else named.get("path")))
            return inner(*arguments, **named)

        return instead(call, inner)

    def listed(path: Any = ".") -> Any:
        if isinstance(path, int):
            return _Entries(scandir(path), told, place(path))
        return _Entries(scandir(path), told)

    new: dict[str, Any] = {name: state(getattr(os, name)) for name in ("stat", "lstat", "fstat")}
    new |= {"access": outer(os.access, "state"), "readlink": outer(readlink, "link")}
    new |= {"scandir": listed, "DirEntry": _Entry, "open": opened}
    for name, function in new.items():
        setattr(os, name, function)
        setattr(posix, name, function)
    _posixsubprocess.fork_exec = outer(_posixsubprocess.fork_exec, "program", "a program")


# -- where it runs -----------------------------------------------------------------------------------------------------


class _Variables(dict[bytes, bytes]):
    """In place of the environment's dictionary: tells which of the variables is read that are not always the same."""

    told: Told

    def _read(self, *names: Any) -> None:
        for name in names:
            if name in (b"PATH", b"PYTHONPATH") and asked(importing=False):
                self.told("variable", name.decode())

    def __getitem__(self, name: bytes) -> bytes:
        self._read(name)
        return dict.__getitem__(self, name)

    def get(self, name: bytes, default: Any = None) -> Any:
        self._read(name)
        return dict.get(self, name, default)

    def __iter__(self) -> Iterator[bytes]:
        self._read(*dict.__iter__(self))
        return dict.__iter__(self)

    def items(self) -> Any:
        return [(name, self[name]) for name in self]

    def values(self) -> Any:
        return [self[name] for name in self]


def _watch_place(told: Told) -> None:
    """Tells when the subject asks in which folder it runs, or reads a search path."""
    known = _Variables(os.environ._data)  # type: ignore[attr-defined]
    known.told = told
    os.environ._data = posix.environ = known  # type: ignore[attr-defined]
    for name in ("getcwd", "getcwdb"):
        inner = getattr(os, name)

        def where(inner: Callable[[], Any] = inner) -> Any:
            here = inner()
            if asked(importing=False):
                told("place", here)
            return here

        for module in (os, posix):
            setattr(module, name, instead(where, inner))


def watch_all(told: Told) -> Callable[[], None]:
    """All of it; returns what is to be called at the end."""
    _watch_state(told)
    _watch_system(told)
    _watch_place(told)
    return _watch_chance(told)
