"""The plan's entry for a node: how its guarantees are to be verified (`methods`), and which program implements it
(`source`, `numbers`, `memory`), with its parameters."""

from __future__ import annotations

import contextlib
import functools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.files import inside, read_regular
from avow.base.suggestions import suggest
from avow.language.contract import Node
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort
from avow.ros.parameters import WrongParameters, flat, is_sectioned, nested, placed
from avow.system.pieces import Piece
from avow.system.plan import Driving, Method, Numbers, Plan, Source
from avow.system.strict_yaml import read_yaml

# -- methods -----------------------------------------------------------------------------------------------------------


def read_methods(node: str, piece: Piece) -> tuple[tuple[Method, ...], tuple[Diagnostic, ...]]:
    """The methods of a node, each with a unique id; and their faults."""
    found: list[Method] = []
    faults: list[Diagnostic] = []
    used: set[str] = set()
    for item in piece.each("methods"):
        found.append(_method(node, item, piece.at("mapping"), used, faults))
    return tuple(found), tuple(faults)


READ_MESSAGES = ("rosmonitoring", "hypothesis")
"""The methods that get a node's own `mapping`: they read messages, and have an option of that name."""


def _with_mapping(options: Piece, shared: Piece) -> Piece:
    """A method's options with the node's mapping; the method's own entry for a variable takes precedence."""
    own = options.at("mapping") or Piece(shared.span, entries={})
    if own.entries is None or shared.entries is None:
        return options  # reported by the schemas
    both = replace(own, entries=shared.entries | own.entries, keys=shared.keys | own.keys)
    return replace(options, entries={**(options.entries or {}), "mapping": both})


def _method(node: str, item: Piece, mapping: Piece | None, used: set[str], faults: list[Diagnostic]) -> Method:
    if item.entries is None:
        backend, options = item.text, Piece(item.span, entries={})
    else:
        backend, options = next(iter(item.entries.items()))
        if options.value is None and options.entries is None and options.items is None and not options.text:
            options = Piece(options.span, entries={})
    if mapping is not None and backend in READ_MESSAGES:
        options = _with_mapping(options, mapping)
    given = options.at("id")
    name = given.text if given is not None else backend
    if given is not None and name in used:
        faults.append(Diagnostic("PLAN110", f"nodes.{node}: the method's id {name!r} is used twice", given.span))
    number = 2
    while name in used:
        name = f"{backend}-{number}"
        number += 1
    used.add(name)
    located = replace(options.located(), key_span=item.key_span(backend))
    return Method(name, backend, located, options.texts("guarantees"))


# -- source ------------------------------------------------------------------------------------------------------------

HELD = (BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort)
"""The values that an attribute may hold between two steps."""


def read_source(name: str, node: Piece) -> tuple[Source | None, tuple[Diagnostic, ...]]:
    """The plan's entry for a node's source; and contradictions in it."""
    piece, numbers, memory = node.at("source"), node.at("numbers"), node.at("memory")
    if piece is None:
        return None, ()
    texts = {key: part.text for key, part in (piece.entries or {}).items()}
    faults: list[Diagnostic] = []
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
        {name: part.value for name, _, part in node.keyed("parameters")},
        texts.get("run", ""),
    )
    return found, tuple(faults)


def files_of(node: Piece) -> list[Piece]:
    """The files that a node's source names."""
    return [part for key in ("python", "cpp", "parameters") if (part := node.at("source", key)) is not None]


def check_memory(plan: Plan, nodes: dict[str, Node]) -> Iterator[Diagnostic]:
    """The ports that a plan declares as memory, checked against the contract."""
    for entry in plan.nodes:
        node = nodes.get(entry.node)
        if node is None or entry.source is None:
            continue
        inputs, outputs = ({p.name: p for p in side} for side in (node.inputs, node.outputs))
        for port in entry.source.memory:
            where, span = f"nodes.{entry.node}.memory", entry.source.place.at("memory", port)
            if port not in inputs:
                message = f"{where}: {port!r} is no input of {entry.node}; memory is what a step reads of the last one"
                yield Diagnostic("PLAN106", message, span, hint=suggest(port, inputs))
                continue
            if not isinstance(inputs[port].sort, HELD):
                kind = inputs[port].type_name
                message = f"{where}: memory is a number, a truth value or an element, and {port} is {kind}"
                yield Diagnostic("PLAN110", message, span)
            if port in outputs and outputs[port].sort != inputs[port].sort:
                yield Diagnostic("PLAN110", f"{where}: in.{port} and out.{port} have different types", span)


# -- parameters --------------------------------------------------------------------------------------------------------


