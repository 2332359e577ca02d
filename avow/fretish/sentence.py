"""A FRETish sentence as its fields: scope, condition, component, timing, response."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, TypeVar

from lark import Lark, Token, Tree
from lark.exceptions import UnexpectedInput

from avow.base.grammars import lark_of, misfit


@dataclass(frozen=True, slots=True)
class Expression:
    """A ``name``, ``number`` or ``truth`` value with its `text`; a ``call`` of the function that `text` names; or a
    `sign` (``!``, ``-``, ``=>``, ``|``, ``xor``, ``&``, a relation, an operation on numbers) applied to `parts`."""

    sign: str
    parts: tuple[Expression, ...] = ()
    text: str = ""


FORM = "a sentence is  [in MODE] [when CONDITION] the COMPONENT shall [within 3 seconds] satisfy RESPONSE"


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
    if re.match(r"\s*not\s+in\b", text, re.IGNORECASE):
        raise Unreadable("a scope with `not in` begins with `when` or `if`", 1)
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
        negative = (kind == "unless") != bool(truth and str(truth[0].children[-1]).lower() == "false")
        said = denied(said) if negative else said
        either = any(str(token).lower() == "or" for token in words)
        trigger = said if trigger is None else Expression("|" if either else "&", (trigger, said))
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
    match tree.data:
        case "name" | "number":
            return Expression(tree.data, text=str(parts[0]))
        case "true" | "false":
            return Expression("truth", text=tree.data.upper())
        case "group":
            return _expression(parts[0])
        case "denied":
            return denied(_expression(parts[0]))
        case "minus":
            return Expression("-", (_expression(parts[-1]),))
        case "implies":
            return Expression("=>", tuple(map(_expression, parts)))
        case "call":
            return Expression("call", tuple(map(_expression, parts[1:])), str(parts[0]))
        case "sign_implies":
            left, arrow, *inner = parts
            _alone(arrow, left)
            return Expression("=>", (_expression(left), Expression("=>", tuple(map(_expression, inner)))))
        case _:  # a sign between two parts
            left, operator, right = parts
            _alone(operator, left)
            sign = str(operator).lower()
            return Expression(_SIGNS.get(sign, sign), (_expression(left), _expression(right)))


def denied(body: Expression) -> Expression:
    """The negation."""
    return Expression("!", (body,))


def _alone(arrow: Token, left: Any) -> None:
    """FRET's grammar groups a chain of arrows from the left, and the tools that receive the text from the right."""
    if arrow.type in _ARROWS and left.data == "sign" and left.children[1].type in _ARROWS:
        raise Unreadable(
            f"a chain of arrows is read in two ways: write parentheses before this `{arrow}`", arrow.column or 1
        )


_ARROWS = ("IMPLIES", "IFF")

FIRST = "FTP"
"""FRET's name for the predicate: this is the first step of the run."""


_SIGNS = {"->": "=>", "<->": "<=>"}
