"""Every file under artifacts/ and reports/, edited or taken away, one at a time: the next run says what a fresh one
says, and a ledger that was touched stays open until a person has seen it (AVOW_EDITS=1000 tries them all)."""

from __future__ import annotations

import json
import os
import random
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from helpers import avow

TIMES = int(os.environ.get("AVOW_EDITS", "12"))
FEW = 1
"""So many of them are not left for the night."""
RCL = """node n { inputs( x : REAL ) outputs( y : REAL ) topics() guarantee small ( out.y <= 10 )
  guarantee large ( out.y >= -10 ) }
node m { inputs( y : REAL ) outputs( z : REAL ) topics() assume low ( in.y <= 10 ) guarantee even ( out.z == in.y ) }
"""
PLAN = """system: s
connections: [{from: n.y, to: m.y}]
compose: {D: {select: [n, m]}}
requirements: {R: {text: It stays small., supported_by: [n.small, D]}}
nodes:
  n: {criticality: low, methods: [{hypothesis: {subject: 'n.py:step', cases: 20}}]}
  m: {criticality: low, methods: [{review: {record: m.yaml}}]}
"""
REVIEW = """reviewer: Ada
role: engineer
date: 2026-11-20
read: [s.rcl]
checklist: [{question: "Is it?", answer: yes}]
conclusion: accepted
"""


def flipped(path: Path) -> None:
    data = bytearray(path.read_bytes() or b" ")
    data[len(data) // 2] ^= 1
    path.write_bytes(bytes(data))


def whitewashed(path: Path) -> None:
    text = path.read_bytes()
    for old, new in (
        (b"refuted", b"tested"),
        (b'"exit_code": 1', b'"exit_code": 0'),
        (b"false", b"true"),
        (b"1", b"0"),
    ):
        text = text.replace(old, new)
    path.write_bytes(text)


def halved(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def a_line_less(path: Path) -> None:
    path.write_bytes(b"".join(path.read_bytes().splitlines(keepends=True)[:-1]))


def a_folder(path: Path) -> None:
    path.unlink()
    path.mkdir()


EDITS: dict[str, Callable[[Path], object]] = {
    "flipped": flipped,
    "whitewashed": whitewashed,
    "halved": halved,
    "a line less": a_line_less,
    "emptied": lambda path: path.write_bytes(b""),
    "taken away": lambda path: path.unlink(),
    "a folder": a_folder,
}


def said(root: Path, *options: str) -> tuple[int, dict[str, str]]:
    code = avow("verify", *options, cwd=root).returncode
    case = json.loads((root / "reports" / "s" / "report.json").read_text())
    statuses = {f"{o['obligation']['node']}/{o['obligation']['name']}": o["status"] for o in case["obligations"]}
    return code, statuses | {f"gate {gate['id']}": str(gate["passed"]) for gate in case["gates"]}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, tuple[int, dict[str, str]]]:
    """Run twice, with a refutation that was there and one that still is; and what its runs say."""
    root = tmp_path_factory.mktemp("whole") / "w"
    folder = root / "contracts" / "s"
    folder.mkdir(parents=True)
    (root / "dodo.py").write_text("")
    for name, text in (("s.rcl", RCL), ("plan.yaml", PLAN), ("m.yaml", REVIEW)):
        (folder / name).write_text(text)
    (folder / "n.py").write_text("def step(x):\n    return x\n")
    avow("review", "stamp", "contracts/s", "m", cwd=root)
    avow("verify", cwd=root)
    (folder / "n.py").write_text("def step(x):\n    return min(x, 10)\n")
    code, found = said(root)
    assert code == 1
    assert found["n/small"] == "tested"
    assert found["n/large"] == "refuted"
    assert found["gate integrity"] == "True"
    assert said(root) == said(root, "--fresh") == (code, found)
    return root, (code, found)


def every(root: Path) -> list[tuple[str, str]]:
    files = [f for place in ("artifacts", "reports") for f in sorted((root / place).rglob("*")) if f.is_file()]
    found = [(str(f.relative_to(root)), edit) for f in files for edit in EDITS if f.name != ".lock"]
    found = [(name, edit) for name, edit in found if not (name.endswith("report.json") and edit == "a folder")]
    return random.Random(0).sample(found, len(found))


def fault(root: Path, before: tuple[int, dict[str, str]], name: str, edit: str) -> str:
    """What is wrong with what runs say after an edit; empty: nothing."""
    first = said(root)
    again, fresh = said(root), said(root, "--fresh")
    told = (1, {**before[1], "gate integrity": "False"})
    if not first == again == fresh:
        return f"not alike: {first} {again} {fresh}"
    if edit == "a folder" and name.startswith("artifacts/ledger/"):
        return "passes" if first[0] == 0 else ""  # nothing can be kept there: a message, and no answer
    if edit == "a folder" and first == (2, before[1]):
        return ""  # nothing can be written there: a message
    if first not in (before, told):
        return f"another answer: {first}"
    if first == before and name == "artifacts/ledger/s.jsonl":
        return "healed in silence"
    return "" if first == before or name.startswith("artifacts/ledger/") else "told of no ledger"


@pytest.mark.parametrize(
    "at", [pytest.param(k, marks=pytest.mark.slow if k < FEW else pytest.mark.nightly) for k in range(TIMES)]
)
def test_every_edit_changes_nothing_or_is_told(
    whole: tuple[Path, tuple[int, dict[str, str]]], tmp_path: Path, at: int
) -> None:
    original, before = whole
    edits = every(original)
    if at >= len(edits):
        pytest.skip("there are no more")
    name, edit = edits[at]
    root = tmp_path / "w"
    shutil.copytree(original, root, symlinks=True)
    EDITS[edit](root / name)
    if (root / name).is_file() and (root / name).read_bytes() == (original / name).read_bytes():
        return
    assert not fault(root, before, name, edit), (name, edit)
