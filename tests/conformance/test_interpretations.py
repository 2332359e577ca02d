"""A node's relation that the plan's scenario interprets: whoever reads it takes the same table."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Job
from avow.backends.ajpf.mapping import Decider
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.backends.rosmonitoring.options import usable
from avow.backends.rosmonitoring.rules import Constant
from avow.calculus.scenario import world
from avow.calculus.variables import frame
from avow.formulas.finite import interpretation
from avow.formulas.values import FunctionValue
from avow.pipeline.methods import method_job
from avow.system.load import load_system

RCL = """
node {name} {{ inputs( f : NATURAL --> BOOL ) outputs( a : BOOL ) topics( bool heard matches(out.a) )
    guarantee g ( out.a ) }}
"""
PLAN = """
scenario:
  all: all.csv
  own: own.csv
  interpret: {{{said}}}
nodes: {{{name}: {{methods: [{{hypothesis: {{subject: "s.py:step"}}}},
    {{rosmonitoring: {{traces: [t.jsonl], mapping: {{in.f: {{scenario: true}}, out.a: data}}}}}}]}}}}
"""


def points(value: Any) -> set[int]:
    assert isinstance(value, FunctionValue)
    return {point[0] for point, holds in value.table.items() if holds is True}  # type: ignore[misc]


def in_tests(job: Job) -> set[int]:
    (data,) = (text for name, text in HYPOTHESIS.export(job).items() if name.endswith(".json"))
    return {int(row[0]) for row in json.loads(data)["f"]}


def in_monitors(job: Job) -> set[int]:
    rules = usable(job.system, job.node, job.system.plan.node(job.node.name).methods[1].options).rules
    (value,) = (rule.value for rule in rules.values() if isinstance(rule, Constant))
    return points(value)


READERS: dict[str, Callable[[Job], set[int]]] = {
    "sanity": lambda job: points(next(iter(interpretation(job.node, job.system.plan.scenario).values()))),
    "calculus": lambda job: points(world(frame(job.system)).choices(job.node.name, job.node.inputs[0])[0]),
    "ajpf": lambda job: points(Decider(job).valuation["in.f"]),
    "hypothesis": in_tests,
    "rosmonitoring": in_monitors,
}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("name", ["a", "z"])  # before and after `in`
@pytest.mark.parametrize("own_first", [True, False])
def test_what_is_said_of_the_node_alone_counts(tmp_path: Path, reader: str, name: str, own_first: bool) -> None:
    said = [f"{name}.f: own(id)", "in.f: all(id)"]
    (tmp_path / "all.csv").write_text("id\n1\n")
    (tmp_path / "own.csv").write_text("id\n2\n")
    (tmp_path / "t.jsonl").write_text("")
    (tmp_path / "s.py").write_text("def step(f):\n    return True\n")
    (tmp_path / "system.rcl").write_text(RCL.format(name=name))
    (tmp_path / "plan.yaml").write_text(PLAN.format(name=name, said=", ".join(said if own_first else said[::-1])))
    system = load_system(tmp_path)
    job = method_job(system, system.contract.node(name), system.plan.node(name).methods[0])
    assert READERS[reader](job) == {2}
