"""A breach is followed to the first clause that broke; silence is a violation when its time has passed."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND
from avow.backends.rosmonitoring.options import setup
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.base.verdict import Verdict
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import ARRIVAL, job_for

CHAIN = """
node sensor {
  inputs( r : REAL )
  outputs( s : REAL )
  topics( float64 r matches(in.r), float64 s matches(out.s) )
  assume real ( in.r >= -10 )
  guarantee nonneg ( out.s >= 0 )
}
node guard {
  inputs( s : REAL )
  outputs( t : REAL )
  topics( float64 s matches(in.s), float64 t matches(out.t) )
  assume nonneg ( in.s >= 0 )
  guarantee twice ( out.t == in.s + in.s )
}
node motor {
  inputs( t : REAL )
  outputs( u : REAL )
  topics( float64 t matches(in.t), float64 u matches(out.u) )
  assume nonneg ( in.t >= 0 )
  guarantee same ( out.u == in.t )
}
"""
Event = dict[str, Any]


def chain(folder: Path, connections: str = "[]") -> System:
    (folder / "system.rcl").write_text(CHAIN, encoding="utf-8")
    methods = {"methods": [{"rosmonitoring": {"answers": ARRIVAL, "mapping": {}}}]}
    nodes = dict.fromkeys(("sensor", "guard", "motor"), methods)
    plan = {"connections": json.loads(connections), "nodes": nodes}
    (folder / "plan.yaml").write_text(json.dumps(plan), encoding="utf-8")
    return load_system(folder)


def judge(system: System, *events: tuple[str, float]) -> list[Violation]:
    running = session(system)
    return [v for topic, value in events for v in running.step({"topic": topic, "data": value, "time": 0})]


def test_a_breach_is_followed_to_its_origin(tmp_path: Path) -> None:
    system = chain(tmp_path)
    found = judge(system, ("r", 1), ("s", 1), ("t", 2), ("u", 2), ("r", 2), ("s", -1), ("t", -2), ("u", -2))
    assert [(v.node, v.clause, v.fault) for v in found] == [
        ("sensor", "nonneg", Fault.GUARANTEE),
        ("guard", "nonneg", Fault.PROVIDER),
        ("motor", "nonneg", Fault.PROVIDER),
    ]
    assert found[1].cause == "sensor.nonneg at event 6 caused guard.nonneg at event 6"
    # the guard had promised nothing of what it was given, and passed it on
    assert found[2].cause == "sensor.nonneg at event 6 caused motor.nonneg at event 7"


def test_what_was_mended_is_no_cause_any_more(tmp_path: Path) -> None:
    found = judge(chain(tmp_path), ("s", -1), ("s", 1), ("t", -5))
    assert [(v.clause, v.index) for v in found if v.fault is Fault.PROVIDER] == [("nonneg", 1), ("nonneg", 3)]
    assert "guard.twice at event 3 caused motor.nonneg at event 3" in found[-1].cause


def test_the_environment_is_blamed_only_where_it_provides(tmp_path: Path) -> None:
    found = judge(chain(tmp_path), ("r", -20), ("s", -1))
    assert [v.fault for v in found] == [Fault.ASSUMPTION, Fault.EXCUSED, Fault.PROVIDER]
    assert found[1].cause == "sensor.real at event 1 (environment) caused it"
    assert "sensor.real at event 1 (environment) caused guard.nonneg at event 2" in found[2].cause


SENSOR = """
node n {
  inputs( r : REAL )
  outputs( o : BOOL )
  topics( float64 r matches(in.r), bool o matches(out.o) )
  guarantee g ( out.o <=> in.r > 0 )
}
"""


def test_a_silent_sensor_is_told_when_its_time_has_passed(make_system: Callable[..., System], tmp_path: Path) -> None:
    events = [{"topic": "r", "data": 1, "time": 0}]
    events += [{"topic": "o", "data": True, "time": k / 10} for k in range(1, 20)]
    for limit, at in (("500 ms", 7), ("1 s", 12), ("3 s", None)):
        system = make_system(SENSOR, traces=["t.jsonl"], fresh={"in.r": limit})
        running = session(system)
        found = [v for e in events for v in running.step(e)]
        assert [(v.fault, v.index) for v in found] == ([(Fault.SILENT, at)] if at else [])
        text = "".join(json.dumps(e) + "\n" for e in events)
        (system.plan.root / "t.jsonl").write_text(text, encoding="utf-8")
        report = BACKEND.discharge(job_for(system, "n"), tmp_path, Limits())
        assert report.outcomes[0].verdict is (Verdict.UNKNOWN if at else Verdict.MONITORED)


def test_time_passes_with_other_topics_too(make_system: Callable[..., System]) -> None:
    running = session(make_system(SENSOR, fresh={"in.r": "1 s", "out.o": "1 s"}))
    found = [v for k in range(4) for v in running.step({"topic": "other", "time": k})]
    assert [(v.clause, v.index) for v in found] == [("in.r", 3), ("out.o", 3)]


@pytest.mark.parametrize("name", ["in.x", "r"])
def test_a_deadline_of_nothing_is_a_fault(make_system: Callable[..., System], name: str) -> None:
    system = make_system(SENSOR, fresh={name: "1 s"})
    node = system.contract.node("n")
    (fault,) = setup(system, node, system.plan.node("n").methods[0].options)[1]
    assert "no message that is observed" in fault.message
    assert fault.span is not None


DELAYED = '[{"from": "guard.t", "to": "motor.t", "delayed": true, "initial": 0}]'


@pytest.mark.parametrize(
    ("connections", "told"),
    [
        ("[]", "at the others the assumption nonneg was broken by a message of guard.t, first at event 3 of t.jsonl"),
        (DELAYED, "by a message of guard.t one step before"),
    ],
)
def test_recorded_evidence_says_what_was_broken_before_it_and_by_whom(
    connections: str, told: str, tmp_path: Path
) -> None:
    chain(tmp_path, connections)
    (tmp_path / "plan.yaml").write_text(
        (tmp_path / "plan.yaml").read_text().replace('"mapping": {}', '"mapping": {}, "traces": ["t.jsonl"]'),
        encoding="utf-8",
    )
    events = [("t", 1), ("u", 1), ("t", -1), ("u", 3)]
    lines = [json.dumps({"topic": topic, "data": value, "time": k}) for k, (topic, value) in enumerate(events)]
    (tmp_path / "t.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    job = job_for(load_system(tmp_path), "motor")
    (outcome,) = BACKEND.discharge(job, tmp_path, Limits()).outcomes
    assert told in outcome.summary


TWO = """
node joy { inputs( ) outputs( v : REAL ) topics( float64 cmd matches(out.v) ) guarantee slow ( out.v <= 1 ) }
node auto { inputs( ) outputs( w : REAL ) topics( float64 cmd matches(out.w) ) guarantee slow ( out.w <= 0 ) }
node wheels { inputs( u : REAL ) outputs( t : REAL ) topics( float64 cmd matches(in.u), float64 t matches(out.t) )
  assume slow ( in.u <= 1 )
  guarantee follows ( out.t <= 1 ) }
