"""Nodes' code against the contract and against each other, without running anything: both places are shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import avow

from avow.base.diagnostics import Diagnostic
from avow.system.code_ends import checked
from avow.system.load import load_system
from system.test_topics import node

CONTRACT = node("camera", "", "x : REAL", "float64 scan matches(out.x)") + node(
    "watch", "y : REAL, on : BOOL", "", "float64 scan matches(in.y), std_srvs/SetBool_Request stop matches(in.on)"
)
CAMERA = """\
#include <rclcpp/rclcpp.hpp>
class Camera : public rclcpp::Node {
  Camera() : Node("camera") {
    out_ = create_publisher<std_msgs::msg::Float64>("scan", rclcpp::SensorDataQoS());
  }
};
"""
WATCH = """\
from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from std_msgs.msg import Float64
from std_srvs.srv import SetBool

class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.declare_parameter("fastest", 1.0)
        self.create_subscription(Float64, "scan", self.heard, qos_profile_sensor_data)
        self.create_service(SetBool, "stop", self.stop)
"""
PLAN = """\
ros:
  distro: humble
  nodes:
    camera: {code: camera.cpp}
nodes:
  watch: {source: {python: watch.py, class: Watch, kind: rclpy, parameters: watch.yaml}}
"""


def told(folder: Path, *changes: tuple[str, str, str]) -> list[Diagnostic]:
    """`changes`: in a file, a text and what is in its place."""
    files = {"system.rcl": CONTRACT, "camera.cpp": CAMERA, "watch.py": WATCH, "plan.yaml": PLAN}
    files["watch.yaml"] = "{fastest: 2.0}\n"
    for name, old, new in changes:
        assert old in files.get(name, ""), (name, old)
        files[name] = files[name].replace(old, new)
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    return list(checked(load_system(folder)))


def places(found: list[Diagnostic]) -> list[str]:
    """Each finding's code, with the file and the line of its place, and of its note."""
    spans = [(d.code, d.severity[0], d.span, d.notes[0][1] if d.notes else None) for d in found]
    return [" ".join([f"{c}{s}", *(f"{Path(p.file).name}:{p.line}" for p in ps if p)]) for c, s, *ps in spans]


STRICT = ("watch.py", ", qos_profile_sensor_data)", ", 10)")
SAID = "camera: {qos: {scan: {reliability: best_effort}}}"
RECORD = """\
/scan
Node name: camera
Node namespace: /
Endpoint type: PUBLISHER
  Reliability: BEST_EFFORT
  Durability: VOLATILE
"""
RELIABLE = ("camera.cpp", "SensorDataQoS()", "SensorDataQoS().reliable()")
CODE = "camera: {code: camera.cpp}"
FAULTS: list[tuple[list[tuple[str, str, str]], list[str]]] = [
    ([], []),
    ([STRICT], ["ROS131e watch.py:10 camera.cpp:4"]),
    ([STRICT, ("camera.cpp", "    out_", "    if (x) out_")], ["ROS131w watch.py:10 camera.cpp:4"]),
    ([STRICT, ("camera.cpp", "SensorDataQoS()", "SystemDefaultsQoS()")], []),
    ([STRICT, RELIABLE], []),
    ([STRICT, ("plan.yaml", CODE, SAID)], ["ROS131e watch.py:10 plan.yaml:4"]),
    ([RELIABLE, ("plan.yaml", CODE, SAID[:-1] + ", code: camera.cpp}")], ["ROS135e plan.yaml:4 camera.cpp:4"]),
    ([("plan.yaml", CODE, "camera: {qos: {scans: {depth: 1}}}")], ["PLAN106e plan.yaml:4"]),
    ([STRICT, ("plan.yaml", f"nodes:\n    {CODE}", "qos: qos.txt")], ["ROS131e watch.py:10 qos.txt:2"]),
    ([("plan.yaml", f"nodes:\n    {CODE}", "qos: watch.yaml")], ["ROS136e watch.yaml:1"]),
    ([("watch.py", '"scan"', '"scans"')], ["ROS133e system.rcl:12 watch.py:10"]),
    ([("watch.py", '"scan"', '"other"')], ["ROS133e system.rcl:12 watch.py:10"]),
    ([("camera.cpp", "Float64", "Int32")], ["ROS133e system.rcl:5 camera.cpp:4"]),
    ([("watch.py", "SetBool", "Trigger")], ["ROS133e system.rcl:12 watch.py:11"]),
    ([("camera.cpp", "create_publisher", "create_subscription")], ["ROS133e system.rcl:5 camera.cpp:4"]),
    ([("camera.cpp", '"scan"', "name()")], ["ROS134n camera.cpp:4"]),
    ([("watch.yaml", "fastest", "fasted")], ["PLAN136w watch.yaml:1"]),
]


