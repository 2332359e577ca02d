"""Message definitions: the fields of a message, and their types. `.msg`, `.srv` and `.action` texts are read here.

A type is called ``package/Type``, in ROS 1 and ROS 2 alike. Source of the format: http://wiki.ros.org/msg and
https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import field

from avow.base.diagnostics import Hinted, Malformed
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean, suggest

INTEGERS: Mapping[str, tuple[int, int]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""The integer types on the wire: the least and the greatest value of each."""
FLOATS = ("float32", "float64")
SCALARS = frozenset((*INTEGERS, *FLOATS, "bool", "string", "wstring", "time", "duration"))

OTHER_NAMES = {"byte": "uint8", "char": "uint8", "float": "float32", "double": "float64", "octet": "uint8"}
"""Names of built-in types that ROS or IDL also uses."""
TIMES = {"builtin_interfaces/Time": "time", "builtin_interfaces/Duration": "duration"}
HEADER = "std_msgs/Header"


@dataclass(frozen=True, slots=True)
class Scalar:
    """A value of one of `SCALARS`."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Nested:
    """A message within a message."""

    name: str

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True, slots=True)
class Array:
    """`length` items, or any number of them."""

    item: Scalar | Nested
    length: int | None = None

    def __str__(self) -> str:
        return f"{self.item}[{'' if self.length is None else self.length}]"


Wire = Scalar | Nested | Array
"""The type of a field, as a message carries it."""


@dataclass(frozen=True, slots=True)
class Field:
    name: str
    wire: Wire
    line: int = field(default=0, compare=False)
    """Its line in the message's file."""


@dataclass(frozen=True, slots=True)
class Message:
    """A message type. `source`: where its definition was found."""

    name: str
    fields: tuple[Field, ...]
    constants: tuple[tuple[str, str, str], ...] = ()
    """(name, type, value as text)."""
    source: str = field(default="", compare=False)

    def field(self, name: str) -> Field | None:
        return next((f for f in self.fields if f.name == name), None)

    def text(self) -> str:
        """The definition as a ``.msg`` text that `parse_message` reads, without limits on lengths."""
        constants = (f"{kind} {name}={value}\n" for name, kind, value in self.constants)
        return "".join((*constants, *(f"{inner.wire} {inner.name}\n" for inner in self.fields)))


class NoField(Hinted):
    """A path that does not exist in a definition; the text says why."""


@dataclass(frozen=True, slots=True)
class Definitions:
    """The known message types, by name."""

    messages: Mapping[str, Message]

    def get(self, name: str) -> Message | None:
        """The type of that name, as ROS 1 or ROS 2 writes it, or a built-in's message (``float64``)."""
        return self.messages.get(canonical(name))

    def stamped(self, name: str) -> bool:
        """Whether the type of that name is known, and has a header."""
        message = self.get(name)
        return message is not None and message.field("header") is not None

    def missing(self, message: Message) -> tuple[str, ...]:
        """The undefined types among those that a message is made of."""
        return tuple(name for name in self.within(message) if name not in self.messages)

    def within(self, message: Message) -> tuple[str, ...]:
        """The types that a message is made of, at any depth."""
        found: dict[str, None] = {}
        stack = [message]
        while stack:
            for inner in stack.pop().fields:
                wire = inner.wire.item if isinstance(inner.wire, Array) else inner.wire
                if not isinstance(wire, Nested) or wire.name in (*found, message.name):
                    continue
                found[wire.name] = None
                if (nested := self.messages.get(wire.name)) is not None:
                    stack.append(nested)
        return tuple(found)

    def leaves(self, message: Message) -> Iterator[tuple[tuple[str, ...], Wire, Message]]:
        """The fields that may carry a value, by their paths, in the message's order: numbers, words, times and arrays.
        Headers are left out: they give time and frame, not content. Each with the message that contains it."""
        for inner in message.fields:
            wire = inner.wire
            if not isinstance(wire, Nested):
                yield (inner.name,), wire, message
            elif wire.name != HEADER and (nested := self.messages.get(wire.name)) is not None:
                for path, leaf, holder in self.leaves(nested):
                    yield (inner.name, *path), leaf, holder

    def at(self, message: Message, path: tuple[str | int, ...]) -> tuple[Wire, Message]:
        """The type of the field at a path, and the message that contains it. Raises NoField."""
        wire: Wire = Nested(message.name)
        holder = message
        for depth, step in enumerate(path):
            before = ".".join(map(str, path[:depth])) or holder.name
            if isinstance(step, int):
                if not isinstance(wire, Array):
                    raise NoField(f"{before} is no array")
                if wire.length is not None and not -wire.length <= step < wire.length:
                    raise NoField(f"{before} has {wire.length} items")
                wire = wire.item
                continue
            if not isinstance(wire, Nested) or (inner := self.messages.get(wire.name)) is None:
                raise NoField(f"{before} ({wire}) has no fields")
            holder = inner
            found = inner.field(step)
            if found is None:
                names, package = [f.name for f in inner.fields], inner.name.partition("/")[0]
                others = (m.name for m in self.messages.values() if m.name.startswith(f"{package}/") and m.field(step))
                hint = did_you_mean(step, names) or ", ".join(f"{other} has such a field" for other in others) or None
                raise NoField(f"{inner.name} has no field {step!r}; it has {', '.join(names) or 'none'}", hint)
            wire = found.wire
        return wire, holder


