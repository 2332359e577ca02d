"""The formulas that a plan gives as text: initial values and environment assumptions, typed against the contract."""

from __future__ import annotations

from functools import partial

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.language.contract import Contract
from avow.language.definedness import with_value
from avow.language.sorts import BOOL
from avow.language.subterms import histories, ports_of
from avow.language.terms import Past, Role, Term, Variable
from avow.language.units import clashes
from avow.system.folding import holders
from avow.system.graph import Graph
from avow.system.plan import Edge, Endpoint, System
from avow.system.temporal import parse_property, parse_state


@dataclass(frozen=True, slots=True)
class Assumed:
    """The plan's assumption about an environment input: `formula` is over the inputs of `node`."""

    port: str
    node: str
    formula: Term
    text: str
    because: str


def initial_condition(system: System, edge: Edge) -> Term | None:
    """The condition on the source's ``out.<port>`` before the first step; None if the plan gives none.

    The text is a value of the port's type, or a formula over ``out.<port>`` (and over inputs from the environment that
    the plan declares constant: a changing one has no value before the first step). Raises Rejected, located.
    """
    if edge.initial is None:
        return None
    node = system.contract.node(edge.source.node)
    port = node.output(edge.source.port)
    text = edge.initial
    as_value = f"out.{port.name} == ({text})"
    about_it = f"out.{port.name}" in text
    attempts = [text] if about_it else [as_value] if port.sort == BOOL else [as_value, text]
    failures: list[Rejected] = []
    for attempt in attempts:
        try:
            term = _parse(system, attempt, node.name, edge.initial_span)
        except Rejected as rejected:
            failures.append(rejected)
            continue
        foreign = [v for v in ports_of(term) if v.role is Role.OUTPUT and v.name != port.name]
        if not foreign:
            return term
        failures.append(Rejected(_speaks_of(edge, foreign[0])))
    what = "; ".join(d.message for d in failures[0].diagnostics)
    message = f"{text!r} is no value of {edge.source} ({port.type_name}), nor a formula about out.{port.name}: {what}"
    hint = "write `true` or `false`" if port.sort == BOOL else did_you_mean(text, getattr(port.sort, "members", ()))
    raise Rejected(Diagnostic("PLAN112", message, edge.initial_span, hint=hint))


def _speaks_of(edge: Edge, variable: Variable) -> Diagnostic:
    message = (
        f"an initial value may speak of out.{edge.source.port} and of constant inputs from the environment, "
        f"not of {variable.qualified}: what is assumed of that is for `environment:` to say"
    )
    return Diagnostic("PLAN112", message, edge.span)


def _changing(system: System, graph: Graph, edge: Edge, term: Term) -> Variable | None:
    """An input that an initial value mentions though it is not a constant input from the environment."""
    constant = {
        each for entry in system.plan.environment if entry.constant for each in holders(system, graph, entry)
    } & set(graph.environment)
    inputs = (v for v in ports_of(term) if v.role is Role.INPUT)
    return next((v for v in inputs if Endpoint(edge.source.node, v.name) not in constant), None)


