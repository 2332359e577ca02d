"""A participant of a running ROS 2 graph, over DDS by the package cyclonedds: it needs no ROS package.

DDS discovery finds a topic's writers. Each is read by a reader with the quality of service that it offers, so that no
message that it keeps or repeats is missed. Messages that come together are put into the order of their writers' clocks.
The structure of types, and the content of a sample, are known from the definitions of messages. The samples of a call
are parts of it, as in a bag. Only those of rmw_cyclonedds name the call: they begin with its `cdds_request_header_t`.
Where it announces the types of services (since 2025), they lack this header, and do not match: that is reported.
"""

from __future__ import annotations

import keyword
import os
import re
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.graphs import reached
from avow.ros.bags import GONE, LOST, Event, enveloped, plainer
from avow.ros.calls import Calls
from avow.ros.dds import Carrier, carriers, dds_type, samples, settings
from avow.ros.definitions import Array, Definitions, Field, Message, Nested, Scalar, Wire, parse_message
from avow.ros.sources import distribution

from ..tuning import DDS_MATCH, DDS_SETTLE, DDS_TAKEN, LIVE_PAUSE
from .graphs import Inbox, Status

_CYCLONE = b"\x01\x10"
"""How a GUID of Cyclone DDS begins: with its vendor id."""
_NO_DDS = Diagnostic("MON305", "DDS needs the packages cyclonedds and rosbags", hint="pip install 'avow[dds]'")

_TIME = {
    kind: parse_message("int32 sec\nuint32 nanosec", f"builtin_interfaces/{kind.capitalize()}")
    for kind in ("time", "duration")
}
_EMPTY = Message("", (Field("structure_needs_at_least_one_member", Scalar("uint8")),))
"""The field that ROS 2 adds to a message without fields."""
_HEADER = (Field("rmw_client", Scalar("uint64")), Field("rmw_number", Scalar("int64")))
"""The fields with which a service's samples begin: the client, and the number of its request."""


@dataclass(slots=True)
class _Heard:
    """A topic that is listened to: its type, and the reader of its samples."""

    topics: tuple[str, ...]
    """One, or several parts of calls."""
    by: Carrier
    read: Callable[[bytes], dict[str, Any]]
    calls: Calls
    entity: Any = None

    def event(self, data: bytes, now: float) -> Event:
        """Raises ValueError."""
        try:
            fields = self.read(data)
        except ValueError as error:
            raise ValueError(f"{self.topics[0]}: {error}") from None
        if not self.by.recorded:
            return enveloped(fields, self.topics[0], now)
        if self.by.event is not None:
            client, number = (fields.pop(part.name) for part in _HEADER)
            info = {"event_type": self.by.event, "client_gid": [*client.to_bytes(8, "big")], "sequence_number": number}
            fields = {"info": info, "request" if self.by.event == 1 else "response": [fields]}
        topic, part = self.calls.part(self.by.recorded, fields)
        return enveloped(part, topic, now)


@dataclass(slots=True)
class _Reader:
    """A reader for all writers of a topic that offer the same quality of service."""

    heard: _Heard
    entity: Any
    lost: int = 0


@dataclass(slots=True)
class _Writer:
    """A writer of a topic, and the reader for it: others may receive its samples too, but these are ignored."""

    reader: _Reader
    key: object = None
    """Its name in the domain, if it was discovered."""
    since: float = field(default_factory=time.monotonic)
    settled: bool = False
    """It is matched, or gone, or has been reported."""
    gone: bool = False


