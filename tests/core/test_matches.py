"""A `match` that leaves a case out says so: `case _` refuses, is impossible by type, or has the reason beside it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

from helpers import nodes, parsed

ROOT = Path(__file__).parents[2]


def files() -> list[Path]:
    return sorted(p for room in ("avow", "backends") for p in (ROOT / room).rglob("*.py") if "template" not in p.parts)


def silent(source: str) -> Iterator[int]:
    """The lines of those that swallow whatever they were not written for."""
    lines = source.splitlines()
    for node in nodes(parsed(source)):
        if not isinstance(node, ast.Match):
            continue
        for case in node.cases:
            pattern = case.pattern
            if (
                not (isinstance(pattern, ast.MatchAs) and pattern.pattern is None and pattern.name is None)
                or case.guard
            ):
                continue
            first = case.body[0]
            called = first.value.func if isinstance(first, ast.Expr) and isinstance(first.value, ast.Call) else None
            never = isinstance(called, ast.Name) and called.id == "assert_never"
            if not (never or isinstance(first, ast.Raise) or "#" in lines[pattern.lineno - 1]):
                yield pattern.lineno


def test_what_a_match_leaves_out_has_a_reason() -> None:
    texts = {path: path.read_text("utf-8") for path in files()}
    found = [f"{path}:{line}" for path, text in texts.items() if "case _" in text for line in silent(text)]
    assert not found, "assert_never, an exception, or a comment with the reason"


def test_a_silent_one_is_found() -> None:
    text = "match x:\n    case 1:\n        pass\n    case _:\n        y = 2\n"
    assert list(silent(text)) == [4]
    assert not list(silent(text.replace("case _:", "case _:  # because")))
    assert not list(silent(text.replace("y = 2", "assert_never(x)")))
