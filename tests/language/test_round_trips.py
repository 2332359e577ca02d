"""Round trips on contracts made from their types: names that are words of other languages, nested types, constants of
every kind, comments anywhere. A long run: AVOW_FUZZ=5000."""

from __future__ import annotations

import os
from dataclasses import replace

import pytest
from drawn.contracts import Strange

from avow.formulas.formula import node_digest
from avow.language.contract import Contract
from avow.language.format import format_text
from avow.language.load import check_text
from avow.language.translate import FORMATS
from avow.solving.smtlib import to_smtlib

ROUNDS = max(60, int(os.environ.get("AVOW_FUZZ", "300")) // 4)
SEED = int(os.environ.get("AVOW_FUZZ_SEED", "20261122"))


def contract_of(text: str) -> Contract:
    contract, found = check_text(text, "f")
    assert contract is not None, (text, [f"{d.span} {d.message}" for d in found if d.is_error])
    return contract


def digests(contract: Contract) -> list[str]:
    return [node_digest(node, clause) for node in contract.nodes for clause in node.clauses]


def made() -> list[tuple[str, tuple[str, ...], Contract]]:
    found = []
    for seed in range(SEED, SEED + ROUNDS):
        source = Strange(seed)
        text = source.text()
        contract, diagnostics = check_text(text, "f")
        if contract is None:  # the generator does not see every rule of types
            assert {d.code for d in diagnostics if d.is_error} <= {"RCL220", "RCL302", "RCL303"}, text
            continue
        found.append((text, tuple(source.comments), contract))
    assert len(found) > 0.8 * ROUNDS
    return found


@pytest.mark.nightly
def test_layout_keeps_everything() -> None:
    for text, comments, contract in made():
        formatted = format_text(text, "f")
        assert format_text(formatted, "f") == formatted
        again = contract_of(formatted)
        assert replace(again, files=contract.files) == contract
        assert digests(again) == digests(contract)
        laid_out = " ".join(formatted.split())
        assert all(" ".join(comment.split()) in laid_out for comment in comments), text


@pytest.mark.nightly
def test_translation_keeps_the_meaning() -> None:
    for text, _, contract in made():
        again = contract_of(FORMATS["rcl"](contract))
        assert replace(again, files=contract.files) == contract, text
        assert digests(again) == digests(contract)
        for notation in ("text", "unicode", "latex", "json"):
            assert FORMATS[notation](contract)


@pytest.mark.nightly
def test_smtlib_is_read_by_z3() -> None:
    import z3

    read = 0
    for text, _, contract in made():
        found = to_smtlib(contract)
        if not found.text:
            continue  # a range between bounds that are no numbers, as a value
        for part in found.text.split("(reset)"):
            assert len(z3.parse_smt2_string(part)) > 0, text
        read += 1
    assert read > ROUNDS / 2


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
    assert contract_of(FORMATS["rcl"](contract)).constants == contract.constants


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
