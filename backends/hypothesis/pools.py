"""Where generated values come from: the formulas' constants and their neighbours, the scenario, small numbers."""

from __future__ import annotations

import ast
import itertools
import math
import unicodedata
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction

from avow.backend_kit.programs.samples import worked_out
from avow.base.plain import LOOK
from avow.evaluation.linear_search import Linear
from avow.formulas.values import Element, Value
from avow.language.bounds import constant
from avow.language.sorts import (
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    BoolSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    Sort,
)
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Compare, Literal, Negative, Term, Widen

from . import tuning

STEP = Fraction(1, 1000)
"""How close to a threshold a value is tried on either side."""


TINY = Fraction(1, 10**9)
"""Below it the neighbours of a number are too long to be worth writing."""


@dataclass(frozen=True, slots=True)
class Pools:
    """`scalars` are values for a number or string that stands alone; `near` for parameters of functions and values,
    which have to coincide; `rows` are the scenario's rows of a port's relation."""

    scalars: Mapping[Sort, tuple[Value, ...]]
    near: Mapping[Sort, tuple[Value, ...]]
    rows: Mapping[str, tuple[tuple[Value, ...], ...]] = field(default_factory=dict)
    edges: Mapping[Sort, tuple[Value, ...]] = field(default_factory=dict)
    """Those of the scalars that are to be tried in any case: the thresholds, and what lies around them."""
    lengths: tuple[int, ...] = ()
    """Lengths of sequences to be tried in any case: at, beside and beyond every number, and long ones."""


def pools(
    formulas: Iterable[Term],
    rows: Mapping[str, tuple[tuple[Value, ...], ...]],
    of_subject: tuple[frozenset[Fraction], frozenset[str]] = (frozenset(), frozenset()),
) -> Pools:
    """From the constants in the formulas, from the scenario's rows, and from the numbers and texts in the subject."""
    parts = [part for formula in formulas for part in subterms(formula)]
    numbers = {number for part in parts if (number := constant(part)) is not None}  # `4 * Flow`, too
    solved = {number for part in parts if isinstance(part, Compare) for number in _solved(part)}
    said = {part.value for part in parts if isinstance(part, Literal) and isinstance(part.value, str)}
    strings = {"", *(t for text in said | of_subject[1] for t in (text, text + "x"))}
    around = _around(numbers | solved)
    few = sorted({*numbers, Fraction(0)}) if len(numbers) <= tuning.CONSTANTS_COMBINED else []
    # An output's threshold may be reached from an input by adding or taking away.
    combined = _simple((*around, *(a + b for a in few for b in few), *(a - b for a in few for b in few)))
    small = tuple(range(tuning.SMALL))
    inside = tuple(int(n) for n in sorted(numbers) if n.denominator == 1 and n not in small)
    texts = tuple(sorted(strings, key=lambda s: (len(s), s)))
    near: dict[Sort, tuple[Value, ...]] = {
        REAL: (*map(Fraction, small), *(n for n in _simple(numbers) if n not in small)),
        INTEGER: (*small, -1, *inside),
        NATURAL: (*small, *(n for n in inside if n >= 0)),
        STRING: texts,
    }
    seen = numbers | solved | of_subject[0]
    edges = _simple((*_around(seen), *(n for number in seen for n in _neighbours(number))))
    written = tuple(dict.fromkeys((*texts, *(other for text in texts for other in variants(text)))))
    # what only the subject speaks of is tried in any case, and drawn now and then
    drawn = _simple((*combined, *(n + d for n in sorted(of_subject[0]) for d in (-1, 0, 1))))
    return Pools(_by_sort(drawn, texts), near, rows, _by_sort(edges, written), _lengths(seen))


_WIDE = {code: code + 0xFEE0 for code in range(0x21, 0x7F)}


