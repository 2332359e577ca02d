"""RML specifications as data, and their text. The tests read back the text that this module writes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction
from typing import assert_never

from avow.base.plain import decimal
from avow.formulas.flattening import joined
from avow.language.operators import OPPOSITE

KEYWORDS = frozenset(
    "not matches with empty all var let if else abs sin cos tan min max true false null any none".split()  # noqa: SIM905
)
LOWER = re.compile(r"[a-z][A-Za-z0-9_]*\Z")
STRING = re.compile(r"[A-Za-z0-9_./ -]*\Z")


class NotRml(Exception):  # noqa: N818 - it says what a text or a formula is
    """Something that RML cannot express; the text gives the reason, for people."""


# -- numbers and conditions --------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class Name:
    name: str


@dataclass(frozen=True, slots=True)
class Number:
    value: Fraction


@dataclass(frozen=True, slots=True)
class Calculation:
    operator: str
    left: Numeric
    right: Numeric


Numeric = Name | Number | Calculation
FUNCTIONS = ("max", "min")
"""Operators of a `Calculation` that are written as functions."""


@dataclass(frozen=True, slots=True)
class Comparison:
    operator: str
    left: Numeric
    right: Numeric


@dataclass(frozen=True, slots=True)
class Every:
    """Conjunction; empty: true."""

    items: tuple[Condition, ...] = ()


@dataclass(frozen=True, slots=True)
class Some:
    """Disjunction; empty: false."""

    items: tuple[Condition, ...] = ()


Condition = Comparison | Every | Some
TRUE, FALSE = Every(), Some()


def compare(operator: str, left: Numeric, right: Numeric) -> Condition:
    """A comparison, decided at once if both sides are numbers."""
    if isinstance(left, Number) and isinstance(right, Number):
        a, b = left.value, right.value
        holds = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[operator]
        return TRUE if holds else FALSE
    if left == right:
        return TRUE if operator in ("<=", ">=", "==") else FALSE
    return Comparison(operator, left, right)


def every(items: list[Condition] | tuple[Condition, ...]) -> Condition:
    """The conjunction; FALSE if a comparison contradicts the rest."""
    found = joined(items, Every, TRUE, FALSE, once=True)
    excluded = {opposite(item) for item in _parts(found, Every) if isinstance(item, Comparison)}
    kept = [
        some([i for i in item.items if i not in excluded]) if isinstance(item, Some) else item
        for item in _parts(found, Every)
    ]
    if any(item in excluded for item in kept):
        return FALSE
    return found if kept == list(_parts(found, Every)) else every(kept)


def some(items: list[Condition] | tuple[Condition, ...]) -> Condition:
    """The disjunction; TRUE if one item is another's opposite."""
    found = joined(items, Some, FALSE, TRUE, once=True)
    implied = {opposite(item) for item in _parts(found, Some) if isinstance(item, Comparison)}
    return TRUE if any(item in implied for item in _parts(found, Some)) else found


def _parts(condition: Condition, kind: type[Every | Some]) -> tuple[Condition, ...]:
    return condition.items if isinstance(condition, kind) else (condition,)


def opposite(condition: Condition) -> Condition:
    match condition:
        case Comparison(operator=operator, left=left, right=right):
            return Comparison(OPPOSITE[operator], left, right)
        case Every(items=items):
            return some([opposite(item) for item in items])
        case Some(items=items):
            return every([opposite(item) for item in items])


def negations(complete: Condition) -> list[Condition]:
    """For each part of a condition that all values are present, the condition that it is missing."""
    parts = complete.items if not isinstance(complete, Comparison) else (complete,)
    return [compare("!=", p.left, p.right) for p in parts if isinstance(p, Comparison)]


def substitute(condition: Condition, new: Mapping[str, Numeric]) -> Condition:
    """The condition with numbers substituted for names."""
    if isinstance(condition, Comparison):
        return compare(condition.operator, _put(condition.left, new), _put(condition.right, new))
    items = [substitute(item, new) for item in condition.items]
    return every(items) if isinstance(condition, Every) else some(items)


def _put(number: Numeric, new: Mapping[str, Numeric]) -> Numeric:
    match number:
        case Name(name=name):
            return new.get(name, number)
        case Calculation(operator=operator, left=left, right=right):
            return Calculation(operator, _put(left, new), _put(right, new))
        case Number():  # a number that is written down
            return number
        case _:
            assert_never(number)


def without_exclusions(condition: Condition, name: Name) -> Condition | None:
    """The condition that `condition` holds for some of infinitely many numbers, if it only excludes certain numbers:
    these are finitely many. None if it says more."""
    match condition:
        case Comparison(operator="!=", left=left, right=right) if _slope(left, name) != _slope(right, name):
            return TRUE if None not in (_slope(left, name), _slope(right, name)) else None
        case Comparison():
            return condition if name.name not in names_in(condition) else None
        case Every(items=items) | Some(items=items):
            found = [part for item in items if (part := without_exclusions(item, name)) is not None]
            return (every if isinstance(condition, Every) else some)(found) if len(found) == len(items) else None


def _slope(number: Numeric, name: Name) -> int | None:
    """How often the name is added in a sum; None if it is no sum."""
    match number:
        case Name() | Number():
            return int(number == name)
        case Calculation(operator="+" | "-" as operator, left=left, right=right):
            one, other = _slope(left, name), _slope(right, name)
            return None if one is None or other is None else one + other if operator == "+" else one - other
        case Calculation():
            return None if name.name in names_in(number) else 0


