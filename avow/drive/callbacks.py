"""A callback class, driven: a node of rospy or rclpy, unmodified, in virtual time and without ROS.

`Driven` stands in for the modules that such a file imports: ROS' own (`avow.drive.rospy`, `avow.drive.rclpy`) and the
messages and services of the packages that are given. Anything in ROS that is missing here is an error that names it
(`avow.drive.refusals`). Callbacks run one at a time, in the order of their times; a timer that is due at a message's
time comes first. Time stands still while a callback runs.
"""

from __future__ import annotations

import copy
import difflib
import heapq
import json
import sys
import threading
import traceback
from collections.abc import Callable, Sequence
from typing import Any

from .messages import Messages
from .refusals import Finder, Refusals, Strict, called_from
from .steps import plain

REQUEST, RESPONSE = "_Request", "_Response"
"""The ends of the names of a service's two message types."""
STATE = ("said", "heard", "spoken", "due", "groups", "together", "waiting", "dropped")
"""The attributes that loading the file may change, and each run changes."""


class Driven(Refusals, Messages):
    """The stand-in for ROS in one process."""

    def __init__(self, spec: Any, own: Sequence[str]) -> None:
        Refusals.__init__(self, spec, own)
        Messages.__init__(self, spec)
        Strict._driven = self
        self.name: str = spec["name"]
        self.topics = frozenset(spec["topics"])
        """The contract's."""
        self.remaps: list[list[str]] = spec["remaps"]
        self.params: Any = {}
        self.now = 0
        self.said: list[list[Any]] = []
        self.heard: dict[str, tuple[tuple[str, Callable[[Any], Any]], ...]] = {}
        self.spoken: dict[str, str] = {}
        self.due: list[tuple[int, int, Callable[[], Any]]] = []
        self.groups: set[Any] = set()
        """Callback groups of callbacks (None: a node's own)."""
        self.together: list[list[str]] = []
        """Topics whose messages belong together by their stamps."""
        self.waiting: dict[str, tuple[Callable[[Any], None], ...]] = {}
        """Topic of a service's responses → what is done with the next ones."""
        self.dropped: tuple[int, ...] = ()
        """Responses that answer no request, by their numbers among all messages."""
        self.services: dict[Any, str] = {}
        """Class of a service → its type (``package/Type``)."""
        self.most: int = spec["most"]
        self.ran = self.handled = self._order = 0
        self._loaded: dict[str, Any] = {}

    def begin(self, now: int) -> None:
        """A new run, from the state after the file was loaded. The list of refusals is kept."""
        self._loaded = self._loaded or {name: copy.copy(getattr(self, name)) for name in STATE}
        vars(self).update({name: copy.copy(value) for name, value in self._loaded.items()})
        self.now, self.ran, self.handled = now, 0, 0

    # -- names, time, topics -----------------------------------------------------------------------------

    def whole(self, name: Any) -> str:
        """The whole name of a topic or a service: absolute, relative, private, remapped (http://wiki.ros.org/Names)."""
        if type(name) is not str or not name:
            raise TypeError(f"a topic's name is a text: {name!r}")
        found = self._expanded(name)
        for old, new in self.remaps:
            if self._expanded(old) == found:
                return self._expanded(new)
        return found

    def _expanded(self, name: str) -> str:
        if name.startswith("/"):
            return name
        if name.startswith("~"):
            return f"{self.name}/{name.lstrip('~/')}"
        return f"{self.name.rpartition('/')[0]}/{name}"

    def later(self, at: int, act: Callable[[], Any]) -> None:
        self._order += 1
        heapq.heappush(self.due, (at, self._order, act))

    def until(self, end: int) -> None:
        """Run everything that is due up to `end`, in order of time."""
        while self.due and self.due[0][0] <= end:
            at, _, act = heapq.heappop(self.due)
            self.now = max(self.now, at)
            self.count()
            self.call(act)
        self.now = max(self.now, end)

    def count(self) -> None:
        self.ran += 1
        if self.ran > self.most:
            raise self.refuse(f"more than {self.most} callbacks")

    def call(self, act: Callable[..., Any], *given: Any) -> Any:
        """What a callback of the class returns."""
        returned = act(*given)
        if hasattr(returned, "__await__"):
            returned.close()
            raise self.refuse("a callback that is a coroutine")
        return returned

    def hear(self, topic: Any, kind: Any, act: Callable[[Any], Any]) -> tuple[str, Any]:
        """The topic's whole name, and what is in `heard` for it."""
        whole, name = self.whole(topic), self.type_of(kind)
        others = self.heard.get(whole, ())
        if any(other != name for other, _ in others):
            raise TypeError(f"{whole} is {others[0][0]}, and heard as {name}")
        self.heard[whole] = (*others, (name, act))
        return whole, self.heard[whole][-1]

    def speak(self, topic: Any, kind: Any) -> str:
        whole, name = self.whole(topic), self.type_of(kind)
        if self.spoken.setdefault(whole, name) != name:
            raise TypeError(f"{whole} is {self.spoken[whole]}, and published as {name}")
        return whole

    def say(self, topic: str, message: Any) -> None:
        if threading.current_thread() is not threading.main_thread():
            raise self.refuse("what is published by a thread of its own")
        data = self.data({"n": self.spoken[topic]}, message, topic)
        self.said.append([topic, self.now, data, self.handled])
        for _, act in self.heard.get(topic, ()):
            self.later(self.now, lambda act=act: act(self.value({"n": self.spoken[topic]}, data)))  # type: ignore[misc]

    def deliver(self, topic: str, data: Any) -> None:
        for kind, act in self.heard.get(topic, ()):
            self.count()
            self.call(act, self.value({"n": kind}, data))

    def parts(self, name: Any, service: Any) -> tuple[str, str, str]:
        """A service's whole name, and the topics of its requests and responses."""
        if service not in self.services:
            raise TypeError(f"{service!r} is no service class")
        whole = self.whole(name)
        return whole, f"{whole}/{REQUEST.lower()}", f"{whole}/{RESPONSE.lower()}"

    def serve(self, name: Any, service: Any, act: Callable[[Any], Any]) -> str:
        """A service whose requests are answered at once: `act` returns the response."""
        whole, asked, told = self.parts(name, service)
        if asked in self.heard:
            raise TypeError(f"{whole} has two servers")
        self.spoken[told] = self.services[service] + RESPONSE
        kind = self.services[service] + REQUEST
        self.heard[asked] = ((kind, lambda request: self.say(told, self.call(act, request))),)
        return whole

    def ask(self, name: Any, service: Any) -> Callable[[Any, Callable[[Any], None]], None]:
        """The function that sends a request to a service, and what is done with the response. Responses come in the
        order of the requests."""
        _, asked, told = self.parts(name, service)
        self.spoken[asked] = self.services[service] + REQUEST

        def answered(response: Any) -> None:
            first, *rest = self.waiting.get(told) or (None,)
            self.waiting[told] = tuple(rest)
            if first is None:
                self.dropped = (*self.dropped, self.handled)
            else:
                first(response)

        def send(request: Any, act: Callable[[Any], None]) -> None:
            self.waiting[told] = (*self.waiting.get(told, ()), act)
            self.say(asked, request)

        self.heard[told] = ((self.services[service] + RESPONSE, answered),)
        return send

    # -- modules -----------------------------------------------------------------------------------------

    def install(self) -> None:
        """Install the modules of messages and services, and refuse every other module of ROS, clocks and chance."""
        self.clocks_and_chance()
        self.classes |= {name: self.message_class(name) for name in self.types}
        packages: dict[str, dict[str, dict[str, Any]]] = {}
        for name, made in self.classes.items():
            package, _, called = name.partition("/")
            service = name.removesuffix(REQUEST)
            part = "srv" if name.endswith((REQUEST, RESPONSE)) else "msg"
            content = packages.setdefault(package, {"msg": {}}).setdefault(part, {})
            made.__module__ = f"{package}.{part}"
            content[called if part == "msg" or self.kind == "rclpy" else called.replace("_", "")] = made
            if service != name and service + RESPONSE in self.classes:
                parts = {"Request": made, "Response": self.classes[service + RESPONSE]}
                content[called.removesuffix(REQUEST)] = both = type(called.removesuffix(REQUEST), (), parts)
                self.services[both] = service
        for package, inside in packages.items():
            modules = {part: self.module(f"{package}.{part}", content) for part, content in inside.items()}
            if not self.is_own(package):  # its own `__init__.py` is executed
                self.module(package, modules)
        sys.meta_path.insert(0, Finder(self, frozenset(packages)))


