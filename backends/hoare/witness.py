"""An input on which the program really breaks a triple: found by the solver, then shown by running the program.

Simple numbers are tried first: those between the thresholds that program and triple mention, then the thresholds.
"""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, negation
from avow.formulas.traversal import subterms
from avow.formulas.values import Element, Value
from avow.formulas.values import show as show_value
from avow.language.sorts import INTEGER, NATURAL, REAL, BoolSort, EnumSort, Sort
from avow.language.terms import (
    Apply,
    Arithmetic,
    Compare,
    Literal,
    Negative,
    Not,
    Or,
    Term,
    Variable,
    Widen,
    children,
)
from avow.solving.models import default_value
from avow.solving.questions import replay, solve
from avow.solving.translation import Unsupported

from .interpreter import Fault, Machine, NoEnd, State
from .outline import show
from .program import Assign, If, Match, Program, Statement, Update, While, statements
from .triples import Triple
from .wp import Condition

_NUMERIC: tuple[Sort, ...] = (NATURAL, INTEGER, REAL)
_TRIED = 300
"""Inputs tried where the solver does not lead to one (programs with loops)."""

_ENDLESS = 3
"""Runs without an end after which no more inputs are tried."""


@dataclass(frozen=True, slots=True)
class Breach:
    """A run that meets the precondition and breaks the postcondition. `end` is None where the run stops at a fault."""

    start: Mapping[str, Value]
    end: Mapping[str, Value] | None
    why: str


def breach(triple: Triple, program: Program, failed: Sequence[Condition], milliseconds: int) -> Breach | None:
    """Such a run, or None where none was found. Every answer has been replayed."""
    machine = Machine()
    wanted = _variables(triple, program)
    for condition in failed:
        if condition.name != "pre":
            continue
        for values in _models(condition, triple, program, wanted, milliseconds):
            found = _shown(triple, program, machine, values)
            if found is not None:
                return found
    if any(isinstance(s, While) for s in statements(program.body)):
        for values in _guesses(triple, program, wanted):
            found = _shown(triple, program, machine, values)
            if found is not None:
                return found
            if machine.endless >= _ENDLESS:
                break
    return None


def _variables(triple: Triple, program: Program) -> tuple[Variable, ...]:
    free = free_variables(triple.full_pre) | free_variables(triple.post)
    return tuple(sorted({*free, *program.state, *program.ghosts.values()}, key=lambda v: v.name))


def _shown(triple: Triple, program: Program, machine: Machine, values: Mapping[Variable, Value]) -> Breach | None:
    """Run the program on the values; a breach if the precondition holds of them and the postcondition fails."""
    start: State = {v.name: value for v, value in values.items()}
    for variable, ghost in program.ghosts.items():
        start[ghost.name] = start[variable.name]
    if not _holds(triple.pre, values, start):
        return None
    try:
        end = machine.run(program.body, start)
    except Fault as fault:
        return Breach(start, None, f"the program asks for {fault}")
    except (NoEnd, NotEvaluable):
        return None
    if not _holds(negation(triple.post), values, end):
        return None
    last = {s.target for s in statements(program.body) if isinstance(s, Assign | Update)}
    outcome = ", ".join(
        f"{v.name} = {show_value(end[v.name])}"
        for v in sorted(last & free_variables(triple.post), key=lambda v: v.name)
    )
    return Breach(start, end, f"{show(triple.post)} is demanded; the program ends with {outcome or 'it false'}")


def _holds(term: Term, values: Mapping[Variable, Value], state: Mapping[str, Value]) -> bool:
    """Whether a formula certainly holds in a state."""
    try:
        return evaluate(term, state) is True
    except NotEvaluable:
        free = free_variables(term)
        return replay([term], {v: state[v.name] for v in free if v.name in state}) is True


# -- candidates --------------------------------------------------------------------------------------------------------


def _models(
    condition: Condition, triple: Triple, program: Program, wanted: tuple[Variable, ...], milliseconds: int
) -> Iterator[dict[Variable, Value]]:
    """The solver's inputs: first with every number a simple one, then as they come."""
    formulas: list[Term] = [*condition.hypotheses, Not(condition.goal)]
    fixed: list[Term] = []
    between, at = _numbers((*formulas, *_expressions(program)))
    for term in _observed(formulas, program):
        for pool in (between, at):
            choice = _one_of(term, pool)
            if choice is None:
                continue
            tried = solve([*formulas, *fixed, choice], timeout_ms=min(milliseconds, 2000))
            if tried.status != "sat":
                continue
            number = _value(term, tried.values)
            if number is not None:
                fixed.append(Compare("==", term, _literal(number, term.sort)))
                break
    for extra in ([fixed] if fixed else []) + [[]]:
        found = solve([*formulas, *extra], timeout_ms=milliseconds)
        if found.status == "sat":
            yield _filled(found.values, wanted)


