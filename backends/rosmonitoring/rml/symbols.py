"""A contract variable as the fixed number of numbers that an RML equation can carry.

An enumeration's element is a code (1, 2, …), a truth value 0 or 1, an algebraic value its constructor's code and the
arguments of every constructor; a relation that holds of the latest message's tuple is a flag and that tuple. The
scenario's tables are known in advance. Anything else (a relation that holds of all tuples seen) is refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import chain, product
from typing import assert_never

from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.printer import show_sort
from avow.language.sorts import BoolSort, DataSort, EnumSort, IntegerSort, NaturalSort, RealSort, Sort
from avow.ros import definitions as wires
from avow.ros.bags import ENVELOPE

from ..rules import Choice, Constant, FieldPath, Fields, Hold, Lookup, Previous, Rule
from ..tuning import TRACKED_TUPLES
from ..wires import parts_of
from .syntax import (
    ONE,
    ZERO,
    Condition,
    NotRml,
    Numeric,
    compare,
    every,
    key,
    literal,
    string,
    value_of,
    variable,
)


@dataclass(frozen=True, slots=True)
class Case:
    """One shape that a rule's message can have: fields with constants or variables, and the parts' new values."""

    fields: tuple[tuple[FieldPath, str], ...]
    values: tuple[Numeric, ...]
    binds: tuple[str, ...]
    guard: Condition = t.TRUE


def choice_cases(rule: Choice, sort: DataSort, stem: str) -> list[Case]:
    found: list[Case] = []
    for constructor in sort.constructors:
        if constructor.name not in rule.arguments:
            continue
        words = _words(constructor.name, rule.names)
        if not words:
            continue
        tag = (rule.tag, " | ".join(words))
        sources = rule.arguments[constructor.name]
        paths = [source for source in sources if not isinstance(source, Lookup)]
        if len(paths) < len(sources):
            raise NotRml(f"an argument of {constructor.name} is looked up in a table")
        binds = binds_of(stem, paths)
        per_field = [
            field_cases(path, s, bind, {}) for path, s, bind in zip(paths, constructor.parameters, binds, strict=True)
        ]
        for chosen in product(*per_field):
            whole = together((), chosen)
            values = made(sort, constructor.name, [whole.values])
            found.append(Case((tag, *whole.fields), values, whole.binds, whole.guard))
    return found


def binds_of(stem: str, paths: Sequence[FieldPath]) -> list[str]:
    """Names for the contents of a message's fields: the fields' names, if these differ."""
    fields = [re.sub("[^A-Za-z0-9]", "", str(path[-1])) if path else "" for path in paths]
    if len(paths) == 1:
        return [stem]
    named = all(fields) and len(set(fields)) == len(fields)
    return [f"{stem}_{field if named else k}" for k, field in enumerate(fields, start=1)]


def together(first: tuple[Numeric, ...], parts: Sequence[Case]) -> Case:
    return Case(
        tuple(f for p in parts for f in p.fields),
        (*first, *(v for p in parts for v in p.values)),
        tuple(b for p in parts for b in p.binds),
        every([p.guard for p in parts]),
    )


def field_cases(path: FieldPath, sort: Sort, name: str, names: Mapping[str, str]) -> list[Case]:
    """A field's content: a constant for each element of an enumeration, else a variable."""
    match sort:
        case EnumSort(members=members):
            meanings = ((member, _words(member, names)) for member in members)
            return [
                Case(((path, " | ".join(words)),), (literal(code(sort, member)),), ())
                for member, words in meanings
                if words
            ]
        case BoolSort():
            return [Case(((path, word),), (literal(number),), ()) for word, number in (("false", 0), ("true", 1))]
        case NaturalSort():
            return [Case(((path, name),), (variable(name),), (name,), compare(">=", variable(name), ZERO))]
        case RealSort() | IntegerSort():
            return [Case(((path, name),), (variable(name),), (name,))]
        case _:
            raise NotRml(f"a field holds a value of {show_sort(sort)}")


def _words(member: str, names: Mapping[str, str]) -> list[str]:
    """The patterns of the words that mean a member: its own name unless that means another one, and its aliases."""
    words = [word for word, meaning in names.items() if meaning == member]
    if names.get(member, member) == member:
        words.append(member)
    found = [string(word) for word in dict.fromkeys(words)]
    found += [word for word in words if word.isascii() and word.isdigit() and str(int(word)) == word]
    return found


