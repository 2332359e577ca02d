"""The paper's step 1 in the check stage: the plan's account of the ROS graph is held against that graph."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from helpers import edit, some

from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.workspace import Workspace
from avow.pipeline.check import check, is_current
from avow.pipeline.plan_check import diagnostics
from avow.pipeline.workload import Survey, survey
from avow.system.load import load_system

SHIPPED = Path(__file__).parents[2] / "contracts" / "remote_inspection"
GRAPH = "models/rosgraph.dot"


@pytest.fixture
def rover(tmp_path: Path) -> Path:
    target = tmp_path / "contracts" / SHIPPED.name
    shutil.copytree(SHIPPED, target)
    return target


def told(folder: Path) -> list[Diagnostic]:
    return [d for d in diagnostics(load_system(folder)) if d.code == "PLAN127"]


def test_the_shipped_account_is_complete() -> None:
    assert [d.message for d in told(SHIPPED) if d.severity is not Severity.NOTE] == []


@pytest.mark.parametrize(
    ("old", "new", "severity", "message"),
    some(
        [
            ("    rviz: display only\n", "", Severity.WARNING, "nor part of a node of the model: rviz"),
            ("[imu, odometry, amcl]", "[imu, odometry]", Severity.WARNING, "nor part of a node of the model: amcl"),
            ("[imu, odometry, amcl]", "[imu, odometry, amlc]", Severity.ERROR, "'amlc' is not on the ROS graph"),
            (
                "[imu, odometry, amcl]",
                "[imu, odometry, amcl, move_base]",
                Severity.ERROR,
                "belongs to localisation already",
            ),
        ],
        1,
    ),
)
def test_what_goes_missing_is_said(rover: Path, old: str, new: str, severity: Severity, message: str) -> None:
    edit(rover / "plan.yaml", (old, new))
    assert any(d.severity is severity and message in d.message for d in told(rover)), told(rover)


def test_a_graph_that_cannot_be_read_is_an_error_of_the_check(rover: Path) -> None:
    (rover / GRAPH).write_text("once upon a time\n")
    (finding,) = told(rover)
    assert finding.is_error
    assert finding.span is not None
    assert finding.span.file.endswith(GRAPH)


@pytest.mark.slow
def test_another_graph_is_checked_again(rover: Path) -> None:
    workspace = Workspace(rover.parents[1])
    surveyed = survey(rover)
    assert isinstance(surveyed, Survey)
    check(workspace, surveyed)
    assert is_current(workspace, surveyed)
    edit(rover / GRAPH, ("n___rviz [", 'n___extra [label="/extra"]; n___rviz ['))
    assert not is_current(workspace, surveyed)
    edit(rover / "plan.yaml", ("[imu, odometry, amcl]", "[imu, odometry, amlc]"))
    surveyed = survey(rover)
    assert isinstance(surveyed, Survey)
    with pytest.raises(Rejected) as rejected:
        check(workspace, surveyed)
    assert "PLAN127" in {d.code for d in rejected.value.diagnostics}
