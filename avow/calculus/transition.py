"""Composed contracts as a transition system: which steps a system may take, judged by its contracts alone.

In a step the environment gives values, and the nodes answer in the order in which values flow: with any outputs that
meet their guarantees (any at all where an assumption is broken). What delayed edges carry is the memory between steps.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from random import Random

from avow.calculus.choices import MAX_FOUND, Values, by_variable, definition, search
from avow.calculus.scenario import CannotRun, Point, World, key
from avow.language.contract import Node, Port
from avow.language.sorts import FunctionSort
from avow.language.terms import Role, Term, Variable
from avow.logic.evaluate import NotEvaluable, compile_term
from avow.logic.formula import free_variables, substitute
from avow.logic.solver import z3
from avow.logic.translation import Translator, Unsupported
from avow.logic.values import FunctionValue, Value, show
from avow.system.formulas import initial_condition, ports_of
from avow.system.graph import components, cycles_in
from avow.system.plan import Endpoint

MAX_ANSWERS = 4_000
"""Answers of one node to one input; with more, a search is not exhaustive."""

MAX_SHAPES = MAX_FOUND

Holds = Callable[[Mapping[str, Value]], bool]


@dataclass(frozen=True, slots=True)
class Step:
    """One step: the value of every system variable (``agent.command``, ``in.r``, ``agent.command@before``)."""

    values: Mapping[str, Value] = field(hash=False)
    memory: tuple[object, ...]
    """The key of the memory that it leaves."""
    broken: tuple[str, ...] = ()
    """Assumptions that do not hold at this step."""

    def shown(self, names: Sequence[str]) -> tuple[tuple[str, str], ...]:
        return tuple((name, show(self.values[name])) for name in names if name in self.values)


@dataclass(frozen=True, slots=True)
class Stuck:
    """A node to whose inputs no output answers. `genuine`: by its contract, not only among the scenario's values."""

    node: str
    inputs: tuple[tuple[str, str], ...]
    clauses: tuple[str, ...]
    genuine: bool

    def text(self) -> str:
        given = ", ".join(f"{name} = {value}" for name, value in self.inputs)
        if not self.genuine:
            return f"no value of the scenario meets the guarantees of {self.node} at {given}"
        return f"no output of {self.node} meets {', '.join(self.clauses)} at {given}"


@dataclass(frozen=True, slots=True)
class Walk:
    """A run: up to a node without an answer, or up to a step that leaves the memory that step `back` - 1 left."""

    steps: tuple[Step, ...]
    stuck: Stuck | None = None
    back: int | None = None


@dataclass(slots=True)
class _Solver:
    """One node: its clauses compiled, its answers remembered."""

    node: Node
    world: World
    relations: tuple[tuple[Port, tuple[Point, ...]], ...]
    plain: tuple[tuple[Port, tuple[Value, ...]], ...]
    assumptions: tuple[tuple[str, Holds], ...]
    guarantees: tuple[tuple[str, Holds], ...]
    read: tuple[str, ...]
    """Inputs that the guarantees mention."""
    assumed: tuple[str, ...]
    """Inputs that the assumptions mention."""
    shapes: tuple[Values, ...] | None
    """The relations that its guarantees allow whatever the inputs; None where that is no help."""
    answers: dict[object, tuple[Values, ...]] = field(default_factory=dict)
    broken: dict[object, tuple[str, ...]] = field(default_factory=dict)


