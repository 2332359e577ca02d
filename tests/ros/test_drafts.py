"""`avow init --from-bag` and `--from-graph`: what is drafted is what is there, and it passes `avow check`."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from drawn.formulas import checked
from helpers import avow

from avow.base.diagnostics import Rejected
from avow.cli.check import command as check
from avow.cli.init import command as init
from avow.ros.drafting import by_names
from avow.ros.listing import Listed, Listing
from avow.system.graph import dataflow
from avow.system.load import load_system

pytest.importorskip("rosbags")

STATUS = "std_msgs/Header header\nuint8 GREEN=0\nuint8 RED=2\nuint8 level\nfloat32 rate\nstring in\n"
GRAPH = """\
/robot1/geiger
  Publishers:
    /geiger/rate: std_msgs/msg/Float64
    /rosout: rcl_interfaces/msg/Log
/robot1/sensor
  Subscribers:
    /geiger/rate: std_msgs/msg/Float64
    /goal: geometry_msgs/msg/Point
    /odd: nobody/msg/Knows
  Publishers:
    /robot1/status: geiger/msg/Status
/rviz2
  Subscribers:
    /robot1/status: geiger/msg/Status
"""


def make_bag(path: Path, form: str, *, bare: bool = False, qos: Sequence[Any] = ()) -> Path:
    """Two topics: a rate with a NaN, and a status of a type of its own. `bare`: without definitions, as Humble's."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(STATUS, "geiger/msg/Status"))
    types = store.types
    stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    header = types["std_msgs/msg/Header"](**({"seq": 1} if form == "ros1" else {}), stamp=stamp, frame_id="f")
    rates = [types["std_msgs/msg/Float64"](data=value) for value in (0.5, float("nan"), 7.0)]
    status: Any = types["geiger/msg/Status"](header=header, level=2, rate=1.5, in_="ok")
    said = [("/geiger/rate", "std_msgs/msg/Float64", "/robot1/geiger", rate) for rate in rates]
    said += [("/robot1/status", "geiger/msg/Status", "/robot1/sensor", status)] if not bare else []
    if form == "ros1":
        path = path.with_suffix(".bag")
        with Writer1(path) as writer:
            known: dict[str, Any] = {}
            for k, (topic, kind, caller, message) in enumerate(said, start=1):
                if topic not in known:
                    known[topic] = writer.add_connection(topic, kind, typestore=store, callerid=caller)
                writer.write(known[topic], k * 10**9, store.serialize_ros1(message, kind))
        return path
    plugin = StoragePlugin.MCAP if form == "mcap" else StoragePlugin.SQLITE3
    with Writer2(path, version=8 if bare else 9, storage_plugin=plugin) as writer2:
        known = {}
        for k, (topic, kind, _, message) in enumerate(said, start=1):
            if topic not in known:
                known[topic] = writer2.add_connection(topic, kind, typestore=store, offered_qos_profiles=qos)
            writer2.write(known[topic], k * 10**9, store.serialize_cdr(message, kind))
    if bare:
        import sqlite3

        with sqlite3.connect(next(path.glob("*.db3"))) as data:
            data.execute("delete from message_definitions")
    return path


