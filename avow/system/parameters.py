"""The parameters of a contract's nodes: the value that the plan, a parameter file or a launch file gives, or any value
that the contract's assumptions allow.

A parameter with a value is a constant: the value stands in every formula of its node, and an assumption about
parameters alone has been decided. Any other stays an input of the environment that has one value during a run.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.base.diagnostics import Diagnostic, Span
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.language import terms as t
from avow.language.bounds import constant
from avow.language.contract import Clause, Contract, Definition, Node, Port
from avow.language.definitions import expand
from avow.language.operators import OPERATORS
from avow.language.printer import show_term
from avow.language.sorts import BoolSort, EnumSort, IntegerSort, NaturalSort, RealSort, Sort, StringSort
from avow.language.subterms import ports_of
from avow.ros.code import read_code
from avow.ros.parameters import flat
from avow.system.launched import started_with, where
from avow.system.node_plan import parameter_place, parameters
from avow.system.plan import Driving, EnvironmentInput, NodePlan, Numbers, Plan

OPEN = "the plan gives it no value: what is shown holds for each value that the contract's assumptions allow"
KEPT = "a parameter keeps its value during a run"


@dataclass(frozen=True, slots=True)
class _Given:
    """A value, and where it is given."""

    name: str
    value: Any
    by: str
    span: Span | None
    default: bool = False
    """Whether any other takes precedence."""


def with_parameters(plan: Plan, contract: Contract) -> tuple[Plan, Contract, tuple[Diagnostic, ...]]:
    """The plan and the contract after each parameter has got its value, or an entry in the environment."""
    faults: list[Diagnostic] = []
    found = [_node(plan, node, faults) for node in contract.nodes]
    nodes, run_with = tuple(node for node, _ in found), {node.name: values for node, values in found}
    entries = tuple(
        replace(e, source=replace(e.source, values={**run_with.get(e.node, {}), **e.source.values})) if e.source else e
        for e in plan.nodes
    )
    environment = list(plan.environment)
    for node in nodes:
        about = list(of_parameters(node))
        for port in node.parameters:
            name = f"{node.name}.{port.name}"
            at = next((k for k, entry in enumerate(environment) if entry.port == name), None)
            if at is not None:
                environment[at] = replace(environment[at], constant=True, stays=environment[at].stays or KEPT)
                continue
            text = " and ".join(f"({show_term(clause.formula, 'rcl')})" for clause in about) or None
            environment.append(EnvironmentInput(name, text, OPEN, port.span, True, KEPT, port.span))
            about = []  # they are stated once, at the first
    plan = replace(plan, nodes=entries, environment=tuple(environment))
    return plan, replace(contract, nodes=nodes), tuple(faults)


def of_parameters(node: Node) -> tuple[Clause, ...]:
    """The written assumptions about the node's parameters alone."""
    among = {port.variable for port in node.parameters}
    written = (clause for clause in node.assumptions if clause.name not in node.implied)
    return tuple(c for c in written if (spoken := set(ports_of(c.formula))) and spoken <= among)


