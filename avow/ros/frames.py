"""Messages in the frame that the contract names: geometry is transformed through the recorded tree of /tf and
/tf_static at the message's stamp, as tf2_geometry_msgs does it. What cannot be transformed is left out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from avow.drive.transforms import SECOND, NoTransform, Numbers, Stored, Transforms, added, rotated, times
from avow.ros.bags import WHOLE, Event, fields_of
from avow.ros.definitions import FLOATS, HEADER, Array, Definitions, Message, Nested, Scalar, Wire

TREE = {"tf": False, "tf_static": True}
"""The topics of transforms, without their leading slash, and whether their transforms hold at all times."""

_UNMOVED = ("Twist", "Accel", "Wrench", "Inertia", "Pose2D")
"""Geometry of geometry_msgs that is made of moved parts and is not transformed by them."""


class Unplaced(Exception):  # noqa: N818 - it names what was found
    """A message that cannot be put into the contract's frame, and why."""


class Tree:
    """The transforms of one run."""

    def __init__(self) -> None:
        self.transforms = Transforms()
        self.whole = False
        """Whether all transforms of the run were heard before its first message is judged."""

    def fill(self, whole: Tree) -> None:
        """Take over all transforms of the run."""
        self.transforms, self.whole = whole.transforms, True

    def hear(self, topic: str, event: Event) -> None:
        """Keep the transforms of a message of a topic in `TREE`; what is no transform is ignored."""
        listed = fields_of(event).get("transforms")
        for each in listed if isinstance(listed, list) else ():
            try:
                place, header = each["transform"], each["header"]
                move = tuple(_number(place["translation"][axis]) for axis in "xyz")
                turn = tuple(_number(place["rotation"][axis]) for axis in "xyzw")
                one = Stored(_stamp(header), str(header["frame_id"]), move, turn)
                self.transforms.add(str(each["child_frame_id"]), one, static=TREE[topic])
            except (KeyError, TypeError, ValueError):
                continue

    def placed(self, event: Event, kind: str, known: Definitions, frame: str) -> Event:
        """The event with its geometry in a frame. A message without a header is in that frame already. Raises
        Unplaced."""
        message, fields = known.get(kind), fields_of(event)
        inner = fields.get("data")
        fields = inner if isinstance(inner, dict) and "header" not in fields else fields
        if "header" in fields and _frame(fields) != frame and message is None:
            raise Unplaced(f"it is in the frame {_frame(fields) or '(none)'}, and nothing defines {kind or 'its type'}")
        if message is None or not _has_header(message, known):
            return event
        moved = self._of_message(fields, message, known, frame, None)
        return {**event, **dict.fromkeys(fields, None), **moved, **({WHOLE: moved} if WHOLE in event else {})}

    def _moved(self, value: Any, wire: Wire, known: Definitions, frame: str, by: tuple[Numbers, Numbers] | None) -> Any:
        """A value in another frame, by this transform; None: it is in that frame."""
        match wire:
            case Nested(name=name) if isinstance(value, Mapping):
                message = known.get(name)
                if message is None:
                    return value if by is None else None
                if by is None and not _has_header(message, known):
                    return value
                return self._of_message(value, message, known, frame, by)
            case Array(item=item) if isinstance(value, list):
                return [self._moved(each, item, known, frame, by) for each in value]
            case Scalar(name=name) if name in FLOATS and by is not None:
                return None  # a number that no transform is known for
            case _:  # no geometry
                return value

    def _of_message(
        self, value: Mapping[str, Any], message: Message, known: Definitions, frame: str,
        by: tuple[Numbers, Numbers] | None,
    ) -> Any:  # fmt: skip
        if any(field.wire == Nested(HEADER) for field in message.fields):
            by = self._to(frame, value)
        package, _, word = message.name.partition("/")
        if by is not None and package == "geometry_msgs":
            if word in _UNMOVED:
                return None
            if word in ("Point", "Point32", "Vector3"):
                turned = rotated(by[1], tuple(_number(value[axis]) for axis in "xyz"))
                return dict(zip("xyz", turned if word == "Vector3" else added(turned, by[0]), strict=True))
            if word == "Quaternion":
                return dict(zip("xyzw", times(by[1], tuple(_number(value[axis]) for axis in "xyzw")), strict=True))
        made = {f.name: self._moved(value.get(f.name), f.wire, known, frame, by) for f in message.fields}
        return {name: part for name, part in made.items() if part is not None}

    def _to(self, frame: str, value: Mapping[str, Any]) -> tuple[Numbers, Numbers] | None:
        """The transform from the frame of a message's header; None if it is the same. Raises Unplaced."""
        there = _frame(value)
        if there == frame:
            return None
        if not there:
            raise Unplaced("its header names no frame")
        try:
            return self.transforms.find(frame, there, _stamp(value["header"]))
        except NoTransform as error:
            raise Unplaced(f"it is in the frame {there}, and no transform to {frame} is known: {error}") from None
        except (KeyError, TypeError, ValueError):
            raise Unplaced(f"it is in the frame {there}, and its header has no stamp") from None


def _has_header(message: Message, known: Definitions) -> bool:
    """Whether the message, or one within it, has a header."""
    parts = [known.get(name) for name in known.within(message)]
    return any(field.wire == Nested(HEADER) for each in (message, *parts) if each is not None for field in each.fields)


def _frame(value: Mapping[str, Any]) -> str:
    header = value.get("header")
    return str(header.get("frame_id", "")).removeprefix("/") if isinstance(header, Mapping) else ""


def _stamp(header: Mapping[str, Any]) -> int:
    """Nanoseconds; ROS 1 writes secs and nsecs, ROS 2 sec and nanosec. Raises KeyError."""
    stamp = header["stamp"]
    second, rest = next(pair for pair in (("sec", "nanosec"), ("secs", "nsecs"), ("sec", "nsec")) if pair[1] in stamp)
    return int(stamp[second]) * SECOND + int(stamp[rest])


def _number(raw: Any) -> float:
    return float(raw.decode() if isinstance(raw, bytes) else raw)
