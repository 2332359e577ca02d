"""A model that was verified beside the source, held against it: a difference refutes the link, not the guarantee."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from helpers import some
from python_backend.source_nodes import LIMITER, LIMITER_RCL

from avow.assurance.relied import agrees
from avow.backend_kit.linked import recorded
from avow.backend_kit.protocol import Limits, Report
from avow.backends.python import BACKEND
from avow.base.verdict import Verdict
from avow.evidence.status import Status
from avow.pipeline.methods import method_job
from avow.pipeline.slices import method_slice
from avow.pipeline.work import catalogue, method_work
from avow.system.load import load_system

MODEL = "IF (v > 1.5) THEN u := 1.5 ELSE IF (v < -1.5) THEN u := -1.5 ELSE u := v\n"


def written(
    folder: Path, model: str = MODEL, methods: tuple[str, ...] = ("python", "hoare"), vmax: float = 1.5
) -> None:
    (folder / "src").mkdir(parents=True)
    (folder / "src" / "limiter.py").write_text(LIMITER)
    (folder / "model.imp").write_text(model)
    (folder / "params.yaml").write_text(f"vmax: {vmax}\n")
    (folder / "system.rcl").write_text(LIMITER_RCL)
    options = {"python": {"python": {}}, "hoare": {"hoare": {"program": "model.imp"}}, "dafny": {"dafny": {}}}
    entry = {
        "source": {"python": "src/limiter.py", "class": "Limiter", "parameters": "params.yaml"},
        "methods": [options[name] for name in methods],
    }
    (folder / "plan.yaml").write_text(yaml.safe_dump({"contract": "system.rcl", "nodes": {"limiter": entry}}))


def asked(folder: Path) -> Report:
    system = load_system(folder)
    node = system.contract.nodes[0]
    method = next(m for m in system.plan.node(node.name).methods if m.backend == "python")
    return BACKEND.discharge(method_job(system, node, method), folder / "made", Limits(seconds=120))


@pytest.mark.slow
def test_they_agree(tmp_path: Path) -> None:
    written(tmp_path / "s")
    found = {o.obligation.rpartition("/")[2]: o for o in asked(tmp_path / "s").outcomes}
    assert found["agrees-with-model"].verdict is Verdict.TESTED
    assert int(str(found["agrees-with-model"].bound["cases"])) > 100
    system = load_system(tmp_path / "s")
    assert found["agrees-with-model"].details["agrees"] == {
        "hoare": [c.name for c in system.contract.nodes[0].guarantees]
    }
    assert found["bounded"].verdict is Verdict.PROVED


@pytest.mark.parametrize(
    "model",
    some(
        [
            MODEL.replace("v > 1.5", "v > 2"),
            MODEL.replace("u := v", "u := 0"),
            MODEL.replace("v < -1.5", "v <= -1.5").replace("u := -1.5", "u := 0 - 1.4"),
        ],
        1,
        slow=2,
    ),
)
def test_a_difference_refutes_the_link_alone(model: str, tmp_path: Path) -> None:
    written(tmp_path / "s", model)
    found = {o.obligation.rpartition("/")[2]: o for o in asked(tmp_path / "s").outcomes}
    link = found.pop("agrees-with-model")
    assert link.verdict is Verdict.REFUTED
    assert link.counterexample is not None
    assert "model's out.u" in dict(link.counterexample.values)
    assert {o.verdict for o in found.values()} == {Verdict.PROVED}


@pytest.mark.slow
def test_rounding_is_no_difference(tmp_path: Path) -> None:
    tenth = MODEL.replace("1.5", "0.3")
    written(tmp_path / "rounded", tenth, vmax=0.3)
    found = {o.obligation.rpartition("/")[2]: o for o in asked(tmp_path / "rounded").outcomes}
    assert found["agrees-with-model"].verdict is Verdict.TESTED
    assert "but for rounding" in found["agrees-with-model"].summary


def test_a_model_that_cannot_be_run_says_nothing(tmp_path: Path) -> None:
    written(tmp_path / "s", "u := \n")
    found = {o.obligation.rpartition("/")[2]: o for o in asked(tmp_path / "s").outcomes}
    assert found["agrees-with-model"].verdict is Verdict.UNKNOWN


@pytest.mark.slow
def test_there_is_no_claim_without_a_model(tmp_path: Path) -> None:
    written(tmp_path / "s", methods=("python",))
    assert not any("agrees-with-model" in o.obligation for o in asked(tmp_path / "s").outcomes)
    assert not any("agrees-with-model" in o.id for o in catalogue(load_system(tmp_path / "s")).obligations)


def test_the_model_is_in_the_key_and_in_the_slice(tmp_path: Path) -> None:
    """A change of the model asks the link again; and whoever gets the slice finds the same keys."""
    written(tmp_path / "s")
    system = load_system(tmp_path / "s")
    node = system.contract.nodes[0]
    method = next(m for m in system.plan.node(node.name).methods if m.backend == "python")
    before = method_work(system, node, method)
    cut = method_slice(BACKEND, method_job(system, node, method)).system
    own = cut.plan.node(node.name).methods[0]
    assert method_work(cut, cut.contract.node(node.name), own).keys == before.keys
    (tmp_path / "s" / "model.imp").write_text(MODEL.replace("1.5", "1.4"))
    after = method_work(load_system(tmp_path / "s"), node, method)
    assert all(after.keys[name] != key for name, key in before.keys.items())


RECORDED = """\
    methods:
    - python: {}
    - hoare: {program: model.imp}
    - rosmonitoring:
        answers: {by: arrival, because: a test}
        traces: [run.jsonl]
        mapping: {in.v: {topic: v, field: data}, out.u: {topic: u, field: data}}