def _meant(error: Exception) -> str:
    """The attribute that was probably meant by a missing one."""
    made = getattr(error, "obj", None)
    known = [name for name in dir(made) if isinstance(error, AttributeError) and not name.startswith("_")]
    kind = made if isinstance(made, type) else type(made)
    near = difflib.get_close_matches(str(getattr(error, "name", "")), known, 1)
    return f": did you mean {kind.__name__}.{near[0]}?" if near else ""


def answers(driven: Driven, make: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Callable[[str], str]]:
    """The driver of a class: given the class and its specification, a function from a case to its result. `make` makes
    an object."""

    def driver(made: Any, spec: Any) -> Callable[[str], str]:
        def run(case: str) -> str:
            asked = json.loads(case)
            driven.begin(int(asked["start"]))
            driven.params = plain(spec["params"])
            wrong = on = state = ""
            try:
                node = make(made, driven.params)
                state = getattr(node, "_avow_state", "")
                if state and not asked["events"]:
                    node._avow_activate()  # for its topics
                for topic, at, data in asked["events"]:
                    driven.until(int(at))
                    driven.handled, on = driven.handled + 1, topic
                    driven.deliver(topic, data)
                    on = ""
                    driven.until(driven.now)  # messages that it sent to itself
                driven.until(int(asked["end"]))
                del node
                if threading.active_count() > 1:
                    driven.refuse("a thread of its own")
            except Exception as error:
                wrong = f"{type(error).__name__}: {error}"[:300] + _meant(error)
                wrong += called_from(traceback.extract_tb(error.__traceback__))
            return json.dumps(
                {
                    "heard": {topic: kinds[0][0] for topic, kinds in driven.heard.items() if kinds},
                    "spoken": driven.spoken,
                    "said": driven.said,
                    "refused": driven.refused,
                    "wrong": wrong,
                    "after": driven.handled,
                    "on": on,
                    "state": state,
                    "together": driven.together,
                    "dropped": driven.dropped,
                }
            )

        return run

    return driver
