"""What to say where the parser met a token that cannot stand there."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.lexer import SYMBOLS, Token
from avow.language.source import Reports

_WORDS = {
    **{kind: f"`{sign}`" for sign, kind in SYMBOLS.items()},
    "NAME": "a name",
    "NUMBER": "a number",
    "STRING": "a string",
    "BUILTIN": "a built-in type",
    "EMPTY_SEQUENCE": "`<>`",
    "NOT_IN": "`!in`",
    "IN": "`in`",
    "OUT": "`out`",
    "MATCHES": "`matches`",
    "UPTO": "`upto`",
}
_TERM = frozenset(("NAME", "NUMBER", "LBRACE", "LPAR"))
_OPERATOR = frozenset(
    ("AND", "OR", "IMPLIES", "IFF", "PLUS", "MINUS", "STAR", "SLASH", "EQ", "NE", "LE", "GE", "LT", "GT")
)


def explain(start: str, tokens: Sequence[Token], found: Token, expected: frozenset[str], reports: Reports) -> None:
    """Report the token `found`, where one of `expected` (terminals) should stand."""
    words = "the end" if found.type == "$END" else f"`{found.text[:40]}`"
    what = {"declaration": "of the declaration", "ports": "of the list", "topics": "of the list"}
    if found.type == "$END":
        words += " " + what.get(start, "of the formula")
    message = f"expected {_expected(start, expected)} and not {words}"
    hint = _hint(start, tokens, found, expected)
    begin, end = found.start, found.end
    if found.type == "$END" and tokens:
        begin, end = tokens[-1].start, tokens[-1].end
        message = f"{_expected(start, expected)} is missing after `{tokens[-1].text[:40]}`"
    reports.error("RCL120", message, begin, end, hint=hint)


def _expected(start: str, expected: frozenset[str]) -> str:
    if expected >= _TERM:
        return "a formula" if "NOT" in expected else "a term"
    if start in ("declaration", "ports") and {"NAME", "BUILTIN"} <= expected:
        return "a type"
    rest = expected - {"$END"}
    if rest >= _OPERATOR or {"AND", "OR", "IMPLIES"} <= rest:
        named = sorted(_WORDS[k] for k in rest & {"COMMA", "RPAR", "GT", "BAR", "RBRACE"} if k in _WORDS)
        return " or ".join(["an operator", *(n for n in named if n != "`>`")])
    named = sorted(_WORDS.get(kind, f"`{kind.lower()}`") for kind in rest)
    if "$END" in expected and not named:
        return "nothing more"
    if len(named) > 6:
        named = [*named[:6], "…"]
    return ", ".join(named[:-1]) + (" or " if len(named) > 1 else "") + named[-1] if named else "nothing more"


def _hint(start: str, tokens: Sequence[Token], found: Token, expected: frozenset[str]) -> str | None:
    position = next((i for i, t in enumerate(tokens) if t is found), len(tokens))
    before = tokens[position - 1] if position else None
    after = tokens[position + 1] if position + 1 < len(tokens) else None
    if found.type == "EQUALS" and start == "formula":
        return "equality is written `==`"
    if found.type == "EQUALS":
        return "a type is declared with `:`, a constant with `=`"
    if found.type in ("BAR", "SEMICOLON") and expected <= {"IN", "COMMA"}:
        return "say what each variable ranges over before the bar: `forall(x, y in REAL, i in NATURAL | …)`"
    if found.type == "LPAR" and before is not None and before.type == "LPAR" and "NAME" in expected:
        return "the variables stand without parentheses: `exists_unique(x, y in REAL | …)`"
    if found.type == "NAME" and found.text == "x" and start == "formula":
        return "a variable ranges over one type: write `x, y in REAL`, not `(x, y) in REAL x REAL`"
    if found.type == "EMPTY_SEQUENCE":
        return "unequal is written `!=`"
    if before is not None and before.type == "EQUALS":
        return "equality is written `==`"
    if found.type == "NOT" and after is not None and after.type == "IN":
        return "write `!in`"
    if found.type in ("BAR", "IMPLIES", "ARROW") and start in ("declaration", "ports") and found.type != "ARROW":
        return "write a function as `A x B --> C`, and a choice of values as `{a, b}`"
    if found.type == "ARROW" and start == "formula":
        return "implication is written `->`"
    if found.type == "SEMICOLON":
        return "no `;` here: it ends a declaration, or stands for the `|` of a quantifier"
    if start == "topics":
        return "a topic is `package/Type name` with, if it has one, `matches(in.variable)`"
    if start == "ports" and found.type == "NAME" and "COMMA" in expected:
        return "separate them by commas: `a : REAL, b : BOOL`"
    if found.text in _ALIASES:
        return f"write `{_ALIASES[found.text]}`"
    if found.type in ("CONTEXT", "NODE", "INPUTS", "OUTPUTS", "TOPICS", "MATCHES", "ASSUME", "GUARANTEE", "UPTO"):
        return f"`{found.text}` is a keyword and cannot be a name"
    return None


_ALIASES = {"true": "TRUE", "false": "FALSE", "implies": "->", "iff": "<=>", "AND": "and", "OR": "or", "NOT": "not"}
