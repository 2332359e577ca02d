"""Reports whose system can no longer be read say that they are of an earlier state; attestations as envelopes."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import helpers
import pytest
from helpers import some

from avow.evidence.envelope import Opened, unseal
from avow.evidence.ledger import Ledger
from avow.evidence.signing import new_key_pair
from avow.pipeline import assess, engine_code
from avow.pipeline.report_check import check

AVOW = str(Path(sys.executable).with_name("avow"))
MARK = "As of an earlier state"


def avow(root: Path, *words: str) -> tuple[int, str]:
    done = subprocess.run([AVOW, *words], cwd=root, capture_output=True, text=True, timeout=120, check=False)
    assert "Traceback" not in done.stdout + done.stderr
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    tmp_path = tmp_path_factory.mktemp("made")
    for name in ("s", "t"):
        folder = tmp_path / "contracts" / name
        folder.mkdir(parents=True)
        (folder / "n.rcl").write_text(
            "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= 1 ) }\n"
        )
        (folder / "plan.yaml").write_text(f"system: {name}\npolicy: reproduction\n")
    (tmp_path / "dodo.py").write_text("")
    avow(tmp_path, "verify")
    return tmp_path


@pytest.fixture
def workspace(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "w"))


def test_an_edit_of_the_reports_templates_writes_the_report_again(
    workspace: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = workspace / "reports/s/index.html"
    times = [page.stat().st_mtime_ns]
    for digest in ("one", "one", "two"):
        monkeypatch.setattr(assess, "report_digest", lambda digest=digest: digest)
        assert helpers.avow("report", "s", cwd=workspace).returncode == 0
        times.append(page.stat().st_mtime_ns)
    assert [before != after for before, after in pairwise(times)] == [True, False, True]
    report = Path(assess.__file__).parents[1] / "report"
    assert any(b"templates/claims.html.j2" in part for part in engine_code._parts(report))


def marked(root: Path) -> dict[str, set[str]]:
    """The formats that say so, of each system; a PDF's text is packed."""
    found = {name: [p for p in (root / "reports" / name).iterdir() if p.suffix != ".pdf"] for name in ("s", "t")}
    return {name: {p.name for p in files if MARK in p.read_text()} for name, files in found.items()}


@pytest.mark.slow
@pytest.mark.parametrize("breaks", some(["plan", "contract", "gone"], 1))
def test_a_report_of_what_cannot_be_read_is_marked_until_it_can(workspace: Path, breaks: str) -> None:
    folder, page = workspace / "contracts" / "s", workspace / "reports" / "s" / "index.html"
    whole, index = page.read_text(), workspace / "reports" / "index.html"
    assert MARK not in index.read_text()
    match breaks:
        case "plan":
            (folder / "plan.yaml").write_text("system: [\n")
        case "contract":
            (folder / "n.rcl").write_text("node n {")
        case _:
            folder.rename(workspace / "away")
    for _ in range(2):
        code, said = avow(workspace, "verify")
        assert code == (0 if breaks == "gone" else 2)
        assert "its report is as of an earlier state" in " ".join(said.split())
        every = {p.name for p in (workspace / "reports" / "s").iterdir() if p.suffix != ".pdf"}
        assert marked(workspace) == {"s": every, "t": set()}
        assert len(every) >= 12
        assert '"exit_code": 1' in (workspace / "reports" / "s" / "report.json").read_text()
        assert "PASSED" not in (workspace / "reports" / "s" / "attestation.jsonl").read_text()
        assert not check(workspace / "reports" / "s", Ledger(workspace / "artifacts" / "ledger" / "s.jsonl"))
        assert MARK in index.read_text()
    match breaks:
        case "plan":
            (folder / "plan.yaml").write_text("system: s\npolicy: reproduction\n")
        case "contract":
            (folder / "n.rcl").write_text((workspace / "contracts" / "t" / "n.rcl").read_text())
        case _:
            (workspace / "away").rename(folder)
    code, said = avow(workspace, "verify")
    assert "earlier state" not in said
    assert MARK not in index.read_text()
    assert marked(workspace) == {"s": set(), "t": set()}
    assert len(page.read_text()) == pytest.approx(len(whole), abs=200)  # run and time differ


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("n.rcl", None),
        ("more.rcl", "node m { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= 1 ) }\n"),
        ("rows.csv", "y\n1\n"),
        ("rows.csv", None),
        ("plan.yaml", None),
        ("", ""),
    ],
)
def test_no_answer_is_of_what_is_no_more_asked(workspace: Path, name: str, text: str | None) -> None:
    folder = workspace / "contracts" / "t"
    (folder / "rows.csv").write_text("x\n1\n")
    (folder / "plan.yaml").write_text(
        "system: t\npolicy: reproduction\nscenario: {rows: rows.csv, domains: {in.x: rows.x}}\n"
    )
    avow(workspace, "verify", "t")
    code, told = avow(workspace, "explain", "t/n/sanity/realizable")
    assert (code, "proved" in told) == (0, True)
    if text is None:
        (folder / name).unlink()
    elif name:
        (folder / name).write_text(text)
    code, told = avow(workspace, "explain", "t/n/sanity/realizable")
    assert (code, "proved" in told, "not shown" in told) == ((0, True, False) if not name else (1, False, True))


