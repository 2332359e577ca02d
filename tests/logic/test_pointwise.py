"""Functions a point at a time, tuples by their items, and what stays as it is because it would not mean the same."""

from __future__ import annotations

import pytest
from helpers import calls

from avow.base.verdict import Verdict
from avow.formulas.pointwise import pointwise
from avow.formulas.tuples import untupled
from avow.language.terms import Variable
from avow.sanity.realizability import realizable
from avow.sanity.witness_candidates import candidates
from avow.sanity.witnesses import witnesses

from .contracts import node

PORTS = "inputs( g : REAL --> REAL, a : REAL, on : BOOL ) outputs( f : REAL --> REAL, h : REAL --> REAL )"


def parts(clauses: str) -> tuple[tuple[Variable, ...], tuple[Variable, ...], dict[str, object], dict[str, object]]:
    of = node(f"{PORTS}|{clauses}")
    return (
        tuple(p.variable for p in of.inputs),
        tuple(p.variable for p in of.outputs),
        {c.name: c.formula for c in of.assumptions},
        {c.name: c.formula for c in of.guarantees},
    )


@pytest.mark.parametrize(
    ("clauses", "verdict"),
    [
        ("guarantee( forall(x in REAL | f(x) > g(x) and f(x) > h(x)) )", Verdict.PROVED),
        ("guarantee( forall(x in REAL | f(x) > g(x) and f(x) < g(x)) and h(0) == 1 )", Verdict.REFUTED),
        ("guarantee( on -> (f(a) > a and f(0) < 0) ) guarantee( h(a) == 0 )", Verdict.REFUTED),  # where a is 0
        ("assume( a != 0 ) guarantee( on -> (f(a) > a and f(0) < 0) ) guarantee( h(a) == 0 )", Verdict.PROVED),
        ("guarantee( on -> forall(x in REAL | f(x) == g(x)) ) guarantee( not on -> forall(x in REAL | f(x) == h(x)) )",
         Verdict.PROVED),
        ("guarantee( forall(x, y in REAL | x == y -> f(x) == g(y)) ) guarantee( f(a) != g(a) and h(a) == a )",
         Verdict.REFUTED),
        ("guarantee( forall(x in REAL | f(g(x)) == x) ) guarantee( forall(x in REAL | h(x) == x) )", Verdict.REFUTED),
    ],
)  # fmt: skip
def test_what_is_said_of_single_points(clauses: str, verdict: Verdict) -> None:
    inputs, outputs, assumptions, guarantees = parts(clauses)
    assert pointwise(guarantees, outputs) is not None  # type: ignore[arg-type]
    answer = realizable(inputs, outputs, assumptions, guarantees)  # type: ignore[arg-type]
    assert answer.verdict is verdict, answer.reason
    assert set(answer.inputs) <= set(inputs)


@pytest.mark.parametrize(
    "clauses",
    [
        "guarantee( forall(x, y in REAL | f(x) == f(y) and h(x) == 0) )",
        "guarantee( exists(x in REAL | f(x) == h(x)) )",
        "guarantee( forall(x in REAL | f(f(x)) == h(x)) )",
        "guarantee( forall(x in REAL | f(x) == 0) <=> on ) guarantee( h(0) == 0 )",
        "guarantee( f == g ) guarantee( h(0) == 0 )",
        "guarantee( f(0) == h(1) )",
        "guarantee( exists_unique(x in REAL | f(x) == h(0)) )",
    ],
)
def test_what_is_said_of_several_points_at_once(clauses: str) -> None:
    _, outputs, _, guarantees = parts(clauses)
    assert pointwise(guarantees, outputs) is None  # type: ignore[arg-type]


def test_a_function_beside_a_number_stays_a_function() -> None:
    of = node("inputs( a : REAL ) outputs( f : REAL --> REAL, k : REAL )|guarantee( forall(x in REAL | f(x) < k) )")
    assert pointwise({c.name: c.formula for c in of.guarantees}, [p.variable for p in of.outputs]) is None


@pytest.mark.slow
def test_a_value_chosen_for_each_point_is_not_one_for_all() -> None:
    """For each x some k is greater than g(x); no k is for all of them, and none is claimed."""
    of = node("inputs( g : REAL --> REAL ) outputs( k : REAL )|guarantee( forall(x in REAL | g(x) < k) )")
    guarantees = {c.name: c.formula for c in of.guarantees}
    found = realizable([p.variable for p in of.inputs], [p.variable for p in of.outputs], {}, guarantees, effort=300)
    assert found.verdict is not Verdict.PROVED


def test_tuples_come_apart_and_together() -> None:
    of = node(
        "inputs( p : Deep, x : REAL ) outputs( q : Deep )|"
        "guarantee( q in {p, (1, (x, TRUE))} ) guarantee( forall(r in Deep | r == q -> r != (x, (x, FALSE))) )",
        "Deep : (REAL, (REAL, BOOL));",
    )
    p, x, q = (port.variable for port in (*of.inputs, *of.outputs))
    apart = untupled({(False, c.name): c.formula for c in of.guarantees}, [p, x, q])
    assert apart is not None
    leaves = apart.variables([p])
    assert [str(v.sort.__class__.__name__) for v in leaves] == ["RealSort", "RealSort", "BoolSort"]
    values = apart.values([p, x], {**dict(zip(leaves, (1, 2, True), strict=True)), x: 3})
    assert values == {p: (1, (2, True)), x: 3}
    assert apart.values([p, x], {x: 3}) == {x: 3}
    found = realizable([p, x], [q], {}, {c.name: c.formula for c in of.guarantees})
    assert found.verdict is Verdict.PROVED


def test_outputs_that_are_defined_by_each_other_do_not_grow() -> None:
    """Eight numbers, each the sum of others: put into one another again and again, they would fill the memory."""
    names = [f"o{k}" for k in range(8)]
    each = " and ".join(f"{name} == {' + '.join(o for o in names if o != name)}" for name in names)
    of = node(f"inputs( x : REAL ) outputs( {', '.join(f'{n} : REAL' for n in names)} )|guarantee( {each} )")
    outputs, guarantees = [p.variable for p in of.outputs], [c.formula for c in of.guarantees]
    assert calls(lambda: witnesses(candidates(outputs, (), guarantees))) < 2_000_000, "a second"
