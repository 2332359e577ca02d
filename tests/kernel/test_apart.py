"""Solvers in processes of their own: what a crash, a fork or an answer out of place leaves of their answers."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator

import pytest

from avow.kernel.solvers import BUDGET, Reply
from avow.solving.apart import Apart, versions
from avow.solving.checking import z3_version

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
    process = subprocess.Popen(
        ["sh", "-c", shell], stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
    )
    solver._owner, solver._process = os.getpid(), process


def test_it_answers_again_after_it_was_killed(solver: Apart) -> None:
    assert solver(NEVER, BUDGET) is Reply.UNSAT
    process = solver._process
    assert process is not None
    process.kill()
    process.wait()
    assert solver(EVER, BUDGET) is Reply.SAT


@pytest.mark.parametrize("shell", ["kill -SEGV $$", "echo unsat", "echo '[\"unsat\"]'"])
def test_a_crash_or_the_answer_to_another_question_is_unknown(solver: Apart, shell: str) -> None:
    acting(solver, f"read line; {shell}")
    assert solver(NEVER, BUDGET) is Reply.UNKNOWN


def test_a_fork_does_not_read_the_answers_of_the_process_that_it_is_a_fork_of(solver: Apart) -> None:
    acting(solver, "while read line; do echo unsat; done")
    theirs = solver._process
    solver._owner = -1
    assert solver(EVER, BUDGET) is Reply.SAT
    assert theirs is not None
    assert theirs.poll() is None
    theirs.kill()
    theirs.communicate()


def test_one_that_hangs_is_ended(solver: Apart, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("avow.solving.apart.NET_MS", 100)
    acting(solver, "read line; sleep 60")
    hanging = solver._process
    assert solver(NEVER, BUDGET) is Reply.LATE
    assert hanging is not None
    assert hanging.poll() is not None


def test_z3_has_one_version() -> None:
    """A report names the kernel's solvers beside the backends that ask Z3."""
    assert versions()["z3"] == z3_version()
