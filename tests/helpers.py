"""What several areas' tests need: `from helpers import edit`."""

from __future__ import annotations

from pathlib import Path


def edit(path: Path, *pairs: tuple[str, str]) -> None:
    """Replace text in a file; what is to be replaced has to be there, else the test would test nothing."""
    text = path.read_text(encoding="utf-8")
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, encoding="utf-8")


def alive(pid: int) -> bool:
    """Whether a process runs: a zombie does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
