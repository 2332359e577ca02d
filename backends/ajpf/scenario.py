"""What the plan's finite scenario decides: formulas over ports that it interprets by tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

from avow.backend_kit.protocol import Job
from avow.evaluation.evaluate import NotEvaluable, evaluate, free_names
from avow.formulas.values import Element, FunctionValue, Value
from avow.language.contract import Node
from avow.language.sorts import (
    BoolSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    RealSort,
    Sort,
    StringSort,
)
from avow.language.terms import Role, Term, Variable
from avow.system.plan import Scenario


class Decider:
    """Decides closed formulas over interpreted inputs. Places outside a function's table have no value there: no number
    that a contract can name equals it."""

    def __init__(self, job: Job) -> None:
        scenario = job.system.plan.scenario
        self.valuation: dict[str, Value] = _interpretations(job.node, scenario) if scenario else {}
        self._known: dict[Term, bool | None] = {}

    def __call__(self, term: Term) -> bool | None:
        if term not in self._known:
            self._known[term] = self._decide(term)
        return self._known[term]

    def _decide(self, term: Term) -> bool | None:
        names = free_names(term)
        if not names or not names <= self.valuation.keys():
            return None
        try:
            value = evaluate(term, self.valuation)
        except NotEvaluable:
            return None
        return value if isinstance(value, bool) else None


def range_of(
    variable: Variable, instances: Mapping[str, tuple[int, ...]], scenario: Scenario | None
) -> Sequence[int] | None:
    """The finite range of an index variable: the plan's instances, else the scenario's domain of its sort."""
    plain = variable.name.rstrip("'")
    for name in (variable.name, plain):
        if name in instances:
            return instances[name]
    return domain_of(variable, scenario)


def domain_of(variable: Variable, scenario: Scenario | None) -> Sequence[int] | None:
    """The scenario's domain of an index variable's sort."""
    names = ("NATURAL", "INTEGER") if isinstance(variable.sort, NaturalSort) else ("INTEGER",)
    for name in names:
        texts = scenario.domains.get(name) if scenario is not None else None
        if texts and all(text.isdigit() for text in texts):
            return tuple(dict.fromkeys(int(text) for text in texts))
    return None


def _interpretations(node: Node, scenario: Scenario) -> dict[str, Value]:
    found: dict[str, Value] = {}
    for port in node.inputs:
        if not isinstance(port.sort, FunctionSort):
            continue
        for name in (f"{node.name}.in.{port.name}", f"{node.name}.{port.name}", f"{Role.INPUT}.{port.name}", port.name):
            if name in scenario.interpret:
                table_name, columns = scenario.interpret[name]
                value = _function(port.sort, scenario, table_name, columns)
                if value is not None:
                    found[port.variable.qualified] = value
                break
    return found


def _function(
    sort: FunctionSort, scenario: Scenario, table_name: str, columns: tuple[str, ...]
) -> FunctionValue | None:
    """A relation holds at the table's rows; another function takes its last column as value there."""
    relation = isinstance(sort.result, BoolSort)
    sorts = [*sort.parameters, *(() if relation else (sort.result,))]
    if len(sorts) != len(columns):
        return None
    try:
        table = scenario.table(table_name)
        cells = [[_value(text, s) for text in table.column(c)] for c, s in zip(columns, sorts, strict=True)]
    except (KeyError, ValueError):
        return None
    rows = list(zip(*cells, strict=True))
    if relation:
        return FunctionValue(dict.fromkeys(rows, True), False)
    if not isinstance(sort.result, IntegerSort | NaturalSort):
        return None  # there is no value to stand for "none"
    points = {row[:-1]: row[-1] for row in rows}
    lowest = min((v for v in points.values() if isinstance(v, int)), default=0)
    return FunctionValue(points, min(-1, lowest - 1))


def _value(text: str, sort: Sort) -> Value:
    """Raises ValueError."""
    match sort:
        case RealSort():
            return Fraction(text)
        case IntegerSort() | NaturalSort():
            return int(text)
        case StringSort():
            return text
        case EnumSort(members=members) if text in members:
            return Element(text)
        case BoolSort() if text in ("TRUE", "FALSE"):
            return text == "TRUE"
    raise ValueError(text)