def run(folder: Path, *options: str, warned: str = "") -> Path:
    """`warned`: a part of the only warning."""
    result = CliRunner().invoke(init, [str(folder), *options], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    (system,) = (folder / "contracts").iterdir()
    checked = CliRunner().invoke(check, [str(system)], standalone_mode=False, catch_exceptions=False)
    assert checked.return_value == 0, checked.output
    if warned:
        assert warned in checked.output
        assert checked.output.endswith("1 file: 1 warning\n")
    else:
        assert checked.output == "1 file: no errors\n"  # and no warning
    return system


def test_a_ros1_bag_knows_who_publishes(tmp_path: Path) -> None:
    system = run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", "ros1")))
    text = (system / "system.rcl").read_text()
    assert "rate : REAL  // float64 data, recorded: 0.5 … 7, 1 × NaN" in text
    assert "Status_level : {green, red};" in text
    assert 'status_in : STRING  // string in, recorded: "ok"' in text
    loaded = load_system(system)
    assert [node.name for node in loaded.contract.nodes] == ["geiger", "sensor"]
    assert loaded.plan.ros.names.placed("sensor").name == "/robot1/sensor"
    plan = (system / "plan.yaml").read_text()
    assert "out.status_level: {field: level, values: {GREEN: green, RED: red}}" in plan
    assert "out.status_in: in" in plan


@pytest.mark.parametrize("form", ["sqlite3", "mcap"])
def test_a_ros2_bag_does_not_know_who_publishes(form: str, tmp_path: Path) -> None:
    system = run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", form)))
    loaded = load_system(system)
    assert {node.name: [p.name for p in node.outputs] for node in loaded.contract.nodes} == {
        "geiger": ["rate"],
        "robot1": ["status_level", "status_rate", "status_in"],
    }
    assert "does not say who publishes" in (system / "system.rcl").read_text()


@pytest.mark.parametrize(
    ("topics", "heard", "nodes"),
    [
        (["/a/x", "/a/y", "/b/x", "/x"], [], {"/a": ["/a/x", "/a/y"], "/b": ["/b/x"], "/robot": ["/x"]}),
        (
            ["/ns/a/x", "/ns/a/in/y", "/ns/z"],
            ["/ns/a", "/ns/b"],
            {"/ns/a": ["/ns/a/x", "/ns/a/in/y"], "/ns": ["/ns/z"]},
        ),
        (["/ab/x"], ["/a"], {"/ab": ["/ab/x"]}),
        (
            ["/grip/_request", "/arm/grip/_response"],
            [],
            {"/robot": ["/grip/_request"], "/arm": ["/arm/grip/_response"]},
        ),
    ],
)
def test_names_suggest_who_publishes(topics: list[str], heard: list[str], nodes: dict[str, list[str]]) -> None:
    assert by_names(topics, heard) == nodes


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
def test_a_bag_and_a_graph(form: str, tmp_path: Path) -> None:
    (tmp_path / "graph.txt").write_text(GRAPH, encoding="utf-8")
    bag = make_bag(tmp_path / "run", form)
    options = ("--from-bag", str(bag), "--from-graph", str(tmp_path / "graph.txt"))
    options += ("--distro", "noetic" if form == "ros1" else "humble")
    loaded = load_system(run(tmp_path / "w", *options, warned="has the package nobody"))
    graph = dataflow(loaded)
    assert [str(edge) for edge in graph.edges] == ["geiger.rate → sensor.rate"]
    assert {at.port for at in graph.environment} == {"goal_x", "goal_y", "goal_z"}
    assert loaded.plan.model.data["dropped"] == {"/rviz2": "shows what others publish"}


@pytest.mark.parametrize(
    ("edits", "wanted"),
    [
        ((), []),
        (("/geiger/rate", "/geiger/ratte"), ["/geiger/rate is in the bag, and no node of the graph has it", "/ratte`"]),
        (("/geiger/rate", "/other"), ["/geiger/rate is in the bag, and no node of the graph has it\n"]),
        (("Float64", "Float32"), ["/geiger/rate has the type std_msgs/Float64 in the bag, and std_msgs/Float32"]),
    ],
)
def test_where_bag_and_graph_disagree_is_reported(edits: tuple[str, ...], wanted: list[str], tmp_path: Path) -> None:
    (tmp_path / "graph.txt").write_text(GRAPH.replace(*edits) if edits else GRAPH, encoding="utf-8")
    bag = make_bag(tmp_path / "run", "ros1")
    options = ("--from-bag", str(bag), "--from-graph", str(tmp_path / "graph.txt"))
    done = CliRunner().invoke(init, [str(tmp_path / "w"), *options], catch_exceptions=False)
    assert done.exit_code == 0
    assert done.stderr.count("warning: ") == bool(wanted) + 1  # /odd has a type that nothing defines
    assert "of the same robot?" not in done.stderr
    assert [text for text in wanted if text not in done.stderr] == []


def test_the_graph_of_another_robot_is_doubted(tmp_path: Path) -> None:
    (tmp_path / "graph.txt").write_text("/base\n  Publishers:\n    /rote: std_msgs/msg/Float64\n", encoding="utf-8")
    options = ("--from-bag", str(make_bag(tmp_path / "run", "ros1")), "--from-graph", str(tmp_path / "graph.txt"))
    done = CliRunner().invoke(init, [str(tmp_path / "w"), *options], catch_exceptions=False)
    assert "the graph has none of the bag's topics: is it of the same robot?" in done.stderr
    assert "did you mean" not in done.stderr


def test_a_bag_without_definitions_wants_a_distribution(tmp_path: Path) -> None:
    bag = make_bag(tmp_path / "run", "sqlite3", bare=True)
    with pytest.raises(Rejected) as caught:
        CliRunner().invoke(init, [str(tmp_path / "v"), "--from-bag", str(bag)], catch_exceptions=False)
    assert "--distro humble" in (caught.value.diagnostics[0].hint or "")
    assert not (tmp_path / "v").exists()
    run(tmp_path / "w", "--from-bag", str(bag), "--distro", "humble")


def test_an_empty_bag_is_reported(tmp_path: Path) -> None:
    import sqlite3

    bag = make_bag(tmp_path / "run", "sqlite3")
    with sqlite3.connect(next(bag.glob("*.db3"))) as data:
        data.execute("delete from messages")
    done = CliRunner().invoke(init, [str(tmp_path / "w"), "--from-bag", str(bag)], catch_exceptions=False)
    assert "run has no message of these topics" in done.stderr


def test_within_a_workspace_only_the_system_is_made(tmp_path: Path) -> None:
    run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", "ros1")))
    folder = tmp_path / "w/contracts/other"
    result = CliRunner().invoke(init, [str(folder), "--from-bag", str(tmp_path / "run.bag")], catch_exceptions=False)
    assert result.exit_code == 0
    assert (folder / "plan.yaml").is_file()
    assert not (folder / "dodo.py").exists()


def test_the_folder_around_a_bag_names_it(tmp_path: Path) -> None:
    make_bag(tmp_path / "traces" / "run", "sqlite3")
    done = avow("init", "w", "--from-bag", "traces", cwd=tmp_path)
    assert (done.returncode, f"name the bag in it: `{Path('traces/run')}`" in done.stderr) == (2, True), done.stderr


@pytest.mark.parametrize("form", ["sqlite3", "mcap"])
def test_a_bag_without_its_metadata_wants_it(form: str, tmp_path: Path) -> None:
    bag = make_bag(tmp_path / "run", form)
    (bag / "metadata.yaml").unlink()
    with pytest.raises(Rejected) as caught:
        CliRunner().invoke(init, [str(tmp_path / "w"), "--from-bag", str(bag)], catch_exceptions=False)
    (fault,) = caught.value.diagnostics
    assert "its folder has no metadata.yaml" in fault.message
    assert f"ros2 bag reindex {bag}" in (fault.hint or "")


@pytest.mark.parametrize(
    ("form", "remedy"), [("sqlite3", "sqlite3"), ("mcap", "mcap recover"), ("ros1", "rosbag reindex")]
)
@pytest.mark.parametrize("share", [0.01, 0.5, 0.99])
def test_a_bag_that_was_cut_off_says_what_restores_it(form: str, remedy: str, share: float, tmp_path: Path) -> None:
    bag = make_bag(tmp_path / "run", form)
    file = bag if bag.is_file() else next(each for each in bag.iterdir() if each.suffix in (".db3", ".mcap"))
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(Rejected) as caught:
        CliRunner().invoke(init, [str(tmp_path / "w"), "--from-bag", str(bag)], catch_exceptions=False)
    (fault,) = caught.value.diagnostics
    assert f"`{remedy} {file}" in (fault.hint or "")


@pytest.mark.parametrize("form", ["sqlite3", "mcap", "ros1"])
@pytest.mark.parametrize("text", ["", "hello"])
def test_what_never_was_a_bag_is_not_restored(form: str, text: str, tmp_path: Path) -> None:
    bag = make_bag(tmp_path / "run", form)
    file = bag if bag.is_file() else next(each for each in bag.iterdir() if each.suffix in (".db3", ".mcap"))
    file.write_text(text, encoding="utf-8")
    (tmp_path / "empty").mkdir()
    for path, hint in ((bag, "file by its first bytes: copy the bag again"), (tmp_path / "empty", "copy the")):
        with pytest.raises(Rejected) as caught:
            CliRunner().invoke(init, [str(tmp_path / "w"), "--from-bag", str(path)], catch_exceptions=False)
        assert hint in (caught.value.diagnostics[0].hint or "")


@pytest.mark.parametrize("text", ["", "a -> b", "/a\n  Publishers:\n", '{"/a": {"publishers": {"/t\\nx": "a/B"}}}'])
def test_what_is_no_graph_drafts_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "graph.txt").write_text(text, encoding="utf-8")
    options = ["--from-graph", str(tmp_path / "graph.txt")]
    with pytest.raises(Rejected) as caught:
        CliRunner().invoke(init, [str(tmp_path / "w"), *options], catch_exceptions=False)
    assert [d.code for d in caught.value.diagnostics] == ["CLI011"]
    if not text.startswith("{"):
        assert "of each node" in f"{caught.value.diagnostics[0].message}{caught.value.diagnostics[0].hint}"
    assert not (tmp_path / "w").exists()


