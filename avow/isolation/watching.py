"""What a Python program under test opens and imports, reported by Python's own audit hook.

Loaded by `host` from beside it, so without imports from Avow. A hook cannot be removed.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Callable
from typing import Any

_LISTS = ("os.listdir", "os.scandir")
_OUTSIDE = {
    "another process": ("os.fork", "os.forkpty", "os.kill", "os.killpg", "pty.spawn"),
    "a program": ("subprocess.Popen", "os.posix_spawn", "os.spawn", "os.system", "os.exec"),
    "the network": ("socket.connect", "socket.bind", "socket.sendto", "socket.sendmsg", "socket.getaddrinfo"),
    "a library": ("ctypes.dlopen", "sqlite3.load_extension"),
    "a change of files": (
        *("os.remove", "os.rmdir", "os.mkdir", "os.chmod", "os.chown", "os.utime", "os.rename", "os.link"),
        *("os.truncate", "os.setxattr", "os.removexattr", "os.symlink"),
    ),
}
"""Inputs that cannot be recorded as a file's content → the audit events that report them."""
_EVENTS = {event: what for what, events in _OUTSIDE.items() for event in events}
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


def way(path: str) -> str:
    """An absolute path in its usual form. One that goes back from a link by ``..`` is kept: a link's parent is not the
    parent of its target."""
    usual = os.path.normpath(path)
    return path if "/../" in f"{path}/" and os.path.realpath(usual) != os.path.realpath(path) else usual


def _line() -> str:
    """The line of the program that runs now: not ours, not Python's."""
    frame = sys._getframe(1)
    while frame.f_back and frame.f_code.co_filename.startswith(_KNOWN):
        frame = frame.f_back
    return f" ({os.path.basename(frame.f_code.co_filename)}, line {frame.f_lineno})" if frame.f_back else ""  # noqa: PTH119


_KNOWN = (os.path.dirname(os.path.dirname(os.path.abspath(__file__))) + os.sep, os.path.dirname(os.__file__), "<")  # noqa: PTH100, PTH120


def watch(scratch: str) -> Callable[[], list[tuple[str, str]]]:
    """Record accesses from now on. The returned function gives the (event, path) pairs since its last call: ``read`` or
    ``list`` with an absolute path, or ``outside`` with words for an input that cannot be recorded. Files in the folder
    `scratch` are the program's own."""
    new: list[tuple[str, str]] = []
    known: set[tuple[str, str]] = set()

    def note(event: str, path: str) -> None:
        path += _line() if event == "outside" else ""
        if (event, path) not in known:
            known.add((event, path))
            new.append((event, path))

    def place(name: Any, folder: Any = None) -> str | None:
        """None: a descriptor, which was reported when it was opened, or the program's own file. `folder` is the
        descriptor that a name is relative to, if it is one."""
        if name is None or isinstance(name, int):
            return None
        at = os.readlink(f"/proc/self/fd/{folder}") if isinstance(folder, int) and folder >= 0 else os.getcwd()  # noqa: PTH109, PTH115
        path = way(os.path.join(at, os.fsdecode(name)))  # noqa: PTH118
        return None if f"{path}/".startswith(f"{scratch}/") else path

    def opened(name: Any, mode: Any, flags: Any) -> None:
        path = place(name)
        if path is None or path == os.devnull:
            return
        if (isinstance(mode, str) and set(mode) & set("wax+")) or (isinstance(flags, int) and flags & _WRITES):
            note("outside", f"a change of files ({path})")
        elif os.path.basename(os.path.dirname(path)) == "__pycache__":  # noqa: PTH119, PTH120
            try:
                note("read", importlib.util.source_from_cache(path))
            except ValueError:
                note("read", path)
        else:
            note("read", path)

    def hook(event: str, arguments: tuple[Any, ...]) -> None:
        if event == "open":
            opened(*arguments)
        elif event in _LISTS:
            if (path := place(arguments[0] if arguments[0] is not None else ".")) is not None:
                note("list", path)
        elif event == "import":
            if (path := place(arguments[1])) is not None:
                note("read", path)
        elif event == "sqlite3.connect":
            if arguments[0] not in ("", ":memory:"):
                note("outside", f"a database ({arguments[0]})")
        elif event in _EVENTS and arguments[:1] != (None,):  # `import ctypes` opens no library by name
            changed = _EVENTS[event] == "a change of files"
            if not changed or place(arguments[0], arguments[-1]) is not None:
                note("outside", f"{_EVENTS[event]} ({', '.join(map(str, arguments))[:200] or event})")

    def taken() -> list[tuple[str, str]]:
        found, new[:] = new[:], []
        return found

    sys.addaudithook(hook)
    return taken
