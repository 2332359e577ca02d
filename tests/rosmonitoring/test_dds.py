"""A running ROS 2 graph over DDS: a writer in another process, heard, judged and recorded here."""

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
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from click.testing import CliRunner
from helpers import wait_for

from avow.backends.rosmonitoring.live import dds
from avow.backends.rosmonitoring.live.follow import UNORDERED, follow, graph_of
from avow.backends.rosmonitoring.session import Session, session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.base.diagnostics import Rejected
from avow.cli.init import command as init
from avow.ros.dds import ask_domain
from avow.ros.listing import Listed, Listing
from avow.system.code_ends import checked
from avow.system.load import load_system
from avow.system.plan import System

from .processes import LONGEST, MAPPING, RCL, running
from .test_bags import write_bag
from .test_calls import PLAN, make, spinning

needs_dds = pytest.mark.needs_dds
HERE = Path(__file__).parent


class Peer:
    """The other process."""

    def __init__(self, process: subprocess.Popen[str], domain: int) -> None:
        self.process, self.domain = process, domain

    def __call__(self, do: str, **more: Any) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.write(json.dumps({"do": do, **more}) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())

    def write(self, topic: str, kind: str = "Double", qos: tuple[str, ...] = ("reliable",), name: str = "") -> None:
        self("write", name=name or topic, topic=f"rt/{topic}", kind=kind, qos=list(qos))

    def calls(self, service: str, asked: str, told: str) -> None:
        """Writers of a service's requests and responses."""
        self("write", name="asked", topic=f"rq/{service}Request", kind=asked, qos=["reliable"])
        self("write", name="told", topic=f"rr/{service}Reply", kind=told, qos=["reliable"])

    def say(self, topic: str, *values: Any, **more: Any) -> None:
        self("say", name=topic, values=list(values), **more)

    def heard(self, topic: str, readers: int = 1) -> None:
        wait_for(lambda: self("heard", name=topic) == readers)


def a_free_domain() -> int:
    """One in which nobody is: who comes first takes the first port that DDS computes from the domain."""
    for k in range(100):
        domain = 1 + (os.getpid() + k) % 100
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe, suppress(OSError):
            probe.bind(("127.0.0.1", 7410 + 250 * domain))
            return domain
    raise AssertionError("somebody is in every domain")


