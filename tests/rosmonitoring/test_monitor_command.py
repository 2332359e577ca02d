"""`avow monitor`: exit codes, output, and the oracle protocol over a real WebSocket."""

from __future__ import annotations

import json
import subprocess
import threading
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import pytest
from helpers import avow, some

from avow.backends.rosmonitoring.live.serve import answer, serve
from avow.backends.rosmonitoring.session import session
from avow.system.plan import System
from rosmonitoring.conftest import CASE

from .test_pace import MAPPING, RCL


def monitor(*arguments: str, stdin: str = "") -> subprocess.CompletedProcess[str]:
    return avow("monitor", *arguments, cwd=Path.cwd(), stdin=stdin)


def heard(folder: Path, events: Iterable[Mapping[str, Any]]) -> subprocess.CompletedProcess[str]:
    """What the monitors of a system's folder say of events on standard input."""
    return monitor(str(folder), "-", stdin="".join(f"{json.dumps(event)}\n" for event in events))


@pytest.fixture(scope="module")
def traces(case_folder: Path) -> dict[str, Path]:
    nominal = case_folder / "traces" / "nominal.jsonl"
    faulty = case_folder / "traces" / "faulty.jsonl"
    text = nominal.read_text(encoding="utf-8")
    assert '"level": "red"' in text
    faulty.write_text(text.replace('"level": "red"', '"level": "green"', 1), encoding="utf-8")
    broken = case_folder / "traces" / "broken.jsonl"
    broken.write_text('{"topic": "r", "time": 0, "radiation": 1}\n{"topic": "r", "radiation": }\n', encoding="utf-8")
    timeless = case_folder / "traces" / "timeless.jsonl"
    timeless.write_text(text.replace('"time": 10.37', '"time": "soon"', 1), encoding="utf-8")
    return {"nominal": nominal, "faulty": faulty, "broken": broken, "timeless": timeless}


def test_nominal(case_folder: Path, traces: dict[str, Path]) -> None:
    done = monitor(str(case_folder), str(traces["nominal"]))
    assert (done.returncode, done.stderr) == (0, "")
    assert "nothing broken" in done.stdout
    assert "agent.next_waypoint (guarantee): published 17 times: held 16, before the first value 1" in done.stdout


def test_topics_that_nobody_listens_to_are_told_with_those_that_are() -> None:
    line = '{"topic": "/raditaion", "time": %d, "radiation": 1}'
    done = monitor(str(CASE), "-", "--node", "radiationSensor", stdin="\n".join(line % n for n in range(3)))
    assert done.returncode == 1
    assert "topics of the trace that no clause uses, and their events: /raditaion (3)" in done.stdout
    told = next(row for row in done.stdout.splitlines() if row.startswith("topics listened to: "))
    assert "radiationStatus" in told


def test_faulty_as_json_and_from_standard_input(case_folder: Path, traces: dict[str, Path]) -> None:
    text = traces["faulty"].read_text(encoding="utf-8")
    line = 1 + next(
        k
        for k, row in enumerate(text.splitlines())
        if "radiationStatus" in row
        and json.loads(row)["time"] > 0
        and json.loads(text.splitlines()[k - 1]).get("radiation", 0) >= 250
    )
    done = monitor(str(case_folder), "-", "--json", "--node", "radiationSensor", stdin=text)
    assert done.returncode == 1
    whole = json.loads(done.stdout)
    (violation,) = whole["violations"]
    assert (violation["clause"], violation["fault"], violation["event"], violation["line"]) == (
        "high",
        "guarantee",
        line,
        line,
    )
    assert whole["clean"] is False
    assert [n["node"] for n in whole["nodes"]] == ["radiationSensor"]


def test_a_flood_of_one_clause_hides_no_breach_of_another() -> None:
    event = '{"topic": "%s", "time": %d, "%s": %s}'
    unreadable = [event % ("radiationStatus", n, "level", '"violet"') for n in range(30)]
    breach = [event % ("r", 30, "radiation", "300"), event % ("radiationStatus", 31, "level", '"green"')]
    done = monitor(str(CASE), "-", "--node", "radiationSensor", stdin="\n".join(unreadable + breach))
    assert done.stdout.count(": message outside its mapping: radiationSensor.out.radiationStatus") == 10
    assert "… and 20 more of radiationSensor.out.radiationStatus: message outside its mapping (--all" in done.stdout
    assert "event 32 (t = 31): guarantee broken: this node: radiationSensor.high" in done.stdout


