"""What a method's check remarks of its input stands beside its answers, unless the plan switches it off."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.backend_kit.protocol import Report
from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.tuning.shown import WARNINGS
from avow.base.verdict import Outcome, Verdict
from avow.base.workspace import Workspace
from avow.pipeline.check import _tell
from avow.pipeline.methods import method_job
from avow.pipeline.worker import remarked
from avow.system.load import load_system

CONTRACT = "node n { inputs( r : REAL ) outputs( b : BOOL ) topics() guarantee( b <=> r > 0 ) }\n"
PLAN = "system: s\ncontract: system.rcl\nnodes:\n  n: {methods: [{hoare: {program: p.imp}}]}\n"
ANSWER = Report((Outcome("s/n/guarantee/G1", Verdict.PROVED, "proved", details={"outline": "…"}),), "z3", "5", ())


@pytest.mark.parametrize("off", ["", "lints_off: [HOARE410]\n"])
def test_warnings_stand_beside_the_answer(tmp_path: Path, off: str) -> None:
    (tmp_path / "system.rcl").write_text(CONTRACT)
    (tmp_path / "plan.yaml").write_text(PLAN + off)
    system = load_system(tmp_path)
    job = method_job(system, system.contract.nodes[0], system.plan.nodes[0].methods[0])
    place = Span(str(tmp_path / "p.imp"), 2, 1, 2, 5)
    warning = Diagnostic("HOARE410", "the program compares with 10", place, Severity.WARNING)
    note = Diagnostic("X1", "a note", None, Severity.NOTE)
    elsewhere = Diagnostic("X2", "elsewhere", Span("/elsewhere/q.imp", 3, 1, 3, 2), Severity.WARNING)
    option = Diagnostic(
        "X3", "an option", Span("", 1, 1, 1, 2), Severity.WARNING
    )  # a job does not know the plan's text
    found = remarked(ANSWER, [warning, note, warning, elsewhere, option], job)
    told = [
        {"code": "HOARE410", "place": "p.imp:2", "message": "the program compares with 10"},
        {"code": "X2", "place": "q.imp:3", "message": "elsewhere"},
        {"code": "X3", "place": "", "message": "an option"},
    ]
    (outcome,) = found.outcomes
    assert outcome.details == {"outline": "…", "remarks": told[1:] if off else told}
    assert outcome.verdict is Verdict.PROVED
    assert remarked(ANSWER, [note], job) == ANSWER


def test_a_run_prints_the_first_warnings_a_line_each_and_no_notes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    place = Span(str(tmp_path / "contracts/s/system.rcl"), 3, 1, 3, 2)
    said = [Diagnostic("RCL408", f"remark {at}\x1b[2J", place, Severity.WARNING) for at in range(WARNINGS + 2)]
    _tell(Workspace(tmp_path), "s", [Diagnostic("MON107", "a note", place, Severity.NOTE), *said])
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == WARNINGS + 1
    assert lines[0].startswith("warning[RCL408]: contracts/s/system.rcl:3: remark 0")
    assert "\x1b" not in lines[0]
    assert lines[-1] == "and 2 more warnings: `avow check s`"
