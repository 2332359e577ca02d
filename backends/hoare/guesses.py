"""Inputs to run a program on where the solver leads to none: small, at and beside its constants, of every sort."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable, Iterator, Mapping
from fractions import Fraction
from typing import assert_never

from avow.formulas.formula import free_variables
from avow.formulas.values import Data, Element, FunctionValue, Opaque, SequenceValue, Value
from avow.language import sorts as s
from avow.language.subterms import subterms
from avow.language.terms import Compare, Length, Literal, Term, Variable
from avow.solving.models import default_value
from avow.solving.questions import solve
from avow.solving.translation import Unsupported

from .program import Assign, If, Match, Program, Skip, Statement, Update, While, statements
from .triples import Triple
from .tuning import GUESS_EFFORT, INPUTS_TRIED, LENGTHS, VALUE_DEPTH

NUMERIC: tuple[s.Sort, ...] = (s.NATURAL, s.INTEGER, s.REAL)


def starting_from(triple: Triple, program: Program) -> tuple[Variable, ...]:
    """What a run starts from, and what the triple speaks of besides."""
    free = free_variables(triple.full_pre) | free_variables(triple.post)
    return tuple(sorted({*free, *program.state, *program.ghosts.values()}, key=lambda v: v.name))


def guesses(triple: Triple, program: Program, wanted: tuple[Variable, ...]) -> Iterator[dict[Variable, Value]]:
    """From inputs that meet the precondition: all small points, or a sample of them (the same one every time)."""
    pre = triple.full_pre
    between, at = numbers((pre, triple.post, *expressions(program)))
    beside = {n + d for n in at for d in (-1, 1)}
    small = sorted({*between, *at, *map(Fraction, range(8)), Fraction(-1)})
    ghosts = frozenset(program.ghosts.values())
    free = [v for v in wanted if v not in ghosts]
    finite = {v: pool for v in free if (pool := _pool(v.sort, small)) is not None}
    sequences = [v for v in free if isinstance(v.sort, s.SequenceSort)][:3]
    bases = []
    for extra in (
        (),
        *((Compare("==", Length(v, s.NATURAL), Literal(n, s.NATURAL)),) for v in sequences for n in (1, 2, 3)),
    ):
        found = solve([pre, *extra], effort=GUESS_EFFORT)
        if found.status == "sat" or not extra:
            bases.append(filled(found.values if found.status == "sat" else {}, wanted))
            yield bases[-1]
    if len(finite) == len(free) and math.prod(map(len, finite.values())) <= INPUTS_TRIED:
        for point in itertools.product(*finite.values()):
            yield {**bases[0], **dict(zip(finite, point, strict=True))}
        return
    rng = random.Random(0)
    draw = Draw(rng, sorted({*small, *beside}), sorted(strings((pre, triple.post, *expressions(program)))))
    for _ in range(INPUTS_TRIED):
        base = rng.choice(bases)
        yield {**base, **{v: draw.value(v.sort) for v in free if v not in base or rng.random() < 0.7}}


def _pool(sort: s.Sort, small: Iterable[Fraction]) -> list[Value] | None:
    match sort:
        case s.EnumSort(members=members):
            return [Element(m) for m in members]
        case s.BoolSort():
            return [False, True]
        case _ if sort in NUMERIC:
            return [stored(n, sort) for n in small if fits(n, sort)]
    return None


class Draw:
    """Values of any sort, by chance."""

    def __init__(self, rng: random.Random, numbers: list[Fraction], strings: list[str]) -> None:
        self.rng, self.numbers, self.strings = rng, numbers, strings

    def value(self, sort: s.Sort, depth: int = 0) -> Value:
        rng = self.rng
        match sort:
            case s.EnumSort(members=members):
                return Element(rng.choice(members))
            case s.BoolSort():
                return rng.random() < 0.5
            case s.TupleSort(items=items):
                return tuple(self.value(item, depth + 1) for item in items)
            case s.SequenceSort(item=item):
                length = rng.choice(LENGTHS) if depth < VALUE_DEPTH else 0
                return SequenceValue(tuple(self.value(item, depth + 1) for _ in range(length)))
            case s.DataSort(constructors=constructors):
                plain = [c for c in constructors if not any(isinstance(p, s.DataSort) for p in c.parameters)]
                made = rng.choice(plain if plain and depth >= VALUE_DEPTH else constructors)
                return Data(made.name, tuple(self.value(p, depth + 1) for p in made.parameters))
            case s.FunctionSort(parameters=parameters, result=result):
                points = [tuple(self.value(p, depth + 1) for p in parameters) for _ in range(rng.randrange(4))]
                default = self.value(result, depth + 1)
                return FunctionValue({point: self.value(result, depth + 1) for point in points}, default)
            case s.OpaqueSort(name=name):
                return Opaque(name, rng.randrange(3))
            case _ if sort in NUMERIC:
                return stored(rng.choice([n for n in self.numbers if fits(n, sort)]), sort)
            case _ if sort == s.STRING:
                return rng.choice(self.strings)
        return default_value(sort)


def strings(terms: Iterable[Term]) -> set[str]:
    found = {p.value for t in terms for p in subterms(t) if isinstance(p, Literal) and isinstance(p.value, str)}
    return {"", "a", *found}


def filled(values: Mapping[Variable, Value], wanted: Iterable[Variable]) -> dict[Variable, Value]:
    """The values, and the simplest ones of the other variables."""
    found = dict(values)
    for variable in wanted:
        if variable not in found:
            try:
                found[variable] = default_value(variable.sort)
            except Unsupported:  # a sort without values that can be written: the evaluation will say so
                continue
    return found


def expressions(program: Program) -> tuple[Term, ...]:
    """Every expression that the program computes."""
    return tuple(term for statement in statements(program.body) for term in _terms(statement))


def _terms(statement: Statement) -> tuple[Term, ...]:
    match statement:
        case Assign(value=value):
            return (value,)
        case Update(arguments=arguments, value=value):
            return (*arguments, value)
        case If(condition=condition) | While(condition=condition):
            return (condition,)
        case Match(subject=subject):
            return (subject,)
        case Skip():  # tests nothing
            return ()
        case _:
            assert_never(statement)


def numbers(terms: Iterable[Term]) -> tuple[list[Fraction], list[Fraction]]:
    """Simple numbers between the constants of some terms and beyond them, and the constants themselves."""
    constants = {
        Fraction(part.value)
        for term in terms
        for part in subterms(term)
        if isinstance(part, Literal) and part.sort in NUMERIC and not isinstance(part.value, str)
    }
    ordered = sorted(constants)
    between = [_simplest_between(a, b) for a, b in itertools.pairwise(ordered)]
    outside = [ordered[0] - 1, ordered[-1] + 1] if ordered else []
    return [*between, *outside], [*ordered, Fraction(0), Fraction(1)]


def _simplest_between(low: Fraction, high: Fraction) -> Fraction:
    """A number near the middle that is easy to read: the middle rounded as far as it stays well inside."""
    middle = (low + high) / 2
    for step in (100, 50, 10, 5, 1):
        rounded = Fraction(round(middle / step) * step)
        if low < rounded < high and abs(rounded - middle) * 5 <= high - low:
            return rounded
    return middle


def fits(number: Fraction, sort: s.Sort) -> bool:
    """Whether a number is one of the sort's."""
    return sort == s.REAL or (number.denominator == 1 and (sort == s.INTEGER or number >= 0))


def stored(number: Fraction, sort: s.Sort) -> Value:
    """The number as values of the sort are kept."""
    return number if sort == s.REAL else int(number)
