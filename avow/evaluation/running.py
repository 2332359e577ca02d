"""Cells along a run: what a node's clauses with history remember, step after step, exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.formulas.values import Value
from avow.temporal.cell import Cell


class Keeper:
    """The cells of some formulas over a run, of which only the last step is kept. A value that cannot be had (by a
    division by zero, say) is none for whatever reads it later. Raises NotEvaluable where a cell keeps something for
    each of infinitely many values."""

    def __init__(self, cells: Sequence[Cell]) -> None:
        for cell in cells:
            if cell.parameters:
                raise NotEvaluable(f"something is remembered for each value of {cell.parameters[0].name}")
        self._cells = {cell.before.qualified: compile_term(cell.now) for cell in cells}
        self._initial = {
            cell.before.qualified: compile_term(cell.initial)({}) for cell in cells if cell.initial is not None
        }
        self.memory: Mapping[str, Value] = {}
        """The value of each cell that has one, by the name of its variable."""
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
                left[name] = now(valuation)
            except NotEvaluable:
                continue
        self.memory = left
