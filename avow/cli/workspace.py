"""The workspace that a command works in."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.workspace import Workspace, find_workspace


def workspace(start: Path | None = None) -> Workspace:
    """The folder with contracts/ and dodo.py, at or above the current one. Raises Rejected."""
    place = (start or Path.cwd()).resolve()
    found = find_workspace(place)
    if found is None:
        raise Rejected(
            Diagnostic(
                "CLI001",
                f"{place} is in no Avow workspace: no folder here or above has a contracts/ and a dodo.py",
                hint="`avow init DIR` makes one",
            )
        )
    return found


def system_folder(name: str) -> Path:
    """A system by its folder, or by its name in the current workspace. Raises Rejected."""
    if not name:
        raise Rejected(Diagnostic("CLI002", "the system's name is empty", hint="the current folder is written `.`"))
    path = Path(name)
    if path.is_dir():
        return path
    found = find_workspace(Path.cwd().resolve())
    if found is not None and (found.contracts / name).is_dir():
        return found.contracts / name
    known = ", ".join(p.name for p in found.systems()) if found else ""
    raise Rejected(
        Diagnostic(
            "CLI002", f"there is no system '{name}'", hint=f"known here: {known}" if known else "give its folder"
        )
    )


def require_systems(place: Workspace, names: Iterable[str]) -> None:
    """Raises Rejected for a name that no system of the workspace has."""
    known = [p.name for p in place.systems()]
    for name in names:
        if name not in known:
            raise Rejected(Diagnostic("CLI002", f"there is no system '{name}'", hint=f"known: {', '.join(known)}"))
