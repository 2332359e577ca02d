"""Cells along a run: the values that a node's clauses with history remember, step after step, exactly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from typing import assert_never

from avow.base.tuning.bounds import INSTANCES, TABLE_ROUNDS
from avow.evaluation.compiler import Compiler, NotEvaluable, finite_values
from avow.evaluation.evaluate import Evaluator, compile_term, filler, guarded, quantified
from avow.evaluation.quantifier_search import Search
from avow.formulas.formula import conjunction, disjunction, equation, negation, opposite
from avow.formulas.renaming import rename_apart
from avow.formulas.temporal.cell import Cell
from avow.formulas.values import Data, FunctionValue, Opaque, SequenceValue, Value
from avow.language import sorts as s
from avow.language.terms import Apply, Conditional, Role, Term, Variable


class Keeper:
    """The cells of some formulas over a run, of which only the last step is kept. A value that cannot be computed
    (because of a division by zero, say) is missing for every later reader; so is a table with more than `instances`
    points. Raises NotEvaluable."""

    def __init__(self, cells: Sequence[Cell], instances: int = INSTANCES) -> None:
        self._cells = {
            cell.before.qualified: _compile_table(cell.now, cell.parameters, instances)
            if cell.parameters
            else _plain(compile_term(cell.now))
            for cell in cells
        }
        self._initial = {
            cell.before.qualified: FunctionValue({}, value) if cell.parameters else value
            for cell in cells
            if cell.initial is not None
            for value in (compile_term(cell.initial)({}),)
        }
        self.memory: Mapping[str, Value] = {}
        """The value of each cell that has one, by the name of its variable."""
        self.why = ""
        """Why a cell had no value, the first time."""
        self.restart()

    def restart(self) -> None:
        """Starts a new run."""
        self.memory = dict(self._initial)

    def at(self, ports: Mapping[str, Value]) -> dict[str, Value]:
        """A step's valuation: its ports, and the values left by earlier steps."""
        return {**self.memory, **ports}

    def advance(self, ports: Mapping[str, Value]) -> None:
        """Ends the step."""
        valuation, left = self.at(ports), dict[str, Value]()
        for name, now in self._cells.items():
            try:
                left[name] = now(valuation, self.memory.get(name))
            except NotEvaluable as error:
                self.why = self.why or error.reason
        self.memory = left


def _plain(now: Evaluator) -> Callable[[Mapping[str, Value], Value | None], Value]:
    return lambda valuation, before: now(valuation)


Table = Callable[[Mapping[str, Value], Value | None], FunctionValue]
"""From a valuation, and the function's previous value (a guess at its points), to its value."""


def _compile_table(term: Term, parameters: Sequence[Variable], instances: int) -> Table:
    """The function from the parameters to the term, with at most `instances` points. A guess (the term at the previous
    points, and at values that nothing names) is compared with the term, exactly, until no argument distinguishes them.
    The result raises NotEvaluable if there are more points, or infinitely many."""
    kept = Variable(Role.INPUT, "kept#", s.FunctionSort(tuple(v.sort for v in parameters), term.sort))
    now = compile_term(term)
    body = rename_apart(_differ(term, Apply(kept, tuple(parameters), term.sort)), [v.name for v in parameters])
    compiler = Compiler({}, quantified)
    search = guarded(lambda: Search(compiler, tuple(parameters), body, True))
    fill = filler(compiler)
    names = tuple(v.name for v in parameters)
    strange = tuple(unnamed(v.sort) for v in parameters)

    def build(valuation: Mapping[str, Value], before: Value | None) -> FunctionValue:
        def at(point: tuple[Value, ...]) -> Value:
            return now({**valuation, **dict(zip(names, point, strict=True))})

        elsewhere = at(strange)
        points = before.table if isinstance(before, FunctionValue) else {}
        found = {point: value for point in points if (value := at(point)) != elsewhere}
        for _ in range(TABLE_ROUNDS):
            if len(found) > instances:
                raise NotEvaluable(f"more than {instances} values of {', '.join(names)} are remembered")
            guess = FunctionValue(found, elsewhere)
            missed = guarded(lambda: search.all(fill({**valuation, kept.qualified: guess})))  # noqa: B023
            if not missed:
                return guess
            found = {**found, **{point: at(point) for point in missed}}
        raise NotEvaluable(f"something else is remembered for each of infinitely many values of {', '.join(names)}")

    return build


def _differ(term: Term, kept: Term) -> Term:
    """That two terms differ; for each branch of a conditional separately, so that its condition restricts them."""
    if isinstance(term, Conditional):
        met = conjunction((term.condition, _differ(term.then, kept)))
        return disjunction((met, conjunction((negation(term.condition), _differ(term.otherwise, kept)))))
    return opposite(equation(term, kept))


def unnamed(sort: s.Sort) -> Value:
    """A value that nothing is likely to name; for a finite sort any, since all are examined."""
    finite = finite_values(sort)
    if finite:
        return finite[0]
    match sort:
        case s.NaturalSort() | s.IntegerSort():
            return 10**60
        case s.RealSort():
            return Fraction(10**61 + 1, 10)
        case s.StringSort():
            return "\0" * 60
        case s.TupleSort(items=items):
            return tuple(map(unnamed, items))
        case s.SequenceSort(item=item):
            return SequenceValue((unnamed(item),))
        case s.OpaqueSort(name=name):
            return Opaque(name, 10**60)
        case s.DataSort(constructors=constructors):
            made = max(constructors, key=lambda each: len(each.parameters))
            if not any(isinstance(part, s.DataSort) for part in made.parameters):
                return Data(made.name, tuple(map(unnamed, made.parameters)))
            raise NotEvaluable(f"something is remembered for each value of {sort}")
        case s.BoolSort() | s.EnumSort() | s.FunctionSort() | s.SetSort():  # one value of many, or none of its own
            raise NotEvaluable(f"something is remembered for each value of {sort}")
        case _:
            assert_never(sort)
