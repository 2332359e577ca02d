"""What `avow check` says of a callback class from its text: certain faults alone."""

from __future__ import annotations

from pathlib import Path

import pytest
from helpers import avow

CONTRACT = """
node a { inputs( x : REAL ) outputs( y : REAL )
  topics( std_msgs/Float64 /x matches(in.x), std_msgs/Float64 /y matches(out.y) ) guarantee g ( out.y == in.x ) }
"""
SOURCE = """\
import math, threading
import rclpy, rospy
from rclpy.node import Node


class A(Node):
    def __init__(self):
        super().__init__("a")
        REGISTERED

    METHOD
"""


def told(folder: Path, registered: str, method: str, kind: str = "rclpy") -> list[tuple[str, str]]:
    """The codes and hints about the class."""
    (folder / "system.rcl").write_text(CONTRACT, "utf-8")
    text = SOURCE.replace("REGISTERED", registered).replace("METHOD", method)
    (folder / "a.py").write_text(text, "utf-8")
    source = f"nodes: {{a: {{source: {{python: a.py, class: A, kind: {kind}}}, methods: []}}}}\n"
    (folder / "plan.yaml").write_text(source, "utf-8")
    printed = avow("check", str(folder), cwd=folder).stdout
    blocks = [block for block in printed.split("\n\n") if "[DRIVE" in block]
    assert all("a.py:" in block for block in blocks)
    return [(block.partition("[")[2][:8], block.partition("help: ")[2].partition("\n")[0]) for block in blocks]


HEAR, TICK = "self.create_subscription(int, '/x', self.heard, 10)", "self.create_timer(1.0, callback=self.tick)"
SERVE = "self.create_service(int, '/s', self.serve)"


@pytest.mark.parametrize(
    ("registered", "method", "hint"),
    [
        (HEAR, "def heard(message): pass", "write `def heard(self, message)`"),
        (HEAR, "def heard(self): pass", "write `def heard(self, message)`"),
        (HEAR, "async def heard(self, a, b, c): pass", "write `def heard(self, message)`"),
        (HEAR, "def heard(self, message, *, extra): pass", "write `def heard(self, message)`"),
        (TICK, "def tick(): pass", "write `def tick(self)`"),
        (TICK, "def tick(self, event): pass", "write `def tick(self)`"),
        (SERVE, "def serve(self, r): pass", "write `def serve(self, request, response)`"),
        ("rospy.Subscriber('/x', int, self.heard)", "def heard(): pass", "write `def heard(self, message)`"),
        (SERVE, "def serve(self, r): return response", "write `def serve(self, request, response)`"),
        ("rospy.Timer(1, self.tick)", "def tick(self): pass", "write `def tick(self, event)`"),
    ],
)  # fmt: skip
def test_a_callback_that_does_not_take_what_it_is_called_with(
    registered: str, method: str, hint: str, tmp_path: Path
) -> None:
    assert told(tmp_path, registered, method) == [("DRIVE105", hint)]


@pytest.mark.parametrize(
    ("registered", "method"),
    [
        (HEAR, "def heard(self, message, info=None): pass"),
        (HEAR, "def heard(self, *given): pass"),
        (HEAR, "@staticmethod\n    def heard(message): pass"),
        (HEAR, "def other(self): pass"),
        ("self.create_subscription(int, '/x', lambda m: m, 10)", "def heard(self): pass"),
        ("self.heard = print; self.create_subscription(int, '/x', self.heard, 10)", "def heard(): pass"),
        ("threading.Timer(1.0, self.tick)", "def tick(self): pass"),
        ("rospy.Timer(1, self.tick)", "def tick(self, event): print(math.pi)"),
        ("rospy.Subscriber('/x', int, self.heard, 3)", "def heard(self, message, three): pass"),
        ("print([each for each in (lambda z: z)(())])", "def f(self, *a, **b):\n        global g; print(a, b, g)"),
        ("print(__file__, __name__)", "def f(self):\n        try: pass\n        except OSError as e: print(e)"),
    ],
)  # fmt: skip
def test_what_may_be_right_is_not_told(registered: str, method: str, tmp_path: Path) -> None:
    assert told(tmp_path, registered, method) == []


def test_a_callback_whose_name_the_class_has_otherwise(tmp_path: Path) -> None:
    assert told(tmp_path, HEAR, "def herd(self, message): pass") == [("DRIVE106", "did you mean `herd`?")]


