"""The small public face of Avow, for scripts and notebooks: what stands here keeps its meaning from version to version.

Everything else may move. See `docs/developers/api.md`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.verdict import Verdict
from avow.language.contract import Clause, Contract, Node
from avow.system.plan import System

if TYPE_CHECKING:
    from avow.assurance.model import Case
    from avow.base.verdict import Outcome
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
    "settle",
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
    from avow.pipeline.plan_check import diagnostics

    place = Path(path)
    if not place.is_dir():
        return check_paths([place])[1]
    try:
        return diagnostics(load(place))
    except Rejected as rejected:
        return rejected.diagnostics


def compose(system: System) -> Composition:
    """The system's derivations (`goals`), by the rules R1 to R4; `settle` asks the solver."""
    from avow.calculus.composition import compose

    return compose(system)


def settle(composition: Composition, *, seconds: float = 10.0) -> Mapping[str, Outcome]:
    """What `avow compose` finds of the side conditions and of the requirements that have a formula, by their ids
    (``x/system/requirement/REQ1``). `seconds`: about how long a question may take."""
    from avow.calculus.discharge import Bounds
    from avow.calculus.obligations import all_tasks, settle_each
    from avow.solving.limits import from_seconds

    asked = [task.obligation for task in all_tasks(composition)]
    return {outcome.obligation: outcome for outcome in settle_each(composition, asked, Bounds(from_seconds(seconds)))}


def verify(workspace: Path | str, systems: Sequence[str] = (), *, jobs: int = 2) -> int:
    """`avow verify` in a workspace: every system under contracts/, or those named. The exit code: 0 every gate passes,
    1 one fails, 2 an input is at fault, 3 a needed tool is missing. Changes the current folder to the workspace."""
    from avow.pipeline.tasks import execute

    return execute(Path(workspace), [f"verify:{name}" for name in systems] or ["verify"], jobs)


def read_case(report: Path | str) -> Case:
    """The assurance case of a report: its folder, or its report.json. Raises Rejected."""
    from avow.assurance.codec import read_case

    return read_case(Path(report))
