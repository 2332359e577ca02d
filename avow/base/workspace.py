"""Where things stand: the folder with `contracts/`, `artifacts/` and `reports/`; which one a command works in."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.records import dataclass
from avow.base.suggestions import suggest

_ON_DEMAND = {
    "gsn": ("gsn.yaml", "gsn.svg"),
    "pdf": ("report.pdf",),
    "qualification": ("qualification.html",),
    "sacm": ("sacm.xml",),
    "sarif": ("report.sarif",),
    "traceability": ("traceability.html", "traceability.csv", "traceability.reqif"),
}
WRITTEN_ON_DEMAND = tuple(name for names in _ON_DEMAND.values() for name in names)
ON_DEMAND: Mapping[str, tuple[str, ...]] = {**_ON_DEMAND, "all": WRITTEN_ON_DEMAND}
"""The formats of a report that only `avow report --format` writes, with their files."""


@dataclass(frozen=True, slots=True)
class Workspace:
    """A folder of the prescribed shape."""

    root: Path

    @property
    def contracts(self) -> Path:
        return self.root / "contracts"

    @property
    def artifacts(self) -> Path:
        return self.root / "artifacts"

    @property
    def reports(self) -> Path:
        return self.root / "reports"

    @property
    def signed(self) -> Path:
        """Signatures of cases, a folder a system; kept with the sources."""
        return self.root / "signed"

    @property
    def ledgers(self) -> Path:
        return self.artifacts / "ledger"

    def ledger(self, system: str) -> Path:
        """The system's evidence, one JSON object a line."""
        return self.ledgers / f"{system}.jsonl"

    def node(self, system: str, node: str, method: str) -> Path:
        """What one method generated for one node, and its tools' logs."""
        return self.artifacts / system / node / method

    def report(self, system: str) -> Path:
        return self.reports / system

    def systems(self) -> tuple[Path, ...]:
        """The folders under contracts/ that hold a plan, by name. A folder without one is no system; one whose plan is
        a link that leads nowhere is a system that cannot be read."""
        if not self.contracts.is_dir():
            return ()
        return tuple(sorted(p for p in self.contracts.iterdir() if os.path.lexists(p / "plan.yaml")))

    def stray_plans(self) -> tuple[Path, ...]:
        """The plans under contracts/ that are in no system's folder, one of each folder, and the contracts of folders
        without a plan."""
        held = set(self.systems())
        found = [path for path in plans_within(self.contracts) if held.isdisjoint(path.parents)]
        bare = (p for p in sorted(self.contracts.glob("*/*.rcl")) if p.parent not in held)
        return tuple(({path.parent: path for path in bare} | {path.parent: path for path in found}).values())

    def relative(self, path: Path) -> str:
        """A path as records and reports show it: relative to the workspace, where it lies within."""
        try:
            return path.resolve().relative_to(self.root.resolve()).as_posix()
        except ValueError:
            return path.as_posix()


def plans_within(folder: Path) -> Iterator[Path]:
    """The plans in a folder and those below it, but for hidden folders and what lies behind links. Also what was meant
    to be one (plan.yml, Plan.yaml): no run reads it."""
    for place, names, files in os.walk(folder):
        names[:] = sorted(name for name in names if not name.startswith("."))
        yield from (Path(place, file) for file in sorted(files) if file.lower() in ("plan.yaml", "plan.yml"))


def find_workspace(start: Path) -> Workspace | None:
    """The nearest folder at or above `start` that has a `contracts/` and a `dodo.py`."""
    for folder in (start, *start.parents):
        if (folder / "contracts").is_dir() and (folder / "dodo.py").is_file():
            return Workspace(folder)
    return None


def workspace() -> Workspace:
    """The folder with contracts/ and dodo.py, at or above the current one. Raises Rejected."""
    place = Path.cwd().resolve()
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


def named_folder(path: Path) -> Path | None:
    """The folder of the system that is given by its folder, its plan, or its name in the current workspace; a folder
    here without plan and contract hides no system of its name."""
    if path.name == "plan.yaml" and path.is_file():
        return path.parent
    found = find_workspace(Path.cwd().resolve()) if len(path.parts) == 1 else None
    named = found.contracts / path if found is not None and (found.contracts / path).is_dir() else None
    if path.is_dir() and (named is None or (path / "plan.yaml").is_file() or any(path.glob("*.rcl"))):
        return path
    return named


def system_folder(name: str) -> Path:
    """As `named_folder`. Raises Rejected where there is none."""
    if not name:
        raise Rejected(Diagnostic("CLI002", "the system's name is empty", hint="the current folder is written `.`"))
    folder = named_folder(Path(name))
    if folder is not None:
        return folder
    found = find_workspace(Path.cwd().resolve())
    hint = suggest(*_typed(name, [p.name for p in found.systems()] if found else []))
    raise Rejected(Diagnostic("CLI002", f"there is no system '{name}'", hint=hint or "give its folder"))


def _typed(name: str, known: Iterable[str]) -> tuple[str, list[str]]:
    """What was typed, and the known systems as they would be typed in its place: by name, or by folder."""
    name = str(Path(name).parent) if Path(name).is_file() else name
    above, _, last = name.rstrip("/").rpartition("/")
    return (name.rstrip("/"), [f"{above}/{each}" for each in known]) if above else (last, list(known))


def report_folder(given: Path) -> Path:
    """The folder of a report: as it is given, or by the file in it, or by its system's name, folder or plan."""
    if (given / "report.json").is_file():
        return given
    if given.name == "report.json" and given.is_file():
        return given.parent
    place = find_workspace(Path.cwd().resolve())
    folder = named_folder(given)
    name = folder.resolve().name if folder is not None else given.name
    if place is not None and (folder is not None or len(given.parts) == 1):
        return place.report(name)
    return given


def require_systems(place: Workspace, names: Iterable[str]) -> tuple[str, ...]:
    """The systems' names, each given as its name or its folder. Raises Rejected for one that is not there."""
    known = [p.name for p in place.systems()]
    found = tuple(name_of(place, name) for name in names)
    for name in found:
        if name not in known:
            hint = f"write its plan.yaml in {place.contracts / name}" if (place.contracts / name).is_dir() else None
            hint = hint or suggest(*_typed(name, known))
            raise Rejected(Diagnostic("CLI002", f"there is no system '{name}'", hint=hint))
    return found


def name_of(place: Workspace, name: str) -> str:
    """A system's name, where its folder in ``contracts/`` may be given; anything else as it stands."""
    path = Path(name)
    folder = path.parent if path.name == "plan.yaml" else path
    inside = folder.is_dir() and folder.resolve().parent == place.contracts.resolve()
    return folder.resolve().name if inside else name
