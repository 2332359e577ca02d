"""Launch files of all kinds say which nodes they start; what cannot be known without running them is told."""

from __future__ import annotations

from pathlib import Path

import pytest

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
        ("a.xml", '<launch>\n<node pkg="p" exec="e"/></launch>', 2, "its program gives it"),
        ("a.xml", '<launch>\n<node pkg="p" exec="e" name="a"><remap from="/*" to="x"/></node></launch>', 2, "'/*'"),
        ("a.py", "def generate_launch_description():\n  return LaunchDescription([f()])", 2, "f(…)"),
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


def test_files_that_include_one_another_end(tmp_path: Path) -> None:
    text = '<launch><include file="$(dirname)/a.launch"/><include file="$(dirname)/a.launch"/></launch>'
    found = read(tmp_path, text)
    assert any("too deeply" in d.message or "more elements" in d.message for d in found.unread)
