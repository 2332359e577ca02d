"""ROS 1 and ROS 2 bags through the package rosbags: the publishers, the types, and the messages."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from avow.base.diagnostics import Hinted
from avow.base.files import read_text
from avow.base.records import dataclass
from avow.ros.calls import CALL, Calls, as_message, parts_of, with_parts
from avow.ros.definitions import Definitions, Message, canonical
from avow.ros.sources import DISTRIBUTIONS, from_store, message_files

if TYPE_CHECKING:
    from avow.ros.layout import Layout

Event = Mapping[str, Any]

ENVELOPE = ("topic", "time")
"""The keys of an event besides its message's fields."""

PUBLISHER = "_publisher"
"""The key of the whole name of the node that published an event, if it is known."""

LIVE = "_live"
"""Marks an event that was received on a running graph, where each topic has its own connection: the order in which such
events arrived is not the causal order."""

LOST, GONE = "_lost", "_gone"
"""Mark an event of a topic that is no message, with the reason: some messages were not heard, so the record is no
evidence about the topic; or nobody publishes it any more, so its values are unknown until the next message."""

WHOLE = "_message"
"""The key of an event's whole message, if the message has fields with the names in `ENVELOPE`."""

SUFFIXES = (".bag", ".db3", ".mcap")


class NoBag(Hinted):
    """The file is not a bag that can be read; the message says why."""


@dataclass(frozen=True, slots=True)
class Origin:
    """The plan's sources of message types, for bags without definitions."""

    distro: str | None = None
    messages: tuple[Path, ...] = ()


NOWHERE = Origin()


@dataclass(frozen=True, slots=True)
class Carried:
    """A bag's topics: the type of each, and the definitions of the types."""

    types: Mapping[str, str]
    known: Mapping[str, Message]
    publishers: Mapping[str, tuple[str, ...]]
    """Topic → the nodes that published it, by their whole names: a ROS 1 bag knows them, a ROS 2 bag does not."""
    counts: Mapping[str, int]
    """Topic → the number of messages."""
    ros2: bool = False


def enveloped(message: Mapping[str, Any], topic: str, time: float | bytes, by: str = "") -> Event:
    """A message as an event: its fields, its topic, when it arrived (seconds, or their digits), and, if it is known,
    the publisher. Fields with those two names are not lost."""
    event = {**message, "topic": topic, "time": time}
    if "topic" in message or "time" in message:
        event[WHOLE] = message
    if by:
        event[PUBLISHER] = by
    return event


def fields_of(event: Event) -> dict[str, Any]:
    """The fields of an event's message."""
    whole = event.get(WHOLE)
    if isinstance(whole, Mapping):
        return {**whole}
    return {name: value for name, value in event.items() if name not in (*ENVELOPE, PUBLISHER, LIVE, LOST, GONE, CALL)}


def publisher(event: Event) -> str:
    """The publisher of an event's message; empty if it is not known."""
    said = event.get(PUBLISHER, "")
    return said if isinstance(said, str) else ""


def message_of(event: Event, field: str) -> Any:
    """The part of an event that contains a field of its message: never the event's own entry of the same name."""
    if field not in ENVELOPE:
        return event
    return event.get(WHOLE, event.get("data"))


def is_bag(path: Path) -> bool:
    """Whether a trace is a bag: by its name, or because it is a folder."""
    return path.is_dir() or path.suffix in SUFFIXES


def digest_trace(path: Path) -> str:
    """SHA-256 of a trace: of the file, or of the names and contents of a bag folder's files. Raises OSError."""
    whole = hashlib.sha256()
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for file in files:
        if path.is_dir():
            whole.update(file.relative_to(path).as_posix().encode() + b"\0")
        with file.open("rb") as stream:
            if len(files) == 1 and not path.is_dir():
                return hashlib.file_digest(stream, "sha256").hexdigest()
            whole.update(hashlib.file_digest(stream, "sha256").digest())
    return whole.hexdigest()


