"""What `language` means, by brute force: nothing here is Avow's.

A formula is True, False, or None where it hangs on a division by zero or on an element that a sequence does not have.
"""

from __future__ import annotations

import operator
from collections.abc import Mapping
from fractions import Fraction
from itertools import product
from typing import Any

from differential.language import Expr, Statement

ORDERS = {
    "<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge, "==": operator.eq, "!=": operator.ne,
}  # fmt: skip
MANY = range(16)
REALS = tuple(Fraction(n, 2) for n in (-3, 0, 1, 3, 8))


class Undefined(Exception):  # noqa: N818 - a value that there is not
    pass


class Table(dict[int, Any]):
    """A total function: points, and what it is elsewhere. Equal where all values are."""

    def __init__(self, points: Mapping[int, Any], default: Any) -> None:
        super().__init__({k: v for k, v in points.items() if v != default})
        self.default = default

    def __call__(self, at: int) -> Any:
        return self.get(at, self.default)

    def updated(self, at: int, value: Any) -> Table:
        return Table({**self, at: value}, self.default)


State = Mapping[str, Any]


def truth(e: Expr, state: State) -> bool | None:
    """Of formulas: three-valued, so that what is undefined matters only where the formula hangs on it."""
    op, _, *parts = e
    match op:
        case "and" | "or" | "->":
            found = [truth(p, state) for p in parts]
            if op == "->":
                op, found[0] = "or", None if found[0] is None else not found[0]
            end = op == "or"
            return end if end in found else None if None in found else not end
        case "not":
            inner = truth(parts[0], state)
            return None if inner is None else not inner
        case "<=>" | "xor":
            one, other = truth(parts[0], state), truth(parts[1], state)
            return None if None in (one, other) else (one == other) is (op == "<=>")
        case "ite":
            test = truth(parts[0], state)
            return None if test is None else truth(parts[1 if test else 2], state)
        case "forall" | "exists" | "exists_unique" | "each" | "some":
            return _quantified(op, parts, state)
    try:
        return bool(value(e, state))
    except Undefined:
        return None


def _quantified(op: str, parts: list[Any], state: State) -> bool | None:
    if op in {"each", "some"}:
        try:
            low, high = int(value(parts[1], state)), int(value(parts[2], state))
        except Undefined:
            return None
        # a variable over a sequence of naturals is a natural: a range from below 0 gives it nothing there
        cases = [{parts[0]: k} for k in range(low, high + 1)]
        body, op = parts[3], "forall" if op == "each" else "exists"
    else:
        body = parts[1]
        cases = [
            dict(zip([n for n, _ in parts[0]], c, strict=True))
            for c in product(*(_range(s, state) for _, s in parts[0]))
        ]
    found = [truth(body, {**state, **case}) for case in cases]
    if op == "exists_unique":
        return False if found.count(True) > 1 else None if None in found else found.count(True) == 1
    end = op == "exists"
    return end if end in found else None if None in found else not end


def _range(sort: str, state: State) -> Any:
    if sort == "N":
        return MANY
    if sort == "C":
        return ("red", "orange", "green")
    numbers = set(_numbers(state.values()))
    return {n for n in numbers if n == int(n)} | set(range(-6, 12)) if sort == "I" else numbers | set(REALS)


def _numbers(values: Any) -> Any:
    for found in values:
        if isinstance(found, tuple):
            yield from _numbers(found)
        elif isinstance(found, int | Fraction) and not isinstance(found, bool):
            yield found


