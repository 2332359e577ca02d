"""What is kept of templates is code: it is used only as it was kept."""

from __future__ import annotations

import marshal
import subprocess
import sys
from pathlib import Path

import pytest

from avow.base.notes import sealed, unsealed
from avow.report.page import environment


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of one compiled template."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    environment.cache_clear()
    environment().get_template("systems.html.j2")
    (found,) = (tmp_path / "avow" / "templates").glob("*/*")
    environment.cache_clear()
    return found


def test_what_was_compiled_is_used_again(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("jinja2.Environment.compile", None)  # as if there were no compiler
    environment().get_template("systems.html.j2")
    environment.cache_clear()


@pytest.mark.parametrize("where", ["seal", "head", "code", "all", "elsewhere"])
def test_an_edited_one_is_made_again(kept: Path, where: str, capsys: pytest.CaptureFixture[str]) -> None:
    good = kept.read_bytes()
    evil = marshal.dumps(compile("print('run')", "evil", "exec"))
    if where == "elsewhere":
        content = sealed(kept.with_name("other"), good[32:])
    else:
        at = {"seal": 0, "head": 33, "code": len(good) - 20, "all": 0}[where]
        content = evil if where == "all" else good[:at] + bytes([good[at] ^ 1]) + good[at + 1 :]
    kept.write_bytes(content)
    assert unsealed(kept) is None
    environment().get_template("systems.html.j2")
    environment.cache_clear()
    assert kept.read_bytes() == good
    assert "run" not in capsys.readouterr().out


def test_a_run_imports_no_engine_to_ask_which_tools_there_are() -> None:
    program = """
import sys
from avow.backend_kit.registry import backend, names
for name in names():
    backend(name).tools()
print(*({"jsonschema", "lark", "z3", "jinja2", "hypothesis"} & sys.modules.keys()))
"""
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
