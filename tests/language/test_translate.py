"""avow translate: RCL reads back as the equal contract, SMT-LIB is accepted by Z3 and cvc5."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from drawn.contracts import CONTRACT

from avow.base.diagnostics import Rejected
from avow.language.contract import Contract
from avow.language.load import check_text, load_contract
from avow.language.translate import to_json, to_rcl, to_unicode

HOSTILE = r"""
context { T_x' : {a_b, c'd, e''}; F : {u, v} x (REAL, <T_x'>) --> REAL x REAL;
  W = {wa, wb}; K = -2.5; S = "} \\end{x} %$#&_^~<>|é—∀🤖"; }
node n_1 {
  inputs( t : T_x', f : F, s : STRING, _ : REAL, in_line : {go(REAL), halt}, u : {} )
  outputs( b : BOOL )
  topics( my_pkg/msg/Some_Type s matches(in.s) )
  guarantee n_a
    "100 % of \\section{x} & $y$ #1 _ ^ ~ {braces} \"quoted\" — é ∀ 🤖 <b>"
    ( b -> s == S and t == a_b and K < _ )
  guarantee( in.in_line != halt and exists(q in in_line | q == go(1)) and forall(w in W | w == wa) )
}
"""


def contracts(root: Path) -> list[Contract]:
    texts = [CONTRACT, HOSTILE]
    found = []
    for text in texts:
        contract, diagnostics = check_text(text, "t.rcl")
        assert contract is not None, [str(d) for d in diagnostics if d.is_error]
        found.append(contract)
    return found + [load_contract([p]) for p in sorted(root.glob("contracts/*/*.rcl"))]


def test_rcl_reads_back(root: Path) -> None:
    for contract in contracts(root):
        text = to_rcl(contract)
        again, found = check_text(text, "again.rcl")
        assert again is not None, (text, [f"{d.span} {d.message}" for d in found if d.is_error])
        assert replace(again, files=contract.files) == contract
        assert "RCL401" not in {d.code for d in found}


def test_json_is_complete(root: Path) -> None:
    for contract in contracts(root):
        data = json.loads(to_json(contract))
        assert [n["name"] for n in data["nodes"]] == [n.name for n in contract.nodes]
        for node, shown in zip(contract.nodes, data["nodes"], strict=True):
            assert [c["name"] for c in shown["guarantees"]] == [c.name for c in node.guarantees]
            assert all(c["formula"]["kind"] for c in shown["guarantees"])


def test_words_and_signs(root: Path) -> None:
    contract = load_contract([root / "contracts" / "remote_inspection_published" / "system.rcl"])
    unicode = to_unicode(contract)
    assert "WayP : ℝ × ℝ → ℕ" in unicode
    assert "∃! x, y ∈ ℝ · out.position(x, y)" in unicode


def test_smtlib_is_accepted_by_z3(root: Path) -> None:
    import z3

    from avow.solving.smtlib import to_smtlib

    for contract in contracts(root)[2:]:
        for script in to_smtlib(contract).text.split("(reset)"):
            assert len(z3.parse_smt2_string(script)) > 0


def test_smtlib_leaves_a_probability_out_and_names_it(root: Path) -> None:
    from avow.solving.smtlib import to_smtlib

    made = to_smtlib(load_contract([root / "contracts/delivery_robot/system.rcl"]))
    assert [d.message for d in made.missing] == [
        f"{name} is left out: it has a probability" for name in ("detector.sees", "tracker.reads", "tracker.follows")
    ]
    assert all(d.code == "SMT001" and d.span is not None for d in made.missing)
    assert "clause sees" not in made.text


@pytest.mark.needs_cvc5
def test_smtlib_is_accepted_by_cvc5(root: Path) -> None:
    import cvc5

    from avow.solving.smtlib import to_smtlib

    for contract in contracts(root)[2:]:
        solver = cvc5.Solver(cvc5.TermManager())
        parser = cvc5.InputParser(solver)
        parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, to_smtlib(contract).text, "contract")
        count = 0
        while not (command := parser.nextCommand()).isNull():
            count += 1
            if not str(command).startswith("(check-sat"):
                assert "error" not in command.invoke(solver, parser.getSymbolManager())
        assert count > 10


def test_an_element_that_a_port_hides_is_an_error_of_the_translation() -> None:
    """Only a constant can name it there, and constants are written out: what reads back would be another contract."""
    text = (
        "context { S : {red, green}; D = {red}; C : {go(REAL), halt}; H = halt; }\n"
        "node n { inputs( %s : BOOL, s : S, c : C ) outputs( o : BOOL ) topics() "
        "guarantee( o <=> in.s in D and c %s H ) }"
    )
    for name, sign, sound in (("red", "==", False), ("halt", "!=", False), ("blue", "==", True)):
        contract = check_text(text % (name, sign), "f")[0]
        assert contract is not None
        if sound:
            assert check_text(to_rcl(contract), "f")[0] == contract
            continue
        with pytest.raises(Rejected) as refused:
            to_rcl(contract)
        assert [d.code for d in refused.value.diagnostics] == ["RCL202"]
