"""Refinement of nodes that remember, against all their runs by the definitions of the operators; and known answers."""

from __future__ import annotations

from dataclasses import replace

import pytest
from helpers import some
from oracle.runs import longer
from oracle.values import Step, keeps

from avow.base.verdict import Verdict
from avow.calculus.discharge import Bounds
from avow.calculus.refinement import refines
from avow.formulas.temporal.cells import remembers
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


@pytest.mark.parametrize("seed", some(range(0, 2000, 2), 8, slow=25))
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
        (("", SOON.format("2 steps")), ("", SOON.format("3 steps")), "proved"),
        (("", SOON.format("3 steps")), ("", SOON.format("2 steps")), "refuted"),
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
