"""Watches what a subject does besides answering: what it looks at is told, and what no subject may do ends it.

Loaded by `host` from beside it, as `senses` is. What the subject can get hold of leads here, and not to what answers.
"""

from __future__ import annotations

import importlib.machinery
import os
import sys
import types
from collections.abc import Callable
from typing import Any

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


def way(path: str, *, whole: bool = False, readlink: Callable[[str], str] = os.readlink) -> tuple[str, list[str]]:
    """An absolute path without ``..``, as the system goes it: what a folder lies in is not where a link to it lies.
    And what decides where that leads: the links on the way, and the folders that are left by ``..``. `whole`: the
    folder is gone into, and what is asked for from there does not say how one came there."""
    if not whole and "/../" not in f"{path}/":
        return os.path.normpath(path), []
    place, noted, links = "/", list[str](), 0
    parts = [*path.split("/"), *(["."] if whole else [])][::-1]
    while parts:
        part = parts.pop()
        if part == "..":
            noted.append(place)
            place = os.path.dirname(place)  # noqa: PTH120
        elif part not in ("", "."):
            above, place = place, os.path.join(place, part)  # noqa: PTH118
            try:
                target = readlink(place) if parts and links < _MOST_LINKS else ""
            except (OSError, ValueError):
                continue
            if target:
                noted.append(place)
                links += 1
                parts += target.split("/")[::-1]
                place = "/" if target.startswith("/") else above
    return place, noted


_MOST_LINKS = 40
"""The system follows no more."""


def watch(
    scratch: str, end: Callable[[str], None], beside: Callable[[str], Any]
) -> tuple[Callable[[], list[tuple[str, str]]], Callable[[], None], tuple[dict[str, Any], ...]]:
    """What gives what it looked at since the last time, as (event, path); what is to be called at the end; and the
    names by which this watches, which the subject can get hold of and must leave as they are. What no subject may do
    ends the process by `end`, before it is done: nothing can catch that, or have it forgotten. A hook cannot be taken
    away."""
    seen: list[tuple[str, str]] = []
    known: set[tuple[str, str]] = set()
    fspath, isabs, join, getcwd = os.fspath, os.path.isabs, os.path.join, os.getcwd
    readlink, dirname = os.readlink, os.path.dirname

    def written(place: Any) -> str:
        place = fspath(place)
        if isinstance(place, bytes):
            place = bytes.decode(place, sys.getfilesystemencoding(), "surrogateescape")
        return str.__str__(place)  # of no class of the subject's own

    def own(path: str) -> bool:
        return path == scratch or path.startswith(scratch + os.sep)

    def path_of(place: Any, *, whole: bool = False) -> str | None:
        if place is None or isinstance(place, int):  # an open descriptor: told when it was opened
            return None
        text = written(place)
        path, left = way(text if isabs(text) else join(getcwd(), text), whole=whole)
        for folder in left:
            if not own(folder):
                add("kind", folder)
        return None if own(path) else path

    def add(event: str, path: str) -> None:
        if (event, path) not in known:
            known.add((event, path))
            seen.append((event, path))

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
        if path is not None:
            add(event, path)

    def taken() -> list[tuple[str, str]]:
        found, seen[:] = seen[:], []
        return found

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
        if mode is None:
            path_of(path, whole=True)  # `os.open`: perhaps a folder, by which others are named
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
            if arguments[0] in _READING or is_extension(arguments[1]):
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
            path_of(arguments[0], whole=True)
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
            told("variable", "PATH")  # it is looked for there, and what it starts
        elif event.startswith(_NETWORK):
            if event != "socket.__new__" or arguments[1] != _OF_A_PAIR or not _wakes_a_loop():
                told("outside", "the network")
        elif event == "fcntl.ioctl":
            told("outside", "the state of a device")
        elif event in _TRACES:
            fault("traces what runs it")
        elif event in _RUNS and _forges(arguments[_RUNS[event]]):
            fault("runs code under the name of a file of the library")
        elif event in _AROUND and not looking and (not event.startswith("object.") or arguments[1] in _LEADING):
            looking.append(event)
            if _looks_around(event):
                told("outside", "what runs it")
            looking.clear()

    looking: list[str] = []  # what it looks at itself to answer that is nothing that the subject asks for
    senses = beside("senses.py")
    machine_code = beside("machine_code.py")
    machine_code.instead = senses.instead
    tell = senses.closed(told)  # who gets hold of it is not to get hold of what it noted
    drawn = senses.watch_all(tell)
    machine_code.watch_modules(tell, senses.asked)
    machine_code.watch_sqlite(tell)
    sys.addaudithook(hook)
    return senses.closed(taken), drawn, (globals(), vars(senses), vars(machine_code))


