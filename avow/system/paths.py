"""Paths that a plan names stay inside the system's folder."""

from __future__ import annotations

from pathlib import Path


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
