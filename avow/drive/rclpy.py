"""The stand-in for rclpy (https://docs.ros.org/en/rolling/p/rclpy), for a driven class."""

from __future__ import annotations

import array
import functools
import math
import re
import types
from collections import UserList, UserString
from collections.abc import Callable, Sequence, Set
from typing import Any

SECOND = 10**9
LOGS = ("debug", "info", "warn", "warning", "error", "fatal")
LARGEST = {"float32": 3.402823466e38, "float64": 1.7976931348623157e308}
ARRAYS = {"float32": "f", "float64": "d", "int8": "b", "uint8": "B", "int16": "h", "uint16": "H"}
ARRAYS |= {"int32": "i", "uint32": "I", "int64": "q", "uint64": "Q"}
"""The type code of a field that holds any number of such numbers: rclpy keeps them in an `array.array`."""
DEFAULTS = {"raw": False, "autostart": True, "start_parameter_services": True, "enable_rosout": True}
DEFAULTS |= {"allow_undeclared_parameters": False, "automatically_declare_parameters_from_overrides": False}
VALUES = tuple(f"{kind}_value" for kind in ("bool", "integer", "double", "string", "byte_array"))
VALUES += tuple(f"{kind}_array_value" for kind in ("bool", "integer", "double", "string"))
OF_NODES: tuple[str, ...] = ("create_", "destroy_", "get_", "set_", "add_", "remove_", "declare_", "undeclare_")
OF_NODES += (
    "describe_",
    "list_",
    "has_",
    "count_",
    "resolve_",
    "publishers",
    "subscriptions",
    "timers",
    "services",
    "clients",
)
OF_NODES += ("executor",)
"""Prefixes of names of rclpy's Node: such a name that is missing here is refused; other names are the class's own."""


def modules(base: Any, spec: Any, values: Any) -> Callable[[Any, Any], Callable[[str], str]]:
    """Install the modules; the driver of a class. `base` is the module `callbacks`."""
    driven = _world(base, spec)
    time, duration = _moments(base, driven)
    kinds = _endpoints(base, driven, time)
    node = _node(base, driven, kinds)
    driven.install()
    content = {
        name: driven.module(f"rclpy.{name}", inside)
        for name, inside in (
            ("node", {"Node": node}),
            ("time", {"Time": time}),
            ("duration", {"Duration": duration}),
            ("qos", _qos()),
            ("callback_groups", {"MutuallyExclusiveCallbackGroup": MutuallyExclusiveCallbackGroup}),
            *((name.lower(), {name: kind}) for name, kind in kinds.items()),
        )
    }
    driven.module("rclpy", content)
    return base.answers(driven, values, _maker(driven, node))  # type: ignore[no-any-return]


class MutuallyExclusiveCallbackGroup:
    """A callback group that changes nothing: callbacks run one at a time."""


def _world(base: Any, spec: Any) -> Any:
    class World(base.Driven):  # type: ignore[misc]
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
            if wire in base.INTEGERS:
                sign, bits = base.INTEGERS[wire]
                low, high = (0, 2**bits) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1))
                return isinstance(value, int) and low <= value < high
            if wire.startswith("float"):
                return isinstance(value, float) and (not abs(value) > LARGEST[wire] or math.isinf(value))
            return isinstance(value, bool if wire == "bool" else str)

    return World(spec)


def _moments(base: Any, driven: Any) -> tuple[Any, Any]:
    """rclpy's Time and Duration."""

    @functools.total_ordering
    class Moment(base.Strict):  # type: ignore[misc]
        _driven = driven

        def __init__(self, *, nanoseconds: int = 0, seconds: float = 0) -> None:
            self.nanoseconds = int(seconds * SECOND) + nanoseconds

        def __eq__(self, other: object) -> bool:
            return type(other) is type(self) and self.nanoseconds == other.nanoseconds

        def __lt__(self, other: Any) -> bool:
            return self.nanoseconds < other.nanoseconds if type(other) is type(self) else NotImplemented

        def __hash__(self) -> int:
            return hash(self.nanoseconds)

        def to_msg(self) -> Any:
            return driven.moment(self._wire, self.nanoseconds)

        @classmethod
        def from_msg(cls, message: Any, clock_type: Any = None) -> Any:
            return cls(nanoseconds=driven.nanoseconds(cls._wire, message))

    class Duration(Moment):
        _called, _wire = "rclpy.duration.Duration", "duration"

    class Time(Moment):
        _called, _wire = "rclpy.time.Time", "time"

        def __init__(self, *, seconds: float = 0, nanoseconds: int = 0, clock_type: Any = None) -> None:
            super().__init__(seconds=seconds, nanoseconds=nanoseconds)

        def __add__(self, other: Any) -> Any:
            return Time(nanoseconds=self.nanoseconds + other.nanoseconds) if type(other) is Duration else NotImplemented

        def __sub__(self, other: Any) -> Any:
            if type(other) not in (Time, Duration):
                return NotImplemented
            kind: Any = Duration if type(other) is Time else Time
            return kind(nanoseconds=self.nanoseconds - other.nanoseconds)

    return Time, Duration


