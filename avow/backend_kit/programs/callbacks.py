"""A node's callback class, run without ROS: messages in, publications out, in virtual time."""

from __future__ import annotations

import contextlib
import json
import math
import random
import re
import struct
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from avow.backend_kit.programs.cpython import Replies, Subject, ask
from avow.backend_kit.programs.samples import Pool, leaves, numbers_of, pool, words_of, written
from avow.base.diagnostics import Diagnostic, Rejected, Span, refuse
from avow.base.files import inside, read_text
from avow.base.process import ToolMissing
from avow.base.suggestions import did_you_mean, nearest, suggest
from avow.base.tuning.running import DRIVEN_CALLBACKS, DRIVEN_MEGABYTES, DRIVEN_SECONDS, LONGEST_GAP, NUMBERS_AGAIN
from avow.isolation.observed import Seen
from avow.language.contract import Node, Topic
from avow.language.terms import Role
from avow.ros.bags import fields_of
from avow.ros.calls import CALL, is_part
from avow.ros.definitions import HEADER, INTEGERS, Array, Definitions, Field, Message, Nested, Scalar, Wire, canonical
from avow.ros.sources import definitions, require
from avow.system.driven import parsed, source_faults
from avow.system.node_plan import parameter_place, parameters
from avow.system.plan import Driving, Source, System
from avow.system.topics import whole_name

SECOND = 10**9
STEP = SECOND // 10
"""The time between most generated messages."""

LARGEST = {"float32": float.fromhex("0x1.fffffep+127"), "float64": sys.float_info.max}

_TIMES = ("builtin_interfaces/Time", "builtin_interfaces/Duration")
_HEADER = Message(HEADER, (Field("stamp", Scalar("time")), Field("frame_id", Scalar("string"))))
_ROS1_HEADER = Message(HEADER, (Field("seq", Scalar("uint32")), *_HEADER.fields))


@dataclass(frozen=True, slots=True)
class Event:
    """One message: its topic's whole name, nanoseconds, and its content as `avow.drive.callbacks` codes it."""

    topic: str
    at: int
    data: Any
    after: int = 0
    """How many messages had been delivered: for a message with itself, in `Run.beside`."""
    call: str = ""
    """The call of which it is a part, if it is known."""


@dataclass(frozen=True, slots=True)
class Run:
    """The result of a run. `wrong`: the exception of the class, after which message (from 1; 0: before any), and on
    which topic it was handled (none: a timer, or what the class published itself)."""

    said: tuple[Event, ...]
    heard: Mapping[str, str]
    spoken: Mapping[str, str]
    wrong: str = ""
    after: int = 0
    on: str = ""
    state: str = ""
    """Of a lifecycle node, before its first message."""
    together: Sequence[Sequence[str]] = ()
    """Topics whose messages it takes together, by their stamps."""
    dropped: Sequence[int] = ()
    """The messages that did not reach it, by their numbers: responses to no request."""
    calls: Sequence[str] = ()
    """For each message the call of its own that it answers."""
    taken: Sequence[int] = ()
    """The messages by their numbers, in the order in which the node took them."""
    order: str = ""
    """In which order the callbacks of one instant ran; none: as they came."""

    @property
    def raised(self) -> tuple[str, ...]:
        """The exception, with its message, topic, file and line; nothing if there is none."""
        place = f" at message {self.after} on {self.on}" if self.on else f" after message {self.after}"
        return (f"raised{place if self.after else ''}: {self.wrong}",) if self.wrong else ()

    def beside(self, heard: Sequence[Event]) -> Iterator[Event]:
        """Messages received and published, in order of occurrence."""
        for position, number in enumerate((0, *self.taken)):
            if number and number not in self.dropped:
                yield replace(heard[number - 1], after=number, call=self.calls[number])
            yield from (event for event in self.said if event.after == position)


Given = tuple[tuple[Event, ...], int, int]
"""The input of a run: messages, begin and end, in nanoseconds."""


