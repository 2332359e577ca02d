"""A running ROS 2 graph as DDS discovery shows it: the names of topics and types there, and their nodes.

Needs the package cyclonedds, and no ROS. Sources: https://design.ros2.org/articles/topic_and_service_names.html
(``rt/`` before a topic's name, ``rq/`` and ``rr/`` before a service's), https://github.com/ros2/rosidl_dds
(``pkg::msg::dds_::Type_``), and rmw_dds_common's ``ParticipantEntitiesInfo`` on ``ros_discovery_info`` for names.
"""

from __future__ import annotations

import os
import re
import struct
import time
from collections.abc import Iterable, Iterator, Mapping
from types import MappingProxyType
from typing import Any
from xml.sax.saxutils import quoteattr

from avow.base.records import dataclass
from avow.base.tuning.running import DDS_NAMES, DDS_PAUSE, DDS_SECONDS, LAST_DOMAIN
from avow.ros.calls import is_part, named
from avow.ros.listing import Listed, Listing, NoListing
from avow.ros.names import is_name

LOOPBACK = ("127.0.0.1", "localhost")

_TYPE = re.compile(r"(\w+)::(msg|srv|action)::dds_::(\w+)_\Z")
_CALL = re.compile(r"r[qr](/.+?)(/_action/(?:send_goal|cancel_goal|get_result))?(?:Request|Reply)\Z")
_PART = re.compile(r"(_SendGoal|_GetResult|_FeedbackMessage)?(_Request|_Response)?\Z")
_OF_ACTION = re.compile(r"\w+_(Goal|Result|Feedback|FeedbackMessage|(SendGoal|GetResult)_(Request|Response))\Z")
_NODES = "ros_discovery_info"


def dds_type(kind: str) -> str:
    package, _, name = kind.partition("/")
    folder = (
        "action" if _OF_ACTION.match(name) else "srv" if name.endswith(("_Request", "_Response", "_Event")) else "msg"
    )
    return f"{package}::{folder}::dds_::{name}_"


@dataclass(frozen=True, slots=True)
class Carrier:
    """A DDS topic, and the ROS type of its samples. `recorded`: for a part of calls, the topic of a bag that holds it.
    `event`: for a service's samples, which begin with a header, the `event_type` of their event."""

    topic: str
    kind: str
    recorded: str = ""
    event: int | None = None


def carriers(topic: str, kind: str) -> tuple[Carrier, ...]:
    """What carries a topic, or a part of calls, over DDS; nothing for a response of an action's services. A result is
    found by the request for it, which names the goal. The client's view of a call is in events (introspection)."""
    name, part = (named(topic), topic.rpartition("/")[2]) if is_part(topic) else (topic, "")
    bare, own = name.lstrip("/"), kind.rpartition("_")[0]

    def service(called: str, kind: str, event: int) -> Carrier:
        side, end = ("rq", "Request") if event == 1 else ("rr", "Reply")
        return Carrier(f"{side}/{called.lstrip('/')}{end}", kind, f"{called}/_service_event", event)

    match part:
        case "":
            return (Carrier(f"rt/{bare}", kind),)
        case "_request" | "_response" if "/_action/" not in name:
            return (service(name, kind, 1 if part == "_request" else 2),)
        case "_request_sent" | "_response_received":
            return (Carrier(f"rt/{bare}/_service_event", f"{own}_Event", f"{name}/_service_event"),)
        case "_goal":
            return (service(f"{name}/_action/send_goal", f"{own}_SendGoal_Request", 1),)
        case "_result":
            called = f"{name}/_action/get_result"
            return tuple(service(called, f"{own}_GetResult_{end}", k) for k, end in ((1, "Request"), (2, "Response")))
        case "_feedback":
            return (Carrier(f"rt/{bare}/_action/feedback", f"{own}_FeedbackMessage", f"{name}/_action/feedback"),)
    return ()


def settings(host: str) -> str:
    """Cyclone DDS's configuration: this network only; on loopback no multicast, and peers are queried one by one."""
    interface = (
        f"<Interfaces><NetworkInterface address={quoteattr(host.replace('localhost', LOOPBACK[0]))}/></Interfaces>"
    )
    if host not in LOOPBACK:
        return f"<CycloneDDS><Domain><General>{interface}</General></Domain></CycloneDDS>"
    return (
        f"<CycloneDDS><Domain><General>{interface}<AllowMulticast>false</AllowMulticast></General><Discovery>"
        f"<Peers><Peer Address={quoteattr(LOOPBACK[0])}/></Peers><ParticipantIndex>auto</ParticipantIndex>"
        "<MaxAutoParticipantIndex>100</MaxAutoParticipantIndex></Discovery></Domain></CycloneDDS>"
    )


