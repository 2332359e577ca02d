"""A running ROS 1 graph: a master and nodes of the test's own, and, where Debian's ROS is installed, the real ones."""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from socketserver import BaseServer
from types import SimpleNamespace
from typing import Any
from xmlrpc.server import SimpleXMLRPCServer

import pytest
from helpers import wait_for

from avow.backends.rosmonitoring.live import graphs, ros1
from avow.backends.rosmonitoring.live.follow import Board, follow, graph_of
from avow.backends.rosmonitoring.live.ros1 import Ros1, frame, header, master_of, read_header, reader
from avow.backends.rosmonitoring.session import Session, session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.base.diagnostics import Rejected
from avow.system.plan import System

from .processes import MAPPING, RCL, a_free_port, answers, running

pytest.importorskip("rosbags")


class Master:
    """What of ROS's master a publisher and a subscriber need."""

    def __init__(self, port: int = 0) -> None:
        self.server = SimpleXMLRPCServer(("127.0.0.1", port), logRequests=False, allow_none=True)
        self.publishers: dict[str, list[str]] = {}
        for call in (self.registerSubscriber, self.registerPublisher, self.unregisterSubscriber):
            self.server.register_function(call)
        self.server.register_function(self.unregisterSubscriber, "unregisterPublisher")
        self.uri = f"http://127.0.0.1:{self.server.server_address[1]}"
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def registerSubscriber(self, caller: str, topic: str, kind: str, uri: str) -> Any:  # noqa: N802 - ROS's name
        return 1, "", self.publishers.get(topic, [])

    def registerPublisher(self, caller: str, topic: str, kind: str, uri: str) -> Any:  # noqa: N802
        self.publishers.setdefault(topic, []).append(uri)
        return 1, "", []

    def unregisterSubscriber(self, caller: str, topic: str, uri: str) -> Any:  # noqa: N802
        return 1, "", 1


@pytest.fixture(autouse=True)
def _soon_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """What ends a server waits until it looks, which is each half second."""
    monkeypatch.setattr(BaseServer.serve_forever, "__defaults__", (0.01,))


@pytest.fixture
def master() -> Iterator[Master]:
    made = Master()
    yield made
    made.server.shutdown()
    made.server.server_close()


def float64(value: float) -> bytes:
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    message = store.types["std_msgs/msg/Float64"](data=value)
    return bytes(store.serialize_ros1(message, "std_msgs/msg/Float64"))


FLOAT64 = ("std_msgs/Float64", "float64 data\n", "fdb28210bfa9d7c91146260178d9a584")


def until(done: Callable[[], bool], seconds: float = 60.0) -> Callable[[], bool]:
    """Over when that is so; at the latest, as no test should need, after so many seconds."""
    end = time.monotonic() + seconds
    return lambda: done() or time.monotonic() >= end


SAID_BY = {"ros": {"nodes": {"n": {"name": ros1.CALLER}}}}
"""The name under which a test speaks."""


def heard(
    master: Master, system: System, say: Callable[[Any], None], over: Callable[[Session], bool], record: Path
) -> tuple[list[Violation], list[str]]:
    warned: list[str] = []
    with Ros1(master.uri, ()) as node:
        spoken = node.speak("/s", *FLOAT64)
        graph = Ros1(master.uri, ("s", "r"))

        def once_heard() -> None:
            while not spoken._lines:
                time.sleep(0.02)
            say(spoken)

        threading.Thread(target=once_heard, daemon=True).start()
        running = session(system)
        found = list(follow(running, graph, until(lambda: over(running)), record, None, warned.append))
    return found, warned


def test_what_a_graph_says_is_judged_and_recorded(
    master: Master, make_system: Callable[..., System], tmp_path: Path
) -> None:
    def say(spoken: Any) -> None:
        for value in (1.5, 119.0, 120.5, 7.0):
            spoken.say(float64(value))

    record = tmp_path / "run.jsonl"
    system = make_system(RCL, MAPPING, plan=SAID_BY)
    found, warned = heard(master, system, say, lambda running: running.events == 4, record)
    assert [w.partition(":")[0] for w in warned] == ["the topics of a running graph have no common order"]
    assert [(v.clause, v.index) for v in found] == [("low", 3)]
    assert [json.loads(line)["data"] for line in record.read_text("utf-8").splitlines()] == [1.5, 119.0, 120.5, 7.0]
    again = [(v.clause, v.index) for _, v in session(system).run(record)]
    assert again == [("low", 3)]