def size(condition: Condition) -> int:
    return 1 if isinstance(condition, Comparison) else 1 + sum(map(size, condition.items))


def names_in(condition: Condition | Numeric) -> frozenset[str]:
    match condition:
        case Name(name=name):
            return frozenset((name,))
        case Number():
            return frozenset()
        case Calculation(left=left, right=right) | Comparison(left=left, right=right):
            return names_in(left) | names_in(right)
        case Every(items=items) | Some(items=items):
            return frozenset[str]().union(*map(names_in, items))


# -- specifications ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class EventType:
    """``name(parameters) matches pattern | pattern with condition;`` - each pattern is text that `Pattern` wrote."""

    name: str
    parameters: tuple[str, ...]
    patterns: tuple[str, ...]
    condition: Condition = TRUE


@dataclass(frozen=True, slots=True)
class Step:
    """One side of an equation: an event of a type, then the equation again with these arguments."""

    event: str
    arguments: tuple[str, ...]
    binds: tuple[str, ...]
    then: tuple[Numeric, ...]


@dataclass(frozen=True, slots=True)
class Machine:
    """``Name<parameters> = (empty \\/ step \\/ …);`` started with `initial`, seeing the events of type `relevant`."""

    name: str
    parameters: tuple[str, ...]
    steps: tuple[Step, ...]
    initial: tuple[Numeric, ...]
    relevant: str


@dataclass(frozen=True, slots=True)
class Specification:
    comments: tuple[str, ...]
    events: tuple[EventType, ...]
    machines: tuple[Machine, ...]
    notes: dict[str, str] = field(default_factory=dict)
    """Machine → the comment before it."""


def string(text: str) -> str:
    """A quoted constant. Raises NotRml if the text has characters that RML's strings lack."""
    if not STRING.match(text):
        raise NotRml(f"RML has no string constant for {text!r}")
    return f"'{text}'"


def key(text: str) -> str:
    """A field's name. Raises NotRml."""
    if not LOWER.match(text) or text in KEYWORDS:
        raise NotRml(f"RML has no field name {text!r}")
    return text


def comment(text: str) -> str:
    """One line of comment, whatever the text contains."""
    clean = "".join(c if c.isprintable() else " " for c in text)
    return f"// {clean}"


def number(value: Fraction) -> str:
    """A non-negative decimal: of at most fifteen digits, or the shortest that denotes a number which a double holds.
    Raises NotRml if there is none."""
    text = decimal(value)
    return _of_double(value) if text is None or len(text.partition(".")[2]) > 15 else text


def _of_double(value: Fraction) -> str:
    try:
        near = float(value)
    except OverflowError:
        near = 0.0
    if Fraction(near) != value:
        raise NotRml(f"{value} is no decimal of fifteen digits")
    return f"{Decimal(repr(near)):f}"


def numeric(value: Numeric) -> str:
    match value:
        case Name(name=name):
            return name
        case Number(value=amount):
            return number(amount) if amount >= 0 else f"(0 - {number(-amount)})"
        case Calculation(operator=operator, left=left, right=right):
            if operator in FUNCTIONS:
                return f"{operator}({numeric(left)}, {numeric(right)})"
            return f"({numeric(left)} {operator} {numeric(right)})"


def _condition_text(condition: Condition) -> str:
    match condition:
        case Comparison(operator=operator, left=left, right=right):
            return f"{numeric(left)} {operator} {numeric(right)}"
        case Every(items=()):
            return "0 == 0"
        case Some(items=()):
            return "0 == 1"
        case Every(items=items):
            return f"({' && '.join(map(_condition_text, items))})"
        case Some(items=items):
            return f"({' || '.join(map(_condition_text, items))})"


def write(specification: Specification) -> str:
    """The file's text. Raises NotRml."""
    lines = [comment(text) if text else "" for text in specification.comments]
    lines += map(_event_text, specification.events)
    lines.append("")
    for machine in specification.machines:
        if machine.name in specification.notes:
            lines.append(comment(specification.notes[machine.name]))
        lines += [_machine_text(machine), ""]
    parts = [f"({m.relevant} >> {_call(m.name, m.initial)})" for m in specification.machines]
    both = " /\\ ".join(parts)
    main = "any*" if not parts else both if len(parts) == 1 else f"({both})"
    lines.append(f"Main = {main};")
    return "\n".join(lines).lstrip("\n") + "\n"


def _event_text(event: EventType) -> str:
    head = event.name + (f"({', '.join(event.parameters)})" if event.parameters else "")
    guard = "" if event.condition == TRUE else f"\n  with {_condition_text(event.condition)}"
    return f"{head} matches {' | '.join(event.patterns)}{guard};"


def _machine_text(machine: Machine) -> str:
    head = machine.name + (f"<{', '.join(machine.parameters)}>" if machine.parameters else "")
    sides = "".join(f"\n  \\/ {_step_text(machine.name, step)}" for step in machine.steps)
    return f"{head} = (empty{sides});"


def _step_text(machine: str, step: Step) -> str:
    event = step.event + (f"({', '.join(step.arguments)})" if step.arguments else "")
    body = f"{event} {_call(machine, step.then)}"
    return f"{{let {', '.join(step.binds)}; {body}}}" if step.binds else f"({body})"


def _call(name: str, arguments: tuple[Numeric, ...]) -> str:
    return name + (f"<{', '.join(map(numeric, arguments))}>" if arguments else "")