"""


def with_recording(folder: Path, values: Sequence[float], model: str = MODEL) -> None:
    """A node with a source, a model, and a recording of these inputs."""
    written(folder, model)
    plan = (folder / "plan.yaml").read_text(encoding="utf-8")
    (folder / "plan.yaml").write_text(plan[: plan.index("    methods:")] + RECORDED + plan[plan.index("    source:") :])
    lines = [
        json.dumps({"topic": topic, "time": at, "data": value})
        for at, value in enumerate(values)
        for topic in ("v", "u")
    ]
    (folder / "run.jsonl").write_text("\n".join(lines), encoding="utf-8")


@pytest.mark.slow
def test_recorded_steps_are_put_through_both(tmp_path: Path) -> None:
    """The model differs at one number, which no rule draws: that it was recorded refutes the link."""
    odd = 0.736328125
    model = MODEL.replace("u := v", f"IF (v = {odd!r}) THEN u := 0 ELSE u := v")
    with_recording(tmp_path / "s", [0.1, 0.5], model)
    (link,) = (o for o in asked(tmp_path / "s").outcomes if o.obligation.endswith("agrees-with-model"))
    assert link.verdict is Verdict.TESTED
    assert link.bound["recorded"] == 2
    with_recording(tmp_path / "t", [0.1, odd, 0.5], model)
    (link,) = (o for o in asked(tmp_path / "t").outcomes if o.obligation.endswith("agrees-with-model"))
    assert link.verdict is Verdict.REFUTED
    assert link.counterexample is not None
    assert ("model's out.u", "0") in link.counterexample.values


def test_a_recording_is_in_the_key_and_in_the_slice(tmp_path: Path) -> None:
    with_recording(tmp_path / "s", [0.1, 0.5])
    system = load_system(tmp_path / "s")
    node = system.contract.nodes[0]
    method = next(m for m in system.plan.node(node.name).methods if m.backend == "python")
    before = method_work(system, node, method)
    cut = method_slice(BACKEND, method_job(system, node, method)).system
    own = cut.plan.node(node.name).methods[0]
    assert method_work(cut, cut.contract.node(node.name), own).keys == before.keys
    job = method_job(cut, cut.contract.node(node.name), own)
    assert recorded(job, ["v"]).runs == (({"v": 0.1}, {"v": 0.5}),)
    (tmp_path / "s" / "run.jsonl").write_text("", encoding="utf-8")
    after = method_work(load_system(tmp_path / "s"), node, method)
    assert all(after.keys[name] != key for name, key in before.keys.items())


@pytest.mark.slow
def test_a_recording_that_cannot_be_read_is_no_agreement(tmp_path: Path) -> None:
    with_recording(tmp_path / "s", [0.1, 0.5])
    (tmp_path / "s" / "run.jsonl").write_text("{", encoding="utf-8")
    (link,) = (o for o in asked(tmp_path / "s").outcomes if o.obligation.endswith("agrees-with-model"))
    assert link.verdict is Verdict.UNKNOWN
    assert "cannot be read" in link.summary


@pytest.mark.slow
def test_a_model_that_is_not_run_is_refused_by_name(tmp_path: Path) -> None:
    """Alone it leaves the link unknown; beside one that is run it is told."""
    written(tmp_path / "s", methods=("python", "dafny"))
    (link,) = (o for o in asked(tmp_path / "s").outcomes if o.obligation.endswith("agrees-with-model"))
    assert link.verdict is Verdict.UNKNOWN
    assert "the model of dafny is not held against the program" in link.summary
    written(tmp_path / "t", methods=("python", "hoare", "dafny"))
    (link,) = (o for o in asked(tmp_path / "t").outcomes if o.obligation.endswith("agrees-with-model"))
    assert link.verdict is Verdict.TESTED
    assert "the model of dafny is not held" in link.hypotheses[0]
    system = load_system(tmp_path / "t")
    node, method = system.contract.nodes[0], system.plan.nodes[0].methods[0]
    cut = method_slice(BACKEND, method_job(system, node, method)).system
    own = method_work(cut, cut.contract.node(node.name), cut.plan.nodes[0].methods[0])
    assert own.keys == method_work(system, node, method).keys


def test_the_report_says_how_the_link_stands(tmp_path: Path) -> None:
    written(tmp_path / "s")
    listed = {o.name: o for o in catalogue(load_system(tmp_path / "s")).obligations if o.node == "limiter"}
    views: Any = [SimpleNamespace(obligation=listed["agrees-with-model"], standing=Status.REFUTED, records=())]
    assert agrees(views, listed["bounded"], "hoare") is Status.REFUTED
    assert agrees((), listed["bounded"], "hoare") is None
