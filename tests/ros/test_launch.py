"""Launch files of all kinds say which nodes they start; what cannot be known without running them is told."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from helpers import some

from avow.ros.launch import Launched, read_launch

ROS1 = """\
<launch>
  <arg name="robot" default="robot1"/>
  <arg name="sim" default="false"/>
  <remap from="/tf" to="/tf_all"/>
  <group ns="$(arg robot)">
    <remap from="scan" to="front/scan"/>
    <node name="sensor" pkg="p" type="s.py"><remap from="scan" to="back"/><param name="x" value="1"/></node>
    <node name="agent" pkg="p" type="a.py" ns="deep" args="x:=y _rate:=3 __name:=boss"/>
    <node name="rviz" pkg="rviz" type="rviz" if="$(arg sim)"/>
  </group>
  <node name="last" pkg="p" type="l" ns="/abs" unless="$(arg sim)"/>
</launch>
"""
ROS2 = """\
<launch>
  <arg name="robot" default="robot1"/>
  <group>
    <push-ros-namespace namespace="$(var robot)"/>
    <set_remap from="scan" to="front/scan"/>
    <node pkg="p" exec="s" name="sensor"><remap from="scan" to="back"/></node>
    <node pkg="p" exec="a" name="agent" namespace="deep" args="--ros-args -r x:=y -p rate:=3 -r __node:=boss"/>
    <node pkg="rviz" exec="rviz" name="rviz" if="false"/>
  </group>
  <let name="where" value="/abs"/>
  <node_container pkg="c" exec="c" name="box" namespace="$(var where)">
    <composable_node pkg="p" plugin="p::Last" name="last" namespace="$(var where)"/>
  </node_container>
</launch>
"""
YAML = """\
launch:
- arg: {name: robot, default: robot1}
- group:
  - push_ros_namespace: {namespace: $(var robot)}
  - set_remap: {from: scan, to: front/scan}
  - node:
      pkg: p
      exec: s
      name: sensor
      remap:
      - {from: scan, to: back}
  - node: {pkg: p, exec: a, name: agent, namespace: deep, args: '--ros-args -r x:=y -r __node:=boss'}
  - node: {pkg: rviz, exec: rviz, name: rviz, if: 'false'}
- let: {name: where, value: /abs}
- node_container:
    pkg: c
    exec: c
    name: box
    namespace: $(var where)
    composable_node:
    - {pkg: p, plugin: 'p::Last', name: last, namespace: $(var where)}
"""
PYTHON = """\
import os
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import ComposableNodeContainer, Node, PushRosNamespace, SetRemap
from launch_ros.descriptions import ComposableNode

raise RuntimeError("a launch file is never run")
WHERE = "/abs"

def generate_launch_description():
    robot = LaunchConfiguration("robot")
    inside = [PushRosNamespace(robot), SetRemap(src="scan", dst="front/scan")]
    inside.append(Node(package="p", executable="s", name="sensor", remappings=[("scan", "back")]))
    ld = LaunchDescription([DeclareLaunchArgument("robot", default_value="robot" + "1")])
    ld.add_action(GroupAction(inside + [
        Node(package="p", executable="a", name="agent", namespace=["de", "ep"],
             arguments=["--ros-args", "-r", "x:=y", "-r", "__node:=boss"]),
        Node(package="rviz", executable="rviz", name="rviz", condition=IfCondition("false")),
    ]))
    last = ComposableNode(package="p", plugin="p::Last", name="last", namespace=f"{WHERE}")
    ld.add_action(ComposableNodeContainer(package="c", executable="c", name="box", namespace=WHERE,
                                          composable_node_descriptions=[last]))
    return ld
