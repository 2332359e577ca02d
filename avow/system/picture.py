"""The dataflow graph as a drawing: layers from left to right, no tool needed; and as text for a terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from avow.system.graph import Edge, Graph, components

_WIDTH, _HEIGHT = 150, 46
_GAP_X, _GAP_Y = 110, 34
_MARGIN = 30
_ARROWHEAD = (
    '<defs><marker id="arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    '<path d="M0,0 L8,4 L0,8 z" fill="#444"/></marker></defs>'
)
MAX_DRAWN = 200
"""More nodes than this are not drawn: nobody would find anything in the picture."""


def svg(graph: Graph) -> str:
    """The graph as SVG. Delayed edges are dashed; inputs from the environment stand at the left, in italics."""
    if len(graph.nodes) > MAX_DRAWN:
        return _message(f"{len(graph.nodes)} nodes, {len(graph.edges)} edges: too many to draw")
    outside = tuple(dict.fromkeys(endpoint.port for endpoint in graph.environment))
    layers = _layers(graph)
    sources = [f"in.{port}" for port in outside]
    columns = ([sources] if sources else []) + layers
    place = _places(columns)
    height = max((len(column) for column in columns), default=1) * (_HEIGHT + _GAP_Y) + 2 * _MARGIN
    width = len(columns) * (_WIDTH + _GAP_X) - _GAP_X + 2 * _MARGIN
    below = _lanes(graph, place, layers)
    box = f'viewBox="0 0 {width} {height + below}"'
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" {box} role="img" font-family="sans-serif" font-size="13">',
        f"<title>{escape(_summary(graph))}</title>",
        _ARROWHEAD,
    ]
    for number, ((source, target), labels, delayed) in enumerate(_links(graph, sources)):
        parts.append(_arrow(place[source], place[target], labels, delayed, height, number, source == target))
    for name, (x, y) in place.items():
        parts.append(_box(name, x, y, environment=name in sources and name not in graph.nodes))
    return "\n".join([*parts, "</svg>"])


def text(graph: Graph) -> str:
    """The graph as lines of text: what each node gets from where, providers first."""
    lines: list[str] = []
    for layer in _layers(graph):
        for node in layer:
            lines.append(node)
            lines += [f"  ← {_edge_text(edge)}" for edge in graph.feeding(node)]
            lines += [f"  ← {e.port} (environment)" for e in graph.environment if e.node == node]
            lines += [f"  → {e.port} (feeds nothing)" for e in graph.dangling if e.node == node]
    for cycle in graph.deadlocks:
        lines.append(f"start-up deadlock: {' → '.join((*cycle, cycle[0]))}")
    return "\n".join(lines)


def _edge_text(edge: Edge) -> str:
    port = edge.target.port if edge.target.port == edge.source.port else f"{edge.target.port} from {edge.source.port}"
    later = f", one step later, first {edge.initial}" if edge.delayed and edge.initial else ""
    later = later or (", one step later" if edge.delayed else "")
    return f"{port} of {edge.source.node}{later}"


def _layers(graph: Graph) -> list[list[str]]:
    """Longest path from the sources, over edges of the same step; loops stay together."""
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


def _links(graph: Graph, sources: Sequence[str]) -> list[tuple[tuple[str, str], list[str], bool]]:
    """Edges between the same two nodes are drawn as one."""
    found: dict[tuple[str, str, bool], list[str]] = {}
    for edge in graph.edges:
        labels = found.setdefault((edge.source.node, edge.target.node, edge.delayed), [])
        if edge.source.port not in labels:
            labels.append(edge.source.port)
    links = [((source, target), labels, delayed) for (source, target, delayed), labels in found.items()]
    known = set(sources)
    links += [((f"in.{e.port}", e.node), [], False) for e in graph.environment if f"in.{e.port}" in known]
    return links


def _lanes(graph: Graph, place: Mapping[str, tuple[int, int]], layers: Sequence[Sequence[str]]) -> int:
    """Room below the boxes for edges that run back."""
    backward = sum(place[e.source.node][0] >= place[e.target.node][0] for e in graph.edges)
    return 16 * min(backward, 40) + (20 if backward else 0)


def _arrow(
    start: tuple[int, int],
    end: tuple[int, int],
    labels: Sequence[str],
    delayed: bool,
    bottom: int,
    number: int,
    itself: bool,
) -> str:
    dash = ' stroke-dasharray="6 4"' if delayed else ""
    y1, y2 = start[1] + _HEIGHT // 2, end[1] + _HEIGHT // 2
    if end[0] > start[0]:
        x1, x2 = start[0] + _WIDTH, end[0]
        middle = (x1 + x2) // 2
        path = f"M{x1},{y1} C{middle},{y1} {middle},{y2} {x2},{y2}"
        label = (middle, (y1 + y2) // 2 - 5)
    else:
        lane = bottom + 14 * (number % 40)
        x1, x2 = start[0] + _WIDTH // 2 + (20 if itself else 0), end[0] + _WIDTH // 2 - 20
        path = f"M{x1},{start[1] + _HEIGHT} C{x1},{lane} {x2},{lane} {x2},{end[1] + _HEIGHT}"
        label = ((x1 + x2) // 2, (3 * lane + max(start[1], end[1]) + _HEIGHT) // 4 - 4)
    drawn = f'<path d="{path}" fill="none" stroke="#444"{dash} marker-end="url(#arrow)"/>'
    if not labels:
        return drawn
    words = escape(", ".join(labels))
    return drawn + f'<text x="{label[0]}" y="{label[1]}" text-anchor="middle" font-size="11" fill="#222">{words}</text>'


def _box(name: str, x: int, y: int, *, environment: bool) -> str:
    shown = name[3:] if environment else name
    if len(shown) > 20:
        shown = shown[:19] + "…"
    if environment:
        style = 'fill="none" stroke="none"'
        font = ' font-style="italic"'
    else:
        style = 'fill="#eef3fa" stroke="#335" rx="6"'
        font = ""
    middle = f'x="{x + _WIDTH // 2}" y="{y + _HEIGHT // 2 + 5}" text-anchor="middle"'
    return (
        f'<rect x="{x}" y="{y}" width="{_WIDTH}" height="{_HEIGHT}" {style}><title>{escape(name)}</title></rect>'
        f"<text {middle}{font}>{escape(shown)}</text>"
    )


def _summary(graph: Graph) -> str:
    return f"{len(graph.nodes)} nodes, {len(graph.edges)} edges"


def _message(words: str) -> str:
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 600 60" role="img" font-family="sans-serif">'
        f'<text x="20" y="35">{escape(words)}</text></svg>'
    )
