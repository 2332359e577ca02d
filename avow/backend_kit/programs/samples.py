"""Inputs for comparing a class with its translation: at every number in contract, program and parameters, one double to
either side of it, at such distances from each other, and at the ends of a double's range."""

from __future__ import annotations

import ast
import math
import random
import struct
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from fractions import Fraction
from types import CodeType
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.running import SAMPLE_LENGTHS, SAMPLE_TRIES, SAMPLES_SHIFTED
from avow.language.bounds import constant
from avow.language.sorts import BoolSort, DataSort, EnumSort, IntegerSort, NaturalSort, RealSort, SequenceSort, Sort
from avow.language.subterms import subterms
from avow.language.terms import Term


@dataclass(frozen=True, slots=True)
class Pool:
    """The values that cases are drawn from."""

    floats: tuple[float, ...]
    steps: tuple[float, ...]
    """Distances at which something happens."""
    ints: tuple[int, ...]
    lengths: tuple[int, ...]


def numbers_of(formulas: Iterable[Term]) -> frozenset[Fraction]:
    """The numbers in formulas."""
    found = set[Fraction]()
    for formula in formulas:
        for part in subterms(formula):
            number = constant(part)
            if number is not None:
                found.add(number)
    return frozenset(found)


def leaves(data: Any) -> list[Fraction]:
    """The numbers of parameters."""
    match data:
        case bool():
            return []
        case int() | float():
            return [Fraction(data)]
        case dict():
            return [n for value in data.values() for n in leaves(value)]
    return []


def written(text: str) -> list[Fraction]:
    """The numbers in a Python program, including computed constants."""
    tree = ast.parse(text)
    values = [node.value for node in ast.walk(tree) if isinstance(node, ast.Constant)]
    values += worked_out(compile(tree, "", "exec", dont_inherit=True))
    numbers = [v for v in values if isinstance(v, int | float) and not isinstance(v, bool)]
    return [Fraction(n) for n in numbers if isinstance(n, int) or math.isfinite(n)]


def worked_out(code: CodeType) -> Iterator[int | float | str]:
    """The numbers and texts in a program as it is compiled: ``2**31 - 1`` is a threshold as much as 2 is."""
    for held in code.co_consts:
        if isinstance(held, CodeType):
            yield from worked_out(held)
        elif isinstance(held, int | float | str):
            yield held


def pool(numbers: Iterable[Fraction]) -> Pool:
    exact = sorted(set(numbers) | {-n for n in numbers})
    doubles = {d for n in exact for d in around(n) if math.isfinite(d)}
    beside = {math.nextafter(d, end) for d in doubles for end in (-math.inf, math.inf)}
    near = {d + s for d in doubles for s in (-1.0, -0.001, 0.001, 1.0)}
    plain = {0.0, 1.0, -1.0, 0.5, 2.0, 3.0, 10.0, 100.0, 1000.0}
    floats = tuple(sorted(f for f in doubles | beside | near | plain if math.isfinite(f)))
    whole = {math.floor(n) for n in exact} | {math.ceil(n) for n in exact}
    ints = tuple(sorted({*range(-2, 5), *(n + d for n in whole for d in (-1, 0, 1))}))
    counted = {n + d for n in whole if 0 <= n <= 64 for d in (-1, 0, 1)}
    lengths = tuple(sorted({*SAMPLE_LENGTHS, *(n for n in counted if n >= 0)}))
    return Pool(floats, tuple(sorted(doubles | {0.0})), ints, lengths)


EXTREME: tuple[float, ...] = (-0.0, 5e-324, -5e-324, sys.float_info.min, 1e-300, 1e-17, 1e15, 2.0**53)
EXTREME += (1e300, sys.float_info.max, -sys.float_info.max, -1e300)


