"""`avow explain` on the terminal: the plan's reason for a finding, also for advice, with the formula in lines."""

from __future__ import annotations

import html
import re
from dataclasses import replace
from io import StringIO
from pathlib import Path
from urllib.parse import unquote

import pytest
from assurance.sample import case, evidence, guarantee, obligation, rover_case, system
from helpers import every_text
from rich.console import Console

from avow.assurance.answers import MEANINGS as LEVELS
from avow.assurance.codec import read_case
from avow.assurance.model import Case
from avow.assurance.naming import short
from avow.base.diagnostics import Rejected
from avow.base.verdict import Counterexample, Verdict
from avow.cli.explain import find_claim
from avow.evidence.ledger import Ledger
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.report.explained import explained, left_out
from avow.report.terminal import show_obligation
from avow.report.wording import MEANINGS
from avow.system.plan import Finding, Requirement
from report.test_answers_page import REPORTS

PAGES = ("index.html", "argument.html", "claims.html", "system.html", "contracts.html", "traceability.html")


def shown(name: str) -> str:
    advice = obligation("node", Kind.SANITY, "not-redundant-a", "a is not implied", "x " + "∧ y = 1 " * 30)
    target = guarantee("node", "a")
    records = [evidence(advice, Verdict.REFUTED, "hoare"), evidence(target, Verdict.REFUTED, "hoare")]
    subject = system(
        {"node": ["a"]},
        expected=[Finding("node/sanity/not-redundant-a", "refuted", "said [twice] in the paper")],
        accepted=[Finding("node/guarantee/a", "refuted", "one run of 47", "R. Assessor", "2026-10-01", "2027-10-01")],
    )
    found = case(subject, (advice, target), records)
    out = StringIO()
    view = next(v for v in found.obligations if name in v.id)
    show_obligation(found, view, Console(file=out, width=100, highlight=False))
    return out.getvalue()


def test_what_goes_to_a_pipe_is_not_wrapped(capsys: pytest.CaptureFixture[str]) -> None:
    target = guarantee("node", "a")
    told = replace(
        evidence(target, Verdict.REFUTED, "hoare"), summary="broken at event 413 of traces/run: " + "x " * 99
    )
    found = case(system({"node": ["a"]}), (target,), [told])
    show_obligation(found, found.obligations[0])
    assert told.summary.strip() in capsys.readouterr().out


def test_advice_that_the_plan_expects_says_why() -> None:
    assert "expected by the plan: said [twice] in the paper" in shown("not-redundant")


def test_an_accepted_refutation_says_who_and_until_when() -> None:
    assert "accepted by R. Assessor until 2027-10-01 by the plan: one run of 47" in shown("guarantee")


def test_a_long_formula_is_in_lines() -> None:
    assert max(len(line) for line in shown("not-redundant").splitlines()) <= 100


@pytest.mark.parametrize("verdict", [Verdict.PROVED, Verdict.UNKNOWN, Verdict.REFUTED])
@pytest.mark.parametrize("below", [Verdict.PROVED, Verdict.TESTED, Verdict.JUSTIFIED, Verdict.REFUTED])
def test_a_requirement_has_one_status_and_the_plans_formula(verdict: Verdict, below: Verdict) -> None:
    asked, target = obligation("system", Kind.REQUIREMENT, "R", "It holds", "m.o > 0"), guarantee("n", "g")
    proof = evidence(asked, verdict, "compose", details={"needed": ["n.g"]})
    required = Requirement("R", "It holds", "n.in_o > 0", None, ("n.g",))
    whole = system({"n": ["g"]}, requirements=[required])
    found = case(whole, (target, asked), [evidence(target, below, "hoare"), proof])
    out = StringIO()
    show_obligation(found, found.obligations[1], Console(file=out, width=200, highlight=False))
    told = out.getvalue().split("\n\n")
    level = found.requirements[0].level
    assert f"{found.requirements[0].tone.mark} {level} {LEVELS[level]}" in told[0]
    assert not any(MEANINGS[status] in told[0] for status in Status)
    assert told[1].strip() == "n.in_o > 0"


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
    found = rover_case()
    names = [r.id for r in found.requirements] + [s.number for s in found.assumptions]
    names += [s.key for s in found.assumptions] + [node.title for node in found.nodes]
    names += [gate.title for gate in found.gates] + [w.words for w in found.deficits]
    names += [d.derivation.name for d in found.derivations]
    names += [r.level.value for r in found.requirements]
    for name in names:
        told = list(explained(found, name))
        assert told, name
        assert all(lines for _, lines in told)


