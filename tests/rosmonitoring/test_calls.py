"""Services and actions: their requests, responses, goals, results and feedback are ports as any others."""

from __future__ import annotations

import json
import runpy
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import yaml
from oracle.rosmonitoring import problems

from avow.backends.rosmonitoring.configuration import configuration, of_system
from avow.backends.rosmonitoring.live.serve import answer
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.rml.translate import translate
from avow.backends.rosmonitoring.session import session
from avow.base.diagnostics import Rejected
from avow.ros.calls import as_message, part_topic, parts_of
from avow.system.graph import dataflow
from avow.system.load import load_system
from avow.system.plan import System

from .test_bags import write_events

pytest.importorskip("rosbags")

GO = "float64 speed\n---\nbool ok\nstring in\n"
EVENT = """\
service_msgs/ServiceEventInfo info
my_msgs/Go_Request[<=1] request
my_msgs/Go_Response[<=1] response
"""
CONTRACT = """
node server { inputs( speed : REAL ) outputs( ok : BOOL )
  topics( my_msgs/Go_Request /go matches(in.speed), my_msgs/Go_Response /go matches(out.ok) )
  assume known ( in.speed <= 100 )
  guarantee limits ( out.ok <=> in.speed <= 2 ) }
node client { inputs( ok : BOOL ) outputs( speed : REAL )
  topics( my_msgs/Go_Request /go matches(out.speed), my_msgs/Go_Response /go matches(in.ok) )
  guarantee asks ( out.speed <= 10 ) }
"""
PLAN = """\
messages: [my_msgs]
connections: [{from: server.ok, to: client.ok, delayed: true, initial: true}]
nodes:
  server:
    methods: [rosmonitoring: {answers: {by: call}}]
"""
RULE = "=" * 80
WHOLE = f"""\
{EVENT}{RULE}
MSG: service_msgs/ServiceEventInfo
uint8 event_type
builtin_interfaces/Time stamp
char[16] client_gid
int64 sequence_number
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{RULE}
MSG: my_msgs/srv/Go_Request
float64 speed
{RULE}
MSG: my_msgs/srv/Go_Response
bool ok
string in
"""
TEXTS = {
    "event": WHOLE,
    "service": GO,
    "service with its name": f"{RULE}\nSRV: my_msgs/srv/Go\n{GO}",
}


def make(folder: Path, plan: str = PLAN, contract: str = CONTRACT) -> System:
    (folder / "my_msgs/srv").mkdir(parents=True, exist_ok=True)
    (folder / "my_msgs/srv/Go.srv").write_text(GO, encoding="utf-8")
    (folder / "s.rcl").write_text(contract, encoding="utf-8")
    (folder / "plan.yaml").write_text(plan, encoding="utf-8")
    return load_system(folder)


