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


def explain(start: str, tokens: Sequence[Token], found: Token, expected: frozenset[str], reports: Reports) -> None:
    """Report the token `found`, where one of `expected` (terminals) should stand."""
    hint = _hint(start, tokens, found, expected)
    if found.type == "$END" and tokens:
        last = tokens[-1]
        message = f"{_expected(start, expected)} is missing after `{last.text[:40]}`"
        reports.error("RCL120", message, last.start, last.end, hint=hint)
        return
    message = f"expected {_expected(start, expected)} and not `{found.text[:40]}`"
    reports.error("RCL120", message, found.start, found.end, hint=hint)


def _expected(start: str, expected: frozenset[str]) -> str:
    if expected >= _TERM:
        return "a formula" if "NOT" in expected else "a term"
    if start in ("declaration", "ports") and {"NAME", "BUILTIN"} <= expected:
        return "a type"
    end = {"declaration": "`;`"}.get(start, "`)`")
    ending = {end} if "$END" in expected else set()
    if {"AND", "OR", "IMPLIES"} & expected:
        closing = ending | {_WORDS[k] for k in expected & {"COMMA", "RPAR", "BAR", "RBRACE"}}
        return " or ".join(["an operator", *sorted(closing)])
    words = {kind: _WORDS.get(kind, f"`{kind.lower()}`") for kind in expected - {"$END"}}
    if "ARROW" in expected and "NAME" in words:
        words["NAME"] = "`x`"
    named = sorted(ending | set(words.values()))
    if len(named) > 6:
        named = [*named[:6], "…"]
    return ", ".join(named[:-1]) + (" or " if len(named) > 1 else "") + named[-1] if named else "nothing more"


def _hint(start: str, tokens: Sequence[Token], found: Token, expected: frozenset[str]) -> str | None:
    position = next((i for i, t in enumerate(tokens) if t is found), len(tokens))
    before = tokens[position - 1] if position else None
    after = tokens[position + 1] if position + 1 < len(tokens) else None
    keyword = _about_keyword(found)
    if start == "formula":
        return _in_formula(tokens[:position], before, found, after, expected) or keyword
    if start == "topics":
        if found.type == "SEMICOLON":
            return "separate topics by commas"
        if found.type in ("DOT", "COLON") and before is not None:
            return f"write the type with slashes: `{before.text}/…`"
        if found.type in ("NAME", "IN", "OUT") and found.text.startswith("match"):
            return "did you mean `matches`?"
        if (
            found.type == "MATCHES"
            and len(tokens) > 2
            and any(t.type == "SLASH" for t in tokens[max(0, position - 4) : position])
        ):
            return "between type and name stands no slash: write `package/Type name matches(in.v)`"
        return "a topic is `package/Type name` with, if it carries a variable, `matches(in.v)` or `matches(out.v)`"
    if start == "ports" and found.type in ("NAME", "BUILTIN") and expected == {"COLON"}:
        return "write `name : type`"
    if start == "ports" and "COMMA" in expected and found.type in ("NAME", "SEMICOLON"):
        return "separate them by commas: `a : REAL, b : BOOL`"
    if start == "ports" and found.type == "COMMA" and expected == {"COLON"}:
        return "each has a type of its own: `a : REAL, b : REAL`"
    if start == "declaration" and found.text == ":=":
        return "a constant is declared with `=`, a type with `:`"
    if (
        start == "declaration"
        and found.type in ("NUMBER", "STRING", "MINUS", "TRUE", "FALSE")
        and _is_type(tokens, before)
    ):
        return "a constant is declared with `=`: `Name = value;`"
    if start in ("declaration", "ports") and (
        found.type == "STAR" or (before is not None and before.text in _SEQUENCES)
    ):
        return "a type of sequences is written `<REAL>`"
    if start == "declaration" and before is not None and before.type == "EQUALS":
        return "equality is written `==`; a constant is `Name = value;`"
    if found.type == "EQUALS":
        return "a type is declared with `:`, a constant with `=`"
    if found.type in ("STRING", "NUMBER") and before is not None and before.type in ("LBRACE", "COMMA"):
        return "a set type lists names, as in `{red, green}`; a set of values is a constant: `Name = {1, 2};`"
    if found.type in ("BAR", "IMPLIES", "COMMA") and expected & {"ARROW", "$END"}:
        return "write a function as `A x B --> C`, and a choice of values as `{a, b}`"
    return keyword


