"""Topics' names as ROS has them: absolute, relative, private; words of the language are ordinary segments."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.language.contract import Contract
from avow.language.format import format_text
from avow.language.load import load_contract

TEXT = """node n {{
  inputs( r : REAL )
  outputs( o : BOOL )
  topics( {topic} matches(in.r), bool o matches(out.o) )

  guarantee g ( out.o or in.r > 0 )
}}
"""


def contract(folder: Path, topic: str) -> Contract:
    path = folder / "t.rcl"
    path.write_text(TEXT.format(topic=topic), encoding="utf-8")
    return load_contract((path,))


@pytest.mark.parametrize(
    ("topic", "kind", "name"),
    [
        ("float64 r", "float64", "r"),
        ("float64 /r", "float64", "/r"),
        ("std_msgs/Float64 /robot1/scan", "std_msgs/Float64", "/robot1/scan"),
        ("std_msgs/msg/Float64 arm/in/x", "std_msgs/msg/Float64", "arm/in/x"),
        ("std_msgs/Float64 ~r", "std_msgs/Float64", "~r"),
        ("float64 ~/r/not", "float64", "~/r/not"),
        ("float64 /inputs/matches/and", "float64", "/inputs/matches/and"),
        ("std_msgs / Float64 r", "std_msgs/Float64", "r"),
    ],
)
def test_names(tmp_path: Path, topic: str, kind: str, name: str) -> None:
    found = contract(tmp_path, topic).nodes[0].topics[0]
    assert (found.ros_type, found.name) == (kind, name)
    assert found.port is not None


@pytest.mark.parametrize(
    "topic", ["float64 /a//b", "float64 /a/", "float64 ~", "float64 /", "std_msgs /Float64 r", "float64 /1a", "float64"]
)
def test_what_is_no_name_is_told(tmp_path: Path, topic: str) -> None:
    with pytest.raises(Rejected) as caught:
        contract(tmp_path, topic)
    assert all(d.span is not None for d in caught.value.diagnostics)


@pytest.mark.parametrize("topic", ["std_msgs/Float64 /robot1/scan", "float64 ~/own", "float64 arm/in"])
def test_the_formatter_keeps_them(topic: str) -> None:
    text = TEXT.format(topic=topic)
    assert topic in format_text(text, "t.rcl")
