"""Files, written so that a reader never sees half of one, and their digests."""

from __future__ import annotations

import hashlib
import os
import tempfile
from pathlib import Path


def digest(data: bytes | str) -> str:
    """SHA-256, in hexadecimal."""
    return hashlib.sha256(data.encode() if isinstance(data, str) else data).hexdigest()


def digest_file(path: Path) -> str:
    """SHA-256 of a file's bytes. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_intact(path: Path, sha: str) -> bool:
    """Whether the file is there and has this SHA-256."""
    try:
        return digest_file(path) == sha
    except OSError:
        return False


def write(path: Path, content: str | bytes) -> bool:
    """Put `content` in place of the file in one step; says whether that changed anything."""
    data = content.encode() if isinstance(content, str) else content
    if path.is_file() and path.read_bytes() == data:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        Path(name).chmod(0o644)
        os.replace(name, path)  # noqa: PTH105 - the point is its atomicity
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise
    return True
