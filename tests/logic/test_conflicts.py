"""Minimal conflicts, and where they are, against enumeration."""

from __future__ import annotations

import random
from collections.abc import Iterable
from itertools import combinations, product

import pytest
from helpers import some
from reference.meaning import holds

from avow.base.verdict import Verdict
from avow.formulas.values import Value
from avow.language.terms import Role
from avow.sanity.conflicts import Conflict, conflicts
from avow.sanity.realizability import realizable

from .contracts import contract


def subsets(labels: Iterable[str]) -> list[frozenset[str]]:
    listed = tuple(labels)
    return [frozenset(c) for size in range(1, len(listed) + 1) for c in combinations(listed, size)]


def found_of(text: str) -> tuple[Conflict, ...]:
    (node,) = contract(text).nodes
    inputs, outputs = (tuple(p.variable for p in ports) for ports in (node.inputs, node.outputs))
    assumptions, guarantees = ({c.name: c.formula for c in kind} for kind in (node.assumptions, node.guarantees))
    answer = realizable(inputs, outputs, assumptions, guarantees)
    if answer.verdict is not Verdict.REFUTED:
        return ()
    return conflicts(inputs, outputs, assumptions, guarantees, answer, effort=40_000)


def drawn(draw: random.Random) -> str:
    names = ["in.a", "in.b", "in.c", "out.x", "out.y", "out.z"]

    def literal(choice: list[str]) -> str:
        return draw.choice(("", "not ")) + draw.choice(choice)

    guarantees = "\n".join(
        f"guarantee g{k} ( {literal(names[:3])} and {literal(names[:3])} -> {literal(names[3:])} or {literal(names)} )"
        if draw.random() < 0.5
        else f"guarantee g{k} ( {literal(names[:3])} -> {literal(names[3:])} )"
        for k in range(7)
    )
    assume = f"assume( {literal(names[:3])} or {literal(names[:3])} )"
    ports = "inputs( a : BOOL, b : BOOL, c : BOOL ) outputs( x : BOOL, y : BOOL, z : BOOL ) topics()"
    return f"node n {{ {ports} {assume} {guarantees} }}"


@pytest.mark.parametrize("seed", some(range(12), 4, slow=8))
def test_conflicts_are_minimal_and_are_wherever_it_is_said(seed: int) -> None:
    text = drawn(random.Random(seed))
    (node,) = contract(text).nodes
    bools: tuple[Value, ...] = (False, True)
    inputs = [p.variable.qualified for p in node.inputs]
    outputs = [p.variable.qualified for p in node.outputs]
    formulas = {c.name: c.formula for c in node.guarantees}
    allowed = [
        at
        for values in product(bools, repeat=3)
        if all(holds(c.formula, at := dict(zip(inputs, values, strict=True))) for c in node.assumptions)
    ]
    met = {
        tuple(at.values()): [
            frozenset(g for g, f in formulas.items() if holds(f, {**at, **dict(zip(outputs, chosen, strict=True))}))
            for chosen in product(bools, repeat=3)
        ]
        for at in allowed
    }

    def fails(chosen: frozenset[str], at: dict[str, Value]) -> bool:
        return not any(chosen <= some for some in met[tuple(at.values())])

    failing = [s for s in subsets(formulas) if any(fails(s, at) for at in allowed)]
    found = found_of(text)
    sets = [frozenset(conflict.clauses) for conflict in found]
    assert len(set(sets)) == len(sets)
    assert bool(sets) == bool(failing)
    for conflict in found:
        chosen = frozenset(conflict.clauses)
        assert any(fails(chosen, at) and not any(fails(chosen - {g}, at) for g in chosen) for at in allowed)
        assert conflict.where is not None
        for at in allowed:
            same = all(at[v.qualified] == value for v, value in conflict.inputs.items())
            if same or (conflict.where and all(holds(term, at) for term in conflict.where)):
                assert fails(chosen, at), (conflict, at)


def test_inputs_that_do_not_matter_are_left_out_and_numbers_have_a_region() -> None:
    text = """
    node n {
      inputs( r : REAL, s : REAL, on : BOOL ) outputs( v : REAL ) topics()
      guarantee low ( in.r > 3 -> out.v > 3 ) guarantee high ( in.r > 4 -> out.v < 2 )
    }"""
    (conflict,) = found_of(text)
    assert conflict.clauses == ("low", "high")
    assert [v.qualified for v in conflict.inputs] == ["in.r"]
    assert conflict.counterexample().explanation.startswith("wherever in.r > 4: guarantee low ")
    assert all(v.role is Role.INPUT for v in conflict.inputs)
