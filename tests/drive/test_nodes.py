"""Nodes as teams write them: each is driven as it is, keeps its guarantees, and its mutants do not."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from helpers import avow, edit

from avow.backend_kit import one_step
from avow.backend_kit.programs.callbacks import SECOND, Event, driver
from avow.backend_kit.protocol import Limits
from avow.base.verdict import Outcome, Verdict
from avow.pipeline.methods import method_job
from avow.pipeline.plan_check import diagnostics
from avow.system.load import load_system
from drive.test_callbacks import drive

TOOL = import_module("avow.backends.hypothesis").BACKEND


@dataclass(frozen=True, slots=True)
class Made:
    """A node's contract, its files (the first is its own), mutants of them (old and new text), and its plan."""

    contract: str
    files: Mapping[str, str]
    mutants: tuple[tuple[str, str], ...]
    options: str = ""
    params: str = ""
    mapping: str = "{}"
    kind: str = "rclpy"
    cases: str = "300"
    run: str = ""


def system(folder: Path, made: Made) -> Path:
    for path, text in {**made.files, "params.yaml": made.params or "{}\n", "system.rcl": made.contract}.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")
    run = made.run and f", run: {made.run}"
    source = f"python: {next(iter(made.files))}, class: Watch, kind: {made.kind}, parameters: params.yaml{run}"
    (folder / "plan.yaml").write_text(
        "system: w\ncontract: system.rcl\nros: {distro: humble}\nnodes:\n  watch:\n"
        f"    source: {{{source}}}\n"
        f"    mapping: {made.mapping}\n    methods: [hypothesis: {{cases: {made.cases}}}]\n{made.options}",
        encoding="utf-8",
    )
    return folder


def verdicts(folder: Path) -> dict[str, Outcome]:
    loaded = load_system(folder)
    job = method_job(loaded, loaded.contract.node("watch"), loaded.plan.node("watch").methods[0])
    assert not [d for d in one_step.check(TOOL, job) if d.is_error]
    return {o.obligation.rpartition("/")[2]: o for o in one_step.discharge(TOOL, job, job.root, Limits()).outcomes}


