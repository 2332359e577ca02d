"""The backend on the page works when a plan names it as a plugin."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from avow.backend_kit import registry
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.work import method_job
from avow.system.load import load_system

PAGE = Path(__file__).parent.parent.parent / "docs" / "adding-a-backend.md"


@pytest.mark.slow
def test_the_example_works_as_a_plugin(workspace: Path) -> None:
    code = re.search(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    assert code is not None
    (workspace / "coin_backend.py").write_text(code[1])
    folder = workspace / "contracts" / "toss"
    folder.mkdir()
    (folder / "system.rcl").write_text(
        "node n { inputs(a : BOOL) outputs(b : BOOL) topics() guarantee same (out.b <=> in.a) }\n"
    )
    (folder / "plan.yaml").write_text(
        "plugins: [coin_backend]\nnodes: {n: {criticality: low, methods: [{coin: {heads: true}}]}}\n"
    )
    done = subprocess.run(
        [sys.executable, "-m", "doit", "verify"],
        cwd=workspace,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": str(workspace)},
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    lines = (workspace / "artifacts" / "ledger" / "toss.jsonl").read_text().splitlines()
    verdicts = {e["obligation"]: e for e in (json.loads(line)["evidence"] for line in lines)}
    record = verdicts["toss/n/guarantee/same"]
    assert (record["verdict"], record["tool"], record["method"]) == ("tested", "coin", "coin")
    assert (workspace / "artifacts" / "toss" / "n" / "coin" / "coin.txt").is_file()
    shutil.rmtree(workspace / "artifacts")


def test_the_optional_members_are_read(workspace: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The page's codes, and its claims of what is not looked at, on the page's backend."""
    backend, codes = re.findall(r"^```python\n(.*?)^```$", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
    for stem, members in (
        ("plain", ""),
        ("full", "    codes = CODES\n    uses_scenario = False\n    uses_wiring = False\n"),
    ):
        text = codes + backend.replace('    name = "coin"\n', f'    name = "coin"\n{members}')
        (workspace / f"coin_{stem}.py").write_text(text)
    monkeypatch.syspath_prepend(str(workspace))
    folder = workspace / "contracts" / "toss"
    folder.mkdir()
    (folder / "system.rcl").write_text(
        "node n { inputs(a : NATURAL) outputs(b : BOOL) topics() guarantee same (out.b <=> in.a > 0) }\n"
    )
    seen = {}
    for stem in ("plain", "full"):
        for domain in ("0..3", "0..4"):
            scenario = f"scenario: {{domains: {{NATURAL: {domain}}}}}"
            plan = f"plugins: [coin_{stem}]\n{scenario}\nnodes: {{n: {{methods: [coin]}}}}\n"
            (folder / "plan.yaml").write_text(plan)
            system = load_system(folder)
            method = system.plan.node("n").methods[0]
            seen[stem, domain] = surroundings(
                registry.backend("coin", (f"coin_{stem}",)), method_job(system, system.contract.node("n"), method), ""
            )
    assert seen["plain", "0..3"] != seen["plain", "0..4"]
    assert seen["full", "0..3"] == seen["full", "0..4"]
    assert list(registry.backend("coin", ("coin_full",)).codes) == ["COIN101"]
    assert registry.backend("coin", ("coin_plain",)).codes == {}
