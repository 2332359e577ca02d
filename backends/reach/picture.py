"""Enclosures as a table and as a picture."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from markupsafe import escape

from avow.base.plain import decimal

from .truth import Span

_WIDTH, _HEIGHT, _LEFT = 640, 120, 90
_MOST = Fraction(10) ** 300


@dataclass(frozen=True, slots=True)
class Piece:
    """What is enclosed from one time to another (of a map: after a step, and both are its number)."""

    start: Fraction
    end: Fraction
    states: Mapping[str, Span]
    outputs: Mapping[str, Span]
    """One that may have no value is left out."""


def shown(number: Fraction) -> str:
    """For people: exact if that is short."""
    exact = decimal(number)
    return exact if exact is not None and len(exact) <= 9 else f"{_near(number):.6g}"


def _near(number: Fraction) -> float:
    return float(max(-_MOST, min(_MOST, number)))


def table(pieces: Sequence[Piece], unit: str) -> str:
    """CSV, a line for each piece; bounds are rounded outward."""
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    names = [*pieces[0].states, *dict.fromkeys(name for piece in pieces for name in piece.outputs)]
    writer.writerow([f"from ({unit})", f"to ({unit})", *(f"{name} {end}" for name in names for end in ("min", "max"))])
    for piece in pieces:
        spans = [{**piece.states, **piece.outputs}.get(name) for name in names]
        bounds = [text for span in spans for text in (_rounded(span) if span else ("", ""))]
        writer.writerow([shown(piece.start), shown(piece.end), *bounds])
    return out.getvalue()


def _rounded(span: Span) -> tuple[str, str]:
    from .series import around

    return repr(around(span.low)[0]), repr(around(span.high)[1])


def picture(pieces: Sequence[Piece], unit: str) -> str:
    """SVG: a band over time for each output."""
    names = list(dict.fromkeys(name for piece in pieces for name in piece.outputs))
    end = max(float(pieces[-1].end), 1e-9)
    height = (_HEIGHT + 20) * len(names) + 20
    parts = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH + _LEFT + 10} {height}" font-size="11">']
    for row, name in enumerate(names):
        known = [(piece, piece.outputs[name]) for piece in pieces if name in piece.outputs]
        low, high = _near(min(span.low for _, span in known)), _near(max(span.high for _, span in known))
        top, scale = 10 + row * (_HEIGHT + 20), _HEIGHT / max(high - low, 1e-9)
        parts.append(f'<g transform="translate({_LEFT},{top})"><title>{escape(name)}</title>')
        for piece, span in known:
            x, y = float(piece.start) / end * _WIDTH, (high - _near(span.high)) * scale
            wide = max(float(piece.end - piece.start) / end * _WIDTH, 1.0)
            tall = max(_near(span.high - span.low) * scale, 1.0)
            parts.append(f'<rect x="{x:.1f}" y="{y:.1f}" width="{wide:.1f}" height="{tall:.1f}" fill="#4878a8"/>')
        parts.append(f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="none" stroke="#888"/>')
        for y, text in ((8, f"{high:.4g}"), (_HEIGHT // 2, escape(name)), (_HEIGHT, f"{low:.4g}")):
            parts.append(f'<text x="-6" y="{y}" text-anchor="end">{text}</text>')
        parts.append("</g>")
    parts.append(f'<text x="{_LEFT + _WIDTH}" y="{height - 6}" text-anchor="end">{end:.4g} {unit}</text></svg>')
    return "\n".join(parts) + "\n"
