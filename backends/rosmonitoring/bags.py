"""ROS 1 and ROS 2 bags through the package rosbags: what their messages are made of, and the messages."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros.definitions import Definitions, Message, canonical
from avow.ros.sources import DISTRIBUTIONS, from_store, message_files

Event = Mapping[str, Any]

SUFFIXES = (".bag", ".db3", ".mcap")


@dataclass(frozen=True, slots=True)
class Origin:
    """What a plan says of message types, for bags that say nothing themselves."""

    distro: str | None = None
    messages: tuple[Path, ...] = ()


NOWHERE = Origin()


@dataclass(frozen=True, slots=True)
class Carried:
    """What a bag says of its topics: the type of each, and how the types are made."""

    types: Mapping[str, str]
    known: Mapping[str, Message]


def is_bag(path: Path) -> bool:
    """Whether a trace is a bag: by its name, or since it is a folder."""
    return path.is_dir() or path.suffix in SUFFIXES


def carried(path: Path, origin: Origin = NOWHERE) -> Carried:
    """Raises Rejected for what is no bag, or a bag whose types nothing defines."""
    with _opened(path, origin) as reader:
        types = {c.topic: canonical(c.msgtype) for c in reader.connections}
        return Carried(types, from_store(reader.typestore.fielddefs, str(path)))


def messages(
    path: Path, origin: Origin = NOWHERE, wanted: Callable[[str], bool] = lambda topic: True
) -> Iterator[Event]:
    """The messages as events, in the order in which they were recorded; of topics that are not wanted, only that there
    was one. Raises Rejected."""
    with _opened(path, origin) as reader:
        plain = _plainer()
        for connection, time, raw in reader.messages():
            event: dict[str, Any] = {}
            if wanted(connection.topic):
                event = plain(reader.deserialize(raw, connection.msgtype))
            event["topic"] = connection.topic
            event["time"] = time / 1e9
            yield event


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


@contextmanager
def _opened(path: Path, origin: Origin) -> Iterator[Any]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.serde import SerdeError
        from rosbags.typesys import TypesysError
    except ImportError:
        text = "reading bags needs the package rosbags"
        raise Rejected(Diagnostic("MON202", text, hint="pip install 'avow[bags]'")) from None
    try:
        with AnyReader([path], default_typestore=_types(origin)) as reader:
            yield reader
    except (AnyReaderError, SerdeError) as error:
        hint = ""
        if "type definition" in str(error):
            hint = "the bag holds no definitions: name the distribution, `ros: {distro: humble}`, and `messages:`"
        raise Rejected(Diagnostic("MON203", f"{path} is no bag that can be read: {error}", hint=hint or None)) from None
    except (OSError, ValueError, KeyError, RuntimeError, TypesysError) as error:
        raise Rejected(Diagnostic("MON203", f"{path} cannot be read as a bag: {error}")) from None


def _types(origin: Origin) -> Any:
    """What the plan says of types, for a bag that holds no definitions; None where it says nothing."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if origin.distro is None:
        return None
    store = get_typestore(Stores(DISTRIBUTIONS[origin.distro]))
    for file in message_files(origin.messages):
        if file.suffix == ".msg":
            package = file.parent.parent.name if file.parent.name == "msg" else file.parent.name
            store.register(get_types_from_msg(file.read_text(encoding="utf-8"), f"{package}/msg/{file.stem}"))
    return store


def _plainer() -> Callable[[Any], Any]:
    """Deserialised messages as the JSON that ROSMonitoring would write of them; floats as they are."""
    names: dict[type, tuple[str, ...]] = {}

    def plain(message: Any) -> Any:
        kind = type(message)
        fields = names.get(kind)
        if fields is None:
            declared = getattr(kind, "__dataclass_fields__", {})
            fields = names[kind] = tuple(name for name in declared if not name.startswith("__"))
        if fields:
            return {name: plain(getattr(message, name)) for name in fields}
        if hasattr(message, "tolist"):
            return message.tolist()
        return [plain(item) for item in message] if isinstance(message, list | tuple) else message

    return plain
