"""The part of a plan that says which program a node is: `source`, `numbers` and `memory` of a node."""

from __future__ import annotations

from collections.abc import Iterator

from avow.base.diagnostics import Diagnostic
from avow.base.suggestions import suggest
from avow.language.contract import Node
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort
from avow.system.plan import Driving, Numbers, Plan, Source
from avow.system.strict_yaml import Piece

HELD = (BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort)
"""What an attribute may hold between two steps."""


def read_source(name: str, node: Piece) -> tuple[Source | None, tuple[Diagnostic, ...]]:
    """What the plan says of a node's source; what in it does not go together."""
    piece, numbers, memory = node.at("source"), node.at("numbers"), node.at("memory")
    if piece is None:
        alone = [(key, part) for key, part in (("numbers", numbers), ("memory", memory)) if part is not None]
        hint = "add  source: {python: src/node.py, class: Node}"
        return None, tuple(
            Diagnostic("PLAN110", f"nodes.{name}: {key} is said of a source, and there is none", part.span, hint=hint)
            for key, part in alone
        )
    texts = {key: part.text for key, part in (piece.entries or {}).items()}
    faults: list[Diagnostic] = []
    if "python" not in texts and "cpp" not in texts:
        faults.append(Diagnostic("PLAN104", f"nodes.{name}.source: either python or cpp is wanted", piece.span))
    elif ("python" in texts) != ("class" in texts):
        absent = "class" if "python" in texts else "python"
        message = f"nodes.{name}.source: python and class go together, and {absent} is missing"
        faults.append(Diagnostic("PLAN104", message, piece.span))
    if texts.get("kind", "step") != "step" and memory is not None:
        message = f"nodes.{name}: memory is of a class with a method step, and kind is {texts['kind']}"
        faults.append(Diagnostic("PLAN110", message, memory.span))
    held: dict[str, str] = {}
    for port, _, part in node.keyed("memory"):
        attribute = part.text.removeprefix("self.")
        if attribute in held.values():
            message = f"nodes.{name}.memory: self.{attribute} stands there twice"
            faults.append(Diagnostic("PLAN110", message, part.span))
        held[port] = attribute
    found = Source(
        texts.get("python", ""),
        texts.get("class", ""),
        texts.get("cpp", ""),
        texts.get("parameters", ""),
        Numbers(numbers.text) if numbers is not None else Numbers.FLOAT64,
        held,
        node.located(),
        Driving(texts.get("kind", "step")),
    )
    return found, tuple(faults)


def files_of(node: Piece) -> list[Piece]:
    """The files that a node's source names."""
    return [part for key in ("python", "cpp", "parameters") if (part := node.at("source", key)) is not None]


def check_memory(plan: Plan, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    """The ports that a plan calls memory, held against the contract."""
    for entry in plan.nodes:
        node = nodes.get(entry.node)
        if node is None or entry.source is None:
            continue
        inputs, outputs = ({p.name: p for p in side} for side in (node.inputs, node.outputs))
        for port in entry.source.memory:
            where, span = f"nodes.{entry.node}.memory", entry.source.place.at("memory", port)
            if port not in inputs:
                message = (
                    f"{where}: {port!r} is no input of {entry.node}; memory is what a step reads of the step before"
                )
                yield Diagnostic("PLAN106", message, span, hint=suggest(port, inputs))
                continue
            if not isinstance(inputs[port].sort, HELD):
                kind = inputs[port].type_name
                message = f"{where}: memory is a number, a truth value or an element, and {port} is {kind}"
                yield Diagnostic("PLAN110", message, span)
            if port in outputs and outputs[port].sort != inputs[port].sort:
                yield Diagnostic("PLAN110", f"{where}: in.{port} and out.{port} have different types", span)
