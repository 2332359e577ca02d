"""What a subject's processes ask the system for, seen from outside by strace where it is installed.

The audit hook sees what Python does. Whatever else runs (an extension module, a program that was started) opens its
files unseen by it; a trace of the system calls tells. Without strace such a program is an undeclared input.
"""

from __future__ import annotations

import codecs
import functools
import os
import re
import secrets
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from avow.base.files import read_regular
from avow.isolation.watching import way

_SIGNALS = frozenset({"kill", "tkill", "pidfd_send_signal", "rt_sigqueueinfo"})
_PROBES = frozenset({"ptrace", "process_vm_readv", "process_vm_writev"})
_NETWORK = frozenset({"socket", "connect"})
_OF_SOCKETS = frozenset({"getsockopt", "setsockopt", "recvmsg", "recvmmsg"})
"""What asks a socket, even one of a pair, for the user, the numbers of a process or the clock."""
_MACHINE_CALLS = frozenset({"uname", "sysinfo"})
"""What a program asks of the machine by a call. The clock is read without one (`_asks`)."""
_TOLD = _SIGNALS | _PROBES | _NETWORK | _OF_SOCKETS | _MACHINE_CALLS
_STEPS = frozenset({"clone", "clone3", "fork", "vfork", "fchdir"})
"""Calls that say in which folder a process is."""
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
"""Calls that name two paths, and change both: what is linked to can be written by its new name."""
_BY_HANDLE = frozenset({"fchmod", "fchown", "ftruncate", "fsetxattr", "fremovexattr", "utimensat"})
"""Calls that change what a descriptor is of."""
_WRITES = re.compile(rb"\bO_(?:WRONLY|RDWR|CREAT|TRUNC|APPEND)\b")

_MACHINE = tuple(
    f"{place}/"
    for place in (
        *(f"/proc/{name}" for name in ("cpuinfo", "meminfo", "filesystems", "mounts", "stat", "version", "sys")),
        *(f"/proc/self/{name}" for name in ("maps", "status", "cgroup", "mountinfo", "mounts", "auxv", "fd")),
        *("/sys/devices/system", "/sys/fs/cgroup", "/sys/kernel", "/etc/ld.so.cache", "/dev/tty"),
    )
)
"""What libraries ask about the machine as they start; and the loader's index, since what it finds there is told."""


INSTALL = "sudo apt install strace"
"""The one command that brings it."""


@dataclass(frozen=True, slots=True)
class Traced:
    """What a trace tells: (event, path) pairs as the audit hook's, and what no subject may do."""

    events: tuple[tuple[str, str], ...]
    faults: tuple[str, ...]


@functools.cache
def traces() -> bool:
    """Whether strace works here: found out by running it, as a container may forbid it."""
    if sys.platform != "linux" or shutil.which("strace") is None:
        return False
    try:
        command = [*_strace(os.devnull), "true"]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0 and not done.stderr


def remedy() -> str:
    """What a person can do where nothing was traced."""
    if traces():
        return "its trace has no end: run it again"
    if sys.platform != "linux":
        return "run it on Linux, with strace"
    if shutil.which("strace") is None:
        return INSTALL
    return "strace is here, but may not trace: allow ptrace (of a container: --cap-add=SYS_PTRACE)"


def _strace(place: str) -> list[str]:
    calls = ",".join(["%file", *sorted(_TOLD | _BY_HANDLE | _STEPS)])
    program = shutil.which("strace") or "strace"
    return [program, "-f", "--seccomp-bpf", "-y", "-q", "-e", "signal=none", "-e", f"trace={calls}", "-o", place]


