"""What is remembered for each value of a quantified variable, against the definitions over all steps of a run and all
values up to a number that no step names."""

from __future__ import annotations

import random

import pytest
from drawn.formulas import NATURAL as NUMBER
from drawn.formulas import Formulas, checked
from helpers import some
from oracle.domains import plain
from reference.meaning import Meaning, Step

from avow.base.tuning.bounds import INSTANCES
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.evaluation.running import Keeper
from avow.formulas.temporal.cells import Records
from avow.formulas.values import FunctionValue, SequenceValue, Value
from avow.language.load import check_text, parse_formula
from avow.language.printer import show_term
from avow.language.sorts import NATURAL
from avow.language.terms import Term
from temporal import test_cells

PORTS = "a : BOOL, n : NATURAL, f : NATURAL --> BOOL, g : NATURAL --> NATURAL, p : NATURAL x NATURAL --> BOOL"
NODE = checked(f"node n {{ inputs( {PORTS}, s : <NATURAL> ) outputs( b : BOOL ) topics() guarantee( TRUE ) }}").nodes[0]
NAMED, ALL = 4, 7
"""Steps speak of numbers below the one; the definitions look at those below the other."""


def quantified(rng: random.Random, depth: int) -> Term:
    bound, made = rng.choice((("k",), ("k", "l"))), Formulas(rng)

    def inside(depth: int) -> str:
        if depth == 0:
            i, j = rng.choice(bound), rng.choice(bound)
            order = rng.choice(("==", "<=", ">"))
            return rng.choice(
                ("a", f"f({i})", f"f({i})", f"p({i}, {j})", f"g({i}) {order} in.n", f"{i} == in.n", f"{i} in s")
            )
        if rng.random() < 0.7:
            return made.past(lambda: inside(depth - 1), {"in.n": NUMBER})
        return f"not ({inside(depth - 1)})"

    text = f"{rng.choice(('forall', 'exists'))}({', '.join(bound)} in NATURAL | {inside(depth)})"
    return parse_formula(text, NODE, remembers=True)


def run_of(rng: random.Random, length: int = 6) -> list[Step]:
    def some() -> list[int]:
        return [n for n in range(NAMED) if rng.random() < 0.5]

    def step() -> Step:
        pairs = {(n, m): True for n in some() for m in some() if rng.random() < 0.5}
        return {
            "in.a": rng.random() < 0.5,
            "out.b": rng.random() < 0.5,
            "in.n": rng.randrange(NAMED),
            "in.f": FunctionValue({(n,): True for n in some()}, False),
            "in.g": FunctionValue({(n,): rng.randrange(NAMED) for n in some()}, 0),
            "in.p": FunctionValue(pairs, False),
            "in.s": SequenceValue(tuple(some())),
        }

    return [step() for _ in range(length)]


def by_definition(term: Term, run: list[Step]) -> list[bool]:
    shown = [{name: plain(v) for name, v in step.items()} for step in run]
    return [Meaning(ranges={NATURAL: range(ALL)}).value(term, shown, k) for k in range(len(run))]


def agreed(rng: random.Random) -> bool | str:
    """Whether tables and definition say the same at each step, or a formula of which they do not; False where the
    tables say nothing."""
    term, run = quantified(rng, rng.randrange(1, 3)), run_of(rng)
    try:
        found = test_cells.judged(term, run)
    except NotEvaluable:
        return False
    return found == by_definition(term, run) or show_term(term, "rcl")


@pytest.mark.parametrize("seed", some(range(4), 1, slow=3))
def test_tables_are_what_the_definitions_say(seed: int) -> None:
    rng = random.Random(seed)
    found = [agreed(rng) for _ in range(60)]
    assert [each for each in found if isinstance(each, str)] == []
    assert found.count(True) > 50


def said(clause: str, ports: str = "f : NATURAL --> BOOL, g : NATURAL --> REAL, s : <REAL>") -> Term:
    text = f"node n {{ inputs( {ports} ) outputs( b : BOOL ) topics() guarantee( {clause} ) }}"
    contract, found = check_text(text, "n.rcl")
    assert contract is not None, found
    return contract.nodes[0].guarantees[0].formula


def test_each_item_of_an_array_has_its_own_past() -> None:
    """An index that the array of the step before did not have, has no value before."""
    near = said("forall(i in indices(in.s) | previous(in.s(i), in.s(i)) - 1 <= in.s(i) or in.s(i) == 0)")
    run: list[Step] = [{"in.s": SequenceValue(tuple(items))} for items in ((5, 5), (5, 4), (4, 0), (1, 0), (1, 1))]
    assert test_cells.judged(near, run) == [True, True, True, False, True]


def test_more_values_than_are_kept_leave_it_undecided() -> None:
    once = said("forall(i in NATURAL | once(f(i)) -> i != 3)")
    records = Records()
    now = records.clause(once)
    keeper = Keeper(records.cells)
    step: dict[str, Value] = {"in.f": FunctionValue({(4 + n,): True for n in range(INSTANCES)}, False)}
    assert evaluate(now, keeper.at(step)) is True
    keeper.advance(step)
    assert len(next(iter(keeper.memory.values())).table) == INSTANCES  # type: ignore[union-attr]
    keeper.advance({"in.f": FunctionValue({(3,): True}, False)})
    with pytest.raises(NotEvaluable):
        evaluate(now, keeper.at(step))


def test_infinitely_many_values_that_differ_are_not_kept() -> None:
    records = Records()
    records.clause(said("forall(i in INTEGER | previous(i < x, FALSE) -> b)", "x : INTEGER"))
    keeper = Keeper(records.cells)
    keeper.advance({"in.x": 3, "out.b": True})
    assert keeper.memory == {}