@dataclass(slots=True)
class Drawing:
    """Draws cases from a seed."""

    pool: Pool
    sorts: Mapping[str, Sort]
    chance: random.Random

    def cases(self, number: int, meets: Callable[[Mapping[str, Any]], bool]) -> Iterator[dict[str, Any]]:
        """So many cases, most of which meet the assumptions where that is not rare."""
        for _ in range(number):
            for _ in range(SAMPLE_TRIES):
                case = self.case()
                if meets(case):
                    break
            yield case

    def case(self) -> dict[str, Any]:
        related = self.chance.random() < 0.6
        wild = self.chance.random() < 0.08
        base = self.chance.choice(self.pool.floats)
        turn = self.chance.random()
        if related and turn < 0.3:  # a number with all its digits, so that differences are rounded
            base *= self.chance.random()
        elif related and turn < 0.6:
            base = abs(self.chance.choice((1.0, 2.0, 3.0, 7.0, 10.0, 1e3, 1e6)) + self.chance.choice((0.0, base)))
        return {name: self.value(sort, base if related else None, wild) for name, sort in self.sorts.items()}

    def value(self, sort: Sort, base: float | None, wild: bool) -> Any:
        match sort:
            case BoolSort():
                return self.chance.random() < 0.5
            case EnumSort(members=members):
                return self.chance.choice(members)
            case IntegerSort():
                return self.whole(wild)
            case NaturalSort():
                return abs(self.whole(wild))
            case RealSort():
                return self.float(base, wild)
            case SequenceSort(item=item):
                length = self.chance.choice(self.pool.lengths)
                if length > 12 and self.chance.random() < 0.7:
                    length = self.chance.choice(SAMPLE_LENGTHS)
                return [self.value(item, base, wild) for _ in range(length)]
        raise TypeError(f"no value of {sort} is drawn")

    def whole(self, wild: bool) -> int:
        if wild and self.chance.random() < 0.3:
            return self.chance.choice((2**31 - 1, 2**31, -(2**31), 2**53 + 1, 2**63, 10**20))
        return self.chance.choice(self.pool.ints)

    def float(self, base: float | None, wild: bool) -> float:
        if wild and self.chance.random() < 0.5:
            return self.chance.choice(EXTREME)
        if base is None:
            kind = self.chance.random()
            if kind < 0.6:
                return self.chance.choice(self.pool.floats)
            scale = abs(self.chance.choice(self.pool.floats)) or 1.0
            return self.chance.uniform(-1.5, 1.5) * min(scale, 1e300)
        found = base + self.chance.choice((-1, 1, 1, 0)) * self.chance.choice(self.pool.steps)
        turn = self.chance.random()
        if turn < 0.3:
            found = math.nextafter(found, -math.inf if turn < 0.15 else math.inf)
        return found if math.isfinite(found) else base


def beside(case: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Cases whose numbers are the doubles around those of an exact case, as a solver's numbers need not be doubles."""

    def ends(value: Any) -> list[Any]:
        if isinstance(value, Fraction):
            low, high = around(value)
            return [d for d in dict.fromkeys((low, high)) if math.isfinite(d)] or [0.0]
        return [value]

    found: list[dict[str, Any]] = [{}]
    for name, value in case.items():
        several = isinstance(value, list)
        options = [[ends(item)[at] for item in value] for at in (0, -1)] if several else ends(value)
        found = [{**one, name: option} for one in found for option in options][:64]
    return found


def shifted(case: Mapping[str, Any], chance: random.Random) -> Iterator[dict[str, Any]]:
    """Cases at other positions with the same distances as an exact case: a solver's statement about rounding holds for
    some doubles with such differences, rarely for the nearest."""
    numbers = {name: value for name, value in case.items() if isinstance(value, Fraction)}
    if not numbers or any(abs(value) > 10**12 for value in numbers.values()):
        return
    least = min(numbers.values())
    for _ in range(SAMPLES_SHIFTED):
        start = Fraction(chance.uniform(0.0, 2.0 ** chance.randrange(-4, 5)))
        ends = {name: around(value - least + start) for name, value in numbers.items()}
        yield {**case, **{name: chance.choice(pair) for name, pair in ends.items()}}


def around(constant: Fraction) -> tuple[float, float]:
    """The largest double that is not above and the smallest that is not below; equal if the number is a double."""
    try:
        near = float(constant)
    except OverflowError:
        return (math.inf, math.inf)
    if math.isinf(near):
        return near, near
    exact = Fraction(near)
    if exact == constant:
        return near, near
    return (near, math.nextafter(near, math.inf)) if exact < constant else (math.nextafter(near, -math.inf), near)


def as_single(value: float) -> float:
    """The nearest float32."""
    if not math.isfinite(value):
        return value
    try:
        (near,) = struct.unpack("f", struct.pack("f", value))
    except OverflowError:
        return math.copysign(math.inf, value)
    return float(near)


def next_single(value: float, towards: float) -> float:
    """The float32 beside a float32."""
    if not math.isfinite(value):
        return value
    if value == 0:
        return math.copysign(2.0**-149, towards)
    (bits,) = struct.unpack("i", struct.pack("f", value))
    away = (towards > 0) == (value > 0)
    (found,) = struct.unpack("f", struct.pack("i", bits + (1 if away else -1)))
    return float(found)


def words_of(sort: Sort) -> tuple[str, ...]:
    """The names of a sort's elements or constructors; numbers and other sorts have none."""
    match sort:
        case DataSort(constructors=constructors):
            return tuple(constructor.name for constructor in constructors)
        case EnumSort(members=members):
            return members
        case _:  # numbers are drawn separately
            return ()
