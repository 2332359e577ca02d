"""What a node's code creates, and with which quality of service; what is computed is not known."""

from __future__ import annotations

import itertools
import math
from dataclasses import fields
from pathlib import Path
from typing import Any

import pytest

from avow.ros.code import Code, read_code
from avow.ros.quality import LEVELS, Quality, recorded, unmet

PYTHON = """\
from std_msgs.msg import Float64
import std_srvs.srv as srv
from rclpy import qos
from rclpy.action import ActionServer
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, QoSReliabilityPolicy, qos_profile_sensor_data
from tf2_ros import StaticTransformBroadcaster

class Other(Node):
    def __init__(self):
        self.create_publisher(Float64, "other", 10)

class Watch(Node):
    STATE = "state"

    def __init__(self):
        made = QoSProfile(depth=1)
        made.reliability = QoSReliabilityPolicy.BEST_EFFORT
        kept = qos.DurabilityPolicy.TRANSIENT_LOCAL
        self.latched = QoSProfile(depth=2, durability=kept, deadline=Duration(seconds=0.5))
        self.create_publisher(Float64, f"~/{self.STATE}", made)
        self.create_publisher(topic="all", msg_type=Float64, qos_profile=self.latched)
        self.create_subscription(Float64, "far", self.heard, qos.QoSPresetProfiles.SYSTEM_DEFAULT.value)
        for side in ("near",):
            self.create_subscription(Float64, f"{side}", self.heard, qos_profile_sensor_data)
        self.create_service(srv.SetBool, "stop", self.stop)
        ActionServer(self, Spin, "spin", self.spin)
        self.declare_parameters("", [("fast", 1), ("slow", 2)])
        StaticTransformBroadcaster(self)
        if self.far:
            self.create_publisher(Float64, "more", made)
"""
CXX = """\
#include <rclcpp/rclcpp.hpp>
#include <std_msgs/msg/float64.hpp>
#include "watch/msg/own.hpp"
using Number = std_msgs::msg::Float64;  // create_publisher<Number>("none", 10);
const char STATE[] = "~/state";
class Watch : public rclcpp::Node {
  Watch() : Node("watch") {
    auto made = rclcpp::QoS(rclcpp::KeepLast(1));
    made.best_effort();
    rclcpp::QoS latched{2};
    latched.transient_local().deadline(500ms);
    a_ = create_publisher<Number>(STATE, made);
    b_ = this->create_publisher<std_msgs::msg::Float64>("all", latched);
    c_ = create_subscription<Number>("near", rclcpp::SensorDataQoS(), [this](Number::SharedPtr m) { heard(m); });
    d_ = create_subscription<Number>("far", rclcpp::SystemDefaultsQoS(), std::bind(&Watch::heard, this, _1));
    e_ = create_service<std_srvs::srv::SetBool>("stop", stop);
    f_ = rclcpp_action::create_server<T>(this, "spin", stop, stop, stop);
    declare_parameter("fast", 1);
    declare_parameter<int>("slow", 2);
    tf2_ros::StaticTransformBroadcaster g_(this);
    if (far) {
      create_publisher<Number>("more", made);
    }
  }
};
"""
CREATED = {
    ("publishes", "~/state", "std_msgs/Float64", "reliability best_effort, durability volatile, depth 1"),
    ("publishes", "all", "std_msgs/Float64", "reliability reliable, durability transient_local, deadline 0.5, depth 2"),
    ("subscribes", "near", "std_msgs/Float64", "reliability best_effort, durability volatile, depth 5"),
    ("subscribes", "far", "std_msgs/Float64", ""),
    ("serves", "stop", "std_srvs/SetBool", ""),
    ("does", "spin", "", ""),
    ("declares", "fast", "", ""),
    ("declares", "slow", "", ""),
    ("publishes", "/tf_static", "tf2_msgs/TFMessage", ""),
    ("publishes", "more", "std_msgs/Float64", "reliability best_effort, durability volatile, depth 1"),
}


def read(folder: Path, text: str, name: str = "node.py", class_name: str = "Watch") -> Code:
    (folder / name).write_text(text, encoding="utf-8")
    return read_code(folder / name, class_name)


