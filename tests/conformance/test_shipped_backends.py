"""Every shipped backend passes the suite that a third party's has to pass."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
import yaml

from avow.backend_kit.registry import installed
from avow.backends.ajpf import BACKEND as AJPF
from avow.backends.dafny import BACKEND as DAFNY
from avow.backends.experiment import BACKEND as EXPERIMENT
from avow.backends.fuzz import BACKEND as FUZZ
from avow.backends.hoare import BACKEND as HOARE
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.backends.onnx import BACKEND as ONNX
from avow.backends.python import BACKEND as PYTHON
from avow.backends.reach import BACKEND as REACH
from avow.backends.review import BACKEND as REVIEW
from avow.backends.review.stamp import stamp
from avow.backends.rosmonitoring import BACKEND as ROSMONITORING
from avow.backends.storm import BACKEND as STORM
from avow.base.verdict import Verdict
from avow.conformance import Conformance, Seeded

CONTRACT = """\
node sensor {
  inputs( r : REAL )
  outputs( high : BOOL )
  topics( p/R r matches(in.r), p/H high matches(out.high) )
  guarantee warns "It warns above 120" ( in.r > 120 -> out.high )
  guarantee calm "It is silent below 10" ( in.r < 10 -> not out.high )
}
"""
SCENARIO = {"scenario": {"domains": {"sensor.r": [0, 5, 125]}, "steps": 3}}


def one_refuted(good: Verdict) -> dict[str, Verdict]:
    return {"warns": Verdict.REFUTED, "calm": good}


def both(good: Verdict) -> dict[str, Verdict]:
    return {"warns": good, "calm": good}


class TestHoare(Conformance):
    backend = HOARE
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"program": "models/sensor.imp"},
            both(Verdict.PROVED),
            {"models/sensor.imp": "IF (r > 100) THEN high := TRUE ELSE high := FALSE\n"},
            SCENARIO,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"program": "models/sensor.imp"},
            one_refuted(Verdict.PROVED),
            {"models/sensor.imp": "IF (r > 121) THEN high := TRUE ELSE high := FALSE\n"},
        ),
    )


STEP = """\
class Node:
    def __init__(self, params):
        self.limit = params["limit"]

    def step(self, r):
        return r > self.limit
