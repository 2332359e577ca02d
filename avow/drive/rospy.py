"""The stand-in for rospy (http://wiki.ros.org/rospy/Overview), for a driven class."""

from __future__ import annotations

import functools
import inspect
import numbers
import sys
from collections.abc import Callable, Sequence
from typing import Any

from . import actionlib, filters
from .callbacks import REQUEST, RESPONSE, Driven, answers
from .refusals import Strict, nothing
from .turns import FREE, SLEEPS

SECOND = 10**9
LOGS = ("logdebug", "loginfo", "logwarn", "logerr", "logfatal")


def modules(spec: Any, own: Sequence[str]) -> Callable[[Any, Any], Callable[[str], str]]:
    """Install the modules; the driver of a class, whose own modules are in the folders `own`."""
    driven = _World(spec, own)
    driven.time, driven.duration = time, duration = _times(driven, _moment(driven))
    find = _parameters(driven)

    def init_node(name: str, anonymous: bool = False, log_level: Any = None, disable_signals: bool = False) -> None:
        """No effect: the plan gives the node's name."""

    class ROSException(Exception):  # noqa: N818 - rospy's name
        pass

    class ROSInterruptException(ROSException, KeyboardInterrupt):
        pass

    class ServiceException(Exception):  # noqa: N818 - rospy's name
        """Is never raised: every call gets a response, or waits."""

    every = [f"{name}{kind}" for name in LOGS for kind in ("", "_once", "_throttle", "_throttle_identical")]
    content: dict[str, Any] = dict.fromkeys(every, nothing)
    content |= {cls.__name__: cls for cls in (*_endpoints(driven), time, duration, ROSException)}
    content |= {"ROSInterruptException": ROSInterruptException, "ServiceException": ServiceException}
    content |= {
        "get_param": _getter(find),
        "init_node": init_node,
        "has_param": lambda name: find(name) is not _NONE,
        "get_time": lambda: time.now().to_sec(),
        "get_rostime": time.now,
        "get_name": lambda: driven.name,
        "get_namespace": lambda: driven.name.rpartition("/")[0] + "/",
        "resolve_name": driven.whole,
        "is_shutdown": lambda: False,
        "on_shutdown": nothing,
        "sleep": lambda time: driven.pause(time.ns if isinstance(time, duration) else int(time * SECOND)),
        "wait_for_service": nothing,
    }
    driven.install()
    driven.module("rospy", content)

    def subscribed(act: Any, topic: str, kind: Any, **more: Any) -> str:
        content["Subscriber"](topic, kind, act, **more)
        return driven.whole(topic)

    filters.Subscriber.subscribe = subscribed
    driven.module("message_filters", filters.CONTENT)
    driven.module("actionlib", actionlib.CONTENT)

    def make(made: Any, params: Any) -> Any:
        # each subscriber, timer and call has a thread of its own, as has the program
        driven.sleeps = driven.parallel = bool(SLEEPS.search(inspect.getsource(sys.modules[made.__module__])))

        def program() -> None:
            node = made(params) if _takes(made) else made()
            if spec["run"]:
                getattr(node, spec["run"])()

        driven.turn(object(), program)()
        driven.go_on()

    return answers(driven, make)


_NONE = object()


class _World(Driven):
    time: Any
    duration: Any

    def moment(self, wire: str, nanoseconds: int) -> Any:
        return (self.time if wire == "time" else self.duration).of(nanoseconds)

    def nanoseconds(self, wire: str, value: Any) -> int:
        if type(value) is not (self.time if wire == "time" else self.duration):
            raise TypeError(f"{value!r} is no {wire}")
        return int(value.ns)


