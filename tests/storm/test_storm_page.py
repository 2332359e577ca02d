"""The worked example of docs/backends/storm.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from helpers import avow

PAGE = Path(__file__).parents[2] / "docs" / "backends" / "storm.md"
pytestmark = [pytest.mark.needs_chance, pytest.mark.slow]


def test_the_example(tmp_path: Path) -> None:
    blocks = dict(re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL))
    assert avow("init", "w", cwd=tmp_path).returncode == 0
    place = tmp_path / "w" / "contracts" / "s"
    place.mkdir()
    for name, kind in (("node.prism", "prism"), ("system.rcl", "rcl"), ("plan.yaml", "yaml")):
        (place / name).write_text(blocks[kind])
    assert avow("check", "s", cwd=place).returncode == 0
    assert avow("verify", "s", cwd=place).returncode == 1  # what is refuted fails a gate
    for name, verdict in (("seen", "checked"), ("better", "refuted"), ("quiet", "checked")):
        assert f"{verdict} by storm" in avow("explain", f"s/detector/guarantee/{name}", cwd=place).stdout, name
