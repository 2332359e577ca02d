"""A callback class, driven: a node of rospy or rclpy, unmodified, in virtual time and without ROS.

`Driven` stands in for the modules that such a file imports: ROS' own (`avow.drive.rospy`, `avow.drive.rclpy`) and the
messages of the packages that are given. Anything in ROS that is missing here is an error that names it, even if the
class catches it. Callbacks run one at a time, in the order of their times; a timer that is due at a message's time
comes first. Time stands still while a callback runs.

A message is passed as data: a whole number ``{"i": digits}``, a float ``{"f": hexadecimal}``, an array
``{"l": [...]}``, a message ``{"d": [[field, value], ...]}``; texts and truth values are their own JSON.
"""

from __future__ import annotations

import array
import datetime
import heapq
import importlib.abc
import importlib.machinery
import json
import math
import os
import random
import struct
import sys
import threading
import time
import traceback
import types
from collections.abc import Callable, Sequence
from typing import Any

FOREIGN: tuple[str, ...] = (
    "rospy",
    "rclpy",
    "roslib",
    "rosgraph",
    "rospkg",
    "actionlib",
    "tf",
    "tf2_ros",
    "tf2_py",
    "message_filters",
)
FOREIGN += (
    "dynamic_reconfigure",
    "cv_bridge",
    "genpy",
    "ros_numpy",
    "rosbag",
    "ament_index_python",
    "tf_transformations",
)
CLOCKS: tuple[str, ...] = ("time", "monotonic", "perf_counter", "process_time", "thread_time", "clock_gettime")
CLOCKS += (*(f"{name}_ns" for name in CLOCKS), "localtime", "gmtime", "ctime", "strftime", "sleep")
INTEGERS = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}


INSTEAD = {
    "Node(allow_undeclared_parameters=)": "declare_parameter for each",
    "Node(automatically_declare_parameters_from_overrides=)": "declare_parameter for each",
    "add_on_set_parameters_callback": "read the parameter in __init__; it keeps its value while the class is driven",
    "create_timer(clock=)": "create_timer without a clock, which uses the node's",
    "ReentrantCallbackGroup": "MutuallyExclusiveCallbackGroup, if the callbacks may run one at a time",
    "create_rate": "create_timer",
    "Rate": "Timer",
    ".sleep": "a timer",
}
"""What of ROS is not driven (how its name ends), and what may serve in its place."""


def _called_from(frames: Sequence[traceback.FrameSummary]) -> str:
    """The line of the class's own code at which something came about: not ours, not Python's."""
    known = tuple(os.path.realpath(os.path.dirname(file)) for file in (os.path.dirname(__file__), os.__file__))  # noqa: PTH120
    own = [frame for frame in frames if not os.path.realpath(frame.filename).startswith(known)]
    own = [frame for frame in own if not frame.filename.startswith("<")]
    return f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""  # noqa: PTH119


class NotDriven(RuntimeError):  # noqa: N818 - it says what is the matter
    """The class uses a part of ROS that is not driven here."""


