"""Where things stand: the folder with `contracts/`, `artifacts/` and `reports/` (design: page "The house")."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


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
        """The folders under contracts/ that hold a plan, by name. A folder without one is no system."""
        if not self.contracts.is_dir():
            return ()
        return tuple(sorted(p.parent for p in self.contracts.glob("*/plan.yaml")))

    def relative(self, path: Path) -> str:
        """A path as records and reports show it: relative to the workspace, where it lies within."""
        try:
            return path.resolve().relative_to(self.root.resolve()).as_posix()
        except ValueError:
            return path.as_posix()


def find_workspace(start: Path) -> Workspace | None:
    """The nearest folder at or above `start` that has a `contracts/` and a `dodo.py`."""
    for folder in (start, *start.parents):
        if (folder / "contracts").is_dir() and (folder / "dodo.py").is_file():
            return Workspace(folder)
    return None
