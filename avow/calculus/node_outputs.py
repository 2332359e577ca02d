"""The outputs of one node: given its inputs, which outputs do its guarantees allow, over the scenario's values?

Z3 finds relations, with one bit for each point at which they may hold; narrowing finds everything else. Open values
(`avow.calculus.narrowing`) are decided only where a clause reads them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from avow.base.records import dataclass
from avow.base.tuning.bounds import CHOICES_FOUND, NODE_ANSWERS, SEQUENCE_LENGTHS
from avow.calculus.narrowing import (
    ANY,
    Choices,
    Holds,
    Narrowing,
    Undecided,
    Unknown,
    Values,
    forcings,
    is_open,
    lazy_names,
    opened,
)
from avow.calculus.scenario import CannotRun, Point, World, key
from avow.evaluation.evaluate import NotEvaluable, compile_term, finite_values
from avow.formulas.formula import free_variables, substitute
from avow.formulas.values import FunctionValue, SequenceValue, Value, show
from avow.language.contract import Clause, Node, Port
from avow.language.sorts import BOOL, FunctionSort, NaturalSort, OpaqueSort, SequenceSort, Sort
from avow.language.subterms import ports_of
from avow.language.terms import Apply, Iff, Quantified, Quantifier, Role, Term, Variable
from avow.solving.checking import put
from avow.solving.models import Model
from avow.solving.translation import Meaning, Translator, Unsupported
from avow.solving.z3_module import z3


def by_variable(node: Node, values: Values) -> dict[Variable, Value]:
    ports = {p.variable.qualified: p.variable for p in (*node.inputs, *node.outputs)}
    return {ports[name]: value for name, value in values.items() if name in ports}


def definition(guarantees: Sequence[Clause], port: Port) -> tuple[tuple[Variable, ...], Term] | None:
    """For ``forall(x | out.p(x) <=> body)``: x and body, if body does not mention outputs."""
    for clause in guarantees:
        formula = clause.formula
        if not (isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL):
            continue
        if not isinstance(formula.body, Iff):
            continue
        for head, body in ((formula.body.left, formula.body.right), (formula.body.right, formula.body.left)):
            applied = isinstance(head, Apply) and head.function == port.variable and head.arguments == formula.variables
            if applied and all(v.role is not Role.OUTPUT for v in free_variables(body)):
                return formula.variables, body
    return None


def search(
    relations: Sequence[tuple[Port, tuple[Point, ...]]],
    plain: Sequence[tuple[Port, tuple[Value, ...]]],
    constraints: Sequence[Term],
    known: Mapping[Variable, Value],
    seed: int,
    effort: int,
) -> tuple[list[Values], bool]:
    """Every choice of outputs that satisfies the constraints, found by Z3 with one bit for each point of a relation.

    Also returns whether these are all. Raises CannotRun if Z3 cannot decide.
    """
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    try:
        meanings: dict[Variable, Any] = {v: translator.value(value, v.sort) for v, value in known.items()}
        bits: list[tuple[Port, Point, Any]] = []
        for port, points in relations:
            assert isinstance(port.sort, FunctionSort)
            rows = []
            for k, point in enumerate(points):
                bit = z3.Bool(f"{port.name}#{k}", translator.context)
                bits.append((port, point, bit))
                rows.append(([translator.value(x, s) for x, s in zip(point, port.sort.parameters, strict=True)], bit))
            meanings[port.variable] = translator.table(rows, z3.BoolVal(False, translator.context))
        chosen = []
        for port, values in plain:
            constant = translator.variable(port.variable)
            solver.add(z3.Or([constant == translator.value(value, port.sort) for value in values]))
            chosen.append((port, constant))
        solver.add(*(translator.term(constraint, meanings) for constraint in constraints))
        found: list[Values] = []
        while True:
            reply = put(translator, solver, effort, seed)
            if reply.status == "unsat":
                return found, True
            if reply.status != "sat":
                raise CannotRun(f"the solver cannot decide which outputs are allowed: {reply.reason}")
            if len(found) >= CHOICES_FOUND:
                return found, False
            model = solver.model()
            reader = Model(translator, model)
            answer: Values = {port.name: reader.read(constant, port.sort) for port, constant in chosen}
            literals = [constant != model.eval(constant, model_completion=True) for _, constant in chosen]
            tables: dict[str, dict[tuple[Value, ...], Value]] = {port.name: {} for port, _ in relations}
            for port, point, bit in bits:
                truth = z3.is_true(model.eval(bit, model_completion=True))
                literals.append(z3.Not(bit) if truth else bit)
                if truth:
                    tables[port.name][point] = True
            answer.update({name: FunctionValue(table, False) for name, table in tables.items()})
            found.append(answer)
            solver.add(z3.Or(literals) if literals else z3.BoolVal(False, translator.context))
    except Unsupported as what:
        raise CannotRun(f"Avow cannot express {what.what} for the solver") from None
    except z3.Z3Exception as error:
        raise CannotRun(f"Z3: {error}") from None


@dataclass(frozen=True, slots=True)
class Stuck:
    """A node without an output for its inputs; without a node, the environment, which has no value as it is assumed to.
    `genuine`: by its contract, not only among the scenario's values."""

    node: str
    inputs: tuple[tuple[str, str], ...]
    clauses: tuple[str, ...]
    genuine: bool

    def text(self) -> str:
        given = ", ".join(f"{name} = {value}" for name, value in self.inputs)
        if not self.node:
            return f"no value of the scenario is as {', '.join(self.clauses)} has it"
        if not self.genuine:
            return f"no value of the scenario meets the guarantees of {self.node} at {given}"
        return f"no output of {self.node} meets {', '.join(self.clauses)} at {given}"


