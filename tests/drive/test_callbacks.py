"""Callback classes of rospy and rclpy run as they are, in virtual time; what is not driven is refused by name."""

from __future__ import annotations

import json
from importlib import import_module
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from helpers import some

from avow.backends.rosmonitoring.driving import command
from avow.base.diagnostics import Rejected
from avow.pipeline.methods import method_job
from avow.ros.bags import LIVE, PUBLISHER
from avow.system.load import load_system

CONTRACT = """\
context { Level : {green, red}; Red = 250; }
node watch {
  inputs( r : REAL )
  outputs( status : Level )
  topics( float64 r matches(in.r), string status matches(out.status) )
  guarantee high ( in.r >= Red -> out.status == red )
  guarantee low ( in.r < Red -> out.status == green )
}
"""
ROS1 = """\
import rospy
from std_msgs.msg import Float64, String


class Watch:
    def __init__(self):
        rospy.init_node("watch")
        self.red = rospy.get_param("~red", 100.0)
        self.said = rospy.Publisher("status", String, queue_size=1, latch=True)
        self.level = "green"
        rospy.Subscriber("r", Float64, self.heard)
        rospy.Timer(rospy.Duration(0.25), self.tick)

    def heard(self, message):
        self.level = "red" if message.data >= self.red else "green"
        # HERE

    def tick(self, event):
        self.said.publish(self.level)
        rospy.loginfo("%s at %s", self.level, event.current_real.to_sec())


if __name__ == "__main__":
    Watch()
    rospy.spin()
"""
ROS2 = """\
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_msgs.msg import Float64, String


class Watch(Node):
    def __init__(self):
        super().__init__("watch")
        self.red = self.declare_parameter("red", 100.0).value
        qos = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
        self.said = self.create_publisher(String, "status", qos)
        self.level = "green"
        self.create_subscription(Float64, "r", self.heard, 10)
        self.create_timer(0.25, self.tick)

    def heard(self, message):
        self.level = "red" if message.data >= self.red else "green"
        # HERE

    def tick(self):
        self.get_logger().info(f"{self.level} at {self.get_clock().now().nanoseconds}")
        self.said.publish(String(data=self.level))


def main():
    rclpy.init()
    rclpy.spin(Watch())
"""
TRACE = [("r", 0.0, 10.0), ("/r", 0.1, 250.0), ("r", 0.6, 249.99999999999997), ("other", 0.7, 1), ("r", 1.0, 300.0)]


def system(folder: Path, kind: str, text: str, methods: str = "[]") -> Path:
    (folder / "src").mkdir(parents=True)
    (folder / "system.rcl").write_text(CONTRACT, encoding="utf-8")
    (folder / "src/watch.py").write_text(text, encoding="utf-8")
    (folder / "src/params.yaml").write_text("red: 250.0\n", encoding="utf-8")
    (folder / "plan.yaml").write_text(
        "system: w\ncontract: system.rcl\nenvironment: {watch.r: {because: a sensor}}\nnodes:\n  watch:\n"
        f"    source: {{python: src/watch.py, class: Watch, kind: {kind}, parameters: src/params.yaml}}\n"
        f"    methods: {methods}\n",
        encoding="utf-8",
    )
    return folder


def trace(folder: Path) -> Path:
    path = folder / "trace.jsonl"
    lines = [json.dumps({"topic": topic, "time": at, "data": value}) for topic, at, value in TRACE]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def drive(*arguments: object) -> Result:
    return CliRunner().invoke(command, [str(a) for a in arguments], standalone_mode=False)


def told(result: Result) -> str:
    """What was rejected."""
    assert isinstance(result.exception, Rejected), result.exception
    return " ".join(f"{d.message} [{d.hint}]" for d in result.exception.diagnostics)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "text"), [("rospy", ROS1), ("rclpy", ROS2)])
