"""Where the scenario's values cut runs off: a node's contract allows an output that was not tried.

An answer that the scenario leaves out may lead on to steps that nobody has looked at. The solver knows the contract
without the scenario: if it finds an output beside the ones that were found, or cannot exclude one, the search is not
exhaustive. Only outputs that are no functions or sequences are asked about.
"""

from __future__ import annotations

from avow.calculus.choices import Values, by_variable
from avow.calculus.node_outputs import Answerer, known_of
from avow.calculus.open_values import is_open
from avow.calculus.scenario import World
from avow.evaluation.evaluate import finite_values
from avow.formulas.values import show
from avow.language.contract import Port
from avow.language.sorts import FunctionSort, OpaqueSort, SequenceSort
from avow.solving.checking import put
from avow.solving.limits import spent
from avow.solving.models import Model
from avow.solving.translation import Translator, Unsupported
from avow.solving.z3_module import z3
from avow.tuning.effort import CUT_EFFORT


def is_restricted(world: World, node: Answerer, port: Port) -> bool:
    """Whether not every value of an output's sort is tried. Functions and sequences are not looked at."""
    if isinstance(port.sort, FunctionSort | SequenceSort | OpaqueSort):
        return False
    everything = finite_values(port.sort)
    tried = node.choices[f"out.{port.name}"].values
    return everything is None or tried is None or not set(everything) <= set(tried)


def first_cut(node: Answerer, deadline: float) -> str:
    """In words, the first inputs at which an allowed output of a node was not looked at; nothing where all were."""
    ports = [port for port in node.others.values() if is_restricted(node.world, node, port)]
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
        constants = {port.name: translator.variable(port.variable) for port in ports}
        for answer in {tuple((p.name, answer[p.name]) for p in ports): answer for answer in found}.values():
            pairs = [constants[p.name] != translator.value(answer[p.name], p.sort) for p in ports]
            solver.add(z3.Or(pairs))
        answered = put(translator, solver, CUT_EFFORT).status
        if answered == "unsat":
            return None
        if answered == "sat":
            reader = Model(translator, solver.model())
            shown = [f"{p.name} = {show(reader.read(constants[p.name], p.sort))}" for p in ports]
            return f", {', '.join(shown)}"
    except (Unsupported, z3.Z3Exception):
        pass
    return ", as far as the solver can tell"
