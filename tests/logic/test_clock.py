"""Limits of questions: counted in steps; the clock ends only what hangs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from avow.base.tuning.effort import MOST_STEPS, STEPS
from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds
from avow.solving.checking import HANGS, check
from avow.solving.limits import (
    NO_ANSWER,
    allowed,
    budget,
    effort_left,
    from_seconds,
    spend,
    spent,
    steps,
    tried,
    until,
)
from avow.solving.translation import Translator
from avow.solving.z3_module import z3
from avow.system.load import load_path


def test_a_question_that_hangs_is_ended_by_the_clock(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("avow.solving.checking.net", lambda _: 30)
    translator = Translator()
    a, b, c, d = (z3.Int(name, translator.context) for name in "abcd")
    cubes = [a * a * a + b * b * b == c * c * c + d * d * d, a > 1, c > a, b > c, d > 1]
    assert check(translator, [*cubes, a + b > 10**6], effort=100_000).reason == HANGS
    assert check(translator, [a > 1]).status == "sat", "the next question is asked as ever"


def test_questions_within_a_budget_share_it() -> None:
    with budget(10_000):
        assert allowed(60_000) == 10_000
        assert allowed(50) == 50
        with budget(100):
            assert allowed(60_000) == 100
            spend(150 * STEPS)
            assert allowed(60_000) == 0
            with budget(5_000):
                assert allowed(60_000) == 0, "a block within cannot extend it"
        assert allowed(60_000) == 9_850
    assert allowed(60_000) == 60_000


@pytest.mark.parametrize("before", [0, 1, 1_234_567_891, 987_654_321_987])
def test_what_is_left_does_not_hang_on_what_was_spent_before(before: int) -> None:
    """Fractions of a unit are rounded: one step too few once changed what a search was allowed."""
    spend(before)
    for _ in range(50):
        spend(1)
        end = until(100)
        assert effort_left(end) == 100
        with budget(100):
            assert allowed(60_000) == 100


def test_without_effort_left_nothing_is_asked() -> None:
    translator = Translator()
    with budget(0):
        assert check(translator, [translator.true()]).status == "unknown"
    assert check(translator, [translator.true()]).status == "sat"


def test_a_deadline_is_never_later_than_the_budget() -> None:
    with budget(100):
        assert until(60_000) == until(100)
        spend(150 * STEPS)
        assert until(60_000) < spent()


def test_a_loop_of_refused_questions_comes_to_an_end() -> None:
    translator, before = Translator(), spent()
    with budget(0):
        check(translator, [translator.true()])
    assert spent() > before


@pytest.mark.slow
@pytest.mark.parametrize("effort", [2, 10])
def test_with_next_to_no_effort_the_analysis_of_a_node_ends_at_once(effort: int, root: Path) -> None:
    """Seen: minutes of writing down questions that were refused, in searches that began when all was used up."""
    contract = load_path(root / "contracts" / "remote_inspection").contract
    agent = next(node for node in contract.nodes if node.name == "agent")
    before = spent()
    results = analyse(agent, bounds=Bounds(effort))
    assert spent() - before < 400
    realizable = next(r for r in results if r.name == "realizable")
    assert realizable.verdict is Verdict.UNKNOWN
    assert re.match(r"no answer with [0-9,]+ steps of effort, which usually take", realizable.explanation)


def test_where_effort_is_used_up_the_reason_says_how_much_it_was() -> None:
    assert tried(NO_ANSWER, 300) == (
        "no answer with 1,200,000 steps of effort, which usually take 0.3 s; "
        "`seconds:` in the plan, or `--seconds`, allows more"
    )
    assert tried(tried("", 100), 300) == tried("", 300), "of the whole question, not of its last attempt"
    assert tried("the solver gave up: incomplete", 300) == "the solver gave up: incomplete"
    assert tried(NO_ANSWER, 0) == NO_ANSWER


def test_a_limit_is_never_none_at_all() -> None:
    assert steps(0.0001) == 1
    assert steps(1e12) == MOST_STEPS < 2**32
    assert from_seconds(1e-6) == 1
    assert from_seconds(3) == 3_000


HARD = """
from avow.solving.limits import spent
from avow.solving.questions import solve
from avow.sanity.analysis import analyse
from logic.contracts import node
from logic.test_oracle import small_node

of = node(
    "inputs( x : REAL, y : REAL, z : REAL, a : REAL ) outputs( u : REAL, f : REAL --> REAL )"
    "|assume( in.x * in.y * in.z > in.a * in.a + 1 ) guarantee( forall(k in REAL | out.f(out.f(k)) == k * k + in.x) )"
    " guarantee( out.u * out.u * out.u == in.x * in.y + in.z )"
)
print(solve({c.name: c.formula for c in of.clauses}, effort=300).status, spent())
results = [result.verdict for each in (small_node(12), small_node(32)) for result in analyse(each)]
print(*results, spent())
"""


@pytest.mark.slow
def test_the_same_question_takes_the_same_steps_in_every_process() -> None:
    """Whatever the order of Python's sets: so that a verdict does not change with the process that it is found in."""
    said = {
        subprocess.run(
            [sys.executable, "-c", HARD],
            env={**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": str(Path(__file__).parents[1])},
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout
        for seed in ("0", "1", "77")
    }
    assert len(said) == 1
    assert said.pop().strip()
