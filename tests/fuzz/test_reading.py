"""What needs no compiler: declarations that do not fit, tables without code, and a machine without clang."""

from __future__ import annotations

import os
import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import pytest

from avow.backends.fuzz import BACKEND, building, clang_tool
from avow.backends.fuzz.runner import Question, Show, _ended
from avow.base.tools import Tool, find_tool
from avow.base.verdict import Verdict
from avow.isolation import judge
from fuzz.cpp_nodes import LIMITER, SCAN, WATCHDOG


def test_without_clang_it_is_not_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(building, "tools", lambda: (Tool("clang++", None, None, "sudo apt install clang"),))
    report = LIMITER.report(tmp_path)
    assert {o.verdict for o in report.outcomes} == {Verdict.NOT_RUN}
    assert len(report.outcomes) == 5, "four guarantees, and that it runs without fault"
    assert all("sudo apt install clang" in o.summary for o in report.outcomes)


def test_clang_without_libfuzzer_is_not_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The run-time libraries are a package of their own: without them clang compiles and does not link."""
    fake = tmp_path / "clang++"
    fake.write_text(f"#!/bin/sh\n[ $1 = --version ] && echo 'clang version 14.0.6' || echo {tmp_path}\n")
    fake.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:{os.environ['PATH']}")
    monkeypatch.setattr(clang_tool, "zig", lambda: None)
    find_tool.cache_clear()
    try:
        outcomes = LIMITER.report(tmp_path / "robot").outcomes
        (tmp_path / "lib" / "linux").mkdir(parents=True)
        (tmp_path / "lib" / "linux" / "libclang_rt.fuzzer-x86_64.a").touch()
        whole = BACKEND.tools()[0]
    finally:
        find_tool.cache_clear()
    assert {o.verdict for o in outcomes} == {Verdict.NOT_RUN}
    assert {o.summary for o in outcomes} == {"clang++ is here without libFuzzer: sudo apt install libclang-rt-14-dev"}
    assert (whole.version, whole.path) == ("14.0.6", str(fake))


def test_no_text_becomes_code(tmp_path: Path) -> None:
    """Whatever a parameter says: the tables are numbers, generated names, and texts escaped byte for byte."""
    odd = replace(LIMITER, params={"vmax": 1.5, 'x"; int main() {} //': '\\\n*/ ??/ \u00e9 "', "deep": {"R(": True}})
    table = BACKEND.export(odd.written(tmp_path))["contract.inc"]
    bare = re.sub(r'"(?:[A-Za-z0-9]|\\[0-3][0-7]{2})*"', '""', table)
    assert '"' not in bare.replace('""', "")
    assert "main" not in bare
    assert "vmax" not in bare
    assert table.isascii()


@pytest.mark.parametrize(
    ("cpp", "code"),
    [
        (replace(LIMITER, numbers="exact"), "FUZZ102"),
        (replace(LIMITER, options={"sources": ["src/absent.cpp"]}), "FUZZ101"),
        (replace(LIMITER, options={"include": ["../out"]}), "FUZZ101"),
        (replace(SCAN, rcl=SCAN.rcl.replace("<REAL>", "<<REAL>>").replace("in.scan(i)", "in.scan(i)(0)")), "FUZZ102"),
    ],
)
def test_what_does_not_fit_is_told_before_anything_runs(cpp: object, code: str, tmp_path: Path) -> None:
    assert {d.code for d in BACKEND.check(cpp.written(tmp_path))} == {code}  # type: ignore[attr-defined]


def test_every_file_that_is_included_is_named(tmp_path: Path) -> None:
    job = WATCHDOG.written(tmp_path)
    assert {path.name for path in BACKEND.files(job)} == {"adapter.hpp", "nodes.hpp", "params.yaml"}


def test_a_long_answer_comes_through(tmp_path: Path) -> None:
    channel = judge.Channel()
    question = Question(Show("", ()), str(tmp_path), 60)
    script = f"import os\nleft = b'x' * 1_000_000\nwhile left: left = left[os.write({channel.theirs}, left):]"
    with tempfile.TemporaryFile() as given:
        code, left, said, _ = _ended([sys.executable, "-c", script], tmp_path, question, channel, {}, given.fileno())
    assert (code, left, len(said)) == (0, False, 1_000_000)
