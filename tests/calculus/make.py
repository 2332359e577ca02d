"""Small systems from text."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from avow.base.verdict import Outcome
from avow.calculus.composition import Composition, compose
from avow.calculus.discharge import Answers, Bounds
from avow.calculus.obligations import all_tasks, settle_each
from avow.evidence.obligation import Kind, Obligation
from avow.solving.limits import from_seconds
from avow.system.load import load_system
from avow.system.plan import System

CONTRACTS = Path(__file__).parents[2] / "contracts"


class TimeLimits(Protocol):
    @property
    def seconds(self) -> float: ...

    @property
    def seed(self) -> int: ...


class Limits:
    """As `avow.backend_kit.protocol.Limits`."""

    def __init__(self, seconds: float = 20.0, seed: int = 0) -> None:
        self.seconds = seconds
        self.seed = seed


def make(folder: Path, rcl: str, plan: str = "{}") -> System:
    """The system of a contract and a plan given as text. Raises Rejected."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "system.rcl").write_text(rcl)
    (folder / "plan.yaml").write_text(plan)
    return load_system(folder)


def case_study(folder: Path, name: str, plan: str, waypoints: int = 3) -> System:
    """A published contract under a plan of the test's own, with its first few waypoints."""
    shutil.copy(CONTRACTS / name / "system.rcl", folder / "system.rcl")
    lines = (CONTRACTS / name / "models/waypoints.csv").read_text().splitlines()
    (folder / "waypoints.csv").write_text("\n".join(lines[: waypoints + 1]) + "\n")
    (folder / "plan.yaml").write_text(plan)
    return load_system(folder)


def settled(system: System, goal: str = "whole", milliseconds: int = 10_000) -> tuple[Composition, Answers]:
    """A goal's side conditions, settled."""
    composition = compose(system)
    return composition, composition.settled(composition.goal(goal), Bounds(milliseconds))


def all_obligations(composition: Composition) -> tuple[Obligation, ...]:
    return tuple(task.obligation for task in all_tasks(composition))


def requirement_obligations(system: System) -> tuple[Obligation, ...]:
    return tuple(o for o in all_obligations(compose(system)) if o.kind is Kind.REQUIREMENT)


def settle_all(composition: Composition, obligations: Sequence[Obligation], limits: TimeLimits) -> tuple[Outcome, ...]:
    return tuple(settle_each(composition, obligations, Bounds(from_seconds(limits.seconds), limits.seed)))


def discharge(system: System, obligations: Sequence[Obligation], limits: TimeLimits) -> tuple[Outcome, ...]:
    return settle_all(compose(system), obligations, limits)


def outcomes(system: System) -> dict[str, Outcome]:
    """Every composition and requirement obligation, by its name, settled."""
    obligations = all_obligations(compose(system))
    found = discharge(system, obligations, Limits())
    return {obligation.name: outcome for obligation, outcome in zip(obligations, found, strict=True)}


def node(name: str, inputs: str = "", outputs: str = "", *clauses: str) -> str:
    """One node; clauses such as ``A reading: in.r >= 0`` or ``G: out.x == 1``."""
    body = []
    for clause in clauses:
        head, formula = clause.split(":", 1)
        kind, _, label = head.strip().partition(" ")
        word = {"A": "assume", "G": "guarantee"}[kind]
        body.append(f"  {word} {label} ( {formula.strip()} )")
    if not any(clause.startswith("G") for clause in clauses):
        body.append("  guarantee ( TRUE )")
    return f"node {name} {{\n  inputs( {inputs} )\n  outputs( {outputs} )\n  topics()\n" + "\n".join(body) + "\n}\n"
