"""Each format through a reader of its own, for an ordinary case, a hostile one and an empty one."""

from __future__ import annotations

import csv
import io
import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import replace
from pathlib import Path
from typing import Any

import jsonschema
import junitparser
import pytest
import yaml
from assurance.sample import case, evidence, guarantee, node_plan, obligation, rover_case, system
from helpers import every_text

import avow.report
from avow.assurance.answers import EARLIER, Tone
from avow.assurance.case import as_of_earlier
from avow.assurance.certification import Grade
from avow.assurance.codec import case_schema
from avow.assurance.model import Case
from avow.assurance.traceability import COLUMNS, trace
from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.base.workspace import WRITTEN_ON_DEMAND
from avow.evidence.obligation import Kind
from avow.report import goals, render_all, write_index
from avow.report.exchange import render_attestation
from avow.report.gsn import render_gsn
from avow.report.on_demand import export
from avow.report.short import terminal_lines
from avow.system.plan import Requirement, Validation
from report.hostile import hostile_case

CASES = {"rover": rover_case, "hostile": hostile_case, "empty": lambda: case(system({}), [], [])}
_RENDERED: dict[str, dict[str, Any]] = {}


@pytest.fixture(params=list(CASES))
def rendered(request: pytest.FixtureRequest) -> tuple[Case, dict[str, Any]]:
    name = request.param
    if name not in _RENDERED:
        _RENDERED[name] = dict(every_text(CASES[name]()))
    return CASES[name](), _RENDERED[name]


def test_json_meets_the_published_schema(rendered: tuple[Case, dict[str, Any]]) -> None:
    found, texts = rendered
    data = json.loads(texts["report.json"])
    jsonschema.Draft202012Validator(case_schema()).validate(data)
    assert data["exit_code"] == found.exit_code


def test_what_is_below_a_requirement_may_be_no_obligation() -> None:
    """An assumption without a reason, a derivation, a requirement: every format is made."""
    found = rover_case()
    below = ("assumption:system/assumption/together(a,b):0123456789ab", "derivation:D", "requirement:R9")
    requirements = tuple(replace(r, below=below, weakest=below[0], failing=below) for r in found.requirements)
    derivations = tuple(replace(d, below=below, weakest=below[0]) for d in found.derivations)
    texts = dict(every_text(replace(found, requirements=requirements, derivations=derivations)))
    assert texts.keys() == dict(every_text(found)).keys()
    assert "system/assumption/together(a,b)" in texts["claims.html"]


def test_junit_is_read_by_junitparser(rendered: tuple[Case, dict[str, Any]], tmp_path: Path) -> None:
    found, texts = rendered
    (tmp_path / "junit.xml").write_text(texts["junit.xml"], encoding="utf-8")
    suites = junitparser.JUnitXml.fromfile(str(tmp_path / "junit.xml"))
    cases = [c for suite in suites for c in suite]
    assert len(cases) == len(found.gates) + len(found.requirements) + len(found.obligations) == suites.tests
    failures = [c for c in cases if any(isinstance(r, junitparser.Failure) for r in c.result)]
    assert len(failures) == suites.failures
    assert (suites.failures > 0) == (not found.good)
    skipped = [c for c in cases if any(isinstance(r, junitparser.Skipped) for r in c.result)]
    # never a pass without support: every test case that passes stands on something
    passing = len(cases) - len(failures) - len(skipped) - suites.errors
    good = [*(g.passed for g in found.gates), *(r.level.holds for r in found.requirements)]
    assert passing == sum(good) + sum(v.passes for v in found.obligations)