"""


def test_nobody_is_blamed_for_what_several_publish(tmp_path: Path) -> None:
    """Where a message does not say whose it is, neither of the two is called broken, nor is anything judged of them."""
    (tmp_path / "system.rcl").write_text(TWO, encoding="utf-8")
    methods = {"methods": [{"rosmonitoring": {"traces": ["t.jsonl"]}}]}
    (tmp_path / "plan.yaml").write_text(json.dumps({"nodes": {"auto": methods}}), encoding="utf-8")
    (tmp_path / "t.jsonl").write_text('{"topic": "cmd", "data": 0.5, "time": 0}\n', encoding="utf-8")
    system = load_system(tmp_path)
    running = session(system)
    events = [{"topic": "cmd", "data": value, "time": k} for k, value in enumerate((0.5, 7))]
    found = [(v.node, v.clause, v.fault) for event in events for v in running.step(event)]
    assert found == [("wheels", "slow", Fault.PROVIDER)]
    (outcome,) = BACKEND.discharge(job_for(system, "auto"), tmp_path, Limits()).outcomes
    assert outcome.verdict is Verdict.UNKNOWN
    assert "a message of cmd is by no node that publishes it in the contract" in outcome.summary


def test_a_slice_knows_that_others_publish_too(tmp_path: Path) -> None:
    from avow.pipeline.slices import method_slice

    (tmp_path / "system.rcl").write_text(TWO, encoding="utf-8")
    methods = {"methods": [{"rosmonitoring": {}}]}
    (tmp_path / "plan.yaml").write_text(json.dumps({"nodes": {"auto": methods}}), encoding="utf-8")
    cut = method_slice(BACKEND, job_for(load_system(tmp_path), "auto")).system
    assert [node.name for node in cut.contract.nodes] == ["auto"]  # it has no recording that may contradict others
    assert cut.plan.ros.shared == (("/cmd", ("/auto", "/joy")),)


def shared(folder: Path, callers: list[tuple[str, float]]) -> Path:
    """A ROS 1 bag in which several publish one topic."""
    rosbags = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    (folder / "system.rcl").write_text(TWO.replace("float64 cmd", "std_msgs/Float64 cmd"), encoding="utf-8")
    methods = {"methods": [{"rosmonitoring": {"traces": ["run.bag"]}}]}
    (folder / "plan.yaml").write_text(json.dumps({"nodes": dict.fromkeys(("joy", "auto"), methods)}), encoding="utf-8")
    store = get_typestore(Stores.ROS1_NOETIC)
    with rosbags.Writer(folder / "run.bag") as writer:
        open_ = {
            who: writer.add_connection("/cmd", "std_msgs/msg/Float64", typestore=store, callerid=who)
            for who in sorted({who for who, _ in callers})
        }
        for k, (who, value) in enumerate(callers, start=1):
            message = store.types["std_msgs/msg/Float64"](data=value)
            writer.write(open_[who], k * 10**9, store.serialize_ros1(message, "std_msgs/msg/Float64"))
    return folder / "run.bag"


def test_a_bag_says_whose_a_message_was(tmp_path: Path) -> None:
    """What is wrong for one of two publishers is right for the other; the listener is told whose it was."""
    bag = shared(
        tmp_path, [("/joy", 1.0), ("/auto", 0.0), ("/joy", 0.5), ("/auto", 0.5), ("/joy", 7.0), ("/auto", -1.0)]
    )
    system = load_system(tmp_path)
    found = [violation for _, violation in session(system, (), bag).run(bag)]
    assert [(v.node, v.clause, v.index, v.fault) for v in found] == [
        ("auto", "slow", 4, Fault.GUARANTEE),
        ("joy", "slow", 5, Fault.GUARANTEE),
        ("wheels", "slow", 5, Fault.PROVIDER),
    ]
    assert found[2].cause == "joy.slow at event 5 caused wheels.slow at event 5"
    verdicts = [BACKEND.discharge(job_for(system, n), tmp_path, Limits()).outcomes[0] for n in ("joy", "auto")]
    assert [v.verdict for v in verdicts] == [Verdict.REFUTED, Verdict.REFUTED]
    assert [v.bound["published"] for v in verdicts] == [3, 3]


def test_a_stranger_on_a_topic_of_several_is_refused(tmp_path: Path) -> None:
    from avow.base.diagnostics import Rejected

    bag = shared(tmp_path, [("/joy", 1.0), ("/auto", 0.0), ("/stranger", 0.0)])
    with pytest.raises(Rejected, match="/stranger publish /cmd, and in the contract /auto, /joy do"):
        session(load_system(tmp_path), (), bag)


def test_a_trace_may_say_whose_a_message_was(tmp_path: Path) -> None:
    shared(tmp_path, [("/joy", 1.0)])
    running = session(load_system(tmp_path))
    said = [("/auto", 0.5), ("/joy", 0.5), ("auto", 0.5), ("", 9)]
    events = [{"topic": "cmd", "data": v, "time": k, "_publisher": who} for k, (who, v) in enumerate(said)]
    found = [(v.node, v.clause, v.index) for event in events for v in running.step(event)]
    assert found == [("auto", "slow", 1), ("wheels", "slow", 4)]
    tallies = {m.setup.node.name: m.tallies["slow"] for m in running.monitors if m.setup.node.name != "wheels"}
    assert {name: (t.published, t.judged, t.nameless) for name, t in tallies.items()} == {
        "joy": (3, 1, 2),
        "auto": (3, 1, 2),
    }
    assert [*running.unmonitored()] == ["joy.slow", "auto.slow"]


@pytest.mark.parametrize(
    ("said", "broken", "judged"),
    [
        ([("/stranger", 9.0), ("/stranger", 0.0)], 0, 0),
        ([("/sensor", 1.0), ("/stranger", -1.0), ("/sensor", 2.0)], 0, 2),
        ([("/sensor", 1.0), ("", -1.0)], 1, 2),  # nobody else publishes it in the contract
        ([("/sensor", -1.0)], 1, 1),
    ],
)
def test_a_message_of_another_node_is_no_answer_of_the_only_publisher(
    said: list[tuple[str, float]], broken: int, judged: int, tmp_path: Path
) -> None:
    system = chain(tmp_path)
    lines = [{"topic": "s", "data": value, "time": k, "_publisher": who} for k, (who, value) in enumerate(said)]
    trace = tmp_path / "t.jsonl"
    trace.write_text("".join(f"{json.dumps(line)}\n" for line in lines), encoding="utf-8")
    running = session(system)
    found = [v for _, v in running.run(trace) if v.node == "sensor"]
    tally = next(m.tallies["nonneg"] for m in running.monitors if m.setup.node.name == "sensor")
    assert (len(found), tally.judged) == (broken, judged)


def test_a_bag_with_a_publisher_that_is_not_modelled_is_refused(tmp_path: Path) -> None:
    rosbags = pytest.importorskip("rosbags.rosbag1")
    from rosbags.typesys import Stores, get_typestore

    from avow.base.diagnostics import Rejected

    store = get_typestore(Stores.ROS1_NOETIC)
    message = store.types["std_msgs/msg/Float64"](data=9.0)
    with rosbags.Writer(tmp_path / "run.bag") as writer:
        for k, caller in enumerate(("/sensor", "/stranger"), start=1):
            connection = writer.add_connection("/s", "std_msgs/msg/Float64", typestore=store, callerid=caller)
            writer.write(connection, k * 10**9, store.serialize_ros1(message, "std_msgs/msg/Float64"))
    with pytest.raises(Rejected, match="/sensor and /stranger published /s, and in the contract /sensor alone does"):
        session(chain(tmp_path), (), tmp_path / "run.bag")
