"""The temporal checker against the definition of LTL on lassos, on random graphs and properties."""

from __future__ import annotations

import random
import time
from itertools import product

import pytest
from helpers import some

from avow.base.graphs import components
from avow.calculus import replaying
from avow.calculus.ltl import TooLong, demands_progress, violation
from avow.language.sorts import BOOL
from avow.language.terms import Role, Variable
from avow.solving.limits import spent
from avow.system.temporal import Operator, Property, State, Temporal

P, Q = (State(Variable(Role.OUTPUT, name, BOOL), name) for name in "pq")


def random_property(chance: random.Random, depth: int) -> Property:
    if depth == 0:
        return chance.choice([P, Q])
    operator = chance.choice(list(Operator))
    size = 1 if operator in (Operator.NOT, Operator.NEXT, Operator.ALWAYS, Operator.EVENTUALLY) else 2
    return Temporal(operator, tuple(random_property(chance, depth - 1) for _ in range(size)))


def holds(formula: Property, run: list[dict[State, bool]], back: int, at: int = 0) -> bool:
    """The definition, on the run that goes on with `back` after its last step."""
    following = lambda k: k + 1 if k + 1 < len(run) else back  # noqa: E731

    def reached(k: int) -> list[int]:
        places: list[int] = []
        while k not in places:
            places.append(k)
            k = following(k)
        return places

    if isinstance(formula, State):
        return run[at][formula]
    parts = formula.parts
    match formula.operator:
        case Operator.NOT:
            return not holds(parts[0], run, back, at)
        case Operator.AND:
            return all(holds(p, run, back, at) for p in parts)
        case Operator.OR:
            return any(holds(p, run, back, at) for p in parts)
        case Operator.IMPLIES:
            return not holds(parts[0], run, back, at) or holds(parts[1], run, back, at)
        case Operator.IFF:
            return holds(parts[0], run, back, at) == holds(parts[1], run, back, at)
        case Operator.NEXT:
            return holds(parts[0], run, back, following(at))
        case Operator.ALWAYS:
            return all(holds(parts[0], run, back, k) for k in reached(at))
        case Operator.EVENTUALLY:
            return any(holds(parts[0], run, back, k) for k in reached(at))
        case Operator.UNTIL:
            for k in reached(at):
                if holds(parts[1], run, back, k):
                    return True
                if not holds(parts[0], run, back, k):
                    return False
            return False
    raise AssertionError


def lassos(graph: dict[int, list[int]], length: int) -> list[tuple[list[int], int]]:
    found: list[tuple[list[int], int]] = []
    stack = [[0]]
    while stack:
        path = stack.pop()
        found += [(path, k) for k in range(len(path)) if path[k] in graph[path[-1]]]
        if len(path) < length:
            stack += [[*path, n] for n in graph[path[-1]]]
    return found


@pytest.mark.parametrize("seed", some(range(120), 40, slow=80))
def test_against_the_definition(seed: int) -> None:
    chance = random.Random(seed)
    size = chance.randint(1, 4)
    graph = {k: sorted({chance.randrange(size) for _ in range(chance.randint(1, 2))}) for k in range(size)}
    truth = {k: {P: chance.random() < 0.5, Q: chance.random() < 0.5} for k in graph}
    formula = random_property(chance, chance.randint(1, 3))
    found = violation(formula, [0], graph.__getitem__, lambda k, state: truth[k][state])
    broken = [
        (path, back) for path, back in lassos(graph, size + 3) if not holds(formula, [truth[k] for k in path], back)
    ]
    if broken:
        assert found is not None, (formula, broken[0])
    if found is not None:
        run = [*found.prefix, *found.cycle]
        assert run[0] == 0
        assert all(b in graph[a] for a, b in zip(run, [*run[1:], run[len(found.prefix)]], strict=True))
        assert not holds(formula, [truth[k] for k in run], len(found.prefix)), "the run that it shows breaks it"


@pytest.mark.parametrize("seed", range(40))
def test_a_run_is_replayed_by_the_definition(seed: int) -> None:
    chance = random.Random(seed)
    for _ in range(40):
        run = [{P: chance.random() < 0.5, Q: chance.random() < 0.5} for _ in range(chance.randint(1, 6))]
        back = chance.randrange(len(run))
        formula = random_property(chance, chance.randint(1, 3))
        assert replaying.holds(formula, run, back) is holds(formula, run, back), (formula, run, back)


def test_wanting_something_to_happen() -> None:
    always, eventually = Temporal(Operator.ALWAYS, (P,)), Temporal(Operator.EVENTUALLY, (P,))
    assert demands_progress(eventually)
    assert not demands_progress(always)
    assert demands_progress(Temporal(Operator.NOT, (always,)))
    assert demands_progress(Temporal(Operator.ALWAYS, (Temporal(Operator.IMPLIES, (Q, eventually)),)))


def test_every_operator_was_tried() -> None:
    seen = set()
    for seed, depth in product(range(60), (1, 2, 3)):
        stack = [random_property(random.Random(seed), depth)]
        while stack:
            formula = stack.pop()
            if isinstance(formula, Temporal):
                seen.add(formula.operator)
                stack += formula.parts
    assert seen == set(Operator)


def test_long_runs_are_held_against_a_property_in_time_that_grows_with_them() -> None:
    length = 40_000
    start = time.thread_time()
    assert len(components(range(length), [(k, k + 1) for k in range(length - 1)])) == length
    assert time.thread_time() - start < 5


def test_a_search_for_a_violation_ends_at_its_deadline() -> None:
    with pytest.raises(TooLong):
        violation(Temporal(Operator.ALWAYS, (P,)), [0], lambda step: (step + 1,), lambda step, state: True, spent() - 1)
