"""Dafny against the evaluator: random formulas at random values. Of what is false there, Dafny must prove nothing, and
of what is true nothing to the contrary; and it proves most, so that the comparison is worth something."""

from __future__ import annotations

import random
from fractions import Fraction
from pathlib import Path

import pytest
from hypothesis_backend.test_judging_agrees import value
from rosmonitoring.test_agreement import RCL, formula

from avow.backend_kit.protocol import Limits
from avow.backends.dafny.modules import generate
from avow.backends.dafny.runner import verify
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Data, Element, FunctionValue, Value
from avow.isolation.outside import Outside
from avow.language.load import load_contract
from avow.language.sorts import REAL, DataSort, EnumSort, FunctionSort, NaturalSort, Sort


def literal(found: Value, sort: Sort) -> str:
    """A value as Dafny writes it."""
    match found, sort:
        case Element(name=name), EnumSort(name=type_name):
            return f"Types.{type_name}.{name}"
        case Data(constructor=name, arguments=arguments), DataSort(name=type_name):
            parts = [literal(a, s) for a, s in zip(arguments, sort.constructor(name).parameters, strict=True)]
            return f"Types.{type_name}.{name}" + (f"({', '.join(parts)})" if parts else "")
        case FunctionValue(table=table), FunctionSort(parameters=parameters):
            names = [f"a{k}" for k in range(len(parameters))]
            types = {REAL: "real"}
            head = ", ".join(f"{n}: {types.get(s, 'nat')}" for n, s in zip(names, parameters, strict=True))
            points = [
                "("
                + " && ".join(f"{n} == {literal(v, s)}" for n, v, s in zip(names, key, parameters, strict=True))
                + ")"
                for key in table
            ]
            return f"(({head}) => {' || '.join(points) or 'false'})"
        case bool(), _:
            return "true" if found else "false"
    number = Fraction(found)  # type: ignore[arg-type]
    if isinstance(sort, NaturalSort):
        return str(int(number))
    return f"({'-' if number < 0 else ''}{abs(number.numerator)}.0 / {number.denominator}.0)"


@pytest.mark.needs_dafny
@pytest.mark.nightly
@pytest.mark.parametrize("seed", [0])
def test_dafny_and_the_evaluator_agree(seed: int, tmp_path: Path) -> None:
    rng = random.Random(seed)
    clauses = "\n".join(f"  guarantee g{k} ( {formula(rng, rng.choice((1, 1, 2)))} )" for k in range(14))
    text = RCL.replace("  guarantee g ( {formula} )\n", "<>").format().replace("<>", clauses + "\n")
    (tmp_path / "system.rcl").write_text(text)
    node = load_contract([tmp_path / "system.rcl"]).node("n")
    made = generate(node, [g.name for g in node.guarantees])
    assert made.uncovered == ()
    ports = {f"{p.role}_{p.name}": p.variable for p in (*node.inputs, *node.outputs)}
    lemmas, truths = [], {}
    spec = made.spec.split("\n")
    for line, name in made.ensures:
        claim = spec[line - 1].strip().removeprefix("ensures ")
        used = claim[claim.index("(") + 1 : -1].split(", ") if "()" not in claim else []
        for case in range(2):
            values = {ports[u]: value(rng, ports[u]) for u in used}
            try:
                held = evaluate(node.clause(name).formula, {v.qualified: x for v, x in values.items()})
            except NotEvaluable:  # over infinitely many values nothing decides it
                continue
            truths[f"{name}_{case}"] = held
            call = f"Contract.{name}({', '.join(literal(values[ports[u]], ports[u].sort) for u in used)})"
            lemmas += [
                f"  lemma Is_{name}_{case}() ensures {call} {{}}",
                f"  lemma Not_{name}_{case}() ensures !{call} {{}}",
            ]
    check = "\n".join(["module Check {", "  import Types", "  import Contract", *lemmas, "}", ""])
    files = {made.types_file: made.types, made.contract_file: made.contract, "check.dfy": check}
    run = verify(files, Limits(seconds=400), Outside(()))
    assert run.members is not None, run.output
    proved = {m.name for m in run.members if m.kind == "Impl" and m.outcome == "correct"}
    wrong = [name for name, held in truths.items() if f"{'Not' if held else 'Is'}_{name}" in proved]
    assert wrong == [], (text, check)
    right = [name for name, held in truths.items() if f"{'Is' if held else 'Not'}_{name}" in proved]
    assert len(right) > len(truths) // 2
    assert len(set(truths.values())) == 2
