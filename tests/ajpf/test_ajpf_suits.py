"""A next step names the method only for contracts that look like an agent's."""

from __future__ import annotations

import pytest

from avow.backends.ajpf import BACKEND
from avow.language.load import check_text

HEAD = "context { Command : {go(REAL, REAL), stop}; Map : NATURAL --> BOOL; Dose : NATURAL --> REAL; } "


@pytest.mark.parametrize(
    ("node", "suits"),
    [
        ("inputs(b : BOOL) outputs(c : Command); guarantee(in.b -> out.c == stop)", True),
        ("inputs(m : Map) outputs(c : {on, off}, m : Map); guarantee(exists(i in NATURAL | in.m(i) and i < 3))", True),
        ("inputs(r : REAL) outputs(c : {on, off}); guarantee(in.r < 18 -> out.c == on)", False),
        ("inputs(r : REAL) outputs(c : {on, off}); assume(0 <= in.r) guarantee(out.c == on)", False),
        ("inputs(c : Command) outputs(v : REAL, done : {yes, no}); guarantee(in.c == stop -> out.v == 0)", False),
        ("inputs(c : Command) outputs(v : BOOL); guarantee(in.c == stop -> out.v)", False),
        ("inputs(b : BOOL) outputs(c : Command, d : Dose); guarantee(out.d(1) == 2)", False),
    ],
)
def test_agents_decide_and_do_not_measure(node: str, suits: bool) -> None:
    contract, found = check_text(f"{HEAD} node n {{ {node.replace('; ', ' topics() ')} }}", "t.rcl")
    assert contract is not None, found
    assert BACKEND.suits(contract.nodes[0]) is suits
