"""Names as ROS resolves them; the examples are those of http://wiki.ros.org/Names."""

from __future__ import annotations

import pytest

from avow.ros.names import Placed, Resolver, is_name


@pytest.mark.parametrize(
    ("node", "name", "whole"),
    [
        ("/node1", "bar", "/bar"),
        ("/wg/node2", "bar", "/wg/bar"),
        ("/wg/node3", "foo/bar", "/wg/foo/bar"),
        ("/node1", "/bar", "/bar"),
        ("/wg/node2", "/bar", "/bar"),
        ("/node1", "~bar", "/node1/bar"),
        ("/wg/node2", "~bar", "/wg/node2/bar"),
        ("/wg/node3", "~/foo/bar", "/wg/node3/foo/bar"),
    ],
)
def test_resolution(node: str, name: str, whole: str) -> None:
    assert Placed(node).resolved(name) == whole


@pytest.mark.parametrize(
    ("remap", "name", "whole"),
    [
        (("bar", "qux"), "bar", "/wg/qux"),
        (("/wg/bar", "/qux"), "bar", "/qux"),
        (("bar", "~qux"), "/wg/bar", "/wg/n/qux"),
        (("~bar", "qux"), "~/bar", "/wg/qux"),
        (("bar", "qux"), "/bar", "/bar"),
    ],
)
def test_remaps(remap: tuple[str, str], name: str, whole: str) -> None:
    assert Placed("/wg/n", (remap,)).resolved(name) == whole


def test_a_node_of_which_nothing_is_said_runs_at_the_root() -> None:
    names = Resolver((("a", Placed("/robot/a")),))
    assert (names.topic("a", "scan"), names.topic("b", "scan")) == ("/robot/scan", "/scan")


def test_what_is_a_name() -> None:
    assert all(map(is_name, ("a", "/a/b_1", "~x", "~/x", "a/b")))
    assert not any(map(is_name, ("", "/", "a//b", "a/", "1a", "a b", "/ä", "x" * 300)))
