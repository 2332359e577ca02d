"""JSON text that is easy to read and fast to write, also for ten thousand obligations."""

from __future__ import annotations

import json
from typing import Any


class Written(str):
    """JSON text that is part of another as it is."""

    __slots__ = ()


def json_text(value: Any, depth: int = 2) -> str:
    """JSON with one item a line down to `depth`, and each of these on one line (the C encoder knows no indentation)."""
    return _json(value, depth, "") + "\n"


def _json(value: Any, depth: int, margin: str) -> str:
    if depth > 0 and value and isinstance(value, dict):
        inner = margin + " "
        rows = (f"{inner}{json.dumps(key)}: {_json(item, depth - 1, inner)}" for key, item in value.items())
        return "{\n" + ",\n".join(rows) + f"\n{margin}}}"
    if depth > 0 and value and isinstance(value, list):
        inner = margin + " "
        return "[\n" + ",\n".join(inner + _json(item, depth - 1, inner) for item in value) + f"\n{margin}]"
    return value if type(value) is Written else json.dumps(value)
