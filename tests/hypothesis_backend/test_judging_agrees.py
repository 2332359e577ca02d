"""The judge of generated cases, and the Python that generated tests assert, against a brute-force reading of random
formulas and against Z3."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any

import pytest
from helpers import some
from oracle.domains import as_written, plain
from rosmonitoring.conftest import make_system
from rosmonitoring.test_agreement import MAPPING, MEANING, RCL, formula

from avow.backends.hypothesis.convention import as_plain
from avow.backends.hypothesis.export import _helpers
from avow.backends.hypothesis.judging import judged
from avow.backends.hypothesis.translate import Translator, Untranslatable
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import Records
from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.language.sorts import BOOL, REAL, DataSort, EnumSort, FunctionSort
from avow.language.terms import Term, Variable
from avow.solving.replay import replay
from avow.system.plan import System

__all__ = ["make_system"]

NUMBERS = (Fraction(0), Fraction(1), Fraction(5, 2), Fraction(-3, 2), Fraction(7))


def value(rng: random.Random, variable: Variable) -> Value:
    match variable.sort:
        case EnumSort(members=members):
            return Element(rng.choice(members))
        case DataSort(constructors=constructors):
            made = rng.choice(constructors)
            return Data(made.name, tuple(value(rng, Variable(variable.role, "x", s)) for s in made.parameters))
        case FunctionSort(parameters=parameters):
            points = {
                tuple(value(rng, Variable(variable.role, "x", s)) for s in parameters) for _ in range(rng.randint(0, 2))
            }
            return FunctionValue(dict.fromkeys(points, True), False)
        case sort if sort == BOOL:
            return rng.random() < 0.5
        case sort if sort == REAL:
            return rng.choice(NUMBERS)
    return rng.choice((0, 1, 2))


SCOPE: dict[str, Any] = {"Fraction": Fraction}
for text in [*_helpers().values()][:4]:
    exec(text, SCOPE)


def asserts(term: Term, values: Mapping[Variable, Value], expected: bool) -> bool:
    """Whether a generated test asserts the formula; then it says what is expected."""
    names = {v.qualified: f"v{k}" for k, v in enumerate(values)}
    try:
        said = Translator(names, frozenset(names.values())).formula(term)
    except Untranslatable:
        return False
    given = {names[v.qualified]: as_plain(value, SCOPE["Table"]) for v, value in values.items()}
    assert bool(eval(said, {**SCOPE, **given})) is expected, (said, given)
    return True


@pytest.mark.parametrize("seed", some(range(4), 1, slow=1))
def test_three_judges_agree(seed: int, make_system: Callable[..., System]) -> None:
    rng = random.Random(seed)
    held = broken = asked = translated = 0
    for _ in range(12):
        system = make_system(RCL.format(formula=formula(rng, rng.choice((1, 2, 3)))), MAPPING)
        clause = system.contract.node("n").guarantees[0]
        judge = judged(clause.name, clause.formula, Records())
        for _ in range(4):
            values = {v: value(rng, v) for v in sorted(free_variables(clause.formula), key=lambda v: v.qualified)}
            snapshot = {v.qualified: plain(found) for v, found in values.items()}
            expected = MEANING.met(as_written(clause), [snapshot])
            assert judge.holds({v.qualified: found for v, found in values.items()}) is expected, (clause.text, values)
            translated += asserts(clause.formula, values, expected)
            if rng.random() < 0.3:
                by_z3 = replay([clause.formula], values, effort=3000)
                assert by_z3 in (None, expected), (clause.text, values)
                asked += by_z3 is not None
            held, broken = held + expected, broken + (not expected)
    assert min(held, broken, asked, translated) > 5
