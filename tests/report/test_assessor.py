"""What an assessor asks of a report: is anything said more strongly than it is, does anything keep silent, and do the
formats count alike? Each of these was wrong once."""

from __future__ import annotations

import csv
import io
import json
import re
from collections import Counter
from xml.etree import ElementTree

import pytest
from assurance.sample import case, evidence, guarantee, node_plan, obligation, rover_case, system, validated
from assurance.test_rates import sampled, three
from helpers import every_text

from avow.assurance.model import Case
from avow.assurance.remarks import REMARK
from avow.base.plain import count
from avow.base.verdict import Verdict
from avow.evidence.obligation import Kind
from avow.evidence.status import Status
from avow.recount import recounted
from avow.report import gsn_svg, wording
from avow.report.answers_page import render_index
from avow.report.page import asset
from avow.report.pdf import _data as pdf_data
from avow.system.plan import Finding, Requirement

G1, G2 = guarantee("agent", "g1"), guarantee("agent", "g2", line=12)
SUBJECT = system(
    {"agent": ["g1", "g2"]},
    plans=[node_plan("agent", "high", "ajpf", "dafny")],
    requirements=[Requirement("R", "It is safe.", None, None, ("agent.g1", "agent.g2"))],
)


def texts(found: Case) -> dict[str, str]:
    """The formats that are text, but the PDF's data in place of the PDF."""
    made = {name: content for name, content in every_text(found) if isinstance(content, str)}
    return made | {"pdf": json.dumps(pdf_data(found))}


def test_a_vacuous_pass_is_called_so_in_every_format() -> None:
    found = case(SUBJECT, [G1, G2], [evidence(G1, method="hoare", vacuous=True), evidence(G2, method="ajpf")])
    made = texts(found)
    assert "hoare vacuous" in made["report.md"]
    assert "hoare proved" not in made["report.md"]
    assert [row["verdict"] for row in csv.DictReader(io.StringIO(made["traceability.csv"])) if row["method"]] == [
        "vacuous",
        "checked",
    ]
    assert '"status": "vacuous", "method": "hoare"' in made["pdf"]
    assert '"status": "proved", "method": "hoare"' not in made["pdf"]
    assert not re.search(r'class="(chip|mini) good"[^>]*>(<span[^>]*>✔</span>)? *proved', made["traceability.html"])
    body = made["node-agent.html"].split('id="list"')[1].split("</section>")[0]
    assert "the tool said: proved" in body
    assert 'class="chip good" title="for all behaviours' not in body


def test_a_record_that_claims_more_than_its_method_can_is_told_at_its_worth() -> None:
    found = case(SUBJECT, [G1, G2], [evidence(G1, Verdict.PROVED, "hypothesis"), evidence(G2, method="ajpf")])
    made = texts(found)
    assert "hypothesis tested" in made["report.md"]
    assert '"status": "tested", "method": "hypothesis"' in made["pdf"]
    assert '"status": "proved", "method": "hypothesis"' not in made["pdf"]


def test_a_method_that_failed_is_an_open_item_though_another_decides() -> None:
    crash = {"summary": "it does not compile"}
    records = [
        evidence(G1, method="ajpf"),
        evidence(G1, Verdict.ERROR, "dafny", **crash),
        evidence(G2, Verdict.REFUTED, "ajpf"),
        evidence(G2, Verdict.ERROR, "dafny", **crash),
    ]
    found = case(SUBJECT, [G1, G2], records)
    (item,) = [i for i in found.open_items if i.kind == "error"]
    assert not item.advice
    assert "it does not compile" in item.text
    assert "agent.g1 is checked by other evidence alone; the same for agent.g2" in item.text
    kinds = [i.kind for i in found.open_items]
    assert kinds.index("refuted") < kinds.index("error")
    assert "it does not compile" in texts(found)["report.md"]


def test_causes_stand_worst_first_and_the_contracts_fault_before_the_programs() -> None:
    contract = obligation("agent", Kind.SANITY, "realizable")
    records = [
        evidence(G1, method="ajpf", vacuous=True),
        evidence(G2, Verdict.REFUTED, "ajpf"),
        evidence(contract, Verdict.REFUTED, "sanity"),
    ]
    found = case(SUBJECT, [G1, G2, contract], records)
    (told,) = found.requirements
    assert told.below == (contract.id, G2.id, G1.id)
    assert told.answer.startswith("Not shown: agent (its guarantees can always be met) is refuted, agent.g2 is refuted")


