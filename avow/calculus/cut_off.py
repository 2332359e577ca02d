"""Detects where a scenario cuts runs off: outputs that a node's contract allows and that were not explored."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from avow.base.tuning.effort import CUT_EFFORT
from avow.calculus.narrowing import Values, is_open
from avow.calculus.node_outputs import Answerer, by_variable, decided, is_restricted, meanings_of
from avow.calculus.scenario import key
from avow.formulas.values import Value, show
from avow.language.contract import Node, Port
from avow.language.sorts import FunctionSort
from avow.language.subterms import ports_of
from avow.language.terms import Role, Term, Variable
from avow.solving.checking import put
from avow.solving.limits import spent
from avow.solving.models import Model
from avow.solving.translation import Expr, Meaning, Translator, Unsupported, new_session
from avow.solving.z3_module import z3


@new_session()
def first_cut(node: Answerer, deadline: float) -> str:
    """In words, the first inputs at which an allowed output of a node was not explored; empty if all were.

    An output that the scenario leaves out may lead to unexplored steps. The solver has the contract without the
    scenario: if it finds another output, or cannot exclude one, the search is not exhaustive. The query covers
    functions and sequences at the points at which they were decided, but no relations: the scenario gives their points.
    """
    ports = [port for port in node.others.values() if is_restricted(node, port)]
    if not ports:
        return ""
    written = _Written(node.node)
    for index, inputs in node.asked.items():
        if spent() > deadline:
            return f"too many inputs to see whether {node.node.name} may answer otherwise than the scenario has it"
        free = bool(node.broken(inputs))
        found = _other(written, ports, inputs, node.found(index), free)
        if found is not None:
            given = ", ".join(f"{name} = {show(value)}" for name, value in inputs.items() if name in node.read)
            where = f" at the step with {given}" if given else ""
            return f"the scenario's values cut runs off{where}: {node.node.name} may answer otherwise{found}"
    return ""


class _Written:
    """A node's guarantees in Z3, for many inputs. Each is translated once for equal values of the inputs that it
    mentions, and each value once. Simplified, many are the same, and so are the queries: each is asked once."""

    def __init__(self, node: Node) -> None:
        self.node = node
        self.translator = Translator()
        self._mentions = [
            sorted(v.qualified for v in ports_of(c.formula) if v.role is Role.INPUT) for c in node.guarantees
        ]
        self._values: dict[object, Meaning] = {}
        self._decided: dict[object, list[Expr]] = {}
        self._clauses: dict[object, Expr] = {}
        self.answers: dict[frozenset[int], tuple[list[Expr], str | None]] = {}
        """By the facts of a query, which are kept: while they are, no other facts have their numbers."""

    def given(self, facts: list[Expr], inputs: Values) -> dict[Variable, Meaning]:
        """The same as `meanings_of`, with translated values reused."""
        meanings: dict[Variable, Meaning] = {}
        for variable, value in by_variable(self.node, inputs).items():
            place = variable, key(value)
            if is_open(value):
                if place not in self._decided:
                    self._decided[place] = decided(self.translator, variable, value)
                facts += self._decided[place]
                continue
            if place not in self._values:
                self._values[place] = self.translator.value(value, variable.sort)
            meanings[variable] = self._values[place]
        return meanings

    def guarantees(self, inputs: Values, meanings: Mapping[Variable, Meaning]) -> Iterator[Expr]:
        keys = {name: key(value) for name, value in inputs.items()}
        for clause, mentions in zip(self.node.guarantees, self._mentions, strict=True):
            place = clause.name, *(keys.get(name) for name in mentions)
            if place not in self._clauses:
                self._clauses[place] = z3.simplify(self.translator.term(clause.formula, meanings))
            yield self._clauses[place]


def _other(written: _Written, ports: list[Port], inputs: Values, found: tuple[Values, ...], free: bool) -> str | None:
    """Another output than those found, in words as far as known; None if there is none."""
    translator = written.translator
    try:
        facts = list(translator.background([p.variable for p in written.node.outputs]))
        meanings = written.given(facts, inputs)
        if not free:
            facts += written.guarantees(inputs, meanings)
        facts += _others(translator, ports, found)
        place = frozenset(fact.get_id() for fact in facts)
        if place not in written.answers:
            solver = z3.Solver(ctx=translator.context)
            solver.add(*facts)
            written.answers[place] = facts, _beside(translator, solver, ports)
        return written.answers[place][1]
    except (Unsupported, z3.Z3Exception):
        return _UNDECIDED


def another_first(node: Answerer, port: Port, condition: Term, inputs: Values, found: tuple[Value, ...]) -> bool:
    """Whether an initial condition allows another value than those found for these inputs; true if the solver cannot
    tell."""
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    try:
        meanings = meanings_of(translator, solver, node.node, inputs)
        solver.add(*translator.background([port.variable]), translator.term(condition, meanings))
        solver.add(*_others(translator, [port], tuple({port.name: value} for value in found)))
        return _beside(translator, solver, [port]) is not None
    except (Unsupported, z3.Z3Exception):
        return True


_UNDECIDED = ", as far as the solver can tell"


def _others(translator: Translator, ports: list[Port], found: tuple[Values, ...]) -> list[Expr]:
    """Z3 facts: the output is none of those found."""
    answers = {tuple((p.name, key(answer[p.name])) for p in ports): answer for answer in found}.values()
    return [z3.Or([z3.Not(z3.And(_known(translator, p, answer[p.name]))) for p in ports]) for answer in answers]


def _beside(translator: Translator, solver: z3.Solver, ports: list[Port]) -> str | None:
    """An output that the solver's facts allow, in words; None if there is none."""
    answered = put(translator, solver, CUT_EFFORT).status
    if answered == "unsat":
        return None
    if answered != "sat":
        return _UNDECIDED
    reader = Model(translator, solver.model())
    plain = [p for p in ports if not isinstance(p.sort, FunctionSort)]
    shown = [f"{p.name} = {show(reader.read(translator.variable(p.variable), p.sort))}" for p in plain]
    return f", {', '.join(shown)}" if shown else f": {', '.join(p.name for p in ports)}"


def _known(translator: Translator, port: Port, value: Value) -> list[object]:
    """Z3 facts: the output has this value, as far as it is decided."""
    if is_open(value) or isinstance(port.sort, FunctionSort):
        return decided(translator, port.variable, value)
    return [translator.variable(port.variable) == translator.value(value, port.sort)]
