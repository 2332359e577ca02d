"""Queries to git about a folder. They fetch nothing, and run no hook."""

from __future__ import annotations

import io
import os
import subprocess
import tarfile
from pathlib import Path

_ALONE = {"GIT_ALLOW_PROTOCOL": "none", "GIT_NO_LAZY_FETCH": "1", "GIT_OPTIONAL_LOCKS": "0", "GIT_TERMINAL_PROMPT": "0"}


class GitFailed(Exception):  # noqa: N818 - it says what happened
    """Git is missing, timed out, or failed; the message is its own last line."""


def head(folder: Path) -> str:
    """The folder's revision, abbreviated; empty if it is not under git."""
    try:
        return _ask(folder, "rev-parse", "--short=12", "HEAD", seconds=5).decode(errors="replace").strip()
    except GitFailed:
        return ""


def write_files(folder: Path, revision: str, part: str, target: Path) -> None:
    """The files of a revision under `part` of the folder, written below `target`. Raises GitFailed, OSError."""
    if revision.startswith("-"):
        raise GitFailed(f"{revision} is no revision")
    archive = _ask(folder, "archive", "--format=tar", revision, "--", part)
    try:
        with tarfile.open(fileobj=io.BytesIO(archive)) as files:
            files.extractall(target, filter="data")
    except tarfile.TarError as error:
        raise GitFailed(f"{revision} cannot be written: {error}") from None


def _ask(folder: Path, *words: str, seconds: float = 60) -> bytes:
    command = ["git", "-C", str(folder), *words]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=seconds,
            check=False,
            env={**os.environ, **_ALONE},
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise GitFailed(f"git cannot be asked: {error}") from None
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise GitFailed(lines[-1] if lines else "git failed")
    return done.stdout
