"""The dataflow graph as a drawing, with layers from left to right, without any tool."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from html import escape
from itertools import pairwise

from avow.base.graphs import components
from avow.base.records import dataclass
from avow.base.tuning.shown import NODES_DRAWN, SUBSYSTEMS_DRAWN
from avow.system.graph import Graph

_WIDTH, _HEIGHT = 150, 46
_GAP_X, _GAP_Y = 110, 34
_MARGIN = 30
_LANE = 26
_FONT = 'role="img" font-family="sans-serif" font-size="13"'
_ARROWHEAD = (
    '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    '<path d="M0,0 L8,4 L0,8 z" fill="#444"/></marker></defs>'
)


def sheet(parts: Sequence[tuple[str, Graph]]) -> str:
    """Graphs below one another as SVG, as `avow.system.folding.seen` gives them: a system whose subsystems are nodes,
    and the inside of each, in a frame with its name. Delayed edges are dashed; inputs from the environment are in
    italics, before the nodes that read them; nodes that are composed of others have a double border."""
    names = {name for name, _ in parts if name}
    body: list[str] = []
    width = height = 0
    for name, graph in parts[:SUBSYSTEMS_DRAWN]:
        drawn = _drawn(graph, names)
        heading = ""
        if name:
            height += _LANE
            frame = f'<rect x="4" y="4" width="{drawn.width - 8}" height="{drawn.height - 8}" fill="none" stroke="#889"'
            heading = f'<text x="8" y="-6" font-weight="bold">inside {escape(name)}</text>{frame} rx="8"/>'
        body.append(f'<g transform="translate(0 {height})">{heading}')
        body += [*drawn.parts, "</g>"]
        width, height = max(width, drawn.width), height + drawn.height
    if len(parts) > SUBSYSTEMS_DRAWN:
        height += _LANE
        body.append(f'<text x="8" y="{height - 8}">and {len(parts) - SUBSYSTEMS_DRAWN} more subsystems</text>')
    whole = parts[0][1]
    told = f"{len(whole.nodes)} nodes, " + (f"{len(names)} subsystems" if names else f"{len(whole.edges)} edges")
    opened = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" {_FONT}>'
    return "\n".join([opened, f"<title>{escape(told)}</title>", _ARROWHEAD, *body, "</svg>"])


@dataclass(frozen=True, slots=True)
class _Drawn:
    width: int
    height: int
    parts: tuple[str, ...]


def _drawn(graph: Graph, composed: Container[str]) -> _Drawn:
    if len(graph.nodes) > NODES_DRAWN:
        told = f"{len(graph.nodes)} nodes, {len(graph.edges)} edges: too many to draw"
        return _Drawn(600, 60, (f'<text x="20" y="35">{told}</text>',))
    columns, links = _columns(graph)
    place = _places(columns)
    bottom = max((y for _, y in place.values()), default=0) + _HEIGHT
    backward = [link for link in links if len(link.through) == 0 and place[link.source][0] >= place[link.target][0]]
    height = bottom + _MARGIN + (_LANE * (len(backward) + 1) if backward else 0)
    width = len(columns) * (_WIDTH + _GAP_X) - _GAP_X + 2 * _MARGIN
    parts: list[str] = []
    lane = 0
    for link in links:
        if link in backward:
            lane += 1
            parts.append(_back(link, place, bottom + _LANE * lane))
        else:
            parts.append(_forward(link, place))
    parts += [_box(name, *place[name], double=name in composed) for name in graph.nodes]
    inputs = [name for column in columns for name in column if name.startswith(_INPUT)]
    parts += [_word(name.split(_GAP)[-1], *place[name]) for name in inputs]
    return _Drawn(width, height, tuple(parts))


@dataclass(frozen=True, slots=True)
class _Link:
    """Edges between the same two nodes, drawn as one line; `through` are the gaps between boxes that it takes."""

    source: str
    target: str
    labels: tuple[str, ...]
    delayed: bool
    through: tuple[str, ...] = ()


_INPUT = "in\0"
_GAP = "\0"


def _columns(graph: Graph) -> tuple[list[list[str]], list[_Link]]:
    """The contents of each column, and the lines; a line over several columns keeps a gap free in each one between."""
    layers = _layers(graph)
    columns: list[list[str]] = [[], *(list(layer) for layer in layers)]
    level = {name: k + 1 for k, layer in enumerate(layers) for name in layer}
    labels: dict[tuple[str, str, bool], dict[str, None]] = {}
    for edge in graph.edges:
        labels.setdefault((edge.source.node, edge.target.node, edge.delayed), {})[edge.source.port] = None
    links = [_Link(source, target, tuple(found), delayed) for (source, target, delayed), found in labels.items()]
    inputs: dict[str, list[str]] = {}
    for endpoint in graph.environment:
        inputs.setdefault(endpoint.node, []).append(endpoint.port)
    for node, ports in inputs.items():
        # one label for all that a node reads from outside, beside it: a shared one would draw lines across everything
        name = f"{_INPUT}{node}{_GAP}{', '.join(ports)}"
        level[name] = level[node] - 1
        columns[level[name]].append(name)
        links.append(_Link(name, node, (), False))

    routed: list[_Link] = []
    for number, link in enumerate(links):
        gaps = tuple(f"{_GAP}{number}.{k}" for k in range(level[link.source] + 1, level[link.target]))
        for gap, k in zip(gaps, range(level[link.source] + 1, level[link.target]), strict=True):
            columns[k].append(gap)
        routed.append(replace(link, through=gaps))
    if not columns[0]:
        columns = columns[1:]
    return _ordered(columns, routed), routed


def _ordered(columns: list[list[str]], links: Sequence[_Link]) -> list[list[str]]:
    """Each column in the order in which its members are reached from the column before: fewer crossings."""
    before: dict[str, list[str]] = {}
    for link in links:
        for one, other in pairwise((link.source, *link.through, link.target)):
            before.setdefault(other, []).append(one)
    row: dict[str, float] = {}
    for column in columns:
        column.sort(key=lambda name: _middle([row[p] for p in before.get(name, ()) if p in row]))
        row.update({name: k - len(column) / 2 for k, name in enumerate(column)})
    return columns


def _middle(rows: Sequence[float]) -> float:
    return sum(rows) / len(rows) if rows else 0.0


def _layers(graph: Graph) -> list[list[str]]:
    """The longest path from the sources, over edges of the same step; loops stay together."""
    arcs = [(e.source.node, e.target.node) for e in graph.edges if not e.delayed]
    level: dict[str, int] = {}
    for group in components(graph.nodes, arcs):
        providers = [s for s, t in arcs if t in group and s not in group]
        base = max((level[p] + 1 for p in providers), default=0)
        level.update({name: base + k for k, name in enumerate(group)})
    found: dict[int, list[str]] = {}
    for name in graph.nodes:
        found.setdefault(level[name], []).append(name)
    return [found[k] for k in sorted(found)]


def _places(columns: Sequence[Sequence[str]]) -> dict[str, tuple[int, int]]:
    tallest = max((len(column) for column in columns), default=1)
    place: dict[str, tuple[int, int]] = {}
    for k, column in enumerate(columns):
        shift = (tallest - len(column)) * (_HEIGHT + _GAP_Y) // 2
        for row, name in enumerate(column):
            place[name] = (_MARGIN + k * (_WIDTH + _GAP_X), _MARGIN + shift + row * (_HEIGHT + _GAP_Y))
    return place


def _forward(link: _Link, place: Mapping[str, tuple[int, int]]) -> str:
    points = [(place[link.source][0] + _WIDTH, place[link.source][1] + _HEIGHT // 2)]
    for gap in link.through:
        x, y = place[gap]
        points += [(x, y + _HEIGHT // 2), (x + _WIDTH, y + _HEIGHT // 2)]
    points.append((place[link.target][0], place[link.target][1] + _HEIGHT // 2))
    path = f"M{points[0][0]},{points[0][1]}"
    for (x1, y1), (x2, y2) in pairwise(points):
        middle = (x1 + x2) // 2
        path += f" C{middle},{y1} {middle},{y2} {x2},{y2}"
    (x1, y1), (x2, y2) = points[0], points[1]
    if link.through:  # a long line has room for its label above its level part
        (x1, y1), (x2, y2) = points[1], points[2]
    return _line(path, link, ((x1 + x2) // 2, (y1 + y2) // 2 - 5))


def _back(link: _Link, place: Mapping[str, tuple[int, int]], lane: int) -> str:
    """A line that runs back, below all boxes."""
    start, end = place[link.source], place[link.target]
    itself = link.source == link.target
    x1, x2 = start[0] + _WIDTH // 2 + 24, end[0] + _WIDTH // 2 - 24
    path = f"M{x1},{start[1] + _HEIGHT} C{x1},{lane} {x1},{lane} {x1 - 24},{lane} L{x2 + 24},{lane} "
    path += f"C{x2},{lane} {x2},{lane} {x2},{end[1] + _HEIGHT}"
    return _line(path, link, ((x1 + x2) // 2, lane - 4 if not itself else lane + 12))


def _line(path: str, link: _Link, label: tuple[int, int]) -> str:
    dash = ' stroke-dasharray="6 4"' if link.delayed else ""
    drawn = f'<path d="{path}" fill="none" stroke="#444"{dash} marker-end="url(#arrow)"/>'
    if not link.labels:
        return drawn
    words = escape(", ".join(link.labels))
    return drawn + f'<text x="{label[0]}" y="{label[1]}" text-anchor="middle" font-size="11" fill="#222">{words}</text>'


def _box(name: str, x: int, y: int, *, double: bool = False) -> str:
    shown = name if len(name) <= 20 else f"{name[:19]}…"
    middle = f'x="{x + _WIDTH // 2}" y="{y + _HEIGHT // 2 + 5}" text-anchor="middle"'
    outer = f'width="{_WIDTH + 8}" height="{_HEIGHT + 8}" fill="#fff" stroke="#335" rx="9"'
    return (f'<rect x="{x - 4}" y="{y - 4}" {outer}/>' if double else "") + (
        f'<rect x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" fill="#eef3fa" stroke="#335" rx="6">'
        f"<title>{escape(name)}</title></rect><text {middle}>{escape(shown)}</text>"
    )


def _word(name: str, x: int, y: int) -> str:
    shown = name if len(name) <= 24 else f"{name[:23]}…"
    place = f'x="{x + _WIDTH - 6}" y="{y + _HEIGHT // 2 + 5}" text-anchor="end" font-style="italic"'
    return f"<text {place}>{escape(shown)}<title>{escape(name)}</title></text>"
