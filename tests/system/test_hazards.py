"""Hazards: files in YAML and CSV, located faults, and how each hazard stands in the case."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import case, evidence, guarantee, node_plan, system
from helpers import every_text

from avow.assurance.answers import Level
from avow.assurance.case import conclude_again
from avow.assurance.model import Case
from avow.assurance.traceability import trace
from avow.base.diagnostics import Rejected
from avow.base.verdict import Object, Verdict
from avow.evidence.record import Evidence
from avow.report.answers_page import render_argument
from avow.system.load import load_system
from avow.system.plan import Hazard, Requirement, System

CONTRACT = """node n { inputs( r : REAL ) outputs( v : REAL ) topics( std_msgs/Float64 r, std_msgs/Float64 v )
  guarantee low ( in.r < 1 -> out.v == 0 )  guarantee high ( in.r >= 1 -> out.v == 1 ) }
"""
PLAN = """system: s
hazards: {}
requirements: {{R: {{text: It keeps low, supported_by: [n.low]}}}}
nodes: {{n: {{methods: [hoare: {{}}]}}}}
"""
YAML = "H1:\n  text: It burns\n  severity: critical\n  mitigated_by: [R, n, n.low, n/hoare]\n"
CSV = """UCA ID,Unsafe control action,Severity,Causal scenarios,Mitigated by
U1,It drives off,Marginal,slip; fog,n.low; R
"""


def load(folder: Path, name: str, text: str) -> System:
    (folder / "s.rcl").write_text(CONTRACT)
    (folder / "plan.yaml").write_text(PLAN.format(name))
    (folder / name).write_text(text)
    return load_system(folder)


def test_a_file_in_yaml_and_a_table_of_an_stpa(tmp_path: Path) -> None:
    (hazard,) = load(tmp_path, "hazards.yaml", YAML).plan.hazards
    assert hazard == Hazard("H1", "It burns", "critical", mitigated_by=("R", "n", "n.low", "n/hoare"))
    assert hazard.span is not None
    assert hazard.span.line == 1
    (row,) = load(tmp_path, "stpa.csv", CSV).plan.hazards
    assert row == Hazard(
        "U1", "It drives off", "marginal", causes=("slip", "fog"), mitigated_by=("n.low", "R"), kind="safety"
    )
    assert row.span is not None
    assert (Path(row.span.file).name, row.span.line) == ("stpa.csv", 2)


@pytest.mark.parametrize(
    ("name", "text", "code", "line", "words"),
    [
        ("h.yaml", YAML.replace("critical", "bad"), "PLAN105", 3, "is not one of catastrophic, critical"),
        ("h.yaml", YAML.replace("severity", "severe"), "PLAN103", 3, "unknown key 'severe'"),
        ("h.yaml", YAML.replace("  text: It burns\n", ""), "PLAN104", 2, "'text' is missing"),
        ("h.yaml", YAML.replace("n.low", "n.lew"), "PLAN106", 4, "'n.lew', which is no requirement"),
        ("h.yaml", YAML.replace("n/hoare", "n/dafny"), "PLAN106", 4, "'n/dafny'"),
        ("h.yaml", YAML + YAML, "PLAN102", 5, "given twice"),
        ("h.csv", CSV.replace("UCA ID", "number"), "PLAN109", 1, "no column for id"),
        ("h.csv", CSV.replace("Marginal", "awful"), "PLAN105", 2, "is not one of catastrophic"),
        ("h.csv", CSV + "U1,again,critical,,\n", "PLAN110", 3, "declared twice"),
        ("h.csv", "", "PLAN109", 1, "empty"),
        ("h.csv", CSV.replace("drives off", "drives, off"), "PLAN109", 2, "6 cells, but 5 columns"),
        ("h.csv", CSV.replace("Mitigated by", "Mitigatedby"), "PLAN109", 1, "not read: did you mean 'mitigated_by'?"),
        ("h.csv", CSV.replace(",", ";"), "PLAN109", 1, "';' separates its columns: separate them by commas"),
    ],
)
def test_faults_are_located(tmp_path: Path, name: str, text: str, code: str, line: int, words: str) -> None:
    with pytest.raises(Rejected) as rejected:
        load(tmp_path, name, text)
    found = [(d.code, d.span.line if d.span else 0, d.message) for d in rejected.value.diagnostics]
    assert any((c, at) == (code, line) and words in message for c, at, message in found), found
    hints = [d.hint or "" for d in rejected.value.diagnostics if words == "empty"]
    assert [hint.partition(",")[0] for hint in hints] == ["its first line has headings: id"] * (words == "empty")


def test_a_missing_file_and_a_path_outside_are_located(tmp_path: Path) -> None:
    load(tmp_path, "h.yaml", YAML)
    for name, code in (("other.yaml", "PLAN107"), ("unsafe.yaml", "PLAN107"), ("../h.yaml", "PLAN108")):
        (tmp_path / "plan.yaml").write_text(PLAN.format(name))
        with pytest.raises(Rejected) as rejected:
            load_system(tmp_path)
        (fault,) = rejected.value.diagnostics
        assert (fault.code, fault.span.line if fault.span else 0) == (code, 2)
        assert name != "unsafe.yaml" or fault.hint is None, "plan.yaml has little but its ending in common"


G = guarantee("n", "g")


def case_of(*hazards: Hazard, records: tuple[Evidence, ...] = ()) -> Case:
    asked = Requirement("R", "It keeps low", None, None, ("n.g",))
    subject = system({"n": ["g"]}, plans=[node_plan("n", "high", "hoare", "hypothesis")], requirements=[asked])
    return case(replace(subject, plan=replace(subject.plan, hazards=hazards)), [G], list(records))


PROOF = evidence(G, Verdict.PROVED, "hoare")


@pytest.mark.parametrize(
    ("mitigated_by", "records", "level", "passes"),
    [
        ((), (PROOF,), Level.NOT_SHOWN, False),
        (("n",), (PROOF,), Level.MODELS, True),
        (("n.g", "n"), (PROOF,), Level.MODELS, True),
        (("n.g",), (evidence(G, Verdict.TESTED, "hypothesis"),), Level.TESTED_MODELS, True),
        (("n.g",), (evidence(G, Verdict.TESTED, "hypothesis", of=Object.SOURCE),), Level.TESTS, True),
        (("n/hypothesis",), (PROOF,), Level.NOT_SHOWN, False),
        (("n/hoare",), (PROOF,), Level.MODELS, True),
        (("n.g",), (), Level.NOT_SHOWN, False),
        (("n.g",), (evidence(G, Verdict.REFUTED, "hypothesis"),), Level.REFUTED, False),
        (("n", "R"), (PROOF,), Level.ARGUED, True),  # R is prose
    ],
)
def test_a_hazard_is_as_well_mitigated_as_its_weakest_mitigation(
    mitigated_by: tuple[str, ...], records: tuple[Evidence, ...], level: Level, passes: bool
) -> None:
    found = case_of(Hazard("H1", "It burns", "critical", mitigated_by=mitigated_by), records=records)
    (view,) = found.hazards
    assert view.level is level
    (gate,) = [gate for gate in found.gates if gate.id == "hazards"]
    assert gate.passed is passes
    assert ("H1" in gate.reason) is not passes
    assert (f"1 hazard mitigated: 1 {level}" == gate.reason) is passes
    assert (found.exit_code == 0) <= passes


def test_without_hazards_there_is_no_gate() -> None:
    assert not [gate for gate in case_of(records=(PROOF,)).gates if gate.id == "hazards"]


def test_a_bow_tie_has_every_part_and_text_is_data() -> None:
    hazard = Hazard(
        "H1", "It <burns>", "critical", "remote", causes=("a & b",), consequences=("loss",), mitigated_by=("n",)
    )
    picture = (
        render_argument(case_of(hazard, records=(PROOF,)))
        .partition("Hazards as bow-ties")[2]
        .partition("</section>")[0]
    )
    assert all(part in picture for part in ("&lt;burns&gt;", "a &amp; b", "loss", "n: shown of models", "critical"))
    assert "no mitigation</div>" in render_argument(case_of(Hazard("H2", "It burns", "critical")))


def test_the_trace_leads_from_source_and_hazard_to_the_command_that_asks_again() -> None:
    hazard = Hazard("H1", "It burns", "critical", mitigated_by=("R",))
    found = case_of(hazard, records=(replace(PROOF, outputs={"artifacts/rover/n/hoare/n.smt2": "ab" * 32}),))
    found = replace(found, requirements=tuple(replace(r, source="SRS 4.2") for r in found.requirements))
    row = next(row for row in trace(found) if row.method == "hoare")
    assert (row.source, row.hazards, row.requirement) == ("SRS 4.2", "H1", "R")
    assert (row.output, row.digest) == ("artifacts/rover/n/hoare/n.smt2", "ab" * 32)
    assert row.rerun == "AVOW_FRESH=1 doit discharge:rover:n:hoare && doit report:rover"


SECURE = """node remote { inputs() outputs( order : REAL ) topics( std_msgs/Float64 order )
  guarantee small ( out.order < 9 ) }
