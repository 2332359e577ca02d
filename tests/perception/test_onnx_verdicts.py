"""Verdicts of networks: intervals and Marabou against onnxruntime, blind spots, and what is refused."""

from __future__ import annotations

import random
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from helpers import avow
from perception.networks import drawn, graph, network, onnx, warner

from avow.backend_kit.protocol import Limits, Report
from avow.backends.onnx import BACKEND
from avow.backends.onnx import marabou as marabou_module
from avow.backends.onnx.cases import Affine, Constraint, Side
from avow.backends.onnx.intervals import bounds
from avow.backends.onnx.marabou import ask
from avow.backends.onnx.options import Given
from avow.backends.onnx.reading import Network, Sum, read_network
from avow.backends.onnx.running import Runtime
from avow.base.diagnostics import Rejected
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import Seeded, settle

TYPES = "context { Kind : {person, other}; }\n"
NODE = """\
node detector {{
  inputs( x : REAL, y : REAL )
  outputs( z : REAL, kind : Kind, near : BOOL )
  topics()
  assume range ( 0 <= in.x and in.x <= 10 and 0 <= in.y and in.y <= 10 )
  guarantee g ( {} )
}}
"""
TWO = {
    "network": "net.onnx",
    "inputs": {"in.x": 0, "in.y": 1},
    "outputs": {"out.z": 0, "out.kind": {"argmax": ["person", "other"]}, "out.near": {"index": 1, "threshold": 1}},
}
IDENTITY = network(([[1.0, 0.0], [0.0, 1.0]], [0.0, 0.0]))
TENT = network(([[1.0], [1.0], [1.0]], [-4.0, -5.0, -6.0]), ([[1.0, -2.0, 1.0]], [0.0]))
"""1 at 5, 0 below 4 and above 6: the sum of its intervals is far from that."""


def judged(folder: Path, formula: str, net: bytes, contract: str = NODE, **options: Any) -> Outcome:
    (outcome,) = run(folder, formula, net, contract, **options).outcomes
    return outcome


def run(folder: Path, formula: str, net: bytes, contract: str, **options: Any) -> Report:
    case = Seeded("n", TYPES + contract.format(formula), {**TWO, **options}, {"g": Verdict.UNKNOWN}, {"net.onnx": net})
    job = case.written(BACKEND, folder / "system")
    assert not BACKEND.check(job)
    return settle(BACKEND, job, folder / "made", Limits())


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("abs(out.z - in.x) <= 1/100", Verdict.PROVED),
        ("out.z < in.x", Verdict.REFUTED),
        ("out.z != in.x", Verdict.REFUTED),
        ("abs(in.x - 5) <= 1 -> 3.9 <= out.z and out.z <= 6.1", Verdict.PROVED),
        ("abs(in.x - 5) <= 1 -> 4 < out.z and out.z <= 6", Verdict.REFUTED),
        ("in.x > in.y + 1/2 -> out.kind in {person}", Verdict.PROVED),
        ("in.x + 1 > in.y -> out.kind == person", Verdict.REFUTED),
        ("(in.y >= 1.1 -> out.near) and (in.y <= 0.9 -> not out.near)", Verdict.PROVED),
        ("out.near <=> in.y > 1", Verdict.REFUTED),
        ("not (out.near and max(in.x, in.y) < 0.9)", Verdict.PROVED),
        ("(if out.near then out.z else 0) <= 9", Verdict.REFUTED),
        ("2 * out.z - in.x / 2 <= 15", Verdict.PROVED),
    ],
)
def test_formulas(formula: str, expected: Verdict, tmp_path: Path) -> None:
    assert judged(tmp_path, formula, IDENTITY).verdict is expected


def test_what_intervals_leave_is_for_marabou(tmp_path: Path) -> None:
    found = judged(tmp_path, "out.z <= 3/2", TENT, ONE, **ONE_OPTIONS)
    assert found.verdict is Verdict.PROVED
    assert found.details["by Marabou"] == 1
    assert any("Marabou" in text for text in found.hypotheses)
    assert any("float32" in text and "sampled points" in text for text in found.hypotheses)


