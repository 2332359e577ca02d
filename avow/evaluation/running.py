"""Cells along a run: what a node's clauses with history remember, step after step, exactly."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from avow.base.tuning.bounds import INSTANCES
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.evaluation.tables import compile_table
from avow.formulas.temporal.cell import Cell
from avow.formulas.values import FunctionValue, Value


class Keeper:
    """The cells of some formulas over a run, of which only the last step is kept. A value that cannot be had (by a
    division by zero, say) is none for whatever reads it later; neither is a table with more than so many `instances`.
    Raises NotEvaluable."""

    def __init__(self, cells: Sequence[Cell], instances: int = INSTANCES) -> None:
        self._cells = {
            cell.before.qualified: compile_table(cell.now, cell.parameters, instances)
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
        """A new run."""
        self.memory = dict(self._initial)

    def at(self, ports: Mapping[str, Value]) -> dict[str, Value]:
        """A step's valuation: its ports, and what the steps before have left."""
        return {**self.memory, **ports}

    def advance(self, ports: Mapping[str, Value]) -> None:
        """The step is over."""
        valuation, left = self.at(ports), dict[str, Value]()
        for name, now in self._cells.items():
            try:
                left[name] = now(valuation, self.memory.get(name))
            except NotEvaluable as error:
                self.why = self.why or error.reason
        self.memory = left


def _plain(now: Evaluator) -> Callable[[Mapping[str, Value], Value | None], Value]:
    return lambda valuation, before: now(valuation)
