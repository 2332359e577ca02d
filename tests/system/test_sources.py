"""Every input hears all of its possible sources, or the plan is refused with an error that names both."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.system.graph import dataflow
from avow.system.load import load_system

LISTENER = """
node l {{ inputs(v : REAL) outputs(a : REAL) topics({topics}) assume ok (in.v == 1) guarantee same (out.a == in.v) }}
"""


def publisher(name: str, port: str, value: int, topics: str = "") -> str:
    return f"node {name} {{ inputs() outputs({port} : REAL) topics({topics}) guarantee g (out.{port} == {value}) }}\n"


P1 = publisher("p1", "q", 1, "float64 t matches(out.q)")
BARE_V = publisher("p3", "v", 3)
BARE_R = publisher("p3", "r", 3)
ON_T = LISTENER.format(topics="float64 t matches(in.v)")
ON_BOTH = LISTENER.format(topics="float64 t matches(in.v), float64 u matches(in.v)")
ON_NONE = LISTENER.format(topics="")
ON_U = publisher("p3", "r", 3, "float64 u matches(out.r)")
OTHER_ON_T = publisher("p2", "r", 1, "float64 t matches(out.r)")
V_ON_T = publisher("p1", "v", 1, "float64 t matches(out.v)")
CONNECT_R = "connections: [{from: p3.r, to: l.v}]"


def loaded(folder: Path, text: str, plan: str) -> list[str]:
    (folder / "system.rcl").write_text(text, encoding="utf-8")
    (folder / "plan.yaml").write_text(plan, encoding="utf-8")
    return [str(edge) for edge in dataflow(load_system(folder)).edges]


@pytest.mark.parametrize(
    ("text", "plan", "code", "named"),
    [
        (P1 + BARE_V + ON_T, "{}", "PLAN122", ("p1.q", "p3.v")),
        (P1 + OTHER_ON_T + BARE_V + ON_T, "{}", "PLAN122", ("topic_t.v", "p3.v")),
        (P1 + ON_U + ON_BOTH + publisher("p4", "v", 3), "{}", "PLAN122", ("topic_t.v", "p4.v")),
        (P1 + BARE_R + ON_T, CONNECT_R, "ROS112", ("p1.q", "p3.r")),
        (P1 + OTHER_ON_T + BARE_R + ON_T, CONNECT_R, "ROS112", ("p1.q", "p3.r")),
        (P1 + OTHER_ON_T + ON_U + ON_T, CONNECT_R, "ROS112", ("/u", "/t")),
        (P1 + BARE_R + ON_BOTH, CONNECT_R, "ROS112", ("p1.q", "p3.r")),
        (V_ON_T + OTHER_ON_T + ON_NONE, "{}", "PLAN122", ("p1.v", "p2.r")),
        (P1 + OTHER_ON_T + ON_NONE, "connections: [{from: p1.q, to: l.v}]", "PLAN122", ("p1.q", "p2.r")),
        (
            ON_U + ON_BOTH,
            "environment: {l.v: {assume: in.v == 1, because: x}}",
            "PLAN113",
            ("l.v", "p3.r"),
        ),
    ],
)
def test_a_source_that_would_not_be_heard_is_an_error(
    tmp_path: Path, text: str, plan: str, code: str, named: tuple[str, str]
) -> None:
    with pytest.raises(Rejected) as refused:
        loaded(tmp_path, text, plan)
    found = [d for d in refused.value.diagnostics if d.code == code]
    assert found
    assert found[0].span is not None
    assert all(name in found[0].message for name in named)


@pytest.mark.parametrize(
    ("text", "plan", "feeding"),
    [
        (P1 + ON_U + ON_BOTH, "{}", {"p1.q", "p3.r"}),
        (P1 + ON_U + ON_BOTH, "connections: [{from: p1.q, to: l.v}]", {"p1.q", "p3.r"}),
        (publisher("p1", "q", 1, "float64 t matches(out.q), float64 u matches(out.q)") + ON_U + ON_BOTH, "{}",
         {"p1.q", "p3.r"}),
        (publisher("p1", "q", 1, "float64 w matches(out.q), float64 t matches(out.q)") + ON_T, "{}", {"p1.q"}),
        (ON_U + ON_BOTH, "{}", {"p3.r"}),
        (P1 + BARE_R + ON_T, "{}", {"p1.q"}),
        (P1 + BARE_V + ON_T, "connections: [{from: p1.q, to: l.v}]", {"p1.q"}),
        (P1 + BARE_R + ON_T, CONNECT_R + "\nros: {nodes: {l: {remap: {t: w}}}}", {"p3.r"}),
        (V_ON_T + ON_NONE, "{}", {"p1.v"}),
    ],
)  # fmt: skip
def test_all_sources_are_heard(tmp_path: Path, text: str, plan: str, feeding: set[str]) -> None:
    edges = [edge.split(" → ") for edge in loaded(tmp_path, text, plan)]
    assert {source for source, _ in edges if not source.startswith("topic_")} == feeding
    assert sum(target == "l.v" for _, target in edges) == 1


def test_two_listeners_of_one_topic_are_no_sources_of_one_another(tmp_path: Path) -> None:
    text = P1 + OTHER_ON_T + ON_T + ON_T.replace("node l", "node m").replace("out.a", "out.b").replace("a :", "b :")
    assert {"topic_t.v → l.v", "topic_t_2.v → m.v"} <= set(loaded(tmp_path, text, "{}"))


@pytest.mark.parametrize(
    "plan",
    [
        "compose: {p1: {select: [p3]}}",
        "requirements: {p1: {text: a, supported_by: [p3]}}",
        "subsystems: {p1: {nodes: [p3]}}",
    ],
)
def test_a_name_is_a_nodes_or_the_plans(tmp_path: Path, plan: str) -> None:
    with pytest.raises(Rejected) as refused:
        loaded(tmp_path, P1 + BARE_R, plan)
    (found,) = [d for d in refused.value.diagnostics if d.code == "PLAN110"]
    assert "'p1' is also a node" in found.message
    assert found.span is not None
    assert found.span.file.endswith("plan.yaml")