def write_calls(path: Path, calls: list[tuple[int, int, float | bool | None]], text: str, plugin: str) -> Path:
    """A ROS 2 bag of service events: (event_type, sequence number, what is asked or answered; None: no content)."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    request, response = GO.split("---\n")
    store.register(get_types_from_msg(request, "my_msgs/msg/Go_Request"))
    store.register(get_types_from_msg(response, "my_msgs/msg/Go_Response"))
    store.register(get_types_from_msg(EVENT, "my_msgs/msg/Go_Event"))
    types: Any = store.types
    import numpy as np

    def info(kind: int, number: int) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=number, nanosec=0)
        gid = np.arange(16, dtype=np.uint8)
        return types["service_msgs/msg/ServiceEventInfo"](
            event_type=kind, stamp=stamp, client_gid=gid, sequence_number=number
        )

    with Writer(path, version=9, storage_plugin=StoragePlugin[plugin]) as writer:
        connection = writer.add_connection(
            "/go/_service_event", "my_msgs/srv/Go_Event", msgdef=text, rihs01="RIHS01_" + "0" * 64
        )
        for k, (kind, number, said) in enumerate(calls, start=1):
            asked = [] if kind > 1 or said is None else [types["my_msgs/msg/Go_Request"](speed=said)]
            told = [] if kind < 2 or said is None else [types["my_msgs/msg/Go_Response"](ok=said, in_="x")]
            event = types["my_msgs/msg/Go_Event"](info=info(kind, number), request=asked, response=told)
            writer.write(connection, k * 10**9, store.serialize_cdr(event, "my_msgs/msg/Go_Event"))
    return path


def judged(system: System, bag: Path) -> tuple[list[tuple[str, int]], list[str]]:
    """(what was broken, at which event), and what is unmonitored."""
    running = session(system, ("server",), bag)
    found = [(f"{v.node}.{v.clause}", v.index) for _, v in running.run(bag)]
    return found, [*running.unmonitored()]


@pytest.mark.parametrize("form", TEXTS)
@pytest.mark.parametrize("plugin", ["SQLITE3", "MCAP"])
def test_calls_of_a_bag_are_judged_each_by_its_own_request(tmp_path: Path, form: str, plugin: str) -> None:
    calls = [
        (0, 1, 1.0),
        (1, 1, 1.0),
        (1, 2, 5.0),
        (2, 1, True),
        (3, 1, True),
        (2, 2, False),
        (1, 3, 9.0),
        (2, 3, True),
    ]
    bag = write_calls(tmp_path / "run", calls, TEXTS[form], plugin)
    assert judged(make(tmp_path), bag) == ([("server.limits", 8)], [])


def test_a_call_recorded_without_content_is_unreadable(tmp_path: Path) -> None:
    bag = write_calls(tmp_path / "run", [(1, 1, 1.0), (2, 1, True), (1, 2, None), (2, 2, None)], WHOLE, "MCAP")
    found, unmonitored = judged(make(tmp_path), bag)
    assert [index for _, index in found] == [3, 4]
    assert unmonitored == ["server.known", "server.limits"]


def test_a_ros1_bag_holds_no_calls(tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    with Writer(tmp_path / "run.bag") as writer:
        writer.add_connection("/x", "std_msgs/msg/Bool", typestore=store)
    with pytest.raises(Rejected, match="cannot hold calls of services: /go/_re") as caught:
        session(make(tmp_path), ("server",), tmp_path / "run.bag")
    assert {d.code for d in caught.value.diagnostics} == {"MON206"}


def test_calls_link_and_rml_refuses_them_by_name(tmp_path: Path) -> None:
    system = make(tmp_path)
    assert [f"{e} {e.topic}" for e in dataflow(system).edges] == [
        "client.speed → server.speed /go/_request",
        "server.ok → client.ok (delayed) /go/_response",
    ]
    node = system.contract.node("server")
    found, faults = setup(system, node, system.plan.node("server").methods[0].options)
    assert faults == ()
    assert "Avow writes RML about topics" in translate(found, node.guarantees).refused["limits"]


def test_ends_of_a_call_have_to_agree(tmp_path: Path) -> None:
    wrong = CONTRACT.replace("my_msgs/Go_Request /go matches(out.speed)", "other/Go_Request /go matches(out.speed)")
    with pytest.raises(Rejected, match="/go/_request is"):
        make(tmp_path, contract=wrong)


@pytest.mark.parametrize(
    ("topic", "kind", "parts"),
    [
        ("/spin/_action/feedback", "a/Spin_FeedbackMessage", {"/spin/_feedback": "a/Spin_Feedback"}),
        ("/spin/_action/send_goal/_service_event", "a/Spin_SendGoal_Event", {"/spin/_goal": "a/Spin_Goal"}),
        ("/spin/_action/get_result/_service_event", "a/Spin_GetResult_Event", {"/spin/_result": "a/Spin_Result"}),
        ("/spin/goal", "a/SpinActionGoal", {"/spin/_goal": "a/Spin_Goal"}),
        ("/spin/feedback", "a/SpinActionFeedback", {"/spin/_feedback": "a/Spin_Feedback"}),
        ("/spin/goal", "a/Pose", {}),
        ("/scan", "sensor_msgs/LaserScan", {}),
    ],
)
def test_what_recorded_topics_hold_of_calls(topic: str, kind: str, parts: dict[str, str]) -> None:
    assert parts_of(topic, kind) == parts


def test_names_of_parts() -> None:
    assert part_topic("/go", "std_srvs/srv/SetBool_Request") == "/go/_request"
    assert part_topic("/spin", "a/Spin_Feedback") == "/spin/_feedback"
    assert part_topic("/scan", "my_msgs/LaserScan") == "/scan"
    assert as_message("a/msg/B", "int32 x\n") == ("a/msg/B", "int32 x\n")


SPIN = "float64 turns\n---\nfloat64 done\n---\nfloat64 sofar\n"
ACTION = """
node spinner { inputs( turns : REAL ) outputs( done : REAL, sofar : REAL )
  topics( my_msgs/Spin_Goal /spin matches(in.turns), my_msgs/Spin_Result /spin matches(out.done),
          my_msgs/Spin_Feedback /spin matches(out.sofar) )
  guarantee all_done ( out.done == in.turns )
  guarantee forward ( out.sofar >= 0 ) }