class Doubts:
    """The reasons why a search's result is weaker than it seems."""

    def __init__(self) -> None:
        self.incomplete: set[str] = set()
        """Why a search is not exhaustive, if it is not."""
        self.inexact: set[str] = set()
        """Clauses whose quantifiers could only be taken over the scenario's values."""


def judge(world: World, formula: Term, *, finite: bool = False, doubts: Doubts | None = None, about: str = "") -> Holds:
    """Whether a formula holds: exactly if possible, otherwise with quantifiers over the scenario's values (which is
    noted among the `doubts`). `finite`: over the scenario's values in any case. The result raises Undecided if an open
    value has to be decided first."""
    # Evaluation treats a free variable of a system as unknown, unless it is an input.
    given = {v: Variable(Role.INPUT, f"={v.name}", v.sort) for v in free_variables(formula) if v.role is Role.BOUND}
    names = [(v.name, known.qualified) for v, known in given.items()]
    own = {known.qualified: v.name for v, known in given.items()}
    closed = substitute(formula, given)
    try:
        exact = None if finite else compile_term(closed)
        bounded = compile_term(closed, domains=world.domains)
    except NotEvaluable as reason:
        raise CannotRun(f"a formula cannot be evaluated: {reason.reason}") from None
    ways = [(exact, lazy_names(closed)), (bounded, lazy_names(closed, world.domains))]

    def holds(found: Mapping[str, Value]) -> bool:
        values = {**found, **{known: found[name] for name, known in names}} if names else found
        reason: NotEvaluable | None = None
        for evaluator, lazy in ways:
            if evaluator is None:
                continue
            asking, wanted = opened(values, lazy) if lazy else (values, [])
            try:
                truth = bool(evaluator(asking))
            except NotEvaluable as stopped:
                reason = stopped
                if wanted:
                    raise Undecided([(own.get(name, name), point) for name, point in wanted]) from None
                continue
            if evaluator is bounded and exact is not None and doubts is not None:
                doubts.inexact.add(about)
            return truth
        assert reason is not None
        raise CannotRun(f"a formula cannot be evaluated: {reason.reason}")

    return holds


