"""A hazard as a bow-tie diagram: causes on the left, the mitigations as barriers, the hazard, its consequences on the
right."""

from __future__ import annotations

from collections.abc import Sequence
from xml.sax.saxutils import quoteattr

from avow.assurance.hazards import HazardView
from avow.report.gsn_svg import GAP, STYLE, WIDTH, Box, draw_box, height_of
from avow.report.wording import clean

_COLUMNS = {"cause": (GAP, 152), "barrier": (192, 176), "hazard": (400, 144), "effect": (576, 136)}
"""Left edge and width of each column, in pixels."""


def bowtie(view: HazardView) -> str:
    """The diagram as SVG. Deterministic: the same hazard gives the same bytes."""
    hazard = view.hazard
    causes = [Box("", text, "asm") for text in hazard.causes] or [Box("", "no cause is recorded", "asm")]
    effects = [Box("", text, "asm") for text in hazard.consequences] or [Box("", "no consequence is recorded", "asm")]
    barriers = [Box(f"{m.name}: {m.level}", m.words, f"goal {_tone(m.level.holds)}") for m in view.mitigations]
    barriers = barriers or [Box("no mitigation", "", "goal red")]
    levels = ", ".join(part for part in (hazard.severity, hazard.exposure) if part)
    event = Box(hazard.id, f"{hazard.text} ({levels})", f"goal {view.tone}")
    columns = {"cause": causes, "barrier": barriers, "hazard": [event], "effect": effects}
    height = max(_height(boxes, _COLUMNS[name][1]) for name, boxes in columns.items()) + 2 * GAP
    middle = height // 2
    lines: list[str] = []
    parts: list[str] = []
    for name, boxes in columns.items():
        left, width = _COLUMNS[name]
        y = (height - _height(boxes, width)) // 2
        for box in boxes:
            end = draw_box(parts, left, y, width, box)
            at = (y + end) // 2
            if name in ("cause", "barrier"):
                target = _COLUMNS["barrier" if name == "cause" else "hazard"][0]
                lines.append(f'<path class="stem" d="M{left + width} {at}L{target} {middle}"/>')
            elif name == "effect":
                hazard_left, hazard_width = _COLUMNS["hazard"]
                lines.append(f'<path class="stem" d="M{hazard_left + hazard_width} {middle}L{left} {at}"/>')
            y = end + GAP
    label = quoteattr(clean(f"Bow-tie of hazard {hazard.id}: {hazard.text}"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" width="{WIDTH}" height="{height}" '
        f'role="img" aria-label={label}><style>{STYLE}</style>{"".join(lines)}{"".join(parts)}</svg>\n'
    )


def _height(boxes: Sequence[Box], width: int) -> int:
    return sum(height_of(box, width) for box in boxes) + GAP * (len(boxes) - 1)


def _tone(holds: bool) -> str:
    return "green" if holds else "red"
