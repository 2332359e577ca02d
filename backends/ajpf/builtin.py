"""Actions that compute: AIL's environments execute them themselves, and they still count as actions."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from .terms import Bindings, Struct, Term, Var, plain


class Crash(Exception):  # noqa: N818 - it names what the agent does
    """AIL would end with a Java exception here; the text is a clause for people."""


def _divide(x: float, y: float) -> float:
    if y != 0:
        return x / y
    return float("nan") if x == 0 else float("inf") if x > 0 else float("-inf")


_ARITHMETIC: Mapping[str, Callable[[float, float], float]] = {
    "sum": lambda x, y: x + y,
    "minus": lambda x, y: x - y,
    "times": lambda x, y: x * y,
    "div": _divide,
}
_OPERATORS: Mapping[str, Callable[[float, float], float]] = {
    "+": _ARITHMETIC["sum"],
    "-": _ARITHMETIC["minus"],
}
COMPUTING = frozenset((*_ARITHMETIC, "append", "toString"))


def compute(action: Struct) -> Bindings:
    """The bindings that result from the action. Raises Crash."""
    if action.functor in _ARITHMETIC and len(action.args) >= 3:
        left, right = number(action.args[0]), number(action.args[1])
        if left is None or right is None:
            raise Crash(f"{plain(action)} computes with what is no number")
        return _bound(action, 2, Struct(shown(_ARITHMETIC[action.functor](left, right))))
    if action.functor == "append" and len(action.args) >= 3:
        texts = [text(arg) for arg in action.args[:2]]
        if None in texts:
            raise Crash(f"{plain(action)} appends what is no text")
        return _bound(action, 2, Struct('"' + "".join(t or "" for t in texts) + '"'))
    if action.functor == "toString" and len(action.args) >= 2:
        return _bound(action, 1, Struct(f'"{plain(action.args[0])}"'))
    return {}


def _bound(action: Struct, at: int, value: Struct) -> Bindings:
    result = action.args[at]
    if not isinstance(result, Var):
        raise Crash(f"the result of {plain(action)} is no free variable")
    return {result.name: value}


def compare(test: str, term: Term, bindings: Bindings) -> Iterator[Bindings]:
    """Two numbers compared; ``==`` with one side free binds it. A comparison that cannot be computed does not hold."""
    assert isinstance(term, Struct)
    left, right = term.args
    values = (value_of(left), value_of(right))
    if values[0] is not None and values[1] is not None:
        if values[0] < values[1] if test == "<" else values[0] == values[1]:
            yield bindings
        return
    for side, value in ((left, values[1]), (right, values[0])):
        if test == "==" and isinstance(side, Var) and value is not None:
            yield {**bindings, side.name: Struct(shown(value))}
            return


def value_of(term: Term) -> float | None:
    """The value of an arithmetic expression; None if it has a free variable, or no value."""
    if isinstance(term, Struct) and term.functor in _OPERATORS and len(term.args) == 2:
        left, right = map(value_of, term.args)
        if left is None or right is None:
            return None
        return _OPERATORS[term.functor](left, right)
    return number(term)


def computed(term: Term) -> Term:
    """The term with its arithmetic expressions replaced by their values, if they have one."""
    if isinstance(term, Var) or not term.args:
        return term
    value = value_of(term)
    return Struct(shown(value)) if value is not None else Struct(term.functor, tuple(map(computed, term.args)))


def number(term: Term) -> float | None:
    """The value of a number; None for anything else."""
    if isinstance(term, Var) or term.args or not term.functor[-1:].isdigit():
        return None
    try:
        return float(term.functor)
    except ValueError:
        return None


def text(term: Term) -> str | None:
    if isinstance(term, Struct) and term.functor[:1] in ("'", '"') and not term.args:
        return term.functor[1:-1]
    return None


def shown(value: float) -> str:
    """A number as AIL writes it: 4.0 is 4."""
    if value == int(value) if abs(value) < 1e15 else False:
        return str(int(value))
    return repr(value)