"""
DECLARED = {"source": {"python": "src/node.py", "class": "Node", "parameters": "config/node.yaml"}}


@pytest.mark.slow
class TestPython(Conformance):
    backend = PYTHON
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {},
            both(Verdict.PROVED),
            {"src/node.py": STEP, "config/node.yaml": "limit: 100.0\n"},
            SCENARIO,
            DECLARED,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {},
            one_refuted(Verdict.PROVED),
            {"src/node.py": STEP, "config/node.yaml": "limit: 120.5\n"},
            declared=DECLARED,
        ),
    )


ADAPTER = """\
#include "avow_node.hpp"
struct AvowNode {
  double limit;
  explicit AvowNode(const avow::Parameters& given) : limit(given.real("limit")) {}
  void step(const avow::Inputs& in, avow::Outputs& out) { out.truth("high", in.real("r") > limit); }
};
"""
COMPILED = {"source": {"cpp": "src/node.hpp", "parameters": "config/node.yaml"}}


@pytest.mark.nightly
@pytest.mark.slow
class TestFuzz(Conformance):
    backend = FUZZ
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"runs": 300},
            both(Verdict.TESTED),
            {"src/node.hpp": ADAPTER, "config/node.yaml": "limit: 100.0\n"},
            SCENARIO,
            COMPILED,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"runs": 300},
            one_refuted(Verdict.TESTED),
            {"src/node.hpp": ADAPTER, "config/node.yaml": "limit: 120.5\n"},
            declared=COMPILED,
        ),
    )


@pytest.mark.slow
class TestHypothesis(Conformance):
    backend = HYPOTHESIS
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"subject": "models/sensor.py:step", "cases": 40},
            both(Verdict.TESTED),
            {
                "models/sensor.py": "import limit\ndef step(r): return {'high': r > limit.LIMIT}\n",
                "models/limit.py": "LIMIT = 100\n",
            },
            SCENARIO,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"subject": "models/sensor.py:step", "cases": 40},
            one_refuted(Verdict.TESTED),
            {"models/sensor.py": "def step(r):\n    return {'high': False}\n"},
        ),
    )


DAFNY_PROGRAM = """\
include "sensor_spec.dfy"
module {:options "--function-syntax:3"} SensorImpl refines SensorSpec {
  predicate Env(in_r: real) { true }
  lemma EnvNotEmpty() returns (in_r: real) { in_r := 0.0; }
  method Step(in_r: real) returns (out_high: bool) { out_high := in_r > LIMIT; }
}
"""


@pytest.mark.slow
class TestDafny(Conformance):
    backend = DAFNY
    files_name_the_node = True
    never_refutes = True
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"implementation": "sensor.dfy"},
            both(Verdict.PROVED),
            {"sensor.dfy": DAFNY_PROGRAM.replace("LIMIT", "100.0")},
            SCENARIO,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"implementation": "sensor.dfy"},
            {"warns": Verdict.UNKNOWN, "calm": Verdict.PROVED},
            {"sensor.dfy": DAFNY_PROGRAM.replace("LIMIT", "121.0")},
        ),
    )


def trace(*events: tuple[float, bool]) -> str:
    lines = [
        {"topic": topic, "time": at, "data": value}
        for at, pair in enumerate(events)
        for topic, value in zip(("r", "high"), pair, strict=True)
    ]
    return "".join(json.dumps(line) + "\n" for line in lines)


ARRIVAL = {"by": "arrival", "because": "one process writes the trace"}


class TestRosMonitoring(Conformance):
    backend = ROSMONITORING
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"traces": ["run.jsonl"], "answers": ARRIVAL, "mapping": {"in.r": "data", "out.high": "data"}},
            both(Verdict.MONITORED),
            {"run.jsonl": trace((5, False), (50, True), (125, True))},
            SCENARIO,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"traces": ["run.jsonl"], "answers": ARRIVAL, "mapping": {"in.r": "data", "out.high": "data"}},
            one_refuted(Verdict.MONITORED),
            {"run.jsonl": trace((5, False), (125, False))},
        ),
    )


RUNS = "run,rate,alarm\n" + "".join(f"{n},130,yes\ncalm{n},5,no\n" for n in range(40))


class TestExperiment(Conformance):
    backend = EXPERIMENT
    asks_inputs = False
    seeded = (
        Seeded(
            "right",
            CONTRACT,
            {"data": "runs.csv", "mapping": {"in.r": "rate", "out.high": "alarm"}, "at_least": 0.9},
            both(Verdict.TESTED),
            {"runs.csv": RUNS},
            SCENARIO,
        ),
        Seeded(
            "wrong",
            CONTRACT,
            {"data": "runs.csv", "mapping": {"in.r": "rate", "out.high": "alarm"}},
            one_refuted(Verdict.TESTED),
            {"runs.csv": RUNS + "x,130,no\n"},
        ),
    )


BEFORE = (
    "08083a650a120a01780a01770a0162120179220447656d6d12036e65742a0f0801080110014201774a040000803f2a0f080108011001"
    "4201624a04"
)
AFTER = "5a130a0178120e0a0c080112080a0208010a02080162130a0179120e0a0c080112080a0208010a02080142040a00100d"
"""An ONNX model of one Gemm, made with `onnx.helper`, before and after its bias."""


def network(limit: float) -> bytes:
    """``x - limit``."""
    return bytes.fromhex(BEFORE) + struct.pack("<f", -limit) + bytes.fromhex(AFTER)


class TestOnnx(Conformance):
    backend = ONNX
    seeded = tuple(
        Seeded(
            name,
            CONTRACT,
            {
                "network": "net.onnx",
                "inputs": {"in.r": 0},
                "outputs": {"out.high": {"index": 0, "threshold": 0}},
                "box": {"in.r": [0, 500]},
            },
            verdicts,
            {"net.onnx": network(limit)},
            SCENARIO,
        )
        for name, limit, verdicts in (
            ("right", 100.0, both(Verdict.PROVED)),
            ("wrong", 121.0, one_refuted(Verdict.PROVED)),
        )
    )


BRAKE = """\
node brake {
  inputs( a : REAL )
  outputs( x : REAL, v : REAL )
  topics( p/A a matches(in.a), p/X x matches(out.x), p/V v matches(out.v) )
  assume range ( 2 <= in.a and in.a <= 3 )
  guarantee warns "It stops in a metre" ( out.x <= 1.01 )
  guarantee calm "It does not speed up" ( out.v <= 2 )
}
"""


class TestReach(Conformance):
    backend = REACH
    seeded = tuple(
        Seeded(
            name,
            BRAKE,
            {
                kind: {"x": moved, "v": slowed},
                "initial": {"x": 0, "v": [0, 2]},
                "inputs": {"a": "in.a"},
                "outputs": {"out.x": "x", "out.v": "v"},
                **more,
            },
            verdicts,
            plan={"scenario": {"domains": {"brake.a": [2, 3]}, "steps": 3}} if name == "right" else {},
        )
        for name, kind, moved, slowed, more, verdicts in (
            ("right", "ode", "v", "-a", {"horizon": 1.2, "step": 0.05}, both(Verdict.CHECKED)),
            ("wrong", "ode", "v", "-a/2", {"horizon": 1.2, "step": 0.05}, one_refuted(Verdict.CHECKED)),
            ("inductive", "map", "0.9 * x + v / 100", "v/2 - a/100", {}, both(Verdict.PROVED)),
        )
    )


CHAIN = """\
dtmc
module n
  x : [0..2] init 0;
  r : [100..130] init 100;
  [] true -> 0.9 : (x'=1) & (r'=LOW) + 0.1 : (x'=2) & (r'=130);
