"""Services and actions: their requests, responses, goals, results and feedback are ports as any others."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.rml.translate import translate
from avow.backends.rosmonitoring.session import session
from avow.base.diagnostics import Rejected
from avow.ros.calls import as_message, part_topic, parts_of
from avow.system.graph import dataflow
from avow.system.load import load_system
from avow.system.plan import System

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
    assert "ROSMonitoring listens to topics" in translate(found, node.guarantees).refused["limits"]


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
