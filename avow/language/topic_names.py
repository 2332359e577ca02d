"""Topics' names in a node's list: `/robot1/scan`, `scan/front`, `~scan`. White space sets type and name apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from avow.language.lexer import KEYWORDS, Token

_SEGMENTS = frozenset(("NAME", *KEYWORDS.values()))


def topic_names(tokens: Sequence[Token]) -> list[Token]:
    """The tokens of a list of topics, each name that has several segments as one NAME. A word of the language is an
    ordinary segment (`/arm/in`)."""
    found: list[Token] = []
    runs = 0
    for run in _runs(tokens):
        if len(run) == 1 and run[0].type not in _SEGMENTS and run[0].type != "SLASH":
            runs = 0 if run[0].type in ("COMMA", "LPAR", "RPAR") else runs
            found += run
            continue
        runs += 1
        if runs == 2 and len(run) > 1:
            text = "".join(token.text for token in run)
            found.append(Token("NAME", text, run[0].start, run[-1].end))
        else:
            found += run
    return found


def _runs(tokens: Sequence[Token]) -> Iterator[list[Token]]:
    """Segments and slashes that stand close together; any other token by itself."""
    run: list[Token] = []
    for token in tokens:
        part = token.type in _SEGMENTS or token.type == "SLASH"
        if run and (not part or run[-1].end != token.start):
            yield run
            run = []
        if part:
            run.append(token)
        else:
            yield [token]
    if run:
        yield run
