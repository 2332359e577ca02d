"""Whoever takes a keyword for a name is told so, whatever the keyword and wherever the name is wanted."""

from __future__ import annotations

import pytest

from avow.language.lexer import KEYWORDS
from avow.language.load import check_sources
from avow.language.source import Source

PLACES = {
    "context": "context {{ {0} : REAL; }} node a {{ inputs() outputs(o : BOOL) topics() guarantee g (out.o) }}",
    "node": "node {0} {{ inputs() outputs(o : BOOL) topics() guarantee g (out.o) }}",
    "port": "node a {{ inputs() outputs({0} : BOOL) topics() guarantee g (TRUE) }}",
    "clause": 'node a {{ inputs() outputs(o : BOOL) topics() guarantee {0} "It is on" (out.o) }}',
    "value": "context {{ T : {{red, {0}}}; }} node a {{ inputs() outputs(o : T) topics() guarantee g (out.o == red) }}",
    "bound": "node a {{ inputs() outputs(o : BOOL) topics() guarantee g (forall({0} in REAL | out.o)) }}",
}


BUILTIN = {"BOOL", "INTEGER", "NATURAL", "REAL", "STRING"}
"""Where `name : type` is wanted, of these it is said that the name stands first."""

SECTIONS = {"assume", "context", "guarantee", "inputs", "node", "outputs", "topics"}
"""In a context these are read as the beginning of what they begin: a brace is missing, more often than not."""


def said(place: str, word: str) -> bool:
    return not (place in ("context", "port") and word in BUILTIN) and not (
        place in ("context", "value") and word in SECTIONS
    )


@pytest.mark.parametrize(("place", "word"), [(p, w) for p in PLACES for w in sorted(KEYWORDS) if said(p, w)])
def test_it_is_said(place: str, word: str) -> None:
    _, found = check_sources([Source("a.rcl", PLACES[place].format(word))])
    told = " ".join(f"{d.message} {d.hint or ''}" for d in found)
    assert f"`{word}` is a keyword and cannot be a name" in told