def marks(made: dict[str, str]) -> set[str]:
    """The identifiers on the pages: digests, elements of gsn.yaml, codes, claims, status words, files read."""
    found: set[str] = set()
    for page in (name for name in made if name in PAGES or name.startswith("node-")):
        text = made[page]
        body = text[text.index("<main") :]
        found |= set(re.findall(r'<code class="digest" title="([0-9a-f]{64})"', body))
        found |= {code for code in re.findall(r"<code>([^<\s]+)</code>", body) if re.match(r"[0-9a-f]{12,64}$", code)}
        found |= set(re.findall(r"\b(?:RCL|PLAN|MON|HOARE|AJPF|DFY|HYP|REV|EXP)\d{3}\b", body))
        found |= set(
            re.findall(r'class="chip (?:good|fair|open|bad)" title="[^"]*"><span[^>]*>[^<]*</span> ([^<]+)<', body)
        )
        found |= set(re.findall(r"<li>(?:read|left) <code>([^<]+)</code>", body))
        found |= set(re.findall(r'<details class="ob" id="([^"]+)"', body))
    found |= set(re.findall(r"^((?:G|Sn|S|C|A|J)\d+):$", made.get("gsn.yaml", ""), re.MULTILINE))
    return {html.unescape(mark) for mark in found}


def unexplained(found: Case, made: dict[str, str]) -> set[str]:
    def known(name: str) -> bool:
        try:
            return bool(list(explained(found, name)) or find_claim([found], name))
        except Rejected:
            return False

    claims = {short(v.id) for v in found.obligations}
    names = marks(made) | claims | {f"{found.system}/{name}" for name in claims} | {m.name for m in found.methods}
    return {name for name in names if not known(unquote(name))}


def test_every_mark_that_a_report_shows_is_known() -> None:
    found = rover_case()
    made = {name: text for name, text in every_text(found) if isinstance(text, str)}
    assert len(marks(made)) > 40
    assert unexplained(found, made) == set()


@pytest.mark.nightly
@pytest.mark.parametrize("folder", REPORTS, ids=lambda folder: folder.name)
def test_every_mark_of_the_shipped_systems_reports_is_known(folder: Path) -> None:
    found = read_case(folder)
    made = {name: text for name, text in every_text(found) if isinstance(text, str)}
    assert unexplained(found, made) == set()


def test_a_record_that_the_report_leaves_out_is_found_in_the_ledger(tmp_path: Path) -> None:
    target = guarantee("node", "a")
    ledger = Ledger(tmp_path / "rover.jsonl")
    entries = ledger.append_all([evidence(target, key=str(k), run=str(k)) for k in range(5)])
    found = case(system({"node": ["a"]}), (target,), [e.evidence for e in entries])
    assert found.left_out == 4
    for entry in entries:
        told = [*explained(found, entry.hash[:16]), *left_out(found, Ledger(ledger.path).records(), entry.hash[:16])]
        assert [title for title, _ in told][:1] == [f"record {entry.number + 1} of the ledger"]
        assert any("left out of the report" in line for _, lines in told for line in lines) == (entry.number < 4)
    assert list(left_out(found, entries, "f" * 16)) == []


def test_a_mark_that_is_nowhere_is_not_explained() -> None:
    found = rover_case()
    assert unexplained(found, dict.fromkeys(PAGES, "<main><code>ffffffffffffffff</code>")) == {"f" * 16}


def test_an_obligation_is_not_explained_by_its_places_in_the_report() -> None:
    found = rover_case()
    assert list(explained(found, found.obligations[0].id)) == []


def test_the_beginning_of_a_name_is_not_explained_by_the_places_of_the_whole() -> None:
    found = rover_case()
    whole = found.obligations[0].id
    assert list(explained(found, whole[:-1])) == []
    with pytest.raises(Rejected) as refused:
        find_claim([found], whole[:-1])
    assert whole in (refused.value.diagnostics[0].hint or "")