@pytest.mark.parametrize(("changes", "wanted"), FAULTS)
def test_a_planted_fault_is_found_at_both_places(
    tmp_path: Path, changes: list[tuple[str, str, str]], wanted: list[str]
) -> None:
    (tmp_path / "qos.txt").write_text(RECORD, encoding="utf-8")
    assert places(told(tmp_path, *changes)) == wanted


def test_check_shows_both_places_and_ends_with_2(tmp_path: Path) -> None:
    told(tmp_path, STRICT)
    done = avow("check", ".", cwd=tmp_path)
    assert done.returncode == 2
    text = "/scan: camera offers best_effort at camera.cpp:4, and watch requests reliable: DDS does not connect them"
    assert f"error[ROS131]: {text}\n  --> watch.py:10:9\n" in done.stdout


SENT, HEARD = "float64 scan matches(out.x) )", "stop matches(in.on) )"
WITHIN = "{} assume a ( y > 0 and once[50 ms](arrived(in.y)) )"
OFFERS = ("camera.cpp", "SensorDataQoS()", "SensorDataQoS().deadline(100ms)")
ASKS = (
    "watch.py",
    "qos_profile_sensor_data)",
    "QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, deadline=Duration(seconds=0.1)))",
)
ASSUMES = '\nenvironment: {{in.y: {{assume: "once[{} ms](arrived(in.y))", because: x}}}}\n'
UNSAID = ("plan.yaml", CODE, "camera: {}")
TIMES: list[tuple[list[tuple[str, str, str]], list[str]]] = [
    ([("system.rcl", SENT, f"{SENT} steps( at most 200 ms )")], []),
    ([("system.rcl", SENT, f"{SENT} steps( at most 200 ms )"), OFFERS], ["ROS137w system.rcl:5 camera.cpp:4"]),
    ([("system.rcl", SENT, f"{SENT} steps( every 101 ms )"), OFFERS], ["ROS137w system.rcl:5 camera.cpp:4"]),
    ([("system.rcl", SENT, f"{SENT} steps( at most 100 ms )"), OFFERS], []),
    ([("system.rcl", SENT, f"{SENT} steps( at most 200 ms )"), ASKS, UNSAID], ["ROS137w system.rcl:5 watch.py:11"]),
    ([("system.rcl", HEARD, WITHIN.format(HEARD)), OFFERS], ["ROS137w system.rcl:12 camera.cpp:4"]),
    ([("system.rcl", HEARD, WITHIN.format(HEARD)), ASKS, UNSAID], ["ROS137w system.rcl:12 watch.py:11"]),
    ([("system.rcl", HEARD, WITHIN.format(HEARD)), OFFERS, ("camera.cpp", "100ms", "50ms"), ASKS], []),
    ([("system.rcl", HEARD, WITHIN.format(HEARD).replace("once", "not once")), OFFERS], []),
    ([("plan.yaml", "nodes:\n  watch", f"{ASSUMES.format(50)}nodes:\n  watch")], ["ROS137w plan.yaml:5 qos.txt:2"]),
    ([("plan.yaml", "nodes:\n  watch", f"{ASSUMES.format(100)}nodes:\n  watch")], []),
]


@pytest.mark.parametrize(("changes", "wanted"), TIMES)
def test_times_of_the_contract_are_compared_with_deadlines(
    tmp_path: Path, changes: list[tuple[str, str, str]], wanted: list[str]
) -> None:
    (tmp_path / "qos.txt").write_text(f"{RECORD}  Deadline: 100000000 nanoseconds\n", encoding="utf-8")
    more = [
        ("watch.py", "from std_msgs", "from rclpy.qos import QoSProfile, ReliabilityPolicy, Duration\nfrom std_msgs")
    ] * (ASKS in changes)
    if changes[0][0] == "plan.yaml":  # nobody of the contract publishes the topic, but the record knows its publisher
        camera = node("camera", "", "x : REAL", "float64 scan matches(out.x)")
        more = [("system.rcl", camera, ""), ("plan.yaml", f"nodes:\n    {CODE}", "qos: qos.txt")]
    assert places(told(tmp_path, *more, *changes)) == wanted
