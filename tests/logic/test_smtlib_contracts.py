"""`avow translate --to smtlib` of generated contracts: Z3 and cvc5, asked with the text, never contradict what sanity
says of the node. AVOW_SMTLIB=300 makes it a long run."""

from __future__ import annotations

import os
import random
from collections import Counter

import pytest
import z3
from drawn.contracts import CONTRACT, Varied

from avow.base.diagnostics import Rejected
from avow.base.verdict import Verdict
from avow.language.contract import Contract
from avow.language.load import check_text
from avow.sanity.analysis import analyse
from avow.sanity.claims import Property
from avow.sanity.results import Bounds
from avow.solving.smtlib import ask_cvc5, formulas_script, to_smtlib

COUNT = int(os.environ.get("AVOW_SMTLIB", "10"))
SAYS = {Verdict.PROVED: "sat", Verdict.REFUTED: "unsat"}
"""What a solver must answer to "can it hold together" where sanity has this verdict."""


def generated(seed: int) -> Contract:
    """A contract of the node in `CONTRACT`, with random clauses; one in three made contradictory."""
    formulas, source = Varied(seed), random.Random(seed)
    while True:
        assumed = formulas.formula(1).replace("b2", "b").replace("st2", "st").replace("c == halt", "b")
        promised = [formulas.formula(1) for _ in range(source.choice((1, 2)))]
        if source.random() < 0.35:
            promised.append(f"not ({promised[0]})")
        clauses = f"assume( {assumed} )\n" + "\n".join(f"  guarantee( {p} )" for p in promised)
        contract, _ = check_text(CONTRACT.replace("guarantee( TRUE )", clauses), "f")
        if contract is not None and not _mentions_output(contract) and _can_be_said(contract):
            return contract


def _can_be_said(contract: Contract) -> bool:
    try:
        return bool(to_smtlib(contract))
    except Rejected as rejected:
        assert {d.code for d in rejected.diagnostics} == {"SMT001"}  # noqa: PT017
        return False


def _mentions_output(contract: Contract) -> bool:
    from avow.formulas.formula import free_variables

    node = contract.nodes[0]
    return any(v.role == "out" for a in node.assumptions for v in free_variables(a.formula))


def ask_z3(script: str) -> str:
    solver = z3.Solver(ctx=z3.Context())
    solver.set("timeout", 2_000)
    solver.from_string(script)
    return str(solver.check())


@pytest.mark.nightly
@pytest.mark.needs_cvc5
def test_the_exported_contract_has_the_verdict_of_sanity() -> None:
    said: Counter[str] = Counter()
    for seed in range(COUNT):
        contract = generated(seed)
        node = contract.nodes[0]
        found = {
            r.asked.about: r
            for r in analyse(node, bounds=Bounds(1_000, 0), wanted=("assumptions-satisfiable", "consistent"))
        }
        questions = {
            Property.CONSISTENT: to_smtlib(contract),
            Property.ASSUMPTIONS_SATISFIABLE: formulas_script({a.name: a.formula for a in node.assumptions}),
        }
        for about, script in questions.items():
            verdict = found[about].verdict
            wanted = SAYS.get(verdict)
            for name, answer in (("z3", ask_z3(script)), ("cvc5", ask_cvc5(script, effort=2_000))):
                assert answer in {"sat", "unsat", "unknown"}, f"{name} cannot read it:\n{script}"
                if wanted is not None and not found[about].bounded:
                    assert answer in {wanted, "unknown"}, (seed, about, verdict, name, [c.text for c in node.clauses])
                    said[f"{name} {answer}"] += 1
    decided = sum(count for name, count in said.items() if not name.endswith("unknown"))
    assert decided > COUNT, said
    assert all(said[f"{name} {answer}"] for name in ("z3", "cvc5") for answer in ("sat", "unsat")), said


@pytest.mark.needs_cvc5
def test_the_comparison_can_fail() -> None:
    """The export of a contract that says the opposite has the opposite verdict."""
    text = "node n { inputs(r : REAL) outputs(o : REAL) topics() guarantee( o > r ) guarantee( o %s r ) }"
    answers = []
    for sign in (">=", "<"):
        contract = check_text(text % sign, "f")[0]
        assert contract is not None
        answers.append((ask_z3(to_smtlib(contract)), ask_cvc5(to_smtlib(contract), effort=2_000)))
    assert answers == [("sat", "sat"), ("unsat", "unsat")]
