"""A FRETish sentence as its fields: scope, condition, component, timing, response."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar, assert_never

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput

from avow.base.grammars import lark_of, misfit


@dataclass(frozen=True, slots=True)
class Name:
    text: str


@dataclass(frozen=True, slots=True)
class Number:
    text: str


@dataclass(frozen=True, slots=True)
class Truth:
    value: bool


@dataclass(frozen=True, slots=True)
class Denied:
    body: Expression


@dataclass(frozen=True, slots=True)
class Minus:
    body: Expression


@dataclass(frozen=True, slots=True)
class Sign:
    """``=>``, ``<=>``, ``|``, ``xor``, ``&``, a relation, or an operation on numbers."""

    operator: str
    left: Expression
    right: Expression


@dataclass(frozen=True, slots=True)
class Call:
    name: str
    arguments: tuple[Expression, ...]


Expression = Name | Number | Truth | Denied | Minus | Sign | Call


def parts(expression: Expression) -> tuple[Expression, ...]:
    """The direct parts of an expression."""
    match expression:
        case Denied(body=body) | Minus(body=body):
            return (body,)
        case Sign(left=left, right=right):
            return (left, right)
        case Call(arguments=arguments):
            return arguments
        case Name() | Number() | Truth():
            return ()
        case _:
            assert_never(expression)


class Scope(StrEnum):
    """When a requirement is in force."""

    ALWAYS = "null"
    IN = "in"
    NOT_IN = "notin"
    BEFORE = "before"
    AFTER = "after"
    ONLY_IN = "onlyIn"
    ONLY_BEFORE = "onlyBefore"
    ONLY_AFTER = "onlyAfter"


class Condition(StrEnum):
    """The trigger: the beginning of the scope, the condition becoming true, or the condition being true."""

    NONE = "null"
    REGULAR = "regular"
    HOLDING = "holding"


class Timing(StrEnum):
    """When the response has to occur."""

    IMMEDIATELY = "immediately"
    NEXT = "next"
    WITHIN = "within"
    FOR = "for"
    AFTER = "after"
    UNTIL = "until"
    BEFORE = "before"
    EVENTUALLY = "eventually"
    ALWAYS = "always"
    NEVER = "never"
    FINALLY = "finally"


@dataclass(frozen=True, slots=True)
class Duration:
    """A number and RCL's unit."""

    number: str
    unit: str


@dataclass(frozen=True, slots=True)
class Sentence:
    """The fields. `trigger` is present with a condition, `stop` with `until` and `before`, `duration` with `within`,
    `for` and `after`, `mode` with every scope but the whole run."""

    component: str
    response: Expression
    timing: Timing = Timing.EVENTUALLY
    scope: Scope = Scope.ALWAYS
    mode: Expression | None = None
    condition: Condition = Condition.NONE
    trigger: Expression | None = None
    stop: Expression | None = None
    duration: Duration | None = None


_Read = TypeVar("_Read")


def is_assumption(name: str) -> bool:
    """Whether FRET's tools treat a requirement of that name as an assumption."""
    return "assum" in name.lower()


