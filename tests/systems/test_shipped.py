"""The shipped systems are what they say they are."""

from __future__ import annotations

import re
from fnmatch import fnmatchcase
from pathlib import Path

from avow.pipeline.plan_check import diagnostics
from avow.system.load import load_system

ROOT = Path(__file__).parent.parent.parent
CONTRACTS = ROOT / "contracts"


def test_the_delayed_system_is_the_published_one_to_the_byte() -> None:
    published = (CONTRACTS / "remote_inspection_published" / "system.rcl").read_bytes()
    assert (CONTRACTS / "remote_inspection_delayed" / "system.rcl").read_bytes() == published


def test_the_code_knows_no_system() -> None:
    words = ("jackal", "radiation", "waypoint", "remote_inspection", "nasa_rover", "delivery_robot")
    known = [
        f"{path.relative_to(ROOT)}: {word}"
        for folder in ("avow", "backends")
        for path in (ROOT / folder).rglob("*.py")
        if "template" not in path.relative_to(ROOT).parts
        for word in words
        if word in path.read_text(encoding="utf-8").lower()
    ]
    assert known == []


def test_what_the_case_study_page_says_is_told_is_told() -> None:
    """docs/case-study.md names what tells each error: a remark of `avow check`, or a finding that the plan expects."""
    rows = re.findall(r"^\| (.+) \| (`.+`) \|$", (ROOT / "docs" / "case-study.md").read_text(), re.MULTILINE)
    named = {name for _, told in rows for name in re.findall(r"`([^`]+)`", told)}
    system = load_system(CONTRACTS / "remote_inspection_published")
    remarks = {d.code for d in diagnostics(system)}
    expected = [f.obligation for f in system.plan.expected or ()]
    assert len(rows) > 15
    for name in named:
        if "/" in name:
            assert any(fnmatchcase(name, pattern) for pattern in expected), name
        else:
            assert name in remarks, name
    findings = {name for name in named if "/" in name}
    unnamed = [p for p in expected if not any(fnmatchcase(name, p) for name in findings)]
    assert unnamed == ["radiationSensor/sanity/constrained-inspected"]  # the page has one of the two
