"""RML specifications as data, and their text. The tests read back the text that this module writes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from decimal import Decimal
from fractions import Fraction

from avow.base.plain import decimal
from avow.formulas.flattening import joined
from avow.formulas.formula import free_variables
from avow.formulas.formula import opposite as negated
from avow.formulas.formula import substitute as put
from avow.language import terms as t
from avow.language.sorts import REAL

KEYWORDS = frozenset(
    "not matches with empty all var let if else abs sin cos tan min max true false null any none".split()  # noqa: SIM905
)
LOWER = re.compile(r"[a-z][A-Za-z0-9_]*\Z")
STRING = re.compile(r"[A-Za-z0-9_./ -]*\Z")


class NotRml(Exception):  # noqa: N818 - it says what a text or a formula is
    """Something that RML cannot express; the text gives the reason, for people."""


# -- numbers and conditions --------------------------------------------------------------------------------------------


Numeric = t.Term
"""A REAL term: a literal, a variable, `+`, `-`, `*`, or a `max` or `min` of two numbers."""
Condition = t.Term
"""A comparison of numbers, `and`, `or`, TRUE or FALSE."""
FUNCTIONS = ("max", "min")
"""Operators that are written as functions."""


def variable(name: str) -> t.Variable:
    return t.Variable(t.Role.BOUND, name, REAL)


def literal(value: Fraction | int) -> t.Literal:
    return t.Literal(Fraction(value), REAL)


ZERO, ONE = literal(0), literal(1)


def value_of(number: t.Literal) -> Fraction:
    assert isinstance(number.value, Fraction)
    return number.value


def calculation(operator: str, left: Numeric, right: Numeric) -> Numeric:
    """A calculation, done at once if both sides are numbers."""
    if isinstance(left, t.Literal) and isinstance(right, t.Literal):
        a, b = value_of(left), value_of(right)
        if operator != "/":
            return literal({"+": a + b, "-": a - b, "*": a * b, "max": max(a, b), "min": min(a, b)}[operator])
        if b:
            return literal(a / b)
    return t.Arithmetic(operator, left, right, REAL)


def compare(operator: str, left: Numeric, right: Numeric) -> Condition:
    """A comparison, decided at once if both sides are numbers."""
    if isinstance(left, t.Literal) and isinstance(right, t.Literal):
        a, b = value_of(left), value_of(right)
        holds = {"<": a < b, "<=": a <= b, ">": a > b, ">=": a >= b, "==": a == b, "!=": a != b}[operator]
        return t.TRUE if holds else t.FALSE
    if left == right:
        return t.TRUE if operator in ("<=", ">=", "==") else t.FALSE
    return t.Compare(operator, left, right)


def every(items: list[Condition] | tuple[Condition, ...]) -> Condition:
    """The conjunction; t.FALSE if a comparison contradicts the rest."""
    found = joined(items, t.And, t.TRUE, t.FALSE, once=True)
    excluded = {opposite(item) for item in _parts(found, t.And) if isinstance(item, t.Compare)}
    kept = [
        some([i for i in item.items if i not in excluded]) if isinstance(item, t.Or) else item
        for item in _parts(found, t.And)
    ]
    if any(item in excluded for item in kept):
        return t.FALSE
    return found if kept == list(_parts(found, t.And)) else every(kept)


def some(items: list[Condition] | tuple[Condition, ...]) -> Condition:
    """The disjunction; t.TRUE if one item is another's opposite."""
    found = joined(items, t.Or, t.FALSE, t.TRUE, once=True)
    implied = {opposite(item) for item in _parts(found, t.Or) if isinstance(item, t.Compare)}
    return t.TRUE if any(item in implied for item in _parts(found, t.Or)) else found


def _parts(condition: Condition, kind: type[t.And | t.Or]) -> tuple[Condition, ...]:
    return condition.items if isinstance(condition, kind) else (condition,)


def opposite(condition: Condition) -> Condition:
    match condition:
        case t.And(items=items):
            return some([opposite(item) for item in items])
        case t.Or(items=items):
            return every([opposite(item) for item in items])
        case _:  # a comparison, or a truth value
            return negated(condition)


def negations(complete: Condition) -> list[Condition]:
    """For each part of a condition that all values are present, the condition that it is missing."""
    return [compare("!=", p.left, p.right) for p in _parts(complete, t.And) if isinstance(p, t.Compare)]


def substitute(condition: Condition, new: Mapping[str, Numeric]) -> Condition:
    """The condition with numbers substituted for names."""
    if isinstance(condition, t.And | t.Or):
        items = [substitute(item, new) for item in condition.items]
        return every(items) if isinstance(condition, t.And) else some(items)
    if not isinstance(condition, t.Compare):
        return condition
    terms = {variable(name): number for name, number in new.items()}
    return compare(condition.operator, put(condition.left, terms), put(condition.right, terms))


def without_exclusions(condition: Condition, name: t.Variable) -> Condition | None:
    """The condition that `condition` holds for some of infinitely many numbers, if it only excludes certain numbers:
    these are finitely many. None if it says more."""
    match condition:
        case t.Compare(operator="!=", left=left, right=right) if _slope(left, name) != _slope(right, name):
            return t.TRUE if None not in (_slope(left, name), _slope(right, name)) else None
        case t.And(items=items) | t.Or(items=items):
            found = [part for item in items if (part := without_exclusions(item, name)) is not None]
            return (every if isinstance(condition, t.And) else some)(found) if len(found) == len(items) else None
        case _:  # a comparison, or a truth value
            return condition if name.name not in names_in(condition) else None


def _slope(number: Numeric, name: t.Variable) -> int | None:
    """How often the name is added in a sum; None if it is no sum."""
    match number:
        case t.Arithmetic(operator="+" | "-" as operator, left=left, right=right):
            one, other = _slope(left, name), _slope(right, name)
            return None if one is None or other is None else one + other if operator == "+" else one - other
        case t.Arithmetic():
            return None if name.name in names_in(number) else 0
        case _:  # a name, or a number
            return int(number == name)


def size(condition: Condition) -> int:
    return 1 + sum(map(size, condition.items)) if isinstance(condition, t.And | t.Or) else 1


def names_in(term: t.Term) -> frozenset[str]:
    return frozenset(variable.name for variable in free_variables(term))


# -- specifications ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class EventType:
    """``name(parameters) matches pattern | pattern with condition;`` - each pattern is text that `Pattern` wrote."""

    name: str
    parameters: tuple[str, ...]
    patterns: tuple[str, ...]
    condition: Condition = t.TRUE


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
        case t.Variable(name=name):
            return name
        case t.Arithmetic(operator=operator, left=left, right=right):
            if operator in FUNCTIONS:
                return f"{operator}({numeric(left)}, {numeric(right)})"
            return f"({numeric(left)} {operator} {numeric(right)})"
        case t.Literal():
            amount = value_of(value)
            return number(amount) if amount >= 0 else f"(0 - {number(-amount)})"
    raise AssertionError(value)


def _condition_text(condition: Condition) -> str:
    match condition:
        case t.Compare(operator=operator, left=left, right=right):
            return f"{numeric(left)} {operator} {numeric(right)}"
        case t.And(items=items):
            return f"({' && '.join(map(_condition_text, items))})"
        case t.Or(items=items):
            return f"({' || '.join(map(_condition_text, items))})"
        case _:  # a truth value
            return "0 == 0" if condition == t.TRUE else "0 == 1"


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
    guard = "" if event.condition == t.TRUE else f"\n  with {_condition_text(event.condition)}"
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