def test_known_bad_material_is_never_attested_as_passed() -> None:
    """Whoever asks the attestation for PASSED must not get it for a system that is as bad as expected."""
    expected = Finding("agent/guarantee/g1", "refuted", "known")
    wanted = SUBJECT.plan.requirements
    subject = system({"agent": ["g1", "g2"]}, requirements=wanted, expected=[expected], policy="reproduction")
    found = case(subject, [G1, G2], [evidence(G1, Verdict.REFUTED, "ajpf"), evidence(G2, method="ajpf")])
    assert found.good
    assert attested(found) == "WARNED"
    worse = case(subject, [G1, G2], [evidence(G1, Verdict.REFUTED, "ajpf"), evidence(G2, Verdict.REFUTED, "ajpf")])
    assert attested(worse) == "FAILED"
    good = system({"agent": ["g1", "g2"]}, requirements=wanted, policy="reproduction")
    assert attested(case(good, [G1, G2], [evidence(G1, method="hoare"), evidence(G2, method="hoare")])) == "PASSED"


def attested(found: Case) -> str:
    result = json.loads(texts(found)["attestation.jsonl"].splitlines()[0])["predicate"]["result"]
    assert isinstance(result, str)
    return result


CONTRACT = """\
context{ Colour : {red, green}; }

node agent{
inputs( r : REAL, unused : REAL )
outputs( c : Colour )
topics( a/B r matches(in.r), a/B c matches(out.c), a/B unused matches(in.unused) )
assume( TRUE )

guarantee g1( 0 <= in.r and in.r < 9
  -> out.c == green )
}
"""
PATH = "contracts/rover/system.rcl"


def remarked(plan: str = "system: rover\n") -> Case:
    target = guarantee("agent", "g1", line=9)
    return case(
        SUBJECT, [target], [evidence(target)], sources={PATH: CONTRACT, "contracts/rover/plan.yaml": plan}, digests={}
    )


def test_what_the_language_checker_remarks_is_in_the_report_brackets_first() -> None:
    found = remarked()
    told = [i for i in found.open_items if i.kind == REMARK]
    assert told
    assert all(i.advice for i in told)
    assert "another bracketing means something else" in told[0].title
    assert told[0].claim == "rover/agent/guarantee/g1"
    assert f"RCL401, {PATH}:9" in told[0].text
    assert any("unused" in i.title for i in told)
    made = texts(found)
    for name in ("report.md", "claims.html", "pdf"):
        assert "another bracketing means something else" in made[name], name
    assert "<b>Remark:</b>" in made["node-agent.html"].split('id="list"')[1]  # and beside the claim itself
    assert found.exit_code == remarked("lints_off: [RCL401, RCL402]\n").exit_code  # nothing fails for them


def test_what_the_plan_switches_off_is_not_remarked_and_a_broken_plan_hides_nothing() -> None:
    silent = remarked("system: rover\nlints_off: [RCL401]\n")
    assert not any("RCL401" in i.text for i in silent.open_items)
    broken = remarked("lints_off: [RCL401\n\t{")
    assert any("RCL401" in i.text for i in broken.open_items)


def test_a_requirement_whose_sentence_says_otherwise_is_remarked() -> None:
    plan = "system: rover\nrequirements:\n  R: {{text: Green from 9 on, formula: '{}'}}\n  S: {{text: Some prose}}\n"
    wrong = plan.replace("Green from 9 on", "Green if at least 9").format("agent.r < 8 -> agent.c == green")
    (item,) = [i for i in remarked(wrong).open_items if i.kind == REMARK and "plan.yaml" in i.text]
    assert item.title == "the sentence says “at least 9”, and the formula has `8`"
    assert item.claim == "R"
    for fine in (plan.format("agent.r < 9 -> agent.c == green"), plan.format("of ( another system"), plan.format("")):
        assert not [i for i in remarked(fine).open_items if i.kind == REMARK and "plan.yaml" in i.text]


