"""Transforms between frames over time, as tf2's BufferCore keeps and finds them
(https://docs.ros.org/en/humble/p/tf2): linear interpolation, slerp, no extrapolation."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator, Sequence
from typing import NamedTuple

UNIT = 10e-3
"""How far the squared length of a quaternion may be from 1."""
Numbers = tuple[float, ...]
SECOND = 10**9


class NoTransform(Exception):  # noqa: N818 - it names what was found
    """No transform between two frames; `kind` is the first word of tf2's exception."""

    def __init__(self, kind: str, message: str) -> None:
        super().__init__(message)
        self.kind = kind


class Stored(NamedTuple):
    stamp: int
    parent: str
    move: Numbers
    turn: Numbers


def times(a: Numbers, b: Numbers) -> Numbers:
    """The product of two quaternions (x, y, z, w)."""
    (ax, ay, az, aw), (bx, by, bz, bw) = a, b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by + ay * bw + az * bx - ax * bz,
        aw * bz + az * bw + ax * by - ay * bx,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _inverse(q: Numbers) -> Numbers:
    return (-q[0], -q[1], -q[2], q[3])


def rotated(q: Numbers, v: Numbers) -> Numbers:
    """A vector turned by a quaternion."""
    return times(times(q, (*v, 0.0)), _inverse(q))[:3]


def added(a: Numbers, b: Numbers) -> Numbers:
    return tuple(x + y for x, y in zip(a, b, strict=True))


def _between(one: Stored, two: Stored, at: int) -> Stored:
    part = (at - one.stamp) / (two.stamp - one.stamp)
    move = tuple(x * (1 - part) + y * part for x, y in zip(one.move, two.move, strict=True))
    dot = sum(x * y for x, y in zip(one.turn, two.turn, strict=True))
    long = math.sqrt(sum(x * x for x in one.turn) * sum(x * x for x in two.turn))
    theta = math.acos(min(1.0, abs(dot) / long))
    if theta == 0:
        return Stored(at, one.parent, move, one.turn)
    first, second = math.sin((1 - part) * theta), math.sin(part * theta) * (-1 if dot < 0 else 1)
    turn = ((x * first + y * second) / math.sin(theta) for x, y in zip(one.turn, two.turn, strict=True))
    return Stored(at, one.parent, move, tuple(turn))


class Transforms:
    """The transforms of each frame to its parents; times are in nanoseconds. `kept`: how long before the latest one."""

    def __init__(self, kept: float = math.inf) -> None:
        self.kept = kept
        self._frames: dict[str, list[Stored]] = {}
        """Frame → its transforms to its parents, the latest last."""
        self._static: set[str] = set()

    def add(self, child: str, one: Stored, *, static: bool = False) -> None:
        """Keep a transform; one that tf2 would refuse is ignored."""
        child, one = child.removeprefix("/"), one._replace(parent=one.parent.removeprefix("/"))
        whole = child and one.parent and child != one.parent and not any(map(math.isnan, (*one.move, *one.turn)))
        if not whole or abs(sum(x * x for x in one.turn) - 1) >= UNIT:
            return  # tf2 logs it, and ignores it
        stored = self._frames.setdefault(child, [])
        if static and not stored:
            self._static.add(child)
        if child in self._static:
            stored.clear()
        if stored and stored[-1].stamp > one.stamp + self.kept:
            return
        stored.insert(bisect_right(stored, one.stamp, key=lambda each: each.stamp), one)
        del stored[: next(k for k, each in enumerate(stored) if each.stamp + self.kept >= stored[-1].stamp)]

    def moment(self, target: str, source: str, at: int) -> int:
        """The time that is asked for; 0: the latest at which both frames are known. Raises NoTransform."""
        for frame in (target, source):
            self._known(frame)
        return at or self._latest(target, source)

    def find(self, target: str, source: str, at: int) -> tuple[Numbers, Numbers]:
        """The translation and the rotation from one frame to another at a time. Raises NoTransform."""
        top, move, turn, wrong = self._walk(source, (target,), at)
        end, back, turned, other = self._walk(target, (top, source), at)
        if end != top and end != source:
            raise other or wrong or NoTransform("Connectivity", f"'{target}' and '{source}' are not connected")
        if end == source:
            move, turn = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)
        undo = _inverse(turned)
        move = added(rotated(undo, move), rotated(undo, tuple(-x for x in back)))
        return move, times(undo, turn)

    def _known(self, frame: str) -> None:
        if not frame or frame.startswith("/"):
            message = f'Invalid argument "{frame}" passed: a frame is not empty, without a slash'
            raise NoTransform("InvalidArgument", message)
        if frame not in self._frames and not any(each.parent == frame for s in self._frames.values() for each in s):
            raise NoTransform("Lookup", f'"{frame}" passed to lookupTransform does not exist.')

    def _at(self, frame: str, at: int) -> Stored:
        stored = self._frames[frame]
        if frame in self._static:
            return stored[0]
        k = bisect_right(stored, at, key=lambda each: each.stamp) - 1
        if k >= 0 and stored[k].stamp == at:
            return stored[k]
        if 0 <= k < len(stored) - 1:
            one, two = stored[k], stored[k + 1]
            return _between(one, two, at) if one.parent == two.parent else one
        where = "at time" if len(stored) == 1 else "into the past" if k < 0 else "into the future"
        raise NoTransform("Extrapolation", f"Lookup would require extrapolation {where}: {at / SECOND} of [{frame}]")

    def _up(self, frame: str) -> Iterator[tuple[str, Stored]]:
        """The latest transforms from a frame to its root."""
        while frame in self._frames:
            yield frame, self._frames[frame][-1]
            frame = self._frames[frame][-1].parent

    def _latest(self, target: str, source: str) -> int:
        """The latest time at which both are known; 0 for static transforms."""
        if target == source:
            return self._frames[source][-1].stamp if source in self._frames and source not in self._static else 0
        chains = []
        for start, end in ((source, target), (target, source)):
            chain = [(frame, s.parent, 0 if frame in self._static else s.stamp) for frame, s in self._up(start)]
            parents = [parent for _, parent, _ in chain]
            if end in parents:
                return min((at for *_, at in chain[: parents.index(end) + 1] if at), default=0)
            chains.append(chain)
        common = next((p for _, p, _ in chains[1] if p in [parent for _, parent, _ in chains[0]]), None)
        if common is None:
            raise NoTransform("Connectivity", f"Could not find a connection between '{target}' and '{source}'")
        stamps = [at for c in chains for *_, at in c[: [p for _, p, _ in c].index(common) + 1] if at]
        return min(stamps, default=0)

    def _walk(self, start: str, ends: Sequence[str], at: int) -> tuple[str, Numbers, Numbers, NoTransform | None]:
        """From a frame up to one of `ends`, or to where nothing is known: that frame, and the transform to it."""
        move: Numbers = (0.0, 0.0, 0.0)
        turn: Numbers = (0.0, 0.0, 0.0, 1.0)
        while start not in ends and start in self._frames:
            try:
                step = self._at(start, at)
            except NoTransform as error:
                return start, move, turn, error
            move, turn = added(rotated(step.turn, move), step.move), times(step.turn, turn)
            start = step.parent
        return start, move, turn, None
