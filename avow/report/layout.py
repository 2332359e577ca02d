"""JSON text that is easy to read and fast to write, also for ten thousand obligations."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any


class Written(str):
    """JSON text that is part of another as it is."""

    __slots__ = ()


def json_text(value: Any, depth: int = 2) -> str:
    """JSON with one item a line down to `depth`, and each of these on one line (the C encoder knows no indentation)."""
    return "".join(json_pieces(value, depth)) + "\n"


def json_pieces(value: Any, depth: int = 2, margin: str = "") -> Iterator[str]:
    """As `json_text`, piece by piece and without the last line's end."""
    if depth <= 0 or not value or not isinstance(value, dict | list):
        yield value if type(value) is Written else json.dumps(value)
        return
    begin, end = "{}" if isinstance(value, dict) else "[]"
    rows = value.items() if isinstance(value, dict) else (("", item) for item in value)
    for key, item in rows:
        yield f"{begin}\n{margin} {json.dumps(key)}: " if end == "}" else f"{begin}\n{margin} "
        yield from json_pieces(item, depth - 1, margin + " ")
        begin = ","
    yield f"\n{margin}{end}"