def variants(text: str) -> tuple[str, ...]:
    """Texts that a careless comparison takes for this one: padded, in other cases, longer, shorter, turned round, with
    signs that are not seen, of letters that look the same."""
    if not text:
        return (" ", "\0", "x")
    padded = (f" {text}", f"{text} ", f" {text} ", f"{text}\n", f"\t{text}")
    unseen = (f"{text}\0", f"\u200b{text}", f"\ufeff{text}", unicodedata.normalize("NFD", text))
    cased = (text.upper(), text.lower(), text.capitalize(), text.swapcase())
    alike = (text.translate(_WIDE), text.translate(LOOK))
    other = (f"{text}x", f"x{text}", f"x{text}x", text + text, text[:-1], text[1:], text[::-1])
    return tuple(one for one in dict.fromkeys((*padded, *unseen, *cased, *alike, *other)) if one != text)


def constants(program: str) -> tuple[frozenset[Fraction], frozenset[str]]:
    """The numbers and texts that a Python program writes down, the first few hundred; none of one that is no Python."""
    numbers: set[Fraction] = set()
    texts: set[str] = set()
    try:
        tree = ast.parse(program)
        calculated = tuple(worked_out(compile(tree, "", "exec", dont_inherit=True)))
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return frozenset(), frozenset()
    documentation = {id(part.value) for part in ast.walk(tree) if isinstance(part, ast.Expr)}
    for part in (*ast.walk(tree), *map(ast.Constant, calculated)):
        if (
            len(numbers) + len(texts) >= tuning.CONSTANTS_READ
            or id(part) in documentation
            or not isinstance(part, ast.Constant)
        ):
            continue
        match part.value:
            case bool():
                continue
            case int(number) if abs(number) <= tuning.LARGEST_CONSTANT:
                numbers |= {Fraction(number), Fraction(-number)}
            case float(number) if math.isfinite(number) and abs(number) <= tuning.LARGEST_CONSTANT:
                # as it is written, and as the machine has it
                numbers |= {Fraction(repr(number)), Fraction(number), -Fraction(repr(number))}
            case str(text) if len(text) <= tuning.LONGEST_TEXT:
                texts.add(text)
    return frozenset(numbers), frozenset(texts)


def _neighbours(number: Fraction) -> Iterable[Fraction]:
    """The floating-point numbers next to a number on either side."""
    try:
        near = float(number)
    except OverflowError:
        return
    for end in (-math.inf, math.inf):
        beside = math.nextafter(near, end)
        if math.isfinite(beside) and abs(number) >= TINY:
            yield Fraction(beside)


def _lengths(numbers: Iterable[Fraction]) -> tuple[int, ...]:
    """Lengths at, beside and beyond each number that can be one, and those that any sequence may have."""
    whole = {math.floor(n) for n in numbers if 0 <= n <= tuning.LONGEST_SEQUENCE}
    found = {n + d for n in whole for d in (-1, 0, 1, 2)} | {2 * n + 1 for n in whole} | {0, 1, 2, tuning.LONG_SEQUENCE}
    return tuple(sorted(n for n in found if 0 <= n <= 2 * tuning.LONGEST_SEQUENCE + 1))[: tuning.LENGTHS]


def _solved(comparison: Compare) -> set[Fraction]:
    """Where the two sides meet, if all that is open is one value: ``4 * gauge < 20`` has its threshold at 5."""
    names: dict[Term, str] = {}
    left, right = _linear(comparison.left, names), _linear(comparison.right, names)
    apart = left.plus(right, Fraction(-1)) if left is not None and right is not None else None
    if apart is None or len(apart.coefficients) != 1:
        return set()
    meeting = -apart.constant / apart.coefficients[0][1]
    return {meeting, Fraction(math.floor(meeting)), Fraction(math.ceil(meeting))}


