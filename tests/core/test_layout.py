"""Layouts: the arrays of raw messages hold what reading each message gives."""

from __future__ import annotations

import random
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pytest

from avow.ros.bags import plainer
from avow.ros.definitions import Definitions
from avow.ros.layout import Layout
from avow.ros.sources import from_store

pytest.importorskip("rosbags")

KINDS = [
    "std_msgs/msg/Header", "sensor_msgs/msg/LaserScan", "sensor_msgs/msg/JointState", "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped", "sensor_msgs/msg/Imu", "std_msgs/msg/Empty", "std_msgs/msg/Float64",
    "diagnostic_msgs/msg/DiagnosticArray", "sensor_msgs/msg/BatteryState", "sensor_msgs/msg/Joy",
    "nav_msgs/msg/Path",
]  # fmt: skip


def made(store: Any, kind: str, rng: random.Random, long: int) -> Any:
    """A message with random contents, and strings and arrays of some length."""

    def value(wire: Any) -> Any:
        tag, content = wire
        if tag.name == "NAME":
            return made(store, content, rng, long)
        if tag.name == "BASE":
            return scalar(content[0])
        item, count = content
        count = count if tag.name == "ARRAY" else long
        if item[0].name == "BASE" and item[1][0] != "string":
            form = {"bool": "bool", "octet": "uint8", "byte": "uint8", "char": "uint8"}.get(item[1][0], item[1][0])
            return np.array([scalar(item[1][0]) for _ in range(count)], form)
        return [value(item) for _ in range(count)]

    def scalar(name: str) -> Any:
        if name == "string":
            return "x" * long
        if name.startswith("float"):
            return float(np.float32(rng.uniform(-9, 9)))
        return rng.random() < 0.5 if name == "bool" else rng.randrange(100)

    fields = store.fielddefs[kind][1]
    return store.types[kind](*(value(wire) for _, wire in fields))


def leaves(raw: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[tuple[str | int, ...], Any]]:
    if isinstance(raw, Mapping):
        for name, inner in raw.items():
            yield from leaves(inner, (*path, name))
    elif isinstance(raw, list):
        for k, inner in enumerate(raw):
            yield from leaves(inner, (*path, k))
            if not isinstance(inner, Mapping):
                yield from leaves(inner, (*path, k - len(raw)))
    elif not isinstance(raw, str):
        yield path, raw


@pytest.mark.parametrize("form", ["ros1", "ros2"])
@pytest.mark.parametrize("kind", KINDS)
def test_arrays_hold_what_reading_gives(kind: str, form: str) -> None:
    from rosbags.typesys import Stores, get_typestore

    ros2 = form == "ros2"
    store: Any = get_typestore(Stores.ROS2_HUMBLE if ros2 else Stores.ROS1_NOETIC)
    serialize, deserialize = (
        (store.serialize_cdr, store.deserialize_cdr) if ros2 else (store.serialize_ros1, store.deserialize_ros1)
    )
    known, plain, rng = Definitions(from_store(store.fielddefs, "")), plainer(store.fielddefs), random.Random(kind)
    for long in range(4):
        raws = [bytes(serialize(made(store, kind, rng, long), kind)) for _ in range(3)]
        layout = Layout.of(kind, known, raws[0], ros2)
        assert layout is not None
        columns = layout.columns(raws)
        assert columns is not None
        for k, raw in enumerate(raws):
            for path, number in leaves(plain(deserialize(raw, kind))):
                if path != ("structure_needs_at_least_one_member",):
                    array = columns(path)
                    assert array is not None, path
                    assert array[k].item() == number
        other = bytes(serialize(made(store, kind, rng, long + 1), kind))
        assert len(other) == len(raws[0]) or layout.columns([raws[0], other]) is None
        assert not raws[1] or layout.columns([raws[0], raws[1][:-1]]) is None
