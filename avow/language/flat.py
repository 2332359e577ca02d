"""Tokens as text on one line, in the canonical spacing: every number and name as it was written."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.lexer import Token, tokens
from avow.language.source import Reports, Source

_OPERANDS = frozenset((
    *("NAME", "NUMBER", "UNIT", "STRING", "BUILTIN", "TRUE", "FALSE", "EMPTY_SEQUENCE"),
    *("RPAR", "RBRACE", "RSQUARE", "CLOSING"),
))  # fmt: skip
"""The tokens that end an operand."""
_APPLIED = _OPERANDS | {"FORALL", "EXISTS", "UNIQUE", "MATCHES", "SINCE"}
"""The tokens before the parenthesis of an application, or a limit's bracket."""
_OPENS = frozenset(("LPAR", "LBRACE", "LSQUARE", "OPENING", "SIGN", "DOT"))
"""The tokens that no space follows."""
_CLOSES = frozenset(("RPAR", "RBRACE", "RSQUARE", "CLOSING", "LIMIT", "COMMA", "DOT", "APPLIED"))
"""The tokens that no space precedes."""
TEXTS = {"NOT_IN": "!in", "EMPTY_SEQUENCE": "<>", "SEMICOLON": "|"}


def flat(found: Sequence[Token]) -> str:
    """The tokens of one declaration, type or formula on a line."""
    out, before = "", ""
    for kind, text in _told_apart(without_doubled(found)):
        glued = before in _OPENS or kind in _CLOSES or not before
        if before == "SIGN" and kind == "SIGN":
            glued = False  # `--` would begin a comment
        out += text if glued else f" {text}"
        before = "LPAR" if kind == "APPLIED" else kind
    return out


def flat_text(text: str) -> str:
    """As `flat`, for a piece of text that has already been read."""
    return flat(tokens(Reports(Source("", text))))


def without_doubled(found: Sequence[Token]) -> list[Token]:
    """The tokens without redundant parentheses: those that directly enclose other parentheses and are not an
    application's."""
    partners: dict[int, int] = {}
    stack: list[int] = []
    for at, token in enumerate(found):
        if token.type == "LPAR":
            stack.append(at)
        elif token.type == "RPAR" and stack:
            partners[stack.pop()] = at
    doubled: set[int] = set()
    for first, last in partners.items():
        applied = first > 0 and found[first - 1].type in _APPLIED
        if not applied and partners.get(first + 1) == last - 1:
            doubled |= {first, last}
    return [token for at, token in enumerate(found) if at not in doubled]


def _told_apart(found: Sequence[Token]) -> list[tuple[str, str]]:
    """The kind and text of each token; a sign with several uses is classified by its use: `OPENING` and `CLOSING` of a
    sequence, a `SIGN` before a number, `APPLIED` brackets of an application, the end of the `LIMIT` of `since`."""
    out: list[tuple[str, str]] = []
    open_: list[str] = []
    before = ""
    for token in found:
        kind, text = token.type, TEXTS.get(token.type, token.text)
        is_operand = before in _OPERANDS
        if kind == "NAME" and text == "x" and is_operand:
            kind = "TIMES"  # between types
        elif kind == "LT" and not is_operand:
            kind = "OPENING"
        elif kind == "GT" and open_[-1:] == ["OPENING"]:
            kind = "CLOSING"
        elif kind == "MINUS" and not is_operand:
            kind = "SIGN"
        elif kind in ("LPAR", "LSQUARE") and before in _APPLIED:
            kind = "APPLIED"
        if kind in ("LPAR", "LBRACE", "LSQUARE", "OPENING", "APPLIED"):
            open_.append("LIMIT" if before == "SINCE" else kind)
        elif kind in ("RPAR", "RBRACE", "RSQUARE", "CLOSING") and open_ and open_.pop() == "LIMIT":
            kind = "LIMIT"
        out.append((kind, text))
        before = kind
    return out