def carried(path: Path, origin: Origin = NOWHERE) -> Carried:
    """Raises NoBag, also for a bag whose types are not defined."""
    with _opened(path, origin) as reader:
        types: dict[str, str] = {}
        publishers: dict[str, dict[str, None]] = {}
        counts: dict[str, int] = {}
        for connection in reader.connections:
            topic = connection.topic
            types[topic] = canonical(connection.msgtype)
            counts[topic] = counts.get(topic, 0) + connection.msgcount
            caller = getattr(connection.ext, "callerid", None)
            publishers.setdefault(topic, {}).update({caller: None} if caller else {})
        for topic, kind in [*types.items()]:
            for part, own in parts_of(topic, kind).items():
                types[part], publishers[part], counts[part] = own, publishers[topic], counts[topic]
        known = with_parts(from_store(reader.typestore.fielddefs, str(path)))
        told = {topic: tuple(found) for topic, found in publishers.items()}
        return Carried(types, known, told, counts, bool(getattr(reader, "is2", False)))


@dataclass(slots=True)
class Channel:
    """One publisher's messages on one topic of a bag."""

    topic: str
    by: str
    """The publisher's name, if the bag has it."""
    read: Callable[[bytes], Mapping[str, Any]]
    """A raw message's fields."""
    layout: Callable[[bytes], Layout | None] = lambda raw: None
    """A raw message's layout, if it is known."""

    def event(self, time: int, raw: bytes) -> Event:
        return enveloped(self.read(raw), self.topic, b"%d.%09d" % divmod(time, 10**9), self.by)


def messages(
    path: Path, origin: Origin = NOWHERE, wanted: Callable[[str], bool] = lambda topic: True
) -> Iterator[tuple[Event, int]]:
    """As `recorded`: the messages as events, each with its size in bytes."""
    for channel, time, raw in recorded(path, origin, wanted):
        yield channel.event(time, raw), len(raw)


def recorded(
    path: Path, origin: Origin = NOWHERE, wanted: Callable[[str], bool] = lambda topic: True
) -> Iterator[tuple[Channel, int, bytes]]:
    """The messages, with the times in nanoseconds at which they were recorded, in this order; for topics that are not
    wanted, only that there was one. For a topic whose parts are wanted (a call's request and response), the part.
    Raises NoBag."""
    calls = Calls()
    with _opened(path, origin) as reader:
        store = reader.typestore
        plain, known, ros2 = plainer(store.fielddefs), Definitions(from_store(store.fielddefs, "")), reader.is2
        deserialize = store.deserialize_cdr if ros2 else store.deserialize_ros1

        def channel(connection: Any) -> tuple[Channel, bool, bool]:
            """A connection's channel, whether its topic is wanted, and whether a part of it is."""
            topic, kind = connection.topic, as_message(connection.msgtype, "")[0]
            by = getattr(connection.ext, "callerid", None) or ""
            parts = not wanted(topic) and any(map(wanted, parts_of(topic, canonical(connection.msgtype))))
            if not parts and not wanted(topic):
                return Channel(topic, by, lambda raw: {}), False, False

            def layout(raw: bytes) -> Layout | None:
                from avow.ros.layout import Layout  # numpy starts threads, and a run forks while it has one

                return Layout.of(kind, known, raw, ros2)

            def read(raw: bytes) -> Mapping[str, Any]:
                with _readable(path):
                    found: Mapping[str, Any] = plain(deserialize(raw, kind))
                return found

            return Channel(topic, by, read, layout), True, parts

        channels: dict[int, tuple[Channel, bool, bool]] = {}
        (whole,) = reader.readers
        for connection, time, raw in whole.messages():
            if (found := channels.get(connection.id)) is None:
                found = channels[connection.id] = channel(connection)
            one, heard, parts = found
            if parts:
                topic, fields = calls.part(one.topic, one.read(raw))
                one = Channel(topic, one.by, partial(_given, fields))
            yield one, time, raw if heard else b""


def _given(fields: Mapping[str, Any], raw: bytes) -> Mapping[str, Any]:
    return fields


@contextmanager
def _opened(path: Path, origin: Origin) -> Iterator[Any]:
    from rosbags.highlevel import AnyReader

    with _readable(path), _reader(AnyReader, path, origin) as reader:
        yield reader


def _beginning(path: Path, size: int = 8) -> bytes:
    """The first bytes of a file; empty if it cannot be read."""
    with suppress(OSError), path.open("rb") as file:
        return file.read(size)
    return b""