def test_another_draft_goes_beside_the_first(tmp_path: Path) -> None:
    """A second bag, or a changed robot: what was written stays, and the command that drafts again works."""
    (tmp_path / "nodes.txt").write_text("/a\n  Publishers:\n    /x: std_msgs/msg/Bool\n")
    options = ("--from-graph", str(tmp_path / "nodes.txt"), "--distro", "humble")
    assert avow("init", "robot", *options, cwd=tmp_path).returncode == 0
    for taken, new in (("robot", "robot/contracts/robot_new"), ("robot/contracts/robot_new", "")):
        again = avow("init", taken, *options, cwd=tmp_path)
        assert (again.returncode, "CLI007" in again.stderr) == (2, True)
        found = re.search(r"`avow init (\S+)` with the same options", again.stderr)
        assert found is not None
        assert not new or found[1] == new
        made = avow("init", found[1], *options, cwd=tmp_path)
        assert (made.returncode, made.stdout.partition("\n")[0]) == (0, f"{found[1]}: a system, {Path(found[1]).name}")
        assert avow("check", Path(found[1]).name, cwd=tmp_path / "robot").returncode == 0
    (tmp_path / "other").mkdir()
    (tmp_path / "other/a").write_text("")
    assert "give the name of a new folder" in avow("init", "other", *options, cwd=tmp_path).stderr


