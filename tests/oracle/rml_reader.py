"""RML text back as data, by our own grammar: what the writer wrote is parsed, every name held to its declaration."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

import lark

from avow.backends.rosmonitoring.rml.syntax import KEYWORDS
from avow.base.grammars import lark_of

PREDECLARED = frozenset(("any", "none"))


@dataclass(frozen=True, slots=True)
class Declared:
    """An event type: its parameters, its patterns and its condition."""

    name: str
    parameters: tuple[str, ...]
    patterns: tuple[Any, ...]
    condition: Any


@dataclass(frozen=True, slots=True)
class Parsed:
    """A specification as Lark trees, by name."""

    events: dict[tuple[str, int], Declared] = field(default_factory=dict)
    equations: dict[str, tuple[tuple[str, ...], Any]] = field(default_factory=dict)


class Malformed(Exception):  # noqa: N818 - it is what the text is
    """The text is no RML that our writer may write; the message says where and why."""


@functools.lru_cache(maxsize=8)
def read(text: str) -> Parsed:
    """Parse and check names; the result is shared and not to be changed. Raises Malformed."""
    grammar = Path(__file__).with_name("rml.lark")
    try:
        tree = lark_of(grammar, "rml", ("start",), lexer="contextual", maybe_placeholders=False).parse(text)
    except lark.exceptions.UnexpectedInput as error:
        raise Malformed(f"line {error.line}, column {error.column}: {type(error).__name__}") from None
    found = Parsed()
    for item in tree.children:
        if item.data == "equation":
            _equation(found, item)
        else:
            _event(found, item)
    if "Main" not in found.equations:
        raise Malformed("there is no equation Main")
    _check(found)
    return found


def _event(found: Parsed, tree: Any) -> None:
    head, *rest = tree.children
    name, parameters = _head(head)
    if name in KEYWORDS:
        raise Malformed(f"{name} is a keyword")
    patterns = tuple(c for c in rest if c.data == "pattern")
    conditions = [c for c in rest if c.data in ("all", "any", "compare")]
    if (name, len(parameters)) in found.events:
        raise Malformed(f"{name} is declared twice")
    found.events[name, len(parameters)] = Declared(name, parameters, patterns, conditions[0] if conditions else None)


def _head(tree: Any) -> tuple[str, tuple[str, ...]]:
    name, *parameters = tree.children
    return str(name), tuple(str(p.children[0]) if p.data == "name" else "_" for p in parameters)


def _equation(found: Parsed, tree: Any) -> None:
    name, *parameters, body = tree.children
    if str(name) in found.equations:
        raise Malformed(f"{name} is defined twice")
    found.equations[str(name)] = (tuple(map(str, parameters)), body)


def _check(found: Parsed) -> None:
    for declared in found.events.values():
        bound = {str(v.children[0]) for p in declared.patterns for v in p.find_data("variable")}
        if declared.patterns and not all(
            {str(v.children[0]) for v in p.find_data("variable")} <= set(declared.parameters) for p in declared.patterns
        ):
            raise Malformed(f"a pattern of {declared.name} binds what is no parameter of it")
        if declared.condition is not None:
            for name in declared.condition.find_data("name"):
                if str(name.children[0]) not in {*declared.parameters, *bound}:
                    raise Malformed(f"{name.children[0]} in the condition of {declared.name} is not declared")
    for name, (parameters, body) in found.equations.items():
        _scope(found, name, body, frozenset(parameters))


def _scope(found: Parsed, equation: str, tree: Any, names: frozenset[str]) -> None:
    if not isinstance(tree, lark.Tree):
        return
    match tree.data:
        case "block":
            *new, body = tree.children
            fresh = frozenset(map(str, new))
            if fresh & names:
                raise Malformed(f"{equation} binds a name twice")
            _scope(found, equation, body, names | fresh)
            return
        case "event":
            _known(found, tree)
        case "call":
            callee = str(tree.children[0])
            if callee not in found.equations:
                raise Malformed(f"{equation} refers to {callee}, which is not defined")
            if len(found.equations[callee][0]) != len(tree.children) - 1:
                raise Malformed(f"{equation} gives {callee} a wrong number of arguments")
        case "name":
            if str(tree.children[0]) not in names:
                raise Malformed(f"{tree.children[0]} in {equation} is not bound")
    for child in tree.children:
        _scope(found, equation, child, names)


def _known(found: Parsed, event: Any) -> None:
    name, parameters = _head(event)
    if name not in PREDECLARED and (name, len(parameters)) not in found.events:
        raise Malformed(f"the event type {name} with {len(parameters)} parameters is not declared")


def number(tree: Any) -> Fraction:
    return Fraction(str(tree.children[0]))