@pytest.fixture
def peer() -> Iterator[Peer]:
    domain = a_free_domain()
    command = [sys.executable, HERE / "dds_peer.py", domain]
    with running(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        yield Peer(process, domain)


def running_of(system: System, record: Path) -> Session:
    """The session that has judged a record."""
    judged = session(system)
    list(judged.run(record))
    return judged


class Listening:
    """A monitor in a thread of its own."""

    def __init__(self, peer: Peer, system: System, record: Path | None = None, verdicts: str | None = None) -> None:
        self.session = session(system)
        self.found: list[Violation] = []
        self.warned: list[str] = []
        self._over = threading.Event()
        graph = graph_of(f"dds:{peer.domain}", self.session, "127.0.0.1")
        judged = follow(self.session, graph, self._over.is_set, record, verdicts, self._warn)
        self._thread = threading.Thread(target=lambda: self.found.extend(judged))

    def _warn(self, text: str) -> None:
        if not text.startswith(UNORDERED.partition("{")[0]):  # that is said of every graph
            self.warned.append(text)

    def __enter__(self) -> Listening:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(LONGEST)

    def until(self, done: Callable[[Session], bool]) -> None:
        wait_for(lambda: done(self.session))

    def told(self, words: str) -> None:
        wait_for(lambda: any(words in one for one in self.warned))


@pytest.mark.slow
@needs_dds
def test_what_is_said_over_dds_is_judged_as_its_record_is(
    peer: Peer, make_system: Callable[..., System], tmp_path: Path
) -> None:
    system, record = make_system(RCL, MAPPING), tmp_path / "run.jsonl"
    peer.write("s")
    with Listening(peer, system, record) as listening:
        peer.heard("s")
        peer.say("s", 1.5, 119.0, 120.5, 7.0)
        listening.until(lambda s: s.events == 4)
    assert listening.warned == []
    assert [(v.clause, v.index) for v in listening.found] == [("low", 3)]
    assert [json.loads(line)["data"] for line in record.read_text("utf-8").splitlines()] == [1.5, 119.0, 120.5, 7.0]
    assert [(v.clause, v.index) for _, v in session(system).run(record)] == [("low", 3)]


@pytest.mark.slow
@needs_dds
@pytest.mark.parametrize("form", ["sqlite3", "mcap"])
def test_verdicts_are_those_of_a_bag(peer: Peer, make_system: Callable[..., System], tmp_path: Path, form: str) -> None:
    """Numbers as they are: binary ones, those that are none, those at the bound."""
    system = make_system(RCL.replace(" s matches", " v matches"), MAPPING)
    said = [0.1, 120.0, 120.00000000000001, float("nan"), float("inf"), -0.0, 5e-324, 1e308, 119.99999999999999]
    bag = write_bag(tmp_path / "bag", form, "std_msgs/msg/Float64", [{"data": one} for one in said])
    peer.write("v")
    with Listening(peer, system) as listening:
        peer.heard("v")
        peer.say("v", *said)
        listening.until(lambda s: s.events == len(said))
    recorded = session(system, (), bag)
    found = [(v.fault, v.clause, v.index, v.values, v.explanation) for _, v in recorded.run(bag)]
    assert [(v.fault, v.clause, v.index, v.values, v.explanation) for v in listening.found] == found
    assert [v[2] for v in found] == [3, 4, 5, 8]
    mine, its = listening.session.summary(), recorded.summary()
    for summary in (mine, its):
        summary["nodes"][0].pop("topics")
    assert mine["nodes"] == its["nodes"]


@pytest.mark.slow
@needs_dds
@pytest.mark.parametrize(
    "qos",
    [
        ("reliable", "volatile"),
        ("best_effort", "volatile"),
        ("reliable", "transient_local"),
        ("best_effort", "exclusive"),
        ("reliable", "partition"),
    ],
    ids="-".join,
)
def test_every_quality_of_service_is_met(peer: Peer, make_system: Callable[..., System], qos: tuple[str, ...]) -> None:
    peer.write("s", qos=qos)
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        if "transient_local" not in qos:  # what such a writer keeps, who comes later hears too
            peer.heard("s")
        peer.say("s", 1.0, 2.0, 300.0)
        listening.until(lambda s: s.events == 3)
    assert [v.index for v in listening.found] == [3]
    assert listening.warned == []


@pytest.mark.slow
@needs_dds
def test_two_writers_one_that_goes_and_one_that_comes_late(peer: Peer, make_system: Callable[..., System]) -> None:
    """Each is heard once, also where their qualities of service differ."""
    peer.write("s", name="a", qos=("reliable",))
    peer.write("s", name="b", qos=("best_effort",))
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        peer.heard("a", 2), peer.heard("b")  # the reader for b's quality of service hears a too
        peer.say("a", 1.0), peer.say("b", 2.0)
        listening.until(lambda s: s.events == 2)
        peer("gone", name="a")
        peer.write("s", name="c")
        peer.heard("c", 2)
        peer.say("c", 200.0), peer.say("b", 3.0)
        listening.until(lambda s: s.events == 4)
    assert [v.clause for v in listening.found] == ["low"]


@pytest.mark.slow
@needs_dds
def test_calls_are_heard_as_in_bags(peer: Peer, tmp_path: Path) -> None:
    """Each response is judged by its own request, though two clients number theirs alike; a client may be gone."""
    system, record = make(tmp_path), tmp_path / "run.jsonl"
    peer.calls("go", "GoRequest", "GoResponse")
    with Listening(peer, system, record) as listening:
        peer.heard("asked"), peer.heard("told")

        def say(name: str, count: int, *call: Any) -> None:
            peer.say(name, call)
            listening.until(lambda s: s.events == count)

        say("asked", 1, 7, 1, 1.0)
        say("asked", 2, 8, 1, 5.0)
        say("told", 3, 7, 1, True, "x")
        peer("gone", name="asked")
        listening.told("/go/_request: no writer is left")
        say("told", 5, 8, 1, False, "x")
        peer.calls("go", "GoRequest", "GoResponse")
        peer.heard("asked")
        say("asked", 6, 9, 1, 9.0)
        say("told", 7, 9, 1, True, "x")
    for judged in (listening.session, running_of(system, record)):
        (tally,) = (tally for _, name, _, tally in judged.clauses() if name == "limits")
        assert (tally.judged, tally.undecided, tally.broken, tally.unanswered) == (3, 0, 1, 0)
        assert "server.limits" not in judged.unmonitored()
    assert [(v.clause, v.index) for v in listening.found] == [("limits", 7)]


@pytest.mark.slow
@needs_dds
def test_actions_are_heard_as_in_bags(peer: Peer, tmp_path: Path) -> None:
    system, record = spinning(tmp_path), tmp_path / "run.jsonl"
    peer("write", name="sent", topic="rq/spin/_action/send_goalRequest", kind="SendGoal", qos=["reliable"])
    peer.calls("spin/_action/get_result", "GetResult", "GotResult")
    peer.write("spin/_action/feedback", "FeedbackMessage")
    said = [
        ("sent", (7, 1, ("uuid", 1), ("goal", 2.0))),
        ("sent", (7, 2, ("uuid", 2), ("goal", 5.0))),
        ("asked", (7, 1, ("uuid", 1))),
        ("asked", (7, 2, ("uuid", 2))),
        ("spin/_action/feedback", (("uuid", 1), ("feedback", 1.0))),
        ("told", (7, 2, 4, ("result", 5.0))),
        ("told", (7, 1, 4, ("result", 3.0))),
        ("spin/_action/feedback", (("uuid", 2), ("feedback", -1.0))),
    ]
    with Listening(peer, system, record) as listening:
        for name in ("sent", "asked", "told", "spin/_action/feedback"):
            peer.heard(name)
        for k, (name, value) in enumerate(said, start=1):
            peer.say(name, value)
            listening.until(lambda s, k=k: s.events == k)  # type: ignore[misc]
    assert [(v.clause, v.index) for v in listening.found] == [("all_done", 7), ("forward", 8)]
    again = session(system)
    assert [(v.clause, v.index) for _, v in again.run(record)] == [("all_done", 7), ("forward", 8)]
    assert again.unmonitored() == {}


@pytest.mark.slow
@needs_dds
def test_the_clients_view_of_calls_is_heard_as_events(peer: Peer, tmp_path: Path) -> None:
    """With introspection, whichever the vendor; the server's events are parts of other topics."""
    mapping = "{in.speed: {topic: /go/_request_sent, field: speed}, out.ok: {topic: /go/_response_received, field: ok}}"
    system = make(tmp_path, PLAN.replace("answers:", f"mapping: {mapping}, answers:"))
    record = tmp_path / "run.jsonl"
    peer.write("go/_service_event", "GoEvent")
    events = [(0, 1, [5.0], []), (1, 1, [5.0], []), (2, 1, [], [False]), (3, 1, [], [True])]
    with Listening(peer, system, record) as listening:
        peer.heard("go/_service_event")
        peer.say("go/_service_event", *events)
        listening.until(lambda s: s.events == 4)
        peer("gone", name="go/_service_event")
        listening.told("/go/_request_sent: no writer is left"), listening.told("/go/_response_received: no writer")
    assert [(v.clause, v.index) for v in listening.found] == [("limits", 4)]
    assert [(v.clause, v.index) for _, v in session(system, ("server",)).run(record)] == [("limits", 4)]


@pytest.mark.slow
@needs_dds
def test_calls_that_nothing_names_are_told_and_not_heard(
    peer: Peer, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Other vendors identify a call outside of the sample."""
    monkeypatch.setattr(dds, "_CYCLONE", b"\x01\x0f")
    peer.calls("go", "GoRequest", "GoResponse")
    with Listening(peer, make(tmp_path)) as listening:
        peer.heard("asked")
        peer.say("asked", (7, 1, 1.0))
        listening.told("nothing names its calls")
    assert "it is not written by Cyclone DDS" in listening.session.unmonitored()["server.limits"]
    assert all("/_re" in one for one in listening.warned)


def unheard(record: Path) -> list[tuple[str, str]]:
    """The marks of a record, each with its reason."""
    events = [json.loads(line) for line in record.read_text("utf-8").splitlines()]
    return [(mark, event[mark]) for event in events for mark in ("_lost", "_gone") if mark in event]


@pytest.mark.slow
@needs_dds
def test_lost_samples_are_in_the_record(
    peer: Peer, make_system: Callable[..., System], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Cyclone DDS itself counts hardly any."""
    from cyclonedds.sub import DataReader

    system, record = make_system(RCL, MAPPING), tmp_path / "run.jsonl"
    peer.write("s")
    with Listening(peer, system, record) as listening:
        peer.heard("s")
        peer.say("s", 1.0)
        listening.until(lambda s: s.events == 1)
        monkeypatch.setattr(DataReader, "get_sample_lost_status", lambda reader: SimpleNamespace(total_count=3))
        peer.say("s", 2.0)
        listening.until(lambda s: s.events == 3)
    assert unheard(record) == [("_lost", "s: 3 samples lost")]
    for judged in (listening.session, running_of(system, record)):
        assert judged.unmonitored() == {"n.low": "not all was heard: s: 3 samples lost"}


@pytest.mark.slow
@needs_dds
def test_the_last_writer_that_goes_is_in_the_record(
    peer: Peer, make_system: Callable[..., System], tmp_path: Path
) -> None:
    system, record = make_system(RCL, MAPPING), tmp_path / "run.jsonl"
    peer.write("s")
    with Listening(peer, system, record) as listening:
        peer.heard("s")
        peer.say("s", 1.0, 2.0)
        peer("gone", name="s")
        listening.told("s: no writer is left")
    assert unheard(record) == [("_gone", "s: no writer is left")]
    judged = running_of(system, record)
    assert (judged.unmonitored(), judged.monitors[0].values) == ({}, {})


@pytest.mark.slow
@needs_dds
def test_a_writer_out_of_reach_for_a_while_is_in_the_record(
    peer: Peer, make_system: Callable[..., System], tmp_path: Path
) -> None:
    system, record = make_system(RCL, MAPPING), tmp_path / "run.jsonl"
    peer.write("s")
    with Listening(peer, system, record) as listening:
        peer.heard("s")
        peer.say("s", 1.0)
        listening.until(lambda s: s.events == 1)
        peer.process.send_signal(signal.SIGSTOP)
        listening.told("s: no writer is left")
        peer.process.send_signal(signal.SIGCONT)
        listening.told("was out of reach")
        peer.heard("s")
        peer.say("s", 2.0)
        listening.until(lambda s: s.events == 4)
    assert [mark for mark, _ in unheard(record)] == ["_gone", "_lost"]
    assert "n.low" in running_of(system, record).unmonitored()


@pytest.mark.slow
@needs_dds
def test_a_writer_that_comes_and_goes_at_once_is_heard(
    peer: Peer, make_system: Callable[..., System], monkeypatch: pytest.MonkeyPatch
) -> None:
    peer.write("s")
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        peer.heard("s")
        peer.say("s", 1.0)
        listening.until(lambda s: s.events == 1)
        monkeypatch.setattr(dds, "DDS_SETTLE", 5.0)
        peer.say("s", 2.0)  # a round begins
        peer.write("s", name="short")
        peer.heard("short")
        peer.say("short", 200.0)
        peer("gone", name="short")
        listening.until(lambda s: s.events == 3)
    assert [(v.clause, v.index) for v in listening.found] == [("low", 3)]


@pytest.mark.slow
@needs_dds
def test_nothing_is_lost_of_a_burst(peer: Peer, make_system: Callable[..., System]) -> None:
    peer.write("s")
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        peer.heard("s")
        peer.say("s", *(float(k % 121) for k in range(30_000)))
        listening.until(lambda s: s.events == 30_000)
    assert (listening.found, listening.warned) == ([], [])


@pytest.mark.slow
@needs_dds
def test_a_writer_that_was_heard_can_be_heard_whatever_discovery_says(
    peer: Peer, make_system: Callable[..., System], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a busy machine a match is at times not told, or lost, while all that was written comes."""
    from cyclonedds.sub import DataReader

    monkeypatch.setattr(dds, "DDS_MATCH", 3.0)
    monkeypatch.setattr(DataReader, "get_matched_publication_data", lambda reader, writer: None)
    peer.write("s")
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        peer.heard("s")
        peer.say("s", 1.0)
        listening.until(lambda s: s.events == 1)
        time.sleep(3.5)
    assert (listening.found, listening.warned) == ([], [])


@pytest.mark.slow
@needs_dds
def test_a_silent_topic_is_told_while_nothing_comes(peer: Peer, make_system: Callable[..., System]) -> None:
    peer.write("s")
    with Listening(peer, make_system(RCL, MAPPING, fresh={"out.s": "300 ms"})) as listening:
        peer.heard("s")
        peer.say("s", 1.0)
        listening.until(lambda s: Fault.SILENT in s.counts)
    assert listening.found[-1].clause == "out.s"


@pytest.mark.slow
@needs_dds
def test_a_writer_whose_clock_jumps_is_no_false_alarm(peer: Peer, make_system: Callable[..., System]) -> None:
    """Deadlines and records go by the times at which messages came."""
    peer.write("s")
    with Listening(peer, make_system(RCL, MAPPING, fresh={"out.s": "60 s"})) as listening:
        peer.heard("s")
        now = time.time_ns()
        for k, jump in enumerate((0, 3600, -3600, 0)):
            peer.say("s", float(k), time=now + jump * 10**9)
            listening.until(lambda s, k=k: s.events == k + 1)  # type: ignore[misc]
    assert listening.found == []


@pytest.mark.slow
@needs_dds
@pytest.mark.parametrize(
    ("kind", "told"),
    [
        ("Wrong", "is made otherwise"),
        ("Short", "is made otherwise"),
        ("Single", "s: it is written as std_msgs/Float32"),
    ],
)
def test_another_layout_or_type_is_told_and_not_heard(
    peer: Peer, make_system: Callable[..., System], monkeypatch: pytest.MonkeyPatch, kind: str, told: str
) -> None:
    monkeypatch.setattr(dds, "DDS_MATCH", 0.5)
    peer.write("s", kind)
    with Listening(peer, make_system(RCL, MAPPING)) as listening:
        peer.say("s", 1)
        listening.told(told)
    assert listening.session.unmonitored()["n.low"].startswith("not all was heard")
    assert listening.session.summary()["nodes"][0]["relevant"] == 0


@pytest.mark.slow
@needs_dds
def test_a_message_of_messages_arrays_and_times(peer: Peer, make_system: Callable[..., System], tmp_path: Path) -> None:
    system = make_system(
        """
node n {
  inputs( near : REAL, ok : BOOL, y : REAL, at : REAL )
  outputs( s : REAL )
  topics( pkg/Scan scan matches(in.near), pkg/Scan scan matches(in.ok), pkg/Scan scan matches(in.y),
          pkg/Scan scan matches(in.at), std_msgs/Float64 s matches(out.s) )
  assume far ( in.near >= 0.1 )
  assume fine ( in.ok and in.y == 2.5 and in.at == 7.25 )
  guarantee low ( out.s <= 120 )
}
""",
        {
            "in.near": {"field": "ranges", "take": "min", "inf": "none", "nan": "none", "elsewhere": 30},
            "in.ok": "ok",
            "in.y": "pair[1]",
            "in.at": "header.stamp",
            "out.s": "data",
        },
        messages={
            "pkg/Scan": "std_msgs/Header header\nbool ok\nfloat32[] ranges\nfloat64[2] pair\nstring[] words\nuint8 level",  # noqa: E501
            "std_msgs/Header": "time stamp\nstring frame_id\n",
        },
    )
    peer.write("scan", "Scan")
    good = {"stamp": [7, 250_000_000], "ok": True, "ranges": [0.5, float("inf"), float("nan")], "pair": [1.5, 2.5]}
    with Listening(peer, system) as listening:
        peer.heard("scan")
        peer.say("scan", good, {**good, "ranges": [0.05]}, {**good, "ranges": []}, {**good, "pair": [2.5, 1.5]})
        listening.until(lambda s: s.events == 4)
    assert [(v.clause, v.index) for v in listening.found] == [("far", 2), ("fine", 4)]


@pytest.mark.slow
@needs_dds
def test_verdicts_are_heard_by_others(peer: Peer, make_system: Callable[..., System]) -> None:
    peer.write("s")
    peer("verdicts")
    with Listening(peer, make_system(RCL, MAPPING), verdicts="/verdicts") as listening:
        peer.heard("s")
        peer.say("s", 1.0, 130.0)
        listening.until(lambda s: s.events == 2)
        said: list[Any] = []
        wait_for(lambda: said.extend(peer("told")) or ["n.low", 2, {"published": "2", "broken": "1"}] in said)


@needs_dds
def test_what_cannot_be_heard_is_refused_before_anything_runs(make_system: Callable[..., System]) -> None:
    running = session(make_system(RCL.replace("std_msgs/Float64 s", "other/Thing s"), MAPPING))
    with pytest.raises(Rejected, match="nothing defines other/Thing"):
        graph_of("dds", running, "127.0.0.1")
    for text in ("dds:-1", "dds:233", "dds:x", "dds:0x1"):
        with pytest.raises(Rejected, match="no DDS domain"):
            graph_of(text, running, "127.0.0.1")


def test_without_the_package_it_is_told(make_system: Callable[..., System], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cyclonedds.idl", None)
    with pytest.raises(Rejected, match="cyclonedds"):
        graph_of("dds", session(make_system(RCL, MAPPING)), "127.0.0.1")


@pytest.mark.slow
@needs_dds
@pytest.mark.parametrize("size", [24, 16])
def test_a_running_graph_is_drafted(peer: Peer, size: int, tmp_path: Path) -> None:
    """A node that announces itself as ROS 2's do, and a participant without a name that requests more."""
    peer.write("robot1/s", qos=("best_effort",))
    peer.write("other", "Single")
    peer("listen", topic="rt/robot1/s", kind="Double", qos=["reliable"])
    peer("node", size=size, space="/robot1", name="sensor", writers=["robot1/s"])
    found: list[Listing] = []
    wait_for(lambda: found.append(ask_domain(peer.domain, seconds=0.5)) or len(found[-1].nodes) == 2)
    assert replace(found[-1], qos="") == Listing(
        (Listed("/participant_1", ("/other",), ("/robot1/s",)), Listed("/robot1/sensor", ("/robot1/s",))),
        {"/other": "std_msgs/Float32", "/robot1/s": "std_msgs/Float64"},
    )
    folder = tmp_path / "robot"
    done = CliRunner().invoke(init, [str(folder), "--from-graph", f"dds:{peer.domain}", "--distro", "humble"])
    assert done.exit_code == 0, done.output
    drafted = load_system(folder / "contracts/robot")
    assert [node.name for node in drafted.contract.nodes] == ["participant_1", "sensor"]
    assert "ros_version: ros2" in (folder / "contracts/robot/plan.yaml").read_text("utf-8")
    (wrong,) = (each for each in checked(drafted) if each.code == "ROS131")
    assert "/robot1/s: sensor offers best_effort" in wrong.message
    assert "participant_1 requests reliable" in wrong.message
