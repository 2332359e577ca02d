"""Subsystems whose nodes remember: what is shown inside and outside, with known answers."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.verdict import Verdict
from avow.calculus.composition import compose

from .make import make, node, outcomes

TEXT = (
    node("latch", "e : BOOL", "on : BOOL", "A pulse: previous(in.e, FALSE) -> not in.e", "G keep: once(in.e) -> out.on")
    + node("echo", "on : BOOL", "heard : BOOL", "G same: out.heard <=> in.on")
    + node("user", "heard : BOOL", "y : BOOL", "A stays: {}", "G: TRUE")
)
PLAN = """environment: {in.e: {assume: 'in.e -> next(not in.e)', because: it is a pulse}}
subsystems: {s: {nodes: [latch, echo]}}
requirements: {R: {text: t, formula: 'once(latch.e) -> echo.heard'}}
"""


@pytest.mark.parametrize("grouped", [True, pytest.param(False, marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("claim", "verdict"),
    [("in.heard or not in.heard", Verdict.PROVED), ("previous(in.heard, TRUE) -> in.heard", Verdict.REFUTED)],
)
def test_known_answers(tmp_path: Path, grouped: bool, claim: str, verdict: Verdict) -> None:
    plan = PLAN if grouped else PLAN.replace("subsystems: {s: {nodes: [latch, echo]}}\n", "")
    found = outcomes(make(tmp_path, TEXT.replace("{}", claim), plan))
    assert found["whole.user.stays"].verdict is verdict, found["whole.user.stays"].summary
    assert found["R"].verdict is Verdict.PROVED
    inside = found["s.latch.pulse" if grouped else "whole.latch.pulse"]
    assert inside.verdict is Verdict.PROVED, "what the plan assumes of the environment with memory helps inside"


def test_the_contract_is_told_in_words(tmp_path: Path) -> None:
    """As the nodes inside say it, not in the cells that stand for what is remembered."""
    text = TEXT.replace("{}", "previous(in.heard, TRUE) -> in.heard")
    aged = text.replace("once(in.e) -> out.on", "once[2 s](in.e) and previous(out.on, FALSE) -> out.on")
    aged_plan = PLAN.replace("formula: 'once(latch.e) -> echo.heard'", "formula: 'not latch.e or echo.heard'")
    for number, (said, plan, kept) in enumerate(
        (
            (text, PLAN, "once(in.e) → out.on"),
            (aged, aged_plan, "once[2 s](in.e) ∧ previous(out.on, false) → out.on"),
        )
    ):
        assert compose(make(tmp_path / str(number), said, plan)).goal("s").contract == (
            "s as a node",
            "  reads e",
            "  puts out on, heard",
            f"  guarantees latch.keep: {kept}",
            "  guarantees echo.same: out.heard ↔ out.on",
        )