def test_a_silent_topic_is_told_while_nothing_comes(
    master: Master, make_system: Callable[..., System], tmp_path: Path
) -> None:
    system = make_system(RCL, MAPPING, fresh={"out.s": "300 ms"})
    told = lambda running: Fault.SILENT in running.counts  # noqa: E731
    found, _ = heard(master, system, lambda spoken: spoken.say(float64(1.0)), told, tmp_path / "r.jsonl")
    assert [v.clause for v in found][-1] == "out.s"
    assert "was silent for" in found[-1].explanation


def test_a_filter_passes_on_what_breaks_nothing(
    master: Master, make_system: Callable[..., System], tmp_path: Path
) -> None:
    """What the node says as /s_mon is heard as /s, but for what is wrong or unreadable; what goes past it is told."""
    record = tmp_path / "run.jsonl"
    system = make_system(RCL, MAPPING, filter=["out.s"])
    running = session(system)
    warned: list[str] = []
    done = threading.Event()
    with Ros1(master.uri, ()) as node:
        spoken = node.speak("/s_mon", *FLOAT64)
        graph = graph_of(f"ros1:{master.uri}", running, "127.0.0.1", enforce=True)
        judged = follow(running, graph, until(done.is_set), record, None, warned.append)
        found: list[Violation] = []
        judging = threading.Thread(target=lambda: found.extend(judged))
        judging.start()
        wait_for(lambda: "/s" in master.publishers)
        with Ros1(master.uri, ("s",)) as other:
            wait_for(lambda: len(graph._spoken["/s"]._lines) == 1)  # type: ignore[union-attr]
            for raw in (float64(1.5), float64(130.0), b"short", float64(7.0)):
                spoken.say(raw)
            heard = [other.inbox.get(60) for _ in range(2)]
            assert [one.read()["data"] for one in heard if one is not None and one.read is not None] == [1.5, 7.0]
            assert other.inbox.get(0) is None
        node.speak("/s", *FLOAT64)
        graph._publishers("", "/s", master.publishers["/s"])  # type: ignore[union-attr]
        wait_for(lambda: any("past the filter" in one for one in warned))
        done.set()
        judging.join()
    assert [(v.clause, v.fault) for v in found] == [("low", Fault.GUARANTEE), ("out.s", Fault.MAPPING)]
    assert running.withheld == {"/s": 2}
    topics = [json.loads(line)["topic"] for line in record.read_text("utf-8").splitlines()]
    assert topics == ["/s_mon", "/s", "/s_mon", "/s_mon", "/s_mon", "/s", "/s"]  # the last was not heard
    again = session(system)
    assert list(again.run(record)) == []
    assert [*again.unmonitored()] == ["n.low"]


@pytest.mark.slow
def test_one_who_listens_and_does_not_read_holds_nobody_up(master: Master) -> None:
    with Ros1(master.uri, ()) as node, Ros1(master.uri, ()) as other:
        spoken = node.speak("/s", *FLOAT64)
        at = ("127.0.0.1", spoken.port)
        with socket.create_connection(at), socket.create_connection(at) as slow:  # the first says not even who he is
            slow.sendall(header({"callerid": "/slow", "topic": "/s", "type": "*", "md5sum": "*"}))
            wait_for(lambda: len(spoken._lines) == 1)
            for _ in range(100):
                spoken.say(bytes(1 << 20))
            assert not spoken._lines
        other._publishers("", "/s", [node.uri])
        wait_for(lambda: len(spoken._lines) == 1)


@pytest.mark.slow
def test_publishers_of_a_filtered_topic_have_one_type(master: Master) -> None:
    with Ros1(master.uri, ("s",), filtered={"s"}) as graph, Ros1(master.uri, ()) as one, Ros1(master.uri, ()) as other:
        one.speak("/s_mon", *FLOAT64)
        graph._publishers("", "/s_mon", [one.uri])
        wait_for(lambda: "/s" in graph._spoken)
        other.speak("/s_mon", "std_msgs/Bool", "bool data\n", "8b94c1b53db61fb6aed406028ad6332a")
        graph._publishers("", "/s_mon", [one.uri, other.uri])
        heard = graph.inbox.get(60)
        assert heard is not None
        assert "made otherwise" in heard.trouble


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ({}, "the plan filters nothing"),
        ({"filter": ["out.s"], "answers": {"by": "order", "because": "a test"}}, "shows only later"),
    ],
)
def test_what_cannot_be_filtered_is_refused(make_system: Callable[..., System], more: dict[str, Any], why: str) -> None:
    with pytest.raises(Rejected, match=why):
        graph_of("ros1", session(make_system(RCL, MAPPING, **more)), "127.0.0.1", enforce=True)


