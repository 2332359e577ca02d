"""An input on which a program runs for ever.

Two things show it of a run, and nothing else does: a loop's test is met in the same state twice, or the state there
meets a predicate that implies the test and that the loop's body, by its weakest precondition, keeps.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, pairwise
from typing import assert_never

from avow.base.verdict import Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import conjunction, equation, negation
from avow.formulas.values import Element, Value
from avow.language.sorts import INTEGER, REAL, EnumSort, Sort
from avow.language.terms import TRUE, Arithmetic, Compare, EnumValue, Literal, Or, Term, Variable, Widen
from avow.solving.limits import spent, until
from avow.solving.questions import entails, solve

from .guesses import NUMERIC, filled, guesses, starting_from
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .program import Assign, Block, If, Match, Program, Skip, Update, While, statements, variable
from .triples import Triple
from .tuning import LASTING_EFFORT, UNENDED_RUNS
from .witness import Breach, first_state
from .wp import Conditions, TooLarge, defined, weakest


def endless_run(triple: Triple, program: Program, effort: int) -> Breach | None:
    """A run from the precondition that provably never ends, or None where none was found."""
    deadline = until(effort)
    machine, given_up = Machine(), 0
    wanted = starting_from(triple, program)
    for values in _candidates(triple, program, wanted):
        if spent() > deadline or given_up >= UNENDED_RUNS:
            return None
        start = first_state(triple, program, values)
        if start is None:
            continue
        try:
            machine.run(program.body, start)
        except Endless as endless:
            return Breach(start, None, str(endless))
        except NoEnd as no_end:
            given_up += 1
            if no_end.loop is not None and goes_on(no_end.loop, no_end.heads, program):
                return Breach(start, None, f"the loop at line {no_end.loop.span.line} never ends")
        except (Fault, NotEvaluable):
            continue
    return None


def _candidates(triple: Triple, program: Program, wanted: tuple[Variable, ...]) -> Iterator[Mapping[Variable, Value]]:
    """First the solver's: inputs from which a loop's first round changes nothing, or from which it is entered; then
    guesses. What is said of loops passed before is only what their invariants say: each is tried by running."""
    for loop in (s for s in statements(program.body) if isinstance(s, While)):
        for goal in (_no_change(loop), loop.condition):
            try:
                reached = _reached(program.body, loop, goal)
            except TooLarge:
                continue
            found = solve([triple.full_pre, reached], effort=LASTING_EFFORT)
            if found.status == "sat":
                yield filled(found.values, wanted)
    yield from guesses(triple, program, wanted)


def _reached(block: Block, loop: While, goal: Term) -> Term:
    """What holds where a run comes to the loop, the first time, with the goal true. A guide, not a proof."""
    found: list[Term] = []
    for at, statement in enumerate(block):
        match statement:
            case While() if statement == loop:
                inner = goal
            case While(condition=condition, body=body):
                inner = conjunction((condition, _reached(body, loop, goal)))
            case If(condition=condition, then=then, otherwise=otherwise):
                yes, no = (_reached(part, loop, goal) for part in (then, otherwise))
                inner = Or((conjunction((condition, yes)), conjunction((negation(condition), no))))
            case Skip() | Assign() | Update() | Match():  # holds no loop
                continue
            case _:
                assert_never(statement)
        found.append(negation(weakest(block[:at], negation(inner), Conditions(TRUE))))
    return Or((Literal(False, TRUE.sort), *found))


def _no_change(loop: While) -> Term:
    """That a round of the loop is entered and leaves everything as it was."""
    before = {
        s.target: variable(f"{s.target.name}~before", s.target.sort)
        for s in statements(loop.body)
        if isinstance(s, Assign | Update)
    }
    kept = [equation(v, old) for v, old in before.items() if v.sort in NUMERIC or v.sort == TRUE.sort]
    try:
        changed = weakest(loop.body, negation(conjunction(kept)), Conditions(TRUE))
    except TooLarge:
        return loop.condition
    return conjunction((loop.condition, *kept, negation(changed)))


# -- a predicate that lasts --------------------------------------------------------------------------------------------


def goes_on(loop: While, heads: Sequence[State], program: Program) -> bool:
    """Whether the loop, from the last of the states, which meets its test, provably never ends.

    Candidates are what the states have in common; those that a round may break are dropped until the rest, with the
    test, is kept by the body, test and all. A loop within the body is no obstacle to that being so, but to showing it.
    """
    if any(isinstance(s, While) for s in statements(loop.body)) or len(heads) < 2:
        return False
    last = heads[-1]
    kept = [c for c in _common(heads, program) if _true(c, last)]
    if not _true(loop.condition, last):
        return False
    try:
        while True:
            known = [loop.condition, *kept]
            after = {c: weakest(loop.body, c, Conditions(TRUE)) for c in kept}
            lost = {c for c, before in after.items() if not _implied(known, before)}
            if not lost:
                again = conjunction((defined(loop.condition), loop.condition))
                return _implied(known, weakest(loop.body, again, Conditions(TRUE)))
            kept = [c for c in kept if c not in lost]
    except (TooLarge, RecursionError):
        return False


def _implied(known: Sequence[Term], goal: Term) -> bool:
    return entails(known, goal, effort=LASTING_EFFORT).verdict is Verdict.PROVED


def _true(term: Term, state: State) -> bool:
    try:
        return evaluate(term, state) is True
    except NotEvaluable:
        return False


def _common(heads: Sequence[State], program: Program) -> Iterator[Term]:
    """What does not change from state to state, and which way the numbers and their differences go."""
    numbers: list[tuple[Term, list[Fraction]]] = []
    for v in (v for v in program.state if all(v.name in state for state in heads)):
        seen = [state[v.name] for state in heads]
        fixed = _term(seen[0], v.sort)
        if fixed is not None and all(value == seen[0] for value in seen):
            yield equation(v, fixed)
        if v.sort in NUMERIC:
            numbers.append((v, [Fraction(value) for value in seen if isinstance(value, int | Fraction)]))
    pairs: list[tuple[Term, list[Fraction]]] = [
        (Arithmetic("-", _real(one), _real(other), REAL), [a - b for a, b in zip(first, second, strict=True)])
        for (one, first), (other, second) in combinations(numbers, 2)
    ]
    for term, values in (*numbers, *pairs):
        end = Literal(values[-1], REAL)
        steps = [b - a for a, b in pairwise(values)]
        if all(step >= 0 for step in steps):
            yield Compare(">=", _real(term), end)
        if all(step <= 0 for step in steps):
            yield Compare("<=", _real(term), end)


def _real(term: Term) -> Term:
    return term if term.sort == REAL else Widen(term, REAL)


def _term(value: Value, sort: Sort) -> Term | None:
    match value:
        case bool():
            return Literal(value, sort)
        case int() | Fraction() if sort in NUMERIC:
            return Literal(value if sort == REAL else int(value), INTEGER if value < 0 and sort != REAL else sort)
        case Element(name=name) if isinstance(sort, EnumSort):
            return EnumValue(name, sort)
    return None


__all__ = ["endless_run", "goes_on"]
