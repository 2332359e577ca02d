"""What no run of a source shows keeps a good answer from being given."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
from helpers import some

from avow.backends.fuzz.clang_tool import clang
from avow.backends.fuzz.unseen import CATCHING, UNDECLARED, Line, own, undefined, unseen
from avow.base.verdict import Verdict
from avow.isolation.tracing import traces
from fuzz.cpp_nodes import LIMITER

needs_clang = pytest.mark.skipif(not (clang().present and traces()), reason="clang++ or strace is not here")


def lines(*texts: str) -> list[Line]:
    return [Line("src/node.hpp", k, text) for k, text in enumerate(texts, 1)]


@pytest.mark.parametrize(
    "text",
    [
        'asm(".incbin \\"table.bin\\"");',
        '__asm__ volatile ("rdtsc" : "=a"(x));',
        "auto t = __rdtsc();",
        "return __builtin_ia32_rdrand64_step(&r);",
    ],
)
def test_what_comes_in_unseen_is_undeclared(text: str) -> None:
    assert unseen(lines(text), lines(text), []).undeclared.startswith("src/node.hpp:1")


@pytest.mark.parametrize(
    "text",
    [
        '__attribute__((no_sanitize("undefined"))) int f();',
        '[[clang::no_sanitize("address")]] int f();',
        "__attribute__((__no_sanitize_address__)) int f();",
        '#pragma clang attribute push(__attribute__((no_sanitize("address"))), apply_to=function)',
        'extern "C" const char* __asan_default_options();',
        'extern "C" int LLVMFuzzerInitialize(int*, char***);',
    ],
)
def test_what_changes_the_sanitizers_is_told(text: str) -> None:
    found = unseen(lines("int g();", text), lines("int g();", text), [])
    assert found.faults.startswith("src/node.hpp:2")
    assert not found.undeclared


def test_another_program_with_sanitizers_is_told() -> None:
    assert unseen(lines("int a;", "int b;"), lines("int a;", "int c;"), []).faults.startswith("src/node.hpp:2: built")
    assert unseen(lines("int a;", "int b;"), lines("int a;"), []).faults.startswith("src/node.hpp:2: built")


@pytest.mark.parametrize("name", [*UNDECLARED, *CATCHING])
def test_what_objects_ask_for_is_told(name: str) -> None:
    found = unseen([], [], [name])
    assert bool(found.undeclared) is (name in UNDECLARED)
    assert bool(found.faults) is (name in CATCHING)


def test_a_plain_source_has_nothing_unseen() -> None:
    text = lines('asm volatile("" ::: "memory");', 'say("asm(1) no_sanitize __asan_x");', "double asmx(double time);")
    assert unseen(text, text, ["timer", "my_time"]) == unseen([], [], [])


def test_names_are_read_from_objects_and_from_nothing_else(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="no ELF"):
        list(undefined(b"!<arch>\n"))
    if (compiler := shutil.which("gcc")) is None:
        pytest.skip("gcc is not here")
    (tmp_path / "a.c").write_text("extern int time(void*); int own(void) { return 1; } int f(void) { return time(0); }")
    subprocess.run([compiler, "-ffunction-sections", "-c", "a.c"], cwd=tmp_path, check=True)
    names = set(undefined((tmp_path / "a.o").read_bytes()))
    assert "time" in names
    assert not names & {"own", "f", "a.c"}


def test_lines_of_the_system_and_generated_ones_are_left_out(tmp_path: Path) -> None:
    (tmp_path / "node.hpp").write_text("")
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "link.hpp").symlink_to(tmp_path / "node.hpp")
    text = f'# 1 "{tmp_path}/made/replay.cpp"\nint r;\n# 9 "/usr/include/x.h" 1 3 4\nint s;\n'
    text += f'# 4 "{tmp_path}/made/link.hpp" 2\nint n;\n\nint m;\n# 2 "<built-in>" 1\nint z;\n'
    found = list(own(text, tmp_path / "made", tmp_path / "node.hpp"))
    assert [(line.number, line.text) for line in found] == [(4, "int n;"), (6, "int m;")]


SAN = "#if defined(__has_feature)\n#if __has_feature(address_sanitizer)\n#define M 0\n#endif\n#endif\n"
UNSEEN = {
    "clock": ("#include <chrono>\n", "if (std::chrono::steady_clock::now().time_since_epoch().count() == 1) return;"),
    "chance": ("#include <random>\n", "std::random_device r; if (r() == 1) return;"),
    "signal": ("#include <csignal>\n", "std::signal(SIGSEGV, SIG_IGN);"),
    "macro": (SAN + "#ifndef M\n#define M 0\n#define MORE ;\n#else\n#define MORE\n#endif\n", "MORE"),
    "unset": ("", 'int z; if (in.real("v") < 1) z = 1; if (z != 1) throw 1;'),
}


@pytest.mark.slow
@needs_clang
@pytest.mark.parametrize("name", some(UNSEEN, 1))
def test_no_good_answer(name: str, tmp_path: Path) -> None:
    head, body = UNSEEN[name]
    adapter = head + LIMITER.adapter.replace("{ out.real", f"{{ {body} out.real")
    adapter = adapter.replace("#define M 0\n#include", "#include") if name == "macro" else adapter
    found = replace(LIMITER, adapter=adapter).outcomes(tmp_path)
    assert not found["runs-without-fault"].verdict.supports, {k: o.summary for k, o in found.items()}
    others = {o.verdict for k, o in found.items() if k != "runs-without-fault"}
    assert others == {Verdict.TESTED if name in ("signal", "macro") else Verdict.UNKNOWN}


@pytest.mark.nightly
@needs_clang
def test_the_other_zero_is_a_number(tmp_path: Path) -> None:
    adapter = "#include <cmath>\n" + LIMITER.adapter.replace(
        "{ out.real", '{ double v = in.real("v"); if (v == 0 && std::signbit(v)) return out.real("u", 99); out.real'
    )
    found = replace(LIMITER, adapter=adapter).outcomes(tmp_path)["bounded"]
    assert found.verdict is Verdict.REFUTED
    assert "in.v is -0.0" in found.summary