def test_sarif_meets_its_schema(rendered: tuple[Case, dict[str, Any]]) -> None:
    found, texts = rendered
    schema = json.loads((Path(__file__).parent / "sarif.subset.schema.json").read_text())
    full, findings = json.loads(texts["report.sarif"]), json.loads(texts["findings.sarif"])
    for data in (full, findings):
        jsonschema.Draft202012Validator(schema).validate(data)
        rules = [rule["id"] for rule in data["runs"][0]["tool"]["driver"]["rules"]]
        assert len(rules) == len(set(rules))
        assert all(rules[r["ruleIndex"]] == r["ruleId"] for r in data["runs"][0]["results"])
    assert len(full["runs"][0]["results"]) == len(found.obligations)
    assert all(r["kind"] != "pass" for r in findings["runs"][0]["results"])
    assert len(findings["runs"][0]["results"]) == sum(not v.standing.supports for v in found.obligations)


def test_sarif_tells_where_and_what_is_accepted() -> None:
    results = {
        r["properties"]["obligation"]: r
        for r in json.loads(dict(every_text(rover_case()))["report.sarif"])["runs"][0]["results"]
    }
    medium = results["rover/radiationSensor/guarantee/medium"]
    assert medium["locations"][0]["physicalLocation"]["artifactLocation"]["uri"] == "contracts/rover/system.rcl"
    assert (medium["kind"], medium["level"]) == ("fail", "error")
    assert "in.r = 120" in medium["message"]["text"]
    assert "suppressions" not in medium
    assert "R. Assessor" in results["rover/navigation/guarantee/arrives"]["suppressions"][0]["justification"]


def test_attestations_are_in_toto_statements(rendered: tuple[Case, dict[str, Any]]) -> None:
    found, texts = rendered
    lines = [json.loads(line) for line in texts["attestation.jsonl"].splitlines()]
    assert len(lines) == 1 + len({v.obligation.node for v in found.obligations})
    for statement in lines:
        assert statement["_type"] == "https://in-toto.io/Statement/v1"
        assert statement["predicateType"] == "https://in-toto.io/attestation/test-result/v0.1"
        assert statement["subject"]
        assert all(s["name"] and re.fullmatch("[0-9a-f]{64}", s["digest"]["sha256"]) for s in statement["subject"])
        assert statement["predicate"]["result"] in ("PASSED", "WARNED", "FAILED")
        assert statement["predicate"]["configuration"]
    relied = found.answers.headline.holds
    assert lines[0]["predicate"]["result"] == ("FAILED" if not found.good else "PASSED" if relied else "WARNED")
    named = [n for key in ("passedTests", "warnedTests", "failedTests") for n in lines[0]["predicate"][key]]
    assert sorted(named) == sorted(v.id for v in found.obligations)


def test_gsn_yaml_obeys_gsn2x_module_by_module(rendered: tuple[Case, dict[str, Any]]) -> None:
    found, texts = rendered
    modules = list(yaml.safe_load_all(texts["gsn.yaml"]))
    assert len(modules) >= 1 + len(found.requirements) + len(found.nodes)
    names = [module.pop("module")["name"] for module in modules]
    assert len(set(names)) == len(names)
    every: dict[str, Any] = {}
    for module in modules:
        assert not every.keys() & module.keys(), "an element stands in one module"
        every |= module
    kinds = {"supportedBy": ("G", "S", "Sn"), "inContextOf": ("A", "J", "C")}
    referred = set()
    for name, element in every.items():
        assert re.fullmatch(r"(G|S|Sn|C|A|J)\d+", name)
        assert element["text"].strip()
        for key, allowed in kinds.items():
            for other in element.get(key, []):
                assert other in every
                assert re.sub(r"\d", "", other) in allowed
                referred.add(other)
        if "supportedBy" in element:
            assert re.match(r"G|S\d", name)
        assert not (element.get("undeveloped") and element.get("supportedBy"))
    alone = {name for name in set(every) - referred if name != "G1" and not name.startswith("G")}
    assert alone == set(), "only nodes that no requirement needs stand alone"
    assert sum(name.startswith("A") for name in every) == len(found.assumptions)