@dataclass(frozen=True, slots=True)
class Driver:
    """A declared callback class, ready to be run."""

    system: System
    node: Node
    source: Source
    subject: Subject
    known: Definitions
    topics: Run
    """Its subscriptions and publications before the first message."""
    text: str
    """Its code and that of the modules that it imports from the system's folder, for their constants only."""

    @property
    def carried(self) -> frozenset[str]:
        """The topics that it subscribes to or publishes."""
        return frozenset((*self.topics.heard, *self.topics.spoken))

    @property
    def inputs(self) -> frozenset[str]:
        """The topics on which other nodes publish to it: it receives its own publications without help."""
        return frozenset(self.topics.heard) - frozenset(self.topics.spoken)

    def run(self, events: Iterable[Event], start: int, end: int, *, orders: bool = False) -> Run:
        """Runs the class twice, in separate processes. Raises Rejected if the class uses a part of ROS that is not
        supported, if the two runs differ, or if the result depends on inputs that no recording has."""
        given = [(tuple(events), start, end)]
        first, second = (_runs(self.source, self.subject, given, orders=orders)[0] for _ in range(2))
        if first != second:
            raise _refused(self.source, f"{self.source.class_name} publishes otherwise when it is run again")
        return first[0]

    def runs(self, given: Sequence[Given]) -> tuple[tuple[Run, ...], Replies]:
        """Runs with a new object each, in one process, each in one of the possible orders of its callbacks; also
        returns its isolation. Raises Rejected likewise."""
        return _runs(self.source, self.subject, given, orders=True)

    def fits(self) -> Iterator[Diagnostic]:
        """Topics of the contract that the class does not use, or uses with other message types."""
        wanted: dict[tuple[str, Role], list[Topic]] = {}
        for topic in (topic for topic in self.node.topics if topic.port):
            name = whole_name(self.system.plan.ros.names, self.node, topic)
            wanted.setdefault((name, topic.port.role), []).append(topic)  # type: ignore[union-attr]
        for (name, role), alike in wanted.items():
            verb, own = (
                ("subscribes to", self.topics.heard) if role is Role.INPUT else ("publishes", self.topics.spoken)
            )
            found, kind = {**own, **self.topics.spoken}.get(name), canonical(alike[0].ros_type)
            text, hint = f"{verb} {name} as {found}; the contract has {kind}", "correct the type in one of them"
            if found is None:
                ports = ", ".join(topic.port.name for topic in alike if topic.port)
                near = nearest(name, own.keys() - {known for known, _ in wanted}) or sorted(own)
                text = f"never {verb} {name}, which carries {ports}: it {verb} {', '.join(near) or 'nothing'}"
                remap = f"ros: {{nodes: {{{self.node.name}: {{remap: {{{(*near, '…')[0]}: {name}}}}}}}}}"
                hint = f"correct the topic in the class or in the contract; if it is remapped on the robot, {remap}"
            if found != kind:
                yield Diagnostic("DRIVE102", f"{self.source.class_name} {text}", alike[0].span, hint=hint)

    def coded(self, topic: str, event: Mapping[str, Any], where: str) -> Any:
        """A recorded event's message as data; a missing field has the default of a new message. Raises Rejected."""
        kind = self.topics.heard.get(topic) or self.topics.spoken[topic]
        try:
            return code(Nested(kind), fields_of(event), self.known)
        except (ValueError, TypeError, KeyError, OverflowError) as error:
            raise unusable(f"{where}: {topic} carries {kind}: {error}") from None

    def fields(self, event: Event) -> dict[str, Any]:
        """A message's fields as a recording has them. A service answers a request before the next message."""
        kind = self.topics.heard.get(event.topic) or self.topics.spoken[event.topic]
        found: dict[str, Any] = shown(Nested(kind), event.data, self.known, self.source.kind)
        return found | ({CALL: event.call or str(event.after)} if is_part(event.topic) else {})

    def generated(self, messages: int, seed: int | str) -> Iterator[Event]:
        """So many messages on its subscriptions, made from the numbers and words of contract, program and
        parameters."""
        chance = random.Random(seed)
        topics = sorted(self.inputs)
        numbers = numbers_of(clause.formula for clause in (*self.node.assumptions, *self.node.guarantees))
        numbers = numbers | set(written(self.text)) | set(leaves(self.subject.params))
        words = sorted({w for port in (*self.node.inputs, *self.node.outputs) for w in words_of(port.sort)})
        drawing = _Drawing(pool(numbers), words, self.known, chance, _FRAMES.findall(self.text))
        at = 0  # nanoseconds
        placed = {whole_name(self.system.plan.ros.names, self.node, t): t.frame for t in self.node.topics}
        alike: dict[str, Sequence[str]] = {topic: group for group in self.topics.together for topic in group}
        due: list[str] = []
        for _ in range(messages if topics else 0):
            if not due:  # else at the time of the message before
                due = [chance.choice(topics)]
                others = [topic for topic in alike.get(due[0], ()) if topic in self.inputs and topic != due[0]]
                due += others if others and chance.random() > NUMBERS_AGAIN else ()
                at += drawing.gap()
            kind = self.topics.heard[topic := due.pop()]
            drawing.frame = placed.get(topic, "")
            made = drawing.message(Nested(kind), at)
            before = drawing.made.setdefault(kind, [])
            made = _with_floats(made, chance.choice(before)) if before and chance.random() < NUMBERS_AGAIN else made
            before.append(made)
            yield Event(topic, at, made)


