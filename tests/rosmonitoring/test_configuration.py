"""The ROSMonitoring configurations: page 06's rules, strictly, also for names that nobody should choose."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
import yaml

from avow.backends.rosmonitoring.configuration import configuration, dotted_type, identifier, problems
from avow.backends.rosmonitoring.options import setup
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


def test_names_that_yaml_would_read_as_something_else(make_system: Callable[..., System]) -> None:
    system = make_system(HOSTILE, {"in.x'": "data", "out.yes": "data"})
    text, whole = configured(system, "n'")
    assert problems(text) == []
    monitor = whole["monitors"][0]["monitor"]
    assert [t["name"] for t in monitor["topics"]] == ["off", "null"]
    assert monitor["id"] == "monitor_n_x27_"


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
