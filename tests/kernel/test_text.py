"""The kernel's text of a formula says what `avow.solving` says, on generated contracts over all of the language."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

import pytest
from drawn.contracts import Strange, small_contract

from avow.formulas.formula import negation
from avow.kernel.solvers import Reply, ask_z3
from avow.kernel.text import Text, Untranslatable
from avow.language.load import check_text
from avow.language.terms import Term
from avow.solving.apart import Apart
from avow.solving.questions import solve

STEPS = 1_000_000
NAMED = {"sat": Reply.SAT, "unsat": Reply.UNSAT}


def terms(text: str) -> Iterator[Term]:
    """Every clause of a contract, and its negation."""
    contract, _ = check_text(text, "a.rcl")
    for clause in (c for node in contract.nodes for c in node.clauses) if contract is not None else ():
        yield from (clause.formula, negation(clause.formula))


def script(term: Term) -> str:
    written = Text()
    return written.script([written.formula(term, lambda v: (f"|{v.role}.{v.name}|", v.sort))])


def compare(term: Term, told: Counter[str], second: Apart | None = None) -> None:
    """Nothing can hold and not hold: as Z3 reads the kernel's text, and as the other translation has it."""
    try:
        mine = ask_z3(question := script(term), STEPS)
    except Untranslatable:
        told["no text"] += 1
        return
    theirs = NAMED.get(solve([term], effort=1_500).status, Reply.UNKNOWN)
    assert {mine, theirs} != {Reply.SAT, Reply.UNSAT}, question
    told[f"{mine}"] += 1
    if second is not None and mine is not Reply.UNKNOWN:
        said = second(question, 1_000)
        assert {mine, said} != {Reply.SAT, Reply.UNSAT}, question
        told[f"second {said}"] += 1


def over(written: Callable[[int], str], seeds: range, second: Apart | None = None) -> Counter[str]:
    told: Counter[str] = Counter()
    for seed in seeds:
        for term in terms(written(seed)):
            compare(term, told, second)
    return told


@pytest.mark.slow
@pytest.mark.parametrize("written", [lambda seed: Strange(seed).text(), small_contract], ids=["types", "cases"])
def test_generated_contracts(written: Callable[[int], str]) -> None:
    told = over(written, range(3))
    assert told["unsat"] > 0
    assert told["sat"] > 10
    assert told["no text"] < told.total() / 10


@pytest.mark.nightly
@pytest.mark.needs_cvc5
@pytest.mark.parametrize("written", [lambda seed: Strange(seed).text(), small_contract], ids=["types", "cases"])
def test_generated_contracts_at_length(written: Callable[[int], str]) -> None:
    second = Apart("cvc5")
    try:
        told = over(written, range(100, 125), second)
    finally:
        second.close()
    assert told["second unsat"] > 15
    assert told["second sat"] > 80
    assert told["no text"] < told.total() / 20
