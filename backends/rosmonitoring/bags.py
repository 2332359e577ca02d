"""Bags as traces: faults of theirs, and where their topics are other than the contract and the plan take them for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros import bags
from avow.ros.bags import NOWHERE, Carried, Event, Origin, is_bag
from avow.ros.definitions import Definitions, Message, canonical

__all__ = ["NOWHERE", "Carried", "Event", "Origin", "carried", "conflicts", "is_bag", "messages"]


def carried(path: Path, origin: Origin = NOWHERE) -> Carried:
    """As `avow.ros.bags.carried`. Raises Rejected."""
    with _told():
        return bags.carried(path, origin)


def messages(
    path: Path, origin: Origin = NOWHERE, wanted: Callable[[str], bool] = lambda topic: True
) -> Iterator[tuple[Event, int]]:
    """As `avow.ros.bags.messages`. Raises Rejected."""
    with _told():
        yield from bags.messages(path, origin, wanted)


@contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except bags.NoBag as wrong:
        raise Rejected(Diagnostic("MON202" if wrong.missing else "MON203", str(wrong), hint=wrong.hint)) from None


def conflicts(path: Path, found: Carried, known: Definitions, types: Mapping[str, str]) -> Iterator[Diagnostic]:
    """Where a bag's topics are other than they are taken for: of another type (`types`: topic → type), or of a type
    that is made otherwise."""
    for topic, kind in types.items():
        there = found.types.get(topic)
        if there is None:
            continue
        if there != canonical(kind):
            text = f"{path.name}: the topic {topic} is {there} there, and {canonical(kind)} in the contract"
            yield Diagnostic("MON205", text)
            continue
        for name, mine, theirs in _differences(there, known.messages, found.known):
            text = (
                f"{path.name}: {name} is {_fields(theirs)} there, and {_fields(mine)} by "
                f"{mine.source or 'the definition that is known'}"
            )
            yield Diagnostic(
                "MON205", text, hint="the plan's `messages:` or `ros: {distro: …}` names another definition"
            )


def _differences(
    name: str, mine: Mapping[str, Message], theirs: Mapping[str, Message]
) -> Iterator[tuple[str, Message, Message]]:
    stack, seen = [name], {name}
    while stack:
        at = stack.pop()
        one, other = mine.get(at), theirs.get(at)
        if one is None or other is None:
            continue
        if one.fields != other.fields or one.constants != other.constants:
            yield at, one, other
        for field in one.fields:
            inner = getattr(getattr(field.wire, "item", field.wire), "name", "")
            if inner not in seen:
                seen.add(inner)
                stack.append(inner)


def _fields(message: Message) -> str:
    constants = [f"{name}={value}" for name, _, value in message.constants]
    return "(" + ", ".join([*(f"{f.wire} {f.name}" for f in message.fields), *constants]) + ")"