@pytest.mark.slow
def test_the_audit_names_a_generated_file_that_was_edited(workspace: Path) -> None:
    contract = workspace / "contracts" / "s" / "n.rcl"
    (contract.parent / "m.py").write_text("def step(x):\n    return 0\n")
    (contract.parent / "plan.yaml").write_text(
        "system: s\npolicy: reproduction\nnodes: {n: {methods: [{hypothesis: {subject: 'm.py:step', cases: 5}}]}}\n"
    )
    avow(workspace, "verify")
    contract.write_text(contract.read_text().replace("<= 1", "<= 2"))
    assert avow(workspace, "audit", "s")[0] == 0  # files of an earlier state were not edited
    for name in ("n/index.md", "n/hypothesis/test_n.py", "obligations.json"):
        path = workspace / "artifacts" / "s" / name
        whole = path.read_text()
        path.write_text(whole.replace("out.y", "out.z"))
        code, told = avow(workspace, "audit", "s")
        assert code == 1
        assert f"artifacts/s/{name} was edited since it was generated" in told
        path.write_text(whole)


def test_verify_signs_its_attestations_where_there_is_a_key(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("cryptography")
    (workspace / "contracts" / "s" / "m.py").write_text("def step(x):\n    return 0\n")
    methods = "nodes: {n: {methods: [{hypothesis: {subject: 'm.py:step', cases: 5}}]}}\n"
    (workspace / "contracts" / "s" / "plan.yaml").write_text(f"system: s\npolicy: reproduction\n{methods}")
    public, place = new_key_pair(workspace / "key"), workspace / "reports" / "s" / "attestation.jsonl"
    avow(workspace, "verify")
    plain = place.read_text()
    assert {"contracts/s/m.py", "contracts/s/n.rcl"} <= {
        s["name"] for s in json.loads(plain.splitlines()[0])["subject"]
    }
    avow(workspace, "verify", "--key", "key")
    opened = [unseal(line, [public]) for line in place.read_text().splitlines()]
    assert [o.statement for o in opened if isinstance(o, Opened)] == [json.loads(line) for line in plain.splitlines()]
    assert avow(workspace, "report", "--check", "reports/s")[0] == 0
    assert avow(workspace, "audit", "--against", "reports/s/attestation.jsonl")[0] == 0
    sealed = place.read_text()
    assert "nothing to do" in avow(workspace, "verify", "--key", "key")[1]
    monkeypatch.setenv("AVOW_KEY", str(workspace / "key"))
    assert "nothing to do" in avow(workspace, "verify")[1]
    place.write_text(plain)  # taken off by hand: written anew
    avow(workspace, "verify")
    assert place.read_text() == sealed
    place.write_text(sealed.replace('"sig": "', '"sig": "AAAA', 1))
    assert avow(workspace, "report", "--check", "reports/s")[0] == 1
    monkeypatch.setenv("AVOW_KEY", str(workspace / "dodo.py"))
    assert avow(workspace, "verify")[0] == 2
    monkeypatch.delenv("AVOW_KEY")
    avow(workspace, "verify")
    assert place.read_text() == plain


@pytest.mark.nightly
def test_attestations_are_envelopes_where_a_key_signs(workspace: Path) -> None:
    pytest.importorskip("cryptography")
    public = new_key_pair(workspace / "key")
    signing = ("sign", "--report", "s", "--as", "A. Person", "--until", "2099-01-01")
    assert avow(workspace, *signing)[0] == 0
    assert not list((workspace / "signed").rglob("*.attestation.jsonl"))
    assert avow(workspace, *signing, "--key", "key")[0] == 0
    (sealed,) = (workspace / "signed").rglob("*.attestation.jsonl")
    lines = sealed.read_text().splitlines()
    plain = (workspace / "reports" / "s" / "attestation.jsonl").read_text().splitlines()
    opened = [unseal(line, [public]) for line in lines]
    assert [o.statement for o in opened if isinstance(o, Opened)] == [json.loads(line) for line in plain]
    changed = lines[0].replace('"payload": "e', '"payload": "f')
    assert isinstance(unseal(changed, [public]), str)
    assert avow(workspace, "verify")[0] == 0  # it is no signature of a case, and none is looked for in it


@pytest.mark.slow
def test_no_report_is_compared_with_a_ledger_that_cannot_be_read(workspace: Path) -> None:
    assert avow(workspace, "diff", "reports/s")[0] == 0
    ledger = workspace / "artifacts/ledger/s.jsonl"
    ledger.unlink()
    os.mkfifo(ledger)
    code, text = avow(workspace, "diff", "reports/s")
    assert (code, text.count("LEDGER001")) == (2, 1)
