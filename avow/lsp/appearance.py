"""How a contract looks: the kind of each word (for colours), and the parts that can be folded."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import takewhile

from avow.language.lexer import KEYWORDS, Token
from avow.lsp.names import Occurrence, Text, What
from avow.lsp.vocabulary import FORMS

TOKEN_TYPES = (
    *("keyword", "operator", "type", "enumMember", "property", "parameter", "class", "function", "variable"),
    *("string", "number", "comment"),
)
"""The protocol's own words for kinds of tokens, in the order of the legend."""
MODIFIERS = ("declaration", "readonly")

_OF_MEANING: Mapping[What, str] = {
    What.NODE: "class",
    What.INPUT: "property",
    What.OUTPUT: "property",
    What.ASSUMPTION: "function",
    What.GUARANTEE: "function",
    What.TYPE: "type",
    What.CONSTANT: "variable",
    What.DEFINITION: "function",
    What.ELEMENT: "enumMember",
    What.FIELD: "property",
    What.VARIABLE: "parameter",
}
_OPERATORS = frozenset(
    ("AND", "OR", "NOT", "IN", "NOT_IN", "FORALL", "EXISTS", "UNIQUE", "SINCE", "UNTIL", "UPTO", "IF", "THEN", "ELSE")
)
_OF_TOKEN = {"BUILTIN": "type", "STRING": "string", "NUMBER": "number", "UNIT": "keyword", "COMMENT": "comment"}


@dataclass(frozen=True, slots=True)
class Coloured:
    """A stretch of one line, with its kind: `kind` is one of `TOKEN_TYPES`, `modifiers` of `MODIFIERS`."""

    start: int
    end: int
    kind: str
    modifiers: tuple[str, ...] = ()


def coloured(text: Text, found: Sequence[Occurrence]) -> tuple[Coloured, ...]:
    """Every word of a text that has a colour, in order; tokens over several lines, line by line."""
    names = {o.start: o for o in found if o.file == text.file and o.written}
    out: list[Coloured] = []
    for token in sorted((*text.tokens, *text.comments), key=lambda t: t.start):
        kind, modifiers = _look(token, names.get(token.start))
        if kind:
            start = token.start
            for line in text.text[token.start : token.end].split("\n"):
                if line:
                    out.append(Coloured(start, start + len(line), kind, modifiers))
                start += len(line) + 1
    return tuple(out)


def _look(token: Token, name: Occurrence | None) -> tuple[str, tuple[str, ...]]:
    if name is not None:
        declared = ("declaration",) if name.declares else ()
        return _OF_MEANING[name.meaning.what], (
            (*declared, "readonly") if name.meaning.what in (What.CONSTANT, What.INPUT) else declared
        )
    if token.type in _OF_TOKEN:
        return _OF_TOKEN[token.type], ()
    if token.type in _OPERATORS:
        return "operator", ()
    if token.text in KEYWORDS:
        return "keyword", ()
    if token.type == "NAME":
        return ("operator", ()) if token.text in FORMS else ("", ())
    return (
        ("", ())
        if token.type in ("LPAR", "RPAR", "LBRACE", "RBRACE", "COMMA", "DOT", "SEMICOLON")
        else ("operator", ())
    )


def folds(text: Text) -> tuple[tuple[int, int], ...]:
    """Contexts, nodes and their parts that take more than a line, by the offsets where they begin and end."""
    found = set(text.syntax.parts)
    for at, token in enumerate(text.tokens):
        if token.type == "CONTEXT":
            inside = takewhile(lambda t: t.type not in ("CONTEXT", "NODE"), text.tokens[at + 1 :])
            found |= {(token.start, end) for end in [t.end for t in inside if t.type == "RBRACE"][-1:]}
    return tuple(sorted(place for place in found if "\n" in text.text[slice(*place)]))
