"""Lines of one program have few shapes: the same keys in the same order, other numbers and words.

A line that has been parsed once, strictly, gives a pattern; a later line that matches it has the same keys (each once)
and values of the same kinds, and is not parsed again until somebody needs more of it than the texts of its values.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..rules import FieldPath
from ..tuning import SHAPE_VALUES

_TOKEN = re.compile(
    rb'("[^"\\\x00-\x1f\x80-\xff]*")|(-?[0-9][0-9.eE+-]*)|(true|false)|null|([{}\[\]:,])|[ \t\r]+'
)  # strings with escapes or beyond ASCII have no shape
_NUMBER = rb"-?(?:0|[1-9][0-9]{0,17})(?:\.[0-9]{1,24})?(?:[eE][+-]?[0-9]{1,2})?"
_TIME = rb"(?:0|[1-9][0-9]{0,11})(?:\.[0-9]{1,20})?"
_WORD = rb'"[^"\\\x00-\x1f\x80-\xff]*"'


@dataclass(frozen=True, slots=True)
class Shape:
    """The pattern of the lines of one topic; its groups hold the time and the wanted values."""

    topic: str
    pattern: bytes
    time: int
    """The group of the event's time, counted from 1."""
    paths: tuple[FieldPath, ...]
    """What each group leads to."""
    numbers: frozenset[int]
    """The groups that hold numbers."""

    def groups(self, leads: Callable[[FieldPath], bool]) -> tuple[int, ...]:
        """The groups of the values that are wanted."""
        return tuple(at for at, path in enumerate(self.paths, start=1) if leads(path))


def shape(line: bytes, topic: str, wanted: Callable[[FieldPath], bool]) -> Shape | None:
    """The shape of a line that is known to be an event of this topic; None where it has none."""
    pieces: list[bytes] = []
    paths: list[FieldPath] = []
    numbers: set[int] = set()
    place: list[str | int] = []
    keyed = False
    at = 0
    while at < len(line):
        token = _TOKEN.match(line, at)
        if token is None:
            return None
        at = token.end()
        text, word, number, mark = token.group(0), token.group(1), token.group(2), token.group(4)
        if mark is not None:
            pieces.append(re.escape(mark))
            keyed = _moved(mark, place, keyed)
        elif word is not None and place and not isinstance(place[-1], int) and not keyed:
            pieces.append(re.escape(word))
            place[-1] = word[1:-1].decode()
        elif text.isspace() or text == b"null" or place == ["topic"]:
            pieces.append(re.escape(text))
        else:
            path = tuple(place)
            if path == ("time",) and (number is None or re.fullmatch(_TIME, number) is None):
                return None
            if number is not None and re.fullmatch(_NUMBER, number) is None:
                return None
            kind = _TIME if path == ("time",) else _NUMBER if number is not None else _WORD
            kind = kind if word is not None or number is not None else rb"true|false"
            if path == ("time",) or wanted(path):
                paths.append(path)
                if number is not None:
                    numbers.add(len(paths))
            pieces.append((b"(" if path == ("time",) or wanted(path) else b"(?:") + kind + b")")
    if ("time",) not in paths or len(pieces) > SHAPE_VALUES:
        return None
    return Shape(topic, b"".join(pieces), paths.index(("time",)) + 1, tuple(paths), frozenset(numbers))


def _moved(mark: bytes, place: list[Any], keyed: bool) -> bool:
    """Follow a bracket, a colon or a comma; whether a value comes next."""
    match mark:
        case b"{":
            place.append("")
        case b"[":
            place.append(0)
            return True
        case b":":
            return True
        case b",":
            if isinstance(place[-1], int):
                place[-1] += 1
                return True
        case _:  # an end
            place.pop()
            return keyed
    return False


def scanner(shapes: list[Shape]) -> tuple[re.Pattern[bytes], list[int]]:
    """One pattern for lines of any of the shapes, or of none (its last group); and each shape's first group, less 1."""
    offsets: list[int] = []
    count = 0
    for each in shapes:
        offsets.append(count)
        count += len(each.paths)
    whole = b"|".join([*(each.pattern for each in shapes), rb"([^\n]*)"])
    return re.compile(b"(?:" + whole + rb")\n"), offsets