def environment_assumptions(system: System, graph: Graph) -> tuple[Assumed, ...]:
    """The plan's assumptions about the inputs that no node provides. Raises Rejected, with every fault."""
    found: list[Assumed] = []
    faults: list[Diagnostic] = []
    for entry in system.plan.environment:
        about = holders(system, graph, entry)
        outside = [e for e in about if e in graph.environment]
        if not outside:
            edges = [graph.by_target[e] for e in about if e in graph.by_target]
            heard = [graph.feeding(e.source.node) if e.source.node in graph.relays else (e,) for e in edges]
            providers = [str(each.source) for some in heard for each in some]
            what = f"{', '.join(providers)} provides it" if providers else "all that read it are named apart"
            message = f"environment: {entry.port} is no environment input: {what}"
            faults.append(Diagnostic("PLAN113", message, entry.span, hint="remove this entry" if edges else None))
            continue
        if entry.assume is None:
            continue
        owner = outside[0].node
        try:
            term = _parse(system, entry.assume, owner, entry.assume_span, clause=True)
        except Rejected as rejected:
            faults += rejected.diagnostics
            continue
        port_of = system.contract.node(owner).input
        for clash in clashes(term, lambda v, port_of=port_of: port_of(v.name).unit if v.role is Role.INPUT else ""):  # type: ignore[misc]
            faults.append(Diagnostic("PLAN140", f"environment: {entry.port}: {clash.message}", entry.assume_span))
        inputs = {e.port for e in graph.environment if e.node == owner}
        foreign = [v for v in ports_of(term) if v.role is not Role.INPUT or v.name not in inputs]
        if foreign and entry.taken_in:
            continue  # it also concerns an input that is provided here
        if foreign:
            message = f"environment: {entry.port}: {foreign[0].qualified} is not the environment's to assume"
            hint = "only inputs that no node provides may be spoken of"
            faults.append(Diagnostic("PLAN113", message, entry.span, hint=hint))
            continue
        if any(record.operator in (Past.EVENTUALLY, Past.STEPS) for record in histories(term)):
            message = f"environment: {entry.port}: what is assumed is of values, and of what some steps can break"
            hint = "`within[…](…)` says how soon something comes"
            faults.append(Diagnostic("PLAN113", message, entry.span, hint=hint))
            continue
        found.append(Assumed(entry.port, owner, term, entry.assume, entry.because or ""))
    if faults:
        raise Rejected(*faults)
    return tuple(found)


def check_formulas(system: System, graph: Graph) -> tuple[Diagnostic, ...]:
    """Every fault in the formulas of the plan: initial values, environment assumptions, requirements."""
    faults: list[Diagnostic] = []
    first: dict[Endpoint, Edge] = {}
    for edge in graph.edges:
        try:
            term = initial_condition(system, edge)
            changing = None if term is None else _changing(system, graph, edge, term)
            faults += [] if changing is None else [_speaks_of(edge, changing)]
        except Rejected as rejected:
            faults += rejected.diagnostics
        if edge.delayed and first.setdefault(edge.source, edge).initial != edge.initial:
            message = f"{edge.source} has more than one initial value; all its delayed edges carry the same"
            faults.append(Diagnostic("PLAN112", message, edge.span))
    for entry in system.plan.nodes:
        for port in entry.source.memory if entry.source is not None else ():
            given = graph.by_target.get(Endpoint(entry.node, port))
            if given is not None and (given.source != given.target or not given.delayed):
                message = f"nodes.{entry.node}.memory: in.{port} is what the program keeps, but {given} feeds it"
                faults.append(Diagnostic("PLAN110", message, given.span or entry.span, hint="take it out of `memory`"))
    for requirement in system.plan.requirements:
        try:
            if requirement.formula is not None:
                term = parse_state(requirement.formula, system.contract, requirement.formula_span)
                faults += [
                    Diagnostic("PLAN140", f"requirements.{requirement.id}: {clash.message}", requirement.formula_span)
                    for clash in clashes(term, partial(_unit, system.contract))
                ]
            if requirement.temporal is not None:
                parse_property(requirement.temporal, system.contract, requirement.formula_span)
        except Rejected as rejected:
            faults += rejected.diagnostics
    try:
        environment_assumptions(system, graph)
    except Rejected as rejected:
        faults += rejected.diagnostics
    return tuple(dict.fromkeys(faults))


def _unit(contract: Contract, variable: Variable) -> str:
    """The unit of ``node.port``."""
    name, _, port = variable.name.partition(".")
    node = contract.node(name)
    return (node.input if variable.role is Role.INPUT else node.output)(port).unit


def _parse(system: System, text: str, node: str, span: Span | None, *, clause: bool = False) -> Term:
    from avow.language.load import parse_formula  # the grammar is slow to import

    return with_value(parse_formula(text, system.contract.node(node), system.contract, span, clause=clause))