def test_no_requirement_and_no_node_is_called_as_another_element() -> None:
    odd = ("system", "node-agent", "agent", "agent.g1", "guarantee-agent.g1", "requirement-system", "node-node")
    names = {"agent": ["g1"], "node": ["g1"], "system": ["g1"], "guarantee": ["g1"]}
    asked = [Requirement(name, "It is safe.", None, None, ("agent.g1",)) for name in odd]
    claims = [guarantee(node, "g1") for node in names]
    found = case(system(names, requirements=asked), claims, [evidence(claim) for claim in claims])
    modules = [m["module"]["name"] for m in yaml.safe_load_all(render_gsn(found))]
    assert len(set(modules)) == len(modules) > 1 + len(odd) + len(names)


def test_svg_is_xml_without_scripts(rendered: tuple[Case, dict[str, Any]]) -> None:
    _, texts = rendered
    root = ElementTree.fromstring(texts["gsn.svg"])
    tags = {e.tag.rpartition("}")[2] for e in root.iter()}
    assert "script" not in tags
    assert tags <= {
        "svg",
        "style",
        "rect",
        "defs",
        "marker",
        "path",
        "g",
        "title",
        "polygon",
        "circle",
        "text",
        "tspan",
        "a",
    }


def test_csv_has_every_path_and_no_formula(rendered: tuple[Case, dict[str, Any]]) -> None:
    found, texts = rendered
    rows = list(csv.reader(io.StringIO(texts["traceability.csv"], newline="")))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) - 1 == len(trace(found))
    assert all(cell[:1] not in tuple("=+-@") for row in rows for cell in row)


def test_known_bad_material_is_warned_of_in_every_format_for_machines() -> None:
    from avow.system.plan import Finding

    target = guarantee("n", "g")
    expected = [Finding("n/guarantee/g", "refuted", "as published")]
    subject = system({"n": ["g"]}, plans=[node_plan("n", "low", "hoare")], expected=expected, policy="reproduction")
    texts: dict[str, Any] = dict(every_text(case(subject, [target], [evidence(target, Verdict.REFUTED)])))
    assert '<property name="result" value="WARNED"/>' in texts["junit.xml"]
    assert json.loads(texts["report.sarif"])["runs"][0]["properties"]["result"] == "WARNED"
    assert json.loads(texts["attestation.jsonl"].splitlines()[0])["predicate"]["result"] == "WARNED"


def test_markdown_keeps_its_tables_and_shows_no_html(rendered: tuple[Case, dict[str, Any]]) -> None:
    _, texts = rendered
    lines = texts["report.md"].splitlines()
    width = 0
    for line in lines:
        cells = len(re.findall(r"(?<!\\)\|", line))
        if line.startswith("| --- ") or (line.startswith("|") and not width):
            width = width or cells
        if line.startswith("|"):
            assert cells == width, line
        else:
            width = 0
    assert not re.search(r"(?<!\\)<[a-z/]", texts["report.md"])


