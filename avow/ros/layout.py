"""Where the fields of raw messages are: messages of one layout become arrays, without reading each of them.

A message with strings or arrays of any length has the layout of another one with the same lengths. ROS 2 writes CDR,
little-endian, with each number aligned to its size (OMG DDSI-RTPS, 10.2). ROS 1 writes no gaps and no CDR header.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field

import numpy as np
import numpy.typing as npt

from avow.base.records import dataclass
from avow.base.tuning.sizes import LAYOUT_FIELDS
from avow.ros.definitions import FLOATS, INTEGERS, Array, Definitions, Nested, Scalar, Wire

FieldPath = tuple[str | int, ...]
Columns = Callable[[FieldPath], npt.NDArray[np.generic] | None]
"""The numbers at a path, one for each message; None if it leads to no number."""

_FORMS = {
    "bool": "?",
    **{name: f"<{name[0]}{int(name.lstrip('uint')) // 8}" for name in INTEGERS},
    **{name: f"<f{int(name.lstrip('float')) // 8}" for name in FLOATS},
}
_CDR = b"\0\1"
"""The header of a ROS 2 message that is written in CDR, little-endian."""


class _Unknown(Exception):  # noqa: N818 - it is what was found
    """A message whose layout is not known."""


@dataclass(slots=True)
class Layout:
    """The layout of one message of a type; `columns` checks whether others have it."""

    known: Definitions
    raw: bytes
    ros2: bool
    places: dict[FieldPath, tuple[int, str]] = field(default_factory=dict)
    """The position of each number, and its form."""
    lengths: list[tuple[int, int]] = field(default_factory=list)
    """The position and value of the length of each string or array."""
    _at: int = 0

    @classmethod
    def of(cls, name: str, known: Definitions, raw: bytes, ros2: bool) -> Layout | None:
        """None if the type or the encoding is not known, or if the message has very many fields."""
        found = cls(known, raw[4:] if ros2 else raw, ros2)
        try:
            found._wire((), Nested(name))
        except _Unknown:
            return None
        return found if len(raw) >= 4 * ros2 + found._at and (not ros2 or raw[:2] == _CDR) else None

    def columns(self, raws: Sequence[bytes]) -> Columns | None:
        """The fields of some messages; None if one of them has another layout."""
        start = 4 * self.ros2
        size = len(self.raw) + start
        if set(map(len, raws)) != {size}:
            return None

        def at(place: int, form: str) -> npt.NDArray[np.generic]:
            return np.ndarray((len(raws),), form, b"".join(raws), place + start, (size,))

        if any((at(place, "<u4") != length).any() for place, length in self.lengths):
            return None
        if self.ros2 and (at(-start, ">u2") != 1).any():
            return None
        return lambda path: np.ascontiguousarray(at(*self.places[path])) if path in self.places else None

    def _wire(self, path: FieldPath, wire: Wire) -> None:
        if len(self.places) + len(self.lengths) > LAYOUT_FIELDS:
            raise _Unknown
        match wire:
            case Scalar(name="string"):
                length = self._length()
                self._at += length
            case Scalar(name="time" | "duration"):
                self.places[*path, "sec"] = self._number("<i4"), "<i4"
                self.places[*path, "nanosec"] = self._number("<u4"), "<u4"
            case Scalar(name=name):
                if (form := _FORMS.get(name)) is None:
                    raise _Unknown
                self.places[path] = self._number(form), form
            case Nested(name=name):
                if (message := self.known.get(name)) is None:
                    raise _Unknown
                for inner in message.fields:
                    self._wire((*path, inner.name), inner.wire)
                self._at += self.ros2 and not message.fields  # ROS 2 puts one byte into an empty message
            case Array(item=item, length=length):
                for k in range(length := self._length() if length is None else length):
                    self._wire((*path, k), item)
                    if (*path, k) in self.places:
                        self.places[*path, k - length] = self.places[*path, k]

    def _number(self, form: str) -> int:
        size = np.dtype(form).itemsize
        self._at += -self._at % size * self.ros2
        self._at += size
        return self._at - size

    def _length(self) -> int:
        place = self._number("<u4")
        self.lengths.append((place, int.from_bytes(self.raw[place : place + 4], "little")))
        return self.lengths[-1][1]
