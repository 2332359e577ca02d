"""Where in a contract an offset is: in which part of which node, in which formula, after what.

It works on words, so that it does while a text is being typed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from avow.language.lexer import Token
from avow.language.parser import QUANTIFIERS
from avow.language.terms import Past
from avow.lsp.names import Text

_TOP = ("CONTEXT", "NODE")
_SECTIONS = ("INPUTS", "OUTPUTS", "TOPICS", "STEPS", "DEFINE", "ASSUME", "GUARANTEE")
_WORDS = {"A": "ASSUME", "G": "GUARANTEE"}


@dataclass(frozen=True, slots=True)
class Place:
    """`top` is ``CONTEXT``, ``NODE`` or empty; `section` the part of a node, empty between its parts. `before` are the
    words of the part up to the offset, without the one being typed; `bound` the variables of the quantifiers around."""

    top: str = ""
    node: str = ""
    section: str = ""
    before: tuple[Token, ...] = ()
    bound: tuple[str, ...] = ()

    @property
    def last(self) -> str:
        """The kind of the word before; empty where there is none."""
        return self.before[-1].type if self.before else ""

    @property
    def defines(self) -> bool:
        """Whether it is in a definition."""
        return self.section == "DEFINE" or any(t.type == "DEFINE" for t in self.before)

    @property
    def parameters(self) -> tuple[str, ...]:
        """Of a definition."""
        pairs = pairwise(self.before) if self.defines else ()
        return tuple(t.text for t, then in pairs if t.type == "NAME" and then.type in ("COLON", "COMMA"))


def place_of(text: Text, offset: int) -> Place | None:
    """Where an offset is; None within a comment or a string."""
    if any(c.start < offset and (offset < c.end or _goes_on(c, offset)) for c in text.comments):
        return None
    if any(t.type == "STRING" and t.start < offset < t.end for t in text.tokens):
        return None
    before = [t for t in text.tokens if t.end < offset or (t.end == offset and not _is_word(t))]
    return _scan([t for t in before if t.start < offset])


def _goes_on(comment: Token, offset: int) -> bool:
    """Whether what is typed at the end of a comment belongs to it."""
    return comment.text.startswith("//") and offset == comment.end


def _is_word(token: Token) -> bool:
    return token.text[:1].isalpha() or token.text[:1] == "_"


def _scan(found: Sequence[Token]) -> Place:
    top, node, section, start, depth, brace, opened = "", "", "", 0, 0, 0, False
    for at, token in enumerate(found):
        kind = token.type
        between = depth == 0 and (not section or opened)
        if kind == "NAME" and top == "NODE" and brace and between and token.text in _WORDS:
            kind = _WORDS[token.text]
        if kind == "NAME" and token.text == Past.STEPS and top == "NODE" and brace and between:
            kind = "STEPS"
        if kind in _TOP:
            top, node, section, start, depth, brace, opened = kind, "", "", at + 1, 0, 0, False
        elif kind in _SECTIONS and (kind, top) != ("DEFINE", "CONTEXT"):
            section, start, depth, opened = kind, at + 1, 0, False
        elif kind == "LPAR":
            depth, opened = depth + 1, section != "DEFINE"
        elif kind == "RPAR":
            depth = max(depth - 1, 0)
        elif kind == "LBRACE" and depth == 0:
            brace += 1
        elif kind == "RBRACE" and depth == 0:
            brace = max(brace - 1, 0)
            if brace == 0:
                top, node, section, start, opened = "", "", "", at + 1, False
        elif kind == "NAME" and top == "NODE" and not brace and not node:
            node = token.text
        elif kind == "SEMICOLON" and depth == 0 and (top == "CONTEXT" or section == "DEFINE"):
            section, start = "", at + 1
    if section and opened and depth == 0:
        section, start = "", len(found)
    elif section and not opened and section != "DEFINE":
        section = "HEAD"
    elif top == "NODE" and not section:
        section = "" if brace else "HEAD"
    part = tuple(found[start:])
    return Place(top, node, section, part, _bound(part))


def _bound(part: Sequence[Token]) -> tuple[str, ...]:
    """The variables of the quantifiers that are open at the end of a part."""
    open_: list[tuple[int, list[str], bool]] = []
    depth = 0
    for at, token in enumerate(part):
        if token.type == "LPAR":
            depth += 1
            if at and part[at - 1].type in QUANTIFIERS:
                open_.append((depth, [], True))
        elif token.type == "RPAR":
            depth -= 1
            while open_ and open_[-1][0] > depth:
                open_.pop()
        elif open_ and open_[-1][0] == depth and open_[-1][2]:
            if token.type in ("BAR", "SEMICOLON"):
                open_[-1] = (depth, open_[-1][1], False)
            elif token.type == "NAME" and part[at - 1].type in ("LPAR", "COMMA"):
                following = part[at + 1].type if at + 1 < len(part) else ""
                if following in ("COMMA", "IN"):
                    open_[-1][1].append(token.text)
    return tuple(name for _, names, _ in open_ for name in names)
