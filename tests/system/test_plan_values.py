"""What the schema cannot see in a plan: each check is silent where all is well, and says what is wrong where it is."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.system.load import load_bare
from avow.system.plan_file import bare_plan, read_plan

FINDING = "{{obligation: {}, verdict: refuted, reason: r, who: A. Person, date: 2026-01-01, expires: 2030-01-01{}}}"
CONFIRMED = "requirements: {{R: {{text: t, validation: {{who: A. Person, date: {}, sentence: x}}}}}}"
REQUIREMENT = "requirements: {{R: {{text: t, {}}}}}"
BOTH = REQUIREMENT.format("formula: a, temporal: b")


def findings(obligation: str, more: str = "") -> str:
    return f"accepted: [{FINDING.format(obligation, more)}]"


@pytest.mark.parametrize(
    ("good", "wrong", "code", "said"),
    [
        (
            REQUIREMENT.format("formula: a"),
            REQUIREMENT.format("formula: a, temporal: b"),
            "PLAN110",
            "R: either formula",
        ),
        (
            REQUIREMENT.format("temporal: a"),
            REQUIREMENT.format("formula: a, temporal: b"),
            "PLAN110",
            "R: either formula",
        ),
        (CONFIRMED.format("2026-01-01"), CONFIRMED.format("2026-02-30"), "PLAN105", "requirements.R.validation: "),
        (findings('"a/*"', ", matched: [a/b]"), findings("a/b", ", matched: [a/b]"), "PLAN110", "'a/b' has no * or ?"),
        (
            findings("a/b", ", found: 3f09b2c41a7e"),
            findings('"a/?"', ", found: 3f09b2c41a7e"),
            "PLAN110",
            "'a/?' may stand for several",
        ),
        ("subsystems: {s: {system: ../b}}", "subsystems: {s: {system: ../c}}", "PLAN107", "there is no folder '../c'"),
        ("subsystems: {s: {system: ../b}}", "subsystems: {s: {system: ../../b}}", "PLAN108", "holds the system's"),
        ("contract: a.rcl", "contract: b.rcl", "PLAN107", "there is no file 'b.rcl'"),
        ("contract: a.rcl", "contract: ../a/b/a.rcl", "PLAN107", "there is no file '../a/b/a.rcl'"),
        ("messages: [a.rcl]", "messages: [../b]", "PLAN108", "'../b' leads out of the system's folder"),
        ("model: {graph: a.rcl}", "model: {graph: no.dot}", "PLAN107", "there is no file 'no.dot'"),
    ],
)
def test_a_check_of_values_speaks_where_it_should(tmp_path: Path, good: str, wrong: str, code: str, said: str) -> None:
    (tmp_path / "b").mkdir()
    (tmp_path / "a").mkdir()
    (tmp_path / "a/a.rcl").write_text("node a { inputs() outputs() topics() guarantee(TRUE) }")
    plan = tmp_path / "a/plan.yaml"
    plan.write_text(good)
    assert read_plan(plan)[2] == ()
    plan.write_text(wrong)
    (fault,) = read_plan(plan)[2]
    assert fault.code == code
    assert said in fault.message
    assert (fault.hint or "").startswith("copy what it names into a") is ("leads out" in said)
    assert fault.span is not None
    assert fault.span.file == str(plan)


def test_a_plan_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as refused:
        read_plan(tmp_path / "plan.yaml")
    (fault,) = refused.value.diagnostics
    assert fault.code == "PLAN100"
    assert "cannot be read: No such file" in fault.message


def test_the_plan_of_bare_files_stands_beside_them(tmp_path: Path) -> None:
    file = tmp_path / "a.rcl"
    file.write_text("node a { inputs() outputs() topics() guarantee(TRUE) }")
    plan = load_bare((file,)).plan
    assert plan.path == tmp_path / "plan.yaml"
    assert plan.policy.span.file == str(file)
    assert plan.contract_files == (file,)
    assert bare_plan("none", ()).path == Path("plan.yaml")
    assert bare_plan("none", ()).policy.span.file == ""


def test_what_stands_in_a_plan_is_what_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.rcl").write_text("node a { inputs() outputs() topics() guarantee(TRUE) }")
    (tmp_path / "plan.yaml").write_text(
        "compose: {D: {select: [a], rule: R1}}\n"
        "subsystems: {s: {nodes: [a], rule: R2}}\n"
        "connections: [{from: a.x, to: [a.y, a.z], delayed: true, initial: true}]\n"
        "scenario: {t: [{p: 1, q: 2, r: 3}], steps: 7}\n"
    )
    plan, _, wrong = read_plan(tmp_path / "plan.yaml")
    assert wrong == ()
    assert [(g.name, g.select, g.rule) for g in plan.compose] == [("D", ("a",), "R1")]
    assert [(g.name, g.members, g.rule) for g in plan.subsystems] == [("s", ("a",), "R2")]
    assert [(str(c.target), c.delayed, c.initial) for c in plan.connections] == [
        ("a.y", True, "TRUE"),
        ("a.z", True, "TRUE"),
    ]
    assert plan.scenario is not None
    assert plan.scenario.steps == 7
