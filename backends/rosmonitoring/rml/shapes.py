"""The shapes that a message can have, as RML patterns: the fields that a rule reads, with constants or names."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from avow.language.printer import show_sort
from avow.language.sorts import BoolSort, DataSort, EnumSort, IntegerSort, NaturalSort, RealSort, Sort
from avow.ros.bags import ENVELOPE

from ..rules import Choice, FieldPath, Lookup
from .symbols import code
from .syntax import TRUE, Condition, Name, NotRml, Number, Numeric, compare, every, key, string


@dataclass(frozen=True, slots=True)
class Case:
    """One shape that a rule's message can have: fields with constants or variables, and the parts' new values."""

    fields: tuple[tuple[FieldPath, str], ...]
    values: tuple[Numeric, ...]
    binds: tuple[str, ...]
    guard: Condition = TRUE


def choice_cases(rule: Choice, sort: DataSort, stem: str) -> list[Case]:
    found: list[Case] = []
    width = {c.name: len(c.parameters) for c in sort.constructors}
    for constructor in sort.constructors:
        if constructor.name not in rule.arguments:
            continue
        words = _words(constructor.name, rule.names)
        if not words:
            continue
        tag = (rule.tag, " | ".join(words))
        places = rule.arguments[constructor.name]
        paths: list[FieldPath] = []
        for place in places:
            if isinstance(place, Lookup):
                raise NotRml(f"an argument of {constructor.name} is looked up in a table")
            paths.append(place)
        binds = binds_of(stem, paths)
        per_field = [
            field_cases(path, s, bind, {}) for path, s, bind in zip(paths, constructor.parameters, binds, strict=True)
        ]
        for parts in product(*per_field):
            whole = together((), parts)
            values: list[Numeric] = [Number(Fraction(code(sort, constructor.name)))]
            for other in sort.constructors:
                mine = other.name == constructor.name
                values += whole.values if mine else [Number(Fraction(0))] * width[other.name]
            found.append(Case((tag, *whole.fields), tuple(values), whole.binds, whole.guard))
    return found


def binds_of(stem: str, paths: Sequence[FieldPath]) -> list[str]:
    """Names for what a message's fields hold: after the fields, if these differ."""
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
            found = []
            for member in members:
                words = _words(member, names)
                if words:
                    found.append(Case(((path, " | ".join(words)),), (Number(Fraction(code(sort, member))),), ()))
            return found
        case BoolSort():
            return [
                Case(((path, word),), (Number(Fraction(number)),), ()) for word, number in (("false", 0), ("true", 1))
            ]
        case NaturalSort():
            guard = compare(">=", Name(name), Number(Fraction(0)))
            return [Case(((path, name),), (Name(name),), (name,), guard)]
        case RealSort() | IntegerSort():
            return [Case(((path, name),), (Name(name),), (name,))]
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
            raise NotRml(f"the field {path[0]} bears the name of what an event says itself")
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
