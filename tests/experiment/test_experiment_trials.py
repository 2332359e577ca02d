"""Which rows are trials: on random guarantees over finite types, against all outputs that an input may have."""

from __future__ import annotations

import itertools
import random
from dataclasses import replace

from drawn.contracts import INPUTS, OUTPUTS, finite_formulas
from drawn.memory import clause, run_of
from hypothesis import given, settings
from hypothesis import strategies as st
from reference.meaning import broken

from avow.backends.experiment.judging import claim, judged
from avow.evaluation.evaluate import evaluate
from avow.formulas.temporal.cell import Unsaid
from avow.formulas.values import Element, FunctionValue, Value
from avow.language.contract import Clause, ClauseKind
from avow.language.terms import TRUE, Term

COLOURS = tuple(map(Element, ("red", "green", "blue")))
CLAUSE = Clause(ClauseKind.GUARANTEE, "g", 1, TRUE)
IN, OUT = tuple(v.qualified for v in INPUTS), tuple(v.qualified for v in OUTPUTS)
ANSWERS = [dict(zip(OUT, answer, strict=True)) for answer in itertools.product((False, True), COLOURS)]


@given(finite_formulas(), st.sets(st.sampled_from(COLOURS)))
@settings(max_examples=60, deadline=None)
def test_a_row_is_a_trial_only_where_some_answer_would_fail(formula: Term, held: set[Element]) -> None:
    asked = claim(replace(CLAUSE, formula=formula), (), (), {*IN, *OUT})
    relation = FunctionValue({(colour,): True for colour in held}, False)
    for b, c in itertools.product((False, True), COLOURS):
        inputs: dict[str, Value] = dict(zip(IN, (b, c, relation), strict=True))
        fails = [evaluate(formula, inputs | answer) is not True for answer in ANSWERS]
        for answer, failing in zip(ANSWERS, fails, strict=True):
            found = judged(asked, [inputs | answer])
            assert (found.broken is not None) == failing
            if found.met or found.asked:
                assert any(fails), "no answer to these inputs fails: the row shows nothing"


@given(st.integers(0, 2**32))
@settings(max_examples=150, deadline=None)
def test_a_run_is_judged_as_the_page_of_the_language_says(seed: int) -> None:
    rng = random.Random(seed)
    formula, run = clause(rng), run_of(rng)
    try:
        asked = claim(replace(CLAUSE, formula=formula), (), (), {"in.a", "in.n", "out.b"})
    except Unsaid:  # the backend is not asked about it
        return
    assert judged(asked, run).broken == broken(formula, run)
