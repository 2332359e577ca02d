"""The name that was most likely meant by an unknown one, as the hint of a diagnostic."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path


def nearest(name: str, known: Iterable[str], most: int = 1, *, alike: float = 0.65) -> list[str]:
    """The known names nearest to an unknown one, if any are near: the one that differs in case only, else up to so
    many. `alike`: the least similarity, as in `difflib`."""
    import difflib  # rarely needed and slow to import

    if len(name) > 100:
        return []
    candidates = sorted({k for k in known if k != name})
    folded = name.casefold()
    same = [k for k in candidates if k.casefold() == folded]
    return same[:1] or difflib.get_close_matches(name, candidates[:2000], most, alike)


def did_you_mean(name: str, known: Iterable[str], most: int = 1) -> str | None:
    """A hint; None if no name is near. Many short names differ by one letter."""
    return _hint(nearest(name, known, most, alike=0.65 if len(name) > 3 else 0.75))


def suggest(name: str, known: Iterable[str]) -> str | None:
    """A hint: the nearest known name, else what is known."""
    names = list(known)
    if not names:
        return None
    shown = ", ".join(names[:12]) + (", …" if len(names) > 12 else "")
    return _hint(nearest(name, names)) or f"known: {shown}"


def nearby(path: Path, written: str = "") -> str | None:
    """A hint for a path that does not exist: what is beside it, if a name is near, as it would be `written` in place of
    the path. Never raises."""
    above = written.rpartition("/")[0] if written else "" if path.is_absolute() else str(path.parent)
    beside = [each.name for each in path.parent.iterdir()] if path.parent.is_dir() else []
    near = nearest(path.name, beside, alike=0.65 if len(path.name) > 3 else 0.75)
    return _hint([str(Path(above, name)) for name in near])


def _hint(near: list[str]) -> str | None:
    return f"did you mean {' or '.join(f'`{each}`' for each in near)}?" if near else None


def distance(one: str, other: str, limit: int) -> int:
    """How many letters to insert, delete, change or swap with the next; more than `limit` is not counted exactly."""
    if abs(len(one) - len(other)) > limit:
        return limit + 1
    before: list[int] = []
    row = list(range(len(other) + 1))
    for i, a in enumerate(one, 1):
        older, before, row = before, row, [i]
        for j, b in enumerate(other, 1):
            cost = min(before[j] + 1, row[j - 1] + 1, before[j - 1] + (a != b))
            if i > 1 and j > 1 and a == other[j - 2] and one[i - 2] == b:
                cost = min(cost, older[j - 2] + 1)
            row.append(cost)
    return row[-1]
