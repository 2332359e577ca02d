"""Runs the subject, and nothing else, in a process of its own: what it prints, patches or breaks stays here.

A script without imports from Avow. Each line of JSON that comes in holds the inputs of some
cases; a line with an answer for each goes out.
Values of the contract are given to the subject as plain Python: an element of an enumeration is a string, a REAL is a
`Fraction`, ``move(1, 2)`` is ``("move", 1, 2)``, a sequence is a tuple, a function or relation is a `Table`.
"""

from __future__ import annotations

import enum
import importlib.util
import inspect
import json
import os
import sys
import traceback
from collections.abc import Iterator, Mapping
from decimal import Decimal
from fractions import Fraction
from typing import Any


class Table:
    """A function given by finitely many points and a default; call it, or look at its points.

    ``wayP(x, y, 3)``; ``wayP.points()`` are the points at which a relation holds, or at which another function differs
    from its default (without their values; those come from calling it); ``before.updated(4, True)`` is a changed copy.
    """

    def __init__(self, table: Mapping[Any, Any], default: Any) -> None:
        self._table = {k if isinstance(k, tuple) else (k,): v for k, v in table.items()}
        self.default = default

    def __call__(self, *arguments: Any) -> Any:
        return self._table.get(arguments, self.default)

    def points(self) -> list[Any]:
        """Points whose value is not the default; bare values where the function has one parameter."""
        different = (k for k, v in self._table.items() if v != self.default)
        return [k[0] if len(k) == 1 else k for k in different]

    def items(self) -> list[tuple[Any, Any]]:
        """(point, value) pairs for `points()`."""
        return [(k, self(*k) if isinstance(k, tuple) else self(k)) for k in self.points()]

    def updated(self, *point_and_value: Any) -> Table:
        """A copy with another value at one point: ``t.updated(x, y, value)``."""
        *point, value = point_and_value
        return Table({**self._table, tuple(point): value}, self.default)

    def __iter__(self) -> Iterator[Any]:
        return iter(self.points())

    def __contains__(self, point: object) -> bool:
        return point in self.points()

    def __len__(self) -> int:
        return len(self.points())

    def __repr__(self) -> str:
        return f"Table({dict(self.items())!r}, default={self.default!r})"


def plain(data: Any) -> Any:
    """A value as the judge sends it, as the subject gets it."""
    match data:
        case {"q": [numerator, denominator]}:
            return Fraction(numerator, denominator)
        case {"t": items}:
            return tuple(plain(item) for item in items)
        case {"f": rows, "d": default}:
            return Table({tuple(plain(a) for a in point): plain(value) for point, value in rows}, plain(default))
        case _:
            return data


def coded(value: Any, depth: int = 0) -> Any:
    """Whatever the subject returned, as JSON; what no contract has is named by its type."""
    if depth > 20:
        return {"?": "something nested too deeply"}
    inner = depth + 1
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, enum.Enum):
        return str(value.name)
    if isinstance(value, str):
        return str.__str__(value)
    if isinstance(value, int):
        return {"q": [str(int(value)), "1"], "w": True}
    if isinstance(value, Fraction | Decimal | float):
        try:
            numerator, denominator = value.as_integer_ratio()
        except (ValueError, OverflowError):
            return {"?": f"the number {value}"}
        return {"q": [str(numerator), str(denominator)]}
    if isinstance(value, Table):
        rows = [[[coded(a, inner) for a in k], coded(v, inner)] for k, v in value._table.items()]
        return {"f": rows, "d": coded(value.default, inner)}
    if isinstance(value, Mapping):
        rows = [[coded(k, inner) if k is not ... else {"...": True}, coded(v, inner)] for k, v in value.items()]
        return {"m": rows}
    if isinstance(value, set | frozenset):
        return {"s": [coded(item, inner) for item in value]}
    if isinstance(value, tuple | list):
        return {"t": [coded(item, inner) for item in value]}
    return {"?": f"a value of type {type(value).__name__}"}


def load(path: str, function: str) -> Any:
    spec = importlib.util.spec_from_file_location("avow_subject", path)
    if spec is None or spec.loader is None:
        raise ImportError(f"{path} is no Python module")
    module = importlib.util.module_from_spec(spec)
    sys.modules["avow_subject"] = module
    sys.path.insert(0, os.path.dirname(path))  # noqa: PTH120 - its own neighbours, as if it were run
    spec.loader.exec_module(module)
    return getattr(module, function)


def accepted(function: Any) -> frozenset[str] | None:
    """The keyword arguments that it takes; None: all."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return None
    if any(p.kind is p.VAR_KEYWORD for p in parameters):
        return None
    return frozenset(p.name for p in parameters)


def answer(function: Any, known: frozenset[str] | None, request: Mapping[str, Any]) -> dict[str, Any]:
    try:
        inputs = {name: plain(value) for name, value in request.items() if known is None or name in known}
        return {"value": coded(function(**inputs))}
    except BaseException as error:
        return {"error": _told(error)}


def _told(error: BaseException) -> str:
    """The error and where in the subject it came from."""
    try:
        place = next((f for f in reversed(traceback.extract_tb(error.__traceback__)) if f.filename != __file__), None)
        where = f" ({os.path.basename(place.filename)}, line {place.lineno})" if place else ""  # noqa: PTH119
        return f"{type(error).__name__}: {error}"[:500] + where
    except BaseException:
        return type(error).__name__


def main() -> None:
    path, function, source, sink = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    with os.fdopen(source, "r", encoding="utf-8") as requests, os.fdopen(sink, "w", encoding="utf-8") as answers:
        try:
            subject = load(path, function)
            known = accepted(subject)
            ready: dict[str, Any] = {"ready": True}
        except BaseException as error:
            ready = {"error": _told(error)}
        answers.write(json.dumps(ready) + "\n")
        answers.flush()
        if "error" in ready:
            return
        for line in requests:
            replies = [answer(subject, known, request) for request in json.loads(line)]
            answers.write(json.dumps(replies) + "\n")
            answers.flush()


if __name__ == "__main__":
    sys.setrecursionlimit(2000)
    main()
    os._exit(0)
