"""The ROSMonitoring configurations: page 06's rules, strictly, also for names that nobody should choose."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from oracle.rosmonitoring import problems

from avow.backends.rosmonitoring.configuration import configuration, dotted_type, identifier, of_system
from avow.backends.rosmonitoring.options import setup
from avow.base.diagnostics import Rejected
from avow.system.load import load_system
from avow.system.plan import System


def configured(system: System, name: str) -> tuple[str, dict[str, Any]]:
    options = system.plan.node(name).methods[0].options
    found, _ = setup(system, system.contract.node(name), options)
    text = configuration(found, options.data)
    return text, yaml.safe_load(text)


@pytest.mark.parametrize("name", ["localisation", "navigation", "agent", "radiationSensor"])
def test_the_case_study(name: str, case: System) -> None:
    text, whole = configured(case, name)
    assert problems(text) == []
    monitor = whole["monitors"][0]["monitor"]
    assert monitor["id"] == f"monitor_{name}"
    names = [t["name"] for t in monitor["topics"]]
    topics = {t.name for t in case.contract.node(name).topics}
    wanted = {{"currentLoc": "/position"}.get(topic, topic) for topic in topics}
    wanted |= {"phase"} if name == "agent" else set()
    assert set(names) == wanted
    assert len(names) == len(set(names))
    assert {t["type"] for t in monitor["topics"]} == {"gazebo_radiation_plugins.msg.Snapshot"}
    assert "oracle" not in monitor


TWO = """
node a {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 /robot/s matches(out.s) )
  guarantee g ( out.s <= in.r )
}
node b {
  inputs( s : REAL )
  outputs( t : REAL )
  topics( std_msgs/Float64 /robot/s matches(in.s), std_msgs/Float64 t matches(out.t) )
  guarantee g ( out.t <= in.s )
}
"""


def two(folder: Path, **options: Any) -> System:
    (folder / "system.rcl").write_text(TWO, encoding="utf-8")
    mappings = {"a": {"in.r": "data", "out.s": "data"}, "b": {"in.s": "data", "out.t": "data"}}
    nodes = {
        name: {"methods": [{"rosmonitoring": {"mapping": mapping, **options.get(name, {})}}]}
        for name, mapping in mappings.items()
    }
    (folder / "plan.yaml").write_text(json.dumps({"contract": "system.rcl", "nodes": nodes}), encoding="utf-8")
    return load_system(folder)


def test_one_file_for_the_system_filters_and_orders(tmp_path: Path) -> None:
    oracle = {"oracle": {"port": 8080}, "ordered": "200 ms", "ros_version": "ros1"}
    system = two(tmp_path, a={"filter": ["out.s"], **oracle}, b=oracle)
    parts = []
    for node in system.contract.nodes:
        options = system.plan.node(node.name).methods[0].options
        found, faults = setup(system, node, options)
        assert not faults
        parts.append((found, options.data))
    whole = yaml.safe_load(of_system(parts))
    assert whole["ros_version"] == "ros1"
    monitors = {entry["monitor"]["id"]: entry["monitor"] for entry in whole["monitors"]}
    assert list(monitors) == ["monitor_a", "monitor_b"]
    by_name = {topic["name"]: topic for topic in monitors["monitor_a"]["topics"]}
    assert by_name["/robot/s"] == {
        "name": "/robot/s",
        "type": "std_msgs.msg.Float64",
        "action": "filter",
        "publishers": ["a"],
        "ordering": {"enabled": True, "max_delay_ms": 200},
    }
    assert by_name["r"]["action"] == "log"
    assert {topic["action"] for topic in monitors["monitor_b"]["topics"]} == {"log"}


def test_what_cannot_be_one_file_is_told(tmp_path: Path) -> None:
    system = two(tmp_path, a={"ros_version": "ros1"}, b={"ros_version": "ros2"})
    nodes = system.contract.nodes
    options = [system.plan.node(node.name).methods[0].options for node in nodes]
    parts = [(setup(system, node, given)[0], given.data) for node, given in zip(nodes, options, strict=True)]
    with pytest.raises(Rejected, match="ros1 and ros2"):
        of_system(parts)


def test_a_filter_is_of_outputs(tmp_path: Path) -> None:
    """Without an oracle nobody would tell the ROS monitor what is broken: it then logs."""
    system = two(tmp_path, a={"filter": ["in.r", "out.s"]})
    found, faults = setup(system, system.contract.node("a"), system.plan.node("a").methods[0].options)
    assert [fault.message.split(":")[1].strip() for fault in faults] == [
        "in.r is no output that a topic's messages carry"
    ]
    assert len(found.filtered) == 1
    assert "filter" not in of_system([(found, {})])


def test_one_entry_a_topic_even_if_several_variables_match(make_system: Callable[..., System]) -> None:
    rcl = """
