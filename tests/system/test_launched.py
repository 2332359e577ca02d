"""What launch files say of a plan's nodes links their topics; where the plan says otherwise, it is told."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from click.testing import CliRunner
from helpers import avow

from avow.base.diagnostics import Diagnostic, Rejected
from avow.cli import main
from avow.cli.check import command as check
from avow.pipeline.plan_check import diagnostics
from avow.system.graph import dataflow
from avow.system.launched import told
from avow.system.load import load_system

CONTRACT = """
node a { inputs( ) outputs( x : REAL ) topics( float64 t matches(out.x) ) guarantee g ( out.x >= 0 ) }
node b { inputs( y : REAL ) outputs( z : REAL ) topics( float64 u matches(in.y) )
  assume a ( in.y >= 0 ) guarantee g ( out.z >= in.y ) }
"""
APART = """\
<launch>
  <group ns="left"><node name="a" pkg="p" type="a"/></group>
  <node name="b" pkg="p" type="b"><remap from="u" to="/left/t"/></node>
</launch>
"""


def make(folder: Path, plan: str, launch: str = APART, contract: str = CONTRACT) -> Path:
    system = folder / "contracts/s"
    system.mkdir(parents=True, exist_ok=True)
    (folder / "dodo.py").write_text("", encoding="utf-8")
    (folder / "launch").mkdir(exist_ok=True)
    (folder / "launch/robot.launch").write_text(launch, encoding="utf-8")
    (system / "system.rcl").write_text(contract, encoding="utf-8")
    (system / "plan.yaml").write_text(plan, encoding="utf-8")
    return system


LAUNCH = "ros:\n  launch: [../../launch/robot.launch]\n"


def edges(folder: Path) -> list[str]:
    return [f"{e} {e.topic}" for e in dataflow(load_system(folder)).edges]


def test_names_and_remappings_of_launch_files_link(tmp_path: Path) -> None:
    assert edges(make(tmp_path, "{}")) == []
    assert edges(make(tmp_path, LAUNCH)) == ["a.x → b.y /left/t"]


def test_arguments_of_a_launch_file(tmp_path: Path) -> None:
    launch = APART.replace("<launch>", '<launch><arg name="ns" default="right"/>').replace('"left"', '"$(arg ns)"')
    assert edges(make(tmp_path, LAUNCH, launch)) == []
    plan = "ros: {launch: [{file: ../../launch/robot.launch, args: {ns: left}}]}"
    assert edges(make(tmp_path, plan, launch)) == ["a.x → b.y /left/t"]


def test_an_argument_that_no_launch_file_has_is_an_error_with_the_nearest_one(tmp_path: Path) -> None:
    """Unless a file that is not read may have it."""
    launch = APART.replace("<launch>", '<launch><arg name="side" default="right"/>')
    plan = "ros: {launch: [{file: ../../launch/robot.launch, args: {sied: left}}]}"
    with pytest.raises(Rejected) as found:
        load_system(make(tmp_path, plan, launch))
    (fault,) = found.value.diagnostics
    assert (fault.code, fault.message) == ("PLAN106", "no launch file has the argument 'sied'")
    assert fault.hint == "did you mean `side`?"
    assert fault.span is not None
    assert fault.span.column == plan.index("sied") + 1
    other = launch.replace("</launch>", '<include file="$(find elsewhere)/a.launch"/></launch>')
    load_system(make(tmp_path, plan, other))
    used = launch.replace("</launch>", '<node name="c" pkg="p" exec="c" if="$(var sied)"/></launch>')
    load_system(make(tmp_path, plan, used))


@pytest.mark.parametrize(
    ("plan", "launch", "codes"),
    [
        ("  nodes: {b: {remap: {u: /left/t}}}", APART, []),
        ("  nodes: {b: {remap: {u: /right/t}}}", APART, ["ROS122"]),
        ("  nodes: {a: {name: /right/a}}", APART, ["ROS122"]),
        ("", APART.replace("</launch>", '<node ns="right" name="a" pkg="p" type="a"/></launch>'), ["ROS123"]),
        (
            "  nodes: {a: {name: /left/a}}",
            APART.replace("</launch>", '<node ns="right" name="a" pkg="p" type="a"/></launch>'),
            [],
        ),
        ("  nodes: {a: {name: /c}, b: {remap: {u: /right/t}}}", "<launch><node</launch>", ["ROS120"]),
    ],
)
def test_what_does_not_agree_is_told(tmp_path: Path, plan: str, launch: str, codes: list[str]) -> None:
    folder = make(tmp_path, LAUNCH + plan, launch)
    found: tuple[Diagnostic, ...] = ()
    try:
        load_system(folder)
    except Rejected as rejected:
        found = rejected.diagnostics
    assert [d.code for d in found] == codes
    assert all(d.span is not None for d in found)
    assert all(d.notes for d in found if d.code == "ROS122"), "the launch file's line"
    assert all(d.hint for d in found if d.code == "ROS122" and "remap" in d.message)
    printed = avow("check", "contracts/s", cwd=tmp_path).stdout
    assert re.findall(r"^\w+\[(ROS12[023])\]", printed, re.MULTILINE) == codes, "each once, and nothing that follows"


@pytest.mark.parametrize(
    ("launch", "expected"),
    [
        (APART, ["a runs as /left/a", "b runs as /b, with u → /left/t"]),
        (
            APART.replace("</launch>", '<node name="rviz" pkg="rviz" type="rviz"/></launch>'),
            [
                "/rviz (rviz/rviz) is started, and is neither a node of the contract nor named under `model`",
                "a runs as /left/a",
                "b runs as /b, with u → /left/t",
            ],
        ),
        ('<launch><node name="a" pkg="p" type="a"/></launch>', ["no launch file starts b", "a runs as /a"]),
        (
            APART.replace('"u"', '"v"'),
            [
                "a runs as /left/a",
                "b runs as /b, with v → /left/t (not in the contract)",
            ],
        ),
        (
            APART.replace('"u"', '"u2"'),
            ["a runs as /left/a", "b runs as /b, with u2 → /left/t (not in the contract)"],
        ),
    ],
)
def test_check_says_how_each_node_runs(tmp_path: Path, launch: str, expected: list[str]) -> None:
    *found, runs = told(load_system(make(tmp_path, LAUNCH, launch)))
    assert [*(d.message for d in found), *(text for text, _ in runs.notes)] == expected


def test_paths_stay_in_the_workspace(tmp_path: Path) -> None:
    with pytest.raises(Rejected) as caught:
        load_system(make(tmp_path, "ros: {launch: [../../../x.launch, ../../launch/gone.launch, /etc/passwd]}"))
    assert [d.code for d in caught.value.diagnostics] == ["PLAN108", "PLAN107", "PLAN108"]


def test_faults_of_launch_files_are_told_with_all_others(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    plan = LAUNCH + "  nodes: {b: {remap: {u: /right/t}}, c: {}}\n  distro: noetic\nlints_of: []\n"
    folder = make(tmp_path, plan, contract=CONTRACT.replace("float64 u", "float32 u"))
    with pytest.raises(SystemExit, match="2"):
        main(["check", str(folder)])
    output = capsys.readouterr().out
    assert all(code in output for code in ("ROS122", "PLAN103", "PLAN106"))


def test_a_launch_file_is_what_the_answer_depends_on(tmp_path: Path) -> None:
    system = load_system(make(tmp_path, LAUNCH))
    assert [path.name for path in system.plan.included] == ["robot.launch"]


PART = """
node n { inputs( ) outputs( x : REAL ) topics( float64 t matches(out.x), float64 ~p matches(out.x) )
  guarantee g ( out.x >= 0 ) }