class Unreadable(Exception):  # noqa: N818 - it names what happened
    """Not FRETish: what was found, and the column, counted from 1."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(message)
        self.message = message
        self.column = column


def parse(text: str) -> Sentence:
    """Raises Unreadable."""
    return _shallow(lambda: _sentence(_tree(text, "sentence")))


def parse_expression(text: str) -> Expression:
    """Raises Unreadable."""
    return _shallow(lambda: _expression(_tree(text, "expression")))


def _shallow(read: Callable[[], _Read]) -> _Read:
    try:
        return read()
    except RecursionError:
        raise Unreadable("the sentence is too deep to be one requirement", 1) from None


def _tree(text: str, start: str) -> Any:
    if (found := re.search(r"at\s+the\s+(?:previous|next)\s+occurrence", text, re.IGNORECASE)) is not None:
        raise Unreadable(f"`{found[0]}` is not read: say it with `since` in RCL", found.start() + 1)
    try:
        return _lark().parse(_without_commas(text), start=start)
    except UnexpectedInput as error:
        word, at = misfit(error, text)
        what = f"did not expect `{word}` here" if word else "the sentence ends too early"
        raise Unreadable(what, at + 1) from None


def _without_commas(text: str) -> str:
    """Replaces commas outside parentheses, which have no meaning; positions are unchanged."""
    depth, out = 0, []
    for sign in text:
        depth += (sign == "(") - (sign == ")")
        out.append(" " if sign == "," and depth == 0 else sign)
    return re.sub(r"\.(\s*)\Z", r" \1", "".join(out))


def _lark() -> Lark:
    grammar, starts = Path(__file__).with_name("fretish.lark"), ("sentence", "expression")
    found: Lark = lark_of(grammar, "fretish", starts, maybe_placeholders=False)
    return found


def _sentence(tree: Any) -> Sentence:
    fields: dict[str, Any] = {"response": _expression(tree.children[-1])}
    for part in tree.children[:-1]:
        if part.data == "component":
            fields["component"] = str(part.children[0])
        elif part.data in _SCOPES:
            fields |= {"scope": _SCOPES[part.data], "mode": _expression(part.children[-1])}
        elif part.data == "conditions":
            fields |= _conditions([c for c in part.children if isinstance(c, Tree)])
        else:
            fields |= _timing(part)
    return Sentence(**fields)


_SCOPES = {
    "in_mode": Scope.IN,
    "not_in": Scope.NOT_IN,
    "before": Scope.BEFORE,
    "after": Scope.AFTER,
    "only_in": Scope.ONLY_IN,
    "only_before": Scope.ONLY_BEFORE,
    "only_after": Scope.ONLY_AFTER,
}


def _conditions(parts: list[Any]) -> dict[str, Any]:
    trigger: Expression | None = None
    holding = False
    for part in parts:
        words = [c for c in part.children if isinstance(c, Token)]
        (word, expression, *truth) = [c for c in part.children if isinstance(c, Tree)]
        kind = str(word.children[0]).lower() if word.children else "when"
        said = _expression(expression)
        denied = (kind == "unless") != bool(truth and str(truth[0].children[-1]).lower() == "false")
        said = Denied(said) if denied else said
        either = any(str(token).lower() == "or" for token in words)
        trigger = said if trigger is None else Sign("|" if either else "&", trigger, said)
        holding = holding or kind == "whenever"
    return {"trigger": trigger, "condition": Condition.HOLDING if holding else Condition.REGULAR}


def _timing(tree: Any) -> dict[str, Any]:
    timing = Timing(tree.data.rstrip("_"))
    if timing in (Timing.UNTIL, Timing.BEFORE):
        return {"timing": timing, "stop": _expression(tree.children[0])}
    if timing in (Timing.WITHIN, Timing.FOR, Timing.AFTER):
        number, unit = tree.children[0].children
        return {"timing": timing, "duration": Duration(str(number), _unit(str(unit)))}
    return {"timing": timing}


def _unit(word: str) -> str:
    starts = {"tick": "steps", "micro": "us", "milli": "ms", "sec": "s", "min": "min", "hour": "h"}
    return next(unit for start, unit in starts.items() if word.lower().startswith(start))


def _expression(tree: Any) -> Expression:
    parts = tree.children
    make: dict[str, Callable[[], Expression]] = {
        "name": lambda: Name(str(parts[0])),
        "number": lambda: Number(str(parts[0])),
        "true": lambda: Truth(True),
        "false": lambda: Truth(False),
        "group": lambda: _expression(parts[0]),
        "denied": lambda: Denied(_expression(parts[0])),
        "minus": lambda: Minus(_expression(parts[-1])),
        "implies": lambda: Sign("=>", _expression(parts[0]), _expression(parts[1])),
        "call": lambda: Call(str(parts[0]), tuple(map(_expression, parts[1:]))),
    }
    if tree.data == "sign_implies":
        left, arrow, *inner = parts
        _alone(arrow, left)
        return Sign("=>", _expression(left), Sign("=>", *map(_expression, inner)))
    if tree.data == "sign":
        left, operator, right = parts
        _alone(operator, left)
        return Sign(_SIGNS.get(str(operator).lower(), str(operator)), _expression(left), _expression(right))
    return make[tree.data]()


def _alone(arrow: Token, left: Any) -> None:
    """FRET's grammar groups a chain of arrows from the left, and the tools that receive the text from the right."""
    if arrow.type in _ARROWS and left.data == "sign" and left.children[1].type in _ARROWS:
        raise Unreadable(
            f"a chain of arrows is read in two ways: write parentheses before this `{arrow}`", arrow.column or 1
        )


_ARROWS = ("IMPLIES", "IFF")

FIRST = "FTP"
"""FRET's name for the predicate: this is the first step of the run."""


_SIGNS = {"->": "=>", "<->": "<=>", "xor": "xor", "mod": "mod"}
