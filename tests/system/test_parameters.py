"""Parameters of a contract: the value that the plan, a file or a launch file gives, or any that the contract allows."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from helpers import avow

from avow.backend_kit import one_step
from avow.backend_kit.parameters import samples
from avow.backend_kit.protocol import Limits
from avow.backend_kit.registry import backend
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.verdict import Outcome, Verdict
from avow.language.load import check_text
from avow.language.printer import show_term
from avow.language.translate import to_rcl
from avow.pipeline.evidence_keys import surroundings
from avow.pipeline.methods import method_job
from avow.system.load import load_system
from avow.system.plan import System

BRAKE = """
context {{ Mode : {{slow, fast}}; }}
node brake {{
  inputs( distance : REAL, parameter limit : REAL, parameter mode : Mode )
  outputs( stop : BOOL )
  topics( float64 distance matches(in.distance), bool stop matches(out.stop) )
  assume range ( 0.1 <= limit <= 0.5 )
  guarantee near ( distance < limit -> stop )
  guarantee slow ( {slow} )
}}
"""
ONE_STEP = BRAKE.format(slow="mode == fast or distance < limit or not stop")
RUNS = BRAKE.format(slow="rose(stop) -> distance < limit or previous(distance >= limit, TRUE)")
FILE = "/**: {ros__parameters: {limit: 0.4}}\n/left/brake: {ros__parameters: {mode: fast}}\n"
CLASS = """
class Brake:
    def __init__(self, params):
        self.limit, self.slow = params["limit"], params["mode"] == "slow"

    def step(self, distance):
        return distance < self.limit
"""
LAUNCH = """\
<launch><group ns="left"><node name="brake" pkg="p" type="b"><param name="limit" value="0.2"/></node></group></launch>
"""


def make(folder: Path, plan: str, rcl: str = ONE_STEP, files: Mapping[str, str] | None = None) -> System:
    system = folder / "contracts/brake"
    system.mkdir(parents=True, exist_ok=True)
    given = {"../../dodo.py": "", "system.rcl": rcl, "plan.yaml": plan, "p.yaml": FILE, "b.py": CLASS}
    given |= {"twice.yaml": "lim: {it: 0.3}\nlim_it: 0.4\n", "huge.yaml": f"limit: 1{'0' * 400}\n", "n.py": NODE}
    for name, text in ({"../../b.launch": LAUNCH} | given | (files or {})).items():
        (system / name).write_text(text, encoding="utf-8")
    return load_system(system)


def wrong(folder: Path, plan: str, rcl: str = ONE_STEP) -> list[Diagnostic]:
    with pytest.raises(Rejected) as rejected:
        make(folder, plan, rcl)
    return list(rejected.value.diagnostics)


SOURCE = "source: {python: b.py, class: Brake, parameters: p.yaml}"
NODE = """from rclpy.node import Node
class Brake(Node):
    def __init__(self):
        self.declare_parameters("", [("limit", 0.3)])
