"""The backend as the core sees it: exports, outcomes, and what it says where it cannot say."""

from __future__ import annotations

import hashlib
import json
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from oracle.rml_reader import read
from oracle.rosmonitoring import problems

from avow.backend_kit.protocol import Backend, Limits
from avow.backends.rosmonitoring import BACKEND
from avow.backends.rosmonitoring.traces import read_trace
from avow.base.diagnostics import Rejected, Severity
from avow.base.verdict import Outcome, Verdict
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import job_for, write_case


@pytest.fixture(scope="module")
def with_traces(tmp_path_factory: pytest.TempPathFactory) -> System:
    return load_system(write_case(tmp_path_factory.mktemp("backend"), {}))


def discharge(system: System, name: str, folder: Path) -> dict[str, Outcome]:
    job = job_for(system, name)
    report = BACKEND.discharge(job, folder, Limits())
    assert [o.obligation for o in report.outcomes] == [o.id for o in job.obligations]
    return {o.obligation.rsplit("/", 1)[1]: o for o in report.outcomes}


def test_it_is_a_backend() -> None:
    assert isinstance(BACKEND, Backend)
    jsonschema.Draft202012Validator.check_schema(dict(BACKEND.options_schema))
    (tool,) = BACKEND.tools()
    assert (tool.name, tool.present, tool.optional) == ("rosbags", True, True)


