"""A time that is none is a usage error in every command that asks the solver."""

from __future__ import annotations

from pathlib import Path

import pytest
from click.testing import CliRunner

from avow.cli import compose, refines, sanity

NODE = """
node n {
  inputs ( r : REAL )
  outputs ( x : REAL )
  topics ( REAL t matches : x )
  assume ( in.r >= 0 )
  guarantee ( out.x == in.r )
}
"""


@pytest.mark.parametrize("seconds", ["nan", "inf", "-inf", "0", "-1", "1e9", "soon", ""])
@pytest.mark.parametrize("command", [compose.command, refines.command, sanity.command])
def test_no_time(tmp_path: Path, command: object, seconds: str) -> None:
    file = tmp_path / "n.rcl"
    file.write_text(NODE)
    files = [str(file)] * (2 if command is refines.command else 1)
    result = CliRunner().invoke(command, [*files, f"--seconds={seconds}"])  # type: ignore[arg-type]
    assert result.exit_code == 2
    assert "a time above 0" in result.output or "is no number" in result.output


def test_a_seed_is_what_the_solver_takes(tmp_path: Path) -> None:
    file = tmp_path / "n.rcl"
    file.write_text(NODE)
    assert CliRunner().invoke(sanity.command, [str(file), "--seed=-1"]).exit_code == 2
