"""rclpy's Node, and what a node creates."""

from __future__ import annotations

import functools
from typing import Any

from .parameters import Parameters
from .refusals import Strict, nothing

SECOND = 10**9
DEFAULTS = {"raw": False, "autostart": True, "start_parameter_services": True, "enable_rosout": True}
DEFAULTS |= {"allow_undeclared_parameters": False, "automatically_declare_parameters_from_overrides": False}
OF_NODES: tuple[str, ...] = (
    "create_",
    "destroy_",
    "get_",
    "set_",
    "add_",
    "remove_",
    "declare_",
    "undeclare_",
    "describe_",
    "list_",
)
OF_NODES += ("has_", "count_", "resolve_", "publishers", "subscriptions", "timers", "services", "clients", "executor")
OF_NODES += ("default_callback_group", "waitables", "guards")
"""Prefixes of names of rclpy's Node: such a name that is missing here is refused; other names are the class's own."""


class MutuallyExclusiveCallbackGroup:
    """A callback group that changes nothing: callbacks run one at a time."""


@functools.total_ordering
class _Moment(Strict):
    _wire = ""

    def __init__(self, *, nanoseconds: int = 0, seconds: float = 0) -> None:
        self.nanoseconds = int(seconds * SECOND) + nanoseconds

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self.nanoseconds == other.nanoseconds

    def __lt__(self, other: Any) -> bool:
        return self.nanoseconds < other.nanoseconds if type(other) is type(self) else NotImplemented

    def __hash__(self) -> int:
        return hash(self.nanoseconds)

    def to_msg(self) -> Any:
        return self._driven.moment(self._wire, self.nanoseconds)

    def seconds_nanoseconds(self) -> tuple[int, int]:
        return divmod(self.nanoseconds, SECOND)

    @classmethod
    def from_msg(cls, message: Any, clock_type: Any = None) -> Any:
        return cls(nanoseconds=cls._driven.nanoseconds(cls._wire, message))


class Duration(_Moment):
    _called, _wire = "rclpy.duration.Duration", "duration"


class Time(_Moment):
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


class Log(Strict):
    _called = "rclpy.impl.rcutils_logger.RcutilsLogger"
    debug = info = warn = warning = error = fatal = set_level = staticmethod(nothing)

    def get_child(self, name: str) -> Log:
        return self


class Publisher(Strict):
    _called = "rclpy.publisher.Publisher"

    def __init__(self, topic: str, kind: Any) -> None:
        self.topic_name, self.msg_type = topic, kind

    def publish(self, message: Any) -> None:
        self._driven.say(self.topic_name, message)


class Timer(Strict):
    _called = "rclpy.timer.Timer"

    def __init__(self, period: int, callback: Any) -> None:
        self.timer_period_ns, self.callback, self.turn, self.over = period, callback, 0, False
        self.reset()

    def fire(self, turn: int) -> None:
        if self.over or turn != self.turn:
            return
        self._driven.later(self._driven.now + self.timer_period_ns, lambda: self.fire(turn))
        self.callback()

    def cancel(self) -> None:
        self.over = True

    def is_canceled(self) -> bool:
        return bool(self.over)

    def reset(self) -> None:
        self.turn, self.over = self.turn + 1, False
        turn = self.turn
        self._driven.later(self._driven.now + self.timer_period_ns, lambda: self.fire(turn))


class Subscription(Strict):
    _called = "rclpy.subscription.Subscription"

    def __init__(self, topic: str, entry: Any) -> None:
        self.topic_name, self.entry = topic, entry


class Service(Strict):
    _called = "rclpy.service.Service"

    def __init__(self, kind: Any, name: str, callback: Any) -> None:
        self.srv_type, self.callback = kind, callback
        self.srv_name = self._driven.serve(name, kind, lambda request: callback(request, kind.Response()))


class Clock(Strict):
    _called = "rclpy.clock.Clock"

    def now(self) -> Any:
        return Time(nanoseconds=self._driven.now)


class Future(Strict):
    _called = "rclpy.task.Future"

    def __init__(self) -> None:
        self._done, self._result, self._callbacks = False, None, list[Any]()

    def done(self) -> bool:
        return self._done

    def result(self) -> Any:
        return self._result

    def exception(self) -> None:
        """None: no response is an error."""

    def cancelled(self) -> bool:
        return False

    def set_result(self, result: Any) -> None:
        self._done, self._result = True, result
        for callback in self._callbacks:
            self.add_done_callback(callback)

    def add_done_callback(self, callback: Any) -> None:
        if self._done:
            self._driven.later(self._driven.now, lambda: callback(self))
        else:
            self._callbacks.append(callback)


