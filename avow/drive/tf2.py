"""tf2_ros of rclpy: a buffer of transforms, fed from /tf and /tf_static, which answers as tf2's BufferCore does
(https://docs.ros.org/en/humble/p/tf2): linear interpolation, slerp, no extrapolation, ten seconds of storage."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

from .nodes import ReentrantCallbackGroup, Time
from .refusals import Strict

SECOND = 10**9
UNIT = 10e-3
"""How far the squared length of a quaternion may be from 1."""
POLL = SECOND // 50
Numbers = tuple[float, ...]


class TransformException(Exception):  # noqa: N818 - tf2's names, as those below
    """The base of tf2's exceptions."""


ERRORS: dict[str, Any] = {
    name: type(name, (TransformException,), {})
    for name in (
        f"{kind}Exception" for kind in ("Lookup", "Connectivity", "Extrapolation", "InvalidArgument", "Timeout")
    )
}


class Stored(NamedTuple):
    stamp: int
    parent: str
    move: Numbers
    turn: Numbers


def _times(a: Numbers, b: Numbers) -> Numbers:
    """The product of two quaternions (x, y, z, w)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _inverse(q: Numbers) -> Numbers:
    return (-q[0], -q[1], -q[2], q[3])


def _rotated(q: Numbers, v: Numbers) -> Numbers:
    return _times(_times(q, (*v, 0.0)), _inverse(q))[:3]


def _sum(a: Numbers, b: Numbers) -> Numbers:
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _between(one: Stored, two: Stored, at: int) -> Stored:
    part = (at - one.stamp) / (two.stamp - one.stamp)
    move = tuple(x * (1 - part) + y * part for x, y in zip(one.move, two.move, strict=True))
    dot = sum(x * y for x, y in zip(one.turn, two.turn, strict=True))
    long = math.sqrt(sum(x * x for x in one.turn) * sum(x * x for x in two.turn))
    theta = math.acos(min(1.0, abs(dot) / long))
    if theta == 0:
        return Stored(at, one.parent, move, one.turn)
    first, second = math.sin((1 - part) * theta), math.sin(part * theta) * (-1 if dot < 0 else 1)
    turn = ((x * first + y * second) / math.sin(theta) for x, y in zip(one.turn, two.turn, strict=True))
    return Stored(at, one.parent, move, tuple(turn))


class Buffer(Strict):
    _called = "tf2_ros.Buffer"

    def __init__(self, cache_time: Any = None, node: Any = None) -> None:
        self.kept = cache_time.nanoseconds if cache_time is not None else 10 * SECOND
        self.frames: dict[str, list[Stored]] = {}
        """Frame → its transforms to its parents, the latest first."""
        self.static: set[str] = set()

    def set_transform(self, transform: Any, authority: str, *, static: bool = False) -> None:
        child, parent = transform.child_frame_id.removeprefix("/"), transform.header.frame_id.removeprefix("/")
        shift, q = transform.transform.translation, transform.transform.rotation
        move, turn = (shift.x, shift.y, shift.z), (q.x, q.y, q.z, q.w)
        whole = child and parent and child != parent and not any(map(math.isnan, (*move, *turn)))
        if not whole or abs(sum(x * x for x in turn) - 1) >= UNIT:
            return  # tf2 logs it, and ignores it
        stamp, stored = self._driven.nanoseconds("time", transform.header.stamp), self.frames.get(child, [])
        if static and not stored:
            self.static.add(child)
        stored = [] if child in self.static else stored
        if stored and stored[0].stamp > stamp + self.kept:
            return
        at = next((k for k, each in enumerate(stored) if each.stamp <= stamp), len(stored))
        stored.insert(at, Stored(stamp, parent, move, turn))
        self.frames[child] = [each for each in stored if each.stamp + self.kept >= stored[0].stamp]

    def set_transform_static(self, transform: Any, authority: str) -> None:
        self.set_transform(transform, authority, static=True)

    def _known(self, frame: str) -> None:
        if not frame or frame.startswith("/"):
            raise ERRORS["InvalidArgumentException"](
                f'Invalid argument "{frame}" passed: a frame is not empty, without a slash'
            )
        if frame not in self.frames and not any(each.parent == frame for s in self.frames.values() for each in s):
            raise ERRORS["LookupException"](f'"{frame}" passed to lookupTransform does not exist.')

    def _at(self, frame: str, at: int) -> Stored:
        stored = self.frames[frame]
        if frame in self.static:
            return stored[0]
        for newer, each in zip((None, *stored), stored, strict=False):
            if each.stamp == at:
                return each
            if each.stamp < at and newer is not None:
                return _between(each, newer, at) if each.parent == newer.parent else each
            if each.stamp < at:
                break
        where = "at time" if len(stored) == 1 else "into the future" if at > stored[0].stamp else "into the past"
        raise ERRORS["ExtrapolationException"](
            f"Lookup would require extrapolation {where}: {at / SECOND} of [{frame}]"
        )

    def _up(self, frame: str) -> Iterator[tuple[str, Stored]]:
        """The latest transforms from a frame to its root."""
        while frame in self.frames:
            yield frame, self.frames[frame][0]
            frame = self.frames[frame][0].parent

    def _latest(self, target: str, source: str) -> int:
        """The latest time at which both are known; 0 for static transforms."""
        if target == source:
            return self.frames[source][0].stamp if source in self.frames and source not in self.static else 0
        chains = []
        for start, end in ((source, target), (target, source)):
            chain = [(frame, s.parent, 0 if frame in self.static else s.stamp) for frame, s in self._up(start)]
            parents = [parent for _, parent, _ in chain]
            if end in parents:
                return min((at for *_, at in chain[: parents.index(end) + 1] if at), default=0)
            chains.append(chain)
        common = next((p for _, p, _ in chains[1] if p in [parent for _, parent, _ in chains[0]]), None)
        if common is None:
            raise ERRORS["ConnectivityException"](f"Could not find a connection between '{target}' and '{source}'")
        stamps = [at for c in chains for *_, at in c[: [p for _, p, _ in c].index(common) + 1] if at]
        return min(stamps, default=0)

    def _walk(self, start: str, ends: Sequence[str], at: int) -> tuple[str, Numbers, Numbers, Exception | None]:
        """From a frame up to one of `ends`, or to where nothing is known: that frame, and the transform to it."""
        move, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        while start not in ends and start in self.frames:
            try:
                step = self._at(start, at)
            except ERRORS["ExtrapolationException"] as error:
                return start, move, turn, error
            move, turn = _sum(_rotated(step.turn, move), step.move), _times(step.turn, turn)  # type: ignore[assignment]
            start = step.parent
        return start, move, turn, None

    def lookup_transform_core(self, target_frame: str, source_frame: str, time: Time) -> Any:
        for frame in (target_frame, source_frame):
            self._known(frame)
        at = time.nanoseconds or self._latest(target_frame, source_frame)
        top, move, turn, wrong = self._walk(source_frame, (target_frame,), at)
        end, back, turned, other = self._walk(target_frame, (top, source_frame), at)
        if end != top and end != source_frame:
            raise (
                other
                or wrong
                or ERRORS["ConnectivityException"](f"'{target_frame}' and '{source_frame}' are not connected")
            )
        if end == source_frame:
            move, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        undo = _inverse(turned)
        move, turn = _sum(_rotated(undo, move), _rotated(undo, tuple(-x for x in back))), _times(undo, turn)
        made = self._driven.classes["geometry_msgs/TransformStamped"](child_frame_id=source_frame)
        made.header.frame_id, made.header.stamp = target_frame, self._driven.moment("time", at)
        shift, rotation = made.transform.translation, made.transform.rotation
        shift.x, shift.y, shift.z = move
        rotation.x, rotation.y, rotation.z, rotation.w = turn
        return made

    def can_transform(
        self, target_frame: str, source_frame: str, time: Time, timeout: Any = None, return_debug_tuple: bool = False
    ) -> Any:
        end = self._driven.now + (timeout.nanoseconds if timeout is not None else 0)
        while True:
            try:
                self.lookup_transform_core(target_frame, source_frame, time)
                return (True, "") if return_debug_tuple else True
            except TransformException as error:
                if self._driven.now >= end:
                    return (False, str(error)) if return_debug_tuple else False
            self._driven.pause(min(POLL, end - self._driven.now))

    def lookup_transform(self, target_frame: str, source_frame: str, time: Time, timeout: Any = None) -> Any:
        self.can_transform(target_frame, source_frame, time, timeout)
        return self.lookup_transform_core(target_frame, source_frame, time)


class TransformListener(Strict):
    _called = "tf2_ros.TransformListener"

    def __init__(self, buffer: Buffer, node: Any, *, spin_thread: bool = False, qos: Any = 100, static_qos: Any = 100):
        if spin_thread:
            raise self._driven.refuse("TransformListener(spin_thread=)")
        kind, more = self._driven.classes["tf2_msgs/TFMessage"], {"callback_group": ReentrantCallbackGroup()}

        def heard(message: Any, static: bool) -> None:
            for transform in message.transforms:
                buffer.set_transform(transform, "", static=static)

        node.create_subscription(kind, "/tf", lambda message: heard(message, False), qos, **more)
        node.create_subscription(kind, "/tf_static", lambda message: heard(message, True), static_qos, **more)


class TransformBroadcaster(Strict):
    _called, _topic = "tf2_ros.TransformBroadcaster", "/tf"

    def __init__(self, node: Any, qos: Any = 100) -> None:
        self.publisher = node.create_publisher(self._driven.classes["tf2_msgs/TFMessage"], self._topic, qos)
        self.all: dict[str, Any] = {}

    def sendTransform(self, transform: Any) -> None:  # noqa: N802 - ROS' name
        given = list(transform) if isinstance(transform, list | tuple) else [transform]
        self.all |= {each.child_frame_id: each for each in given}
        whole = list(self.all.values()) if self._topic == "/tf_static" else given
        self.publisher.publish(self.publisher.msg_type(transforms=whole))


class StaticTransformBroadcaster(TransformBroadcaster):
    _called, _topic = "tf2_ros.StaticTransformBroadcaster", "/tf_static"


KINDS: tuple[Any, ...] = (Buffer, TransformListener, TransformBroadcaster, StaticTransformBroadcaster)
CONTENT: dict[str, Any] = {kind.__name__: kind for kind in (*KINDS, TransformException)} | ERRORS
PARTS = ("buffer", "transform_listener", "transform_broadcaster", "static_transform_broadcaster")
"""Modules of the package."""
