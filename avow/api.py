"""The small public face of Avow, for scripts and notebooks: what stands here keeps its meaning from version to version.

Everything else may move. See `docs/api.md`.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.verdict import Verdict
from avow.language.contract import Clause, Contract, Node
from avow.system.plan import System

if TYPE_CHECKING:
    from avow.assurance.model import Case
    from avow.calculus.composition import Composition

__all__ = [
    "Clause",
    "Contract",
    "Diagnostic",
    "Node",
    "Rejected",
    "Severity",
    "Span",
    "System",
    "Verdict",
    "check",
    "compose",
    "load",
    "read_case",
    "verify",
]


def load(path: Path | str) -> System:
    """A system: the folder of its plan.yaml, a folder of .rcl files, or one .rcl file. Raises Rejected with all that is
    wrong."""
    from avow.system.load import load_path

    return load_path(Path(path))


def check(path: Path | str) -> tuple[Diagnostic, ...]:
    """All that there is to say of a system before any solver is asked: errors and warnings, as `avow check` has them
    and, for a folder with a plan, what each backend says of its options."""
    from avow.language.load import check_paths
    from avow.pipeline.check import diagnostics

    place = Path(path)
    if not place.is_dir():
        return check_paths([place])[1]
    try:
        return diagnostics(load(place))
    except Rejected as rejected:
        return rejected.diagnostics


def compose(system: System) -> Composition:
    """The system's derivations (`goals`), by the rules R1 to R4; `stands(goal, Bounds())` asks the solver."""
    from avow.calculus.composition import compose

    return compose(system)


def verify(workspace: Path | str, systems: Sequence[str] = (), *, jobs: int = 2) -> int:
    """`avow verify` in a workspace: every system under contracts/, or those named. The exit code: 0 every gate passes,
    1 one fails, 2 an input is at fault, 3 a needed tool is missing. Changes the current folder to the workspace."""
    from avow.pipeline.tasks import execute

    return execute(Path(workspace), [f"verify:{name}" for name in systems] or ["verify"], jobs)


def read_case(report: Path | str) -> Case:
    """The assurance case of a report: its folder, or its report.json. Raises Rejected."""
    from avow.assurance.codec import read_case

    return read_case(Path(report))
