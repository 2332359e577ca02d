"""The notes on a monitor before it runs: the field that each variable is read from, and bags whose messages differ from
the expected types."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import assert_never

from avow.base.diagnostics import Diagnostic, Severity, Span
from avow.base.graphs import reached
from avow.base.suggestions import nearest
from avow.formulas.formula import free_variables
from avow.language.terms import Role
from avow.ros.bags import Carried, Origin, is_bag
from avow.ros.calls import is_service_part
from avow.ros.definitions import Definitions, Message, canonical
from avow.system.plan import System
from avow.system.topics import whole_name

from .options import Setup, origin, same_topic
from .reading import shown
from .rules import Choice, Constant, Fields, Parameter, Previous, Rule
from .traces import carried


def readable(setup: Setup, path: Path, where: Origin) -> tuple[Diagnostic, ...]:
    """Why a bag's messages are not what the rules expect. Raises Rejected if it is no bag."""
    if not is_bag(path):
        return ()
    found = carried(path, where)
    kinds = setup.kinds
    topics = {name: same_topic(rule.topic) for name, rule in setup.carried.items()}
    said = {topic for name, topic in topics.items() if name.startswith(f"{Role.OUTPUT}.")}
    known = {topics[name]: who for name, who in setup.shared.items()}
    hint = "model the others too, or give their names under `ros: {nodes: …}`"
    for topic, who in found.publishers.items():
        modelled = known.get(same_topic(topic))
        if modelled is not None and (strange := [name for name in who if name not in modelled]):
            text = f"{path.name}: {' and '.join(strange)} publish {topic}, and in the contract {', '.join(modelled)} do"
            return (Diagnostic("MON207", text, hint=hint),)
        if modelled is None and same_topic(topic) in said and any(map(setup.strange, who)):
            text = f"{path.name}: {' and '.join(who)} published {topic}, and in the contract {setup.placed} alone does"
            return (Diagnostic("MON207", text, hint=hint),)
    calls = [topic for topic in setup.topics if is_service_part(topic)]
    if calls and not found.ros2:
        text = f"{path.name} is a ROS 1 bag, which cannot hold calls of services: {', '.join(calls)}"
        return (Diagnostic("MON206", text, hint="publish what is called and answered, or write a JSON trace"),)
    types = {topic: kinds[same_topic(topic)] for topic in found.types if same_topic(topic) in kinds}
    return tuple(_conflicts(path, found, setup.known, types))


def unheard(setup: Setup, path: Path, system: System) -> Iterator[Diagnostic]:
    """The node's topics that a bag does not have, if it has one of nearly that name that no node has."""
    if not is_bag(path):
        return
    found = {same_topic(topic) for topic in carried(path, origin(system)).types}
    known = {whole_name(system.plan.ros.names, node, t) for node in system.contract.nodes for t in node.topics}
    others = sorted(f"/{topic}" for topic in found - {same_topic(name) for name in known})
    spans = {t.port.variable.qualified: t.span for t in setup.node.topics if t.port is not None}
    for name, rule in setup.carried.items():
        near = nearest(f"/{same_topic(rule.topic)}", others, alike=0.75)
        if near and same_topic(rule.topic) not in found and name in spans:
            text = f"{path.name} has no message on {rule.topic}"
            yield Diagnostic("MON208", text, spans[name], Severity.WARNING, f"did you mean `{near[0]}`?")


def _conflicts(path: Path, found: Carried, known: Definitions, types: Mapping[str, str]) -> Iterator[Diagnostic]:
    """The topics of a bag that differ from expectation: by another type (`types`: topic → type), or by another
    definition of the same type."""
    for topic, kind in types.items():
        there = found.types.get(topic)
        if there is None:
            continue
        if there != canonical(kind):
            text = f"{path.name}: the topic {topic} is {there} there, and {canonical(kind)} in the contract"
            yield Diagnostic("MON205", text)
        for name, mine, theirs in _differences(there, known.messages, found.known) if there == canonical(kind) else ():
            here = f"{_fields(mine)} by {mine.source or 'the definition that is known'}"
            hint = "record again, or name the definitions of that day by `messages:` or `ros: {distro: …}`"
            yield Diagnostic("MON205", f"{path.name}: {name} is {_fields(theirs)} there, and {here}", hint=hint)


def _differences(
    name: str, mine: Mapping[str, Message], theirs: Mapping[str, Message]
) -> Iterator[tuple[str, Message, Message]]:
    def inner(at: str) -> list[str]:
        fields = mine[at].fields if at in mine and at in theirs else ()
        return [getattr(getattr(field.wire, "item", field.wire), "name", "") for field in fields]

    for at in reached([name], inner):
        one, other = mine.get(at), theirs.get(at)
        if one is not None and other is not None and (one.fields, one.constants) != (other.fields, other.constants):
            yield at, one, other


def _fields(message: Message) -> str:
    constants = [f"{name}={value}" for name, _, value in message.constants]
    return "(" + ", ".join([*(f"{f.wire} {f.name}" for f in message.fields), *constants]) + ")"


def readings(setup: Setup, span: Span | None) -> Iterator[Diagnostic]:
    """One note that gives, for each variable of the node's clauses, the fields that it is read from."""
    spoken = {v.qualified for clause in setup.node.clauses for v in free_variables(clause.formula)}
    texts = [reading(name, rule) for name, rule in setup.rules.items() if name in spoken]
    told = "; ".join(text for text in texts if text)
    if told:
        yield Diagnostic("MON107", f"{setup.node.name}: {told}", span, Severity.NOTE)


def reading(name: str, rule: Rule) -> str:
    """``in.range ← range : float32 (/scan)``; empty for a variable that no message carries."""
    match rule:
        case Parameter(paths=((node, parameter, *kept),)):
            return "" if kept else f"{name} ← parameter {parameter} of {node} ({rule.topic})"
        case Fields():
            parts = []
            for at, path in enumerate(rule.paths):
                wire = rule.wire(at)
                parts.append((shown(path) or "the message") + (f" : {wire}" if wire else ""))
            taken = f"{rule.take} of " if rule.take else ""
            each = f" of each of {shown(rule.each)}" if rule.each else ""
            frame = f" in {rule.frame}" if rule.frame else ""
            return f"{name} ← {taken}{', '.join(parts)}{each} ({rule.topic}{frame})"
        case Choice():
            return f"{name} ← {shown(rule.tag)} and its arguments ({rule.topic})"
        case Constant() | Previous():  # from the scenario, or the step before
            return ""
        case _:
            assert_never(rule)