"""


@pytest.mark.parametrize(
    ("plan", "topics"),
    [
        ("", ["/t", "/n/p"]),
        ("namespace: left", ["/left/t", "/left/n/p"]),
    ],
)
def test_a_system_that_is_taken_in_keeps_its_names(tmp_path: Path, plan: str, topics: list[str]) -> None:
    part = tmp_path / "contracts/part"
    part.mkdir(parents=True)
    (part / "plan.yaml").write_text("{}", encoding="utf-8")
    (part / "p.rcl").write_text(PART, encoding="utf-8")
    folder = make(tmp_path, f"subsystems: {{l: {{system: ../part, {plan}}}}}")
    system = load_system(folder)
    node = system.contract.node("l_n")
    assert [system.plan.ros.names.topic("l_n", t.name) for t in node.topics] == topics


def test_what_is_taken_in_may_be_called_otherwise_here(tmp_path: Path) -> None:
    part = tmp_path / "contracts/part"
    part.mkdir(parents=True)
    (part / "plan.yaml").write_text("ros: {nodes: {n: {name: /deep/n, remap: {t: s}}}}", encoding="utf-8")
    (part / "p.rcl").write_text(PART, encoding="utf-8")
    whole = "subsystems: {l: {system: ../part}}\n"
    assert load_system(make(tmp_path, whole)).plan.ros.names.topic("l_n", "t") == "/deep/s"
    here = whole + "ros: {nodes: {l_n: {name: /here/n}}}"
    assert load_system(make(tmp_path, here)).plan.ros.names.topic("l_n", "t") == "/here/t"


def test_an_edit_of_a_launch_file_is_another_question(tmp_path: Path) -> None:
    from avow.pipeline.workload import survey

    folder = make(tmp_path, LAUNCH)
    before = survey(folder)
    (tmp_path / "launch/robot.launch").write_text(APART.replace("/left/t", "/right/t"), encoding="utf-8")
    after = survey(folder)
    assert not isinstance(before, Rejected)
    assert not isinstance(after, Rejected)
    assert before.digest != after.digest
    assert dataflow(before.system).edges
    assert not dataflow(after.system).edges


UNREAD = [
    APART.replace("<launch>", '<launch><remap from="t" to="$(env T)"/>'),
    APART.replace('name="a"', 'name="$(env A)"'),
    (
        '<launch><let name="x" value="y"/><include file="$(find-pkg-share other)/l.xml"/>'
        '<node namespace="left" name="a" pkg="p" exec="a"/><node name="b" pkg="p" exec="b">'
        '<remap from="u" to="/left/t"/></node></launch>'
    ),
]


@pytest.mark.parametrize("launch", UNREAD)
def test_what_rests_on_what_is_not_read_is_not_agreed(tmp_path: Path, launch: str) -> None:
    """A remapping, a name, an include that is not read: the links of what it reaches wait for the plan's word."""
    folder = make(tmp_path, LAUNCH, launch)
    with pytest.raises(Rejected) as caught:
        load_system(folder)
    assert {d.code for d in caught.value.diagnostics} == {"ROS126"}
    assert "name: /a" in str(caught.value.diagnostics[0].hint)
    said = LAUNCH + "  nodes: {a: {name: /left/a}, b: {name: /b, remap: {u: /left/t}}}\n"
    assert edges(make(tmp_path, said, launch)) == ["a.x → b.y /left/t"]