@pytest.mark.parametrize(
    ("trace", "words"),
    some(
        [
            ("broken", "broken.jsonl:2:"),
            ("timeless", "timeless.jsonl:2:"),
            ("absent", "cannot read"),
            ("traces/metadata.yaml", "is a part of a bag"),
            ("traces/inside.jsonl", "did you mean"),
            ("nodes", "did you mean"),
        ],
        2,
    ),
)
def test_bad_input_is_code_2_with_its_place(case_folder: Path, traces: dict[str, Path], trace: str, words: str) -> None:
    if trace == "nodes":
        done = monitor(str(case_folder), str(traces["nominal"]), "--node", "agnt")
    elif trace == "traces/inside.jsonl":
        (case_folder / "traces").mkdir(exist_ok=True)
        (case_folder / trace).touch()
        done = monitor(str(case_folder), trace)
    else:
        done = monitor(str(case_folder), str(traces.get(trace, case_folder / trace)))
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr


def test_a_trace_of_other_topics_is_no_success(case_folder: Path, traces: dict[str, Path]) -> None:
    """Seeded fault: a remapped robot, whose every topic has another name."""
    events = [json.loads(line) for line in traces["nominal"].read_text().splitlines()]
    text = "".join(json.dumps({**event, "topic": f"robot2/{event['topic']}"}) + "\n" for event in events)
    done = monitor(str(case_folder), "-", stdin=text)
    assert done.returncode == 1
    assert "nothing was judged: no clause" in done.stdout
    assert "no event came" in monitor(str(case_folder), "-", stdin="").stdout


@pytest.mark.slow
def test_usage(case_folder: Path) -> None:
    assert monitor(str(case_folder)).returncode == 2
    assert monitor(str(case_folder), "x", "--serve", "0").returncode == 2
    assert "give one: TRACE, --live" in monitor(str(case_folder), "x", "--live", "ros2").stderr
    assert "need --live" in monitor(str(case_folder), "x", "--for", "2").stderr


def test_replies_always_carry_a_verdict_and_never_a_final_one(case: System, nominal: list[dict[str, Any]]) -> None:
    running = session(case)
    frames = [json.dumps(e) for e in nominal]
    frames += [f'{{"topic": "r", "radiation": {"[" * n}{"]" * n}}}' for n in range(900, 1000, 7)]
    frames += ["", "nonsense", "[]", "[" * 100_000, '{"topic": "radiationStatus", "level": "green"', "{}"]
    for frame in frames:
        reply = json.loads(answer(running, frame))
        assert reply["verdict"] in ("currently_true", "currently_false", "unknown")
    first = json.loads(answer(session(case), frames[0]))
    assert first.pop("verdict") == "currently_true"
    assert first == nominal[0]


def test_an_event_by_which_nothing_is_decided_is_unknown(make_system: Callable[..., System]) -> None:
    """Also the first answer after a reconnection, whose input the oracle has not heard."""
    system = make_system(RCL, MAPPING)

    def said(*events: tuple[str, float]) -> list[str]:
        running = session(system)
        frames = [json.dumps({"topic": topic, "time": k, "data": data}) for k, (topic, data) in enumerate(events)]
        return [json.loads(answer(running, frame))["verdict"] for frame in frames]

    assert said(("r", 1), ("s", 1), ("elsewhere", 1), ("s", 1), ("s", 2)) == [
        "unknown", "currently_true", "unknown", "currently_true", "currently_false",
    ]  # fmt: skip
    assert said(("s", 2), ("r", 2), ("s", 2)) == ["unknown", "unknown", "currently_true"]


def test_the_oracle_over_a_websocket(case: System, nominal: list[dict[str, Any]]) -> None:
    client = pytest.importorskip("websockets.sync.client")
    started: list[Any] = []
    up = threading.Event()

    def ready(server: Any) -> None:
        started.append(server)
        up.set()

    thread = threading.Thread(target=serve, args=(lambda: session(case), 0, ready), daemon=True)
    thread.start()
    assert up.wait(20)
    port = started[0].socket.getsockname()[1]
    try:
        with client.connect(f"ws://127.0.0.1:{port}") as socket:
            verdicts = []
            for event in nominal:
                changed = {**event, "level": "green"} if event.get("level") == "red" else event
                socket.send(json.dumps(changed))
                verdicts.append(json.loads(socket.recv(timeout=20))["verdict"])
            assert len(verdicts) == len(nominal)
            at = next(k for k, e in enumerate(nominal) if e.get("level") == "red")
            assert verdicts.index("currently_false") == at
            assert {*verdicts[:at]} == {"currently_true", "unknown"}
    finally:
        started[0].shutdown()
        thread.join(20)


