"""What SMT-LIB has of a contract is read as it was meant; constants that are formulas read back."""

from __future__ import annotations

import pytest
from drawn.contracts import Strange

from avow.language.contract import Contract
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.solving.smtlib import to_smtlib


def contract_of(text: str) -> Contract:
    contract, found = check_text(text, "f")
    assert contract is not None, (text, [f"{d.span} {d.message}" for d in found if d.is_error])
    return contract


@pytest.mark.nightly
def test_smtlib_is_read_by_z3() -> None:
    import z3

    read = 0
    for seed in range(100):
        contract, _ = check_text(Strange(seed).text(), "f")
        found = to_smtlib(contract).text if contract is not None else ""  # a range is no value there
        for part in found.split("(reset)") if found else ():
            assert len(z3.parse_smt2_string(part)) > 0, seed
        read += bool(found)
    assert read > 50


@pytest.mark.parametrize("collection", ["{{{0}, {1}}}", "<{0}, {1}>", "<<{0}>(0), {1}>"])
def test_a_variable_over_tuples_takes_each_value(collection: str) -> None:
    """Where one tuple has a natural and the other an integer, the variable is of integers: no value is lost."""
    import z3

    items = collection.format("(1, 2)", "(1, -2)")
    text = (
        f"node n {{ inputs() outputs( b : BOOL ) topics() guarantee( exists(t in {items} | t == (1, -2)) and out.b ) }}"
    )
    solver = z3.Solver()
    solver.from_string(to_smtlib(contract_of(text)).text)
    assert solver.check() == z3.sat
    text = text.replace("exists(t", "forall(t").replace("t == (1, -2)", "t != (1, -2)")
    solver = z3.Solver()
    solver.from_string(to_smtlib(contract_of(text)).text)
    assert solver.check() == z3.unsat


def test_constants_that_are_formulas_read_back() -> None:
    text = "context { A = (1 < 2); B = (not TRUE); C = (A -> B); D = <(1 < 2), FALSE>; E = ((1 < 2), 3); }"
    contract = contract_of(text + " node n { inputs() outputs( b : BOOL ) topics() guarantee( out.b <=> C ) }")
    assert contract_of(to_rcl(contract)).constants == contract.constants


@pytest.mark.parametrize(
    "types",
    [
        "T : {a', a''};",  # primes need bars, where Z3 sets none
        "assert : {a, b}; T : {c(assert)};",  # what is declared is told from what is asserted
        "B : {b1, b2}; T : {c(<<B>>), d};",  # declared before it is used
        "T' : {a, b(<<(T2', T2')>>)}; T2' : {e', f'};",
    ],
)
def test_declarations_that_z3_prints_wrongly(types: str) -> None:
    import z3

    name = "T'" if "T'" in types else "T"
    text = f"context {{ {types} }} node n {{ inputs( i : {name} ) outputs( o : {name} ) topics() guarantee( i == o ) }}"
    script = to_smtlib(contract_of(text)).text
    assert len(z3.parse_smt2_string(script)) > 0
    cvc5 = pytest.importorskip("cvc5")
    solver = cvc5.Solver(cvc5.TermManager())
    parser = cvc5.InputParser(solver)
    parser.setStringInput(cvc5.InputLanguage.SMT_LIB_2_6, script, "contract")
    while not (command := parser.nextCommand()).isNull():
        assert "error" not in command.invoke(solver, parser.getSymbolManager())