class Machine:
    """The transition system of a composed system over its scenario. Raises CannotRun where it has none."""

    def __init__(self, world: World, seed: int = 0) -> None:
        self.world = world
        self.frame = world.frame
        self.graph = world.frame.graph
        self.seed = seed
        self.incomplete: set[str] = set()
        """Why a search through this machine is not exhaustive, if it is not."""
        self.order = self._order()
        self.solvers = {name: self._solver(self.frame.node(name)) for name in self.order}
        self.constants: list[str] = []
        self.environment = self._environment()
        self.memory = tuple(dict.fromkeys(edge.source for edge in self.graph.edges if edge.delayed))
        self.memories: dict[tuple[object, ...], Values] = {}
        self.stuck: dict[tuple[object, ...], Stuck] = {}
        self._first: tuple[tuple[object, ...], ...] | None = None
        self._steps: dict[tuple[object, ...], tuple[Step, ...]] = {}

    # -- set-up --------------------------------------------------------------------------------------------------------

    def _order(self) -> tuple[str, ...]:
        arcs = [(e.source.node, e.target.node) for e in self.graph.edges if not e.delayed]
        groups = components(self.graph.nodes, arcs)
        for group in groups:
            cycles = cycles_in(group, arcs)
            if cycles:
                shown = " → ".join((*cycles[0], cycles[0][0]))
                raise CannotRun(f"start-up deadlock: {shown} wait for one another within one step")
        return tuple(name for group in groups for name in group)

    def _solver(self, node: Node) -> _Solver:
        functions = [p for p in node.outputs if isinstance(p.sort, FunctionSort)]
        relations = tuple((p, self.world.points(node.name, p)) for p in functions)
        plain = tuple((p, self.world.candidates(node.name, p)) for p in node.outputs if p not in functions)
        mentioned = {v.name for clause in node.guarantees for v in ports_of(clause.formula) if v.role is Role.INPUT}
        assumed = {v.name for clause in node.assumptions for v in ports_of(clause.formula)}
        searched = [(p, points) for p, points in relations if definition(node.guarantees, p) is None]

        return _Solver(
            node,
            self.world,
            relations,
            plain,
            tuple((clause.name, self.judge(clause.formula)) for clause in node.assumptions),
            tuple((clause.name, self.judge(clause.formula)) for clause in node.guarantees),
            tuple(p.name for p in node.inputs if p.name in mentioned),
            tuple(p.name for p in node.inputs if p.name in assumed),
            self._shapes(node, searched),
        )

    def _shapes(self, node: Node, relations: Sequence[tuple[Port, tuple[Point, ...]]]) -> tuple[Values, ...] | None:
        """Found once, these need only be held against the other guarantees for each input."""
        own = {port.variable for port, _ in relations}
        about = [clause.formula for clause in node.guarantees if set(ports_of(clause.formula)) <= own]
        if not relations or not about:
            return None
        found, complete = search(relations, (), about, {}, self.seed)
        return tuple(found) if complete and len(found) <= MAX_SHAPES else None

    def judge(self, formula: Term, *, finite: bool = False) -> Holds:
        """Whether a formula holds: exactly if that can be had, else with quantifiers over the scenario's values.
        `finite`: over the scenario's values in any case."""
        # Evaluation takes a free variable of a system for one that has yet to be found, unless it is an input.
        given = {v: Variable(Role.INPUT, f"={v.name}", v.sort) for v in free_variables(formula) if v.role is Role.BOUND}
        names = [(v.name, known.qualified) for v, known in given.items()]
        closed = substitute(formula, given)
        exact = None if finite else compile_term(closed)
        bounded = compile_term(closed, domains=self.world.domains)

        def holds(found: Mapping[str, Value]) -> bool:
            values = {**found, **{known: found[name] for name, known in names}} if names else found
            if exact is not None:
                try:
                    return bool(exact(values))
                except NotEvaluable:
                    pass
            try:
                return bool(bounded(values))
            except NotEvaluable as reason:
                raise CannotRun(f"a formula cannot be evaluated: {reason.reason}") from None

        return holds

    def _environment(self) -> dict[tuple[object, ...], tuple[Values, ...]]:
        """Every combination of what the environment may give at a step, by the values of its constants."""
        names: dict[str, tuple[Value, ...]] = {}
        for endpoint in self.graph.environment:
            variable = self.frame.input(endpoint.node, endpoint.port)
            port = self.frame.node(endpoint.node).input(endpoint.port)
            names.setdefault(variable.qualified, self.world.choices(endpoint.node, port))
            if {
                f"in.{endpoint.port}",
                str(endpoint),
            } & self.frame.constants and variable.qualified not in self.constants:
                self.constants.append(variable.qualified)
        facts = [self.judge(term) for term in self.frame.environment().values()]
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
        for choices in self.environment.values():
            constants = {name: choices[0][name] for name in self.constants}
            ranges = [tuple({key(v): v for v in self._initially(e, choices)}.values()) for e in self.memory]
            for values in product(*ranges):
                yield self._remember({**constants, **dict(zip(names, values, strict=True))})

    def _initially(self, endpoint: Endpoint, choices: Sequence[Values]) -> Iterator[Value]:
        """The initial values of an output, for whatever its node's environment inputs may be at first."""
        edge = next(e for e in self.graph.edges if e.delayed and e.source == endpoint)
        condition = initial_condition(self.frame.system, edge)
        port = self.frame.node(endpoint.node).output(endpoint.port)
        inputs = sorted({v.name for v in ports_of(condition) if v.role is Role.INPUT}) if condition is not None else []
        names = {f"in.{name}": self.frame.input(endpoint.node, name).qualified for name in inputs}
        given = {tuple(key(values[name]) for name in names.values()): values for values in choices}
        if len(given) > 1:
            self.incomplete.add(f"the initial value of {endpoint} depends on inputs that change")
        for values in given.values():
            known = {own: values[name] for own, name in names.items()}
            yield from self._initial_values(endpoint, port, condition, known)

    def _initial_values(
        self, endpoint: Endpoint, port: Port, condition: Term | None, given: Values
    ) -> tuple[Value, ...]:
        if isinstance(port.sort, FunctionSort):
            points = self.world.points(endpoint.node, port)
            constraints = [] if condition is None else [condition]
            known = by_variable(self.frame.node(endpoint.node), given)
            answers, complete = search(((port, points),), (), constraints, known, self.seed)
            if not complete:
                self.incomplete.add(f"too many initial values of {endpoint}")
            found = tuple(answer[port.name] for answer in answers)
        else:
            candidates = self.world.candidates(endpoint.node, port)
            holds = self.judge(condition) if condition is not None else None
            found = tuple(v for v in candidates if holds is None or holds({**given, f"out.{port.name}": v}))
        if not found:
            raise CannotRun(f"no value of the scenario is an initial value of {endpoint}")
        return found

    def _remember(self, values: Values) -> tuple[object, ...]:
        names = [*self.constants, *map(str, self.memory)]
        found = tuple(key(values[name]) for name in names)
        self.memories.setdefault(found, {name: values[name] for name in names})
        return found

    def _before(self, memory: tuple[object, ...]) -> Values:
        """What a memory gives to the next step."""
        values = self.memories[memory]
        return {f"{endpoint}@before": values[str(endpoint)] for endpoint in self.memory}

    def _given(self, memory: tuple[object, ...]) -> tuple[Values, ...]:
        """What the environment may give after a memory."""
        return self.environment[memory[: len(self.constants)]]

    # -- one run -------------------------------------------------------------------------------------------------------

    def walk(self, random: Random, length: int, *, until_repeat: bool = False) -> Walk:
        """One run, chosen at random: each node answers what it is given with one of its allowed outputs."""
        memory = random.choice(self.initial())
        steps: list[Step] = []
        seen: dict[tuple[object, ...], int] = {}
        for number in range(length):
            values = self._before(memory) | random.choice(self._given(memory))
            broken: tuple[str, ...] = ()
            for name in self.order:
                answers, faults = self._answers(name, values)
                if not answers:
                    return Walk(tuple(steps), self._why_stuck(self.solvers[name], self._inputs(name, values)))
                broken += faults
                values |= {f"{name}.{port}": value for port, value in random.choice(answers).items()}
            memory = self._remember(values)
            steps.append(Step(values, memory, broken))
            if until_repeat and memory in seen:
                return Walk(tuple(steps), None, seen[memory] + 1)
            seen.setdefault(memory, number)
        return Walk(tuple(steps))

    # -- steps ---------------------------------------------------------------------------------------------------------

    def steps(self, memory: tuple[object, ...]) -> tuple[Step, ...]:
        """Every step from a memory. Where some node has no answer to what it may be given, see `stuck`."""
        if memory not in self._steps:
            self._steps[memory] = tuple(self._all_steps(memory))
        return self._steps[memory]

    def _all_steps(self, memory: tuple[object, ...]) -> Iterator[Step]:
        before = self._before(memory)
        for given in self._given(memory):
            partial: list[tuple[Values, tuple[str, ...]]] = [({**before, **given}, ())]
            for name in self.order:
                extended: list[tuple[Values, tuple[str, ...]]] = []
                for values, broken in partial:
                    answers, faults = self._answers(name, values)
                    if not answers and memory not in self.stuck:
                        self.stuck[memory] = self._why_stuck(self.solvers[name], self._inputs(name, values))

                    extended += [
                        ({**values, **{f"{name}.{port}": v for port, v in answer.items()}}, broken + faults)
                        for answer in answers
                    ]
                partial = extended
            for values, broken in partial:
                yield Step(values, self._remember(values), broken)

    def _inputs(self, name: str, values: Values) -> Values:
        node = self.frame.node(name)
        return {f"in.{port.name}": values[self.frame.input(name, port.name).qualified] for port in node.inputs}

    def _answers(self, name: str, values: Values) -> tuple[tuple[Values, ...], tuple[str, ...]]:
        """What a node may put out, given what it reads; and its assumptions that do not hold."""
        solver = self.solvers[name]
        inputs = self._inputs(name, values)

        place = tuple(key(inputs[f"in.{port}"]) for port in solver.assumed)
        if place not in solver.broken:
            failed = [clause for clause, holds in solver.assumptions if not holds(inputs)]
            solver.broken[place] = tuple(f"{name}.{clause}" for clause in failed)
        broken = solver.broken[place]
        index = (bool(broken), *(key(inputs[f"in.{port}"]) for port in solver.read))
        if index not in solver.answers:
            solver.answers[index] = self._solve(solver, inputs, free=bool(broken))
        return solver.answers[index], broken

    def _solve(self, solver: _Solver, inputs: Values, *, free: bool) -> tuple[Values, ...]:
        """Every output that meets the guarantees (all of them, where an assumption is broken)."""
        guarantees = () if free else solver.guarantees
        defined, searched = self._defined(solver, inputs) if not free else ({}, list(solver.relations))
        if searched and (free or solver.shapes is None):
            constraints = [] if free else [clause.formula for clause in solver.node.guarantees]
            known = inputs | {f"out.{name}": value for name, value in defined.items()}
            given = by_variable(solver.node, known)
            answers, complete = search(searched, solver.plain, constraints, given, self.seed)
            if not complete:
                self.incomplete.add(f"{solver.node.name} has more than {MAX_ANSWERS} answers to one input")
            return tuple({**defined, **answer} for answer in answers)
        found: list[Values] = []
        names = [port.name for port, _ in solver.plain]
        shapes = solver.shapes if searched and solver.shapes is not None else ({},)
        choices = [dict(zip(names, values, strict=True)) for values in product(*(values for _, values in solver.plain))]
        for shape, choice in product(shapes, choices):
            outputs: Values = {**defined, **shape, **choice}

            valuation = inputs | {f"out.{name}": value for name, value in outputs.items()}
            if all(holds(valuation) for _, holds in guarantees):
                found.append(outputs)
                if len(found) >= MAX_ANSWERS:
                    self.incomplete.add(f"{solver.node.name} has more than {MAX_ANSWERS} answers to one input")
                    break
        return tuple(found)

    def _defined(self, solver: _Solver, inputs: Values) -> tuple[Values, list[tuple[Port, tuple[Point, ...]]]]:
        """Relations that a guarantee defines point by point, computed; and those that have to be searched for."""
        defined: Values = {}
        searched: list[tuple[Port, tuple[Point, ...]]] = []
        for port, points in solver.relations:
            found = definition(solver.node.guarantees, port)
            if found is None:
                searched.append((port, points))
                continue
            variables, body = found
            holds = self.judge(body)
            table = {
                point: True
                for point in points
                if holds(inputs | {v.name: x for v, x in zip(variables, point, strict=True)})
            }
            defined[port.name] = FunctionValue(table, False)
        return defined, searched

    def _why_stuck(self, solver: _Solver, inputs: Values) -> Stuck:
        """Is there really no output, or only none in the scenario? Z3 knows the contract without the scenario."""
        node = solver.node
        shown = tuple((name, show(value)) for name, value in inputs.items() if name[3:] in solver.read)
        constants = by_variable(node, inputs)
        translator = Translator()
        z3_solver = z3.Solver(ctx=translator.context)
        z3_solver.set("timeout", 5_000)
        names = tuple(clause.name for clause in node.guarantees)
        try:
            meanings = {v: translator.value(value, v.sort) for v, value in constants.items()}
            z3_solver.add(*translator.background([p.variable for p in node.outputs]))
            switches = []
            for clause in node.guarantees:
                switch = z3.Bool(f"use {clause.name}", translator.context)
                z3_solver.add(z3.Implies(switch, translator.term(clause.formula, meanings)))
                switches.append(switch)
            if z3_solver.check(*switches) == z3.unsat:
                core = {str(switch) for switch in z3_solver.unsat_core()}
                needed = tuple(name for name in names if f"use {name}" in core)
                return Stuck(node.name, shown, needed or names, True)
        except (Unsupported, z3.Z3Exception):
            pass
        return Stuck(node.name, shown, names, False)
