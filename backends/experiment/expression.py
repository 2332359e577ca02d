"""A tiny language for what is measured: ``hypot(x - goal_x, y - goal_y)`` over the columns of a data set.

Own grammar (`measure.lark`), own evaluator: text from a plan is never Python. Nothing can be written down that is the
same in every run or less than what was measured: no numbers, no products, no column held against itself.

Arithmetic is exact; a square root is enclosed between two fractions that are 10^-12 apart, and the enclosure is carried
along, so a comparison is decided or known not to be.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avow.base.grammars import lark_of
from avow.base.records import dataclass

from .statistics import root
from .tuning import EXPRESSION_DEPTH, EXPRESSION_LENGTH

if TYPE_CHECKING:
    from lark import Token
    from lark.exceptions import UnexpectedInput

ALLOWED = "a measure is a column, the difference of two columns, or abs, hypot or max of these"


class Malformed(Exception):  # noqa: N818 - it names what the text is
    """Not a measure: `position` counts characters from 0; `code` is EXP106 where it could flatter."""

    def __init__(self, message: str, position: int, code: str = "EXP103") -> None:
        super().__init__(message)
        self.message = message
        self.position = position
        self.code = code


@dataclass(frozen=True, slots=True)
class Interval:
    """A real number that is somewhere from `low` to `high`; usually they are the same."""

    low: Fraction
    high: Fraction

    @staticmethod
    def of(value: Fraction) -> Interval:
        return Interval(value, value)


@dataclass(frozen=True, slots=True)
class Expression:
    """A measure that has been parsed. `columns` are those that it reads, in order of first use."""

    text: str
    columns: tuple[str, ...]
    evaluate: Callable[[Mapping[str, Fraction]], Interval]
    """Raises ValueError where a part of a `max` is negative, which would be hidden."""
    halves: bool
    """Whether it takes half a width, the distance from a centre that is free."""


def parse(text: str) -> Expression:
    """Raises Malformed."""
    from lark.exceptions import UnexpectedInput  # a run that measures nothing imports no grammar

    if len(text) > EXPRESSION_LENGTH:
        raise Malformed(f"longer than {EXPRESSION_LENGTH} characters", 0)
    try:
        part: _Part = lark_of(Path(__file__).with_name("measure.lark"), "measure", ("measure",), _Build).parse(text)
    except UnexpectedInput as error:
        raise _unexpected(text, error) from None
    return Expression(text, tuple(dict.fromkeys(part.columns)), part.value, part.halves)


_Eval = Callable[[Mapping[str, Fraction]], Interval]


def _abs(a: Interval) -> Interval:
    if a.low >= 0:
        return a
    return Interval(-a.high, -a.low) if a.high <= 0 else Interval(Fraction(0), max(-a.low, a.high))


def _hypot(*items: Interval) -> Interval:
    sides = [_abs(item) for item in items]
    low, high = sum((s.low**2 for s in sides), Fraction(0)), sum((s.high**2 for s in sides), Fraction(0))
    return Interval(root(low)[0], root(high)[1])


def _max(*items: Interval) -> Interval:
    if any(i.low < 0 for i in items):
        raise ValueError("a part of 'max' is negative; use abs(…)")
    return Interval(max(i.low for i in items), max(i.high for i in items))


FUNCTIONS: Mapping[str, tuple[Callable[..., Interval], int]] = {
    "abs": (_abs, 1),
    "hypot": (_hypot, 8),
    "max": (_max, 8),
}
"""Name → function, greatest number of arguments. No `min`, `sqrt` or `mean`: they make less of what was measured."""


def _unexpected(text: str, error: UnexpectedInput) -> Malformed:
    from lark.exceptions import UnexpectedToken

    at = len(text) if isinstance(error, UnexpectedToken) and error.token.type == "$END" else error.pos_in_stream or 0
    wanted = "a column" if isinstance(error, UnexpectedToken) and "NAME" in error.accepts else "',' or ')'"
    if at == len(text):
        return Malformed(f"expected {wanted} at the end", at)
    whole = isinstance(error, UnexpectedToken) and "$END" in error.accepts
    flatters = whole or re.match(r"[\d+*/(-]", text[at:])
    return Malformed(f"unexpected {text[at]!r}: {ALLOWED}", at, "EXP106" if flatters else "EXP103")


@dataclass(frozen=True, slots=True)
class _Part:
    value: _Eval
    columns: tuple[str, ...]
    at: int
    depth: int = 0
    name: str = ""
    """Of a column by itself."""
    of: frozenset[str] = frozenset()
    """Of which two columns it may be one end: the column, or those of a `max` of two."""
    halves: bool = False


class _Build:
    """A callback for each rule; Lark's loop does not recurse."""

    def column(self, c: list[Token]) -> _Part:
        name = str(c[0])
        return _Part(lambda row: Interval.of(row[name]), (name,), c[0].start_pos or 0, name=name, of=frozenset((name,)))

    def difference(self, c: list[Any]) -> _Part:
        left, other = c[0], str(c[1])
        if not left.name:
            raise Malformed(f"a difference is of two columns: {ALLOWED}", left.at, "EXP106")
        if left.name == other:
            raise Malformed(f"'{other} - {other}' is 0 in every run", left.at, "EXP106")
        return _Part(lambda row: Interval.of(row[left.name] - row[other]), (left.name, other), left.at)

    def half(self, c: list[Any]) -> _Part:
        left, word, *ends = c
        if word != "mean":
            raise Malformed(f"a difference is of two columns: {ALLOWED}", word.start_pos, "EXP106")
        one, two = [end.name for end in ends] if len(ends) == 2 else ("", "")
        if one == two or not left.of or not left.of <= {one, two}:
            raise Malformed("half a width is max(a, b) - mean(a, b), of two different columns", left.at, "EXP106")

        def value(row: Mapping[str, Fraction]) -> Interval:
            whole, centre = left.value(row), (row[one] + row[two]) / 2
            return Interval(whole.low - centre, whole.high - centre)

        return _Part(value, (*left.columns, one, two), left.at, left.depth, halves=True)

    def call(self, c: list[Any]) -> _Part:
        name, parts, at = str(c[0]), c[1:], c[0].start_pos
        if name not in FUNCTIONS:
            raise Malformed(f"no function '{name}'; there are {', '.join(sorted(FUNCTIONS))}", at, "EXP106")
        function, greatest = FUNCTIONS[name]
        if len(parts) > greatest:
            raise Malformed(f"'{name}' takes at most {greatest} arguments, not {len(parts)}", at)
        depth = 1 + max(part.depth for part in parts)
        if depth > EXPRESSION_DEPTH:
            raise Malformed(f"nested deeper than {EXPRESSION_DEPTH} levels", at)
        ends = frozenset(part.name for part in parts) if name == "max" and len(parts) == 2 else frozenset()
        value: _Eval = lambda row: function(*(part.value(row) for part in parts))  # noqa: E731 - as the others
        columns = tuple(column for part in parts for column in part.columns)
        halves = any(part.halves for part in parts)
        return _Part(value, columns, at, depth, of=frozenset() if "" in ends else ends, halves=halves)
