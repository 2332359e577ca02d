"""Atomic writes of files, and their digests; paths that stay in a folder; and identities that show whether a file is
unchanged."""

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

from avow.base.tuning.running import SETTLED_NS

PART = ".part"
"""Suffix of a file that is still being written; one that remains was left by a killed process."""


def sha256(data: bytes | str) -> str:
    """SHA-256, in hexadecimal."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file's bytes. Raises OSError, also for a device or a pipe, which may have no end."""
    _must_be_regular(path)
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def read_regular(path: Path) -> bytes:
    """A file's bytes. Raises OSError, also for a device or a pipe, which may have no end."""
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
    """An identity that shows whether a file is unchanged: device, inode, size in bytes, times in nanoseconds, the time
    of its last change (ctime) at the end. That time cannot be set back. If the file system does not guarantee this, or
    counts whole seconds only and the change was recent, the content itself is read. Raises OSError."""
    # once the second is over, no later change has the same time: files from an unpacked image are like this
    told = info.st_ctime_ns % 1_000_000_000 or time.time_ns() - info.st_ctime_ns > SETTLED_NS
    true = told and keeps_changes(os.fspath(path), info.st_dev)
    content = "" if true else _content(os.fspath(path), info.st_mode)
    return info.st_dev, info.st_ino, info.st_size, content, info.st_mtime_ns, info.st_ctime_ns


def _content(path: str, mode: int) -> str:
    """The digest of the names in a folder."""
    if stat.S_ISDIR(mode):
        return sha256("\0".join(sorted(os.listdir(path))).encode("utf-8", "surrogateescape"))  # noqa: PTH208
    return digest_file(Path(path)) if stat.S_ISREG(mode) else ""


@functools.lru_cache(maxsize=100_000)
def _digest_as(path: Path, mark: tuple[int | str, ...]) -> str:
    """A file with the same identity is not read again."""
    return digest_file(path)


def write_out(path: Path, content: str) -> None:
    """Write `content` to the user's path: as `write`, but a device or a pipe is not replaced. Raises OSError, also for
    a folder."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "this is a folder: name a file", str(path))
    if path.exists() and not path.is_file():
        path.write_text(content, "utf-8")
    else:
        write(path, content)


def write(path: Path, content: str | bytes) -> bool:
    """Replace the file, or anything but a folder, by `content` in one step; returns whether that changed anything.
    Raises OSError."""
    data = content.encode() if isinstance(content, str) else content
    if path.is_file() and path.stat().st_size == len(data) and path.read_bytes() == data:
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
    """The absolute path of `text` below `root`, or None if it leads (also by a symbolic link) out of it, or if its name
    is too long for a file."""
    if "\0" in text or not text or Path(text).is_absolute():
        return None
    base = root.resolve()
    try:
        path = (base / text).resolve()
        path.exists()  # raises for a name that is too long, as all later uses of the path would
    except (OSError, RuntimeError, ValueError):
        return None
    return path if path == base or base in path.parents else None


# -- file systems that keep the time of a last change themselves, so that it cannot be set back -------------------

_MOUNTS = Path("/proc/self/mountinfo")
_KEEPING = frozenset({"ext2", "ext3", "ext4", "xfs", "btrfs", "overlay", "zfs", "f2fs", "bcachefs", "jfs"})
"""Those of Linux that do, in ticks of their own clock. FAT has no such time, and many network or shared file systems
(NFS, 9p, FUSE) do not show the current one. In memory (tmpfs, ramfs) writes through a mapping update it only once; on a
disk, once each time that the page is written back."""


def keeps_changes(path: str, device: int) -> bool:
    """Whether the file system of a file (its `st_dev`) does."""
    if device not in _known:
        _known[device] = _kind(os.path.realpath(path)) in _KEEPING
    return _known[device]


_known: dict[int, bool] = {}


def _kind(path: str) -> str:
    """The kind of the innermost mount over a path; empty if unknown."""
    inside = [(len(place), at, kind) for at, (place, kind) in enumerate(_mounts()) if f"{path}/".startswith(place)]
    return max(inside, default=(0, 0, ""))[2]


def _mounts() -> tuple[tuple[str, str], ...]:
    """(folder with a slash, kind of file system), the later over the earlier."""
    try:
        lines = _MOUNTS.read_bytes().splitlines()
    except OSError:  # not Linux
        return ()
    found = []
    for line in lines:
        words, _, rest = line.partition(b" - ")
        place = re.sub(rb"\\([0-7]{3})", lambda m: bytes([int(m[1], 8)]), words.split()[4])
        found.append((os.fsdecode(place).rstrip("/") + "/", rest.split()[0].decode()))
    return tuple(found)