node n { inputs( order : REAL, r : REAL ) outputs( v : REAL )
  topics( std_msgs/Float64 order, std_msgs/Float64 r, std_msgs/Float64 v ) guarantee r ( out.v <= in.order ) }
"""


def secured(folder: Path, contract: str, hazards: str) -> System:
    (folder / "contracts/s").mkdir(parents=True)
    (folder / "contracts/s/s.rcl").write_text(contract)
    (folder / "contracts/s/plan.yaml").write_text("system: s\nhazards: h.yaml\n")
    (folder / "contracts/s/h.yaml").write_text(hazards)
    return load_system(folder / "contracts/s")


def test_a_security_goal_rests_on_who_feeds_an_input(tmp_path: Path) -> None:
    goals = (
        "S1: {text: A stranger gives orders, severity: critical, kind: security, mitigated_by: [n.order]}\n"
        "S2: {text: A stranger sends readings, severity: critical, kind: security, mitigated_by: [n.r]}\n"
    )
    found = case(secured(tmp_path, SECURE.replace("guarantee r (", "guarantee low ("), goals), [], [])
    read, ordered = found.hazards  # the least mitigated first
    assert (ordered.level, read.level) == (Level.ARGUED, Level.NOT_SHOWN)
    assert ordered.mitigations[0].words == "in the graph only remote reaches n.order"
    (gate,) = [gate for gate in found.gates if gate.id == "hazards"]
    assert (gate.passed, "S2: not shown" in gate.reason, "S1" in gate.reason) == (False, True, False)
    rows = {row.hazards: (row.obligation, row.status) for row in trace(found) if row.hazards}
    assert rows == {"S1": ("n.order", "argued"), "S2": ("n.r", "missing")}
    made = dict(every_text(found))
    for name in ("gsn.yaml", "sacm.xml", "traceability.reqif"):
        assert "in the graph only remote reaches n.order" in str(made[name]), name
    assert conclude_again(found) == found


def test_a_guarantee_comes_before_an_input_of_its_name(tmp_path: Path) -> None:
    r = guarantee("n", "r", of="s")
    subject = secured(tmp_path, SECURE, "H1: {text: It burns, severity: critical, mitigated_by: [n.r]}\n")
    (view,) = case(subject, [r], [evidence(r)]).hazards
    assert view.mitigations[0].claims == (r.id,)
