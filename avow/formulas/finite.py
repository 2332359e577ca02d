"""The inputs that a scenario's tables give. A formula that holds for these is *checked*, not proved; one that fails
shows nothing by itself."""

from __future__ import annotations

from collections.abc import Sequence

from avow.base.plain import exact
from avow.formulas.values import Element, FunctionValue, Value
from avow.language.contract import Node, Port
from avow.language.sorts import BoolSort, EnumSort, FunctionSort, IntegerSort, NaturalSort, RealSort, Sort, StringSort
from avow.language.terms import Variable
from avow.system.plan import Scenario


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
        cells = [[cell_value(t, s) for t in table.column(c)] for c, s in zip(interpretation[1], sorts, strict=True)]
    except (KeyError, ValueError):
        return None
    return list(zip(*cells, strict=True))


def cell_value(text: str, sort: Sort) -> Value:
    """The value of the sort that a table's cell denotes by itself. Raises ValueError."""
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
