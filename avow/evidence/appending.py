"""Append-only files written by several processes at once: under a lock, each piece whole or not at all, synced."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def locked(path: Path) -> Iterator[int]:
    """The open file, created if it is missing, locked for this process alone. Raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    file = open_file(str(path), os.O_RDWR | os.O_APPEND | os.O_CREAT)
    try:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield file
    finally:
        os.close(file)  # releases the lock


def open_file(path: str, flags: int) -> int:
    """Opens only a regular file: a pipe in its place would block without limit."""
    file = os.open(path, flags | os.O_NONBLOCK, 0o644)
    if not stat.S_ISREG(os.fstat(file).st_mode):
        os.close(file)
        raise OSError(errno.EINVAL, "not a regular file", path)
    return file


def drop_half_line(file: int) -> None:
    """Remove what a killed run left behind the last end of a line, so that the chain continues after that line."""
    end = os.fstat(file).st_size
    while end and os.pread(file, 1, end - 1) != b"\n":
        end -= 1
    os.ftruncate(file, end)


def append(file: int, data: bytes) -> None:
    """Append `data`. Raises OSError: then nothing was added."""
    size = os.fstat(file).st_size
    try:
        done = 0
        while done < len(data):
            done += os.write(file, data[done:])
        os.fsync(file)
    except BaseException:
        os.ftruncate(file, size)  # a reader never sees half of it; if even this fails, the next append repairs it
        raise
