"""The worked example of docs/backends/onnx.md."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import avow

PAGE = Path(__file__).parents[2] / "docs" / "backends" / "onnx.md"
pytestmark = [pytest.mark.needs_perception, pytest.mark.slow]


def test_the_example(tmp_path: Path) -> None:
    blocks = dict(re.findall(r"^```(\w+)\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL))
    assert avow("init", "w", cwd=tmp_path).returncode == 0
    place = tmp_path / "w" / "contracts" / "s"
    place.mkdir()
    subprocess.run([sys.executable, "-c", blocks["python"]], cwd=place, check=True)
    (place / "system.rcl").write_text(blocks["rcl"])
    (place / "plan.yaml").write_text(blocks["yaml"])
    assert avow("check", "s", cwd=place).returncode == 0
    assert avow("verify", "s", cwd=place).returncode == 1  # what is refuted fails a gate
    for name, verdict in (("far", "proved"), ("robust", "proved"), ("always_far", "refuted")):
        assert f"{verdict} by onnx" in avow("explain", f"s/detector/guarantee/{name}", cwd=place).stdout, name
