"""Clauses made of sentences against FRET's semantics in its own words: intervals, triggers, what is required there.

The same clauses were held against the formulas of past time that FRET publishes, for each of its templates.
"""

from __future__ import annotations

import random
from itertools import product

import pytest
from reference.meaning import breaks

from avow.fretish.meaning import Unsaid, demands, remarks
from avow.fretish.sentence import Condition, Duration, Expression, Scope, Sentence, Timing, parse
from avow.language.load import check_text
from avow.language.terms import Term

N = 2
Run = list[dict[str, bool]]


def intervals(scope: Scope, m: list[bool]) -> list[tuple[int, int, bool]]:
    """First and last step, and whether it has ended."""
    last = len(m) - 1
    first = next((k for k, now in enumerate(m) if now), None)
    fell = next((k for k in range(1, len(m)) if m[k - 1] and not m[k]), None)
    match scope:
        case Scope.ALWAYS:
            return [(0, last, False)]
        case Scope.IN | Scope.NOT_IN | Scope.ONLY_IN:
            here = m if scope is Scope.IN else [not now for now in m]
            starts = [k for k in range(len(m)) if here[k] and (k == 0 or not here[k - 1])]
            ends = [next((k - 1 for k in range(s, len(m)) if not here[k]), last) for s in starts]
            return [(s, e, e < last) for s, e in zip(starts, ends, strict=True)]
        case Scope.BEFORE:
            return [] if first == 0 else [(0, last, False) if first is None else (0, first - 1, True)]
        case Scope.ONLY_BEFORE:
            return [] if first is None else [(first, last, False)]
        case Scope.AFTER:
            return [] if fell is None else [(fell, last, False)]
        case Scope.ONLY_AFTER:
            return [(0, last, False) if fell is None else (0, fell - 1, True)]


def triggers(condition: Condition, c: list[bool], a: int, b: int) -> list[int]:
    match condition:
        case Condition.NONE:
            return [a]
        case Condition.REGULAR:
            return [k for k in range(a, b + 1) if c[k] and (k == a or not c[k - 1])]
        case Condition.HOLDING:
            return [k for k in range(a, b + 1) if c[k]]


def kept(timing: Timing, r: list[bool], s: list[bool], t: int, b: int, ended: bool) -> bool:
    due = t + N
    match timing:
        case Timing.IMMEDIATELY:
            return r[t]
        case Timing.NEXT:
            return t + 1 > b or r[t + 1]
        case Timing.WITHIN:
            return due > b or any(r[t : due + 1])
        case Timing.FOR:
            return all(r[t : min(b, due) + 1])
        case Timing.AFTER:
            return not any(r[t : min(b, due) + 1]) and (due + 1 > b or r[due + 1])
        case Timing.UNTIL:
            stop = next((k for k in range(t, b + 1) if s[k]), b + 1)
            return all(r[t:stop])
        case Timing.BEFORE:
            return all(any(r[t:k]) for k in range(t, b + 1) if s[k])
        case Timing.EVENTUALLY:
            return not ended or any(r[t : b + 1])
        case Timing.ALWAYS:
            return all(r[t : b + 1])
        case Timing.NEVER:
            return not any(r[t : b + 1])
        case Timing.FINALLY:
            return not ended or r[b]


def came_about(timing: Timing, r: list[bool], s: list[bool], t: int, b: int, ended: bool) -> bool:
    """What must not, where the scope is `only`."""
    due = t + N
    match timing:
        case Timing.IMMEDIATELY:
            return r[t]
        case Timing.NEXT:
            return t + 1 <= b and r[t + 1]
        case Timing.WITHIN:
            return any(r[t : min(b, due) + 1])
        case Timing.FOR:
            return due <= b and all(r[t : due + 1])
        case Timing.UNTIL:
            return any(s[k] and all(r[t:k]) for k in range(t, b + 1))
        case Timing.BEFORE:
            return any(r[k] and not any(s[t : k + 1]) for k in range(t, b + 1))
        case Timing.EVENTUALLY:
            return any(r[t : b + 1])
        case Timing.ALWAYS:
            return ended and all(r[t : b + 1])
        case Timing.NEVER:
            return ended and not any(r[t : b + 1])
        case Timing.FINALLY:
            return ended and r[b]
        case Timing.AFTER:
            raise AssertionError(timing)


