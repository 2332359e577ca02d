"""The message for a token that the parser cannot accept: what it expected, and the form to write instead."""

from __future__ import annotations

from collections.abc import Sequence

from avow.language.foreign import OPERATORS
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
_TOPIC = "write `package/Type name matches(in.variable)`, separated by commas; one topic for each variable"
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
    "COMMA": "join formulas by `and`; write sets with braces: `x in {a, b}`",
    "SEMICOLON": "only declarations end with `;`",
    "COLON": "a formula has no `:`; a type is declared in `inputs`, `outputs` or a quantifier",
    "THEN": "write `if F then s else t`, or `A -> B` for: if A then B",
    "ELSE": "write `if F then s else t`, or `A -> B` for: if A then B",
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
    hint = _hint(start, tokens, at, found, expected)
    if found.type == "$END" and tokens:
        last = tokens[-1]
        message = f"{_expected(start, expected)} is missing after `{last.text[:40]}`"
        reports.error("RCL120", message, last.start, last.end, hint=hint)
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


def _hint(start: str, tokens: Sequence[Token], at: int, found: Token, expected: frozenset[str]) -> str | None:
    before = tokens[at - 1] if at else None
    after = tokens[at + 1] if at + 1 < len(tokens) else None
    keyword = about_keyword(found) if "NAME" in expected and not {"NUMBER", "ARROW"} & expected else None
    if start == "declaration" and any(token.type == "DEFINE" for token in tokens[: at + 1]):
        keyword = about_keyword(before) if before is not None and before.type == "DEFINE" else keyword
        return f"{keyword}; {_DEFINITION}" if keyword else _DEFINITION
    if keyword and start != "topics":
        return keyword
    if start == "formula":
        return _in_formula(tokens[:at], before, found, after, expected) or about_keyword(found)
    if start == "topics":
        return _TOPIC
    if start == "declaration":
        if any(token.type == "EQUALS" for token in tokens[:at]):
            formula = found.type in _COMPARISONS | _CONNECTIVES
            return "put a formula in parentheses: `Name = (3 > 2);`" if formula else _DECLARATION
        typed = before is not None and before.type != "COLON" and any(token.type == "COLON" for token in tokens[:at])
        return _TYPE if typed or found.type not in ("NUMBER", "STRING", "TRUE", "FALSE", "MINUS") else _DECLARATION
    if found.type in ("SEMICOLON", "COLON", "EQUALS") or not {"BUILTIN", "ARROW", "RBRACE"} & expected:
        return _PORT
    return _TYPE


def _in_formula(
    earlier: Sequence[Token], before: Token | None, found: Token, after: Token | None, expected: frozenset[str]
) -> str | None:
    """The hint for a token in a formula, from the most to the least specific."""
    if before is not None and before.text in LIMITED and found.type == "NUMBER" and "NUMBER" not in expected:
        unit = after.text if after is not None and after.text.isalpha() else "steps"
        return f"write its limit in brackets: `{before.text}[{found.text} {unit}](F)`"
    if before is not None and before.end < found.start and found.text and before.text + found.text in SYMBOLS:
        return f"write `{before.text}{found.text}` without a space in it"
    if expected == {"DOT"} and before is not None:
        return f"`{before.text}` is a keyword; write `{before.text}.v` for the {before.text}put `v`"
    for word in (found, before):
        if (
            word is not None
            and word.type in ("NAME", "IF")
            and word.text.lower() in OPERATORS
            and "NOT" not in expected
        ):
            return OPERATORS[word.text.lower()]
    if found.type == "NOT" and after is not None and after.type in ("IN", "EQ", "EQUALS"):
        return "write `!in`" if after.type == "IN" else "write `!=`"
    if found.type == "NAME" and before is not None and before.type == "NUMBER":
        return f"only times have units (`500 ms`): write the number in the port's own unit, without `{found.text}`"
    if _in_quantifier(earlier, found, expected):
        return _QUANTIFIER
    begins = before is None or before.type in _CONNECTIVES | {"LPAR"}
    if (begins and found.type in _COMPARISONS - {"LT"}) or ("GT" in expected and "EQ" not in expected):
        return "write both sides of each comparison: `0 < r and r < 3`, or `0 < r < 3`"
    if found.type in ("SINCE", "UNTIL") and "AND" in expected:
        return f"`{found.text}` does not chain: put parentheses around one of them"
    if found.type in _CONNECTIVES - {"NOT", "BAR"}:
        return f"a formula is missing before `{found.text}`"
    if found.type == "$END" and {"THEN", "ELSE"} & expected:
        return _IN_FORMULA["THEN"]
    if found.type == "COMMA" and before is not None and after is not None and before.type == after.type == "NUMBER":
        return f"write a decimal point: `{before.text}.{after.text}`"
    if found.type in _IN_FORMULA:
        return _IN_FORMULA[found.type]
    if found.type in ("NAME", "NUMBER", "STRING", "IN", "OUT", "LPAR", "NOT", *_QUANTIFIERS):
        if "COMMA" in expected:
            return "separate them by commas"
        return "join formulas by `and`, `or` or `->`" if "AND" in expected else None
    return None


def _in_quantifier(earlier: Sequence[Token], found: Token, expected: frozenset[str]) -> bool:
    """Whether the variables of a quantifier, or a word that other languages use for one, are written wrongly."""
    if found.type in ("BAR", "IN") or "BAR" in expected or expected <= {"IN", "COMMA"}:
        return any(token.type in _QUANTIFIERS or token.text.casefold() in _LIKE for token in earlier)
    if earlier and (earlier[-1].type in _QUANTIFIERS or earlier[-1].text.casefold() in _LIKE):
        return True
    if len(earlier) > 1 and earlier[-1].type == "LPAR" and earlier[-2].type in _QUANTIFIERS:
        return found.text not in KEYWORDS
    return found.type in _QUANTIFIERS and "AND" in expected


_LIKE = frozenset(("forall", "all", "every", "foreach", "exists", "exist", "exists1", "some", "any", "unique", "there"))


def about_keyword(found: Token) -> str | None:
    """The message for a keyword where a name is expected."""
    return f"`{found.text}` is a keyword and cannot be a name" if found.text in KEYWORDS else None
