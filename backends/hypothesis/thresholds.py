"""The numbers, texts and lengths at which something may change: those of the contract and of the unit under test."""

from __future__ import annotations

import ast
import itertools
import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.programs.samples import numbers_of, worked_out
from avow.base.files import text_or_nothing
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.traversal import transform
from avow.language.sorts import IntegerSort, NaturalSort, RealSort
from avow.language.subterms import subterms
from avow.language.terms import Arithmetic, Compare, Literal, Negative, Role, Term, Variable, Widen

from . import tuning

_STEP = Fraction(1, 1000)
"""The distance from a threshold at which a value is tried on either side."""


@dataclass(frozen=True, slots=True)
class Thresholds:
    """The simplest value of each comes first: failing cases are shrunk towards it. `few` are the constants of
    the contract and small numbers, so few that two draws often meet."""

    constants: tuple[Fraction, ...]
    """Constants in contract and program."""
    numbers: tuple[Fraction, ...]
    """Numbers near these, and numbers calculated from them."""
    few: tuple[Fraction, ...]
    texts: tuple[str, ...]
    """The texts of contract and program, and texts that a careless comparison confuses with them."""
    words: tuple[str, ...]
    """The parts from which other texts are composed."""
    lengths: tuple[int, ...]


def thresholds(formulas: Iterable[Term], program: Iterable[Path], parameters: Iterable[Fraction]) -> Thresholds:
    """From the formulas, Python sources and the data files that these name, and a class's parameters."""
    stated = list(formulas)
    parts = [part for formula in stated for part in subterms(formula)]
    contract = {*numbers_of(stated), *(n for part in parts if isinstance(part, Compare) for n in _meeting(part))}
    texts = {part.value for part in parts if isinstance(part, Literal) and isinstance(part.value, str)}
    of_program = [*itertools.islice(_constants(program), tuning.CONSTANTS_READ)]
    written = texts | {text for text in of_program if isinstance(text, str)}
    own = {number for number in of_program if not isinstance(number, str)} | set(parameters)
    own |= {Fraction(text) for text in written if text.isascii() and text.isdecimal()}
    few = _simple(own)[: tuning.CONSTANTS_COMBINED]
    calculated = {m for a in few for b in few for m in (a + b, a * b)}
    calculated |= {Fraction(math.isqrt(n.numerator)) for n in own if n.denominator == 1 and n > 1}
    occurring = contract | own | {-number for number in own}
    numbers = occurring | calculated
    small = sorted(contract)[: tuning.CONSTANTS_COMBINED]
    around = {n + d for n in occurring | {Fraction(0)} for d in (-1, -_STEP, 0, _STEP, 1)}
    between = {(a + b) / 2 for a, b in itertools.pairwise(sorted(numbers | {Fraction(0)}))}
    combined = {a + b for a in small for b in small} | {a - b for a in small for b in small}
    beside = {beside for n in occurring for beside in _neighbours(n)}
    far = {2 * max(numbers, default=Fraction(0)) + 100, min(numbers, default=Fraction(0)) - 100}
    whole, others = _lengths(contract | own), _lengths(calculated)
    lengths = others | {n + d for n in whole for d in ((-1, 0, 1) if len(whole) <= tuning.LENGTHS_BESIDE else (0,))}
    words = written | {str(n) for n in _simple(own) if n.denominator == 1}
    return Thresholds(
        _simple({Fraction(0), *contract, *own}),
        _simple(calculated | around | between | combined | beside | far),
        _simple({*map(Fraction, range(tuning.SMALL)), *contract}),
        _shortest({"", *words, *(v for text in written for v in _variants(text))}),
        _shortest({"", *words}),
        tuple(sorted(n for n in lengths | {*tuning.LONG_SEQUENCES} if n > 0)),
    )


def _lengths(numbers: Iterable[Fraction]) -> set[int]:
    return {int(n) for n in numbers if n.denominator == 1 and 0 < n <= tuning.LONGEST_SEQUENCE}


def _simple(numbers: Iterable[Fraction]) -> tuple[Fraction, ...]:
    return tuple(sorted(set(numbers), key=lambda n: (n.denominator, n < 0, abs(n))))


def _shortest(texts: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(texts, key=lambda text: (len(text), text)))


