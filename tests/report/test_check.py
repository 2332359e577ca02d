"""`report --check`: every way in which a report can say something else than the ledger is found."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from assurance.sample import case, evidence, rover_parts
from helpers import some

from avow.assurance.codec import from_json
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.base.workspace import ON_DEMAND, WRITTEN_ON_DEMAND
from avow.evidence.currency import changed_since, not_established
from avow.evidence.ledger import Entry, Ledger
from avow.pipeline.report_check import _ledger, check, stale
from avow.report import render_all
from avow.report.on_demand import export


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("check")
    subject, obligations, records, keys, extras = rover_parts()
    Ledger(root / "rover.jsonl").append_all(records)
    found = case(subject, obligations, records, keys=keys, **extras)
    render_all(found, root / "report")
    list(export(found, root / "report", ON_DEMAND.keys() - {"pdf", "all"}))
    return root


@pytest.fixture
def place(made: Path, tmp_path: Path) -> Path:
    import shutil

    shutil.copytree(made, tmp_path / "w")
    return tmp_path / "w"


def found(place: Path) -> tuple[str, ...]:
    return check(place / "report", Ledger(place / "rover.jsonl"))


def edit(path: Path, change) -> None:  # type: ignore[no-untyped-def]
    data = json.loads(path.read_text())
    change(data)
    path.write_text(json.dumps(data))


def test_an_honest_report_agrees(place: Path) -> None:
    assert found(place) == ()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    some(
        [
            "index.html",
            "claims.html",
            "node-agent.html",
            "report.md",
            "report.sarif",
            "findings.sarif",
            "junit.xml",
            "attestation.jsonl",
            "gsn.yaml",
            "gsn.svg",
            "traceability.csv",
            "traceability.html",
        ],
        4,
    ),
)
def test_an_edited_format_is_found(place: Path, name: str) -> None:
    path = place / "report" / name
    if not path.exists():
        pytest.skip("extra not installed")
    data = path.read_bytes()
    path.write_bytes(data.replace(b"refuted", b"proved") if b"refuted" in data else data + b" ")
    assert any(name in line for line in found(place))
    path.unlink()
    assert any(name in line for line in found(place)) == (name not in WRITTEN_ON_DEMAND)


def test_a_page_of_no_node_is_found(place: Path) -> None:
    (place / "report/node-agent.html").rename(place / "report/node-agents.html")
    told = "\n".join(found(place))
    assert "node-agents.html is a page of no node in report.json" in told
    assert "node-agent.html cannot be read" in told


def test_an_embellished_conclusion_is_found(place: Path) -> None:
    def lie(data: dict) -> None:  # type: ignore[type-arg]
        for o in data["obligations"]:
            if o["status"] == "refuted":
                o["status"] = o["standing"] = "proved"
        data["exit_code"] = 0

    edit(place / "report/report.json", lie)
    told = found(place)
    assert any("'obligations' does not follow" in line for line in told)
    assert any("'exit_code' does not follow" in line and "says 0, but is 1" in line for line in told)


def test_an_embellished_record_is_found(place: Path) -> None:
    def lie(data: dict) -> None:  # type: ignore[type-arg]
        for o in data["obligations"]:
            for item in o["evidence"]:
                item["entry"]["evidence"]["verdict"] = "proved"

    edit(place / "report/report.json", lie)
    assert any("otherwise than the ledger has it" in line for line in found(place))


def test_a_left_out_refutation_is_found(place: Path) -> None:
    def lie(data: dict) -> None:  # type: ignore[type-arg]
        for o in data["obligations"]:
            o["evidence"] = [i for i in o["evidence"] if i["entry"]["evidence"]["verdict"] != "refuted"]

    edit(place / "report/report.json", lie)
    assert any("does not show (`doit report:rover` renders it again)" in line for line in found(place))


def test_newer_evidence_makes_a_report_old(place: Path) -> None:
    Ledger(place / "rover.jsonl").append(evidence("radiationSensor.low", Verdict.REFUTED, key="new"))
    assert any("does not show" in line for line in found(place))


def test_a_damaged_ledger_is_told(place: Path) -> None:
    path = place / "rover.jsonl"
    path.write_text(path.read_text().replace('"refuted"', '"proved"', 1))
    assert any("was changed after it was written" in line for line in found(place))


def test_a_report_without_a_ledger_or_without_json_does_not_agree(place: Path) -> None:
    assert "there is no ledger to compare with" in check(place / "report", None)
    (place / "report/report.json").write_text("{")
    assert "cannot be read" in found(place)[0]
    (place / "report/report.json").write_text("{}")
    assert "not a case of format" in found(place)[0]


def test_changed_sources_are_told(place: Path) -> None:
    told = check(place / "report", Ledger(place / "rover.jsonl"), place)
    assert any("contracts/rover/plan.yaml" in line for line in told)


def test_a_fact_that_no_other_format_shows_cannot_be_edited_either(place: Path) -> None:
    """A node's guarantees stand in report.json alone; the page holds the digest of that file."""
    path = place / "report/report.json"
    text = path.read_text()
    path.write_text(text.replace('["low", "TRUE"]', '["low", "FALSE"]', 1))
    assert path.read_text() != text
    assert any("index.html" in line for line in found(place))


@pytest.mark.parametrize("no_more", [not_established, changed_since])
def test_what_counts_no_more_is_quoted_so_and_a_refutation_is_not(
    made: Path, no_more: Callable[[Entry], Entry]
) -> None:
    """Of a proof that the kernel does not establish any more, and of evidence whose inputs are others now, the report
    says so; a refutation may not be told away."""
    ledger = Ledger(made / "rover.jsonl")
    honest = from_json(json.loads((made / "report/report.json").read_text()))
    for entry in ledger.records():
        views = tuple(
            replace(v, evidence=tuple(replace(i, entry=no_more(entry)) for i in v.evidence if i.entry == entry))
            for v in honest.obligations
        )
        told = [line for line in _ledger(replace(honest, obligations=views), ledger, made) if "report quotes" in line]
        quoted = any(i.entry == entry for v in honest.obligations for i in v.evidence)
        assert bool(told) == (quoted and not entry.evidence.verdict.supports)
        how = "counts now" if no_more is changed_since else "otherwise than"  # an edit of a file looks like the first
        assert all(how in line for line in told)


def test_files_that_are_others_now_are_named_and_are_no_difference(tmp_path: Path) -> None:
    subject, obligations, records, keys, extras = rover_parts()
    for name in ("same.py", "other.py", "gone.py"):
        (tmp_path / name).write_text(name)
    marks = {name: sha256((tmp_path / name).read_bytes()) for name in ("same.py", "other.py", "gone.py")}
    records = [replace(record, inputs=marks) for record in records]
    made_of = case(subject, obligations, records, keys=keys, **extras)
    assert stale(made_of, tmp_path) == ()
    (tmp_path / "other.py").write_text("another")
    (tmp_path / "gone.py").unlink()
    assert stale(made_of, tmp_path) == ("gone.py", "other.py")
