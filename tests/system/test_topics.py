"""Topics are the wiring: resolved names link, types have to agree, several publishers are each to be heard."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.pipeline.plan_check import of_plan
from avow.system.graph import dataflow
from avow.system.load import load_system
from avow.system.plan import System
from avow.system.topics import turned

NODE = """
node {name} {{
  inputs( {inputs} )
  outputs( {outputs} )
  topics( {topics} )
  {clauses}
}}
"""


def node(name: str, inputs: str = "", outputs: str = "", topics: str = "", clauses: str = "") -> str:
    return NODE.format(
        name=name, inputs=inputs, outputs=outputs, topics=topics, clauses=clauses or "guarantee g ( TRUE )"
    )


def make(folder: Path, text: str, plan: str = "{}") -> System:
    (folder / "system.rcl").write_text(text, encoding="utf-8")
    (folder / "plan.yaml").write_text(plan, encoding="utf-8")
    return load_system(folder)


def edges(system: System) -> list[str]:
    return [str(edge) for edge in dataflow(system).edges]


def told(folder: Path, text: str, plan: str = "{}") -> list[str]:
    """Codes of errors and warnings."""
    try:
        return [d.code for d in dataflow(make(folder, text, plan)).findings]
    except Rejected as rejected:
        return [d.code for d in rejected.diagnostics]


SOURCE = node("a", "", "x : REAL", "std_msgs/Float64 /t matches(out.x)")


def sink(kind: str = "std_msgs/Float64", topic: str = "t", port: str = "y", sort: str = "REAL") -> str:
    return node("b", f"{port} : {sort}", "", f"{kind} {topic} matches(in.{port})")


def test_a_topic_links_whatever_the_ports_are_called(tmp_path: Path) -> None:
    system = make(tmp_path, SOURCE + sink())
    assert edges(system) == ["a.x → b.y"]
    assert dataflow(system).edges[0].topic == "/t"
    assert dataflow(system).environment == ()


@pytest.mark.parametrize(
    ("plan", "linked"),
    [
        ("ros: {nodes: {b: {name: /robot/b}}}", False),
        ("ros: {nodes: {b: {name: /robot/b, remap: {t: /t}}}}", True),
        ("ros: {nodes: {a: {remap: {/t: /robot/t}}, b: {name: /robot/b}}}", True),
        ("ros: {nodes: {b: {remap: {t: ~t}}}}", False),
    ],
)
def test_namespaces_and_remaps_decide(tmp_path: Path, plan: str, linked: bool) -> None:
    assert edges(make(tmp_path, SOURCE + sink(), plan)) == (["a.x → b.y"] if linked else [])


def test_private_topics(tmp_path: Path) -> None:
    text = node("a", "", "x : REAL", "float64 ~x matches(out.x)") + sink("float64", "/a/x")
    assert edges(make(tmp_path, text)) == ["a.x → b.y"]


def test_a_remapping_the_other_way_round(tmp_path: Path) -> None:
    def found(remap: str) -> list[str]:
        system = make(tmp_path, SOURCE + sink(), f"ros: {{nodes: {{b: {{remap: {remap}}}}}}}")
        return [d.code for d in turned(system.plan, system.contract)]

    assert found("{scan: t}") == found("{scan: /t}") == ["ROS116"]
    assert found("{t: scan}") == found("{/tf: /robot/tf}") == []


@pytest.mark.parametrize(
    ("text", "plan", "codes"),
    [
        (SOURCE + sink("std_msgs/Float32"), "{}", ["ROS111"]),
        (SOURCE + sink("std_msgs/msg/Float64"), "{}", []),
        (SOURCE + sink("float64"), "{}", []),
        (SOURCE + sink(topic="u"), "connections: [{from: a.x, to: b.y}]", ["ROS112"]),
        (SOURCE + sink(topic="u"), "connections: [{from: a.x, to: b.y}]\nros: {nodes: {b: {remap: {u: t}}}}", []),
        (SOURCE + sink(topic="u", port="x"), "{}", ["ROS113"]),
        (
            node("a", "", "x : REAL, z : REAL", "p/P t matches(out.x), p/P t matches(out.z)")
            + node("b", "x : REAL, z : REAL", "", "p/P u matches(in.x), p/P u matches(in.z)"),
            "{}",
            ["ROS113"],  # once, though two ports are apart
        ),
        (SOURCE + sink(topic="u", port="x"), "ros: {nodes: {b: {remap: {u: t}}}}", []),
        (SOURCE + sink(sort="BOOL"), "{}", ["PLAN121"]),
        (
            node("a", "y : REAL", "x : REAL", "float64 t matches(out.x), float64 /t matches(in.y)"),
            "{}",
            ["ROS114"],
        ),
        (
            node("a", "", "x : REAL, z : REAL", "p/P t matches(out.x), p/P t matches(out.z)") + sink("p/P"),
            "{}",
            ["ROS115"],
        ),
        (SOURCE + sink(), "ros: {nodes: {c: {}}}", ["PLAN106"]),
        (SOURCE + sink(), "ros: {nodes: {b: {remap: {t: 'a b'}}}}", ["PLAN105"]),
        (SOURCE + sink(), "ros: {distro: sunny}", ["PLAN105"]),
    ],
)
def test_what_does_not_fit_is_told(tmp_path: Path, text: str, plan: str, codes: list[str]) -> None:
    assert told(tmp_path, text, plan) == codes


def test_an_output_on_another_topic_than_the_input_of_its_name(tmp_path: Path) -> None:
    """The output that is on the topic has another type; the port that is meant is named."""
    topics = "std_msgs/Float64 /t matches(out.x), std_msgs/Float64 /u matches(out.y)"
    with pytest.raises(Rejected) as caught:
        dataflow(make(tmp_path, node("a", "", "x : BOOL, y : REAL", topics) + sink()))
    assert [d.hint for d in caught.value.diagnostics] == ["a.y is on /u: correct its topic, or remap it"]


def test_a_slip_in_one_type_of_three(tmp_path: Path) -> None:
    text = SOURCE.replace("std_msgs/Float64", "p/Vacum") + "".join(
        node(name, "y : REAL", "", "p/Vacuum t matches(in.y)") for name in "bc"
    )
    with pytest.raises(Rejected) as caught:
        dataflow(make(tmp_path, text))
    (found,) = caught.value.diagnostics
    assert (found.code, found.hint, found.span and found.span.line) == ("ROS111", "did you mean `p/Vacuum`?", 5)


def test_a_slip_in_one_of_two_topics_is_no_crossed_connection(tmp_path: Path) -> None:
    text = node("a", "", "x : REAL, z : REAL", "p/P thurst matches(out.x), p/P thrust matches(out.z)")
    text += node("b", "x : REAL, z : REAL", "", "p/P thrust matches(in.x), p/P thrust matches(in.z)")
    with pytest.raises(Rejected) as caught:
        dataflow(make(tmp_path, text))
    (found,) = caught.value.diagnostics
    assert (found.code, found.hint) == ("ROS115", "a.x is published on `/thurst`: did you mean `/thrust`?")
    text = node("a", "", "x : REAL", "p/P flow matches(out.x)") + node("b", "y : REAL", "", "p/P flwo matches(in.y)")
    with pytest.raises(Rejected) as caught:
        dataflow(make(tmp_path, text, "connections: [{from: a.x, to: b.y}]"))
    assert (caught.value.diagnostics[0].hint or "").startswith("did you mean `/flow`?")


def test_an_end_without_a_topic_links_by_name(tmp_path: Path) -> None:
    assert edges(make(tmp_path, node("a", "", "y : REAL") + sink())) == ["a.y → b.y"]
    assert edges(make(tmp_path, SOURCE + node("b", "x : REAL"))) == ["a.x → b.x"]


def test_a_topic_of_several_variables_links_those_of_one_name(tmp_path: Path) -> None:
    topics = "p/P t matches({0}.x), p/P t matches({0}.z)"
    text = node("a", "", "x : REAL, z : REAL", topics.format("out"))
    text += node("b", "x : REAL, z : REAL", "", topics.format("in"))
    assert edges(make(tmp_path, text)) == ["a.x → b.x", "a.z → b.z"]


# -- several publishers ------------------------------------------------------------------------------------------------


def two(second: str) -> str:
    """Two nodes drive, one of them as `second` guarantees; the wheels assume at most 1."""
    return (
        node("joy", "", "v : REAL", "float64 cmd matches(out.v)", "guarantee slow ( out.v <= 1 )")
        + node("auto", "", "w : REAL", "float64 cmd matches(out.w)", f"guarantee slow ( {second} )")
        + node("wheels", "u : REAL", "turn : REAL", "float64 cmd matches(in.u)", "assume slow ( in.u <= 1 )\n"
               "guarantee follows ( out.turn == in.u )")
    )  # fmt: skip


def test_a_listener_of_several_publishers_hears_any_of_them(tmp_path: Path) -> None:
    system = make(tmp_path, two("out.w <= 0"))
    assert set(edges(system)) == {
        "joy.v → topic_cmd.joy_v",
        "auto.w → topic_cmd.auto_w",
        "topic_cmd.u → wheels.u",
    }
    (clause,) = system.contract.node("topic_cmd").guarantees
    assert clause.text == "out.u == in.joy_v or out.u == in.auto_w"
    assert system.contract.node("topic_cmd").assumptions == ()


def test_a_node_that_publishes_what_it_hears_beside_another_is_told_in_the_names_of_the_files(tmp_path: Path) -> None:
    """The advice starts the system; the note names both publishers."""
    text = node("tank", "", "level : REAL", "float64 level matches(out.level)")
    text += node("pump", "level : REAL", "p : REAL", "float64 level matches(in.level), float64 level matches(out.p)")
    stuck, note = of_plan(make(tmp_path, text))
    assert (stuck.code, stuck.message.partition(" wait")[0]) == ("PLAN123", "start-up deadlock: pump → pump")
    assert note.message == "/level has several publishers, and an input on it takes what any says: tank, pump"
    advice = (stuck.hint or "").partition("for example  ")[2]
    assert advice == "connections: [{from: pump.p, to: pump.level, delayed: true, initial: …}]"
    assert [d.code for d in of_plan(make(tmp_path, text, advice.replace("…", "0")))] == ["ROS117"]


def test_relations_are_heard_whole(tmp_path: Path) -> None:
    context = "context { At : REAL x NATURAL --> BOOL; }\n"
    text = "".join(node(n, "", "at : At", "p/P at matches(out.at)") for n in ("a", "b"))
    text += node("c", "at : At", "", "p/P at matches(in.at)")
    (clause,) = make(tmp_path, context + text).contract.node("topic_at").guarantees
    assert len(getattr(clause.formula, "items", ())) == 2


@pytest.mark.parametrize(
    ("outputs", "topics"),
    [
        ("w : BOOL", "float64 cmd matches(out.w)"),
        ("w : INTEGER", "float64 cmd matches(out.w)"),
        ("w : REAL, x : REAL", "float64 cmd matches(out.w), float64 cmd matches(out.x)"),
    ],
)
@pytest.mark.parametrize("plan", ["{}", "connections: [{from: joy.v, to: wheels.u}]"])
def test_no_publisher_is_left_out(tmp_path: Path, outputs: str, topics: str, plan: str) -> None:
    """Not even where a connection names another: what it publishes is heard all the same."""
    text = node("joy", "", "v : REAL", "float64 cmd matches(out.v)") + node("auto", "", outputs, topics)
    text += node("wheels", "u : REAL", "", "float64 cmd matches(in.u)")
    assert "ROS115" in told(tmp_path, text, plan)


def test_a_connection_to_one_publisher_does_not_silence_the_other(tmp_path: Path) -> None:
    plan = "connections: [{from: joy.v, to: wheels.u, delayed: true, initial: 0}]"
    found = set(edges(make(tmp_path, two("out.w <= 0"), plan)))
    assert found == {
        "joy.v → topic_cmd.joy_v (delayed)",
        "auto.w → topic_cmd.auto_w",
        "topic_cmd.u → wheels.u",
    }


def test_what_stands_for_a_topic_has_nothing_to_show(tmp_path: Path) -> None:
    """It is wiring: no claim is made of it, no derivation rests on it, and no method can be given to it."""
    from avow.pipeline.assess import _derivation_views
    from avow.pipeline.work import catalogue

    system = make(tmp_path, two("out.w <= 0"))
    found = catalogue(system)
    assert {o.node for o in found.obligations} == {"joy", "auto", "wheels", "system"}
    assert all("topic_cmd" not in view.premises for view in _derivation_views(system))
    with pytest.raises(Rejected, match="topic_cmd"):
        make(tmp_path, two("out.w <= 0"), "nodes: {topic_cmd: {methods: [hoare: {program: x}]}}")
