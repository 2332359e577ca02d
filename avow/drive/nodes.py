"""rclpy's Node, and what a node creates."""

from __future__ import annotations

import enum
import functools
from typing import Any

from .parameters import Parameters
from .refusals import Strict, nothing
from .turns import FREE

SECOND = 10**9
DEFAULTS = {"raw": False, "autostart": True, "start_parameter_services": True, "enable_rosout": True}
DEFAULTS |= {"allow_undeclared_parameters": False, "automatically_declare_parameters_from_overrides": False}
KEYWORDS = {*DEFAULTS, "callback_group", "event_callbacks", "qos_overriding_options", "content_filter_options", "clock"}
KEYWORDS |= {"publisher_class", "context", "cli_args", "parameter_overrides", "rosout_qos_profile"}
"""Keyword arguments of rclpy's Node and its methods: any other one is an error of the class, there as here."""
OF_NODES: tuple[str, ...] = ("create_", "destroy_", "get_", "set_", "add_", "remove_", "declare_", "undeclare_")
OF_NODES += ("describe_", "list_", "has_", "count_", "resolve_", "publishers", "subscriptions", "timers", "services")
OF_NODES += ("clients", "executor", "default_callback_group", "waitables", "guards")
"""Prefixes of names of rclpy's Node: such a name that is missing here is refused; other names are the class's own."""


class MutuallyExclusiveCallbackGroup:
    """A callback group: while one of its callbacks sleeps, the others wait."""

    reentrant = False


class ReentrantCallbackGroup(MutuallyExclusiveCallbackGroup):
    """A callback group whose callbacks do not wait for each other."""

    reentrant = True


GROUPS: dict[str, Any] = {kind.__name__: kind for kind in (MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup)}


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


def _policy(name: str, *words: str) -> Any:
    """A policy of rclpy by its members; each has its older name too."""
    known = {word: number for number, word in enumerate(words) if word}
    older = {f"RMW_QOS_POLICY_{name.upper()}_{word}": number for word, number in known.items()}
    return enum.IntEnum(f"{name}Policy", {**known, **older})


POLICIES = {
    "history": _policy("History", "SYSTEM_DEFAULT", "KEEP_LAST", "KEEP_ALL"),
    "reliability": _policy("Reliability", "SYSTEM_DEFAULT", "RELIABLE", "BEST_EFFORT", "", "BEST_AVAILABLE"),
    "durability": _policy("Durability", "SYSTEM_DEFAULT", "TRANSIENT_LOCAL", "VOLATILE", "", "BEST_AVAILABLE"),
    "liveliness": _policy("Liveliness", "SYSTEM_DEFAULT", "AUTOMATIC", "", "MANUAL_BY_TOPIC", "", "BEST_AVAILABLE"),
}
SETTINGS: dict[str, Any] = {"history": 1, "depth": 10, "reliability": 1, "durability": 2, "lifespan": Duration()}
SETTINGS |= {"deadline": Duration(), "liveliness": 0, "liveliness_lease_duration": Duration()}
SETTINGS |= {"avoid_ros_namespace_conventions": False}
"""The settings of a profile, with rmw's defaults."""


class InvalidQoSProfileException(Exception):  # noqa: N818 - rclpy's name
    """A profile without the depth that it needs."""


class QoSProfile:
    """Takes what rclpy's takes. Here every message arrives, with TRANSIENT_LOCAL also the last one from before."""

    def __init__(self, **named: Any) -> None:
        if "depth" not in named and named.get("history", 1) == 1 and named.keys() <= SETTINGS.keys():
            raise InvalidQoSProfileException("QoSProfile with the history KEEP_LAST needs depth=")
        for name, value in {**SETTINGS, **named}.items():
            setattr(self, name, value)

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in SETTINGS:
            raise AssertionError(f"QoSProfile has {', '.join(SETTINGS)}, and no {name!r}")
        kind = POLICIES.get(name, type(SETTINGS[name]))
        if not isinstance(value, int if name in POLICIES else kind):
            raise AssertionError(f"{name} of a QoSProfile is a {kind.__name__}, not {value!r}")
        super().__setattr__(name, kind(value) if name in POLICIES else value)


