"""The stand-ins against ROS 1 itself: one class, under Debian's rospy and a master and driven, publishes the same."""

from __future__ import annotations

import json
import os
import subprocess
from pathlib import Path

import pytest
from helpers import wait_for
from rosmonitoring.processes import LONGEST, a_free_port, answers, running

from avow.backend_kit.programs.callbacks import SECOND, Event, driver
from avow.system.load import load_system

CONTRACT = """\
node asked {
  inputs( number : REAL )
  outputs( said : STRING )
  topics( float64 number matches(in.number), string said matches(out.said) )
  guarantee any ( out.said == out.said )
}
"""
EXPRESSIONS = [
    "rospy.Duration(1) * 2",
    "rospy.Duration(1) * 0.3",
    "3 * rospy.Duration(0.1)",
    "rospy.Duration(1) / 3",
    "rospy.Duration(1) / rospy.Duration(3)",
    "rospy.Duration(7) // rospy.Duration(2)",
    "rospy.Duration(7) // 2.5",
    "rospy.Duration(7) % rospy.Duration(2.5)",
    "rospy.Time(1) - rospy.Duration(2)",
    "rospy.Time(-1)",
    "rospy.Time(1.5, 3)",
    "str(rospy.Time(2.5))",
    "repr(rospy.Time(2, 5))",
    "repr(rospy.Duration(-2, 5))",
    "rospy.Duration(-1.9999999999)",
    "rospy.Duration(True)",
    "rospy.Duration(1) * 'x'",
    "rospy.Time(1) * 2",
    "rospy.Time(1.5).to_sec()",
    "rospy.Time(3, 7).nsecs",
    "rospy.Time(3, 7).to_nsec()",
    "rospy.Time(1.9999999999).secs",
    "rospy.Duration(-0.25).secs",
    "rospy.Duration(-0.25).nsecs",
    "rospy.Duration(-0.25).to_sec()",
    "(rospy.Time(2) - rospy.Duration(0.5)).to_sec()",
    "(rospy.Time(2) - rospy.Time(3.25)).to_sec()",
    "(rospy.Time(2) + rospy.Duration(0.1)).to_nsec()",
    "(rospy.Duration(2) + rospy.Time(0.1)).to_nsec()",
    "rospy.Time.from_sec(1e9 / 3).to_nsec()",
    "bool(rospy.Duration(0))",
    "bool(rospy.Time(0, 1))",
    "rospy.Duration(1) < rospy.Duration(2)",
    "rospy.Time(1) == rospy.Duration(1)",
    "rospy.Time(1) == rospy.Time(1.0)",
    "abs(rospy.Duration(-1.5)).to_sec()",
    "(-rospy.Duration(1.5)).secs",
    "rospy.Time(0).is_zero()",
    "rospy.Duration(1) + 1",
    "rospy.Time(1) + rospy.Time(1)",
    "rospy.Time(1) < 2",
    "Float64().data",
    "Float64(3).data",
    "Float64(data=2).data",
    "String('x') == String(data='x')",
    "String().data",
    "Float64(1, 2)",
    "Float64(nothing=1)",
    "Float64._type",
    "Header().frame_id",
    "Header().stamp.to_sec()",
    "rospy.get_name()",
    "rospy.resolve_name('x')",
    "rospy.resolve_name('~x')",
    "rospy.resolve_name('/x')",
    "rospy.get_param('~red')",
    "rospy.get_param('~none', 5)",
    "rospy.get_param('~none')",
    "rospy.has_param('~none')",
    "rospy.has_param('~red')",
    "rospy.get_namespace()",
    "rospy.is_shutdown()",
    "rospy.loginfo('a %s', 1)",
    "issubclass(rospy.ROSInterruptException, rospy.ROSException)",
    "message.data.hex()",
    "type(message.data).__name__",
    "type(message).__name__",
    "message == Float64(message.data)",
]
NODE = f"""\
import rospy
from std_msgs.msg import Float64, Header, String

EXPRESSIONS = {EXPRESSIONS!r}


class Asked:
    def __init__(self):
        rospy.init_node("asked")
        self.said = rospy.Publisher("said", String, queue_size=100)
        self.heard = 0
        rospy.Subscriber("number", Float64, self.hears)

    def hears(self, message):
        expression = EXPRESSIONS[self.heard] if self.heard < len(EXPRESSIONS) else "message.data.hex()"
        self.heard += 1
        try:
            answer = repr(eval(expression))
        except Exception:
            answer = "raises"
        self.said.publish(String(data=answer))
"""
REAL = """\
import json, sys, threading
sys.path.insert(0, sys.argv[1])
import rospy
from std_msgs.msg import Float64, String
rospy.set_param("/asked/red", 2.5)
from node import Asked
asked = Asked()
answers, came = [], threading.Semaphore(0)
def heard(message):
    answers.append(message.data)
    came.release()
rospy.Subscriber("said", String, heard)
say = rospy.Publisher("number", Float64, queue_size=100)
while not (say.get_num_connections() and asked.said.get_num_connections()):
    rospy.rostime.wallsleep(0.02)
for text in json.loads(sys.argv[2]):
    say.publish(float.fromhex(text))
    if not came.acquire(timeout=100):
        break
print(json.dumps(answers))
rospy.signal_shutdown("done")
"""
PYTHON = Path("/usr/bin/python3")
NUMBERS = [*(float(k) / 3 for k in range(len(EXPRESSIONS))), 0.1, -0.0, 5e-324, float("inf"), float("nan"), 1e300]


@pytest.mark.slow
@pytest.mark.needs_ros1
def test_a_class_publishes_the_same_under_rospy_and_driven(tmp_path: Path) -> None:
    folder = tmp_path / "w"
    folder.mkdir()
    (folder / "node.py").write_text(NODE, encoding="utf-8")
    (folder / "params.yaml").write_text("red: 2.5\n", encoding="utf-8")
    (folder / "system.rcl").write_text(CONTRACT, encoding="utf-8")
    (folder / "plan.yaml").write_text(
        "system: w\ncontract: system.rcl\nnodes:\n  asked:\n"
        "    source: {python: node.py, class: Asked, kind: rospy, parameters: params.yaml}\n",
        encoding="utf-8",
    )
    found = driver(load_system(folder), "asked")
    events = tuple(Event("/number", k * SECOND, {"d": [["data", {"f": x.hex()}]]}) for k, x in enumerate(NUMBERS, 1))
    run = found.run(events, 0, len(events) * SECOND)
    assert not run.wrong
    ours = [found.fields(event)["data"] for event in run.said]
    port = a_free_port()
    place = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(tmp_path),
    }
    (tmp_path / "real.py").write_text(REAL, encoding="utf-8")
    with running(["rosmaster", "--core", "-p", port], env=place, stdout=subprocess.DEVNULL):
        wait_for(lambda: answers(port))
        command = [PYTHON, tmp_path / "real.py", folder, json.dumps([x.hex() for x in NUMBERS])]
        done = subprocess.run(
            [str(word) for word in command], env=place, capture_output=True, text=True, timeout=LONGEST, check=False
        )
    assert done.returncode == 0, done.stderr
    theirs = json.loads(done.stdout.splitlines()[-1])
    told = [*EXPRESSIONS, *["message.data.hex()"] * (len(NUMBERS) - len(EXPRESSIONS))]
    differ = {e: (real, driven) for e, real, driven in zip(told, theirs, ours, strict=True) if real != driven}
    assert differ == {}