@pytest.mark.parametrize(("name", "text"), [("node.py", PYTHON), ("node.cpp", CXX)])
def test_what_is_created_has_its_place_and_quality(tmp_path: Path, name: str, text: str) -> None:
    code = read(tmp_path, text, name)
    assert {(c.side, c.name, c.kind, str(c.quality)) for c in code.created} == CREATED
    assert not code.unread, code.unread
    assert {"more"} <= {c.name for c in code.created if not c.sure} <= {"more", "/tf_static"}
    for each in code.created:
        line = text.splitlines()[each.span.line - 1].upper().replace("STATICTRANSFORM", "TF_STATIC")
        assert each.name.rpartition("/")[2].upper() in line.replace("{SIDE}", "NEAR")


ROS1 = {
    "node.py": 'import rospy\nfrom a.msg import B\nrospy.Publisher("x", B, latch=True)\nrospy.ServiceProxy("y", B)\n',
    "node.cpp": 'void f() { ros::NodeHandle nh; nh.advertise<a::B>("x", 1, true); nh.serviceClient<a::B>("y"); }',
}


@pytest.mark.parametrize("name", ROS1)
def test_ros_1_is_read_too(tmp_path: Path, name: str) -> None:
    code = read(tmp_path, ROS1[name], name)
    assert [(c.side, c.name, c.quality.durability) for c in code.created] == [
        ("publishes", "x", "transient_local"),
        ("calls", "y", None),
    ]
    assert not code.unread
    private = read(tmp_path, ROS1["node.cpp"].replace("nh;", 'nh("~");'), "node.cpp")
    assert (private.created, len(private.unread)) == ((), 2)


UNKNOWN = [  # what is written in the place of a text, and the topic whose quality is then not known; none: unread
    ("node.py", ("        made.reliability", "        if x:\n            made.reliability"), "~/state", "reliability"),
    ("node.py", ("made = QoSProfile(depth=1)", "made = QoSProfile(**more)"), "~/state", "durability"),
    ("node.py", ("class Other", "self.latched = None\nclass Other"), "all", "durability"),
    ("node.py", ('"stop"', "self.get_name()"), "", ""),
    ("node.py", ("STATE = ", "STATE = x = "), "", ""),
    ("node.py", ("import std_srvs.srv as srv", "import std_srvs.srv as srv\nfrom .more import help"), "", ""),
    ("node.py", ("self.create_service(", "make = self.create_service\n        make("), "", ""),
    ("node.cpp", ("    made.best_effort();", "    if (x) { made.best_effort(); }"), "~/state", "reliability"),
    ("node.cpp", ("KeepLast(1))", "KeepLast(1)).tuned(x)"), "~/state", "durability"),
    ("node.cpp", ("latched{2};", "latched{2}; latched = x;"), "all", "durability"),
    ("node.cpp", ('"stop"', "get_name()"), "", ""),
    ("node.cpp", ("<std_msgs/msg/float64.hpp>", "<nav2_util/node.hpp>"), "", ""),
    ("node.cpp", ('"watch/msg/own.hpp"', '"own.hpp"'), "", ""),
]


@pytest.mark.parametrize(("name", "change", "topic", "policy"), UNKNOWN)
def test_what_is_computed_is_not_known(
    tmp_path: Path, name: str, change: tuple[str, str], topic: str, policy: str
) -> None:
    text = {"node.py": PYTHON, "node.cpp": CXX}[name]
    assert change[0] in text
    code = read(tmp_path, text.replace(*change), name)
    if topic:
        (found,) = (c.quality for c in code.created if c.name == topic)
        assert getattr(found, policy) is None
    else:
        assert code.unread


def test_a_file_that_is_no_code_is_unread(tmp_path: Path) -> None:
    assert read(tmp_path, "def").unread
    assert read(tmp_path, "x = 1\n" * 10**6).unread
    assert read_code(tmp_path / "none.cpp").unread


def test_a_long_file_is_read_in_no_time(tmp_path: Path) -> None:
    blank = f"int a{' ' * 10**5}/*{'*' * 10**5}*/\n"
    code = read(tmp_path, CXX.replace("class", f"{blank * 3}class"), "node.cpp")
    assert {c.name for c in code.created} == {name for _, name, _, _ in CREATED}


def every() -> list[Quality]:
    times = (None, 0.5, 2.0, math.inf)
    kinds = [{"deadline": t} for t in times] + [{"lease": t} for t in times]
    kinds += [{policy: level} for policy in LEVELS for level in (None, *LEVELS[policy])]
    return [Quality(**kind) for kind in kinds]  # type: ignore[arg-type]