"""
OWN = "source: {python: n.py, class: Brake, kind: rclpy}"
STARTED = "ros: {launch: [../../b.launch], nodes: {brake: {name: /left/brake}}}"


@pytest.mark.parametrize(
    ("plan", "limit", "mode"),
    [
        ("{}", "", ""),
        ("nodes: {brake: {parameters: {limit: 0.4}}}", "0.4", ""),
        ("nodes: {brake: {parameters: {limit: 0.4, mode: slow}}}", "0.4", "slow"),
        (f"nodes: {{brake: {{numbers: exact, {SOURCE}}}}}", "0.4", ""),
        (
            f"nodes: {{brake: {{numbers: exact, {SOURCE}}}}}\nros: {{nodes: {{brake: {{name: /left/brake}}}}}}",
            "0.4",
            "fast",
        ),
        (STARTED, "0.2", ""),
        (f"nodes: {{brake: {{numbers: exact, {OWN}}}}}", "0.3", ""),
        (f"nodes: {{brake: {{numbers: exact, parameters: {{limit: 0.4}}, {OWN}}}}}", "0.4", ""),
        (f"{STARTED}\nnodes: {{brake: {{numbers: exact, {OWN}}}}}", "0.2", ""),
        (f"{STARTED}\nnodes: {{brake: {{numbers: exact, source: {{python: b.py, class: Brake}}}}}}", "0.2", ""),
    ],
)
def test_values_come_from_plan_file_and_launch(tmp_path: Path, plan: str, limit: str, mode: str) -> None:
    (node,) = make(tmp_path, plan).contract.nodes
    assert [p.name for p in node.parameters] == [name for name, v in (("limit", limit), ("mode", mode)) if not v]
    assert {p.name: show_term(p.value, "rcl") for p in node.fixed if p.value} == {
        name: value for name, value in (("limit", limit), ("mode", mode)) if value
    }
    assert show_term(node.clause("near").formula, "rcl") == f"in.distance < {limit or 'in.limit'} -> out.stop"
    assert [c.name for c in node.assumptions] == [] if limit else ["range"]


@pytest.mark.parametrize(
    ("plan", "words", "line"),
    [
        ("nodes: {brake: {parameters: {limit: 0.7}}}", "excludes", 7),
        (
            "nodes: {brake: {parameters: {limit: yes please}}}",
            "is of type REAL, and the plan sets it to 'yes please'",
            1,
        ),
        ("nodes: {brake: {parameters: {limit: true}}}", "is of type REAL", 1),
        ("nodes: {brake: {parameters: {mode: medium}}}", "is of type Mode", 1),
        ("nodes: {brake: {parameters: {limt: 0.2}}}", "no parameter 'limt'", 1),
        ("nodes: {brake: {parameters: {limt: 0.2}, source: {cpp: brake.hpp}}}", "no parameter 'limt'", 1),
        (
            f"{STARTED}\nnodes: {{brake: {{parameters: {{limit: 0.3}}}}}}",
            "the plan sets it to 0.3; b.launch:1 sets it to 0.2",
            2,
        ),
        (
            f"nodes: {{brake: {{parameters: {{limit: 0.3}}, {SOURCE}}}}}",
            "the plan sets it to 0.3; p.yaml sets it to 0.4",
            1,
        ),
        (
            f"nodes: {{brake: {{{SOURCE.replace('p.yaml', 'twice.yaml')}}}}}",
            "twice.yaml sets it to 0.3; twice.yaml sets it to 0.4",
            1,
        ),
        (f"nodes: {{brake: {{{SOURCE.replace('p.yaml', 'huge.yaml')}}}}}", "is of type REAL, and huge.yaml", 1),
        ("connections: [{from: brake.stop, to: brake.limit}]", "brake.limit", 1),
    ],
)
def test_values_that_cannot_be(tmp_path: Path, plan: str, words: str, line: int) -> None:
    rcl = ONE_STEP.replace("limit", "lim_it") if "twice" in plan else ONE_STEP
    (found,) = [d for d in wrong(tmp_path, plan, rcl) if d.code in ("PLAN139", "PLAN106")]
    assert words in found.message
    assert found.span is not None
    assert found.span.line == line


@pytest.mark.parametrize(("value", "faults"), [("0.3", []), ("0.2", ["PLAN139"])])
@pytest.mark.parametrize("by", ["plan", "launch"])
def test_an_included_system_has_given_a_value(tmp_path: Path, value: str, faults: list[str], by: str) -> None:
    make(tmp_path, "nodes: {brake: {parameters: {limit: 0.3}}}")
    whole = tmp_path / "contracts/whole"
    whole.mkdir()
    (whole / "w.rcl").write_text("node w { inputs() outputs( w : BOOL ) topics() guarantee ( w ) }")
    given = f"nodes: {{b_brake: {{parameters: {{limit: {value}}}}}}}"
    if by == "launch":
        (whole / "w.launch").write_text(LAUNCH.replace("0.2", value))
        given = "ros: {launch: [w.launch], nodes: {b_brake: {name: /left/brake}}}"
    (whole / "plan.yaml").write_text(f"subsystems: {{b: {{system: ../brake}}}}\n{given}\n")
    found: list[Diagnostic] = []
    try:
        load_system(whole)
    except Rejected as rejected:
        found += rejected.diagnostics
    assert [d.code for d in found] == faults, found  # not also that the included node is unknown
    assert all(d.span is not None for d in found)


@pytest.mark.parametrize(
    ("declared", "launch", "limit"),
    [
        ('"", [("limit", 0.7)]', "", "excluded"),
        ('"", [("limit", 0.2)]', '<param name="limit" value="$(arg unknown)"/>', ""),  # it may set another
        ('"front", [("limit", 0.2)]', "", ""),  # the parameter front.limit
        ('"", [("limit", Parameter.Type.DOUBLE)]', "", ""),
    ],
)
def test_the_default_of_a_class_is_the_last_source(tmp_path: Path, declared: str, launch: str, limit: str) -> None:
    started = f'<launch><group ns="left"><node name="brake" pkg="p" type="b">{launch}</node></group></launch>'
    files = {"n.py": NODE.replace('"", [("limit", 0.3)]', declared), "../../b.launch": started}
    try:
        (node,) = make(tmp_path, f"{STARTED}\nnodes: {{brake: {{{OWN}}}}}", files=files).contract.nodes
        assert not limit
    except Rejected as rejected:
        (found,) = rejected.diagnostics
        assert limit == "excluded"
        assert found.code == "PLAN139"
        assert [span.line for _, span in found.notes if span is not None] == [4]
        return
    assert [port.name for port in node.parameters] == ["limit", "mode"]


def test_an_output_of_its_name_does_not_feed_it(tmp_path: Path) -> None:
    other = "node planner { inputs() outputs( limit : REAL ) topics() guarantee ( out.limit > 9 ) }"
    system = make(tmp_path, "{}", ONE_STEP + other)
    assert [entry.port for entry in system.plan.environment if entry.constant] == ["brake.limit", "brake.mode"]
    told = avow("compose", str(tmp_path / "contracts/brake"), cwd=tmp_path).stdout
    assert "follows from environment brake.limit" in " ".join(told.split())


REQUIRED = """
requirements:
  CLOSE: {text: a, formula: "brake.distance < 0.1 -> brake.stop", supported_by: [brake]}
  FAR: {text: b, formula: "brake.distance < 0.3 -> brake.stop", supported_by: [brake]}
  KEPT: {text: c, formula: "previous(brake.limit, 0.2) == brake.limit or brake.distance > 0", supported_by: [brake]}
  MOVED: {text: d, formula: "changed(brake.distance) -> brake.limit > 0.3", supported_by: [brake]}
