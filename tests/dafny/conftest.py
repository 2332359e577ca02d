"""Jobs for the Dafny backend, made from contract text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Job
from avow.base.diagnostics import Span
from avow.evidence.obligation import Kind, Obligation
from avow.language.contract import Contract
from avow.language.load import load_contract
from avow.system.plan import Located, Method, NodePlan, Plan, System

MakeJob = Callable[..., Job]


@pytest.fixture
def make_job(tmp_path: Path) -> MakeJob:
    """make_job(contract, node, **options): `contract` is text, a path, or a checked contract."""

    def make(contract: str | Path | Contract, node: str, root: Path | None = None, **options: Any) -> Job:
        base = root or tmp_path
        if isinstance(contract, str):
            (tmp_path / "system.rcl").write_text(contract, encoding="utf-8")
            contract = tmp_path / "system.rcl"
        if isinstance(contract, Path):
            contract = load_contract([contract])
        place = Span("plan.yaml", 1, 1, 2, 1)
        names = tuple(clause.name for clause in contract.node(node).guarantees)
        method = Method("dafny", "dafny", Located(options, place), names)
        plan = Plan(
            "s", "S", base / "plan.yaml", (), Located({}, place), (), (), (), None, (), (),
            (NodePlan(node, "medium", (method,)),), Located({}, place), None, (), (), (),
        )  # fmt: skip
        made = tuple(Obligation("s", node, Kind.GUARANTEE, name, "c", "…", "0" * 64) for name in names)
        return Job(System(plan, contract), contract.node(node), method, made)

    return make
