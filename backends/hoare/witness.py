"""An input on which the program really breaks a triple: found by the solver, then shown by running the program.

Simple numbers are tried first: those between the thresholds that program and triple mention, then the thresholds.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from fractions import Fraction

from avow.base.records import dataclass
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, negation
from avow.formulas.values import Value, show
from avow.language.sorts import REAL, Sort
from avow.language.subterms import subterms
from avow.language.terms import Apply, Arithmetic, Compare, Literal, Negative, Not, Or, Term, Variable, Widen
from avow.solving.questions import solve
from avow.solving.replay import replay

from .guesses import NUMERIC, expressions, filled, fits, guesses, numbers, starting_from
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .outline import one_line
from .program import Assign, Program, Update, has_loops, statements
from .triples import Triple
from .tuning import ENDLESS_RUNS
from .wp import Condition


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


def _shown(triple: Triple, program: Program, machine: Machine, values: Mapping[Variable, Value]) -> Breach | None:
    """Run the program on the values; a breach if the precondition holds of them and the postcondition fails: those that
    the contract states."""
    start = first_state(triple, program, values)
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


def first_state(triple: Triple, program: Program, values: Mapping[Variable, Value]) -> State | None:
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


def _holds(term: Term, state: Mapping[str, Value]) -> bool:
    """Whether a formula certainly holds in a state."""
    try:
        return evaluate(term, state) is True
    except NotEvaluable:
        free = free_variables(term)
        return replay([term], {v: state[v.name] for v in free if v.name in state}) is True


# -- candidates --------------------------------------------------------------------------------------------------------


def _models(
    condition: Condition, program: Program, wanted: tuple[Variable, ...], effort: int
) -> Iterator[dict[Variable, Value]]:
    """The solver's inputs: first with every number a simple one, then as they come."""
    formulas: list[Term] = [*condition.hypotheses, Not(condition.goal)]
    fixed: list[Term] = []
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
                fixed.append(Compare("==", term, _literal(number, term.sort)))
                break
    for extra in ([fixed] if fixed else []) + [[]]:
        found = solve([*formulas, *extra], effort=effort)
        if found.status == "sat":
            yield filled(found.values, wanted)


def _observed(formulas: Sequence[Term], program: Program) -> list[Term]:
    """What is compared of the inputs' numbers: ``r``, ``level_at(i)``."""
    found: dict[Term, None] = {}
    inputs = frozenset(program.state)
    for formula in formulas:
        stack = [side for part in subterms(formula) if isinstance(part, Compare) for side in (part.left, part.right)]
        while stack:
            part = stack.pop()
            if isinstance(part, Arithmetic | Negative | Widen):
                stack.extend(part.children)
            is_application = isinstance(part, Apply) and all(isinstance(a, Variable) for a in part.arguments)
            named = isinstance(part, Variable) or is_application
            if named and part.sort in NUMERIC and free_variables(part) <= inputs:
                found.setdefault(part)
    return list(found)[:4]


def _one_of(term: Term, pool: Iterable[Fraction]) -> Term | None:
    choices = tuple(Compare("==", term, _literal(n, term.sort)) for n in pool if fits(n, term.sort))
    return Or(choices) if choices else None


def _literal(number: Fraction, sort: Sort) -> Literal:
    return Literal(number, REAL) if sort == REAL else Literal(int(number), sort)


def _value(term: Term, values: Mapping[Variable, Value]) -> Fraction | None:
    try:
        value = evaluate(term, {v.name: value for v, value in values.items()})
    except NotEvaluable:
        return None
    return Fraction(value) if isinstance(value, int | Fraction) else None


__all__ = ["Breach", "breach", "first_state"]
