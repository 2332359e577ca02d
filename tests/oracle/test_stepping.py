"""What is said step by step is what is said over all steps."""

from __future__ import annotations

import random

import pytest
from drawn.memory import clause, run_of
from reference.meaning import keeps

from avow.language.printer import show_term
from oracle.stepping import Watch


@pytest.mark.parametrize("seed", range(150))
def test_a_walk_says_what_the_definitions_say(seed: int) -> None:
    rng = random.Random(seed)
    term, run = clause(rng), run_of(rng, 7)
    watch = Watch(term)
    memory = watch.begins
    for k, step in enumerate(run):
        held, memory = watch.step(step, memory)
        assert held is keeps(term, run[: k + 1]), (show_term(term, "rcl"), k)
        if not held and watch.response is not None:
            return
