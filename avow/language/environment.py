"""The names that a contract gives to sorts and values, and where each was declared."""

from __future__ import annotations

from dataclasses import field
from typing import assert_never

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.contract import Contract
from avow.language.sorts import (
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    SequenceSort,
    SetSort,
    Sort,
    StringSort,
    TupleSort,
)
from avow.language.terms import Term


@dataclass(slots=True)
class Environment:
    """`elements` maps every enumeration member and constructor to its sort; `broken` are names whose declaration is in
    error, about which nothing more is said."""

    types: dict[str, Sort] = field(default_factory=dict)
    constants: dict[str, Term] = field(default_factory=dict)
    elements: dict[str, EnumSort | DataSort] = field(default_factory=dict)
    anonymous: dict[str, EnumSort | DataSort] = field(default_factory=dict)
    places: dict[str, Span] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    written_out: int = 0
    """How many parts the formulas checked so far have, constants written out."""

    def sort(self, name: str) -> Sort | None:
        """The sort of that name, also of one that was written in place and named by us."""
        return self.types.get(name) or self.anonymous.get(name)

    def add_elements(self, sort: Sort) -> None:
        match sort:
            case EnumSort(members=members):
                self.elements.update(dict.fromkeys(members, sort))
            case DataSort(constructors=constructors):
                for constructor in constructors:
                    self.elements[constructor.name] = sort
                    for parameter in constructor.parameters:
                        self._inner(parameter)
            case _:  # a sort without elements of its own
                self._inner(sort)

    def _inner(self, sort: Sort) -> None:
        match sort:
            case EnumSort() | DataSort():
                if self.sort(sort.name) is None:
                    self.anonymous[sort.name] = sort
                    self.add_elements(sort)
            case FunctionSort(parameters=parameters, result=result):
                for parameter in (*parameters, result):
                    self._inner(parameter)
            case TupleSort(items=items):
                for item in items:
                    self._inner(item)
            case SequenceSort(item=item):
                self._inner(item)
            case BoolSort() | RealSort() | IntegerSort() | NaturalSort() | StringSort() | OpaqueSort() | SetSort():
                # a sort without parts
                pass
            case _:
                assert_never(sort)


def of_contract(contract: Contract) -> Environment:
    """The environment in which the contract's formulas were read."""
    environment = Environment(types=dict(contract.types), constants=dict(contract.constants))
    for sort in environment.types.values():
        environment.add_elements(sort)
    for node in contract.nodes:
        for port in (*node.inputs, *node.outputs):
            environment._inner(port.sort)
    return environment
