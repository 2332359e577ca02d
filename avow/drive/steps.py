"""A step class, driven: constructed with its parameters, given its memory, called for one step after another.

A step class has ``__init__(self, params)`` (or ``__init__(self)``) and ``step(self, **inputs)``, which returns its one
output, or a dict of outputs by name. Memory is held in attributes.

Values are passed as JSON that keeps every bit: a float is ``{"f": hexadecimal}``, an int ``{"i": digits}``, a Fraction
``{"q": [numerator, denominator]}``, a list ``{"l": [...]}``, a tuple argument ``{"t": [...]}``; truth values
and texts are their own JSON.
"""

from __future__ import annotations

import enum
import json
from collections.abc import Callable
from fractions import Fraction
from typing import Any


def plain(data: Any) -> Any:
    """The Python value that the data stands for. Raises ValueError."""
    match data:
        case None | bool() | str():
            return data
        case {"f": str(text)}:
            return float.fromhex(text)
        case {"i": str(digits)}:
            return int(digits)
        case {"q": [str(numerator), str(denominator)]}:
            return Fraction(int(numerator), int(denominator))
        case {"l": list(items)}:
            return [plain(item) for item in items]
        case {"t": list(items)}:
            return tuple(plain(item) for item in items)
        case {"d": list(pairs)}:
            return {str(key): plain(value) for key, value in pairs}
        case _:
            raise ValueError("no value of a step")


def coded(value: Any, depth: int = 0) -> Any:
    """A value as data; a value that no step may return is replaced by the name of its type."""
    inner = depth + 1
    if depth > 10:
        return {"?": "something nested too deeply"}
    if value is None or type(value) in (bool, str):
        return value
    if isinstance(value, enum.Enum):
        return str(value.name)
    if type(value) is int:
        return {"i": str(value)}
    if type(value) is float:
        return {"f": value.hex()}
    if type(value) is Fraction:
        return {"q": [str(value.numerator), str(value.denominator)]}
    if type(value) in (list, tuple):
        return {"l": [coded(item, inner) for item in value]}
    if type(value) is dict and all(type(key) is str for key in value):
        return {"d": [[key, coded(item, inner)] for key, item in value.items()]}
    return {"?": f"a value of type {type(value).__name__}"}


def _kept_as(before: Any, value: Any) -> Any:
    """The value for an attribute: if it holds a member of an enumeration, the member named by a text."""
    if isinstance(before, enum.Enum) and isinstance(value, str):
        return type(before).__members__.get(value, value)
    return value


def driver(made: Any, spec: Any) -> Callable[[str], str]:
    """The function that answers a case: a run of the class `made` from a start. `spec` has its parameters and its
    memory."""
    code = getattr(made.__init__, "__code__", None)
    wants = code is not None and code.co_argcount > 1
    memory: dict[str, str] = dict(spec["memory"])
    shown = list(spec["attributes"])

    def start() -> Any:
        return made(plain(spec["params"])) if wants else made()

    def held(node: Any) -> dict[str, Any]:
        return {port: coded(getattr(node, attribute)) for port, attribute in memory.items()}

    def others(node: Any) -> dict[str, str]:
        inside = {k: v for k, v in vars(node).items() if k not in memory.values()}
        return {k: json.dumps(coded(v)) for k, v in inside.items()}

    kept: list[Any] = []

    def run(case: str) -> str:
        asked = json.loads(case)
        node = kept[0] if asked.get("on") else start()  # "on": the run continues with the object of the previous case
        kept[:] = [node]
        for port, value in (asked.get("memory") or {}).items():
            setattr(node, memory[port], _kept_as(getattr(node, memory[port], None), plain(value)))
        answers: list[dict[str, Any]] = []
        said = {name: coded(getattr(node, name, None)) for name in shown}
        for inputs in asked["steps"]:
            before = others(node)
            answer: dict[str, Any] = {"before": held(node)}
            try:
                value = node.step(**{name: plain(data) for name, data in inputs.items()})
                answer["value"] = coded(value)
            except Exception as error:
                answer["error"] = type(error).__name__
                answer["why"] = f"{type(error).__name__}: {error}"[:300]
            answer["memory"] = held(node)
            after = others(node)
            answer["changed"] = sorted(k for k in {*before, *after} if before.get(k) != after.get(k))
            answers.append(answer)
            if "error" in answer:
                break
        return json.dumps({"start": said, "steps": answers, "held": held(node)})

    return run