def test_a_class_runs_as_it_is_and_its_recording_replays(tmp_path: Path, kind: str, text: str) -> None:
    folder = system(tmp_path / "w", kind, text)
    recording = tmp_path / "recording.jsonl"
    done = drive(folder, "watch", trace(tmp_path), "-o", recording)
    assert done.return_value == 0, (done.output, done.exception)
    events = [json.loads(line) for line in recording.read_text(encoding="utf-8").splitlines()]
    said = [(e["time"], e["data"]) for e in events if e["topic"] == "/status"]
    assert said == [(0.25, "red"), (0.5, "red"), (0.75, "green"), (1.0, "green")]  # a timer due then comes first
    assert [e["topic"] for e in events].count("/r") == 4
    again = drive(folder, "watch", recording, "--replay")
    assert again.return_value == 0, again.output
    assert "the recording has the same" in again.output
    live = tmp_path / "live.jsonl"  # as it is recorded on a running graph
    live.write_text("".join(f"{json.dumps({**event, LIVE: True, PUBLISHER: '/n'})}\n" for event in events), "utf-8")
    assert drive(folder, "watch", live, "--replay").return_value == 0
    changed = recording.read_text(encoding="utf-8").replace('0.500000000, "data": "red"', '0.5, "data": "green"')
    recording.write_text(changed, encoding="utf-8")
    other = drive(folder, "watch", recording, "--replay")
    assert other.return_value == 1
    assert "/status: publication 2 is" in other.output


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "reds", "told_"),
    [
        ("red: 250.0", 2, ""),
        ("/w: {ros__parameters: {red: 250.0}}", 2, ""),
        ("'/**': {ros__parameters: {red: 1.0, use_sim_time: true}}\nw: {ros__parameters: {red: 250.0}}", 2, ""),
        ("'/**': {ros__parameters: {red: 1000.0}}", 0, ""),
        ("other: {ros__parameters: {red: 250.0}}", 0, "sets nothing for /w, but for /other"),
        ("w: {ros_parameters: {red: 250.0}}", 0, "/w has `ros_parameters`: write `ros__parameters`, with two"),
        ("w: {ros__parameters: {redd: 250.0}}", 0, "the parameter redd is set, and the class declares red"),
        ("redd: 250.0", 0, "the parameter redd is set, and the class declares red"),
        ("w: {ros__parameters: {red: '250'}}", 0, "is declared as 100.0, and set to '250'"),
        ("w: {ros__parameters: {red: 250}}", 0, "is declared as 100.0, and set to 250: write 250.0"),
    ],
)
def test_a_class_has_the_parameters_that_ros2_reads(tmp_path: Path, parameters: str, reds: int, told_: str) -> None:
    """Never its code's defaults in the place of what the file sets."""
    folder = system(tmp_path / "w", "rclpy", ROS2)
    (folder / "src/params.yaml").write_text(parameters, encoding="utf-8")
    plan = folder / "plan.yaml"
    plan.write_text(plan.read_text(encoding="utf-8") + "ros: {nodes: {watch: {name: /w}}}\n", encoding="utf-8")
    recording = tmp_path / "recording.jsonl"
    done = drive(folder, "watch", trace(tmp_path), "-o", recording)
    if told_:
        assert told_ in told(done)
        assert isinstance(done.exception, Rejected)
        assert all(d.span and Path(d.span.file).name == "params.yaml" for d in done.exception.diagnostics)
    else:
        assert recording.read_text(encoding="utf-8").count('"data": "red"') == reds


CAUGHT = {
    "rospy.wait_for_message('r', Float64)": "rospy.wait_for_message",
    "import actionlib.action_server as _": "the module actionlib.action_server",
    "hasattr(rospy, 'SubscribeListener')": "rospy.SubscribeListener",
    "self.said.get_num_connections()": "rospy.Publisher.get_num_connections",
    "import tf as _": "the module tf",
    "import rospy.core as _": "the module rospy.core",
    "import nav_msgs.msg as _": "the module nav_msgs",
    "from rospy import AnyMsg as _": "rospy.AnyMsg",
}


@pytest.mark.slow
def test_what_of_ros_is_not_driven_is_refused_by_name_also_where_it_is_caught(tmp_path: Path) -> None:
    lines = "".join(f"\n        try: {line}\n        except Exception: pass" for line in CAUGHT)
    folder = system(tmp_path / "w", "rospy", ROS1.replace("# HERE", lines))
    found = told(drive(folder, "watch", trace(tmp_path)))
    assert [line for line, why in CAUGHT.items() if why not in found] == []


