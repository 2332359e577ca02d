"""What `avow diff signed` and the report say of a real workspace after an edit, and after none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from helpers import avow

FILES = {
    "dodo.py": "",
    "contracts/s/models/n.py": 'def step(x):\n    return {"y": min(x, 1)}\n',
    "contracts/s/models/m.py": 'def step(y):\n    return {"z": y}\n',
    "contracts/s/n.rcl": """context { Top = 1; }
node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= Top ) }
node m { inputs( y : REAL ) outputs( z : REAL ) topics() guarantee h ( out.z <= in.y ) }
""",
    "contracts/s/hazards.yaml": """H1:
  text: It is hot
  severity: critical
  mitigated_by: [R, n.g]
""",
    "contracts/s/plan.yaml": """system: s
hazards: hazards.yaml
connections: [{from: n.y, to: m.y}]
policy:
  guarantees:
    medium: {one_of: [tested], cases: 20}
requirements:
  R: {text: "It is low.", supported_by: [D]}
compose:
  D: {select: [n, m], persistence: {because: latched}, one_output: {because: it is so}}
nodes:
  n: {criticality: medium, methods: [{hypothesis: {subject: "models/n.py:step", cases: 40}}]}
  m: {criticality: medium, methods: [{hypothesis: {subject: "models/m.py:step", cases: 40}}]}
""",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("made")
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    avow("validate", "s", "R", "--as", "A. Person", cwd=root)
    assert avow("verify", cwd=root).returncode == 0
    done = avow("sign", "--report", "s", "--as", "A. Person", "--until", "2999-01-01", cwd=root)
    assert done.returncode == 0, done.stderr
    return root


@pytest.fixture
def signed(made: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(made, tmp_path / "w"))


def test_nothing_changed_after_signing(signed: Path) -> None:
    """Also of a requirement that a derivation supports: the derivations are not in the ledger."""
    for old in ("signed", "reports/s"):
        done = avow("diff", old, cwd=signed)
        assert (done.returncode, done.stdout) == (0, "nothing changed\n")