def domain_of(text: str) -> int:
    """``dds`` or ``ros2`` (ROS_DOMAIN_ID, else 0), ``dds:42``. Raises ValueError."""
    said = (
        text.removeprefix("dds").removeprefix("ros2").removeprefix(":")
        or os.environ.get("ROS_DOMAIN_ID", "").strip()
        or "0"
    )
    if not (said.isascii() and said.isdigit() and len(said) <= 3 and int(said) <= LAST_DOMAIN):
        raise ValueError(f"{said!r} is no DDS domain: 0 to {LAST_DOMAIN}")
    return int(said)


def ask_domain(domain: int, host: str = LOOPBACK[0], seconds: float = DDS_SECONDS) -> Listing:
    """The publishers and listeners in a domain, as far as discovery finds them within some seconds: nodes by name if
    ROS 2's own announcement gives it, other participants by a number. Raises NoListing."""
    try:
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
        from cyclonedds.core import DDSException
        from cyclonedds.domain import Domain, DomainParticipant
    except ImportError:
        raise NoListing("DDS needs the package cyclonedds: pip install 'avow[dds]'") from None
    ends: list[tuple[Any, bool]] = []
    names: dict[bytes, str] = {}
    try:
        entity = None if "CYCLONEDDS_URI" in os.environ else Domain(domain, settings(host))
        # each layout by its own participant: a topic has one type for a participant
        listeners = [(size, *_listener(DomainParticipant(domain), size)) for size in DDS_NAMES]
        own = {participant.guid for _, participant, _ in listeners}
        publications, subscriptions = (
            BuiltinDataReader(listeners[0][1], topic)
            for topic in (BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription)
        )
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(DDS_PAUSE)
            for reader, writes in ((publications, True), (subscriptions, False)):
                found = [end for end in samples(reader) if end.sample_info.valid_data]
                ends += [(end, writes) for end in found if end.participant_key not in own]
            for size, _, reader in listeners:
                for sample in samples(reader):
                    names |= dict(_announced(sample.data, size) or ()) if sample.sample_info.valid_data else {}
        del entity
    except DDSException as error:
        raise NoListing(f"DDS domain {domain} cannot be joined at {host}: {error}") from None
    found = [(e.key.bytes, e.participant_key.bytes, e.topic_name, e.type_name, w) for e, w in ends]
    return listing_of(found, names, {e.key.bytes: e.qos for e, _ in ends})


End = tuple[bytes, bytes, str, str, bool]
"""An endpoint: its name, its participant's, its topic, its type, whether it writes."""


def listing_of(
    ends: list[End], names: Mapping[bytes, str], policies: Mapping[bytes, Iterable[Any]] = MappingProxyType({})
) -> Listing:
    """The ROS graph of these endpoints; `names`: endpoint → its node; `policies`: endpoint → its quality of service."""
    printed: dict[str, None] = {}
    nodes: dict[str, dict[str, dict[str, None]]] = {}
    types: dict[str, str] = {}
    strangers: dict[bytes, str] = {}
    for key, participant, topic, kind, writes in sorted(ends, key=lambda end: (end[1], end[2])):
        said = _TYPE.match(kind)
        part = _side(topic, writes)
        if said is None or part is None:
            continue  # not a ROS topic
        side, name = part
        node = names.get(key) or strangers.setdefault(participant, f"/participant_{len(strangers) + 1}")
        nodes.setdefault(node, {}).setdefault(side, {})[name] = None
        if side in _ENDPOINTS and key in policies and is_name(name) and is_name(node):
            printed[_printed(node, name, side, policies[key])] = None
        types[name] = f"{said[1]}/{said[3] if said[2] == 'msg' else _PART.sub('', said[3])}"
    listed = {name: {side: tuple(found) for side, found in sides.items()} for name, sides in sorted(nodes.items())}
    return Listing(tuple(Listed(name, **sides) for name, sides in listed.items()), types, "".join(printed))


_ENDPOINTS = {"publishes": "PUBLISHER", "subscribes": "SUBSCRIPTION"}


