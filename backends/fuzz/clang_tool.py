"""Is Clang here, and in which version? Apart from `building`, as every run asks and few build."""

from __future__ import annotations

from avow.base.tools import Tool, find_tool


def clang() -> Tool:
    return find_tool("clang++", install="sudo apt install clang", optional=False)