node n {
  inputs( a : REAL, b : REAL )
  outputs( c : REAL )
  topics( p/Snapshot snap matches(in.a), std_msgs/msg/Float64 c matches(out.c) )
  guarantee g ( out.c == in.a + in.b )
}
"""
    mapping = {"in.a": "a", "in.b": {"topic": "/snap", "type": "p/Snapshot", "field": "b"}, "out.c": "data"}
    system = make_system(rcl, mapping, oracle={"port": 9090}, ros_version="ros2")
    text, whole = configured(system, "n")
    assert problems(text) == []
    monitor = whole["monitors"][0]["monitor"]
    assert [(t["name"], t["type"]) for t in monitor["topics"]] == [
        ("snap", "p.msg.Snapshot"),
        ("c", "std_msgs.msg.Float64"),
    ]
    assert monitor["oracle"] == {"url": "127.0.0.1", "port": 9090, "action": "nothing", "timeout": 2.0}
    assert whole["ros_version"] == "ros2"


@pytest.mark.parametrize(
    ("ros", "dotted"),
    [
        ("gazebo_radiation_plugins/Snapshot", "gazebo_radiation_plugins.msg.Snapshot"),
        ("std_msgs/msg/String", "std_msgs.msg.String"),
        ("float64", "std_msgs.msg.Float64"),
        ("uint8", "std_msgs.msg.UInt8"),
        ("bool", "std_msgs.msg.Bool"),
        ("string", "std_msgs.msg.String"),
        ("time", "std_msgs.msg.Time"),
    ],
)
def test_types_are_dotted(ros: str, dotted: str) -> None:
    assert dotted_type(ros) == dotted


def test_identifiers_are_python_and_injective() -> None:
    names = ["n", "n'", "n''", "n_x27_", "n_x27_x27_", "é", "a b", "a_b", "a-b", "class", "x\n", "_x5f_", "n_"]
    found = [identifier("monitor_", name) for name in names]
    assert all(f.isidentifier() and f.isascii() for f in found)
    assert len(set(found)) == len(names)
    assert identifier("", "class") == "class_"


HOSTILE = """
node n' {
  inputs( x' : REAL )
  outputs( yes : BOOL )
  topics( a/R off matches(in.x'), a/R null matches(out.yes) )
  guarantee g ( out.yes <=> in.x' > 0 )
}
"""


def test_a_topic_of_the_plan_cannot_break_out(make_system: Callable[..., System]) -> None:
    topic = "x\"\n    oracle: {port: 1}\n#'"
    mapping = {"in.x'": {"topic": topic, "type": "a/R", "field": "data"}, "out.yes": "data"}
    system = make_system(HOSTILE, mapping)
    text, whole = configured(system, "n'")
    assert problems(text) == []
    monitor = whole["monitors"][0]["monitor"]
    assert "oracle" not in monitor
    assert topic in [t["name"] for t in monitor["topics"]]


GOOD = """
monitors:
- monitor:
    id: monitor_a
    log: ./a.txt
    topics:
    - {name: t, type: p.msg.T, action: log}
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("monitors:\n-", "monitors:\n "),
        ("id: monitor_a", "id: monitor-a"),
        ("id: monitor_a", "id: 7"),
        ("log: ./a.txt", "log: [1]"),
        ("p.msg.T", "p/T"),
        ("p.msg.T", "p.T"),
        ("action: log", "action: delete"),
        ("name: t, ", ""),
        ("action: log}", "action: log}\n    - {name: /t, type: p.msg.T, action: log}"),
        ("- monitor:", "- other:"),
        ("log}", "log"),
    ],
)
def test_the_check_can_fail(old: str, new: str) -> None:
    assert problems(GOOD) == []
    assert old in GOOD
    assert problems(GOOD.replace(old, new, 1)) != []


def test_two_monitors_may_not_share_an_id() -> None:
    again = GOOD + GOOD.split("monitors:\n", 1)[1]
    assert problems(again) == ["the id monitor_a occurs twice"]