ONE = """\
node detector {{
  inputs( x : REAL ) outputs( z : REAL ) topics()
  assume range ( 0 <= in.x and in.x <= 10 )
  guarantee g ( {} )
}}
"""
ONE_OPTIONS: dict[str, Any] = {"inputs": {"in.x": 0}, "outputs": {"out.z": 0}}


@pytest.mark.parametrize(
    ("formula", "shown"), [("out.z < 1/20", "0.1"), ("10 * out.z <= 1", "0.100000001490116119384765625")]
)
def test_a_counterexample_is_one_as_it_is_shown(formula: str, shown: str, tmp_path: Path) -> None:
    found = judged(tmp_path, formula, network(([[0.0]], [0.1])), ONE, **ONE_OPTIONS)
    assert found.verdict is Verdict.REFUTED
    assert found.counterexample is not None
    assert dict(found.counterexample.values)["out.z"] == shown


@pytest.mark.parametrize("width", [2.0, 0.001])
def test_a_blind_spot_is_found_and_named(width: float, tmp_path: Path) -> None:
    """1 everywhere but about 5: no drawn point falls into the narrow one."""
    rows = [[1 / width]] * 3
    spot = network((rows, [-(5 - width) / width, -5 / width, -(5 + width) / width]), ([[-1.0, 2.0, -1.0]], [1.0]))
    found = judged(tmp_path, "out.z > 1/4", spot, ONE, **ONE_OPTIONS)
    assert found.verdict is Verdict.REFUTED
    assert found.counterexample is not None
    values = dict(found.counterexample.values)
    assert abs(float(values["in.x"]) - 5) <= width
    assert float(values["out.z"]) <= 0.25


def test_a_counterexample_that_does_not_replay_is_unknown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("avow.backends.onnx.settle.ask", lambda *_: ("sat", (1.0,)))
    found = judged(tmp_path, "out.z <= 3/2", TENT, ONE, **ONE_OPTIONS)
    assert found.verdict is Verdict.UNKNOWN
    assert "does not confirm" in found.summary