REFUSED = [
    ("open('/tmp/x', 'w')", "not driven: a change of files (/tmp/x) (watch.py, line"),
    ("import os; os.system('true')", "not driven: a program (b'true') (watch.py, line"),
    ("import threading; threading.Thread(target=int).start()", "a thread of its own (watch.py, line"),
    ("import _thread; _thread.start_new_thread(int, ())", "a thread of its own (watch.py, line"),
    ("rospy.Timer(rospy.Duration(1e-9), lambda event: None)", "more than"),
]


CLOCKS = ["time.time()", "time.monotonic()", "time.perf_counter_ns()", "time.sleep(0)", "time.localtime()"]
CLOCKS += ["datetime.datetime.now()", "datetime.datetime.utcnow()", "datetime.date.today()"]
CHANCE = ["random.random()", "random.seed(); random.choice([1, 2])", "random.seed(None); random.gauss(0, 1)"]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "instead"), [("rospy", "rospy.Time.now()"), ("rclpy", "get_clock().now()")])
def test_a_clock_of_python_and_chance_are_refused_by_name_and_line(tmp_path: Path, kind: str, instead: str) -> None:
    """Also where two runs agree by chance, or it is caught; dates without a clock, and Python's own use, are driven."""
    text = ROS1 if kind == "rospy" else ROS2
    lines = "import datetime, logging, time, threading; logging.warning('x'); threading.Event().wait(0.001)"
    lines += "\n        day = datetime.datetime(2026, 1, 1) + datetime.timedelta(1); assert day.day == 2"
    lines += "\n        assert isinstance(day, datetime.datetime) and isinstance(day, datetime.date)"
    lines += "\n        class Mixed: pass\n        class Own(Mixed, datetime.datetime): pass"
    lines += "\n        assert isinstance(Own(2026, 1, 1), Own) and not isinstance(day, Own)"
    folder = system(tmp_path / "w", kind, text.replace("# HERE", lines))
    done = drive(folder, "watch", trace(tmp_path))
    assert done.return_value == 0, (done.output, done.exception)
    lines = lines.replace("import datetime,", "import random, datetime,")
    lines += "".join(f"\n        try: {line}\n        except Exception: pass" for line in (*CLOCKS, *CHANCE))
    lines += "\n        random.seed(7); random.random(); random.Random(3).random()"
    (folder / "src/watch.py").write_text(text.replace("# HERE", lines), encoding="utf-8")
    found = told(drive(folder, "watch", trace(tmp_path)))
    first = text[: text.index("# HERE")].count("\n") + 7
    wanted = [f"{line.partition('(')[0]} (watch.py, line {first + 2 * at})" for at, line in enumerate(CLOCKS)]
    wanted = [why for why in wanted if not why.startswith("time.sleep")]  # a callback may sleep
    wanted += [f"random.{name} (watch.py, line " for name in ("random", "choice", "gauss")]
    assert [why for why in wanted if why not in found] == [], found
    assert found.count("; instead: random.Random(0)") == 3
    assert f"; instead: {instead}" in found


@pytest.mark.slow
@pytest.mark.parametrize(("line", "why"), some(REFUSED, 3))
def test_a_recording_hangs_on_nothing_else(tmp_path: Path, line: str, why: str) -> None:
    folder = system(tmp_path / "w", "rospy", ROS1.replace("# HERE", line))
    assert why in told(drive(folder, "watch", trace(tmp_path)))


SETTERS = [  # field, a value that rosidl's setter takes, and one that it does not
    ("number", "1.0", "1"),
    ("number", "float('inf')", "'1.0'"),
    ("single", "0.1", "1e39"),
    ("single", "0.1", "True"),
    ("whole", "True", "1.0"),
    ("whole", "-128", "128"),
    ("whole", "5", "'5'"),
    ("flag", "True", "1"),
    ("word", "'a'", "b'a'"),
    ("numbers", "(1.0, 2.0)", "[1]"),
    ("numbers", "array.array('d', [1.0])", "array.array('f', [1.0])"),
    ("three", "[1.0, 2.0, 3.0]", "[1.0, 2.0]"),
    ("words", "{'a'}", "'a'"),
    ("inner", "Float64(data=1.0)", "1.0"),
    ("inners", "[Float64()]", "[1.0]"),
    ("at", "Time(sec=1)", "1.0"),
]
FIELDS = """\
float64 number
float32 single
int8 whole
bool flag
string word
float64[] numbers
float64[3] three
string[] words
std_msgs/Float64 inner
std_msgs/Float64[] inners
builtin_interfaces/Time at
"""


