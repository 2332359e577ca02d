"""Services and actions: a call's request and response, a goal, its result and its feedback, as topics of their own.

In a contract the part is named by its type: ``std_srvs/SetBool_Request /go matches(in.data)``. The topic that carries
it is called here ``/go/_request``, ``/go/_response``, ``/spin/_goal``, ``/spin/_result`` and ``/spin/_feedback``. A ROS
2 bag holds calls as service events, if introspection is on (REP 2012), and actions' feedback; a ROS 1 bag holds
actions, and no service.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import field, replace
from typing import Any

from avow.base.records import dataclass
from avow.ros.definitions import Definitions, Message
from avow.ros.listing import Listed, Listing

CALL_PARTS = ("Request", "Response", "Goal", "Result", "Feedback")
_PARTS = {part: f"_{part.lower()}" for part in CALL_PARTS}
CALL = "_call"
"""The field, in every part of a call, that identifies the call."""
_SERVICE_EVENT = "/_service_event"
_KINDS = ("_request_sent", "_request", "_response", "_response_received")
"""The part that an event records, by service_msgs/ServiceEventInfo's `event_type`: the server's has the short names."""
_ACTION1 = re.compile(r"(?P<name>.*)Action(?P<part>Goal|Result|Feedback)\Z")


def part_topic(name: str, kind: str) -> str:
    """The topic that carries messages of a type under a name: a part of a call has its own topic."""
    part = kind.rpartition("_")[2] if "_" in kind.rpartition("/")[2] else ""
    return f"{name}/{_PARTS[part]}" if part in _PARTS else name


def is_part(topic: str) -> bool:
    """Whether a topic is a part of calls: no publisher of ROS publishes it."""
    return topic.rpartition("/")[2] in (*_PARTS.values(), *_KINDS)


def named(topic: str) -> str:
    """The contract's name for the topic of a part of calls: the service or the action."""
    return topic.rpartition("/")[0] if is_part(topic) else topic


def pairing(kinds: Mapping[str, str], known: Definitions, *, looped: bool = False) -> str:
    """How to say which input an answer answered, for a person to correct. `kinds`: topic → type, of all that is
    received and published. By stamp if all are stamped, and no stamp comes back to the node (`looped`)."""
    latency = "{latency: 10 ms, jitter: 2 ms, because: …}"
    if any(map(is_part, kinds)):
        return "{by: call}" if all(map(is_part, kinds)) else f"{{by: call, others: {latency}}}"
    return "{by: stamp}" if all(map(known.stamped, kinds.values())) and not looped else latency


def with_calls(listing: Listing) -> Listing:
    """A graph with the parts of its services' and actions' calls as topics, as far as their types are given; without
    the topics that implement an action."""
    types = {t: kind for t, kind in listing.types.items() if kind.partition("/")[0] not in OWN_CALLS}
    raw = {topic for topic, kind in types.items() if parts_of(topic, kind)}
    parts: dict[str, str] = {}

    def sides(names: tuple[str, ...], asked: tuple[str, ...], told: tuple[str, ...]) -> tuple[list[str], list[str]]:
        found: tuple[list[str], list[str]] = ([], [])
        for name in names:
            for part, side in (*((p, 0) for p in asked), *((p, 1) for p in told)):
                if name in types:
                    found[side].append(f"{name}/{_PARTS[part]}")
                    parts[found[side][-1]] = f"{types[name]}_{part}"
        return found

    nodes: list[Listed] = []
    for node in listing.nodes:
        (asked, told), (asks, hears) = sides(node.serves, *_SERVICE), sides(node.calls, *_SERVICE)
        (goals, results), (sends, awaits) = sides(node.does, *_ACTION), sides(node.orders, *_ACTION)
        said = [t for t in node.publishes if t not in raw]
        heard = [t for t in node.subscribes if t not in raw]
        # nodes that are known only from a bag
        ends = {(named(t), t.rpartition("/")[2]) for t in said if is_part(t)}
        for whole, part in ends:
            others = (
                ("_result", "_feedback") if part == "_goal" else ("_goal",) if part in ("_result", "_feedback") else ()
            )
            heard += [f"{whole}/{other}" for other in others if f"{whole}/{other}" in types]
        publishes, subscribes = (*said, *told, *asks, *results, *sends), (*heard, *asked, *hears, *goals, *awaits)
        nodes.append(replace(node, publishes=_once(publishes), subscribes=_once(subscribes)))
    return Listing(tuple(nodes), {**listing.types, **parts})


def _once(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(names))


_SERVICE = (("Request",), ("Response",))
_ACTION = (("Goal",), ("Result", "Feedback"))
OWN_CALLS = ("rcl_interfaces", "type_description_interfaces", "lifecycle_msgs", "roscpp", "nodelet")
"""Packages of the services that every ROS node, or every lifecycle node, has."""


def is_service_part(topic: str) -> bool:
    return topic.rpartition("/")[2] in _KINDS