def _moment(driven: Any) -> Any:
    @functools.total_ordering
    class Moment:
        """Whole nanoseconds, as genpy's times are."""

        __slots__ = ("ns",)
        ns: int

        def __init__(self, secs: float = 0, nsecs: int = 0) -> None:
            if not isinstance(secs, numbers.Integral):
                if nsecs != 0:
                    raise ValueError("if secs is a float, nsecs cannot be set")
                whole = int(secs)
                secs, nsecs = whole, int((secs - whole) * 1000000000)  # truncated, as in genpy
            self.ns = int(secs) * SECOND + int(nsecs)
            self.possible()

        def possible(self) -> None:
            """Raises TypeError if there is no such moment."""

        def __getattr__(self, name: str) -> Any:
            if name.startswith("__"):
                raise AttributeError(name)
            raise driven.refuse(f"rospy.{type(self).__name__}.{name}")

        @classmethod
        def of(cls, ns: int) -> Any:
            made = cls()
            made.ns = ns
            made.possible()
            return made

        @classmethod
        def from_sec(cls, seconds: float) -> Any:
            return cls(float(seconds))

        @property
        def secs(self) -> int:
            return self.ns // SECOND

        @secs.setter
        def secs(self, secs: int) -> None:
            self.ns = secs * SECOND + self.ns % SECOND

        @property
        def nsecs(self) -> int:
            return self.ns % SECOND

        @nsecs.setter
        def nsecs(self, nsecs: int) -> None:
            self.ns = self.secs * SECOND + nsecs

        def to_sec(self) -> float:
            return float(self.secs) + float(self.nsecs) / 1e9

        def to_nsec(self) -> int:
            return self.ns

        def is_zero(self) -> bool:
            return self.ns == 0

        def __bool__(self) -> bool:
            return self.ns != 0

        def __eq__(self, other: object) -> bool:
            return type(other) is type(self) and self.ns == other.ns

        def __lt__(self, other: Any) -> bool:
            return self.ns < other.ns if type(other) is type(self) else NotImplemented

        def __hash__(self) -> int:
            return hash(self.ns)

        def __str__(self) -> str:
            return str(self.ns)

        def __repr__(self) -> str:
            return f"rospy.{type(self).__name__}[{self.ns}]"

    return Moment