_RECOVERED = {
    ".db3": (b"SQLite", "sqlite3 {0} .recover | sqlite3 whole.db3"),
    ".mcap": (b"\x89MCAP", "mcap recover {0} -o whole.mcap"),
    ".bag": (b"#ROSBAG", "rosbag reindex {0}"),
}
"""How the files of bags begin, and what restores one that was cut off."""


@contextmanager
def _readable(path: Path) -> Iterator[None]:
    import apsw  # rosbags reads sqlite3 by it, and passes its errors on
    from rosbags.highlevel import AnyReaderError
    from rosbags.serde import SerdeError
    from rosbags.typesys import TypesysError

    try:
        yield
    except (AnyReaderError, SerdeError, OSError, ValueError, KeyError, RuntimeError, TypesysError, apsw.Error) as error:
        why, hint = str(error), None
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        stored = next((each for each in files if each.suffix in _RECOVERED), None)
        if "type definition" in why:
            hint = "the bag holds no definitions: name the distribution, `ros: {distro: humble}`, and `messages:`"
        elif stored:
            begin, command = _RECOVERED[stored.suffix]
            hint = f"if it was cut off, `{command.format(stored)}` restores its whole messages"
            if not _beginning(stored).startswith(begin):
                hint = f"{stored} is empty, or no {stored.suffix} file by its first bytes: copy the bag again"
            elif stored.suffix == ".db3" and b"storage_identifier: mcap" in _beginning(path / "metadata.yaml", -1):
                hint = f"metadata.yaml says mcap, and {stored.name} is sqlite3: correct its storage_identifier"
        if not files:
            why, hint = "the folder is empty", "copy the bag again"
        elif path.is_dir() and not (path / "metadata.yaml").exists():
            why = "its folder has no metadata.yaml"
            inner = next((it.parent for it in sorted(path.glob("*/metadata.yaml"))), None)
            remedy = f"`ros2 bag reindex {path}` writes it from the recorded files"
            hint = f"name the bag in it: `{inner}`" if inner else remedy
        raise NoBag(f"{path} cannot be read as a bag: {why}", hint) from None


def _reader(kind: Any, path: Path, origin: Origin) -> Any:
    """A reader of the bag that also knows the types of services and actions."""
    from rosbags.rosbag2 import Reader

    class Calling(Reader):  # type: ignore[misc]
        @property
        def connections(self) -> list[Any]:
            return [_plain(c) for c in super().connections]

    found = kind([path], default_typestore=_types(origin))
    if found.is2:
        found.readers = [Calling(path)]
    return found


def _plain(connection: Any) -> Any:
    if "/msg/" in connection.msgtype:
        return connection
    kind, text = as_message(connection.msgtype, connection.msgdef.data)
    return connection._replace(msgtype=kind, msgdef=connection.msgdef._replace(data=text), digest="")


def _types(origin: Origin) -> Any:
    """The plan's types, for a bag that holds no definitions; None if the plan gives none."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if origin.distro is None:
        return None
    store = get_typestore(Stores(DISTRIBUTIONS[origin.distro]))
    for file in message_files(origin.messages):
        if file.suffix == ".msg":
            package = file.parent.parent.name if file.parent.name == "msg" else file.parent.name
            store.register(get_types_from_msg(read_text(file, "utf-8"), f"{package}/msg/{file.stem}"))
    return store


_SCALARS = frozenset((float, int, str, bool))


def plainer(fielddefs: Mapping[str, Any]) -> Callable[[Any], Any]:
    """Deserialised messages as the JSON that ROSMonitoring would write for them; floats unchanged. Fields have their
    own names, including Python keywords, to which rosbags appends an underscore."""
    names: dict[type, tuple[tuple[str, str], ...]] = {}

    def plain(message: Any) -> Any:
        kind = type(message)
        if kind in _SCALARS:
            return message
        fields = names.get(kind)
        if fields is None:
            declared = getattr(kind, "__dataclass_fields__", {})  # first the fields, then the constants
            own = [name for name, _ in fielddefs[getattr(kind, "__msgtype__", "")][1]] if declared else []
            fields = names[kind] = tuple(zip(own, declared, strict=False))
        if fields:
            return {name: plain(getattr(message, attribute)) for name, attribute in fields}
        if hasattr(message, "tolist"):
            return message.tolist()
        return [plain(item) for item in message] if isinstance(message, list | tuple) else message

    return plain