def _endpoints(base: Any, driven: Any, time: Any) -> dict[str, Any]:
    """The classes of the objects that a node creates, and of its clock; by name."""

    class Publisher(base.Strict):  # type: ignore[misc]
        _driven, _called = driven, "rclpy.publisher.Publisher"

        def __init__(self, topic: str, kind: Any) -> None:
            self.topic_name, self.msg_type = topic, kind

        def publish(self, message: Any) -> None:
            driven.say(self.topic_name, message)

    class Timer(base.Strict):  # type: ignore[misc]
        _driven, _called = driven, "rclpy.timer.Timer"

        def __init__(self, period: int, callback: Any) -> None:
            self.timer_period_ns, self.callback, self.turn, self.over = period, callback, 0, False
            self.reset()

        def fire(self, turn: int) -> None:
            if self.over or turn != self.turn:
                return
            driven.later(driven.now + self.timer_period_ns, lambda: self.fire(turn))
            self.callback()

        def cancel(self) -> None:
            self.over = True

        def is_canceled(self) -> bool:
            return bool(self.over)

        def reset(self) -> None:
            self.turn, self.over = self.turn + 1, False
            turn = self.turn
            driven.later(driven.now + self.timer_period_ns, lambda: self.fire(turn))

    class Subscription(base.Strict):  # type: ignore[misc]
        _driven, _called = driven, "rclpy.subscription.Subscription"

    class Parameter(base.Strict):  # type: ignore[misc]
        _driven, _called = driven, "rclpy.parameter.Parameter"

        def __init__(self, name: str, value: Any = None) -> None:
            self.name, self.value = name, value

        def get_parameter_value(self) -> Any:
            """A message rcl_interfaces/ParameterValue: the field of the parameter's type, defaults in the others."""
            held = self.value
            many = isinstance(held, list | tuple)
            kinds = [type(each) for each in held] if many else [type(held)]
            number = next((n for n, kind in enumerate((bool, int, float, str), 1) if {*kinds} == {kind}), 0)
            fields = dict(zip(VALUES, (False, 0, 0.0, "", [], [], array.array("q"), array.array("d"), []), strict=True))
            if number:
                code = {2: "q", 3: "d"}.get(number) if many else None
                number += 5 if many else 0
                fields[VALUES[number - 1]] = array.array(code, held) if code else held
            elif held is not None:
                raise driven.refuse(f"the type of the parameter {self.name}")
            return types.SimpleNamespace(type=number, **fields)

    class Clock(base.Strict):  # type: ignore[misc]
        _driven, _called = driven, "rclpy.clock.Clock"

        def now(self) -> Any:
            return time(nanoseconds=driven.now)

    return {kind.__name__: kind for kind in (Publisher, Timer, Subscription, Parameter, Clock)}