def possible(world: World, node: str, port: Port) -> Choices:
    """The values that an output may have, if it is not a relation."""
    sort = port.sort
    cut = f"{node}.{port.name} may have values at some point that the scenario's leave out"
    try:
        match sort:
            case FunctionSort(result=result):
                natural = isinstance(result, NaturalSort)
                values = world.results(node, port)
                restricted = "" if _are_all(values, result) else cut
                return Choices(values, "", (FunctionValue({}, ANY),), restricted=restricted, natural=natural)
            case SequenceSort(item=item) if world.domain(("out", node), port) is None and sort not in world.domains:
                shells: tuple[Value, ...] = tuple(SequenceValue((ANY,) * n) for n in range(SEQUENCE_LENGTHS + 1))
                unknown = f"the elements of {node}.{port.name} are not known"
                short = f"sequences of more than {SEQUENCE_LENGTHS} elements are not tried for {node}.{port.name}"
                items = world.plain_values(item)
                restricted = cut if items is not None and not _are_all(items, item) else ""
                return Choices(items, unknown, shells, short, restricted)
            case _:  # any other sort
                return Choices(world.candidates(node, port), natural=isinstance(sort, NaturalSort))
    except CannotRun as reason:
        shells = (FunctionValue({}, ANY),) if isinstance(sort, FunctionSort) else None  # type: ignore[assignment]
        at_a_point = sort.result if isinstance(sort, FunctionSort) else sort
        return Choices(None, str(reason), shells, natural=isinstance(at_a_point, NaturalSort))


def _are_all(values: Sequence[Value], sort: Sort) -> bool:
    """Whether the values tried are all that a sort has."""
    everything = finite_values(sort)
    return everything is not None and set(everything) <= set(values)


def is_restricted(node: Answerer, port: Port) -> bool:
    """Whether some value of an output's sort is not tried; for functions, and for sequences element by element, at some
    point."""
    choices = node.choices.get(f"out.{port.name}")
    if choices is None or isinstance(port.sort, OpaqueSort):
        return False
    if choices.shells is not None:
        return bool(choices.restricted)
    return choices.values is None or not _are_all(choices.values, port.sort)


