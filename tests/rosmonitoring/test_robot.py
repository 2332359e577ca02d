"""The robot that runs: nothing is broken where nothing is wrong, and each fault is found where it begins."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from helpers import wait_for

from avow.backends.rosmonitoring.session import session
from avow.ros.bags import Event, carried, messages
from avow.system.load import load_system

from .processes import a_free_port, answers, running

ROOT = Path(__file__).parents[2]
CASE = ROOT / "contracts/remote_inspection"
ROBOT = CASE / "robot"


def drive(*arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, str(ROBOT / "drive.py"), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def mission() -> list[Event]:
    """The recorded one, with its times as numbers."""
    found = (event for event, _ in messages(ROBOT / "traces/mission.bag"))
    return [{**event, "time": float(event["time"])} for event in found]


def same(line: str, event: Event) -> bool:
    """Whether a line of a record says what a message of the recorded mission does."""
    said = json.loads(line)
    return {key: event.get(key) for key in said} == {**said, "topic": f"/{said['topic']}"}


@pytest.mark.slow
def test_a_mission_without_faults_is_the_recorded_one(tmp_path: Path) -> None:
    done = drive("--record", str(tmp_path / "run.bag"))
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.endswith(": 0 violations\n")
    made_events = (event for event, _ in messages(tmp_path / "run.bag"))
    assert [{**event, "time": float(event["time"])} for event in made_events] == mission()
    made, kept = carried(tmp_path / "run.bag"), carried(ROBOT / "traces/mission.bag")
    assert (made.types, made.publishers, made.counts) == (kept.types, kept.publishers, kept.counts)
    assert kept.publishers["/r"] == ("/world",)
    assert kept.publishers["/radiationStatus"] == ("/radiationSensor",)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("mislabel", ["guarantee broken: this node: radiationSensor.medium"]),
        ("ignore_orange", ["guarantee broken: this node: agent.exit_on_danger", "this node: agent.abandon"]),
        ("early", ["guarantee broken: this node: navigation.there"]),
        ("jump", ["guarantee broken: this node: localisation.steady"]),
        ("silent", ["silent for longer than the plan allows: radiationSensor.out.radiationStatus"]),
    ],
)
def test_a_fault_is_found_and_laid_at_the_right_door(fault: str, told: list[str], tmp_path: Path) -> None:
    done = drive("--fault", fault, "--seconds", "60", "--record", str(tmp_path / "run.jsonl"))
    assert done.returncode == 1, done.stdout + done.stderr
    lines = done.stdout.splitlines()
    for words, line in zip(told, lines, strict=False):
        assert words in line
    good = mission()
    bad = (tmp_path / "run.jsonl").read_text(encoding="utf-8").splitlines()
    at = int(lines[0].split("event ")[1].split(" ")[0].rstrip(":"))
    if fault in ("mislabel", "jump"):  # the first message that is other than it should be
        assert next(k for k, (a, b) in enumerate(zip(good, bad, strict=False), start=1) if not same(b, a)) == at


def until_told(words: str, robot: list[object], how: list[object], folder: Path) -> tuple[str, str, int]:
    """The robot on ROS 1, driving towards radiation, under a monitor until that says some words: its line with them,
    all that it says then, its code. Its record is run.jsonl."""
    port = a_free_port()
    command = [sys.executable, ROBOT / "ros1.py", "--port", port, "--source=4,-15.3,106560", *robot]
    monitor = [sys.executable, "-m", "avow", "monitor", ROBOT, "--live", f"ros1:http://127.0.0.1:{port}"]
    monitor += ["--record", folder / "run.jsonl", *how]
    with running(command, env={**os.environ, "ROS_HOME": str(folder / "ros")}):
        wait_for(lambda: answers(port))
        # of two pipes, the one that is not read could fill up
        with running(monitor, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as watching:
            assert watching.stdout is not None
            first = next((line for line in watching.stdout if words in line), "")
            watching.send_signal(signal.SIGINT)
            rest, _ = watching.communicate()
    wait_for(lambda: not answers(port))  # with the robot its master is gone
    return first, rest, watching.returncode


@pytest.mark.nightly
@pytest.mark.needs_ros1
def test_on_ros_1_a_wrong_command_is_withheld(tmp_path: Path) -> None:
    robot = ["--fault", "ignore_orange", "--enforce"]
    first, rest, code = until_told("agent.exit_on_danger", robot, ["--enforce"], tmp_path)
    assert "guarantee broken: this node: agent.exit_on_danger" in first, rest
    assert code == 1
    assert re.search(r"withheld: /?command \d+\n", rest), rest
    said = [json.loads(line) for line in (tmp_path / "run.jsonl").read_text("utf-8").splitlines()]
    commands = [event["topic"] for event in said if event["topic"].startswith("/command")]
    assert commands.count("/command_mon") > commands.count("/command") > 0


@pytest.mark.slow
def test_on_the_bus_a_wrong_command_is_withheld_and_its_record_is_no_evidence(tmp_path: Path) -> None:
    record = tmp_path / "run.jsonl"
    done = drive("--fault", "ignore_orange", "--seconds", "40", "--enforce", "--record", str(record))
    assert done.returncode == 1
    assert "withheld: command 1\n" in done.stdout
    said = [json.loads(line) for line in record.read_text("utf-8").splitlines()]
    wrong = [event for event in said if event["topic"].startswith("command") and event["id"] == 3]
    assert [event["topic"] for event in wrong if event["command"] == "inspect"] == ["command_mon"]
    again = session(load_system(ROBOT))
    assert "exit_on_danger" not in {v.clause for _, v in again.run(record)}
    assert "agent.exit_on_danger" in again.unmonitored()
    good = drive("--enforce", "--record", str(record))
    assert good.returncode == 0
    passed = [line for line in record.read_text("utf-8").splitlines() if "command_mon" not in line]
    assert len(passed) == len(mission())
    assert all(map(same, passed, mission()))


@pytest.mark.slow
@pytest.mark.needs_ros1
@pytest.mark.needs_roscpp
def test_on_ros_1_with_a_node_in_cpp_among_those_in_python(tmp_path: Path) -> None:
    """A real master, the nodes as processes of their own, the sensor in C++, which takes orange for green: this is
    found on the running graph, and in its record."""
    sensor = tmp_path / "radiation_sensor"
    flags = subprocess.check_output(["pkg-config", "--cflags", "--libs", "roscpp"], text=True).split()
    subprocess.run(["g++", ROBOT / "nodes/radiation_sensor.cpp", "-o", sensor, *flags], check=True, timeout=300)
    robot = ["--sensor", sensor, "--fault", "mislabel"]
    first, rest, code = until_told("radiationSensor.medium", robot, ["--node", "radiationSensor"], tmp_path)
    assert code == 1, rest
    assert "guarantee broken: this node: radiationSensor.medium: Medium radiation is orange" in first
    low = re.search(r"radiationSensor\.low \(guarantee\): published \d+ times: held (\d+)", rest)
    assert low is not None, rest
    assert int(low[1]) >= 1
    again = [v.clause for _, v in session(load_system(ROBOT), ["radiationSensor"]).run(tmp_path / "run.jsonl")]
    assert "medium" in again


def test_what_the_robot_shares_with_the_case_study_is_the_same() -> None:
    assert (ROBOT / "models/waypoints.csv").read_bytes() == (CASE / "models/waypoints.csv").read_bytes()
    mine = ROBOT / "msg/gazebo_radiation_plugins/msg/Snapshot.msg"
    theirs = CASE / "models/msg/gazebo_radiation_plugins/msg/Snapshot.msg"
    assert mine.read_bytes() == theirs.read_bytes()


def test_the_nodes_know_nothing_of_a_bus() -> None:
    for path in (ROBOT / "nodes").glob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert not any(word in text for word in ("rospy", "import bus", "wiring", "publish")), path


@pytest.mark.slow
def test_what_monitors_cost_is_measured() -> None:
    done = subprocess.run(
        [sys.executable, str(ROBOT / "overhead.py"), "1"], capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stderr
    first, *places = done.stdout.splitlines()
    assert first.split() == ["none", "localisation", "navigation", "radiationSensor", "agent", "all"]
    assert [line.split("  ")[0] for line in places] == [*(f"WP{k}" for k in range(1, 7)), "the door"]