class Dds:
    """Listens to the topics of a domain; use it as a context."""

    def __init__(
        self, domain: int, topics: Iterable[str], kinds: Mapping[str, str], known: Definitions, host: str
    ) -> None:
        """`kinds`: the type of each topic, without its leading slash. `host`: an address of the network of the nodes.
        Raises Rejected for a topic whose type is not known, and without the package cyclonedds."""
        self.inbox = Inbox()
        self._domain, self._host = domain, host
        self._types = _Types(known)
        self._heard: dict[str, _Heard] = {}
        wrong: list[Diagnostic] = []
        for topic in topics:
            kind = kinds.get(topic.lstrip("/"), "")
            carried = carriers(topic, kind)
            why = next(filter(None, (self._types.missing(each.kind) for each in carried)), "")
            why = why if kind else f"nothing says of which type {topic} is"
            if why:
                hint = "name the files of its type under `messages`, or the distribution, `ros: {distro: humble}`"
                wrong.append(Diagnostic("MON306", f"{topic} cannot be heard over DDS: {why}", hint=hint))
            else:
                calls = Calls()
                for each in carried:
                    others = self._heard[each.topic].topics if each.topic in self._heard else ()
                    self._heard[each.topic] = _Heard((topic, *others), each, self._types.reader(each.kind), calls)
        if wrong:
            raise Rejected(*wrong)
        self._over = threading.Event()
        self._writers: dict[int, _Writer] = {}
        self._left: list[_Writer] = []
        """Those whose departure is not reported yet."""
        self._readers: dict[tuple[Any, ...], _Reader] = {}
        self._spoken: list[Any] = []

    def __enter__(self) -> Dds:
        """Raises Rejected if the domain cannot be joined."""
        try:
            from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
            from cyclonedds.core import DDSException, WaitSet
            from cyclonedds.domain import Domain, DomainParticipant
            from cyclonedds.qos import Policy
            from cyclonedds.topic import Topic
        except ImportError:
            raise Rejected(_NO_DDS) from None
        try:
            self._entity = None if "CYCLONEDDS_URI" in os.environ else Domain(self._domain, settings(self._host))
            self._participant = DomainParticipant(self._domain)
            for name, heard in self._heard.items():
                heard.entity = Topic(self._participant, name, self._types.raw(heard.by.kind))
            self._publications = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
            self._wait = WaitSet(self._participant)
            self._wait.attach(self._condition(self._publications))
            plain = Policy.Reliability.Reliable(0), Policy.Durability.Volatile, Policy.Ownership.Shared
            for heard in self._heard.values():
                if heard.by.event is not None:  # a client may be gone before its writer is discovered
                    self._reader(heard, plain)
        except DDSException as error:
            text = f"DDS domain {self._domain} cannot be joined at {self._host}: {error}"
            raise Rejected(Diagnostic("MON303", text, hint="--live dds:0 --host ADDRESS")) from None
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()

    def diagnostics(self, topic: str, system: str) -> Callable[[Sequence[Status]], None]:
        """A function that publishes verdicts on a topic. Raises Rejected."""
        from cyclonedds.core import DDSException, Qos
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy
        from cyclonedds.topic import Topic
        from cyclonedds.util import duration

        kind = "diagnostic_msgs/DiagnosticArray"
        types = _Types(Definitions(distribution("humble")))  # the same in every ROS 2 so far
        qos = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(DDS_TAKEN))
        try:
            entity = Topic(self._participant, carriers(topic, kind)[0].topic, types.struct(kind))
            writer = DataWriter(self._participant, entity, qos)
        except DDSException as error:
            raise Rejected(Diagnostic("MON303", f"{topic} cannot be written over DDS: {error}")) from None
        self._spoken.append(writer)

        def say(statuses: Sequence[Status]) -> None:
            made = [status.message(system) for status in statuses]
            header = {"stamp": divmod(time.time_ns(), 10**9), "frame_id": ""}
            writer.write(_filled(types, kind, {"header": header, "status": made}))

        return say

    def _condition(self, reader: Any) -> Any:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState

        return ReadCondition(reader, SampleState.NotRead | ViewState.Any | InstanceState.Any)

    def _listen(self) -> None:
        from cyclonedds.core import DDSException
        from cyclonedds.util import duration

        pause = duration(seconds=LIVE_PAUSE)
        try:
            while not self._over.is_set():
                self._wait.wait(pause)
                time.sleep(DDS_SETTLE)
                self._discover()
                self._take()
                self._look()
        except DDSException as error:
            for heard in self._heard.values():
                self._trouble(heard, f"DDS: {error}")

    def _trouble(self, heard: _Heard, text: str, mark: str = LOST) -> None:
        for topic in heard.topics:
            self.inbox.trouble(topic, f"{topic}: {text}", mark)

    def _discover(self) -> None:
        """Find the writers of the topics that are listened to."""
        for found in samples(self._publications, DDS_TAKEN):
            handle = found.sample_info.instance_handle
            if not found.sample_info.valid_data:
                if handle in self._writers:
                    self._writers[handle].settled = self._writers[handle].gone = True
                    self._left.append(self._writers[handle])
                continue
            heard = self._heard.get(found.topic_name)
            if heard is None or handle in self._writers:
                continue
            if found.type_name != dds_type(heard.by.kind):
                said = re.sub("::(msg|srv|action)::dds_::", "/", found.type_name).removesuffix("_")
                self._trouble(heard, f"it is written as {said}, and is to be {heard.by.kind}")
                continue
            if heard.by.event is not None and not found.key.bytes.startswith(_CYCLONE):
                text = "nothing names its calls; set RMW_IMPLEMENTATION=rmw_cyclonedds_cpp for its nodes"
                self._trouble(heard, f"it is not written by Cyclone DDS: {text}")
                self._writers[handle] = _Writer(_Reader(heard, None), settled=True)  # none takes its samples
                continue
            if any(writer.gone and writer.key == found.key for writer in self._writers.values()):
                self._trouble(heard, "a writer was out of reach: what it wrote in that time is lost")
            self._writers[handle] = _Writer(self._reader(heard, found.qos), found.key)

    def _reader(self, heard: _Heard, offered: Any) -> _Reader:
        """A reader with the quality of service that a writer offers."""
        from cyclonedds.core import Qos
        from cyclonedds.qos import Policy
        from cyclonedds.sub import DataReader, Subscriber

        taken = [policy for policy in offered if policy.__scope__ in ("Reliability", "Durability", "Ownership")]
        part = [policy for policy in offered if policy.__scope__ == "Partition"]
        key = (heard.by.topic, *sorted(type(policy).__qualname__ for policy in taken), *map(repr, part))
        if key not in self._readers:
            more = Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True)
            qos = Qos(*taken, Policy.History.KeepAll, more)  # a reader would not report dropped samples
            subscriber = Subscriber(self._participant, Qos(*part)) if part else self._participant
            entity = DataReader(subscriber, heard.entity, qos)
            self._wait.attach(self._condition(entity))
            self._readers[key] = _Reader(heard, entity)
        return self._readers[key]

    def _take(self) -> None:
        """Take the new samples: of each writer by its own reader, in the order of their clocks. Losses come first: they
        are found when a later sample comes."""
        for reader in self._readers.values():
            lost = reader.entity.get_sample_lost_status().total_count
            if lost != reader.lost:
                reader.lost = lost
                self._trouble(reader.heard, f"{lost} samples lost")
        taken = [(reader, sample) for reader in self._readers.values() for sample in samples(reader.entity, DDS_TAKEN)]
        if any(sample.sample_info.publication_handle not in self._writers for _, sample in taken):
            self._discover()  # a writer that came in between
        found: list[tuple[int, _Heard, bytes]] = []
        for reader, sample in taken:
            info = sample.sample_info
            if not info.valid_data:
                continue
            writer = self._writers.get(info.publication_handle)
            if writer is None:  # it came and went within a round, and was not discovered
                writer = self._writers[info.publication_handle] = _Writer(reader, gone=True)
                self._left.append(writer)
            if writer.reader is reader:
                writer.settled = True  # whatever discovery reports of it later
                found.append((info.source_timestamp, reader.heard, sample.data))
        for _, heard, data in sorted(found, key=lambda one: one[0]):
            self.inbox.message(heard.topics[0], partial(heard.event, data))

    def _look(self) -> None:
        """Report the writers that cannot be heard, and the topics without any."""
        for handle, writer in self._writers.items():
            if writer.settled:
                continue
            writer.settled = writer.reader.entity.get_matched_publication_data(handle) is not None
            if not writer.settled and time.monotonic() - writer.since > DDS_MATCH:
                writer.settled = True
                text = f"a writer cannot be heard: its {writer.reader.heard.by.kind} is made otherwise than known here"
                self._trouble(writer.reader.heard, f"{text}, or its quality of service has no match")
        for heard in {writer.reader.heard.topics: writer.reader.heard for writer in self._left}.values():
            if all(writer.gone for writer in self._writers.values() if writer.reader.heard.topics == heard.topics):
                self._trouble(heard, "no writer is left", GONE)
        self._left.clear()


