"""A node with two guarantees, a reviewed file and a stamped record, made by hand."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Span
from avow.evidence.obligation import Kind, Obligation
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.sorts import REAL
from avow.language.terms import Compare, Literal, Role, Variable
from avow.system.plan import Located, Method, NodePlan, Plan, System

MakeJob = Callable[..., Job]


def sensor(threshold: int = 120, assumed: int = 0) -> Node:
    r = Variable(Role.INPUT, "r", REAL)
    high = Compare("<=", Literal(Fraction(threshold), REAL), r)
    low = Compare("<=", Literal(Fraction(assumed), REAL), r)
    return Node(
        "sensor",
        (Port(Role.INPUT, "r", REAL, "REAL"),),
        (),
        (),
        (Clause(ClauseKind.ASSUMPTION, "A1", 1, low),),
        (Clause(ClauseKind.GUARANTEE, "G1", 1, high), Clause(ClauseKind.GUARANTEE, "G2", 2, low)),
    )


@pytest.fixture
def make_node() -> Callable[..., Node]:
    return sensor


@pytest.fixture
def make_job(tmp_path: Path) -> MakeJob:
    def make(options: Any = None, node: Node | None = None) -> Job:
        place = Span("plan.yaml", 1, 1, 2, 1)
        node = node or sensor()
        contract = Contract(("system.rcl",), (), (), (node,))
        data = {"record": "review.yaml"} if options is None else options
        method = Method("review", "review", Located(data, place), ("G1", "G2"))
        plan = Plan(
            "s", "S", tmp_path / "plan.yaml", (), Located({}, place), (), (), (), None, (), (),
            (NodePlan(node.name, "medium", (method,)),), Located({}, place), None, (), (), (),
        )  # fmt: skip
        made = tuple(Obligation("s", node.name, Kind.GUARANTEE, c.name, "c", "…", "0" * 64) for c in node.guarantees)
        return Job(System(plan, contract), node, method, made)

    return make


RECORD = """\
# kept: a comment
format: 1
reviewer: Ada
role: safety engineer
date: 2026-11-20
valid_until: 2027-11-20
read:
  - models/code.py   # kept too
  - {file: models/more.py, sha256: }
  - file: "models/odd name.py"
clauses:
checklist:
  - question: Is it one?
    answer: yes
  - {question: "Can it fail?", answer: no, wanted: no}
conclusion: accepted
"""


@pytest.fixture
def record_text() -> str:
    return RECORD


@pytest.fixture
def stamped(tmp_path: Path) -> Path:
    """The record above, stamped for `sensor()`."""
    from avow.backends.review.stamp import stamp_record

    (tmp_path / "models").mkdir()
    for name in ("code.py", "more.py", "odd name.py"):
        (tmp_path / "models" / name).write_text(f"# {name}\n")
    path = tmp_path / "review.yaml"
    path.write_text(RECORD)
    said = stamp_record(path, tmp_path, sensor(), ("G1", "G2"))
    assert len(said) == 5
    return path
