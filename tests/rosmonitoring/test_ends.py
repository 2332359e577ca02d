"""The two ends of a link say that they have one value: they are read in one way."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring.options import Setup, setup
from avow.base.diagnostics import Diagnostic
from avow.system.load import load_system

RCL = """
node left { inputs() outputs( v : REAL ) topics( p/Twist cmd matches(out.v) ) guarantee g ( out.v <= 1 ) }
node right { inputs() outputs( v : REAL ) topics( p/Twist /cmd matches(out.v) ) guarantee g ( out.v <= 1 ) }
node motor {
  inputs( v : REAL ) outputs( on : BOOL )
  topics( p/Twist cmd matches(in.v), bool on matches(out.on) )
  guarantee g ( out.on <=> in.v > 0 )
}
"""
TWIST = "float64 x\nfloat64 y\nfloat64[] more\n"


def motor(folder: Path, left: Any, right: Any, own: Any = None) -> tuple[Setup, tuple[Diagnostic, ...]]:
    (folder / "msgs/p/msg").mkdir(parents=True)
    (folder / "msgs/p/msg/Twist.msg").write_text(TWIST, encoding="utf-8")
    (folder / "s.rcl").write_text(RCL, encoding="utf-8")
    mappings = {"left": {"out.v": left}, "right": {"out.v": right}, "motor": {} if own is None else {"in.v": own}}
    nodes = {name: {"methods": [{"rosmonitoring": {"mapping": mapping}}]} for name, mapping in mappings.items()}
    (folder / "plan.yaml").write_text(json.dumps({"messages": ["msgs"], "nodes": nodes}), encoding="utf-8")
    system = load_system(folder)
    return setup(system, system.contract.node("motor"), system.plan.node("motor").methods[0].options)


@pytest.mark.parametrize("own", [None, "x", {"field": "x"}, {"fields": ["x"], "initial": 0}])
def test_an_input_is_read_as_what_all_its_publishers_say(tmp_path: Path, own: Any) -> None:
    made, faults = motor(tmp_path, "x", {"field": "x"}, own)
    assert faults == ()
    assert made.rules["in.v"].paths == (("x",),)  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("left", "right", "own", "said"),
    [
        ("x", "y", None, ["it hears left.v, read as x, and right.v, read as y"]),
        ("x", "x", "y", ["left.v, to which it is linked, is read otherwise, as x of ", "right.v, to which"]),
        ("more[0]", "more[0]", "more[1]", ["left.v", "right.v"]),
        ({"field": "more", "take": "min"}, "more[0]", {"field": "more", "take": "min"}, ["right.v"]),
        ("x", "x", {"field": "x", "topic": "/elsewhere", "type": "p/Twist"}, ["left.v", "right.v"]),
    ],
)
def test_ends_that_are_read_otherwise_are_told(tmp_path: Path, left: Any, right: Any, own: Any, said: Any) -> None:
    _, faults = motor(tmp_path, left, right, own)
    assert [d.code for d in faults] == ["MON101"] * len(said)
    assert all(text in d.message for text, d in zip(said, faults, strict=True))
