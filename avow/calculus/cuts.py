"""Where the scenario's values cut runs off: a node's contract allows an output that was not tried.

An answer that the scenario leaves out may lead on to steps that nobody has looked at. The solver knows the contract
without the scenario: if it finds an output beside the ones that were found, or cannot exclude one, the search is not
exhaustive. Functions and sequences are asked about at the points at which they were decided; relations, whose points
the scenario gives, are not.
"""

from __future__ import annotations

from avow.base.tuning.effort import CUT_EFFORT
from avow.calculus.choices import Values, by_variable
from avow.calculus.node_outputs import Answerer, is_restricted, known_of
from avow.calculus.open_values import is_open
from avow.calculus.scenario import key
from avow.formulas.values import Value, show
from avow.language.contract import Port
from avow.language.sorts import FunctionSort
from avow.language.terms import Term
from avow.solving.checking import put
from avow.solving.limits import spent
from avow.solving.models import Model
from avow.solving.translation import Translator, Unsupported
from avow.solving.z3_module import z3


def first_cut(node: Answerer, deadline: float) -> str:
    """In words, the first inputs at which an allowed output of a node was not looked at; nothing where all were."""
    ports = [port for port in node.others.values() if is_restricted(node, port)]
    if not ports:
        return ""
    shared = Translator()
    for index, inputs in node.asked.items():
        if spent() > deadline:
            return f"too many inputs to see whether {node.node.name} may answer otherwise than the scenario has it"
        free = bool(node.broken(inputs))
        found = _other(Translator(shared), node, ports, inputs, node.found(index), free)
        if found is not None:
            given = ", ".join(f"{name} = {show(value)}" for name, value in inputs.items() if name in node.read)
            where = f" at the step with {given}" if given else ""
            return f"the scenario's values cut runs off{where}: {node.node.name} may answer otherwise{found}"
    return ""


def _other(
    translator: Translator, node: Answerer, ports: list[Port], inputs: Values, found: tuple[Values, ...], free: bool
) -> str | None:
    """An output beside the ones found, as far as it is known; None if there is none."""
    solver = z3.Solver(ctx=translator.context)
    try:
        known = by_variable(node.node, inputs)
        meanings = {v: translator.value(value, v.sort) for v, value in known.items() if not is_open(value)}
        for variable in (v for v in known if v not in meanings):
            solver.add(*known_of(translator, variable, known[variable]))
        solver.add(*translator.background([p.variable for p in node.node.outputs]))
        if not free:
            solver.add(*(translator.term(clause.formula, meanings) for clause in node.node.guarantees))
        return _beside(translator, solver, ports, found)
    except (Unsupported, z3.Z3Exception):
        return _UNDECIDED


def another_first(node: Answerer, port: Port, condition: Term, inputs: Values, found: tuple[Value, ...]) -> bool:
    """Whether an initial condition allows a value beside the ones found, as far as is known, its inputs being these."""
    translator = Translator()
    solver = z3.Solver(ctx=translator.context)
    try:
        known = by_variable(node.node, inputs)
        meanings = {v: translator.value(value, v.sort) for v, value in known.items()}
        solver.add(*translator.background([port.variable]), translator.term(condition, meanings))
        return _beside(translator, solver, [port], tuple({port.name: value} for value in found)) is not None
    except (Unsupported, z3.Z3Exception):
        return True


_UNDECIDED = ", as far as the solver can tell"


def _beside(translator: Translator, solver: z3.Solver, ports: list[Port], found: tuple[Values, ...]) -> str | None:
    """An output that the solver's facts allow beside the ones found, in words; None if there is none."""
    for answer in {tuple((p.name, key(answer[p.name])) for p in ports): answer for answer in found}.values():
        solver.add(z3.Or([z3.Not(z3.And(_known(translator, p, answer[p.name]))) for p in ports]))
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
    """That an output has this value, as far as it is decided."""
    if is_open(value) or isinstance(port.sort, FunctionSort):
        return known_of(translator, port.variable, value)
    return [translator.variable(port.variable) == translator.value(value, port.sort)]
