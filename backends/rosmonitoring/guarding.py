"""Bounds of a node's inputs, and what a filter passes on in place of a message that it withholds."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from avow.backend_kit.box import BOX, Box
from avow.formulas.formula import conjunction
from avow.language.contract import Clause, ClauseKind, Node
from avow.ros.definitions import FLOATS, INTEGERS, Definitions, Wire

from .rules import Choice, Fields, Rule

FALLBACK = "/avow_fallback"
"""The publisher, in a record, of what is passed on in place of a withheld message."""

Fallback = Mapping[str, bool | float | str]
"""Top-level fields of a message, and their values."""


def _fits(value: bool | float | str, wire: Wire) -> bool:
    """Whether a field of this type can have the value."""
    name = str(wire)
    if isinstance(value, bool | str):
        return name == ("bool" if isinstance(value, bool) else "string")
    if name in INTEGERS:
        least, greatest = INTEGERS[name]
        return isinstance(value, int) and least <= value <= greatest
    try:
        return name in FLOATS and bool(struct.pack("f" if name == "float32" else "d", value))
    except (struct.error, OverflowError):
        return False


def bounded(node: Node, box: Box, wrong: Callable[..., None]) -> Node:
    """The node with the bounds as an assumption."""
    if box.terms and any(c.name == BOX for c in node.clauses):
        wrong(f"{BOX}: a clause of {node.name} has this name", BOX, hint="give the clause another name")
    clause = Clause(ClauseKind.ASSUMPTION, BOX, 0, conjunction(box.terms), text=box.text)
    return replace(node, assumptions=(*node.assumptions, clause)) if box.terms else node


def fallbacks(
    data: Mapping[str, Any], rules: Mapping[str, Rule], known: Definitions, wrong: Callable[..., None]
) -> dict[str, Fallback]:
    """The option, by topic (without its leading slash)."""
    found = {}
    for name, fields in data.get("fallback", {}).items():
        rule = rules.get(name)
        if name not in data.get("filter", ()) or not isinstance(rule, Fields | Choice):
            wrong(f"fallback: {name} is not filtered", "fallback", name, hint=f"filter: [{name}]")
            continue
        message = known.get(rule.kind)
        for key, value in fields.items():
            own = message.field(key) if message else None
            if own is None or not _fits(value, own.wire):
                what = f"no field of {rule.kind}" if own is None else f"not of type {own.wire}"
                wrong(f"fallback: {name}: {key} is {what}", "fallback", name, key)
        found[rule.topic.lstrip("/")] = fields
    return found
