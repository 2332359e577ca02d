"""Mutants of a formula are near misses: well-typed, of another meaning, and only telling ones are used."""

from __future__ import annotations

from fractions import Fraction

from avow.formulas.formula import normalise
from avow.language.contract import Node
from avow.language.load import check_text
from avow.language.terms import Term
from avow.sanity.mutants import Mutant, difference, mutants, telling


def guarantee(formula: str) -> Term:
    text = f"node n {{ inputs(r : REAL, k : INTEGER) outputs(s : {{low, mid, high}}) topics() guarantee({formula}) }}"
    contract, found = check_text(text, "t.rcl")
    assert contract is not None, found
    return contract.nodes[0].guarantees[0].formula


def changes(formula: str) -> set[str]:
    return {m.change for m in mutants(guarantee(formula))}


def test_every_kind_of_change_is_made() -> None:
    found = changes("0 <= in.r and in.r < 120 -> out.s == low")
    assert {
        "the whole is negated",
        "part 1 of a conjunction is dropped",
        "part 2 of a conjunction is dropped",
        "< becomes <=",
        "<= becomes <",
        "120 becomes 132",
        "120 becomes 108",
        "low becomes mid",
        "a condition is dropped",
    } <= found


def test_no_mutant_means_the_original_and_none_stands_twice() -> None:
    formula = guarantee("not (in.r < 1 or in.k > 2) -> out.s != high")
    meanings = [normalise(m.formula) for m in mutants(formula)]
    assert normalise(formula) not in meanings
    assert len(meanings) == len(set(meanings))


def test_a_weaker_claim_is_no_test_of_the_evidence() -> None:
    formula = guarantee("in.r <= 10 -> out.s == low")
    told = {m.change for m in telling(formula, (), limit=99)}
    assert "<= becomes <" not in told, "it follows from the original"
    assert "10 becomes 9" not in told
    assert {"10 becomes 11", "low becomes mid", "the whole is negated"} <= told


def test_the_limit_spreads_over_the_formula() -> None:
    formula = guarantee("0 <= in.r and in.r < 120 and in.k > 5 -> out.s == low")
    every = telling(formula, (), limit=99)
    some = telling(formula, (), limit=3)
    assert len(some) == 3
    assert set(some) < set(every)


def node_of(*guarantees: str) -> Node:
    inside = " ".join(f"guarantee g{k} ({text})" for k, text in enumerate(guarantees, start=1))
    contract, found = check_text(f"node n {{ inputs(r : REAL) outputs(s : {{low, high}}) topics() {inside} }}", "t.rcl")
    assert contract is not None, found
    return contract.nodes[0]


def test_what_follows_from_the_other_guarantees_is_no_mutant() -> None:
    node = node_of("in.r < 18 -> out.s == low", "in.r < 20 -> out.s == low")
    first, second = (g.formula for g in node.guarantees)
    assert "18 becomes 19" in {m.change for m in telling(first, (), limit=99)}
    assert "18 becomes 19" not in {m.change for m in telling(first, (), limit=99, others=(second,))}


def mutant(node: Node, change: str) -> Mutant:
    return next(m for m in mutants(node.guarantees[0].formula) if m.change == change)


def test_where_every_answer_breaks_the_mutant_the_method_has_not_looked() -> None:
    node = node_of("in.r < 18 -> out.s == low", "in.r >= 18 -> out.s == high")
    found = difference(node, mutant(node, "18 becomes 19"))
    assert found.forced
    ((name, value),) = found.at
    assert name == "in.r"
    assert 18 <= Fraction(value) < 19
    assert found.answer == (("out.s", "high"),)
    assert f"at in.r = {value} every answer" in found.why


def test_where_the_contract_leaves_a_choice_the_program_may_be_stricter() -> None:
    node = node_of("in.r < 18 -> out.s == low")
    found = difference(node, mutant(node, "18 becomes 19"))
    assert not found.forced
    assert found.answer == (("out.s", "high"),)
    assert "others, which do not" in found.why


def test_an_unrealizable_contract_shows_no_difference_where_it_has_no_answer() -> None:
    node = node_of("in.r < 18 -> out.s == low", "in.r < 18 -> out.s == high", "in.r >= 18 -> out.s == high")
    found = difference(node, mutant(node, "18 becomes 17"))
    assert not found.forced
    assert not found.answer
