"""The names that a contract gives to sorts and values, and where each was declared."""

from __future__ import annotations

from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.contract import Contract
from avow.language.sorts import DataSort, EnumSort, Sort, parts
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
        """Make known what a declared sort, and those written in place in it, are made of."""
        if isinstance(sort, EnumSort):
            self.elements.update(dict.fromkeys(sort.members, sort))
        elif isinstance(sort, DataSort):
            self.elements.update((constructor.name, sort) for constructor in sort.constructors)
        for part in parts(sort):
            self.add_inner(part)

    def add_inner(self, sort: Sort) -> None:
        """As `add_elements`, of a sort that is part of another: an enumeration there may be one that has no name."""
        if not isinstance(sort, EnumSort | DataSort):
            self.add_elements(sort)
        elif self.sort(sort.name) is None:
            self.anonymous[sort.name] = sort
            self.add_elements(sort)


def of_contract(contract: Contract) -> Environment:
    """The environment in which the contract's formulas were read."""
    environment = Environment(types=dict(contract.types), constants=dict(contract.constants))
    for sort in environment.types.values():
        environment.add_elements(sort)
    for node in contract.nodes:
        for port in (*node.inputs, *node.outputs):
            environment.add_inner(port.sort)
    return environment