class Driven:
    """The stand-in for ROS in one process."""

    def __init__(self, spec: Any) -> None:
        self.kind: str = spec["kind"]
        self.name: str = spec["name"]
        self.remaps: list[list[str]] = spec["remaps"]
        self.types: dict[str, Any] = spec["messages"]
        self.params: Any = {}
        self.now = 0
        self.refused: list[str] = []
        self.said: list[list[Any]] = []
        self.heard: dict[str, list[tuple[str, Callable[[Any], None]]]] = {}
        self.spoken: dict[str, str] = {}
        self.classes: dict[str, Any] = {}
        self.due: list[tuple[int, int, Callable[[], None]]] = []
        self.most: int = spec["most"]
        self.ran = self.handled = self._order = 0
        self._loaded: Callable[[], None] | None = None

    def begin(self, now: int) -> None:
        """A new run, from the state after the file was loaded. The list of refusals is kept."""
        if self._loaded is None:
            said, heard, spoken, due = list(self.said), dict(self.heard), dict(self.spoken), list(self.due)

            def loaded() -> None:
                self.said, self.spoken, self.due = list(said), dict(spoken), list(due)
                self.heard = {topic: list(acts) for topic, acts in heard.items()}

            self._loaded = loaded
        self._loaded()
        self.now, self.ran, self.handled = now, 0, 0

    # -- missing parts -----------------------------------------------------------------------------------

    def refuse(self, what: str) -> NotDriven:
        """The error is recorded with its line, so that it is reported even if the class catches it."""
        instead = next((f"; instead: {text}" for end, text in INSTEAD.items() if what.endswith(end)), "")
        if what.startswith(("time.", "datetime.")) and not instead:
            instead = f"; instead: {'rospy.Time.now()' if self.kind == 'rospy' else 'get_clock().now()'}"
        self.refused.append(f"{what}{_called_from(traceback.extract_stack())}{instead}")
        return NotDriven(f"{what} is not driven{instead}")

    def clocks_and_chance(self) -> None:
        """Refuses the class Python's clocks, which go on while its own time stands still, and unseeded random numbers.
        Python's own library has them."""
        library = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120

        def refusing(name: str, real: Any) -> Any:
            def read(*given: Any, **named: Any) -> Any:
                if not sys._getframe(1).f_code.co_filename.startswith((library, "<")):
                    raise self.refuse(name)
                return real(*given, **named)

            return read

        for name in CLOCKS:
            if hasattr(time, name):
                setattr(time, name, refusing(f"time.{name}", getattr(time, name)))
        for kind in (datetime.datetime, datetime.date):
            reads = [name for name in ("now", "utcnow", "today") if hasattr(kind, name)]
            content = {n: staticmethod(refusing(f"datetime.{kind.__name__}.{n}", getattr(kind, n))) for n in reads}
            setattr(datetime, kind.__name__, _Substitute(kind.__name__, (kind,), {**content, "_avow_real": kind}))
        names = vars(random)
        drawing = {name: real for name, real in names.items() if getattr(real, "__self__", None) is names["_inst"]}

        def seed(*given: Any, **named: Any) -> None:
            if any(value is not None for value in (*given, *named.values())):
                names.update(drawing)  # from its own seed it draws the same numbers in every run, on the robot too
            drawing["seed"](*given, **named)

        names.update({name: refusing(f"random.{name}", real) for name, real in drawing.items()}, seed=seed)

    def module(self, name: str, content: dict[str, Any]) -> types.ModuleType:
        made = types.ModuleType(name)
        vars(made).update({"__path__": [], **content})  # so that its submodules are searched for, and refused

        def absent(attribute: str) -> Any:
            if attribute.startswith("__"):
                raise AttributeError(attribute)
            raise self.refuse(f"{name}.{attribute}")

        vars(made)["__getattr__"] = absent
        sys.modules[name] = made
        return made

    # -- names, time, topics -----------------------------------------------------------------------------

    def whole(self, name: Any) -> str:
        """The whole name of a topic: absolute, relative, private, remapped (http://wiki.ros.org/Names)."""
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

    def later(self, at: int, act: Callable[[], None]) -> None:
        self._order += 1
        heapq.heappush(self.due, (at, self._order, act))

    def until(self, end: int) -> None:
        """Run everything that is due up to `end`, in order of time."""
        while self.due and self.due[0][0] <= end:
            at, _, act = heapq.heappop(self.due)
            self.now = max(self.now, at)
            self.count()
            act()
        self.now = max(self.now, end)

    def count(self) -> None:
        self.ran += 1
        if self.ran > self.most:
            raise self.refuse(f"more than {self.most} callbacks")

    def hear(self, topic: Any, kind: Any, act: Callable[[Any], None]) -> None:
        whole, name = self.whole(topic), self.type_of(kind)
        others = self.heard.setdefault(whole, [])
        if any(other != name for other, _ in others):
            raise TypeError(f"{whole} is {others[0][0]}, and heard as {name}")
        others.append((name, act))

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
            act(self.value({"n": kind}, data))

    # -- messages ----------------------------------------------------------------------------------------

    def type_of(self, kind: Any) -> str:
        name = next((name for name, made in self.classes.items() if made is kind), None)
        if name is None:
            raise TypeError(f"{kind!r} is no message class")
        return name

    def message_class(self, name: str) -> Any:
        """The class of the messages of a type: fields as slots, constants as attributes."""
        fields = dict(self.types[name]["fields"])
        driven = self

        def init(self: Any, *given: Any, **named: Any) -> None:
            if given and (driven.kind != "rospy" or named or len(given) != len(fields)):
                raise TypeError(
                    f"{name}: fields are given by name{', or all of them' if driven.kind == 'rospy' else ''}"
                )
            wrong = [field for field in named if field not in fields]
            if wrong:
                raise (AssertionError if driven.kind == "rclpy" else AttributeError)(
                    f"{name} has no field {wrong[0]!r}"
                )
            for field, wire in fields.items():
                setattr(self, field, named[field] if field in named else driven.fresh(wire))
            for field, value in zip(fields, given, strict=False):
                setattr(self, field, value)

        def same(self: Any, other: Any) -> bool:
            return type(other) is type(self) and all(getattr(self, f) == getattr(other, f) for f in fields)

        def shown(self: Any) -> str:
            return f"{name}({', '.join(f'{f}={getattr(self, f)!r}' for f in fields)})"

        content: dict[str, Any] = {"__slots__": tuple(fields), "__init__": init, "__eq__": same, "__repr__": shown}
        content |= {"__hash__": None, "_type": name}
        content |= {called: self._constant(kind, text) for called, kind, text in self.types[name]["constants"]}
        return type(name.partition("/")[2], (), content)

    @staticmethod
    def _constant(kind: str, text: str) -> Any:
        if kind in INTEGERS:
            return int(text, 0)
        if kind == "bool":
            return text.strip().lower() in ("true", "1")
        return float(text) if kind.startswith("float") else text

    def fresh(self, wire: Any) -> Any:
        """The default value of a field."""
        if isinstance(wire, dict):
            if "n" in wire:
                return self.classes[wire["n"]]()
            return [self.fresh(wire["a"]) for _ in range(wire["length"] or 0)]
        if wire in INTEGERS:
            return 0
        if wire in ("time", "duration"):
            return self.moment(wire, 0)
        return False if wire == "bool" else 0.0 if wire.startswith("float") else ""

    def moment(self, wire: str, nanoseconds: int) -> Any:
        """The time value of a field. Defined by the driven version of ROS."""
        raise NotImplementedError

    def nanoseconds(self, wire: str, value: Any) -> int:
        """The nanoseconds of a field's time. Raises TypeError."""
        raise NotImplementedError

    def data(self, wire: Any, value: Any, where: str) -> Any:
        """A value as it is transmitted. Raises TypeError or ValueError if ROS would reject it."""
        if isinstance(wire, dict) and "n" in wire:
            if type(value) is not self.classes[wire["n"]]:
                raise TypeError(f"{where}: {value!r} is no {wire['n']}")
            fields = self.types[wire["n"]]["fields"]
            return {"d": [[f, self.data(inner, getattr(value, f), f"{where}.{f}")] for f, inner in fields]}
        if isinstance(wire, dict):
            if not isinstance(value, list | tuple | bytes | bytearray | array.array):
                raise TypeError(f"{where}: {value!r} is no array")
            if wire["length"] is not None and len(value) != wire["length"]:
                raise ValueError(f"{where} has {wire['length']} items, not {len(value)}")
            return {"l": [self.data(wire["a"], item, f"{where}[{i}]") for i, item in enumerate(value)]}
        if wire in INTEGERS:
            sign, bits = INTEGERS[wire]
            low, high = (0, 2**bits) if sign else (-(2 ** (bits - 1)), 2 ** (bits - 1))
            if not isinstance(value, int) or not low <= value < high:
                raise ValueError(f"{where}: {value!r} is no {wire}")
            return {"i": str(int(value))}
        if wire in ("time", "duration"):
            return {"i": str(self.nanoseconds(wire, value))}
        if wire == "bool":
            if not isinstance(value, bool):
                raise TypeError(f"{where}: {value!r} is no bool")
            return value
        if wire.startswith("float"):
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise TypeError(f"{where}: {value!r} is no {wire}")
            number = float(value)
            if wire == "float32" and math.isfinite(number):
                (number,) = struct.unpack("f", struct.pack("f", number))
            return {"f": number.hex()}
        if type(value) is not str:
            raise TypeError(f"{where}: {value!r} is no {wire}")
        return value

    def value(self, wire: Any, data: Any) -> Any:
        """The value for a subscriber: a separate object."""
        if isinstance(wire, dict) and "n" in wire:
            given = dict(data["d"])
            made = self.classes[wire["n"]]()
            for field, inner in self.types[wire["n"]]["fields"]:
                setattr(made, field, self.value(inner, given[field]))
            return made
        if isinstance(wire, dict):
            return [self.value(wire["a"], item) for item in data["l"]]
        if wire in ("time", "duration"):
            return self.moment(wire, int(data["i"]))
        if wire in INTEGERS:
            return int(data["i"])
        return float.fromhex(data["f"]) if wire.startswith("float") else data

    # -- modules -----------------------------------------------------------------------------------------

    def install(self) -> None:
        """Install the modules of messages, and refuse every other module of ROS, clocks and chance."""
        self.clocks_and_chance()
        self.classes |= {name: self.message_class(name) for name in self.types}
        packages: dict[str, dict[str, Any]] = {}
        for name, made in self.classes.items():
            package, _, called = name.partition("/")
            packages.setdefault(package, {})[called] = made
            made.__module__ = f"{package}.msg"
        for package, content in packages.items():
            self.module(package, {"msg": self.module(f"{package}.msg", content)})
        sys.meta_path.insert(0, _Refusing(self, frozenset(packages)))


