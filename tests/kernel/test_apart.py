"""Solvers in processes of their own: what a crash, a fork or an answer out of place leaves of their answers."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator

import pytest

from avow.kernel.solvers import BUDGET, Said
from avow.solving.apart import Apart

NEVER = "(declare-fun x () Int)\n(assert (and (> x 0) (< x 1)))\n"
EVER = "(declare-fun x () Int)\n(assert (> x 0))\n"


@pytest.fixture
def solver() -> Iterator[Apart]:
    found = Apart("z3")
    yield found
    found.close()


def acting(solver: Apart, shell: str) -> None:
    """Another program in the solver's place."""
    solver.close()
    solver._owner = os.getpid()
    solver._process = subprocess.Popen(["sh", "-c", shell], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)


def test_it_answers_again_after_it_was_killed(solver: Apart) -> None:
    assert solver(NEVER, BUDGET) is Said.UNSAT
    assert solver._process is not None
    solver._process.kill()
    solver._process.wait()
    assert solver(EVER, BUDGET) is Said.SAT


@pytest.mark.parametrize("shell", ["read line; kill -SEGV $$", "read line; echo unsat", "read line; echo unsat 0"])
def test_a_crash_or_the_answer_to_another_question_is_unknown(solver: Apart, shell: str) -> None:
    acting(solver, shell)
    assert solver(NEVER, BUDGET) is Said.UNKNOWN


def test_a_fork_does_not_read_the_answers_of_the_process_that_it_is_a_fork_of(solver: Apart) -> None:
    acting(solver, "while read line; do echo unsat; done")
    theirs = solver._process
    solver._owner = -1
    assert solver(EVER, BUDGET) is Said.SAT
    assert theirs is not None
    assert theirs.poll() is None
    theirs.kill()
    theirs.communicate()