def value(e: Expr, state: State) -> Any:
    """Raises Undefined."""
    op, _, *parts = e
    if op in {"and", "or", "not", "->", "<=>", "xor", "forall", "exists", "exists_unique", "each", "some"}:
        found = truth(e, state)
        if found is None:
            raise Undefined
        return found
    if op == "cmp":
        items = [value(p, state) for p in parts[1:]]
        return all(ORDERS[c](a, b) for a, c, b in zip(items, parts[0], items[1:], strict=False))
    if op in {"elem", "num"}:
        return parts[0]
    if op == "true":
        return True
    if op == "var":
        return state[parts[0]]
    if op == "data":
        return (parts[0], *(value(p, state) for p in parts[1:]))
    if op == "ite":
        test = truth(parts[0], state)
        if test is None:
            raise Undefined
        return value(parts[1 if test else 2], state)
    sub = [value(p, state) for p in parts]
    match op:
        case "abs":
            return max(sub[0], -sub[0])
        case "min":
            return sorted(sub)[0]
        case "max":
            return sorted(sub)[-1]
        case "mod" | "div":
            rest = next(r for r in range(int(sub[1])) if (sub[0] - r) / Fraction(sub[1]) == (sub[0] - r) // sub[1])
            return rest if op == "mod" else (sub[0] - rest) // sub[1]
        case "widen":
            return sub[0]
        case "neg":
            return -sub[0]
        case "+":
            return sub[0] + sub[1]
        case "-":
            return sub[0] - sub[1]
        case "*":
            return sub[0] * sub[1]
        case "/":
            if sub[1] == 0:
                raise Undefined
            return Fraction(sub[0]) / sub[1]
        case "in":
            return sub[0] in sub[1:]
        case "!in":
            return sub[0] not in sub[1:]
        case "near":
            return sub[0] in ("red", "orange")
        case "within":
            return sub[0] in sub[1]
        case "app":
            if sub[1] < 0:
                raise Undefined
            return sub[0](sub[1])
        case "nth":
            if not 0 <= sub[1] < len(sub[0]):
                raise Undefined
            return sub[0][int(sub[1])]
        case "len":
            return len(sub[0])
        case "seq" | "pair":
            return tuple(sub)
    raise AssertionError(op)


class Stops(Exception):  # noqa: N818 - a run without an output
    pass


def run(block: list[Statement], inputs: State, sorts: Mapping[str, str]) -> dict[str, Any]:
    """The outputs of a run, as ``out.x``. Raises Stops. Tests are computed from the left, as far as needed."""
    state = dict(inputs)
    _block(block, state, sorts)
    return {k: v for k, v in state.items() if k.startswith("out.")}


def _block(block: list[Statement], state: dict[str, Any], sorts: Mapping[str, str]) -> None:
    for kind, *parts in block:
        match kind:
            case "set":
                found = _computed(parts[1], state)
                if sorts[parts[0]] == "N" and found < 0:
                    raise Stops
                state[f"out.{parts[0]}"] = found
            case "update":
                at, found = _computed(parts[1], state), _computed(parts[2], state)
                state[f"out.{parts[0]}"] = state[f"out.{parts[0]}"].updated(at, found)
            case "if":
                _block(parts[1] if _computed(parts[0], state) else parts[2], state, sorts)
            case "match":
                command = state["in.command"]
                if command[0] == parts[0]:
                    _bound(parts, state, sorts)
                else:
                    _block(parts[3], state, sorts)


def _bound(parts: list[Any], state: dict[str, Any], sorts: Mapping[str, str]) -> None:
    inner = state | dict(zip(parts[1], state["in.command"][1:], strict=True))
    _block(parts[2], inner, sorts)
    state.update({k: v for k, v in inner.items() if k.startswith("out.")})


def _computed(e: Expr, state: State) -> Any:
    try:
        return _strict(e, state)
    except Undefined:
        raise Stops from None


def _strict(e: Expr, state: State) -> Any:
    """Programs compute: ``and`` and ``or`` stop at the part that decides; an undefined part before it ends the run."""
    op, _, *parts = e
    if op == "and":
        return all(_strict(p, state) for p in parts)
    if op == "or":
        return any(_strict(p, state) for p in parts)
    if op == "->":
        return not _strict(parts[0], state) or _strict(parts[1], state)
    if op == "not":
        return not _strict(parts[0], state)
    if op == "<=>":
        return _strict(parts[0], state) == _strict(parts[1], state)
    return value(e, state)
