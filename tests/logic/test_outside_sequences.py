"""What lies outside a sequence settles nothing: no claim may rest on a value that was made up for it."""

from __future__ import annotations

import pytest

from avow.base.verdict import Verdict
from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.formulas.values import SequenceValue
from avow.language.definedness import defined
from avow.language.sorts import BOOL, NATURAL, Constructor, DataSort, SequenceSort, TupleSort
from avow.sanity.analysis import analyse
from avow.sanity.results import Bounds
from avow.solving.translation import Translator
from avow.solving.z3_module import z3

from .contracts import formula, node

SHORT = node("inputs() outputs( s : <INTEGER>, b : BOOL ) | guarantee( length(out.s) < 3 ) guarantee( out.b )")


@pytest.mark.slow
@pytest.mark.parametrize(
    "clause",
    [
        "out.s(5) == 0 -> length(out.s) > 10",
        "not (out.s(5) == 0) or length(out.s) > 10",
        "not (out.s(5) == 0 and length(out.s) < 10)",
    ],
)
def test_an_output_whose_guarantee_has_no_value_is_no_answer(clause: str) -> None:
    own = node(f"inputs() outputs( s : <INTEGER> ) | guarantee( length(out.s) < 3 ) guarantee( {clause} )")
    (result,) = analyse(own, bounds=Bounds(100), wanted=["realizable"])
    assert result.verdict is Verdict.REFUTED


@pytest.mark.parametrize(
    ("text", "short", "at_one"),
    [
        ("s(1) == 0 -> b", False, True),
        ("b -> s(1) == 0", False, True),
        ("length(s) > 1 -> s(1) == 0", True, True),
        ("s(1) == 0 -> length(s) > 1", False, True),
        ("s(1) == 0 and length(s) > 1", True, True),
        ("s(1) == 0 or length(s) < 2", True, True),
        ("s(1) == 0 <=> length(s) > 1", False, True),
        ("forall(i in NATURAL | i < length(s) -> s(i) == 0)", True, True),
        ("forall(i in NATURAL | s(i) == 0 -> i < length(s))", False, False),
    ],
)
def test_the_condition_says_when_nothing_outside_matters(text: str, short: bool, at_one: bool) -> None:
    """For `b` that does not settle the formula by itself: sequences of one element, and of two."""
    condition = defined(formula(text, SHORT))
    for items, expected in (((0,), short), ((0, 0), at_one)):
        for b in (False, True) if expected else ("b -> s" in text,):
            try:
                holds = bool(compile_term(condition)({"out.s": SequenceValue(items), "out.b": b}))
            except NotEvaluable:
                holds = False
            assert holds is expected


def test_what_lies_outside_is_of_the_sort_of_the_elements() -> None:
    """Also where the elements have parts: Z3's own element outside a sequence may be ``go(-1)`` for ``go(NATURAL)``."""
    order = DataSort("Order", (Constructor("halt", ()), Constructor("go", (NATURAL, BOOL))))
    context = Translator()
    for sort in (NATURAL, TupleSort((NATURAL, BOOL)), order, SequenceSort(NATURAL)):
        anything = context.fresh("x", sort)
        member, inside = context.member(sort, anything), context.member(sort, context.clamped(anything, sort))
        solver = z3.Solver(ctx=context.context)
        solver.add(z3.Not(inside))
        assert solver.check() == z3.unsat
        solver = z3.Solver(ctx=context.context)
        solver.add(member, z3.Not(context.clamped(anything, sort) == anything))
        assert solver.check() == z3.unsat
