"""How a contract looks: what each word of it is (for colours), and which parts of it fold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

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
    """A stretch of one line, with what it is: `kind` is of `TOKEN_TYPES`, `modifiers` of `MODIFIERS`."""

    start: int
    end: int
    kind: str
    modifiers: tuple[str, ...] = ()


def coloured(text: Text, found: Sequence[Occurrence]) -> tuple[Coloured, ...]:
    """Every word of a text that has a colour, in order; what goes over several lines, line by line."""
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


@dataclass(frozen=True, slots=True)
class Fold:
    """A part that can be folded, by offsets; `kind` is the protocol's (``comment`` or ``region``)."""

    start: int
    end: int
    kind: str = "region"


def folds(text: Text) -> tuple[Fold, ...]:
    """Contexts, nodes, their parts, and runs of comments, wherever they take more than a line."""
    found = [Fold(start, end) for start, end in text.syntax.parts]
    found += _contexts(text)
    run: list[Token] = []
    for comment in (*text.comments, None):
        if run and comment is not None and _follows(run[-1], comment, text.text):
            run.append(comment)
            continue
        if run:
            found.append(Fold(run[0].start, run[-1].end, "comment"))
        run = [comment] if comment is not None else []
    several = {(f.start, f.end): f for f in found if "\n" in text.text[f.start : f.end]}
    return tuple(several[place] for place in sorted(several))


def _follows(comment: Token, other: Token, text: str) -> bool:
    """Whether a comment stands on the line after another, with nothing between them."""
    between = text[comment.end : other.start]
    return not between.strip() and between.count("\n") == 1


def _contexts(text: Text) -> list[Fold]:
    """From each ``context`` to the brace before the next node."""
    found: list[Fold] = []
    begun: Token | None = None
    last: Token | None = None
    for token in (*text.tokens, Token("NODE", "", len(text.text), len(text.text))):
        if token.type in ("CONTEXT", "NODE"):
            if begun is not None and last is not None:
                found.append(Fold(begun.start, last.end))
            begun = token if token.type == "CONTEXT" else None
        if token.type == "RBRACE":
            last = token
    return found
