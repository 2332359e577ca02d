"""Messages in other frames than the contract's: transformed at their stamp through the recorded tree, or not judged."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from avow.backends.rosmonitoring import columns
from avow.backends.rosmonitoring.session import session
from avow.base.diagnostics import Rejected
from avow.drive import transforms
from avow.ros.frames import TREE, Tree
from avow.system.load import load_system

CONTRACT = """
node nav {
  inputs( x : REAL in m, y : REAL in m ) outputs( at : REAL in m )
  topics( geometry_msgs/PoseStamped /pose in map matches(in.x), geometry_msgs/PoseStamped /pose in map matches(in.y),
          std_msgs/Float64 /told matches(out.at) )
  guarantee exact ( out.at - in.x < 0.000001 and in.x - out.at < 0.000001 )
  guarantee level ( out.at >= 0 or in.y < 1000 )
}
"""
PLAN = """
ros: {distro: humble}
nodes:
  nav:
    methods:
      - rosmonitoring:
          traces: [t.jsonl]
          answers: {by: arrival, because: one process writes the trace}
          mapping: {in.x: pose.position.x, in.y: pose.position.y}
"""


def header(seconds: float, frame: str) -> dict[str, Any]:
    whole, rest = divmod(round(seconds * 1e9), 10**9)
    return {"stamp": {"sec": whole, "nanosec": rest}, "frame_id": frame}


def turned(angle: float) -> dict[str, float]:
    return {"x": 0.0, "y": 0.0, "z": math.sin(angle / 2), "w": math.cos(angle / 2)}


def link(time: float, parent: str, child: str, x: float, y: float, angle: float, topic: str = "/tf") -> dict[str, Any]:
    place = {"translation": {"x": x, "y": y, "z": 0.0}, "rotation": turned(angle)}
    return {
        "topic": topic,
        "time": time,
        "transforms": [{"header": header(time, parent), "child_frame_id": child, "transform": place}],
    }


def pose(time: float, frame: str, x: float, y: float) -> dict[str, Any]:
    content = {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turned(0.0)}
    return {"topic": "/pose", "time": time, "header": header(time, frame), "pose": content}


def told(time: float, at: float) -> dict[str, Any]:
    return {"topic": "/told", "time": time, "data": at}


def run(last: int = 40) -> list[dict[str, Any]]:
    """A robot drives along x and turns; its camera, 2 m ahead of it, sees a thing at (1, 0.5). Where that is in the map
    is known in closed form; the poses come between the transforms."""
    events = [link(0.0, "base", "camera", 2.0, 0.0, 0.0, "/tf_static")]
    for k in range(last):
        events.append(link(k * 0.1, "map", "base", k * 0.1, 0.0, k * 0.05))
        now = k * 0.1 + 0.03
        if k < last - 1:
            seen = now + 3.0 * math.cos(0.5 * now) - 0.5 * math.sin(0.5 * now)
            events += [pose(now, "camera", 1.0, 0.5), told(now + 0.01, seen)]
    return events


def judged(folder: Path, events: list[dict[str, Any]], contract: str = CONTRACT) -> dict[str, tuple[int, int, int]]:
    """For each guarantee: held, broken, undecided or unreadable."""
    (folder / "system.rcl").write_text(contract, "utf-8")
    (folder / "plan.yaml").write_text(PLAN, "utf-8")
    (folder / "t.jsonl").write_text("".join(json.dumps(event) + "\n" for event in events), "utf-8")
    running = session(load_system(folder))
    for _ in running.run(folder / "t.jsonl"):
        pass
    tallies = {name: tally for _, name, _, tally in running.clauses()}
    return {n: (t.judged - t.broken, t.broken, t.published - t.judged) for n, t in tallies.items()}


def test_a_moving_tree_gives_the_closed_form(tmp_path: Path) -> None:
    assert judged(tmp_path, run()) == {"exact": (39, 0, 0), "level": (39, 0, 0)}


def test_a_message_in_the_contracts_frame_is_taken_as_it_is(tmp_path: Path) -> None:
    events = [event for k in range(30) for event in (pose(k, "/map", k, 0.0), told(k + 0.5, k))]
    assert judged(tmp_path, events)["exact"] == (30, 0, 0)
    events[2]["pose"]["position"]["x"] += 0.5
    assert judged(tmp_path, events)["exact"] == (29, 1, 0)


@pytest.mark.parametrize(
    "unknown",
    [
        lambda events: [e for e in events if e["topic"] != "/tf_static"],  # no path
        lambda events: [e for e in events if e["topic"] != "/tf" or e["time"] < 2.0],  # extrapolation
        lambda events: [e | {"header": {**e["header"], "frame_id": ""}} if "header" in e else e for e in events],
        lambda events: [{k: v for k, v in e.items() if k != "header"} for e in events],
    ],
)
def test_what_cannot_be_transformed_is_not_judged_and_no_fault(tmp_path: Path, unknown: Any) -> None:
    held, broken, left = judged(tmp_path, unknown(run()))["exact"]
    assert broken == 0
    assert left > 10
    assert held < 25


@pytest.mark.parametrize("fault", ["inverse", "order", "nearest"])
def test_seeded_faults_are_caught(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fault: str) -> None:
    """A wrong direction, a wrong order of rotations, no interpolation."""
    right = transforms.times
    match fault:
        case "inverse":
            find = transforms.Transforms.find
            monkeypatch.setattr(transforms.Transforms, "find", lambda self, a, b, at: find(self, b, a, at))
        case "order":
            monkeypatch.setattr(transforms, "times", lambda a, b: right(b, a))
        case _:
            monkeypatch.setattr(transforms, "_between", lambda one, two, at: one)
    assert judged(tmp_path, run())["exact"][1] > 10


def test_other_numbers_of_another_frame_are_not_judged(tmp_path: Path) -> None:
    """A range has no meaning in another frame, and a velocity is not turned."""
    contract = CONTRACT.replace("geometry_msgs/PoseStamped", "geometry_msgs/TwistStamped")
    events = [e | {"twist": {"linear": {"x": 1.0, "y": 0.0, "z": 0.0}}} if "pose" in e else e for e in run()]
    plan = PLAN.replace("pose.position", "twist.linear")
    (tmp_path / "plan.yaml").write_text(plan, "utf-8")
    tree = Tree()
    for event in events:
        if event["topic"][1:] in TREE:
            tree.hear(event["topic"][1:], event)
    (tmp_path / "system.rcl").write_text(contract, "utf-8")
    (running,) = session(load_system(tmp_path)).monitors
    assert running.tree is not None
    running.tree.fill(tree)
    assert not [violation for event in events for violation in running.step(event)]
    assert running.tallies["exact"].judged == 0


def test_ends_in_two_frames_are_a_located_error(tmp_path: Path) -> None:
    other = "node seer { inputs() outputs( x : REAL ) topics( geometry_msgs/PoseStamped /pose in odom matches(out.x) )"
    with pytest.raises(Rejected) as caught:
        judged(tmp_path, run(), CONTRACT + other + " guarantee some ( out.x > 0 ) }")
    said = next(d for d in caught.value.diagnostics if d.code == "ROS111")
    assert said.span is not None
    assert "geometry_msgs/PoseStamped in odom at seer.x" in said.message
    assert "geometry_msgs/PoseStamped in map at nav." in said.message


def test_arrays_of_events_are_judged_one_by_one(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = judged(tmp_path, run(100))
    monkeypatch.setattr(columns, "FEW", 10**9)
    assert judged(tmp_path, run(100)) == whole
