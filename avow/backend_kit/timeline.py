"""The signals of a recorded run and a monitor's findings: lanes over the run's events.

A method puts it into its evidence's details, under `timeline`; the report draws it. A lane has a bounded number of
columns for runs of any length. Signals lose detail by that; marks are counted, and none is lost.

Stretches and marks are rows, as a record has thousands.
"""

from __future__ import annotations

import contextlib
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from typing import Any, Generic, NamedTuple, TypeVar

from markupsafe import Markup, escape

from avow.base.codec import Unreadable, called, from_json
from avow.base.plain import count
from avow.base.records import dataclass
from avow.base.tuning.shown import TIMELINE_COLUMNS

KINDS: Mapping[str, tuple[str, str]] = {
    "broken": ("M-4 -4l8 8m0 -8l-8 8", "broken"),
    "assumption": ("M-4 4h8l-4 -8z", "assumption broken"),
    "excused": ("M0 -5l5 5l-5 5l-5 -5z", "not met while an assumption was broken"),
    "silent": ("M-4 -4h8v8h-8z", "silent for too long"),
    "rate": ("M-5 -2h10m-10 4h10", "outside its rate"),
    "unreadable": ("M0 -5v6m0 3v1", "not readable"),
}
"""Kind of mark → its shape, around the origin, and its words. Shapes differ, so that paper needs no colours."""


class Word(NamedTuple):
    """A lane's signal over some events, counted from 1; "" for several words."""

    first: int
    last: int
    said: str


class Band(NamedTuple):
    """The range of its numbers."""

    first: int
    last: int
    low: float
    high: float


Stretch = Word | Band


class Mark(NamedTuple):
    """A number of findings of one kind, at neighbouring events; `time`: of the first, in seconds, as text."""

    kind: str
    first: int
    last: int
    number: int
    time: str = ""


@dataclass(frozen=True, slots=True)
class Lane:
    """A port, or a clause (which has no signal)."""

    name: str
    stretches: tuple[Stretch, ...] = field(default=(), metadata=called("signal"))
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True, slots=True)
class Timeline:
    """One run. `every`: signals are sampled at about one event in so many; marks cover all."""

    name: str = field(metadata=called("trace"))
    events: int
    start: str = field(metadata=called("from"))
    end: str = field(metadata=called("to"))
    """Times in seconds, as text."""
    lanes: tuple[Lane, ...]
    every: int = 1


T = TypeVar("T")