def test_files_on_demand_are_removed_with_their_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("typst")
    case = CASES["empty"]()
    written = list(export(case, tmp_path, ["all"]))
    assert [path.name for path in written] == list(WRITTEN_ON_DEMAND)
    data = (tmp_path / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF-")
    assert b"%%EOF" in data[-32:]
    render_all(case, tmp_path)
    assert not any(path.exists() for path in written)
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(Rejected, match="CLI023"):
        list(export(case, tmp_path, ["pdf"]))


def test_rendering_twice_changes_no_byte(tmp_path: Path) -> None:
    first = render_all(rover_case(), tmp_path / "rover")
    before = {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in first}
    second = render_all(rover_case(), tmp_path / "rover")
    assert {p: (p.read_bytes(), p.stat().st_mtime_ns) for p in second} == before
    assert write_index([rover_case()], tmp_path) == tmp_path / "index.html"


# -- traceability ---------------------------------------------------------------------------------------------------


def test_the_argument_is_made_once_and_comparisons_are_sought_among_links_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sought: list[list[object]] = []
    made: list[Case] = []
    module = goals._Argument
    monkeypatch.setattr(goals, "agrees", lambda views, *of: sought.append(list(views)))
    monkeypatch.setattr(goals, "_Argument", lambda of: (made.append(of), module(of))[1])
    claims = [guarantee("a", f"g{k}") for k in range(3)]
    found = case(system({"a": ["g0", "g1", "g2"]}), claims, [evidence(claim) for claim in claims])
    assert {name for name, _ in every_text(found)} >= {"sacm.xml", "gsn.yaml"}
    assert made == [found]
    assert sought
    assert not any(sought), "no program was compared with a model"


def test_orphans_both_ways() -> None:
    from avow.system.plan import Requirement

    g, h = guarantee("n", "g"), guarantee("n", "h")
    gone = evidence(guarantee("n", "gone"))
    subject = system(
        {"n": ["g", "h"]},
        plans=[node_plan("n", "low", "hoare")],
        requirements=[Requirement("R", "t", None, None, ("n.g",)), Requirement("LONELY", "t", None, None, ())],
    )
    rows = trace(case(subject, [g, h], [evidence(g), evidence(h), gone]))
    told = {(r.requirement, r.guarantee or r.obligation): r.remark for r in rows}
    assert told["R", "n.g"] == ""
    assert "nothing supports" in told["LONELY", ""]
    assert "serves no requirement" in told["", "n.h"]
    assert "no longer exists" in told["", "rover/n/guarantee/gone"]


def test_a_path_goes_through_the_derivation() -> None:
    rows = [r for r in trace(rover_case()) if r.requirement == "REQ1" and r.derivation == "D1"]
    assert {r.obligation for r in rows} >= {
        "rover/system/composition/D1-position",
        "rover/localisation/guarantee/one_position",
    }
    found = rover_case()
    alone = replace(found.requirements[0], rests_on=())  # it reaches the derivation's conditions, not its name
    told = {r.derivation for r in trace(replace(found, requirements=(alone,))) if "serves no requirement" in r.remark}
    assert "D1" not in told
    assert "D1" in {r.derivation for r in trace(replace(found, requirements=())) if "serves no" in r.remark}


def test_what_a_guarantee_rests_on_is_part_of_the_trace() -> None:
    from avow.evidence.obligation import Kind
    from avow.system.plan import Requirement

    g, sane = guarantee("n", "g"), obligation("n", Kind.SANITY, "realizable")
    subject = system({"n": ["g"]}, requirements=[Requirement("R", "t", None, None, ("n.g",))])
    found = case(subject, [g, sane], [evidence(g), evidence(sane, Verdict.REFUTED, "sanity")])
    told = {r.obligation: (r.requirement, r.verdict) for r in trace(found)}
    assert told[sane.id] == ("R", "refuted")


def test_the_matrix_page_counts_what_is_covered() -> None:
    from avow.report.page import render_traceability
    from avow.system.plan import Requirement

    g, h = guarantee("n", "g"), guarantee("n", "h")
    subject = system(
        {"n": ["g", "h"]},
        requirements=[Requirement("R", "t", None, None, ("n.g",)), Requirement("LONELY", "t", None, None, ())],
    )
    found = case(subject, [g, h], [evidence(g), evidence(g, Verdict.TESTED, "hypothesis"), evidence(h)])
    text = render_traceability(found, trace(found))
    assert "<b>1 of 2</b> requirements lead to evidence" in text
    assert "<b>1 of 2</b> guarantees serve a requirement" in text
    assert "<b>2 orphans</b>" in text
    assert text.count('href="argument.html#rover/n/guarantee/g"') == 1, "one row for a claim, with all of its evidence"
    assert "hypothesis" in text


def test_the_grade_of_the_proofs_is_told_as_one_of_proofs() -> None:
    """Beside a finding, or a refutation, a bare word would read as a verdict."""
    found = replace(rover_case(), grade=Grade.CERTIFIED)
    for name, text in dict(every_text(found)).items():
        assert "CERTIFIED" not in str(text), name
    assert '"grade": "proofs certified"' in str(dict(every_text(found))["report.json"])
    assert "Proofs certified" in str(dict(every_text(found))["claims.html"])


def test_the_index_does_not_call_known_bad_material_passed() -> None:
    from avow.report.answers_page import render_index
    from avow.system.plan import Finding, Requirement

    g = guarantee("n", "g")
    bad = system(
        {"n": ["g"]},
        policy="reproduction",
        requirements=[Requirement("R", "t", None, None, ("n.g",))],
        expected=[Finding("n/guarantee/g", "refuted")],
    )
    examined = case(bad, [g], [evidence(g, Verdict.REFUTED)])
    good = case(system({}), [], [])
    assert examined.exit_code == 0
    text = render_index([examined, good])
    assert "None is relied upon" in text, "of a system without requirements nothing is claimed either"
    assert text.count("Examined, not relied upon") == 2
    assert examined.answers.verdict == "Examined, not relied upon", "one of four sentences"
    assert text.count("1 finding against it, which the plan lists") == 1
    made = dict(every_text(examined))
    for name in ("index.html", "report.md", "comment.md", "gsn.yaml"):
        assert "1 finding against it, which the plan lists" in str(made[name]), name
    assert any("1 finding against it, which the plan lists" in line for line in terminal_lines(examined))
    assert (examined.answers.tone, good.answers.tone) == (Tone.RED, Tone.GREY)
    assert examined.answers.gates.endswith(" do not apply")
    assert "✔" not in text.split("<main")[0]
    relied = case(system({"n": ["g"]}, requirements=[Requirement("R", "t", None, None, ("n.g",))]), [g], [evidence(g)])
    assert "1 system, argued; 1 only examined" in render_index([examined, relied])
    better = case(
        system({"n": ["g"]}, requirements=[Requirement("R", "t", "n.x", None, ("n.g",))]),
        [g, own := obligation("system", Kind.REQUIREMENT, "R", clauses=("n.g",))],
        [evidence(g), evidence(own, method="compose")],
    )
    assert "2 systems, the lowest verdict: argued; 1 only examined" in render_index([examined, relied, better])
    assert "1 system, shown of models" in render_index([better])


def test_every_format_is_described() -> None:
    names = [re.sub(r"^node-\w+", "node-NAME", name) for name, _ in every_text(rover_case())]
    names.append("report.pdf")
    page = (Path(__file__).parents[2] / "docs" / "reading-a-report.md").read_text(encoding="utf-8")
    table = re.findall(r"`([\w.-]+)`", "\n".join(re.findall(r"^\| (.*?) \|", page, re.MULTILINE)))
    assert set(names) <= set(table), "the table of files in docs/reading-a-report.md"
    assert set(names) <= set((avow.report.__doc__ or "").split()), "the docstring of avow/report/__init__.py"


def test_every_format_says_that_it_is_of_an_earlier_state() -> None:
    """Of a system that cannot be read any more; a PDF's text is packed."""
    for made, said in ((as_of_earlier(rover_case()), True), (rover_case(), False)):
        texts = [(name, text) for name, text in every_text(made) if isinstance(text, str)]
        assert [name for name, text in texts if (EARLIER in text) != said] == [], "it says EARLIER where case.earlier"


def test_what_nobody_has_validated_is_not_passed() -> None:
    g = guarantee("n", "g")
    unread = Requirement("R", "It is safe.", None, None, ("n.g",), validation=Validation("A. Person", "2026-01-01"))
    read = replace(unread, validation=None)  # the sample's reader reads it
    for requirement, result in ((unread, "WARNED"), (read, "PASSED")):
        found = case(system({"n": ["g"]}, requirements=[requirement]), [g], [evidence(g)])
        assert found.exit_code == 0
        first = json.loads(render_attestation(found).splitlines()[0])
        assert first["predicate"]["result"] == result
