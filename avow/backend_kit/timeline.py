"""What was heard in a recorded run, and where a monitor found something wrong: lanes over the run's events.

A method leaves it in its evidence's details, under `timeline`; the report draws it. However long the run was, a lane
has a bounded number of columns. Signals lose detail by that; marks are counted, and none is lost.

Its JSON is written here and not by `avow.base.codec`: a stretch and a mark are rows without names, of which a record
has thousands, and what another's record holds must lie within its events.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, Generic, TypeVar

from markupsafe import Markup, escape

from avow.base.plain import count
from avow.base.records import dataclass
from avow.tuning.shown import TIMELINE_COLUMNS

KINDS: Mapping[str, tuple[str, str]] = {
    "broken": ("M-4 -4l8 8m0 -8l-8 8", "broken"),
    "assumption": ("M-4 4h8l-4 -8z", "assumption broken"),
    "excused": ("M0 -5l5 5l-5 5l-5 -5z", "not met while an assumption was broken"),
    "silent": ("M-4 -4h8v8h-8z", "silent for too long"),
    "rate": ("M-5 -2h10m-10 4h10", "outside its rate"),
    "unreadable": ("M0 -5v6m0 3v1", "not readable"),
}
"""Kind of mark → its shape, around the origin, and its words. Shapes differ, so that paper needs no colours."""


@dataclass(frozen=True, slots=True)
class Stretch:
    """What a lane's signal was over some events, counted from 1: between two numbers, or a word ("" for several)."""

    first: int
    last: int
    said: tuple[float, float] | str


@dataclass(frozen=True, slots=True)
class Mark:
    """So many findings of one kind, at neighbouring events; `time`: of the first of them, in seconds, as text."""

    kind: str
    first: int
    last: int
    number: int
    time: str = ""


@dataclass(frozen=True, slots=True)
class Lane:
    """A port, or a clause (which has no signal)."""

    name: str
    stretches: tuple[Stretch, ...] = ()
    marks: tuple[Mark, ...] = ()


@dataclass(frozen=True, slots=True)
class Timeline:
    """One run. `every`: the signals are those of about one event in so many; marks are of all."""

    name: str
    events: int
    start: str
    end: str
    """Times in seconds, as text."""
    lanes: tuple[Lane, ...]
    every: int = 1


T = TypeVar("T")


class Columns(Generic[T]):
    """Items by event, in at most TIMELINE_COLUMNS columns: they get wider as events go on. `joined` makes one item of
    two neighbours."""

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
    """Over both: the least and the greatest number, or the word if it is one."""
    first, last = min(one.first, other.first), max(one.last, other.last)
    match one.said, other.said:
        case (float(low), float(high)), (float(lower), float(higher)):
            return Stretch(first, last, (min(low, lower), max(high, higher)))
        case said, same if said == same:
            return Stretch(first, last, said)
        case _:  # several words
            return Stretch(first, last, "")


def joined_marks(one: Mark, other: Mark) -> Mark:
    earlier = one if one.first <= other.first else other
    return Mark(one.kind, earlier.first, max(one.last, other.last), one.number + other.number, earlier.time)


def runs(stretches: Iterable[Stretch]) -> tuple[Stretch, ...]:
    """Neighbours that say the same word, or the same number, as one."""
    found: list[Stretch] = []
    for stretch in stretches:
        if found and stretch.said and found[-1].said == stretch.said:
            found[-1] = Stretch(found[-1].first, stretch.last, stretch.said)
        else:
            found.append(stretch)
    return tuple(found)


# -- as JSON, in evidence ----------------------------------------------------------------------------------------------


def to_json(timeline: Timeline) -> dict[str, Any]:
    lanes = [
        {
            "name": lane.name,
            "signal": [[s.first, s.last, *((s.said,) if isinstance(s.said, str) else s.said)] for s in lane.stretches],
            "marks": [[m.kind, m.first, m.last, m.number, m.time] for m in lane.marks],
        }
        for lane in timeline.lanes
    ]
    return {
        "trace": timeline.name, "events": timeline.events, "from": timeline.start, "to": timeline.end,
        "every": timeline.every, "lanes": lanes,
    }  # fmt: skip


def timelines(details: Mapping[str, Any]) -> list[Timeline]:
    """Those of an evidence's details. Evidence may be anybody's: what is no timeline is left out."""
    found = details.get("timeline")
    read = [_timeline(one) for one in found] if isinstance(found, list) else []
    return [one for one in read if one is not None]


def _timeline(found: Any) -> Timeline | None:
    match found:
        case {
            "trace": str(name), "events": int(events), "from": str(start), "to": str(end), "every": int(every),
            "lanes": [*lanes],
        } if events > 0 and every > 0:  # fmt: skip
            read = [_lane(one, events) for one in lanes]
            whole = tuple(lane for lane in read if lane is not None)
            return Timeline(name, events, start, end, whole, every) if len(whole) == len(lanes) else None
        case _:  # not what a record of a timeline has
            return None


