"""The worked example of docs/backends/reach.md."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from helpers import avow

PAGE = Path(__file__).parents[2] / "docs" / "backends" / "reach.md"


@pytest.mark.needs_motion
@pytest.mark.slow
def test_the_example(tmp_path: Path) -> None:
    blocks = dict(re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL))
    assert avow("init", "w", cwd=tmp_path).returncode == 0
    place = tmp_path / "w" / "contracts" / "s"
    place.mkdir()
    (place / "system.rcl").write_text(blocks["rcl"])
    (place / "plan.yaml").write_text(blocks["yaml"])
    assert avow("check", "s", cwd=place).returncode == 0
    assert avow("verify", "s", cwd=place).returncode == 1  # what is refuted fails a gate
    for name, verdict in (("stops", "checked"), ("sooner", "refuted")):
        assert f"{verdict} by reach" in avow("explain", f"s/brake/guarantee/{name}", cwd=place).stdout, name
    made = [path.name for path in (tmp_path / "w" / "artifacts").rglob("enclosure.*")]
    assert sorted(made) == ["enclosure.csv", "enclosure.svg"]
