"""Programs for random contracts so small that every case can be written out: Hoare's logic proves what the reference
says of all inputs, and it and generated tests refute nothing else."""

from __future__ import annotations

import random
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from drawn.contracts import small_contract
from hoare.systems import make_job
from oracle.domains import as_written, situations

from avow.backend_kit.protocol import Limits
from avow.backends.hoare import BACKEND as HOARE
from avow.backends.hypothesis import BACKEND as HYPOTHESIS
from avow.base.verdict import Verdict
from avow.language import sorts as s
from avow.language.contract import Clause
from avow.language.load import check_text
from avow.language.printer import show_term

from .meaning import Meaning, Step
from .test_engines import literal

MEANING = Meaning()


class Case(NamedTuple):
    """A contract, a program for it as text (Hoare's, and Python), and the guarantees that an allowed input breaks."""

    rcl: str
    hoare: str
    python: str
    broken: set[str]


def met(clause: Clause, step: Step) -> bool:
    return MEANING.met(as_written(clause), [step])


def made(seed: int) -> Case | None:
    """The program gives one answer where an input has a certain value, and another elsewhere; most are chosen to keep
    many guarantees. None: no input is allowed, a port is a function, or the type of an empty sequence is not known."""
    rcl, rng = small_contract(seed), random.Random(seed)
    contract, _ = check_text(rcl, "n.rcl")
    if contract is None:
        return None
    node = contract.nodes[0]
    if any(isinstance(part, s.FunctionSort) for p in (*node.inputs, *node.outputs) for part in s.components(p.sort)):
        return None
    given = [i for i in situations(p.variable for p in node.inputs) if all(met(a, i) for a in node.assumptions)]
    if not given or not node.inputs:
        return None
    outputs, port = situations(p.variable for p in node.outputs), rng.choice(node.inputs)
    at = rng.choice(given)[port.variable.qualified]
    answers: dict[bool, Step] = {}
    for here in (True, False):
        shown = [i for i in given if (i[port.variable.qualified] == at) is here]
        shown = rng.sample(shown, min(4, len(shown)))
        tried = rng.sample(outputs, min(len(outputs), rng.choice([1, 30, 30])))
        answers[here] = max(tried, key=lambda o: sum(met(g, {**i, **o}) for i in shown for g in node.guarantees))
    ends = [{**i, **answers[i[port.variable.qualified] == at]} for i in given]

    def written(value: Any, sort: s.Sort) -> str:
        return show_term(literal(value, sort), "rcl").translate(str.maketrans("<>", "[]"))  # sequences

    hoare, python = ["", ""], ["", ""]
    for k, answer in enumerate(answers.values()):
        values = {p: answer[p.variable.qualified] for p in node.outputs}
        hoare[k] = "\n".join(f"  {p.name} := {written(value, p.sort)}" for p, value in values.items())
        python[k] = repr({p.name: value for p, value in values.items()})
    names = ", ".join(p.name for p in node.inputs)
    return Case(
        rcl,
        f"IF {port.name} == {written(at, port.sort)} THEN\n{hoare[0]}\nELSE\n{hoare[1]}\n",
        "from fractions import Fraction\n\n\n"
        f"def step({names}):\n    return {python[0]} if {port.name} == {at!r} else {python[1]}\n",
        {g.name for g in node.guarantees if not all(met(g, end) for end in ends)},
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tool", "seeds"),
    [
        ("hoare", range(60)),
        ("hypothesis", range(100, 120)),
        pytest.param("hoare", range(200, 800), marks=pytest.mark.nightly),
        pytest.param("hypothesis", range(800, 1000), marks=pytest.mark.nightly),
    ],
)
def test_a_program_is_judged_as_the_reference_judges_it(tool: str, seeds: range, tmp_path: Path) -> None:
    backend, seen = {"hoare": HOARE, "hypothesis": HYPOTHESIS}[tool], Counter[Verdict]()
    for seed in seeds:
        if (case := made(seed)) is None:
            continue
        options, files = ({"program": "n.imp"}, {"n.imp": case.hoare})
        if tool == "hypothesis":
            options, files = {"subject": "s.py:step", "cases": 100}, {"s.py": case.python}
        job = make_job(tmp_path / str(seed), case.rcl, "n", options, files, tool)
        assert not [d for d in backend.check(job) if d.is_error], (case, backend.check(job))
        for outcome in backend.discharge(job, job.root, Limits(seconds=30)).outcomes:
            broken = outcome.obligation.rpartition("/")[2] in case.broken
            assert outcome.verdict is not (Verdict.PROVED if broken else Verdict.REFUTED), (seed, case, outcome)
            seen[outcome.verdict] += 1
    assert seen[Verdict.REFUTED] > 2, seen
    assert tool == "hypothesis" or seen[Verdict.PROVED] > 2, seen
