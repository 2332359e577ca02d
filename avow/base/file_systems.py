"""Which file systems keep the time of a file's last change by themselves, so that nobody can set it back."""

from __future__ import annotations

import os
import re
from pathlib import Path

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