"""
ACTION_PLAN = "nodes: {spinner: {methods: [rosmonitoring: {answers: {by: call}}]}}\n"
UUID = "uint8[16] uuid"


def spinning(folder: Path) -> System:
    (folder / "my_msgs/action").mkdir(parents=True)
    (folder / "my_msgs/action/Spin.action").write_text(SPIN, encoding="utf-8")
    (folder / "s.rcl").write_text(ACTION, encoding="utf-8")
    (folder / "plan.yaml").write_text(f"messages: [my_msgs]\n{ACTION_PLAN}", encoding="utf-8")
    return load_system(folder)


def broken(system: System, bag: Path) -> list[tuple[str, int]]:
    running = session(system, (), bag)
    found = [(v.clause, v.index) for _, v in running.run(bag)]
    assert [*running.unmonitored()] == []
    return found


def test_a_ros1_bag_holds_actions(tmp_path: Path) -> None:
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    parts = dict(zip(("Goal", "Result", "Feedback"), SPIN.split("---\n"), strict=True))
    for part, text in parts.items():
        store.register(get_types_from_msg(text, f"my_msgs/msg/Spin{part}"))
        first = "goal_id" if part == "Goal" else "status"
        kind = "actionlib_msgs/GoalID" if part == "Goal" else "actionlib_msgs/GoalStatus"
        whole = f"std_msgs/Header header\n{kind} {first}\nmy_msgs/Spin{part} {part.lower()}\n"
        store.register(get_types_from_msg(whole, f"my_msgs/msg/SpinAction{part}"))
    types: Any = store.types
    time = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
    header = types["std_msgs/msg/Header"](seq=0, stamp=time, frame_id="")

    def message(part: str, goal: str, value: float) -> Any:
        known = types["actionlib_msgs/msg/GoalID"](stamp=time, id=goal)
        status = types["actionlib_msgs/msg/GoalStatus"](goal_id=known, status=3, text="")
        field = {"Goal": "turns", "Result": "done", "Feedback": "sofar"}[part]
        content = types[f"my_msgs/msg/Spin{part}"](**{field: value})
        first = {"goal_id": known} if part == "Goal" else {"status": status}
        return types[f"my_msgs/msg/SpinAction{part}"](header=header, **first, **{part.lower(): content})

    said = [("Goal", "a", 2.0), ("Goal", "b", 5.0), ("Feedback", "a", 1.0), ("Result", "b", 5.0), ("Result", "a", 3.0)]
    with Writer(tmp_path / "run.bag") as writer:
        connections: dict[str, Any] = {}
        for k, (part, goal, value) in enumerate([*said, ("Feedback", "b", -1.0)], start=1):
            kind = f"my_msgs/msg/SpinAction{part}"
            if part not in connections:
                connections[part] = writer.add_connection(f"/spin/{part.lower()}", kind, typestore=store)
            writer.write(connections[part], k * 10**9, store.serialize_ros1(message(part, goal, value), kind))
    assert broken(spinning(tmp_path), tmp_path / "run.bag") == [("all_done", 5), ("forward", 6)]


def test_a_ros2_bag_holds_actions_as_events_and_feedback(tmp_path: Path) -> None:
    import numpy as np
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    goal, result, feedback = SPIN.split("---\n")
    event = EVENT.replace("my_msgs/Go", "my_msgs/{0}")
    texts = {
        "Spin_Goal": goal,
        "Spin_Result": result,
        "Spin_Feedback": feedback,
        "Spin_SendGoal_Request": "unique_identifier_msgs/UUID goal_id\nmy_msgs/Spin_Goal goal\n",
        "Spin_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp\n",
        "Spin_GetResult_Request": "unique_identifier_msgs/UUID goal_id\n",
        "Spin_GetResult_Response": "int8 status\nmy_msgs/Spin_Result result\n",
        "Spin_SendGoal_Event": event.format("Spin_SendGoal"),
        "Spin_GetResult_Event": event.format("Spin_GetResult"),
        "Spin_FeedbackMessage": "unique_identifier_msgs/UUID goal_id\nmy_msgs/Spin_Feedback feedback\n",
    }
    for name, text in texts.items():
        store.register(get_types_from_msg(text, f"my_msgs/msg/{name}"))
    types: Any = store.types

    def uuid(number: int) -> Any:
        return types["unique_identifier_msgs/msg/UUID"](uuid=np.full(16, number, dtype=np.uint8))

    def called(name: str, kind: int, number: int, content: Any) -> Any:
        stamp = types["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
        info = types["service_msgs/msg/ServiceEventInfo"](
            event_type=kind, stamp=stamp, client_gid=np.zeros(16, dtype=np.uint8), sequence_number=number
        )
        sides = {"request": [content] if kind < 2 else [], "response": [content] if kind > 1 else []}
        return types[f"my_msgs/msg/{name}_Event"](info=info, **sides)

    def sent(number: int, turns: float) -> Any:
        content = types["my_msgs/msg/Spin_Goal"](turns=turns)
        return called(
            "Spin_SendGoal", 1, number, types["my_msgs/msg/Spin_SendGoal_Request"](goal_id=uuid(number), goal=content)
        )

    def asked(number: int) -> Any:
        wanted = types["my_msgs/msg/Spin_GetResult_Request"](goal_id=uuid(number))
        return called("Spin_GetResult", 1, 10 + number, wanted)

    def done(number: int, value: float) -> Any:
        content = types["my_msgs/msg/Spin_Result"](done=value)
        answer = types["my_msgs/msg/Spin_GetResult_Response"](status=4, result=content)
        return called("Spin_GetResult", 2, 10 + number, answer)

    def told(number: int, value: float) -> Any:
        content = types["my_msgs/msg/Spin_Feedback"](sofar=value)
        return types["my_msgs/msg/Spin_FeedbackMessage"](goal_id=uuid(number), feedback=content)

    names = {
        "Spin_SendGoal_Event": "/spin/_action/send_goal/_service_event",
        "Spin_GetResult_Event": "/spin/_action/get_result/_service_event",
        "Spin_FeedbackMessage": "/spin/_action/feedback",
    }
    said = [sent(1, 2.0), sent(2, 5.0), asked(1), asked(2), told(1, 1.0), done(2, 5.0), done(1, 3.0), told(2, -1.0)]
    with Writer(tmp_path / "run", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for k, message in enumerate(said, start=1):
            name = message.__msgtype__.rpartition("/")[2]
            if name not in connections:
                text, _ = store.generate_msgdef(f"my_msgs/msg/{name}", ros_version=2)
                connections[name] = writer.add_connection(
                    names[name], f"my_msgs/action/{name}", msgdef=text, rihs01="RIHS01_" + "0" * 64
                )
            writer.write(connections[name], k * 10**9, bytes(store.serialize_cdr(message, message.__msgtype__)))
    assert broken(spinning(tmp_path), tmp_path / "run") == [("all_done", 7), ("forward", 8)]


def test_a_json_trace_names_the_parts(tmp_path: Path) -> None:
    trace = tmp_path / "run.jsonl"
    trace.write_text(
        '{"topic": "/spin/_goal", "time": 0, "turns": 2, "_call": "a"}\n'
        '{"topic": "/spin/_feedback", "time": 1, "sofar": 1, "_call": "a"}\n'
        '{"topic": "/spin/_result", "time": 2, "done": 1, "_call": "a"}\n',
        encoding="utf-8",
    )
    assert broken(spinning(tmp_path), trace) == [("all_done", 3)]


# -- ROSMonitoring's service monitors ----------------------------------------------------------------------------------


def parts(system: System, **options: Any) -> list[tuple[Any, dict[str, Any]]]:
    return [(setup(system, node, None)[0], {"ros_version": "ros2", **options}) for node in system.contract.nodes]


def test_one_monitor_forwards_the_calls_of_a_service(tmp_path: Path) -> None:
    """That of the server, wherever it stands. A service's monitor only logs, also where all is ordered."""
    server, client = CONTRACT.split("\nnode client")
    system = make(tmp_path, contract=f"node client{client}\n{server}\n")
    text = of_system(parts(system, ordered="50 ms"))
    assert problems(text) == []
    assert yaml.safe_load(text)["monitors"] == [
        {
            "monitor": {
                "id": "monitor_server",
                "log": "./server_log.txt",
                "silent": False,
                "warning": 1,
                "topics": [],
                "services": [
                    {
                        "name": "/go",
                        "type": "my_msgs.srv.Go",
                        "action": "log",
                        "ordering": {"enabled": True, "max_delay_ms": 50},
                    }
                ],
            }
        }
    ]
    alone = configuration(*next(p for p in parts(system) if p[0].node.name == "client"))
    assert problems(alone) == []
    assert "name: /go\n" in alone