_AROUND = frozenset(
    {"sys._getframe", "sys._current_frames", "gc.get_objects", "gc.get_referrers", "gc.get_referents"}
    | {"object.__getattr__", "object.__setattr__"}
)
"""Events by which a subject may find out that it is run by a judge and not by what it is made for."""
_LEADING = ("tb_frame", "gi_frame", "cr_frame", "ag_frame", "__code__", "__defaults__", "__kwdefaults__")
_TRACES = frozenset({"sys.settrace", "sys.setprofile", "sys.monitoring.register_callback"})
"""Events after which it is handed all frames, and with them the list of what was seen."""
_RUNS = {"exec": 0, "function.__new__": 0, "object.__setattr__": 2}
"""Event by which code becomes what runs (an attribute: `__code__`) → where among its arguments the code is."""

_READING = frozenset(
    {"_ssl", "_dbm", "_gdbm", "_curses", "_posixshmem", "_tkinter", "nis", "ossaudiodev", "readline", "spwd", "syslog"}
)
"""Modules of Python's own in C that open files by themselves: a trace of system calls tells which."""
_STDLIB = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120

_IMPORT = ("<frozen importlib", "<frozen zipimport")
_INSTALLED = tuple(place + os.sep for place in sys.path if place.endswith("-packages"))


def _looks_around(event: str) -> bool:
    """Whether it is the subject itself that asks for the frames of its callers, for another's code or for all objects:
    directly, or by `inspect` and `traceback`. A library that looks for its caller (log lines) is not it."""
    frame: Any = sys._getframe(2)
    while frame is not None and event == "sys._getframe" and frame.f_code.co_filename.startswith(_LOOKING):
        frame = frame.f_back
    if frame is not None and frame.f_code.co_filename.startswith(_STDLIB + "logging/"):
        frame = frame.f_back  # `logging.currentframe` hands it on
    if frame is None:
        return False
    return not _is_library(frame.f_code.co_filename)


_OF_A_PAIR = 1
"""The family of a pair of sockets, AF_UNIX: one of another (NETLINK) answers without being connected."""


def _wakes_a_loop() -> bool:
    """Whether a socket is made that is of the pair by which a loop of `asyncio` wakes itself: it is as a pipe that
    stays in the process, as long as nobody connects it or asks for its options, which is told."""
    frame: Any = sys._getframe(3)  # of who called what makes the socket
    places = [(_STDLIB + "socket.py", "socketpair"), (_STDLIB + "asyncio/selector_events.py", "_make_self_pipe")]
    return [(f.f_code.co_filename, f.f_code.co_name) for f in (frame, frame and frame.f_back) if f] == places


def _is_library(file: str) -> bool:
    """Whether code of that file is not the subject's own."""
    return file.startswith((_AVOW, _STDLIB, "<frozen ", *_INSTALLED)) or "-packages" in file


def _forges(code: Any) -> bool:
    """Whether code is run under the name of a library's file by who is not importing: by that name is told who asks.
    What is imported under a false name is not seen."""
    if sys._getframe(2).f_code.co_filename.startswith((*_IMPORT, _STDLIB + "types.py")):  # `types.coroutine`
        return False
    parts = [code]
    while parts:
        part = parts.pop()
        if isinstance(part, types.CodeType):
            if type(part.co_filename) is not str or _is_library(part.co_filename):  # another kind answers as it likes
                return True
            parts += part.co_consts
    return False


_AVOW = os.path.dirname(os.path.dirname(__file__)) + os.sep  # noqa: PTH120
_LOOKING = (_STDLIB + "inspect.py", _STDLIB + "traceback.py")


def is_extension(file: Any) -> bool:
    """Whether a module is of machine code, and not Python's own."""
    return (
        isinstance(file, str)
        and file.endswith(tuple(importlib.machinery.EXTENSION_SUFFIXES))
        and (not file.startswith(_STDLIB) or "-packages" in file)
    )


_HARMLESS = ("self", "thread-self", "cpuinfo", "meminfo", "stat", "version", "filesystems", "mounts", "sys")
