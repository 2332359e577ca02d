"""Other systems' folders as nodes of a plan: nothing is copied, and what they assume is shown where they are fed."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.calculus.composition import compose
from avow.system.load import load_system

from .make import make, node, outcomes
from .test_hierarchy import CONTEXT, GRADER, READER, SINK, SOURCE
from .test_subsystems import verdict


def folder_of(root: Path, name: str, text: str, plan: str = "{}") -> Path:
    make(root / name, text, plan)
    return root / name


def test_another_systems_folder_is_a_node(tmp_path: Path) -> None:
    folder_of(tmp_path, "sensor", CONTEXT + READER + GRADER)
    robot = folder_of(tmp_path, "robot", SOURCE + CONTEXT + SINK, "subsystems: {front: {system: ../sensor}}")
    composition = compose(load_system(robot))
    assert composition.outermost == ("source", "sink", "front")
    assert composition.goal("front").nodes == ("front_reader", "front_grader")
    assert verdict(composition) is Verdict.PROVED
    found = outcomes(load_system(robot))
    assert found["whole.front.front_reader.sane"].verdict is Verdict.PROVED
    assert [p.parent.name for p in load_system(robot).plan.included] == ["sensor", "sensor"]
    # an edit there is seen here at once: nothing is copied
    (tmp_path / "sensor/system.rcl").write_text(CONTEXT + READER + GRADER.replace("> 4", "> 3"))
    assert outcomes(load_system(robot))["whole.sink.calm"].verdict is Verdict.REFUTED


def test_one_folder_twice_and_systems_within_systems(tmp_path: Path) -> None:
    """Each copy has inputs of its own: that both are called raw does not make them one."""
    folder_of(tmp_path, "sensor", node("reader", "raw : INTEGER", "value : INTEGER", "G: out.value == in.raw"))
    pair = "subsystems: {left: {system: ../sensor}, right: {system: ../sensor}}\nconnections:\n"
    pair += "  - {from: left.value, to: compare.a}\n  - {from: right.value, to: compare.b}"
    compare = node("compare", "a : INTEGER, b : INTEGER", "same : BOOL", "G: out.same <=> in.a == in.b")
    folder_of(tmp_path, "pair", compare, pair)
    sink = node("sink", "same : BOOL", "", "A: in.same")
    top = folder_of(tmp_path, "top", sink, "subsystems: {both: {system: ../pair}}")
    composition = compose(load_system(top))
    assert [goal.name for goal in composition.goals] == ["both_left", "both_right", "both", "whole"]
    assert verdict(composition) is Verdict.REFUTED
    shared = "subsystems: {both: {system: ../pair}}\nenvironment: {in.raw: {because: one wire}}"
    assert verdict(compose(load_system(folder_of(tmp_path, "wired", sink, shared)))) is Verdict.PROVED


def test_what_another_system_assumes_of_its_environment_is_shown_here_once_it_is_fed(tmp_path: Path) -> None:
    there = 'environment: {in.raw: {assume: "0 <= in.raw and in.raw <= 10", because: "a 10 V supply"}}'
    folder_of(tmp_path, "sensor", CONTEXT + READER + GRADER, there)
    open_ = folder_of(tmp_path, "open", SINK + CONTEXT, "subsystems: {s: {system: ../sensor}}")
    found = outcomes(load_system(open_))
    assert found["environment.s.raw"].verdict is Verdict.JUSTIFIED
    assert found["s.s_reader.sane"].verdict is Verdict.PROVED
    fed = folder_of(tmp_path, "fed", SOURCE.replace("<= 8", "<= 11") + CONTEXT, "subsystems: {s: {system: ../sensor}}")
    found = outcomes(load_system(fed))
    assert "environment.s.raw" not in found
    assert found["whole.s.s_reader.sane"].verdict is Verdict.REFUTED


def test_bad_inclusions_are_located(tmp_path: Path) -> None:
    folder_of(tmp_path, "a", SINK + CONTEXT, "{}")
    (tmp_path / "a/plan.yaml").write_text("subsystems: {x: {system: ../b}}")
    (tmp_path / "b").mkdir()
    (tmp_path / "b/system.rcl").write_text(SINK + CONTEXT)
    (tmp_path / "b/plan.yaml").write_text("subsystems: {y: {system: ../a}}")
    with pytest.raises(Rejected) as rejected:
        load_system(tmp_path / "a")
    assert "systems take in one another: a → b → a" in "".join(d.message for d in rejected.value.diagnostics)
    (tmp_path / "a/plan.yaml").write_text("subsystems: {x: {system: .}}")
    with pytest.raises(Rejected) as rejected:
        load_system(tmp_path / "a")
    assert "a → a" in "".join(d.message for d in rejected.value.diagnostics)
    (tmp_path / "b/plan.yaml").write_text("{}")
    (tmp_path / "b/system.rcl").write_text(SINK + CONTEXT.replace("10", "11"))
    for plan, words in (
        ("subsystems: {x: {system: ../b}}", "constant 'Limit' is another one there"),
        ("subsystems: {x: {system: ../c}}", "no folder '../c'"),
    ):
        (tmp_path / "a/plan.yaml").write_text(plan)
        with pytest.raises(Rejected) as rejected:
            load_system(tmp_path / "a")
        (fault,) = rejected.value.diagnostics
        assert words in fault.message
        assert fault.span is not None
        assert fault.span.line == 1
    (tmp_path / "b/system.rcl").write_text("node (")
    (tmp_path / "a/plan.yaml").write_text("subsystems: {x: {system: ../b}}")
    with pytest.raises(Rejected) as rejected:
        load_system(tmp_path / "a")
    assert {Path(d.span.file).parent.name for d in rejected.value.diagnostics if d.span} == {"a", "b"}


@pytest.mark.nightly
def test_two_of_two_of_two_is_soon_refused(tmp_path: Path) -> None:
    folder_of(tmp_path, "s0", node("n", "", "x0 : INTEGER"))
    for k in range(1, 16):
        (tmp_path / f"s{k}").mkdir()
        (tmp_path / f"s{k}/system.rcl").write_text(node(f"m{k}", "", f"z{k} : INTEGER"))
        (tmp_path / f"s{k}/plan.yaml").write_text(
            f"subsystems: {{a: {{system: ../s{k - 1}}}, b: {{system: ../s{k - 1}}}}}"
        )
    with pytest.raises(Rejected) as rejected:
        load_system(tmp_path / "s15")
    assert any("nodes in all" in d.message for d in rejected.value.diagnostics)


def test_what_is_assumed_of_a_shared_input_is_not_assumed_of_one_that_is_set_apart(tmp_path: Path) -> None:
    """`in.x` is what the nodes read that no other entry sets apart, even if such a node comes first."""
    text = node("a", "x : INTEGER", "y : INTEGER", "G: out.y == in.x") + node("b", "x : INTEGER", "", "A q: in.x > 0")
    plan = "environment: {in.x: {assume: in.x > 0, because: t}, a.x: {because: another}}\n"
    plan += "requirements: {R: {text: t, formula: a.y > 0}}"
    found = outcomes(make(tmp_path / "nodes", text, plan))
    assert found["whole.b.q"].verdict is Verdict.PROVED
    assert found["R"].verdict is Verdict.REFUTED
    inside = plan.replace("a.x:", "s.x:") + "\nsubsystems: {s: {nodes: [a]}}"
    found = outcomes(make(tmp_path / "inside", text, inside))
    assert found["whole.b.q"].verdict is Verdict.PROVED
    assert found["R"].verdict is Verdict.REFUTED
    with pytest.raises(Rejected, match="named apart"):
        make(tmp_path / "none", text.split("node b")[0], plan)


def test_what_a_folder_sets_apart_stays_apart_where_it_is_taken_in(tmp_path: Path) -> None:
    text = node("a", "x : INTEGER", "y : INTEGER", "G: out.y == in.x") + node("b", "x : INTEGER", "", "A q: in.x > 0")
    own = "environment: {in.x: {assume: in.x > 0, because: t}, a.x: {assume: in.x < 0, because: another}}"
    folder_of(tmp_path, "part", text, own)
    for name, more in (("apart", ""), ("wired", "environment: {in.x: {because: one wire}}\n")):
        plan = f"{more}subsystems: {{s: {{system: ../part}}}}\n"
        plan += "requirements: {R: {text: t, formula: s_a.y > 0}, S: {text: t, formula: s_a.y < 0}}"
        sink = node("sink", "x : INTEGER", "", "A q: in.x > 0")
        found = outcomes(load_system(folder_of(tmp_path, name, sink, plan)))
        assert found["R"].verdict is Verdict.REFUTED
        assert found["S"].verdict is Verdict.PROVED


def test_inputs_of_one_name_and_different_types_are_different_inputs(tmp_path: Path) -> None:
    """A run that gave a node a value of another's type would show nothing."""
    text = node("a", "x : REAL", "y : REAL", "G: out.y == in.x")
    text += node("b", "x : INTEGER", "z : INTEGER", "G: out.z == in.x") + node("c", "x : INTEGER", "", "A q: in.x < 3")
    plan = "environment: {in.x: {assume: in.x < 1, because: t}}\n"
    plan += "scenario: {domains: {REAL: [0.5], INTEGER: 0..1}}\nrequirements:\n"
    plan += '  T: {text: t, temporal: "always (a.y == 0.5 and (b.z == 0))"}\n'
    plan += '  U: {text: t, temporal: "always (a.y == 0.5 and b.z <= 1 and b.z == b.x)"}\n'
    plan += '  V: {text: t, formula: "b.z == c.x"}'
    found = outcomes(make(tmp_path, text, plan))
    assert found["T"].verdict is Verdict.REFUTED
    assert found["U"].verdict is Verdict.CHECKED
    assert found["V"].verdict is Verdict.PROVED
    assert found["environment.c.q"].verdict is Verdict.UNKNOWN  # the plan's reason is one for another input
