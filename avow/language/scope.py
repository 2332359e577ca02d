"""What a name means inside a formula."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import field

from avow.base.diagnostics import Span
from avow.base.records import dataclass
from avow.language.contract import Definition, Node, Port
from avow.language.environment import Environment
from avow.language.source import Reports
from avow.language.syntax import Define
from avow.language.terms import Role, Variable


@dataclass(slots=True)
class Defined:
    """A definition in a scope: its text until it is looked up, and then what it says there."""

    parameters: tuple[Variable, ...]
    tree: Define | None = None
    reports: Reports | None = None
    bare: bool = True
    """Whether its inputs and outputs may be named without `in.` and `out.`: a context does not know them."""
    found: Definition | None = None
    state: str = "new"
    """new, open (being checked: meeting it again is a circle), or done."""

    @property
    def place(self) -> Span | None:
        if self.tree is None or self.reports is None:
            return None if self.found is None else self.found.span
        return self.reports.source.span(self.tree.name.start, self.tree.name.end)


BOTH_ROLES = frozenset((Role.INPUT, Role.OUTPUT))


@dataclass(slots=True)
class Scope:
    """The names that a formula may use.

    Of a node: its `inputs` and `outputs`. Of a whole system: `nodes`, whose ports are written ``node.port``.
    `bound` are the variables of the quantifiers around the place, and the extra names that the caller gave.
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
    """Whether it may speak of other steps than this one."""
    bare: bool = True
    """Whether inputs and outputs may be named without `in.` and `out.`."""
    defined: Mapping[str, Defined] = field(default_factory=dict)

    @property
    def named(self) -> str:
        """The node as messages call it: one whose name cannot be read has none."""
        return f"node `{self.node}`" if self.node else "the node"

    def ports(self, role: Role) -> Mapping[str, Port]:
        return self.inputs if role is Role.INPUT else self.outputs

    def is_broken(self, name: str) -> bool:
        """Whether the name's declaration (or, with ``*``, the whole list of them) is in error already."""
        return name in self.broken or "*" in self.broken or name in self.environment.broken

    def taken(self, name: str) -> tuple[str, Span | None] | None:
        """What already has the name here, and where it was declared."""
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
        return None

    def known(self) -> Iterator[str]:
        """Every name that may stand for a value here."""
        yield from self.bound
        yield from self.defined
        for name in self.inputs:
            yield name if name not in self.outputs else f"in.{name}"
        for name in self.outputs:
            yield name if name not in self.inputs else f"out.{name}"
        yield from self.environment.elements
        yield from self.environment.constants
        yield from self.nodes