def driver(system: System, name: str) -> Driver:
    """The class that the plan declares as the node. Raises Rejected."""
    plan, names = system.plan, [each.name for each in system.contract.nodes]
    if name not in names:
        raise Rejected(Diagnostic("DRIVE100", f"{system.name} has no node {name!r}", hint=suggest(name, names)))
    node = system.contract.node(name)
    source = next((entry.source for entry in plan.nodes if entry.node == node.name), None)
    if source is not None and source.cpp:
        text = f"the program of {node.name} is C++, which is not driven"
        raise Rejected(Diagnostic("DRIVE100", text, source.place.at("source"), hint="the method `fuzz` tests it"))
    if source is None or not source.python:
        hint = "source: {python: src/node.py, class: Node, kind: rclpy}, or kind: rospy"
        raise Rejected(Diagnostic("DRIVE100", f"the plan names no program for the node {node.name}", hint=hint))
    if source.kind is Driving.STEP:
        text = f"kind is step, by default: {source.class_name} is driven by its method step, and has no topics"
        raise Rejected(Diagnostic("DRIVE100", text, source.place.at("source"), hint="add `kind: rclpy`, or rospy"))
    root = plan.root.resolve()
    path = inside(root, source.python)
    assert path is not None  # or the plan would not load
    with contextlib.suppress(SyntaxError, ValueError, RecursionError):
        refuse(source_faults(source, parsed(path)))
    placed = plan.ros.names.placed(node.name)
    params, faults = parameters(root, source, placed.name)
    refuse(faults)
    known = require(definitions(plan.messages, plan.ros.distro))
    known = Definitions({HEADER: (_ROS1_HEADER if source.kind is Driving.ROSPY else _HEADER), **known.messages})
    folders = [folder for folder in path.parents if folder.is_relative_to(root)]
    package = next((folder for folder in folders if (folder / "package.xml").is_file()), path.parent)
    ros = {
        "kind": source.kind.value,
        "run": source.run,
        "name": placed.name,
        "remaps": [list(pair) for pair in placed.remaps],
        "most": DRIVEN_CALLBACKS,
        "topics": [whole_name(plan.ros.names, node, topic) for topic in node.topics],
        "messages": _messages(node, package, known, source.kind, plan.ros.distro),
    }
    subject = Subject(root, path, source.class_name, params, {}, (), ros)
    ((topics,), how) = _runs(source, subject, [((), 0, 0)], quiet=True)
    read = {path, *(Path(seen.path) for seen in how.observed if seen.kind is Seen.READ and seen.path.endswith(".py"))}
    text = "".join(read_text(file, "utf-8", errors="replace") for file in sorted(read) if file.is_relative_to(root))
    found = Driver(system, node, source, subject, known, topics, text)
    if found.topics.wrong:
        text = f"{source.class_name} cannot be constructed: {found.topics.wrong}"
        if key := re.search(r"the parameter (\S+) is ", found.topics.wrong):
            raise Rejected(Diagnostic("DRIVE103", text, parameter_place(root, source, placed.name, key[1])))
        raise _refused(source, text)
    if wrong := tuple(found.fits()):
        raise Rejected(*wrong)
    return found


