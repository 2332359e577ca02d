"""What no run looks at, and folders with names that are none of a task: told each time, and they stop nothing else."""

from __future__ import annotations

import io
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.base.workspace import Workspace
from avow.pipeline.plan_check import left_out
from avow.pipeline.results import Result
from avow.pipeline.stages import stages
from avow.pipeline.state import State, system_of, task_name
from avow.pipeline.summary import print_summary, results_json
from avow.pipeline.tasks import Pipeline
from avow.system.load import load_system

CONTRACT = "node n { inputs() outputs( y : REAL ) topics() guarantee low ( out.y <= 1 ) }\n"


def system(folder: Path, plan: str = "") -> Path:
    folder.mkdir(parents=True)
    (folder / "s.rcl").write_text(CONTRACT)
    (folder / "plan.yaml").write_text(f"{plan}nodes: {{n: {{criticality: low}}}}\n")
    return folder


def tasks(root: Path) -> Iterator[tuple[str, object]]:
    for task in stages(State(Workspace(root))):
        if task["name"] is not None:
            yield f"{task['basename']}:{task['name']}", task.get("task_dep", ())


def test_every_folder_has_a_task_that_doit_takes(tmp_path: Path) -> None:
    contracts = tmp_path / "contracts"
    broken = ["a=b", "a-b", "a%3Db", "x:y", "x"]
    for name in broken:
        (contracts / name).mkdir(parents=True)
        (contracts / name / "plan.yaml").write_text("system: [")
    names = [name for name, _ in tasks(tmp_path)]
    assert len(names) == len(set(names))
    assert not [name for name in names if "=" in name]
    assert {system_of(name) for name in names if name.startswith("verify:")} == set(broken)
    assert {task_name(name) for name in broken} >= {"a-b", "x"}  # most are as they are written


def test_a_misspelt_task_has_a_suggestion(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "contracts" / "pill").mkdir(parents=True)
    (tmp_path / "contracts" / "pill" / "plan.yaml").write_text("system: [")
    for word, meant in (("verfy", "verify"), ("verify:pil", "verify:pill")):
        with pytest.raises(SystemExit) as ended:
            list(Pipeline(tmp_path, [word]).tasks())
        assert ended.value.code == 2
        assert f"there is no task {word}: did you mean `{meant}`?" in capsys.readouterr().err
    for word in ("verify:pill", "verify:*", "list", "other.txt"):
        assert list(Pipeline(tmp_path, [word]).tasks())


def test_a_system_is_asked_for_by_its_folder_too(tmp_path: Path) -> None:
    system(tmp_path / "contracts/c=d")
    system(tmp_path / "contracts/other", "system: crane\n")
    found = dict(tasks(tmp_path))
    assert found["verify:c%3Dd"] == ["verify:c_d"]
    assert found["report:other"] == ["report:crane"]
    assert "verify:crane" in found


def test_a_plan_in_no_systems_folder_has_tasks_of_its_own(tmp_path: Path) -> None:
    contracts = tmp_path / "contracts"
    system(contracts / "crane")
    system(contracts / "heap/spare")
    assert "verify:contracts/heap/spare" in dict(tasks(tmp_path))
    (contracts / "crane/plan.yaml").write_text("system: crane\nsubsystems: {one: {system: ../heap/spare}}\n")
    assert "verify:contracts/heap/spare" not in dict(tasks(tmp_path))


def test_a_plan_of_another_name_is_told(tmp_path: Path) -> None:
    """Its system was left out without a word, and nothing failed."""
    contracts = tmp_path / "contracts"
    for name in ("plan.yml", "Plan.yaml"):
        (contracts / "hook").mkdir(parents=True, exist_ok=True)
        (contracts / "hook" / name).write_text("nodes: {}\n")
    (system(contracts / "crane") / "plan.yml").write_text("nodes: {}\n")
    assert "verify:contracts/hook" in dict(tasks(tmp_path))
    (found,) = left_out(load_system(contracts / "crane"))
    assert found.span is not None
    assert (found.code, Path(found.span.file).name) == ("CLI021", "plan.yml")


