"""What a claim is answered does not depend on which others are asked, before it or at all."""

from __future__ import annotations

import subprocess
import sys
from random import Random

import pytest
from drawn.contracts import small_contract
from helpers import some
from scale.made import node as node_of_integers

from avow.base.tuning.effort import STEPS
from avow.language.contract import Node
from avow.language.load import check_text
from avow.language.sorts import BOOL, INTEGER, TupleSort
from avow.language.terms import And, Compare, Role, Term, Variable
from avow.sanity.analysis import analyse
from avow.sanity.claims import claims
from avow.sanity.results import Bounds, SanityResult
from avow.solving.limits import spent
from avow.solving.questions import Solution, solve
from avow.solving.translation import new_session


def generated(seed: int) -> Node:
    """Of the first text that is a contract: not each that is drawn is one."""
    drawn = (check_text(small_contract(seed + 1000 * more), "test.rcl")[0] for more in range(20))
    return next(found for found in drawn if found is not None).nodes[0]


def said(result: SanityResult) -> object:
    return result.name, result.verdict, result.clauses, result.counterexample, result.explanation, result.because


@pytest.mark.parametrize("seed", some(range(40), 0, 3))
def test_claims_are_answered_alike_whichever_are_wanted(seed: int) -> None:
    node = generated(seed)
    bounds = Bounds(60)
    whole = {result.name: said(result) for result in analyse(node, bounds=bounds)}
    names = [claim.name for claim in claims(node)]
    for count in (1, len(names) // 3):
        wanted = Random(seed).sample(names, count)
        assert {r.name: said(r) for r in analyse(node, bounds=bounds, wanted=wanted)} == {n: whole[n] for n in wanted}


def answered(asked: dict[str, Term]) -> tuple[Solution, int]:
    """And the steps that it took."""
    start = spent()
    answer = solve(asked, effort=300)
    return Solution(answer.status, answer.values, answer.core, answer.reason, answer.engine), round(
        (spent() - start) * STEPS
    )


@pytest.mark.parametrize("seed", some(range(40), 3, 8))
def test_a_session_gives_the_same_answers_whatever_was_asked_before_it(seed: int) -> None:
    """The same values and the same effort, however full another session of this process is."""
    node = generated(seed)
    clauses = [(clause.name, clause.formula) for clause in node.clauses]
    questions = [dict(clauses), *({name: formula} for name, formula in clauses), dict(clauses[:2])]
    found = []
    for before in (0, 1, len(questions)):
        with new_session():
            for asked in questions[:before]:
                answered(asked)
            with new_session():
                found.append([answered(asked) for asked in questions])
    assert found[0] == found[1] == found[2]


@pytest.mark.skipif(sys.platform != "linux", reason="the peak of a process is read from /proc")
def test_the_analysis_of_a_node_with_twenty_guarantees_takes_less_than_150_megabytes() -> None:
    names = range(20)
    promised = [f"in.x{k} > {k} -> out.y{k} >= in.x{k} + {k} - 20" for k in names]
    text = node_of_integers("n", [f"x{k}" for k in names], [f"y{k}" for k in names], ["in.x0 >= -1000"], promised)
    code = """
import sys
from pathlib import Path
from avow.language.load import check_text
from avow.sanity.analysis import analyse
contract, _ = check_text(sys.argv[1], "f")
assert all(result.verdict in ("proved", "refuted") for result in analyse(contract.nodes[0]))
print(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0])
"""
    done = subprocess.run([sys.executable, "-c", code, text], capture_output=True, text=True, check=True)
    assert int(done.stdout) < 150 << 10  # in KiB


def test_sorts_of_one_name_stay_apart() -> None:
    """Z3 knows sorts by their names, and tuples of any kind are called alike."""
    one, other = TupleSort((INTEGER, BOOL)), TupleSort((BOOL, BOOL))
    a, b = (Variable(Role.INPUT, name, one) for name in "ab")
    c, d = (Variable(Role.INPUT, name, other) for name in "cd")
    first, second = Compare("==", a, b), Compare("!=", c, d)
    with new_session():
        assert solve([first]).status == solve([second]).status == solve([first, second]).status == "sat"
        assert solve([second, first, Compare("==", c, d)]).status == "unsat"
        assert solve([And((first, second)), Compare("!=", a, b)]).status == "unsat"