"""


def read(folder: Path, text: str, name: str = "a.launch", **given: str) -> Launched:
    (folder / name).write_text(text, encoding="utf-8")
    return read_launch([(folder / name, given)], folder)


def shown(found: Launched) -> dict[str, tuple[tuple[str, str], ...]]:
    return {node.name: node.remaps for node in found.nodes}


def test_ros1(tmp_path: Path) -> None:
    found = read(tmp_path, ROS1)
    tf = ("/tf", "/tf_all")
    assert shown(found) == {
        "/robot1/sensor": (tf, ("scan", "back")),
        "/robot1/deep/boss": (tf, ("scan", "front/scan"), ("x", "y")),
        "/abs/last": (tf,),
    }
    assert found.unread == ()
    assert [n.kind for n in found.nodes] == ["p/s.py", "p/a.py", "p/l"]
    assert found.nodes[0].span is not None
    assert found.nodes[0].span.line == 7


@pytest.mark.parametrize(("name", "text"), [("a.xml", ROS2), ("a.yaml", YAML), ("a.launch.py", PYTHON)])
def test_ros2_in_each_of_its_languages(tmp_path: Path, name: str, text: str) -> None:
    found = read(tmp_path, text, name)
    assert shown(found) == {
        "/robot1/sensor": (("scan", "front/scan"), ("scan", "back")),  # of two rules the first counts
        "/robot1/deep/boss": (("scan", "front/scan"), ("x", "y")),
        "/abs/box": (),
        "/abs/last": (),
    }
    assert found.unread == ()


@pytest.mark.parametrize(("name", "text"), [("a.launch", ROS1), ("a.launch.xml", ROS2), ("a.launch.py", PYTHON)])
def test_arguments_of_the_plan(tmp_path: Path, name: str, text: str) -> None:
    assert "/r2/sensor" in shown(read(tmp_path, text, name, robot="r2"))


def package(folder: Path, name: str) -> Path:
    (folder / name / "launch").mkdir(parents=True)
    (folder / name / "package.xml").write_text(f"<package><name>{name}</name></package>", encoding="utf-8")
    return folder / name / "launch"


def test_includes_are_read_where_they_are_local(tmp_path: Path) -> None:
    inner = package(tmp_path, "demo")
    (inner / "one.launch").write_text(
        '<launch><arg name="n"/><arg name="m" default="x"/><node name="$(arg n)_$(arg m)" pkg="p" type="t"/></launch>',
        encoding="utf-8",
    )
    include = '<include file="$(find demo)/launch/one.launch" ns="g"><arg name="n" value="a"/></include>'
    other = '<include file="$(find gone)/launch/one.launch"/><include file="/etc/passwd"/>'
    found = read(tmp_path, f'<launch><arg name="m" value="y"/>{include}{other}</launch>')
    assert list(shown(found)) == ["/g/a_x"]  # in ROS 1 an included file sees only what it is given
    assert [d.message.split(":")[0] for d in found.unread] == [
        "the file that is included is not known",
        f"{Path('/etc/passwd').resolve()} lies outside {tmp_path}",
    ]


def test_in_ros2_included_files_share_arguments_and_namespaces(tmp_path: Path) -> None:
    inner = package(tmp_path, "demo")
    (inner / "one.launch.py").write_text(
        "from launch import *\n"
        "def generate_launch_description():\n"
        "    return LaunchDescription([DeclareLaunchArgument('m', default_value='x'), PushRosNamespace('in'),\n"
        "        Node(package='p', executable='e', name=['a_', LaunchConfiguration('m')])])\n",
        encoding="utf-8",
    )
    text = (
        "import os\n"
        "def generate_launch_description():\n"
        "    path = os.path.join(get_package_share_directory('demo'), 'launch', 'one.launch.py')\n"
        "    source = PythonLaunchDescriptionSource(path)\n"
        "    more = IncludeLaunchDescription(source, launch_arguments={'m': 'y'}.items())\n"
        "    return LaunchDescription([more, Node(package='p', executable='e', name='b')])\n"
    )
    assert list(shown(read(tmp_path, text, "a.launch.py"))) == ["/in/a_y", "/in/b"]


@pytest.mark.parametrize(
    ("name", "text", "line", "word"),
    [
        ("a.launch", '<launch>\n<node name="$(anon a)" pkg="p" type="t"/>\n</launch>', 2, "name is not known"),
        ("a.launch", '<launch>\n<group ns="$(env R)">\n<node name="a" pkg="p" type="t"/></group></launch>', 2, "R"),
        ("a.launch", '<launch>\n\n<remap from="x" to="$(arg t)"/></launch>', 3, "no argument 't'"),
        ("a.launch", '<launch>\n<node name="a" pkg="p" type="t" if="$(eval 1)"/></launch>', 2, "whether it counts"),
        ("a.launch", '<launch>\n<node name="a" pkg="p" type="t" args="$(env X)"/></launch>', 2, "arguments"),
        ("a.launch", '<launch>\n<param command="touch /tmp/x" name="p"/><mystery/></launch>', 2, "<mystery>"),
        ("a.xml", '<launch>\n<node pkg="p" exec="e"/></launch>', 2, "program gives is not known"),
        ("a.xml", '<launch>\n<node pkg="p" exec="e" name="a"><remap from="/*" to="x"/></node></launch>', 2, "'/*'"),
        ("a.py", "def generate_launch_description():\n  return LaunchDescription([f()])", 2, "f(…)"),
        (
            "a.py",
            "def generate_launch_description():\n  return LaunchDescription([Node(name='a',\n paramters=[])])",
            3,
            "Node has no keyword `paramters`",
        ),
        (
            "a.py",
            "def generate_launch_description():\n  return LaunchDescription([Node(name='a',\n parameters={'x': 1})])",
            3,
            "is no list",
        ),
        (
            "a.py",
            "def generate_launch_description():\n  for n in 'ab':\n    Node(name=n)\n  return LaunchDescription([])",
            3,
            "this Node(…) is not read",
        ),
        (
            "a.py",
            "def generate_launch_description():\n  n = 'a'\n  n = 'b'\n  return LaunchDescription([Node(name=n)])",
            4,
            "`n` is not evaluated",
        ),
        (
            "a.py",
            "def generate_launch_description():\n  if X:\n    return []\n  return LaunchDescription([])",
            3,
            "under a condition",
        ),
        (
            "a.py",
            "def generate_launch_description():\n  return LaunchDescription([Node(name='a', remappings=REMAPS)])",
            2,
            "`REMAPS` is not evaluated",
        ),
        ("a.py", "def generate_launch_description():\n  return LaunchDescription([\n OpaqueFunction(f)])", 3, "Opaque"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_told_with_its_place(tmp_path: Path, name: str, text: str, line: int, word: str) -> None:
    found = read(tmp_path, text, name)
    told = [(d.span.line, d.message) for d in found.unread if d.span is not None and d.code == "ROS121"]
    assert any(at == line and word in message for at, message in told), told


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ('<launch><arg name="x" default="y"/>{}</launch>', "a.launch"),
        ('<launch><node pkg="p" exec="e" name="other"/>{}</launch>', "a.xml"),
    ],
)
def test_a_remapping_that_is_not_known_is_a_doubt_of_what_it_reaches(tmp_path: Path, text: str, name: str) -> None:
    inner = '<group><remap from="a" to="$(env X)"/><node name="n" pkg="p" type="t"/></group><node name="m" pkg="p"/>'
    found = {n.name: bool(n.unread) for n in read(tmp_path, text.format(inner), name).nodes}
    assert found["/n"]
    assert not found["/m"]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.launch", "<launch><node</launch>"),
        ("a.launch", '<!DOCTYPE l [<!ENTITY a "b">]><launch>&a;</launch>'),
        ("a.launch", "<robot/>"),
        ("a.launch", ""),
        ("a.launch", "<launch>" + "<group>" * 5000 + "</group>" * 5000 + "</launch>"),
        ("a.yaml", "launch: [a"),
        ("a.yaml", "launch: 3"),
        ("a.yaml", "nodes: []"),
        ("a.yaml", "launch: &a\n- group: *a"),
        ("a.py", "def f(:"),
        ("a.py", "x = 1"),
        ("a.py", "def generate_launch_description():\n  return " + "[" * 500 + "]" * 500),
        ("a.py", "def generate_launch_description():\n  a = [a]\n  return a"),
        ("a.py", "def generate_launch_description():\n  return " + " + ".join(["x"] * 30_000)),
        (
            "a.py",
            "def generate_launch_description():\n"
            + "".join(f"  a{k} = [*a{k + 1}, *a{k + 1}]\n" for k in range(40))
            + "  return a0",
        ),
        ("a.launch", "\0"),
    ],
)
def test_what_is_no_launch_file_is_an_error_and_nothing_worse(tmp_path: Path, name: str, text: str) -> None:
    found = read(tmp_path, text, name)
    assert [d.code for d in found.unread][:1] in (["ROS120"], ["ROS121"])
    assert found.nodes == ()


@pytest.mark.parametrize(
    ("name", "text", "place", "said"),
    [
        ("a.launch", "<launch>\n <group>\n </gruop>\n</launch>", (3, 4), "<group> of line 2 is not closed before this"),
        ("a.launch", '<launch>\n <node name="a">\n</launch>', (3, 3), "<node> of line 2 is not closed before this"),
        ("a.launch", "<launch>\n <group>", (2, 9), "<group> of line 2 is not closed before this"),
        ("a.launch", "<launch>\n <node name=a/>\n</launch>", (2, 13), "this cannot stand here"),
        ("a.launch", '<launch>\n <arg if="a &&"/>\n</launch>', (2, 14), "this cannot stand here"),
        ("a.launch", "<launch/>\n<launch/>", (2, 1), "a file has only one"),
        ("a.launch", '<launch>\n <arg a="" a=""/></launch>', (2, 12), "this attribute is given twice"),
        ("a.launch", "<launch>\n <!-- a", (2, 2), "what begins here has no end"),
        ("a.launch", "<launch>&nbsp;</launch>", (1, 9), "nothing defines this entity"),
        ("a.yaml", "launch:\n- arg:\n    name: a\n   default: b\n", (4, 4), "this line is indented as none above it"),
        ("a.yaml", 'launch:\n- arg: {name: "a}\n- arg: {name: "b"}\n', (2, 15), "closed only on a later line"),
    ],
)
def test_the_first_fault_of_a_launch_file_has_its_place_and_a_remedy(
    tmp_path: Path, name: str, text: str, place: tuple[int, int], said: str
) -> None:
    (fault,) = read(tmp_path, text, name).unread
    assert (fault.code, said in fault.message) == ("ROS120", True), fault.message
    assert fault.span is not None
    assert (fault.span.line, fault.span.column) == place
    assert fault.hint
    assert "group" not in text or "write `</group>` here, or end its first tag on line 2" in fault.hint


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('<nod name="a" pkg="p" exec="a"/>', "did you mean `node`?"),
        ('<node name="a" pkg="p" exec="a"><remap form="b" to="c"/></node>', "did you mean `from` for `form`?"),
        ('<arg name="sim"/><node name="a" pkg="p" exec="a" if="$(var smi)"/>', "did you mean `sim`?"),
    ],
)
def test_what_is_misspelt_in_a_launch_file_is_said(tmp_path: Path, text: str, said: str) -> None:
    assert any(said in f"{d.message} {d.hint}" for d in read(tmp_path, f"<launch>{text}</launch>").unread)


@pytest.mark.slow
def test_files_that_include_one_another_end(tmp_path: Path) -> None:
    text = '<launch><include file="$(dirname)/a.launch"/><include file="$(dirname)/a.launch"/></launch>'
    found = read(tmp_path, text)
    assert any("too deeply" in d.message or "more elements" in d.message for d in found.unread)


@dataclass
class World:
    """ROS 2's launch context: nothing of it ends but with a scoped group."""

    truths: tuple[bool, ...]
    namespace: str = ""
    remaps: list[tuple[str, str]] = field(default_factory=list)
    values: dict[str, str] = field(default_factory=lambda: {"word": "plain"})
    started: dict[str, tuple[str, tuple[tuple[str, str], ...]]] = field(default_factory=dict)

    def run(self, actions: list[tuple]) -> None:  # type: ignore[type-arg]
        for kind, condition, what in actions:
            if condition is not None and not (condition if isinstance(condition, bool) else self.truths[condition[0]]):
                continue
            kept = self.namespace, list(self.remaps), dict(self.values)
            match kind:
                case "push":
                    self.namespace += f"/{self.values['word']}_{what}"
                case "remap":
                    self.remaps.append((what, f"{what}_{self.values['word']}"))
                case "let":
                    self.values["word"] = what
                case "node":
                    self.started[what] = (f"{self.namespace}/{what}", tuple(self.remaps))
                case "group" | "scoped" | "include":
                    self.run(what)
            if kind == "scoped":
                self.namespace, self.remaps, self.values = kept


