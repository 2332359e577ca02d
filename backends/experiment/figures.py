"""Printed figures of an experiment (number of runs, mean, extremes, deviation): can they all be true, and what follows?

Where the runs themselves are not published, the figures still say much: the extremes force a least deviation, and a
greatest value beyond the tolerance is a run that failed. Every figure stands for all that its rounding may hide.
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction
from pathlib import Path

from avow.backend_kit.given import file_bytes
from avow.base.diagnostics import Diagnostic, Rejected, Severity
from avow.base.records import dataclass
from avow.system.strict_yaml import Piece, read_yaml

from .quantity import conversion, figure, show
from .statistics import Range, greatest_deviation, least_deviation, root

_KEYS = ("n", "unit", "mean", "min", "max", "sd", "source", "note")


@dataclass(frozen=True, slots=True)
class Figures:
    """What is printed, in one unit. A figure that is not given is None."""

    runs: int
    unit: str
    mean: Range | None
    least: Range | None
    greatest: Range | None
    deviation: Range | None
    printed: Mapping[str, str]
    source: str


def read_figures(path: Path, unit: str) -> Figures:
    """Raises Rejected. `unit` is that of the plan; the file's own `unit` is that of its figures without one."""
    piece, problems = read_yaml(file_bytes(path, "EXP102"), str(path))
    found = [p for p in problems if p.severity is Severity.ERROR]
    if piece.entries is None:
        raise Rejected(*found, Diagnostic("EXP121", "expected figures by name (n, mean, min, max, sd)", piece.span))
    for key in piece.entries:
        if key not in _KEYS:
            found.append(
                Diagnostic("EXP121", f"'{key}' is no figure", piece.key_span(key), hint=f"known: {', '.join(_KEYS)}")
            )
    own = _scalar(piece, "unit") or unit
    if not unit:
        unit = own
    if conversion(own, unit) is None:
        found.append(Diagnostic("EXP104", f"cannot convert '{own}' into '{unit}'", piece.entries["unit"].span))
    runs = piece.entries.get("n")
    count = runs.value if runs is not None else None
    if runs is None or not isinstance(count, int) or isinstance(count, bool) or not 1 <= count <= 100_000:
        found.append(
            Diagnostic("EXP122", "n must be the number of runs, from 1 to 100000", runs.span if runs else piece.span)
        )
    printed: dict[str, str] = {}
    ranges: dict[str, Range] = {}
    for key in ("mean", "min", "max", "sd"):
        if key in piece.entries:
            entry = piece.entries[key]
            printed[key] = entry.text
            made = _figure(key, entry, own, unit)
            if isinstance(made, Range):
                ranges[key] = made
            else:
                found.append(made)
    if not ranges and not found:
        found.append(Diagnostic("EXP121", "no figure at all: expected mean, min, max or sd", piece.span))
    if found:
        raise Rejected(*found)
    assert isinstance(count, int)
    return Figures(
        count,
        unit,
        ranges.get("mean"),
        ranges.get("min"),
        ranges.get("max"),
        ranges.get("sd"),
        printed,
        _scalar(piece, "source") or "",
    )


def contradictions(figures: Figures) -> tuple[str, ...]:
    """Why the figures cannot all be true, in sentences; empty where data with such figures exist or may exist."""
    n, mean, least, greatest, sd = figures.runs, figures.mean, figures.least, figures.greatest, figures.deviation
    unit = f" {figures.unit}" if figures.unit else ""
    if least and greatest and least.low > greatest.high:
        return ("the printed minimum exceeds the printed maximum",)
    if mean and ((least and mean.high < least.low) or (greatest and mean.low > greatest.high)):
        return ("the printed mean does not lie between the printed minimum and maximum",)
    found = []
    if mean and least and greatest:
        if n * mean.high < (n - 1) * least.low + greatest.low:
            found.append(f"{n} runs with this minimum and maximum have a greater mean than printed")
        if n * mean.low > (n - 1) * greatest.high + least.high:
            found.append(f"{n} runs with this minimum and maximum have a smaller mean than printed")
        if sd and n > 1 and not found:
            least_squares = least_deviation(n, mean, least, greatest)
            sample, population = root(least_squares / (n - 1))[0], root(least_squares / n)[0]
            if sd.high < population:
                found.append(
                    f"{n} runs with this mean, minimum and maximum have a standard deviation of at least "
                    f"{show(sample, 2)}{unit} (as a population: {show(population, 2)}{unit}), but "
                    f"{figures.printed['sd']} is printed"
                )
            # The sample deviation, the greater of the two readings, decides here.
            most = root(greatest_deviation(n, mean, least, greatest) / (n - 1))[1]
            if sd.low > most:
                found.append(
                    f"{n} runs between this minimum and maximum have a standard deviation of at most "
                    f"{show(most, 2)}{unit}, but {figures.printed['sd']} is printed"
                )
    return tuple(found)


def failures(figures: Figures, within: Fraction, strict: bool) -> tuple[int, int]:
    """The least and the greatest number of runs that may have exceeded the tolerance, or reached it where `strict`."""
    n, mean, least, greatest = figures.runs, figures.mean, figures.least, figures.greatest
    fewest = 0
    if (greatest and greatest.low > within) or (mean and mean.low > within):
        fewest = 1
    if least and least.low > within:
        fewest = n
    if greatest and (greatest.high < within or (greatest.high == within and not strict)):
        return fewest, fewest
    most = n
    if mean and least and within > least.low and mean.high < within:
        # k runs above the tolerance and n - k no less than the minimum have at least this sum
        most = min(n, int(n * (mean.high - least.low) / (within - least.low)))
    if least and (least.high < within or (least.high == within and not strict)):
        most = min(most, n - 1)
    return fewest, max(most, fewest)


def _figure(key: str, entry: Piece, own: str, unit: str) -> Range | Diagnostic:
    """What it may stand for, or what is wrong with it."""
    if entry.items is not None or entry.entries is not None:
        return Diagnostic("EXP122", f"'{key}' must be one figure, such as '21.4 cm'", entry.span)
    read = figure(entry.text, own)
    if read is None:
        return Diagnostic("EXP122", f"'{entry.text}' is not a figure such as '21.4 cm'", entry.span)
    span = read.within(unit)
    if span is None:
        return Diagnostic("EXP104", f"cannot convert '{entry.text}' into '{unit}'", entry.span)
    if read.value < 0:
        return Diagnostic("EXP122", f"'{key}' of a distance cannot be negative", entry.span)
    return Range(max(span.low, Fraction(0)), span.high)


def _scalar(piece: Piece, key: str) -> str:
    entry = piece.at(key)
    return entry.text if entry is not None and entry.items is None and entry.entries is None else ""