def _runs(
    source: Source, subject: Subject, given: Sequence[Given], *, quiet: bool = False, orders: bool = False
) -> tuple[tuple[Run, ...], Replies]:
    """Runs in a separate process. `quiet`: only subscriptions and publications."""
    asked = [
        json.dumps({"start": start, "end": end, "orders": orders, "events": [[e.topic, e.at, e.data] for e in events]})
        for events, start, end in given
    ]
    try:
        answer = ask(subject, asked, seconds=DRIVEN_SECONDS, megabytes=DRIVEN_MEGABYTES)
    except ToolMissing as missing:
        raise _refused(source, str(missing)) from None
    if answer.silent:
        raise _refused(source, answer.fault, Silent)
    if answer.fault or len(answer.replies) != len(asked):
        raise _refused(source, answer.fault or "there is no answer")
    refused = dict.fromkeys(why for reply in answer.replies for why in reply.pop("refused"))
    if not quiet:
        refused |= dict.fromkeys(seen.path for seen in answer.observed if seen.kind is Seen.OUTSIDE)
    if refused:
        raise _refused(source, f"{source.class_name} asks for what is not driven: {', '.join(refused)}")
    return tuple(_made(reply) for reply in answer.replies), answer


def _made(reply: Mapping[str, Any]) -> Run:
    return Run(**{**reply, "said": tuple(Event(*each) for each in reply["said"])})


class Silent(Rejected):
    """There is no answer for a reason that is no fault of the class: a slow machine, or a kill from outside."""


def _refused(source: Source, text: str, kind: type[Rejected] = Rejected) -> Rejected:
    """At the line that the text names, if that is of the class's own file; otherwise at the plan's entry."""
    span, found = source.place.at("source"), re.search(r" \((\S+), line (\d+)\)", text)
    if (file := Path(span.file if span else "").parent / source.python).is_file() and found and found[1] == file.name:
        span = Span(str(file), int(found[2]), 1, int(found[2]), 2)
    return kind(Diagnostic("DRIVE103", text, span))


def unusable(text: str) -> Rejected:
    """A recording that this class cannot be given."""
    return Rejected(Diagnostic("DRIVE104", text))


def _messages(node: Node, package: Path, known: Definitions, kind: Driving, distro: str | None) -> dict[str, Any]:
    """The message types of the contract's topics and of the packages that the files of the node's package (or the
    source's folder) name, with their fields."""
    files = sorted(found for depth in ("*.py", "*/*.py", "*/*/*.py") for found in package.glob(depth))
    text = "".join(read_text(path, "utf-8", errors="replace") for path in files)
    wanted = [canonical(topic.ros_type) for topic in node.topics]
    wanted += [f"{name.removesuffix('_Request')}_Response" for name in wanted if name.endswith("_Request")]
    wanted += [name for name in known.messages if name.partition("/")[0] in text]
    found: dict[str, Any] = {}
    if kind is Driving.RCLPY:
        found |= {name: {"fields": [["sec", "int32"], ["nanosec", "uint32"]], "constants": []} for name in _TIMES}
    while wanted:
        name = wanted.pop()
        message = known.get(name)
        if name in found or name in _TIMES:
            continue
        if message is None:
            hint = f"messages: [msg]  names folders: msg/{name.replace('/', '/msg/')}.msg defines it"
            hint = f"{did_you_mean(name, known.messages) or ''} {hint}".strip()
            if distro is None:
                hint += f"; ros: {{distro: {'noetic' if kind is Driving.ROSPY else 'humble'}}}  names a distribution's"
            text = f"nothing defines {name}{f', and {distro} has no such message' if distro else ''}"
            raise Rejected(Diagnostic("DRIVE101", text, hint=hint))
        if any(inner.name in ("topic", "time") for inner in message.fields):
            text = f"{name} has a field that is called as a part of every recorded event: topic or time"
            raise Rejected(Diagnostic("DRIVE101", text))
        fields = [[inner.name, _wire(inner.wire)] for inner in message.fields]
        found[name] = {"fields": fields, "constants": [list(constant) for constant in message.constants]}
        held = (inner.wire.item if isinstance(inner.wire, Array) else inner.wire for inner in message.fields)
        wanted += [wire.name for wire in held if isinstance(wire, Nested)]
    return found


