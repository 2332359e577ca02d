"""`avow explain` on the terminal: the plan's reason for a finding, also for advice, with the formula in lines."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

from assurance.sample import case, evidence, guarantee, obligation, system
from rich.console import Console

from avow.base.verdict import Counterexample, Verdict
from avow.evidence.obligation import Kind
from avow.report.terminal import show_obligation
from avow.system.plan import Finding


def shown(name: str) -> str:
    advice = obligation("node", Kind.SANITY, "redundant-a", "a is not implied", "x " + "∧ y = 1 " * 30)
    target = guarantee("node", "a")
    records = [evidence(advice, Verdict.REFUTED, "hoare"), evidence(target, Verdict.REFUTED, "hoare")]
    subject = system(
        {"node": ["a"]},
        expected=[Finding("node/sanity/redundant-a", "refuted", "said [twice] in the paper")],
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


def run_of_an_agent(width: int) -> str:
    steps = (("no", "none", "nothing new"), ("yes", "none", "estop"), ("yes", "wait", "estop"))
    names = ("in.estop", "out.command = wait, as the contract has it", "(what the agent believes of the world)")
    example = Counterexample((), "it waits", tuple(tuple(zip(names, step, strict=True)) for step in steps), 2)
    target = guarantee("n", "g")
    records = [replace(evidence(target, Verdict.REFUTED, "hoare"), counterexample=example)]
    found = case(system({"n": ["g"]}), (target,), records)
    out = StringIO()
    show_obligation(found, found.obligations[0], Console(file=out, width=width, highlight=False))
    return out.getvalue()


def test_a_run_is_a_table_where_there_is_room() -> None:
    assert "(what the agent believes of the world)" in run_of_an_agent(160)


def test_a_run_too_wide_for_the_terminal_is_told_by_what_changes() -> None:
    told = run_of_an_agent(76)
    assert "…" not in told
    assert "what the agent believes" not in told
    lines = [line.strip() for line in told.splitlines()]
    assert "step 1  in.estop: yes" in lines
    assert any(line.startswith("step 2 ↺") and "wait" in line for line in lines)
    assert "what the tool itself shows of each step stands in the report" in told


def test_every_name_that_the_first_page_shows_is_known() -> None:
    from assurance.sample import rover_case

    from avow.report.explained import explained

    found = rover_case()
    names = [r.id for r in found.requirements] + [s.number for s in found.suppositions]
    names += [s.key for s in found.suppositions] + [node.title for node in found.nodes]
    names += [gate.title for gate in found.gates] + [w.words for w in found.weakenings]
    names += [d.derivation.name for d in found.derivations]
    names += [r.how.value.split(",")[0] for r in found.requirements]
    for name in names:
        told = list(explained(found, name))
        assert told, name
        assert all(lines for _, lines in told)