class Answerer:
    """One node with its compiled clauses and its cached answers. Raises CannotRun."""

    def __init__(self, world: World, node: Node, seed: int, doubts: Doubts) -> None:
        self.node, self.world, self.seed, self.doubts = node, world, seed, doubts
        relations = [p for p in node.outputs if isinstance(p.sort, FunctionSort) and p.sort.result == BOOL]
        self.defined: list[tuple[Port, tuple[Point, ...], tuple[str, ...], Holds]] = []
        """Relations that a guarantee defines point by point."""
        self.searched: list[tuple[Port, tuple[Point, ...]]] = []
        self.all_relations = [(port, world.points(node.name, port)) for port in relations]
        for port, points in self.all_relations:
            found = definition(node.guarantees, port)
            if found is None:
                self.searched.append((port, points))
                if world.domain(("out", node.name), port) is not None:
                    doubts.incomplete.add(f"{node.name}.{port.name} may hold at points that the scenario leaves out")
            else:
                variables, body = found
                holds = judge(world, body, doubts=doubts, about=f"{node.name}.{port.name}")
                self.defined.append((port, points, tuple(v.name for v in variables), holds))
        self.others = {f"out.{p.name}": p for p in node.outputs if p not in relations}
        self.choices = {name: possible(world, node.name, port) for name, port in self.others.items()}
        self.assumptions = tuple((c.name, self._judge(c)) for c in node.assumptions)
        guarantees = tuple((self._spoken(c), self._judge(c)) for c in node.guarantees)
        self.narrowing = Narrowing(self.choices, guarantees, forcings(node.guarantees), doubts.incomplete)
        mentioned = {v.name for c in node.guarantees for v in ports_of(c.formula) if v.role is Role.INPUT}
        assumed = {v.name for c in node.assumptions for v in ports_of(c.formula)}
        self.read = tuple(f"in.{p.name}" for p in node.inputs if p.name in mentioned)
        """Inputs that the guarantees mention."""
        self.assumed = tuple(f"in.{p.name}" for p in node.inputs if p.name in assumed)
        """Inputs that the assumptions mention."""
        self.shapes = self._shapes()
        """The searched relations that the guarantees allow for any inputs; None if that does not help."""
        self._answers: dict[object, tuple[Values, ...]] = {}
        self._broken: dict[object, tuple[str, ...]] = {}
        self.asked: dict[object, Values] = {}
        """The inputs of each query, by its key among the answers."""

    def _judge(self, clause: Clause) -> Holds:
        about = f"{self.node.name}.{clause.name}"
        return judge(self.world, clause.formula, doubts=self.doubts, about=about)

    def _spoken(self, clause: Clause) -> frozenset[str]:
        """The outputs that have to be chosen before the clause is judged."""
        return frozenset(v.qualified for v in ports_of(clause.formula) if v.qualified in self.others)

    def _shapes(self) -> tuple[Values, ...] | None:
        """These are found once; for each input, only the other guarantees are checked."""
        own = {port.variable for port, _ in self.searched}
        about = [clause.formula for clause in self.node.guarantees if set(ports_of(clause.formula)) <= own]
        if not self.searched or not about:
            return None
        found, complete = search(self.searched, (), about, {}, self.seed, self.world.effort)
        return tuple(found) if complete and len(found) <= CHOICES_FOUND else None

    # -- answers -------------------------------------------------------------------------------------------------------

    def broken(self, inputs: Values) -> tuple[str, ...]:
        """The assumptions that do not hold for the inputs. Raises Undecided."""
        place = tuple([key(inputs[name]) for name in self.assumed])
        found = self._broken.get(place)
        if found is None:
            failed = [clause for clause, holds in self.assumptions if not holds(inputs)]
            found = self._broken[place] = tuple(f"{self.node.name}.{clause}" for clause in failed)
        return found

    def answers(self, inputs: Values, *, free: bool = False) -> tuple[tuple[Values, ...], tuple[str, ...]]:
        """Every output (by port) that satisfies the guarantees, given the inputs, or any output if an assumption is
        broken or the node is `free`; and the broken assumptions. Raises Undecided."""
        broken = self.broken(inputs)
        free = free or bool(broken)
        index = (free, *[key(inputs[name]) for name in self.read])
        found = self._answers.get(index)
        if found is None:
            found = self._answers[index] = self._solve(inputs, free)
            self.asked[index] = inputs
        return found, broken

    def found(self, index: object) -> tuple[Values, ...]:
        """The answer for a key of `asked`."""
        return self._answers[index]

    def _solve(self, inputs: Values, free: bool) -> tuple[Values, ...]:
        relations, searched = ({}, self.all_relations) if free else (self._defined(inputs), self.searched)
        if not searched:
            return self._narrowed(inputs, relations, free)
        if self.shapes is not None and not free:
            return tuple(
                answer for shape in self.shapes for answer in self._narrowed(inputs, {**relations, **shape}, free)
            )
        return self._found_by_z3(inputs, relations, searched, free)

    def _narrowed(self, inputs: Values, relations: Values, free: bool) -> tuple[Values, ...]:
        """The answers with these relations."""
        known = {**inputs, **{f"out.{name}": value for name, value in relations.items()}}
        try:
            found, complete = self.narrowing.answers(known, NODE_ANSWERS, free=free)
        except Unknown as unknown:
            raise CannotRun(str(unknown)) from None
        if not complete:
            self.doubts.incomplete.add(f"{self.node.name} has more than {NODE_ANSWERS} answers to one input")
        return tuple({**relations, **{name[4:]: value for name, value in answer.items()}} for answer in found)

    def _found_by_z3(
        self, inputs: Values, relations: Values, searched: Sequence[tuple[Port, tuple[Point, ...]]], free: bool
    ) -> tuple[Values, ...]:
        """Relations and plain outputs together, or relations alone if other outputs cannot be given to Z3 that way."""
        plain = [(port, self.choices[name].values) for name, port in self.others.items()]
        lazy = FunctionSort | SequenceSort
        together = [(port, values) for port, values in plain if values is not None and not isinstance(port.sort, lazy)]
        alone = len(together) < len(plain)
        own = {port.variable for port, _ in searched} | {p.variable for p, *_ in self.defined}
        constraints = [] if free else [clause.formula for clause in self.node.guarantees]
        if alone:
            outputs = {port.variable for port in self.node.outputs}
            constraints = [f for f in constraints if set(ports_of(f)) & outputs <= own]
        known = inputs | {f"out.{name}": value for name, value in relations.items()}
        if any(is_open(known[v.qualified]) for f in constraints for v in ports_of(f) if v.qualified in known):
            raise CannotRun(f"{self.node.name} has relations to choose after a function that is not known everywhere")
        spoken = {v for f in constraints for v in ports_of(f)}
        given = {v: value for v, value in by_variable(self.node, known).items() if v in spoken}
        answers, complete = search(
            searched, () if alone else together, constraints, given, self.seed, self.world.effort
        )
        if not complete:
            self.doubts.incomplete.add(f"{self.node.name} has more than {CHOICES_FOUND} answers to one input")
        if not alone:
            return tuple({**relations, **answer} for answer in answers)
        return tuple(found for answer in answers for found in self._narrowed(inputs, {**relations, **answer}, free))

    def _defined(self, inputs: Values) -> Values:
        """Relations that a guarantee defines point by point, computed."""
        found: Values = {}
        for port, points, variables, holds in self.defined:
            here = [p for p in points if holds(inputs | dict(zip(variables, p, strict=True)))]
            found[port.name] = FunctionValue(dict.fromkeys(here, True), False)
        return found

    # -- no answer -----------------------------------------------------------------------------------------------------

    def stuck(self, inputs: Values) -> Stuck:
        """Is there really no output, or only none in the scenario? Z3 has the contract without the scenario."""
        node = self.node
        shown = tuple((name, show(value)) for name, value in inputs.items() if name in self.read)
        names = tuple(clause.name for clause in node.guarantees)
        translator = Translator()
        solver = z3.Solver(ctx=translator.context)
        try:
            meanings = meanings_of(translator, solver, node, inputs)
            solver.add(*translator.background([p.variable for p in node.outputs]))
            switches = []
            for clause in node.guarantees:
                switch = z3.Bool(f"use {clause.name}", translator.context)
                solver.add(z3.Implies(switch, translator.term(clause.formula, meanings)))
                switches.append(switch)
            if put(translator, solver, self.world.effort, 0, *switches).status == "unsat":
                core = {str(switch) for switch in solver.unsat_core()}
                needed = tuple(name for name in names if f"use {name}" in core)
                return Stuck(node.name, shown, needed or names, True)
        except (Unsupported, z3.Z3Exception):
            pass
        return Stuck(node.name, shown, names, False)


def meanings_of(translator: Translator, solver: z3.Solver, node: Node, inputs: Values) -> dict[Variable, Meaning]:
    """The values of the inputs; the decided points of open ones are added to the solver."""
    meanings: dict[Variable, Meaning] = {}
    for variable, value in by_variable(node, inputs).items():
        if is_open(value):
            solver.add(*decided(translator, variable, value))
        else:
            meanings[variable] = translator.value(value, variable.sort)
    return meanings


def decided(translator: Translator, variable: Variable, value: Value) -> list[object]:
    """The decided points of an open value, as Z3 facts."""
    match value, variable.sort:
        case FunctionValue(table=table), FunctionSort(parameters=parameters, result=result):
            function = translator.function(variable)
            return [
                function(*(translator.value(a, p) for a, p in zip(point, parameters, strict=True)))
                == translator.value(at, result)
                for point, at in table.items()
            ]
        case SequenceValue(items=items), SequenceSort(item=item):
            constant = translator.variable(variable)
            known = [constant[k] == translator.value(x, item) for k, x in enumerate(items) if x is not ANY]
            return [z3.Length(constant) == len(items), *known]
    return []