@pytest.mark.slow
def test_fields_of_ros_2_take_what_its_setters_take(tmp_path: Path) -> None:
    """At the assignment and in the constructor, whether or not the message is published."""
    lines = "import array; from own_msgs.msg import All; from std_msgs.msg import Float64"
    lines += "; from builtin_interfaces.msg import Time; made, wrong = All(), []"
    for field, good, bad in SETTERS:
        lines += f"\n        made.{field} = {good}; All({field}={good})"
        for line in (f"made.{field} = {bad}", f"All({field}={bad})"):
            lines += f"\n        try: {line}\n        except AssertionError: pass\n        else: wrong.append({line!r})"
    lines += "\n        made.numbers.append(1)\n        assert made.numbers[-1:].tolist() == [1.0]"
    lines += "\n        if wrong: raise ValueError(wrong)"
    folder = system(tmp_path / "w", "rclpy", ROS2.replace("# HERE", lines))
    (folder / "msg/own_msgs/msg").mkdir(parents=True)
    (folder / "msg/own_msgs/msg/All.msg").write_text(FIELDS, encoding="utf-8")
    plan = folder / "plan.yaml"
    plan.write_text(plan.read_text(encoding="utf-8") + "messages: [msg]\n", encoding="utf-8")
    done = drive(folder, "watch", trace(tmp_path))
    assert done.return_value == 0, (done.output, done.exception)
    for line in ("self.said.publish(String(data=1))", "message.data = 1", "String(dat='x')"):
        (folder / "src/watch.py").write_text(ROS2.replace("# HERE", line), encoding="utf-8")
        done = drive(folder, "watch", trace(tmp_path))
        assert done.return_value == 1, (line, done.output)
        assert "AssertionError" in done.output


UNSUPPORTED = {  # what of rclpy is used, and what is told besides its name and line
    "self.context": "rclpy.node.Node.context (watch.py, line {})",
    "message.SLOT_TYPES": "Float64.SLOT_TYPES (watch.py, line {})",
    "assert [*String.get_fields_and_field_types()] == ['data']; String.get_fields_and_field_types()['data']": (
        "the type of a field in get_fields_and_field_types() (watch.py, line {})"
    ),
    "self.get_logger().fatally": "RcutilsLogger.fatally (watch.py, line {})",
    "self.create_guard_condition(print)": "rclpy.node.Node.create_guard_condition (watch.py, line {})",
    "self.add_pre_set_parameters_callback(print)": "Node.add_pre_set_parameters_callback (watch.py, line {})",
    "self.create_timer(1.0, print, clock=self.get_clock())": "create_timer(clock=) (watch.py, line {}); instead: ",
    "self.create_timer(1.0, print, autostart=False)": "create_timer(autostart=) (watch.py, line {})",
    "Node('other', allow_undeclared_parameters=True)": "parameters=) (watch.py, line {}); instead: declare_parameter",
    "self.create_subscription(String, 's', print, 1, raw=True)": "create_subscription(raw=) (watch.py, line {})",
    "import nav_msgs.msg as _": "the module nav_msgs (watch.py, line {}); instead: its definitions",
}


@pytest.mark.slow
def test_what_of_ros_2_is_not_driven_has_its_line_and_an_alternative(tmp_path: Path) -> None:
    lines = "".join(f"\n        try: {line}\n        except Exception: pass" for line in UNSUPPORTED)
    first = ROS2[: ROS2.index("# HERE")].count("\n") + 2
    folder = system(tmp_path / "w", "rclpy", ROS2.replace("# HERE", lines))
    found = told(drive(folder, "watch", trace(tmp_path)))
    wanted = [why.format(first + 2 * at) for at, why in enumerate(UNSUPPORTED.values())]
    assert [why for why in wanted if why not in found] == [], found