def pattern(topic: str, fields: Sequence[tuple[FieldPath, str]]) -> str:
    """The event's pattern. Raises NotRml."""
    tree: dict[str, object] = {}
    for path, text in fields:
        if not path:
            raise NotRml("a rule takes the whole message as one value")
        if path[0] in ENVELOPE:
            raise NotRml(f"the field {path[0]} has the name of a key of the event itself")
        place = tree
        steps = [str(step) for step in path]
        for step in steps[:-1]:
            below = place.setdefault(key(step), {})
            if not isinstance(below, dict):
                raise NotRml(f"the field {step} is used both as a value and as a message")
            place = below
        if key(steps[-1]) in place:
            raise NotRml(f"the field {steps[-1]} is used twice")
        place[key(steps[-1])] = text
    return _object({"topic": string(topic), **tree})


def _object(tree: dict[str, object]) -> str:
    return "{" + ", ".join(f"{k}: {_object(v) if isinstance(v, dict) else v}" for k, v in tree.items()) + "}"


Numbers = tuple[Numeric, ...]
"""A value: a number, a code or a truth value, or, for an algebraic type, the constructor's code and the arguments of
every constructor (0 for those of others than the value's own)."""


@dataclass(frozen=True, slots=True)
class Points:
    """A relation that holds of these tuples, each if a number is 1."""

    tuples: tuple[tuple[Numeric, tuple[Numbers, ...]], ...]


@dataclass(frozen=True, slots=True)
class Tracked:
    """A relation that holds of every tuple seen, if it is applied only to known tuples: a number for each of these, 1
    once it has been seen. The tuples are collected while the condition is built."""

    prefix: str
    flags: dict[tuple[Fraction, ...], str] = field(default_factory=dict, hash=False)

    def flag(self, arguments: tuple[Numbers, ...]) -> Condition:
        """The condition that the relation holds there. Raises NotRml."""
        at: list[Fraction] = []
        for argument in arguments:
            if len(argument) > 1 or not isinstance(argument[0], t.Literal):
                raise NotRml(
                    "it asks a relation that holds of all tuples seen for a tuple that is not known beforehand"
                )
            at.append(value_of(argument[0]))
        name = self.flags.setdefault(tuple(at), f"{self.prefix}_{len(self.flags) + 1}")
        if len(self.flags) > TRACKED_TUPLES:
            raise NotRml(f"it asks a relation for more than {TRACKED_TUPLES} tuples")
        return compare("==", variable(name), ONE)


@dataclass(frozen=True, slots=True)
class Table:
    """A function with a result: its value at these arguments, and its value elsewhere."""

    points: tuple[tuple[tuple[Numbers, ...], Numbers], ...]
    elsewhere: Numbers


Symbol = Numbers | Points | Tracked | Table


def code(sort: s.EnumSort | s.DataSort, name: str) -> int:
    """The number that represents an element or a constructor; 0 represents none."""
    return (sort.members if isinstance(sort, s.EnumSort) else tuple(c.name for c in sort.constructors)).index(name) + 1


def places(sort: s.DataSort, constructor: str) -> range:
    """The places of a constructor's arguments among the numbers of an algebraic value."""
    before = sort.constructors[: code(sort, constructor) - 1]
    first = 1 + sum(len(each.parameters) for each in before)
    return range(first, first + len(sort.constructor(constructor).parameters))


def made(sort: s.DataSort, constructor: str, arguments: Iterable[Numbers]) -> Numbers:
    """A value made by a constructor."""
    known = dict(zip(places(sort, constructor), (number for each in arguments for number in each), strict=True))
    width = 1 + sum(len(each.parameters) for each in sort.constructors)
    return (literal(code(sort, constructor)), *(known.get(at, ZERO) for at in range(1, width)))


def constant(value: Value, sort: s.Sort) -> Symbol:
    """A known value. Raises NotRml."""
    match value:
        case FunctionValue(table=table, default=False) if isinstance(sort, s.FunctionSort):
            return Points(tuple((ONE, _row(k, sort)) for k, holds in table.items() if holds is True))
        case FunctionValue(table=table, default=default) if isinstance(sort, s.FunctionSort) and sort.result != s.BOOL:
            known = tuple((_row(k, sort), numbers(v, sort.result)) for k, v in table.items())
            return Table(known, numbers(default, sort.result))
        case _:  # a value of numbers
            return numbers(value, sort)


def _row(arguments: Sequence[Value], sort: s.FunctionSort) -> tuple[Numbers, ...]:
    return tuple(numbers(argument, part) for argument, part in zip(arguments, sort.parameters, strict=True))


def numbers(value: Value, sort: s.Sort) -> Numbers:
    """A known value that is no function. Raises NotRml."""
    match value:
        case bool() | int() | Fraction():
            return (literal(value),)
        case Element(name=name) if isinstance(sort, s.EnumSort):
            return (literal(code(sort, name)),)
        case Data(constructor=name, arguments=arguments) if isinstance(sort, s.DataSort):
            _check_arguments(sort)
            parts = zip(arguments, sort.constructor(name).parameters, strict=True)
            return made(sort, name, (numbers(argument, part) for argument, part in parts))
        case _:
            raise NotRml("a value that RML's equations cannot carry")