def test_actions_are_left_out_and_calls_are_not_filtered(tmp_path: Path) -> None:
    spinning(tmp_path)
    send = "my_msgs/Spin_SendGoal_Response /spin/_action/send_goal matches(out.done)"
    contract = ACTION.replace("my_msgs/Spin_Result /spin matches(out.done)", send)
    (tmp_path / "s.rcl").write_text(contract, encoding="utf-8")
    with pytest.raises(Rejected, match="a list of monitors"):
        of_system(parts(load_system(tmp_path)))
    plan = PLAN.replace("{by: call}", "{by: call}, filter: [out.ok]")
    system = make(tmp_path, plan)
    server = system.plan.node("server").methods[0].options
    faults = setup(system, system.contract.node("server"), server)[1]
    assert [fault.message for fault in faults] == ["filter: out.ok is no output that a topic's messages carry"]


def request(time: float, **fields: Any) -> dict[str, Any]:
    return {"service": "/go", "time": time, "request": fields}


def response(time: float, ok: bool, **more: Any) -> dict[str, Any]:
    return {"service": "/go", "time": time, "response": {"ok": ok, "in": "", **more}}


SEQUENCES: dict[str, tuple[list[dict[str, Any]], int, int]] = {
    "good": (
        [
            {"service": "/stop", "time": 0, "request": ""},
            request(1, speed=1),
            response(2, True),
            request(3, speed=5),
            response(4, False),
        ],
        2,
        0,
    ),
    "wrong": ([request(1, speed=1), response(2, True), request(3, speed=5), response(4, True)], 2, 1),
    "overlapping": ([request(1, speed=1), request(2, speed=5), response(3, False), response(4, True)], 0, 0),
    "after an overlap": (
        [request(1, speed=1), request(2, speed=1), response(3, False), response(4, False)]
        + [event for k in range(5, 105, 2) for event in (request(k, speed=1), response(k + 1, k != 99))],
        50,
        1,
    ),
    "late": (
        [request(1, speed=1), request(2, speed=5), response(3, False), request(4, speed=5), response(5, True)],
        0,
        0,
    ),
    "answered twice": ([request(1, speed=1), response(2, True), response(3, False)], 1, 0),
    "no request": ([response(1, True), request(2, speed=5), response(3, False)], 1, 0),
    "stamped": ([request(1, speed=5, stamp={"sec": 1, "nanosec": 0}), response(2, True)], 0, 0),
    "stamped response": ([request(1, speed=5), response(2, True, header={})], 0, 0),
}
"""Calls as ROSMonitoring reports them, and how many of them are decided and broken."""