def test_importing_it_is_light() -> None:
    code = (
        "import sys, avow.backends.rosmonitoring; "
        "print([m for m in ('z3', 'lark', 'yaml', 'rosbags', 'websockets', 'hypothesis') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("name", ["localisation", "navigation", "agent", "radiationSensor"])
def test_exports_are_pure_and_well_formed(with_traces: System, name: str) -> None:
    job = job_for(with_traces, name)
    assert [d.code for d in BACKEND.check(job)] == ["MON107"]
    files = BACKEND.export(job)
    assert files == BACKEND.export(job)
    assert set(files) == {f"{name}.yaml", f"{name}.rml", f"{name}_monitor.json"}
    assert problems(files[f"{name}.yaml"]) == []
    read(files[f"{name}.rml"])
    assert str(with_traces.plan.root) not in "".join(files.values())
    assert next(iter(BACKEND.files(job))).name == "nominal.jsonl"


@pytest.mark.parametrize("name", ["localisation", "navigation", "agent", "radiationSensor"])
def test_nominal_trace_supports_every_guarantee(with_traces: System, name: str, tmp_path: Path) -> None:
    for clause, outcome in discharge(with_traces, name, tmp_path).items():
        assert outcome.verdict is Verdict.MONITORED, (clause, outcome.summary)
        assert outcome.vacuous is (clause == "end_of_mission")  # danger ends this mission before its last waypoint
        assert outcome.bound["events"] == 118
        (digest,) = outcome.bound["traces"].values()  # type: ignore[attr-defined]
        assert len(digest) == 64


def changed(folder: Path, change: Callable[[str], str]) -> System:
    place = write_case(folder, {})
    trace = place / "traces" / "nominal.jsonl"
    trace.write_text(change(trace.read_text(encoding="utf-8")), encoding="utf-8")
    return load_system(place)


def test_a_broken_guarantee_is_refuted_with_its_event(tmp_path: Path) -> None:
    system = changed(tmp_path, lambda text: text.replace('"level": "red"', '"level": "green"', 1))
    found = discharge(system, "radiationSensor", tmp_path)
    assert found["high"].verdict is Verdict.REFUTED
    assert found["high"].counterexample is not None
    assert ("out.radiationStatus", "green") in found["high"].counterexample.values
    assert {found[n].verdict for n in ("low", "medium", "marks_inspected")} == {Verdict.MONITORED}


def test_an_unreadable_line_is_named_by_the_plans_path(tmp_path: Path) -> None:
    system = changed(tmp_path, lambda text: text + "{")
    found = discharge(system, "radiationSensor", tmp_path)["high"]
    assert found.verdict is Verdict.ERROR
    assert re.match(r"traces/[a-z]+\.jsonl, line \d+: this is not JSON", found.summary), found.summary
    assert str(tmp_path) not in found.summary


def test_bad_traces_are_errors_or_unknown_never_support(tmp_path: Path) -> None:
    cases: dict[str, tuple[Callable[[str], str], Verdict]] = {
        "json": (lambda text: text + "{", Verdict.ERROR),
        "colour": (lambda text: text.replace('"level": "green"', '"level": "pink"', 1), Verdict.UNKNOWN),
        "empty": (lambda text: "", Verdict.UNKNOWN),
        "elsewhere": (lambda text: text.replace('"topic": "', '"topic": "other_'), Verdict.UNKNOWN),
    }
    for name, (change, verdict) in cases.items():
        folder = tmp_path / name
        folder.mkdir()
        found = discharge(changed(folder, change), "radiationSensor", folder)
        assert found["low"].verdict is verdict, (name, found["low"])


def test_a_trigger_that_never_came_is_vacuous(tmp_path: Path) -> None:
    def only_low(text: str) -> str:
        rows = [json.loads(line) for line in text.splitlines()]
        return "".join(json.dumps(r) + "\n" for r in rows[:20])

    found = discharge(changed(tmp_path, only_low), "radiationSensor", tmp_path)
    assert (found["low"].verdict, found["low"].vacuous) == (Verdict.MONITORED, False)
    assert (found["high"].verdict, found["high"].vacuous) == (Verdict.MONITORED, True)


SYSTEM = """
node n {
  inputs( r : REAL, hidden : REAL )
  outputs( o : REAL )
  topics( float64 r matches(in.r), std_msgs/Float64 o matches(out.o) )
  assume positive ( in.r >= 0 )
  guarantee seen ( out.o >= in.r )
  guarantee unseen ( out.o >= in.hidden )
  guarantee hard ( forall(x in REAL | x * x + out.o > 0 or x * x * x < in.r) )
}
"""


def test_without_a_trace_nothing_ran(make_system: Callable[..., System], tmp_path: Path) -> None:
    found = discharge(make_system(SYSTEM), "n", tmp_path)
    assert {n: o.verdict for n, o in found.items()} == {
        "seen": Verdict.NOT_RUN,
        "unseen": Verdict.UNKNOWN,
        "hard": Verdict.NOT_RUN,
    }
    assert "not monitorable in RML" in found["hard"].summary
    assert not any(o.verdict.supports for o in found.values())


def test_what_cannot_be_observed_is_unknown(make_system: Callable[..., System], tmp_path: Path) -> None:
    system = make_system(SYSTEM, traces=["t.jsonl"])
    trace = system.plan.root / "t.jsonl"
    rows: list[dict[str, Any]] = [{"topic": "r", "data": 1, "time": 0}, {"topic": "o", "data": 2, "time": 1}]
    trace.write_text("".join(json.dumps(r) + "\n" for r in rows), encoding="utf-8")
    job = job_for(system, "n")
    assert any("unseen cannot be monitored" in d.message and not d.is_error for d in BACKEND.check(job))
    found = discharge(system, "n", tmp_path)
    assert found["seen"].verdict is Verdict.MONITORED
    assert found["unseen"].verdict is Verdict.UNKNOWN
    assert "no topic" in found["unseen"].summary
    assert found["hard"].verdict in (Verdict.UNKNOWN, Verdict.MONITORED)


def test_a_guarantee_only_judged_while_its_assumption_is_broken_is_not_supported(
    make_system: Callable[..., System], tmp_path: Path
) -> None:
    system = make_system(SYSTEM, traces=["t.jsonl"])
    trace = system.plan.root / "t.jsonl"
    trace.write_text('{"topic": "r", "data": -1, "time": 0}\n{"topic": "o", "data": -2, "time": 1}\n', encoding="utf-8")
    found = discharge(system, "n", tmp_path)
    assert found["seen"].verdict is Verdict.UNKNOWN
    assert "assumption" in found["seen"].summary


def test_a_trace_outside_the_system_is_a_fault(make_system: Callable[..., System]) -> None:
    for name, said in (("../secret.jsonl", "leads out"), ("/etc/passwd", "leads out"), ("absent.jsonl", "no file")):
        faults = BACKEND.check(job_for(make_system(SYSTEM, traces=[name]), "n"))
        assert [said in d.message and d.span is not None for d in faults if d.code == "MON102"] == [True], faults


def test_a_slip_in_the_name_of_a_trace_is_told_with_the_name_that_is_there(make_system: Callable[..., System]) -> None:
    """By a digest too, though such a recording may be missing."""
    for entry, severity in (
        ("runn.jsonl", Severity.ERROR),
        ({"path": "runn.jsonl", "sha256": "0" * 64}, Severity.WARNING),
    ):
        system = make_system(MONITOR, {"out.v": "data"}, traces=[entry])
        (system.plan.root / "run.jsonl").touch()
        (fault,) = (d for d in BACKEND.check(job_for(system, "n")) if d.code == "MON102")
        assert (fault.severity, fault.hint) == (severity, "did you mean `run.jsonl`?")
    with pytest.raises(Rejected, match="cannot read") as found:
        list(read_trace(system.plan.root / "rn.jsonl"))
    assert found.value.diagnostics[0].hint == "did you mean `run.jsonl`?"


@pytest.mark.parametrize(("traces", "told"), [([], True), (["by_hand.jsonl"], False)])
def test_a_message_without_the_field_that_pairs_answers_is_told(
    make_system: Callable[..., System], traces: list[str], told: bool
) -> None:
    """A line of JSON may have other fields than its type; a bag's message has not."""
    paired = "node n {{ inputs( a : REAL ) outputs( b : REAL ) topics( {} t matches(in.a), {} u matches(out.b) ) {} }}"
    for kind, said in (("std_msgs/Float64", told), ("sensor_msgs/Temperature", False)):
        text = paired.format("sensor_msgs/Temperature", kind, "guarantee g ( out.b >= in.a )")
        fields = {"in.a": "temperature", "out.b": "data" if said or "std" in kind else "temperature"}
        more = {"ros": {"distro": "humble"}}
        system = make_system(text, fields, plan=more, traces=traces, answers={"by": "stamp"})
        found = [d for d in BACKEND.check(job_for(system, "n")) if d.code == "MON103"]
        assert ["std_msgs/Float64 has no field 'header'" in d.message for d in found] == [True] * said
    system = make_system(text, fields, plan=more, traces=traces, answers=None)
    found = [
        d for d in BACKEND.check(job_for(system, "n")) if "add `answers: {by: stamp}`, or another way" in d.message
    ]
    assert len(found) == 1


MONITOR = """
node n {
  inputs( a : REAL )
  outputs( v : REAL )
  topics( std_msgs/Float64 v matches(out.v) )
  guarantee low ( out.v <= 120 )
}
"""


LATE = """
node n {
  inputs( limit : REAL )  outputs( v : REAL )
  topics( std_msgs/Float64 limit matches(in.limit), std_msgs/Float64 v matches(out.v) )
  guarantee low ( out.v <= in.limit )
}
"""


@pytest.mark.parametrize(
    ("limit", "options", "verdict", "told"),
    [
        ("data", {}, Verdict.UNKNOWN, ["mapping: {in.limit: {…, initial: …}}", "decided: 0.9"]),
        ("data", {"decided": 0.9}, Verdict.MONITORED, []),
        ({"field": "data", "initial": 2}, {}, Verdict.MONITORED, []),
    ],
)
def test_what_is_said_of_an_input_that_comes_late_is_what_helps(
    limit: Any,
    options: dict[str, Any],
    verdict: Verdict,
    told: list[str],
    make_system: Callable[..., System],
    tmp_path: Path,
) -> None:
    """A latched input whose message is recorded after the first of ten answers."""
    said = [("v", 1), ("limit", 2), *[("v", 1)] * 9]
    lines = [json.dumps({"topic": topic, "time": k, "data": value}) for k, (topic, value) in enumerate(said)]
    system = make_system(LATE, {"in.limit": limit, "out.v": "data"}, traces=["run.jsonl"], **options)
    (system.plan.root / "run.jsonl").write_text("\n".join(lines), encoding="utf-8")
    outcome = discharge(system, "n", tmp_path)["low"]
    assert outcome.verdict is verdict
    assert all(text in outcome.summary for text in told)


def test_methods_share_their_nodes_mapping(make_system: Callable[..., System], tmp_path: Path) -> None:
    """A method's own entry comes first; what reads no messages is given nothing."""
    methods = [{"rosmonitoring": {"mapping": {"out.v": "own"}}}, {"hypothesis": {}}, {"hoare": {"program": "n.imp"}}]
    node = {"mapping": {"in.limit": "data", "out.v": "data"}, "methods": methods}
    plan = make_system(LATE, plan={"nodes": {"n": node}}).plan
    found = [method.options.data.get("mapping") for method in plan.node("n").methods]
    assert found == [{"in.limit": "data", "out.v": "own"}, {"in.limit": "data", "out.v": "data"}, None]


def test_a_recording_named_by_its_digest_need_not_be_here(make_system: Callable[..., System], tmp_path: Path) -> None:
    line = '{"topic": "v", "time": 1, "data": 3.5}\n'
    entry = {"path": "run.jsonl", "sha256": hashlib.sha256(line.encode()).hexdigest()}
    system = make_system(MONITOR, {"out.v": "data"}, traces=[entry])
    job, file = job_for(system, "n"), system.plan.root / "run.jsonl"
    assert [d.code for d in BACKEND.check(job)] == ["MON107"]
    absent = discharge(system, "n", tmp_path)["low"]
    assert (absent.verdict, "is not here: fetch it first, also in CI" in absent.summary) == (Verdict.NOT_RUN, True)
    file.write_text(line, encoding="utf-8")
    assert [d.code for d in BACKEND.check(job)] == ["MON107"]
    assert discharge(system, "n", tmp_path)["low"].verdict is Verdict.MONITORED
    file.write_text(line * 2, encoding="utf-8")
    assert [d.code for d in BACKEND.check(job)] == ["MON107", "MON102"]
    assert discharge(system, "n", tmp_path)["low"].verdict is Verdict.ERROR


COST = "monitors,WP1,the door\nnone,10,20.0\nnone,10,20.2\nn,10,20.1\nall,11,30.15\nother,1,1\n"


@pytest.mark.parametrize(
    ("table", "told"),
    [
        (COST, ""),
        ("WP1,monitors\n1,none\n", "its first column is `monitors`, each other one a place that the robot reaches"),
        ("monitors,WP1\nall,1\n", "no run without monitors (`none`)"),
        ("monitors,WP1\nnone,nan\n", "'nan' is no number of seconds above 0"),
        ("monitors,WP1\nnone\n", "cost.csv: 1 cells where 2 are wanted"),
        (None, "there is no such file in the system's folder"),
    ],
)
def test_what_monitors_cost_is_shown_as_it_was_measured(
    table: str | None, told: str, make_system: Callable[..., System], tmp_path: Path
) -> None:
    entry = {"data": "cost.csv", "how": "on a bench", "machine": "two cores", "date": "2026-11-22"}
    system = make_system(MONITOR, {"out.v": "data"}, traces=["run.jsonl"], overhead=[entry])
    (system.plan.root / "run.jsonl").write_text('{"topic": "v", "time": 1, "data": 3.5}\n', encoding="utf-8")
    if table is not None:
        (system.plan.root / "cost.csv").write_text(table, encoding="utf-8")
    wrong = [d.message for d in BACKEND.check(job_for(system, "n")) if d.code == "MON108"]
    assert wrong == ([f"overhead: cost.csv: {told}"] if told else [])
    assert system.plan.root / "cost.csv" in BACKEND.files(job_for(system, "n"))
    said = discharge(system, "n", tmp_path)["low"].details.get("overhead")
    assert said == (
        None
        if told
        else "on a bench, on two cores, 2026-11-22: 20.10 s to the door without monitors, the mean of 2 runs; "
        "20.10 s (+0.00 %) with this node's, of 1; on the way +0.00 % WP1; "
        "30.15 s (+50.00 %) with all of them, of 1; on the way +10.00 % WP1"
    )
