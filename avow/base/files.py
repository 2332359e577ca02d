"""Files, written so that a reader never sees half of one, and their digests; paths that stay in a folder; and by what
it is known that a file is as it was."""

from __future__ import annotations

import errno
import functools
import hashlib
import os
import re
import stat
import tempfile
import time
from pathlib import Path

from avow.base.tuning.running import READER_SECONDS, SETTLED_NS

PART = ".part"
"""How the name of a file ends that is still being written; one that stays was left by a killed process."""


def sha256(data: bytes | str) -> str:
    """SHA-256, in hexadecimal."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file's bytes. Raises OSError, also for what is no file and might have no end (a device, a pipe)."""
    _must_be_regular(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_regular(path: Path) -> bytes:
    """A file's bytes. Raises OSError, also for what is no file and might have no end (a device, a pipe)."""
    _must_be_regular(path)
    return path.read_bytes()


def read_text(path: Path, encoding: str = "utf-8", errors: str = "strict") -> str:
    """A file's text, its line ends as `\\n`. Raises OSError as `read_regular`, and UnicodeDecodeError."""
    _must_be_regular(path)
    return path.read_text(encoding, errors)


def _must_be_regular(path: Path) -> None:
    mode = path.stat().st_mode
    if not stat.S_ISREG(mode) and not stat.S_ISDIR(mode):  # opening a folder fails by itself
        raise OSError(errno.EINVAL, "not a regular file", str(path))


def is_intact(path: Path, sha: str) -> bool:
    """Whether the file is there and has this SHA-256."""
    try:
        return digest_once(path) == sha
    except OSError:
        return False


def text_or_nothing(path: Path) -> str:
    """A file's text, whatever its bytes; empty where there is nothing to read."""
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError:
        return ""


def digest_or_missing(path: Path) -> str:
    """As `digest_file`; ``missing`` where there is nothing to read."""
    try:
        return digest_file(path)
    except OSError:
        return "missing"


def digest_once(path: Path) -> str:
    """As `digest_file`; a file that this process has read is not read again while it is the same."""
    return _digest_as(path, identity(path.stat(), path))


def identity(info: os.stat_result, path: str | Path) -> tuple[int | str, ...]:
    """What tells that a file is as it was a moment ago: its place on the disk, size in bytes, times in nanoseconds, the
    time of its last change at the end. That time cannot be set back; where it can, or counts whole seconds only and was
    a moment ago, the content itself is looked at. Raises OSError."""
    # once whole seconds are over, no later change has the same time: so lies what an image was unpacked from
    told = info.st_ctime_ns % 1_000_000_000 or time.time_ns() - info.st_ctime_ns > SETTLED_NS
    true = told and keeps_changes(os.fspath(path), info.st_dev)
    content = "" if true else _content(os.fspath(path), info.st_mode)
    return info.st_dev, info.st_ino, info.st_size, content, info.st_mtime_ns, info.st_ctime_ns


def _content(path: str, mode: int) -> str:
    """Of a folder, the names in it."""
    if stat.S_ISDIR(mode):
        return sha256("\0".join(sorted(os.listdir(path))).encode("utf-8", "surrogateescape"))  # noqa: PTH208
    return digest_file(Path(path)) if stat.S_ISREG(mode) else ""


@functools.lru_cache(maxsize=100_000)
def _digest_as(path: Path, mark: tuple[int | str, ...]) -> str:
    """A file that is as it was a moment ago is not read again."""
    return digest_file(path)


def _open_special(path: Path) -> int:
    """A device or a pipe, open for writing. A pipe that nobody reads within `READER_SECONDS` is an error, not a wait:
    whoever reads it (`-o >(less)`) may open it a moment later than we do."""
    end = time.monotonic() + READER_SECONDS
    while True:
        try:
            return os.open(path, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as error:
            if error.errno != errno.ENXIO or time.monotonic() > end:
                raise
            time.sleep(0.01)


def write_out(path: Path, content: str) -> None:
    """Put `content` where the user asked for it: as `write`, but a device or a pipe is written to, and stays what it
    is. Raises OSError."""
    if path.exists() and not path.is_file() and not path.is_dir():
        descriptor = _open_special(path)
        os.set_blocking(descriptor, True)
        with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
            stream.write(content)
    else:
        write(path, content)


def write(path: Path, content: str | bytes) -> bool:
    """Put `content` in place of the file in one step, whatever stands there but a folder; says whether that changed
    anything. Raises OSError."""
    data = content.encode() if isinstance(content, str) else content
    if path.is_file() and path.read_bytes() == data:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=PART)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(name).chmod(0o644)
        os.replace(name, path)  # noqa: PTH105 - the point is its atomicity
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return True


def inside(root: Path, text: str) -> Path | None:
    """The absolute path of `text` below `root`, or None where it leads (also by a symbolic link) out of it, or where no
    file can have such a path (its name is too long)."""
    if "\0" in text or not text or Path(text).is_absolute():
        return None
    base = root.resolve()
    try:
        path = (base / text).resolve()
        path.exists()  # raises for a name that is too long, where all later looks at the path would
    except (OSError, RuntimeError, ValueError):
        return None
    return path if path == base or base in path.parents else None


# -- which file systems keep the time of a last change by themselves, so that nobody can set it back -------------------

_MOUNTS = Path("/proc/self/mountinfo")
_KEEPING = frozenset({"ext2", "ext3", "ext4", "xfs", "btrfs", "overlay", "zfs", "f2fs", "bcachefs", "jfs"})
"""Those of Linux that do, by their own clock's ticks. FAT has no such time, nor do many ways to somebody else's files
(NFS, 9p, FUSE) show it as it is now. In memory (tmpfs, ramfs) what a process writes through a mapping moves it once and
never again; on a disk, once for each time that the page is written back."""


def keeps_changes(path: str, device: int) -> bool:
    """Whether the file system on which a file lies (its `st_dev`) does."""
    if device not in _known:
        _known[device] = _kind(os.path.realpath(path)) in _KEEPING
    return _known[device]


_known: dict[int, bool] = {}


def _kind(path: str) -> str:
    """What the innermost mount over a path is; empty where nobody says."""
    inside = [(len(place), at, kind) for at, (place, kind) in enumerate(_mounts()) if f"{path}/".startswith(place)]
    return max(inside, default=(0, 0, ""))[2]


def _mounts() -> tuple[tuple[str, str], ...]:
    """(folder with a slash, kind of file system), the later over the earlier."""
    try:
        lines = _MOUNTS.read_bytes().splitlines()
    except OSError:  # no Linux
        return ()
    found = []
    for line in lines:
        words, _, rest = line.partition(b" - ")
        place = re.sub(rb"\\([0-7]{3})", lambda m: bytes([int(m[1], 8)]), words.split()[4])
        found.append((os.fsdecode(place).rstrip("/") + "/", rest.split()[0].decode()))
    return tuple(found)