def _node(plan: Plan, node: Node, faults: list[Diagnostic]) -> tuple[Node, Mapping[str, Any]]:
    """The node, in which the parameters with a value are constants; and these values, by the names that ROS has."""
    ports = (*node.parameters, *node.fixed)  # an included system's own plan has given a value
    sources = tuple(_sources(plan, node)) if ports else ()
    entry = plan.node(node.name)
    known = [port.name for port in ports]
    for name in () if entry.source and entry.source.python else entry.parameters.data:
        if name.replace(".", "_") not in known:
            message = f"nodes.{node.name}.parameters: {node.name} has no parameter {name!r}"
            hint = suggest(name, known) or f"declare it under the node's `inputs`: `parameter {name} : REAL`"
            faults.append(Diagnostic("PLAN106", message, entry.parameters.at(name), hint=hint))
    fixed: list[Port] = []
    run_with: dict[str, Any] = {}
    places: dict[str, Span | None] = {}
    for port in ports:
        given = [one for one in sources if one.name.replace(".", "_") == port.name]
        if port.value is not None:
            given.insert(0, _Given(port.name, plain(decimal(port.value)), "the included system", None))
        given = [one for one in given if not one.default] or given
        unfit = [one for one in given if _term(one.value, port.sort) is None]
        for one in unfit:
            said = "gives it no value" if one.value is None else f"sets it to {one.value!r}"
            message = f"{node.name}.{port.name} is of type {port.type_name}, and {one.by} {said}"
            faults.append(Diagnostic("PLAN139", message, one.span, notes=_declared(port)))
        if unfit or not given:
            continue
        first, value = given[0], _term(given[0].value, port.sort)
        run_with[first.name], places[port.name] = first.value, first.span
        if port.value is None and value is not None:
            fixed.append(replace(port, value=_as_run(value, entry)))
        others = [one for one in given[1:] if _term(one.value, port.sort) != value]
        if others:
            said = "; ".join(f"{one.by} sets it to {one.value!r}" for one in (first, *others))
            notes = tuple((one.by, one.span) for one in others if one.span is not None)
            message = f"the value of {node.name}.{port.name} is not clear: {said}"
            span = first.span or others[0].span
            faults.append(Diagnostic("PLAN139", message, span, hint="give one value, once", notes=notes))
    return (with_values(node, tuple(fixed), faults, places) if fixed else node), run_with


def _declared(port: Port) -> tuple[tuple[str, Span | None], ...]:
    return ((f"`{port.name}` is declared here", port.span),)


def _sources(plan: Plan, node: Node) -> Iterator[_Given]:
    """What sets parameters of a node; ``.`` in a name is ``_`` in a contract."""
    entry = plan.node(node.name)
    placed = plan.ros.names.placed(node.name)
    for name, value in entry.parameters.data.items():
        yield _Given(name, value, "the plan", entry.parameters.at(name))
    source, sure = entry.source, plan.launched is None or not plan.launched.unread
    if source is not None and source.parameters:
        of_file = replace(source, values={})
        read, _ = parameters(plan.root, of_file, placed.name)  # faults: where the class is examined
        for name, value in flat(read):
            yield _Given(name, value, source.parameters, parameter_place(plan.root, of_file, placed.name, name))
    for one in plan.launched.nodes if plan.launched is not None else ():
        if one.name == placed.name:
            there, unread = started_with(one)
            sure = sure and not unread
            yield from (_Given(name, value, where(span), span) for name, (value, span) in there.items())
    if sure and source is not None and source.kind is Driving.RCLPY:
        declared = read_code(plan.root / source.python, source.class_name).created
        defaults = [one for one in declared if one.side == "declares" and one.default is not None]
        yield from (_Given(d.name, d.default, where(d.span), d.span, True) for d in defaults if d.sure)


def _as_run(value: t.Term, entry: NodePlan) -> t.Term:
    """The value as the node's program has it: the nearest double, unless its numbers are exact."""
    exact = entry.source is None or entry.source.numbers is Numbers.EXACT
    if isinstance(value, t.Literal) and isinstance(value.value, Fraction) and not exact:
        return replace(value, value=Fraction(float(value.value)))
    return value


def _term(value: Any, sort: Sort) -> t.Term | None:
    """A value of a parameter as a term of a sort; None if it is none of that sort."""
    match sort, value:
        case BoolSort(), bool():
            return t.Literal(value, sort)
        case ((RealSort() | IntegerSort() | NaturalSort()), bool()):
            return None
        case RealSort(), int() | float() if abs(value) <= sys.float_info.max:
            return t.Literal(Fraction(str(value)), sort)
        case IntegerSort(), int():
            return t.Literal(value, sort)
        case NaturalSort(), int() if value >= 0:
            return t.Literal(value, sort)
        case StringSort(), str():
            return t.Literal(value, sort)
        case EnumSort(members=members), str() if value in members:
            return t.EnumValue(value, sort)
    return None