class _Substitute(type):
    """A class in the place of another: instances of that one are its own."""

    def __instancecheck__(cls, value: Any) -> bool:
        return type.__instancecheck__(vars(cls).get("_avow_real", cls), value)  # a subclass of it is itself


class _Refusing(importlib.abc.MetaPathFinder):
    """Refuses imports of ROS modules that have no stand-in."""

    def __init__(self, driven: Driven, packages: frozenset[str]) -> None:
        self._driven, self._packages = driven, packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        first = fullname.partition(".")[0]
        of_messages = first.endswith(("_msgs", "_interfaces", "_srvs")) or first in self._packages
        if first in FOREIGN or of_messages:
            self._driven.refuse(f"the module {fullname}")
            raise ModuleNotFoundError(f"the module {fullname} is not driven", name=fullname)
        return None


class Strict:
    """An object of ROS: its other attributes in ROS are refused by name."""

    _driven: Driven
    _called = ""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise self._driven.refuse(f"{self._called}.{name}")


class Log:
    """Ignores what is logged."""

    def __init__(self, names: Sequence[str]) -> None:
        for name in names:
            setattr(self, name, self.nothing)

    @staticmethod
    def nothing(*_given: Any, **_named: Any) -> None:
        """Log messages are not judged."""


def answers(driven: Driven, values: Any, make: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Callable[[str], str]]:
    """The driver of a class: given the class and its specification, a function from a case to its result.

    `values` is the module that decodes parameters; `make` makes an object.
    """

    def driver(made: Any, spec: Any) -> Callable[[str], str]:
        def run(case: str) -> str:
            asked = json.loads(case)
            driven.begin(int(asked["start"]))
            driven.params = values.plain(spec["params"])
            wrong = on = ""
            try:
                node = make(made, driven.params)
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
                wrong = f"{type(error).__name__}: {error}"[:300] + _called_from(
                    traceback.extract_tb(error.__traceback__)
                )
            return json.dumps(
                {
                    "heard": {topic: kinds[0][0] for topic, kinds in driven.heard.items()},
                    "spoken": driven.spoken,
                    "said": driven.said,
                    "refused": driven.refused,
                    "wrong": wrong,
                    "after": driven.handled,
                    "on": on,
                }
            )

        return run

    return driver