QOS: dict[str, Any] = {kind.__name__: kind for kind in (QoSProfile, InvalidQoSProfileException, *POLICIES.values())}
QOS |= {f"QoS{kind.__name__}": kind for kind in POLICIES.values()}
PROFILES = {"sensor_data": (1, 5, 2), "services_default": (1, 10), "parameters": (1, 1000)}
PROFILES |= {"system_default": (0, 0, 0, 0)}
"""The first settings of rclpy's profiles."""
QOS |= {f"qos_profile_{n}": QoSProfile(**dict(zip(SETTINGS, v, strict=False))) for n, v in PROFILES.items()}


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

    def __init__(self, period: int, callback: Any, group: Any = None) -> None:
        self.timer_period_ns, self.turn, self.over = period, 0, False
        self.callback = self._driven.turn(group, lambda: self._driven.call(callback))
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

    def __init__(self, kind: Any, name: str, callback: Any, group: Any = None) -> None:
        self.srv_type, self.callback = kind, callback
        self.srv_name = self._driven.serve(name, kind, lambda request: callback(request, kind.Response()), group)


class Clock(Strict):
    _called = "rclpy.clock.Clock"

    def now(self) -> Any:
        return Time(nanoseconds=self._driven.now)

    def sleep_for(self, rel_time: Duration, context: Any = None) -> bool:
        self._driven.pause(rel_time.nanoseconds)
        return True


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
            act = self._driven.turn(FREE, lambda: self._driven.call(callback, self, free=True))
            self._driven.later(self._driven.now, act)
        else:
            self._callbacks.append(callback)

    def __await__(self) -> Any:
        while not self._done:
            yield self
        return self._result


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
        Parameters.__init__(self)
        self._avow_plain("Node", more)

    def _avow_plain(self, called: str, more: dict[str, Any], qos: Any = 0, kinds: Any = int | QoSProfile) -> None:
        """Refuses what else is given, unless it is the default, or an exclusive group."""
        for name, given in more.items():
            if name not in KEYWORDS:
                instead = ": the depth of the queue is its qos_profile" if name == "queue_size" else ""
                raise TypeError(f"{called}() has no argument {name!r}{instead}")
            if given is not DEFAULTS.get(name) and not isinstance(given, MutuallyExclusiveCallbackGroup):
                raise self._avow.refuse(f"rclpy.node.{called}({name}=)")
        if not isinstance(qos, kinds) or (isinstance(qos, int) and qos < 0):
            text = f"qos_profile of {called}() is {qos!r}, and has to be a QoSProfile, or for a topic a depth from 0"
            raise (ValueError if isinstance(qos, kinds) else TypeError)(text)

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Any, qos_profile: Any = None, **more: Any
    ) -> Any:
        self._avow_plain("Node.create_subscription", more, qos_profile)
        act = self._avow.turn(more.get("callback_group"), lambda message: self._avow.call(callback, message))
        late = getattr(qos_profile, "durability", None) == POLICIES["durability"].TRANSIENT_LOCAL
        return Subscription(*self._avow.hear(topic, msg_type, act, late=late))

    def create_publisher(
        self, msg_type: Any, topic: str, qos_profile: Any = None, *, _avow_made: Any = Publisher, **more: Any
    ) -> Any:
        self._avow_plain("Node.create_publisher", more, qos_profile)
        return _avow_made(self._avow.speak(topic, msg_type), msg_type)

    def create_timer(self, timer_period_sec: float, callback: Any, callback_group: Any = None, **more: Any) -> Any:
        self._avow_plain("Node.create_timer", {"callback_group": callback_group, **more})
        if not timer_period_sec > 0:
            raise ValueError(f"a timer's period is above 0, not {timer_period_sec!r}")
        return Timer(int(float(timer_period_sec) * SECOND), callback, callback_group)

    def create_service(self, srv_type: Any, srv_name: str, callback: Any, **more: Any) -> Any:
        self._avow_plain("Node.create_service", more, more.pop("qos_profile", QoSProfile(depth=10)), QoSProfile)
        return Service(srv_type, srv_name, callback, more.get("callback_group"))

    def create_client(self, srv_type: Any, srv_name: str, **more: Any) -> Any:
        self._avow_plain("Node.create_client", more, more.pop("qos_profile", QoSProfile(depth=10)), QoSProfile)
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
        if name in ("_avow", "_avow_declared"):
            raise RuntimeError(f"{type(self).__name__} is used before its __init__ calls super().__init__(name)")
        if name.startswith(OF_NODES) or name in ("context", "handle"):
            begun = name[: -(-3 * len(name) // 4)]  # `create_subscriber` begins as `create_subscription` does
            near = "".join(f" (did you mean `{known}`?)" for known in dir(type(self)) if known.startswith(begun))
            raise self._avow.refuse(f"rclpy.node.Node.{name}{near}")
        raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
