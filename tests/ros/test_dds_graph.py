"""The ROS graph that DDS's endpoints are: ROS's names and types, calls, and whose an endpoint is."""

from __future__ import annotations

import struct

import pytest

from avow.ros.dds import _announced, carriers, dds_type, listing_of
from avow.ros.listing import Listed, Listing

NODE, OTHER = b"n" * 12, b"o" * 12


def test_topics_services_and_actions_are_told_apart() -> None:
    ends = [
        (NODE + b"0001", NODE, "rt/scan", "sensor_msgs::msg::dds_::LaserScan_", True),
        (NODE + b"0002", NODE, "rt/ns/cmd_vel", "geometry_msgs::msg::dds_::Twist_", False),
        (NODE + b"0003", NODE, "rq/gripRequest", "std_srvs::srv::dds_::SetBool_Request_", False),
        (NODE + b"0004", NODE, "rr/gripReply", "std_srvs::srv::dds_::SetBool_Response_", True),
        (NODE + b"0005", NODE, "rq/turn/_action/send_goalRequest", "my::action::dds_::Turn_SendGoal_Request_", False),
        (NODE + b"0006", NODE, "rt/turn/_action/feedback", "my::action::dds_::Turn_FeedbackMessage_", True),
        (OTHER + b"0001", OTHER, "rq/gripRequest", "std_srvs::srv::dds_::SetBool_Request_", True),
        (OTHER + b"0002", OTHER, "rr/gripReply", "std_srvs::srv::dds_::SetBool_Response_", False),
        (
            OTHER + b"0003",
            OTHER,
            "rr/turn/_action/get_resultReply",
            "my::action::dds_::Turn_GetResult_Response_",
            False,
        ),
        (OTHER + b"0004", OTHER, "ros_discovery_info", "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_", True),
        (OTHER + b"0005", OTHER, "chatter", "Plain", True),
    ]
    names = {key: "/robot1/base" for key, participant, *_ in ends if participant == NODE}
    assert listing_of(ends, names) == Listing(
        (
            Listed("/participant_1", calls=("/grip",), orders=("/turn",)),
            Listed("/robot1/base", ("/scan",), ("/ns/cmd_vel",), ("/grip",), does=("/turn",)),
        ),
        {
            "/scan": "sensor_msgs/LaserScan",
            "/ns/cmd_vel": "geometry_msgs/Twist",
            "/grip": "std_srvs/SetBool",
            "/turn": "my/Turn",
        },
    )


@pytest.mark.parametrize(
    ("topic", "kind", "found"),
    [
        ("scan", "sensor_msgs/LaserScan", {"rt/scan": "sensor_msgs::msg::dds_::LaserScan_"}),
        ("/ns/grip/_request", "a/Grip_Request", {"rq/ns/gripRequest": "a::srv::dds_::Grip_Request_"}),
        ("/ns/grip/_response", "a/Grip_Response", {"rr/ns/gripReply": "a::srv::dds_::Grip_Response_"}),
        ("/turn/_goal", "a/Turn_Goal", {"rq/turn/_action/send_goalRequest": "a::action::dds_::Turn_SendGoal_Request_"}),
        ("/turn/_feedback", "a/Turn_Feedback", {"rt/turn/_action/feedback": "a::action::dds_::Turn_FeedbackMessage_"}),
        (
            "/turn/_result",
            "a/Turn_Result",
            {
                "rq/turn/_action/get_resultRequest": "a::action::dds_::Turn_GetResult_Request_",
                "rr/turn/_action/get_resultReply": "a::action::dds_::Turn_GetResult_Response_",
            },
        ),
        ("/grip/_request_sent", "a/Grip_Request", {"rt/grip/_service_event": "a::srv::dds_::Grip_Event_"}),
        ("/turn/_action/send_goal/_response", "a/Turn_SendGoal_Response", {}),
    ],
)
def test_what_carries_a_topic_or_a_part_of_calls(topic: str, kind: str, found: dict[str, str]) -> None:
    assert {each.topic: dds_type(each.kind) for each in carriers(topic, kind)} == found


def announcement(size: int, name: str = "base", order: str = "<") -> bytes:
    def text(word: str) -> bytes:
        raw = word.encode() + b"\0"
        return struct.pack(f"{order}I", len(raw)) + raw + bytes(-len(raw) % 4)

    gids = struct.pack(f"{order}I", 1) + (NODE + b"0001").ljust(size, b"\0")
    head = b"\0\1\0\0" if order == "<" else b"\0\0\0\0"
    return head + bytes(size) + struct.pack(f"{order}I", 1) + text("/robot1") + text(name) + gids + gids


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("size", [24, 16])
def test_an_announcement_is_read_by_its_own_layout_alone(size: int, order: str) -> None:
    data = announcement(size, order=order)
    assert dict(_announced(data, size) or ()) == {NODE + b"0001": "/robot1/base"}
    assert _announced(data, 40 - size) is None


@pytest.mark.parametrize("size", [24, 16])
def test_what_is_cut_or_made_up_is_no_announcement(size: int) -> None:
    data = announcement(size)
    assert all(_announced(data[:at], size) is None for at in range(len(data)))
    assert _announced(data[:4] + bytes(size) + b"\xff" * 12, size) is None
