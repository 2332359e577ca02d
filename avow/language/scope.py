"""The meaning of names: a contract's names of sorts and values, and the names in scope at a place in a formula."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.contract import Contract, Definition, Node, Port
from avow.language.sorts import BUILTINS, DataSort, EnumSort, Sort, parts
from avow.language.source import Reports
from avow.language.syntax import Define
from avow.language.terms import Role, Term, Variable


@dataclass(slots=True)
class Environment:
    """`elements` maps every enumeration member and constructor to its sort; `broken` are names whose declaration is in
    error, about which nothing more is reported."""

    types: dict[str, Sort] = field(default_factory=dict)
    constants: dict[str, Term] = field(default_factory=dict)
    elements: dict[str, EnumSort | DataSort] = field(default_factory=dict)
    anonymous: dict[str, EnumSort | DataSort] = field(default_factory=dict)
    places: dict[str, Span] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)

    def sort(self, name: str) -> Sort | None:
        """The sort of that name, including generated names of sorts that were written in place."""
        return BUILTINS.get(name) or self.types.get(name) or self.anonymous.get(name)

    def add_elements(self, sort: Sort) -> None:
        """Register the elements of a declared sort, and of those written in place in it."""
        if isinstance(sort, EnumSort):
            self.elements.update(dict.fromkeys(sort.members, sort))
        elif isinstance(sort, DataSort):
            self.elements.update((constructor.name, sort) for constructor in sort.constructors)
        for part in parts(sort):
            self.add_inner(part)

    def add_inner(self, sort: Sort) -> None:
        """As `add_elements`, for a sort that is part of another, where an enumeration may have no declared name."""
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


@dataclass(slots=True)
class Defined:
    """A definition in a scope: its tree until it is looked up, then the checked definition."""

    parameters: tuple[Variable, ...]
    tree: Define | None = None
    reports: Reports | None = None
    bare: bool = True
    """Whether its inputs and outputs may be named without `in.` and `out.`; not in a context."""
    found: Definition | None = None
    state: str = "new"
    """new, open (being checked: meeting it again is a cycle), or done."""

    @property
    def place(self) -> Span | None:
        if self.tree is None or self.reports is None:
            return None if self.found is None else self.found.span
        return self.reports.source.span(self.tree.name.start, self.tree.name.end)


BOTH_ROLES = frozenset((Role.INPUT, Role.OUTPUT))


@dataclass(slots=True)
class Scope:
    """The names that a formula may use.

    For a node: its `inputs` and `outputs`. For a whole system: `nodes`, whose ports are written ``node.port``. `bound`
    are the variables of the enclosing quantifiers, and the extra names that the caller gave.
    """

    environment: Environment
    inputs: Mapping[str, Port] = field(default_factory=dict)
    outputs: Mapping[str, Port] = field(default_factory=dict)
    nodes: Mapping[str, Node] = field(default_factory=dict)
    roles: frozenset[Role] = BOTH_ROLES
    bound: dict[str, Variable] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)
    node: str | None = None
    remembers: bool = False
    """Whether the formula may refer to other steps than this one."""
    bare: bool = True
    """Whether inputs and outputs may be named without `in.` and `out.`."""
    defined: Mapping[str, Defined] = field(default_factory=dict)

    @property
    def named(self) -> str:
        """The node's name in messages; without a name if it cannot be read."""
        return f"node `{self.node}`" if self.node else "the node"

    def ports(self, role: Role) -> Mapping[str, Port]:
        return self.inputs if role is Role.INPUT else self.outputs

    def is_broken(self, name: str) -> bool:
        """Whether the name's declaration (or, with ``*``, the whole list of them) is in error already."""
        return name in self.broken or "*" in self.broken or name in self.environment.broken

    def taken(self, name: str) -> tuple[str, Span | None] | None:
        """The kind of thing that already has the name here, and where it was declared; None if the name is free."""
        environment = self.environment
        if name in self.bound:
            return "a variable of an enclosing quantifier", self.bound[name].span
        if name in self.defined:
            found = self.defined[name]
            return "a definition", found.place
        if self.bare and name in self.inputs:
            return "an input", self.inputs[name].span
        if self.bare and name in self.outputs:
            return "an output", self.outputs[name].span
        for what, table in (
            ("an element of a type", environment.elements),
            ("a constant", environment.constants),
            ("a type", environment.types),
        ):
            if name in table:
                return what, environment.places.get(name)
        return ("a type", None) if name in BUILTINS else None

    def known(self) -> Iterator[str]:
        """Every name that may denote a value here."""
        yield from self.bound
        yield from self.defined
        for name in self.inputs:
            yield name if name not in self.outputs else f"in.{name}"
        for name in self.outputs:
            yield name if name not in self.inputs else f"out.{name}"
        yield from self.environment.elements
        yield from self.environment.constants
        yield from self.nodes
