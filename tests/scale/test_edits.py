"""What one edit costs, and what doit's own commands do, through the real command line."""

from __future__ import annotations

import os
import random
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import edit

from avow.evidence.ledger import Ledger
from avow.pipeline.report_check import check

from .made import programs

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("edits")
    programs(root / "contracts" / "made", 3, 3)
    shutil.copy(ROOT / "dodo.py", root)
    assert "stages run" in doit(root, "verify")
    return root


def doit(root: Path, *words: str, code: int | None = None) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "doit", *words],
        cwd=root,
        capture_output=True,
        text=True,
        timeout=200,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert "Traceback" not in done.stdout + done.stderr
    assert code is None or done.returncode == code, done.stdout + done.stderr
    return done.stdout + done.stderr


def stages(text: str) -> list[str]:
    return sorted(re.findall(r"^  (export|sanity|discharge|compose)\s", text, re.MULTILINE))


def test_one_edited_clause_is_one_export_one_sanity_and_one_method(place: Path) -> None:
    contract = place / "contracts" / "made" / "system.rcl"
    before = contract.read_text()
    contract.write_text(before.replace("in.x1 > 1 ->", "in.x1 > 0 ->"))
    assert stages(doit(place, "verify")) == ["discharge", "export", "sanity"]
    contract.write_text("// a comment, which moves every line\n\n" + contract.read_text())
    assert stages(doit(place, "verify")) == []
    assert "nothing to do" in doit(place, "verify")


def test_what_is_kept_of_a_report_changes_no_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """After each edit every file is what a render without a cache makes of the case; some files name no run."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    place = tmp_path / "workspace"
    programs(place / "contracts" / "made", 3, 3)
    shutil.copy(ROOT / "dodo.py", place)
    contract, plan = (place / "contracts" / "made" / name for name in ("system.rcl", "plan.yaml"))
    report, rng = place / "reports" / "made", random.Random(29)
    edits = {
        contract: [
            ("in.x1 > 1 ->", "in.x1 > 2 ->"),
            ("node n2", "// moved\nnode n2"),
            ("in.x0 > 0 ->", "in.x0 > -1 ->"),
        ],
        plan: [("n0: {criticality: high", "n0: {criticality: low"), ("system: made", "title: Another\nsystem: made")],
    }
    for path, old, new in rng.sample([(path, *pair) for path, pairs in edits.items() for pair in pairs], 5):
        edit(path, (old, new))
        doit(place, "verify")
        assert check(report, Ledger(place / "artifacts" / "ledger" / "made.jsonl"), place) == ()
        pages = [*report.glob("node-*.html"), report / "system.html", report / "contracts.html"]
        pages += (place / "artifacts" / "made").glob("*/index.md")
        kept = {page: page.read_bytes() for page in pages}
        shutil.rmtree(tmp_path / "avow" / "parts")
        shutil.rmtree(report)
        for page in (place / "artifacts" / "made").glob("*/index.md"):
            page.unlink()
        doit(place, "report")
        assert kept == {page: page.read_bytes() for page in pages}, new
        if rng.random() < 0.5:
            shutil.rmtree(tmp_path / "avow")


def test_always_is_fresh(place: Path) -> None:
    ledger = Ledger(place / "artifacts" / "ledger" / "made.jsonl")
    before = len(ledger.records())
    assert "sanity" in stages(doit(place, "-a", "sanity:made:n0"))
    assert len(Ledger(ledger.path).records()) > before


def test_clean_removes_what_is_made_again_and_no_evidence(place: Path) -> None:
    doit(place, "verify")
    ledger = (place / "artifacts" / "ledger" / "made.jsonl").read_bytes()
    made = place / "artifacts" / "made" / "n0" / "hoare"
    assert list(made.glob("*.smt2"))
    doit(place, "clean", "-n", "verify:made", "export:made:n0:hoare", code=0)
    assert list(made.glob("*.smt2"))
    doit(place, "clean", "verify:made", "export:made:n0:hoare", "sanity:made:n0", code=0)
    assert not list(made.glob("*.smt2"))
    assert not (place / "reports" / "made").exists()
    assert (place / "artifacts" / "ledger" / "made.jsonl").read_bytes() == ledger
    assert stages(doit(place, "verify")) == ["export"]
    assert (place / "reports" / "made" / "index.html").is_file()


@pytest.mark.parametrize("verb", ["forget", "ignore"])
def test_what_is_about_doits_memory_says_why_not(place: Path, verb: str) -> None:
    assert "avow verify --fresh" in doit(place, verb, code=2)


def test_no_process_at_all_is_not_nothing_to_do(place: Path) -> None:
    assert "not all of it was run" in doit(place, "-n", "-3", "verify", code=2)
