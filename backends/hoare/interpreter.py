"""Running a checked program on concrete, exact values: a refutation counts only once the program has shown it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.evaluation.evaluate import Evaluator, compile_term
from avow.formulas.values import Data, FunctionValue, Value
from avow.language.sorts import NATURAL, FunctionSort, Sort
from avow.language.terms import Term
from avow.solving.limits import spend

from .program import Assign, Block, If, Match, Skip, Statement, Update, While
from .tuning import RUN_STEPS, STATEMENT_STEPS
from .wp import defined

_UNDEFINED = "a division by zero, an element that the sequence does not have, or a negative number for a natural one,"


State = dict[str, Value]


class NoEnd(Exception):  # noqa: N818 - it names a state
    """The program has not ended within `RUN_STEPS`."""


class Endless(Exception):  # noqa: N818 - it names a state
    """The program never ends: a loop's test is met in the same state twice."""

    def __init__(self, loop: While) -> None:
        super().__init__(f"the loop at line {loop.span.line} comes back to the same state for ever")


class Fault(Exception):  # noqa: N818 - it names a state
    """The program asks for something undefined, such as a division by zero."""

    def __init__(self, what: str, span: Span) -> None:
        super().__init__(f"{what} at line {span.line}")
        self.span = span


@dataclass(slots=True)
class Machine:
    """Runs programs; compiled expressions are kept."""

    steps: int = 0
    endless: int = 0
    """How many runs have been given up."""
    compiled: dict[int, tuple[Term, Evaluator]] = field(default_factory=dict)

    def run(self, body: Block, start: Mapping[str, Value]) -> State:
        """The last state. Raises NoEnd, Endless, Fault, or NotEvaluable."""
        self.steps = 0
        state: State = dict(start)
        try:
            self._block(body, state)
        finally:
            spend(STATEMENT_STEPS * (1 + self.steps))
        return state

    def value(self, term: Term, state: State) -> Value:
        """The value of a term in a state. Raises NotEvaluable."""
        if id(term) not in self.compiled:
            self.compiled[id(term)] = (term, compile_term(term))
        return self.compiled[id(term)][1](state)

    def _ended(self) -> None:
        if self.steps > RUN_STEPS:
            self.endless += 1
            raise NoEnd

    def _block(self, body: Block, state: State) -> None:
        for statement in body:
            self.steps += 1
            self._ended()
            self._statement(statement, state)

    def _statement(self, statement: Statement, state: State) -> None:
        at = statement.span
        match statement:
            case Skip():
                pass
            case Assign(target=target, value=value):
                state[target.name] = self._stored(value, target.sort, state, at)
            case Update(target=target, arguments=arguments, value=value):
                assert isinstance(target.sort, FunctionSort)
                point = tuple(
                    self._stored(a, s, state, at) for a, s in zip(arguments, target.sort.parameters, strict=True)
                )
                old = state[target.name]
                assert isinstance(old, FunctionValue)
                new = self._stored(value, target.sort.result, state, at)
                state[target.name] = FunctionValue({**old.table, point: new}, old.default)
            case If(condition=condition, then=then, otherwise=otherwise):
                self._block(then if self._compute(condition, state, at) else otherwise, state)
            case Match(subject=subject, constructor=constructor, variables=variables):
                made = self._compute(subject, state, at)
                assert isinstance(made, Data)
                if made.constructor != constructor:
                    self._block(statement.otherwise, state)
                    return
                outer = dict(state)
                state.update((v.name, a) for v, a in zip(variables, made.arguments, strict=True))
                self._block(statement.then, state)
                for variable in variables:
                    state.pop(variable.name, None)
                    if variable.name in outer:
                        state[variable.name] = outer[variable.name]
            case While():
                self._loop(statement, state)

    def _loop(self, loop: While, state: State) -> None:
        """Brent's search for a circle: the state is held against one that is taken anew after 1, 2, 4… rounds. What a
        round does depends on nothing but the state, so that one met twice is met for ever."""
        held, rounds, power = dict(state), 0, 1
        while self._compute(loop.condition, state, loop.span):
            self.steps += 1
            self._ended()
            self._block(loop.body, state)
            if state == held:
                raise Endless(loop)
            rounds += 1
            if rounds == power:
                held, rounds, power = dict(state), 0, 2 * power

    def _compute(self, term: Term, state: State, at: Span) -> Value:
        safe = defined(term)
        if self.value(safe, state) is not True:
            raise Fault(_UNDEFINED, at)
        return self.value(term, state)

    def _stored(self, term: Term, sort: Sort, state: State, at: Span) -> Value:
        value = self._compute(term, state, at)
        if sort == NATURAL and isinstance(value, int) and value < 0:
            raise Fault(f"{value} for a natural number", at)
        return value
