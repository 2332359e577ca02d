"""The exit code and the page come from the ledger: what is kept to save time can be edited, and changes nothing."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

RCL = "node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee small (out.y <= 10) }\n"
PLAN = "system: s\nnodes: {n: {methods: [{hypothesis: {subject: 'm.py:step', cases: 30}}]}}\n"
WRONG = "def step(x):\n    return x\n"


def verify(root: Path) -> tuple[int, str]:
    done = subprocess.run(
        [sys.executable, "-m", "avow", "verify"], cwd=root, capture_output=True, text=True, timeout=120, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture(scope="module")
def refuted(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("refuted")
    (root / "contracts" / "s").mkdir(parents=True)
    (root / "dodo.py").write_text("")
    (root / "contracts" / "s" / "s.rcl").write_text(RCL)
    (root / "contracts" / "s" / "plan.yaml").write_text(PLAN)
    (root / "contracts" / "s" / "m.py").write_text(WRONG)
    code, text = verify(root)
    assert code == 1, text
    code, text = verify(root)
    assert code == 1
    assert "nothing to do" in text, text
    return root


@pytest.mark.nightly
def test_no_edit_of_what_is_kept_changes_the_verdict(refuted: Path) -> None:
    edited = 0
    files = [f for f in (*refuted.glob("artifacts/**/*"), *refuted.glob("reports/**/*")) if f.is_file()]
    for file in files:
        if file.parent.name == "ledger":
            continue
        before = file.stat()
        old = file.read_bytes()
        new = old.replace(b'"exit_code": 1', b'"exit_code": 0').replace(b"refuted", b"proved ")
        new = new.replace(b'\\"exit_code\\": 1', b'\\"exit_code\\": 0').replace(b"false", b"true ")
        if new != old:
            file.write_bytes(new)
            os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))
            edited += 1
    assert edited >= 3
    with (refuted / "reports" / "index.html").open("a") as page:
        page.write("<!-- edited by hand -->")
    code, text = verify(refuted)
    assert code == 1, text
    report = json.loads((refuted / "reports" / "s" / "report.json").read_text())
    assert report["exit_code"] == 1
    assert "refuted" in (refuted / "reports" / "s" / "index.html").read_text()
    assert "edited by hand" not in (refuted / "reports" / "index.html").read_text()


@pytest.mark.nightly
def test_a_note_of_a_good_run_does_not_fit_a_bad_one(refuted: Path) -> None:
    """A run that ends well, its notes kept; then the wrong program again, with these notes."""
    subject = refuted / "contracts" / "s" / "m.py"
    subject.write_text("def step(x):\n    return min(x, 10)\n")
    code, text = verify(refuted)
    kept = {f: f.read_bytes() for f in refuted.glob("artifacts/**/.*") if f.is_file()}
    kept |= {f: f.read_bytes() for f in refuted.glob("artifacts/*/report.json")}
    good = json.loads((refuted / "reports" / "s" / "report.json").read_text())
    assert "tested" in {o["status"] for o in good["obligations"]}, text
    subject.write_text(WRONG)
    for file, data in kept.items():
        file.write_bytes(data)
    code, text = verify(refuted)
    assert code == 1, text
