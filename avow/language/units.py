"""Units of measurement of ports (REP 103), and of the terms of formulas.

A number in a formula has the unit that its place wants, unless it is written with one (`2 s`). A port without a unit, a
bound variable, and what a function, a sequence or a field gives may have any. Source:
https://www.ros.org/reps/rep-0103.html.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Mapping

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language import terms as t
from avow.language.printer import show_term

Unit = Mapping[str, int]
"""Base unit → exponent, none of them 0."""

BASES = ("m", "kg", "s", "A", "K", "cd", "rad", "celsius")
DERIVED = {
    "Hz": "/s",
    "N": "kg*m/s/s",
    "Pa": "kg/m/s/s",
    "J": "kg*m*m/s/s",
    "W": "kg*m*m/s/s/s",
    "V": "kg*m*m/s/s/s/A",
    "T": "kg/s/s/A",
}
NUMBER: Unit = {}
ONE_UNIT = "convert one of the two, or correct its unit"


def unit(text: str) -> Unit | None:
    """The unit that a text such as ``m/s`` names; None if one of its names is none of REP 103."""
    powers: Counter[str] = Counter()
    for sign, name in re.findall(r"([*/]?)(\w+)", text):
        inner = unit(DERIVED[name]) if name in DERIVED else {name: 1} if name in BASES else None
        if inner is None:
            return None
        for base, power in inner.items():
            powers[base] += -power if sign == "/" else power
    return _whole(powers)


def _whole(powers: Mapping[str, int]) -> Unit:
    """Without exponents of 0. An angle times a radius is a length."""
    return {base: n for base, n in powers.items() if n and not (base == "rad" and powers.get("m"))}


def _shown(found: Unit) -> str:
    over = [base for base, n in found.items() for _ in range(n)]
    under = [base for base, n in found.items() for _ in range(-n)]
    return "*".join(over or ["1"]) + "".join(f"/{base}" for base in under)


@dataclass(frozen=True, slots=True)
class Clash:
    """Two terms whose units differ where they have to be one."""

    message: str
    span: Span | None


_Found = Unit | None
"""The unit of a term; None if it may have any."""


def clashes(formula: t.Term, unit_of: Callable[[t.Variable], str]) -> Iterator[Clash]:
    """The places of a formula where units differ. `unit_of`: the unit of an input or output as text, or empty."""
    found: list[Clash] = []
    _Reader(unit_of, found).of(formula)
    yield from found


@dataclass(frozen=True, slots=True)
class _Reader:
    unit_of: Callable[[t.Variable], str]
    found: list[Clash]

    def of(self, term: t.Term) -> _Found:
        parts = [self.of(child) for child in term.children]
        match term:
            case t.Variable() if term.role is not t.Role.BOUND:
                text = self.unit_of(term)
                return unit(text) if text else None
            case t.Literal(unit=text) if text:
                return unit(text)
            case t.Arithmetic(operator="*" | "/" as sign, left=left, right=right):
                factors = [
                    NUMBER if _is_number(side) else part for side, part in zip((left, right), parts, strict=True)
                ]
                return _product(factors[0], factors[1], sign)
            case t.Operation(operator=t.Builtin.SQRT):
                return _root(parts[0])
            case t.Operation(operator=t.Builtin.SIN | t.Builtin.COS as name, arguments=(angle,)):
                if parts[0] not in (None, NUMBER, unit("rad")) and not _is_number(angle):
                    told = f"`{name}` takes an angle in rad, and `{show_term(angle, 'rcl')}` is in {_shown(parts[0])}"
                    self.found.append(Clash(told, angle.span or term.span))
                return NUMBER
            case t.Operation(operator=t.Builtin.ATAN2, arguments=vector):
                self.same(term, vector, parts)
                return unit("rad")
            case t.Arithmetic() | t.Compare() | t.Operation() | t.Conditional():
                of = parts[1:] if isinstance(term, t.Conditional) else parts
                return self.same(term, term.children[-len(of) :], of)
            case t.History(operator=t.Past.PREVIOUS):
                return self.same(term, term.children[:2], parts[:2])
            case t.In(collection=t.SetTerm(items=items) | t.SequenceTerm(items=items) as listed):
                return self.same(term, (term.item, *items), [parts[0], *(self.of(item) for item in listed.children)])
            case t.Negative() | t.Widen():
                return parts[0]
            case _:  # a formula, or a value of any unit
                return None

    def same(self, term: t.Term, sides: tuple[t.Term, ...], units: list[_Found]) -> _Found:
        """The unit of all parts of a sum or comparison; reports those that differ."""
        known = [
            (side, one) for side, one in zip(sides, units, strict=True) if one is not None and not _is_number(side)
        ]
        if not known:
            return None
        first, whole = known[0]
        for side, other in known[1:]:
            if other != whole:
                told = [
                    f"`{show_term(each, 'rcl')}` is in {_shown(one)}" for each, one in ((first, whole), (side, other))
                ]
                self.found.append(Clash(" and ".join(told), side.span or term.span))
                return None
        return None if isinstance(term, t.Compare | t.In) else whole


def _is_number(term: t.Term) -> bool:
    """Whether a term has no variables and no unit of its own: its unit is that of its place."""
    return (isinstance(term, t.Literal) and not term.unit) or (
        bool(term.children) and all(map(_is_number, term.children))
    )


def _root(square: _Found) -> _Found:
    """Half of each exponent; a unit with an odd one has no root that is a unit, and is not compared."""
    if square is None or any(n % 2 for n in square.values()):
        return None
    return _whole({base: n // 2 for base, n in square.items()})


def _product(one: _Found, other: _Found, sign: str) -> _Found:
    if one is None or other is None:
        return None
    powers = Counter(one)
    for base, n in other.items():
        powers[base] += n if sign == "*" else -n
    return _whole(powers)