def actions(rng: random.Random, names: Iterator[int], depth: int) -> list[tuple]:  # type: ignore[type-arg]
    found = []
    for _ in range(rng.randrange(2, 5)):
        condition = rng.choice((None, None, None, True, False, (rng.randrange(2),)))
        kind = rng.choice(("push", "remap", "let", "node", "node", "group", "scoped", "include"))
        if kind in ("group", "scoped", "include"):
            found.append((kind, condition, actions(rng, names, depth - 1) if depth else []))
        else:
            what = f"n{next(names)}" if kind == "node" else rng.choice("abc")
            found.append((kind, condition, what))
    return found


def written(folder: Path, files: Iterator[int], actions: list[tuple]) -> str:  # type: ignore[type-arg]
    lines = []
    for kind, condition, what in actions:
        when = f' if="$(env X{condition[0]})"' if isinstance(condition, tuple) else ""
        when = f' if="{str(condition).lower()}"' if isinstance(condition, bool) else when
        match kind:
            case "push":
                lines.append(f'<push-ros-namespace namespace="$(var word)_{what}"{when}/>')
            case "remap":
                lines.append(f'<set_remap from="{what}" to="{what}_$(var word)"{when}/>')
            case "let":
                lines.append(f'<let name="word" value="{what}"{when}/>')
            case "node":
                lines.append(f'<node pkg="p" exec="e" name="{what}"{when}/>')
            case "group" | "scoped":
                scoped = 'scoped="false"' if kind == "group" else ""
                lines.append(f"<group {scoped}{when}>{written(folder, files, what)}</group>")
            case _:
                name = f"file{next(files)}.launch.xml"
                (folder / name).write_text(f"<launch>{written(folder, files, what)}</launch>")
                lines.append(f'<include file="$(dirname)/{name}"{when}/>')
    return "\n".join(lines)