def _wire(wire: Wire) -> Any:
    match wire:
        case Scalar(name=name):
            return name
        case Nested(name=name):
            return {"n": name}
        case Array(item=item, length=length):
            return {"a": _wire(item), "length": length}


def code(wire: Wire, value: Any, known: Definitions) -> Any:
    """A JSON value in the wire's form. Raises ValueError, TypeError, KeyError, OverflowError."""
    match wire:
        case Nested(name=name):
            message = known.get(name)
            if message is None or not isinstance(value, dict):
                raise ValueError(f"{value!r} is no {name}")
            unknown = set(value) - {inner.name for inner in message.fields}
            if unknown:
                raise ValueError(f"{name} has no field {min(unknown)!r}")
            return {
                "d": [
                    [f.name, code(f.wire, value[f.name], known) if f.name in value else fresh(f.wire, known)]
                    for f in message.fields
                ]
            }
        case Array(item=item, length=length):
            if not isinstance(value, list) or (length is not None and len(value) != length):
                raise ValueError(f"{value!r} is no {wire}")
            return {"l": [code(item, each, known) for each in value]}
        case Scalar(name="time" | "duration"):
            pairs = (("secs", "nsecs"), ("sec", "nanosec"))
            found = next((pair for pair in pairs if isinstance(value, dict) and set(value) == set(pair)), None)
            if found is None:
                raise ValueError(f"{value!r} is no time of seconds and nanoseconds")
            return {"i": str(int(value[found[0]]) * SECOND + int(value[found[1]]))}
        case Scalar(name="bool" | "string" | "wstring" as name):
            if not isinstance(value, bool if name == "bool" else str):
                raise ValueError(f"{value!r} is no {'bool' if name == 'bool' else 'text'}")
            return value
        case Scalar(name=name) if name in INTEGERS:
            low, high = INTEGERS[name]
            if isinstance(value, bool) or not isinstance(value, int) or not low <= value <= high:
                raise ValueError(f"{value!r} is no {name}")
            return {"i": str(value)}
        case Scalar(name=name):
            # a decimal in a trace is kept as its digits, in bytes
            if isinstance(value, bool) or not isinstance(value, int | float | bytes):
                raise ValueError(f"{value!r} is no {name}")
            return {"f": _as_float(float(value), name).hex()}


def _as_float(number: float, name: str) -> float:
    return float(struct.unpack("f", struct.pack("f", number))[0]) if name == "float32" else number


def fresh(wire: Wire, known: Definitions) -> Any:
    """The default of a field in a new message."""
    if isinstance(wire, Array):
        return {"l": [fresh(wire.item, known)] * (wire.length or 0)}
    return code(wire, {} if isinstance(wire, Nested) else _ZERO.get(wire.name, 0), known)


_FRAMES = re.compile(r"_transform\(\s*[\"']([\w/]+)[\"'],\s*[\"']([\w/]+)[\"']")
_ZERO: dict[str, Any] = {"bool": False, "string": "", "wstring": ""}
_ZERO |= {name: {"sec": 0, "nanosec": 0} for name in ("time", "duration")}


def shown(wire: Wire, data: Any, known: Definitions, kind: Driving) -> Any:
    """The JSON value in a recording."""
    match wire:
        case Nested(name=name):
            message = known.get(name)
            assert message is not None
            given = dict(data["d"])
            return {inner.name: shown(inner.wire, given[inner.name], known, kind) for inner in message.fields}
        case Array(item=item):
            return [shown(item, each, known, kind) for each in data["l"]]
        case Scalar(name="time" | "duration"):
            names = ("secs", "nsecs") if kind is Driving.ROSPY else ("sec", "nanosec")
            return dict(zip(names, divmod(int(data["i"]), SECOND), strict=True))
        case Scalar(name=name) if name in INTEGERS:
            return int(data["i"])
        case Scalar(name=name):
            return float.fromhex(data["f"]) if name.startswith("float") else data


