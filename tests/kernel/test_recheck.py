"""avow recheck: the kernel alone over certificates."""

from __future__ import annotations

import json
from pathlib import Path

from calculus.make import make
from calculus.test_commands import invoke

from avow.cli.recheck import command
from avow.kernel.certificate import to_json
from kernel.test_kernel import LOOP, PLAN, made


def test_recheck(tmp_path: Path) -> None:
    _, certificate = made(tmp_path / "system")
    kept = tmp_path / "certificates.json"
    kept.write_text(json.dumps({"requirement R": to_json(certificate)}))
    code, told = invoke(command, str(tmp_path / "system"), str(kept))
    assert code == 0
    assert "requirement R: R, on" in told
    report = tmp_path / "report.json"
    report.write_text(json.dumps({"kernel": {"certificates": {"requirement R": to_json(certificate)}}}))
    assert invoke(command, str(tmp_path / "system"), str(report)) == (code, told)
    make(tmp_path / "system", LOOP.replace("out.z == in.y + 1", "out.z == in.y + 2"), PLAN)
    code, told = invoke(command, str(tmp_path / "system"), str(kept))
    assert code == 1
    assert "stale" in told
