"""Refinement of nodes that remember, against all their runs by the definitions of the operators; and known answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import pytest
from helpers import some
from oracle.runs import longer
from reference.meaning import Step, keeps

from avow.base.verdict import Verdict
from avow.calculus import refinement
from avow.calculus.discharge import Bounds
from avow.calculus.questions import Answer
from avow.calculus.refinement import refines
from avow.calculus.requirements import formula_question
from avow.formulas.temporal.cells import remembers
from avow.kernel.certificate import How
from avow.kernel.check import Needed
from avow.language.contract import Node
from avow.language.load import check_text
from temporal.test_viability import drawn, node_of

DEPTH = 4


def broken_by(concrete: Node, abstract: Node, run: list[Step] | None = None) -> set[str]:
    """The clauses that some run of at most so many steps breaks."""
    run = run or []
    found: set[str] = set()
    if len(run) == DEPTH:
        return found
    for more in longer(run):
        if not all(keeps(c.formula, more) for c in abstract.assumptions):
            continue
        wrong = {f"A {c.name}" for c in concrete.assumptions if not keeps(c.formula, more)}
        if not wrong and all(keeps(g.formula, more) for g in concrete.guarantees):
            wrong = {f"G {g.name}" for g in abstract.guarantees if not keeps(g.formula, more)}
            found |= wrong or broken_by(concrete, abstract, more)
        found |= wrong
    return found


@pytest.mark.parametrize("seed", some(range(0, 2000, 2), 1, slow=32))
def test_all_runs_say_the_same(seed: int) -> None:
    concrete, abstract = node_of(*drawn(seed)), node_of(*drawn(seed + 1))
    if seed % 4:  # more that refine: less assumed, more guaranteed
        more = [replace(g, name=f"more_{g.name}") for g in abstract.guarantees]
        concrete = replace(concrete, assumptions=abstract.assumptions, guarantees=(*more, *concrete.guarantees))
    if not remembers(concrete) and not remembers(abstract):
        return
    found = refines(concrete, abstract, Bounds(2_000))
    wrong = broken_by(concrete, abstract)
    shown = {
        f"{'A' if demand.node == concrete.name and demand.clause in concrete.assumptions else 'G'} {demand.clause.name}"
        for demand in found.demands
        if demand.verdict is Verdict.PROVED
    }
    if all(demand.verdict is Verdict.PROVED for demand in found.demands):
        assert not wrong
    assert not shown & {name for name in wrong if name.startswith("A ")}
    if found.verdict is Verdict.REFUTED:  # of what is assumed, whatever the node puts out
        assert wrong or broken_by(replace(concrete, guarantees=()), replace(abstract, guarantees=()))


def _node(assumed: str, promised: str, more: str = "") -> Node:
    text = f"node n {{ inputs( x : INTEGER ) outputs( y : INTEGER ) topics() {assumed} {promised} {more} }}"
    contract, diagnostics = check_text(text, "n.rcl")
    assert contract is not None, diagnostics
    return contract.nodes[0]


SOON = "guarantee( in.x > 9 -> within[{}](y > 0) )"
ONCE = "guarantee( once(y > 0) -> once(in.x > 0) )"
POSITIVE = "guarantee( y > 0 )"


@pytest.mark.parametrize(
    ("concrete", "abstract", "verdict"),
    [
        (("", "guarantee( y == previous(in.x, 0) )"), ("", ONCE), "proved"),
        (("", "guarantee( y == previous(in.x, 1) )"), ("", ONCE), "refuted"),
        (("assume( once(in.x > 0) )", POSITIVE), ("assume( in.x > 0 )", POSITIVE), "proved"),
        (("assume( in.x > 0 )", POSITIVE), ("assume( once(in.x > 0) )", POSITIVE), "refuted"),
        pytest.param(("", SOON.format("2 steps")), ("", SOON.format("3 steps")), "proved", marks=pytest.mark.slow),
        pytest.param(("", SOON.format("3 steps")), ("", SOON.format("2 steps")), "refuted", marks=pytest.mark.slow),
        (("", SOON.format("1 s")), ("", SOON.format("2 s")), "proved"),
        (("", "guarantee( y == 0 and once(in.x > 5) )"), ("", "guarantee( once(in.x > 3) )"), "vacuous"),
        # the guarantee holds only where the assumption does: it may not show it
        (("assume( previous(y, 1) > 0 )", POSITIVE), ("", POSITIVE), "unknown"),
    ],
)
def test_known_answers(concrete: tuple[str, str], abstract: tuple[str, str], verdict: str) -> None:
    found = refines(_node(*concrete), _node(*abstract))
    assert ("vacuous" if found.vacuous else found.verdict.value) == verdict
    if verdict == "proved":
        assert found.certificates


@pytest.mark.parametrize("other", some([Needed(How.TOGETHER, "n", ""), Needed(How.OPEN, "n", "0"), None], 1, slow=2))
def test_a_proof_that_rests_on_more_than_the_contracts_say_is_none(
    other: Needed | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    def asked(*told: Any) -> Callable[..., Answer]:
        def answer(*given: Any) -> Answer:
            found = formula_question(*told)(*given)
            known = found.established
            assert known is not None
            more = None if other is None else replace(known, hypotheses=(*known.hypotheses, other))
            return replace(found, established=more)

        return answer

    monkeypatch.setattr(refinement, "formula_question", asked)
    found = refines(_node("", SOON.format("2 steps")), _node("", SOON.format("3 steps")))
    assert [demand.verdict for demand in found.demands] == [Verdict.UNKNOWN]
    assert not found.certificates


def test_a_demand_over_runs_is_told_with_its_node_and_what_it_needs() -> None:
    mine = replace(_node("assume a ( once(in.x > 0) )", "guarantee p ( y > 0 )", "guarantee ( y > -7 )"), name="m")
    found = refines(mine, _node("assume b ( in.x > 0 )", "guarantee q ( y > 0 )"))
    told = [(demand.node, demand.clause.name, demand.needed, demand.vacuous) for demand in found.demands]
    assert told == [("m", "a", ("environment 0 b",), False), ("n", "q", ("m.p",), False)]
    assert found.holds


def test_a_demand_that_nothing_meets_is_vacuous_over_runs() -> None:
    nothing = "assume ( in.x > 0 ) assume ( once(in.x < 0) )"
    found = refines(_node("", POSITIVE), _node(nothing, "guarantee( y > 1 )"))
    assert [(demand.verdict, demand.vacuous) for demand in found.demands] == [(Verdict.PROVED, True)]
    assert found.vacuous
    assert not found.holds


def test_a_refutation_over_runs_shows_ports_and_not_what_is_remembered() -> None:
    found = refines(_node("", "guarantee( y == 0 )"), _node("", "guarantee( once(in.x > 0) -> y > 0 )"))
    (shown,) = (demand.counterexample for demand in found.demands)
    assert shown is not None
    assert shown.values == (("in.x", "1"), ("out.y", "0"))


@pytest.mark.parametrize("assumed", ["in.c == red", "once(in.c == red)"])
def test_assumptions_are_asked_in_the_other_s_types(assumed: str) -> None:
    nodes = []
    for colour, what in (("Lamp", assumed), ("Colour", "in.c == red")):
        text = f"context {{ {colour} : {{red, green}}; }} node n {{ inputs( c : {colour} ) outputs( y : BOOL ) topics()"
        contract, diagnostics = check_text(f"{text} assume( {what} ) guarantee( y ) }}", "n.rcl")
        assert contract is not None, diagnostics
        nodes.append(contract.nodes[0])
    assert refines(*nodes).holds
