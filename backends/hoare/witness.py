"""An input on which the program really breaks a triple, or never ends: found by the solver, then shown by running the
program.

Simple numbers are tried first: those between the thresholds that program and triple mention, then the thresholds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction
from itertools import combinations, pairwise
from typing import assert_never

from avow.base.records import dataclass
from avow.base.verdict import Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import conjunction, equation, free_variables, negation
from avow.formulas.values import Value, show
from avow.formulas.written import value_term
from avow.language import terms as t
from avow.language.sorts import REAL, BoolSort, EnumSort
from avow.language.subterms import subterms
from avow.solving.limits import spent, until
from avow.solving.questions import entails, solve
from avow.solving.replay import replay

from .guesses import NUMERIC, expressions, filled, fits, guesses, numbers, starting_from, stored
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .outline import one_line
from .program import Assign, Block, If, Match, Program, Skip, Update, While, has_loops, statements, variable
from .triples import Triple
from .tuning import ENDLESS_RUNS, LASTING_EFFORT, UNENDED_RUNS
from .wp import Condition, Conditions, TooLarge, defined, weakest


@dataclass(frozen=True, slots=True)
class Breach:
    """A run that meets the precondition and breaks the postcondition. `end` is None where the run stops at a fault."""

    start: Mapping[str, Value]
    end: Mapping[str, Value] | None
    why: str


def breach(triple: Triple, program: Program, failed: Sequence[Condition], effort: int) -> Breach | None:
    """Such a run, or None where none was found. Every answer has been replayed."""
    machine = Machine()
    wanted = starting_from(triple, program)
    for condition in failed:
        if condition.name != "pre":
            continue
        for values in _models(condition, program, wanted, effort):
            found = _shown(triple, program, machine, values)
            if found is not None:
                return found
    if has_loops(program):
        for values in guesses(triple, program, wanted):
            found = _shown(triple, program, machine, values)
            if found is not None:
                return found
            if machine.endless >= ENDLESS_RUNS:
                break
    return None


def _shown(triple: Triple, program: Program, machine: Machine, values: Mapping[t.Variable, Value]) -> Breach | None:
    """Run the program on the values; a breach if the precondition holds of them and the postcondition fails: those that
    the contract states."""
    start = _first_state(triple, program, values)
    if start is None:
        return None
    try:
        end = machine.run(program.body, start)
    except Fault as fault:
        return Breach(start, None, f"the program asks for {fault}")
    except (Endless, NoEnd, NotEvaluable):
        return None
    if not _holds(negation(triple.as_stated.post), end):
        return None
    last = {s.target for s in statements(program.body) if isinstance(s, Assign | Update)}
    outcome = ", ".join(
        f"{v.name} = {show(end[v.name])}" for v in sorted(last & free_variables(triple.post), key=lambda v: v.name)
    )
    return Breach(start, end, f"{one_line(triple.post)} is demanded; the program ends with {outcome or 'it false'}")


def _first_state(triple: Triple, program: Program, values: Mapping[t.Variable, Value]) -> State | None:
    """The program's first state on these values, with the ghosts and the constants that simplifying put away; None
    where it is not certain that the stated precondition holds of them."""
    start: State = {v.name: value for v, value in values.items()}
    try:
        for variable, ghost in program.ghosts.items():
            start[ghost.name] = start[variable.name]
        for constant, value in reversed(triple.stated.fixed if triple.stated else ()):
            start[constant.name] = evaluate(value, start)
    except (KeyError, NotEvaluable):
        return None
    return start if _holds(triple.as_stated.pre, start) else None


def _holds(term: t.Term, state: Mapping[str, Value]) -> bool:
    """Whether a formula certainly holds in a state."""
    try:
        return evaluate(term, state) is True
    except NotEvaluable:
        free = free_variables(term)
        return replay([term], {v: state[v.name] for v in free if v.name in state}) is True


# -- candidates --------------------------------------------------------------------------------------------------------


def _models(
    condition: Condition, program: Program, wanted: tuple[t.Variable, ...], effort: int
) -> Iterator[dict[t.Variable, Value]]:
    """The solver's inputs: first with every number a simple one, then as they come."""
    formulas: list[t.Term] = [*condition.hypotheses, t.Not(condition.goal)]
    fixed: list[t.Term] = []
    between, at = numbers((*formulas, *expressions(program)))
    for term in _observed(formulas, program):
        for pool in (between, at):
            choice = _one_of(term, pool)
            if choice is None:
                continue
            tried = solve([*formulas, *fixed, choice], effort=min(effort, 2000))
            if tried.status != "sat":
                continue
            number = _value(term, tried.values)
            if number is not None:
                fixed.append(t.Compare("==", term, value_term(stored(number, term.sort), term.sort)))
                break
    for extra in ([fixed] if fixed else []) + [[]]:
        found = solve([*formulas, *extra], effort=effort)
        if found.status == "sat":
            yield filled(found.values, wanted)


def _observed(formulas: Sequence[t.Term], program: Program) -> list[t.Term]:
    """What is compared of the inputs' numbers: ``r``, ``level_at(i)``."""
    found: dict[t.Term, None] = {}
    inputs = frozenset(program.state)
    for formula in formulas:
        stack = [side for part in subterms(formula) if isinstance(part, t.Compare) for side in (part.left, part.right)]
        while stack:
            part = stack.pop()
            if isinstance(part, t.Arithmetic | t.Negative | t.Widen):
                stack.extend(part.children)
            is_application = isinstance(part, t.Apply) and all(isinstance(a, t.Variable) for a in part.arguments)
            named = isinstance(part, t.Variable) or is_application
            if named and part.sort in NUMERIC and free_variables(part) <= inputs:
                found.setdefault(part)
    return list(found)[:4]


