"""RCL for editors that highlight by TextMate grammars: generated from the language's own tables.

``python -m avow.language.textmate > rcl.tmLanguage.json`` prints the grammar; the editor's package ships this output.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any

from avow.base.codec import document
from avow.language.lexer import KEYWORDS, LONG_UNITS, STEPS, SYMBOLS, UNITS
from avow.language.operators import OPERATORS
from avow.language.terms import CALLED, Builtin, Past

SCOPE = "source.rcl"
_STRUCTURE = ("context", "node", "inputs", "outputs", "topics", "matches", "define", "assume", "guarantee")
_CONTROL = ("forall", "exists", "exists_unique", "upto", "if", "then", "else")
_CONSTANTS = ("TRUE", "FALSE")
_PUNCTUATION = frozenset(":;,.|(){}=")


def grammar() -> dict[str, Any]:
    """The grammar, as plain data."""
    types = [word for word, kind in KEYWORDS.items() if kind == "BUILTIN"]
    infix = [word for word in KEYWORDS if word not in (*_STRUCTURE, *_CONTROL, *_CONSTANTS, *types)]
    called = sorted({*Builtin, *Past, *CALLED} - set(KEYWORDS))
    signs = sorted(
        (set(SYMBOLS) | {name for name in OPERATORS if not name.isalpha()}) - _PUNCTUATION,
        key=lambda sign: (-len(sign), sign),
    )
    units = (*UNITS, *LONG_UNITS, *STEPS)
    return {
        "scopeName": SCOPE,
        "name": "RCL",
        "patterns": [
            {"name": "comment.line.double-slash.rcl", "match": r"//.*$"},
            {"name": "comment.block.rcl", "begin": r"/\*", "end": r"\*/"},
            {
                "name": "string.quoted.double.rcl",
                "begin": '"',
                "end": '"|$',
                "patterns": [{"name": "constant.character.escape.rcl", "match": r"\\."}],
            },
            {
                "match": rf"\b(node)\s+({_NAME})",
                "captures": {"1": {"name": "keyword.control.rcl"}, "2": {"name": "entity.name.type.rcl"}},
            },
            {
                "match": rf"\b(assume|guarantee|A|G)\s+({_NAME})(?=\s*[\"(])",
                "captures": {"1": {"name": "keyword.control.rcl"}, "2": {"name": "entity.name.function.rcl"}},
            },
            {"name": "variable.language.rcl", "match": r"\b(in|out)(?=\.)"},
            {"name": "keyword.control.rcl", "match": _words((*_STRUCTURE, "A", "G"))},
            {"name": "keyword.operator.word.rcl", "match": _words((*_CONTROL, *infix))},
            {"name": "support.function.rcl", "match": _words(called) + r"(?=\s*[(\[])"},
            {"name": "support.type.rcl", "match": _words(types)},
            {"name": "constant.language.rcl", "match": _words(_CONSTANTS)},
            {"name": "constant.numeric.rcl", "match": rf"\b[0-9]+(\.[0-9]+)?\b(\s*{_words(units)})?"},
            {"name": "keyword.operator.rcl", "match": "|".join(map(re.escape, signs))},
        ],
    }


_NAME = r"[A-Za-z_][A-Za-z0-9_']*"


def _words(words: Iterable[str]) -> str:
    return rf"\b({'|'.join(words)})\b(?!')"


def text() -> str:
    """The text of the shipped grammar file."""
    return document(grammar()) + "\n"


if __name__ == "__main__":
    print(text(), end="")