def test_what_is_offered_has_to_be_as_strong_as_what_is_requested() -> None:
    order: dict[Any, int] = {level: k for levels in LEVELS.values() for k, level in enumerate(levels)}
    for offered, requested in itertools.product(every(), every()):
        wrong = False
        for name in (f.name for f in fields(Quality) if f.name != "depth"):
            one, other = getattr(offered, name), getattr(requested, name)
            if one is not None and other is not None:
                wrong |= order[one] < order[other] if name in LEVELS else one > other
        assert bool(list(unmet(offered, requested))) is wrong, (offered, requested)


@pytest.mark.slow
def test_dds_connects_those_and_no_others() -> None:
    pytest.importorskip("cyclonedds")
    from cyclonedds.core import Qos
    from cyclonedds.domain import Domain, DomainParticipant
    from cyclonedds.idl import make_idl_struct
    from cyclonedds.pub import DataWriter
    from cyclonedds.qos import Policy
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    from avow.ros.dds import settings

    def policies(quality: Quality) -> Qos:
        found = [Policy.Reliability.Reliable(duration(seconds=1))]
        if quality.reliability == "best_effort":
            found = [Policy.Reliability.BestEffort]
        if quality.durability == "transient_local":
            found.append(Policy.Durability.TransientLocal)
        if quality.deadline not in (None, math.inf):
            found.append(Policy.Deadline(duration(seconds=quality.deadline)))
        lease = duration(seconds=quality.lease) if quality.lease not in (None, math.inf) else duration(infinite=True)
        manual = {
            "manual_by_node": Policy.Liveliness.ManualByParticipant,
            "manual_by_topic": Policy.Liveliness.ManualByTopic,
        }
        found.append(manual.get(quality.liveliness or "", Policy.Liveliness.Automatic)(lease))
        return Qos(*found)

    def whole(quality: Quality) -> Quality:
        plain = Quality("reliable", "volatile", math.inf, "automatic", math.inf)
        return Quality(*(getattr(quality, f.name) or getattr(plain, f.name) for f in fields(Quality)))

    entity = Domain(97, settings("127.0.0.1"))
    participant = DomainParticipant(97)
    kind = make_idl_struct("K", "K", {"x": int})
    kinds = list(dict.fromkeys(map(whole, every())))
    for number, (offered, requested) in enumerate(itertools.product(kinds, kinds)):
        topic = Topic(participant, f"t{number}", kind)
        writer = DataWriter(participant, topic, qos=policies(offered))
        reader = DataReader(participant, topic, qos=policies(requested))
        connected = reader.instance_handle in list(writer.get_matched_subscriptions())
        assert connected is not bool(list(unmet(offered, requested))), (offered, requested)
    del entity


INFO = """\
/scan
Type: sensor_msgs/msg/LaserScan

Publisher count: 1

Node name: camera
Node namespace: /front
Topic type: sensor_msgs/msg/LaserScan
Endpoint type: PUBLISHER
GID: 01.0f.1a
QoS profile:
  Reliability: BEST_EFFORT
  History (Depth): KEEP_LAST (5)
  Durability: VOLATILE
  Lifespan: Infinite
  Deadline: 100000000 nanoseconds
  Liveliness: AUTOMATIC
  Liveliness lease duration: 9223372036854775807 nanoseconds

Subscription count: 0

/other
Type: x/msg/Y
"""


def test_recorded_quality_is_read(tmp_path: Path) -> None:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    (tmp_path / "info.txt").write_text(INFO, encoding="utf-8")
    (end,) = recorded(tmp_path / "info.txt")
    assert (end.node, end.topic, end.publishes, end.span.line) == ("/front/camera", "/scan", True, 6)
    wanted = Quality("best_effort", "volatile", 0.1, "automatic", math.inf, 5)
    assert end.quality == wanted
    with pytest.raises(ValueError, match="neither a bag nor"):
        recorded(Path(pytest.__file__))
    none = QosTime(0, 0)
    profile = Qos(
        QosHistory.KEEP_LAST, 5, QosReliability.BEST_EFFORT, QosDurability.VOLATILE, QosTime(0, 100000000), none,
        QosLiveliness.AUTOMATIC, QosTime(9223372036, 854775807), False,
    )  # fmt: skip
    with Writer(tmp_path / "bag", version=9) as writer:
        store = get_typestore(Stores.ROS2_HUMBLE)
        writer.add_connection("/scan", "std_msgs/msg/Float64", typestore=store, offered_qos_profiles=[profile])
    (end,) = recorded(tmp_path / "bag")
    assert (end.node, end.topic, end.publishes, end.quality) == ("", "/scan", True, wanted)