def test_an_include_that_is_not_read_is_no_doubt_of_what_comes_before_it(tmp_path: Path) -> None:
    before, after = UNREAD[2].split('<include file="$(find-pkg-share other)/l.xml"/>')
    launch = before + after.replace("</launch>", '<include file="$(find-pkg-share other)/l.xml"/></launch>')
    assert edges(make(tmp_path, LAUNCH, launch)) == ["a.x → b.y /left/t"]


CLASS = """
from rclpy.node import Node


class B(Node):
    def __init__(self):
        super().__init__("b")
        self.limit = self.declare_parameter("limit", 1.0).value
"""
NODE = "<node name='b' pkg='p' exec='b'>{}</node>"
NODE1 = "<node name='b' pkg='p' type='b'/>"
PLAIN1 = "<rosparam file='$(dirname)/plain.yaml'/>"


@pytest.mark.parametrize(
    ("own", "launched", "said"),
    [
        ("limit: 2.0", NODE.format("<param name='limit' value='2.0'/>"), ""),
        ("limit: 2.0", NODE.format(""), ""),
        ("limit: 2.0", NODE.format("<param from='$(dirname)/p.yaml'/>"), "limit = 3.0, and the plan says 2.0"),
        ("limit: 3.0", NODE.format("<param from='$(dirname)/p.yaml'/>"), ""),
        ("/left/b: {ros__parameters: {limit: 3.0}}", NODE.format("<param name='limit' value='2.0'/>"), "sets nothing"),
        ("{}", NODE.format("<param name='limit' value='2.0'/>"), "limit = 2.0, and the plan does not set it"),
        ("{limit: 2.0, x: 1}", NODE.format("<param name='limit' value='2.0'/>"), "the plan sets x of b"),
        ("{limitt: 2.0}", NODE.format("<param name='limit' value='2.0'/>"), "(the plan has `limitt`: correct the one"),
        ("{limit: 2.0, x: 1}", NODE.format("<param name='limit' value='$(env L)'/>"), "not read"),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=[{'limit': 3.0}])", "limit = 3.0"),
        ("limit: 3.0", "Node(name='b', package='p', executable='b', parameters=[HERE, {'limit': 3.0}])", ""),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=[HERE])", "limit = 3.0"),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=[unknown()])", "not read"),
        ("limit: 2.0", "Node(name='b', ros_arguments=['-p', 'limit:=3.0'])", "limit = 3.0"),
        ("limit: 2.0", "Node(name='b', arguments=['--ros-args', '-p', 'limit:=4.0', '-r', 'x:=y'])", "limit = 4.0"),
        ("limit: 3.0", "Node(name='b', ros_arguments=['-p', 'limit:=4.0'], parameters=[HERE])", ""),
        ("limit: 2.0", "Node(name='b', ros_arguments=['-p', 'b:limit:=3.0'])", "not read"),
        ("limit: 2.0", NODE.format("<param name='limit' value='3.0' if='false'/>"), ""),
        ("limit: 2.0", "SetParameter('limit', 3.0), Node(name='b')", "limit = 3.0"),
        ("limit: 2.0", "SetParameter('limit', 3.0), Node(name='b', parameters=[{'limit': 2.0}])", ""),
        ("limit: 2.0", "GroupAction([SetParameter('limit', 3.0)]), Node(name='b')", ""),
        (
            "limit: 2.0",
            "SetParameter('other', 1), Node(name='b', parameters=[{'limit': 2.0, 'use_sim_time': True}])",
            "",
        ),
        ("limit: 2.0", "Node(name='b'), SetParameter('limit', 3.0)", ""),
        ("limit: 2.0", "SetParametersFromFile(HERE), Node(name='b')", "limit = 3.0"),
        ("limit: 2.0", NODE.format("<rosparam file='$(dirname)/plain.yaml'/>"), "limit = 5.0"),
        ("limit: 2.0", NODE.format("<rosparam file='$(dirname)/plain.yaml' ns='x'/>"), "not read"),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=[HERE, unknown()])", "not read"),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=[HERE, 'p.yaml'])", "not read"),
        ("limit: 2.0", "Node(name='b', package='p', executable='b', parameters=['p.yaml', HERE])", "limit = 3.0"),
        (
            "limit: 2.0",
            "Node(name='b', package='p', executable='b', parameters=[unknown(), {'limit': 3.0}])",
            "limit = 3.0",
        ),
        ("limit: 2.0", "Node(name='b', parameters=[{'limit': 2.0}, HERE])", "not clear"),
        ("limit: 3.0", "Node(parameters=[{'limit': 2.0}, HERE], name='b')", "not clear"),
        ("limit: 2.0", "Node(name='b', parameters=[HERE, {'limit': 2.0}, HERE])", ""),  # the sections' order counts
        ("limit: 2.0", "Node(name='b', parameters=[{'limit': 2.0}], ros_arguments=['-p', 'limit:=3.0'])", ""),
        ("limit: 2.0", f"<rosparam file='$(dirname)/server.yaml'/>{NODE1}", "limit = 6.0"),
        ("limit: 2.0", f"<rosparam file='$(dirname)/plain.yaml' ns='b'/>{NODE1}", "limit = 5.0"),
        ("limit: 2.0", f"<group ns='b'>{PLAIN1}</group>{NODE1}", "limit = 5.0"),
        ("limit: 2.0", f"<rosparam file='$(dirname)/plain.yaml' param='/b'/>{NODE1}", "limit = 5.0"),
        ("limit: 6.0", f"{PLAIN1}<rosparam file='$(dirname)/server.yaml'/>{NODE1}", ""),
        ("limit: 2.0", f"<rosparam ns='b'>limit: 3.0</rosparam>{NODE1}", "not read"),
        ("limit: 2.0", f"<rosparam ns='b' file='$(dirname)/plain.yaml' subst_value='true'/>{NODE1}", "not read"),
        ("limit: 2.0", f"<rosparam ns='other'>limit: 3.0</rosparam>{NODE1}", ""),
        ("limit: 2.0", f"<param name='~limit' value='5.0'/>{NODE1}", "limit = 5.0"),
        ("limit: 2.0", f"{NODE1}<param name='~limit' value='5.0'/>", ""),
    ],
)
def test_parameters_of_a_launch_file_are_compared(tmp_path: Path, own: str, launched: str, said: str) -> None:
    """A class is examined with the parameters that the robot starts it with, or the difference is named."""
    plan = "nodes: {b: {source: {python: b.py, class: B, kind: rclpy, parameters: p.yaml}, methods: []}}\n"
    if not launched.startswith("<"):
        here = "PathJoinSubstitution([ThisLaunchFileDir(), 'p.yaml'])"
        text = "from launch import *\n\n\ndef generate_launch_description():\n"
        text += f"    return LaunchDescription([{launched.replace('HERE', here)}])\n"
        folder = make(tmp_path, f"{plan}ros: {{launch: [../../launch/robot.launch.py]}}")
        (tmp_path / "launch/robot.launch.py").write_text(text, encoding="utf-8")
    else:
        folder = make(tmp_path, plan + LAUNCH.replace(".launch]", ".launch.xml]"))
        (tmp_path / "launch/robot.launch.xml").write_text(f"<launch>{launched}</launch>", encoding="utf-8")
    (tmp_path / "launch/p.yaml").write_text("'/**': {ros__parameters: {limit: 3.0}}", encoding="utf-8")
    (tmp_path / "launch/plain.yaml").write_text("limit: 5.0", encoding="utf-8")
    (tmp_path / "launch/server.yaml").write_text("b: {limit: 6.0}", encoding="utf-8")
    (folder / "b.py").write_text(CLASS, encoding="utf-8")
    (folder / "p.yaml").write_text(own, encoding="utf-8")
    if said in ("", "not read", "not clear", "sets nothing"):  # what the file itself lacks is told where it is driven
        unread = [d.message for d in told(load_system(folder)) if d.code == "ROS121"]
        unread = [message for message in unread if "not read" in message or "not clear" in message]
        assert [said in message for message in unread] == [True] * (said in ("not read", "not clear"))
        return
    with pytest.raises(Rejected) as caught:
        load_system(folder)
    assert [d.code for d in caught.value.diagnostics] == ["ROS127"]
    assert said in "{0.message} ({0.hint})".format(*caught.value.diagnostics)


