"""Finds the compiler, with libFuzzer or without. Separate from `building`, as every run needs it and few build."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from functools import partial
from pathlib import Path

from avow.base.tools import Tool, find_tool, package_version, tried

_TARGET = """#include <cstddef>
extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, std::size_t) { return 0; }
"""


def tools() -> tuple[Tool, ...]:
    """Clang; if it is not installed, the compiler of the extra `cpp` first, which has neither the address sanitizer nor
    libFuzzer."""
    found, wheel = clang(), None if clang().present else zig()
    return (found,) if wheel is None else (wheel, replace(found, optional=True))


def fuzzes(tool: Tool) -> bool:
    """Whether a compiler links libFuzzer."""
    return tool.name == "clang++"


def zig() -> Tool | None:
    """The C++ compiler of the wheel `ziglang`, if that is installed."""
    spec = importlib.util.find_spec("ziglang")
    if spec is None or not spec.submodule_search_locations:
        return None
    path = Path(spec.submodule_search_locations[0], "zig")
    compiled = partial(
        tried, [(str(path), "c++", "-c", "target.cpp")], "target.cpp", _TARGET, ""
    )  # linking takes minutes
    install = "pip install 'avow[cpp]'"
    return Tool("zig", package_version("ziglang"), str(path), install, optional=False, trial=compiled)


def clang() -> Tool:
    """Also missing if its run-time libraries are: they are separate packages, and nothing links without them."""
    found = find_tool("clang++", install="sudo apt install clang", optional=False)
    if not found.present:
        return found
    resources = find_tool("clang++", ("-print-resource-dir",), install="", pattern=r"/.+").version or ""
    if not any(Path(resources).glob("lib/*/libclang_rt.fuzzer*.a")):
        version = (found.version or "").partition(".")[0]
        return replace(found, version=None, install=f"sudo apt install libclang-rt-{version}-dev")
    return replace(found, trial=_trial)


def _trial() -> str:
    """Links and runs a fuzz target."""
    build = ("clang++", "-fsanitize=fuzzer,address,undefined", "target.cpp", "-o", "target")
    return tried([build, ("./target", "-runs=10")], "target.cpp", _TARGET, "DONE")