def _lane(found: Any, events: int) -> Lane | None:
    match found:
        case {"name": str(name), "signal": [*signal], "marks": [*marks]}:
            stretches = tuple(_stretch(one) for one in signal)
            read = tuple(_mark(one) for one in marks)
            inside = all(s is not None and 0 < s.first <= s.last <= events for s in stretches)
            if inside and all(m is not None and 0 < m.first <= m.last <= events for m in read):
                return Lane(name, tuple(s for s in stretches if s), tuple(m for m in read if m))
    return None


def _stretch(found: Any) -> Stretch | None:
    match found:
        case [int(first), int(last), str(word)]:
            return Stretch(first, last, word)
        case [int(first), int(last), float() | int() as low, float() | int() as high] if (
            math.isfinite(low) and math.isfinite(high) and low <= high
        ):
            return Stretch(first, last, (float(low), float(high)))
        case _:  # not what a record of a timeline has
            return None


def _mark(found: Any) -> Mark | None:
    match found:
        case [str(kind), int(first), int(last), int(number), str(time)] if kind in KINDS:
            return Mark(kind, first, last, number, time)
        case _:  # not what a record of a timeline has
            return None


# -- as a picture ------------------------------------------------------------------------------------------------------

_WIDTH, _LEFT, _RIGHT, _LANE, _CLAUSE, _SIGNAL = 720, 170, 12, 40, 18, 24
_ACROSS = ("broken", "assumption")
"""Findings that are drawn through all lanes, to see what the signals were."""
_STYLE = (
    "<style>text{font:10px 'Libertinus Serif',serif;fill:#3c4654}.lane{fill:#f2f4f7}.signal{fill:none;stroke:#1f539e;"
    "stroke-width:1.3}.word{fill:#fff;stroke:#5b6472;stroke-width:.7}"
    ".mark{fill:none;stroke:#a01c15;stroke-width:1.8}.at{stroke:#a01c15;stroke-width:.5;stroke-dasharray:2 3}</style>"
)
_NO_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def picture(timeline: Timeline, alone: bool = False) -> Markup:
    """The timeline as SVG. `alone`: with its own colours, for where the page's style sheet is not."""
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
    return Markup("".join(parts))  # every text in it is escaped where it is put in


def in_words(timeline: Timeline) -> str:
    """What the picture shows that matters, for those who do not see it."""
    told = [
        f"{lane.name}: {KINDS[kind][1]} {count(sum(m.number for m in found), 'time')}, first at event {found[0].first}"
        + (f" (t = {found[0].time})" if found[0].time else "")
        for lane in timeline.lanes
        for kind in KINDS
        if (found := sorted((m for m in lane.marks if m.kind == kind), key=lambda m: m.first))
    ]
    part = f"; signals of one event in {timeline.every}, marks of all" if timeline.every > 1 else ""
    whole = f"{timeline.name}, {count(timeline.events, 'event')}{part}"
    return f"{whole}: {'; '.join(told) or 'no finding'}"


def _height(lane: Lane) -> int:
    return _LANE if lane.stretches else _CLAUSE


def _drawn(lane: Lane, top: int, events: int) -> Iterable[str]:
    height = _height(lane) - 3
    middle = top + height / 2
    yield f'<rect class="lane" x="{_LEFT}" y="{top}" width="{_WIDTH - _LEFT - _RIGHT}" height="{height}"/>'
    yield f'<text x="2" y="{middle + 3:.1f}">{_text(_short(lane.name, 27))}<title>{_text(lane.name)}</title></text>'
    ends = [*(s.first for s in lane.stretches[1:]), events]
    numbers = [s.said for s in lane.stretches if not isinstance(s.said, str)]
    if numbers:
        yield from _curve(lane.stretches, ends, (min(n for n, _ in numbers), max(n for _, n in numbers)), top, events)
    for stretch, end in zip(lane.stretches, ends, strict=False):
        if isinstance(stretch.said, str):
            yield _word(_x(stretch.first, events), _x(end, events), stretch.said, middle)
    for mark in lane.marks:
        shape, words = KINDS[mark.kind]
        at = f"event {mark.first}" if mark.first == mark.last else f"events {mark.first} to {mark.last}"
        told = f"{words}: {at}" + (f" (t = {mark.time})" if mark.time else "")
        told += f", {count(mark.number, 'time')}" if mark.number > 1 else ""
        place = f"translate({_x(mark.first, events):.1f} {top + 7 if lane.stretches else middle:.1f})"
        yield f'<path class="mark" transform="{place}" d="{shape}"><title>{_text(told)}</title></path>'


def _curve(
    stretches: Sequence[Stretch], ends: Sequence[int], reach: tuple[float, float], top: int, events: int
) -> Iterable[str]:
    """In steps, as a value stays until the next message; up and down where a column has several values."""
    low, high = reach
    size = high / 2 - low / 2  # halves: the difference may be more than a float holds

    def y(value: float) -> float:
        return top + 32 - (_SIGNAL * ((value / 2 - low / 2) / size) if size > 0 else _SIGNAL / 2)

    path = ""
    for stretch, end in zip(stretches, ends, strict=True):
        if isinstance(stretch.said, str):
            continue
        least, most = stretch.said
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
