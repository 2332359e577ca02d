"""Evaluation against Z3, of formulas and values drawn by chance."""

from __future__ import annotations

import random
from fractions import Fraction

import pytest
from helpers import some

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Data, FunctionValue, Value
from avow.language import sorts as s
from avow.language import terms as t

from .terms import (
    COLOUR,
    COMMAND,
    C,
    H,
    K,
    P,
    Q,
    bound,
    eq,
    holds,
    nat,
    plus,
    real,
)


def _random_formula(rng: random.Random, depth: int, scope: tuple[t.Variable, ...]) -> t.Term:
    numbers = [v for v in scope if v.sort == s.REAL]
    naturals = [v for v in scope if v.sort == s.NATURAL]

    def number() -> t.Term:
        choice = rng.random()
        if numbers and choice < 0.7:
            return rng.choice(numbers)
        if choice < 0.8:
            return holds(H, rng.choice(numbers) if numbers else real(rng.randrange(3)))
        if numbers and choice < 0.87:
            return t.Arithmetic(rng.choice("+-"), rng.choice(numbers), real(rng.randrange(1, 3)), s.REAL)
        return real(rng.randrange(3))

    def natural() -> t.Term:
        if naturals and rng.random() < 0.7:
            return rng.choice(naturals)
        if naturals and rng.random() < 0.4:
            return plus(rng.choice(naturals), nat(1))
        return nat(rng.randrange(3))

    if depth == 0:
        commands = [C, *(v for v in scope if v.sort == COMMAND)]
        colours: list[t.Term] = [t.EnumValue("red", COLOUR), *(v for v in scope if v.sort == COLOUR)]
        match rng.randrange(10):
            case 7:
                return eq(rng.choice(commands), rng.choice(commands))
            case 8:
                return eq(rng.choice(colours), t.EnumValue(rng.choice(COLOUR.members), COLOUR))
            case 9:
                return t.In(number(), t.SetTerm((real(0), real(2)), s.SetSort(s.REAL)))
            case 0 | 1:
                return holds(rng.choice((P, Q)), number(), number())
            case 2:
                return holds(K, natural())
            case 3:
                return t.Compare(rng.choice(("==", "!=")), number(), number())
            case 4:
                return t.Compare(rng.choice(("<", "<=", ">", ">=")), number(), number())
            case 5:
                return eq(rng.choice(commands), t.Construct("move", (number(), number()), COMMAND))
            case _:
                return eq(rng.choice(commands), t.Construct("inspect", (natural(),), COMMAND))
    match rng.randrange(8):
        case 0 | 1:
            return t.And(tuple(_random_formula(rng, depth - 1, scope) for _ in range(rng.randrange(2, 4))))
        case 2:
            return t.Or(tuple(_random_formula(rng, depth - 1, scope) for _ in range(2)))
        case 3:
            return t.Implies(_random_formula(rng, depth - 1, scope), _random_formula(rng, depth - 1, scope))
        case 4:
            return t.Iff(_random_formula(rng, depth - 1, scope), _random_formula(rng, depth - 1, scope))
        case 5:
            return t.Not(_random_formula(rng, depth - 1, scope))
        case _:
            fresh = tuple(
                bound(f"v{len(scope) + k}", rng.choice((s.REAL, s.REAL, s.REAL, s.NATURAL, s.NATURAL, COMMAND, COLOUR)))
                for k in range(rng.randrange(1, 3))
            )
            body = _random_formula(rng, depth - 1, scope + fresh)
            return t.Quantified(rng.choice(list(t.Quantifier)), fresh, body)


def _random_values(rng: random.Random) -> dict[str, Value]:
    def relation() -> FunctionValue:
        default = rng.random() < 0.2
        table = {
            (Fraction(rng.randrange(3)), Fraction(rng.randrange(3))): rng.random() < 0.8
            for _ in range(rng.randrange(4))
        }
        return FunctionValue(table, default)

    move = Data("move", (Fraction(rng.randrange(3)), Fraction(rng.randrange(3))))
    return {
        "in.p": relation(),
        "in.q": relation(),
        "in.h": FunctionValue({(Fraction(rng.randrange(3)),): Fraction(rng.randrange(3))}, Fraction(rng.randrange(3))),
        "in.k": FunctionValue({(rng.randrange(3),): rng.random() < 0.7}, rng.random() < 0.2),
        "in.c": rng.choice((move, Data("inspect", (rng.randrange(3),)))),
    }


@pytest.mark.parametrize("seed", some(range(4), 1, slow=1))
def test_agrees_with_z3_on_random_formulas(seed: int) -> None:
    from avow.solving.replay import replay

    rng = random.Random(seed)
    variables = {"in.p": P, "in.q": Q, "in.h": H, "in.k": K, "in.c": C}
    evaluated = compared = true = 0
    for _ in range(60):
        formula = _random_formula(rng, 3, ())
        values = _random_values(rng)
        try:
            mine = evaluate(formula, values)
        except NotEvaluable:
            continue
        evaluated += 1
        theirs = replay([formula], {v: values[n] for n, v in variables.items()}, effort=1000)
        if theirs is not None:
            compared += 1
            true += bool(mine)
            assert mine is theirs, (seed, formula, values)
    assert evaluated > 30
    assert compared > 25
    assert 0 < true < compared
