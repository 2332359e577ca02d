"""What is done for each node of a system costs four times as much for four times as many nodes, and little more."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from helpers import calls

from avow.calculus.variables import closest, indexed
from avow.formulas.formula import free_variables
from avow.language.sorts import INTEGER
from avow.language.terms import Compare, Literal, Role, Variable
from avow.pipeline.work import catalogue
from avow.system.load import load_path
from avow.system.plan import System

from .made import chain, fan


def made(folder: Path, text: str) -> System:
    path = folder / "system.rcl"
    path.write_text(text)
    return load_path(path)


def at_least(name: str, least: int) -> Compare:
    return Compare("<=", Literal(least, INTEGER), Variable(Role.BOUND, name, INTEGER))


def below(one: str, other: str) -> Compare:
    return Compare("<=", Variable(Role.BOUND, one, INTEGER), Variable(Role.BOUND, other, INTEGER))


def test_the_closest_facts_are_those_about_the_goal_and_bounds_of_what_these_speak_of() -> None:
    facts = {"a": below("x", "y"), "b": at_least("x", 0), "c": below("x", "z"), "d": at_least("z", 0)}
    goal = at_least("y", 0)
    assert list(closest([indexed(facts)], goal)) == ["a", "b"]
    split = [indexed({k: v}) for k, v in facts.items()]
    assert sorted(closest(split, goal)) == ["a", "b"]
    for part in split:
        (fact,) = part.terms.values()
        assert set(part.speaking) == set(free_variables(fact))


@pytest.mark.parametrize("shape", [chain, fan])
def test_four_times_the_nodes_list_in_at_most_five_times_the_steps(tmp_path: Path, shape: Callable[[int], str]) -> None:
    first, small, large = (made(tmp_path, shape(count)) for count in (3, 20, 80))
    catalogue(first)  # what is done once
    less, more = (calls(lambda: catalogue(system)) for system in (small, large))  # noqa: B023
    assert more <= 5 * less, (less, more)
