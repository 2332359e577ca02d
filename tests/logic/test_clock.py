"""The watchdog: one thread for all questions; nothing is interrupted that is done, in no order and in no process."""

from __future__ import annotations

import os
import threading
import time
import weakref

import pytest

from avow.solving.checking import check
from avow.solving.limits import allowed, budget, now, watchdog
from avow.solving.translation import Translator


def busy(seconds: float) -> None:
    end = time.thread_time() + seconds
    while time.thread_time() < end:
        pass


def test_a_block_beyond_its_limit_is_interrupted_and_again() -> None:
    hits: list[float] = []
    with watchdog(30, lambda: hits.append(time.monotonic())) as interrupted:
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
        with watchdog(60_000, lambda: None):
            entered.set()
            leave.wait(10)

    other = threading.Thread(target=long)
    other.start()
    entered.wait(10)
    with watchdog(30, lambda: None) as interrupted:
        busy(0.2)
    leave.set()
    other.join()
    assert interrupted.is_set()


def test_waiting_is_not_working() -> None:
    """The limit is in processor time; a machine that does other things changes nothing."""
    with watchdog(50, lambda: None) as interrupted:
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
        with watchdog(60_000, context.interrupt):
            pass
    del context
    assert threading.active_count() <= before + 1
    assert not any(reference() for reference in kept)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:This process .*multi-threaded:DeprecationWarning")
def test_a_forked_process_has_a_watchdog_of_its_own() -> None:
    with watchdog(1_000, lambda: None):
        pass
    child = os.fork()
    if child == 0:
        with watchdog(30, lambda: None) as interrupted:
            busy(0.3)
        os._exit(0 if interrupted.is_set() else 1)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def test_questions_within_a_budget_share_it() -> None:
    with budget(10_000):
        assert 9_000 < allowed(60_000) <= 10_000
        assert allowed(50) == 50
        with budget(100):
            assert allowed(60_000) <= 100
            end = now() + 0.15
            while now() < end:
                pass
            assert allowed(60_000) == 0
            with budget(5_000):
                assert allowed(60_000) == 0, "a block within cannot extend it"
        assert allowed(60_000) > 9_000
    assert allowed(60_000) == 60_000


def test_without_time_left_nothing_is_asked() -> None:
    translator = Translator()
    with budget(0):
        assert check(translator, [translator.true()]).status == "unknown"
    assert check(translator, [translator.true()]).status == "sat"
