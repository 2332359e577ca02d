"""Faults planted in generated chains, with delays, at rates of their own: found where they are, and followed from
everywhere else to there; and recorded evidence says the same as `avow monitor`."""

from __future__ import annotations

import json
import random
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.backend_kit.protocol import Limits
from avow.backends.rosmonitoring import BACKEND
from avow.backends.rosmonitoring.session import session
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.pipeline.slices import method_slice
from avow.system.load import load_system
from avow.system.plan import System

from .conftest import ARRIVAL, job_for, one_by_one

NODE = """node n{at} {{
  inputs( v{before} : REAL )
  outputs( v{at} : REAL )
  topics( float64 v{before} matches(in.v{before}), float64 v{at} matches(out.v{at}) )
  assume sound ( in.v{before} >= 0 )
  {guarantees}
}}
"""
NONNEG = "guarantee nonneg ( out.v{at} >= 0 )"
SAME = "guarantee same ( out.v{at} == in.v{before} )"


@dataclass(frozen=True)
class Planted:
    """A chain, its trace, and where it was broken: the node (0: the environment) and the number of the event."""

    system: System
    trace: Path
    node: int
    event: int
    broken: str


def planted(folder: Path, seed: int, answers: dict[str, Any], *, whole: bool = False) -> Planted:
    """`whole`: each message has its answer, and it may come before the message is heard of."""
    rng = random.Random(seed)
    length = rng.randint(3, 6)
    guilty = rng.randint(0, length - 1)
    guarantees = SAME if whole else rng.choice([NONNEG, f"{NONNEG}\n  {SAME}"])
    nodes = range(1, length + 1)
    text = "".join(NODE.format(at=k, before=k - 1, guarantees=guarantees.format(at=k, before=k - 1)) for k in nodes)
    (folder / "system.rcl").write_text(text, encoding="utf-8")
    late = [k for k in nodes if k > 1 and not whole and rng.random() < 0.4]
    connections = [{"from": f"n{k - 1}.v{k - 1}", "to": f"n{k}.v{k - 1}", "delayed": True, "initial": 0} for k in late]
    method = {"rosmonitoring": {"answers": answers, "decided": 0.5, "traces": ["t.jsonl"]}}
    plan = {"connections": connections, "nodes": {f"n{k}": {"methods": [method]} for k in nodes}}
    (folder / "plan.yaml").write_text(json.dumps(plan), encoding="utf-8")
    events, at = _run(rng, length, guilty, late, whole=whole)
    lines = [json.dumps({"topic": f"v{k}", "time": n / 10**5, "data": value}) for n, (k, value) in enumerate(events)]
    (folder / "t.jsonl").write_text("\n".join(lines) + "\n", encoding="utf-8")
    broken = "nonneg" if "nonneg" in guarantees else "same"
    return Planted(load_system(folder), folder / "t.jsonl", guilty, at, broken)


def _run(rng: random.Random, length: int, guilty: int, late: list[int], *, whole: bool) -> tuple[list[Any], int]:
    """Rounds in which each node may answer with what it last heard, and one of them once says something else."""
    values: dict[int, float] = {}
    events: list[tuple[int, float]] = []
    when, at = rng.randint(5, 10), 0
    for number in range(20):
        todo = [k for k in range(length + 1) if whole or k == 0 or rng.random() < 0.8]
        # what is fed with delay may answer before its source
        todo.sort(key=lambda k: k - 1.5 if k in late else k)
        fresh = []
        for k in todo:
            if k and k - 1 not in values:
                continue
            value = float(rng.randint(0, 9)) if k == 0 else values[k - 1]
            if k == guilty and number >= when and not at:
                value, at = -7.0, -1
                fresh.append((k, value, True))
            else:
                fresh.append((k, value, False))
            values[k] = value
        if whole and rng.random() < 0.5:
            rng.shuffle(fresh)  # each topic has a connection of its own
        for k, value, wrong in fresh:
            events.append((k, value))
            at = len(events) if wrong else at
    return events, at


def found(made: Planted) -> list[Violation]:
    return [violation for _, violation in session(made.system).run(made.trace)]


def check(made: Planted, violations: list[Violation]) -> list[Violation]:
    """Those that are followed to the planted fault: all broken assumptions, but the environment's own."""
    own = [v for v in violations if v.fault is Fault.GUARANTEE]
    given = [v for v in violations if v.fault is Fault.ASSUMPTION]
    if made.node == 0:
        assert not own
        assert {(v.node, v.clause) for v in given} == {("n1", "sound")}
        assert made.event in {v.index for v in given}
        origin = f"n1.sound at event {made.event} (environment)"
    else:
        assert not given
        assert (f"n{made.node}", made.broken, made.event) in {(v.node, v.clause, v.index) for v in own}
        assert {(v.node, v.index) for v in own} == {(f"n{made.node}", made.event)}
        origin = f"n{made.node}.{made.broken} at event {made.event}"
    followed = [v for v in violations if v.fault is Fault.PROVIDER]
    for violation in followed:
        here = f"{violation.node}.{violation.clause} at event {violation.index}"
        assert violation.cause == f"{origin} caused {here}"
    return followed


@pytest.mark.parametrize("seed", some(range(60), 12))
def test_a_planted_fault_is_found_and_followed(tmp_path: Path, seed: int) -> None:
    made = planted(tmp_path, seed, ARRIVAL)
    followed = check(made, found(made))
    one = session(made.system)
    assert check(made, list(one_by_one(one, made.trace))) == followed


@pytest.mark.parametrize("seed", some(range(100, 140), 8))
def test_also_where_an_answer_is_judged_later_than_what_it_breaks(tmp_path: Path, seed: int) -> None:
    made = planted(tmp_path, seed, {"by": "order", "because": "all links stood before the first message"}, whole=True)
    check(made, found(made))


@pytest.mark.parametrize("seed", some(range(200, 240), 3, slow=3))
def test_recorded_evidence_says_the_same(tmp_path: Path, seed: int) -> None:
    made = planted(tmp_path, seed, ARRIVAL)
    followed = check(made, found(made))
    for node in made.system.contract.nodes:
        job = job_for(made.system, node.name)
        cut = method_slice(BACKEND, job)
        own = job_for(cut.system, node.name)
        outcomes = BACKEND.discharge(own, tmp_path, Limits()).outcomes
        told = next((v for v in followed if v.node == node.name), None)
        excused = [o for o in outcomes if "at the others" in o.summary]
        if told is not None:
            assert all(told.cause in outcome.summary for outcome in excused)
        elif made.node == 0 and node.name == "n1":
            assert all("by the environment" in outcome.summary for outcome in excused)
        else:
            assert not excused
