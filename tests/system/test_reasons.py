"""A placeholder is no reason, wherever the plan asks for one."""

from __future__ import annotations

from pathlib import Path

import pytest

from avow.base.diagnostics import Rejected
from avow.pipeline.plan_check import of_plan
from avow.system.load import load_system

RCL = """
node n {
  inputs( r : REAL )  outputs( s : REAL )
  topics( std_msgs/Float64 r matches(in.r), std_msgs/Float64 s matches(out.s) )
  guarantee g ( in.r >= 0 -> out.s == 0 )
}
"""
METHOD = "nodes: {n: {methods: [%s]}}"
PLACES = [
    METHOD % "rosmonitoring: {answers: {by: arrival, because: {}}}",
    METHOD % "rosmonitoring: {answers: {by: order, because: {}}}",
    METHOD % "rosmonitoring: {answers: {latency: 10 ms, jitter: 2 ms, because: {}}}",
    METHOD % "experiment: {data: d.csv, left_out: {runs: [1], because: {}}}",
    METHOD % "ajpf: {properties: {p: {psl: a, because: {}}}}",
    "environment: {n.r: {assume: in.r >= 0, because: {}}}",
    "environment: {n.r: {because: {}}}",
    "environment: {n.r: {constant: {because: {}}, because: it is so}}",
    "environment: {n.r: {assume: in.r >= 0, says: {}, because: it is so}}",
    "compose: {D: {entered: {because: {}}}}",
    "requirements: {R: {text: t, formula: TRUE, validation: {who: A B, date: 2026-01-01, because: {}}}}",
]


@pytest.mark.parametrize("place", PLACES)
def test_a_placeholder_is_no_reason(place: str, tmp_path: Path) -> None:
    (tmp_path / "system.rcl").write_text(RCL, encoding="utf-8")

    def told(reason: str) -> list[str]:
        (tmp_path / "plan.yaml").write_text(place.replace("{}", reason), encoding="utf-8")
        try:
            found = of_plan(load_system(tmp_path))
        except Rejected as rejected:
            found = rejected.diagnostics
        return [d.message for d in found if "because" in d.message or "says" in d.message or "answers" in d.message]

    fine = told("one process wrote it")
    for placeholder in ("...", "…", '"-"', '" "', "'?'", "___"):
        assert len(told(placeholder)) > len(fine), (placeholder, fine)