def test_a_fault_of_the_reader_is_no_proof(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    read = read_network

    def wrong(path: Path) -> Any:
        found = read(path)
        return replace(found, neurons=(*found.neurons[:-1], replace(found.neurons[-1], bias=-1.0)))

    monkeypatch.setattr("avow.backends.onnx.options.read_network", wrong)
    assert judged(tmp_path, "out.z <= 3/2", TENT, ONE, **ONE_OPTIONS).verdict is Verdict.ERROR


STRAIGHT = network(([[1.0]], [0.0]))
SCALED = {"inputs": {"in.x": {"index": 0, "scale": 10, "offset": 1}}, "outputs": {"out.z": {"index": 0, "scale": 2}}}


def test_scales_and_a_box(tmp_path: Path) -> None:
    found = judged(
        tmp_path / "1",
        "abs(out.z - 20 * in.x - 2) <= 1/100 and out.z <= 22.1",
        STRAIGHT,
        ONE,
        **SCALED,
        box={"in.x": [0, 1]},
    )
    assert found.verdict is Verdict.PROVED
    assert [h.name for h in found.rests_on] == ["detector/assumption/box"]
    assert judged(tmp_path / "2", "out.z <= 22.1", STRAIGHT, ONE, **SCALED).verdict is Verdict.REFUTED


def test_the_range_of_the_training_data_is_a_box(tmp_path: Path) -> None:
    for greatest, verdict in (("1", Verdict.PROVED), ("1.1", Verdict.REFUTED)):
        (tmp_path / greatest / "system").mkdir(parents=True)
        (tmp_path / greatest / "system/seen.csv").write_text(f"run,x\n1,0.25\n2,{greatest}\n3,0\n")
        box = {"in.x": {"data": "seen.csv", "column": "x"}}
        found = judged(tmp_path / greatest, "out.z <= 22.1", STRAIGHT, ONE, **SCALED, box=box)
        assert found.verdict is verdict
        assert verdict is Verdict.REFUTED or [h.text for h in found.rests_on] == ["the plan's box: 0 <= in.x <= 1"]


def test_a_port_without_bounds_is_named(tmp_path: Path) -> None:
    found = judged(tmp_path, "out.z <= 3", STRAIGHT, ONE.replace("0 <= in.x and ", ""), **ONE_OPTIONS)
    assert found.verdict is Verdict.UNKNOWN
    assert "in.x has no bounds" in found.summary


def test_a_record_has_a_list_of_indices(tmp_path: Path) -> None:
    contract = ONE.replace("x : REAL", "p : [a, b : REAL]").replace("0 <= in.x and in.x <= 10", BOXED)
    options = {"inputs": {"in.p": [1, 0]}, "outputs": {"out.z": 0}}
    assert (
        judged(tmp_path / "1", "abs(out.z - in.p.b) < 1/100", IDENTITY, contract, **options).verdict is Verdict.PROVED
    )
    found = judged(tmp_path / "2", "out.z == in.p.a", IDENTITY, contract, **options)
    assert found.verdict is Verdict.REFUTED


BOXED = "0 <= in.p.a and in.p.a <= 1 and 2 <= in.p.b and in.p.b <= 3"


def test_what_is_impossible_is_vacuous(tmp_path: Path) -> None:
    assert judged(tmp_path, "in.x > 11 -> out.z > 100", IDENTITY).vacuous


@pytest.mark.parametrize("formula", ["in.x * out.z >= 0", "out.z >= in.x * in.x"])
def test_what_is_not_linear_is_unknown(formula: str, tmp_path: Path) -> None:
    found = judged(tmp_path, formula, IDENTITY)
    assert found.verdict is Verdict.UNKNOWN
    assert "not linear" in found.summary
    assert "connect its ports, or write sums" in found.summary


# -- the file ----------------------------------------------------------------------------------------------------------


def test_operators_as_in_onnxruntime(tmp_path: Path) -> None:
    import numpy as np

    draw = np.random.default_rng(1)

    def constant(name: str, *shape: int) -> Any:
        return onnx.numpy_helper.from_array(draw.normal(size=shape).astype(np.float32), name)

    make = onnx.helper.make_node
    to = onnx.numpy_helper.from_array(np.array([0, -1], dtype=np.int64), "to")
    nodes = [
        make("Conv", ["in", "k", "c"], ["conv"], pads=[1, 0, 1, 1], strides=[2, 1], dilations=[1, 2]),
        make("Relu", ["conv"], ["r"]),
        make("Flatten", ["r"], ["f"]),
        make("MatMul", ["f", "m"], ["mm"]),
        make("Add", ["mm", "a"], ["added"]),
        make("Add", ["added", "mm"], ["twice"]),
        make("Reshape", ["twice", "to"], ["shaped"]),
        make("Identity", ["shaped"], ["same"]),
        make("Gemm", ["same", "g", "h"], ["out"], transB=1, alpha=0.5, beta=2.0),
    ]
    constants = [constant("k", 2, 1, 2, 2), constant("c", 2), constant("m", 24, 3), constant("a", 3)]
    constants += [constant("g", 2, 3), constant("h", 1, 2), to]
    path = tmp_path / "net.onnx"
    path.write_bytes(graph(nodes, constants, ["n", 1, 5, 5], "out"))
    found = read_network(path)
    runtime = Runtime(path, Given(found, {}, {}, (), ""))
    for _ in range(20):
        assert runtime.compare(tuple(draw.normal(size=25).astype(np.float32).tolist()))
    assert runtime.difference < 1e-4


def test_a_parameter_is_no_input_of_the_network(tmp_path: Path) -> None:
    """Neither before the plan gives it a value, nor after."""
    (tmp_path / "net.onnx").write_bytes(IDENTITY)
    (tmp_path / "system.rcl").write_text(
        "node d { inputs( x : REAL, parameter limit : REAL ) outputs( z : REAL ) topics() "
        "guarantee g ( out.z <= in.limit + in.x ) }"
    )
    onnx = "methods: [{onnx: {network: net.onnx, inputs: {in.x: 0, in.limit: 1}, outputs: {out.z: 0}}}]"
    for given, told in (
        ("", "onnx needs a value of limit: write it under nodes.d.parameters"),
        ("parameters: {limit: 3}, ", "leave it out here, or declare it without `parameter`"),
    ):
        (tmp_path / "plan.yaml").write_text(f"nodes: {{d: {{{given}{onnx}}}}}\n")
        assert told in avow("check", str(tmp_path), cwd=tmp_path).stdout


def test_each_fault_is_reported(tmp_path: Path) -> None:
    sigmoid = graph([onnx.helper.make_node("Sigmoid", ["in"], ["out"], name="last")], [], [1, 2], "out")
    wrong = {
        "inputs": {"in.x": 0, "in.q": 1, "in.y": 0},
        "outputs": {"out.z": {"index": 0, "threshold": 1}, "out.kind": {"argmax": ["person", "pet"]}},
        "box": {"in.x": [2, 1]},
    }
    case = Seeded("n", TYPES + NODE.format("out.z > 0"), {**TWO, **wrong}, {"g": Verdict.ERROR}, {"net.onnx": sigmoid})
    job = case.written(BACKEND, tmp_path)
    found = BACKEND.check(job)
    assert [d.code for d in found] == ["ONNX112", *["ONNX103"] * 5]
    assert "Sigmoid of 'last'" in found[0].message
    assert all(d.span is not None for d in found)
    (tmp_path / "net.onnx").write_bytes(IDENTITY)
    job = replace(case, options={**TWO, "inputs": {"in.x": 0, "in.y": 7}}).written(BACKEND, tmp_path / "other")
    (tmp_path / "other" / "net.onnx").write_bytes(IDENTITY)
    assert [d.message for d in BACKEND.check(job)] == [
        "the network has 2 inputs, and none of index 7",
        "no port gives the network's inputs 1",
    ]


def test_broken_files(tmp_path: Path) -> None:
    """Each file cut anywhere, and with a byte changed, is read or refused: nothing raises."""
    draw, found = random.Random(1), set()
    make = onnx.helper.make_node
    odd = graph([make("MatMul", ["in", "in"], ["out"])], [], [2, 2], "out")
    for data in (warner(1.0), odd):
        for _ in range(80):
            at = draw.randrange(len(data))
            cut = data[:at] if draw.random() < 0.3 else data[:at] + bytes([draw.randrange(256)]) + data[at + 1 :]
            (tmp_path / "net.onnx").write_bytes(cut)
            try:
                read_network(tmp_path / "net.onnx")
            except Rejected as error:
                found |= {d.code for d in error.diagnostics}
    assert {"ONNX111", "ONNX113"} <= found


@pytest.mark.slow
@pytest.mark.parametrize(
    ("formula", "proved"),
    [("out.z <= 3/2", True), ("out.z <= 1/2", False), ("out.z - in.x <= 3", True), ("out.z - in.x <= -5", False)],
)
def test_exported_queries_in_marabous_own_reader(formula: str, proved: bool, tmp_path: Path) -> None:
    """The command of the index, with the same answer; Marabou then reads network and query itself."""
    case = Seeded("n", ONE.format(formula), {**TWO, **ONE_OPTIONS}, {"g": Verdict.UNKNOWN}, {"net.onnx": TENT})
    job = case.written(BACKEND, tmp_path / "system")
    files = BACKEND.export(job)
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    found = BACKEND.outside_checks(job, tmp_path, tuple(files))
    line = "from maraboupy.MarabouMain import main; main()"
    said = [
        subprocess.run([sys.executable, "-c", line, *check.command[1:]], capture_output=True, text=True, check=True)
        for check in found
    ]
    assert said
    assert all("unsat" in one.stdout.splitlines() for one in said) == proved


def test_a_query_with_coefficients_has_no_command(tmp_path: Path) -> None:
    case = Seeded(
        "n", ONE.format("2 * out.z <= in.x + 3"), {**TWO, **ONE_OPTIONS}, {"g": Verdict.UNKNOWN}, {"net.onnx": TENT}
    )
    job = case.written(BACKEND, tmp_path)
    (text,) = BACKEND.export(job).values()
    assert "(assert (<= (+ (* -1.0 Y_0) (* 0.5 X_0)) -1.5))" in text
    assert list(BACKEND.outside_checks(job, tmp_path, ("g-1.vnnlib",))) == []


def test_without_the_extra_it_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.metadata import PackageNotFoundError

    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("avow.base.tools.package_version", missing)
    found = judged(tmp_path, "out.z == in.x", IDENTITY)
    assert found.verdict is Verdict.NOT_RUN
    assert "pip install 'avow[perception]'" in found.summary


def test_the_tools_do_their_one_line_job() -> None:
    assert [tool.trial() for tool in BACKEND.tools() if tool.trial] == ["", ""]


def exact(net: Network, point: list[Fraction]) -> list[Fraction]:
    """Of the inputs, then of the neurons."""
    found = list(point)
    for neuron in net.neurons:
        if isinstance(neuron, Sum):
            parts = (Fraction(w) * found[k] for k, w in zip(neuron.of, neuron.weights, strict=True))
            found.append(sum(parts, Fraction(neuron.bias)))
        else:
            found.append(max(Fraction(0), found[neuron.of]))
    return found


def test_bounds_hold_in_exact_arithmetic(tmp_path: Path) -> None:
    """The box is one point: then the bounds are as tight as rounding lets them be, and contain the exact value."""
    draw = random.Random(7)
    for _ in range(40):
        (tmp_path / "net.onnx").write_bytes(drawn(draw, 3, 5, 2))
        net = read_network(tmp_path / "net.onnx")
        point = [Fraction(draw.uniform(-3, 3)) / 3 for _ in range(3)]
        known = bounds(net, tuple((Side(x, False), Side(x, False)) for x in point))
        assert all(low <= x <= high for x, (low, high) in zip(exact(net, point), known, strict=True))
        assert all(high - low < 1e-12 for low, high in known)


# -- against onnxruntime -----------------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_verdicts_against_points(seed: int, tmp_path: Path) -> None:
    """The limit is about the greatest of 10 000 outputs: what is proved holds at each of them."""
    import numpy as np
    import onnxruntime

    draw = random.Random(100 + seed)
    net = drawn(draw, 2, 5, 5, 2)
    session = onnxruntime.InferenceSession(net)
    points = np.random.default_rng(seed).uniform(0, 10, (10_000, 1, 2)).astype(np.float32)
    greatest = max(float(session.run(None, {"in": point})[0][0, 0]) for point in points)
    limit = greatest + draw.choice((-0.5, -0.01, 0.5, 5.0))
    verdict = judged(tmp_path, f"out.z <= 0 + ({limit:.6f})", net).verdict
    assert verdict is not Verdict.PROVED or greatest <= limit + 1e-4
    assert verdict is Verdict.REFUTED or greatest <= limit
    if limit > greatest + 4:
        assert verdict is Verdict.PROVED


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_bounds_and_marabou_against_points(seed: int, tmp_path: Path) -> None:
    """No output of 25 000 points leaves the intervals; Marabou's `unsat` above the greatest output, and `sat` below."""
    import numpy as np
    import onnxruntime

    draw = random.Random(seed)
    path = tmp_path / "net.onnx"
    path.write_bytes(drawn(draw, 3, 6, 6, 1))
    net = read_network(path)
    side = Side(Fraction(1), False)
    within = ((Side(Fraction(-1), False), side),) * 3
    known = bounds(net, within)
    session = onnxruntime.InferenceSession(path.read_bytes())
    points = np.random.default_rng(seed).uniform(-1, 1, (25_000, 1, 3)).astype(np.float32)
    points[::2] = np.sign(points[::2])
    outputs = [float(session.run(None, {"in": point})[0][0, 0]) for point in points]
    low, high = known[net.outputs[0]]
    assert low - 1e-4 <= min(outputs)
    assert max(outputs) <= high + 1e-4

    def above(limit: float) -> str:
        left = Affine({("Y", 0): Fraction(-1)}, Fraction(limit))
        return ask(net, (Constraint(left),), known, 60.0)[0]

    greatest = max(outputs)
    assert above(greatest - 0.01) == "sat"
    least = next(limit for limit in np.linspace(greatest, high + 0.1, 50) if above(float(limit)) == "unsat")
    word, point = marabou_module.ask(
        net,
        (Constraint(Affine({("Y", 0): Fraction(-1)}, Fraction(float(least) - (high + 0.1 - greatest) / 49))),),
        known,
        60.0,
    )
    if word == "sat":  # its point does reach what it says
        tensor = np.array([point], dtype=np.float32)
        assert float(session.run(None, {"in": tensor})[0][0, 0]) >= float(least) - (high + 0.1 - greatest) / 49 - 1e-3
