"""Variables that no part of a conjunction restricts to finitely many values.

Where the formula cannot tell unnamed values apart, one of them stands for all: the values that the formula can name
(in tables, literals, other variables) and one value besides. That holds for a variable that is only compared for
equality and given to functions (a permutation of the unnamed values changes nothing), and for a REAL that is also
compared by order: then one value between each two neighbours is needed (a monotone map changes nothing). Arithmetic
on the variable breaks the argument, and the variable is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field
from fractions import Fraction
from itertools import pairwise
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.bounds import REPRESENTATIVES
from avow.evaluation.compiler import Code, Compiler, Env, NotEvaluable
from avow.evaluation.linear_search import linear_step
from avow.formulas import values
from avow.formulas.disjunctions import Part
from avow.formulas.values import Data, FunctionValue
from avow.language.sorts import IntegerSort, NaturalSort, RealSort, Sort, StringSort, components
from avow.language.subterms import subterms
from avow.language.terms import (
    Apply,
    Compare,
    Construct,
    In,
    Index,
    Quantified,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
)


def leftover_steps(
    compiler: Compiler, parts: Sequence[Part], variables: Sequence[Variable], *, unique: bool
) -> list[Callable[[Env], Iterable[object]]]:
    """A step for each variable; one that cannot be treated raises NotEvaluable when (and if) it is reached."""
    steps: list[Callable[[Env], Iterable[object]]] = []
    names = {v.name for v in variables}
    for variable in variables:
        found = _generic(compiler, parts, variable, frozenset(names), 2 if unique else 1)
        if found is None:
            solved = None if unique else linear_step(compiler, parts, variables)
            return [solved or _refusal(variables)]
        steps.append(found)
        names.discard(variable.name)
    return steps


def _refusal(variables: Sequence[Variable]) -> Callable[[Env], Iterable[object]]:
    listed = ", ".join(v.name for v in variables)
    reason = f"nothing restricts {listed} to finitely many values"

    def run(env: Env) -> Iterable[object]:
        raise NotEvaluable(reason)

    return run


def _generic(
    compiler: Compiler, parts: Sequence[Part], variable: Variable, unbound: frozenset[str], copies: int
) -> Callable[[Env], Iterable[object]] | None:
    carrier = _carrier(variable.sort)
    if carrier is None:
        return None
    survey = _Survey(compiler, carrier, unbound)
    if not all(survey.formula(part.term, frozenset()) for part in parts):
        return None
    slot, constants, ordered, sort = compiler.bind(variable), tuple(survey.constants), survey.ordered, variable.sort

    def run(env: Env) -> Iterator[None]:
        named: set[Any] = set()
        for code in constants:
            _collect(code(env), carrier, named)
        candidates = _representatives(sort, named, ordered, copies)
        if len(candidates) > REPRESENTATIVES:
            raise NotEvaluable(f"there are {len(candidates)} values to try for {variable.name}")
        for value in candidates:
            env[slot] = value
            yield None

    return run


def _representatives(sort: Sort, named: set[Any], ordered: bool, copies: int) -> list[Any]:
    match sort:
        case StringSort():
            longest = max(map(len, named), default=0)
            return [*sorted(named), *("#" * (longest + k) for k in range(1, copies + 1))]
        case NaturalSort():
            top = max(named, default=0)
            return [*sorted(v for v in named if v >= 0), *(max(top, 0) + k for k in range(1, copies + 1))]
        case IntegerSort():
            top, bottom = max([0, *named]), min([0, *named])
            return [*sorted(named), *(s for k in range(1, copies + 1) for s in (top + k, bottom - k))]
        case RealSort():
            points = sorted(map(Fraction, named)) or [Fraction(0)]
            found = [*points, *(points[-1] + k for k in range(1, copies + 1))]
            if ordered:
                found += [points[0] - k for k in range(1, copies + 1)]
                for low, high in pairwise(points):
                    found += [low + (high - low) * k / (copies + 1) for k in range(1, copies + 1)]
            return found
        case _:
            raise AssertionError(f"{sort} is no carrier")


@dataclass(slots=True)
class _Survey:
    """Whether a formula treats the unnamed values of a carrier alike, and which values it names."""

    compiler: Compiler
    carrier: str
    unbound: frozenset[str]
    constants: list[Code] = field(default_factory=list)
    ordered: bool = False

    def formula(self, term: Term, inner: frozenset[str]) -> bool:
        """A term whose own value does not lie in the carrier, or that only combines fixed values."""
        match term:
            case Variable():
                if self._open(term, inner):
                    return not self._hot(term)
                return True
            case Compare(operator="==" | "!=", left=left, right=right):
                same = self.operand(left, inner) and self.operand(right, inner)
                return same or (self.formula(left, inner) and self.formula(right, inner))
            case Compare(left=left, right=right):
                if not any(isinstance(s, Variable) and self._open(s, inner) and self._hot(s) for s in (left, right)):
                    return self.formula(left, inner) and self.formula(right, inner)
                self.ordered = True
                return self.carrier == "real" and self.operand(left, inner) and self.operand(right, inner)
            case In(item=item, collection=SetTerm(items=items) | SequenceTerm(items=items)):
                return all(self.operand(each, inner) for each in (item, *items))
            case In(item=item, collection=collection) if not isinstance(collection, SequenceRange):
                return self.operand(item, inner) and self.operand(collection, inner)
            case Apply():
                return self._apply(term, inner)
            case Quantified(variables=variables, body=body):
                if any(v.sort in self.compiler.domains and self._hot(v) for v in variables):
                    return False
                return self.formula(body, inner | {v.name for v in variables})
            case _:  # alike if all its parts are: a variable of the carrier alone in it is not
                return all(self.formula(child, inner) for child in term.children)

    def operand(self, term: Term, inner: frozenset[str]) -> bool:
        """A term that is compared for equality or given to a function."""
        if not _contains(term.sort, self.carrier):
            return self.formula(term, inner)
        if isinstance(term, Variable) and self._open(term, inner):
            return True
        if self._closed(term, inner):
            self.constants.append(self.compiler.code(term))
            return True
        match term:
            case Apply():
                return self._apply(term, inner)
            case Construct(arguments=items) | TupleTerm(items=items) | SequenceTerm(items=items):
                return all(self.operand(item, inner) for item in items)
            case Index(sequence=sequence, index=index) if self._closed(sequence, inner):
                self.constants.append(self.compiler.code(sequence))
                return self.formula(index, inner)
            case _:  # its value depends on the variable: refused
                return False

    def _apply(self, term: Apply, inner: frozenset[str]) -> bool:
        if not self._closed(term.function, inner):
            return False
        self.constants.append(self.compiler.code(term.function))
        return all(self.operand(argument, inner) for argument in term.arguments)

    def _hot(self, variable: Variable) -> bool:
        return _contains(variable.sort, self.carrier)

    def _open(self, variable: Variable, inner: frozenset[str]) -> bool:
        return variable.qualified in self.unbound or variable.qualified in inner

    def _closed(self, term: Term, inner: frozenset[str]) -> bool:
        own = inner | self.unbound
        return not any(
            isinstance(part, Quantified) or (isinstance(part, Variable) and part.qualified in own)
            for part in subterms(term)
        )


def _carrier(sort: Sort) -> str | None:
    match sort:
        case RealSort():
            return "real"
        case IntegerSort() | NaturalSort():
            return "integer"
        case StringSort():
            return "string"
        case _:  # no carrier: its values are told apart in another way
            return None


def _contains(sort: Sort, carrier: str) -> bool:
    return any(_carrier(part) == carrier for part in components(sort))


def _collect(value: Any, carrier: str, found: set[Any]) -> None:
    """Every value of the carrier that occurs in `value`; integers and reals are kept apart only by their places, so
    naming too many is possible and harmless."""
    match value:
        case bool():
            return
        case str():
            if carrier == "string":
                found.add(value)
        case Data(arguments=items) | values.SequenceValue(items=items):
            for item in items:
                _collect(item, carrier, found)
        case tuple():
            for item in value:
                _collect(item, carrier, found)
        case FunctionValue(table=table, default=default):
            _collect(default, carrier, found)
            for key, result in table.items():
                _collect(key, carrier, found)
                _collect(result, carrier, found)
        case int():
            if carrier != "string":
                found.add(value)
        case _:  # a fraction, or a value without numbers
            if carrier == "real" and hasattr(value, "denominator"):
                found.add(value)
