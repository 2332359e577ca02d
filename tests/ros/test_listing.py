"""Listings of a ROS graph: ROS 1's and ROS 2's text, JSON, and a master over XML-RPC."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from xmlrpc.server import SimpleXMLRPCServer

import pytest

from avow.ros.listing import Listed, Listing, NoListing, parse_listing
from avow.ros.master import ask_master

ROS1 = """\
--------------------------------------------------------------------------------
Node [/robot1/sensor]
Publications: 
 * /robot1/status [std_msgs/String]
 * /rosout [rosgraph_msgs/Log]

Subscriptions: 
 * /r [unknown type]

Services: 
 * /robot1/sensor/set_logger_level

contacting node http://h:1/ ...
Pid: 1
Connections:
 * topic: /rosout
    * to: /rosout
"""  # noqa: W291 - as rosnode writes it
ROS2 = """\
/robot1/sensor
  Subscribers:
    /r: std_msgs/msg/Float64
  Publishers:
    /robot1/status: std_msgs/msg/String
  Service Servers:
    /reset: std_srvs/srv/Empty
  Service Clients:
    /go: std_srvs/srv/Trigger
  Action Servers:
    /spin: a/action/Spin
  Action Clients:
"""
JSON = '{"/a": {"publishers": {"/t": "std_msgs/msg/Float64"}, "subscribers": ["/u"]}}'


def test_rosnode_info() -> None:
    found = parse_listing(ROS1)
    node = Listed("/robot1/sensor", ("/robot1/status", "/rosout"), ("/r",), ("/robot1/sensor/set_logger_level",))
    assert found.nodes == (node,)
    assert found.types == {"/robot1/status": "std_msgs/String", "/rosout": "rosgraph_msgs/Log"}
    assert parse_listing(found.text()) == found


def test_ros2_node_info() -> None:
    found = parse_listing(ROS2)
    assert found.nodes == (Listed("/robot1/sensor", ("/robot1/status",), ("/r",), ("/reset",), ("/go",), ("/spin",)),)
    assert found.types["/r"] == "std_msgs/Float64"
    assert found.types["/reset"] == "std_srvs/Empty"


def test_json() -> None:
    assert parse_listing(JSON) == Listing((Listed("/a", ("/t",), ("/u",)),), {"/t": "std_msgs/Float64"})


@pytest.mark.parametrize(
    "text",
    [
        *("", "a -> b", "{", "[]", '{"/a": 3}', '{"/a": {"x": []}}', '{"/a b": {}}', "{" * 9999),
        *(f'{{"/a": {{"publishers": {wrong}}}}}' for wrong in ("3", '"/t"', "[7]", '{"/t": 7}', "[NaN]", '[["/t"]]')),
        '{"/a": {}, "/a": {}}',
    ],
)
def test_what_is_no_listing(text: str) -> None:
    with pytest.raises(NoListing):
        parse_listing(text)


@pytest.fixture
def master() -> Iterator[SimpleXMLRPCServer]:
    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def uri(server: SimpleXMLRPCServer) -> str:
    return f"http://127.0.0.1:{server.server_address[1]}"


def test_a_running_master(master: SimpleXMLRPCServer) -> None:
    state = [[["/t", ["/a", "/b"]]], [["/t", ["/c"]]], [["/a/go", ["/a"]]]]
    master.register_function(lambda caller: [1, "", state], "getSystemState")
    master.register_function(lambda caller: [1, "", [["/t", "std_msgs/Float64"], ["/u", "*"]]], "getTopicTypes")
    found = ask_master(uri(master))
    nodes = (Listed("/a", ("/t",), (), ("/a/go",)), Listed("/b", ("/t",)), Listed("/c", (), ("/t",)))
    assert found == Listing(nodes, {"/t": "std_msgs/Float64"})


@pytest.mark.parametrize("answer", [None, 3, [1], [1, "", 3], [1, "", [[["/t", 4]], [], []]], [1, "", []]])
def test_what_answers_and_is_no_master(master: SimpleXMLRPCServer, answer: object) -> None:
    master.register_function(lambda caller: answer, "getSystemState")
    master.register_function(lambda caller: [1, "", []], "getTopicTypes")
    with pytest.raises(NoListing):
        ask_master(uri(master))


def test_nobody_answers() -> None:
    with pytest.raises(NoListing, match="no ROS 1 master answers"):
        ask_master("http://127.0.0.1:1")