@pytest.mark.parametrize("name", SEQUENCES)
def test_calls_that_service_monitors_report(name: str, tmp_path: Path) -> None:
    """A response without a certain request is undecided, in a log and live."""
    events, decided, broken = SEQUENCES[name]
    system = make(tmp_path)
    trace = tmp_path / "run.jsonl"
    trace.write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    recorded, live = session(system, ("server",), trace), session(system, ("server",))
    assert [v.clause for _, v in recorded.run(trace)] == ["limits"] * broken
    live.prompt()
    replies = [json.loads(answer(live, json.dumps(event))) for event in events]
    assert [reply["verdict"] for reply in replies].count("currently_false") == broken
    assert [*live.finish()] == []
    for running in (recorded, live):
        assert running.monitors[0].tallies["limits"].decided == decided
        assert bool(running.unmonitored()) is (decided < sum("response" in event for event in events))


@pytest.mark.parametrize("wrong", [{"request": {}, "response": {}}, {}])
def test_an_event_of_a_service_has_one_part(wrong: dict[str, Any], tmp_path: Path) -> None:
    event = json.dumps({"service": "/go", "time": 1, **wrong})
    (tmp_path / "run.jsonl").write_text(event + "\n", encoding="utf-8")
    system = make(tmp_path)
    with pytest.raises(Rejected, match="either a `request` or a `response`"):
        [*session(system).run(tmp_path / "run.jsonl")]
    assert json.loads(answer(session(system), event))["verdict"] == "currently_false"