def _is_type(tokens: Sequence[Token], before: Token | None) -> bool:
    return len(tokens) > 1 and before is not None and before is tokens[1] and before.type == "COLON"


def _in_formula(
    earlier: Sequence[Token], before: Token | None, found: Token, after: Token | None, expected: frozenset[str]
) -> str | None:
    quantified = any(t.type in _QUANTIFIERS for t in earlier)
    if found.type == "EQUALS" or (before is not None and before.type == "EQUALS"):
        return "equality is written `==`"
    if before is not None and before.type in _QUANTIFIERS:
        return f"write `{before.text}(x in S | …)`"
    if quantified and expected <= {"IN", "COMMA"}:
        if any(t.type == "IN" for t in earlier) and found.type in _RELATIONS:
            return "a bar stands between the variables and the formula: `forall(x in REAL | …)`"
        return "say what each variable ranges over before the bar: `forall(x, y in REAL, i in NATURAL | …)`"
    if before is not None and before.type == "LPAR" and found.type == "LPAR" and expected == {"NAME"}:
        return "the variables stand without parentheses: `exists_unique(x, y in REAL | …)`"
    if found.text == "x" and quantified and "BAR" in expected:
        return "a variable ranges over one type: write `x, y in REAL`, not `(x, y) in REAL x REAL`"
    if found.type in ("BAR", "IN") and any(t.text.casefold().replace("_", "") in _QUANTIFIER_LIKE for t in earlier):
        like = next(t for t in earlier if t.text.casefold().replace("_", "") in _QUANTIFIER_LIKE)
        return f"write `{_QUANTIFIER_LIKE[like.text.casefold().replace('_', '')]}(x in S | …)`, not `{like.text}`"
    if found.type == "COLON" and quantified:
        return "a bar stands between the variables and the formula: `forall(x in REAL | …)`"
    if found.type == "EMPTY_SEQUENCE" and "NE" in expected:
        return "unequal is written `!=`"
    if found.type == "NOT" and after is not None and after.type == "IN":
        return "write `!in`"
    if expected == {"DOT"} and before is not None and found.type == "NAME":
        return f"write `{before.text}.{found.text}`"
    if found.type == "ARROW":
        return "implication is written `->`"
    if found.type == "SEMICOLON":
        return "no `;` here: it ends a declaration, or stands for the `|` of a quantifier"
    if found.type == "DOT" and after is not None and after.type == "NUMBER":
        return f"write `0.{after.text}`"
    if earlier and earlier[0].text == "if":
        return "write `A -> B` for: if A then B"
    if found.type == "COMMA":
        return "join formulas by `and`"
    if found.text in _ALIASES:
        return f"write `{_ALIASES[found.text]}`"
    if before is not None and before.text in _ALIASES:
        return f"write `{_ALIASES[before.text]}`"
    return None


def _about_keyword(found: Token) -> str | None:
    if found.type in ("CONTEXT", "NODE", "INPUTS", "OUTPUTS", "TOPICS", "MATCHES", "ASSUME", "GUARANTEE", "UPTO"):
        return f"`{found.text}` is a keyword and cannot be a name"
    if found.text in ("in", "out", "not", "and", "or", "forall", "exists"):
        return f"`{found.text}` is a keyword"
    return None


_QUANTIFIERS = frozenset(("FORALL", "EXISTS", "UNIQUE"))
_RELATIONS = frozenset(("EQ", "NE", "LE", "GE", "LT", "GT", "LPAR", "DOT", "PLUS", "MINUS"))
_SEQUENCES = frozenset(("seq", "sequence", "list", "List", "Seq", "Sequence", "array"))
_QUANTIFIER_LIKE = {
    **dict.fromkeys(("exists1", "existsone", "existsunique", "existsexactlyone", "unique"), "exists_unique"),
    **dict.fromkeys(("all", "every", "foreach", "forevery"), "forall"),
    **dict.fromkeys(("exist", "some", "forsome", "any"), "exists"),
}
_ALIASES = {
    "true": "TRUE",
    "false": "FALSE",
    "implies": "->",
    "iff": "<=>",
    "AND": "and",
    "OR": "or",
    "NOT": "not",
    "is": "==",
    "equals": "==",
    "then": "->",
    "IN": "in",
    "FORALL": "forall",
    "EXISTS": "exists",
}