def test_the_folder_to_go_to_is_quoted(tmp_path: Path) -> None:
    assert f"  cd '{tmp_path}/my robot'\n" in CliRunner().invoke(init, [str(tmp_path / "my robot")]).output


@pytest.mark.parametrize(("distro", "version"), [("noetic", "ros1"), ("humble", "ros2")])
def test_a_graph_is_of_the_distributions_ros(distro: str, version: str, tmp_path: Path) -> None:
    (tmp_path / "g.json").write_text('{"/n": {"publishers": {"/t": "std_msgs/Bool"}}}', encoding="utf-8")
    folder = run(tmp_path / "w", "--from-graph", str(tmp_path / "g.json"), "--distro", distro)
    assert f"ros_version: {version}" in (folder / "plan.yaml").read_text(encoding="utf-8")


def test_names_of_a_graph_are_data(tmp_path: Path) -> None:
    graph = '{"/node": {"publishers": {"/in": "std_msgs/Bool", "/a}//b": "x/Y", "/REAL": "std_msgs/Int32"}}}'
    (tmp_path / "g.json").write_text(graph.replace("/a}//b", "/ok"), encoding="utf-8")
    loaded = load_system(run(tmp_path / "w", "--from-graph", str(tmp_path / "g.json"), "--distro", "noetic"))
    assert [node.name for node in loaded.contract.nodes] == ["node_"]
    assert [p.name for p in loaded.contract.nodes[0].outputs] == ["in_", "REAL_"]


@pytest.mark.parametrize("length", [2, 3, 5])
def test_a_loop_is_drafted_with_the_connection_to_delay(length: int, tmp_path: Path) -> None:
    """Until then the plan's warning says the same; with a first value nothing waits for anything."""
    ring = {
        f"/n{k}": {
            "publishers": {f"/t{k}": "std_msgs/Bool", f"/u{k}": "std_msgs/Bool"},
            "subscribers": {f"/t{(k - 1) % length}": "std_msgs/Bool", f"/t{k}": "std_msgs/Bool"},
        }
        for k in range(length)
    }
    (tmp_path / "g.json").write_text(json.dumps(ring), encoding="utf-8")
    folder = run(tmp_path / "w", "--from-graph", str(tmp_path / "g.json"), "--distro", "noetic", warned="PLAN123")
    plan = (folder / "plan.yaml").read_text(encoding="utf-8")
    (stuck,) = dataflow(load_system(folder)).findings
    drafted = re.findall(r"^#   - (\{from: .*\})  #", plan, re.MULTILINE)
    last = length - 1
    assert drafted == [f"{{from: n{last}.t{last}, to: n0.t{last}, delayed: true, initial: …}}"]
    assert (stuck.code, f"connections: [{drafted[0]}]" in (stuck.hint or "")) == ("PLAN123", True)
    text = re.sub("^# (connections:|  - )", r"\1", plan.replace("initial: …", "initial: false"), flags=re.MULTILINE)
    (folder / "plan.yaml").write_text(text, encoding="utf-8")
    assert dataflow(load_system(folder)).findings == ()