def with_values(
    node: Node, fixed: tuple[Port, ...], faults: list[Diagnostic], places: Mapping[str, Span | None] | None = None
) -> Node:
    """The node with values for some parameters; those that an assumption excludes are among the faults. `places`:
    where each value is given."""
    values = {port.variable: port.value for port in fixed if port.value is not None}
    written = {variable: decimal(value) for variable, value in values.items()}  # an end of a range is within it

    def put(term: t.Term, values: Mapping[t.Variable, t.Term] = values) -> t.Term:
        spoken = [v for v in ports_of(term) if v in values]
        body = Definition("", tuple(spoken), term)
        return expand(body, [values[v] for v in spoken], term.span) if spoken else term

    def clause(old: Clause) -> Clause:
        chance = old.chance and old.chance.mapped(put)
        written = None if old.written is None else put(old.written)
        return replace(old, formula=put(old.formula), written=written, chance=chance)

    kept = [c for c in node.assumptions if c.name not in {port.constancy.name for port in fixed} & node.implied]
    assumptions: list[Clause] = []
    for old in kept:
        new = clause(old)
        decided = _holds(put(old.formula, written)) if new.formula != old.formula else None
        if decided is False:
            named = [p for p in fixed if p.variable in ports_of(old.formula)]
            said = ", ".join(f"{p.name} = {show_term(written[p.variable], 'rcl')}" for p in named)
            message = f"{node.name} is run with {said}, which its assumption {old.name} excludes"
            notes = tuple((f"{p.name} gets its value here", at) for p in named if (at := (places or {}).get(p.name)))
            hint = "correct the value, or the assumption"
            faults.append(Diagnostic("PLAN139", message, old.span, hint=hint, notes=notes))
        if decided is not True:
            assumptions.append(new)
    names = {port.name for port in fixed}
    return replace(
        node,
        inputs=tuple(port for port in node.inputs if port.name not in names),
        assumptions=tuple(assumptions),
        guarantees=tuple(map(clause, node.guarantees)),
        definitions=tuple(replace(d, body=put(d.body)) for d in node.definitions),
        fixed=(*node.fixed, *fixed),
    )


def plain(term: t.Term | None) -> Any:
    """A parameter's value as a file has it."""
    match term:
        case t.EnumValue(name=name):
            return name
        case t.Literal(value=Fraction() as value):
            return float(value)
        case t.Literal(value=value):
            return value
    raise TypeError(term)


def decimal(value: t.Term) -> t.Term:
    """A number of a program as people write it: the shortest decimal for it."""
    if isinstance(value, t.Literal) and isinstance(value.value, Fraction):
        return replace(value, value=Fraction(repr(float(value.value))))
    return value


def _holds(term: t.Term) -> bool | None:
    """Whether a formula without variables holds; None if that is not obvious."""
    match term:
        case t.Literal(value=bool(value)):
            return value
        case t.Not(body=body):
            inner = _holds(body)
            return None if inner is None else not inner
        case t.And(items=items) | t.Or(items=items):
            parts, decides = [_holds(item) for item in items], isinstance(term, t.Or)
            return decides if decides in parts else None if None in parts else not decides
        case t.Compare(operator=sign, left=left, right=right):
            one, other = constant(left), constant(right)
            evaluate = OPERATORS[sign].evaluate
            if one is not None and other is not None and callable(evaluate):
                return bool(evaluate(one, other))
            if isinstance(left, t.Literal | t.EnumValue) and isinstance(right, t.Literal | t.EnumValue):
                return (left == right) is (sign == "==")
        case t.In(item=item, collection=t.SetTerm(items=items)):
            return _holds(t.Or(tuple(t.Compare("==", item, each) for each in items)))
    return None
