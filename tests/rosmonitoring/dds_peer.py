"""A writer on DDS, as a process of its own: python dds_peer.py DOMAIN; commands come as JSON lines, each is answered.

Its types are written out here, so that Avow's are held against others than its own.
"""

import json
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import (
    array,
    bounded_str,
    float32,
    float64,
    int8,
    int32,
    int64,
    sequence,
    uint8,
    uint32,
    uint64,
)
from cyclonedds.pub import DataWriter, Publisher
from cyclonedds.qos import Policy
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Double(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    data: float64


@dataclass
class Wrong(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    """Another layout by the same name."""

    data: int64
    more: str = ""


@dataclass
class Short(IdlStruct, typename="std_msgs::msg::dds_::Float64_"):
    data: float32


@dataclass
class Single(IdlStruct, typename="std_msgs::msg::dds_::Float32_"):
    data: float32


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Scan(IdlStruct, typename="pkg::msg::dds_::Scan_"):
    header: Header
    ok: bool
    ranges: sequence[float32]
    pair: array[float64, 2]
    words: sequence[str]
    level: uint8


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


@dataclass
class Gid24(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 24]


@dataclass
class Gid16(IdlStruct, typename="rmw_dds_common::msg::dds_::Gid_"):
    data: array[uint8, 16]


@dataclass
class Node24(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: bounded_str[256]
    node_name: bounded_str[256]
    reader_gid_seq: sequence[Gid24]
    writer_gid_seq: sequence[Gid24]


@dataclass
class Node16(IdlStruct, typename="rmw_dds_common::msg::dds_::NodeEntitiesInfo_"):
    node_namespace: bounded_str[256]
    node_name: bounded_str[256]
    reader_gid_seq: sequence[Gid16]
    writer_gid_seq: sequence[Gid16]


@dataclass
class Participant24(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid24
    node_entities_info_seq: sequence[Node24]


@dataclass
class Participant16(IdlStruct, typename="rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"):
    gid: Gid16
    node_entities_info_seq: sequence[Node16]


# rmw_cyclonedds's requests and responses begin with the client and the number of its request
@dataclass
class GoRequest(IdlStruct, typename="my_msgs::srv::dds_::Go_Request_"):
    client: uint64
    number: int64
    speed: float64


@dataclass
class GoResponse(IdlStruct, typename="my_msgs::srv::dds_::Go_Response_"):
    client: uint64
    number: int64
    ok: bool
    in_: str


@dataclass
class UUID(IdlStruct, typename="unique_identifier_msgs::msg::dds_::UUID_"):
    uuid: array[uint8, 16]


@dataclass
class Goal(IdlStruct, typename="my_msgs::action::dds_::Spin_Goal_"):
    turns: float64


@dataclass
class Result(IdlStruct, typename="my_msgs::action::dds_::Spin_Result_"):
    done: float64


@dataclass
class Feedback(IdlStruct, typename="my_msgs::action::dds_::Spin_Feedback_"):
    sofar: float64


@dataclass
class SendGoal(IdlStruct, typename="my_msgs::action::dds_::Spin_SendGoal_Request_"):
    client: uint64
    number: int64
    goal_id: UUID
    goal: Goal


@dataclass
class GetResult(IdlStruct, typename="my_msgs::action::dds_::Spin_GetResult_Request_"):
    client: uint64
    number: int64
    goal_id: UUID


@dataclass
class GotResult(IdlStruct, typename="my_msgs::action::dds_::Spin_GetResult_Response_"):
    client: uint64
    number: int64
    status: int8
    result: Result


@dataclass
class FeedbackMessage(IdlStruct, typename="my_msgs::action::dds_::Spin_FeedbackMessage_"):
    goal_id: UUID
    feedback: Feedback


@dataclass
class PlainRequest(IdlStruct, typename="my_msgs::srv::dds_::Go_Request_"):
    speed: float64


@dataclass
class PlainResponse(IdlStruct, typename="my_msgs::srv::dds_::Go_Response_"):
    ok: bool
    in_: str


@dataclass
class EventInfo(IdlStruct, typename="service_msgs::msg::dds_::ServiceEventInfo_"):
    event_type: uint8
    stamp: Time
    client_gid: array[uint8, 16]
    sequence_number: int64


@dataclass
class GoEvent(IdlStruct, typename="my_msgs::srv::dds_::Go_Event_"):
    """ROS 2's sequences have at most one item, which nodes do not announce and which the sample does not show."""

    info: EventInfo
    request: sequence[PlainRequest]
    response: sequence[PlainResponse]


@dataclass
class ParameterValue(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterValue_"):
    type: uint8
    bool_value: bool
    integer_value: int64
    double_value: float64
    string_value: str
    byte_array_value: sequence[uint8]
    bool_array_value: sequence[bool]
    integer_array_value: sequence[int64]
    double_array_value: sequence[float64]
    string_array_value: sequence[str]


@dataclass
class Parameter(IdlStruct, typename="rcl_interfaces::msg::dds_::Parameter_"):
    name: str
    value: ParameterValue


@dataclass
class ParameterEvent(IdlStruct, typename="rcl_interfaces::msg::dds_::ParameterEvent_"):
    stamp: Time
    node: str
    new_parameters: sequence[Parameter]
    changed_parameters: sequence[Parameter]
    deleted_parameters: sequence[Parameter]


CALLED = (GoRequest, GoResponse, SendGoal, GetResult, GotResult)

NODES = {24: (Gid24, Node24, Participant24), 16: (Gid16, Node16, Participant16)}
"""What ROS 2 says of its nodes: rmw_dds_common, up to Humble and since."""

KINDS = {
    kind.__name__: kind
    for kind in (Double, Wrong, Short, Single, Scan, FeedbackMessage, GoEvent, ParameterEvent, *CALLED)
}
QOS = {
    "reliable": Policy.Reliability.Reliable(duration(seconds=1)),
    "best_effort": Policy.Reliability.BestEffort,
    "transient_local": Policy.Durability.TransientLocal,
    "volatile": Policy.Durability.Volatile,
    "exclusive": Policy.Ownership.Exclusive,
    "partition": Policy.Partition(["robot1"]),
}
KEPT = Policy.DurabilityService(0, Policy.History.KeepAll, -1, -1, -1)
"""What a transient_local writer keeps for whoever comes later: all."""
LOOPBACK = """<CycloneDDS><Domain><General><Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
<AllowMulticast>false</AllowMulticast></General><Discovery><Peers><Peer Address="127.0.0.1"/></Peers>
<LeaseDuration>2s</LeaseDuration><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>100</MaxAutoParticipantIndex></Discovery></Domain></CycloneDDS>"""


def value(kind, given):
    if kind is Scan:
        return Scan(Header(Time(*given["stamp"]), "map"), given["ok"], given["ranges"], given["pair"], ["a", "bc"], 2)
    if kind is FeedbackMessage or kind in CALLED:
        made = {"uuid": lambda n: UUID([n] * 16), "goal": Goal, "result": Result, "feedback": Feedback}
        return kind(*(made[part[0]](part[1]) if isinstance(part, list) else part for part in given))
    if kind is GoEvent:
        event, number, request, response = given
        info = EventInfo(event, Time(1, 0), [3] * 16, number)
        return GoEvent(info, [PlainRequest(v) for v in request], [PlainResponse(v, "x") for v in response])
    if kind is ParameterEvent:
        node, *told = given  # of new, changed and deleted parameters: their names and numbers
        every = [[Parameter(n, ParameterValue(3, False, 0, v, "", [], [], [], [], [])) for n, v in one] for one in told]
        return ParameterEvent(Time(1, 0), node, *every)
    return kind(given)


def heard_by(writer) -> int:
    """The number of its readers. cyclonedds counts them twice, and fails if there is one more the second time."""
    while True:
        try:
            return len(writer.get_matched_subscriptions())
        except IndexError:
            continue


def main():
    number = int(sys.argv[1])
    domain = Domain(number, LOOPBACK)  # noqa: F841 - it is left when this is gone
    participant = DomainParticipant(number)
    writers = {}
    readers = []
    board = None
    for line in sys.stdin:
        said = json.loads(line)
        answer = None
        match said["do"]:
            case "write":  # a new writer: its name, topic, kind and quality of service
                kind = KINDS[said["kind"]]
                qos = [QOS[name] for name in said["qos"]]
                part = [policy for policy in qos if isinstance(policy, Policy.Partition)]
                qos = Qos(*(policy for policy in qos if policy not in part), Policy.History.KeepAll, KEPT)
                topic = Topic(participant, said["topic"], kind)
                owner = Publisher(participant, Qos(*part)) if part else participant
                writers[said["name"]] = (kind, DataWriter(owner, topic, qos))
            case "listen":
                topic = Topic(participant, said["topic"], KINDS[said["kind"]])
                readers.append(DataReader(participant, topic, Qos(*(QOS[name] for name in said["qos"]))))
            case "heard":  # how many hear it
                answer = heard_by(writers[said["name"]][1])
            case "say":
                kind, writer = writers[said["name"]]
                for given in said["values"]:
                    writer.write(value(kind, given), *((said["time"],) if "time" in said else ()))
                    if "pause" in said:
                        time.sleep(said["pause"])
            case "node":  # announce a node, with some of the writers
                size = said["size"]
                gid, node, whole = NODES[size]

                def named(entity, gid=gid, size=size):
                    return gid(list(entity.guid.bytes + bytes(size - 16)))

                topic = Topic(participant, "ros_discovery_info", whole)
                kept = Qos(QOS["reliable"], QOS["transient_local"], Policy.History.KeepLast(1))
                teller = DataWriter(participant, topic, kept)
                own = [named(writers[name][1]) for name in said["writers"]]
                teller.write(whole(named(participant), [node(said["space"], said["name"], [], own)]))
                writers["ros_discovery_info"] = (whole, teller)
            case "gone":
                del writers[said["name"]]
                writer = None  # the one that has spoken last
            case "verdicts":
                board = DataReader(participant, Topic(participant, "rt/verdicts", DiagnosticArray))
            case "told":
                answer = [
                    [s.name, s.level, {v.key: v.value for v in s.values}] for m in board.take(100) for s in m.status
                ]
        print(json.dumps(answer), flush=True)


if __name__ == "__main__":
    main()
