"""Composed contracts as a transition system: the steps that a system may take according to its contracts alone.

In a step the environment gives values, and the nodes respond in the order in which values flow, with any outputs that
satisfy their guarantees (any outputs at all if an assumption is broken). The values on delayed edges are the memory
between steps. A function's values are decided when they are first read: by its node, by a consumer, or by a property.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field
from itertools import product
from random import Random

from avow.base.graphs import components, cycles_in
from avow.base.plain import circle
from avow.base.records import dataclass
from avow.base.tuning.bounds import NODE_ANSWERS
from avow.base.tuning.effort import SEARCH_STEPS
from avow.calculus.cut_off import another_first, first_cut
from avow.calculus.narrowing import Holds, Narrowing, Undecided, Unknown, Values, decided, forcings
from avow.calculus.node_outputs import Answerer, Doubts, Stuck, by_variable, is_restricted, judge, possible, search
from avow.calculus.scenario import CannotRun, World, key
from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.formulas.formula import free_variables
from avow.formulas.temporal.ages import CLOCK
from avow.formulas.temporal.cell import CELL, Cell
from avow.formulas.temporal.clock import is_arrival
from avow.formulas.values import Value, show
from avow.language.contract import Clause, ClauseKind
from avow.language.sorts import BOOL, FunctionSort, OpaqueSort
from avow.language.subterms import ports_of
from avow.language.terms import TRUE, Role, Term
from avow.solving.limits import spend
from avow.system.formulas import initial_condition
from avow.system.plan import Endpoint


@dataclass(frozen=True, slots=True)
class Step:
    """One step: the value of every system variable (``agent.command``, ``in.r``, ``agent.command@before``)."""

    values: Mapping[str, Value] = field(hash=False)
    memory: tuple[object, ...]
    """The key of the memory after it."""
    broken: tuple[str, ...] = ()
    """Assumptions that do not hold at this step."""

    def shown(self, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
        return tuple((name, show(self.values[name])) for name in names if name in self.values)


@dataclass(frozen=True, slots=True)
class Walk:
    """A run: up to a node without an output, or up to a step with the same memory after it as after step `back` - 1."""

    steps: tuple[Step, ...]
    stuck: Stuck | None = None
    back: int | None = None


@dataclass(frozen=True, slots=True)
class _Kept:
    """A cell: its initial value, and its value after a step."""

    initial: Value
    now: Callable[[Mapping[str, Value]], Value]


class Machine:
    """The transition system of a composed system over its scenario. Raises CannotRun if it has none."""

    def __init__(self, world: World, seed: int = 0, of: str = "") -> None:
        self.world = world
        self.frame = world.frame
        self.of = of
        """The requirement whose cells are included."""
        self.graph = world.frame.graph
        self.seed = seed
        self.doubts = Doubts()
        self.order = self._order()
        self.nodes = {name: Answerer(world, self.frame.node(name), seed, self.doubts) for name in self.order}
        self.reads = {
            name: tuple(
                (f"in.{p.name}", self.frame.input(name, p.name).qualified) for p in self.frame.node(name).inputs
            )
            for name in self.order
        }
        """The variables that each node's inputs read."""
        self.incomplete.update(self._unspecified())
        self.constants: list[str] = []
        self.cells = {called: self._kept(node, cell) for node, called, cell in self.frame.own_cells(of)}
        """The cells of the clauses, by name."""
        self.supposed: dict[str, Holds] = {}
        """The environment assumptions that mention cells."""
        self.environment = self._environment()
        self.given = [values for choices in self.environment.values() for values in choices]
        """The environment inputs that are tried."""
        self.memory = tuple(dict.fromkeys(edge.source for edge in self.graph.edges if edge.delayed))
        self.freed = {node: f"{node}.broken{CELL}" for node in self.frame.cells}
        """For each node with cells: whether an assumption has been broken; then its guarantees no longer apply."""
        self.remembered = (*self.constants, *map(str, self.memory), *self.cells, *self.freed.values())
        self.memories: dict[tuple[object, ...], Values] = {}
        self.stuck: dict[tuple[object, ...], Stuck] = {}
        self._begun: list[tuple[Endpoint, Term | None, Values, tuple[Value, ...]]] = []
        """Each output's initial values, as found for the initial inputs of its node."""
        self._first: tuple[tuple[object, ...], ...] | None = None
        self._given_first: dict[tuple[object, ...], tuple[Values, ...]] = {}
        self._steps: dict[tuple[object, ...], tuple[Step, ...]] = {}

    @property
    def incomplete(self) -> set[str]:
        """Why a search through this machine is not exhaustive, if it is not."""
        return self.doubts.incomplete

    @property
    def short(self) -> list[str]:
        """Why a property of every step found may not hold for every step that the scenario allows."""
        inexact = [f"{name} could be judged over the scenario's values only" for name in sorted(self.doubts.inexact)]
        return [*sorted(self.incomplete), *inexact]

    def look_for_cuts(self, deadline: float) -> None:
        """Notes each place where the contracts allow an output that the scenario's values leave out: its continuations
        were not explored. `deadline` is in units of `avow.solving.limits.spent`."""
        for answerer in self.nodes.values():
            cut = first_cut(answerer, deadline)
            if cut:
                self.incomplete.add(cut)
        self.incomplete.update(stuck.text() for stuck in self.stuck.values() if not stuck.genuine)
        self.initial()
        for endpoint, condition, given, found in self._begun:
            node, port = self.nodes[endpoint.node], self.frame.node(endpoint.node).output(endpoint.port)
            if is_restricted(node, port) and another_first(node, port, condition or TRUE, given, found):
                self.incomplete.add(f"before the first step {endpoint} may have other values than the scenario's")

    def _unspecified(self) -> Iterator[str]:
        """One value of an unspecified type is tried; this is exhaustive only if no clause mentions it."""
        for name in self.order:
            node = self.frame.node(name)
            spoken = {v for clause in node.clauses for v in ports_of(clause.formula)}
            for port in (*node.inputs, *node.outputs):
                if isinstance(port.sort, OpaqueSort) and port.variable in spoken:
                    yield f"one value of the unspecified type of {name}.{port.name} is tried"

    # -- set-up --------------------------------------------------------------------------------------------------------

    def _order(self) -> tuple[str, ...]:
        arcs = [(e.source.node, e.target.node) for e in self.graph.edges if not e.delayed]
        groups = components(self.graph.nodes, arcs)
        for group in groups:
            cycles = cycles_in(group, arcs)
            if cycles:
                shown = circle(cycles[0])
                raise CannotRun(f"start-up deadlock: {shown} wait for one another within one step")
        return tuple(name for group in groups for name in group)

    def _environment(self) -> dict[tuple[object, ...], tuple[Values, ...]]:
        """Every combination of environment inputs at a step, by the values of its constants."""
        names: dict[str, tuple[Value, ...]] = {}
        for endpoint in self.graph.environment:
            variable = self.frame.input(endpoint.node, endpoint.port)
            port = self.frame.node(endpoint.node).input(endpoint.port)
            names.setdefault(variable.qualified, self.world.choices(endpoint.node, port))
            entry = self.frame.entry(endpoint.node, endpoint.port)
            if entry in self.frame.constants and variable.qualified not in self.constants:
                self.constants.append(variable.qualified)
        if self.frame.timed:
            names[CLOCK.qualified] = self.world.lengths()
        arrivals = [(n, p.name) for n in self.frame.cells for p in self.frame.node(n).inputs if is_arrival(p.variable)]
        arrivals += self.frame.observed[self.of].arrivals if self.of in self.frame.observed else ()
        names.update((self.frame.input(name, event).qualified, (False, True)) for name, event in arrivals)
        facts: list[Holds] = []
        for label, term in self.frame.environment().items():
            fact = judge(self.world, term, doubts=self.doubts, about=label)
            if {v.name.removesuffix("@before") for v in free_variables(term)} & self.cells.keys():
                self.supposed[label] = fact
            else:
                facts.append(fact)
        found: dict[tuple[object, ...], list[Values]] = {}
        for combination in product(*names.values()):
            values: Values = dict(zip(names, combination, strict=True))
            if all(fact(values) for fact in facts):
                found.setdefault(tuple(key(values[name]) for name in self.constants), []).append(values)
        if not found:
            raise CannotRun("no value of the scenario is as the plan assumes of the environment")
        return {constants: tuple(choices) for constants, choices in found.items()}

    # -- memory --------------------------------------------------------------------------------------------------------

    def initial(self) -> tuple[tuple[object, ...], ...]:
        """The memories before the first step."""
        if self._first is None:
            self._first = tuple(dict.fromkeys(self._initial()))
        return self._first

    def _initial(self) -> Iterator[tuple[object, ...]]:
        names = [str(endpoint) for endpoint in self.memory]
        blank = {name: cell.initial for name, cell in self.cells.items()} | dict.fromkeys(self.freed.values(), False)
        conditions = {endpoint: self._initially(endpoint) for endpoint in self.memory}
        changing = [n for _, read in conditions.values() for n in read.values() if n not in self.constants]
        for choices in self.environment.values():
            together: dict[tuple[object, ...], list[Values]] = {}
            for given in choices:
                together.setdefault(tuple(key(given[name]) for name in changing), []).append(given)
            for place, some in together.items():
                ranges = []
                for endpoint, (condition, read) in conditions.items():
                    known = {own: some[0][name] for own, name in read.items()}
                    ranges.append(self._initial_values(endpoint, condition, known))
                constants = {name: some[0][name] for name in self.constants}
                for values in product(*ranges):
                    memory = self._noted({**constants, **blank, **dict(zip(names, values, strict=True))})
                    yield self._before_the_first(memory, place, some) if changing else memory

    def _before_the_first(
        self, memory: tuple[object, ...], place: tuple[object, ...], given: Sequence[Values]
    ) -> tuple[object, ...]:
        """The memory for a first step with the environment inputs for which the initial values were chosen."""
        first = (*memory, ("first", *place))
        self.memories[first] = self.memories[memory]
        self._given_first[first] = tuple(given)
        return first

    def _initially(self, endpoint: Endpoint) -> tuple[Term | None, dict[str, str]]:
        """The initial condition of an output, and the variables that its node's inputs mentioned there read."""
        edge = next(e for e in self.graph.edges if e.delayed and e.source == endpoint)
        condition = initial_condition(self.frame.system, edge)
        inputs = sorted({v.name for v in ports_of(condition) if v.role is Role.INPUT}) if condition is not None else []
        return condition, {f"in.{name}": self.frame.input(endpoint.node, name).qualified for name in inputs}

    def _initial_values(self, endpoint: Endpoint, condition: Term | None, given: Values) -> tuple[Value, ...]:
        port = self.frame.node(endpoint.node).output(endpoint.port)
        name = f"out.{port.name}"
        if isinstance(port.sort, FunctionSort) and port.sort.result == BOOL:
            points = self.world.points(endpoint.node, port)
            constraints = [] if condition is None else [condition]
            known = by_variable(self.frame.node(endpoint.node), given)
            answers, complete = search(((port, points),), (), constraints, known, self.seed, self.world.effort)
            found = tuple(answer[port.name] for answer in answers)
        else:
            clauses = [] if condition is None else [Clause(ClauseKind.GUARANTEE, "initial", 1, condition)]
            guarantees = [(frozenset({name}), judge(self.world, c.formula, doubts=self.doubts)) for c in clauses]
            outputs = {name: possible(self.world, endpoint.node, port)}
            try:
                narrowed, complete = Narrowing(outputs, tuple(guarantees), forcings(clauses), self.incomplete).answers(
                    given, NODE_ANSWERS
                )
            except Unknown as unknown:
                raise CannotRun(f"the initial value of {endpoint}: {unknown}") from None
            found = tuple(answer[name] for answer in narrowed)
        if not complete:
            self.doubts.incomplete.add(f"too many initial values of {endpoint}")
        if not found:
            raise CannotRun(f"no value of the scenario is an initial value of {endpoint}")
        self._begun.append((endpoint, condition, given, found))
        return found

    def _kept(self, node: str, cell: Cell) -> _Kept:
        """The cell as functions. Raises CannotRun if it cannot be computed step by step."""
        if cell.parameters or cell.initial is None:
            raise CannotRun(f"{node or self.of} remembers something for each of many values, or of an unspecified type")
        now = compile_term(self.frame.placed(node, cell.now))
        return _Kept(compile_term(cell.initial)({}), now)

    def _remember(self, values: Values) -> tuple[object, ...]:
        try:
            return self._noted(values | {name: cell.now(values) for name, cell in self.cells.items()})
        except (NotEvaluable, Undecided) as reason:
            raise CannotRun(f"what a clause remembers has no value: {reason}") from None

    def _noted(self, values: Values) -> tuple[object, ...]:
        names = self.remembered
        found = tuple([key(values[name]) for name in names])
        if found not in self.memories:
            self.memories[found] = {name: values[name] for name in names}
        return found

    def _before(self, memory: tuple[object, ...]) -> Values:
        """The values that a memory provides to the next step."""
        values = self.memories[memory]
        return {f"{name}@before": values[name] for name in (*map(str, self.memory), *self.cells, *self.freed.values())}

    def _given(self, memory: tuple[object, ...]) -> tuple[Values, ...]:
        """The possible environment inputs after a memory, together with the values from that memory; empty if none
        satisfies the assumptions."""
        before = self._before(memory)
        choices = self._given_first.get(memory) or self.environment[memory[: len(self.constants)]]
        found = tuple(before | given for given in choices)
        found = tuple(values for values in found if all(fact(values) for fact in self.supposed.values()))
        if not found:
            self.stuck.setdefault(memory, Stuck("", (), tuple(self.supposed), genuine=False))
        return found

    def judge(self, formula: Term) -> Holds:
        """Whether a formula holds at a step, with quantifiers over the scenario's values. It raises Undecided."""
        return judge(self.world, formula, finite=True)

    # -- one run -------------------------------------------------------------------------------------------------------

    def walk(self, random: Random, length: int, *, until_repeat: bool = False, judges: Sequence[Holds] = ()) -> Walk:
        """One random run: each node responds to its inputs with one of its allowed outputs.

        `judges`: the state formulas that will be evaluated; they determine which open values are decided.
        """
        memory = random.choice(self.initial())
        steps: list[Step] = []
        seen: dict[tuple[object, ...], int] = {}
        for number in range(length):
            if not (choices := self._given(memory)):
                return Walk(tuple(steps), self.stuck[memory])
            values = random.choice(choices)
            broken: tuple[str, ...] = ()
            for name in self.order:
                extended = self._extended(name, values, random)
                if not extended:
                    return Walk(tuple(steps), self.nodes[name].stuck(self._inputs(name, values)))
                values, faults = random.choice(extended)
                broken += faults
            for holds in judges:
                values = random.choice(self._settled(values, holds, random))
            memory = self._remember(values)
            steps.append(Step(values, memory, broken))
            if until_repeat and memory in seen:
                return Walk(tuple(steps), None, seen[memory] + 1)
            seen.setdefault(memory, number)
        return Walk(tuple(steps))

    # -- steps ---------------------------------------------------------------------------------------------------------

    def steps(self, memory: tuple[object, ...]) -> tuple[Step, ...]:
        """Every step from a memory. `stuck` records nodes without an output for some possible input."""
        if memory not in self._steps:
            self._steps[memory] = tuple(self._all_steps(memory))
        return self._steps[memory]

    def judged(self, memory: tuple[object, ...], judges: Sequence[Holds]) -> Iterator[Step]:
        """Every step from a memory, with as many values decided as are needed to judge it."""
        for step in self.steps(memory):
            partial: list[Values] = [dict(step.values)]
            for holds in judges:
                partial = [settled for values in partial for settled in self._settled(values, holds)]
            if len(partial) == 1 and partial[0] == step.values:
                yield step
                continue
            for values in partial:
                yield Step(values, self._remember(values), step.broken)

    def _all_steps(self, memory: tuple[object, ...]) -> Iterator[Step]:
        for given in self._given(memory):
            partial: list[tuple[Values, tuple[str, ...]]] = [(given, ())]
            for name in self.order:
                extended: list[tuple[Values, tuple[str, ...]]] = []
                for values, broken in partial:
                    further = self._extended(name, values)
                    if not further and memory not in self.stuck:
                        self.stuck[memory] = self.nodes[name].stuck(self._inputs(name, values))
                    extended += [(more, broken + faults) for more, faults in further]
                partial = extended
            for values, broken in partial:
                yield Step(values, self._remember(values), broken)

    def _inputs(self, name: str, values: Values) -> Values:
        return {own: values[meant] for own, meant in self.reads[name]}

    def _extended(
        self, name: str, values: Values, random: Random | None = None
    ) -> list[tuple[Values, tuple[str, ...]]]:
        """The values with each output of a node, and its broken assumptions; the open values that it reads are decided
        first (in each way, or at random)."""
        node, freed = self.nodes[name], self.freed.get(name)
        waiting, found = [values], []
        while waiting:
            values = waiting.pop()
            inputs = self._inputs(name, values)
            try:
                answers, broken = node.answers(inputs, free=bool(freed and values[f"{freed}@before"]))
            except Undecided as undecided:
                at, point = undecided.wanted[0]
                waiting += self._decided(values, self.frame.input(name, at[3:]).qualified, point, random)
                continue
            spend(SEARCH_STEPS)
            for answer in answers:
                more = values.copy()
                for port, value in answer.items():
                    more[f"{name}.{port}"] = value
                if freed:
                    more[freed] = bool(broken) or values[f"{freed}@before"]
                found.append((more, broken))
        return found

    def _settled(self, values: Values, holds: Holds, random: Random | None = None) -> list[Values]:
        """The values with as many open points decided as are needed to judge them."""
        waiting, found = [values], []
        while waiting:
            values = waiting.pop()
            try:
                holds(values)
                found.append(values)
            except Undecided as undecided:
                at, point = undecided.wanted[0]
                waiting += self._decided(values, at, point, random)
        return found

    def _decided(self, values: Values, name: str, point: tuple[Value, ...], random: Random | None) -> list[Values]:
        """The values with one point of an open output decided, in each way (or in one way at random)."""
        node, _, port = name.partition("@")[0].partition(".")
        choices = self.nodes[node].choices[f"out.{port}"]
        if choices.values is None:
            raise CannotRun(choices.why)
        if choices.restricted:
            self.incomplete.add(choices.restricted)
        chosen = choices.values if random is None else (random.choice(choices.values),)
        return [{**values, name: decided(values[name], point, value)} for value in reversed(chosen)]