def test_a_guarantee_of_two_topics_is_not_filtered(make_system: Callable[..., System]) -> None:
    rcl = RCL.replace("outputs( s : REAL )", "outputs( s : REAL, t : REAL )").replace(
        "matches(out.s) )", "matches(out.s), std_msgs/Float64 t matches(out.t) )"
    )
    system = make_system(
        rcl.replace("out.s <= 120", "out.s <= out.t"), MAPPING | {"out.t": "data"}, filter=["out.s", "out.t"]
    )
    with pytest.raises(Rejected, match="speaks of several topics"):
        graph_of("ros1", session(system), "127.0.0.1", enforce=True)
    with pytest.raises(Rejected, match="ROS 1 alone"):
        graph_of("dds", session(make_system(RCL, MAPPING, filter=["out.s"])), "127.0.0.1", enforce=True)


def test_a_wrong_digest_is_told(master: Master, make_system: Callable[..., System], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="digest"):
        reader("/s", {"type": "std_msgs/Float64", "message_definition": "float64 data\n", "md5sum": "0" * 32})
    with pytest.raises(ValueError, match="cannot be read"):
        reader("/s", {"type": "std_msgs/Float64", "message_definition": "float65 data\n", "md5sum": "0" * 32})


@pytest.mark.parametrize(
    "raw", [b"\xff\xff\xff\xff", b"\x05\x00\x00\x00abcde", b"\x08\x00\x00\x00\xff\x00\x00\x00a=bc", b"\x04\x00"]
)
def test_hostile_headers_are_refused(raw: bytes) -> None:
    one, other = socket.socketpair()
    with one, other:
        one.sendall(raw)
        one.close()
        with pytest.raises((ValueError, EOFError)):
            read_header(other)


def test_a_header_is_read_as_it_is_written() -> None:
    one, other = socket.socketpair()
    with one, other:
        one.sendall(header({"type": "a/B", "message_definition": "int32 x=1\n"}) + b"\x03\x00\x00\x00abc")
        assert read_header(other) == {"type": "a/B", "message_definition": "int32 x=1\n"}
        assert frame(other, 10) == b"abc"


def test_no_master_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros1, "AGAIN_SECONDS", 0)
    with pytest.raises(Rejected, match="no ROS 1 master"), Ros1("http://127.0.0.1:1", ("s",)):
        pass
    with pytest.raises(Rejected, match="no address"):
        master_of("ros1:ftp://x")


def test_a_master_that_is_about_to_start_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros1, "AGAIN_SECONDS", 0)
    port = a_free_port()
    started: list[Master] = []
    with Ros1(f"http://127.0.0.1:{port}", ("s",), warn=lambda text: started.append(Master(port))) as graph:
        assert [one.uri for one in started] == [graph._uri]
    started[0].server.shutdown()
    started[0].server.server_close()