def test_a_plan_that_is_a_link_to_nowhere_is_told(tmp_path: Path) -> None:
    folder = system(tmp_path / "contracts/crane")
    (folder / "plan.yaml").unlink()
    (folder / "plan.yaml").symlink_to("nowhere")
    assert "verify:crane" in dict(tasks(tmp_path))
    with pytest.raises(Rejected, match="link that leads nowhere"):
        load_system(folder)


@pytest.mark.parametrize(("more", "told"), [("", True), ("lints_off: [CLI021]\n", False)])
def test_a_plan_below_a_system_that_does_not_take_it_in_is_left_out(tmp_path: Path, more: str, told: bool) -> None:
    place = system(tmp_path / "crane", more)
    system(place / "spare")
    found = left_out(load_system(place))
    assert [(d.code, d.is_error, d.span and Path(d.span.file)) for d in found] == [
        ("CLI021", False, place / "spare/plan.yaml")
    ] * told


def test_a_next_step_that_closes_several_gates_is_said_once() -> None:
    gates = (("One", False, "a; next: do it"), ("Two", False, "b; next: do it"), ("Three", False, "c; next: do that"))
    out = io.StringIO()
    print_summary([Result("a", 1, {}, "r/a/i.html", (*gates, ("Four", False, "d")))], (), (), 0, 0.1, out)
    shown = [line.partition("a: ")[2] for line in out.getvalue().splitlines() if line.startswith("✗")]
    assert shown == ["One: a; next: do it", "Two: b; next: as above", "Three: c; next: do that", "Four: d"]


@pytest.mark.parametrize("number", [0, 1, 5])
def test_a_method_that_ended_with_an_error_is_named_though_every_gate_passes(number: int) -> None:
    """Other evidence may support the claim, such as a recording of an earlier program."""
    failed = tuple(f"n.g{k}: hypothesis: it never subscribes to /r" for k in range(number))
    out = io.StringIO()
    print_summary([Result("a", 0, {"monitored": 1}, "r/a/i.html", (), failed=failed)], (), (), 0, 0.1, out)
    assert out.getvalue().count("! a: n.g") == min(number, 3)
    assert ("and 2 more methods" in out.getvalue()) is (number == 5)


@pytest.mark.slow
def test_a_method_without_an_answer_is_told_at_its_claim_before_the_gates(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "contracts/s"
    folder.mkdir(parents=True)
    (tmp_path / "dodo.py").write_text("", "utf-8")
    (folder / "n.rcl").write_text(
        "node n { inputs( x : REAL ) outputs( y : REAL ) topics()\n  guarantee g ( out.y <= 1 ) }\n", "utf-8"
    )
    (folder / "n.py").write_text("def n(x):\n    return {}[x]\n\n\nraise OSError\n", "utf-8")
    (folder / "plan.yaml").write_text('nodes: {n: {methods: [hypothesis: {subject: "n.py:n"}]}}\n', "utf-8")
    words = [str(Path(sys.executable).with_name("avow")), "verify"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    first = next(line for line in done.stdout.splitlines() if line[:1] in "!✗" and line)
    assert first.startswith("! s: contracts/s/n.rcl:2: n.g: ")


def test_what_is_left_out_is_told_in_every_summary_once() -> None:
    one, plan = ("contracts/old/plan.yml", "misnamed"), ("contracts/crane/spare/plan.yaml", "not verified [CLI021]")
    gates = (("all", True, "fine"),)
    found = [
        Result("crane", 0, {"proved": 3}, "reports/crane/index.html", gates, (one, plan)),
        Result("hook", 0, {"proved": 3}, "reports/hook/index.html", gates, (one,)),
    ]
    out = io.StringIO()
    print_summary(found, (), (), 0, 0.1, out)
    assert out.getvalue().count("misnamed") == out.getvalue().count("CLI021") == 1
    said = json.loads(results_json(found, (), (), 0))["systems"]
    assert [[row["file"] for row in s["left_out"]] for s in said] == [[one[0], plan[0]], [one[0]]]
