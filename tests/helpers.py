"""What several areas' tests need: `from helpers import edit`."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from _pytest.mark import ParameterSet


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


def some(cases: Iterable[Any], always: int) -> list[Any]:
    """Parameters of a test: so many of them, evenly spread, run always, and the others with `-m nightly`."""
    listed = list(cases)
    chosen = {k * len(listed) // always for k in range(always)}
    return [case if k in chosen else _nightly(case) for k, case in enumerate(listed)]


def _nightly(case: Any) -> Any:
    if isinstance(case, ParameterSet):
        return pytest.param(*case.values, marks=[*case.marks, pytest.mark.nightly], id=case.id)
    return pytest.param(*case if isinstance(case, tuple) else (case,), marks=pytest.mark.nightly)