class Columns(Generic[T]):
    """Items by event, in at most TIMELINE_COLUMNS columns, which get wider as events are added. `joined` merges two
    neighbours."""

    def __init__(self, joined: Callable[[T, T], T]) -> None:
        self._joined = joined
        self._width = 1
        self._items: dict[int, T] = {}

    def put(self, event: int, item: T) -> None:
        while (event - 1) // self._width >= TIMELINE_COLUMNS:
            self._width *= 2
            old, self._items = self._items, {}
            for at, found in sorted(old.items()):
                self._add(at // 2, found)
        self._add((event - 1) // self._width, item)

    def _add(self, at: int, item: T) -> None:
        self._items[at] = self._joined(self._items[at], item) if at in self._items else item

    def items(self) -> list[T]:
        return [item for _, item in sorted(self._items.items())]


def joined_stretches(one: Stretch, other: Stretch) -> Stretch:
    """The union of two: the least and the greatest number, or the word if both have the same."""
    first, last = min(one.first, other.first), max(one.last, other.last)
    match one, other:
        case Band(), Band():
            return Band(first, last, min(one.low, other.low), max(one.high, other.high))
        case Word(said=said), Word(said=same) if said == same:
            return Word(first, last, said)
        case _:  # several words
            return Word(first, last, "")


def joined_marks(one: Mark, other: Mark) -> Mark:
    earlier = one if one.first <= other.first else other
    return Mark(one.kind, earlier.first, max(one.last, other.last), one.number + other.number, earlier.time)


def runs(stretches: Iterable[Stretch]) -> tuple[Stretch, ...]:
    """Merges neighbours with the same word or number."""
    found: list[Stretch] = []
    for stretch in stretches:
        if found and stretch[2:] != ("",) and found[-1][2:] == stretch[2:]:
            found[-1] = stretch._replace(first=found[-1].first)
        else:
            found.append(stretch)
    return tuple(found)


def timelines(details: Mapping[str, Any]) -> list[Timeline]:
    """The timelines in an evidence's details. Evidence may come from any backend: other data is left out."""
    found = details.get("timeline")
    read = []
    for one in found if isinstance(found, list) else ():
        with contextlib.suppress(Unreadable):
            read.append(from_json(Timeline, one))
    return [one for one in read if _is_whole(one)]


def _is_whole(timeline: Timeline) -> bool:
    """Whether all items are within its events."""
    marks = [mark for lane in timeline.lanes for mark in lane.marks]
    stretches = [stretch for lane in timeline.lanes for stretch in lane.stretches]
    return (
        timeline.every > 0
        and timeline.events > 0
        and all(0 < row.first <= row.last <= timeline.events for row in (*marks, *stretches))
        and all(mark.kind in KINDS for mark in marks)
        and all(-math.inf < s.low <= s.high < math.inf for s in stretches if isinstance(s, Band))
    )


# -- as a picture ------------------------------------------------------------------------------------------------------

_WIDTH, _LEFT, _RIGHT, _LANE, _CLAUSE, _SIGNAL = 720, 170, 12, 40, 18, 24
_ACROSS = ("broken", "assumption")
"""Findings that are drawn through all lanes, to show the signals there."""
_STYLE = (
    "<style>text{font:10px 'Libertinus Serif',serif;fill:#3c4654}.lane{fill:#f2f4f7}.signal{fill:none;stroke:#1f539e;"
    "stroke-width:1.3}.word{fill:#fff;stroke:#5b6472;stroke-width:.7}"
    ".mark{fill:none;stroke:#a01c15;stroke-width:1.8}.at{stroke:#a01c15;stroke-width:.5;stroke-dasharray:2 3}</style>"
)
_NO_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def picture(timeline: Timeline, alone: bool = False) -> Markup:
    """The timeline as SVG. `alone`: with its own colours, for use without the page's style sheet."""
    tops = [2]
    for lane in timeline.lanes:
        tops.append(tops[-1] + _height(lane))
    height = tops[-1] + 20
    size = f'viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" height="{height}"'
    parts = [f'<svg class="timeline" xmlns="http://www.w3.org/2000/svg" {size} role="img"']
    parts.append(f' aria-label="{_text(in_words(timeline))}">{_STYLE if alone else ""}')
    if alone:
        parts.append(f'<rect width="{_WIDTH}" height="{height}" fill="#fff"/>')
    for lane, top in zip(timeline.lanes, tops, strict=False):
        parts += _drawn(lane, top, timeline.events)
    for event in sorted({m.first for lane in timeline.lanes for m in lane.marks if m.kind in _ACROSS}):
        parts.append(f'<path class="at" d="M{_x(event, timeline.events):.1f} 2V{tops[-1]}"/>')
    for event, time, anchor in ((1, timeline.start, "start"), (timeline.events, timeline.end, "end")):
        words = f"event {event}" + (f" (t = {_short(time, 20)})" if time else "")
        x = _LEFT if anchor == "start" else _WIDTH - _RIGHT
        parts.append(f'<text x="{x}" y="{height - 6}" text-anchor="{anchor}">{_text(words)}</text>')
    parts.append("</svg>")
    return Markup("".join(parts))  # each text is escaped when it is inserted


def in_words(timeline: Timeline) -> str:
    """A text alternative with the picture's findings."""
    counts = [
        f"{lane.name}: {KINDS[kind][1]} {count(sum(m.number for m in found), 'time')}, first at event {found[0].first}"
        + (f" (t = {found[0].time})" if found[0].time else "")
        for lane in timeline.lanes
        for kind in KINDS
        if (found := sorted((m for m in lane.marks if m.kind == kind), key=lambda m: m.first))
    ]
    part = f"; signals of one event in {timeline.every}, marks of all" if timeline.every > 1 else ""
    whole = f"{timeline.name}, {count(timeline.events, 'event')}{part}"
    return f"{whole}: {'; '.join(counts) or 'no finding'}"


def _height(lane: Lane) -> int:
    return _LANE if lane.stretches else _CLAUSE


def _drawn(lane: Lane, top: int, events: int) -> Iterable[str]:
    height = _height(lane) - 3
    middle = top + height / 2
    yield f'<rect class="lane" x="{_LEFT}" y="{top}" width="{_WIDTH - _LEFT - _RIGHT}" height="{height}"/>'
    yield f'<text x="2" y="{middle + 3:.1f}">{_text(_short(lane.name, 27))}<title>{_text(lane.name)}</title></text>'
    ends = [*(s.first for s in lane.stretches[1:]), events]
    bands = [s for s in lane.stretches if isinstance(s, Band)]
    if bands:
        yield from _curve(lane.stretches, ends, (min(b.low for b in bands), max(b.high for b in bands)), top, events)
    for stretch, end in zip(lane.stretches, ends, strict=False):
        if isinstance(stretch, Word):
            yield _word(_x(stretch.first, events), _x(end, events), stretch.said, middle)
    for mark in lane.marks:
        shape, words = KINDS[mark.kind]
        at = f"event {mark.first}" if mark.first == mark.last else f"events {mark.first} to {mark.last}"
        title = f"{words}: {at}" + (f" (t = {mark.time})" if mark.time else "")
        title += f", {count(mark.number, 'time')}" if mark.number > 1 else ""
        place = f"translate({_x(mark.first, events):.1f} {top + 7 if lane.stretches else middle:.1f})"
        yield f'<path class="mark" transform="{place}" d="{shape}"><title>{_text(title)}</title></path>'


def _curve(
    stretches: Sequence[Stretch], ends: Sequence[int], reach: tuple[float, float], top: int, events: int
) -> Iterable[str]:
    """A step line, as a value stays until the next message; vertical if a column has several values."""
    low, high = reach
    size = high / 2 - low / 2  # halves: the difference may overflow a float

    def y(value: float) -> float:
        return top + 32 - (_SIGNAL * ((value / 2 - low / 2) / size) if size > 0 else _SIGNAL / 2)

    path = ""
    for stretch, end in zip(stretches, ends, strict=True):
        if isinstance(stretch, Word):
            continue
        _, _, least, most = stretch
        start = "" if path else f"M{_x(stretch.first, events):.1f} {y(least):.1f}"
        path += f"{start}V{y(most):.1f}V{y(least):.1f}H{_x(end, events):.1f}"
    yield f'<path class="signal" d="{path}"/>'
    for value in dict.fromkeys((low, high)):
        yield f'<text x="{_LEFT - 4}" y="{y(value) + 3:.1f}" text-anchor="end">{value:.4g}</text>'


def _word(x: float, end: float, said: str, middle: float) -> str:
    width = max(end - x, 1.0)
    room = int((width - 6) / 5.5)
    shown = f'<text x="{x + 3:.1f}" y="{middle + 9:.1f}">{_text(_short(said, room))}</text>' if room > 2 else ""
    place = f'x="{x:.1f}" y="{middle - 2:.1f}" width="{width:.1f}" height="15"'
    return f'<rect class="word" {place}><title>{_text(said or "several values")}</title></rect>{shown}'


def _x(event: int, events: int) -> float:
    return _LEFT + 6 + (_WIDTH - _LEFT - _RIGHT - 12) * ((event - 1) / max(events - 1, 1))


def _short(text: str, room: int) -> str:
    return text if len(text) <= room else text[: room - 1] + "…"


def _text(text: str) -> str:
    """Escaped, and without characters that XML cannot hold."""
    return str(escape(_NO_XML.sub("\ufffd", text)))
