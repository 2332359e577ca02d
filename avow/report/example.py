"""A counterexample as small tables: values one below the other, a run step by step with what changed, long runs cut.

The tool's own notation (names in parentheses, see `Counterexample`) is set apart, in small print.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.base.records import dataclass
from avow.base.tuning.shown import ROWS_LEFT_OUT, RUN_ROWS
from avow.base.verdict import Counterexample

ANOTHER = " (another)"
"""The suffix of the name of a second value that the contract allows as well."""
_FIRST, _LAST = 8, 12
"""Rows of a long run that are shown on paper, which cannot scroll: the start, and the end, where it goes wrong."""


@dataclass(frozen=True, slots=True)
class Value:
    name: str
    value: str
    other: str = ""


@dataclass(frozen=True, slots=True)
class Cell:
    text: str
    new: bool
    """Whether it differs from the step before."""


@dataclass(frozen=True, slots=True)
class StepRow:
    """One step, or several consecutive steps in which no value of the contract changes."""

    label: str
    cells: tuple[Cell, ...]
    small: str
    returns: bool
    """Whether the run returns to it."""
    middle: bool
    """Left out if there is little room."""


@dataclass(frozen=True, slots=True)
class Run:
    columns: tuple[str, ...]
    rows: tuple[StepRow, ...]
    small: bool
    """Whether any row has small print."""
    left_out: int
    """The number of rows in the middle."""
    beyond: int
    """Steps that are not shown at all."""


def is_small(name: str) -> bool:
    """Whether a name is the tool's, not the contract's."""
    return name.startswith("(")


def bare(name: str) -> str:
    return name.removeprefix("(").removesuffix(")")


def values(example: Counterexample) -> tuple[Value, ...]:
    """The contract's values, each with the other allowed value, if that differs."""
    others = {n.removesuffix(ANOTHER): v for n, v in example.values if n.endswith(ANOTHER)}
    found = [Value(n, v, others.pop(n, "")) for n, v in example.values if not n.endswith(ANOTHER) and not is_small(n)]
    return (*found, *(Value(name, "", other) for name, other in others.items()))


def small_values(example: Counterexample) -> str:
    """The values that have the tool's own names, in a line."""
    return "; ".join(f"{bare(name)}: {value}" for name, value in example.values if is_small(name))


def run(example: Counterexample) -> Run:
    """The trace as a table."""
    columns = tuple(dict.fromkeys(n for step in example.trace for n, _ in step if not is_small(n)))
    rows: list[StepRow] = []
    before: tuple[str, ...] | None = None
    for first, last in _groups(example, columns):
        told = tuple(_text(example, last, name) for name in columns)
        changed = [before is not None and text != old for text, old in zip(told, before or told, strict=True)]
        label = str(first) if first == last else f"{first}–{last}"
        small = "; ".join(f"{bare(n)}: {v}" for n, v in example.trace[last] if is_small(n))
        cells = tuple(Cell(text, new) for text, new in zip(told, changed, strict=True))
        rows.append(StepRow(label, cells, small, first == example.loop, False))
        before = told
    shown = rows[:RUN_ROWS]
    if len(shown) > _FIRST + _LAST + ROWS_LEFT_OUT:
        shown = [
            StepRow(r.label, r.cells, r.small, r.returns, _FIRST <= at < len(shown) - _LAST)
            for at, r in enumerate(shown)
        ]
    middle = sum(row.middle for row in shown)
    return Run(columns, tuple(shown), any(row.small for row in shown), middle, len(rows) - len(shown))


def _groups(example: Counterexample, columns: Sequence[str]) -> Iterator[tuple[int, int]]:
    """The first and last of consecutive steps with the same values of the contract; no group crosses the start of the
    loop."""
    if not columns:  # only the tool's names: each step is a group of its own
        yield from ((at, at) for at in range(len(example.trace)))
        return
    start = 0
    told = [tuple(_text(example, at, name) for name in columns) for at in range(len(example.trace))]
    for at in range(1, len(told) + 1):
        if at == len(told) or told[at] != told[at - 1] or at == example.loop:
            yield start, at - 1
            start = at


def _text(example: Counterexample, step: int, name: str) -> str:
    return next((value for n, value in example.trace[step] if n == name), "")
