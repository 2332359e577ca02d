"""`avow graph`: topics, types, names, several publishers and the environment, as text and as JSON."""

from __future__ import annotations

import json
from pathlib import Path

from click.testing import CliRunner

from avow.cli.graph import command

CONTRACT = """
node joy { inputs( ) outputs( v : REAL ) topics( float64 cmd matches(out.v) ) guarantee g ( out.v <= 1 ) }
node auto { inputs( m : REAL, b : REAL, o : REAL ) outputs( w : REAL )
  topics( float64 cmd matches(out.w), float64 ~map matches(in.m), float64 cmd matches(in.b) )
  guarantee g ( out.w <= 0 ) }
node wheels { inputs( u : REAL ) outputs( turn : REAL ) topics( float64 /cmd_vel matches(in.u) )
  assume slow ( in.u <= 1 ) guarantee g ( out.turn == in.u ) }
node panel { inputs( turn : REAL ) outputs( b : BOOL ) topics( bool b matches(out.b) ) guarantee g ( out.b ) }
"""
PLAN = """\
ros: {nodes: {joy: {name: /robot/joy, remap: {cmd: /cmd_vel}}, auto: {name: /robot/auto, remap: {cmd: /cmd_vel}}}}
connections: [{from: auto.w, to: auto.b, delayed: true, initial: 0}]
"""
TEXT = """\
nodes
  joy: /robot/joy, cmd → /cmd_vel
  auto: /robot/auto, cmd → /cmd_vel
  wheels: /wheels
  panel: /panel
topics
  /b  std_msgs/Bool
    ← panel.b
    → nobody
  /cmd_vel  std_msgs/Float64
    ← joy.v (there called cmd)
    ← auto.w (there called cmd)
    → auto.b (there called cmd), from auto.w one step later: any of the publishers, at any step
    → wheels.u: any of the publishers, at any step
  /robot/auto/map  std_msgs/Float64
    ← the environment
    → auto.m (there called ~map)
linked by name, since an end has no topic, or by a connection
  wheels.turn → panel.turn
from the environment, without a topic
  auto.o
"""


def shown(folder: Path, *options: str) -> str:
    (folder / "s.rcl").write_text(CONTRACT, encoding="utf-8")
    (folder / "plan.yaml").write_text(PLAN, encoding="utf-8")
    result = CliRunner().invoke(command, [str(folder), *options], catch_exceptions=False)
    assert result.exit_code == 0
    return result.output


def test_the_wiring_as_text(tmp_path: Path) -> None:
    assert shown(tmp_path) == TEXT


def test_the_wiring_as_json(tmp_path: Path) -> None:
    found = json.loads(shown(tmp_path, "--json"))
    (topic,) = [t for t in found["topics"] if t["topic"] == "/cmd_vel"]
    assert [p["port"] for p in topic["publishers"]] == ["joy.v", "auto.w"]
    assert topic["environment"] is False
    assert found["nodes"][0] == {"node": "joy", "name": "/robot/joy", "remap": {"cmd": "/cmd_vel"}, "said": ""}


def test_the_picture(tmp_path: Path) -> None:
    assert shown(tmp_path, "--svg").startswith("<svg")
