"""RML as a monitor executes it, for the part that our writer writes: a second, independent reading of its text.

After Ancona and others, "RML: Theory and practice of a domain specific language for runtime verification": a
specification is rewritten by each event; where no rule applies the trace is rejected for good. ``\\/`` takes the first
side that can move; ``/\\`` needs both; ``>>`` lets other events pass; a block binds its variables at the first match.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from avow.backends.rosmonitoring.wires import NotANumber, exact
from oracle.rml_reader import Declared, Parsed, number, read

Binding = dict[str, Any]


@dataclass(frozen=True, slots=True)
class _Closure:
    """An expression with the values of its names."""

    tree: Any
    values: Mapping[str, Any]


_EMPTY = object()


class Interpreter:
    """Feed it events; it answers ``currently_true`` until the trace can no more be accepted, then ``false``."""

    def __init__(self, text: str) -> None:
        self._spec: Parsed = read(text)
        self._state: Any = _Closure(self._spec.equations["Main"][1], {})

    def step(self, event: Mapping[str, Any]) -> str:
        if self._state is not None:
            self._state = self._next(self._state, event)
        return "false" if self._state is None else "currently_true"

    def _next(self, state: Any, event: Mapping[str, Any]) -> Any:
        """The state after the event, or None."""
        if state is _EMPTY:
            return None
        if isinstance(state, tuple):
            return self._composite(state, event)
        tree, values = state.tree, state.values
        match tree.data:
            case "empty":
                return None
            case "either":
                for side in tree.children:
                    found = self._next(_Closure(side, values), event)
                    if found is not None:
                        return found
                return None
            case "both":
                return self._composite(("both", *(_Closure(side, values) for side in tree.children)), event)
            case "filtered":
                return self._composite(("filtered", tree.children[0], _Closure(tree.children[1], values)), event)
            case "star":
                return state if self._matches(tree.children[0], event, values) is not None else None
            case "sequence":
                binding = self._matches(tree.children[0], event, values)
                return None if binding is None else _Closure(tree.children[1], {**values, **binding})
            case "block":
                fresh = {str(name): None for name in tree.children[:-1]}
                return self._next(_Closure(tree.children[-1], {**values, **fresh}), event)
            case "call":
                parameters, body = self._spec.equations[str(tree.children[0])]
                arguments = [_evaluate(a, values) for a in tree.children[1:]]
                return self._next(_Closure(body, dict(zip(parameters, arguments, strict=True))), event)
            case other:
                raise AssertionError(f"no rule for {other}")

    def _composite(self, state: tuple[Any, ...], event: Mapping[str, Any]) -> Any:
        if state[0] == "both":
            sides = [self._next(side, event) for side in state[1:]]
            return None if any(side is None for side in sides) else ("both", *sides)
        _, relevant, inner = state
        if self._matches(relevant, event, {}) is None:
            return state
        after = self._next(inner, event)
        return None if after is None else ("filtered", relevant, after)

    def _matches(self, event_type: Any, event: Mapping[str, Any], values: Mapping[str, Any]) -> Binding | None:
        """The values of the names that the event type binds, if it matches."""
        name, *parameters = event_type.children
        if str(name) == "any":
            return {}
        declared = self._spec.events[str(name), len(parameters)]
        given = {}
        for formal, actual in zip(declared.parameters, parameters, strict=True):
            value = values.get(str(actual.children[0])) if actual.data == "name" else None
            if value is not None:
                given[formal] = value
        for binding in self._options(declared, event):
            if any(binding.get(k, v) != v for k, v in given.items()):
                continue
            whole = {**binding, **given}
            if declared.condition is None or _holds(declared.condition, whole):
                pairs = zip(declared.parameters, parameters, strict=True)
                return {str(a.children[0]): whole[f] for f, a in pairs if a.data == "name" and f in whole}
        return None

    def _options(self, declared: Declared, event: Mapping[str, Any]) -> list[Binding]:
        return [b for pattern in declared.patterns for b in _match(pattern, event)]


def _match(pattern: Any, value: Any) -> list[Binding]:
    """Every way in which a value matches a pattern (or one of its alternatives)."""
    match pattern.data:
        case "pattern":
            return [b for shape in pattern.children for b in _match(shape, value)]
        case "object":
            if not isinstance(value, Mapping):
                return []
            found: list[Binding] = [{}]
            for pair in pattern.children:
                name, inner = str(pair.children[0]), pair.children[1]
                if name not in value:
                    return []
                found = [{**one, **other} for one in found for other in _match(inner, value[name])]
            return found
        case "string":
            return [{}] if isinstance(value, str) and f"'{value}'" == str(pattern.children[0]) else []
        case "integer" | "float":
            amount = _number(value)
            return [{}] if amount is not None and amount == number(pattern) else []
        case "true" | "false":
            return [{}] if value is (pattern.data == "true") else []
        case "variable":
            amount = _number(value)
            return [] if amount is None else [{str(pattern.children[0]): amount}]
        case _:  # the wildcard
            return [{}]


def _number(value: Any) -> Fraction | None:
    """Our conditions are about numbers; what is none is taken to match nothing (the file says so)."""
    if isinstance(value, bool) or not isinstance(value, int | float | bytes):
        return None
    try:
        return Fraction(exact(value))
    except NotANumber:
        return None


def _holds(tree: Any, values: Mapping[str, Any]) -> bool:
    match tree.data:
        case "all":
            return all(_holds(c, values) for c in tree.children)
        case "any":
            return any(_holds(c, values) for c in tree.children)
        case _:  # a comparison
            left, operator, right = tree.children
            a, b = _evaluate(left, values), _evaluate(right, values)
            return {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[
                str(operator.children[0])
            ]


def _evaluate(tree: Any, values: Mapping[str, Any]) -> Fraction:
    match tree.data:
        case "name":
            found: Fraction = values[str(tree.children[0])]
            return found
        case "arithmetic":
            left, operator, right = tree.children
            a, b = _evaluate(left, values), _evaluate(right, values)
            return a + b if operator == "+" else a - b if operator == "-" else a * b
        case "applied":
            function, left, right = tree.children
            return {"max": max, "min": min}[str(function)](_evaluate(left, values), _evaluate(right, values))
        case _:  # a number
            return number(tree)