QOS = 'self.said = self.create_publisher(String, "status", qos)'
WRONG = [  # what rclpy rejects when a node is made: a text of it, what is in its place, and the error
    (
        QOS,
        QOS.replace("qos", "queue_size=1"),
        "TypeError: Node.create_publisher() has no argument 'queue_size': the de",
    ),
    (
        QOS,
        QOS.replace("qos", "'1'"),
        "TypeError: qos_profile of Node.create_publisher() is '1', and has to be a QoSProf",
    ),
    (
        QOS,
        QOS.replace("qos", "-1"),
        "ValueError: qos_profile of Node.create_publisher() is -1, and has to be a QoSProf",
    ),
    ("self.heard, 10", "self.heard", "TypeError: qos_profile of Node.create_subscription() is None, and has to be a Q"),
    ("depth=1, ", "", "InvalidQoSProfileException: QoSProfile with the history KEEP_LAST needs depth="),
    ("reliability=", "reliabilty=", "AssertionError: QoSProfile has history, depth, reliability, "),
    ("=ReliabilityPolicy.RELIABLE", "='reliable'", "AssertionError: reliability of a QoSProfile is a ReliabilityPol"),
    ("RELIABLE)", "RELIABEL)", "AttributeError: RELIABEL: did you mean ReliabilityPolicy.RELIABLE?"),
    ('super().__init__("watch")', "pass", "Watch is used before its __init__ calls super().__init__(name)"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("old", "new", "why"), some(WRONG, 3))
def test_what_rclpy_rejects_is_an_error_of_the_class(tmp_path: Path, old: str, new: str, why: str) -> None:
    result = drive(system(tmp_path / "w", "rclpy", ROS2.replace(old, new)), "watch")
    found = told(result)
    assert f"Watch cannot be constructed: {why}" in found or f"RuntimeError: {why}" in found
    assert "(watch.py, line 1" in found
    assert "watch.py:1" in str(result.exception)  # the place is the class's, not the plan's


@pytest.mark.slow
def test_typed_parameter_values_and_exclusive_groups_are_driven(tmp_path: Path) -> None:
    values = {"True": "bool", "3": "integer", "2.5": "double", "'a'": "string", "[True]": "bool_array"}
    values |= {"[3]": "integer_array", "[2.5]": "double_array", "['a']": "string_array"}
    lines = "from rclpy.callback_groups import MutuallyExclusiveCallbackGroup as G; wrong = []"
    lines += "\n        self.create_subscription(String, 's', print, 1, callback_group=G())"
    lines += "\n        self.get_logger().get_child('x').warn('a', once=True)"
    lines += "\n        import rclpy; assert rclpy.ok() and self.get_clock().now().seconds_nanoseconds() <= (1, 0)"
    lines += "\n        self.create_timer(9.0, print, callback_group=G()); self.create_timer(9.0, print, None)"
    for value, kind in values.items():
        name = f"p{kind}"
        lines += f"\n        if not self.has_parameter('{name}'): self.declare_parameter('{name}', {value})"
        lines += f"\n        held = self.get_parameter('{name}').get_parameter_value()"
        lines += f"\n        others = [k for k in vars(held) if k not in ('type', '{kind}_value') and getattr(held, k)]"
        array_of = "list" if value.startswith("[") else ""
        lines += f"\n        same = {array_of}(held.{kind}_value) == {value}"
        lines += f"\n        if others or not same: wrong.append('{kind}')"
    lines += "\n        from rclpy.qos import DurabilityPolicy as D, QoSProfile as Q, qos_profile_sensor_data as s"
    lines += "\n        assert Q(depth=1, durability=D.RMW_QOS_POLICY_DURABILITY_TRANSIENT_LOCAL).durability == 1"
    lines += "\n        assert Q(history=2).depth == 10 and (s.depth, s.reliability) == (5, 2)"
    lines += "\n        assert wrong == [], wrong"
    done = drive(system(tmp_path / "w", "rclpy", ROS2.replace("# HERE", lines)), "watch", trace(tmp_path))
    assert done.return_value == 0, (done.output, done.exception)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "why"),
    some(
        [
            (
                '"r", Float64',
                '"q", Float64',
                "never subscribes to /r, which carries r: it subscribes to /q [correct the topic in the",
            ),
            ('"r", Float64', '"r", String', "subscribes to /r as std_msgs/String"),
            ('"status", String', '"~status", String', "never publishes /status"),
            (
                "class Watch:",
                "class Watcher:",
                "cannot be loaded: AttributeError: watch.py has no class 'Watch': did you",
            ),
            ("def __init__(self):", "def __init__(self):\n        1 / 0", "ZeroDivisionError"),
        ],
        2,
    ),
)
def test_a_class_that_does_not_fit(tmp_path: Path, old: str, new: str, why: str) -> None:
    assert why in told(drive(system(tmp_path / "w", "rospy", ROS1.replace(old, new)), "watch"))


