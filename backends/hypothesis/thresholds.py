"""The numbers, texts and lengths at which something may change: those of the contract and of the unit under test."""

from __future__ import annotations

import ast
import itertools
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction

from avow.backend_kit.programs.samples import numbers_of, worked_out
from avow.language.sorts import IntegerSort, NaturalSort, RealSort
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Compare, Literal, Negative, Term, Widen

from . import tuning

_STEP = Fraction(1, 1000)
"""How close to a threshold a value is tried on either side."""


_Sum = dict[Term | None, Fraction]
"""The coefficients of what is no arithmetic, and the constant under None."""


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The simplest value of each comes first: it is what a failing case is shrunk towards. `few` are the constants of
    the contract and small numbers, so few that two draws often meet."""

    constants: tuple[Fraction, ...]
    """What contract and program write down."""
    numbers: tuple[Fraction, ...]
    """What lies around these, and what is calculated from them."""
    few: tuple[Fraction, ...]
    texts: tuple[str, ...]
    lengths: tuple[int, ...]


def thresholds(formulas: Iterable[Term], program: Iterable[str], parameters: Iterable[Fraction]) -> Thresholds:
    """From the formulas, the texts of Python sources, and the numbers of a class's parameters."""
    stated = list(formulas)
    parts = [part for formula in stated for part in subterms(formula)]
    contract = {*numbers_of(stated), *(n for part in parts if isinstance(part, Compare) for n in _meeting(part))}
    said = {part.value for part in parts if isinstance(part, Literal) and isinstance(part.value, str)}
    of_program = [*itertools.islice(_constants(program), tuning.CONSTANTS_READ)]
    texts = said | {text for text in of_program if isinstance(text, str)}
    own = {number for number in of_program if not isinstance(number, str)} | set(parameters)
    few = _simple(own)[: tuning.CONSTANTS_COMBINED]
    calculated = {m for a in few for b in few for m in (a + b, a * b)}
    numbers = contract | own | {-number for number in own} | calculated
    small = sorted(contract)[: tuning.CONSTANTS_COMBINED]
    around = {n + d for n in numbers - calculated | {Fraction(0)} for d in (-1, -_STEP, 0, _STEP, 1)}
    between = {(a + b) / 2 for a, b in itertools.pairwise(sorted(numbers | {Fraction(0)}))}
    combined = {a + b for a in small for b in small} | {a - b for a in small for b in small}
    beside = {beside for n in numbers - calculated for beside in _neighbours(n)}
    beside |= {n + d for n in calculated for d in (-1, 0, 1)}
    far = {2 * max(numbers, default=Fraction(0)) + 100, min(numbers, default=Fraction(0)) - 100}
    whole = {int(n) for n in contract | own | calculated if n.denominator == 1 and 0 < n <= tuning.LONGEST_SEQUENCE}
    lengths = {n + d for n in whole for d in (-1, 0, 1)} if len(whole) <= tuning.CONSTANTS_COMBINED else whole
    return Thresholds(
        _simple({Fraction(0), *contract, *own}),
        _simple(around | between | combined | beside | far),
        _simple({*map(Fraction, range(tuning.SMALL)), *contract}),
        tuple(sorted({"", *(v for text in texts for v in _variants(text))}, key=lambda s: (len(s), s))),
        tuple(sorted(n for n in lengths | {*tuning.LONG_SEQUENCES} if n > 0)),
    )


def _simple(numbers: Iterable[Fraction]) -> tuple[Fraction, ...]:
    return tuple(sorted(set(numbers), key=lambda n: (n.denominator, n < 0, abs(n))))


def _variants(text: str) -> tuple[str, ...]:
    """Texts that a careless comparison takes for this one."""
    return (
        text,
        f" {text}",
        f"{text} ",
        text.upper(),
        text.capitalize(),
        f"{text}x",
        f"x{text}",
        text[:-1],
        text[::-1],
    )


def _constants(program: Iterable[str]) -> Iterator[Fraction | str]:
    """The numbers and short texts that Python sources write down, calculated numbers (``2**31 - 1``) among them."""
    for text in program:
        try:
            tree = ast.parse(text)
            calculated = [*worked_out(compile(tree, "", "exec", dont_inherit=True))]
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        documentation = {id(part.value) for part in ast.walk(tree) if isinstance(part, ast.Expr)}
        written = (part for part in ast.walk(tree) if isinstance(part, ast.Constant) and id(part) not in documentation)
        for value in (*(part.value for part in written), *calculated):
            match value:
                case bool():
                    pass
                case int() if abs(value) <= tuning.LARGEST_CONSTANT:
                    yield Fraction(value)
                case float() if abs(value) <= tuning.LARGEST_CONSTANT:
                    yield Fraction(repr(value))
                    yield Fraction(value)  # as the machine has it
                case str() if len(value) <= tuning.LONGEST_TEXT:
                    yield value


def _neighbours(number: Fraction) -> Iterator[Fraction]:
    """The doubles next to a number on either side."""
    try:
        near = float(number)
    except OverflowError:
        return
    for end in (-math.inf, math.inf):
        beside = math.nextafter(near, end)
        if math.isfinite(beside) and abs(beside) > tuning.TINY:
            yield Fraction(beside)


def _meeting(comparison: Compare) -> set[Fraction]:
    """Where the two sides meet, if all that is open is one value: ``4 * gauge < 20`` has its threshold at 5."""
    left, right = _linear(comparison.left), _linear(comparison.right)
    apart = _plus(left, right, Fraction(-1)) if left is not None and right is not None else {}
    slopes = [slope for part, slope in apart.items() if part is not None]
    if len(slopes) != 1:
        return set()
    meeting = -apart.get(None, Fraction(0)) / slopes[0]
    return {meeting, Fraction(math.floor(meeting)), Fraction(math.ceil(meeting))}


def _plus(one: _Sum, other: _Sum, factor: Fraction) -> _Sum:
    parts = dict.fromkeys((*one, *other))
    total = {part: one.get(part, Fraction(0)) + factor * other.get(part, Fraction(0)) for part in parts}
    return {part: coefficient for part, coefficient in total.items() if coefficient}


def _linear(term: Term) -> _Sum | None:
    """A sum over what is no arithmetic; None if it is not linear in it."""
    match term:
        case Literal(value=bool() | str()):
            return None
        case Literal(value=value):
            return {None: Fraction(value)}
        case Widen(term=inner):
            return _linear(inner)
        case Negative(term=inner):
            turned = _linear(inner)
            return None if turned is None else _plus({}, turned, Fraction(-1))
        case Arithmetic(operator=operator, left=left, right=right):
            one, other = _linear(left), _linear(right)
            if one is None or other is None:
                return None
            match operator:
                case "+" | "-":
                    return _plus(one, other, Fraction(1 if operator == "+" else -1))
                case "*" if other.keys() <= {None}:
                    return _plus({}, one, other.get(None, Fraction(0)))
                case "*" if one.keys() <= {None}:
                    return _plus({}, other, one.get(None, Fraction(0)))
                case "/" if other.keys() == {None}:
                    return _plus({}, one, 1 / other[None])
            return None
        case _ if isinstance(term.sort, RealSort | IntegerSort | NaturalSort):
            return {term: Fraction(1)}
    return None