def _guesses(triple: Triple, program: Program, wanted: tuple[Variable, ...]) -> Iterator[dict[Variable, Value]]:
    """From an input that meets the precondition: all small points, or a sample of them (the same one every time)."""
    between, at = _numbers((triple.full_pre, triple.post, *_expressions(program)))
    small = sorted({*between, *at, *map(Fraction, range(8)), Fraction(-1)})
    pools: dict[Variable, list[Value]] = {}
    for variable in wanted:
        if variable in program.ghosts.values():
            continue
        match variable.sort:
            case EnumSort(members=members):
                pools[variable] = [Element(m) for m in members]
            case BoolSort():
                pools[variable] = [False, True]
            case sort if sort in _NUMERIC:
                pools[variable] = [_stored(n, sort) for n in small if _fits(n, sort)]
    found = solve([triple.full_pre], timeout_ms=1000)
    base = _filled(found.values if found.status == "sat" else {}, wanted)
    yield base
    points: Iterable[tuple[Value, ...]] = itertools.product(*pools.values())
    if math.prod(map(len, pools.values())) > _TRIED:
        rng = random.Random(0)
        points = (tuple(rng.choice(pool) for pool in pools.values()) for _ in range(_TRIED))
    for point in points:
        yield {**base, **dict(zip(pools, point, strict=True))}


def _filled(values: Mapping[Variable, Value], wanted: Iterable[Variable]) -> dict[Variable, Value]:
    filled = dict(values)
    for variable in wanted:
        if variable not in filled:
            try:
                filled[variable] = default_value(variable.sort)
            except Unsupported:  # a sort without values that can be written: the evaluation will say so
                continue
    return filled


def _observed(formulas: Sequence[Term], program: Program) -> list[Term]:
    """What is compared of the inputs' numbers: ``r``, ``level_at(i)``."""
    found: dict[Term, None] = {}
    inputs = frozenset(program.state)
    for formula in formulas:
        stack = [side for part in subterms(formula) if isinstance(part, Compare) for side in (part.left, part.right)]
        while stack:
            part = stack.pop()
            if isinstance(part, Arithmetic | Negative | Widen):
                stack.extend(children(part))
            is_application = isinstance(part, Apply) and all(isinstance(a, Variable) for a in part.arguments)
            named = isinstance(part, Variable) or is_application
            if named and part.sort in _NUMERIC and free_variables(part) <= inputs:
                found.setdefault(part)
    return list(found)[:4]


def _expressions(program: Program) -> tuple[Term, ...]:
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
        case _:
            return ()


def _numbers(terms: Iterable[Term]) -> tuple[list[Fraction], list[Fraction]]:
    """Simple numbers between the constants of some terms and beyond them, and the constants themselves."""
    constants = {
        Fraction(part.value)
        for term in terms
        for part in subterms(term)
        if isinstance(part, Literal) and part.sort in _NUMERIC and not isinstance(part.value, str)
    }
    ordered = sorted(constants)
    between = [simplest_between(a, b) for a, b in itertools.pairwise(ordered)]
    outside = [ordered[0] - 1, ordered[-1] + 1] if ordered else []
    return [*between, *outside], [*ordered, Fraction(0), Fraction(1)]


def simplest_between(low: Fraction, high: Fraction) -> Fraction:
    """A number near the middle that is easy to read: the middle rounded as far as it stays well inside."""
    middle = (low + high) / 2
    for step in (100, 50, 10, 5, 1):
        rounded = Fraction(round(middle / step) * step)
        if low < rounded < high and abs(rounded - middle) * 5 <= high - low:
            return rounded
    return middle


def _one_of(term: Term, pool: Iterable[Fraction]) -> Term | None:
    choices = tuple(Compare("==", term, _literal(n, term.sort)) for n in pool if _fits(n, term.sort))
    return Or(choices) if choices else None


def _fits(number: Fraction, sort: Sort) -> bool:
    return sort == REAL or (number.denominator == 1 and (sort == INTEGER or number >= 0))


def _stored(number: Fraction, sort: Sort) -> Value:
    return number if sort == REAL else int(number)


def _literal(number: Fraction, sort: Sort) -> Literal:
    return Literal(number, REAL) if sort == REAL else Literal(int(number), sort)


def _value(term: Term, values: Mapping[Variable, Value]) -> Fraction | None:
    try:
        value = evaluate(term, {v.name: value for v, value in values.items()})
    except NotEvaluable:
        return None
    return Fraction(value) if isinstance(value, int | Fraction) else None


__all__ = ["Breach", "breach", "simplest_between"]
