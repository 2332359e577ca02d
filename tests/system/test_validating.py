"""`avow validate` writes a validation into plan.yaml, whatever style the entry has, and nothing else changes."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.cli import main
from avow.system.load import load_system

RCL = "node a { inputs( r : REAL ) outputs( x : REAL ) topics() guarantee g ( out.x <= 5 ) }\n"
STYLES = {
    "block": "requirements:\n  R:\n    text: It is low.  # said so\n    formula: a.x <= 5\n\n# the end\n",
    "block, at the end": "requirements:\n  R:\n    text: >-\n      It is\n      low.\n    formula: a.x <= 5",
    "flow": 'requirements: {R: {text: It is low., formula: "a.x <= 5"}}\n',
    "validated before": "requirements:\n  R:\n    text: It is low.\n    formula: a.x <= 5\n"
    "    validation:\n      because: it is so\n      who: B. Person\n      date: 2020-01-01\n",
    "validated before, flow": 'requirements: {R: {text: Low., formula: "a.x <= 5", '
    "validation: {who: B. P., date: 2020-01-01}}}\n",
}  # fmt: skip


def cli(*words: str | Path) -> int:
    with pytest.raises(SystemExit) as ended:
        main(list(map(str, words)))
    return int(ended.value.code or 0)


@pytest.mark.parametrize("style", STYLES)
def test_a_validation_is_written_and_counts(tmp_path: Path, style: str, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "system.rcl").write_text(RCL)
    plan = tmp_path / "plan.yaml"
    plan.write_text(STYLES[style])
    assert not load_system(tmp_path).plan.requirements[0].validated
    assert cli("validate", tmp_path) == 0
    assert "formula: a.x <= 5" in capsys.readouterr().out
    assert cli("validate", tmp_path, "R", "--as", "A. Person") == 0
    found = load_system(tmp_path).plan
    assert found.requirements[0].validated
    assert found.requirements[0].validation is not None
    assert found.requirements[0].validation.who == "A. Person"
    assert ("because" in STYLES[style]) == any(s.because == "it is so" for s in found.statements)
    kept = [line for line in STYLES[style].splitlines() if line.strip().startswith(("#", "text", "policy"))]
    assert set(kept) <= set(plan.read_text().splitlines()) or "flow" in style
    again = plan.read_text()
    assert cli("validate", tmp_path, "R", "--as", "A. Person") == 0
    assert plan.read_text() == again
    plan.write_text(again.replace("<= 5", "<= 7"))
    assert load_system(tmp_path).plan.requirements[0].outdated


def test_a_requirement_on_a_system_that_is_taken_in_is_validated(tmp_path: Path) -> None:
    for name, text in (("inner", "{}\n"), ("outer", STYLES["flow"] + "subsystems: {left: {system: ../inner}}\n")):
        (tmp_path / name).mkdir()
        (tmp_path / name / "system.rcl").write_text(RCL)
        (tmp_path / name / "plan.yaml").write_text(text)
    assert cli("validate", tmp_path / "outer", "R", "--as", "A. Person") == 0
    assert load_system(tmp_path / "outer").plan.requirements[0].validated


@pytest.mark.parametrize(("more", "code"), [(["Q", "--as", "A. B."], "CLI022"), (["R", "--as", "?"], "SIGN005")])
def test_nobody_validates_what_is_not_there(
    tmp_path: Path, more: list[str], code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "system.rcl").write_text(RCL)
    (tmp_path / "plan.yaml").write_text(STYLES["flow"])
    assert cli("validate", tmp_path, *more) == 2
    assert code in capsys.readouterr().err


GRAPH = """context { Most = 5; Level : {low, high}; }
node a { inputs() outputs( x : REAL ) topics() guarantee low ( out.x <= Most ) }
node c { inputs() outputs( x : REAL ) topics() guarantee any ( out.x <= 9 ) }
node b { inputs( r : REAL, level : Level ) outputs( x : REAL ) topics()
  assume small "The reading is small" ( in.r <= 5 ) guarantee g ( out.x <= in.r ) }
"""
PLAN = """connections: [{from: a.x, to: b.r}]
requirements: {R: {text: It is low., %s}}
"""


@pytest.mark.parametrize("what", ["supported_by: [b.g]", "formula: b.x <= Most"])
@pytest.mark.parametrize(
    ("edit", "counts"),
    [
        (("in.r <= 5 )", "in.r <= 4 )"), {"supported_by: [b.g]"}),
        (("The reading is small", "The reading is big"), {"supported_by: [b.g]"}),
        (("from: a.x", "from: c.x"), {"supported_by: [b.g]", "formula: b.x <= Most"}),
        (("Most = 5", "Most = 6"), {"formula: b.x <= Most"}),
        (("outputs( x : REAL ) topics()\n  assume", "outputs( x : INTEGER ) topics()\n  assume"),
         {"supported_by: [b.g]", "formula: b.x <= Most"}),
        (("outputs( x : REAL ) topics()\n  assume", "outputs( x : REAL in m ) topics()\n  assume"),
         {"supported_by: [b.g]", "formula: b.x <= Most"}),
        (("low, high}", "low, high, top}"), {"supported_by: [b.g]", "formula: b.x <= Most"}),
        (("guarantee any ( out.x <= 9 )", "guarantee any ( out.x <= 8 )"), set()),
        (("node c", "// another node\nnode c"), set()),
    ],
)  # fmt: skip
def test_an_edit_of_what_the_sentence_rests_on_ends_the_validation(
    tmp_path: Path, what: str, edit: tuple[str, str], counts: set[str]
) -> None:
    contract, plan = tmp_path / "system.rcl", tmp_path / "plan.yaml"
    contract.write_text(GRAPH)
    plan.write_text(PLAN % what)
    assert cli("validate", tmp_path, "R", "--as", "A. Person") == 0
    for path in (contract, plan):
        path.write_text(path.read_text().replace(*edit))
    assert load_system(tmp_path).plan.requirements[0].outdated is (what in counts)
