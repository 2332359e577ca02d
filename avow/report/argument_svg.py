"""The goal structure as an SVG picture, laid out from left to right; no other program is needed.

Every text is escaped here and nowhere else. An element that supports several goals is drawn once. A picture stops at a
number of elements that a person can still read, and says how many it leaves out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from html import escape

from avow.assurance.argument import Argument, Element, Shape
from avow.report.wording import MARKS, clean, tone

LIMIT = 400
_BESIDE = 4
_LINE, _PAD, _GAP, _COLUMN_GAP, _RADIUS = 15.0, 9.0, 14.0, 46.0, 43.0
_WIDTH = {Shape.GOAL: 244.0, Shape.STRATEGY: 206.0, Shape.SOLUTION: 2 * _RADIUS}
_ASIDE_WIDTH = 206.0
_CHARACTER = 6.35
_BOLD = 7.5
_MOST_LINES = 5


@dataclass(slots=True)
class _Box:
    element: Element
    depth: int
    lines: list[str]
    title: str
    named_apart: bool
    """The title is too long to stand beside the status: it has a line of its own."""
    width: float
    height: float
    asides: list[_Box] = field(default_factory=list)
    children: list[_Box] = field(default_factory=list)
    row: list[_Box] = field(default_factory=list)
    """Solutions stand side by side behind their goal."""
    x: float = 0.0
    y: float = 0.0
    tall: float = 0.0


def draw(
    argument: Argument, start: str, link: Callable[[Element], str | None], label: str, *, alone: bool = False
) -> str:
    """The picture of everything below `start`. `link` gives an element's target, if any; `alone` makes a file of its
    own, with its colours in it."""
    boxes, left_out, cross = _tree(argument, start)
    root = boxes[0]
    _measure(boxes)
    _place(boxes, root)
    right = max(box.x + box.width for box in _all(boxes)) + 4
    bottom = max(box.y + box.height for box in _all(boxes)) + 4
    parts = [_edges(boxes), _crossing(cross)]
    parts += [_shape(box, link) for box in _all(boxes)]
    if left_out:
        bottom += 26
        parts.append(f'<text class="note" x="4" y="{bottom - 8:.0f}">and {left_out} more elements: see gsn.yaml</text>')
    space = ' xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink"' if alone else ""
    style = f"<style>{_STYLE}</style>" if alone else ""
    frame = f'<rect class="paper" width="{right:.0f}" height="{bottom:.0f}"/>' if alone else ""
    size = f'viewBox="0 0 {right:.0f} {bottom:.0f}" width="{right:.0f}" height="{bottom:.0f}"'
    head = f'<svg{space} class="gsn" role="group" aria-label="{escape(clean(label))}" {size}>'
    return f"{head}{style}{frame}{ARROWS if alone else ''}{''.join(parts)}</svg>"


def _tree(argument: Argument, start: str) -> tuple[list[_Box], int, list[tuple[_Box, _Box]]]:
    """The boxes of goals and strategies, each parent before its children; how many were left out; the edges to boxes
    that stand elsewhere."""
    known = {element.id: element for element in argument.elements}
    total = len(argument.below(start))
    first = _box(known[start], 0)
    placed: dict[str, _Box] = {start: first}
    boxes, drawn, cross = [first], 1, []
    stack = [first]
    while stack:
        box = stack.pop()
        for name in box.element.in_context_of:
            if name not in placed and drawn < LIMIT:
                placed[name] = _box(known[name], 0)
                box.asides.append(placed[name])
                drawn += 1
        for name in box.element.supported_by:
            if name in placed:
                cross.append((box, placed[name]))
            elif drawn < LIMIT:
                child = _box(known[name], box.depth + 1)
                placed[name] = child
                drawn += 1
                if child.element.shape is Shape.SOLUTION:
                    box.row.append(child)
                else:
                    box.children.append(child)
        stack.extend(reversed(box.children))
    order: list[_Box] = []
    stack = [first]
    while stack:
        box = stack.pop()
        order.append(box)
        stack.extend(reversed(box.children))
    del boxes
    return order, total - drawn, cross


def _box(element: Element, depth: int) -> _Box:
    width = _WIDTH.get(element.shape, _ASIDE_WIDTH)
    if element.shape is Shape.SOLUTION:
        return _Box(element, depth, [], _cut(element.title, 13), False, width, width)
    inner = width - 2 * _inset(element)
    taken = len(element.id) + len(element.status or "") + 4
    apart = len(element.title) * _BOLD > inner - taken * _CHARACTER
    lines = _wrap(element.text, inner)
    if element.shape not in (Shape.GOAL, Shape.STRATEGY):
        lines = (
            [*lines[:3], lines[3] if len(lines) == 4 else _cut(lines[3] + " …", int(inner / _CHARACTER))]
            if len(lines) > 3
            else lines
        )
    height = 2 * _PAD + _LINE * (1 + apart + len(lines))
    return _Box(element, depth, lines, _cut(element.title, int(inner / _BOLD)), apart, width, height)


def _inset(element: Element) -> float:
    return _PAD if element.shape is Shape.GOAL else _PAD + 10


def _measure(boxes: list[_Box]) -> None:
    for box in reversed(boxes):
        below = sum(child.tall for child in box.children) + _GAP * max(0, len(box.children) - 1)
        rows = (len(box.row) + _BESIDE - 1) // _BESIDE
        solutions = rows * (2 * _RADIUS + 6)
        box.tall = max(_own(box), below + solutions + (_GAP if box.children and box.row else 0))


def _place(boxes: list[_Box], root: _Box) -> None:
    columns: dict[int, float] = {}
    for box in boxes:
        columns[box.depth] = max(columns.get(box.depth, 0.0), box.width, *(aside.width for aside in box.asides), 0.0)
    x, at = 4.0, {}
    for depth in range(max(columns) + 2):
        at[depth] = x
        x += columns.get(depth, 0.0) + _COLUMN_GAP
    tops = {id(root): 4.0}
    for box in boxes:  # parents first: where each subtree begins
        y = tops[id(box)]
        for child in box.children:
            tops[id(child)] = y
            y += child.tall + _GAP
    for box in reversed(boxes):  # children first: a parent stands in the middle of what it rests on
        top, own = tops[id(box)], _own(box)
        box.x = at[box.depth]
        rows = (len(box.row) + _BESIDE - 1) // _BESIDE
        solutions = rows * (2 * _RADIUS + 6)
        if box.children:
            start = top + sum(child.tall + _GAP for child in box.children)
        else:
            start = top if box.asides else top + max(0.0, box.tall - solutions) / 2
        for number, solution in enumerate(box.row):
            row, column = divmod(number, _BESIDE)
            solution.x = at[box.depth + 1] + column * (2 * _RADIUS + 8)
            solution.y = start + row * (2 * _RADIUS + 6)
        middles = [child.y + child.height / 2 for child in box.children]
        middles += [box.row[0].y + _RADIUS, box.row[-1].y + _RADIUS] if box.row else []
        wanted = (min(middles) + max(middles)) / 2 - box.height / 2 if middles else top
        box.y = min(max(wanted, top), top + box.tall - own)
        y = box.y + box.height + (10 if box.element.undeveloped else 0)
        for aside in box.asides:
            aside.x, aside.y = box.x, y + _GAP
            y = aside.y + aside.height


def _own(box: _Box) -> float:
    """The height of a box with what stands below it."""
    return box.height + sum(aside.height + _GAP for aside in box.asides) + (10 if box.element.undeveloped else 0)


def _all(boxes: list[_Box]) -> Iterator[_Box]:
    for box in boxes:
        yield box
        yield from box.asides
        yield from box.row


def _edges(boxes: list[_Box]) -> str:
    parts = []
    for box in boxes:
        x, y = box.x + box.width, box.y + box.height / 2
        for child in box.children:
            parts.append(_elbow(x, y, child.x, child.y + child.height / 2))
        rows: dict[float, float] = {}
        for solution in box.row:
            rows.setdefault(solution.y, solution.x)
        for top, left in rows.items():
            parts.append(_elbow(x, y, left, top + _RADIUS))
        above = box
        for aside in box.asides:
            middle = box.x + 24
            start = above.y + above.height
            parts.append(f'<path class="aside" d="M{middle:.0f} {start:.0f}V{aside.y:.0f}"/>')
            above = aside
    return "".join(parts)


def _crossing(cross: list[tuple[_Box, _Box]]) -> str:
    return "".join(
        _elbow(a.x + a.width, a.y + a.height / 2 + 6, b.x, b.y + b.height / 2 + 6, "edge again") for a, b in cross
    )


def _elbow(x1: float, y1: float, x2: float, y2: float, kind: str = "edge") -> str:
    if x2 <= x1:
        curve = f"C{x1 + 60:.0f} {y1:.0f} {x2 - 60:.0f} {y2:.0f} {x2:.0f} {y2:.0f}"
        return f'<path class="{kind}" d="M{x1:.0f} {y1:.0f}{curve}"/>'
    middle = x1 + _COLUMN_GAP / 2
    if abs(y1 - y2) < 1:
        return f'<path class="{kind}" d="M{x1:.0f} {y1:.1f}H{x2:.0f}"/>'
    return f'<path class="{kind}" d="M{x1:.0f} {y1:.1f}H{middle:.0f}V{y2:.1f}H{x2:.0f}"/>'


def _shape(box: _Box, link: Callable[[Element], str | None]) -> str:
    element = box.element
    look = tone(element.status) if element.status else "plain"
    x, y, w, h = box.x, box.y, box.width, box.height
    match element.shape:
        case Shape.GOAL:
            outline = f'<rect x="{x:.0f}" y="{y:.1f}" width="{w:.0f}" height="{h:.0f}"/>'
        case Shape.STRATEGY:
            points = f"{x + 12:.0f},{y:.1f} {x + w:.0f},{y:.1f} {x + w - 12:.0f},{y + h:.1f} {x:.0f},{y + h:.1f}"
            outline = f'<polygon points="{points}"/>'
        case Shape.SOLUTION:
            outline = f'<circle cx="{x + _RADIUS:.0f}" cy="{y + _RADIUS:.1f}" r="{_RADIUS:.0f}"/>'
        case Shape.CONTEXT:
            outline = f'<rect rx="16" x="{x:.0f}" y="{y:.1f}" width="{w:.0f}" height="{h:.0f}"/>'
        case Shape.ASSUMPTION | Shape.JUSTIFICATION:
            outline = f'<rect rx="{min(h / 2, 26):.0f}" x="{x:.0f}" y="{y:.1f}" width="{w:.0f}" height="{h:.0f}"/>'
    kind, title = element.shape.name.lower(), escape(clean(_full(element)))
    drawn = f'<g class="{kind} {look}"><title>{title}</title>{outline}{_text(box)}</g>'
    if element.undeveloped:
        cx, cy = x + w / 2, y + h
        drawn += f'<path class="undeveloped" d="M{cx:.0f} {cy:.1f}l6 6-6 6-6-6z"/>'
    target = link(element)
    return f'<a href="{escape(target)}">{drawn}</a>' if target else drawn


def _text(box: _Box) -> str:
    element = box.element
    status = f"{MARKS[element.status]} {element.status}" if element.status else ""
    name = f'<tspan class="name">{escape(box.title)}</tspan>'
    if element.shape is Shape.SOLUTION:
        x, y = box.x + _RADIUS, box.y + _RADIUS
        return (
            f'<text class="id middle" x="{x:.0f}" y="{y - 14:.1f}">{escape(element.id)}</text>'
            f'<text class="middle"{_squeezed(box.title)} x="{x:.0f}" y="{y + 2:.1f}">{escape(box.title)}</text>'
            f'<text class="status middle" x="{x:.0f}" y="{y + 18:.1f}">{status}</text>'
        )
    letter = element.shape.value if element.shape in (Shape.ASSUMPTION, Shape.JUSTIFICATION) else ""
    x, y = box.x + _inset(element), box.y + _PAD + 11
    end = box.x + box.width - _inset(element)
    beside = "" if box.named_apart else f" {name}"
    parts = [f'<text x="{x:.0f}" y="{y:.1f}"><tspan class="id">{escape(element.id)}</tspan>{beside}</text>']
    if status or letter:
        look = "status" if status else "id"
        parts.append(f'<text class="{look} end" x="{end:.0f}" y="{y:.1f}">{status or letter}</text>')
    for line in ([name] if box.named_apart else []) + [escape(line) for line in box.lines]:
        y += _LINE
        parts.append(f'<text x="{x:.0f}" y="{y:.1f}">{line}</text>')
    return "".join(parts)


def _squeezed(title: str) -> str:
    """A method's name that is wider than its circle is set narrower."""
    room = 2 * _RADIUS - 10
    return f' textLength="{room:.0f}" lengthAdjust="spacingAndGlyphs"' if len(title) * _CHARACTER > room else ""


