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
from avow.formulas.written import value_term
from avow.language import terms as t
from avow.language.subterms import subterms
from avow.solving.questions import solve
from avow.solving.replay import replay

from .guesses import NUMERIC, expressions, filled, fits, guesses, numbers, starting_from, stored
from .interpreter import Endless, Fault, Machine, NoEnd, State
from .program import Assign, Program, Update, has_loops, statements
from .triples import Triple, one_line
from .tuning import ENDLESS_RUNS
from .wp import Condition


@dataclass(frozen=True, slots=True)
class Breach:
    """A run that meets the precondition and breaks the postcondition. `end` is None where the run has no end: it stops
    at a fault, or comes back to a state for ever."""

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
    the contract states. A run without an end breaks any: the node promises an output."""
    start = _first_state(triple, program, values)
    if start is None:
        return None
    try:
        end = machine.run(program.body, start)
    except Fault as fault:
        return Breach(start, None, f"the program asks for {fault}")
    except Endless as endless:
        return Breach(start, None, str(endless))
    except (NoEnd, NotEvaluable):
        return None
    if not _holds(negation(triple.post), end):
        return None
    last = {s.target for s in statements(program.body) if isinstance(s, Assign | Update)}
    outcome = ", ".join(
        f"{v.name} = {show(end[v.name])}" for v in sorted(last & free_variables(triple.post), key=lambda v: v.name)
    )
    return Breach(start, end, f"{one_line(triple.post)} is demanded; the program ends with {outcome or 'it false'}")


def _first_state(triple: Triple, program: Program, values: Mapping[t.Variable, Value]) -> State | None:
    """The program's first state on these values, with the ghosts; None where it is not certain that the precondition
    holds of them."""
    start: State = {v.name: value for v, value in values.items()}
    try:
        for variable, ghost in program.ghosts.items():
            start[ghost.name] = start[variable.name]
    except KeyError:
        return None
    return start if _holds(triple.pre, start) else None


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
