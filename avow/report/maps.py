"""A counterexample's places on a small map, if the plan names the table that holds the places (plan: `pictures`).

A place is given by its coordinates, ``(2, 2)``, in a value of a port, or by its label in a call that the plan names
under `places`, ``inspect(3)``. Places of a trace are joined to a path. All text is escaped; none of it is markup.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from fractions import Fraction

from markupsafe import Markup, escape

from avow.assurance.model import MapView
from avow.base.records import dataclass
from avow.base.tuning.shown import MAP_STEPS
from avow.base.verdict import Counterexample
from avow.report.example import is_small

_NUMBER = r"[-+−]?\d{1,12}(?:[./]\d{1,12})?"
_COORDINATES = re.compile(rf"\(\s*({_NUMBER})\s*,\s*({_NUMBER})\s*\)")
_CALL = re.compile(r"([A-Za-z_]\w{0,60})\(\s*([^\s(),]{1,40})\s*\)")
_PORT = re.compile(r"^[A-Za-z_]\w*\.[A-Za-z_]\w*")
"""Only values of ports are the contract's: a tool's other output (beliefs, percepts) may hold pairs that are no
places."""
_SIZE = 300.0
_MARGIN = 26.0
_STYLE = (
    "<style>text{font:10px 'Libertinus Serif',serif;fill:#5b6472}.spot{fill:#5b6472}.hit{fill:#a01c15}"
    ".off{stroke:#a01c15;stroke-width:2;fill:none}"
    ".way{fill:none;stroke:#a01c15;stroke-width:1.5;stroke-dasharray:4 3}</style>"
)

Place = tuple[Fraction, Fraction]


@dataclass(frozen=True, slots=True)
class _Visit:
    place: Place
    when: str
    """Its name: a variable's name, or a step."""


def draw_map(view: MapView, example: Counterexample) -> Markup:
    """The map with the example's places marked, and a caption; empty if there is nothing to mark."""
    svg, told = map_picture(view, example)
    if not svg:
        return Markup()
    return Markup(f'<div class="where">{svg}<p class="quiet">{escape(told)}</p></div>')  # escaped piece by piece


def map_picture(view: MapView, example: Counterexample, alone: bool = False) -> tuple[str, str]:
    """The map as SVG, and its caption; two empty texts if the example names no place, or the table holds no numbers.
    `alone`: with its own colours, for use without the page's style sheet."""
    known = _known(view)
    if not known:
        return "", ""
    marked = [
        _Visit(place, name)
        for name, value in example.values
        if not is_small(name)
        for place in _places(name, value, view, known)
    ]
    path = list(_path(example, view, known))
    if not marked and not path:
        return "", ""
    return _svg(view, known, marked, path, _STYLE if alone else "")


def _known(view: MapView) -> dict[str, Place]:
    """Label → place, for every row whose coordinates are numbers."""
    found = {}
    for at, (x, y, label) in enumerate(view.points):
        place = _place(x, y)
        if place is not None:
            found[label or f"{at + 1}"] = place
    return found


def _place(x: str, y: str) -> Place | None:
    try:
        return Fraction(x.replace("−", "-")), Fraction(y.replace("−", "-"))
    except (ValueError, ZeroDivisionError):
        return None


def _places(name: str, value: str, view: MapView, known: dict[str, Place]) -> Iterable[Place]:
    if _PORT.match(name):
        for x, y in _COORDINATES.findall(value):
            place = _place(x, y)
            if place is not None:
                yield place
    for word, label in _CALL.findall(value):
        if word in view.places and label in known:
            yield known[label]


def _path(example: Counterexample, view: MapView, known: dict[str, Place]) -> Iterable[_Visit]:
    """A place is entered in the step that names it after one that did not: beliefs and relations persist."""
    before: set[Place] = set()
    last = None
    for at, step in enumerate(example.trace[:MAP_STEPS]):
        now = dict.fromkeys(p for name, value in step for p in _places(name, value, view, known))
        for place in now:
            if place not in before and place != last:
                last = place
                yield _Visit(place, f"step {at}")
        before = set(now)


def _svg(
    view: MapView, known: dict[str, Place], marked: Sequence[_Visit], path: Sequence[_Visit], style: str
) -> tuple[str, str]:
    visits = (*marked, *path)
    inside = _frame(list(known.values()))
    near = [
        v for v in visits if all(abs(c - m) <= 4 * w for c, m, w in zip(v.place, inside[0], inside[1], strict=True))
    ]
    places = [*known.values(), *(v.place for v in near)]
    (left, right), (low, high) = ((min(c), max(c)) for c in zip(*places, strict=True))
    scale = (_SIZE - 2 * _MARGIN) / float(max(right - left, high - low) or 1)
    width = float(right - left) * scale + 2 * _MARGIN
    height = float(high - low) * scale + 2 * _MARGIN

    def at(place: Place) -> tuple[float, float]:
        return _MARGIN + float(place[0] - left) * scale, _MARGIN + float(high - place[1]) * scale

    hit = {v.place for v in near}
    told = _told(view, known, marked, path)
    parts = [
        (
            f'<svg class="map" xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
            f'width="{width:.0f}" height="{height:.0f}" role="img" aria-label="{escape(told)}">{style}'
        )
    ]
    for label, place in known.items():
        x, y = at(place)
        kind = "hit" if place in hit else "spot"
        parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{6 if place in hit else 3.5}"/>')
        parts.append(f'<text x="{x + 7:.1f}" y="{y - 5:.1f}">{escape(label)}</text>')
    for place in sorted(hit - set(known.values())):
        x, y = at(place)
        parts.append(f'<path class="off" d="M{x - 5:.1f} {y - 5:.1f}l10 10m0 -10l-10 10"/>')
        parts.append(f'<text x="{x + 8:.1f}" y="{y + 4:.1f}">({place[0]}, {place[1]})</text>')
    way = [v for v in path if v in near]
    if len(way) > 1:
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in (at(v.place) for v in way))
        parts.append(f'<polyline class="way" points="{line}"/>')
    parts.append("</svg>")
    return "".join(parts), told  # every text in the picture is escaped above


def _frame(places: Sequence[Place]) -> tuple[Place, Place]:
    """The middle of the table's places, and their extent (at least 1)."""
    xs, ys = zip(*places, strict=True)
    reach = max(max(xs) - min(xs), max(ys) - min(ys), Fraction(1))
    return ((min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2), (reach, reach)


def _told(view: MapView, known: dict[str, Place], marked: Sequence[_Visit], path: Sequence[_Visit]) -> str:
    names = {place: label for label, place in known.items()}

    def say(place: Place) -> str:
        return f"{view.name} {names[place]}" if place in names else f"({place[0]}, {place[1]}), which is no {view.name}"

    told = [f"{v.when}: {say(v.place)}" for v in dict.fromkeys(marked)]
    if path:
        told += [f"{v.when}: {say(v.place)}" for v in path[:12]]
        if len(path) > 12:
            told.append(f"and {len(path) - 12} more moves")
    return "; ".join(told)
