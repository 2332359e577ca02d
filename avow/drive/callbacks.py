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
import os
import sys
import threading
import traceback
import zlib
from collections.abc import Callable, Sequence
from typing import Any

from .messages import Messages
from .refusals import Finder, Refusals, Strict, called_from
from .steps import plain
from .turns import ORDERS, Turns

REQUEST, RESPONSE = "_Request", "_Response"
ACTION = ("_Goal", "_Result", "_Feedback")
"""The ends of the names of the message types of a service, and of an action."""
STATE: tuple[str, ...] = ("said", "kept", "latched", "heard", "spoken", "due", "together", "waiting", "dropped")
STATE += ("calls", "taken", "_order")
"""The attributes that loading the file may change, and each run changes."""


class Driven(Refusals, Messages, Turns):
    """The stand-in for ROS in one process."""

    def __init__(self, spec: Any, own: Sequence[str]) -> None:
        Refusals.__init__(self, spec, own)
        Messages.__init__(self, spec)
        Turns.__init__(self)
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
        self.together: list[list[str]] = []
        """Topics whose messages belong together by their stamps."""
        self.waiting: dict[str, tuple[tuple[str, Callable[[Any], None]], ...]] = {}
        """Topic of responses → the calls that are to be answered, and what is done with the responses."""
        self.dropped: tuple[int, ...] = ()
        """Responses that answer no request, by their numbers among all messages."""
        self.calls: dict[int, str] = {}
        """A response's number among all messages → the call that it answers."""
        self.services: dict[Any, str] = {}
        """Class of a service or an action → its type (``package/Type``)."""
        self.kept: dict[str, Any] = {}
        """Topic → its last message."""
        self.latched: dict[str, None] = {}
        """The topics that the class itself latches."""
        self.most: int = spec["most"]
        self.ran = self.number = self._order = 0
        self._loaded: dict[str, Any] = {}

    def begin(self, now: int) -> None:
        """A new run, from the state after the file was loaded. The list of refusals is kept."""
        self._loaded = self._loaded or {name: copy.copy(getattr(self, name)) for name in STATE}
        vars(self).update({name: copy.copy(value) for name, value in self._loaded.items()})
        self.now, self.ran, self.number = now, 0, 0

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
        """Run everything that is due up to `end`, in order of time; what waits at `end` itself may wait for more."""
        while True:
            if self.due and self.due[0][0] <= self.now:
                self.count()
                self.call(heapq.heappop(self.due)[2])
            elif end > self.now and self.next() is not None:
                self.go_on()
            elif end <= self.now:
                break
            else:
                self.take(*self.ready)
                self.now = min(end, self.due[0][0]) if self.due else end

    def count(self) -> None:
        self.ran += 1
        if self.ran > self.most:
            raise self.refuse(f"more than {self.most} callbacks")

    def call(self, act: Callable[..., Any], *given: Any, free: bool = False) -> Any:
        """What a callback of the class returns. `free`: a coroutine may wait, as it is of no callback group."""
        try:
            returned = act(*given)
        except TypeError as error:
            code = getattr(act, "__code__", None)
            if code is not None and error.__traceback__ is not None and error.__traceback__.tb_next is None:
                # the callback does not take what it is given: no line of it was reached
                place = f"({os.path.basename(code.co_filename)}, line {code.co_firstlineno})"  # noqa: PTH119
                error.args = (f"{error} {place}",)
            raise
        if hasattr(returned, "__await__"):
            return self._proceed(returned, free)
        return returned

    def _proceed(self, coroutine: Any, free: bool) -> Any:
        try:
            awaited: Any = coroutine.send(None) if self.kind == "rclpy" else None
        except StopIteration as end:
            return end.value
        if not free or not hasattr(awaited, "add_done_callback"):
            coroutine.close()
            raise self.refuse("a coroutine that waits")
        return awaited.add_done_callback(lambda _: self._proceed(coroutine, free))

    def pause(self, nanoseconds: int) -> None:
        """The running callback sleeps."""
        self.wait(lambda act: self.later(self.now + nanoseconds, lambda: act(None)), "time.sleep")

    def wait(self, begin: Callable[[Callable[[Any], None]], Any], called: str) -> Any:
        """The running callback waits: `begin` takes the function that ends this, and is given what `wait` returns."""
        turn = self.running
        if turn is None or threading.current_thread() is not turn:
            raise self.refuse(called)
        found: list[Any] = []

        def end(result: Any) -> None:
            if not found:  # it may end for several reasons
                found.append(result)
                self.wake(turn)

        begin(end)
        turn.sleep()
        return found[0]

    def hear(self, topic: Any, kind: Any, act: Callable[[Any], Any], *, late: bool = False) -> tuple[str, Any]:
        """The topic's whole name, and what is in `heard` for it. `late`: it gets the last message from before."""
        whole, name = self.whole(topic), self.type_of(kind)
        others = self.heard.get(whole, ())
        if any(other != name for other, _ in others):
            raise TypeError(f"{whole} is {others[0][0]}, and heard as {name}")
        self.heard[whole] = (*others, (name, act))
        if whole in self.kept and (late or whole in self.latched):
            self.later(self.now, lambda data=self.kept[whole]: act(self.value({"n": name}, data)))  # type: ignore[misc]
        return whole, self.heard[whole][-1]

    def speak(self, topic: Any, kind: Any) -> str:
        whole, name = self.whole(topic), self.type_of(kind)
        if self.spoken.setdefault(whole, name) != name:
            raise TypeError(f"{whole} is {self.spoken[whole]}, and published as {name}")
        return whole

    def say(self, topic: str, message: Any, call: str = "") -> None:
        """`call`: of which the message is a part."""
        if threading.current_thread() is not (self.running or threading.main_thread()):
            raise self.refuse("what is published by a thread of its own")
        if self.order == 2 and self.running:
            self.pause(0)
        data = self.data({"n": self.spoken[topic]}, message, topic)
        self.said.append([topic, self.now, data, len(self.taken), call])
        self.kept[topic] = data
        for _, act in self.heard.get(topic, ()):
            self.later(self.now, lambda act=act: act(self.value({"n": self.spoken[topic]}, data)))  # type: ignore[misc]

    def deliver(self, topic: str, data: Any) -> None:
        self.kept[topic] = data
        if not self.order:
            self.taken[self.number] = None
        for kind, act in self.heard.get(topic, ()):
            self.count()
            self.call(act, self.value({"n": kind}, data))
        if not any(turn.number == self.number for turn in self.ready):
            self.taken[self.number] = None

    def parts(self, name: Any, service: Any) -> tuple[str, str, str]:
        """A service's whole name, and the topics of its requests and responses."""
        if service not in self.services:
            raise TypeError(f"{service!r} is no service class")
        whole = self.whole(name)
        return whole, f"{whole}/{REQUEST.lower()}", f"{whole}/{RESPONSE.lower()}"

    def serve(self, name: Any, service: Any, act: Callable[[Any], Any], group: Any = None) -> str:
        """A service whose requests are answered by `act`, which returns the response."""
        whole, asked, told = self.parts(name, service)
        if asked in self.heard:
            raise TypeError(f"{whole} has two servers")
        self.spoken[told] = self.services[service] + RESPONSE
        kind = self.services[service] + REQUEST

        def answer(request: Any, call: str) -> None:
            if (response := self.call(act, request)) is None:
                raise TypeError(f"the callback of {whole} returned None: return the response")
            self.say(told, response, call)

        turn = self.turn(group, answer)
        self.heard[asked] = ((kind, lambda request: turn(request, str(self.number or len(self.taken)))),)
        return whole

    def ask(self, name: Any, service: Any) -> Callable[[Any, Callable[[Any], None]], None]:
        """The function that sends a request to a service, and what is done with the response."""
        _, asked, told = self.parts(name, service)
        self.spoken[asked] = self.services[service] + REQUEST
        self.await_on(told, self.services[service] + RESPONSE)

        def send(request: Any, act: Callable[[Any], None]) -> None:
            call = self.new_call()
            self.expect(told, call, act)
            self.say(asked, request, call)

        return send

    def expect(self, told: str, call: str, act: Callable[[Any], None]) -> None:
        self.waiting[told] = (*self.waiting.get(told, ()), (call, act))

    def new_call(self) -> str:
        self._order += 1
        return f"own {self._order}"

    def await_on(self, told: str, kind: str, *, last: bool = True) -> None:
        """A topic of answers to what is `waiting`, in the order of the requests. `last`: one for each."""

        def answered(response: Any) -> None:
            first, *rest = self.waiting.get(told) or (None,)
            if first is None:
                self.dropped = (*self.dropped, self.number)
                return
            if last:
                self.waiting[told] = tuple(rest)
            self.calls[self.number] = first[0]
            first[1](response)

        self.heard[told] = ((kind, answered),)

    # -- modules -----------------------------------------------------------------------------------------

    def install(self) -> None:
        """Install the modules of messages and services, and refuse every other module of ROS, clocks and chance."""
        self.clocks_and_chance()
        self.no_threads()
        self.classes |= {name: self.message_class(name) for name in self.types}
        packages: dict[str, dict[str, dict[str, Any]]] = {}
        for name, made in self.classes.items():
            package, _, called = name.partition("/")
            service = name.removesuffix(REQUEST)
            action = name.rpartition("_")[0]
            whole = all(f"{action}{end}" in self.classes for end in ACTION)
            part = "srv" if name.endswith((REQUEST, RESPONSE)) else "msg"
            part = "action" if whole and self.kind == "rclpy" else part
            content = packages.setdefault(package, {"msg": {}}).setdefault(part, {})
            made.__module__ = f"{package}.{part}"
            content[called if self.kind == "rclpy" else called.replace("_", "")] = made
            ends = ACTION if whole and name.endswith(ACTION[0]) else (REQUEST, RESPONSE) if service != name else ()
            base = action if ends == ACTION else service
            if ends and all(f"{base}{end}" in self.classes for end in ends):
                word = base.rpartition("/")[2] + "Action" * (ends == ACTION and self.kind == "rospy")
                content[word] = both = type(word, (), {end[1:]: self.classes[f"{base}{end}"] for end in ends})
                self.services[both] = base
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
            driven.order = zlib.crc32(case.encode()) % len(ORDERS) if asked["orders"] else 0
            driven.params = plain(spec["params"])
            wrong = on = state = ""
            try:
                node = make(made, driven.params)
                driven.order *= driven.parallel  # one thread has one order
                state = getattr(node, "_avow_state", "")
                if state and not asked["events"]:
                    node._avow_activate()  # for its topics
                for number, (topic, at, data) in enumerate(asked["events"], 1):
                    driven.until(int(at))
                    driven.number, on = number, topic
                    driven.deliver(topic, data)
                    on, driven.number = "", 0
                    driven.until(driven.now)  # messages that it sent to itself
                driven.until(int(asked["end"]) + 1)
                del node
            except Exception as error:
                wrong = f"{type(error).__name__}: {error}"[:300] + _meant(error)
                wrong += called_from(traceback.extract_tb(error.__traceback__))
            said = list(driven.said)  # without what a callback says when it is cut
            driven.cut()
            numbers = range(len(asked["events"]) + 1)
            found = {name: getattr(driven, name) for name in ("spoken", "refused", "together", "dropped")}
            found |= {"heard": {topic: kinds[0][0] for topic, kinds in driven.heard.items() if kinds}, "said": said}
            found |= {"wrong": wrong, "on": on, "after": driven.number or len(driven.taken), "state": state}
            found |= {"taken": list(driven.taken | dict.fromkeys(numbers[1:])), "order": ORDERS[driven.order]}
            return json.dumps(found | {"calls": [driven.calls.get(number, "") for number in numbers]})

        return run

    return driver
