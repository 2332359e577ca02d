"""A parameter with a value is that literal in each clause; one without stays, and only allowed values are tried."""

from __future__ import annotations

import json
import random
import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path

import pytest
from drawn.contracts import small_contract
from oracle.domains import as_written, domain

from avow.backend_kit.parameters import samples
from avow.base.diagnostics import Rejected
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, substitute
from avow.language import sorts as s
from avow.language.contract import Clause, Contract, Node
from avow.language.load import check_text
from avow.system.load import load_texts
from avow.system.parameters import of_parameters, plain

from .meaning import Meaning
from .test_engines import by_script, literal, scripts

HELD = (s.BoolSort, s.EnumSort, s.IntegerSort, s.NaturalSort, s.RealSort, s.StringSort)


def with_parameters(seed: int) -> Contract | None:
    """A drawn contract whose inputs are parameters where they may be."""
    text = small_contract(seed)
    for port in checked_inputs(text):
        text = re.sub(rf"\b{port} :", f"parameter {port} :", text, count=1)
    return check_text(text, "drawn.rcl")[0]


def checked_inputs(text: str) -> list[str]:
    contract, _ = check_text(text, "drawn.rcl")
    return [] if contract is None else [p.name for p in contract.nodes[0].inputs if isinstance(p.sort, HELD)]


def given(folder: Path, contract: Contract, values: Mapping[str, object]) -> Node | None:
    """The node with these values in the plan; None if an assumption excludes them."""
    plan = json.dumps({"nodes": {"n": {"parameters": values}}})
    try:
        return load_texts(folder / "plan.yaml", plan, contract).contract.node("n")
    except Rejected as rejected:
        found = rejected.diagnostics
    assert {d.code for d in found} == {"PLAN139"}, found
    return None


def steps(clause: Clause, rng: random.Random, values: Mapping[str, object]) -> Iterator[dict[str, object]]:
    free = sorted(free_variables(as_written(clause)), key=lambda v: v.qualified)
    if not any(isinstance(part, s.FunctionSort) for v in free for part in s.components(v.sort)):
        for _ in range(3):
            yield {v.qualified: values.get(v.name, rng.choice(domain(v.sort))) for v in free}


@pytest.mark.parametrize(
    ("seeds", "asked"),
    [
        pytest.param(range(25), 40, id="few"),
        pytest.param(range(25, 250), 600, id="many", marks=pytest.mark.slow),
    ],
)
def test_a_value_is_the_literal_and_only_allowed_values_are_tried(tmp_path: Path, seeds: range, asked: int) -> None:
    (tmp_path / "n.rcl").touch()
    meaning, compared, excluded = Meaning(), 0, 0
    for seed in seeds:
        rng, contract = random.Random(seed), with_parameters(seed)
        if contract is None or not (ports := contract.nodes[0].parameters):
            continue
        node = contract.nodes[0]
        written = [clause for clause in node.assumptions if clause.name not in node.implied]
        about = [as_written(clause) for clause in of_parameters(node)]
        for fixed in samples(node):
            tried = {f"in.{p.name}": plain(p.value) for p in fixed}
            assert all(meaning.met(formula, [tried]) for formula in about), (seed, tried)
        raw = {p.name: rng.choice(domain(p.sort)[:4]) for p in ports}
        values = {name: plain(literal(value, p.sort)) for (name, value), p in zip(raw.items(), ports, strict=True)}
        made = given(tmp_path, contract, values)
        if made is None:
            mets = [meaning.met(as_written(c), [step]) for c in written for step in steps(c, rng, raw)]
            assert not all(mets), (seed, values)
            excluded += 1
            continue
        left = {clause.name: clause.formula for clause in made.clauses}
        for clause in (c for c in node.clauses if c.name not in node.implied):
            for step in steps(clause, rng, raw):
                met = meaning.met(as_written(clause), [step])
                if clause.name not in left:
                    assert met, (seed, clause.name, values)
                    continue
                free = free_variables(left[clause.name])
                closed = substitute(left[clause.name], {v: literal(step[v.qualified], v.sort) for v in free})
                with suppress(NotEvaluable):
                    assert evaluate(closed, {}) is met, (seed, clause.name, values)
                found = [str(by_script(script)) for script in scripts(closed)]
                assert not {"unsat" if met else "sat"} & set(found), (seed, clause.name, values)
                compared += 1
    assert compared >= asked
    assert excluded