LIMIT = """\
node watch {
  inputs( asked : REAL )
  outputs( allowed : REAL )
  topics( float64 asked matches(in.asked), float64 allowed matches(out.allowed) )
  guarantee limited ( out.allowed <= 1.5 )
  guarantee followed ( in.asked <= 1.5 -> out.allowed == in.asked )
}
"""
PACKAGE = {
    "ws/src/mover/mover/node.py": """\
from mover.limits import clamp
from rclpy.node import Node
from std_msgs.msg import Float64

from .names import ALLOWED


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.allowed = self.create_publisher(Float64, ALLOWED, 10)
        self.create_subscription(Float64, "asked", self.heard, 10)

    def heard(self, message):
        self.allowed.publish(Float64(data=clamp(message.data)))
""",
    "ws/src/mover/mover/__init__.py": "",
    "ws/src/mover/mover/names.py": 'ALLOWED = "allowed"\n',
    "ws/src/mover/mover/limits.py": "FASTEST = 1.5\n\n\ndef clamp(speed):\n    return min(FASTEST, speed)\n",
    "ws/src/mover/package.xml": "<package><name>mover</name></package>\n",
}
CATKIN = {
    "mover/scripts/node.py": """\
import rospy
from mover.limits import clamp
from mover.msg import Speed
from std_msgs.msg import Float64


class Watch:
    def __init__(self):
        self.allowed = rospy.Publisher("allowed", Speed, queue_size=1)
        rospy.Subscriber("asked", Float64, self.heard)

    def heard(self, message):
        self.allowed.publish(clamp(message.data))
""",
    "mover/src/mover/__init__.py": "",
    "mover/src/mover/limits.py": PACKAGE["ws/src/mover/mover/limits.py"],
    "mover/package.xml": PACKAGE["ws/src/mover/package.xml"],
    "mover/msg/Speed.msg": "float64 speed\n",
}
STOP = """\
node watch {
  inputs( hold : BOOL, speed : REAL )
  outputs( held : BOOL, motor : REAL )
  topics( std_srvs/SetBool_Request stop matches(in.hold), std_srvs/SetBool_Response stop matches(out.held),
          float64 speed matches(in.speed), float64 motor matches(out.motor) )
  guarantee obeyed ( out.held <=> in.hold )
  guarantee still ( in.hold -> out.motor == 0 )
}
"""
SERVER = """\
from rclpy.node import Node
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from std_msgs.msg import Float64
from std_srvs.srv import SetBool


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.held = False
        self.motor = self.create_publisher(Float64, "motor", 10)
        self.create_service(SetBool, "stop", self.stop)
        self.create_subscription(Float64, "speed", self.move, 10)

    def stop(self, request, response):
        self.held = request.data
        self.motor.publish(Float64(data=0.0))
        response.success = self.held
        response.message = "held" if self.held else "free"
        return response

    def move(self, message):
        self.motor.publish(Float64(data=0.0 if self.held else message.data))
"""
SERVER1 = """\
import rospy
from std_msgs.msg import Float64
from std_srvs.srv import SetBool, SetBoolRequest, SetBoolResponse


class Watch:
    def __init__(self):
        self.held = False
        self.motor = rospy.Publisher("motor", Float64, queue_size=10)
        rospy.Service("stop", SetBool, self.stop)
        rospy.Subscriber("speed", Float64, self.move)

    def stop(self, request):
        assert isinstance(request, SetBoolRequest)
        self.held = request.data
        self.motor.publish(0.0)
        return SetBoolResponse(success=True, message="held") if self.held else (False, "free")

    def move(self, message):
        self.motor.publish(0.0 if self.held else message.data)
"""
TUNED = """\
from rcl_interfaces.msg import FloatingPointRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float64


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.fastest = 9.0
        self.add_on_set_parameters_callback(self.tuned)
        span = FloatingPointRange(from_value=0.0, to_value=10.0)
        self.declare_parameter("fastest", 1.0, ParameterDescriptor(floating_point_range=[span]))
        self.allowed = self.create_publisher(Float64, "allowed", 10)
        self.create_subscription(Float64, "asked", self.heard, 10)

    def tuned(self, parameters):
        for parameter in parameters:
            if parameter.name == "fastest":
                if parameter.value > 1.5:
                    return SetParametersResult(successful=False, reason="too fast")
                self.fastest = parameter.value
        return SetParametersResult(successful=True)

    def heard(self, message):
        for fastest in (2.0, 20.0, 1.5):
            self.set_parameters([Parameter("fastest", Parameter.Type.DOUBLE, fastest)])
            assert self.fastest <= 1.5
        self.allowed.publish(Float64(data=min(message.data, self.get_parameter("fastest").value)))
"""
CAMERA = """\
from rclpy.lifecycle import LifecycleNode, State, TransitionCallbackReturn
from std_msgs.msg import Float64


class Watch(LifecycleNode):
    def __init__(self):
        super().__init__("watch")
        self.declare_parameter("fastest", 9.0)
        self.fastest = None

    def on_configure(self, state: State) -> TransitionCallbackReturn:
        assert state.label == "unconfigured"
        self.fastest = self.get_parameter("fastest").value
        self.allowed = self.create_lifecycle_publisher(Float64, "allowed", 10)
        self.create_subscription(Float64, "asked", self.heard, 10)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: State) -> TransitionCallbackReturn:
        self.allowed.publish(Float64(data=99.0))  # not yet active
        return super().on_activate(state)

    def heard(self, message):
        self.allowed.publish(Float64(data=min(message.data, self.fastest)))
"""
FUSED = """\
node watch {
  inputs( left : REAL, right : REAL )
  outputs( most : REAL )
  topics( sensor_msgs/Range left matches(in.left), sensor_msgs/Range right matches(in.right),
          float64 most matches(out.most) )
  guarantee greatest ( out.most >= in.left and out.most >= in.right )
}
"""
PAIRS = """\
from message_filters import ApproximateTimeSynchronizer, Subscriber, TimeSynchronizer
from rclpy.node import Node
from sensor_msgs.msg import Range
from std_msgs.msg import Float64


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.most = self.create_publisher(Float64, "most", 10)
        both = [Subscriber(self, Range, name, qos_profile=10) for name in ("left", "right")]
        self.pairs = TimeSynchronizer(both, 5)
        self.pairs.registerCallback(self.paired)

    def paired(self, left, right):
        assert left.header.stamp == right.header.stamp
        self.most.publish(Float64(data=max(left.range, right.range)))
"""
ASKED = """\
node watch {
  inputs( near : BOOL, free : BOOL )
  outputs( asked : BOOL, go : BOOL )
  topics( bool near matches(in.near), std_srvs/SetBool_Request gate matches(out.asked),
          std_srvs/SetBool_Response gate matches(in.free), bool go matches(out.go) )
  guarantee asks ( out.asked <=> in.near )
  guarantee goes ( out.go -> in.free )
}
"""
CLIENT = """\
from rclpy.node import Node
from std_msgs.msg import Bool
from std_srvs.srv import SetBool


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.go = self.create_publisher(Bool, "go", 10)
        self.gate = self.create_client(SetBool, "gate")
        while not self.gate.wait_for_service(timeout_sec=1.0):
            self.get_logger().info("no gate yet")
        self.create_subscription(Bool, "near", self.heard, 10)

    def heard(self, message):
        self.gate.call_async(SetBool.Request(data=message.data)).add_done_callback(self.answered)

    def answered(self, future):
        self.go.publish(Bool(data=future.result().success))
"""
TURNED = """\
context { Turn : {configure, activate, deactivate, cleanup, shutdown}; }
node watch {
  inputs( turn : Turn, speed : REAL )
  outputs( turned : BOOL, motor : REAL )
  topics( lifecycle_msgs/ChangeState_Request watch/change_state matches(in.turn),
          lifecycle_msgs/ChangeState_Response watch/change_state matches(out.turned),
          float64 speed matches(in.speed), float64 motor matches(out.motor) )
  guarantee still ( in.turn == deactivate -> out.motor == 0 )
  guarantee bound ( out.motor <= in.speed or out.motor == 0 )
}
"""
MOTOR = """\
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from std_msgs.msg import Float64


class Watch(LifecycleNode):
    on = False

    def __init__(self):
        super().__init__("watch")

    def on_configure(self, state):
        self.motor = self.create_publisher(Float64, "motor", 10)
        self.speed = self.create_subscription(Float64, "speed", self.move, 10)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        self.on = True
        return super().on_activate(state)

    def on_deactivate(self, state):
        self.on = False
        self.motor.publish(Float64())
        return super().on_deactivate(state)

    def on_cleanup(self, state):
        self.destroy_subscription(self.speed)
        self.destroy_publisher(self.motor)
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state):
        self.on = False
        return TransitionCallbackReturn.SUCCESS

    def move(self, message):
        self.motor.publish(Float64(data=message.data if self.on else 0.0))
"""
SPIN = """\
node watch {
  inputs( turns : INTEGER )
  outputs( taken : BOOL, done : INTEGER, sofar : INTEGER, status : INTEGER )
  topics( mover/Spin_Goal spin matches(in.turns), mover/Spin_Result spin matches(out.done),
          mover/Spin_Feedback spin matches(out.sofar), action_msgs/CancelGoal_Request spin/_action/cancel_goal,
          mover/Spin_SendGoal_Response spin/_action/send_goal matches(out.taken),
          mover/Spin_GetResult_Response spin/_action/get_result matches(out.status) )
  guarantee taken ( out.taken <=> 0 < in.turns and in.turns <= 3 )
  guarantee done ( out.done <= in.turns )
  guarantee bounded ( 1 <= out.sofar and out.sofar <= in.turns )
  guarantee ended ( out.status == 4 or out.status == 5 )
}
"""
ACTION = """\
import time

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from mover.action import Spin


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.server = ActionServer(
            self,
            Spin,
            "spin",
            execute_callback=self.execute,
            callback_group=ReentrantCallbackGroup(),
            goal_callback=self.asked,
            cancel_callback=lambda handle: CancelResponse.ACCEPT,
        )

    def asked(self, goal):
        return GoalResponse.ACCEPT if 0 < goal.turns <= 3 else GoalResponse.REJECT

    async def execute(self, handle):
        feedback, result = Spin.Feedback(), Spin.Result()
        for turn in range(handle.request.turns):
            if handle.is_cancel_requested:
                handle.canceled()
                return result
            feedback.sofar = turn + 1
            handle.publish_feedback(feedback)
            time.sleep(0.25)
            result.done = turn + 1
        handle.succeed()
        return result
"""
SPUN = """\
node watch {
  inputs( turns : INTEGER, taken : BOOL, done : INTEGER, sofar : INTEGER )
  outputs( asked : INTEGER, shown : INTEGER, near : BOOL )
  topics( int32 turns matches(in.turns), mover/Spin_Goal spin matches(out.asked),
          mover/Spin_SendGoal_Response spin/_action/send_goal matches(in.taken),
          mover/Spin_Result spin matches(in.done), mover/Spin_Feedback spin matches(in.sofar),
          int32 shown matches(out.shown), bool near matches(out.near) )
  guarantee bounded ( out.asked <= 3 )
  guarantee shown ( out.shown == in.done )
  guarantee near ( out.near <=> in.sofar >= 2 )
}
"""
ORDERS = """\
from rclpy.action import ActionClient
from rclpy.node import Node
from mover.action import Spin
from std_msgs.msg import Bool, Int32


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.shown = self.create_publisher(Int32, "shown", 10)
        self.near = self.create_publisher(Bool, "near", 10)
        self.client = ActionClient(self, Spin, "spin")
        self.client.wait_for_server()
        self.create_subscription(Int32, "turns", self.heard, 10)

    def heard(self, message):
        goal = Spin.Goal(turns=min(message.data, 3))
        self.client.send_goal_async(goal, feedback_callback=self.going).add_done_callback(self.answered)

    def going(self, message):
        self.near.publish(Bool(data=message.feedback.sofar >= 2))

    def answered(self, future):
        handle = future.result()
        if handle.accepted:
            handle.get_result_async().add_done_callback(self.ended)

    def ended(self, future):
        self.shown.publish(Int32(data=future.result().result.done))
"""
RACING = """\
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import MultiThreadedExecutor
from rclpy.node import Node
from std_msgs.msg import Float64


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.group, self.fastest = ReentrantCallbackGroup(), 1.5
        self.allowed = self.create_publisher(Float64, "allowed", 10)
        self.state = self.create_publisher(Float64, "state", 10)
        self.create_subscription(Float64, "asked", self.heard, 10, callback_group=self.group)
        self.create_timer(0.1, self.tick, callback_group=self.group)

    def heard(self, message):
        self.allowed.publish(Float64(data=min(message.data, self.fastest)))

    def tick(self):
        fastest = 1.25
        self.state.publish(Float64(data=fastest))
        self.fastest = 1.5
"""
FENCE = """\
node watch {
  inputs( ahead : REAL )
  outputs( gone : BOOL )
  topics( float64 ahead matches(in.ahead), tf2_msgs/TFMessage /tf, bool gone matches(out.gone) )
  guarantee far ( in.ahead >= 10 -> out.gone )
}
"""
LISTENER = """\
import rclpy
import tf2_ros
from rclpy.duration import Duration
from rclpy.node import Node
from std_msgs.msg import Bool, Float64
from tf2_ros import TransformException
from tf2_ros.buffer import Buffer
from tf2_ros.transform_listener import TransformListener


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.buffer = Buffer(cache_time=Duration(seconds=5))
        self.listener = TransformListener(self.buffer, self)
        self.out = self.create_publisher(Bool, "gone", 10)
        self.create_subscription(Float64, "ahead", self.heard, 10)

    def heard(self, message):
        try:
            at = self.buffer.lookup_transform("map", "base", rclpy.time.Time())
        except TransformException as error:
            assert isinstance(error, (tf2_ros.LookupException, tf2_ros.ExtrapolationException)), error
            self.out.publish(Bool(data=True))
            return
        x = at.transform.translation.x
        self.out.publish(Bool(data=message.data + abs(x) >= 10.0))
"""
CLIENT1 = """\
import rospy
from std_msgs.msg import Bool
from std_srvs.srv import SetBool


class Watch:
    def __init__(self):
        rospy.wait_for_service("gate", timeout=2.0)
        self.gate = rospy.ServiceProxy("gate", SetBool)
        self.go = rospy.Publisher("go", Bool, queue_size=10)
        rospy.Subscriber("near", Bool, self.heard)

    def heard(self, message):
        try:
            self.go.publish(self.gate(message.data).success)
        except rospy.ServiceException:
            self.go.publish(False)
"""
LATE = """\
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64


class Watch(LifecycleNode):
    def __init__(self):
        super().__init__("watch")
        self.latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.seen, self.limit, self.timer = [], 9e9, self.create_timer(0.05, self.begin)
        self.state = self.create_publisher(Float64, "state", self.latched)
        self.state.publish(Float64(data=1.0))
        self.create_subscription(Float64, "state", self.seen.append, self.latched)
        self.create_subscription(Float64, "state", self.seen.append, 10)

    def begin(self):
        self.timer.cancel()
        assert self.seen == [Float64(data=1.0)]

    def on_configure(self, state):
        self.motor = self.create_publisher(Float64, "motor", 10)
        self.heard = self.create_subscription(Float64, "limit", self.limited, self.latched)
        self.speed = self.create_subscription(Float64, "speed", self.move, 10)
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state):
        self.destroy_subscription(self.heard)
        self.destroy_subscription(self.speed)
        return TransitionCallbackReturn.SUCCESS

    def limited(self, message):
        self.limit = message.data

    def move(self, message):
        self.motor.publish(Float64(data=min(message.data, self.limit)))
"""
LIMITED = """\
context { Turn : {configure, activate, deactivate, cleanup, shutdown}; }
node watch {
  inputs( turn : Turn, limit : REAL, speed : REAL )
  outputs( motor : REAL )
  topics( lifecycle_msgs/ChangeState_Request watch/change_state matches(in.turn), float64 limit matches(in.limit),
          float64 speed matches(in.speed), float64 motor matches(out.motor), float64 state )
  guarantee bound ( out.motor <= in.limit )
}
"""
GRIPS = """\
node watch {
  inputs( effort : REAL )
  outputs( held : BOOL )
  topics( control_msgs/GripperCommand_Goal grip matches(in.effort), control_msgs/GripperCommand_Result grip
          matches(out.held) )
  guarantee gentle ( out.held -> in.effort <= 5 )
}
"""
GRIPPER = """\
from control_msgs.action import GripperCommand
from rclpy.action import ActionServer
from rclpy.node import Node


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.server = ActionServer(self, GripperCommand, "grip", self.grip)

    def grip(self, goal):
        wanted = goal.request.command.max_effort
        result = GripperCommand.Result(effort=wanted, reached_goal=wanted <= 5.0)
        goal.succeed() if result.reached_goal else goal.abort()
        return result
"""
MONITORED = """\
node watch {
  inputs( speed : REAL, nearest : REAL )
  outputs( allowed : REAL )
  topics( float64 speed matches(in.speed), sensor_msgs/LaserScan scan matches(in.nearest),
          float64 allowed matches(out.allowed) )
  guarantee stops ( in.nearest < 1 -> out.allowed <= 0 )
  guarantee slows ( out.allowed <= in.speed or out.allowed == 0 )
}
"""
COLLISION = """\
import math

from rclpy.node import Node
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import LaserScan
from std_msgs.msg import Float64


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.nearest = None
        self.allowed = self.create_publisher(Float64, "allowed", 10)
        self.create_subscription(LaserScan, "scan", self.scanned, qos_profile_sensor_data)
        self.create_subscription(Float64, "speed", self.asked, 10)

    def scanned(self, scan):
        self.nearest = min((r for r in scan.ranges if math.isfinite(r)), default=math.inf)
        if self.nearest < 1.0:
            self.allowed.publish(Float64())

    def asked(self, message):
        stopped = self.nearest is None or self.nearest < 1.0
        self.allowed.publish(Float64(data=0.0 if stopped else message.data))
"""
PLACED = """\
node watch {
  inputs( x : REAL )
  outputs( at : REAL )
  topics( nav_msgs/Odometry odom matches(in.x), tf2_msgs/TFMessage /tf matches(out.at) )
  guarantee same ( out.at == in.x )
}
"""
BROADCASTER = """\
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from tf2_ros import TransformBroadcaster


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.broadcaster = TransformBroadcaster(self)
        self.create_subscription(Odometry, "odom", self.heard, 10)

    def heard(self, message):
        made = TransformStamped(header=message.header, child_frame_id=message.child_frame_id)
        made.transform.translation.x = message.pose.pose.position.x
        made.transform.rotation = message.pose.pose.orientation
        self.broadcaster.sendTransform(made)
"""
LOOP1 = """\
import rospy
from std_msgs.msg import Float64


class Watch:
    def __init__(self):
        self.asked = None
        self.allowed = rospy.Publisher("allowed", Float64, queue_size=10)
        rospy.Subscriber("asked", Float64, self.heard)

    def heard(self, message):
        self.asked = message.data

    def loop(self):
        rate = rospy.Rate(20)
        while not rospy.is_shutdown():
            if self.asked is not None:
                self.allowed.publish(min(1.5, self.asked))
            rate.sleep()


if __name__ == "__main__":
    rospy.init_node("watch")
    Watch().loop()
"""
SPIN1 = """\
import actionlib
import rospy
from mover.msg import SpinAction, SpinFeedback, SpinResult


class Watch:
    def __init__(self):
        self.server = actionlib.SimpleActionServer("spin", SpinAction, execute_cb=self.spin, auto_start=False)
        self.server.register_preempt_callback(lambda: rospy.loginfo("another goal"))
        self.server.start()

    def spin(self, goal):
        rate = rospy.Rate(4)
        done = 0
        while done < min(goal.turns, 3):
            if self.server.is_preempt_requested():
                self.server.set_preempted(SpinResult(done))
                return
            done += 1
            self.server.publish_feedback(SpinFeedback(sofar=done))
            rate.sleep()
        if goal.turns > 3:
            self.server.set_aborted(SpinResult(done=done), "too far")
        else:
            self.server.set_succeeded(SpinResult(done=done))
"""
SPUN1 = """\
node watch {
  inputs( turns : INTEGER )
  outputs( done : INTEGER, sofar : INTEGER, status, ended : INTEGER )
  topics( mover/Spin_Goal spin matches(in.turns), mover/Spin_Result spin matches(out.done),
          mover/Spin_Feedback spin matches(out.sofar), actionlib_msgs/GoalID spin/cancel,
          mover/Spin_GetResult_Response spin/_action/get_result matches(out.status),
          mover/Spin_GetResult_Response spin/_action/get_result matches(out.ended) )
  guarantee most ( out.done <= 3 )
  guarantee going ( 1 <= out.sofar and out.sofar <= 3 )
  guarantee whole ( out.status == 3 -> out.ended == max(in.turns, 0) )
  guarantee short ( out.status == 4 -> in.turns > 3 )
  guarantee stopped ( out.status != 3 and out.status != 4 -> out.status == 2 or (out.status == 8 and out.ended == 0) )
}
"""
ORDERS1 = """\
import actionlib
import rospy
from mover.msg import SpinAction, SpinGoal
from std_msgs.msg import Bool, Int32


class Watch:
    def __init__(self):
        self.shown = rospy.Publisher("shown", Int32, queue_size=10)
        self.near = rospy.Publisher("near", Bool, queue_size=10)
        self.client = actionlib.SimpleActionClient("spin", SpinAction)
        self.client.wait_for_server()
        rospy.Subscriber("turns", Int32, self.heard)

    def heard(self, message):
        self.client.send_goal(SpinGoal(min(message.data, 3)), done_cb=self.ended, feedback_cb=self.going)

    def going(self, feedback):
        self.near.publish(feedback.sofar >= 2)

    def ended(self, status, result):
        if status == actionlib.GoalStatus.SUCCEEDED:
            self.shown.publish(result.done)
"""
WAITS1 = """\
import actionlib
import rospy
from mover.msg import SpinAction, SpinGoal
from std_msgs.msg import Int32


class Watch:
    def __init__(self):
        self.shown = rospy.Publisher("shown", Int32, queue_size=10)
        self.client = actionlib.SimpleActionClient("spin", SpinAction)
        rospy.Subscriber("turns", Int32, self.heard)

    def heard(self, message):
        self.client.send_goal(SpinGoal(turns=min(message.data, 3)))
        came = self.client.wait_for_result(rospy.Duration(2.0))
        self.shown.publish(self.client.get_result().done if came else -1)
"""
SPUN2 = """\
node watch {
  inputs( turns : INTEGER, done : INTEGER )
  outputs( asked : INTEGER, shown : INTEGER )
  topics( int32 turns matches(in.turns), mover/Spin_Goal spin matches(out.asked),
          mover/Spin_Result spin matches(in.done), int32 shown matches(out.shown) )
  assume even ( mod(in.done, 2) == 0 )
  guarantee bounded ( out.asked <= 3 )
  guarantee shown ( mod(out.shown, 2) == 0 or out.shown == -1 )
}
"""
SPINS = {"mover/package.xml": PACKAGE["ws/src/mover/package.xml"]}
SPINS |= {"mover/action/Spin.action": "int32 turns\n---\nint32 done\n---\nint32 sofar\n"}
RANGES = "{in.left: range, in.right: range}"
NEAR = PAIRS.replace("TimeSynchronizer(both, 5)", "ApproximateTimeSynchronizer(both, 5, 0.05)").replace("assert", "#")
BEGINS = {"a lifecycle node": "active", "transitions": "unconfigured", "latched topics": "unconfigured"}
NODES = {
    "an ament package": Made(LIMIT, PACKAGE, (("min(FASTEST", "max(FASTEST"), ("FASTEST = 1.5", "FASTEST = 1.75"))),
    "a catkin package with messages": Made(
        LIMIT.replace("float64 allowed", "mover/Speed allowed"),
        CATKIN,
        (("FASTEST = 1.5", "FASTEST = 1.0"),),
        kind="rospy",
        options="messages: [mover/msg]\n",
    ),
    "a service": Made(
        STOP,
        {"src/stop.py": SERVER},
        (("= self.held\n", "= True\n"), ("0.0 if self.held else", "")),
        mapping="{out.held: success}",
    ),
    "a service of ROS 1": Made(
        STOP,
        {"src/stop.py": SERVER1},
        (("success=True", "success=False"),),
        mapping="{out.held: success}",
        kind="rospy",
    ),
    "a client of a service": Made(
        ASKED,
        {"src/client.py": CLIENT},
        (("=message.data", "=True"), ("future.result().success", "True"), ("self.gate.call_async", "self.gate.call")),
        mapping="{in.free: success}",
    ),
    "callbacks of parameters": Made(
        LIMIT, {"src/tuned.py": TUNED}, (("value > 1.5", "value > 2.5"), ("to_value=10.0", "to_value=0.5"))
    ),
    "messages of one stamp": Made(FUSED, {"src/pairs.py": PAIRS}, (("max(", "min("),), mapping=RANGES),
    "messages of near stamps": Made(FUSED, {"src/pairs.py": NEAR}, (("right.range", "0.0"),), mapping=RANGES),
    "transitions": Made(
        TURNED,
        {"src/motor.py": MOTOR},
        (("self.on = False\n        self.motor", "self.motor"), ("self.destroy_subscription(self.speed)", "pass")),
        mapping="{in.turn: transition.label, out.turned: success}",
        cases="1500",
    ),
    "a server of an action": Made(
        SPIN,
        {"mover/mover/server.py": ACTION, **SPINS},
        (
            ("<= 3 else", "<= 4 else"),
            ("return result\n            feedback", "result.done = 9; return result\n            feedback"),
            ("turn + 1\n            handle", "turn\n            handle"),
            ("handle.canceled()", "handle.abort()"),
        ),
        mapping="{out.taken: accepted, out.status: status}",
        options="messages: [mover/action]\n",
        cases="600, answers: {by: call}",
    ),
    "a client of an action": Made(
        SPUN,
        {"mover/mover/client.py": ORDERS, **SPINS},
        (("min(message.data, 3)", "message.data"), ("result.done", "result.done + 1"), (">= 2", ">= 1")),
        mapping="{in.taken: accepted}",
        options="messages: [mover/action]\n",
        cases="900",
    ),
    "a loop at a rate of ROS 1": Made(
        re.sub(".*followed.*\n", "", LIMIT),
        {"src/loop.py": LOOP1},
        (("min(1.5", "max(1.5"), ("min(1.5", "min(2.5")),
        kind="rospy",
        run="loop",
    ),
    "a server of an action of ROS 1": Made(
        SPUN1,
        {"mover/src/server.py": SPIN1, **SPINS},
        (
            ("min(goal.turns, 3)", "min(goal.turns, 4)"),
            ("sofar=done)", "sofar=done - 1)"),
            ("goal.turns > 3", "goal.turns > 2"),
            ("set_preempted(SpinResult(done))", "set_succeeded(SpinResult(done))"),
        ),
        mapping="{out.status: status, out.ended: result.done}",
        kind="rospy",
        options="messages: [mover/action]\n",
        cases="900, answers: {by: call}",
    ),
    "a client of an action of ROS 1": Made(
        re.sub(".*_SendGoal_Response.*\n", "", SPUN.replace("taken : BOOL, ", "")),
        {"mover/src/client.py": ORDERS1, **SPINS},
        (("min(message.data, 3)", "message.data"), ("result.done", "result.done + 1"), (">= 2", ">= 1")),
        kind="rospy",
        options="messages: [mover/action]\n",
        cases="900",
    ),
    "a client that waits for a result of ROS 1": Made(
        SPUN2,
        {"mover/src/client.py": WAITS1, **SPINS},
        (
            ("get_result().done", "get_result().done + 1"),
            ("if came", "if not came"),
            ("message.data, 3)", "message.data, 4)"),
        ),
        kind="rospy",
        options="messages: [mover/action]\n",
        cases="900",
    ),
    "a listener to transforms": Made(
        FENCE, {"src/fence.py": LISTENER}, (("+ abs(x)", "- abs(x)"), ("(data=True)", "(data=False)"))
    ),
    "a client of a service of ROS 1": Made(
        re.sub(".*guarantee asks.*\n", "", ASKED),  # the next message may come while a call waits
        {"src/client.py": CLIENT1},
        (("data).success", "data).message == ''"), ("publish(self", "publish(not self")),
        mapping="{in.free: success}",
        kind="rospy",
    ),
    "latched topics": Made(
        LIMITED,
        {"src/late.py": LATE},
        (
            ("self.limited, self.latched", "self.limited, 1"),
            ("self.limit)", "2 * self.limit)"),
            ("append, 10", "append, self.latched"),
        ),
        mapping="{in.turn: transition.label}",
        cases="1500",
    ),
    "an action of the distribution": Made(
        GRIPS,
        {"src/gripper.py": GRIPPER},
        (("wanted <= 5.0", "wanted <= 6.0"), ("reached_goal=wanted", "reached_goal=-wanted")),
        mapping="{in.effort: command.max_effort, out.held: reached_goal}",
        cases="600, answers: {by: call}",
    ),
    "a monitor of collisions": Made(
        MONITORED,
        {"src/collision.py": COLLISION},
        (("< 1.0\n        self.allowed", "< 0.5\n        self.allowed"), ("if math.isfinite(r)", "if r > 0.5")),
        mapping="{in.nearest: {field: ranges, take: min, nan: none, inf: none, elsewhere: 100}}",
        cases="1500",
    ),
    "a broadcaster of transforms": Made(
        PLACED,
        {"src/odometry.py": BROADCASTER},
        (("position.x", "position.y"), ("translation.x", "translation.y")),
        mapping="{in.x: pose.pose.position.x, out.at: 'transforms[0].transform.translation.x'}",
    ),
    "callbacks that run together": Made(
        re.sub(".*followed.*\n", "", LIMIT),
        {"src/racing.py": RACING},
        (("fastest = 1.25", "fastest = self.fastest = 1.75"),),
    ),
    "a lifecycle node": Made(
        LIMIT,
        {"src/camera.py": CAMERA},
        (('"fastest").value', '"fastest").value + 1'), ("super().on_activate(state)", "super().on_configure(state)")),
        params="fastest: 1.5\n",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_a_node_is_driven_and_its_mutants_are_caught(tmp_path: Path, name: str) -> None:
    made = NODES[name]
    found = verdicts(system(tmp_path / "right", made))
    assert {o.verdict for o in found.values()} == {Verdict.TESTED}, found
    assert {o.bound.get("begins") for o in found.values()} == {BEGINS.get(name)}
    for number, (old, new) in enumerate(made.mutants):
        files = {path: text.replace(old, new) for path, text in made.files.items()}
        assert files != made.files, old
        wrong = verdicts(system(tmp_path / str(number), replace(made, files=files)))
        assert {o.verdict for o in wrong.values()} != {Verdict.TESTED}, (old, new)


@pytest.mark.slow
@pytest.mark.parametrize("name", NODES)
def test_the_check_finds_no_fault_in_a_node_that_is_driven(tmp_path: Path, name: str) -> None:
    found = {d.code for d in diagnostics(load_system(system(tmp_path, NODES[name])))}
    assert not {code for code in found if code[:3] != "RCL"} - {"ROS132", "ROS134"}  # a topic without a guarantee


TREE = """
        import math

        from geometry_msgs.msg import TransformStamped
        from rclpy.time import Time

        tree = Buffer()

        def put(child, parent, at, x, yaw=0.0, static=False):
            made = TransformStamped(child_frame_id=child)
            made.header.frame_id, made.header.stamp.sec = parent, at
            made.transform.translation.x = x
            made.transform.rotation.z, made.transform.rotation.w = math.sin(yaw / 2), math.cos(yaw / 2)
            (tree.set_transform_static if static else tree.set_transform)(made, "")

        def found(target, source, at):
            try:
                made = tree.lookup_transform(target, source, Time(seconds=at))
            except TransformException as error:
                return type(error).__name__
            moved, turned = made.transform.translation, made.transform.rotation
            numbers = (moved.x, moved.y, 2 * math.atan2(turned.z, turned.w))
            return [made.header.stamp.sec, *(round(n, 6) for n in numbers)]

        for at, x, yaw in ((1, 0.0, 0.0), (3, 4.0, math.pi / 2)):
            put("base", "odom", at, x, yaw)
        put("odom", "map", 2, 10.0)
        put("odom", "map", 4, 20.0)
        put("laser", "base", 0, 1.0, static=True)
        put("other", "world", 1, 0.0)
        half, root = round(math.pi / 4, 6), round(math.sqrt(0.5), 6)
        wanted = {
            ("odom", "base", 2): [2, 2.0, 0.0, half],
            ("map", "laser", 2): [2, 12 + root, root, half],
            ("map", "base", 0): [3, 19.0, 0.0, round(math.pi / 2, 6)],
            ("laser", "base", 0): [0, -1.0, 0.0, 0.0],
            ("base", "odom", 3): [3, 0.0, 4.0, round(-math.pi / 2, 6)],
            ("base", "base", 0): [3, 0.0, 0.0, 0.0],
            ("odom", "base", 4): "ExtrapolationException",
            ("map", "base", 1): "ExtrapolationException",
            ("odom", "other", 0): "ConnectivityException",
            ("odom", "none", 1): "LookupException",
            ("/odom", "base", 1): "InvalidArgumentException",
        }
        wrong = {at: found(*at) for at in wanted if found(*at) != wanted[at]}
        assert not wrong, wrong
        put("odom", "map", 20, 0.0)
        assert found("map", "odom", 4) == "ExtrapolationException" and not tree.can_transform("map", "none", Time())
"""


@pytest.mark.slow
def test_transforms_are_those_of_tf2(tmp_path: Path) -> None:
    """Interpolated, composed and inverted, of the latest common time; none outside of the stored times."""
    made = NODES["a listener to transforms"]
    begin = '        super().__init__("watch")'
    text = made.files["src/fence.py"].replace(begin, begin + TREE)
    done = drive(system(tmp_path / "w", replace(made, files={"src/fence.py": text})), "watch")
    assert done.return_value == 0, (done.output, done.exception)


@pytest.mark.slow
def test_an_edit_of_a_module_that_a_node_imports_makes_its_evidence_stale(tmp_path: Path) -> None:
    made = NODES["an ament package"]
    folder = system(tmp_path / "contracts/w", made)
    (tmp_path / "dodo.py").touch()

    def verdict() -> str:
        done = avow("verify", cwd=tmp_path)
        assert done.returncode in (0, 1), done.stderr
        case = json.loads((tmp_path / "reports/w/report.json").read_text(encoding="utf-8"))
        (found,) = (o["status"] for o in case["obligations"] if o["obligation"]["name"] == "limited")
        return str(found)

    assert verdict() == "tested"
    edit(folder / "ws/src/mover/mover/limits.py", ("FASTEST = 1.5", "FASTEST = 1.75"))
    assert verdict() == "refuted"


REFUSED = {  # what is written in the place of a text of a node, and what is told
    "a coroutine that waits": (
        "a client of a service",
        "def heard(self, message):\n        self.gate.call_async(",
        "async def heard(self, message):\n        await self.gate.call_async(SetBool.Request())\n        (",
        "a coroutine that waits; instead: call_async and add_done_callback",
    ),
    "sleep of a constructor": (
        *("a service", "self.held = False\n        self.motor", "time.sleep(1.0)\n        self.motor"),
        "time.sleep (",
    ),
    "another service": ("a service", "SetBool", "Trigger", "subscribes to /stop/_request as std_srvs/Trigger_Request"),
    "no response": (
        "a service",
        "return response",
        "return None",
        "callback of /stop returned None: return the response",
    ),
    "not active": (
        *("a lifecycle node", "return super().on_activate(state)", "return TransitionCallbackReturn.FAILURE"),
        "RuntimeError: on_activate returned FAILURE: the node is inactive",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", REFUSED)
def test_what_a_node_may_not_do_is_told(tmp_path: Path, name: str) -> None:
    node, old, new, why = REFUSED[name]
    files = {path: text.replace(old, new) for path, text in NODES[node].files.items()}
    made = replace(NODES[node], files={path: f"import time\n{text}" for path, text in files.items()})
    done = drive(system(tmp_path / "w", made), "watch")
    told = " ".join(d.message for d in done.exception.diagnostics) if done.exception else done.output
    assert why in told


def driven(folder: Path, made: Made, *given: tuple[str, float, dict[str, Any]]) -> list[tuple[str, float, Any]]:
    """What is published on these messages (topic, seconds, fields), with its seconds and its fields by the contract."""
    found = driver(load_system(system(folder, made)), "watch")
    events = [Event(topic, round(at * SECOND), found.coded(topic, fields, "")) for topic, at, fields in given]
    run = found.run(events, 0, 3 * SECOND)
    assert not run.wrong, run.wrong
    return [(e.topic, e.at / SECOND, {k: v for k, v in found.fields(e).items() if k[0] != "_"}) for e in run.said]


@pytest.mark.parametrize("place", ["__init__", "loop"])
def test_a_rate_is_that_of_rospy(tmp_path: Path, place: str) -> None:
    """Also in the constructor; a sleep within the loop counts, and a loop that is too slow begins anew."""
    made = NODES["a loop at a rate of ROS 1"]
    text = made.files["src/loop.py"].replace("Rate(20)", "Rate(4)")
    text = text.replace("1.5, self.asked))", "9.0, self.asked))\n                rospy.sleep(max(0.0, self.asked))")
    if place == "__init__":
        text = text.replace("self.heard)\n", "self.heard)\n        self.loop()\n", 1)
        made = replace(made, run="")
    made = replace(made, files={"src/loop.py": text})
    said = driven(
        tmp_path, made, ("/asked", 0.1, {"data": 0.2}), ("/asked", 0.8, {"data": 0.7}), ("/asked", 1.8, {"data": 0.1})
    )
    times = [round(at, 2) for _, at, _ in said]
    assert times == [0.25, 0.5, 0.75, 1.0, 1.7, 2.4, 2.65, 2.9]


GOAL, RESULT, CANCEL = "/spin/_goal", "/spin/_result", "/spin/cancel"
TOLD = "/spin/_action/get_result/_response"


@pytest.mark.parametrize(
    ("given", "wanted"),
    [
        ([(GOAL, 0, 2)], [(0.5, 3, 2)]),
        ([(GOAL, 0, 4)], [(0.75, 4, 3)]),
        ([(GOAL, 0, 0)], [(0.0, 3, 0)]),
        ([(GOAL, 0, 3), (GOAL, 0.3, 1)], [(0.5, 2, 2), (0.85, 3, 1)]),  # another goal; the thread looks after 0.1 s
        ([(GOAL, 0, 3), (GOAL, 0.3, 2), (GOAL, 0.4, 1)], [(0.4, 8, 0), (0.5, 2, 2), (0.85, 3, 1)]),
        ([(GOAL, 0, 3), (CANCEL, 0.3, {})], [(0.5, 2, 2)]),
        ([(GOAL, 0, 3), (CANCEL, 0.3, {"id": "1"})], [(0.5, 2, 2)]),
        ([(GOAL, 0, 3), (CANCEL, 0.3, {"id": "other"})], [(0.75, 3, 3)]),
        ([(GOAL, 0.1, 3), (CANCEL, 0.3, {"stamp": {"secs": 0, "nsecs": 10**8}})], [(0.35, 2, 1)]),
        ([(GOAL, 0.2, 3), (CANCEL, 0.3, {"stamp": {"secs": 0, "nsecs": 10**8}})], [(0.95, 3, 3)]),
        ([(GOAL, 0, 3), (GOAL, 0.3, 2), (CANCEL, 0.4, {"id": "2"})], [(0.5, 2, 2), (0.6, 2, 0)]),  # before it began
    ],
)
@pytest.mark.slow
def test_goals_go_through_the_states_of_actionlib(
    tmp_path: Path, given: list[tuple[str, float, Any]], wanted: list[tuple[float, int, int]]
) -> None:
    events = [(topic, at, {"turns": what} if topic == GOAL else what) for topic, at, what in given]
    said = driven(tmp_path, NODES["a server of an action of ROS 1"], *events)
    told = [(at, fields["status"], fields["result"]["done"]) for topic, at, fields in said if topic == TOLD]
    assert told == wanted
    assert [fields["done"] for topic, _, fields in said if topic == RESULT] == [done for _, _, done in wanted]


def test_a_method_to_run_has_to_be_there(tmp_path: Path) -> None:
    made = replace(NODES["a loop at a rate of ROS 1"], run="loops")
    done = drive(system(tmp_path / "w", made), "watch")
    assert done.exception is not None
    assert "did you mean Watch.loop?" in str(done.exception.diagnostics)