def required(sentence: Sentence, run: Run) -> bool:
    m, c, r, s = ([step[f"in.{name}"] for step in run] for name in "mcrs")
    only = sentence.scope in (Scope.ONLY_IN, Scope.ONLY_BEFORE, Scope.ONLY_AFTER)
    for a, b, ended in intervals(sentence.scope, m):
        for t in triggers(sentence.condition, c, a, b):
            if only and came_about(sentence.timing, r, s, t, b, ended):
                return False
            if not only and not kept(sentence.timing, r, s, t, b, ended):
                return False
    return True


def say(part: Expression) -> str:
    return f"in.{part.text}" if part.sign == "name" else f"(not {say(*part.parts)})"


def name(text: str) -> Expression:
    return Expression("name", text=text)


def clauses(sentence: Sentence) -> list[Term]:
    made = " ".join(f"guarantee g{k} ( {d.formula} )" for k, d in enumerate(demands(sentence, say)))
    ports = "inputs( m : BOOL, c : BOOL, r : BOOL, s : BOOL ) outputs( o : BOOL ) topics()"
    contract, diagnostics = check_text(f"node n {{ {ports} {made} }}", "x.rcl")
    assert contract is not None, diagnostics
    return [clause.formula for clause in contract.nodes[0].guarantees]


TEMPLATES = [
    Sentence("n", name("r"), timing, scope, name("m"), condition, name("c"), name("s"), Duration(str(N), "steps"))
    for scope, condition, timing in product(Scope, Condition, Timing)
]


@pytest.mark.parametrize("scope", Scope)
def test_clauses_say_what_fret_says(scope: Scope) -> None:
    rng = random.Random(str(scope))
    unsaid = set()
    for sentence in TEMPLATES:
        if sentence.scope is not scope:
            continue
        try:
            formulas = clauses(sentence)
        except Unsaid:
            unsaid.add(sentence.timing)
            continue
        told = False
        for k in range(600):
            if k > 60 and told:
                break
            often = rng.choice((0.3, 0.7, 0.9))
            run = [
                {f"in.{name}": rng.random() < share for name, share in zip("mcrs", (often, 0.4, 0.6, 0.3), strict=True)}
                for _ in range(rng.randint(1, 7))
            ]
            wanted = required(sentence, run)
            told = told or not wanted
            assert (not any(breaks(formula, run) for formula in formulas)) is wanted, (sentence, run)
        endless = (
            (Timing.EVENTUALLY, Timing.ALWAYS, Timing.NEVER) if scope is Scope.ONLY_BEFORE else (Timing.EVENTUALLY,)
        )
        assert told or sentence.timing in endless, f"no run that breaks {sentence} was tried"
    only = {Timing.AFTER} if scope in (Scope.ONLY_IN, Scope.ONLY_BEFORE, Scope.ONLY_AFTER) else set()
    never_ending = {Timing.FINALLY} if scope in (Scope.ALWAYS, Scope.AFTER, Scope.ONLY_BEFORE) else set()
    assert unsaid == only | never_ending


@pytest.mark.parametrize(
    ("text", "remarked"),
    [
        ("in m mode the node shall at the next timepoint satisfy r", 1),
        ("in m mode the node shall immediately satisfy r", 0),
        ("upon c the node shall always satisfy r", 1),
        ("whenever c the node shall always satisfy r", 0),
        ("after m mode the node shall immediately satisfy r", 1),
    ],
)
def test_what_is_often_not_meant_is_remarked(text: str, remarked: int) -> None:
    assert len(remarks(parse(text))) == remarked
