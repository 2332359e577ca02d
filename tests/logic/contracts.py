"""Contracts and formulas for the tests of the logic."""

from __future__ import annotations

from pathlib import Path

from avow.language.contract import Contract, Node
from avow.language.load import check_text, load_contract, parse_formula
from avow.language.terms import Term

CONTRACTS = Path(__file__).parent.parent.parent / "contracts"


def contract(text: str) -> Contract:
    found, diagnostics = check_text(text, "test.rcl")
    assert found is not None, [d.message for d in diagnostics]
    return found


def node(text: str, context: str = "") -> Node:
    """The node of a text such as ``inputs( … ) outputs( … ) assume( … ) guarantee( … )``."""
    head, _, clauses = text.partition("|")
    body = f"node n {{ {head} topics() {clauses} }}"
    return contract((f"context {{ {context} }}" if context else "") + body).nodes[0]


def formula(text: str, within: Node, context: Contract | None = None) -> Term:
    return parse_formula(text, within, context) if context else parse_formula(text, within)


def case_study(name: str) -> Contract:
    return load_contract([CONTRACTS / name / "system.rcl"])
