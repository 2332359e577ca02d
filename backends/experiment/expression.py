"""A tiny language for what is measured: ``hypot(x - goal_x, y - goal_y)`` over the columns of a data set.

Own grammar, own evaluator: text from a plan is never Python. Arithmetic is exact; a square root is enclosed between
two fractions that are 10^-12 apart, and the enclosure is carried along, so a comparison is decided or known not to be.

    sum: product (("+" | "-") product)*     product: factor (("*" | "/") factor)*     factor: "-" factor | atom
    atom: number | column | function "(" sum ("," sum)* ")" | "(" sum ")"
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction

from .statistics import root
from .tuning import EXPRESSION_DEPTH, EXPRESSION_LENGTH

_TOKEN = re.compile(r"\s*(?:(\d{1,40}(?:\.\d{1,40})?)|([^\W\d]\w*)|([-+*/(),]))")


class Malformed(Exception):  # noqa: N818 - it names what the text is
    """Not an expression: `position` counts characters from 0."""

    def __init__(self, message: str, position: int) -> None:
        super().__init__(message)
        self.message = message
        self.position = position


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
    """Raises ZeroDivisionError, and ValueError for a root of a negative number."""
    numbers: tuple[str, ...] = ()
    """Those that stand in it: a factor or an offset moves the tolerance."""
    scales: tuple[str, ...] = ()
    """The columns that multiply or divide: one that is the same in every run is a factor, too."""


def parse(text: str) -> Expression:
    """Raises Malformed."""
    if len(text) > EXPRESSION_LENGTH:
        raise Malformed(f"longer than {EXPRESSION_LENGTH} characters", 0)
    parser = _Parser(text)
    value = parser.sum(0)
    parser.end()
    columns, scales = dict.fromkeys(parser.columns), dict.fromkeys(parser.scales)
    return Expression(text, tuple(columns), value, tuple(parser.numbers), tuple(scales))


_Eval = Callable[[Mapping[str, Fraction]], Interval]


def _negative(a: Interval) -> Interval:
    return Interval(-a.high, -a.low)


def _plus(a: Interval, b: Interval) -> Interval:
    return Interval(a.low + b.low, a.high + b.high)


def _minus(a: Interval, b: Interval) -> Interval:
    return Interval(a.low - b.high, a.high - b.low)


def _times(a: Interval, b: Interval) -> Interval:
    corners = (a.low * b.low, a.low * b.high, a.high * b.low, a.high * b.high)
    return Interval(min(corners), max(corners))


def _over(a: Interval, b: Interval) -> Interval:
    if b.low <= 0 <= b.high:
        raise ZeroDivisionError
    return _times(a, Interval(1 / b.high, 1 / b.low))


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


def _mean(*items: Interval) -> Interval:
    return Interval(
        sum((i.low for i in items), Fraction(0)) / len(items), sum((i.high for i in items), Fraction(0)) / len(items)
    )


def _max(*items: Interval) -> Interval:
    return Interval(max(i.low for i in items), max(i.high for i in items))


FUNCTIONS: Mapping[str, tuple[Callable[..., Interval], int, int]] = {
    "abs": (_abs, 1, 1),
    "sqrt": (_sqrt, 1, 1),
    "hypot": (_hypot, 1, 8),
    "max": (_max, 1, 8),
    "mean": (_mean, 1, 8),
}
"""Name → function, least and greatest number of arguments. No `min`: a measure that is cut off lets any run succeed."""


class _Parser:
    def __init__(self, text: str) -> None:
        self.text = text
        self.columns: list[str] = []
        self.numbers: list[str] = []
        self.scales: list[str] = []
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
            raise Malformed(f"expected '{sign}', found {text!r}" if text else f"expected '{sign}' at the end", position)

    def end(self) -> None:
        kind, text, position = self.peek()
        if kind != "end":
            raise Malformed(f"unexpected {text!r}", position)

    def sum(self, depth: int) -> _Eval:
        value = self.product(depth)
        while sign := self.accept("+", "-"):
            value = _both(_plus if sign == "+" else _minus, value, self.product(depth))
        return value

    def product(self, depth: int) -> _Eval:
        first = len(self.columns)
        value = self.factor(depth)
        while sign := self.accept("*", "/"):
            value = _both(_times if sign == "*" else _over, value, self.factor(depth))
            self.scales += self.columns[first:]
        return value

    def factor(self, depth: int) -> _Eval:
        if depth > EXPRESSION_DEPTH:
            raise Malformed(f"nested deeper than {EXPRESSION_DEPTH} levels", self.peek()[2])
        if self.accept("-"):
            return _each(_negative, (self.factor(depth + 1),))
        if self.accept("("):
            inner = self.sum(depth + 1)
            self.expect(")")
            return inner
        kind, text, position = self.take()
        if kind == "number":
            constant = Interval.of(Fraction(text))
            self.numbers.append(text)
            return lambda _row: constant
        if kind != "name":
            found = repr(text) if text else "the end"
            raise Malformed(f"expected a number, a column or '(', found {found}", position)
        if self.accept("("):
            return self.call(text, position, depth)
        self.columns.append(text)
        return lambda row: Interval.of(row[text])

    def call(self, name: str, position: int, depth: int) -> _Eval:
        if name not in FUNCTIONS:
            raise Malformed(f"no function '{name}'; there are {', '.join(sorted(FUNCTIONS))}", position)
        arguments = [self.sum(depth + 1)]
        while self.accept(","):
            arguments.append(self.sum(depth + 1))
        self.expect(")")
        function, least, greatest = FUNCTIONS[name]
        if not least <= len(arguments) <= greatest:
            wanted = str(least) if least == greatest else f"{least} to {greatest}"
            raise Malformed(f"'{name}' takes {wanted} arguments, not {len(arguments)}", position)
        return _each(function, tuple(arguments))


def _both(function: Callable[[Interval, Interval], Interval], left: _Eval, right: _Eval) -> _Eval:
    return lambda row: function(left(row), right(row))


def _each(function: Callable[..., Interval], arguments: tuple[_Eval, ...]) -> _Eval:
    return lambda row: function(*(argument(row) for argument in arguments))
