"""ROS 2 parameter files set for a node what ROS 2 reads of them."""

from __future__ import annotations

from typing import Any

import pytest
import yaml

from avow.ros.parameters import WrongParameters, flat, is_sectioned, nested, placed

P = "ros__parameters"


def of_node(data: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, (value, _) in placed(data, name).items()}


@pytest.mark.parametrize(
    ("entry", "name", "applies"),
    [
        ("a", "/a", True),
        ("/a", "/a", True),
        ("a", "/ns/a", False),
        ("/ns/a", "/ns/a", True),
        ("ns/a", "/ns/a", True),
        ("ns: {a: HERE}", "/ns/a", True),
        ("/ns: {a: HERE}", "/ns/a", True),
        ("ns: {deep: {a: HERE}}", "/ns/deep/a", True),
        ("/**", "/a", True),
        ("/**", "/ns/deep/a", True),
        ("/*", "/a", True),
        ("/*", "/ns/a", False),
        ("/*/a", "/ns/a", True),
        ("/*/a", "/a", False),
        ("/**/a", "/a", True),
        ("/**/a", "/ns/deep/a", True),
        ("/**/a", "/ns/ba", False),
        ("/ns/**", "/other/a", False),
        ("/ns/**", "/ns/a", True),
        ("/a.b", "/axb", False),
    ],
)
def test_an_entry_applies_to_the_nodes_that_its_name_means(entry: str, name: str, applies: bool) -> None:
    text = entry.replace("HERE", f"{{{P}: {{x: 1}}}}") if "HERE" in entry else f"'{entry}': {{{P}: {{x: 1}}}}"
    data = yaml.safe_load(f"{text}\n/none_of_these: {{{P}: {{x: 2}}}}")
    assert is_sectioned(data)
    if applies:
        assert of_node(data, name) == {"x": 1}
    else:
        with pytest.raises(WrongParameters, match=f"it sets nothing for {name}, but for"):
            of_node(data, name)


def test_later_entries_count_first_and_names_are_dotted() -> None:
    data = {"/**": {P: {"x": 1, "pid": {"p": 1, "i": 2}}}, "/a": {P: {"pid.p": 3}}, "/b": {P: None}}
    assert of_node(data, "/a") == {"x": 1, "pid.p": 3, "pid.i": 2}
    assert nested(of_node(data, "/a")) == {"x": 1, "pid": {"p": 3, "i": 2}}
    assert dict(flat(nested(of_node(data, "/a")))) == of_node(data, "/a")
    assert of_node(data, "/b") == {"x": 1, "pid.p": 1, "pid.i": 2}


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("{/a: {P: {x: 1}}, '/**': {P: {x: 2}}}", "put the wildcard first"),
        ("{/a: {P: {x: 1}, x: 2}}", "has other keys beside"),
        ("{/a: {P: {x: 1}}, /b: 3}", "/b is neither a node"),
        ("{/a: {P: [1]}}", "is no mapping"),
    ],
)
def test_what_cannot_be_said_is_refused(text: str, why: str) -> None:
    with pytest.raises(WrongParameters, match=why):
        of_node(yaml.safe_load(text.replace("P:", f"{P}:")), "/a")


def test_a_wildcard_that_says_the_same_again_is_no_doubt() -> None:
    assert of_node({"/a": {P: {"x": 1}}, "/**": {P: {"x": 1, "y": 2}}}, "/a") == {"x": 1, "y": 2}


@pytest.mark.parametrize("text", ["red: 250.0", "{}", "{a: {b: 1}}", "[1, 2]", "3"])
def test_plain_mappings_are_none(text: str) -> None:
    assert not is_sectioned(yaml.safe_load(text))
