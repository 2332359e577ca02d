"""tf2_ros of rclpy: a buffer of transforms, fed from /tf and /tf_static, with ten seconds of storage."""

from __future__ import annotations

from typing import Any

from .nodes import ReentrantCallbackGroup, Time
from .refusals import Strict
from .transforms import SECOND, NoTransform, Stored, Transforms

POLL = SECOND // 50


class TransformException(Exception):  # noqa: N818 - tf2's names, as those below
    """The base of tf2's exceptions."""


ERRORS: dict[str, Any] = {
    name: type(name, (TransformException,), {})
    for name in (
        f"{kind}Exception" for kind in ("Lookup", "Connectivity", "Extrapolation", "InvalidArgument", "Timeout")
    )
}


class Buffer(Strict):
    _called = "tf2_ros.Buffer"

    def __init__(self, cache_time: Any = None, node: Any = None) -> None:
        self.transforms = Transforms(cache_time.nanoseconds if cache_time is not None else 10 * SECOND)

    def set_transform(self, transform: Any, authority: str, *, static: bool = False) -> None:
        shift, q = transform.transform.translation, transform.transform.rotation
        stamp = self._driven.nanoseconds("time", transform.header.stamp)
        one = Stored(stamp, transform.header.frame_id, (shift.x, shift.y, shift.z), (q.x, q.y, q.z, q.w))
        self.transforms.add(transform.child_frame_id, one, static=static)

    def set_transform_static(self, transform: Any, authority: str) -> None:
        self.set_transform(transform, authority, static=True)

    def lookup_transform_core(self, target_frame: str, source_frame: str, time: Time) -> Any:
        try:
            at = self.transforms.moment(target_frame, source_frame, time.nanoseconds)
            move, turn = self.transforms.find(target_frame, source_frame, at)
        except NoTransform as error:
            raise ERRORS[f"{error.kind}Exception"](str(error)) from None
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
