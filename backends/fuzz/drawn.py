"""Steps of a run, as the plain program reads and gives them (`native/replay.cpp`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

from avow.drive.steps import plain
from avow.language.contract import Port
from avow.language.sorts import SequenceSort

NEW = "N"
"""The command that makes a node."""

Step = dict[str, Any]
"""Input → a float, an int, a bool, the name of an element, or a list of these."""


def asking(data: bytes) -> str:
    """The command that asks for the run that the harness draws of these bytes."""
    return f"D {data.hex()}"


def steps(ports: Sequence[Port], reply: Iterable[Mapping[str, Any]]) -> Iterator[Step]:
    """That run's steps."""
    for step in reply:
        yield {port.name: plain(step[port.name]) for port in ports}


def command(ports: Sequence[Port], step: Step) -> str:
    """A step as the plain program reads it."""
    words = ["S"]
    for port in ports:
        value = step[port.name]
        if isinstance(port.sort, SequenceSort):
            words.append(str(len(value)))
            words += [_word(port.sort.item, item) for item in value]
        else:
            words.append(_word(port.sort, value))
    return " ".join(words)


def _word(sort: Any, value: Any) -> str:
    match value:
        case bool():
            return str(int(value))
        case float():
            return value.hex() if math.isfinite(value) else str(value)
        case int():
            return str(value)
        case _:  # an element's name
            return str(sort.members.index(value))