def _variants(text: str) -> Iterator[str]:
    """Texts that a careless comparison confuses with this one; the last two look alike."""
    yield from (f" {text}", f"{text} ", text.upper(), text.capitalize(), f"{text}x", f"x{text}", text[:-1], text[::-1])
    yield f"{text[:1]}\u200b{text[1:]}"
    yield "".join(chr(ord(letter) + 0xFEE0) if "!" <= letter <= "~" else letter for letter in text)


def _constants(program: Iterable[Path]) -> Iterator[Fraction | str]:
    """The numbers and short texts in Python sources, including calculated ones (``2 * LIMIT + 1``) and those of the
    data files that they name."""
    for path in program:
        try:
            tree = ast.parse(text_or_nothing(path))
            alone = [part.value for part in ast.walk(tree) if isinstance(part, ast.Expr)]
            documentation = {part.value for part in alone if isinstance(part, ast.Constant)}
            written = [part.value for part in ast.walk(tree) if isinstance(part, ast.Constant)]
            calculated = [*worked_out(compile(_Named(tree).visit(tree), "", "exec", dont_inherit=True))]
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            continue
        for value in (*written, *calculated, *_beside(path, written)):
            match value:
                case _ if isinstance(value, bool) or value in documentation:
                    pass
                case int() if abs(value) <= tuning.LARGEST_CONSTANT:
                    yield Fraction(value)
                case float() if abs(value) <= tuning.LARGEST_CONSTANT:
                    yield Fraction(repr(value))
                    yield Fraction(value)  # its value as a double
                case str() if len(value) <= tuning.LONGEST_TEXT:
                    yield value


class _Named(ast.NodeTransformer):
    """Replaces a module's named constants and `math.pi` by their values, so that Python calculates."""

    def __init__(self, tree: ast.Module) -> None:
        self.known: dict[str, Any] = {}
        for part in tree.body:
            if isinstance(part, ast.Assign):
                values = part.value.elts if isinstance(part.value, ast.Tuple) else [part.value]
                for target in part.targets:
                    names = target.elts if isinstance(target, ast.Tuple) else [target]
                    for name, value in zip(names, values, strict=False):
                        if isinstance(name, ast.Name) and isinstance(value, ast.Constant):
                            self.known[name.id] = value.value

    def visit_Name(self, node: ast.Name) -> ast.expr:
        known = isinstance(node.ctx, ast.Load) and node.id in self.known
        return ast.copy_location(ast.Constant(self.known[node.id]), node) if known else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        of_math = isinstance(node.value, ast.Name) and node.value.id == "math"
        value = getattr(math, node.attr, None) if of_math else None
        return ast.copy_location(ast.Constant(value), node) if isinstance(value, float) else node


def _beside(source: Path, texts: Iterable[object]) -> Iterator[float | str]:
    """The first numbers and words of the data files beside a source that it names."""
    for name in texts:
        if isinstance(name, str) and re.fullmatch(r"[\w-]+\.(json|ya?ml|txt|csv|ini|toml)", name):
            path = source.with_name(name)
            text = text_or_nothing(path)[: tuning.DATA_READ] if path.is_file() else ""
            for word in re.findall(r"[-+]?[\w.]+", text):
                try:
                    yield float(word)
                except ValueError:
                    yield word


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
    """Where the two sides are equal, if they are linear in a single unknown: ``4 * gauge < 20`` has its threshold at 5.
    Three values of the unknown decide both."""
    unknown = {*_unknowns(comparison.left), *_unknowns(comparison.right)}
    if len(unknown) != 1 or not isinstance(comparison.left.sort, RealSort | IntegerSort | NaturalSort):
        return set()
    variable = Variable(Role.INPUT, "unknown", RealSort())
    left, right = (
        transform(side, lambda part: variable if part in unknown else part)
        for side in (comparison.left, comparison.right)
    )
    apart: list[Fraction] = []
    for at in map(Fraction, (1, 2, 3)):
        values = {variable.qualified: at}
        try:
            apart.append(Fraction(evaluate(left, values)) - Fraction(evaluate(right, values)))  # type: ignore[arg-type]
        except NotEvaluable:
            return set()
    slope = apart[1] - apart[0]
    if not slope or apart[2] - apart[1] != slope:
        return set()
    meeting = 1 - apart[0] / slope
    return {meeting, Fraction(math.floor(meeting)), Fraction(math.ceil(meeting))}


def _unknowns(term: Term) -> Iterator[Term]:
    """The parts of a sum or product that are not calculated from others."""
    if isinstance(term, Arithmetic | Negative | Widen):
        for part in term.children:
            yield from _unknowns(part)
    elif not isinstance(term, Literal):
        yield term