def test_loops_that_share_nodes_and_stamps_are_drafted(tmp_path: Path) -> None:
    """Every loop has a connection to delay, and no stamp that comes back tells which input was answered."""
    arcs = ["ab", "ba", "bc", "cd", "dc", "da", "df"]
    graph: dict[str, dict[str, dict[str, str]]] = {f"/{n}": {"publishers": {}, "subscribers": {}} for n in "abcdfx"}
    for source, target in [*arcs, "fx"]:
        graph[f"/{source}"]["publishers"][f"/{source}{target}"] = "sensor_msgs/Temperature"
        graph[f"/{target}"]["subscribers"][f"/{source}{target}"] = "sensor_msgs/Temperature"
    (tmp_path / "g.json").write_text(json.dumps(graph), encoding="utf-8")
    options = [str(tmp_path / "w"), "--from-graph", str(tmp_path / "g.json"), "--distro", "noetic"]
    assert CliRunner().invoke(init, options, catch_exceptions=False).exit_code == 0
    folder = tmp_path / "w/contracts/w"
    plan = (folder / "plan.yaml").read_text(encoding="utf-8")
    assert plan.count("{by: stamp}") == 1  # f's alone
    text = re.sub("^# (connections:|  - )", r"\1", plan.replace("initial: …", "initial: 0"), flags=re.MULTILINE)
    (folder / "plan.yaml").write_text(text, encoding="utf-8")
    assert dataflow(load_system(folder)).findings == ()


CALLS = """\
/gripper
  Service Servers:
    /grip: std_srvs/srv/SetBool
    /gripper/get_parameters: rcl_interfaces/srv/GetParameters
    /gripper/change_state: lifecycle_msgs/srv/ChangeState
    /odd: nobody/srv/Knows
  Action Servers:
    /spin: control/action/Spin
/arm
  Service Clients:
    /grip: std_srvs/srv/SetBool
"""


def test_services_and_actions_of_a_graph_are_drafted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "graph.txt").write_text(CALLS, encoding="utf-8")
    folder = tmp_path / "w"
    done = CliRunner().invoke(init, [str(folder), "--from-graph", "graph.txt", "--distro", "humble"])
    assert done.exit_code == 0, done.output
    (folder,) = (path.parent for path in folder.rglob("system.rcl"))
    text = (folder / "system.rcl").read_text(encoding="utf-8")
    assert "std_srvs/SetBool_Request /grip matches(in.grip_request)" in text
    assert "std_srvs/SetBool_Response /grip matches(out.grip_response_success)" in text
    assert "control/Spin_Goal /spin" in text
    assert "get_parameters" not in text
    assert "change_state" not in text
    system = load_system(folder)
    assert {str(edge) for edge in dataflow(system).edges} == {
        "arm.grip_request → gripper.grip_request",
        "gripper.grip_response_success → arm.grip_response_success",
        "gripper.grip_response_message → arm.grip_response_message",
    }
    assert "{by: call}" in (folder / "plan.yaml").read_text(encoding="utf-8")
    assert CliRunner().invoke(check, [str(folder)]).exit_code == 0
    assert "not known: control/action/Spin.action, nobody/srv/Knows.srv; the topics" in done.stderr


def test_own_messages_of_a_graph_are_given_by_their_folder(tmp_path: Path) -> None:
    (tmp_path / "graph.txt").write_text(CALLS.replace("nobody/srv/Knows", "std_srvs/srv/SetBool"), encoding="utf-8")
    own = tmp_path / "src/control/action/Spin.action"
    own.parent.mkdir(parents=True)
    own.write_text("float64 angle  # rad\n---\nbool done\n---\nfloat64 left\n", encoding="utf-8")
    options = ("--from-graph", str(tmp_path / "graph.txt"), "--messages", str(tmp_path / "src"))
    system = run(tmp_path / "w", *options, warned="PLAN123")
    assert "control/Spin_Goal /spin matches(in.spin_goal)" in (system / "system.rcl").read_text(encoding="utf-8")
    text = (system / "msg/control/action/Spin.action").read_text(encoding="utf-8")
    assert text == "float64 angle\n---\nbool done\n---\nfloat64 left\n"