def canonical(name: str) -> str:
    """``package/msg/Type`` and ``package.msg.Type`` as ``package/Type``; a built-in as the message that carries it."""
    parts = name.replace(".", "/").split("/")
    if len(parts) == 1:
        return f"std_msgs/{_STANDARD_NAMES.get(parts[0], parts[0])}"
    return f"{parts[0]}/{'/'.join(p for p in parts[1:] if p not in ('msg', 'srv', 'action'))}"


_STANDARD_NAMES = {
    "bool": "Bool",
    "string": "String",
    "time": "Time",
    "duration": "Duration",
    "byte": "Byte",
    "char": "Char",
    "float32": "Float32",
    "float64": "Float64",
    **{name: name.capitalize().replace("Uint", "UInt") for name in INTEGERS},
}

STANDARD: dict[str, Message] = {
    f"std_msgs/{name}": Message(
        f"std_msgs/{name}", (Field("data", Scalar(OTHER_NAMES.get(base, base))),), source="std_msgs"
    )
    for base, name in _STANDARD_NAMES.items()
}
"""The messages that carry one built-in value, and the services and actions that are the same in every ROS distribution:
others, such as control_msgs/FollowJointTrajectory, differ."""

_FIELD = re.compile(
    r"(?P<type>[A-Za-z][A-Za-z0-9_/]*)(?:<=(?P<bound>\d+))?(?P<array>\[(?P<size>(?:<=)?\d*)\])?\s+"
    r"(?P<name>[A-Za-z][A-Za-z0-9_]*)\s*(?P<rest>.*)\Z"
)


def parse_message(text: str, name: str, source: str = "") -> Message:
    """One ``.msg`` text; `name` is ``package/Type``. Raises Malformed."""
    package = name.split("/")[0]
    fields: dict[str, Field] = {}
    constants: list[tuple[str, str, str]] = []
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.split("#")[0].strip()
        if not line:
            continue
        found = _FIELD.match(line)
        if found is None:
            raise Malformed(f"{line[:60]!r} is neither `type name` nor `type NAME=value`", number)
        scalar, rest = _scalar(found["type"], package), found["rest"]
        if isinstance(scalar, Nested) and re.fullmatch(
            "[a-z][^/]*", found["type"]
        ):  # a message's begins with a capital
            hint = suggest(found["type"], sorted((*SCALARS, *OTHER_NAMES, "Header")))
            raise Malformed(f"there is no type {found['type']}", number, hint=hint)
        if rest.startswith("="):
            if not isinstance(scalar, Scalar) or found["array"]:
                raise Malformed(f"the constant {found['name']} has no built-in type", number)
            # a string's value is the rest of the line, including what looks like a comment (ROS 1)
            value = raw.split("=", 1)[1].strip() if scalar.name == "string" else rest[1:].strip()
            if not _is_value(value, found["type"]):
                raise Malformed(f"{value[:60]!r} is no value of {found['type']}", number)
            constants.append((found["name"], scalar.name, value.strip("\"'") if scalar.name == "string" else value))
            continue
        if rest.startswith("//"):
            raise Malformed("`//` begins no comment", number, hint="a comment begins with `#`")
        if rest and (rest[0] == ";" or not line[found.end("name")].isspace()):
            text = f"{rest[:60]!r} stands after the name of the field {found['name']}"
            raise Malformed(text, number, hint="a line ends with the name, or with a default value set apart from it")
        if found["name"] in fields:
            raise Malformed(f"the field {found['name']} is listed twice", number)
        size = found["size"] or ""
        wire = Array(scalar, int(size) if size.isdigit() else None) if found["array"] else scalar
        fields[found["name"]] = Field(found["name"], wire, number)
    return Message(name, tuple(fields.values()), tuple(constants), source)


def _is_value(text: str, kind: str) -> bool:
    """Whether a built-in type has a constant's value. A byte and a char have a sign or none, by distribution."""
    try:
        match OTHER_NAMES.get(kind, kind):
            case "bool":
                return text.lower() in ("true", "false", "0", "1")
            case "float32" | "float64":
                float(text)
            case name if name in INTEGERS:
                least, greatest = INTEGERS[name] if kind == name else (-128, 255)
                return least <= int(text, 0 if re.match("[+-]?0[xob]", text.lower()) else 10) <= greatest
            case _:  # any text is a string
                pass
        return True
    except ValueError:
        return False


def _scalar(name: str, package: str) -> Scalar | Nested:
    plain = OTHER_NAMES.get(name, name)
    if plain in SCALARS:
        return Scalar(plain)
    if name == "Header":
        return Nested(HEADER)
    full = canonical(name) if "/" in name else f"{package}/{name}"
    return Scalar(TIMES[full]) if full in TIMES else Nested(full)


