"""Records what a foreign tool, or a compiled program under test, opens, executes and looks for, by a trace of its
system calls (strace). Without strace this is unknown, and its answers are re-run each time."""

from __future__ import annotations

import codecs
import functools
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from avow.isolation.watching import way

_STEPS = frozenset({"clone", "clone3", "fork", "vfork", "fchdir"})
"""Calls that set a process' working folder."""
_OPENS = frozenset({"open", "openat", "openat2", "creat", "execve", "execveat"})
_LOOKS = frozenset(
    {"stat", "lstat", "newfstatat", "statx", "access", "faccessat", "faccessat2", "readlink", "readlinkat"}
)
_CHANGES = frozenset(
    {"unlink", "unlinkat", "rename", "renameat", "renameat2", "mkdir", "mkdirat", "rmdir", "link", "linkat", "symlink"}
    | {"symlinkat", "truncate", "chmod", "fchmodat", "chown", "lchown", "fchownat", "utimensat", "mknod", "mknodat"}
    | {"setxattr", "lsetxattr", "removexattr", "lremovexattr"}
)
_LINKS = frozenset({"symlink", "symlinkat"})
_BOTH = _LINKS | {"rename", "renameat", "renameat2", "link", "linkat"}
"""Calls that name and change two paths: a linked file can be written by its new name."""
_WRITES = re.compile(rb"\bO_(?:WRONLY|RDWR|CREAT|TRUNC|APPEND)\b")

INSTALL = "sudo apt install strace"
"""The command that installs it."""


