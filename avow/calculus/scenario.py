"""A plan's finite scenario as values: what the environment may give, and what outputs may be, in a bounded check.

The scenario restricts which values are *tried*; whether a guarantee holds of them is judged exactly.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from avow.calculus.variables import Frame
from avow.diagnostics import Rejected
from avow.language.contract import Port
from avow.language.sorts import (
    BOOL,
    INTEGER,
    NATURAL,
    REAL,
    STRING,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.logic.evaluate import NotEvaluable, evaluate, finite_values
from avow.logic.values import FunctionValue, Opaque, Value
from avow.system.plan import Scenario

MAX_CANDIDATES = 20_000

_SORTS: dict[str, Sort] = {"BOOL": BOOL, "INTEGER": INTEGER, "NATURAL": NATURAL, "REAL": REAL, "STRING": STRING}

Point = tuple[Value, ...]


class CannotRun(Exception):  # noqa: N818 - it names a state
    """The composed contracts cannot be run over this scenario; says why, and what would help."""


@dataclass(frozen=True, slots=True)
class World:
    """The scenario of one system, read once."""

    frame: Frame
    scenario: Scenario
    domains: dict[Sort, tuple[Value, ...]]

    def choices(self, node: str, port: Port) -> tuple[Value, ...]:
        """The values that an environment input may take at each step. Raises CannotRun."""
        table = self.scenario.interpret.get(f"in.{port.name}") or self.scenario.interpret.get(f"{node}.{port.name}")
        if table is not None:
            return (self.interpreted(port.sort, *table),)
        return self.values(f"{node}.{port.name}", ("in", node), port)

    def candidates(self, node: str, port: Port) -> tuple[Value, ...]:
        """The values that are tried for an output that is not a function. Raises CannotRun."""
        return self.values(f"{node}.{port.name}", ("out", node), port)

    def points(self, node: str, port: Port) -> tuple[Point, ...]:
        """The points at which a relation may hold. Raises CannotRun."""
        sort = port.sort
        assert isinstance(sort, FunctionSort)
        if sort.result != BOOL:
            raise CannotRun(f"{node}.{port.name} is a function; only relations (… --> BOOL) can be searched for")
        for owner in ("out", "in", node):
            texts = self.scenario.domains.get(f"{owner}.{port.name}")
            if texts is not None:
                wanted = sort.parameters[0] if len(sort.parameters) == 1 else TupleSort(sort.parameters)
                found = [self.parse(text, wanted) for text in texts]
                return tuple(v if isinstance(v, tuple) else (v,) for v in found)
        ranges = [finite_values(parameter, self.domains) for parameter in sort.parameters]
        known = [r for r in ranges if r is not None]
        if len(known) < len(ranges) or math.prod(map(len, known)) > MAX_CANDIDATES:
            raise CannotRun(
                f"where {node}.{port.name} may hold is not said, or too many places; give scenario.domains: "
                f"{{out.{port.name}: …}} or the ranges of its parameters' types"
            )
        return tuple(product(*known))

    def values(self, name: str, owners: Sequence[str], port: Port) -> tuple[Value, ...]:
        for owner in owners:
            texts = self.scenario.domains.get(f"{owner}.{port.name}")
            if texts is not None and not isinstance(port.sort, FunctionSort):
                return tuple(self.parse(text, port.sort) for text in texts)
        if isinstance(port.sort, OpaqueSort):
            return (Opaque(port.sort.name, 0),)
        if isinstance(port.sort, FunctionSort):
            raise CannotRun(f"{name}: say where it holds: scenario.interpret: {{in.{port.name}: table(column, …)}}")
        found = finite_values(port.sort, self.domains)
        if found is None or len(found) > MAX_CANDIDATES:
            why = "has infinitely many values" if found is None else "has too many values"
            raise CannotRun(f"{name} ({port.type_name}) {why}; give scenario.domains: {{{owners[0]}.{port.name}: …}}")
        return tuple(found)

    def interpreted(self, sort: Sort, table: str, columns: tuple[str, ...]) -> FunctionValue:
        """A relation that holds at exactly the rows of a table, or a function given by them."""
        assert isinstance(sort, FunctionSort)
        found = self.scenario.table(table)
        cells = [found.column(column) for column in columns]
        rows = list(zip(*cells, strict=True))
        keys = [tuple(self.parse(cell, s) for cell, s in zip(row, sort.parameters, strict=False)) for row in rows]
        if sort.result == BOOL:
            return FunctionValue(dict.fromkeys(keys, True), False)
        results = [self.parse(row[-1], sort.result) for row in rows]
        return FunctionValue(dict(zip(keys, results, strict=True)), self.elsewhere(sort.result, results))

    def elsewhere(self, sort: Sort, results: Sequence[Value]) -> Value:
        """A function's value beside its table: one that the table does not give, and that does not follow on it."""
        if isinstance(sort, NaturalSort | IntegerSort | RealSort):
            numbers = [value for value in results if isinstance(value, int | Fraction)]
            top = max(numbers, default=0)
            return Fraction(top + 2) if isinstance(sort, RealSort) else int(top) + 2
        known = finite_values(sort, self.domains) or tuple(results)
        unused = [value for value in known if value not in results]
        if not (unused or known):
            raise CannotRun("a function's table is empty, and nothing else says what its values may be")
        return (unused or list(known))[0]

    def parse(self, text: str, sort: Sort) -> Value:
        """A cell or a value as RCL writes it. Raises CannotRun."""
        from avow.language.load import parse_term

        if isinstance(sort, StringSort) and not text.startswith('"'):
            return text
        try:
            if isinstance(sort, RealSort):
                return Fraction(text)
            if isinstance(sort, IntegerSort | NaturalSort):
                number = int(text)
                if number < 0 and isinstance(sort, NaturalSort):
                    raise CannotRun(f"scenario: {text} is no natural number")
                return number
        except (ValueError, ZeroDivisionError):
            pass
        try:
            return evaluate(parse_term(text, None, self.frame.system.contract, sort=sort), {})
        except Rejected as rejected:
            raise CannotRun(f"scenario: {text!r}: {rejected.diagnostics[0].message}") from None
        except NotEvaluable as reason:
            raise CannotRun(f"scenario: {text!r}: {reason.reason}") from None


def world(frame: Frame) -> World:
    """The scenario of a system. Raises CannotRun where there is none, or its values cannot be read."""
    scenario = frame.system.plan.scenario or Scenario()
    found = World(frame, scenario, {})
    named = {**_SORTS, **dict(frame.system.contract.types)}
    for name, texts in scenario.domains.items():
        sort = named.get(name)
        if sort is not None and not isinstance(sort, FunctionSort):
            found.domains[sort] = tuple(dict.fromkeys(found.parse(text, sort) for text in texts))
    return found


def key(value: Value) -> object:
    """Equal for equal values, and quick to look up (functions hash poorly)."""
    if isinstance(value, FunctionValue):
        return (frozenset((p, v) for p, v in value.table.items() if v != value.default), value.default)
    return value