def _check_arguments(sort: s.DataSort) -> None:
    """Raises NotRml."""
    if any(isinstance(part, s.NotScalar) for each in sort.constructors for part in each.parameters):
        raise NotRml("an argument of a constructor that is no number, truth value or enumeration")


def carried(rule: Rule, rules: dict[str, Rule], prefix: str) -> Symbol:
    """The symbol of an observed variable, with names for its parts that begin with `prefix`. Raises NotRml."""
    if isinstance(rule, Constant):
        return constant(rule.value, rule.variable.sort)
    source = rules.get(rule.source) if isinstance(rule, Previous) else rule
    if getattr(source, "frame", ""):
        raise NotRml(f"{rule.variable.qualified} is in the frame of a topic, and RML transforms nothing")
    name = rule.variable.qualified
    sort = rule.variable.sort
    if isinstance(sort, s.FunctionSort):
        if isinstance(rule, Fields) and rule.hold is Hold.SEEN and rule.each is None and sort.result == s.BOOL:
            return Tracked(prefix)
        if isinstance(source, Fields) and (source.hold is Hold.SEEN or getattr(source, "each", None)):
            raise NotRml(f"{name} holds of any number of tuples, and an RML equation carries a fixed number of values")
        parts = tuple(_named(part, f"{prefix}_{k}", name) for k, part in enumerate(parts_of(sort), start=1))
        if sort.result != s.BOOL:
            elsewhere = source.elsewhere if isinstance(source, Fields) else None
            if elsewhere is None:
                raise NotRml(f"{name} is a function without a value `elsewhere`")
            return Table(((parts[:-1], parts[-1]),), numbers(elsewhere, sort.result))
        return Points(((variable(f"{prefix}_p"), parts),))
    return _named(sort, prefix, name)


def _named(sort: s.Sort, prefix: str, name: str) -> Numbers:
    match sort:
        case s.BoolSort() | s.RealSort() | s.IntegerSort() | s.NaturalSort() | s.EnumSort():
            return (variable(prefix),)
        case s.DataSort(constructors=constructors):
            _check_arguments(sort)
            each = enumerate(constructors, start=1)
            parts = [f"{at}_{k}" for at, made in each for k, _ in enumerate(made.parameters, start=1)]
            return tuple(variable(f"{prefix}_{part}") for part in ("t", *parts))
        case s.StringSort() | s.OpaqueSort() | s.FunctionSort() | s.TupleSort() | s.SequenceSort() | s.SetSort():
            raise NotRml(f"{name} is of a sort that RML's equations cannot carry")
        case _:
            assert_never(sort)


def no_pattern(rule: Fields) -> str:
    """Why no RML pattern reads the fields that the rule reads; empty if one does."""
    if rule.take is not None:
        return "calculated from the items of an array"
    if rule.gaps or (rule.elsewhere is not None and not isinstance(rule.variable.sort, s.FunctionSort)):
        return "no reading where the message holds NaN or an infinity"
    if any(isinstance(step, int) for path in rule.paths for step in path):
        return "an item of an array"
    if any(isinstance(wire, wires.Scalar) and wire.name in ("time", "duration") for wire in rule.wires):
        return "a time of seconds and nanoseconds"
    return ""


def equal(left: Numbers, right: Numbers, sort: s.Sort) -> Condition:
    """The condition that two values of a sort are the same. If one's constructor is known, only its arguments count."""
    compared: Iterable[int] = range(len(left))
    tag = next((one[0] for one in (left, right) if isinstance(one[0], t.Literal)), None)
    if isinstance(sort, s.DataSort) and tag is not None:
        compared = 0, *places(sort, sort.constructors[int(value_of(tag)) - 1].name)
    return every([compare("==", left[at], right[at]) for at in compared])


def parts(symbol: Symbol) -> tuple[Numeric, ...]:
    """The numbers that an equation carries for it, in order; none for what is known in advance."""
    match symbol:
        case Tracked(flags=flags):
            return tuple(map(variable, flags.values()))
        case Points(tuples=((flag, row),)):
            return (flag, *chain(*row))
        case Table(points=((arguments, result),)):
            return (*chain(*arguments), *result)
        case Points() | Table():  # known in advance
            return ()
        case _:  # a value's numbers
            return symbol


def components(symbol: Symbol) -> tuple[str, ...]:
    """Their names."""
    return tuple(number.name for number in parts(symbol) if isinstance(number, t.Variable))
