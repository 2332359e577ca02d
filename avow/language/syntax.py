"""The surface syntax of declarations and formulas: what the parser makes of the tokens, before any name is resolved.

One generic node, `Tree`, keeps parsing fast: `kind` says what it is (the aliases of grammar.lark), `parts` are trees,
tokens or plain strings as described per kind in `avow.language.parser`.
"""

from __future__ import annotations

from typing import Any, NamedTuple


class Tree(NamedTuple):
    """A piece of syntax with its place; `depth` is its height, so that deep nesting is known before any recursion."""

    kind: str
    parts: tuple[Any, ...]
    start: int
    end: int
    depth: int
