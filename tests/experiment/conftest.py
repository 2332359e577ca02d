"""A system with one node, made by hand, and jobs for it."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Span
from avow.evidence.obligation import Kind, Obligation
from avow.language.contract import Clause, ClauseKind, Contract, Node
from avow.language.sorts import BOOL, REAL
from avow.language.terms import TRUE, Literal
from avow.system.plan import Located, Method, NodePlan, Plan, System

MakeJob = Callable[..., Job]


@pytest.fixture
def make_job(tmp_path: Path) -> MakeJob:
    def make(**options: Any) -> Job:
        place = Span("plan.yaml", 1, 1, 2, 1)
        spans = {(key,): Span("plan.yaml", at, 5, at, 9) for at, key in enumerate(options, 10)}
        node = Node("drive", (), (), (), (), (Clause(ClauseKind.GUARANTEE, "arrives", 1, TRUE),))
        constants = (("Tolerance", Literal(Fraction(1, 4), REAL)), ("Yes", Literal(True, BOOL)))
        contract = Contract(("system.rcl",), (), constants, (node,))
        method = Method("experiment", "experiment", Located(options, place, spans), ("arrives",))
        plan = Plan(
            "s", "S", tmp_path / "plan.yaml", (), Located({}, place), (), (), (), None, (), (),
            (NodePlan("drive", "medium", (method,)),), Located({}, place), None, (), (), (),
        )  # fmt: skip
        obligation = Obligation("s", "drive", Kind.GUARANTEE, "arrives", "it arrives", "…", "0" * 64)
        return Job(System(plan, contract), node, method, (obligation,))

    return make
