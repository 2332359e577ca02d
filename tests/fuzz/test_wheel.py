"""The compiler of the extra `cpp`, where clang is not here: the plain program alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from avow.backends.fuzz import BACKEND, clang_tool
from avow.backends.fuzz.tuning import FIRST_BUILD_SECONDS
from avow.base.process import Completed
from avow.base.tools import Tool
from avow.base.verdict import Verdict
from avow.evidence.record import RETRY
from avow.isolation.outside import Outside
from fuzz.cpp_nodes import LIMITER, Cpp, adapter

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(clang_tool.zig() is None, reason="ziglang is not here (extra `cpp`)"),
]


@pytest.fixture(autouse=True)
def _without_clang(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(clang_tool, "clang", lambda: Tool("clang++", None, None, "sudo apt install clang", False))


def test_the_wheels_compiler_is_taken_where_clang_is_missing() -> None:
    assert [(tool.name, tool.present, tool.optional) for tool in BACKEND.tools()] == [
        ("zig", True, False),
        ("clang++", False, True),
    ]


def test_guarantees_are_tested_and_what_sanitizers_would_tell_is_not_run(tmp_path: Path) -> None:
    found = LIMITER.outcomes(tmp_path)
    assert found.pop("runs-without-fault").verdict is Verdict.NOT_RUN
    assert {outcome.verdict for outcome in found.values()} == {Verdict.TESTED}
    assert all("drawn, seed 0" in outcome.summary for outcome in found.values())


@pytest.mark.nightly
def test_a_wrong_program_is_refuted(tmp_path: Path) -> None:
    assert Verdict.REFUTED in LIMITER.mutant(1).verdicts(tmp_path).values()


def _overflowing(body: str) -> Cpp:
    step = f'{body} out.real("u", node.step(in.real("v")));'
    return replace(LIMITER, adapter=adapter("Limiter", 'node.vmax = given.real("vmax");', step))


@pytest.mark.nightly
def test_undefined_behaviour_ends_the_program(tmp_path: Path) -> None:
    cpp = _overflowing("volatile int big = 2147483647; volatile int more = big + 1; (void)more;")
    assert set(cpp.verdicts(tmp_path).values()) == {Verdict.REFUTED}


def test_a_clock_that_is_read_is_found(tmp_path: Path) -> None:
    cpp = _overflowing("(void)std::chrono::steady_clock::now();")
    cpp = replace(cpp, adapter=f"#include <chrono>\n{cpp.adapter}")
    found = cpp.outcomes(tmp_path)
    assert "it uses the clock" in found["same"].summary
    assert found["same"].verdict is Verdict.UNKNOWN


def test_a_build_that_does_not_end_is_tried_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its first run builds the standard library, which `seconds` do not count."""
    given: list[float] = []

    def late(*words: object, seconds: float, **more: object) -> Completed:
        given.append(seconds)
        return Completed((), None, "", "", seconds)

    monkeypatch.setattr(Outside, "run", late)
    found = LIMITER.outcomes(tmp_path)
    assert min(given) >= FIRST_BUILD_SECONDS
    assert {(o.verdict, o.details.get(RETRY)) for o in found.values()} == {(Verdict.ERROR, True)}
