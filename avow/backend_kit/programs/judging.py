"""Judges the answers of a program by the contract, in exact arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.base.tuning.effort import JUDGE_EFFORT
from avow.base.verdict import Counterexample
from avow.drive.steps import plain
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.evaluation.truth import judge
from avow.formulas.conditions import Condition, conditions
from avow.formulas.formula import free_variables
from avow.formulas.values import Binary, Element, SequenceValue, Value, show
from avow.language.contract import Clause, Node
from avow.language.printer import show_term
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, Sort
from avow.language.terms import Term


@dataclass(frozen=True, slots=True)
class Formula:
    """A clause, compiled for repeated evaluation."""

    name: str
    term: Term
    evaluator: Evaluator | None

    @classmethod
    def of(cls, clause: Clause) -> Formula:
        return cls.made(clause.name, clause.formula)

    @classmethod
    def made(cls, name: str, term: Term) -> Formula:
        try:
            return cls(name, term, compile_term(term))
        except NotEvaluable:
            return cls(name, term, None)

    def holds(self, values: Mapping[str, Value]) -> bool | None:
        if self.evaluator is not None:
            try:
                return bool(self.evaluator(values))
            except NotEvaluable:
                pass
        return judge(self.term, values, effort=JUDGE_EFFORT)

    def compared(self, values: Mapping[str, Value], name: str, special: float) -> bool | None:
        """As `holds`, if a value (or the first item of a sequence) is NaN or an infinity: compared as in IEEE 754. None
        if that cannot be decided."""
        held = values[name]
        put: Any = SequenceValue((special, *held.items[1:])) if isinstance(held, SequenceValue) else special  # type: ignore[arg-type]
        try:
            return bool(self.evaluator({**values, name: put})) if self.evaluator is not None else None
        except (NotEvaluable, ValueError, ArithmeticError, TypeError):
            return None


def triggers(clause: Clause) -> tuple[Formula, ...]:
    """The conditions under which a clause demands something: a clause whose condition no case met was not tested."""

    def ready(condition: Condition) -> Formula:
        return Formula.made(show_term(condition.formula, "unicode").replace("\n", " "), condition.formula)

    return tuple(map(ready, conditions(clause.formula)))


class NoValue(ValueError):  # noqa: N818 - it says what it is
    """The answer is no value of the port's type."""


def exact(value: Any) -> Value:
    """An input in the contract's form."""
    match value:
        case bool():
            return value
        case float():
            return Binary.held(Fraction(value), repr(value))
        case str():
            return Element(value)
        case list():
            return SequenceValue(tuple(exact(item) for item in value))
        case _:  # an int or a fraction
            return value  # type: ignore[no-any-return]


def returned(name: str, value: Any, sort: Sort) -> Value:
    """An output in the contract's form. Raises NoValue."""
    match sort, value:
        case BoolSort(), bool():
            return value
        case RealSort(), float() if math.isfinite(value):
            return Binary.held(Fraction(value), repr(value))
        case RealSort(), int() | Fraction() if not isinstance(value, bool):
            return Fraction(value)
        case IntegerSort() | NaturalSort(), int() if not isinstance(value, bool):
            if isinstance(sort, IntegerSort) or value >= 0:
                return value
        case EnumSort(members=members), str() if value in members:
            return Element(value)
    raise NoValue(f"out.{name} is {value!r}, which is no value of its type")


@dataclass(frozen=True, slots=True)
class Seen:
    """One case and its result: values by qualified name, or in `wrong` why there are none."""

    values: Mapping[str, Value]
    wrong: str = ""

    def pairs(self) -> tuple[tuple[str, str], ...]:
        return tuple((name, show(value)) for name, value in self.values.items())


def to_return(outputs: Iterable[str]) -> str:
    """What a step has to return, in words; `outputs`: those that are not kept in state."""
    return ", ".join(sorted(outputs)) or "{}, since all outputs are held in memory"


def seen(node: Node, memory: Mapping[str, str], case: Mapping[str, Any], reply: Any) -> Seen:
    """The reply to a case of one step, in the contract's form."""
    values: dict[str, Value] = {f"in.{name}": exact(value) for name, value in case.items()}
    (answer,) = reply["steps"]
    if "error" in answer:
        return Seen(values, f"the step raises {answer['why']}")
    others = {p.name: p for p in node.outputs if p.name not in memory}
    try:
        value = _plain(answer["value"])
        given = value if isinstance(value, dict) else {next(iter(others)): value} if len(others) == 1 else None
        if given is None or set(given) != set(others):
            raise NoValue(f"the step returns {value!r}; it has to return {to_return(others)}")
        for name, port in others.items():
            values[f"out.{name}"] = returned(name, given[name], port.sort)
        for port in node.outputs:
            if port.name in memory:
                held = _plain(answer["memory"][port.name])
                values[f"out.{port.name}"] = returned(port.name, held, port.sort)
    except NoValue as error:
        return Seen(values, str(error))
    return Seen(values)


def started(node: Node, assumed: Iterable[Formula], memory: Mapping[str, Any], maker: str) -> Counterexample | None:
    """What is wrong with a program's state (by the ports' names): a malformed value, or one that breaks an assumption
    about state alone. `maker`: the code that made it."""
    try:
        values = {f"in.{name}": returned(name, value, node.input(name).sort) for name, value in memory.items()}
    except NoValue as wrong:
        return Counterexample((), f"this is what {maker} makes of memory: {wrong}")
    for formula in assumed:
        names = {v.qualified for v in free_variables(formula.term)}
        if names and names <= values.keys() and formula.holds(values) is False:
            why = f"this is what {maker} makes, and assumption {formula.name} does not hold of it"
            return Counterexample(Seen({name: values[name] for name in sorted(names)}).pairs(), why)
    return None


def _plain(data: Any) -> Any:
    try:
        return plain(data)
    except ValueError:
        raise NoValue(f"the step returns {data.get('?', data) if isinstance(data, dict) else data}") from None


Meets = Callable[[Mapping[str, Any]], bool]


def meets(assumptions: tuple[Formula, ...]) -> Meets:
    """Whether inputs are certainly allowed."""

    def allowed(case: Mapping[str, Any]) -> bool:
        values = {f"in.{name}": exact(value) for name, value in case.items()}
        return all(a.holds(values) is True for a in assumptions)

    return allowed