@pytest.mark.parametrize(
    ("source", "column", "said"),
    [
        ("class: AA, kind: rclpy", 43, "did you mean `A`?"),
        ("class: A, kind: rospy", 21, "write `kind: rclpy`"),
        ("class: A", 21, "write `kind: rclpy`"),
        ("class: A, kind: rclpy", 0, ""),
        ("class: B", 0, ""),
    ],
)
def test_the_class_of_a_source_is_looked_up_whatever_the_methods_are(
    tmp_path: Path, source: str, column: int, said: str
) -> None:
    """`avow check` finds what `avow drive` would refuse."""
    (tmp_path / "system.rcl").write_text(CONTRACT, "utf-8")
    text = "import rclpy\nfrom rclpy.node import Node\nclass A(Node):\n    pass\nclass B:\n    def step(self): pass\n"
    (tmp_path / "a.py").write_text(text, "utf-8")
    (tmp_path / "plan.yaml").write_text(f"nodes: {{a: {{source: {{python: a.py, {source}}}, methods: []}}}}\n", "utf-8")
    checked = avow("check", str(tmp_path), cwd=tmp_path)
    assert (checked.returncode == 2, "error[DRIVE108]" in checked.stdout) == (bool(said), bool(said)), checked.stdout
    if said:
        assert f"plan.yaml:1:{column}\n" in checked.stdout
        assert f"help: {said}\n" in checked.stdout
    if said and "kind" in source:
        driven = avow("drive", str(tmp_path), "a", cwd=tmp_path)
        assert (driven.returncode, "DRIVE108" in driven.stderr) == (2, True), driven.stderr


def test_a_name_that_nothing_defines(tmp_path: Path) -> None:
    found = told(tmp_path, "print(os.sep, rclpi)", "def f(self): return unknown")
    assert found == [
        ("DRIVE106", "write `import os`"),
        ("DRIVE106", "did you mean `rclpy`?"),
        ("DRIVE106", "import it, or define it in this file"),
    ]
    assert told(tmp_path, "from os import *; print(sep)", "pass") == []


@pytest.mark.parametrize(
    ("imported", "said"),
    [
        ("from own.msg import Laod", [("DRIVE107", "did you mean `Load`?")]),
        ("from own.msg import SpinAction, SpinGoal", []),
        ("from own.msg import SpinGaol", [("DRIVE107", "did you mean `SpinGoal`?")]),
        ("from std_msgs.msg import Flot64", [("DRIVE107", "did you mean `Float64`?")]),
        ("from own.msg import Load as L, Box", []),
        ("from other.msg import Anything", []),
        ("from .own.msg import Laod", []),
        ("from own.srv import Sett", [("DRIVE107", "did you mean `Set`?")]),
        ("from own.srv import Set, Box", [("DRIVE107", "known: Set")]),
        ("from own.action import Trun", [("DRIVE107", "did you mean `Turn`?")]),
    ],
)
def test_a_message_that_its_package_does_not_have(tmp_path: Path, imported: str, said: list[tuple[str, str]]) -> None:
    (tmp_path / "msg/own/msg").mkdir(parents=True)
    for name in ("Load", "Box"):
        (tmp_path / f"msg/own/msg/{name}.msg").write_text("float64 data\n", "utf-8")
    (tmp_path / "msg/own/srv").mkdir()
    (tmp_path / "msg/own/srv/Set.srv").write_text("bool on\n---\nbool done\n", "utf-8")
    (tmp_path / "msg/own/action").mkdir()
    (tmp_path / "msg/own/action/Turn.action").write_text("bool on\n---\nbool done\n---\nbool now\n", "utf-8")
    (tmp_path / "msg/own/action/Spin.action").write_text("---\n---\n", "utf-8")
    (tmp_path / "system.rcl").write_text(CONTRACT, "utf-8")
    (tmp_path / "a.py").write_text(f"{imported}\n\n\nclass A:\n    pass\n", "utf-8")
    plan = "messages: [msg]\nros: {distro: humble}\nnodes: {a: {source: {python: a.py, class: A}, methods: []}}\n"
    (tmp_path / "plan.yaml").write_text(plan, "utf-8")
    blocks = [b for b in avow("check", str(tmp_path), cwd=tmp_path).stdout.split("\n\n") if "[DRIVE107" in b]
    assert [(b.partition("[")[2][:8], b.partition("help: ")[2].partition("\n")[0]) for b in blocks] == said


@pytest.mark.parametrize(
    ("ros", "said"),
    [
        ("{}", ["write `ros: {nodes: {a: {name: other}}}`, or name it alike"]),
        ("{nodes: {a: {name: /left/other}}}", []),
        ("{launch: [a.launch]}", []),
    ],
)
def test_a_class_that_names_its_node_otherwise(tmp_path: Path, ros: str, said: list[str]) -> None:
    (tmp_path / "a.launch").write_text('<launch><node pkg="p" type="a.py" name="a"/></launch>\n', "utf-8")
    (tmp_path / "system.rcl").write_text(CONTRACT, "utf-8")
    text = SOURCE.replace('"a"', '"other"').replace("REGISTERED", "pass").replace("METHOD", "pass")
    (tmp_path / "a.py").write_text(text, "utf-8")
    source = "{python: a.py, class: A, kind: rclpy}"
    (tmp_path / "plan.yaml").write_text(f"ros: {ros}\nnodes: {{a: {{source: {source}, methods: []}}}}\n", "utf-8")
    printed = avow("check", str(tmp_path), cwd=tmp_path).stdout
    blocks = [block for block in printed.split("\n\n") if "[DRIVE109" in block]
    assert [block.partition("help: ")[2].partition("\n")[0] for block in blocks] == said
