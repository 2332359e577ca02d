"""What the plan's finite scenario decides: formulas over ports that it interprets by tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from avow.backend_kit.protocol import Job
from avow.evaluation.evaluate import NotEvaluable, evaluate, free_names
from avow.formulas.interpretation import interpretation, rows_of
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Node
from avow.language.sorts import FunctionSort, IntegerSort, NaturalSort
from avow.language.terms import Term, Variable
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
    """A relation holds at the table's rows; a function to whole numbers takes its last column as value there. (Of other
    sorts there is no value to stand for "none".)"""
    found = {variable.qualified: value for variable, value in interpretation(node, scenario).items()}
    for port in node.inputs:
        sort = port.sort
        if isinstance(sort, FunctionSort) and isinstance(sort.result, IntegerSort | NaturalSort):
            rows = rows_of(node, port, (*sort.parameters, sort.result), scenario)
            if rows is not None:
                points = {row[:-1]: row[-1] for row in rows}
                lowest = min((v for v in points.values() if isinstance(v, int)), default=0)
                found[port.variable.qualified] = FunctionValue(points, min(-1, lowest - 1))
    return found