def test_inputs_that_are_too_old_are_no_success(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( x : REAL ) outputs( y : BOOL ) topics( std_msgs/Float64 x matches(in.x), std_msgs/Bool y "
        "matches(out.y) ) guarantee g ( in.x > 5 -> out.y ) }"
    )
    method = "rosmonitoring: {answers: {by: arrival, because: b}, max_age: 500 ms}"
    (tmp_path / "plan.yaml").write_text(f"ros: {{distro: humble}}\nnodes: {{n: {{methods: [{method}]}}}}\n")
    for late, code in ((5.0, 1), (0.4, 0)):
        events = [{"topic": "x", "time": 1.0, "data": 9.0}, {"topic": "y", "time": 1.0 + late, "data": True}]
        done = heard(tmp_path, events)
        assert (done.returncode, "too old (`max_age`)" in done.stdout) == (code, code == 1), done.stdout


def test_the_remedy_of_a_clause_is_said_with_its_first_breach(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs() outputs( y : REAL ) topics( std_msgs/Float64 y matches(out.y) ) "
        "guarantee g ( out.y <= 0.2 ) }"
    )
    (tmp_path / "plan.yaml").write_text("ros: {distro: humble}\nnodes: {n: {methods: [{rosmonitoring: {}}]}}\n")
    events = [{"topic": "y", "time": time, "data": 0.2} for time in (1.0, 2.0, 3.0)]
    done = heard(tmp_path, events)
    assert done.stdout.count("exactly, out.y is 0.2 + 1.1e-17, since no float is the decimal number") >= 3
    assert done.stdout.count("guarantee broken") >= 3
    assert done.stdout.partition("event 2")[2].count("event 3") == 1
    assert "allow a tolerance" in done.stdout.partition("event 2")[0]
    assert "allow a tolerance" not in done.stdout.partition("event 2")[2].partition("n.g (guarantee)")[0]


def test_one_remedy_for_several_clauses_is_said_once(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( x : REAL ) outputs( y : BOOL ) topics( std_msgs/Float64 x matches(in.x), std_msgs/Bool y "
        "matches(out.y) ) guarantee g ( in.x > 5 -> out.y ) guarantee h ( in.x < 0 -> not out.y ) }"
    )
    (tmp_path / "plan.yaml").write_text("ros: {distro: humble}\nnodes: {n: {methods: [{rosmonitoring: {}}]}}\n")
    events = [{"topic": "x", "time": 1.0, "data": 9.0}, {"topic": "y", "time": 1.1, "data": True}]
    done = heard(tmp_path, events)
    assert "unmonitored: n.g, n.h\n  n.g, n.h: the plan does not say which input" in done.stdout
    assert done.stdout.count("add `answers:") == 1


def test_a_field_that_is_not_clear_says_what_to_write(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs() outputs( y : REAL ) topics( geometry_msgs/Point y matches(out.y) ) guarantee( out.y > 0 ) }"
    )
    (tmp_path / "plan.yaml").write_text("ros: {distro: humble}\n")
    done = monitor(str(tmp_path), "-", stdin='{"topic": "y", "time": 0, "x": 1, "y": 2, "z": 3}\n')
    assert "more than one field of geometry_msgs/Point: x : float64, y : float64, z : float64; name the field" in (
        done.stdout
    )


def test_without_answers_what_held_is_no_evidence_and_no_success(tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(
        "node n { inputs( x : REAL ) outputs( y : BOOL ) topics( std_msgs/Float64 x matches(in.x), std_msgs/Bool y "
        "matches(out.y) ) guarantee g ( in.x > 5 -> out.y ) guarantee alone ( out.y ) }"
    )
    (tmp_path / "plan.yaml").write_text("ros: {distro: humble}\nnodes: {n: {methods: [{rosmonitoring: {}}]}}\n")
    events = [{"topic": "x", "time": 1.0, "data": 9.0}, {"topic": "y", "time": 1.1, "data": True}]
    done = heard(tmp_path, events)
    assert (done.returncode, "unmonitored: n.g\n" in done.stdout) == (1, True)
    assert "  n.g: the plan does not say which input an answer answered: add `answers: {latency: 10 ms, " in done.stdout
