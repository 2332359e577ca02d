"""Text to tokens. The token types are the terminals of grammar.lark; text that is not a token is reported and skipped.

One regular expression, one pass, linear in the text. Lark's own lexers are not used: they stop at the first error.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from avow.base.tuning.sizes import DIGITS
from avow.language.foreign import SIGNS, foreign, invisible
from avow.language.source import Reports


class Token(NamedTuple):
    """A piece of the text: `start` and `end` are offsets, the end exclusive."""

    type: str
    text: str
    start: int
    end: int


KEYWORDS = {
    **{word: word.upper() for word in ("context", "node", "inputs", "outputs", "topics", "matches")},
    **{
        word: word.upper()
        for word in ("assume", "guarantee", "define", "forall", "exists", "in", "out", "not", "and", "or")
    },
    "exists_unique": "UNIQUE",
    "upto": "UPTO",
    **{word: word.upper() for word in ("if", "then", "else", "since", "until")},
    "TRUE": "TRUE",
    "FALSE": "FALSE",
    **dict.fromkeys(("REAL", "INTEGER", "NATURAL", "BOOL", "STRING"), "BUILTIN"),
}
LIMITED = frozenset(("once", "historically", "held", "within", "for"))
"""Names that are operators directly before a limit, ``once[5 steps](…)``; `since` takes a limit too."""
UNITS = {"ns": 9, "us": 6, "ms": 3, "s": 0}
"""Units of time by the decimal places of a second; minutes and hours are whole seconds."""
LONG_UNITS = {"min": 60, "h": 3600}
STEPS = ("steps", "step")
_UNITS = frozenset((*UNITS, *LONG_UNITS, *STEPS))
"""Names that are units directly after a number."""
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
_FOREIGN = "|".join(re.escape(s) for s in sorted(SIGNS, key=len, reverse=True))
_SYMBOLS = "|".join(re.escape(s) for s in sorted(SYMBOLS, key=len, reverse=True))
_PATTERN = re.compile(
    r"(?P<space>[ \t\r\n\f]+)"
    r"|(?P<unique>exists!(?!=))"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_']*(?!\w))"
    r"|(?P<comment>//[^\n]*|/\*[^*]*\*+(?:[^/*][^*]*\*+)*/)"
    r"|(?P<open_comment>/\*)"
    r"|(?P<not_in>!\s*in(?![A-Za-z0-9_']))"
    r"|(?P<empty><[ \t]*>)"
    r"|(?P<ne>!=(?!=))"
    r"|(?P<old_comment>--(?!>)[^\n]*)"
    r"|(?P<arrow>-->|<=>|==(?![>=])|<=(?!=?>)|>=(?!=))"
    r"|(?P<quoted>'[^'\n]*'|[“„”][^“”„\n]*[“”]|‘[^’\n]*’|`[^`\n]*`)"
    r"|(?P<point>(?<![A-Za-z0-9_')])\.[0-9]+)"
    rf"|(?P<foreign>\\[A-Za-z]+|{_FOREIGN})"
    r"|(?P<square>[\[\]])"
    rf"|(?P<symbol>{_SYMBOLS})"
    r"|(?P<number>[0-9]+(?:\.[0-9]+)?)(?P<tail>(?:[A-Za-z0-9_']|\.(?!\.))*)"
    r'|(?P<string>"(?:[^"\\\n]|\\[^\n])*")'
    r'|(?P<open_string>"[^\n]*)'
    r"|(?P<word>[^\W\d][\w']*)"
    r"|(?P<junk>.)",
    re.DOTALL,
)
_RECORD = re.compile(r"\s*[A-Za-z_][A-Za-z0-9_']*\s*(?:,\s*[A-Za-z_][A-Za-z0-9_']*\s*)*:(?!=)")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}
_PLAIN = {"ne": "NE", "not_in": "NOT_IN", "empty": "EMPTY_SEQUENCE", "string": "STRING"}
"""Groups of the pattern that are tokens without further processing."""


def tokens(reports: Reports, comments: list[Token] | None = None) -> list[Token]:
    """All tokens of the text; appends its comments to `comments`, if given. Reports text that is not a token."""
    text = reports.source.text
    found: list[Token] = []
    append = found.append
    other = _Other(reports, found)
    at, end = 0, len(text)
    match_at = _PATTERN.match
    while at < end and not reports.full:
        match = match_at(text, at)
        assert match is not None, "the last alternative takes any character"
        kind, start, at = str(match.lastgroup), at, match.end()
        if kind == "space":
            continue
        piece = match.group()
        if kind == "name":
            word = KEYWORDS.get(piece, "NAME")
            if piece in _UNITS and found and found[-1].type == "NUMBER":
                word = "UNIT"
            append(Token(other.section(piece, word, start, at) if word in _STRUCTURE else word, piece, start, at))
        elif piece == "<" and found and found[-1].type == "LSQUARE":
            append(Token("YOUNGER", piece, start, at))
        elif kind in ("symbol", "arrow"):
            append(Token(SYMBOLS[piece], piece, start, at))
        elif kind in _PLAIN:
            append(Token(_PLAIN[kind], piece, start, at))
            if kind == "string":
                _check_escapes(reports, piece, start)
        elif kind == "comment":
            if comments is not None:
                comments.append(Token("COMMENT", piece, start, at))
        elif kind in ("number", "tail"):
            append(_number(reports, match, start, at))
        elif kind == "open_comment":
            reports.error("RCL103", "this comment is never closed", start, at, hint="close it with `*/`")
            break
        else:
            at = other.read(kind, piece, start, at)
    return found


_STRUCTURE = frozenset(("CONTEXT", "NODE", "INPUTS", "OUTPUTS", "TOPICS", "MATCHES", "DEFINE", "ASSUME", "GUARANTEE"))
_SECTIONS = _STRUCTURE - {"MATCHES"}
_OPERAND_FOLLOWS = frozenset((
    *("LPAR", "COMMA", "DOT", "EQ", "NE", "LE", "GE", "LT", "GT", "IN", "NOT_IN", "PLUS", "MINUS"),
    *("AND", "OR", "NOT", "IMPLIES", "IFF", "BAR"),
))  # fmt: skip
_GOES_ON = re.compile(r"\s*(?:[.:,)=<>!+*/|&-]|(?:in|and|or)\b)")
_PORT = re.compile(r"\.[A-Za-z_]")
_PRIVATE = re.compile(r"~/?[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
"""A topic's name in its node's own namespace."""
_QUOTED = 'write texts as `"…"`, and the elements of types without quotation marks'
_BRACKET = (
    "write sets as `{a, b}`, sequences and their types as `<a, b>` and `<REAL>`, the item of a sequence as `s(i)`, "
    "intervals as `0 <= r <= 9`"
)


class _Other:
    """Reports each piece that is not an RCL token once, and replaces it by the token it must mean, or skips it."""

    def __init__(self, reports: Reports, found: list[Token]) -> None:
        self.reports = reports
        self.found = found
        self.square = 0
        """The number of open square brackets of limits and records."""

    def read(self, kind: str, piece: str, start: int, end: int) -> int:
        """Reads one piece of the text; returns the offset at which to continue."""
        reports = self.reports
        if kind in ("foreign", "unique"):
            return self.sign(piece, start, end)
        if kind == "square":
            self.bracket(piece, start, end)
        elif kind == "quoted":
            reports.error("RCL101", f"`{_short(piece)}` is not RCL", start, end, hint=_QUOTED)
            self.stand_in(("STRING", piece), start, end)
        elif kind == "point":
            reports.error("RCL105", f"`{_short(piece)}` is no number", start, end, hint=f"write `0{_short(piece)}`")
            self.stand_in(("NUMBER", "1"), start, end)
        elif kind == "word":
            message = f"the name `{_short(piece)}` is not made of the letters A-Z and a-z"
            hint = "names are made of the letters A-Z and a-z, digits, `_` and primes"
            reports.error("RCL107", message, start, end, hint=hint)
            self.stand_in(("NAME", piece), start, end)
        elif kind == "old_comment":
            reports.error("RCL102", "`--` does not begin a comment", start, start + 2, hint="write `// …`")
            reports.torn.append(start)  # it may have been a double minus
        elif kind == "open_string":
            reports.error("RCL104", "this string is not closed on its line", start, end, hint='close it with `"`')
            reports.torn.append(start)
            self.found.append(Token("STRING", piece, start, end))
        else:
            return self.junk(start, end)
        return end

    def stand_in(self, token: tuple[str, str], start: int, end: int) -> None:
        self.reports.odd.add(start)
        self.found.append(Token(*token, start, end))

    def sign(self, piece: str, start: int, end: int) -> int:
        reports, text = self.reports, self.reports.source.text
        if piece == "#" and not text[text.rfind("\n", 0, start) + 1 : start].strip():
            reports.error("RCL102", "`#` does not begin a comment", start, end, hint="write `// …`")
            line_end = text.find("\n", start)
            return line_end if line_end >= 0 else len(text)
        if piece == "~" and (private := _PRIVATE.match(text, start)) and self.among_topics():
            self.found.append(Token("NAME", private.group(), start, private.end()))
            return private.end()
        hint, token = foreign(piece)
        reports.error("RCL101", f"`{_short(piece)}` is not RCL", start, end, hint=hint)
        if token is None or piece == "::":  # a sign with several possible meanings
            reports.torn.append(start)
        if token is not None:
            self.stand_in(token, start, end)
        return end

    def among_topics(self) -> bool:
        """Whether the current section is a list of topics."""
        return next((t.type for t in reversed(self.found) if t.type in _SECTIONS), "") == "TOPICS"

    def bracket(self, piece: str, start: int, end: int) -> None:
        """A square bracket of a limit (``once[5 steps]``) or of a record type; an error anywhere else."""
        text = self.reports.source.text
        last = self.found[-1] if self.found else Token("", "", -1, -1)
        limit = (last.type == "SINCE" or last.text in LIMITED) and not text[last.end : start].strip()
        if piece == "[" and (limit or _RECORD.match(text, end)):
            self.square += 1
            self.found.append(Token("LSQUARE", piece, start, end))
        elif piece == "]" and self.square:
            self.square -= 1
            self.found.append(Token("RSQUARE", piece, start, end))
        elif piece == "[" or not self.reports.torn:  # the partner of a reported one is not reported
            self.reports.error("RCL101", f"`{piece}` is not RCL", start, end, hint=_BRACKET)
            self.reports.torn.append(start)

    def section(self, word: str, kind: str, start: int, end: int) -> str:
        """The token type of a keyword that begins a clause or section, or that is used as a name."""
        reports = self.reports
        before = self.found[-1] if self.found else Token("", "", -1, -1)
        if before.type == "SLASH" and before.end == start and self.among_topics():
            return "NAME"  # a segment of a topic's name
        if kind in ("INPUTS", "OUTPUTS") and _PORT.match(reports.source.text, end):
            return "NAME"  # `inputs.r`, which has no meaning
        if before.type in _OPERAND_FOLLOWS and _GOES_ON.match(reports.source.text, end):
            message = f"`{word}` is a keyword and cannot be a name"
            reports.error("RCL120", message, start, end, hint=f"choose another, such as `{word}_`")
            reports.odd.add(start)
            return "NAME"
        return kind

    def junk(self, start: int, end: int) -> int:
        """Reports characters that RCL does not use, up to the next one that it does."""
        text = self.reports.source.text
        self.reports.torn.append(start)
        while end < len(text) and (match := _PATTERN.match(text, end)) and match.lastgroup == "junk":
            end += 1
        piece = text[start:end]
        unseen = invisible(piece[0])
        what = "character" if len(piece) == 1 else "characters"
        shown = unseen or (f"`{_short(piece)}`" if piece.isprintable() else ascii(_short(piece)))
        hint = "delete it: it may come from a copied text" if unseen else None
        self.reports.error("RCL107", f"no place in RCL for the {what} {shown}", start, end, hint=hint)
        return end


def _number(reports: Reports, match: re.Match[str], start: int, end: int) -> Token:
    number, tail = match.group("number"), match.group("tail")
    if not tail and len(number) <= DIGITS:
        return Token("NUMBER", number, start, end)
    message = f"`{_short(number + tail)}` is neither a number nor a name"
    hint = "write numbers as `12` or `0.25`, without exponent or ending; names begin with a letter"
    if not tail:
        message, hint = f"this number has {len(number)} digits; {DIGITS} is the most", "round it"
    elif tail in _UNITS:
        hint = f"write `{_short(number)} {tail}`"
    reports.error("RCL105", message, start, end, hint=hint)
    reports.odd.add(start)
    return Token("NUMBER", "1", start, end)


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
    """The text of a string token with that value."""
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'


def _short(text: str) -> str:
    return text if len(text) <= 24 else text[:21] + "…"