def _full(element: Element) -> str:
    status = f" ({element.status})" if element.status else ""
    return f"{element.id} {element.title}{status}: {element.text}"


def _wrap(text: str, width: float) -> list[str]:
    text = clean(text)
    most = max(8, int(width / _CHARACTER))
    lines: list[str] = []
    line = ""
    for word in text.split():
        while len(word) > most:
            if line:
                lines.append(line)
                line = ""
            lines.append(word[:most])
            word = word[most:]
            if len(lines) > _MOST_LINES:
                break
        if len(line) + len(word) + 1 > most and line:
            lines.append(line)
            line = word
        else:
            line = f"{line} {word}" if line else word
        if len(lines) > _MOST_LINES:
            break
    if line:
        lines.append(line)
    return _first(lines, _MOST_LINES, most)


def _first(lines: list[str], number: int, most: int) -> list[str]:
    """So many lines, with a sign that there are more."""
    if len(lines) <= number:
        return lines
    return [*lines[: number - 1], _cut(lines[number - 1], most - 2).removesuffix("…") + " …"]


def _cut(text: str, most: int) -> str:
    text = clean(text)
    return text if len(text) <= most else text[: max(1, most - 1)] + "…"


ARROWS = (
    '<defs><marker id="gsn-arrow" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
    '<path class="head" d="M0 0L8 4L0 8z"/></marker></defs>'
)

