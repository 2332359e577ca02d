"""What a driven class may use: stand-ins for modules of ROS. Anything else of ROS, clocks and chance is an error that
names it and its line, even if the class catches it."""

from __future__ import annotations

import _thread
import datetime
import difflib
import functools
import importlib.abc
import importlib.machinery
import os
import random
import re
import sys
import threading
import time
import traceback
import types
from collections.abc import Sequence
from typing import Any, ClassVar

from .turns import Turn

FOREIGN: tuple[str, ...] = ("rospy", "rclpy", "roslib", "rosgraph", "rospkg", "rosbag", "actionlib", "genpy")
FOREIGN += ("tf", "tf2_ros", "tf2_py", "tf_transformations", "message_filters", "dynamic_reconfigure", "ros_numpy")
FOREIGN += ("ament_index_python", "cv_bridge")
CLOCKS: tuple[str, ...] = ("time", "monotonic", "perf_counter", "process_time", "thread_time", "clock_gettime")
CLOCKS += (*(f"{name}_ns" for name in CLOCKS), "localtime", "gmtime", "ctime", "strftime", "sleep")

INSTEAD = {
    "Node(allow_undeclared_parameters=)": "declare_parameter for each",
    "Node(automatically_declare_parameters_from_overrides=)": "declare_parameter for each",
    "create_timer(clock=)": "create_timer without a clock, which uses the node's",
    "create_rate": "create_timer",
    "MultiThreadedExecutor": "one callback group, if the callbacks may run one at a time",
    "spin_until_future_complete": "call_async and add_done_callback",
    "Client.call": "call_async and add_done_callback",
    "coroutine that waits": "call_async and add_done_callback",
    "a thread of its own": "a timer",
    ".sleep": "a timer",
    "ament_index_python": "a path beside the file: pathlib.Path(__file__)",
}
"""What of ROS is not driven (how its name ends), and what may serve in its place."""
DEFINED = "its definitions under the plan's `messages`, or a distribution that has them: `ros: {distro: …}`"


def called_from(frames: Sequence[traceback.FrameSummary]) -> str:
    """The line of the class's own code at which something came about: not ours, not Python's."""
    known = tuple(os.path.realpath(os.path.dirname(file)) for file in (os.path.dirname(__file__), os.__file__))  # noqa: PTH120
    own = [frame for frame in frames if not os.path.realpath(frame.filename).startswith(known)]
    own = [frame for frame in own if not frame.filename.startswith("<")]
    return f" ({os.path.basename(own[-1].filename)}, line {own[-1].lineno})" if own else ""  # noqa: PTH119


class NotDriven(RuntimeError):  # noqa: N818 - it says what is the matter
    """The class uses a part of ROS that is not driven here."""


class Refusals:
    """The stand-ins, and what was refused."""

    def __init__(self, spec: Any, own: Sequence[str]) -> None:
        self.kind: str = spec["kind"]
        self.refused: list[str] = []
        self.own = own
        """The folders of the class's own modules."""

    def pause(self, nanoseconds: int) -> None:
        """The running callback sleeps. Refused outside of callbacks."""
        raise NotImplementedError

    def is_own(self, name: str) -> bool:
        """Whether one of the class's own folders has a module or a package of that name."""
        places = [os.path.join(folder, name) for folder in self.own]  # noqa: PTH118
        return any(os.path.isfile(f"{at}.py") or os.path.isfile(f"{at}/__init__.py") for at in places)  # noqa: PTH113

    def refuse(self, what: str, instead: str = "") -> NotDriven:
        """The error is recorded with its line, so that it is reported even if the class catches it."""
        instead = next((text for end, text in INSTEAD.items() if what.endswith(end)), instead)
        if what.startswith(("time.", "datetime.")) and not instead:
            instead = "rospy.Time.now()" if self.kind == "rospy" else "get_clock().now()"
        instead = f"; instead: {instead}" if instead else ""
        self.refused.append(f"{what}{called_from(traceback.extract_stack())}{instead}")
        return NotDriven(f"{what} is not driven{instead}")

    def clocks_and_chance(self) -> None:
        """Refuses the class Python's clocks, which go on while its own time stands still, and unseeded random numbers.
        Python's own library has them."""
        library = os.path.dirname(os.__file__) + os.sep  # noqa: PTH120

        def refusing(name: str, real: Any) -> Any:
            def read(*given: Any, **named: Any) -> Any:
                if not sys._getframe(1).f_code.co_filename.startswith((library, "<")):
                    if name == "time.sleep":
                        return self.pause(int(given[0] * 10**9))
                    raise self.refuse(name, "random.Random(0)" if name.startswith("random.") else "")
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

    def no_threads(self) -> None:
        """A thread of the class would change it beside its callbacks, unseen if it ends soon."""
        for module in (_thread, threading):
            for name in [name for name in vars(module) if re.match("_?start_", name)]:
                setattr(module, name, functools.partial(self._begin, getattr(module, name)))

    def _begin(self, begin: Any, act: Any, *given: Any, **named: Any) -> Any:
        if not isinstance(getattr(act, "__self__", None), Turn):
            raise self.refuse("a thread of its own")
        return begin(act, *given, **named)

    def module(self, name: str, content: dict[str, Any]) -> types.ModuleType:
        made = types.ModuleType(name)
        vars(made).update({"__path__": [], **content})  # so that its submodules are searched for, and refused

        def absent(attribute: str) -> Any:
            if attribute.startswith("__"):
                raise AttributeError(attribute)
            raise self.refuse(f"{name}.{attribute}", *difflib.get_close_matches(attribute, content, 1, 0.65))

        vars(made)["__getattr__"] = absent
        sys.modules[name] = made
        return made


class _Substitute(type):
    """A class in the place of another: instances of that one are its own."""

    def __instancecheck__(cls, value: Any) -> bool:
        return type.__instancecheck__(vars(cls).get("_avow_real", cls), value)  # a subclass of it is itself


class Finder(importlib.abc.MetaPathFinder):
    """Refuses modules of ROS that have no stand-in."""

    def __init__(self, refusals: Refusals, packages: frozenset[str]) -> None:
        self._refusals, self._packages = refusals, packages

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: types.ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        first = fullname.partition(".")[0]
        of_messages = first.endswith(("_msgs", "_interfaces", "_srvs")) or first in self._packages
        if first in FOREIGN or (of_messages and not self._refusals.is_own(first)):
            instead = "" if first in FOREIGN else DEFINED
            raise ModuleNotFoundError(str(self._refusals.refuse(f"the module {fullname}", instead)), name=fullname)
        return None


class Strict:
    """An object of ROS: its other attributes in ROS are refused by name."""

    _driven: ClassVar[Any]
    """The only one in the process."""
    _called = ""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        raise self._driven.refuse(f"{self._called}.{name}")


def nothing(*_given: Any, **_named: Any) -> None:
    """What is logged is not judged."""
