"""One set of variables for a whole system: linking equations are solved by giving both ends of an edge one name.

The output `at` of `navigation` is ``navigation.at`` wherever it flows; ``navigation.at@before`` is its value one step
earlier (delivered by a delayed edge); an input that no node provides is ``in.map``, one variable for all nodes that
read it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from functools import partial
from typing import TypeVar

from avow.base.files import sha256
from avow.base.records import dataclass
from avow.calculus.chance import while_kept
from avow.formulas.formula import digest, free_variables, substitute
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.cell import CELL, Cell, Unsaid
from avow.formulas.temporal.cells import Records, compiled, remembers
from avow.formulas.temporal.clock import GOES_ON, Timed, events, is_arrival, longest_limit, one_pace, other_paces
from avow.language.contract import Clause, ClauseKind, Node, Port
from avow.language.printer import show_sort
from avow.language.sorts import BOOL, REAL, Sort
from avow.language.subterms import counts_steps, histories, ports_of, timed
from avow.language.terms import TRUE, Role, Term, Variable
from avow.system.folding import own_inputs
from avow.system.formulas import Assumed, environment_assumptions, initial_condition
from avow.system.graph import Graph, dataflow
from avow.system.plan import Edge, Endpoint, System
from avow.system.temporal import parse_state

OBSERVED = "requirement "
"""Prefix of the name of a cell of a requirement (``requirement R.once#…``); no port's name begins with it."""

SUFFIXES = ("", "@before", "@before@before")
"""Now, one step earlier, two steps earlier."""


@dataclass(frozen=True, slots=True)
class Facts:
    """Labelled facts, indexed by the variables that they mention."""

    terms: Mapping[str, Term]
    variables: Mapping[str, frozenset[Variable]]
    speaking: Mapping[Variable, tuple[str, ...]]
    """Variable → the labels of the facts that mention it."""
    rarest: Mapping[Variable, tuple[str, ...]]
    """Variable → the labels of the facts of whose variables it is the rarest, mentioned by the fewest other facts."""
    digest: str
    """SHA-256 of labels and meanings."""


def indexed(facts: Mapping[str, Term]) -> Facts:
    """The facts with their index."""
    variables = {label: free_variables(fact) for label, fact in facts.items()}
    speaking: dict[Variable, list[str]] = {}
    for label, spoken in variables.items():
        for variable in spoken:
            speaking.setdefault(variable, []).append(label)
    rarest: dict[Variable, list[str]] = {}
    for label, spoken in variables.items():
        if spoken:
            rarest.setdefault(min(spoken, key=lambda v: len(speaking[v])), []).append(label)
    meaning = sha256("\n".join(sorted(f"{label} {digest(fact)}" for label, fact in facts.items())))
    return Facts(facts, variables, _frozen(speaking), _frozen(rarest), meaning)


def _frozen(lists: Mapping[Variable, list[str]]) -> dict[Variable, tuple[str, ...]]:
    return {variable: tuple(labels) for variable, labels in lists.items()}


def closest(parts: Iterable[Facts], goal: Term) -> dict[str, Term]:
    """The facts that share a variable with the goal, and then those *all* of whose variables occur in these: bounds on
    what the first mention. Sharing one variable is not enough there: one step further would include everything."""
    parts = tuple(parts)
    spoken = free_variables(goal)
    direct = [{label for variable in spoken for label in part.speaking.get(variable, ())} for part in parts]
    known = spoken.union(
        *(part.variables[label] for part, labels in zip(parts, direct, strict=True) for label in labels)
    )
    found: dict[str, Term] = {}
    for part, labels in zip(parts, direct, strict=True):
        bounds = {label for v in known for label in part.rarest.get(v, ()) if part.variables[label] <= known}
        found.update((label, part.terms[label]) for label in sorted(labels | bounds))
    return found


Label = TypeVar("Label")


def bearing(facts: Mapping[Label, Term], spoken: Iterable[Variable]) -> dict[Label, Term]:
    """The facts that share a variable with the given ones, directly or through other facts. Other
    facts cannot help a proof, and may keep the solver busy for long."""
    left = {label: free_variables(fact) for label, fact in facts.items()}
    known = set(spoken)
    found: dict[Label, Term] = {}
    while near := [label for label, variables in left.items() if not variables.isdisjoint(known)]:
        for label in near:
            found[label] = facts[label]
            known |= left.pop(label)
    return found


@dataclass(frozen=True, slots=True)
class Observed:
    """A requirement that mentions other steps: its formula as one over a single step, over ``node.port`` and its cells.
    The cells are updated whatever the nodes do. `unsaid`: why there is no such formula."""

    formula: Term
    cells: tuple[Cell, ...] = ()
    unsaid: str = ""

    @property
    def spoken(self) -> frozenset[Variable]:
        """The variables that the formula and its cells mention."""
        return free_variables(self.formula).union(*(free_variables(cell.now) for cell in self.cells))

    @property
    def arrivals(self) -> tuple[tuple[str, str], ...]:
        """Nodes, and those of their inputs for which it matters whether a message has arrived (``arrived scan#``)."""
        names = (v.name.partition(".") for v in self.spoken if v.name.endswith(CELL) and ".arrived " in v.name)
        return tuple(sorted((node, event) for node, _, event in names))


@dataclass(slots=True)
class Frame:
    """A system with its graph, and its formulas in system-level variables (each translated once)."""

    system: System
    graph: Graph
    assumed: tuple[Assumed, ...]
    own_inputs: Mapping[str, str]
    """Inputs (``planner.map``) separate from other nodes' inputs of that name → the input whose name they use."""
    constants: frozenset[str]
    """Environment inputs (``in.map``, ``planner.map``) that are constant."""

    cells: Mapping[str, tuple[Cell, ...]] = field(default_factory=dict)
    """Node → the cells of its clauses and of the plan's assumptions about its inputs; each is an input of the node,
    with the cell's name."""

    shared: dict[str, str] = field(default_factory=dict)
    """A cell (``log.earliest#…``) that keeps the same as another → that one: if time matters, several nodes may use the
    age of the same value; and a node and a requirement may have the same cell."""

    required: Mapping[str, Term] = field(default_factory=dict)
    """The formulas of requirements, over ``node.port``."""

    observed: Mapping[str, Observed] = field(default_factory=dict)
    """The requirements that mention other steps."""

    left_out: tuple[str, ...] = ()
    """Guarantees (``sensor.soon``) and assumptions of the plan (``in.x``) with limits in seconds and no formula over
    one step: they are not hypotheses, so an example (a step or a run) may violate them."""

    _nodes: dict[str, Node] = field(default_factory=dict)
    _mappings: dict[tuple[str, int], Mapping[Variable, Term]] = field(default_factory=dict)
    _terms: dict[tuple[str, str, int], Term] = field(default_factory=dict)
    _facts: dict[tuple[str | frozenset[str], int], Facts] = field(default_factory=dict)
    _environment: dict[int, dict[str, Term]] = field(default_factory=dict)
    _initials: dict[str, tuple[tuple[str, Term], ...]] | None = None

    def node(self, name: str) -> Node:
        return self._nodes[name]

    def clause(self, node: str, clause: str, earlier: int = 0) -> Term:
        """A clause of a node, `earlier` steps ago."""
        key = (node, clause, earlier)
        if key not in self._terms:
            formula = self.node(node).clause(clause).formula
            mapping = self.mapping(node, earlier)
            spoken = free_variables(formula)  # a clause mentions few of many ports
            self._terms[key] = substitute(formula, {v: mapping[v] for v in spoken if v in mapping})
        return self._terms[key]

    def promised(self, node: str, earlier: int = 0) -> Facts:
        """The same as `contracts`, for one node."""
        key = (node, earlier)
        if key not in self._facts:
            self._facts[key] = indexed(self.contracts((node,), earlier))
        return self._facts[key]

    def contracts(self, nodes: Iterable[str], earlier: int = 0) -> dict[str, Term]:
        """All clauses of some nodes' contracts, `earlier` steps ago, labelled ``navigation.somewhere``."""
        suffix = " one step before" if earlier else ""
        return {
            f"{node}.{clause.name}{suffix}": self.clause(node, clause.name, earlier)
            for node in nodes
            for clause in self.node(node).clauses
        }

    def surroundings(self, earlier: int = 0) -> Facts:
        """The facts of `environment` and `memory`."""
        key = (frozenset[str](), earlier)
        if key not in self._facts:
            self._facts[key] = indexed(self.environment(earlier) | self.memory(earlier))
        return self._facts[key]

    def beginnings(self, nodes: frozenset[str]) -> Facts:
        """The facts of `initials` and `blank`."""
        key = (nodes, 1)
        if not nodes:
            return indexed({})
        if key not in self._facts:
            self._facts[key] = indexed(self.initials(nodes) | self.blank())
        return self._facts[key]

    def mapping(self, node: str, earlier: int = 0) -> Mapping[Variable, Term]:
        """A node's ports in system-level variables."""
        key = (node, earlier)
        if key not in self._mappings:
            contract = self.node(node)
            found: dict[Variable, Term] = {p.variable: self.output(node, p.name, earlier) for p in contract.outputs}
            found |= {p.variable: self.input(node, p.name, earlier) for p in contract.inputs}
            self._mappings[key] = found
        return self._mappings[key]

    def output(self, node: str, port: str, earlier: int = 0) -> Variable:
        """The variable of an output."""
        return system_variable(f"{node}.{port}", self.node(node).output(port).sort, earlier)

    def input(self, node: str, port: str, earlier: int = 0) -> Variable:
        """The variable that an input reads: its provider's, now or one step earlier, or the environment's."""
        edge = self.graph.by_target.get(Endpoint(node, port))
        cell = next((cell for cell in self.cells.get(node, ()) if cell.name == port), None)
        if cell is not None:
            return system_variable(self.keeper(node, port), cell.sort, earlier + 1)
        if edge is None and port.endswith(CELL) and port != CLOCK.name:  # a message's arrival
            return system_variable(f"{node}.{port}", BOOL, earlier)
        if edge is None:
            sort = self.node(node).input(port).sort
            entry = self.entry(node, port)
            if entry in self.constants:
                earlier = 0
            owner = entry.partition(".")[0]
            if owner != "in":
                return system_variable(f"{owner}.in.{port}", sort, earlier)

            return Variable(Role.INPUT, port + SUFFIXES[earlier], sort)

        return self.output(edge.source.node, edge.source.port, earlier + (1 if edge.delayed else 0))

    def keeper(self, node: str, cell: str) -> str:
        """The name of the cell that stands in for a cell of a node (itself, unless shared)."""
        return self.shared.get(f"{node}.{cell}", f"{node}.{cell}")

    def own_cells(self, of: str = "") -> tuple[tuple[str, str, Cell], ...]:
        """Every cell once, with its node and its name; those `of` a requirement have no node."""
        found = [(node, f"{node}.{cell.name}", cell) for node, cells in self.cells.items() for cell in cells]
        found += [("", cell.name, cell) for cell in (self.observed[of].cells if of in self.observed else ())]
        return tuple(each for each in found if each[1] not in self.shared)

    def share(self) -> None:
        """Merge cells with the same initial value and update: those of requirements with those of nodes and, if time
        matters, all."""
        for of in self.observed or ("",):
            kept: dict[str, str] = {}
            for node, called, cell in self.own_cells(of):
                if cell.initial is None:
                    continue
                itself = {self.placed(node, cell.before): Variable(Role.BOUND, "kept", cell.sort)}
                now = substitute(self.placed(node, cell.now), itself)  # type: ignore[arg-type]
                meaning = f"{digest(now)} {digest(cell.initial)} {len(cell.parameters)} {show_sort(cell.sort)}"
                other = kept.setdefault(meaning, called)
                if other != called and (self.timed or not node):
                    self.shared[called] = other
                    self._mappings.clear()  # readers of one cell read the other from here on

    def placed(self, node: str, term: Term, earlier: int = 0) -> Term:
        """A term over a node's ports (``node.port`` without a node) in system-level variables."""
        return substitute(term, self.mapping(node, earlier)) if node else system_term(self, term, earlier)

    def entry(self, node: str, port: str) -> str:
        """The plan's name for an input from the environment: ``in.map``, or ``planner.map`` if it is separate."""
        return self.own_inputs.get(f"{node}.{port}", f"in.{port}")

    def environment(self, earlier: int = 0) -> dict[str, Term]:
        """The plan's assumptions about the environment, labelled ``environment in.map``."""
        if earlier not in self._environment:
            suffix = " one step before" if earlier else ""
            self._environment[earlier] = {
                f"environment {assumed.port}{suffix}": substitute(assumed.formula, self.mapping(assumed.node, earlier))
                for assumed in self.assumed
            }
        return dict(self._environment[earlier])

    def memory(self, earlier: int = 0, of: str = "") -> dict[str, Term]:
        """The definitions of the cells after each step as functions of its values; also those for a requirement (`of`).
        The labels are ``memory navigation.once#…``."""
        suffix = " one step before" if earlier else ""
        found = {
            f"memory {called}{suffix}": self.placed(
                node, cell.leaves(system_variable(called, cell.sort, earlier)), earlier
            )
            for node, called, cell in self.own_cells(of)
        }
        for node in self.timed[:1]:
            clock = Variable(Role.INPUT, CLOCK.name + SUFFIXES[earlier], REAL)
            found[f"memory {node}.{CLOCK.name}{suffix}"] = substitute(GOES_ON, {CLOCK: clock})
        return found

    @property
    def timed(self) -> tuple[str, ...]:
        """The nodes whose clauses depend on the time between steps; any node, if only requirements do."""
        found = tuple(n for n in self.cells if any(port.variable == CLOCK for port in self.node(n).inputs))
        return found or self.graph.nodes[:1] if any(CLOCK in o.spoken for o in self.observed.values()) else found

    def blank(self, of: str = "") -> dict[str, Term]:
        """The initial values of the cells, also for a requirement (`of`)."""
        return {
            f"initial {called}": self.placed(node, cell.begins())
            for node, called, cell in self.own_cells(of)
            if cell.initial is not None
        }

    def remembering(self, nodes: Iterable[str]) -> bool:
        """Whether some of these nodes have cells: clauses about other steps."""
        return any(name in self.cells for name in nodes)

    def behind(self, node: str, formula: Term) -> tuple[tuple[Variable, bool], ...]:
        """The ports of a node that a formula mentions, and whether it mentions their earlier values, through a cell."""
        known = {cell.name: cell for cell in self.cells.get(node, ())}
        found: dict[tuple[Variable, bool], None] = {}
        seen: set[str] = set()
        stack = [(variable, False) for variable in reversed(ports_of(formula))]
        while stack:
            variable, remembered = stack.pop()
            if variable.role is not Role.INPUT or variable.name not in known:
                found[variable, remembered] = None
            elif variable.name not in seen:
                seen.add(variable.name)
                stack += [(inner, True) for inner in reversed(ports_of(known[variable.name].now))]
        return tuple(found)

    def initials(self, nodes: Iterable[str]) -> dict[str, Term]:
        """The conditions before the first step on the outputs of `nodes` that feed delayed edges."""
        if self._initials is None:
            found: dict[str, dict[str, Term]] = {}
            for edge in self.graph.edges:
                label = f"initial {edge.source}"
                if edge.delayed and label not in found.get(edge.source.node, {}):
                    condition = self._initially(edge)
                    if condition is not None:
                        found.setdefault(edge.source.node, {})[label] = condition
            self._initials = {node: tuple(conditions.items()) for node, conditions in found.items()}
        wanted = frozenset(nodes)
        return dict(item for node, items in self._initials.items() if node in wanted for item in items)

    def _initially(self, edge: Edge) -> Term | None:
        condition = initial_condition(self.system, edge)
        if condition is None:
            return None
        node, port = edge.source.node, edge.source.port
        source = self.node(node).output(port).variable
        return substitute(condition, {**self.mapping(node), source: self.output(node, port, 1)})


def frame(system: System) -> Frame:
    """The frame of a system. Raises Rejected if the plan's formulas are wrong."""
    graph = dataflow(system)
    required = {
        r.id: while_kept(system, r, parse_state(r.formula, system.contract, r.formula_span))
        for r in system.plan.requirements
        if r.formula is not None
    }
    return framed(system, graph, environment_assumptions(system, graph), required)


def framed(system: System, graph: Graph, assumed: Sequence[Assumed], required: Mapping[str, Term]) -> Frame:
    """The frame of a system with the given environment assumptions and requirements."""
    speaking = {name: term for name, term in required.items() if histories(term)}
    clauses = (c.formula for n in system.contract.nodes for c in n.clauses)
    longest = longest_limit((*clauses, *(a.formula for a in assumed), *speaking.values()))
    others, apart = other_paces(system.contract.nodes)
    together = one_pace(system.contract.nodes)
    fresh = partial(Timed, longest=longest, apart=apart) if together else partial(Records, apart=apart)
    nodes: dict[str, Node] = {}
    cells: dict[str, tuple[Cell, ...]] = {}
    given: list[Assumed] = []
    left_out: list[str] = []
    for node in system.contract.nodes:
        own = [a for a in assumed if a.node == node.name]
        nodes[node.name], cells[node.name], formulas = _of_one_step(node, own, fresh, paced=node.name not in others)
        left_out += [
            f"{node.name}.{g.name}"
            for g in node.guarantees
            if _unsaid(g.formula, nodes[node.name].clause(g.name).formula)
        ]
        left_out += [a.port for a, one in zip(own, formulas, strict=True) if _unsaid(a.formula, one.formula)]
        given += formulas
    given.sort(key=lambda a: [each.port for each in assumed].index(a.port))
    constants = frozenset(entry.port for entry in system.plan.environment if entry.constant)
    observed = {name: observing(name, term, fresh()) for name, term in speaking.items()}
    remembering = {name: kept for name, kept in cells.items() if kept}
    own_names = own_inputs(system, graph)
    made = Frame(
        system, graph, tuple(given), own_names, constants, remembering, {}, required, observed, tuple(left_out), nodes
    )
    if made.timed or observed:
        made.share()
    return made


def _unsaid(clause: Term, formula: Term) -> bool:
    """Whether a clause with a limit or a count has no formula over one step. (No first steps violate `eventually`.)"""
    return formula == TRUE and (timed(clause) is not None or counts_steps(clause))


def _of_one_step(
    node: Node, assumed: Sequence[Assumed], fresh: Callable[[], Records], *, paced: bool
) -> tuple[Node, tuple[Cell, ...], list[Assumed]]:
    """The node with clauses over one step, its cells, and the plan's assumptions on its inputs, also over one step.
    `paced`: its pace is a hypothesis."""
    if not remembers(node) and not any(histories(a.formula) for a in assumed):
        return node, (), list(assumed)
    supposed = tuple(Clause(ClauseKind.ASSUMPTION, f"{a.port}{CELL}", 0, a.formula) for a in assumed)
    whole = replace(node, assumptions=(*node.assumptions, *supposed))
    made = compiled(whole, fresh())
    read = (*made.before, *events(made))
    ports = tuple(Port(Role.INPUT, v.name, v.sort, show_sort(v.sort)) for v in read)
    # a clause without a formula over one step is no hypothesis; such an assumption of a node stays, and open
    formulas = {c.name: TRUE if c.name in made.unsaid else c.formula for c in made.node.clauses}
    formulas |= {g.name: TRUE for g in node.guarantees if g.pace is not None and not paced}
    kept = tuple(replace(g, formula=formulas[g.name]) for g in made.node.guarantees)
    known = made.node.assumptions[: len(node.assumptions)]
    given = [replace(a, formula=formulas[each.name]) for a, each in zip(assumed, supposed, strict=True)]
    return replace(node, inputs=(*node.inputs, *ports), assumptions=known, guarantees=kept), made.cells, given


def observing(name: str, formula: Term, records: Records) -> Observed:
    """A requirement that mentions other steps, as a formula over one step."""
    try:
        translated = records.clause(formula)
    except Unsaid as why:
        return Observed(formula, unsaid=why.reason)
    names = {cell.before: replace(cell.before, name=f"{OBSERVED}{name}.{cell.name}") for cell in records.cells}
    spoken = free_variables(translated).union(*(free_variables(cell.now) for cell in records.cells))
    for event in (v for v in spoken if is_arrival(v)):
        node, _, port = event.name.removeprefix("arrived ").partition(".")
        names[event] = replace(event, name=f"{node}.arrived {port}")
    cells = (replace(cell, before=names[cell.before], now=substitute(cell.now, names)) for cell in records.cells)
    return Observed(substitute(translated, names), tuple(cells))


def system_variable(name: str, sort: Sort, earlier: int = 0) -> Variable:
    """A variable of the whole system; its name contains a dot, so that it differs from every bound variable."""
    return Variable(Role.BOUND, name + SUFFIXES[earlier], sort)


def system_term(frame: Frame, formula: Term, earlier: int = 0) -> Term:
    """A formula over ``node.port`` and a requirement's cells in system-level variables."""
    mapping: dict[Variable, Term] = {}
    for variable in free_variables(formula):
        node, _, port = variable.name.partition(".")
        if variable.role is Role.BOUND:
            continue
        if variable == CLOCK:
            mapping[variable] = Variable(Role.INPUT, CLOCK.name + SUFFIXES[earlier], REAL)
            continue
        if node.startswith(OBSERVED):
            kept = frame.shared.get(variable.name, variable.name)
            mapping[variable] = system_variable(kept, variable.sort, earlier + 1)
            continue
        find = frame.input if variable.role is Role.INPUT else frame.output
        mapping[variable] = find(node, port, earlier)
    return substitute(formula, mapping)