def test_a_contract_drafted_of_what_runs_has_the_names_after_remapping(tmp_path: Path) -> None:
    """No doubt about the direction of a launch file's remapping: the links are those of the running graph."""
    contract = CONTRACT.replace("float64 t ", "float64 /left/t ").replace("float64 u ", "float64 /left/t ")
    folder = make(tmp_path, LAUNCH, contract=contract)
    assert edges(folder) == ["a.x → b.y /left/t"]
    assert [d.code for d in diagnostics(load_system(folder)) if d.code == "ROS116"] == []
    misspelt = make(tmp_path / "misspelt", LAUNCH, contract=contract.replace("/left/t ", "/left/tt "))
    found = [d for d in diagnostics(load_system(misspelt)) if d.code == "ROS116"]
    assert found, "the remapping touches no topic"
    assert all(d.span and "launch" in d.span.file for d in found)
    for name, hints in (("v", ["did you mean `/u`?"]), ("u2", [])):
        slip = make(tmp_path / name, LAUNCH, APART.replace('"u"', f'"{name}"'))
        assert [d.hint for d in diagnostics(load_system(slip)) if d.code == "ROS116"] == hints


def test_memory_needs_no_topic(tmp_path: Path) -> None:
    contract = CONTRACT.replace("topics( float64 u matches(in.y) )", "topics( float64 z matches(out.z) )")
    source = "nodes: {b: {source: {python: b.py, class: B}, memory: {y: self.y}, methods: []}}"
    for plan, told_ in (("{}", ["RCL405"]), (source, [])):
        folder = make(tmp_path, plan, contract=contract)
        (folder / "b.py").write_text("class B: pass", encoding="utf-8")
        found = [d.code for d in diagnostics(load_system(folder)) if d.code == "RCL405"]
        assert found == told_
        shown = CliRunner().invoke(check, [str(folder)]).output
        assert ("no topic of `b` carries `in.y`" in shown) is bool(told_)


def test_a_launch_file_in_python_that_lacks_an_import(tmp_path: Path) -> None:
    text = "def generate_launch_description():\n    return LaunchDescription([Node(name=nam, package=os.sep)])\n"
    folder = make(tmp_path, "ros: {launch: [../../launch/robot.launch.py]}")
    (tmp_path / "launch/robot.launch.py").write_text(f"name = 'a'\n{text}", encoding="utf-8")
    with pytest.raises(Rejected) as caught:
        load_system(folder)
    found = [(d.code, d.span.line, d.span.column, d.hint) for d in caught.value.diagnostics if d.span]
    assert found == [
        ("ROS120", 3, 12, "write `from launch import LaunchDescription`"),
        ("ROS120", 3, 31, "write `from launch_ros.actions import Node`"),
        ("ROS120", 3, 41, "did you mean `name`?"),
        ("ROS120", 3, 54, "write `import os`"),
    ]