RAISED = [  # kind, what raises in the callback of a message (or, after TICK, of a timer), where it is told
    ("rospy", "1 / 0", "raised at message 1 on /r: ZeroDivisionError"),
    ("rospy", "self.said.publish(5)", "raised at message 1 on /r: TypeError"),
    ("rclpy", "message.no_field = 1", "raised at message 1 on /r: AttributeError"),
    ("rclpy", "message.no_field", "raised at message 1 on /r: AttributeError"),
    ("rclpy", "self.create_timer(0.01, lambda: 1 / 0)", "raised after message 1: ZeroDivisionError"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "line", "why"), some(RAISED, 2))
def test_what_a_callback_raises_has_its_message_topic_and_line(tmp_path: Path, kind: str, line: str, why: str) -> None:
    text = ROS1 if kind == "rospy" else ROS2
    done = drive(system(tmp_path / "w", kind, text.replace("# HERE", line)), "watch", trace(tmp_path))
    assert done.return_value == 1
    assert why in done.output
    assert f" (watch.py, line {text[: text.index('# HERE')].count(chr(10)) + 1})" in done.output


def test_a_callback_that_takes_no_message_is_told_at_its_line(tmp_path: Path) -> None:
    text = ROS2.replace("def heard(self, message)", "def heard(message)")
    done = drive(system(tmp_path / "w", "rclpy", text), "watch", trace(tmp_path))
    line = text[: text.index("def heard(message)")].count("\n") + 1
    assert f"takes 1 positional argument but 2 were given (watch.py, line {line})" in " ".join(done.output.split())


LOADED = [  # the first line of the file, and what is told if it cannot be loaded
    ("from .helper import x", "no known parent package (watch.py, line 1); a relative import needs the file in the"),
    ("from rospy import AnyMsg", "rospy.AnyMsg is not driven (watch.py, line 1)"),
    (
        "import no_such_module",
        "'no_such_module': install it where Avow runs, or put its file beside watch.py (watch.py",
    ),
    ("import json.decode", "json has no decode.py: did you mean decoder? (watch.py, line 1)"),
    ("from std_msgs.msg import Strng", "std_msgs.msg.Strng is not driven; instead: String (watch.py, line 1)"),
    ("import std_ms_io", "'std_ms_io': install it where Avow runs, or put its file beside watch.py (watch.py"),
    ("import std_msg.msg", "No module named 'std_msg': did you mean std_msgs? (watch.py, line 1)"),
    ("1 / 0", "division by zero (watch.py, line 1)"),
]


@pytest.mark.parametrize(
    ("kind", "distro", "wanted"),
    [
        ("rospy", "", "ros: {distro: noetic}"),
        ("rclpy", "", "ros: {distro: humble}"),
        ("rclpy", "jazzy", "jazzy has no such message"),
    ],
)
def test_advice_on_a_missing_message_fits_the_plan(tmp_path: Path, kind: str, distro: str, wanted: str) -> None:
    """A distribution is proposed only if the plan names none, and only one of the class's ROS."""
    pytest.importorskip("rosbags")
    folder = system(tmp_path / "w", kind, ROS1 if kind == "rospy" else ROS2)
    contract = CONTRACT.replace("string status", "rover_msgs/Level status")
    (folder / "system.rcl").write_text(contract, encoding="utf-8")
    (folder / "msg/rover_msg/msg").mkdir(parents=True)
    (folder / "msg/rover_msg/msg/Level.msg").write_text("string data\n", encoding="utf-8")
    more = f"messages: [msg]\n{f'ros: {{distro: {distro}}}' if distro else ''}\n"
    plan = folder / "plan.yaml"
    plan.write_text(f"{plan.read_text(encoding='utf-8')}    mapping: {{out.status: data}}\n{more}", encoding="utf-8")
    result = drive(folder, "watch")
    assert isinstance(result.exception, Rejected), result.exception
    (found,) = result.exception.diagnostics
    assert found.code == "DRIVE101"
    told_ = f"{found.message} {found.hint}"
    assert wanted in told_
    assert "did you mean `rover_msg/Level`?" in told_
    assert "msg/rover_msgs/msg/Level.msg" in told_
    assert ("distro:" in told_) == (not distro)


