"""The stand-in for rclpy (https://docs.ros.org/en/rolling/p/rclpy), for a driven class."""

from __future__ import annotations

import array
import inspect
import math
import sys
from collections import UserList, UserString
from collections.abc import Callable, Sequence, Set
from typing import Any

from . import actions, filters, lifecycle, parameters, tf2
from .callbacks import Driven, answers
from .messages import INTEGERS
from .nodes import ENTITIES, GROUPS, QOS, Duration, Future, Log, Node, Time
from .refusals import Strict
from .turns import SLEEPS

SECOND = 10**9
LARGEST = {"float32": 3.402823466e38, "float64": 1.7976931348623157e308}
ARRAYS = {"float32": "f", "float64": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H"}
ARRAYS |= {"int32": "i", "uint32": "I", "int64": "q", "uint64": "Q"}
"""The type code of a field that holds any number of such numbers: rclpy keeps them in an `array.array`."""
WIRES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}


def modules(spec: Any, own: Sequence[str]) -> Callable[[Any, Any], Callable[[str], str]]:
    """Install the modules; the driver of a class, whose own modules are in the folders `own`."""
    driven = _World(spec, own)
    driven.install()
    inside: dict[str, dict[str, Any]] = {
        "node": {"Node": Node},
        "time": {"Time": Time},
        "duration": {"Duration": Duration},
        "qos": QOS,
        "action": actions.CONTENT,
        "callback_groups": GROUPS,
        "executors": {kind.__name__: kind for kind in (SingleThreadedExecutor, MultiThreadedExecutor, _Shutdown)},
        "exceptions": parameters.EXCEPTIONS,
        "lifecycle": lifecycle.CONTENT,
        "logging": {"get_logger": lambda name="": Log()},
        "task": {"Future": Future},
        "parameter": {"Parameter": parameters.Parameter},
        **{kind.__name__.lower(): {kind.__name__: kind} for kind in ENTITIES},
    }
    content: dict[str, Any] = {name: driven.module(f"rclpy.{name}", content) for name, content in inside.items()}
    filters.Subscriber.subscribe = _subscribed
    driven.module("message_filters", filters.CONTENT)
    parts = {name: driven.module(f"tf2_ros.{name}", tf2.CONTENT) for name in tf2.PARTS}
    driven.module("tf2_ros", parts | tf2.CONTENT)
    driven.module("rclpy", content | {"Parameter": parameters.Parameter, "ok": lambda context=None: True})

    def make(made: Any, params: Any) -> Any:
        if not issubclass(made, Node):
            raise TypeError(f"{made.__name__} is no rclpy.node.Node")
        text = inspect.getsource(sys.modules[made.__module__])
        driven.sleeps, driven.parallel = bool(SLEEPS.search(text)), MultiThreadedExecutor.__name__ in text
        node = made()
        if isinstance(node, lifecycle.LifecycleNode) and not node._avow_asked_for:
            node._avow_activate()
        node._avow_all_declared()
        return node

    return answers(driven, make)


def _subscribed(act: Any, node: Node, kind: Any, topic: str, qos_profile: Any = 10, **more: Any) -> str:
    node.create_subscription(kind, topic, act, qos_profile, **more)
    return str(node._avow.whole(topic))


class SingleThreadedExecutor(Strict):
    """Executors run nodes in `main`, which is not called."""

    _called = "rclpy.executors.SingleThreadedExecutor"


class MultiThreadedExecutor(SingleThreadedExecutor):
    _called = "rclpy.executors.MultiThreadedExecutor"


class _Shutdown(Exception):  # noqa: N818 - rclpy's name
    """Is never raised."""


_Shutdown.__name__ = "ExternalShutdownException"


class _World(Driven):
    def moment(self, wire: str, nanoseconds: int) -> Any:
        made = self.classes[WIRES[wire]]()
        made.sec, made.nanosec = divmod(nanoseconds, SECOND)
        return made

    def nanoseconds(self, wire: str, value: Any) -> int:
        if type(value) is not self.classes[WIRES[wire]]:
            raise TypeError(f"{value!r} is no {WIRES[wire]}")
        return int(value.sec) * SECOND + int(value.nanosec)

    def message_class(self, name: str) -> Any:
        """Its fields take what the setters that rosidl generates take, and raise AssertionError otherwise."""
        made = super().message_class(name)
        for field, wire in self.types[name]["fields"]:
            setattr(made, field, self.checked(field, wire, vars(made)[field]))
        return made

    def checked(self, field: str, wire: Any, slot: Any) -> property:
        def put(message: Any, value: Any) -> None:
            item = wire["a"] if isinstance(wire, dict) and "a" in wire else None
            length = wire["length"] if item is not None else None
            code = ARRAYS.get(item) if length is None and isinstance(item, str) else None
            if length is not None and getattr(getattr(value, "dtype", None), "name", None) == item:
                value = value.tolist()  # numpy's, for a field of fixed length
            if item is None:
                fits = self.fits(wire, value)
            else:
                fits = isinstance(value, Sequence | Set | UserList) and not isinstance(value, str | UserString)
                fits = fits and len(value) == (len(value) if length is None else length)
                fits = fits and getattr(value, "typecode", code) == code and all(self.fits(item, v) for v in value)
            if not fits:
                kind, array_of = (wire, "") if item is None else (item, f"[{length or ''}]")
                of = f"{kind['n'] if isinstance(kind, dict) else kind}{array_of}"
                raise AssertionError(f"the field {field!r} must be of type {of}, not {value!r}"[:200])
            if item is not None and (length is not None or not isinstance(value, list | tuple)):
                value = list(value)
            slot.__set__(message, array.array(code, value) if code else value)

        return property(slot.__get__, put)

    def fits(self, wire: Any, value: Any) -> bool:
        """Whether a field that is no array takes the value."""
        if isinstance(wire, dict) or wire in WIRES:
            return isinstance(value, self.classes[WIRES[wire] if isinstance(wire, str) else wire["n"]])
        if wire in INTEGERS:
            sign, bits = INTEGERS[wire]
            low, high = (0, 2**bits) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1))
            return isinstance(value, int) and low <= value < high
        if wire.startswith("float"):
            return isinstance(value, float) and (not abs(value) > LARGEST[wire] or math.isinf(value))
        return isinstance(value, bool if wire == "bool" else str)
