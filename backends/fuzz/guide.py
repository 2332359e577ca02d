"""Formulas as trees in an array, for the harness to look at in machine numbers. A guide: what it cannot say is unknown,
and nothing is judged by it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field
from fractions import Fraction

from avow.base.records import dataclass
from avow.language.operators import definition
from avow.language.sorts import EnumSort, IntegerSort, NaturalSort
from avow.language.terms import (
    And,
    Arithmetic,
    Compare,
    Conditional,
    EnumValue,
    Iff,
    Implies,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Operation,
    Or,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
    Widen,
)

_COMPARED = {"<": "less", "<=": "at_most", ">": "greater", ">=": "at_least", "==": "equal", "!=": "other"}
_COMPUTED = {"+": "plus", "-": "minus", "*": "times", "/": "divide"}


@dataclass(frozen=True, slots=True)
class Part:
    op: str
    a: int = -1
    b: int = -1
    c: int = -1
    value: float = 0.0


@dataclass(slots=True)
class Guide:
    """`inputs` and `outputs`: name → place among the ports."""

    inputs: Mapping[str, int]
    outputs: Mapping[str, int]
    parts: list[Part] = field(default_factory=list)
    _bound: list[Variable] = field(default_factory=list)

    def root(self, term: Term) -> int:
        """The place of a formula's tree."""
        try:
            return self._of(term)
        except RecursionError:
            return self._put(Part("unknown"))

    def _put(self, part: Part) -> int:
        self.parts.append(part)
        return len(self.parts) - 1

    def _joined(self, op: str, items: tuple[Term, ...]) -> int:
        at = self._of(items[-1])
        for item in reversed(items[:-1]):
            at = self._put(Part(op, self._of(item), at))
        return at

    def _of(self, term: Term) -> int:
        match term:
            case Literal(value=bool(value)):
                return self._put(Part("number", value=float(value)))
            case Literal(value=value) if isinstance(value, int | Fraction):
                return self._number(Fraction(value))
            case EnumValue(name=name, sort=EnumSort(members=members)):
                return self._put(Part("number", value=float(members.index(name))))
            case Variable():
                return self._variable(term)
            case Widen(term=inner):
                return self._put(Part("widen", self._of(inner)))
            case Negative(term=inner):
                return self._put(Part("negate", self._of(inner)))
            case Not(body=inner):
                return self._put(Part("no", self._of(inner)))
            case Arithmetic(operator=operator, left=left, right=right) if operator in _COMPUTED:
                return self._put(Part(_COMPUTED[operator], self._of(left), self._of(right)))
            case Compare(operator=operator, left=left, right=right) if operator in _COMPARED:
                return self._put(Part(_COMPARED[operator], self._of(left), self._of(right)))
            case And(items=items) if items:
                return self._joined("both", items)
            case Or(items=items) if items:
                return self._joined("either", items)
            case Implies(left=left, right=right):
                return self._put(Part("implies", self._of(left), self._of(right)))
            case Iff(left=left, right=right):
                return self._put(Part("same", self._of(left), self._of(right)))
            case Conditional(condition=condition, then=then, otherwise=otherwise):
                return self._put(Part("choose", self._of(condition), self._of(then), self._of(otherwise)))
            case Length(sequence=Variable(role=role, name=name)) if self._port(role, name) is not None:
                return self._put(Part(f"length_{_side(role)}", self._port(role, name) or 0))
            case Index(sequence=Variable(role=role, name=name), index=index) if self._port(role, name) is not None:
                return self._put(Part(f"index_{_side(role)}", self._port(role, name) or 0, self._of(index)))
            case Operation() if (same := definition(term)) is not None:
                return self._of(same)
            case Quantified(quantifier=quantifier, variables=variables, body=body):
                return self._quantified(quantifier, variables, body)
            case _:  # what the harness does not look at
                return self._put(Part("unknown"))

    def _number(self, value: Fraction) -> int:
        try:
            return self._put(Part("number", value=float(value)))
        except OverflowError:
            return self._put(Part("unknown"))

    def _port(self, role: Role, name: str) -> int | None:
        return {Role.INPUT: self.inputs, Role.OUTPUT: self.outputs}.get(role, {}).get(name)

    def _variable(self, term: Variable) -> int:
        at = self._port(term.role, term.name)
        if at is not None:
            return self._put(Part(_side(term.role), at))
        if term in self._bound:
            return self._put(Part("bound", len(self._bound) - 1 - self._bound[::-1].index(term)))
        return self._put(Part("unknown"))

    def _quantified(self, quantifier: Quantifier, variables: tuple[Variable, ...], body: Term) -> int:
        whole = all(isinstance(v.sort, NaturalSort | IntegerSort) for v in variables)
        if quantifier not in (Quantifier.FORALL, Quantifier.EXISTS) or not whole or len(self._bound) > 6:
            return self._put(Part("unknown"))
        self._bound += variables
        at = self._of(body)
        op = "every" if quantifier is Quantifier.FORALL else "some"
        for _ in variables:
            self._bound.pop()
            at = self._put(Part(op, at, len(self._bound)))
        return at


def _side(role: Role) -> str:
    return "input" if role is Role.INPUT else "output"