def test_a_publisher_that_is_not_ready_is_asked_again(master: Master, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is named by the master before it can be heard; says nothing where it is heard; and then is there."""
    monkeypatch.setattr(ros1, "AGAIN_SECONDS", 0.01)
    monkeypatch.setattr(ros1, "PUBLISHER_SECONDS", 0.2)

    def next_trouble(graph: Ros1) -> str:
        heard = graph.inbox.get(60)
        assert heard is not None
        return heard.trouble

    with (
        Ros1(master.uri, ("s",)) as graph,
        Ros1(master.uri, ()) as node,
        socket.create_server(("127.0.0.1", 0)) as mute,
    ):
        graph._publishers("", "/s", [node.uri])
        assert "not published here; it is asked again" in next_trouble(graph)
        port = int(mute.getsockname()[1])
        node._spoken["/s"] = SimpleNamespace(topic="/s", port=port, close=lambda: None)  # type: ignore[assignment]
        while "timed out" not in next_trouble(graph):
            pass
        spoken = node.speak("/s", *FLOAT64)
        spoken.say(float64(1.5))
        while (heard := graph.inbox.get(60)) is not None and heard.read is None:
            pass
        assert heard is not None
        assert heard.read is not None
        assert heard.read()["data"] == 1.5
        spoken._lines.pop().shutdown(socket.SHUT_RDWR)
        assert [heard and heard.mark for heard in (graph.inbox.get(60), graph.inbox.get(60))] == ["_gone", "_lost"]
        graph._publishers("", "/s", [])
        assert not graph._heard


def test_a_verdict_over_unheard_messages_is_a_warning(make_system: Callable[..., System]) -> None:
    running = session(make_system(RCL, MAPPING))
    silent: Any = SimpleNamespace(diagnostics=lambda topic, system: lambda statuses: None)
    board = Board(running, silent, "/verdicts")
    levels = []
    for more in ({"data": 1.0}, {"_lost": "3 samples"}, {"data": 2.0}):
        list(running.step({"topic": "s", "time": 0, **more}))
        levels.append([(status.level, status.text) for status in board.standing()])
    assert [level for ((level, _),) in levels] == [graphs.OK, graphs.WARN, graphs.WARN]
    assert levels[2] == [(graphs.WARN, "not all was heard: 3 samples")]


def test_messages_without_room_are_marked_where_they_are_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(graphs, "QUEUED_MESSAGES", 2)
    inbox = graphs.Inbox()
    for topic in "rrrrs":
        inbox.message(topic, lambda now: {"time": now})
    heard = [one for _ in range(4) if (one := inbox.get(0)) is not None]
    inbox.message("r", lambda now: {"time": now})
    heard += [one for _ in range(2) if (one := inbox.get(0)) is not None]
    assert [(one.topic, one.read is None) for one in heard] == [
        ("r", False), ("r", False), ("r", True), ("s", True), ("r", False),
    ]  # fmt: skip
    assert {one.mark for one in heard if one.read is None} == {"_lost"}


@pytest.mark.parametrize("text", ["rosbridge:ws://127.0.0.1:9090", "zenoh"])
def test_other_graphs_are_refused(make_system: Callable[..., System], text: str) -> None:
    with pytest.raises(Rejected, match="no graph that can be listened to"):
        graph_of(text, session(make_system(RCL, MAPPING)), "127.0.0.1")


def test_calls_are_not_heard_on_a_running_graph(make_system: Callable[..., System]) -> None:
    rcl = RCL.replace("std_msgs/Float64 r matches(in.r)", "std_srvs/SetBool_Request /grip matches(in.r)")
    running = session(make_system(rcl.replace("r : REAL", "r : BOOL"), MAPPING))
    told = graph_of("ros1:http://127.0.0.1:1", running, "127.0.0.1").inbox.get(0)
    assert told is not None
    assert told.trouble == "/grip/_request is not heard on a running ros1 graph"


NODE = """
import rospy
from std_msgs.msg import Float64
from diagnostic_msgs.msg import DiagnosticArray
said = {}
rospy.init_node("n")
def hear(m):
    for s in m.status:
        level = ord(s.level) if isinstance(s.level, bytes) else s.level
        said[s.name] = (level, dict((v.key, v.value) for v in s.values))
rospy.Subscriber("/verdicts", DiagnosticArray, hear)
out = rospy.Publisher("s", Float64, queue_size=1000)
while out.get_num_connections() < 1 and not rospy.is_shutdown():
    rospy.sleep(0.05)
rate = rospy.Rate(200)
for k in range(400):
    out.publish(200.0 if k % 100 == 50 else k / 10.0)
    rate.sleep()
while said.get("n.low", (0, {}))[1].get("published") != "400" and not rospy.is_shutdown():
    rospy.sleep(0.05)
print(said["n.low"][0], flush=True)
"""


@pytest.mark.slow
@pytest.mark.needs_ros1
def test_a_real_master_and_a_rospy_node(make_system: Callable[..., System], tmp_path: Path) -> None:
    """400 messages at 200 Hz, four of them wrong: these are found, none is lost, and the node hears the verdicts."""
    port = a_free_port()
    environment = {
        **os.environ,
        "ROS_MASTER_URI": f"http://127.0.0.1:{port}",
        "ROS_IP": "127.0.0.1",
        "ROS_HOME": str(tmp_path / "ros"),
        "PYTHONPATH": "/usr/lib/python3/dist-packages",
    }
    system = make_system(RCL, MAPPING)
    (tmp_path / "node.py").write_text(NODE, encoding="utf-8")
    command = [
        sys.executable, "-m", "avow", "monitor", system.plan.root, "--live", f"ros1:http://127.0.0.1:{port}",
        "--record", tmp_path / "run.jsonl", "--verdicts", "/verdicts", "--json",
    ]  # fmt: skip
    node = ["/usr/bin/python3", tmp_path / "node.py"]
    with running(["rosmaster", "--core", "-p", port], env=environment):
        wait_for(lambda: answers(port))
        with (
            running(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as monitor,
            running(node, env=environment, stdout=subprocess.PIPE) as said,
        ):
            assert said.communicate()[0].strip() == "2"
            monitor.send_signal(signal.SIGINT)
            out, wrong = monitor.communicate()
    assert monitor.returncode == 1, out + wrong
    found = json.loads(out)
    assert found["nodes"][0]["relevant"] == 400
    assert [v["event"] for v in found["violations"]] == [51, 151, 251, 351]