class Trace:
    """The trace of one process and all that it starts. It lies in memory: on a disk that is full for a while it would
    have gaps, and nobody could tell."""

    def __init__(self) -> None:
        handle = os.memfd_create("avow-trace")
        self._place = f"/proc/{os.getpid()}/fd/{handle}"
        self._file = os.fdopen(handle, "rb")
        self.mark = f"/avow-{secrets.token_hex(8)}"
        """The process looks at ``<mark>-begin`` and ``<mark>-end``: what it asks for in between is its subject's."""

    def around(self, command: Sequence[str]) -> list[str]:
        return [*_strace(self._place), *command]

    def read(self, folder: Path, scratch: str) -> Traced | None:
        """What was asked for by a process that began in `folder`; None where the trace has no end: then nobody knows.
        Said once. What lies in `scratch` is the subject's own."""
        with self._file as file:
            lines = list(_whole(file.read().split(b"\n")))
        return _read(lines, self.mark, str(folder), scratch)

    def read_all(self, program: str, folder: Path) -> tuple[tuple[str, str], ...] | None:
        """As `read`, of a trusted tool, from the start of its program: what it asked for, but for what it made itself
        and what the machine is (``/proc``, devices). Said once."""
        with self._file as file:
            lines = list(_whole(file.read().split(b"\n")))
        begins = (k for k, (_, line) in enumerate(lines) if line.startswith(b"execve(") and _names(line, program))
        begin = next(begins, None)
        if begin is None or (lines[begin][0], b"") not in lines[begin:]:  # the program's own end, not of what it starts
            return None
        return _looked_at(lines[begin:], str(folder))


class _Places:
    """The folder that each process is in. A started one begins in that of who started it; whatever a line says of it
    (``AT_FDCWD</folder>``) is so."""

    def __init__(self, lines: Iterable[tuple[int, bytes]], first: int, folder: str) -> None:
        self._now: dict[int, str] = {first: folder}
        self._begins: dict[int, str] = {}
        self._parents: dict[int, int] = {}
        moved: set[int] = set()
        for process, line in lines:
            if line.startswith((b"chdir(", b"fchdir(")):
                moved.add(process)
            elif process not in moved and (said := _FROM.match(line)):
                self._begins.setdefault(process, _text(said[1]))
            elif child := _STARTED.match(line):
                self._parents.setdefault(int(child[1]), process)

    def of(self, process: int) -> str | None:
        """None: nothing tells. Sandboxes count processes otherwise than who watches them."""
        if process not in self._now:
            parent = self._parents.pop(process, None)
            place = self._begins.get(process) or (self.of(parent) if parent is not None else None)
            if place is None:
                return None
            self._now[process] = place
        return self._now[process]

    def see(self, process: int, line: bytes) -> None:
        """The next line: where its process is from now on."""
        if child := _STARTED.match(line):
            self.of(int(child[1]))
        elif said := _FROM.match(line):
            self._now[process] = _text(said[1])
        elif (step := _STEP.match(line)) is not None:
            to = _text(step[1] or step[2])
            at = "" if to[:1] == os.sep else self.of(process)
            if at is not None:
                self._now[process], _ = way(os.path.join(at, to))  # noqa: PTH118


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
        path, left = way(os.path.join(at or "", _text(text)), whole=_goes_into(call, rest))  # noqa: PTH118
        well = b"= -1 " not in rest
        if call in _BOTH:
            old, new = _both(call, line, at or "")
            if well and call not in _LINKS and not own(old):
                events["read", old] = None  # by its new name it is as little made here
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
            pass  # a Java asks whether somebody wants to speak to it
        elif call in _OPENS | _LOOKS:
            # what was made here may be a link; that may be gone when we look
            name = (_opened(rest) if call in _OPENS else None) or os.path.realpath(path) if own(path) else path
            if not own(name):
                kind = "link" if call.startswith("readlink") else "state" if call in _LOOKS else "read"
                events["kind" if kind == "read" and b"O_PATH" in rest and call not in _RUNS else kind, name] = None
            events |= {("kind", place): None for place in left if not own(place)}
    return (*events, *_interpreters(events))


_RUNS = frozenset({"execve", "execveat"})
_JAVA = r"/(\.(java|attach)_pid|hsperfdata_[^/]+/)%d$"
_OPENED = re.compile(rb"\) = \d+<(/(?:[^>\\]|\\.)*)>$")


def _opened(rest: bytes) -> str | None:
    """What a call that opens says that it opened, behind all links."""
    found = _OPENED.search(rest.rstrip())
    return _text(found[1]) if found is not None else None


