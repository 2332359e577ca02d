"""The shipped systems are what they say they are."""

from __future__ import annotations

from pathlib import Path

CONTRACTS = Path(__file__).parent.parent.parent / "contracts"


def test_the_delayed_system_is_the_published_one_to_the_byte() -> None:
    published = (CONTRACTS / "remote_inspection_published" / "system.rcl").read_bytes()
    assert (CONTRACTS / "remote_inspection_delayed" / "system.rcl").read_bytes() == published


def test_the_code_knows_no_system() -> None:
    words = ("jackal", "radiation", "waypoint", "remote_inspection", "nasa_rover")
    root = CONTRACTS.parent
    known = [
        f"{path.relative_to(root)}: {word}"
        for folder in ("avow", "backends")
        for path in (root / folder).rglob("*.py")
        if "template" not in path.parts
        for word in words
        if word in path.read_text(encoding="utf-8").lower()
    ]
    assert known == []