def _one_of(term: t.Term, pool: Iterable[Fraction]) -> t.Term | None:
    choices = tuple(
        t.Compare("==", term, value_term(stored(n, term.sort), term.sort)) for n in pool if fits(n, term.sort)
    )
    return t.Or(choices) if choices else None


def _value(term: t.Term, values: Mapping[t.Variable, Value]) -> Fraction | None:
    try:
        value = evaluate(term, {v.name: value for v, value in values.items()})
    except NotEvaluable:
        return None
    return Fraction(value) if isinstance(value, int | Fraction) else None


# -- an input on which a program runs for ever -------------------------------------------------------------------------


def endless_run(triple: Triple, program: Program, effort: int) -> Breach | None:
    """A run from the precondition that provably never ends, or None where none was found. Two things show it, and
    nothing else does: a loop's test is met in the same state twice, or the state there meets a predicate that implies
    the test and that the loop's body, by its weakest precondition, keeps."""
    deadline = until(effort)
    machine, given_up = Machine(), 0
    wanted = starting_from(triple, program)
    for values in _candidates(triple, program, wanted):
        if spent() > deadline or given_up >= UNENDED_RUNS:
            return None
        start = _first_state(triple, program, values)
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


def _candidates(
    triple: Triple, program: Program, wanted: tuple[t.Variable, ...]
) -> Iterator[Mapping[t.Variable, Value]]:
    """First the solver's: inputs from which a loop's first round changes nothing, or from which it is entered; then
    guesses. Of earlier loops only the invariants are known, so each guess is tried by running."""
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


def _reached(block: Block, loop: While, goal: t.Term) -> t.Term:
    """What holds where a run comes to the loop, the first time, with the goal true. A guide, not a proof."""
    found: list[t.Term] = []
    for at, statement in enumerate(block):
        match statement:
            case While() if statement == loop:
                inner = goal
            case While(condition=condition, body=body):
                inner = conjunction((condition, _reached(body, loop, goal)))
            case If(condition=condition, then=then, otherwise=otherwise):
                yes, no = (_reached(part, loop, goal) for part in (then, otherwise))
                inner = t.Or((conjunction((condition, yes)), conjunction((negation(condition), no))))
            case Skip() | Assign() | Update() | Match():  # holds no loop
                continue
            case _:
                assert_never(statement)
        found.append(negation(weakest(block[:at], negation(inner), Conditions(t.TRUE))))
    return t.Or((t.Literal(False, t.TRUE.sort), *found))


def _no_change(loop: While) -> t.Term:
    """That a round of the loop is entered and leaves everything as it was."""
    before = {
        s.target: variable(f"{s.target.name}~before", s.target.sort)
        for s in statements(loop.body)
        if isinstance(s, Assign | Update)
    }
    kept = [equation(v, old) for v, old in before.items() if v.sort in NUMERIC or v.sort == t.TRUE.sort]
    try:
        changed = weakest(loop.body, negation(conjunction(kept)), Conditions(t.TRUE))
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
            after = {c: weakest(loop.body, c, Conditions(t.TRUE)) for c in kept}
            lost = {c for c, before in after.items() if not _implied(known, before)}
            if not lost:
                again = conjunction((defined(loop.condition), loop.condition))
                return _implied(known, weakest(loop.body, again, Conditions(t.TRUE)))
            kept = [c for c in kept if c not in lost]
    except (TooLarge, RecursionError):
        return False


def _implied(known: Sequence[t.Term], goal: t.Term) -> bool:
    return entails(known, goal, effort=LASTING_EFFORT).verdict is Verdict.PROVED


def _true(term: t.Term, state: State) -> bool:
    try:
        return evaluate(term, state) is True
    except NotEvaluable:
        return False


def _common(heads: Sequence[State], program: Program) -> Iterator[t.Term]:
    """What does not change from state to state, and which way the numbers and their differences go."""
    numbers: list[tuple[t.Term, list[Fraction]]] = []
    for v in (v for v in program.state if all(v.name in state for state in heads)):
        seen = [state[v.name] for state in heads]
        plain = v.sort in NUMERIC or isinstance(v.sort, BoolSort | EnumSort)
        if plain and all(value == seen[0] for value in seen):
            yield equation(v, value_term(seen[0], v.sort))
        if v.sort in NUMERIC:
            numbers.append((v, [Fraction(value) for value in seen if isinstance(value, int | Fraction)]))
    pairs: list[tuple[t.Term, list[Fraction]]] = [
        (t.Arithmetic("-", _real(one), _real(other), REAL), [a - b for a, b in zip(first, second, strict=True)])
        for (one, first), (other, second) in combinations(numbers, 2)
    ]
    for term, values in (*numbers, *pairs):
        end = t.Literal(values[-1], REAL)
        steps = [b - a for a, b in pairwise(values)]
        if all(step >= 0 for step in steps):
            yield t.Compare(">=", _real(term), end)
        if all(step <= 0 for step in steps):
            yield t.Compare("<=", _real(term), end)


def _real(term: t.Term) -> t.Term:
    return term if term.sort == REAL else t.Widen(term, REAL)
