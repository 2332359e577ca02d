"""What a question says does not hang on the order in which it is written down."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from avow.formulas.formula import negation
from avow.language.load import check_text
from avow.language.terms import And, Implies, Or, Quantified, Term
from avow.solving.questions import solve


def shuffled(term: Term, random: Random) -> Term:
    match term:
        case And(items=items) | Or(items=items):
            parts = [shuffled(item, random) for item in items]
            random.shuffle(parts)
            return replace(term, items=tuple(parts))
        case Implies(left=left, right=right):
            return replace(term, left=shuffled(left, random), right=shuffled(right, random))
        case Quantified(body=body):
            return replace(term, body=shuffled(body, random))
        case _:
            return term


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 4, pytest.param(5, marks=pytest.mark.nightly)])
def test_a_redundant_clause_is_found_in_any_order(root: Path, seed: int) -> None:
    """Of these orders each was once open."""
    contract, _ = check_text((root / "contracts/remote_inspection/robot/system.rcl").read_text(), "system.rcl")
    assert contract is not None
    node = next(n for n in contract.nodes if n.name == "navigation")
    random = Random(seed)
    others = [c for c in (*node.assumptions, *node.guarantees) if c.name != "somewhere"]
    parts = [(c.name, shuffled(c.formula, random)) for c in others]
    denied = shuffled(negation(node.clause("somewhere").formula), random)
    random.shuffle(parts)
    found = solve({**dict(parts), "": denied}, effort=1_000, values="unused")
    assert found.status == "unsat"
    assert set(found.core) == {"one_position", "there", ""}
