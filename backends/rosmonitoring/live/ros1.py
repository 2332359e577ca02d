"""A participant of a running ROS 1 graph: it listens to topics and publishes verdicts, and needs no ROS package.

ROS's protocols: the master's and the nodes' XML-RPC interfaces, and TCPROS: a header of `name=value` fields, then
messages, each after its length. The header of a publisher's answer has the full definition of its messages.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from contextlib import suppress
from functools import partial
from socketserver import ThreadingMixIn
from typing import Any
from urllib.parse import urlparse
from xmlrpc.server import SimpleXMLRPCServer

from rosbags.serde import SerdeError
from rosbags.typesys import Stores, TypesysError, get_types_from_msg, get_typestore

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros.bags import GONE, LOST, Event, enveloped, plainer
from avow.ros.master import FAILURES, interface

from ..session import raw
from ..tuning import AGAIN_SECONDS, FRAME_BYTES, HEADER_BYTES, LISTENER_SECONDS, MASTER_ATTEMPTS, PUBLISHER_SECONDS
from .graphs import Inbox, Status

CALLER = "/avow_monitor"
HOST = "127.0.0.1"


class _Server(ThreadingMixIn, SimpleXMLRPCServer):
    daemon_threads = True


class Ros1:
    """Listens to the topics of a graph; use it as a context."""

    def __init__(
        self, master: str, topics: Iterable[str], host: str = HOST, filtered: Set[str] = frozenset(),
        warn: Callable[[str], None] = lambda text: None,
    ) -> None:  # fmt: skip
        """`host`: the name or address at which the graph's nodes find this one. `filtered`: topics (without their
        leading slash) on which only the messages that are passed on are published; their nodes publish under the name
        that `raw` returns. `warn` receives a message while a master is awaited."""
        self.host = host
        self._warn = warn
        topics = tuple(topic if topic.startswith("/") else f"/{topic}" for topic in topics)
        self._filtered = {raw(topic): topic for topic in topics if topic[1:] in filtered}
        self.topics = (*topics, *self._filtered)
        self.inbox = Inbox()
        self._uri = master
        self._heard: dict[tuple[str, str], threading.Event] = {}
        self._reached: set[tuple[str, str]] = set()
        """(topic, publisher) → set once the master no longer names it."""
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._spoken: dict[str, Spoken] = {}
        self._speaking = threading.Lock()

    def __enter__(self) -> Ros1:
        """Raises Rejected if no master answers within some seconds."""
        self._slave = _Server((self.host, 0), logRequests=False, allow_none=True)
        calls: dict[str, Any] = {"publisherUpdate": self._publishers, "requestTopic": self._requested}
        for name, call in calls.items():
            self._slave.register_function(call, name)
        self._slave.register_function(lambda caller: (1, "", os.getpid()), "getPid")
        self._slave.register_function(lambda caller, reason="": (1, "", 0), "shutdown")
        threading.Thread(target=self._slave.serve_forever, daemon=True).start()
        self.uri = f"http://{self.host}:{self._slave.server_address[1]}/"
        try:
            for topic in self.topics:
                _, _, publishers = self._asked("registerSubscriber", CALLER, topic, "*", self.uri)
                self._publishers("", topic, publishers)
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        for topic in self.topics:
            with suppress(Rejected):
                self._asked("unregisterSubscriber", CALLER, topic, self.uri)
        for spoken in self._spoken.values():
            with suppress(Rejected):
                self._asked("unregisterPublisher", CALLER, spoken.topic, self.uri)
            spoken.close()
        self._slave.shutdown()
        self._slave.server_close()

    def _forward(self, topic: str, fields: Mapping[str, str]) -> Callable[[bytes, Event], None] | None:
        """A function that passes a topic's messages on, with other values of some fields; None for a topic that is not
        filtered."""
        target = self._filtered.get(topic)
        if target is None:
            return None
        with self._speaking:
            if target not in self._spoken:
                latch = fields.get("latching") == "1"
                self.speak(target, fields["type"], fields["message_definition"], fields["md5sum"], latch=latch)
            if self._spoken[target].digest != fields["md5sum"]:
                raise ValueError(f"its {fields['type']} is made otherwise than that of another publisher")
        store, kind = typed(topic, fields)

        def forward(said: bytes, changed: Event) -> None:
            if changed:
                made: Any = store.deserialize_ros1(said, kind)
                said = bytes(store.serialize_ros1(dataclasses.replace(made, **changed), kind))
            self._spoken[target].say(said)

        return forward

    def speak(self, topic: str, kind: str, definition: str, digest: str, *, latch: bool = True) -> Spoken:
        """Advertise a topic."""
        fields = {"type": kind, "message_definition": definition, "md5sum": digest}
        spoken = Spoken(self.host, topic, fields, latch=latch)
        self._spoken[topic] = spoken
        self._asked("registerPublisher", CALLER, topic, kind, self.uri)
        return spoken

    def diagnostics(self, topic: str, system: str) -> Callable[[Sequence[Status]], None]:
        """A function that publishes verdicts on a topic. Raises Rejected."""
        store, full = get_typestore(Stores.ROS1_NOETIC), "diagnostic_msgs/msg/DiagnosticArray"
        definition, digest = store.generate_msgdef(full, ros_version=1)
        spoken = self.speak(topic, "diagnostic_msgs/DiagnosticArray", definition, digest)
        types, numbers = store.types, itertools.count()

        def say(statuses: Sequence[Status]) -> None:
            now = time.time_ns()
            stamp = types["builtin_interfaces/msg/Time"](sec=now // 10**9, nanosec=now % 10**9)
            header = types["std_msgs/msg/Header"](seq=next(numbers), stamp=stamp, frame_id="")
            made = [
                types["diagnostic_msgs/msg/DiagnosticStatus"](
                    level=status.level,
                    name=status.name,
                    message=status.text,
                    hardware_id=system,
                    values=[types["diagnostic_msgs/msg/KeyValue"](key=k, value=v) for k, v in status.values],
                )
                for status in statuses
            ]
            spoken.say(bytes(store.serialize_ros1(types[full](header=header, status=made), full)))

        return say

    def _asked(self, call: str, *arguments: Any) -> tuple[int, str, Any]:
        """The answer of the master, which may be starting up. Raises Rejected."""
        for attempt in range(MASTER_ATTEMPTS):
            try:
                with interface(self._uri) as master:
                    code, text, value = getattr(master, call)(*arguments)
                break
            except FAILURES as error:
                text = f"no ROS 1 master answers at {self._uri}: {error}"
                if self._over.is_set() or attempt + 1 == MASTER_ATTEMPTS:
                    raise Rejected(Diagnostic("MON303", text, hint="--live ros1:http://host:11311")) from None
                if not attempt:
                    self._warn(f"{text}; it is asked again for {MASTER_ATTEMPTS * AGAIN_SECONDS:g} s")
                self._over.wait(AGAIN_SECONDS)
        if code != 1:
            raise Rejected(Diagnostic("MON303", f"the master at {self._uri} refuses {call}: {text}"))
        return code, text, value

    def _requested(self, caller: str, topic: str, protocols: list[Any]) -> tuple[int, str, Any]:
        """A subscriber requests a topic that is published here."""
        spoken = self._spoken.get(topic)
        if spoken is None:
            return 0, "not published here", []
        return 1, "", ["TCPROS", self.host, spoken.port]

    def _publishers(self, caller: str, topic: str, publishers: list[str]) -> tuple[int, str, int]:
        """The master reports the current publishers of a topic."""
        with self._lock:
            if topic in self._filtered.values():
                for uri in publishers:
                    if uri != getattr(self, "uri", None):
                        text = f"{uri} publishes {topic} past the filter: start its node with {topic}:={raw(topic)}"
                        self.inbox.trouble(topic, text)
                return 1, "", 0
            for uri in publishers:
                if (topic, uri) not in self._heard and uri != getattr(self, "uri", None):
                    gone = self._heard[topic, uri] = threading.Event()
                    threading.Thread(target=self._listen, args=(topic, uri, gone), daemon=True).start()
            for key in [k for k in self._heard if k[0] == topic and k[1] not in publishers]:
                self._heard.pop(key).set()
        return 1, "", 0

    def _listen(self, topic: str, uri: str, gone: threading.Event) -> None:
        """Listen to one publisher of a topic while the master names it; retry if it cannot be reached or closes the
        connection."""
        while not (self._over.is_set() or gone.is_set()):
            try:
                self._hear(topic, uri, gone)
            except (ValueError, Rejected) as error:  # its messages cannot be read, now or later
                self._trouble(topic, uri, str(error))
                break
            except FAILURES as error:
                self._trouble(topic, uri, f"{error}; it is asked again", GONE)
            gone.wait(AGAIN_SECONDS)
        with self._lock:
            if self._heard.get((topic, uri)) is gone:
                del self._heard[topic, uri]

    def _trouble(self, topic: str, uri: str, text: str, mark: str = LOST) -> None:
        if not self._over.is_set():
            self.inbox.trouble(topic, f"{topic} from {uri}: {text}", mark)

    def _hear(self, topic: str, uri: str, gone: threading.Event) -> None:
        """Listen to one publisher until the connection closes. Raises Rejected, ValueError, and those of `FAILURES`."""
        with interface(uri) as other:
            code, text, protocol = other.requestTopic(CALLER, topic, [["TCPROS"]])
        if code != 1 or not isinstance(protocol, list) or len(protocol) != 3:
            raise ConnectionError(f"it does not speak TCPROS: {text}")
        with socket.create_connection((str(protocol[1]), int(protocol[2])), timeout=PUBLISHER_SECONDS) as line:
            line.sendall(header({"callerid": CALLER, "topic": topic, "type": "*", "md5sum": "*", "tcp_nodelay": "1"}))
            fields = read_header(line)
            line.settimeout(None)  # from now on it may be silent
            read = reader(topic, fields)
            forward = self._forward(topic, fields)
            if (topic, uri) in self._reached:
                self._trouble(topic, uri, "it was out of reach: what it published in that time is lost")
            self._reached.add((topic, uri))
            while not (self._over.is_set() or gone.is_set()):
                said = frame(line, FRAME_BYTES)
                on = None if forward is None else partial(forward, said)
                self.inbox.message(topic, partial(_event, topic, fields.get("callerid", ""), read, said), on)


def _event(topic: str, by: str, read: Callable[[bytes], dict[str, Any]], raw: bytes, now: float) -> Event:
    return enveloped(read(raw), topic, now, by)


class Spoken:
    """A topic that is published; `latch`: the latest message is kept for later subscribers."""

    def __init__(self, host: str, topic: str, fields: Mapping[str, str], *, latch: bool = True) -> None:
        self.topic = topic
        self._latch = latch
        self.digest = fields["md5sum"]
        self._header = header({"callerid": CALLER, "topic": topic, "latching": str(int(latch)), **fields})
        self._listening = socket.create_server((host, 0))
        self.port = int(self._listening.getsockname()[1])
        self._lines: list[socket.socket] = []
        self._latest = b""
        self._lock = threading.Lock()
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._listening.accept()
                line.settimeout(LISTENER_SECONDS)
                read_header(line)
                line.sendall(self._header)
                with self._lock:
                    if self._latest and self._latch:
                        line.sendall(self._latest)
                    self._lines.append(line)
            except (OSError, ValueError):
                if self._listening.fileno() < 0:
                    return

    def say(self, raw: bytes) -> None:
        with self._lock:
            self._latest = struct.pack("<I", len(raw)) + raw
            for line in [*self._lines]:
                try:
                    line.sendall(self._latest)
                except OSError:
                    self._lines.remove(line)
                    line.close()  # half a message may have been sent on it

    def close(self) -> None:
        self._listening.close()
        for line in self._lines:
            line.close()


def header(fields: Mapping[str, str]) -> bytes:
    """A TCPROS header."""
    parts = [f"{name}={value}".encode() for name, value in fields.items()]
    whole = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    return struct.pack("<I", len(whole)) + whole


def read_header(line: socket.socket) -> dict[str, str]:
    """Raises ValueError if it is no header, or reports that the other side refuses."""
    raw, found, at = frame(line, HEADER_BYTES), {}, 0
    while at < len(raw):
        if at + 4 > len(raw):
            raise ValueError("the header is cut")
        (length,) = struct.unpack_from("<I", raw, at)
        name, mark, value = raw[at + 4 : at + 4 + length].partition(b"=")
        if not mark or at + 4 + length > len(raw):
            raise ValueError("the header is no list of fields")
        found[name.decode(errors="replace")] = value.decode(errors="replace")
        at += 4 + length
    if "error" in found:
        raise ValueError(found["error"])
    return found


class Gone(EOFError, OSError):  # noqa: N818 - it says what the other side is
    """The other side has closed the connection."""


def frame(line: socket.socket, most: int) -> bytes:
    """The next length and that many bytes. Raises ValueError if the length exceeds `most`, Gone at the end."""
    (length,) = struct.unpack("<I", _exactly(line, 4))
    if length > most:
        raise ValueError(f"{length} bytes are more than {most}")
    return _exactly(line, length)


def _exactly(line: socket.socket, count: int) -> bytes:
    parts = []
    while count:
        part = line.recv(min(count, 1 << 16))
        if not part:
            raise Gone("the connection is closed")
        parts.append(part)
        count -= len(part)
    return b"".join(parts)


def typed(topic: str, fields: Mapping[str, str]) -> tuple[Any, str]:
    """The type of a publisher's messages: its store and name. Raises ValueError if its definition is wrong."""
    store = get_typestore(Stores.EMPTY)
    kind = fields.get("type", "")
    package, _, name = kind.partition("/")
    full = f"{package}/msg/{name}"
    try:
        store.register(get_types_from_msg(fields.get("message_definition", ""), full))
        _, digest = store.generate_msgdef(full, ros_version=1)
    except (TypesysError, KeyError) as error:
        raise ValueError(f"{topic} is {kind or 'of no type'}, whose definition cannot be read: {error}") from None
    if digest != fields.get("md5sum"):
        raise ValueError(f"{topic}: the digest of {kind} is not that of the definition that came with it")
    return store, full


def reader(topic: str, fields: Mapping[str, str]) -> Callable[[bytes], dict[str, Any]]:
    """A reader of a publisher's messages. Raises ValueError if its definition contradicts itself."""
    store, full = typed(topic, fields)
    plain = plainer(store.fielddefs)

    def read(raw: bytes) -> dict[str, Any]:
        try:
            found: dict[str, Any] = plain(store.deserialize_ros1(raw, full))
        except (SerdeError, struct.error, IndexError, UnicodeDecodeError, AssertionError) as error:
            raise ValueError(f"a message of {topic} is no {fields['type']}: {error}") from None
        return found

    return read


def master_of(text: str) -> str:
    """``ros1`` or ``ros1:http://host:11311``: the master's address, by default that of ROS_MASTER_URI. Raises
    Rejected."""
    uri = text.removeprefix("ros1").removeprefix(":") or os.environ.get("ROS_MASTER_URI", "http://127.0.0.1:11311")
    parts = urlparse(uri)
    if parts.scheme != "http" or not parts.hostname:
        raise Rejected(Diagnostic("MON303", f"{uri!r} is no address of a master", hint="--live ros1:http://host:11311"))
    return uri