"""


@pytest.mark.slow
@pytest.mark.parametrize("rcl", [ONE_STEP, RUNS], ids=["one step", "runs"])
@pytest.mark.parametrize(
    ("given", "verdicts"),
    [
        ("", "proved refuted refuted refuted"),
        ("0.3", "proved proved refuted refuted"),
        ("0.4", "proved proved refuted proved"),
    ],
)
def test_what_is_proved_of_the_whole(tmp_path: Path, rcl: str, given: str, verdicts: str) -> None:
    """It holds for each allowed value without one in the plan, and for that value with one."""
    nodes = f"nodes: {{brake: {{parameters: {{limit: {given}}}}}}}" if given else ""
    make(tmp_path, REQUIRED + nodes, rcl)
    told = avow("compose", str(tmp_path / "contracts/brake"), cwd=tmp_path).stdout
    lines = {line.split()[1].strip(":"): line.split()[0] for line in told.splitlines() if ": " in line}
    assert [lines[name] for name in ("CLOSE", "FAR", "KEPT", "MOVED")] == verdicts.split()


def test_it_keeps_its_value_during_a_run(tmp_path: Path) -> None:
    plan = """
requirements: {R: {text: a, formula: "previous(brake.limit, brake.limit) == brake.limit", supported_by: [brake]}}
"""
    make(tmp_path, plan)
    assert "proved    R:" in avow("compose", str(tmp_path / "contracts/brake"), cwd=tmp_path).stdout
    make(tmp_path, plan, ONE_STEP.replace("parameter limit", "limit"))
    assert "refuted   R:" in avow("compose", str(tmp_path / "contracts/brake"), cwd=tmp_path).stdout


def test_it_is_printed_and_read_back() -> None:
    contract, found = check_text(RUNS, "f.rcl")
    assert contract is not None, found
    assert [c.name for c in contract.nodes[0].assumptions] == ["range", "limit_constant", "mode_constant"]
    assert check_text(to_rcl(contract), "f.rcl")[0] == contract


def test_the_values_that_are_tried(tmp_path: Path) -> None:
    (node,) = make(tmp_path, "{}").contract.nodes
    tried = [[show_term(p.value, "rcl")[:3] for p in fixed if p.value] for fixed in samples(node)]
    assert (tried[0], tried[-1]) == (["0.1", "slo"], ["0.5", "fas"])


METHOD = "nodes: {{brake: {{source: {{python: b.py, class: Brake}}, {}, methods: [{}]}}}}"
FAULTS = {"": "", "far": "min(self.limit, 0.45)", "near": "self.limit - 0.01"}


@pytest.mark.slow
@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("method", ["hypothesis", "python"])
@pytest.mark.parametrize("value", ["", "limit: 0.2"])
def test_a_class_is_made_with_it(tmp_path: Path, method: str, fault: str, value: str) -> None:
    """Once for each of some allowed values, or with the plan's."""
    text = CLASS.replace("< self.limit", f"< {FAULTS[fault]}") if fault else CLASS
    plan = METHOD.format(f"parameters: {{mode: fast, {value}}}", f"{{{method}: {{guarantees: [near]}}}}")
    outcome = discharged(tmp_path, plan, text)
    wrong = fault == "near" or (fault == "far" and not value)
    good = Verdict.PROVED if method == "python" and value else Verdict.TESTED
    assert outcome.verdict is (Verdict.REFUTED if wrong else good), outcome.summary
    if wrong and not value:
        assert outcome.counterexample is not None
        assert "in.limit" in dict(outcome.counterexample.values)


