"""Text to tokens. The token types are the terminals of grammar.lark; what is no token is reported and left out.

One regular expression, one pass, linear in the text. Lark's own lexers are not used: they stop at the first error.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from avow.language.source import Reports

MAX_TOKENS = 1_000_000
"""A text with more is no contract; a megabyte of RCL has some 250,000."""

MAX_DIGITS = 500
"""Longer numbers are rejected: nobody means them, and arithmetic on them costs more than it is worth."""


class Token(NamedTuple):
    """A piece of the text: `start` and `end` are offsets, the end exclusive."""

    type: str
    text: str
    start: int
    end: int


KEYWORDS = {
    **{word: word.upper() for word in ("context", "node", "inputs", "outputs", "topics", "matches")},
    **{word: word.upper() for word in ("assume", "guarantee", "forall", "exists", "in", "out", "not", "and", "or")},
    "exists_unique": "UNIQUE",
    "upto": "UPTO",
    "TRUE": "TRUE",
    "FALSE": "FALSE",
    **dict.fromkeys(("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"), "BUILTIN"),
}
SYMBOLS = {
    "-->": "ARROW",
    "<=>": "IFF",
    "->": "IMPLIES",
    "==": "EQ",
    "!=": "NE",
    "<=": "LE",
    ">=": "GE",
    "<": "LT",
    ">": "GT",
    "=": "EQUALS",
    ":": "COLON",
    ";": "SEMICOLON",
    ",": "COMMA",
    ".": "DOT",
    "|": "BAR",
    "(": "LPAR",
    ")": "RPAR",
    "{": "LBRACE",
    "}": "RBRACE",
    "+": "PLUS",
    "-": "MINUS",
    "*": "STAR",
    "/": "SLASH",
}
FOREIGN = {
    "<->": "write `<=>`",
    "=>": "write `->`",
    "==>": "write `->`",
    "&&": "write `and`",
    "&": "write `and`",
    "||": "write `or`",
    "!": "write `not`",
    "~": "write `not`",
    ":=": "write `==` for equality, `=` for a constant",
    "/=": "write `!=`",
    "=/=": "write `!=`",
    "=<": "write `<=`",
    "...": "write a range as `<a upto b>`",
    "..": "write a range as `<a upto b>`",
    "[": "write sets as `{a, b}` and sequences as `<a, b>`",
    "]": "write sets as `{a, b}` and sequences as `<a, b>`",
    "/\\": "write `and`",
    "\\/": "write `or`",
    "\\": "write operators as words: `in`, `and`, `or`, `not`, `forall`, `exists`",
    "∃!": "write `exists_unique(x in S | …)`",
    "exists!": "write `exists_unique(x in S | …)`",
    "#": "a comment begins with `//`",
    "^": "RCL has no powers: write `x * x`",
    "%": "RCL has no remainder",
    "'": 'write texts as `"…"`, and the elements of types without quotation marks',
    "@": "RCL speaks of one step: there is no earlier or later value",
    "∀": "write `forall(x in S | …)`",
    "∃": "write `exists(x in S | …)`",
    "∧": "write `and`",
    "∨": "write `or`",
    "¬": "write `not`",
    "→": "write `->`",
    "⇒": "write `->`",
    "↔": "write `<=>`",
    "⇔": "write `<=>`",
    "∈": "write `in`",
    "∉": "write `!in`",
    "≤": "write `<=`",
    "≥": "write `>=`",
    "≠": "write `!=`",
    "×": "write `x` between types, `*` between numbers",
    "·": "write `*`",
    "ℝ": "write `REAL`",
    "ℤ": "write `INTEGER`",
    "ℕ": "write `NATURAL`",
    "“": 'write the straight quotation mark `"`',
    "”": 'write the straight quotation mark `"`',
    "’": "write the straight quote `'`",
    "′": "write the straight quote `'`",
    "−": "write the plain minus `-`",
    "–": "write the plain minus `-`",
}
"""What stands for it in RCL, for what other notations (and the prototype) write."""

_FOREIGN = "|".join(re.escape(s) for s in sorted(FOREIGN, key=len, reverse=True))
_SYMBOLS = "|".join(re.escape(s) for s in sorted(SYMBOLS, key=len, reverse=True))
_PATTERN = re.compile(
    r"(?P<space>[ \t\r\n\f]+)"
    r"|(?P<unique>exists!(?!=))"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_']*)"
    r"|(?P<comment>//[^\n]*|/\*[^*]*\*+(?:[^/*][^*]*\*+)*/)"
    r"|(?P<open_comment>/\*)"
    r"|(?P<not_in>!\s*in(?![A-Za-z0-9_']))"
    r"|(?P<empty><[ \t]*>)"
    r"|(?P<ne>!=)"
    r"|(?P<old_comment>--(?!>)[^\n]*)"
    rf"|(?P<arrow>-->|<=>|==(?!>)|<=(?!>)|>=(?!=))"
    rf"|(?P<foreign>{_FOREIGN})"
    rf"|(?P<symbol>{_SYMBOLS})"
    r"|(?P<number>[0-9]+(?:\.[0-9]+)?)(?P<tail>[A-Za-z0-9_'.]*)"
    r'|(?P<string>"(?:[^"\\\n]|\\[^\n])*")'
    r'|(?P<open_string>"[^\n]*)'
    r"|(?P<junk>[^\x00-\x7f\s]+|.)",
    re.DOTALL,
)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}


def tokens(reports: Reports, comments: list[Token] | None = None) -> list[Token]:
    """All tokens of the text, and (into `comments`, where given) its comments. Reports what is no token."""
    text = reports.source.text
    found: list[Token] = []
    append = found.append
    at, end = 0, len(text)
    match_at = _PATTERN.match
    junk_from = junk_to = -1
    while at < end and not reports.full:
        match = match_at(text, at)
        if match is None:  # pragma: no cover - the last alternative takes any character
            break
        kind, start, at = match.lastgroup, at, match.end()
        piece = match.group()
        if kind == "space":
            continue
        if kind == "name":
            append(Token(KEYWORDS.get(piece, "NAME"), piece, start, at))
        elif kind in ("symbol", "arrow"):
            append(Token(SYMBOLS[piece], piece, start, at))
        elif kind == "ne":
            append(Token("NE", piece, start, at))
        elif kind == "not_in":
            append(Token("NOT_IN", piece, start, at))
        elif kind == "empty":
            append(Token("EMPTY_SEQUENCE", piece, start, at))
        elif kind == "comment":
            if comments is not None:
                comments.append(Token("COMMENT", piece, start, at))
        elif kind in ("number", "tail"):
            number = _number(reports, match, start, at)
            if number is not None:
                append(number)
        elif kind == "string":
            _check_escapes(reports, piece, start)
            append(Token("STRING", piece, start, at))
        elif kind in ("foreign", "unique"):
            reports.error("RCL101", f"`{piece}` is not RCL", start, at, hint=FOREIGN[piece])
            stand_in = _STAND_IN.get(piece)
            if stand_in is not None:
                append(Token(stand_in, piece, start, at))
        elif kind == "old_comment":
            reports.error("RCL102", "`--` does not begin a comment", start, start + 2, hint="write `// …`")
        elif kind == "open_comment":
            reports.error("RCL103", "this comment is never closed", start, at, hint="close it with `*/`")
            break
        elif kind == "open_string":
            reports.error("RCL104", "this string is not closed on its line", start, at, hint='close it with `"`')
        elif start == junk_to:
            junk_to = at
        else:
            _junk(reports, junk_from, junk_to)
            junk_from, junk_to = start, at
    _junk(reports, junk_from, junk_to)
    if len(found) > MAX_TOKENS:
        last = found[MAX_TOKENS]
        reports.error("RCL003", f"the text has more than {MAX_TOKENS:,} words and signs", last.start, last.end)
        return []
    return found


_STAND_IN = {
    **dict.fromkeys(("<->", "↔", "⇔"), "IFF"),
    **dict.fromkeys(("=>", "==>", "→", "⇒"), "IMPLIES"),
    **dict.fromkeys(("&&", "&", "∧", "/\\"), "AND"),
    **dict.fromkeys(("||", "∨", "\\/"), "OR"),
    **dict.fromkeys(("∃!", "exists!"), "UNIQUE"),
    **dict.fromkeys(("!", "~", "¬"), "NOT"),
    **dict.fromkeys(("/=", "=/=", "≠"), "NE"),
    **dict.fromkeys(("=<", "≤"), "LE"),
    "≥": "GE",
    "∈": "IN",
    "∉": "NOT_IN",
    ":=": "EQ",
    "∀": "FORALL",
    "∃": "EXISTS",
    "·": "STAR",
    "^": "STAR",
    "%": "STAR",
    "−": "MINUS",
    "–": "MINUS",
    "ℝ": "BUILTIN",
    "ℤ": "BUILTIN",
    "ℕ": "BUILTIN",
}
"""The token that a foreign sign is read as, after its error, so that nothing else is reported because of it."""


def _number(reports: Reports, match: re.Match[str], start: int, end: int) -> Token | None:
    number, tail = match.group("number"), match.group("tail")
    if tail:
        hint = "names begin with a letter" if not tail.startswith(".") else "a decimal has digits after its point"
        if re.fullmatch(r"[eE][0-9]*", tail):
            hint = "write the number out: RCL has no exponents"
        reports.error("RCL105", f"`{_short(number + tail)}` is neither a number nor a name", start, end, hint=hint)
        return Token("NUMBER", "0", start, end)
    if len(number) > MAX_DIGITS:
        message = f"this number has {len(number)} digits; {MAX_DIGITS} is the most"
        reports.error("RCL105", message, start, end)
        return Token("NUMBER", "0", start, end)
    return Token("NUMBER", number, start, end)


def _check_escapes(reports: Reports, piece: str, start: int) -> None:
    if "\\" not in piece:
        return
    for escape in _ESCAPE.finditer(piece, 1, len(piece) - 1):
        if escape.group(1) not in _ESCAPES:
            place = start + escape.start()
            message = f"`{escape.group()}` is no escape in a string"
            reports.error("RCL106", message, place, place + 2, hint='write `\\\\`, `\\"`, `\\n` or `\\t`')


def unquote(text: str) -> str:
    """The value of a string token."""
    return _ESCAPE.sub(lambda m: _ESCAPES.get(m.group(1), m.group(1)), text[1:-1])


def quote(value: str) -> str:
    """A string token of that value."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'


def _junk(reports: Reports, start: int, end: int) -> None:
    if start < 0:
        return
    piece = reports.source.text[start:end]
    if len(piece) == 1:
        message = f"the character {_visible(piece)} has no place in RCL"
    else:
        message = f"the characters {_visible(_short(piece))} have no place in RCL"
    hint = "names are made of the letters A-Z and a-z, digits, `_` and primes" if piece[0].isalpha() else None
    reports.error("RCL107", message, start, end, hint=hint)


def _short(text: str) -> str:
    return text if len(text) <= 24 else text[:21] + "…"


def _visible(text: str) -> str:
    if text.isprintable():
        return f"`{text}`"
    return ascii(text)