@pytest.mark.slow
@pytest.mark.parametrize(("line", "why"), some(LOADED, 2))
def test_a_file_that_cannot_be_loaded_has_its_own_line(tmp_path: Path, line: str, why: str) -> None:
    found = told(drive(system(tmp_path / "w", "rospy", f"{line}\n{ROS1}"), "watch"))
    assert why in found
    assert not [word for word in ("importlib", "callbacks.py", "avow_subject") if word in found]


@pytest.mark.slow
def test_generated_messages_are_the_same_for_a_seed(tmp_path: Path) -> None:
    folder = system(tmp_path / "w", "rospy", ROS1)
    made = []
    for seed in (1, 1, 2):
        assert drive(folder, "watch", "--messages", 30, "--seed", seed, "-o", tmp_path / "made").return_value == 0
        made.append((tmp_path / "made").read_text(encoding="utf-8"))
    assert made[0] == made[1] != made[2]
    assert '"red"' in made[0]
    assert '"green"' in made[0]


def test_the_method_about_a_step_refuses_callbacks(tmp_path: Path) -> None:
    loaded = load_system(system(tmp_path / "w", "rospy", ROS1, "[python]"))
    (method,) = loaded.plan.node("watch").methods
    tool = import_module("avow.backends.python").BACKEND
    found = tool.check(method_job(loaded, loaded.contract.node("watch"), method))
    assert any("kind is rospy" in d.message and d.is_error for d in found)


@pytest.mark.slow
def test_what_is_published_at_a_message_s_time_stands_where_it_came_about(tmp_path: Path) -> None:
    """A timer that is due then comes first: what it publishes does not answer the message."""
    recorded = tmp_path / "trace.jsonl"
    lines = [{"topic": "r", "time": at, "data": value} for at, value in ((0.0, 10.0), (0.25, 300.0), (0.5, 10.0))]
    recorded.write_text("\n".join(map(json.dumps, lines)), encoding="utf-8")
    made = tmp_path / "made.jsonl"
    assert drive(system(tmp_path / "w", "rospy", ROS1), "watch", recorded, "-o", made).return_value == 0
    told = [(e["topic"], e["data"]) for e in map(json.loads, made.read_text(encoding="utf-8").splitlines())]
    assert told == [("/r", 10.0), ("/status", "green"), ("/r", 300.0), ("/status", "red"), ("/r", 10.0)]


def test_a_step_class_has_no_topics(tmp_path: Path) -> None:
    folder = system(tmp_path / "w", "step", "class Watch:\n    def step(self, r):\n        return 'red'\n")
    assert all(words in told(drive(folder, "watch")) for words in ("has no topics", "add `kind: rclpy`"))


@pytest.mark.slow
@pytest.mark.parametrize("form", some(["ros1", "mcap"], 1))
def test_a_bag_is_a_recording_too(tmp_path: Path, form: str) -> None:
    pytest.importorskip("rosbags")
    from rosmonitoring.test_bags import write_bag

    readings = [{"data": 10.0}, {"data": 250.0}, {"data": float("nan")}]
    start = 1_732_448_384_123_456_789
    bag = write_bag(tmp_path / "b", form, "std_msgs/msg/Float64", readings, start=start)
    text = ROS1.replace('"r"', '"v"').replace("# HERE", "assert message.data != 10.0 or type(message.data) is float")
    folder = system(tmp_path / "w", "rospy", text)
    (folder / "system.rcl").write_text(CONTRACT.replace("float64 r", "float64 v"), encoding="utf-8")
    done = drive(folder, "watch", bag, "-o", tmp_path / "made.jsonl")
    assert done.return_value == 0, (done.output, done.exception)
    assert "watch: 3 messages heard, 8 published" in done.output
    heard = [line for line in (tmp_path / "made.jsonl").read_text().splitlines() if '"/v"' in line]
    assert [f'"time": {start // 10**9 + k}.123456789' in line for k, line in enumerate(heard, 1)] == [True] * 3
    assert drive(folder, "watch", tmp_path / "made.jsonl", "--replay").return_value == 0