def _times(driven: Any, moment: Any) -> tuple[Any, Any]:
    """rospy's Time and Duration."""

    class Duration(moment):  # type: ignore[misc]
        __slots__ = ()

        def __add__(self, other: Any) -> Any:
            return type(other).of(self.ns + other.ns) if isinstance(other, moment) else NotImplemented

        def __sub__(self, other: Any) -> Any:
            return Duration.of(self.ns - other.ns) if isinstance(other, Duration) else NotImplemented

        def __mul__(self, by: Any) -> Any:
            if isinstance(by, numbers.Integral):
                return Duration.of(self.ns * int(by))
            return Duration.from_sec(self.to_sec() * float(by)) if isinstance(by, numbers.Real) else NotImplemented

        __rmul__ = __mul__

        def __truediv__(self, by: Any) -> Any:
            if isinstance(by, Duration):
                return self.to_sec() / by.to_sec()
            return Duration.from_sec(self.to_sec() / float(by)) if isinstance(by, numbers.Real) else NotImplemented

        def __floordiv__(self, by: Any) -> Any:
            if isinstance(by, Duration):
                return int(self.to_sec() // by.to_sec())
            return Duration.from_sec(self.to_sec() // float(by)) if isinstance(by, numbers.Real) else NotImplemented

        def __mod__(self, by: Any) -> Any:
            return Duration.from_sec(self.to_sec() % by.to_sec()) if isinstance(by, Duration) else NotImplemented

        def __neg__(self) -> Any:
            return Duration.of(-self.ns)

        def __abs__(self) -> Any:
            return Duration.of(abs(self.ns))

    class Time(moment):  # type: ignore[misc]
        __slots__ = ()

        def possible(self) -> None:
            if self.ns < 0:
                raise TypeError("time values must be positive")

        @staticmethod
        def now() -> Any:
            return Time.of(driven.now)

        def __add__(self, other: Any) -> Any:
            return Time.of(self.ns + other.ns) if isinstance(other, Duration) else NotImplemented

        def __sub__(self, other: Any) -> Any:
            if isinstance(other, Time):
                return Duration.of(self.ns - other.ns)
            return Time.of(self.ns - other.ns) if isinstance(other, Duration) else NotImplemented

    return Time, Duration


def _endpoints(driven: Any) -> tuple[Any, ...]:
    class Subscriber(Strict):
        _called = "rospy.Subscriber"

        def __init__(
            self, name: str, data_class: Any, callback: Any = None, callback_args: Any = None, queue_size: Any = None,
            buff_size: int = 65536, tcp_nodelay: bool = False,
        ) -> None:  # fmt: skip
            extra = () if callback_args is None else (callback_args,)
            act = driven.turn(object(), lambda message: callback(message, *extra) if callback else None)
            driven.hear(name, data_class, act)

    class Publisher(Strict):
        _called = "rospy.Publisher"

        def __init__(
            self, name: str, data_class: Any, latch: bool = False, queue_size: Any = None, tcp_nodelay: bool = False
        ) -> None:
            self.topic, self.kind = driven.speak(name, data_class), data_class
            driven.latched.update({self.topic: None} if latch else {})

        def publish(self, *given: Any, **named: Any) -> None:
            whole = len(given) == 1 and not named and type(given[0]) is self.kind
            driven.say(self.topic, given[0] if whole else self.kind(*given, **named))

    class Service(Strict):
        _called = "rospy.Service"

        def __init__(
            self, name: str, service_class: Any, handler: Any, buff_size: int = 65536, error_handler: Any = None
        ) -> None:
            response = driven.classes.get(f"{driven.services.get(service_class)}{RESPONSE}")

            def act(request: Any) -> Any:
                """What a handler may return: a response, or the values of its fields."""
                returned = handler(request)
                if returned is None or type(returned) is response:
                    return returned
                if isinstance(returned, dict):
                    return response(**returned)
                return response(*(returned if isinstance(returned, list | tuple) else (returned,)))

            self.resolved_name = driven.serve(name, service_class, act, FREE)

    class ServiceProxy(Strict):
        _called = "rospy.ServiceProxy"

        def __init__(self, name: str, service_class: Any, persistent: bool = False, headers: Any = None) -> None:
            self._send, self.resolved_name = driven.ask(name, service_class), driven.whole(name)
            self.request_class = driven.classes[f"{driven.services[service_class]}{REQUEST}"]

        def __call__(self, *given: Any, **named: Any) -> Any:
            whole = len(given) == 1 and not named and type(given[0]) is self.request_class
            request = given[0] if whole else self.request_class(*given, **named)
            return driven.wait(lambda act: self._send(request, act), "a call of a service outside of a callback")

        call = __call__

        def wait_for_service(self, timeout: Any = None) -> None:
            """Every service is there."""

        def close(self) -> None:
            """No effect."""

    class Rate(Strict):
        _called = "rospy.Rate"

        def __init__(self, hz: float, reset: bool = False) -> None:
            self.last, self.period = driven.now, int(SECOND / hz)

        def remaining(self) -> Any:
            return driven.duration.of(self.last + self.period - driven.now)

        def sleep(self) -> None:
            now, left = driven.now, self.remaining().ns
            if left > 0:
                driven.pause(left)
            self.last += self.period
            if now - self.last > 2 * self.period:  # its loop is too slow
                self.last = now

    class TimerEvent:
        def __init__(self, before: Any, now: Any) -> None:
            self.last_expected = self.last_real = before
            self.current_expected = self.current_real = now
            self.last_duration = 0.0

    class Timer(Strict):
        _called = "rospy.Timer"

        def __init__(self, period: Any, callback: Any, oneshot: bool = False, reset: bool = False) -> None:
            if type(period) is not driven.duration or period.ns <= 0:
                raise TypeError(f"a timer's period is a Duration above 0, not {period!r}")
            self.period, self.oneshot, self.before, self.over = period.ns, oneshot, None, False
            self.act = driven.turn(object(), callback)
            driven.later(driven.now + self.period, self.fire)

        def fire(self) -> None:
            if self.over:
                return
            now = driven.time.of(driven.now)
            event, self.before = TimerEvent(self.before, now), now
            if not self.oneshot:
                driven.later(driven.now + self.period, self.fire)
            self.act(event)

        def shutdown(self) -> None:
            self.over = True

    return Subscriber, Publisher, Timer, Rate, Service, ServiceProxy


def _parameters(driven: Any) -> Callable[[str], Any]:
    def find(name: str) -> Any:
        """Parameters of the declared file are the node's own: ``~limit``, and ``limit`` without a namespace."""
        at: Any = driven.params
        for part in name.lstrip("~").strip("/").split("/"):
            at = at[part] if isinstance(at, dict) and part in at else _NONE
        return at

    return find


def _getter(find: Callable[[str], Any]) -> Callable[..., Any]:
    def get_param(name: str, default: Any = _NONE) -> Any:
        found = find(name)
        if found is _NONE and default is _NONE:
            raise KeyError(name)
        return default if found is _NONE else found

    return get_param


def _takes(made: Any) -> bool:
    """Whether the class's constructor takes its parameters."""
    code = getattr(made.__init__, "__code__", None)
    defaults = getattr(made.__init__, "__defaults__", None) or ()
    return code is not None and code.co_argcount - len(defaults) > 1