@pytest.mark.slow
@pytest.mark.parametrize("value", ["", "limit: 0.2"])
@pytest.mark.parametrize("limit", ["limit", "limit - 0.01"])
def test_a_function_or_a_program_reads_it(tmp_path: Path, value: str, limit: str) -> None:
    imp = f"IF (distance < {limit}) THEN\n   stop := TRUE\nELSE\n   stop := FALSE\n"
    python = f"def step(distance, limit):\n    return distance < {limit}\n"
    for method, good in (
        ('hypothesis: {subject: "f.py:step", guarantees: [near]}', Verdict.TESTED),
        ("hoare: {program: f.imp, guarantees: [near]}", Verdict.PROVED),
    ):
        plan = f"nodes: {{brake: {{parameters: {{{value}}}, methods: [{{{method}}}]}}}}"
        found = discharged(tmp_path, plan, files={"f.imp": imp, "f.py": python})
        assert found.verdict is (good if limit == "limit" else Verdict.REFUTED), found.summary


def test_a_monitor_needs_its_value(tmp_path: Path) -> None:
    events = '{"topic": "/distance", "time": 1, "data": 0.3}\n{"topic": "/stop", "time": 1.1, "data": false}\n'
    method = "rosmonitoring: {traces: [t.jsonl], guarantees: [near], answers: {by: arrival, because: it is quick}}"
    for value, verdict in (("", "unknown"), ("limit: 0.2", "monitored"), ("limit: 0.4", "refuted")):
        plan = f"nodes: {{brake: {{parameters: {{{value}}}, methods: [{{{method}}}]}}}}"
        found = discharged(tmp_path, plan, files={"t.jsonl": events})
        assert found.verdict.value == verdict, found.summary


def discharged(folder: Path, plan: str, text: str = CLASS, files: Mapping[str, str] | None = None) -> Outcome:
    system = make(folder, plan, files={"b.py": text, **(files or {})})
    (method,) = system.plan.nodes[0].methods
    tool, job = backend(method.backend), method_job(system, system.contract.nodes[0], method)
    (outcome,) = [o for o in one_step.discharge(tool, job, folder, Limits()).outcomes if o.obligation.endswith("near")]
    return outcome


def test_a_value_is_in_the_key(tmp_path: Path) -> None:
    keys = set()
    for value in ("", "limit: 0.2", "limit: 0.3"):
        system = make(tmp_path, METHOD.format(f"parameters: {{{value}}}", "hypothesis"))
        (method,) = system.plan.nodes[0].methods
        keys.add(surroundings(backend("hypothesis"), method_job(system, system.contract.nodes[0], method), ""))
    assert len(keys) == 3
