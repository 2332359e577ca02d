"""The argument in modules as one picture of 720 pixels: boxes in four columns, every text wrapped within its box.

Widths are those of DejaVu Sans, one of the widest sans-serif faces, plus 8 %: with another font there is room left.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from xml.sax.saxutils import escape, quoteattr

from avow.assurance.model import Case
from avow.assurance.relied import shade
from avow.base.records import dataclass
from avow.report.modules import node_modules, requirement_modules
from avow.report.wording import anchor, clean

WIDTH, COLUMNS, GAP, SIZE = 720, 4, 8, 12
_LINE, _PAD, _MOST = 15, 6, 12
"""Pixels of a line and of a margin; a node with more guarantees than this has one box for each group of them."""
_WIDTHS = {
    **dict.fromkeys("0123456789$#_?*", 640),
    **dict.fromkeys(" ,.;:/|\\'!", 402),
    **dict.fromkeys("ijl-", 362),
    **dict.fromkeys('frt()[]"', 460),
    **dict.fromkeys("abcdeghknopqsuvxyz{}", 636),
    **dict.fromkeys("mwMW%@", 1000),
    **dict.fromkeys("+<>=~^&", 838),
    **dict.fromkeys("ABCDEFGHIJKLNOPQRSTUVXYZ", 788),
}
"""Thousandths of the font's size, rounded up by group; any other character is as wide as it is high."""
STYLE = (
    "text{font:12px 'DejaVu Sans',system-ui,sans-serif;fill:#1b1f27}.b{fill:#f4f6f9;stroke:#3c4654;stroke-width:1.5}"
    ".green{stroke:#14622c}.amber{stroke:#744600}.red{stroke:#9c1616}.asm{stroke-dasharray:4 3}"
    ".away{stroke-width:3}.h{font-weight:bold}.stem{stroke:#3c4654;stroke-width:1.5}"
)


@dataclass(frozen=True, slots=True)
class _Box:
    """One element: its head in bold, its text, a class for its kind, and the target of its link."""

    head: str
    text: str
    kind: str
    link: str = ""


def draw(case: Case) -> str:
    """The picture. Deterministic: same case, same bytes."""
    parts: list[str] = []
    y = GAP
    if case.earlier:
        parts.append(f'<text x="{GAP}" y="{2 * GAP}">{escape(clean(case.title))}</text>')
        y += 3 * GAP
    for root, strategy, children in _modules(case):
        y = _panel(parts, y, root, strategy, children)
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {y}" width="{WIDTH}" height="{y}" role="img" '
        f"aria-label={quoteattr(clean(f'The argument for {case.title}, module by module'))}>"
    )
    return f"{head}<style>{STYLE}</style>{''.join(parts)}</svg>\n"


def _modules(case: Case) -> Iterator[tuple[_Box, str, Sequence[_Box]]]:
    for module in requirement_modules(case):
        r = module.requirement
        link = f"argument.html#{anchor('requirement:' + r.id)}"
        below = [
            _Box(title, words, "away", f"argument.html#{anchor('node:' + node)}") for node, title, words in module.away
        ]
        if module.conditions:
            below.append(_Box("Composition", module.conditions, "sol", "system.html#obligations"))
        if module.supposes:
            below.append(_Box("assumes", ", ".join(module.supposes), "asm", "argument.html#assumptions"))
        yield _Box(f"{r.id}: {r.level}", r.words, f"goal {r.tone}", link), module.strategy, below
    bases = {basis.node: basis for basis in case.answers.bases}
    for node in node_modules(case):
        link = f"argument.html#{anchor('node:' + node.node.name)}"
        root = _Box(node.node.title, f"What {node.node.title} guarantees", "goal", link)
        if len(node.guarantees) > _MOST:
            yield root, "", [_Box(part, "", "goal", link) for part in bases[node.node.name].words.split(", ")]
            continue
        below = []
        for view in node.guarantees:
            place = f"argument.html#{anchor(view.id)}"
            below.append(_Box(view.standing.value, view.obligation.claim, f"goal {shade(view)}", place))
        yield root, "", below


def _panel(parts: list[str], y: int, root: _Box, strategy: str, children: Sequence[_Box]) -> int:
    """Draws one module from `y` on; returns where the next one begins."""
    left, wide = WIDTH // 6, WIDTH * 2 // 3
    y = _draw_box(parts, left, y, wide, root)
    if strategy:
        y = _stem(parts, y)
        y = _draw_box(parts, left, y, wide, _Box("", strategy, "str"))
    if children:
        y = _stem(parts, y)
        column = (WIDTH - GAP * (COLUMNS + 1)) // COLUMNS
        for at in range(0, len(children), COLUMNS):
            row = children[at : at + COLUMNS]
            height = max(_height_of(box, column) for box in row)
            for place, box in enumerate(row):
                _draw_box(parts, GAP + place * (column + GAP), y, column, box, height)
            y += height + GAP
    return y + 3 * GAP


def _stem(parts: list[str], y: int) -> int:
    parts.append(f'<path class="stem" d="M{WIDTH // 2} {y}v{GAP}"/>')
    return y + GAP


def _draw_box(parts: list[str], x: int, y: int, width: int, box: _Box, height: int = 0) -> int:
    """Appends a box, as high as its text needs or as `height` says; returns the y coordinate of its lower edge."""
    heads, lines = _texts(box, width)
    height = height or _height_of(box, width)
    radius = ' rx="12"' if "asm" in box.kind or "sol" in box.kind else ""
    body = [f'<rect class="b {box.kind}"{radius} x="{x}" y="{y}" width="{width}" height="{height}"/>']
    for at, line in enumerate((*heads, *lines)):
        style = ' class="h"' if at < len(heads) else ""
        body.append(f'<text{style} x="{x + _PAD}" y="{y + _PAD + SIZE + at * _LINE - 1}">{escape(line)}</text>')
    drawn = "".join(body)
    parts.append(f"<a href={quoteattr(clean(box.link))}>{drawn}</a>" if box.link else drawn)
    return y + height


def _texts(box: _Box, width: int) -> tuple[list[str], list[str]]:
    room = width - 2 * _PAD
    return wrap(box.head, room * 0.93), wrap(box.text, room)


def _height_of(box: _Box, width: int) -> int:
    """The height in pixels that the box needs at that width."""
    return 2 * _PAD + _LINE * sum(map(len, _texts(box, width)))


def width_of(text: str) -> float:
    """An upper bound in pixels: the text's width in DejaVu Sans, plus 8 %."""
    return 1.08 * SIZE * sum(_WIDTHS.get(c, 1000) for c in text) / 1000


def wrap(text: str, room: float) -> list[str]:
    """Lines that fit; a word that is too long is broken."""
    lines: list[str] = []
    line = ""
    for found in clean(text).split():
        rest = found
        while rest:
            longer = f"{line} {rest}".strip()
            if width_of(longer) <= room:
                line, rest = longer, ""
            elif line:
                lines.append(line)
                line = ""
            else:
                cut = next((n for n in range(len(rest), 1, -1) if width_of(rest[:n]) <= room), 1)
                lines.append(rest[:cut])
                rest = rest[cut:]
    return [*lines, line] if line else lines
