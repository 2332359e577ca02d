"""Damaged plans are systems or located diagnostics."""

from __future__ import annotations

import functools
import re
import shutil
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from avow.base.codec import to_json
from avow.base.diagnostics import Rejected
from avow.base.rendering import render, to_sarif, told
from avow.language import load as language_load
from avow.system.load import load_system

ROOT = Path(__file__).parents[2]
PLANS = {plan.parent.name: plan.read_text("utf-8") for plan in sorted(ROOT.glob("contracts/*/plan.yaml"))}
TOKEN = re.compile(r"[A-Za-z_][\w.'-]*|\d+(?:\.\d+)?|\s+|.", re.DOTALL)
WORDS = st.sampled_from((
    *("~", "null", "true", "no", "0", "-1", "1e999", "9" * 400, "1.5", '""', "[]", "{}", "[[]]", "{a: b}", "é∀", "'"),
    *("&a 1", "*a", "!!python/object:os.system x", "<<: {a: 1}", "? ", "- ", ": ", "|", ">", "---", "...", "#", "%TAG"),
    *("\t", "\n", "  ", "\r\n", "\x00", "\x1b[31m", "\ufeff", "\u202e", "../..", "/etc/passwd", "in.r", "agent", '"'),
    *("[" * 300, "{a: " * 200, "(" * 4000, "not " * 4000, "a" * 70_000, "medium", "forall(x in REAL | x > 0)"),
))  # fmt: skip


@st.composite
def damaged(draw: st.DrawFn) -> tuple[str, str]:
    """A shipped system, and its plan with a few tokens or lines replaced, left out, inserted, moved or doubled."""
    name = draw(st.sampled_from(sorted(PLANS)))
    parts = TOKEN.findall(PLANS[name])
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, max(len(parts) - 1, 0)))
        match draw(st.sampled_from(("replace", "other", "drop", "insert", "double", "line", "cut"))):
            case "replace":
                parts[at : at + 1] = [draw(WORDS)]
            case "other":
                parts[at : at + 1] = [parts[draw(st.integers(0, max(len(parts) - 1, 0)))]] if parts else []
            case "drop":
                del parts[at : at + draw(st.integers(1, 20))]
            case "insert":
                parts.insert(at, draw(WORDS))
            case "double":
                parts[at:at] = parts[at : at + 30]
            case "line":
                lines = "".join(parts).split("\n")
                line = lines.pop(draw(st.integers(0, len(lines) - 1)))
                lines.insert(draw(st.integers(0, len(lines))), " " * draw(st.integers(0, 4)) + line)
                parts = TOKEN.findall("\n".join(lines))
            case _:
                parts = parts[: max(at, 1)]
    return name, "".join(parts)


_load = language_load.load_contract


@functools.cache
def _contract(paths: tuple[Path, ...]):  # type: ignore[no-untyped-def]
    return _load(paths)


@pytest.mark.slow
@pytest.mark.parametrize("examples", [40, pytest.param(2000, marks=pytest.mark.nightly)])
def test_damaged_plans(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, examples: int) -> None:
    # the contracts stay as they are, and reading them takes most of the time
    monkeypatch.setattr(language_load, "load_contract", lambda paths, shelf=None: _contract(tuple(paths)))
    for name in PLANS:
        shutil.copytree(ROOT / "contracts" / name, tmp_path / name, ignore=shutil.ignore_patterns("traces", "*.bag"))

    def examine(case: tuple[str, str]) -> None:
        path, text = tmp_path / case[0] / "plan.yaml", case[1]
        path.write_bytes(text.encode("utf-8", "surrogatepass"))
        try:
            load_system(path.parent)
            return
        except Rejected as rejected:
            found = rejected.diagnostics
        assert any(d.is_error for d in found)
        shown = render(found, {str(path): text})
        assert not any(c in shown for c in "\x00\x1b\u202e")
        to_json(told(found)), to_sarif(found)
        lines = re.split(r"\r\n|[\n\r\x85\u2028\u2029]", text)
        for diagnostic in found:
            span = diagnostic.span
            assert diagnostic.message
            if span is not None and span.file == str(path):
                assert 1 <= span.line <= len(lines) + 1, diagnostic
                assert span.column >= 1, diagnostic
                assert (span.line, span.column) <= (span.end_line, span.end_column), diagnostic

    unhurried = settings(max_examples=examples, deadline=None, suppress_health_check=list(HealthCheck))
    unhurried(given(damaged())(examine))()