QOS = """\
/scan
Node name: camera
Node namespace: /
Endpoint type: PUBLISHER
  Deadline: 100000000 nanoseconds

/scan
Node name: watch
Node namespace: /
Endpoint type: SUBSCRIPTION
  Deadline: 2500000000 nanoseconds

/joy
Node name: joystick
Node namespace: /
Endpoint type: PUBLISHER
  Deadline: 500000 nanoseconds

/stop
Node name: watch
Node namespace: /
Endpoint type: PUBLISHER
  Deadline: 9223372036854775807 nanoseconds
"""


def test_deadlines_of_a_running_graph_are_drafted_as_times(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    nodes = (Listed("/camera", ("/scan",)), Listed("/watch", ("/stop",), ("/scan", "/joy")))
    listing = Listing(nodes, dict.fromkeys(("/scan", "/joy", "/stop"), "std_msgs/Float64"), QOS)
    monkeypatch.setattr("avow.cli.from_ros.ask_domain", lambda *_: listing)
    system = run(tmp_path / "w", "--from-graph", "ros2", "--distro", "humble")
    file = system / "system.rcl"
    text = file.read_text(encoding="utf-8")
    assert text.count("// steps(") == 1
    assert "// steps( at most 100 ms )" in text
    assert text.count("// assume") == 1
    assert "// assume alive_scan ( once[2500 ms](arrived(in.scan)) )" in text
    plan = (system / "plan.yaml").read_text(encoding="utf-8")
    assert (
        '#   in.joy: {assume: "once[0.5 ms](arrived(in.joy))", because: "its publisher offers this deadline"}' in plan
    )
    steps, assume = (
        re.findall(rf"// ({word}.*?\))  ", text)[0] for word in ("steps", "assume")
    )  # as a person takes them
    said = text.replace(f"// {steps}", f"{steps} //").replace(f"// {assume}", f"{assume} //")
    file.write_text(said.replace("100 ms", "101 ms").replace("2500", "99"), encoding="utf-8")
    told = CliRunner().invoke(check, [str(system)]).output
    assert told.count("warning[ROS137]") == 2
    assert "camera may leave /scan without a message for 0.101 s, and its deadline is 0.1 s" in told
    assert "watch assumes a message on /scan within 0.099 s, and its deadline is 0.1 s" in told


@pytest.mark.parametrize("seconds", [0, 1])
def test_deadlines_in_a_bag_are_drafted_as_times(seconds: int, tmp_path: Path) -> None:
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    levels = QosHistory.KEEP_LAST, 5, QosReliability.RELIABLE, QosDurability.VOLATILE, QosTime(seconds, 0)
    qos = Qos(*levels, QosTime(0, 0), QosLiveliness.AUTOMATIC, QosTime(0, 0), False)
    system = run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", "mcap", qos=[qos])))
    assert (system / "system.rcl").read_text(encoding="utf-8").count("// steps( at most 1000 ms )") == 2 * seconds


def test_services_of_a_bag_are_drafted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from rosmonitoring.test_calls import GO, RULE, write_calls  # type: ignore[import-not-found]

    monkeypatch.chdir(tmp_path)
    bag = write_calls(tmp_path / "calls", [(1, 1, 0.5), (2, 1, True)], f"{RULE}\nSRV: my_msgs/srv/Go\n{GO}", "MCAP")
    done = CliRunner().invoke(init, [str(tmp_path / "w"), "--from-bag", bag.name])
    assert done.exit_code == 0, done.output
    (folder,) = (path.parent for path in (tmp_path / "w").rglob("system.rcl"))
    text = (folder / "system.rcl").read_text(encoding="utf-8")
    assert "my_msgs/Go_Request /go matches(in." in text
    assert "my_msgs/Go_Response /go matches(out." in text
    assert (folder / "msg/my_msgs/srv/Go.srv").read_text(encoding="utf-8") == GO
    assert CliRunner().invoke(check, [str(folder)]).exit_code == 0


def written(system: Path, node: str, clause: str) -> None:
    """Write a node's first guarantee in place of its placeholder."""
    file = system / "system.rcl"
    before, start, rest = file.read_text(encoding="utf-8").partition(f"node {node} {{")
    file.write_text(f"{before}{start}{re.sub(PLACEHOLDER, lambda _: clause, rest, count=1)}", encoding="utf-8")


PLACEHOLDER = r'guarantee to_write "[^"]*"\s*\( TRUE \)'


def test_what_is_unwritten_is_counted_apart_and_behind_a_breach(tmp_path: Path) -> None:
    """A draft with one guarantee written, which the record breaks: in every format the breach comes first, and what is
    unwritten is neither refuted nor good."""
    system = run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", "mcap")))
    reports = tmp_path / "w/reports/w"

    def verified() -> dict[str, Any]:
        done = avow("verify", cwd=tmp_path / "w")
        assert done.returncode == 1, done.stdout
        case: dict[str, Any] = json.loads((reports / "report.json").read_text(encoding="utf-8"))
        return case

    case = verified()
    assert [gate["id"] for gate in case["gates"] if not gate["passed"]] == ["unwritten"]
    monitored = avow("monitor", "w", str(tmp_path / "run"), cwd=tmp_path / "w")
    assert monitored.returncode == 1
    assert "nothing was judged: write what a node promises in place of `to_write`" in monitored.stdout
    assert "to_write" not in monitored.stdout.replace("`to_write`", "")
    statuses = {view["obligation"]["name"]: view["status"] for view in case["obligations"]}
    assert statuses.pop("to_write") == "unwritten"
    assert set(statuses.values()) == {"proved"}
    assert len(json.loads((reports / "findings.sarif").read_text(encoding="utf-8"))["runs"][0]["results"]) == 2

    written(system, "geiger", 'guarantee low "The rate is low" ( out.rate < 5 )')
    plan = (system / "plan.yaml").read_text(encoding="utf-8")
    (system / "plan.yaml").write_text(
        plan.replace("out.rate: data", "out.rate: {field: data, nan: none, elsewhere: 0}")
    )
    case = verified()
    failing = [gate["id"] for gate in case["gates"] if not gate["passed"]]
    assert failing[0] == "refuted"
    assert "unwritten" in failing
    assert [(item["kind"], item["claim"]) for item in case["open_items"] if not item["advice"]] == [
        ("refuted", "w/geiger/guarantee/low"),
        ("unwritten", "w/robot1/guarantee/to_write"),
    ]
    assert "Refuted: geiger" in (reports / "report.md").read_text(encoding="utf-8")
    junit = (reports / "junit.xml").read_text(encoding="utf-8")
    assert '<skipped message="unwritten' in junit
    assert '<failure type="refuted"' in junit


@pytest.mark.parametrize("formula", ["in.rate > 0 or TRUE", "FALSE"])
def test_only_the_placeholder_is_unwritten(formula: str) -> None:
    """A guarantee of that name with another formula is one like any other, and TRUE under another name says nothing."""
    text = "node n {{ inputs( rate : REAL ) outputs( x : REAL ) topics( ) guarantee {} ( {} ) }}"
    said = checked(text.format("to_write", formula)).nodes[0]
    other = checked(text.format("other", "TRUE")).nodes[0]
    assert not said.unwritten
    assert not other.unwritten
    assert checked(text.format("to_write", "TRUE")).nodes[0].unwritten


@pytest.mark.parametrize("distro", [(), ("--distro", "humble")], ids=["alone", "humble"])
def test_a_draft_stands_without_its_bag(distro: tuple[str, ...], tmp_path: Path) -> None:
    """Types of the bag are files of the draft, the bag is named by its digest, and git is told to leave it out."""
    system = run(tmp_path / "w", "--from-bag", str(make_bag(tmp_path / "run", "mcap")), *distro)
    assert (system / "msg/geiger/msg/Status.msg").read_text() == (
        "uint8 GREEN=0\nuint8 RED=2\nstd_msgs/Header header\nuint8 level\nfloat32 rate\nstring in\n"
    )
    assert (system / "msg/std_msgs/msg/Header.msg").exists() is not bool(distro)
    assert (system / "traces/.gitignore").read_text(encoding="utf-8").endswith("/run\n")
    shutil.rmtree(system / "traces/run")
    done = CliRunner().invoke(check, [str(system)], standalone_mode=False)
    assert (done.return_value, done.output) == (0, "1 file: no errors\n")