def parts_of(topic: str, kind: str) -> dict[str, str]:
    """The parts that a recorded topic's messages hold: topic → type (``package/Type``)."""
    package, _, name = kind.partition("/")
    if topic.endswith(_SERVICE_EVENT) and name.endswith("_Event"):
        called, own = topic.removesuffix(_SERVICE_EVENT), name.removesuffix("_Event")
        if called.endswith("/_action/send_goal"):
            action = called.removesuffix("/_action/send_goal")
            return {f"{action}/_goal": f"{package}/{own.removesuffix('_SendGoal')}_Goal"}
        if called.endswith("/_action/get_result"):
            action = called.removesuffix("/_action/get_result")
            return {f"{action}/_result": f"{package}/{own.removesuffix('_GetResult')}_Result"}
        sides = ("Request", "Request", "Response", "Response")
        return {f"{called}/{k}": f"{package}/{own}_{side}" for k, side in zip(_KINDS, sides, strict=True)}
    if topic.endswith("/_action/feedback"):
        action = topic.removesuffix("/_action/feedback")
        return {f"{action}/_feedback": f"{package}/{name.removesuffix('_FeedbackMessage')}_Feedback"}
    found = _ACTION1.match(name)
    if found and topic.endswith(f"/{found['part'].lower()}"):
        action = topic.rpartition("/")[0]
        return {f"{action}/_{found['part'].lower()}": f"{package}/{found['name']}_{found['part']}"}
    return {}


def with_parts(known: Mapping[str, Message]) -> dict[str, Message]:
    """Definitions, with ROS 1's parts of actions (``SpinGoal``) under the names used here (``Spin_Goal``)."""
    found = dict(known)
    for name in known:
        wrapped = _ACTION1.match(name)
        inner = known.get(f"{wrapped['name']}{wrapped['part']}") if wrapped else None
        if wrapped and inner is not None:
            part = f"{wrapped['name']}_{wrapped['part']}"
            found.setdefault(part, replace(inner, name=part))
    return found


@dataclass(slots=True)
class Calls:
    """Splits recorded messages into parts, in their order."""

    goals: dict[str, str] = field(default_factory=dict)
    """A call for a result → the goal whose result it requests."""

    def part(self, topic: str, message: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]]:
        """The part of a call that a recorded message is, with its topic; the message itself if it is no part."""
        if topic.endswith(_SERVICE_EVENT):
            return self._event(topic.removesuffix(_SERVICE_EVENT), message) or (topic, message)
        if topic.endswith("/_action/feedback"):
            call = _uuid(message.get("goal_id"))
            return f"{topic.removesuffix('/_action/feedback')}/_feedback", _content(message.get("feedback"), call)
        action, _, part = topic.rpartition("/")  # ROS 1
        goal = message.get("goal_id") or (message.get("status") or {}).get("goal_id") or {}
        return f"{action}/_{part}", _content(message.get(part), str(goal.get("id", "")))

    def _event(self, called: str, message: Mapping[str, Any]) -> tuple[str, Mapping[str, Any]] | None:
        info = message.get("info") or {}
        kind = info.get("event_type")
        if kind not in (0, 1, 2, 3):
            return None
        told = message.get("request" if kind < 2 else "response") or [{}]
        call = f"{bytes(info.get('client_gid') or ()).hex()}:{info.get('sequence_number')}"
        for service, part, wanted in (("send_goal", "goal", 1), ("get_result", "result", 2)):
            if called.endswith(f"/_action/{service}"):
                if part == "result" and kind == 1:
                    self.goals[call] = _uuid(told[0].get("goal_id"))
                if kind != wanted:
                    return None
                goal = _uuid(told[0].get("goal_id")) if part == "goal" else self.goals.pop(call, "")
                return f"{called.removesuffix(f'/_action/{service}')}/_{part}", _content(told[0].get(part), goal)
        return f"{called}/{_KINDS[kind]}", _content(told[0], call)


def _uuid(raw: Any) -> str:
    return bytes((raw or {}).get("uuid") or ()).hex() if isinstance(raw, Mapping) else ""


def _content(raw: Any, call: str) -> Mapping[str, Any]:
    """A part's own fields, and its call; for one that was recorded without content, the call only."""
    return {**(raw if isinstance(raw, Mapping) else {}), **({CALL: call} if call else {})}


# -- definitions in bags -----------------------------------------------------------------------------------------------

_OTHER = re.compile(r"\b([A-Za-z]\w*)/(?:srv|action)/([A-Za-z]\w*)")
_RULE = "=" * 80
_EVENT = """\
service_msgs/ServiceEventInfo info
{0}_Request[<=1] request
{0}_Response[<=1] response
{rule}
MSG: service_msgs/ServiceEventInfo
uint8 event_type
builtin_interfaces/Time stamp
uint8[16] client_gid
int64 sequence_number
{rule}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{rule}
MSG: {0}_Request
{request}
{rule}
MSG: {0}_Response
{response}
"""


def as_message(kind: str, text: str) -> tuple[str, str]:
    """A type of a service or an action as a bag names it (``package/srv/Go_Event``), and its definition, as those of a
    message: bag readers know no other form. A service's own text (with ``---``) becomes that of its event."""
    plain = _OTHER.sub(r"\1/msg/\2", kind)
    first, *others = re.split(rf"^{_RULE}\n", text, flags=re.M)
    if not first.strip() and others:
        first, others = others[0].partition("\n")[2], others[1:]  # it begins with its own name
    halves = re.split(r"^---[ \t]*$", first, flags=re.M)
    if len(halves) == 2 and plain.endswith("_Event"):
        own = plain.removesuffix("_Event").replace("/msg/", "/")
        made = _EVENT.format(own, rule=_RULE, request=halves[0], response=halves[1])
        known = re.findall(r"^MSG: (\S+)", made, flags=re.M)
        more = [part for part in others if part.split("\n")[0].removeprefix("MSG: ").strip() not in known]
        return plain, _OTHER.sub(r"\1/msg/\2", "".join([made, *(f"{_RULE}\n{part}" for part in more)]))
    return plain, _OTHER.sub(r"\1/msg/\2", text)
