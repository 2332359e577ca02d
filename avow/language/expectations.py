"""The message for a token that the parser cannot accept: what it expected, and the form to write instead."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.foreign import WORDS
from avow.language.lexer import KEYWORDS, LIMITED, SYMBOLS, Token
from avow.language.source import Reports

_WORDS = {
    **{kind: f"`{sign}`" for sign, kind in SYMBOLS.items()},
    "NAME": "a name",
    "NUMBER": "a number",
    "STRING": "a string",
    "BUILTIN": "a built-in type",
    "EMPTY_SEQUENCE": "`<>`",
    "NOT_IN": "`!in`",
}
_TERM = frozenset(("NAME", "NUMBER", "LBRACE", "LPAR"))
_COMPARISONS = frozenset(("EQ", "NE", "LE", "GE", "LT", "GT", "IN", "NOT_IN"))
_CONNECTIVES = frozenset(("AND", "OR", "NOT", "IMPLIES", "IFF", "BAR"))
_QUANTIFIERS = frozenset(("FORALL", "EXISTS", "UNIQUE"))

SECTION_FORMS = {
    "INPUTS": "write `inputs( name : TYPE, … )`, or `inputs()` where there are none",
    "OUTPUTS": "write `outputs( name : TYPE, … )`, or `outputs()` where there are none",
    "TOPICS": "write `topics( package/Type name matches(in.variable), … )`, or `topics()` where there are none",
}
_DECLARATION = "write `Name : type;` or `Name = value;`"
_DEFINITION = "a definition is written `define name(i : NATURAL) = F;`"
_PORT = "write `name : TYPE`, separated by commas"
_TOPIC = "write `package/Type name [in frame] matches(in.variable)`, separated by commas; one topic for each variable"
_TYPE = (
    "types are `REAL`, `{red, green}`, `{move(REAL), stop}`, `A x B --> C`, `(A, B)`, `<A>`, `[x : REAL]`; ROS types "
    "stand in `topics`"
)
_QUANTIFIER = "write `forall(x, y in REAL, i in NATURAL | F)`"
_IN_FORMULA = {
    "EQUALS": "equality is written `==`",
    "EMPTY_SEQUENCE": "unequal is written `!=`",
    "ARROW": "implication is written `->`",
    "LBRACE": "`{ … }` is a set: group formulas by `( … )`",
    "BAR": "a bar stands in quantifiers only; the length of a sequence is `length(s)`",
    "COMMA": "join formulas by `and`; write sets with braces, `x in {a, b}`, and numbers with a decimal point",
    "NOT": "write `!in`, `!=`, or `a and not b`",
    "SEMICOLON": "only declarations end with `;`",
    "COLON": "a formula has no `:`; a type is declared in `inputs`, `outputs` or a quantifier",
    "IF": "put parentheses around it: `x == (if c then a else b)`",
}
"""Hints by the unexpected token."""


def explain(
    start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str], reports: Reports
) -> None:
    """Report the token `found` at position `at`, where one of the terminals `expected` should be."""
    if {"COLON", "COMMA"} <= expected <= {"COLON", "COMMA", "NAME"}:  # after a port's name, its type is usually missing
        expected = frozenset({"COLON"})
    if expected == {"NAME", "DEFINE"}:  # at the start of a declaration, the name is usually missing
        expected = frozenset({"NAME"})
    hint = _hint(start, tokens[:at], found, expected)
    if found.type == "$END" and tokens:
        last = tokens[-1]
        message = f"{_expected(start, expected)} is missing after `{last.text[:40]}`"
        hint = "remove the `,`, or go on after it" if last.type == "COMMA" else hint
        reports.error("RCL120", message, last.start, last.end, hint=hint)
        return
    if start in ("ports", "given") and found.type == "COLON" and at > 2 and tokens[at - 2].end < tokens[at - 1].start:
        before, name = tokens[at - 2], tokens[at - 1]
        message = f"a `,` is missing after `{before.text[:40]}`, before the port `{name.text[:40]}`"
        reports.error("RCL120", message, before.start, before.end)
        return
    message = f"expected {_expected(start, expected)} and not `{found.text[:40]}`"
    if found.type == "RPAR" and start == "formula" and "$END" in expected:
        message = "this `)` closes nothing"
    reports.error("RCL120", message, found.start, found.end, hint=hint)


def _expected(start: str, expected: frozenset[str]) -> str:
    if expected >= _TERM:
        return "a formula" if "NOT" in expected else "a term"
    if start in ("declaration", "ports", "given") and {"NAME", "BUILTIN"} <= expected:
        return "a type"
    words = {kind: _WORDS.get(kind, f"`{kind.lower()}`") for kind in expected - {"$END"}}
    if "ARROW" in expected and "NAME" in words:
        words["NAME"] = "`x`"
    if "PLUS" in expected:
        closing = expected & {"COMMA", "RPAR", "BAR", "RBRACE", "UPTO", "THEN", "ELSE"}
        words = {"PLUS": "an operator", **{kind: words[kind] for kind in closing}}
        if "GT" in expected and "EQ" not in expected:
            words["GT"] = "`>`"
    if "$END" in expected:
        words["$END"] = "`;`" if start == "declaration" else "`)`"
    named = sorted(set(words.values()), key=lambda word: (word != "an operator", word))
    return ", ".join(named[:-1]) + (" or " if len(named) > 1 else "") + named[-1] if named else "nothing more"


def _hint(start: str, earlier: Sequence[Token], found: Token, expected: frozenset[str]) -> str | None:
    keyword = about_keyword(found) if "NAME" in expected and not {"NUMBER", "ARROW"} & expected else None
    if start == "declaration" and any(token.type == "DEFINE" for token in (*earlier, found)):
        keyword = about_keyword(earlier[-1]) if earlier and earlier[-1].type == "DEFINE" else keyword
        return f"{keyword}; {_DEFINITION}" if keyword else _DEFINITION
    if keyword and start != "topics":
        return keyword
    if start == "formula":
        return _in_formula(earlier, found, expected) or about_keyword(found)
    if start == "topics":
        return _TOPIC
    if start == "declaration" and found.type == "NAME" and earlier and earlier[-1].type == "NUMBER":
        return f"only ports have units: `name : REAL in {found.text}`"
    if start == "declaration":
        return _TYPE if "ARROW" in expected else _DECLARATION
    return _TYPE if {"BUILTIN", "ARROW", "RBRACE"} & expected else _PORT


def _in_formula(earlier: Sequence[Token], found: Token, expected: frozenset[str]) -> str | None:
    """The hint for a token in a formula, from the most to the least specific."""
    before = earlier[-1] if earlier else Token("LPAR", "", found.start, found.start)
    if before.end < found.start and found.text and before.text + found.text in SYMBOLS:
        return f"write `{before.text}{found.text}` without a space in it"
    if expected == {"DOT"}:
        return f"`{before.text}` is a keyword; write `{before.text}.v` for the {before.text}put `v`"
    for word in (found, before):
        if word.type in ("NAME", "IF") and word.text.lower() in WORDS and "NOT" not in expected:
            return WORDS[word.text.lower()]
    if before.text in LIMITED and found.type == "NUMBER":
        return f"write its limit in brackets: `{before.text}[{found.text} steps](F)`"
    if found.type == "NAME" and before.type == "NUMBER":
        return f"only times have units (`500 ms`): write the number in the port's own unit, without `{found.text}`"
    quantified = any(token.type in _QUANTIFIERS for token in earlier)
    if quantified and (found.type in ("BAR", "IN") or "BAR" in expected or expected <= {"LPAR", "IN", "COMMA"}):
        return _QUANTIFIER
    begins = before.type in _CONNECTIVES | {"LPAR"}
    if (begins and found.type in _COMPARISONS - {"LT"}) or ("GT" in expected and "EQ" not in expected):
        return "write both sides of each comparison: `0 < r and r < 3`, or `0 < r < 3`"
    if found.type in ("SINCE", "UNTIL") and "AND" in expected:
        return f"`{found.text}` does not chain: put parentheses around one of them"
    if found.type in _IN_FORMULA:
        return _IN_FORMULA[found.type]
    if found.type in _CONNECTIVES:
        return f"a formula is missing before `{found.text}`"
    if {"THEN", "ELSE"} & expected:
        return WORDS["if"]
    if "COMMA" in expected and found.type in _TERM:
        return "separate them by commas"
    return "join formulas by `and`, `or` or `->`" if "AND" in expected else None


def about_keyword(found: Token) -> str | None:
    """The message for a keyword where a name is expected."""
    return f"`{found.text}` is a keyword and cannot be a name" if found.text in KEYWORDS else None