def _linear(term: Term, names: dict[Term, str]) -> Linear | None:
    """A sum over what is no arithmetic, each by a name of its own; None if it is not linear in it."""
    match term:
        case Literal(value=bool() | str()):
            return None
        case Literal(value=value):
            return Linear((), Fraction(value))
        case Widen(term=inner):
            return _linear(inner, names)
        case Negative(term=inner):
            turned = _linear(inner, names)
            return None if turned is None else turned.times(Fraction(-1))
        case Arithmetic(operator=operator, left=left, right=right):
            one, other = _linear(left, names), _linear(right, names)
            if one is None or other is None:
                return None
            match operator:
                case "+" | "-":
                    return one.plus(other, Fraction(1 if operator == "+" else -1))
                case "*" if not other.coefficients:
                    return one.times(other.constant)
                case "*" if not one.coefficients:
                    return other.times(one.constant)
                case "/" if not other.coefficients and other.constant:
                    return one.times(1 / other.constant)
            return None
        case _ if isinstance(term.sort, RealSort | IntegerSort | NaturalSort):
            return Linear(((names.setdefault(term, str(len(names))), Fraction(1)),), Fraction(0))
    return None


def _by_sort(numbers: tuple[Fraction, ...], texts: tuple[str, ...]) -> dict[Sort, tuple[Value, ...]]:
    whole = tuple(int(n) for n in numbers if n.denominator == 1)
    return {REAL: numbers, INTEGER: whole, NATURAL: tuple(n for n in whole if n >= 0), STRING: texts}


def _around(numbers: Iterable[Fraction]) -> tuple[Fraction, ...]:
    """The numbers, what lies close on either side, what lies between them, and what lies well beyond."""
    ordered = sorted({*numbers, Fraction(0)})
    values = {Fraction(-1), Fraction(1), ordered[0] - 100, 2 * ordered[-1] + 100}
    for number in ordered:
        values |= {number, number - STEP, number + STEP, number - 1, number + 1}
    values |= {(a + b) / 2 for a, b in itertools.pairwise(ordered)}
    return _simple(values)


def _simple(numbers: Iterable[Fraction]) -> tuple[Fraction, ...]:
    """The simplest first: what a failing case is shrunk towards."""
    return tuple(sorted(set(numbers), key=lambda n: (n.denominator, n < 0, abs(n))))


def parse_cell(text: str, sort: Sort) -> Value | None:
    """A cell of a scenario's table as a value of the sort; None where it is none."""
    text = text.strip()
    try:
        number = Fraction(text)
    except (ValueError, ZeroDivisionError):
        number = None
    if sort == REAL:
        return number
    if sort in (INTEGER, NATURAL):
        whole = number is not None and number.denominator == 1 and (sort == INTEGER or number >= 0)
        return int(number) if whole and number is not None else None
    match sort:
        case EnumSort(members=members):
            return Element(text) if text in members else None
        case BoolSort():
            return {"TRUE": True, "FALSE": False}.get(text.upper())
    return text if sort == STRING else None


def runs(parameters: tuple[Sort, ...]) -> tuple[tuple[Sort, ...], ...]:
    """Parameters grouped by equal neighbours: (REAL, REAL, NATURAL) is a place and a number."""
    return tuple(tuple(group) for _, group in itertools.groupby(parameters))


def scenario_runs(
    rows: Mapping[str, tuple[tuple[Value, ...], ...]], sorts: Mapping[str, Sort]
) -> dict[tuple[Sort, ...], tuple[tuple[Value, ...], ...]]:
    """The parts of the scenario's rows, by the sorts of which they are: places, numbers."""
    found: dict[tuple[Sort, ...], dict[tuple[Value, ...], None]] = {}
    for port, table in rows.items():
        sort = sorts.get(port)
        if not isinstance(sort, FunctionSort):
            continue
        for row in table:
            at = 0
            for run in runs(sort.parameters):
                found.setdefault(run, {})[row[at : at + len(run)]] = None
                at += len(run)
    return {run: tuple(parts) for run, parts in found.items()}
