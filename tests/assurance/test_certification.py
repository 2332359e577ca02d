"""Grades of proofs: what the kernel established in this very run, and nothing that a record says of itself."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import pytest

from assurance.sample import RUN, case, evidence, guarantee, node_plan, obligation, system
from avow.assurance.case import conclude_again
from avow.assurance.certification import Grade, KernelRun, ProofGrade
from avow.assurance.codec import from_json, to_json
from avow.assurance.model import Case
from avow.base.verdict import Verdict
from avow.evidence.audit import Discrepancy, Fault
from avow.evidence.claims import Reestablished
from avow.evidence.obligation import Kind

G = guarantee("n", "g")
SIDE = obligation("system", Kind.COMPOSITION, "whole.n.low")
START = obligation("system", Kind.COMPOSITION, "start.n")
PLANS = [node_plan("n", "low", "hoare")]


def proof(of: Any) -> Any:
    told = {"certificate": {"key": "k", "solvers": 2}}
    return replace(evidence(of, Verdict.PROVED, method="compose"), backend="compose", details=told)


def kernel(*names: str, solvers: int = 1, run: str = RUN.id) -> KernelRun:
    return KernelRun(run, tuple(Reestablished(name, solvers, "k", "whole") for name in names), {"z3": "5.4.0"})


def graded(told: KernelRun | None, *obligations: Any, policy: Any = None, **others: Any) -> Case:
    subject = system({"n": ["g"]}, plans=PLANS, policy=policy or {"profile": "reproduction"})
    return case(subject, [G, *obligations], [evidence(G), *map(proof, obligations)], kernel=told, **others)


def grades(found: Case) -> dict[str, str]:
    return {p.obligation.split("/", 1)[1]: p.grade for p in found.proofs}


def test_what_a_record_says_of_itself_is_claimed() -> None:
    found = graded(None, SIDE)
    assert grades(found)["system/composition/whole.n.low"] == ProofGrade.CLAIMED
    assert found.grade is Grade.CHECKED


@pytest.mark.parametrize(("solvers", "grade"), [(1, ProofGrade.CERTIFIED_1), (2, ProofGrade.CERTIFIED_2)])
def test_certified(solvers: int, grade: ProofGrade) -> None:
    found = graded(kernel(SIDE.id, solvers=solvers), SIDE)
    assert grades(found)["system/composition/whole.n.low"] == grade
    assert found.grade is Grade.CERTIFIED
    assert grades(found).get("n/guarantee/g", ProofGrade.TOOL_TRUSTED) == ProofGrade.TOOL_TRUSTED
    assert conclude_again(from_json(json.loads(json.dumps(to_json(found))))) == found


def test_the_word_of_another_run_certifies_nothing() -> None:
    found = graded(kernel(SIDE.id, run="an earlier run"), SIDE)
    assert grades(found)["system/composition/whole.n.low"] == ProofGrade.CLAIMED
    assert found.grade is Grade.CHECKED


def test_one_that_is_claimed_is_enough() -> None:
    found = graded(kernel(SIDE.id), SIDE, START)
    assert found.grade is Grade.CHECKED
    assert "start.n" in found.grade_reason


def test_the_kernels_word_makes_no_other_engines_proof_its_own() -> None:
    found = graded(kernel(G.id), SIDE)
    assert ProofGrade.CERTIFIED_1 not in grades(found).values()


def test_nothing_to_certify_is_not_certified() -> None:
    assert graded(kernel()).grade is Grade.CHECKED


def test_a_changed_ledger_is_never_certified() -> None:
    serious = Discrepancy(Fault.CHANGED, "a.log", "a.log was changed")
    assert graded(kernel(SIDE.id), SIDE, discrepancies=[serious]).grade is Grade.CHECKED
    assert graded(kernel(SIDE.id), SIDE, discrepancies=None).grade is Grade.CHECKED


def test_the_gate() -> None:
    policy = {"profile": "reproduction", "proved": "certified"}
    assert graded(kernel(SIDE.id), SIDE, policy=policy).exit_code == 0
    found = graded(kernel(), SIDE, policy=policy)
    assert found.exit_code == 1
    assert [gate.id for gate in found.gates if not gate.passed] == ["proved"]
    assert graded(kernel(), SIDE).exit_code == 0
