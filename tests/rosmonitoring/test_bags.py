"""Bags: their own definitions count, and are held against what the contract and the plan say."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.notes import readable, unheard
from avow.backends.rosmonitoring.options import known_types, origin, setup
from avow.backends.rosmonitoring.pairing import time_of
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.traces import read_trace
from avow.base.diagnostics import Rejected
from avow.system.plan import System

pytest.importorskip("rosbags")

RCL = """
node n {{
  inputs( v : REAL )
  outputs( o : BOOL )
  topics( {kind} v matches(in.v), bool o matches(out.o) )
  guarantee g ( out.o or in.v > 0 )
}}
"""
CUSTOM = "std_msgs/Header header\nfloat32 level\nstring note\n"


def write_bag(
    path: Path,
    form: str,
    kind: str,
    values: list[dict[str, Any]],
    definition: str = "",
    start: int = 0,
    topic: str = "/v",
) -> Path:
    """A bag of one topic /v, a message a second after `start` nanoseconds; `form`: ros1, sqlite3 or mcap."""
    path = path.with_suffix(".bag") if form == "ros1" else path
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if form == "ros1" else Stores.ROS2_HUMBLE)
    if definition:
        store.register(get_types_from_msg(definition, kind))
    header = store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"](sec=99, nanosec=0)
    make = store.types[kind]

    def message(fields: dict[str, Any]) -> Any:
        whole = dict(fields)
        if "header" in make.__dataclass_fields__:
            first = {"seq": 7} if form == "ros1" else {}
            whole["header"] = header(**first, stamp=stamp, frame_id="f")
        return make(**whole)

    if form == "ros1":
        with Writer1(path) as writer:
            connection = writer.add_connection(topic, kind, typestore=store)
            for k, fields in enumerate(values, start=1):
                writer.write(connection, start + k * 10**9, store.serialize_ros1(message(fields), kind))
    else:
        plugin = StoragePlugin.MCAP if form == "mcap" else StoragePlugin.SQLITE3
        with Writer2(path, version=9, storage_plugin=plugin) as writer2:
            connection2 = writer2.add_connection(topic, kind, typestore=store)
            for k, fields in enumerate(values, start=1):
                writer2.write(connection2, start + k * 10**9, store.serialize_cdr(message(fields), kind))
    return path


def write_events(
    path: Path, kinds: dict[str, str], events: Sequence[dict[str, Any]], definitions: dict[str, str] | None = None
) -> Path:
    """A ROS 2 bag of events, as traces of JSON have them. `kinds`: the type of each topic; `definitions`: of types that
    no distribution has, those of services and actions as messages."""
    import numpy as np
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    for kind, text in (definitions or {}).items():
        store.register(get_types_from_msg(text, kind))

    def made(kind: str, data: dict[str, Any]) -> Any:
        wires = dict(store.get_msgdef(kind).fields)
        return store.types[kind](**{name: part(wires[name], value) for name, value in data.items()})

    def part(wire: Any, value: Any) -> Any:
        if isinstance(value, list):
            inner = wire[1][0]
            if isinstance(inner[1], str):
                return [made(inner[1], one) for one in value]
            word = inner[1][0]
            return (
                list(value)
                if word == "string"
                else np.array(value, {"octet": "uint8", "char": "uint8"}.get(word, word))
            )
        return made(wire[1], value) if isinstance(value, dict) else value

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        known: dict[str, Any] = {}
        for topic, kind in kinds.items():
            folder = "action" if "Spin" in kind else "srv"
            text, _ = store.generate_msgdef(kind, ros_version=2)
            own = {"msgdef": text, "rihs01": "RIHS01_" + "0" * 64} if kind.endswith("_Event") else {"typestore": store}
            named = kind.replace("/msg/", f"/{folder}/") if "msgdef" in own else kind
            known[topic] = writer.add_connection(f"/{topic.lstrip('/')}", named, **own)
        for event in events:
            fields = {name: value for name, value in event.items() if name not in ("topic", "time")}
            kind = kinds[event["topic"]]
            at = round(event["time"] * 10**9)
            writer.write(known[event["topic"]], at, bytes(store.serialize_cdr(made(kind, fields), kind)))
    return path


def judge(system: System, bag: Path) -> list[Any]:
    known, wrong = known_types(system, [bag])
    found, faults = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options, known)
    assert (wrong, faults) == ((), ())
    if told := readable(found, bag, origin(system)):
        raise Rejected(*told)
    monitor = Monitor(found)
    values = []
    for recorded in read_trace(bag, origin(system), monitor.listens):
        monitor.step(recorded.event)
        values.append(monitor.values.get("in.v"))
    return values


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
def test_a_custom_type_is_read_by_the_bags_own_definition(
    form: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    bag = write_bag(
        tmp_path / ("run.bag" if form == "ros1" else "run"),
        form,
        "my/msg/Level",
        [{"level": 0.5, "note": "a"}, {"level": 0.1, "note": "1"}],
        CUSTOM,
    )
    system = make_system(RCL.format(kind="my/Level"))
    assert judge(system, bag) == [Fraction(1, 2), Fraction(13421773, 134217728)]


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
@pytest.mark.parametrize("start", [0, 1, 1_732_448_384_123_456_789, 4_000_000_000_999_999_999])
def test_times_are_those_of_the_bag_to_the_nanosecond(form: str, start: int, tmp_path: Path) -> None:
    start = min(start, 2**32 * 10**9 - 10**10) if form == "ros1" else start
    bag = write_bag(tmp_path / "run", form, "std_msgs/msg/Bool", [{"data": True}] * 3, start=start)
    times = [time_of(recorded.event) * 10**9 for recorded in read_trace(bag)]
    assert times == [start + k * 10**9 for k in (1, 2, 3)]


@pytest.mark.parametrize("form", ["ros1", "sqlite3", "mcap"])
def test_another_type_or_definition_is_no_trace_of_this_system(
    form: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "run", form, "my/msg/Level", [{"level": 0.5, "note": "a"}], CUSTOM)
    other = make_system(RCL.format(kind="std_msgs/Float64"))
    with pytest.raises(Rejected, match="my/Level there, and std_msgs/Float64 in the contract"):
        judge(other, bag)
    changed = {"my/Level": CUSTOM.replace("float32", "float64"), "std_msgs/Header": "time stamp\nstring frame_id"}
    if form == "ros1":
        changed["std_msgs/Header"] = "uint32 seq\ntime stamp\nstring frame_id"
    with pytest.raises(Rejected, match="float32 level"):
        judge(make_system(RCL.format(kind="my/Level"), messages=changed), bag)


def test_what_is_wrong_with_a_topic_of_several_nodes_is_told_once(
    make_system: Callable[..., System], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "run", "sqlite3", "my/msg/Level", [{"level": 0.5, "note": "a"}], CUSTOM)
    one = RCL.format(kind="std_msgs/Float64")
    system = make_system(one + one.replace("node n ", "node m "))
    with pytest.raises(Rejected) as wrong:
        session(system, trace=bag)
    assert [d.code for d in wrong.value.diagnostics] == ["MON205"]


@pytest.mark.parametrize("distro", ["humble", "jazzy"])
def test_types_that_changed_between_distributions(
    distro: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    """Range has a field more since Jazzy: a bag of Humble is one of Humble."""
    fields = {"radiation_type": 0, "field_of_view": 0.5, "min_range": 0.0, "max_range": 4.0, "range": 1.5}
    bag = write_bag(tmp_path / "run", "sqlite3", "sensor_msgs/msg/Range", [fields])
    system = make_system(RCL.format(kind="sensor_msgs/Range"), {"in.v": "range"}, plan={"ros": {"distro": distro}})
    if distro == "humble":
        assert judge(system, bag) == [Fraction(3, 2)]
    else:
        with pytest.raises(Rejected, match="sensor_msgs/Range is"):
            judge(system, bag)


@pytest.mark.parametrize("distro", [None, "humble"])
def test_a_bag_without_definitions_wants_the_distribution(
    distro: str | None, make_system: Callable[..., System], tmp_path: Path
) -> None:
    import sqlite3

    bag = write_bag(tmp_path / "run", "sqlite3", "std_msgs/msg/Float64", [{"data": 2.5}])
    (database,) = bag.glob("*.db3")
    with sqlite3.connect(database) as connection:
        connection.execute("DELETE FROM message_definitions")
    metadata = bag / "metadata.yaml"
    text = metadata.read_text(encoding="utf-8")
    metadata.write_text(text, encoding="utf-8")
    system = make_system(RCL.format(kind="std_msgs/Float64"), plan={"ros": {"distro": distro}} if distro else {})
    if distro is None:
        with pytest.raises(Rejected) as caught:
            judge(system, bag)
        assert "ros: {distro: humble}" in str(caught.value.diagnostics[0].hint)
    else:
        assert judge(system, bag) == [Fraction(5, 2)]


@pytest.mark.parametrize(
    ("topic", "told"), [("/brush/setpiont", ["MON208"]), ("/brush/setpoint", []), ("/elsewhere", [])]
)
def test_a_topic_of_nearly_the_recorded_name_is_named(
    topic: str, told: list[str], make_system: Callable[..., System], tmp_path: Path
) -> None:
    bag = write_bag(tmp_path / "run", "mcap", "std_msgs/msg/Float64", [{"data": 1.0}], topic="/brush/setpoint")
    system = make_system(re.sub(r"/?\bv matches", f"{topic} matches", RCL.format(kind="std_msgs/Float64")))
    found, _ = setup(system, system.contract.node("n"), system.plan.node("n").methods[0].options)
    warned = list(unheard(found, bag, system))
    assert [d.code for d in warned] == told
    assert all(d.span is not None and d.hint == "did you mean `/brush/setpoint`?" for d in warned)
