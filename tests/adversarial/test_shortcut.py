"""What was edited while a run was under way is not taken for verified by the next."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.workspace import Workspace
from avow.pipeline.results import Result
from avow.pipeline.shortcut import Shortcut

from .test_exit_codes import run

DONE = Result("s", 0, {"proved": 1}, "reports/s/index.html", ())


def system(workspace: Path) -> Path:
    folder = workspace / "contracts" / "s"
    folder.mkdir()
    (workspace / "artifacts").mkdir()
    (workspace / "reports").mkdir()
    (folder / "plan.yaml").write_text("system: s\n")
    (folder / "system.rcl").write_text("node n { inputs() outputs(b : BOOL) topics() guarantee(out.b) }")
    return folder


def test_an_edit_during_the_run_is_not_kept_as_settled(workspace: Path) -> None:
    contract, shortcut = system(workspace) / "system.rcl", Shortcut(Workspace(workspace))
    assert shortcut.nothing_to_do(("verify",)) is None
    contract.write_text(contract.read_text().replace("out.b", "not out.b"))
    shortcut.keep((DONE,))
    assert shortcut.nothing_to_do(("verify",)) is None


def test_what_stood_still_is_kept(workspace: Path) -> None:
    contract, shortcut = system(workspace) / "system.rcl", Shortcut(Workspace(workspace))
    assert shortcut.nothing_to_do(("verify",)) is None
    (workspace / "artifacts" / "made").write_text("by the run")
    shortcut.keep((DONE,))
    assert Shortcut(Workspace(workspace)).nothing_to_do(("verify",)) == (DONE,)
    contract.write_text(contract.read_text() + "\n")
    assert shortcut.nothing_to_do(("verify",)) is None


@pytest.mark.slow
def test_a_memory_of_doit_that_was_half_written(workspace: Path) -> None:
    """A full disk, or a kill at the wrong moment, must not keep the next run from starting."""
    system(workspace)
    (workspace / "artifacts" / ".doit.json").write_text('{"check:s": {"_val')
    code, text = run(workspace, "doit", "check")
    assert code == 0, text