def _with_floats(made: Any, before: Any) -> Any:
    """A message with the floats of an earlier one of its type: a robot arrives where it was sent."""
    match made, before:
        case {"d": fields}, {"d": others}:
            pairs = zip(fields, others, strict=True)
            return {"d": [[name, _with_floats(mine, old)] for (name, mine), (_, old) in pairs]}
        case {"f": _}, {"f": _}:
            return before
        case _:  # not a float
            return made


@dataclass(slots=True)
class _Drawing:
    """Draws messages, at intervals taken from the numbers, in seconds."""

    numbers: Pool
    words: list[str]
    known: Definitions
    chance: random.Random
    frames: Sequence[tuple[str, str]]
    """Pairs of frames whose transforms the program looks up."""
    frame: str = ""  # of the contract's topic, if it names one
    last: float = 0.0
    made: dict[str, list[Any]] = field(default_factory=dict)
    """Type → the messages so far."""

    def gap(self) -> int:
        if self.chance.random() < 0.7:
            return STEP
        near = [n for n in self.numbers.steps if 0 <= n <= LONGEST_GAP]
        return max(0, round(self.chance.choice(near) * SECOND) + self.chance.choice((-1, 0, 0, 1)))

    def message(self, wire: Wire, at: int) -> Any:
        """A message whose header has its time of arrival."""
        match wire:
            case Nested(name="geometry_msgs/TransformStamped") if self.frames:
                (parent, child), half = self.chance.choice(self.frames), self.chance.choice(self.numbers.floats)
                unit = {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}
                made: dict[str, Any] = shown(wire, fresh(wire, self.known), self.known, Driving.RCLPY)
                made["header"] |= {"stamp": dict(zip(("sec", "nanosec"), divmod(at, SECOND), strict=True))}
                made["header"]["frame_id"], made["child_frame_id"] = parent, child
                made["transform"]["rotation"] = unit
                made["transform"]["translation"] = {axis: self.number() for axis in "xyz"}
                return code(wire, made, self.known)
            case Nested(name=name):
                message = self.known.get(name)
                assert message is not None
                given = {"stamp": {"i": str(at)}, "frame_id": self.frame} if name == HEADER else {}
                return {"d": [[f.name, given.get(f.name) or self.message(f.wire, at)] for f in message.fields]}
            case Array(item=item, length=length):
                number = self.chance.choice(self.numbers.lengths) if length is None else length
                return {"l": [self.message(item, at) for _ in range(number)]}
            case Scalar(name="time" | "duration"):
                return {"i": str(self.chance.randrange(100) * STEP)}
            case Scalar(name="bool"):
                return self.chance.random() < 0.5
            case Scalar(name="string" | "wstring"):
                known = self.words and self.chance.random() < 0.9
                return self.chance.choice(self.words) if known else self.chance.choice(("", "other"))
            case Scalar(name=name) if name in INTEGERS:
                low, high = INTEGERS[name]
                whole = [n for n in (*self.numbers.ints, low, high, 0) if low <= n <= high]
                return {"i": str(self.chance.choice(whole))}
            case Scalar(name=name):
                drawn = self.number()
                return {"f": (_as_float(drawn, name) if abs(drawn) <= LARGEST[name] else 0.0).hex()}

    def number(self) -> float:
        """One of the numbers, or one slightly different, or one at such a distance from the last."""
        turn = self.chance.random()
        found = self.chance.choice(self.numbers.floats)
        if turn < 0.3:
            found = self.last + self.chance.choice((-1, 1)) * self.chance.choice(self.numbers.steps)
            found = self.chance.choice((found, math.nextafter(found, -math.inf), math.nextafter(found, math.inf)))
        elif turn < 0.5:
            found = self.chance.choice(self.numbers.steps)
        elif turn < 0.65:
            found += self.chance.uniform(-1.0, 1.0)
        self.last = found if math.isfinite(found) else 0.0
        return self.last
