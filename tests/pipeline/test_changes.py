"""What `avow diff signed` and the report say of a real workspace after an edit, and after none."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from helpers import avow, edit, some

from avow.assurance.codec import read_case

FILES = {
    "dodo.py": "",
    "contracts/s/models/n.py": 'def step(x):\n    return {"y": min(x, 1)}\n',
    "contracts/s/models/k.py": """class K:
    def __init__(self, given: dict[str, float]) -> None:
        self.most = given["most"]

    def step(self, z: float) -> dict[str, object]:
        return {"k": min(z, self.most)}
""",
    "contracts/s/k.yaml": "# the limit\nmost: 1.0\n",
    "contracts/s/models/m.py": 'def step(y):\n    return {"z": y}\n',
    "contracts/s/n.rcl": """context { Top = 1; }
node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee g ( out.y <= Top ) }
node k { inputs( z : REAL ) outputs( k : REAL ) topics() guarantee i ( out.k <= 2 ) }
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
  Q: {text: "It is lower.", supported_by: [m.h]}
compose:
  D: {select: [n, m], persistence: {because: latched}, one_output: {because: it is so}}
nodes:
  n: {criticality: medium, methods: [{hypothesis: {subject: "models/n.py:step", cases: 40}}]}
  m: {criticality: medium, methods: [{hypothesis: {subject: "models/m.py:step", cases: 40}}]}
  k: {source: {python: models/k.py, class: K, parameters: k.yaml}, methods: [{hypothesis: {cases: 40}}]}
""",
}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("made")
    for name, text in FILES.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text)
    for name in "RQ":
        avow("validate", "s", name, "--as", "A. Person", cwd=root)
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


EDITS = [
    ("plan.yaml", "cases: 20", "cases: 1", "▼ policy, guarantees.medium.cases: 20 → 1", 1),
    ("plan.yaml", "[tested]", "[tested, justified]", "▼ policy, guarantees.medium.one_of: also justified", 1),
    ("plan.yaml", "cases: 40}}]}\n  m", "cases: 30}}]}\n  m", "▼ n.g by hypothesis: tested (model), 40 judged", 1),
    ("plan.yaml", "n: {criticality: medium", "n: {criticality: low", "▼ node n, criticality: medium → low", 1),
    ("plan.yaml", "nodes:", "# why\nnodes:", "≠ contracts/s/plan.yaml:12: (nothing) → # why", 0),
    ("models/n.py", "min(x, 1)", "min(1, x)", "≠ contracts/s/models/n.py changed: 1 claim re-run, same verdict", 0),
    ("k.yaml", "most: 1.0", "most: 1.5", "≠ contracts/s/k.yaml:2: most: 1.0 → most: 1.5", 0),
    ("n.rcl", "Top = 1", "Top = 2", "≠ contracts/s/n.rcl:1: context { Top = 1; } → context { Top = 2; }", 1),
    ("hazards.yaml", "severity: critical", "severity: marginal", "▼ hazard H1, severity: critical → marginal", 1),
    ("hazards.yaml", "[R, n.g]", "[R]", "▼ hazard H1, mitigated by: without n.g", 1),
]


@pytest.mark.parametrize(("name", "old", "new", "line", "code"), some(EDITS, 1, len(EDITS) - 1))
def test_an_edit_has_a_line_and_ends_the_signature(
    signed: Path, name: str, old: str, new: str, line: str, code: int
) -> None:
    """The same lines in the report and on the terminal, though most leave every verdict and gate as before."""
    edit(signed / "contracts/s" / name, (old, new))
    avow("verify", cwd=signed)
    done = avow("diff", "signed", cwd=signed)
    assert done.returncode == code, done.stdout
    assert any(told.startswith(f"  {line}") for told in done.stdout.splitlines()), done.stdout
    found = read_case(signed / "reports/s")
    assert [entry.words for entry in found.changes.entries if entry.words not in done.stdout] == []
    assert any(line[2:] in entry.words for entry in found.changes.entries)
    assert found.answers.signed.startswith("not signed: A. Person signed another state on ")
    assert found.answers.signed in avow("report", "--check", "s", cwd=signed).stdout


def test_a_sentence_that_changed_takes_no_owner_from_another(signed: Path) -> None:
    edit(signed / "contracts/s/plan.yaml", ("It is lower.", "It is the lowest."))
    avow("verify", cwd=signed)
    found = {a.key: a.who for a in read_case(signed / "reports/s").assumptions if a.key.endswith(".validation")}
    assert found == {"requirements.Q.validation": "", "requirements.R.validation": "A. Person"}


def test_a_plan_that_cannot_be_read_is_no_removal(signed: Path) -> None:
    with (signed / "contracts/s/plan.yaml").open("a") as plan:
        plan.write("x: [")
    done = avow("diff", "signed", cwd=signed)
    assert (done.returncode, done.stdout, "plan.yaml" in done.stderr) == (2, "", True)


def test_a_report_is_held_against_the_signature_that_it_names(signed: Path) -> None:
    assert avow("report", "s", cwd=signed).returncode == 0
    done = avow("report", "--check", "s", cwd=signed)
    assert (done.returncode, done.stdout.count("· signed by A. Person on ")) == (0, 1)
    (path,) = (signed / "signed/s").glob("*.json")
    path.rename(path.with_name("0002-other.json"))
    done = avow("report", "--check", "s", cwd=signed)
    assert (done.returncode, "signature of A. Person that is not" in done.stdout) == (1, True)