@pytest.mark.parametrize(("ros", "folder"), [("ros1", "src"), ("ros2", "monitor")])
def test_rosmonitoring_makes_the_monitor_whose_events_are_judged(ros: str, folder: str, tmp_path: Path) -> None:
    """With ROSMonitoring's own generator (3.0, not on PyPI: `PYTHONPATH=…/ROSMonitoring/src`), without ROS."""
    generator = [sys.executable, "-m", "rosmonitoring.cli"]
    if subprocess.run([*generator, "--help"], cwd=tmp_path, capture_output=True, check=False).returncode:
        pytest.skip("ROSMonitoring is not on the path")
    system = make(tmp_path)
    (tmp_path / "all.yaml").write_text(of_system(parts(system)), encoding="utf-8")
    subprocess.run(
        [*generator, "generate", "all.yaml", "--ros-version", ros, "--output", "."], cwd=tmp_path, check=True
    )
    made = runpy.run_path(str(tmp_path / "monitor" / folder / "monitor_server.py"))
    (interface,) = made["INTERFACES"]
    own = made["ROSMonitor_monitor_server"].__new__(made["ROSMonitor_monitor_server"])
    events = [
        own._wire_event(own._event(interface, SimpleNamespace(**content), kind))
        for speed, ok in ((1.0, True), (5.0, True))
        for kind, content in (("request", {"speed": speed}), ("response", {"ok": ok}))
    ]
    (tmp_path / "run.jsonl").write_text("".join(json.dumps(e) + "\n" for e in events), encoding="utf-8")
    running = session(system, ("server",), tmp_path / "run.jsonl")
    assert [(v.clause, v.index) for _, v in running.run(tmp_path / "run.jsonl")] == [("limits", 4)]