def _node(base: Any, driven: Any, kinds: dict[str, Any]) -> Any:
    def plain(called: str, more: dict[str, Any]) -> None:
        """Refuses what else is given, unless it is the default, or an exclusive group."""
        for name, given in more.items():
            if given is not DEFAULTS.get(name) and type(given) is not MutuallyExclusiveCallbackGroup:
                raise driven.refuse(f"rclpy.node.{called}({name}=)")

    class Node:
        """The base class of nodes. The other attributes of rclpy's Node are refused by name."""

        def __init__(
            self, node_name: str, *, namespace: Any = None, use_global_arguments: bool = True, **more: Any
        ) -> None:
            plain("Node", more)
            self._avow_declared: dict[str, Any] = {}

        def create_subscription(self, msg_type: Any, topic: str, callback: Any, qos_profile: Any, **more: Any) -> Any:
            plain("Node.create_subscription", more)
            driven.hear(topic, msg_type, callback)
            return kinds["Subscription"]()

        def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **more: Any) -> Any:
            plain("Node.create_publisher", more)
            return kinds["Publisher"](driven.speak(topic, msg_type), msg_type)

        def create_timer(self, timer_period_sec: float, callback: Any, callback_group: Any = None, **more: Any) -> Any:
            plain("Node.create_timer", {"callback_group": callback_group, **more})
            if not timer_period_sec > 0:
                raise ValueError(f"a timer's period is above 0, not {timer_period_sec!r}")
            return kinds["Timer"](int(float(timer_period_sec) * SECOND), callback)

        def declare_parameter(self, name: str, value: Any = None) -> Any:
            if name in self._avow_declared:
                raise driven.refuse(f"a second declaration of the parameter {name}")
            at = dict(flat(driven.params)).get(name)
            found = value if at is None else at
            if at is not None and value is not None and type(at) is not type(value):
                raise TypeError(f"the parameter {name} is declared as {value!r}, and set to {at!r}")
            self._avow_declared[name] = kinds["Parameter"](name, found)
            return self._avow_declared[name]

        def declare_parameters(self, namespace: str, parameters: Any) -> Any:
            prefix = f"{namespace}." if namespace else ""
            return [self.declare_parameter(f"{prefix}{name}", *rest) for name, *rest in parameters]

        def has_parameter(self, name: str) -> bool:
            return name in self._avow_declared

        def get_parameter(self, name: str) -> Any:
            if name not in self._avow_declared:
                raise KeyError(f"the parameter {name} is not declared")
            return self._avow_declared[name]

        def get_clock(self) -> Any:
            return kinds["Clock"]()

        def get_logger(self) -> Any:
            return base.Log(LOGS)

        def get_name(self) -> str:
            return str(driven.name.rpartition("/")[2])

        def get_namespace(self) -> str:
            return str(driven.name.rpartition("/")[0] or "/")

        def get_fully_qualified_name(self) -> str:
            return str(driven.name)

        def destroy_node(self) -> None:
            raise driven.refuse("rclpy.node.Node.destroy_node")

        def __getattr__(self, name: str) -> Any:
            if name.startswith(OF_NODES):
                raise driven.refuse(f"rclpy.node.Node.{name}")
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")

    return Node


def _qos() -> dict[str, Any]:
    class QoSProfile:
        """Queue sizes and reliability: here every message arrives."""

        def __init__(self, **named: Any) -> None:
            vars(self).update(named)

    def policy(name: str, *words: str) -> Any:
        return types.SimpleNamespace(**{word: f"{name}.{word}" for word in words})

    qos: dict[str, Any] = {"QoSProfile": QoSProfile}
    for short, long, words in (
        ("Reliability", "QoSReliabilityPolicy", ("RELIABLE", "BEST_EFFORT", "SYSTEM_DEFAULT")),
        ("Durability", "QoSDurabilityPolicy", ("VOLATILE", "TRANSIENT_LOCAL", "SYSTEM_DEFAULT")),
        ("History", "QoSHistoryPolicy", ("KEEP_LAST", "KEEP_ALL", "SYSTEM_DEFAULT")),
    ):
        qos |= dict.fromkeys((f"{short}Policy", long), policy(short, *words))
    qos |= dict.fromkeys(("qos_profile_sensor_data", "qos_profile_system_default"), QoSProfile(depth=10))
    return qos


def _maker(driven: Any, base_class: Any) -> Callable[[Any, Any], Any]:
    def make(made: Any, params: Any) -> Any:
        if not issubclass(made, base_class):
            raise TypeError(f"{made.__name__} is no rclpy.node.Node")
        node = made()
        unknown = [name for name, _ in flat(driven.params) if name not in node._avow_declared and not OWN.match(name)]
        if unknown:
            known = ", ".join(sorted(node._avow_declared)) or "none"
            raise ValueError(f"the parameter {unknown[0]} is set, and the class declares {known}")
        return node

    return make


OWN = re.compile(r"use_sim_time\Z|start_type_description_service\Z|qos_overrides\.")
"""Parameters that every node of rclpy declares itself."""


def flat(params: Any, before: str = "") -> Any:
    """Parameters by their dotted names."""
    for name, value in params.items():
        if isinstance(value, dict):
            yield from flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


WIRES = {"time": "builtin_interfaces/Time", "duration": "builtin_interfaces/Duration"}
