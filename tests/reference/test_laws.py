"""Laws that follow from the page: of the reference, and of what Avow has for the same operators."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import product

import pytest
from drawn.memory import TIMED_NODE, timed_formula, word_of
from helpers import some

from avow.base.verdict import Verdict
from avow.evaluation.evaluate import evaluate
from avow.formulas.values import SequenceValue
from avow.language.definedness import defined
from avow.language.load import check_text, parse_formula
from avow.language.operators import OPERATORS, Typing, Why, definition
from avow.language.printer import show_term
from avow.language.sorts import REAL
from avow.language.terms import Builtin, History, Limit, Literal, Not, Operation, Past, Term
from avow.sanity.analysis import analyse

from .meaning import Meaning, NoValue, Word, lasts


def since(f: Term, g: Term, limit: Limit | None) -> History:
    return History(Past.SINCE, (f, g), f.sort, limit)


def seconds(relation: str, amount: int) -> Limit:
    return Limit(relation, Literal(Fraction(amount), REAL), False)


@pytest.mark.parametrize("seed", range(60))
def test_a_limit_that_nothing_reaches_limits_nothing(seed: int) -> None:
    rng = random.Random(seed)
    f, word, meaning = timed_formula(rng, rng.randrange(2)), word_of(rng), Meaning()
    g = rng.choice((timed_formula(rng, rng.randrange(2)), Not(f)))
    for p in range(len(word)):
        ever = meaning.met(since(f, g, None), word, p)
        assert meaning.met(since(f, g, seconds("<=", 1000)), word, p) is ever, (show_term(f, "rcl"), p)
        assert meaning.met(since(f, g, seconds(">=", 0)), word, p) is ever
        assert not meaning.met(since(f, g, seconds(">", 1000)), word, p)


def test_what_began_ends_where_its_denial_begins() -> None:
    """Of every formula: after it, `not G since G` is true for ever, with a limit as long as that says."""
    meaning = Meaning()
    for seed in range(80):
        rng = random.Random(seed)
        g, word = timed_formula(rng, rng.randrange(3)), word_of(rng)
        held = [meaning.met(g, word, p) for p in range(len(word))]
        for p in range(len(word)):
            assert meaning.met(since(Not(g), g, None), word, p) is any(held[: p + 1]), (show_term(g, "rcl"), p)


EVENLY = {  # a value lasts until the next step: what ended is as old as the step after its last
    "once[{0} s](in.a)": "once[{1} steps](in.a)",
    "historically[{0} s](in.a)": "historically[{1} steps](in.a)",
    "held[{0} s](in.a)": "held[{0} steps](in.a)",
    "in.a since[<= {0} s] out.b": "in.a since[<= {1} steps] out.b",
    "not out.b since[<= {0} s] out.b": "not out.b since[<= {1} steps] out.b",
    "in.a since[< {0} s] out.b": "in.a since[< {1} steps] out.b",
    "out.b -> within[{0} s](in.a)": "out.b -> within[{0} steps](in.a)",
    "out.b -> for[{0} s](in.a)": "out.b -> for[{1} steps](in.a)",
    "rose(out.b) -> for[{0} s](in.a)": "rose(out.b) -> for[{0} steps](in.a)",
}


@pytest.mark.parametrize("timed", EVENLY)
def test_where_steps_are_a_second_apart_seconds_are_steps(timed: str) -> None:
    rng, meaning = random.Random(timed), Meaning()
    for n in (1, 2, 3):
        said, counted = (
            parse_formula(text.format(n, n + 1), TIMED_NODE, remembers=True, clause=True)
            for text in (timed, EVENLY[timed])
        )
        for _ in range(30):
            steps = word_of(rng, 10).steps
            word = Word(steps, range(10))
            if "->" in timed:  # a deadline is over only when time goes on
                broken = meaning.broken(said, word)
                step = None if broken is None else word.positions[broken].step
                assert (step if step != 9 else None) == meaning.broken(counted, steps[:9])
            else:
                at_steps = [meaning.met(said, word, word.places[k]) for k in range(9)]
                assert at_steps == [meaning.met(counted, steps, k) for k in range(9)]


SINCE = "inputs( a : BOOL ) outputs( b : BOOL ) topics() guarantee on ( (not a since{0} a) -> out.b )"


@pytest.mark.parametrize("limit", some(["[<= 3 s]", "", "[<= 3 steps]", "[< 3 s]", "[>= 0 s]"], 1, slow=4))
def test_sanity_sees_the_conflict_after_a_negated_side_with_any_limit(limit: str) -> None:
    contract, faults = check_text(f"node n {{ {SINCE.format(limit)} guarantee off ( not out.b or not once(a) ) }}", "n")
    assert contract is not None, faults
    found = {result.name: result.verdict for result in analyse(contract.nodes[0])}
    assert found["realizable"] is Verdict.REFUTED
    assert found["not-vacuous-on"] is not Verdict.REFUTED


# -- having a value ----------------------------------------------------------------------------------------------------

ARGUMENTS = {
    Typing.FORMULA: ("p", "1 / in.x > 0", "in.s(1) > 0"),
    Typing.FORMULAS: ("in.p", "not in.p", "1 / in.x > 0", "in.s(1) > 0"),
    Typing.NUMBER: ("in.x", "1 / in.x", "in.s(1)"),
    Typing.ROOT: ("in.x", "1 / in.x", "in.s(1)", "-in.x"),
    Typing.NUMBERS: ("in.x", "1 / in.x", "in.s(1)"),
    Typing.QUOTIENT: ("in.x", "1 / in.x", "in.s(1)"),
    Typing.WHOLE: ("in.s(1)", "length(in.s)"),
}
NODE = "node n { inputs( p : BOOL, x : REAL, s : <INTEGER> ) outputs( y : BOOL ) topics() guarantee( y ) }"


@pytest.mark.parametrize("name", list(Builtin))
def test_an_operator_has_a_value_just_where_its_definition_has(name: Builtin) -> None:
    """For the reference, and for the conditions that the checker writes out."""
    contract, _ = check_text(NODE, "n.rcl")
    assert contract is not None
    node, row, meaning = contract.nodes[0], OPERATORS[name], Meaning()
    takes = row.takes
    assert not isinstance(takes, Why)
    whole = row.typing is Typing.WHOLE
    strict = []
    for given in product(ARGUMENTS[row.typing], repeat=1 if whole else takes[1] or 3):
        written = f"{name}({', '.join((*given, '2') if whole else given)})"
        claim = parse_formula(written if row.typing.takes_formulas else f"{written} > 0", node)
        term = claim if row.typing.takes_formulas else claim.children[0]
        strict.append(term)
    asked = 0
    for term in strict:
        while not isinstance(term, Operation):
            (term,) = term.children
        meant = definition(term)
        for p, x, s in product((False, True), (0, 2), ((), (1, -1))):
            step = {"in.p": p, "in.x": Fraction(x), "in.s": s}
            values = {**step, "in.s": SequenceValue(s)}
            has = all(_has_value(meaning, part, step) for part in term.arguments)
            has = has and (name != "sqrt" or meaning.value(term.arguments[0], [step]) >= 0)
            has = has and (name != "atan2" or any(meaning.value(each, [step]) for each in term.arguments))
            assert _has_value(meaning, term, step) is has
            assert evaluate(defined(term), values) is has, show_term(term, "rcl")
            if meant is not None:
                assert _has_value(meaning, meant, step) is has, f"{name} is defined where it has no value, or not where"
                assert evaluate(defined(meant), values) is has
            asked += 1
    assert asked


def _has_value(meaning: Meaning, term: Term, step: dict[str, object]) -> bool:
    try:
        meaning.value(term, [step])
    except NoValue:
        return False
    return True


# -- for ever ----------------------------------------------------------------------------------------------------------


def test_a_run_that_goes_round_for_ever() -> None:
    def clause(text: str) -> Term:
        return parse_formula(text, TIMED_NODE, remembers=True, clause=True)

    on, off = ({"in.a": a, "out.b": not a, "in.x": Fraction(0)} for a in (True, False))
    assert lasts(clause("in.a -> eventually(out.b)"), [on], [on, off])
    assert not lasts(clause("in.a -> eventually(out.b)"), [off], [on])
    assert lasts(clause("in.a -> within[2 steps](out.b)"), [on], [on, off])
    assert not lasts(clause("in.a -> within[2 steps](out.b)"), [], [on, on, on, off])
    assert not lasts(clause("not held[4 steps](in.a)"), [], [on])
    assert lasts(clause("once(out.b) or in.a"), [on, on], [off, on])
