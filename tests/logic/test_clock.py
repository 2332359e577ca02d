"""The watchdog: one thread for all questions; nothing is interrupted that is done, in no order and in no process."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import threading
import time
import weakref
from pathlib import Path

import pytest

from avow.base.tuning.effort import MOST_STEPS, STEPS
from avow.base.verdict import Verdict
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds
from avow.solving.checking import check
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
    watchdog,
)
from avow.solving.translation import Translator
from avow.system.load import load_path


def busy(seconds: float) -> None:
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_a_block_beyond_its_limit_is_interrupted_and_again() -> None:
    hits: list[float] = []
    with watchdog(0.03, lambda: hits.append(time.monotonic())) as interrupted:
        busy(0.2)
    assert interrupted.is_set()
    assert len(hits) >= 2
    count = len(hits)
    time.sleep(0.1)
    assert len(hits) == count, "nothing is interrupted once the block is left"


def test_a_short_limit_behind_a_long_one() -> None:
    """The dog sleeps until the long one's end: it has to be told of the short one."""
    leave = threading.Event()
    entered = threading.Event()

    def long() -> None:
        with watchdog(60, lambda: None):
            entered.set()
            leave.wait(10)

    other = threading.Thread(target=long)
    other.start()
    entered.wait(10)
    with watchdog(0.03, lambda: None) as interrupted:
        busy(0.2)
    leave.set()
    other.join()
    assert interrupted.is_set()


def test_waiting_is_not_working() -> None:
    """The limit is in processor time; a machine that does other things changes nothing."""
    with watchdog(0.05, lambda: None) as interrupted:
        time.sleep(0.3)
    assert not interrupted.is_set()


def test_many_blocks_take_one_thread_and_keep_nothing_alive() -> None:
    class Context:
        def interrupt(self) -> None: ...

    kept = []
    before = threading.active_count()
    for _ in range(300):
        context = Context()
        kept.append(weakref.ref(context))
        with watchdog(60, context.interrupt):
            pass
    del context
    assert threading.active_count() <= before + 1
    assert not any(reference() for reference in kept)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:This process .*multi-threaded:DeprecationWarning")
def test_a_forked_process_has_a_watchdog_of_its_own() -> None:
    with watchdog(1, lambda: None):
        pass
    child = os.fork()
    if child == 0:
        with watchdog(0.03, lambda: None) as interrupted:
            busy(0.3)
        os._exit(0 if interrupted.is_set() else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


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


def test_time_that_passes_is_no_effort() -> None:
    with budget(100):
        busy(0.3)
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
from avow.language.load import parse_term
from avow.language.contract import Contract
from avow.solving.limits import spent
from avow.solving.questions import solve
from tests.logic.contracts import node

of = node(
    "inputs( x : REAL, y : REAL, z : REAL, a : REAL ) outputs( u : REAL, f : REAL --> REAL )"
    "|assume( in.x * in.y * in.z > in.a * in.a + 1 ) guarantee( forall(k in REAL | out.f(out.f(k)) == k * k + in.x) )"
    " guarantee( out.u * out.u * out.u == in.x * in.y + in.z )"
)
print(solve({c.name: c.formula for c in of.clauses}, effort=300).status, spent())
"""


@pytest.mark.nightly
def test_the_same_question_takes_the_same_steps_in_every_process() -> None:
    """Whatever the order of Python's sets: so that a verdict does not change with the process that it is found in."""
    said = {
        subprocess.run(
            [sys.executable, "-c", HARD], env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True
        ).stdout
        for seed in ("0", "1", "77")
    }
    assert len(said) == 1
    assert said.pop().strip()
