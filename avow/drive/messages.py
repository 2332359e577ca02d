"""The messages of ROS: their classes, and their values as data.

A message is passed as data: a whole number ``{"i": digits}``, a float ``{"f": hexadecimal}``, an array
``{"l": [...]}``, a message ``{"d": [[field, value], ...]}``; texts and truth values are their own JSON.
"""

from __future__ import annotations

import array
import math
import struct
from collections import UserDict
from typing import Any

from .refusals import Strict

INTEGERS = {f"{sign}int{bits}": (sign, bits) for sign in ("", "u") for bits in (8, 16, 32, 64)}


class Fields(UserDict[str, Any]):
    """The names of a message's fields; their types, with limits on lengths, are not known."""

    def __getitem__(self, name: str) -> Any:
        raise Strict._driven.refuse("the type of a field in get_fields_and_field_types()")


class SlotTypes:
    """They are refused, of a class and of its objects."""

    def __get__(self, made: object, kind: type) -> Any:
        raise Strict._driven.refuse(f"{kind.__name__}.SLOT_TYPES")


class Messages:
    """The message types that a class may use."""

    kind: str
    """``rospy`` or ``rclpy``."""

    def __init__(self, spec: Any) -> None:
        self.types: dict[str, Any] = spec["messages"]
        self.classes: dict[str, Any] = {}

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
        if self.kind == "rclpy":
            content["get_fields_and_field_types"] = classmethod(lambda kind: Fields(dict.fromkeys(fields)))
            content["SLOT_TYPES"] = SlotTypes()
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