def test_what_a_method_remarks_of_its_input_is_in_the_report_once() -> None:
    told = [{"code": "HOARE410", "place": "models/p.imp:2", "message": "the program compares with 10"}]
    odd: list[object] = [*told, {"code": 3}, "words", {"code": "X", "place": "", "message": "<b>bold</b>"}]
    records = [evidence(G1, details={"remarks": odd}), evidence(G2, details={"remarks": told})]
    sources = {"contracts/rover/plan.yaml": "system: rover\n"}
    found = case(SUBJECT, [G1, G2], records, sources=sources, digests={})
    items = [i for i in found.open_items if i.kind == REMARK]
    assert [(i.claim, i.title, i.text, i.advice) for i in items] == [
        (G1.id, "the program compares with 10", "HOARE410, models/p.imp:2; method hoare", True),
        (G1.id, "<b>bold</b>", "X; method hoare", True),
    ]
    assert "<b>bold</b>" not in texts(found)["claims.html"] + texts(found)["node-agent.html"]
    sources = {"contracts/rover/plan.yaml": "system: rover\nlints_off: [HOARE410]\n"}
    silent = case(SUBJECT, [G1, G2], records, sources=sources, digests={})
    assert [i.title for i in silent.open_items if i.kind == REMARK] == ["<b>bold</b>"]
    stale = case(SUBJECT, [G1, G2], records, sources=sources, digests={}, keys={(G1.id, "hoare"): "another"})
    assert not [i for i in stale.open_items if i.kind == REMARK]  # what does not count remarks nothing


def test_tested_says_on_how_many_cases_at_first_sight() -> None:
    bound = {"cases": 271, "seed": 0}
    records = [evidence(G1, method="hoare"), evidence(G2, Verdict.TESTED, "hypothesis", bound=bound)]
    made = texts(case(SUBJECT, [G1, G2], records))
    answer = made["claims.html"].split('id="answer"')[1].split("How to read this")[0]
    assert "cases 271" in answer
    assert "hypothesis tested (cases 271, seed 0)" in made["report.md"]


def test_a_requirement_that_was_only_checked_says_within_what() -> None:
    formal = system(
        {"agent": ["g1"]}, requirements=[Requirement("R", "It ends.", None, "eventually done", ("agent.g1",))]
    )
    own = obligation("system", Kind.REQUIREMENT, "R")
    bound = {"depth": 28, "scenario": "a1" * 32}
    away = obligation("system", Kind.COMPOSITION, "environment.in.away")
    records = [
        evidence(G1, Verdict.JUSTIFIED, "review", strength=Verdict.JUSTIFIED),
        evidence(own, Verdict.CHECKED, "ajpf", bound=bound, hypotheses=("agent/guarantee/g1", "the wind is weak")),
        evidence(away, Verdict.JUSTIFIED, "compose", strength=Verdict.JUSTIFIED),
    ]
    found = case(formal, [G1, own, away], records)
    made = texts(found)
    assert next(d.claims for d in found.deficits if d.key == "bounded") == ("R",)
    answer = made["claims.html"].split('id="answer"')[1].split("How to read this")[0]
    assert "depth 28, scenario a1a1a1a1a1a1" in answer
    assert "a1" * 32 not in answer
    # words are only words: what a claim rests on is said by typed hypotheses, so that these count for nothing
    assert {"agent/guarantee/g1", "the wind is weak"} <= {a.text for a in found.assumptions}


@pytest.mark.parametrize(
    ("own", "below", "words"),
    [
        (("compose", {"steps": 63}), {}, "every run within the plan's scenario was looked at, with 63 kinds of steps"),
        (("ajpf", {"states": 1}), {}, "every case of a bounded model was looked at, with 1 state"),
        (
            None,
            {"states": 5},
            "within the bounds of agent.g1, every case of a bounded model was looked at, with 5 states",
        ),
        (None, None, ""),
    ],
)
def test_what_holds_within_bounds_says_how_far_it_was_searched(
    own: tuple[str, dict[str, int]] | None, below: dict[str, int] | None, words: str
) -> None:
    """Its own formula, or the claim below it that has the bounds."""
    asked = Requirement("R", "It ends.", None, "eventually done", ("agent.g1",))
    claim = obligation("system", Kind.REQUIREMENT, "R")
    checked, (method, bound) = Verdict.CHECKED, own or ("compose", {})
    records = [
        evidence(G1) if below is None else evidence(G1, checked, "ajpf", bound=below),
        evidence(claim, checked if own else Verdict.PROVED, method, bound=bound),
    ]
    found = case(system({"agent": ["g1"]}, requirements=[validated(asked)]), [G1, claim], records)
    (requirement,) = found.requirements
    assert requirement.noted == requirement.searched == words
    assert requirement.bounded is bool(words)
    made = texts(found)
    assert words in made["index.html"].replace("&#39;", "'")
    assert recounted(made["index.html"], made["report.json"].encode()) == []


