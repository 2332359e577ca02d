"""Parameters of ROS 2 as inputs: a node tells on ``/parameter_events`` which of them it declares, changes and deletes
(rcl_interfaces/ParameterEvent, which names the node and each parameter)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from fractions import Fraction
from typing import Any

from avow.backend_kit.parameters import equals
from avow.evaluation.evaluate import evaluate
from avow.formulas.values import Value
from avow.language import sorts as s
from avow.language.contract import Node, Port
from avow.language.terms import Role, Variable
from avow.ros.bags import Event
from avow.ros.definitions import Definitions, Scalar
from avow.system.plan import System

from .rules import EVENTS, Parameter, Rule
from .wires import MappingError, converter

EVENT = "rcl_interfaces/ParameterEvent"
_VALUES = {1: "bool_value", 2: "integer_value", 3: "double_value", 4: "string_value"}
"""The field of a rcl_interfaces/ParameterValue that holds the value, by its `type`. The others are arrays."""
_WIRES = {s.RealSort: "float64", s.BoolSort: "bool", s.IntegerSort: "int64", s.NaturalSort: "int64"}


def parameter(
    port: Port, system: System, node: Node, known: Definitions, name: str, initial: Value | None = None
) -> Parameter | str:
    """The rule of an input that is the node's parameter of that name, in which ``_`` may be ``.``; or why there is
    none."""
    if known.get(EVENT) is None:
        return f"{port.variable.qualified} is a parameter: `ros: {{distro: humble}}`, or yours, defines {EVENT}"
    path = system.plan.ros.names.placed(node.name).name, name.replace(".", "_")
    return Parameter(port.variable, f"/{EVENTS}", (path,), initial=initial, kind=EVENT, of=port)


def kept(system: System, node: Node, rules: dict[str, Rule], known: Definitions) -> Node:
    """The node with an assumption about one step for each parameter, that it has kept its value so far: the plan's, or
    the first one told. Their rules are added."""
    for port in (*node.parameters, *node.fixed):
        own = rules.get(port.variable.qualified) or parameter(port, system, node, known, port.name)
        if isinstance(own, Parameter):
            variable = Variable(Role.INPUT, f"{port.name} kept", s.BOOL)
            path = (*own.paths[0], variable.name)
            rules[variable.qualified] = replace(own, variable=variable, paths=(path,), initial=True)
            clause = port.constancy if port.value is None else equals(port)
            others = tuple(each for each in node.assumptions if each.name != clause.name)
            node = replace(node, assumptions=(*others, replace(clause, formula=variable, written=variable)))
    return node


def constant(rule: Rule) -> bool:
    """Whether the contract says that a parameter has one value during a run: then it is irrelevant when it is told."""
    return isinstance(rule, Parameter) and rule.of.parameter


def concerns(rule: Rule, event: Event) -> bool | None:
    """Whether an event tells something of a parameter; None for another variable."""
    return told(event, rule) is not None if isinstance(rule, Parameter) else None


def told(event: Event, rule: Parameter) -> Mapping[str, Any] | None:
    """What an event tells of a parameter; None if it tells nothing of it."""
    node, name = map(str, rule.paths[0][:2])
    if str(event.get("node")).lstrip("/") == node.lstrip("/"):
        for kind in ("new_parameters", "changed_parameters", "deleted_parameters"):
            given = event.get(kind)
            for each in given if isinstance(given, list) else ():
                if isinstance(each, Mapping) and str(each.get("name")).replace(".", "_") == name:
                    value = each.get("value")
                    return value if isinstance(value, Mapping) and kind != "deleted_parameters" else {}
    return None


def reader(rule: Parameter) -> Callable[[Event, Value | None], Value]:
    """A reader for one run, of the value, or of whether it has been kept so far."""
    sort, given = rule.of.sort, rule.of.value
    convert = converter(sort, Scalar(_WIRES.get(type(sort), "string")))

    def read(event: Event, old: Value | None) -> Value:
        value = told(event, rule) or {}
        if (kind := value.get("type")) not in _VALUES:
            raise MappingError("the parameter is an array" if kind else "the parameter has no value")
        return convert(value.get(_VALUES[kind]))

    first = [evaluate(given, {})] if given is not None else []
    first = [Fraction(float(value)) if isinstance(value, Fraction) else value for value in first]

    def keeps(event: Event, old: Value | None) -> Value:
        try:
            first.append(read(event, None))
        except MappingError:
            return False
        return old is not False and first[-1] == first[0]

    return read if rule.variable == rule.of.variable else keeps