_PARTS = {"srv": ("Request", "Response"), "action": ("Goal", "Result", "Feedback")}
_WRAPPED = {
    "srv": {"Event": "service_msgs/ServiceEventInfo info\n{0}_Request[<=1] request\n{0}_Response[<=1] response"},
    "action": {
        "SendGoal_Request": "unique_identifier_msgs/UUID goal_id\n{0}_Goal goal",
        "SendGoal_Response": "bool accepted\nbuiltin_interfaces/Time stamp",
        "GetResult_Request": "unique_identifier_msgs/UUID goal_id",
        "GetResult_Response": "int8 status\n{0}_Result result",
        "FeedbackMessage": "unique_identifier_msgs/UUID goal_id\n{0}_Feedback feedback",
    },
}
"""The messages that ROS 2 makes of a service (REP 2012) and an action
(https://design.ros2.org/articles/actions.html)."""
_INFO = "uint8 event_type\nbuiltin_interfaces/Time stamp\nuint8[16] client_gid\nint64 sequence_number"


def definition_file(name: str) -> tuple[str, tuple[str, ...]]:
    """The file that defines a type, and the types that are its parts: ``my_msgs/srv/SetMode.srv`` for a part of that
    service's calls."""
    package, _, word = name.partition("/")
    whole, _, part = word.partition("_")
    kind = "srv" if part in _PARTS["srv"] else "action"
    if not part.startswith((*_PARTS[kind], "SendGoal_", "GetResult_")):
        return f"{package}/msg/{word}.msg", (name,)
    return f"{package}/{kind}/{whole}.{kind}", tuple(f"{package}/{whole}_{each}" for each in _PARTS[kind])


def parse_parts(text: str, name: str, kind: str, source: str = "") -> tuple[Message, ...]:
    """A ``.srv`` (``package/Type_Request``, ``…_Response``) or ``.action`` text (``…_Goal``, ``…_Result``,
    ``…_Feedback``), and the messages that ROS 2 makes of these. Raises Malformed."""
    lines = text.splitlines()
    parts = [part.split("\n")[1:] for part in re.split(r"\n[ \t]*---[ \t]*(?=\n)", "\n".join(["", *lines, ""]))]
    wanted = _PARTS[kind]
    if len(parts) != len(wanted):
        rule = re.compile(r"\s*(?!---\s*$)[-=_*—–]+\s*")  # a line that was meant to be `---`
        at = next((at for at, line in enumerate(lines, 1) if rule.fullmatch(line)), len(lines) or 1)
        message = f"a .{kind} has {len(wanted)} parts, set apart by `---`; this has {len(parts)}"
        raise Malformed(message, at, hint="write `---` on a line of its own between two parts")
    found: list[Message] = []
    before = 0
    for part, suffix in zip(parts, wanted, strict=True):
        try:
            found.append(parse_message("\n".join(part), f"{name}_{suffix}", source))
        except Malformed as wrong:
            raise Malformed(str(wrong), wrong.line + before, hint=wrong.hint) from None
        before += len(part) + 1
    made = ((f"{name}_{end}", text.format(name)) for end, text in _WRAPPED[kind].items())
    return (*found, *(parse_message(text, whole, source) for whole, text in made))


_LOOKUP = """\
string target_frame
string source_frame
time source_time
duration timeout
time target_time
string fixed_frame
bool advanced
---
geometry_msgs/TransformStamped transform
TF2Error error
---
"""
_GRIPPED = "float64 position\nfloat64 effort\nbool stalled\nbool reached_goal"
STANDARD |= {
    name: parse_message(text, name, name.partition("/")[0])
    for name, text in (
        ("control_msgs/GripperCommand", "float64 position\nfloat64 max_effort"),
        ("unique_identifier_msgs/UUID", "uint8[16] uuid"),
        ("service_msgs/ServiceEventInfo", _INFO),
    )
}
for _name, _text in (
    ("example_interfaces/AddTwoInts", "int64 a\nint64 b\n---\nint64 sum"),
    ("example_interfaces/Fibonacci", "int32 order\n---\nint32[] sequence\n---\nint32[] sequence"),
    ("tf2_msgs/LookupTransform", _LOOKUP),
    ("control_msgs/GripperCommand", f"GripperCommand command\n---\n{_GRIPPED}\n---\n{_GRIPPED}"),
    ("std_srvs/Empty", "---"),
    ("std_srvs/SetBool", "bool data\n---\nbool success\nstring message"),
    ("std_srvs/Trigger", "---\nbool success\nstring message"),
    ("lifecycle_msgs/ChangeState", "Transition transition\n---\nbool success"),
    ("action_msgs/CancelGoal", "GoalInfo goal_info\n---\nint8 return_code\nGoalInfo[] goals_canceling"),
):
    _kind = "action" if _text.count("---") == 2 else "srv"
    STANDARD |= {message.name: message for message in parse_parts(_text, _name, _kind, _name.partition("/")[0])}
