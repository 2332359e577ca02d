"""A tiny language for what is measured: ``hypot(x - goal_x, y - goal_y)`` over the columns of a data set.

Own grammar, own evaluator: text from a plan is never Python. Nothing can be written down that is the same in every run
or less than what was measured: no numbers, no products, no column held against itself.

    part: ("abs" | "hypot" | "max") "(" part ("," part)* ")" | column | column "-" column | half a width
    half a width: (column | "max" "(" column "," column ")") "-" "mean" "(" column "," column ")", of the same two

Arithmetic is exact; a square root is enclosed between two fractions that are 10^-12 apart, and the enclosure is carried
along, so a comparison is decided or known not to be.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from fractions import Fraction

from avow.base.records import dataclass

from .statistics import root
from .tuning import EXPRESSION_DEPTH, EXPRESSION_LENGTH

_TOKEN = re.compile(r"\s*(?:(\d{1,40}(?:\.\d{1,40})?)|([^\W\d]\w*)|([-+*/(),]))")
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
    if len(text) > EXPRESSION_LENGTH:
        raise Malformed(f"longer than {EXPRESSION_LENGTH} characters", 0)
    parser = _Parser(text)
    value = parser.part(0)
    parser.end()
    return Expression(text, tuple(dict.fromkeys(parser.columns)), value, parser.halves)


_Eval = Callable[[Mapping[str, Fraction]], Interval]


def _minus(a: Interval, b: Interval) -> Interval:
    return Interval(a.low - b.high, a.high - b.low)


def _negative(a: Interval) -> Interval:
    return Interval(-a.high, -a.low)


def _abs(a: Interval) -> Interval:
    if a.low >= 0:
        return a
    return _negative(a) if a.high <= 0 else Interval(Fraction(0), max(-a.low, a.high))


def _square(a: Interval) -> Interval:
    positive = _abs(a)
    return Interval(positive.low**2, positive.high**2)


def _sqrt(a: Interval) -> Interval:
    return Interval(root(a.low)[0], root(a.high)[1])


def _hypot(*items: Interval) -> Interval:
    squares = [_square(i) for i in items]
    return _sqrt(Interval(sum((s.low for s in squares), Fraction(0)), sum((s.high for s in squares), Fraction(0))))


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


class _Parser:
    def __init__(self, text: str) -> None:
        self.text = text
        self.columns: list[str] = []
        self.halves = False
        self.tokens: list[tuple[str, str, int]] = []
        position = 0
        while text[position:].strip():
            match = _TOKEN.match(text, position)
            if match is None:
                at = position + len(text[position:]) - len(text[position:].lstrip())
                raise Malformed(f"unexpected {text[at]!r}", at)
            kind = ("number", "name", "sign")[(match.lastindex or 1) - 1]
            self.tokens.append((kind, match.group(match.lastindex or 1), match.start(match.lastindex or 1)))
            position = match.end()
        self.next = 0

    def peek(self) -> tuple[str, str, int]:
        return self.tokens[self.next] if self.next < len(self.tokens) else ("end", "", len(self.text))

    def take(self) -> tuple[str, str, int]:
        token = self.peek()
        self.next += 1
        return token

    def accept(self, *signs: str) -> str | None:
        kind, text, _ = self.peek()
        if kind == "sign" and text in signs:
            self.next += 1
            return text
        return None

    def expect(self, sign: str) -> None:
        if self.accept(sign) is None:
            _, text, position = self.peek()
            found = f"expected '{sign}', found {text!r}: {ALLOWED}" if text else f"expected '{sign}' at the end"
            raise Malformed(found, position, "EXP106" if text in "+-*/" and text else "EXP103")

    def end(self) -> None:
        kind, text, position = self.peek()
        if kind != "end":
            raise Malformed(f"unexpected {text!r}: {ALLOWED}", position, "EXP106")

    def part(self, depth: int) -> _Eval:
        if depth > EXPRESSION_DEPTH:
            raise Malformed(f"nested deeper than {EXPRESSION_DEPTH} levels", self.peek()[2])
        name, position = self.name()
        if not self.accept("("):
            self.columns.append(name)
            return self.difference(name, lambda row: Interval.of(row[name]), {name}, position)
        if name not in FUNCTIONS:
            raise Malformed(f"no function '{name}'; there are {', '.join(sorted(FUNCTIONS))}", position, "EXP106")
        first = self.next
        arguments = [self.part(depth + 1)]
        while self.accept(","):
            arguments.append(self.part(depth + 1))
        read = {text for kind, text, _ in self.tokens[first : self.next] if kind == "name"}
        plain = self.next - first == 3  # column, comma, column
        self.expect(")")
        function, greatest = FUNCTIONS[name]
        if len(arguments) > greatest:
            raise Malformed(f"'{name}' takes at most {greatest} arguments, not {len(arguments)}", position)
        value: _Eval = lambda row: function(*(argument(row) for argument in arguments))  # noqa: E731 - as the others
        return self.difference("", value, read if name == "max" and plain else set(), position)

    def difference(self, column: str, left: _Eval, read: set[str], position: int) -> _Eval:
        """What follows a column, or a `max`: nothing, another column, or the mean of two columns, each of them read."""
        if not self.accept("-"):
            return left
        other, at = self.name()
        if not self.accept("("):
            if not column:
                raise Malformed(f"a difference is of two columns: {ALLOWED}", position, "EXP106")
            if column == other:
                raise Malformed(f"'{column} - {other}' is 0 in every run", position, "EXP106")
            self.columns.append(other)
            return lambda row: Interval.of(row[column] - row[other])
        if other != "mean":
            raise Malformed(f"a difference is of two columns: {ALLOWED}", at, "EXP106")
        one, _ = self.name()
        self.expect(",")
        two, _ = self.name()
        self.expect(")")
        if one == two or not read or not read <= {one, two}:
            raise Malformed("half a width is max(a, b) - mean(a, b), of two different columns", position, "EXP106")
        self.columns += [one, two]
        self.halves = True
        return lambda row: _minus(left(row), Interval.of((row[one] + row[two]) / 2))

    def name(self) -> tuple[str, int]:
        kind, text, position = self.take()
        if kind == "name":
            return text, position
        if kind == "end":
            raise Malformed("expected a column, found the end", position)
        code = "EXP106" if kind == "number" or text in "-(" else "EXP103"
        raise Malformed(f"expected a column, found {text!r}: {ALLOWED}", position, code)
