"""JSON and YAML text that is easy to read and fast to write, also for ten thousand obligations."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any

from avow.report.wording import clean

_SPECIAL = re.compile("[\x7f-\x9f\u2028\u2029\ufeff]")


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
    return json.dumps(value)


def yaml_text(elements: Mapping[str, Mapping[str, Any]]) -> str:
    """Two levels of YAML with texts in double quotes: names → (key → text, list of names or Boolean)."""
    lines = []
    for name, body in elements.items():
        lines.append(f"{name}:")
        for key, value in body.items():
            if isinstance(value, str):
                shown = quoted(value)
            elif isinstance(value, bool):
                shown = "true" if value else "false"
            else:
                shown = f"[{', '.join(map(str, value))}]"
            lines.append(f"  {key}: {shown}")
    return "\n".join(lines) + "\n"


def quoted(text: str) -> str:
    """A double-quoted YAML scalar: a JSON string, with the characters escaped that YAML reads as line breaks."""
    escaped = json.dumps(clean(text), ensure_ascii=False)
    return _SPECIAL.sub(lambda match: f"\\u{ord(match.group()):04x}", escaped)
