"""Limits in seconds: cells against the definitions over all positions of timed words; mutants of the compiler die."""

from __future__ import annotations

import random
from collections.abc import Mapping
from fractions import Fraction

import pytest
from drawn.memory import TIMED_NODE, timed_formula, timed_response, word_of
from reference.meaning import Meaning, Word

from avow.evaluation.evaluate import evaluate
from avow.evaluation.running import Keeper
from avow.formulas.temporal import ages, clock
from avow.formulas.temporal.ages import CLOCK, ELAPSED, Lasting, Side
from avow.formulas.temporal.cell import Unsaid
from avow.formulas.temporal.clock import Timed, longest_limit
from avow.formulas.values import Value
from avow.language.load import parse_formula
from avow.language.printer import show_term
from avow.language.sorts import BOOL
from avow.language.subterms import timed
from avow.language.terms import FALSE, Implies, Term


def ports(word: Word, k: int) -> dict[str, Value]:
    step = dict(word.steps[k])
    dt = Fraction(word.times[k] - word.times[k - 1]) if k else Fraction(5)
    arrived = {f"in.arrived {name}#": step.pop(f"in.arrived {name}") for name in ("a",)}
    return {**step, **arrived, CLOCK.qualified: dt}


def along(
    word: Word, records: Timed, clause: Term, positions: Lasting, instants: Mapping[Side, Term], response: bool = True
) -> tuple[list[bool], list[bool]]:
    """A clause at each step, with the silence before it, and its value at every position, by its cells. A response may
    be broken right after an instant, and not later."""
    keeper, judged, values = Keeper(records.cells), list[bool](), list[bool]()
    for k in range(len(word.steps)):
        memory = dict(keeper.memory)
        silent = lambda elapsed, side=Side.AT: bool(  # noqa: E731
            evaluate(instants[side], {**memory, ELAPSED.qualified: elapsed})  # noqa: B023
        )
        for at in range(word.times[k - 1], word.times[k]) if k else ():
            elapsed = Fraction(at - word.times[k - 1])
            if elapsed:
                values.append(silent(elapsed))
            after, middle = silent(elapsed, Side.AFTER), silent(elapsed + Fraction(1, 2))
            values.append(after and middle)
            # all of an open interval is alike
            assert silent(elapsed + 1, Side.BEFORE) is middle
            assert after is middle or response
        at_step = keeper.at(ports(word, k))
        judged.append(bool(evaluate(clause, at_step)))
        values.append(bool(evaluate(positions.now, at_step)))
        keeper.advance(ports(word, k))
    return judged, values


def disagreement(rng: random.Random, depth: int) -> str | None:
    """A formula of which cells and definition say something else somewhere in a word; empty where it is not said."""
    term, word = timed_formula(rng, depth), word_of(rng)
    trigger, response = timed_response(rng, depth - 1)
    meaning = Meaning()
    for whole in (term, Implies(trigger, response)):
        if timed(whole) is None:
            continue
        records = Timed(longest=longest_limit([whole]))
        try:
            clause = records.clause(whole)
            positions = records.positions(whole)
            instants, _ = records.instants(positions)
        except Unsaid:
            continue
        shown = show_term(whole, "rcl")
        try:
            judged, values = along(word, records, clause, positions, instants, whole is not term)
        except AssertionError:
            return f"{shown}: an interval is not alike"
        places = range(len(word.positions))
        if whole is term:
            expected = [meaning.met(term, word, p) for p in places]
            if values != expected:
                return f"{shown}: {[p for p in places if values[p] != expected[p]]} of {word.times}"
        else:
            first = next((p for p in places if not values[p]), None)
            if first != meaning.broken(whole, word):
                return f"{shown}: first broken {first}, {meaning.broken(whole, word)} of {word}"
        for k in range(len(word.steps)):  # a step tells of itself, and of the silence before it unless it was told then
            before = word.places[k - 1] + 1 if k else 0
            told = k > 0 and not values[before - 1]
            if judged[k] != all(values[before : word.places[k] + 1]) and not told:
                return f"{shown}: at step {k}"
    return None


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_cells_are_what_the_definitions_say(seed: int) -> None:
    rng = random.Random(seed)
    assert [found for _ in range(80) if (found := disagreement(rng, rng.choice((1, 2, 2, 3)))) is not None] == []


def test_what_a_step_has_had_is_not_demanded_again_right_after_it() -> None:
    """Where the trigger is so for that instant alone."""
    text = "(once[1 s](in.a) and not in.a) -> within[0 s](arrived(in.a))"
    records = Timed(longest=Fraction(1))
    whole = parse_formula(text, TIMED_NODE, remembers=True, clause=True)
    clause, positions = records.clause(whole), records.positions(whole)
    for seed in (11, 24, 35, 39):
        along(word_of(random.Random(seed)), records, clause, positions, records.instants(positions)[0])


_older, _kind = ages.Record._older, clock._kind

MUTANTS: dict[str, tuple[object, str, object]] = {
    "ages stand still": (ages.Record, "_older", lambda self, kept, length: kept),
    "ages run twice as fast": (ages.Record, "_older", lambda self, a, b: _older(self, _older(self, a, b), b)),
    "an instant is as the times around it": (ages, "sided", lambda relation, side: relation),
    "the latest beginning in place of the earliest": (
        clock, "_kind", lambda term: ages.Kind.LATEST if term.limit is not None else _kind(term),
    ),
    "silence is as nothing were": (Timed, "_held", lambda self, last: FALSE if last.sort == BOOL else last),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_mutants_die(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    where, attribute, mutant = MUTANTS[name]
    monkeypatch.setattr(where, attribute, mutant)
    rng = random.Random(7)
    assert any(disagreement(rng, 2) is not None for _ in range(150))