class _Types:
    """The types of some definitions, for cyclonedds (which announces them) and for rosbags, which reads."""

    def __init__(self, known: Definitions) -> None:
        """Raises Rejected without the packages cyclonedds and rosbags."""
        try:
            from cyclonedds.idl import make_idl_struct, types
            from rosbags.interfaces import Nodetype
            from rosbags.typesys import Stores, get_typestore
        except ImportError:
            raise Rejected(_NO_DDS) from None
        self._make, self._types, self._kind = make_idl_struct, types, Nodetype
        self._empty = partial(get_typestore, Stores.EMPTY)
        self._known = known
        self._made: dict[str, Any] = {}

    def missing(self, kind: str) -> str:
        """Why a type cannot be heard; empty if it can."""
        message = self._known.get(kind)
        if message is None:
            return f"nothing defines {kind}"
        if lacking := self._known.missing(message):
            return f"nothing defines {lacking[0]}, of which {kind} is made"
        wide = [name for name in self._names(message) for f in self.message(name).fields if _has_wide(f.wire)]
        return f"{wide[0]} has a wstring, which cannot be read here" if wide else ""

    def struct(self, kind: str) -> Any:
        """A class of cyclonedds. It must not be `missing`."""
        if kind not in self._made:
            self._made[kind] = self._new(kind)
        return self._made[kind]

    def raw(self, kind: str) -> Any:
        """As `struct`, for readers: its samples are of class `_Raw`."""
        made = self._new(kind, whole=True)
        made.deserialize = classmethod(lambda cls, data, *more: _Raw(data))
        made.deserialize_key = classmethod(lambda cls, data, *more: _Raw(b""))
        return made

    def _new(self, kind: str, *, whole: bool = False) -> Any:
        fields = {_attribute(f.name): self._idl(f.wire) for f in self.message(kind, whole=whole).fields}
        return self._make(f"{kind.rpartition('/')[2]}_", dds_type(kind), fields)

    def reader(self, kind: str) -> Callable[[bytes], dict[str, Any]]:
        """A function that reads a sample like a bag's message; it raises ValueError if it is no such message."""
        from rosbags.serde import SerdeError

        base, store = self._kind, self._empty()

        def desc(wire: Wire) -> Any:
            match wire:
                case Scalar(name="time" | "duration" as name):
                    return base.NAME, _full(_TIME[name].name)
                case Scalar(name=name):
                    return base.BASE, (name, 0)
                case Nested(name=name):
                    return base.NAME, _full(name)
                case Array(item=item, length=None):
                    return base.SEQUENCE, (desc(item), 0)
                case Array(item=item, length=length):
                    return base.ARRAY, (desc(item), length)

        names = self._names(self.message(kind))
        whole = {name: self.message(name, whole=name == kind).fields for name in names}
        store.register({_full(name): ([], [(f.name, desc(f.wire)) for f in found]) for name, found in whole.items()})
        plain, full = plainer(store.fielddefs), _full(kind)

        def read(raw: bytes) -> dict[str, Any]:
            try:
                found: dict[str, Any] = plain(store.deserialize_cdr(raw, full))
            except (SerdeError, AssertionError, IndexError) as error:
                raise ValueError(f"a sample is no {kind}: {error}") from None
            return found

        return read

    def message(self, kind: str, *, whole: bool = False) -> Message:
        """`whole`: as a sample of its own, not within another."""
        for each in _TIME.values():
            if each.name == kind:
                return each
        message = self._known.get(kind)
        assert message is not None, kind
        header = _HEADER if whole and kind.endswith(("_Request", "_Response")) else ()
        return Message(kind, (*header, *(message.fields or _EMPTY.fields)))

    def _names(self, message: Message) -> list[str]:
        """The types that a message consists of, including its own."""

        def inner(name: str) -> Iterator[str]:
            for each in self.message(name).fields:
                wire = each.wire.item if isinstance(each.wire, Array) else each.wire
                if isinstance(wire, Nested):
                    yield wire.name
                elif wire.name in _TIME:
                    yield _TIME[wire.name].name

        return list(reached([message.name], inner))

    def _idl(self, wire: Wire) -> Any:
        match wire:
            case Scalar(name="time" | "duration" as name):
                return self.struct(_TIME[name].name)
            case Scalar(name="string"):
                return str
            case Scalar(name="bool"):
                return bool
            case Scalar(name=name):
                return getattr(self._types, name)
            case Nested(name=name):
                return self.struct(name)
            case Array(item=item, length=None):
                return self._types.sequence[self._idl(item)]
            case Array(item=item, length=length):
                return self._types.array[self._idl(item), length]


class _Raw:
    """A sample as it was received; cyclonedds sets `sample_info`."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.sample_info: Any = None


def _filled(types: _Types, kind: str, values: Mapping[str, Any]) -> Any:
    """A message to be published, from plain values."""

    def made(wire: Wire, value: Any) -> Any:
        match wire:
            case Scalar(name="time" | "duration" as name):
                return types.struct(_TIME[name].name)(*value)
            case Scalar():
                return value
            case Nested(name=name):
                return _filled(types, name, value)
            case Array(item=item):
                return [made(item, one) for one in value]

    return types.struct(kind)(**{_attribute(f.name): made(f.wire, values[f.name]) for f in types.message(kind).fields})


def _attribute(name: str) -> str:
    """A field's name as a Python name."""
    return f"{name}_" if keyword.iskeyword(name) else name


def _has_wide(wire: Wire) -> bool:
    return (wire.item if isinstance(wire, Array) else wire) == Scalar("wstring")


def _full(kind: str) -> str:
    package, _, name = kind.partition("/")
    return f"{package}/msg/{name}"
