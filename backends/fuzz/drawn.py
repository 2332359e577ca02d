"""Runs from bytes, as the harness draws them (`native/avow_drawn.hpp`); the same bytes are the same run."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from avow.backend_kit.programs.samples import as_single, next_single
from avow.language.contract import Port
from avow.language.sorts import EnumSort, NaturalSort, SequenceSort

from .tables import ENDS, Drawable, sort_name
from .tuning import REMEMBERED

Step = dict[str, Any]
"""Input → a float, an int, a bool, the name of an element, or a list of these."""


@dataclass(slots=True)
class Drawn:
    """One run's bytes."""

    data: bytes
    made: Drawable
    single: bool
    _at: int = 0
    _reals: list[float] = field(default_factory=lambda: [0.0] * REMEMBERED)
    _count: int = 0
    _last: int = 0

    def steps(self, ports: Sequence[Port], most: int) -> list[Step]:
        """The inputs of each step; those that the assumptions seem to exclude are skipped when they are run."""
        found: list[Step] = []
        before: Step = {}
        for k in range(1 + self.take(1) % most):
            if k and self._at >= len(self.data):
                break
            before = {port.name: self._value(port, before.get(port.name)) for port in ports}
            found.append(before)
        return found

    def take(self, count: int) -> int:
        part = self.data[self._at : self._at + count]
        self._at += count
        return int.from_bytes(part.ljust(count, b"\0"), "big")

    def _value(self, port: Port, before: Any) -> Any:
        if before is not None and self.take(1) % 4 == 1:
            return before
        if not isinstance(port.sort, SequenceSort):
            return self._one(port.sort)
        lengths = self.made.lengths
        count = lengths[self.take(1) % len(lengths)] if self.take(1) % 4 == 3 else self.take(1) % 6
        return [self._one(port.sort.item) for _ in range(count)]

    def _one(self, sort: Any) -> Any:
        match sort_name(sort):
            case "real":
                return self._real()
            case "integer":
                return self._integer(isinstance(sort, NaturalSort))
            case "truth":
                return bool(self.take(1) & 1)
            case _:  # an element
                assert isinstance(sort, EnumSort)
                return sort.members[self.take(1) % len(sort.members)]

    def _real(self) -> float:
        reals = self.made.reals
        way = self.take(1) % 8
        if way == 3:
            made = self._seen()
        elif way == 4:
            made = self._seen()
            made = self._beside(made + reals[self.take(1) % len(reals)])
        elif way == 5:
            made = self._beside(reals[self.take(1) % len(reals)])
        elif way == 6:
            made = _signed(self.take(2), 16) / 8.0
        elif way == 7:
            (made,) = struct.unpack(">d", self.take(8).to_bytes(8, "big"))
        else:
            made = reals[self.take(1) % len(reals)]
        made = as_single(made) if self.single else made
        made = made if math.isfinite(made) else 0.0
        self._reals[self._count % REMEMBERED] = made
        self._count += 1
        return made

    def _seen(self) -> float:
        which, known = self.take(1), min(self._count, REMEMBERED)
        return self._reals[which % known] if known else 0.0

    def _beside(self, made: float) -> float:
        way = self.take(1) % 3
        if way == 0:
            return made
        end = math.inf if way == 1 else -math.inf
        return next_single(as_single(made), end) if self.single else math.nextafter(made, end)

    def _integer(self, natural: bool) -> int:
        integers = self.made.integers
        way = self.take(1) % 8
        if way == 4:
            made = _signed((self._last + self.take(1) % 5 - 2) % 2**64, 64)
        elif way == 5:
            made = _signed(self.take(2), 16)
        elif way == 6:
            made = _signed(self.take(8), 64)
        elif way == 7:
            made = ENDS[self.take(1) % len(ENDS)]
        else:
            made = integers[self.take(1) % len(integers)]
        if natural and made < 0:
            made = 0 if made == -(2**63) else -made
        self._last = made
        return made


def _signed(value: int, bits: int) -> int:
    return value - 2**bits if value >= 2 ** (bits - 1) else value


def command(ports: Sequence[Port], step: Step) -> str:
    """A step as the plain program reads it."""
    words = ["S"]
    for port in ports:
        value = step[port.name]
        if isinstance(port.sort, SequenceSort):
            words.append(str(len(value)))
            words += [_word(port.sort.item, item) for item in value]
        else:
            words.append(_word(port.sort, value))
    return " ".join(words)


def _word(sort: Any, value: Any) -> str:
    match value:
        case bool():
            return str(int(value))
        case float():
            return value.hex() if math.isfinite(value) else str(value)
        case int():
            return str(value)
        case _:  # an element's name
            return str(sort.members.index(value))
