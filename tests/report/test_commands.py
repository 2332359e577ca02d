"""The commands audit, explain, report --check and diff in a workspace of their own."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
from datetime import date
from pathlib import Path
from typing import Any

import pytest
from assurance.sample import PLAN_TEXT, RCL_TEXT, TODAY, case, evidence, rover_parts
from click.testing import CliRunner, Result

from avow.assurance.changes import compare
from avow.assurance.state import state_of, state_of_ledger
from avow.base.diagnostics import Rejected
from avow.base.files import sha256
from avow.base.verdict import Verdict
from avow.cli.audit import command as audit
from avow.cli.diff import command as diff
from avow.cli.explain import command as explain
from avow.cli.init import command as init
from avow.cli.report import command as report
from avow.evidence.ledger import Ledger
from avow.evidence.obligation import Kind
from avow.report import render_all


@pytest.fixture(scope="module")
def template(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("workspace")
    (root / "contracts/rover").mkdir(parents=True)
    (root / "dodo.py").touch()
    (root / "contracts/rover/plan.yaml").write_text(PLAN_TEXT)
    (root / "contracts/rover/system.rcl").write_text(RCL_TEXT)
    (root / "a.log").write_text("log")
    subject, obligations, records, keys, extras = rover_parts()
    logged = evidence("radiationSensor.low", outputs={"a.log": sha256("log")}, run="later")
    records.append(logged)
    ledger = Ledger(root / "artifacts/ledger/rover.jsonl")
    ledger.append_all(records)
    render_all(case(subject, obligations, records, keys=keys, **extras), root / "reports/rover")
    return root


@pytest.fixture
def root(template: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(template, tmp_path / "w")
    monkeypatch.chdir(tmp_path / "w")
    # the rover is made by hand: its files are no contract and no plan
    monkeypatch.setattr("avow.pipeline.report_check.asked_otherwise", lambda *_: ())
    monkeypatch.setattr("avow.cli.explain.today", lambda: TODAY)
    return tmp_path / "w"


def run(command: Any, *arguments: str) -> tuple[int, str]:
    """Exit code (the command's return value) and output; what the command line would tell a user of a `Rejected`."""
    result: Result = CliRunner().invoke(command, list(arguments), standalone_mode=False)
    if result.exception is not None:
        raise result.exception
    return int(result.return_value), result.output


def test_audit_agrees_then_names_what_was_done(root: Path) -> None:
    code, text = run(audit)
    assert (code, text.splitlines()[0]) == (0, "rover: 36 records, 0 discrepancies")
    (root / "a.log").write_text("edited")
    code, text = run(audit, "rover")
    assert code == 1
    assert "a.log" in text
    assert "was changed" in text
    data = json.loads(run(audit, "--json")[1])
    assert data["systems"]["rover"]["discrepancies"][0]["fault"] == "changed"
    with pytest.raises(Rejected):
        run(audit, "rovr")


def test_audit_signs_and_verifies(root: Path) -> None:
    pytest.importorskip("cryptography")
    assert run(audit, "--new-key", "key")[0] == 0
    assert run(audit, "--key", "key.pub")[0] == 1  # not signed yet
    assert run(audit, "--sign", "key")[0] == 0
    assert run(audit, "--key", "key.pub")[0] == 0
    (root / "a.log").write_text("edited")
    assert run(audit, "--sign", "key")[0] == 1  # what disagrees is not signed


@pytest.mark.parametrize(
    "name", ["radiationSensor.medium", "rover/radiationSensor/guarantee/medium", "radiationSensor/guarantee/medium"]
)
def test_explain_tells_all_of_one_obligation(root: Path, name: str) -> None:
    code, text = run(explain, name)
    assert code == 0
    for part in (
        "refuted",
        "in.r = 120",
        "guarantee medium demands orange",
        "AVOW_FRESH=1 doit",
        "system.rcl:",
        "REQ2",
        "120 ≤ in.r",
    ):
        assert part in text
    data = json.loads(run(explain, name, "--json")[1])
    assert data["obligations"][0]["status"] == "refuted"


def test_explain_shows_runs_and_history_and_says_what_is_near(root: Path) -> None:
    assert "returns to step 2" in run(explain, "REQ4")[1]
    assert "no longer count" in run(explain, "localisation.one_position")[1]
    with pytest.raises(Rejected) as caught:
        run(explain, "radiationSensor.mediun")
    assert "radiationSensor.medium" in (caught.value.diagnostics[0].hint or "")
    (root / "reports/rover/report.json").write_text("{")
    with pytest.raises(Rejected):
        run(explain, "REQ4")


@pytest.mark.slow
def test_report_check(root: Path) -> None:
    for given in ("reports/rover", "rover", "contracts/rover", "reports/rover/report.json"):
        code, text = run(report, "--check", given)
        assert (code, text.count("agrees with the ledger")) == (0, 1), text
    (root / "contracts/rover/system.rcl").write_text("another contract")
    code, text = run(report, "--check", "reports/rover")
    assert code == 1
    assert "system.rcl has changed" in text
    assert json.loads(run(report, "--check", "reports/rover", "--json")[1])["agrees"] is False


def test_diff_of_reports_and_ledgers(root: Path) -> None:
    assert run(diff, "reports/rover", "reports/rover") == (0, "nothing changed\n")
    subject, obligations, records, keys, extras = rover_parts()
    better = [r for r in records if r.verdict is not Verdict.REFUTED]
    render_all(case(subject, obligations, better, keys=keys, **extras), root / "new")
    assert run(diff, "reports", "reports/rover") == (0, "nothing changed\n")
    text = run(diff, "reports/rover", "new")[1]
    assert "▲ refuted → tested: “" in text
    other = root / "other.jsonl"
    Ledger(other).append_all([*records, evidence("radiationSensor.low", Verdict.REFUTED)])
    changes = json.loads(run(diff, "artifacts/ledger/rover.jsonl", str(other), "--json")[1])["changes"]
    assert changes[0] == {
        "system": "rover",
        "kind": "open",
        "subject": "rover/radiationSensor/guarantee/low",
        "words": "proved → contradictory: “radiationSensor.low”",
        "before": "proved",
        "after": "contradictory",
        "edits": ["radiationSensor.low by hoare: proved (model) → refuted (model)"],
        "about": "claim",
        "worse": True,
    }
    with pytest.raises(Rejected):
        run(diff, "no-such-revision", "reports/rover")
    with pytest.raises(Rejected):
        run(diff, "--", "--output=x", "reports/rover")


def test_diff_takes_revisions_and_workspaces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The requirement that an edit of the contract concerns is told with the edit, whatever is held against it."""
    assert run(init, str(tmp_path / "w"))[0] == 0
    monkeypatch.chdir(tmp_path / "w")
    person = ("-c", "user.name=n", "-c", "user.email=e")
    for words in (("init", "-q"), ("add", "-A"), (*person, "commit", "-qm", "first"), ("tag", "v1.2")):
        subprocess.run(["git", *words], check=True)
    shutil.copytree(tmp_path / "w", tmp_path / "copy")
    path = Path("contracts/thermostat/system.rcl")
    text = path.read_text()
    assert run(diff, "v1.2") == run(diff, "../copy") == (0, "nothing changed\n")
    path.write_text(text.replace("High = 24", "High = 25"))
    line = 1 + text[: text.index("High = 24")].count("\n")
    for old in ("v1.2", "../copy"):
        lines = run(diff, old)[1].splitlines()
        at = next(n for n, one in enumerate(lines) if one.startswith("  ≠ “Above the high mark it cools” was"))
        assert lines[at + 3].startswith(f"      {path}:{line}: High = 24;"), lines
        assert "High = 25;" in lines[at + 3]
        assert "Below the low mark" not in " ".join(lines)


def test_comparison_tells_new_gone_and_changed_claims() -> None:
    subject, obligations, records, keys, extras = rover_parts()
    old = state_of(case(subject, obligations, records, keys=keys, **extras))
    assert compare(old, old) == ()
    from dataclasses import replace

    at = next(n for n, one in enumerate(obligations) if one.kind is Kind.GUARANTEE)
    changed = [*obligations[1:at], replace(obligations[at], digest=sha256("other")), *obligations[at + 1 :]]
    new = state_of(case(subject, changed, records, keys=keys, **extras))
    kinds = {(c.kind, c.subject) for c in compare(old, new)}
    assert ("gone", obligations[0].id) in kinds
    assert ("meaning", obligations[at].id) in kinds
    assert ("new", obligations[0].id) in {(c.kind, c.subject) for c in compare(new, old)}
    assert state_of_ledger(()).items == {}


@pytest.mark.parametrize(("version", "fault", "code"), [(None, "", 0), ("1.0", "", 0), ("1.0", "it does not link", 3)])
def test_doctor_prints_commands_whole_and_faults(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    version: str | None,
    fault: str,
    code: int,
) -> None:
    """A required tool that fails its one-line job is as good as missing."""
    import avow.pipeline.doctor as doctor

    told = doctor.Finding("a [use]", "thing", version, None, "pip install 'avow[signing]'", not fault, fault)
    monkeypatch.setattr(doctor, "findings", lambda tried: (told,))
    from avow.cli import main

    with pytest.raises(SystemExit) as done:
        main(["doctor"])
    assert done.value.code == code
    out = capsys.readouterr().out
    assert ("pip install 'avow[signing]'" in out) == (version is None or bool(fault))
    assert fault in out


@pytest.mark.parametrize("edited", ["contracts/rover/system.rcl", "contracts/rover/plan.yaml"])
def test_after_an_edit_a_report_answers_not_shown(root: Path, edited: str) -> None:
    (root / edited).write_text((root / edited).read_text() + "\n")
    for name in ("radiationSensor.medium", "REQ1"):
        code, text = run(explain, name)
        assert (code, f"{edited} has changed since" in text) == (1, True)
        assert not {"proved", "checked", "tested", "argued"} & set(re.findall(r"\w+", text))


def test_an_answer_is_as_of_today(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What has expired since the report was made is not shown."""
    names: list[int] = []
    for day in (TODAY, date(2100, 1, 1)):
        monkeypatch.setattr("avow.cli.explain.today", lambda day=day: day)
        names.append(run(explain, "accepted")[1].count("was accepted by"))
    assert names[0] < names[1]


@pytest.mark.parametrize("how", ["fifo", "folder", "cut", "gone", "edited"])
def test_what_a_report_says_is_shown_with_what_its_ledger_says(root: Path, how: str) -> None:
    ledger = root / "artifacts/ledger/rover.jsonl"
    lines = ledger.read_text().splitlines(keepends=True)
    ledger.unlink()
    match how:
        case "fifo":
            os.mkfifo(ledger)
        case "folder":
            ledger.mkdir()
        case "cut":
            ledger.write_text("".join(lines[:-1]))
        case "edited":
            ledger.write_text("".join([*lines[:-1], lines[-1].replace("later", "never")]))
    if how in ("fifo", "folder"):
        for words in (["radiationSensor"], ["radiationSensor.medium", "--json"]):
            with pytest.raises(Rejected) as caught:
                run(explain, *words)
            assert [d.code for d in caught.value.diagnostics] == ["LEDGER001"]
    else:
        code, text = run(explain, "radiationSensor")
        assert (code, text.count("rover: not shown: its report is stale")) == (1, 1)
        code, text = run(explain, "radiationSensor.medium")
        assert code == 1
        assert "radiationSensor/guarantee/medium: not shown" in text
        assert not {"proved", "checked", "tested"} & set(re.findall(r"\w+", text))
        code, text = run(explain, "radiationSensor.medium", "--json")
        told = json.loads(text)
        assert (code, list(told["differences"]), told["obligations"]) == (1, ["rover"], [])
    assert run(report, "--check", "reports/rover")[0] == 1