_STYLE = """
svg{font:12px system-ui,"Segoe UI","Liberation Sans","DejaVu Sans",sans-serif}
.paper{fill:#fff}rect,polygon,circle{fill:#fff;stroke:#5b6472;stroke-width:1.2}
text{fill:#1a1f29}.id{font-weight:700;font-size:10.5px;fill:#5b6472}.name{font-weight:600}.status{font-size:10.5px;font-weight:600}
.middle{text-anchor:middle}.end{text-anchor:end}.note{fill:#5b6472}
.good rect,.good polygon,.good circle{fill:#e6f4ea;stroke:#1e7b3a}.good .status{fill:#176b31}
.fair rect,.fair polygon,.fair circle{fill:#e8f0fb;stroke:#2b62b4}.fair .status{fill:#1f539e}
.open rect,.open polygon,.open circle{fill:#fdf3dc;stroke:#a86a00}.open .status{fill:#8a5600}
.bad rect,.bad polygon,.bad circle{fill:#fde8e6;stroke:#b3261e}.bad .status{fill:#a01c15}
.context rect,.assumption rect,.justification rect{fill:#f4f5f7;stroke:#8a93a1;stroke-width:1}
.edge{fill:none;stroke:#5b6472;stroke-width:1.2;marker-end:url(#gsn-arrow)}
.again{stroke-dasharray:2 3}.head{fill:#5b6472}
.aside{fill:none;stroke:#8a93a1;stroke-width:1;stroke-dasharray:4 3}
.undeveloped{fill:#fff;stroke:#5b6472;stroke-width:1.2}
"""
