"""The denial of a guarantee as cases: conjunctions of linear constraints on the network's inputs and outputs.

Every valuation that denies the guarantee satisfies one of the cases (strict inequalities are marked, and may be taken
as not strict). If no case can be satisfied, the guarantee holds.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import product

from avow.base.optional import complete
from avow.formulas.cases import TooManyCases, lifted
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.printer import show_term

from .options import Argmax, Given, Scaled, Threshold
from .tuning import CASES, ROUNDS

Quantity = tuple[str, int]
"""``("X", 3)`` is input 3 of the network, ``("Y", 0)`` its output 0."""


class NotLinear(Exception):  # noqa: N818 - it names what the formula is
    """The part of the formula that is not linear over connected ports, in words."""


@dataclass(frozen=True, slots=True)
class Affine:
    """The sum of the coefficients times their quantities, and a constant."""

    terms: Mapping[Quantity, Fraction] = field(default_factory=dict)
    constant: Fraction = Fraction(0)

    def plus(self, other: Affine, factor: Fraction = Fraction(1)) -> Affine:
        terms = dict(self.terms)
        for quantity, by in other.terms.items():
            terms[quantity] = terms.get(quantity, Fraction(0)) + factor * by
        return Affine({q: by for q, by in terms.items() if by}, self.constant + factor * other.constant)

    def times(self, factor: Fraction) -> Affine:
        return Affine().plus(self, factor)


@dataclass(frozen=True, slots=True)
class Constraint:
    """`left` <= 0, or < 0 if `strict`."""

    left: Affine
    strict: bool = False


Case = tuple[Constraint, ...]


def denials(guarantee: t.Term, assumed: Iterable[t.Term], given: Given) -> tuple[tuple[Case, ...], tuple[t.Term, ...]]:
    """The cases of the guarantee's denial under the assumptions, and the assumptions that they leave out, as these are
    not linear: the cases then admit more. Raises NotLinear if the guarantee is not."""
    linear = _Linear(given)
    found, left = linear.whole(guarantee, False), list[t.Term]()
    for each in assumed:
        try:
            found = _both(linear.whole(each, True), found)
        except NotLinear:
            left.append(each)
    return tuple((*case, *linear.rises()) for case in found), tuple(left)


class _Linear:
    def __init__(self, given: Given) -> None:
        self.given = given

    def whole(self, formula: t.Term, positive: bool) -> list[Case]:
        try:
            return self.cases(lifted(formula), positive)
        except (TooManyCases, RecursionError):
            raise NotLinear("it has too many cases") from None

    def cases(self, term: t.Term, positive: bool) -> list[Case]:
        """The cases in which the formula holds, or does not if not `positive`."""
        match term:
            case t.Literal(value=bool() as value):
                return [()] if value == positive else []
            case t.Not(body=body):
                return self.cases(body, not positive)
            case t.And(items=items) | t.Or(items=items):
                parts = (self.cases(item, positive) for item in items)
                if isinstance(term, t.And) == positive:
                    found: list[Case] = [()]
                    for part in parts:
                        found = _both(found, part)
                    return found
                return _few([case for part in parts for case in part])
            case t.Implies(left=left, right=right):
                return self.cases(t.Or((t.Not(left), right)), positive)
            case t.Iff(left=left, right=right):
                return self.same(left, right, positive)
            case t.Compare(operator="==" | "!=" as operator, left=left, right=right) if left.sort == s.BOOL:
                return self.same(left, right, positive == (operator == "=="))
            case t.Compare(operator="==" | "!=" as operator, left=left, right=right) if isinstance(
                left.sort, s.EnumSort
            ):
                return self.member(left, right, positive == (operator == "=="))
            case t.Compare(operator=operator, left=left, right=right):
                return self.compared(operator, self.affine(left).plus(self.affine(right), Fraction(-1)), positive)
            case t.In(item=item, collection=t.SetTerm(items=items)):
                return self.cases(t.Or(tuple(t.Compare("==", item, each) for each in items)), positive)
            case t.Variable(sort=s.BoolSort()):
                output = self.given.outputs.get(term.qualified)
                if isinstance(output, Threshold):
                    above = Affine({("Y", output.index): Fraction(-1)}, output.least)  # threshold - y <= 0
                    return self.compared("<=", above, positive)
        raise NotLinear(_shown(term))

    def same(self, left: t.Term, right: t.Term, positive: bool) -> list[Case]:
        """Two truth values, equal or not."""
        one, other = self.cases(left, True), self.cases(left, False)
        return _few(_both(one, self.cases(right, positive)) + _both(other, self.cases(right, not positive)))

    def member(self, left: t.Term, right: t.Term, positive: bool) -> list[Case]:
        assert isinstance(left.sort, s.EnumSort)
        names = left.sort.members
        pairs = ((a, b) for a, b in product(names, names) if (a == b) == positive)
        return _few([case for a, b in pairs for case in _both(self.is_one(left, a), self.is_one(right, b))])

    def is_one(self, term: t.Term, member: str) -> list[Case]:
        match term:
            case t.EnumValue(name=name):
                return [()] if name == member else []
            case t.Variable() if isinstance(output := self.given.outputs.get(term.qualified), Argmax):
                k = output.members.index(member)
                others = [j for j in range(len(output.members)) if j != k]
                best = ("Y", output.first + k)
                return [
                    tuple(
                        Constraint(Affine({("Y", output.first + j): Fraction(1), best: Fraction(-1)}), j < k)
                        for j in others
                    )
                ]
        raise NotLinear(_shown(term))

    def rises(self) -> Case:
        """That each rise of an input is the difference of two: in both directions."""
        count = 0 if self.given.one is None else self.given.one.network.inputs
        links = (
            Affine({("X", 2 * count + k): Fraction(1), ("X", count + k): Fraction(-1), ("X", k): Fraction(1)})
            for k in range(count)
        )
        return tuple(Constraint(link.times(Fraction(sign))) for link in links for sign in (1, -1))

    def compared(self, operator: str, difference: Affine, positive: bool) -> list[Case]:
        """The difference of the two sides, compared with zero."""
        difference = by_rises(difference, self.given)
        if not positive:
            operator = {"<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}[operator]
        down, up = difference, difference.times(Fraction(-1))
        made: list[Case]
        match operator:
            case "<" | "<=":
                made = [(Constraint(down, operator == "<"),)]
            case ">" | ">=":
                made = [(Constraint(up, operator == ">"),)]
            case "==":
                made = [(Constraint(down), Constraint(up))]
            case _:  # !=
                made = [(Constraint(down, True),), (Constraint(up, True),)]
        return [case for case in made if all(map(_possible, case))]

    def affine(self, term: t.Term) -> Affine:
        match term:
            case t.Literal(value=int() | Fraction() as value):
                return Affine({}, Fraction(value))
            case t.Variable() | t.Item(record=t.Variable()):
                return self.port(term)
            case t.Widen(term=inner):
                return self.affine(inner)
            case t.Negative(term=inner):
                return self.affine(inner).times(Fraction(-1))
            case t.Arithmetic(operator=operator, left=left, right=right):
                one, other = self.affine(left), self.affine(right)
                match operator:
                    case "+" | "-":
                        return one.plus(other, Fraction(1 if operator == "+" else -1))
                    case "*" if not one.terms or not other.terms:
                        return one.times(other.constant) if not other.terms else other.times(one.constant)
                    case "/" if not other.terms and other.constant:
                        return one.times(1 / other.constant)
        raise NotLinear(_shown(term))

    def port(self, term: t.Variable | t.Item) -> Affine:
        variable, place = (term.record, term.position) if isinstance(term, t.Item) else (term, 0)
        assert isinstance(variable, t.Variable)
        if term.sort == s.REAL:
            if (given := self.given.inputs.get(variable.qualified)) is not None:
                one = given[place]  # x = scale * port + offset
                return Affine({("X", one.index): 1 / one.scale}, -one.offset / one.scale)
            if isinstance(output := self.given.outputs.get(variable.qualified), Scaled):
                return Affine({("Y", output.index): output.scale}, output.offset)
        raise NotLinear(_shown(term))


def by_rises(left: Affine, given: Given) -> Affine:
    """The sum with the rise in place of each difference of one quantity at two steps."""
    for (kind, index), by in left.terms.items() if given.one is not None else ():
        count = given.network.inputs if kind == "X" else len(given.network.outputs)
        third = count // 3
        other = left.terms.get((kind, index - third), Fraction(0))
        if index // third == 1 and by * other < 0:
            part = min(abs(by), abs(other)) * (1 if by > 0 else -1)
            rise = Affine({(kind, index + third): part, (kind, index): -part, (kind, index - third): part})
            left = left.plus(rise)
    return left


def _possible(constraint: Constraint) -> bool:
    left = constraint.left
    return bool(left.terms) or left.constant < 0 or (left.constant == 0 and not constraint.strict)


def _both(one: list[Case], other: list[Case]) -> list[Case]:
    if len(one) * len(other) > CASES:
        raise NotLinear(f"it has more than {CASES} cases")
    return [(*a, *(each for each in b if each not in a)) for a in one for b in other if not _opposed(a, b)]


def _opposed(one: Case, other: Case) -> bool:
    """Whether two constraints contradict each other by their sum. Where a strict one is taken as not strict, Marabou
    would not see it."""
    sums = (Constraint(a.left.plus(b.left), a.strict or b.strict) for a in one for b in other)
    return not all(map(_possible, sums))


def _few(cases: list[Case]) -> list[Case]:
    if len(cases) > CASES:
        raise NotLinear(f"it has more than {CASES} cases")
    return cases


def _shown(term: t.Term) -> str:
    return f"`{show_term(term, 'unicode')}`".replace("\n", " ")


# -- boxes -------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Side:
    """A bound of an interval; the bound itself is outside if it is `strict`."""

    value: Fraction
    strict: bool


Box = tuple[tuple[Side | None, Side | None], ...]
"""For each input of the network its least and greatest value; None if there is no bound."""


def box(case: Case, inputs: int) -> Box:
    """What the constraints on inputs say of each: a constraint bounds an input by the bounds of its others."""
    low: list[Side | None] = [None] * inputs
    high: list[Side | None] = [None] * inputs
    for constraint in case * ROUNDS:
        terms = constraint.left.terms
        for (_, k), by in terms.items() if all(kind == "X" for kind, _ in terms) else ():
            rest = complete((low if each > 0 else high)[j] for (_, j), each in terms.items() if j != k)
            if rest is None:
                continue
            others = (each for (_, j), each in terms.items() if j != k)
            least = sum((each * side.value for each, side in zip(others, rest, strict=True)), constraint.left.constant)
            side = Side(-least / by, constraint.strict)
            sides, sign = (high, 1) if by > 0 else (low, -1)
            known = sides[k]
            if known is None or (sign * side.value, not side.strict) < (sign * known.value, not known.strict):
                sides[k] = side
    return tuple(zip(low, high, strict=True))


def is_empty(sides: Box) -> bool:
    return any(
        low.value > high.value or (low.value == high.value and (low.strict or high.strict))
        for low, high in sides
        if low is not None and high is not None
    )
