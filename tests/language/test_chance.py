"""Guarantees with a probability: text to contract and back, faults, and what their sanity asks."""

from __future__ import annotations

import re
from fractions import Fraction

import pytest

from avow.base.verdict import Verdict
from avow.formulas.formula import node_digest
from avow.language.contract import Node
from avow.language.definitions import show_clause
from avow.language.format import format_text
from avow.language.load import check_text
from avow.language.terms import TRUE
from avow.language.translate import to_rcl
from avow.sanity.analysis import analyse

RCL = """node n {{
  inputs( p, q : BOOL )
  outputs( d, e : BOOL )
  topics()
  {clauses}
}}
"""
SEEN = 'guarantee seen "It sees" with probability >= 0.99 given ( in.p and not in.q ) ( out.d )'
RUN = "guarantee with probability >= 0.5 per run ( in.p -> out.d )"


def node(*clauses: str) -> Node:
    contract, found = check_text(RCL.format(clauses="\n  ".join(clauses)), "s.rcl")
    assert contract is not None, found
    return contract.nodes[0]


def test_a_text_and_its_clause() -> None:
    seen, run = node(SEEN, RUN).guarantees
    assert seen.chance is not None
    assert run.chance is not None
    assert (seen.chance.least, seen.chance.per_run, run.name, run.chance.per_run) == (
        Fraction(99, 100),
        False,
        "G2",
        True,
    )
    assert seen.formula == run.formula == TRUE, "no engine may use it as if it always held"
    assert show_clause(seen, node(SEEN)) == "out.d given in.p ∧ ¬in.q, with probability ≥ 0.99"


@pytest.mark.parametrize("squeeze", [False, True])
def test_formatter_and_printer_keep_it(squeeze: bool) -> None:
    text = RCL.format(clauses=f"{SEEN}\n  {RUN}\n  guarantee with( out.e )")
    written = re.sub(r"\( (?=[io])", "(", text) if squeeze else text
    formatted = format_text(written, "s.rcl")
    assert format_text(formatted, "s.rcl") == formatted
    (first, _), (again, _), (printed, _) = (
        check_text(t, "s.rcl") for t in (written, formatted, to_rcl(check_text(written, "s.rcl")[0]))
    )  # type: ignore[arg-type]
    assert first is not None
    assert first.nodes == again.nodes == printed.nodes  # type: ignore[union-attr]


@pytest.mark.parametrize(
    "other",
    [
        SEEN.replace("0.99", "0.98"),
        SEEN.replace("and not", "and"),
        SEEN.replace("out.d", "out.e"),
        SEEN.replace("given ( in.p and not in.q )", "per run"),
    ],
)
def test_each_part_belongs_to_what_evidence_is_about(other: str) -> None:
    one, two = node(SEEN), node(other)
    assert node_digest(one, one.guarantees[0]) != node_digest(two, two.guarantees[0])


@pytest.mark.parametrize(
    ("clause", "code", "message"),
    [
        ("guarantee g with probability >= 1 ( out.d )", "RCL224", "always holds"),
        ("guarantee g with probability >= 0.0 ( out.d )", "RCL224", "demands nothing"),
        ("guarantee g with probability >= 1.5 ( out.d )", "RCL224", "1.5 is no probability"),
        ("assume a with probability >= 0.5 ( in.p )", "RCL224", "an assumption has no probability"),
        ("guarantee g with probability >= 0.5 per run given ( in.p ) ( out.d )", "RCL224", "has no `given`"),
        ("guarantee g with probability > 0.5 ( out.d )", "RCL113", "expected `>= P`"),
        ("guarantee g with probability >= 0.5 given in.p ( out.d )", "RCL113", "in parentheses after `given`"),
        ("guarantee g with probability >= 0.5 given ( in.r ) ( out.d )", "RCL203", "no input `r`"),
        ("guarantee g with probability >= 0.5 given () ( out.d )", "RCL113", "after `given` and not `)`"),
        ("guarantee g with probability >= 0.5 ( once(out.d) )", "RCL322", "there is one here only"),
    ],
)
def test_faults_are_at_their_place(clause: str, code: str, message: str) -> None:
    contract, found = check_text(RCL.format(clauses=f"{clause}\n  guarantee other ( out.d )"), "s.rcl")
    errors = [d for d in found if d.is_error]
    assert contract is None
    assert [(d.code, d.span and d.span.line) for d in errors] == [(code, 5)], errors
    assert message in errors[0].message


def refuted(*clauses: str) -> set[str]:
    return {r.name for r in analyse(node(*clauses)) if r.verdict is Verdict.REFUTED}


def test_sanity() -> None:
    """A tautology, a condition that cannot arise, and one under which other guarantees exclude the claim."""
    head = "guarantee g with probability >= 0.5"
    assert refuted(f"{head} given ( in.p ) ( out.d )", "guarantee other ( in.q <=> out.e )") == set()
    assert "not-tautological-g" in refuted(f"{head} given ( in.p ) ( in.p or out.d )")
    assert "not-vacuous-g" in refuted("assume never ( not in.p )", f"{head} given ( in.p ) ( out.d )")
    assert refuted(f"{head} given ( in.p ) ( out.d )", "guarantee off ( in.p -> not out.d )") >= {"not-vacuous-g"}
    over_runs = "guarantee slow ( previous(in.q, FALSE) -> not out.e )"
    assert refuted(f"{head} given ( in.p ) ( out.d )", over_runs) & {"not-tautological-g", "not-vacuous-g"} == set()