@pytest.mark.parametrize("seed", some(range(40), 10))
def test_what_is_said_of_a_node_without_a_doubt_is_so_whatever_is_not_known(seed: int, tmp_path: Path) -> None:
    """Groups whose scope does not end, included files, values, and conditions on the environment, against a run of the
    same actions under each of the environments."""
    rng = random.Random(seed)
    sure = 0
    for at in range(20):
        made = actions(rng, itertools.count(), 3)
        folder = tmp_path / str(at)
        folder.mkdir()
        body = written(folder, itertools.count(), made)
        # the outermost file has now and then nothing that only ROS 2 has
        top = folder / "top.launch.xml"
        (folder / "all.launch.xml").write_text(f'<launch><let name="word" value="plain"/>{body}</launch>')
        top.write_text(
            '<launch><include file="$(dirname)/all.launch.xml"/></launch>'
            if rng.random() < 0.5
            else (f'<launch><let name="word" value="plain"/>{body}</launch>')
        )
        read = read_launch([(top, {})], folder)
        worlds = [World(truths) for truths in itertools.product((True, False), repeat=2)]
        for world in worlds:
            world.run(made)
        for one in read.nodes:
            if one.name and not one.unread:
                last = one.name.rpartition("/")[2]
                assert {world.started.get(last) for world in worlds} == {(one.name, one.remaps)}, body
                sure += 1
        known = {one.name.rpartition("/")[2] for one in read.nodes}
        always = set.intersection(*(set(world.started) for world in worlds))
        assert always <= known or any(not one.name for one in read.nodes), body
    assert sure > 10


@pytest.mark.parametrize("name", ["a.launch", "a.launch.xml"])
def test_arguments_that_remap_otherwise_are_a_doubt(name: str, tmp_path: Path) -> None:
    word = "type" if name == "a.launch" else "exec"
    text = f'<launch><remap from="scan" to="x"/><node pkg="p" {word}="e" name="n" args="scan:=y"/></launch>'
    (node,) = read(tmp_path, text, name).nodes
    assert "its arguments remap scan too" in node.unread


def test_parameters_outside_of_a_node_reach_it_and_the_last_one_holds(tmp_path: Path) -> None:
    text = """<launch>
      <param name="/left/b/limit" value="1.0"/>
      <group ns="left">
        <node name="b" pkg="p" type="b"><param name="limit" value="2.0"/></node>
        <param name="b/limit" value="3.0"/><param name="bb/limit" value="4.0"/>
      </group>
    </launch>"""
    (tmp_path / "r.launch").write_text(text, encoding="utf-8")
    (node,) = read_launch([(tmp_path / "r.launch", {})], tmp_path).nodes
    assert [(s.name, s.value) for s in node.parameters] == [("limit", "1.0"), ("limit", "2.0"), ("limit", "3.0")]