def parameters(root: Path, source: Source, name: str) -> tuple[Mapping[str, Any], tuple[Diagnostic, ...]]:
    """The parameters of the class: the plan's own, and those of its file (if that is a ROS 2 parameter file, those set
    for the node of this whole name). YAML that another reader may interpret differently is rejected."""
    if not source.parameters:
        return nested(source.values), ()
    try:
        values, found = _settings(root, source, name)
    except Rejected as rejected:
        return {}, rejected.diagnostics
    told = ((_unclear(piece, value, key), piece.span) for key, (value, piece) in found.items())
    wrong = [Diagnostic("PLAN130", f"`{source.parameters}`: {why}", span) for why, span in told if why]
    own = source.values
    for key in sorted(own.keys() & found.keys() & source.place.data.get("parameters", {}).keys()):
        value, piece = found[key]
        if own[key] != value or isinstance(own[key], bool) is not isinstance(value, bool):
            message = f"the plan sets {key} to {own[key]!r}, and `{source.parameters}` to {value!r}"
            wrong.append(Diagnostic("PLAN139", message, piece.span))
    return nested({**{key: value for key, (value, _) in found.items()}, **own}) if own else values, tuple(wrong)


def parameter_place(root: Path, source: Source, name: str, key: str) -> Span:
    """Where the plan or its parameter file sets a parameter of the node of this whole name; otherwise where the plan
    names the file."""
    if key in source.values and key in source.place.data.get("parameters", {}):
        return source.place.key("parameters", key)
    with contextlib.suppress(Rejected, KeyError):
        return _settings(root, source, name)[1][key][1].span
    return source.place.at("source", "parameters")


def _settings(root: Path, source: Source, name: str) -> tuple[Mapping[str, Any], dict[str, tuple[Any, Piece]]]:
    """The parameters, and each one's value with its place, by its dotted name. Raises Rejected."""
    place, path = source.place.at("source", "parameters"), inside(root, source.parameters)
    try:
        assert path is not None
        piece, faults, loaded = _read(read_regular(path), str(path))
    except (OSError, AssertionError, ValueError, yaml.YAMLError, RecursionError) as error:
        raise Rejected(Diagnostic("PLAN130", f"`{source.parameters}` cannot be read: {error}", place)) from None
    if faults:
        raise Rejected(*faults)
    if not isinstance(loaded, dict):
        raise Rejected(Diagnostic("PLAN130", f"`{source.parameters}` is no mapping", piece.span))
    try:
        found = placed(loaded, name)
        values = nested({key: value for key, (value, _) in found.items()}) if is_sectioned(loaded) else loaded
    except WrongParameters as unclear:
        above = piece.at(*unclear.path[:-1]) or piece
        span = above.key_span(unclear.path[-1]) if unclear.path else piece.span
        raise Rejected(Diagnostic("PLAN130", f"`{source.parameters}`: {unclear}", span)) from None
    odd = [key for key, (_, path) in found.items() if piece.at(*path) is None]
    if odd:
        text = f"`{source.parameters}`: the keys of {odd[0]} are no plain texts"
        raise Rejected(Diagnostic("PLAN130", text, piece.span, hint="put them in quotes"))
    return values, {key: (value, piece.at(*path) or piece) for key, (value, path) in found.items()}


@functools.lru_cache(16)
def _read(data: bytes, path: str) -> tuple[Piece, tuple[Diagnostic, ...], Any]:
    """A text as the strict reader and as YAML's own reads it, once for all nodes. Raises what they raise."""
    return (*read_yaml(data, path), yaml.safe_load(data))


def never_read(plan: Plan) -> Iterator[Diagnostic]:
    """A warning for each parameter that no Python file beside the source mentions: it changes nothing. A class of ROS 2
    declares its parameters, so that driving it finds them."""
    for entry in plan.nodes:
        source = entry.source
        if source is None or not source.python or not source.parameters or source.kind is Driving.RCLPY:
            continue
        path = plan.root / source.python
        name = plan.ros.names.placed(entry.node).name
        values, _ = parameters(plan.root, source, name)
        with contextlib.suppress(OSError):
            text = b" ".join(read_regular(file) for file in path.parent.glob("*.py"))
            for key, _ in flat(values):
                lost = [part for part in key.split(".") if not re.search(rf"\b{re.escape(part)}\b".encode(), text)]
                if lost:
                    message = f"`{source.parameters}` sets {key}; no Python file beside {path.name} has `{lost[0]}`"
                    span = parameter_place(plan.root, source, name, key)
                    yield Diagnostic("PLAN136", message, span, Severity.WARNING, "correct its name, or remove it")


def _unclear(piece: Piece, loaded: Any, where: str) -> str:
    """How YAML's own reader interprets a text differently from its appearance, or that a value is no parameter's; else
    empty."""
    strict = piece.data
    if not isinstance(loaded, bool | int | float | str):
        kinds = "numbers, truth values, texts and mappings of them are parameters"
        return "" if loaded is strict is None else f"{where} is a {type(loaded).__name__}; {kinds}"
    if isinstance(loaded, float) and not math.isfinite(loaded):
        return f"{where} is {loaded}, which is no REAL"
    if type(strict) is not type(loaded) and not (type(strict) is int and type(loaded) is float):
        return f"{where} is read as {loaded!r} by some, and as {strict!r} by others: write it in quotes, or plainly"
    return "" if strict == loaded else f"{where} is read as {loaded!r} by some, and as {strict!r} by others"
