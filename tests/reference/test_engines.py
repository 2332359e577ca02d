"""One step: what engines and exporters make of a clause, at values drawn by chance, against the reference, which reads
the clause as it is written (partial operations included).

Clauses over runs are held against it where their engines are tested: `temporal` (cells, sanity, refinement),
`rosmonitoring` (monitors, RML), `hoare`, `hypothesis_backend` and `dafny`."""

from __future__ import annotations

import contextlib
import random
from collections.abc import Iterator
from dataclasses import replace
from fractions import Fraction
from typing import Any

import pytest
import z3
from drawn.contracts import small_contract
from drawn.formulas import checked
from oracle.domains import as_written, domain

from avow.backend_kit.protocol import Limits
from avow.backends.dafny.modules import generate
from avow.backends.dafny.runner import verify
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, substitute
from avow.isolation.outside import Outside
from avow.kernel.text import Text, Untranslatable
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.contract import Clause, ClauseKind
from avow.language.load import check_text
from avow.language.printer import show_term
from avow.solving.smtlib import formulas_script
from avow.solving.z3_sorts import Unsupported

from .meaning import Meaning


def literal(value: Any, sort: s.Sort) -> t.Term:
    match sort:
        case s.EnumSort():
            return t.EnumValue(value, sort)
        case s.DataSort():
            made = sort.constructor(value[0])
            return t.Construct(made.name, tuple(map(literal, value[1:], made.parameters)), sort)
        case s.TupleSort(items=items):
            return t.TupleTerm(tuple(map(literal, value, items)), sort)
        case s.SequenceSort(item=item):
            return t.SequenceTerm(tuple(literal(each, item) for each in value), sort)
        case s.StringSort():
            return t.Literal(value, sort)
    return t.Literal(value if sort == s.BOOL else Fraction(value) if sort == s.REAL else int(value), sort)


def drawn(seed: int) -> tuple[Clause, ...]:
    """None where the type of an empty sequence cannot be told."""
    contract, _ = check_text(small_contract(seed), "drawn.rcl")
    return () if contract is None else contract.nodes[0].clauses


def pairs(seed: int, situations: int) -> Iterator[tuple[t.Term, bool]]:
    """Clauses with values in them, and whether the reference says that they are met."""
    rng, meaning = random.Random(seed), Meaning()
    for clause in drawn(seed):
        free = sorted(free_variables(as_written(clause)), key=lambda v: v.qualified)
        if any(isinstance(part, s.FunctionSort) for v in free for part in s.components(v.sort)):
            continue
        for _ in range(situations):
            step = {v.qualified: rng.choice(domain(v.sort)) for v in free}
            closed = substitute(clause.formula, {v: literal(step[v.qualified], v.sort) for v in free})
            yield closed, meaning.met(as_written(clause), [step])


def scripts(closed: t.Term) -> Iterator[str]:
    """As users and as the kernel's solvers get it; each refuses some forms by name."""
    with contextlib.suppress(Unsupported):
        yield formulas_script([closed])
    with contextlib.suppress(Untranslatable):
        text = Text()
        yield text.script([text.formula(closed, lambda v: (v.name, v.sort))])


def by_script(script: str) -> z3.CheckSatResult:
    solver = z3.Solver()
    solver.set("rlimit", 2_000_000)
    solver.from_string(script)
    return solver.check()


@pytest.mark.parametrize(
    ("seeds", "asked"),
    [
        pytest.param(range(12), 80, id="few"),
        pytest.param(range(12, 90), 500, id="some", marks=pytest.mark.slow),
        pytest.param(range(120, 1500), 10_000, id="many", marks=pytest.mark.nightly),
    ],
)
def test_engines_and_exporters_say_what_the_reference_says(seeds: range, asked: int) -> None:
    seen, unknown = {True: 0, False: 0}, 0
    for seed in seeds:
        for closed, met in pairs(seed, 3):
            shown = seed, show_term(closed, "rcl"), met
            with contextlib.suppress(NotEvaluable):
                assert evaluate(closed, {}) is met, shown
            for script in scripts(closed):
                found = by_script(script)
                assert found in (z3.unknown, z3.sat if met else z3.unsat), shown
                unknown += found == z3.unknown
            seen[met] += 1
    assert sum(seen.values()) >= asked, seen
    assert min(seen.values()) * 5 > asked
    assert unknown * 20 < asked


@pytest.mark.needs_dafny
@pytest.mark.parametrize(
    "seeds",
    [
        pytest.param(range(6), id="few", marks=pytest.mark.slow),
        pytest.param(range(6, 60), id="many", marks=pytest.mark.nightly),
    ],
)
def test_dafny_proves_what_the_reference_says_and_never_its_opposite(seeds: range) -> None:
    proved = asked = 0
    for seed in seeds:
        found = list(pairs(seed, 2))
        if not found:
            continue
        node = checked(small_contract(seed)).nodes[0]
        clauses = [Clause(ClauseKind.GUARANTEE, f"g{k}", k + 1, closed) for k, (closed, _) in enumerate(found)]
        made = generate(replace(node, assumptions=(), guarantees=tuple(clauses)), [c.name for c in clauses])
        uncovered = {name for name, *_ in made.uncovered}
        lemmas = [
            f"  lemma {word}{k}() ensures {sign}Contract.g{k}() {{}}"
            for k in range(len(found))
            for word, sign in (("Is", ""), ("Not", "!"))
            if f"g{k}" not in uncovered
        ]
        check = "\n".join(["module Check {", "  import Contract", *lemmas, "}", ""])
        files = {made.types_file: made.types, made.contract_file: made.contract, "check.dfy": check}
        run = verify(files, Limits(seconds=200), Outside(()))
        assert run.members is not None, run.output
        shown = {m.name for m in run.members if m.kind == "Impl" and m.outcome == "correct"}
        for k, (closed, met) in enumerate(found):
            assert f"{'Not' if met else 'Is'}{k}" not in shown, (seed, show_term(closed, "rcl"))
            proved += f"{'Is' if met else 'Not'}{k}" in shown
            asked += 1
    assert proved * 2 > asked
