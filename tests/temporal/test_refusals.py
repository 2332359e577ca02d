"""Backends that judge steps only refuse what speaks of the time between them, by name."""

from __future__ import annotations

import pytest

from avow.backend_kit.one_step import refusal
from avow.backend_kit.registry import backend, names
from avow.language.load import check_text

JUDGE_TIME = {"rosmonitoring", "review"}
CLAUSES = (
    "guarantee g ( in.r -> within[2 s](out.s) )",
    "guarantee g ( held[2 s](in.r) -> out.s )",
    "guarantee g ( arrived(in.r) -> out.s )",
    "guarantee g ( steps(at most 2 s) )",
    "guarantee g ( steps(every 20 ms) )",
    "assume a ( once[100 ms](arrived(in.r)) ) guarantee g ( out.s )",
)


@pytest.mark.parametrize("text", CLAUSES)
def test_each_refuses_it(text: str) -> None:
    contract, found = check_text(f"node n {{ inputs( r : BOOL ) outputs( s : BOOL ) topics() {text} }}", "n.rcl")
    assert contract is not None, found
    node = contract.nodes[0]
    for name in sorted(set(names()) - JUDGE_TIME):
        tool = backend(name)
        told = (tool.unsaid if tool.remembers else lambda n, c, by=tool.name: refusal(by, n, c))(node, node.clause("g"))
        assert told is not None, name
        assert name in told or "runs" in told or "steps" in told