def _names(line: bytes, program: str) -> bool:
    found = _CALL.match(line)
    return found is not None and found[3] is not None and _text(found[3]) == program


_FAILED = b")"
"""How the line of a call ends that failed: ``= -1 ENOENT (No such file or directory)``."""
_CONNECTED = (b"= 0", b"(Operation now in progress)")
_OF_THE_MACHINE = ("/proc/", "/sys/", "/dev/", "/etc/ld.so.cache/", "/etc/ld.so.preload/")


def _whole(lines: Iterable[bytes]) -> Iterator[tuple[int, bytes]]:
    """(process, call), calls that were interrupted by others' joined again, in the order in which they ended; nothing
    where a process ended."""
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


def _goes_into(call: str, rest: bytes) -> bool:
    """Whether it may be a folder from which others are named."""
    return call == "chdir" or b"O_DIRECTORY" in rest or b"O_PATH" in rest


_PATH = re.compile(rb"(?:(?:AT_FDCWD|-?\d+)(?:<((?:[^>\\]|\\.)*)>)?, )?" + _STRING)


def _both(call: str, line: bytes, folder: str) -> list[str]:
    """The two paths of a call."""
    found = [(_text(base) if base else folder, _text(text)) for base, text in _PATH.findall(line)[:2]]
    paths = [way(os.path.join(*pair))[0] for pair in found]  # noqa: PTH118
    if call in _LINKS and len(paths) == 2:
        paths[0], _ = way(os.path.join(os.path.dirname(paths[1]), found[0][1]))  # noqa: PTH118, PTH120
    return paths


def _read(lines: Sequence[tuple[int, bytes]], mark: str, folder: str, scratch: str) -> Traced | None:
    events: dict[tuple[str, str], None] = {}
    faults: dict[str, None] = {}
    begins = (process for process, line in lines if mark.encode() in line)
    places = _Places(lines, next(begins, 0), folder)
    host: int | None = None
    ended = False
    running: set[int] = set()
    started: dict[str, None] = {}
    """What started programs are made of, among what they read."""
    ours: set[int] = set()
    """Processes of the sandbox itself: they were there before the subject."""
    for process, line in lines:
        places.see(process, line)
        if not line:
            running.discard(process)
        found = _CALL.match(line)
        if found is None:
            continue
        if host is None:
            ours.add(process)
        elif not ended and process not in ours:
            running.add(process)
        call, base, text, rest = found[1].decode(), found[2], found[3], found[4]
        if text is not None and _text(text) == f"{mark}-begin" and host is None:
            host = process
            continue
        if host is None:
            continue
        if text is not None and _text(text) == f"{mark}-end":
            ended = ended or process == host
            if running - {host}:
                faults["left processes behind"] = None
        if ended and process == host:
            continue  # it looks whether something is left
        if call in _SIGNALS:
            faults["sends signals"] = None
        elif call in _PROBES:
            faults["looks at another process"] = None
        elif call in _NETWORK:
            if (call == "socket" and b"AF_UNIX" not in line) or (call == "connect" and rest.rstrip().endswith(b"= 0")):
                events["outside", "the network"] = None
        elif call in _OF_SOCKETS:
            if process == host:
                events["outside", "the network"] = None
        elif call in _MACHINE_CALLS:
            if process != host:  # the host's own: `senses`
                events["outside", "the machine"] = None
        elif call in _BOTH:
            for path in _both(call, line, places.of(process) or ""):
                if path != scratch and not path.startswith(scratch + os.sep):
                    faults[f"writes {path}"] = None
        elif text is None and call in _BY_HANDLE:
            path = _text(base or b"")
            if path != scratch and not path.startswith((scratch + os.sep, "/memfd:", "/dev/")):
                faults[f"writes {path or 'a file'}"] = None
        elif text is not None:
            at = _text(base) if base is not None else places.of(process)
            if at is None and text and _text(text)[:1] != os.sep:
                events[_NOWHERE] = None
                continue
            path, left = way(os.path.join(at or "", _text(text)), whole=_goes_into(call, rest))  # noqa: PTH118
            if path == scratch or path.startswith(scratch + os.sep):
                continue
            events |= {("kind", place): None for place in left if process != host}  # the host's own: the audit hook
            if call in ("chdir", "fchdir"):
                pass
            elif call in _CHANGES or (call in _OPENS and _WRITES.search(rest)):
                if not path.startswith(("/dev/null", "/dev/tty")):
                    faults[f"writes {path}"] = None
            elif (text or call == "execveat") and not f"{path}/".startswith(_MACHINE):
                if call in _OPENS:
                    events["read", path] = None
                    if process != host and not rest.rstrip().endswith(_FAILED):
                        started[path] = None
                elif call in _LOOKS and process != host:  # the host's own: the audit hook
                    events["state", path] = None
    asked = (("outside", f"{what} ({os.path.basename(path)})") for path in started for what in _asks(path))  # noqa: PTH119
    return Traced((*events, *_interpreters(events), *asked), tuple(faults)) if ended else None