WORLD = """
node watch { inputs( speed : REAL, turns : REAL, x : REAL in m ) outputs( ok : BOOL, done : REAL, near : BOOL )
  topics( my_msgs/Go_Request /go matches(in.speed), my_msgs/Go_Response /go matches(out.ok),
          my_msgs/Spin_Goal /spin matches(in.turns), my_msgs/Spin_Result /spin matches(out.done),
          geometry_msgs/PointStamped /seen in map matches(in.x), std_msgs/Bool /near matches(out.near) )
  guarantee limits ( out.ok <=> in.speed <= 2 )
  guarantee all_done ( out.done == in.turns )
  guarantee close ( in.x < 5 -> out.near ) }
"""
ANSWERS = "{by: call, others: {latency: 20 ms, jitter: 5 ms, because: measured}}"
WORLD_PLAN = f"nodes: {{watch: {{mapping: {{in.x: point.x}}, methods: [rosmonitoring: {{answers: {ANSWERS}}}]}}}}\n"


def test_a_bag_with_a_service_an_action_and_transforms_is_judged(tmp_path: Path) -> None:
    """Each of the three has one fault, and is judged as if it were alone."""
    goal, result, _ = SPIN.split("---\n")
    request, response = GO.split("---\n")
    event = EVENT.replace("my_msgs/Go", "my_msgs/{0}")
    texts = {
        "Go_Request": request,
        "Go_Response": response,
        "Go_Event": EVENT,
        "Spin_Goal": goal,
        "Spin_Result": result,
        "Spin_SendGoal_Request": "unique_identifier_msgs/UUID goal_id\nmy_msgs/Spin_Goal goal\n",
        "Spin_SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp\n",
        "Spin_SendGoal_Event": event.format("Spin_SendGoal"),
        "Spin_GetResult_Request": "unique_identifier_msgs/UUID goal_id\n",
        "Spin_GetResult_Response": "int8 status\nmy_msgs/Spin_Result result\n",
        "Spin_GetResult_Event": event.format("Spin_GetResult"),
    }
    services = {"/go": "Go", "/spin/_action/send_goal": "Spin_SendGoal", "/spin/_action/get_result": "Spin_GetResult"}
    kinds = {f"{name}/_service_event": f"my_msgs/msg/{kind}_Event" for name, kind in services.items()}
    kinds |= {"/tf": "tf2_msgs/msg/TFMessage", "/seen": "geometry_msgs/msg/PointStamped", "/near": "std_msgs/msg/Bool"}

    def called(at: float, name: str, kind: int, number: int, content: dict[str, Any]) -> dict[str, Any]:
        info = {
            "event_type": kind,
            "stamp": {"sec": 1, "nanosec": 0},
            "client_gid": [0] * 16,
            "sequence_number": number,
        }
        sides = {"request": [content] if kind < 2 else [], "response": [content] if kind > 1 else []}
        return {"topic": f"{name}/_service_event", "time": at, "info": info, **sides}

    def uuid(number: int) -> dict[str, Any]:
        return {"goal_id": {"uuid": [number] * 16}}

    def header(at: float, frame: str) -> dict[str, Any]:
        return {"header": {"stamp": {"sec": int(at), "nanosec": 0}, "frame_id": frame}}

    def moved(at: float, x: float) -> dict[str, Any]:
        turn = {"rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}}
        place = {
            **header(at, "map"),
            "child_frame_id": "base",
            "transform": {"translation": {"x": x, "y": 0.0, "z": 0.0}, **turn},
        }
        return {"topic": "/tf", "time": at, "transforms": [place]}

    def seen(at: float, x: float, near: bool) -> list[dict[str, Any]]:
        point = {"topic": "/seen", "time": at + 0.5, **header(at, "base"), "point": {"x": x, "y": 0.0, "z": 0.0}}
        return [point, {"topic": "/near", "time": at + 0.53, "data": near}]

    _, sent, got = services
    said = [moved(0, 0.0), moved(2, 4.0), *seen(1, 1.0, True), *seen(2, 0.5, False), *seen(0, 9.0, False)]
    said += [called(3.0, "/go", 1, 1, {"speed": 1.0}), called(3.1, "/go", 1, 2, {"speed": 5.0})]
    said += [called(3.2, "/go", 2, 2, {"ok": True, "in_": ""}), called(3.3, "/go", 2, 1, {"ok": True, "in_": ""})]
    for number, turns, done in ((1, 2.0, 2.0), (2, 5.0, 4.0)):
        said += [called(4.0 + number, sent, 1, number, {**uuid(number), "goal": {"turns": turns}})]
        said += [called(4.1 + number, got, 1, number, uuid(number))]
        said += [called(4.2 + number, got, 2, number, {"status": 4, "result": {"done": done}})]
    said = sorted(said, key=lambda one: one["time"])
    bag = write_events(tmp_path / "run", kinds, said, {f"my_msgs/msg/{name}": text for name, text in texts.items()})
    (tmp_path / "my_msgs/action").mkdir(parents=True)
    (tmp_path / "my_msgs/action/Spin.action").write_text(SPIN, encoding="utf-8")
    system = make(tmp_path, f"messages: [my_msgs]\nros: {{distro: jazzy}}\n{WORLD_PLAN}", WORLD)
    running = session(system, (), bag)
    found = [(v.clause, v.time) for _, v in running.run(bag)]
    assert found == [("close", "2.53"), ("limits", "3.2"), ("all_done", "6.2")]
    tallies = {name: tally for _, name, _, tally in running.clauses()}
    assert {name: (t.judged, t.broken) for name, t in tallies.items()} == {
        "limits": (2, 1),
        "all_done": (2, 1),
        "close": (3, 1),
    }


STATES = """
context {
  Goal : {accepted, executing, canceling, succeeded, canceled, aborted};
  State : {unconfigured, inactive, active, finalized};
}
node mover { inputs( clear : BOOL, state : State ) outputs( goal : Goal )
  topics( bool clear matches(in.clear), lifecycle_msgs/TransitionEvent mover/transition_event matches(in.state),
          action_msgs/GoalStatusArray spin/_action/status matches(out.goal) )
  guarantee safe ( in.state == active -> (out.goal == executing -> in.clear) )
  guarantee ends ( rose(out.goal == executing) -> within[2 s](out.goal in {succeeded, canceled, aborted}) ) }
"""


def test_states_of_goals_and_of_lifecycle_nodes_are_enumerations(tmp_path: Path) -> None:
    words = ("accepted", "executing", "canceling", "succeeded", "canceled", "aborted")
    status = {"field": "status_list[-1].status", "values": {f"STATUS_{word.upper()}": word for word in words}}
    method = {"answers": {"by": "arrival", "because": "one process writes the trace"}}
    mapping = {"in.state": "goal_state.label", "out.goal": status}
    plan = {
        "ros": {"distro": "humble"},
        "nodes": {"mover": {"mapping": mapping, "methods": [{"rosmonitoring": method}]}},
    }

    def turned(at: float, label: str) -> dict[str, Any]:
        return {"topic": "/mover/transition_event", "time": at, "goal_state": {"id": 0, "label": label}}

    def goals(at: float, *states: str) -> dict[str, Any]:
        return {
            "topic": "/spin/_action/status",
            "time": at,
            "status_list": [{"status": words.index(s) + 1} for s in states],
        }

    events = [{"topic": "clear", "time": 0, "data": False}, turned(0.1, "inactive")]
    events += [goals(1, "executing"), goals(2, "succeeded"), turned(3, "active"), goals(4, "succeeded", "executing")]
    events += [{"topic": "clear", "time": 4.5, "data": True}, goals(7, "succeeded", "aborted")]
    system = make(tmp_path, json.dumps(plan), STATES)
    (tmp_path / "t.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events), encoding="utf-8")
    found = [(v.clause, v.time) for _, v in session(system).run(tmp_path / "t.jsonl")]
    assert found == [("safe", "4"), ("ends", "6")]