endmodule
formula high = x = 2;
"""


class TestStorm(Conformance):
    backend = STORM
    seeded = tuple(
        Seeded(
            name,
            CONTRACT,
            {"model": "node.prism", "ports": {"in.r": "r", "out.high": "high"}},
            verdicts,
            {"node.prism": CHAIN.replace("LOW", low)},
            SCENARIO,
        )
        for name, low, verdicts in (
            ("right", "110", both(Verdict.CHECKED)),
            ("wrong", "125", one_refuted(Verdict.CHECKED)),
        )
    )


RECORD = """\
reviewer: Ada
role: engineer
date: 2026-11-20
read: [code.py]
checklist: [{question: "Is it?", answer: yes}]
conclusion: CONCLUSION
"""


def stamped(folder: Path) -> None:
    words = (folder / "system.rcl").read_text().split()
    stamp(folder, words[words.index("node") + 1])


class TestReview(Conformance):
    backend = REVIEW
    seeded = (
        Seeded(
            "accepted",
            CONTRACT,
            {"record": "review.yaml"},
            both(Verdict.REVIEWED),
            {"review.yaml": RECORD.replace("CONCLUSION", "accepted"), "code.py": "pass\n"},
            SCENARIO,
            prepare=stamped,
        ),
        Seeded(
            "rejected",
            CONTRACT,
            {"record": "review.yaml"},
            both(Verdict.REFUTED),
            {"review.yaml": RECORD.replace("CONCLUSION", "rejected"), "code.py": "pass\n"},
            prepare=stamped,
        ),
    )


LIFT = Path(__file__).parents[1] / "ajpf" / "fixtures" / "lift"
LIFT_OPTIONS = yaml.safe_load((LIFT / "plan.yaml").read_text())["nodes"]["cabin"]["methods"][0]["ajpf"]


@pytest.mark.slow
class TestAjpf(Conformance):
    backend = AJPF
    asks_inputs = False
    files_name_the_node = True
    seeded = tuple(
        Seeded(
            name,
            (LIFT / "system.rcl").read_text(),
            LIFT_OPTIONS,
            {"answers": Verdict.CHECKED, "halts": verdict},
            {
                "cabin.gwen": (LIFT / "cabin.gwen").read_text().replace("halt(0)", deed),
                "cabin.yaml": (LIFT / "cabin.yaml").read_text(),
            },
        )
        for name, deed, verdict in (("right", "halt(0)", Verdict.CHECKED), ("wrong", "print(0)", Verdict.REFUTED))
    )


def test_none_is_left_out() -> None:
    held = {cls.backend.name for cls in Conformance.__subclasses__()}
    ours = {name for name, point in installed().items() if point.value.startswith("avow.backends.")}
    assert ours <= held