def _interpreters(events: Iterable[tuple[str, str]]) -> Iterator[tuple[str, str]]:
    """The programs that the kernel starts for scripts: no call tells of them."""
    for event, path in events:
        if event == "read" and os.access(path, os.X_OK) and Path(path).is_file():
            with open(path, "rb") as file:  # noqa: PTH123
                first = file.readline(200)
            if first.startswith(b"#!"):
                yield "read", os.fsdecode(first[2:].split()[0]) if first[2:].split() else path


def _text(quoted: bytes) -> str:
    """A string as strace writes it, as Python writes it."""
    raw, _ = codecs.escape_decode(quoted)
    return os.fsdecode(raw)


# -- what machine code asks without a call of the system, by the names that it takes from libraries --------------------

# The kernel hands the clock out without being asked, and so no trace tells who read it.

_NAMES_TAKEN = {
    "the clock": "clock_gettime gettimeofday time ftime timespec_get clock getrusage "
    "_ZNSt6chrono3_V212system_clock3nowEv _ZNSt6chrono3_V212steady_clock3nowEv",
    "random numbers": "getrandom getentropy arc4random arc4random_buf arc4random_uniform "
    "_ZNSt13random_device9_M_getvalEv",
}
_ASKED = {name: what for what, names in _NAMES_TAKEN.items() for name in names.split()}
_OF_THE_SYSTEM = (
    "libc.so",
    "libc-",
    "ld-linux",
    "ld-musl",
    "libm.so",
    "libpthread.so",
    "libdl.so",
    "librt.so",
    "libstdc++.so",
)
"""Libraries that have such functions for others, and use none for themselves."""

_SECTIONS = 0x28
"""Where a file of 64 bits says where its table of sections is."""


def _asks(path: str) -> tuple[str, ...]:
    """What the program or library can ask for so; what it is, where it does not say which names it takes (a static
    program). Nothing for what is no machine code of 64 bits, or is not there."""
    file = Path(path)
    if file.name.startswith(_OF_THE_SYSTEM):
        return ()
    try:
        data = read_regular(file)
    except OSError:
        return ()
    if data[:6] != b"\x7fELF\x02\x01":
        return ("what only it knows",) if data[:4] == b"\x7fELF" else ()
    try:
        names = _taken(data)
    except (struct.error, IndexError):
        names = None
    return ("what only it knows",) if names is None else tuple(sorted({_ASKED[n] for n in names if n in _ASKED}))


def _taken(data: bytes) -> set[str] | None:
    """The names that it takes from others; None where it has no list of them. Raises struct.error, IndexError."""
    (table,) = struct.unpack_from("<Q", data, _SECTIONS)
    size, count = struct.unpack_from("<HH", data, 0x3A)
    sections = [struct.unpack_from("<IIQQQQII", data, table + k * size) for k in range(count)]
    for _, kind, _, _, at, length, link, _ in sections:
        if kind != 11:  # SHT_DYNSYM
            continue
        strings = sections[link][4]
        found = set()
        for place in range(at, at + length, 24):
            name, _, _, section = struct.unpack_from("<IBBH", data, place)
            if section == 0 and name:
                found.add(data[strings + name : data.index(b"\0", strings + name)].decode("ascii", "replace"))
        return found
    return None