def _printed(node: str, topic: str, side: str, policies: Iterable[Any]) -> str:
    """An endpoint as ``ros2 topic info --verbose`` prints it, below its topic. Discovery does not give the depth."""
    space, _, name = node.rpartition("/")
    lines = [topic, f"Node name: {name}", f"Node namespace: {space or '/'}"]
    lines += [f"Endpoint type: {_ENDPOINTS[side]}", "QoS profile:"]
    for policy in policies:
        kind = re.sub(r"(?<=[a-z])(?=[A-Z])", "_", type(policy).__qualname__.rpartition(".")[2]).upper()
        match policy.__scope__:
            case "Reliability" | "Durability":
                lines.append(f"  {policy.__scope__}: {kind}")
            case "Deadline":
                lines.append(f"  Deadline: {policy.deadline} nanoseconds")
            case "Liveliness":
                lines.append(f"  Liveliness: {kind.replace('PARTICIPANT', 'NODE')}")
                lines.append(f"  Liveliness lease duration: {policy.lease_duration} nanoseconds")
    return "\n".join([*lines, "", ""])


def _side(topic: str, writes: bool) -> tuple[str, str] | None:
    """The relation of a node with this endpoint to a topic, and the topic; None if it is no ROS topic."""
    if topic.startswith("rt/"):
        name = topic.removeprefix("rt")
        return None if "/_action/" in name else ("publishes" if writes else "subscribes", name)
    called = _CALL.match(topic)
    if called is None:
        return None
    serves = writes is topic.startswith("rr")
    if called[2]:
        return "does" if serves else "orders", called[1]
    return "serves" if serves else "calls", called[1]


def _listener(participant: Any, size: int) -> tuple[Any, Any]:
    """A participant, and the reader of nodes' names, as bytes."""
    from cyclonedds.core import Qos
    from cyclonedds.idl import make_idl_struct, types
    from cyclonedds.qos import Policy
    from cyclonedds.sub import DataReader
    from cyclonedds.topic import Topic
    from cyclonedds.util import duration

    package = "rmw_dds_common::msg::dds_"
    gid = make_idl_struct("Gid_", f"{package}::Gid_", {"data": types.array[types.uint8, size]})
    gids = types.sequence[gid]
    name = types.bounded_str[256]
    parts = {"node_namespace": name, "node_name": name, "reader_gid_seq": gids, "writer_gid_seq": gids}
    node = make_idl_struct("NodeEntitiesInfo_", f"{package}::NodeEntitiesInfo_", parts)
    whole = {"gid": gid, "node_entities_info_seq": types.sequence[node]}
    made: Any = make_idl_struct("ParticipantEntitiesInfo_", f"{package}::ParticipantEntitiesInfo_", whole)
    made.deserialize = classmethod(lambda cls, data, *more: _Bytes(data))
    made.deserialize_key = classmethod(lambda cls, data, *more: _Bytes(b""))
    qos = Qos(
        Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal, Policy.History.KeepAll,
        Policy.TypeConsistency.AllowTypeCoercion(ignore_member_names=True),
    )  # fmt: skip
    return participant, DataReader(participant, Topic(participant, _NODES, made), qos)


class _Bytes:
    """A raw sample; cyclonedds sets `sample_info`."""

    def __init__(self, data: bytes) -> None:
        self.data = data
        self.sample_info: Any = None


def samples(reader: Any, most: int = 100) -> Iterator[Any]:
    """The samples of a reader, at most so many at a time."""
    while found := reader.take(most):
        yield from found
        if len(found) < most:
            return


def _announced(data: bytes, size: int) -> list[tuple[bytes, str]] | None:
    """Endpoint → node, from one participant's announcement; None if it is not one with names of that size."""
    order = "<" if data[1:2] == b"\x01" else ">"
    at = 4 + size

    def number() -> int:
        nonlocal at
        at += -at % 4
        (found,) = struct.unpack_from(f"{order}I", data, at)
        at += 4
        return int(found)

    def text() -> str:
        nonlocal at
        length = number()
        if not 1 <= length <= len(data) - at:
            raise ValueError
        at += length
        return data[at - length : at - 1].decode()

    found: list[tuple[bytes, str]] = []
    try:
        for _ in range(number()):
            space, name = text(), text()
            for _ in range(2):
                for _ in range(number()):
                    if at + size > len(data):
                        return None
                    found.append((data[at : at + 16], f"{space.rstrip('/')}/{name}"))
                    at += size
    except (struct.error, ValueError):
        return None
    return found if len(data) - at < 4 else None
