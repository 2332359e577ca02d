"""Formulas within a scenario: quantifiers range over the few values that the scenario gives their sort, and inputs take
the values that it gives them. A formula that holds then is *checked*, not proved; one that fails shows nothing by
itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from itertools import product
from math import prod

from avow.base.plain import exact
from avow.base.records import dataclass
from avow.base.tuning.bounds import VALUES_WRITTEN_OUT
from avow.formulas.formula import conjunction, disjunction, negation, substitute
from avow.formulas.renaming import map_children
from avow.formulas.values import Element, FunctionValue, Value
from avow.formulas.written import value_term
from avow.language.contract import Node, Port
from avow.language.sorts import BoolSort, EnumSort, FunctionSort, IntegerSort, NaturalSort, RealSort, Sort, StringSort
from avow.language.terms import Compare, Quantified, Quantifier, Term, Variable
from avow.system.plan import Scenario


@dataclass(frozen=True, slots=True)
class Ranges:
    """The finite ranges that a plan's scenario gives to sorts, and to inputs."""

    sorts: Mapping[Sort, Sequence[Value]] = field(default_factory=dict)
    inputs: Mapping[Variable, Sequence[Value]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return bool(self.sorts or self.inputs)

    def assumptions(self, inputs: Sequence[Variable]) -> dict[str, Term]:
        """The assumptions that these inputs have the values that the scenario gives them, by labels that no clause can
        have."""
        found = {}
        for variable in inputs:
            values = self.inputs.get(variable, self.sorts.get(variable.sort, ()))
            terms = _terms(values, variable.sort)
            if terms:
                equal = [Compare("==", variable, term) for term in terms]
                found[f"scenario {variable.qualified}"] = disjunction(equal)
        return found

    def within(self, term: Term) -> Term:
        """The formula with its quantifiers expanded over the scenario's values."""
        if not isinstance(term, Quantified):
            return map_children(term, self.within)
        body = self.within(term.body)
        few = {v: terms for v in term.variables if (terms := _terms(self.sorts.get(v.sort, ()), v.sort))}
        rest = tuple(v for v in term.variables if v not in few)
        unlike = term.quantifier is Quantifier.UNIQUE and rest
        if not few or unlike or prod(map(len, few.values())) > VALUES_WRITTEN_OUT:
            return Quantified(term.quantifier, term.variables, body, term.span)
        cases = [substitute(body, dict(zip(few, choice, strict=True))) for choice in product(*few.values())]
        match term.quantifier:
            case Quantifier.FORALL:
                return conjunction(Quantified(term.quantifier, rest, c) if rest else c for c in cases)
            case Quantifier.EXISTS:
                return disjunction(Quantified(term.quantifier, rest, c) if rest else c for c in cases)
            case Quantifier.UNIQUE:
                alone = (
                    conjunction((case, *(negation(other) for other in cases[:k] + cases[k + 1 :])))
                    for k, case in enumerate(cases)
                )
                return disjunction(alone)


_SIMPLE = BoolSort | EnumSort | IntegerSort | NaturalSort | RealSort | StringSort
"""Sorts whose values are written out; quantifiers over other sorts are kept."""


def _terms(values: Sequence[Value], sort: Sort) -> list[Term]:
    return [value_term(value, sort) for value in dict.fromkeys(values)] if isinstance(sort, _SIMPLE) else []


# -- what the scenario's tables fix ------------------------------------------------------------------------------------


def interpretation(node: Node, scenario: Scenario | None) -> dict[Variable, Value]:
    """The inputs of a node that are relations given by the scenario's tables: each holds at the rows and nowhere else.

    A function with another result is not fixed: a table does not give its value elsewhere. Entries that are not a value
    of their sort leave the input open, too (the plan's checks report them).
    """
    found: dict[Variable, Value] = {}
    for port in node.inputs:
        sort = port.sort
        if scenario is None or not isinstance(sort, FunctionSort) or not isinstance(sort.result, BoolSort):
            continue
        rows = rows_of(node, port, sort.parameters, scenario)
        if rows is not None:
            found[port.variable] = FunctionValue(dict.fromkeys(rows, True), False)
    return found


def rows_of(node: Node, port: Port, sorts: Sequence[Sort], scenario: Scenario) -> list[tuple[Value, ...]] | None:
    """The rows of the table that interprets a port; None if there is no table with such columns."""
    interpretation = scenario.interpreted(node.name, port)
    if interpretation is None or len(interpretation[1]) != len(sorts):
        return None
    try:
        table = scenario.table(interpretation[0])
        cells = [[_value(t, s) for t in table.column(c)] for c, s in zip(interpretation[1], sorts, strict=True)]
    except (KeyError, ValueError):
        return None
    return list(zip(*cells, strict=True))


def _value(text: str, sort: Sort) -> Value:
    """The value that a text denotes. Raises ValueError."""
    match sort:
        case RealSort():
            return exact(text)
        case IntegerSort():
            return int(text)
        case NaturalSort() if int(text) >= 0:
            return int(text)
        case StringSort():
            return text
        case EnumSort(members=members) if text in members:
            return Element(text)
        case BoolSort() if text.lower() in {"true", "false"}:
            return text.lower() == "true"
    raise ValueError(text)
