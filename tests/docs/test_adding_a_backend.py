"""The backend on the page works when a plan names it as a plugin."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

PAGE = Path(__file__).parent.parent.parent / "docs" / "adding-a-backend.md"


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