class Client(Strict):
    _called = "rclpy.client.Client"

    def __init__(self, kind: Any, name: str) -> None:
        self._send = self._driven.ask(name, kind)
        self.srv_type, self.srv_name = kind, self._driven.whole(name)

    def call_async(self, request: Any) -> Future:
        future = Future()
        self._send(request, future.set_result)
        return future

    def service_is_ready(self) -> bool:
        return True

    def wait_for_service(self, timeout_sec: Any = None) -> bool:
        return True


ENTITIES: tuple[Any, ...] = (Publisher, Timer, Subscription, Service, Client, Clock)


class Node(Parameters):
    """The base class of nodes. The other attributes of rclpy's Node are refused by name."""

    def __init__(
        self, node_name: str, *, namespace: Any = None, use_global_arguments: bool = True, **more: Any
    ) -> None:
        self._avow_plain("Node", more)
        Parameters.__init__(self)

    def _avow_plain(self, called: str, more: dict[str, Any]) -> None:
        """Refuses what else is given, unless it is the default, or an exclusive group."""
        for name, given in more.items():
            if type(given) is MutuallyExclusiveCallbackGroup:
                self._avow.groups.add(given)
            elif given is not DEFAULTS.get(name):
                raise self._avow.refuse(f"rclpy.node.{called}({name}=)")
        if more.get("callback_group") is None:
            self._avow.groups.add(None)

    def create_subscription(self, msg_type: Any, topic: str, callback: Any, qos_profile: Any, **more: Any) -> Any:
        self._avow_plain("Node.create_subscription", more)
        return Subscription(*self._avow.hear(topic, msg_type, callback))

    def create_publisher(self, msg_type: Any, topic: str, qos_profile: Any, **more: Any) -> Any:
        return self._avow_publisher(Publisher, msg_type, topic, more)

    def _avow_publisher(self, made: Any, msg_type: Any, topic: str, more: dict[str, Any]) -> Any:
        groups = set(self._avow.groups)
        self._avow_plain("Node.create_publisher", more)
        self._avow.groups = groups  # a publisher has no callbacks
        return made(self._avow.speak(topic, msg_type), msg_type)

    def create_timer(self, timer_period_sec: float, callback: Any, callback_group: Any = None, **more: Any) -> Any:
        self._avow_plain("Node.create_timer", {"callback_group": callback_group, **more})
        if not timer_period_sec > 0:
            raise ValueError(f"a timer's period is above 0, not {timer_period_sec!r}")
        return Timer(int(float(timer_period_sec) * SECOND), callback)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **more: Any) -> Any:
        more.pop("qos_profile", None)
        self._avow_plain("Node.create_service", more)
        return Service(srv_type, srv_name, callback)

    def create_client(self, srv_type: Any, srv_name: str, **more: Any) -> Any:
        more.pop("qos_profile", None)
        self._avow_plain("Node.create_client", more)
        return Client(srv_type, srv_name)

    def destroy_timer(self, timer: Timer) -> bool:
        timer.cancel()
        return True

    def destroy_subscription(self, subscription: Subscription) -> bool:
        heard, topic = self._avow.heard, subscription.topic_name
        heard[topic] = tuple(entry for entry in heard[topic] if entry is not subscription.entry)
        return True

    def destroy_publisher(self, publisher: Publisher) -> bool:
        publisher.topic_name = ""  # publishing raises
        return True

    destroy_lifecycle_publisher = destroy_publisher

    def get_clock(self) -> Any:
        return Clock()

    def get_logger(self) -> Any:
        return Log()

    def get_name(self) -> str:
        return str(self._avow.name.rpartition("/")[2])

    def get_namespace(self) -> str:
        return str(self._avow.name.rpartition("/")[0] or "/")

    def get_fully_qualified_name(self) -> str:
        return str(self._avow.name)

    def destroy_node(self) -> None:
        raise self._avow.refuse("rclpy.node.Node.destroy_node")

    def __getattr__(self, name: str) -> Any:
        if name.startswith(OF_NODES) or name in ("context", "handle"):
            raise self._avow.refuse(f"rclpy.node.Node.{name}")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
