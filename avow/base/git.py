"""Queries to git about a folder that execute nothing from that folder.

A repository's own settings name programs: filters for checkout and archive, hooks, pagers, remote helpers. So this
module uses only commands that run none of them, and fetches nothing.
"""

from __future__ import annotations

import os
import stat
import subprocess
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
    listed = _ask(folder, "ls-tree", "-r", "-z", revision, part)
    rows = [row.partition(b"\t") for row in listed.split(b"\0") if row]
    found = [(about.split(), target / os.fsdecode(path)) for about, _, path in rows]
    blobs = [(int(about[0], 8), about[2], path) for about, path in found if about[1] == b"blob"]
    if any(".." in path.parts for _, _, path in blobs):
        raise GitFailed(f"{revision} has files outside of its folder")
    told = _ask(folder, "cat-file", "--batch", said=b"".join(digest + b"\n" for _, digest, _ in blobs))
    contents: list[tuple[int, Path, bytes]] = []
    for mode, _, path in blobs:
        header, _, told = told.partition(b"\n")
        if len(header.split()) != 3:
            raise GitFailed(header.decode(errors="replace"))
        size = int(header.split()[2])
        contents.append((mode, path, told[:size]))
        told = told[size + 1 :]
    for mode, path, content in sorted(
        contents, key=lambda c: stat.S_ISLNK(c[0])
    ):  # through no link anything is written
        path.parent.mkdir(parents=True, exist_ok=True)
        if stat.S_ISLNK(mode):
            path.symlink_to(os.fsdecode(content))
        else:
            path.write_bytes(content)


def _ask(folder: Path, *words: str, said: bytes = b"", seconds: float = 60) -> bytes:
    command = ["git", "-C", str(folder), *words]
    try:
        done = subprocess.run(
            command, input=said, capture_output=True, timeout=seconds, check=False, env={**os.environ, **_ALONE}
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise GitFailed(f"git cannot be asked: {error}") from None
    if done.returncode:
        lines = done.stderr.decode(errors="replace").strip().splitlines()
        raise GitFailed(lines[-1] if lines else "git failed")
    return done.stdout
