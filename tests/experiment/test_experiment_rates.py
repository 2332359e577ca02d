"""From recorded runs to a requirement's failure rate, its gate and its re-check, through the command line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from helpers import avow, some

RCL = """\
node a { inputs( raw : REAL ) outputs( x : REAL ) topics( t/A raw matches(in.raw), t/X x matches(out.x) )
  guarantee keeps "A positive value stays positive" ( in.raw > 0 -> out.x > 0 ) }
node b { inputs( x : REAL ) outputs( y : REAL ) topics( t/X x matches(in.x), t/Y y matches(out.y) )
  guarantee keeps "A positive value stays positive" ( in.x > 0 -> out.y > 0 ) }
node c { inputs( y : REAL ) outputs( z : REAL ) topics( t/Y y matches(in.y), t/Z z matches(out.z) )
  guarantee keeps "A positive value stays positive" ( in.y > 0 -> out.z > 0 ) }
"""
PLAN = """\
system: line
environment: {{a.raw: {{because: nothing is assumed}}}}
policy: {policy}
requirements:
  R: {{text: A positive reading stays positive., formula: "a.raw > 0 -> c.z > 0", supported_by: [a, b, c]}}
compose:
  whole:
    persistence: &said {{because: every topic is latched, says: values stay, who: A. Person, until: 2030-12-31}}
    one_output: *said
nodes:
  a: {{methods: [{{experiment: {{data: a.csv, mapping: {{in.raw: i, out.x: o}}}}}}]}}
  b: {{methods: [{{experiment: {{data: b.csv, mapping: {{in.x: i, out.y: o}}}}}}]}}
  c: {{methods: [{{experiment: {{data: c.csv, mapping: {{in.y: i, out.z: o}}}}}}]}}
"""


def verified(folder: Path, policy: str = "default", runs: int = 34) -> dict[str, Any]:
    place = folder / "contracts/line"
    place.mkdir(parents=True, exist_ok=True)
    (folder / "dodo.py").write_text("")
    (place / "system.rcl").write_text(RCL)
    (place / "plan.yaml").write_text(PLAN.format(policy=policy))
    for node in "abc":
        # runs that do not meet the condition are there too, and count for nothing
        rows = [f"{n},1,{n}" for n in range(1, runs + 1)] + [f"idle{n},-1,-1" for n in range(50)]
        (place / f"{node}.csv").write_text("run,i,o\n" + "\n".join(rows) + "\n")
    avow("verify", cwd=folder)
    found: dict[str, Any] = json.loads((folder / "reports/line/report.json").read_text())
    return found


@pytest.mark.slow
def test_three_sampled_nodes_give_one_rate_at_joint_confidence(tmp_path: Path) -> None:
    case = verified(tmp_path, "{max_failure_rate: {medium: 0.3}}")
    (gate,) = (g for g in case["gates"] if g["id"] == "rates")
    assert not gate["passed"]
    assert "90 %" in gate["reason"]
    rate = case["requirements"][0]["rate"]
    assert [leaf["strata"][0]["trials"] for leaf in rate["leaves"]] == [34, 34, 34]
    assert (rate["bound"], rate["confidence"]) == ("0.25302", "0.85")  # 3 times 8.434 %, at 1 - 3 times 5 %
    done = avow("recheck", "line", "reports/line/report.json", cwd=tmp_path)
    assert done.returncode == 0, done.stdout
    report = tmp_path / "reports/line/report.json"
    report.write_text(report.read_text().replace('"0.25302"', '"0.05302"'))
    done = avow("recheck", "line", "reports/line/report.json", cwd=tmp_path)
    assert done.returncode == 1
    assert "failure rate" in done.stdout


@pytest.mark.slow
def test_runs_that_never_meet_the_condition_leave_the_guarantee_vacuous(tmp_path: Path) -> None:
    case = verified(tmp_path, runs=0)
    found = [o for o in case["obligations"] if o["obligation"]["kind"] == "guarantee"]
    assert [o["status"] for o in found] == ["vacuous"] * 3
    assert case["exit_code"] == 1


STOPS = """\
node brake { inputs( speed : REAL ) outputs( distance : REAL ) topics( t/S speed matches(in.speed) )
  guarantee stops "It stops within its speed" ( in.speed >= 0 -> out.distance <= in.speed ) }
"""
STEPS = "run,v,d\n" + "".join(f"{n},1,{d}\n" for n in range(40) for d in (1, 0.5))
ROWS = "run,v,d\n" + "".join(f"{n},1,1\n" for n in range(40))


@pytest.mark.parametrize(
    ("steps", "formula", "said"),
    some(
        [
            (False, "brake.speed >= 0 -> brake.distance <= brake.speed", "% of steps fail"),
            (True, "brake.speed >= 0 -> brake.distance <= brake.speed", "% of runs fail"),
            (True, "historically(brake.speed >= 0 -> brake.distance <= brake.speed)", "% of runs fail"),
            (False, "historically(brake.speed >= 0 -> brake.distance <= brake.speed)", "brake.stops is a single step"),
            (
                False,
                "5 <= brake.speed <= 6 -> brake.distance <= 6",
                "trials of brake.stops need not meet its condition",
            ),
        ],
        0,
        slow=3,
    ),
)
def test_a_rate_is_of_what_was_tried(tmp_path: Path, steps: bool, formula: str, said: str) -> None:
    place = tmp_path / "contracts/line"
    place.mkdir(parents=True)
    (tmp_path / "dodo.py").write_text("")
    (place / "system.rcl").write_text(STOPS)
    (place / "d.csv").write_text(STEPS if steps else ROWS)
    plan = {
        "environment": {"brake.speed": {"because": "nothing is assumed"}},
        "requirements": {"R": {"text": "It stops.", "formula": formula, "supported_by": ["brake"]}},
        "nodes": {
            "brake": {
                "methods": [
                    {"experiment": {"data": "d.csv", "steps": steps, "mapping": {"in.speed": "v", "out.distance": "d"}}}
                ]
            }
        },
    }
    (place / "plan.yaml").write_text(json.dumps(plan))
    avow("verify", cwd=tmp_path)
    (requirement,) = json.loads((tmp_path / "reports/line/report.json").read_text())["requirements"]
    assert said in requirement["answer"]