@functools.cache
def traces() -> bool:
    """Whether strace works here: tested by running it, as a container may forbid it."""
    if sys.platform != "linux" or shutil.which("strace") is None:
        return False
    try:
        command = [*_strace(os.devnull), "true"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and not done.stderr


def remedy() -> str:
    """The remedy if nothing was traced."""
    if traces():
        return "its trace has no end: run it again"
    if sys.platform != "linux":
        return "run it on Linux, with strace"
    if shutil.which("strace") is None:
        return INSTALL
    return "strace is here, but may not trace: allow ptrace (of a container: --cap-add=SYS_PTRACE)"


def _strace(place: str) -> list[str]:
    calls = ",".join(["%file", "connect", *sorted(_STEPS)])
    program = shutil.which("strace") or "strace"
    return [program, "-f", "--seccomp-bpf", "-y", "-q", "-e", "signal=none", "-e", f"trace={calls}", "-o", place]


class Trace:
    """The trace of one process and all that it starts. It is kept in memory: on a temporarily full disk it would have
    undetectable gaps."""

    def __init__(self) -> None:
        handle = os.memfd_create("avow-trace")
        self._place = f"/proc/{os.getpid()}/fd/{handle}"
        self._file = os.fdopen(handle, "rb")

    def around(self, command: Sequence[str]) -> list[str]:
        return [*_strace(self._place), *command]

    def read_all(self, program: str, folder: Path) -> tuple[tuple[str, str], ...] | None:
        """(event, path) pairs of the accesses since the start of the program, whose working folder was `folder`,
        without files that it made itself and the machine's own (``/proc``, devices). None if the trace is incomplete.
        Read once."""
        with self._file as file:
            lines = list(_whole(file.read().split(b"\n")))
        begins = (k for k, (_, line) in enumerate(lines) if line.startswith(b"execve(") and _names(line, program))
        begin = next(begins, None)
        if begin is None or (lines[begin][0], b"") not in lines[begin:]:  # the program's own end, not of what it starts
            return None
        return _looked_at(lines[begin:], str(folder))


class _Places:
    """Each process' working folder. A child starts in its parent's; a folder that a line shows (``AT_FDCWD</folder>``)
    is taken as the current one."""

    def __init__(self, lines: Iterable[tuple[int, bytes]], first: int, folder: str) -> None:
        self._now: dict[int, str] = {first: folder}
        self._begins: dict[int, str] = {}
        self._parents: dict[int, int] = {}
        moved: set[int] = set()
        for process, line in lines:
            if line.startswith((b"chdir(", b"fchdir(")):
                moved.add(process)
            elif process not in moved and (match := _FROM.match(line)):
                self._begins.setdefault(process, _text(match[1]))
            elif child := _STARTED.match(line):
                self._parents.setdefault(int(child[1]), process)

    def of(self, process: int) -> str | None:
        """None: unknown. Process ids in a sandbox differ from those outside."""
        if process not in self._now:
            parent = self._parents.pop(process, None)
            place = self._begins.get(process) or (self.of(parent) if parent is not None else None)
            if place is None:
                return None
            self._now[process] = place
        return self._now[process]

    def see(self, process: int, line: bytes) -> None:
        """Update the process' working folder from the next line."""
        if child := _STARTED.match(line):
            self.of(int(child[1]))
        elif match := _FROM.match(line):
            self._now[process] = _text(match[1])
        elif (step := _STEP.match(line)) is not None:
            to = _text(step[1] or step[2])
            at = "" if to[:1] == os.sep else self.of(process)
            if at is not None:
                self._now[process] = way(os.path.join(at, to))  # noqa: PTH118


_STEP = re.compile(rb'(?:chdir\("((?:[^"\\]|\\.)+)"|fchdir\(\d+<((?:[^>\\]|\\.)*)>)\)\s+= 0')
_FROM = re.compile(rb"\w+\(AT_FDCWD<((?:[^>\\]|\\.)*)>")
_STARTED = re.compile(rb"(?:clone3?|v?fork)\(.*= (\d+)", re.DOTALL)
_NOWHERE = ("outside", "a file in a folder that no trace tells of")


def _looked_at(lines: Sequence[tuple[int, bytes]], folder: str) -> tuple[tuple[str, str], ...]:
    events: dict[tuple[str, str], None] = {}
    places = _Places(lines, lines[0][0], folder)
    made: set[str] = set()

    def own(path: str) -> bool:
        return any(f"{path}/".startswith(f"{one}/") for one in made)

    for process, line in lines:
        places.see(process, line)
        found = _CALL.match(line)
        if found is None:
            continue
        call, base, text, rest = found[1].decode(), found[2], found[3], found[4]
        if call == "connect" and b"AF_UNIX" not in line and rest.rstrip().endswith(_CONNECTED):
            events["outside", "the network"] = None
        if text is None or (not text and call != "execveat"):
            continue
        at = _text(base) if base is not None else places.of(process)
        if at is None and _text(text)[:1] != os.sep:
            events[_NOWHERE] = None
            continue
        path = way(os.path.join(at or "", _text(text)))  # noqa: PTH118
        well = b"= -1 " not in rest
        if call in _BOTH:
            old, new = _both(call, line, at or "")
            if well and call not in _LINKS and not own(old):
                events["read", old] = None  # under its new name it is not made here either
            elif well:
                made.add(new)
        elif call in _CHANGES or call == "creat" or (call in _OPENS and _WRITES.search(rest)):
            if call in _OPENS and b"O_RDWR" in rest and b"O_CREAT" not in rest and not own(path):
                events["read", path] = None
            if well:
                folder, name = os.path.split(path)
                made |= {path, _opened(rest) or os.path.join(os.path.realpath(folder), name)}  # noqa: PTH118
        elif f"{path}/".startswith(_OF_THE_MACHINE):
            pass
        elif path.startswith(tempfile.gettempdir()) and re.search(_JAVA % process, path):
            pass  # Java checks for an attaching debugger
        elif call in _OPENS | _LOOKS:
            # a file made here may be a link that is gone by now
            name = (_opened(rest) if call in _OPENS else None) or os.path.realpath(path) if own(path) else path
            if not own(name):
                kind = "link" if call.startswith("readlink") else "state" if call in _LOOKS else "read"
                events["kind" if kind == "read" and b"O_PATH" in rest and call not in _RUNS else kind, name] = None
    return (*events, *_interpreters(events))


_RUNS = frozenset({"execve", "execveat"})
_JAVA = r"/(\.(java|attach)_pid|hsperfdata_[^/]+/)%d$"
_OPENED = re.compile(rb"\) = \d+<(/(?:[^>\\]|\\.)*)>$")


def _opened(rest: bytes) -> str | None:
    """The path that an opening call reports, with all links resolved."""
    found = _OPENED.search(rest.rstrip())
    return _text(found[1]) if found is not None else None


def _names(line: bytes, program: str) -> bool:
    found = _CALL.match(line)
    return found is not None and found[3] is not None and _text(found[3]) == program


_CONNECTED = (b"= 0", b"(Operation now in progress)")
_OF_THE_MACHINE = ("/proc/", "/sys/", "/dev/", "/etc/ld.so.cache/", "/etc/ld.so.preload/")


def _whole(lines: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    """(process, call) pairs, with interrupted calls joined, in the order in which they ended; an empty call at a
    process' end."""
    open_: dict[int, bytes] = {}
    for line in lines:
        number, _, rest = line.partition(b" ")
        if not number.isdigit():
            continue
        process, rest = int(number), rest.lstrip()
        if rest.endswith(b"<unfinished ...>"):
            open_[process] = rest.removesuffix(b"<unfinished ...>")
        elif rest.startswith(b"<... "):
            yield process, open_.pop(process, b"") + rest.partition(b"resumed>")[2]
        elif rest.startswith(b"+++ "):
            yield process, b""
        else:
            yield process, rest
    yield from open_.items()


_STRING = rb'"((?:[^"\\]|\\.)*)"(?:\.\.\.)?'
_CALL = re.compile(rb"(\w+)\((?:(?:AT_FDCWD|-?\d+)(?:<((?:[^>\\]|\\.)*)>)?, )?(?:" + _STRING + rb")?(.*)", re.DOTALL)


_PATH = re.compile(rb"(?:(?:AT_FDCWD|-?\d+)(?:<((?:[^>\\]|\\.)*)>)?, )?" + _STRING)


def _both(call: str, line: bytes, folder: str) -> list[str]:
    """The two paths of a call."""
    found = [(_text(base) if base else folder, _text(text)) for base, text in _PATH.findall(line)[:2]]
    paths = [way(os.path.join(*pair)) for pair in found]  # noqa: PTH118
    if call in _LINKS and len(paths) == 2:
        paths[0] = way(os.path.join(os.path.dirname(paths[1]), found[0][1]))  # noqa: PTH118, PTH120
    return paths


def _interpreters(events: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """The interpreters that the kernel starts for scripts: no call shows them."""
    for event, path in events:
        if event == "read" and os.access(path, os.X_OK) and Path(path).is_file():
            with open(path, "rb") as file:  # noqa: PTH123
                first = file.readline(200)
            if first.startswith(b"#!"):
                yield "read", os.fsdecode(first[2:].split()[0]) if first[2:].split() else path


def _text(quoted: bytes) -> str:
    """Decodes a string in strace's notation."""
    raw, _ = codecs.escape_decode(quoted)
    return os.fsdecode(raw)