STAMPS = [  # nanoseconds that the robot's stamps are later (None: all 0), a planted difference, the code
    (3_000_000, False, 0),
    (3_000_000, True, 1),
    (3_000_000_000, False, 1),  # no clock's time
    (None, False, 1),
]


@pytest.mark.slow
@pytest.mark.parametrize(("later", "planted", "code"), STAMPS)
def test_stamps_of_clocks_are_times(tmp_path: Path, later: int | None, planted: bool, code: int) -> None:
    """Counted, and not compared; any other difference is shown alone."""
    text = ROS2.replace("String\n", "String\nfrom own_msgs.msg import Stamped\n").replace("(String, ", "(Stamped, ")
    made = "message = Stamped(data=self.level)\n        message.header.stamp = self.get_clock().now().to_msg()"
    text = text.replace("self.said.publish(String(data=self.level))", f"{made}\n        self.said.publish(message)")
    folder = system(tmp_path / "w", "rclpy", text)
    (folder / "msg/own_msgs/msg").mkdir(parents=True)
    (folder / "msg/own_msgs/msg/Stamped.msg").write_text("std_msgs/Header header\nstring data\n", encoding="utf-8")
    contract = CONTRACT.replace("string status", "own_msgs/Stamped status")
    (folder / "system.rcl").write_text(contract, encoding="utf-8")
    plan = folder / "plan.yaml"
    more = "    mapping: {out.status: data}\nmessages: [msg]\n"
    plan.write_text(plan.read_text(encoding="utf-8") + more, encoding="utf-8")
    recording = tmp_path / "recording.jsonl"
    done = drive(folder, "watch", trace(tmp_path), "-o", recording)
    assert done.return_value == 0, (done.output, done.exception)
    events = [json.loads(line) for line in recording.read_text(encoding="utf-8").splitlines()]
    said = [event for event in events if event["topic"] == "/status"]
    for event in said:
        stamp = event["header"]["stamp"]
        at = stamp["sec"] * 10**9 + stamp["nanosec"] + later if later is not None else 0
        event["header"]["stamp"] = dict(zip(("sec", "nanosec"), divmod(at, 10**9), strict=True))
    said[1]["data"] = "other" if planted else said[1]["data"]
    recording.write_text("".join(f"{json.dumps(event)}\n" for event in events), encoding="utf-8")
    done = drive(folder, "watch", recording, "--replay")
    assert done.return_value == code, (done.output, done.exception)
    near = later is not None and later < 10**9
    assert (f"/status: {4 - planted} differ only in header.stamp" in done.output) == near
    assert done.output.count("/status: publication") == (planted if near else 4)


@pytest.mark.slow
def test_nothing_is_not_the_same(tmp_path: Path) -> None:
    silent = ROS1.replace("rospy.Timer(rospy.Duration(0.25), self.tick)", "pass")
    done = drive(system(tmp_path / "w", "rospy", silent), "watch", trace(tmp_path), "--replay")
    assert done.return_value == 1
    assert "nothing to compare" in done.output


@pytest.mark.slow
def test_a_recorded_message_without_fields_is_not_the_same(tmp_path: Path) -> None:
    recorded = trace(tmp_path)
    said = "".join(f'\n{{"topic": "status", "time": {at}}}' for at in (1.0, 1.0, 1.0, 1.0))
    recorded.write_text(recorded.read_text(encoding="utf-8") + said, encoding="utf-8")
    assert drive(system(tmp_path / "w", "rospy", ROS1), "watch", recorded, "--replay").return_value == 1