def test_measured_runs_say_how_they_were_made() -> None:
    """47 of 47 in a simulation is not 47 of 47 on the robot."""
    records = [evidence(G1, Verdict.TESTED, "experiment", details={"protocol": "47 runs in a simulation."})]
    found = case(SUBJECT, [G1, G2], records)
    made = texts(found)
    assert "how it was measured: 47 runs in a simulation." in made["node-agent.html"]
    assert "How it was measured: 47 runs in a simulation." in made["pdf"]


def test_sentences_end_once() -> None:
    found = case(SUBJECT, [guarantee("agent", "g1", "It stops.")], [])
    made = texts(found)
    assert "It stops.." not in made["report.sarif"]


def test_open_items_and_expected_findings_add_up() -> None:
    found = rover_case()
    items = [i for i in found.open_items if not i.advice]
    told = [int(n) for n in re.findall(r"\d+", wording.open_line(found))]
    assert told[0] == sum(bool(i.handled) for i in items)
    assert f"of {len(items) - told[0]} it says nothing" in wording.open_line(found)
    assert wording.open_line(case(SUBJECT, [G1], [evidence(G1)])) == ""


def test_nothing_that_paper_hides_is_part_of_a_picture() -> None:
    """Once a rule for the middle of long runs emptied the evidence's circles."""
    style = asset("style.css").split("@media print{")[1]
    hidden = {
        name
        for selectors in re.findall(r"([^{}]+)\{display:none", style)
        for selector in selectors.split(",")
        for name in re.findall(r"^\.([\w-]+)$", selector.strip())
    }
    assert hidden  # the rule for filters and the like is there
    drawn = gsn_svg.draw(rover_case())
    assert not hidden & {name for names in re.findall(r'class="([^"]*)"', drawn) for name in names.split()}


def test_what_fails_comes_first_in_the_index() -> None:
    good = case(system({"n": []}, name="aaa", title="Sound"), [], [])
    bad = rover_case()
    assert good.good
    assert not bad.good
    page = render_index([good, bad])
    assert page.index(bad.title) < page.index("Sound")


@pytest.mark.parametrize("found", [rover_case(), three(sampled("a.g"), sampled("b.g"))], ids=["rover", "sampled"])
def test_all_formats_count_alike(found: Case) -> None:
    made = texts(found)
    words = Counter(view.word for view in found.obligations)
    for part in ("summary", "obligations"):
        table = made["claims.html"].split(f'<section id="{part}"')[1].split("</section>")[0].split("<h3>")[0]
        told = re.findall(r'<span class="(?:chip|mini) \w+">(\d+) ([^<]+)</span>', table)
        assert sum((Counter({word: int(many)}) for many, word in told), Counter()) == words, part
    deficits = {d.key: d.count for d in found.deficits}
    sampled_ones = [v for v in found.obligations if v.status in (Status.TESTED, Status.MONITORED)]
    assert deficits.get("sampled", 0) == len(sampled_ones)
    for name in ("report.md", "claims.html"):
        assert f"{count(deficits.get('advice', 0), 'open remark')}" in made[name]
    standing = Counter(v.standing.value for v in found.obligations)
    data = json.loads(made["report.json"])
    assert Counter(v["standing"] for v in data["obligations"]) == standing
    assert Counter(re.findall(r'class="ob"[^>]*data-status="([^"]+)"', made["claims.html"])) == standing
    results = json.loads(made["report.sarif"])["runs"][0]["results"]
    assert Counter(r["properties"]["status"] for r in results) == standing
    holding = sum(v.standing.supports for v in found.obligations)
    assert len(json.loads(made["findings.sarif"])["runs"][0]["results"]) == len(found.obligations) - holding
    reasons = sum(v.standing.supports and v.status is Status.JUSTIFIED for v in found.obligations)
    first = json.loads(made["attestation.jsonl"].splitlines()[0])["predicate"]
    assert len(first["passedTests"]) == holding - reasons
    cases = [
        t
        for t in ElementTree.fromstring(made["junit.xml"]).iter("testcase")
        if not t.attrib["classname"].endswith((".gates", ".requirements"))
    ]
    assert len(cases) == len(found.obligations)
    assert sum(not len(t) for t in cases) == holding - reasons
    assert len(json.loads(made["pdf"])["remarks"]) == sum(i.advice for i in found.open_items)
    items = sum(not i.advice for i in found.open_items)
    assert f'Failures and gaps <span class="n">{items}</span>' in made["claims.html"]
    rows = made["report.md"].split("## Failures and gaps")[1].split("\n## ")[0]
    assert len(re.findall(r"^\| ", rows, re.MULTILINE)) == items + 2  # the head and its line
    assert len(json.loads(made["pdf"])["open"]) == items
