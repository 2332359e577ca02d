"""`avow explain` on the terminal: the plan's reason for a finding, also for advice, with the formula in lines."""

from __future__ import annotations

from io import StringIO

from assurance.sample import case, evidence, guarantee, obligation, system
from rich.console import Console

from avow.evidence.obligation import Kind
from avow.report.terminal import show_obligation
from avow.system.plan import Finding
from avow.verdict import Verdict


def shown(name: str) -> str:
    advice = obligation("node", Kind.SANITY, "redundant-a", "a is not implied", "x " + "∧ y = 1 " * 30)
    target = guarantee("node", "a")
    records = [evidence(advice, Verdict.REFUTED, "hoare"), evidence(target, Verdict.REFUTED, "hoare")]
    subject = system(
        {"node": ["a"]},
        expected=[Finding("node/sanity/redundant-*", "refuted", "said [twice] in the paper")],
        accepted=[Finding("node/guarantee/a", "refuted", "one run of 47", "R. Assessor", "2026-10-01", "2027-10-01")],
    )
    found = case(subject, (advice, target), records)
    out = StringIO()
    view = next(v for v in found.obligations if name in v.id)
    show_obligation(found, view, Console(file=out, width=100, highlight=False))
    return out.getvalue()


def test_advice_that_the_plan_expects_says_why() -> None:
    assert "expected by the plan: said [twice] in the paper" in shown("redundant")


def test_an_accepted_refutation_says_who_and_until_when() -> None:
    assert "accepted by R. Assessor until 2027-10-01 by the plan: one run of 47" in shown("guarantee")


def test_a_long_formula_is_in_lines() -> None:
    assert max(len(line) for line in shown("redundant").splitlines()) <= 100
