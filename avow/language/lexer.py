"""Text to tokens. The token types are the terminals of grammar.lark; what is no token is reported and left out.

One regular expression, one pass, linear in the text. Lark's own lexers are not used: they stop at the first error.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from avow.base.tuning.sizes import DIGITS, TOKENS
from avow.language.foreign import FOREIGN_TYPES, SIGNS, foreign, invisible, wide
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
"""Words that are operators directly before a limit, ``once[5 steps](…)``; `since` has one too."""
UNITS = {"ns": 9, "us": 6, "ms": 3, "s": 0}
"""Units of time by the decimal places of a second; minutes and hours are whole seconds."""
LONG_UNITS = {"min": 60, "h": 3600}
STEPS = ("steps", "step")
_UNITS = frozenset((*UNITS, *LONG_UNITS, *STEPS))
"""Words that are units directly behind a number."""
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
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_']*)"
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
    r"|(?P<word>[^\W\d_][\w']*)"
    r"|(?P<junk>.)",
    re.DOTALL,
)
_RECORD = re.compile(r"\s*[A-Za-z_][A-Za-z0-9_']*\s*(?:,\s*[A-Za-z_][A-Za-z0-9_']*\s*)*:(?!=)")
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)
_ESCAPES = {'"': '"', "\\": "\\", "n": "\n", "t": "\t"}


def tokens(reports: Reports, comments: list[Token] | None = None) -> list[Token]:
    """All tokens of the text, and (into `comments`, where given) its comments. Reports what is no token."""
    text = reports.source.text
    found: list[Token] = []
    append = found.append
    other = _Other(reports, found)
    at, end = 0, len(text)
    match_at = _PATTERN.match
    while at < end and not reports.full:
        match = match_at(text, at)
        if match is None:  # pragma: no cover - the last alternative takes any character
            break
        kind, start, at = match.lastgroup, at, match.end()
        if kind == "space":
            continue
        piece = match.group()
        if kind == "name":
            word = KEYWORDS.get(piece, "NAME")
            if piece in _UNITS and found and found[-1].type == "NUMBER":
                word = "UNIT"
            append(other.section(piece, word, start, at) if word in _STRUCTURE else Token(word, piece, start, at))
        elif piece == "<" and found and found[-1].type == "LSQUARE":
            append(Token("YOUNGER", piece, start, at))
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
            append(_number(reports, match, start, at))
        elif kind == "string":
            _check_escapes(reports, piece, start)
            append(Token("STRING", piece, start, at))
        elif kind == "open_comment":
            reports.error("RCL103", "this comment is never closed", start, at, hint="close it with `*/`")
            break
        else:
            at = other.read(str(kind), piece, start, at)
    other.finish()
    if len(found) > TOKENS:
        last = found[TOKENS]
        reports.error("RCL003", f"the text has more than {TOKENS:,} words and signs", last.start, last.end)
        return []
    return found


_STRUCTURE = frozenset(("CONTEXT", "NODE", "INPUTS", "OUTPUTS", "TOPICS", "MATCHES", "DEFINE", "ASSUME", "GUARANTEE"))
_SECTIONS = _STRUCTURE - {"MATCHES"}
_WITHIN = frozenset(("LPAR", "COMMA", "DOT", "EQ", "NE", "LE", "GE", "LT", "GT", "IN", "NOT_IN", "PLUS", "MINUS"))
_CONNECTIVES = frozenset(("AND", "OR", "NOT", "IMPLIES", "IFF", "BAR"))
_GOES_ON = re.compile(r"\s*(?:[.:,)=<>!+*/|&-]|(?:in|and|or)\b)")
_ARRAY = re.compile(r"\]|\s*(?:REAL|INTEGER|NATURAL|BOOL|STRING)\b")
_PRIVATE = re.compile(r"~/?[A-Za-z_][A-Za-z0-9_]*(?:/[A-Za-z_][A-Za-z0-9_]*)*")
"""A topic's name in its node's own namespace."""
_PORT = re.compile(r"\.[A-Za-z_]")


class _Other:
    """What is no token of RCL: said once, and read as what it must mean, or left out."""

    def __init__(self, reports: Reports, found: list[Token]) -> None:
        self.reports = reports
        self.found = found
        self.square: list[tuple[str, str]] = []
        self.junk = (-1, -1)
        self.unseen: dict[str, tuple[int, int]] = {}

    def read(self, kind: str, piece: str, start: int, end: int) -> int:
        """Reads one piece of the text; the offset where reading goes on."""
        reports = self.reports
        if kind in ("foreign", "unique"):
            return self.sign(piece, start, end)
        if kind == "square":
            self.bracket(piece, start, end)
        elif kind == "quoted":
            hint = 'write texts as `"…"`, and the elements of types without quotation marks'
            reports.error("RCL101", f"`{_short(piece)}` is not RCL", start, end, hint=hint)
            self.stand_in(("STRING", piece), start, end)
        elif kind == "point":
            reports.error("RCL105", f"`{_short(piece)}` is no number", start, end, hint=f"write `0{_short(piece)}`")
            self.found.append(Token("NUMBER", "1", start, end))
        elif kind == "word":
            self.word(piece, start, end)
        elif kind == "old_comment":
            reports.error("RCL102", "`--` does not begin a comment", start, start + 2, hint="write `// …`")
            reports.torn.append(start)
        elif kind == "open_string":
            reports.error("RCL104", "this string is not closed on its line", start, end, hint='close it with `"`')
            reports.torn.append(start)
            self.found.append(Token("STRING", piece, start, end))
        else:
            self.other(piece, start, end)
        return end

    def stand_in(self, token: tuple[str, str], start: int, end: int) -> None:
        self.reports.odd.add(start)
        self.found.append(Token(*token, start, end))

    def sign(self, piece: str, start: int, end: int) -> int:
        reports = self.reports
        if piece == "#" and not reports.source.text[reports.source.text.rfind("\n", 0, start) + 1 : start].strip():
            reports.error("RCL102", "`#` does not begin a comment", start, end, hint="write `// …`")
            line_end = reports.source.text.find("\n", start)
            return line_end if line_end >= 0 else len(reports.source.text)
        if piece == "~" and (private := _PRIVATE.match(reports.source.text, start)) and self.among_topics():
            self.found.append(Token("NAME", private.group(), start, private.end()))
            return private.end()
        hint, token = foreign(piece)
        if piece == "::" and len(self.found) > 1 and self.found[-2].start in reports.odd:
            self.found.append(Token("SLASH", "/", start, end))  # `std_msgs::msg::Bool` is one mistake
            return end
        if token is None or token[0] != "UPTO" or not self.square:  # `[0..9]` is one mistake
            reports.error("RCL101", f"`{_short(piece)}` is not RCL", start, end, hint=hint)
        if token is None or piece == "::":  # which may stand for several things
            reports.torn.append(start)
        if token is not None:
            self.stand_in(token, start, end)
        return end

    def among_topics(self) -> bool:
        """Whether the latest section that has begun is a list of topics."""
        return next((t.type for t in reversed(self.found) if t.type in _SECTIONS), "") == "TOPICS"

    def bracket(self, piece: str, start: int, end: int) -> None:
        """A square bracket: of an item (`s[0]`), an array type (`REAL[]`), an interval, or a collection."""
        reports, text = self.reports, self.reports.source.text
        last = self.found[-1] if self.found else Token("", "", -1, -1)
        limits = last.type == "SINCE" or (last.type == "NAME" and last.text in LIMITED)
        if piece == "[" and limits and not text[last.end : start].strip():
            self.square.append(("RSQUARE", "]"))
            self.found.append(Token("LSQUARE", "[", start, end))
            return
        if piece == "]" and self.square:
            kind, sign = self.square.pop()
            if kind == "RSQUARE":
                self.found.append(Token(kind, sign, start, end))
            elif kind:
                self.stand_in((kind, sign), start, end)
            return
        if piece == "[" and _RECORD.match(text, end):
            self.square.append(("RSQUARE", "]"))
            self.found.append(Token("LSQUARE", "[", start, end))
            return
        hint, opening, closing = "write sets as `{a, b}` and sequences as `<a, b>`", "", ("", "")
        before = self.found[-1] if self.found and piece == "[" else Token("", "", -1, -1)
        if before.type == "BUILTIN" or before.text in FOREIGN_TYPES or _ARRAY.match(text, end):
            hint = "a type of sequences is written `<REAL>`; a topic has the type of its message, `package/Type`"
        elif before.type in ("NAME", "RPAR") and before.end == start:
            hint = "the item of a sequence at position i is written `s(i)`"
            opening, closing = "(", ("RPAR", ")")
        elif before.type in ("IN", "NOT_IN"):
            hint = "write a set as `{a, b}`, whole numbers as `<0 upto 9>`, an interval of reals as `0 <= r <= 9`"
        reports.error("RCL101", f"`{piece}` is not RCL", start, end, hint=hint)
        if opening:
            self.stand_in(("LPAR", opening), start, end)
        else:
            reports.torn.append(start)
        if piece == "[":
            self.square.append(closing)

    def section(self, word: str, kind: str, start: int, end: int) -> Token:
        """A keyword that begins a clause or section; or one that someone took for a name, or for `in`."""
        reports, text = self.reports, self.reports.source.text
        before = self.found[-1].type if self.found else ""
        if before == "SLASH" and self.found[-1].end == start and self.among_topics():
            return Token("NAME", word, start, end)  # a segment of a topic's name
        if kind in ("INPUTS", "OUTPUTS") and before != "RPAR" and _PORT.match(text, end):
            meant = "in" if kind == "INPUTS" else "out"
            reports.error("RCL101", f"`{word}.` is not RCL", start, end, hint=f"write `{meant}.`")
            return Token(meant.upper(), meant, start, end)
        if (before in _WITHIN or before in _CONNECTIVES) and _GOES_ON.match(text, end):
            message = f"`{word}` is a keyword and cannot be a name"
            reports.error("RCL120", message, start, end, hint=f"choose another, such as `{word}_`")
            reports.odd.add(start)
            return Token("NAME", word, start, end)
        return Token(kind, word, start, end)

    def word(self, piece: str, start: int, end: int) -> None:
        """A name with letters that names do not have: read as one all the same."""
        if self.found and self.found[-1].end == start and self.found[-1].text[:1].isalpha():
            before = self.found.pop()
            piece, start = before.text + piece, before.start
        message = f"the name `{_short(piece)}` is not made of the letters A-Z and a-z"
        hint = "names are made of the letters A-Z and a-z, digits, `_` and primes"
        self.reports.error("RCL107", message, start, end, hint=hint)
        self.stand_in(("NAME", piece), start, end)

    def other(self, character: str, start: int, end: int) -> None:
        """A character that has no place: a full-width sign, one that nobody sees, or any other."""
        plain = wide(character)
        if plain is not None and plain in SYMBOLS:
            hint = f"write the plain sign `{plain}`"
            self.reports.error("RCL101", f"`{character}` is not RCL", start, end, hint=hint)
            self.stand_in((SYMBOLS[plain], plain), start, end)
            return
        if invisible(character) is not None:
            first, count = self.unseen.get(character, (start, 0))
            self.unseen[character] = (first, count + 1)
            if not character.isspace():  # it may split a name in two
                self.reports.torn.append(start)
            return
        self.reports.torn.append(start)
        begun, ended = self.junk
        if ended != start:
            self.finish_junk()
            begun = start
        self.junk = (begun, end)

    def finish_junk(self) -> None:
        start, end = self.junk
        if start < 0:
            return
        piece = self.reports.source.text[start:end]
        what = "character" if len(piece) == 1 else "characters"
        verb = "has" if len(piece) == 1 else "have"
        message = f"the {what} {_visible(_short(piece))} {verb} no place in RCL"
        self.reports.error("RCL107", message, start, end)
        self.junk = (-1, -1)

    def finish(self) -> None:
        self.finish_junk()
        for character, (start, count) in self.unseen.items():
            often = f", {count} times" if count > 1 else ""
            message = f"the invisible character {invisible(character)} has no place in RCL{often}"
            hint = "replace it by a plain space" if character.isspace() else "delete it"
            self.reports.error("RCL107", message, start, start + 1, hint=f"{hint}: it may come from a copied text")


def _number(reports: Reports, match: re.Match[str], start: int, end: int) -> Token:
    number, tail = match.group("number"), match.group("tail")
    if tail:
        message = f"`{_short(number + tail)}` is neither a number nor a name"
        reports.error("RCL105", message, start, end, hint=_about_tail(number, tail))
        reports.odd.add(start)
        return Token("NUMBER", "1", start, end)
    if len(number) > DIGITS:
        message = f"this number has {len(number)} digits; {DIGITS} is the most"
        reports.error("RCL105", message, start, end)
        return Token("NUMBER", "1", start, end)
    return Token("NUMBER", number, start, end)


def _about_tail(number: str, tail: str) -> str:
    if tail.startswith("."):
        return "a decimal has digits after its one point"
    if re.fullmatch(r"[eE][0-9]*", tail):
        return "write the number out: RCL has no exponents"
    if re.fullmatch(r"[fFdDlLuU]+", tail):
        return f"write `{_short(number)}`: numbers have no endings"
    if number == "0" and re.fullmatch(r"[xXbBoO][0-9A-Fa-f_]+", tail):
        return "write the number in decimal"
    if tail in UNITS or tail in LONG_UNITS:
        return f"write `{_short(number)} {tail}`"
    if re.fullmatch(r"[0-9_']+", tail):
        return f"write `{_short(number + re.sub('[^0-9]', '', tail))}`"
    return "names begin with a letter, and numbers have no units"


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


def _short(text: str) -> str:
    return text if len(text) <= 24 else text[:21] + "…"


def _visible(text: str) -> str:
    if text.isprintable():
        return f"`{text}`"
    return ascii(text)
