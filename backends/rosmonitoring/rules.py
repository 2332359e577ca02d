"""How messages become values: rules as data.

A rule says from which topic and fields a contract variable gets its value, or its other source: the scenario's tables,
or an output's value of the step before. `avow.backends.rosmonitoring.options` makes the rules from the plan; `reading`
turns messages into values by them; `rml` turns them into RML patterns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from enum import StrEnum

from avow.base.records import dataclass
from avow.formulas.values import Value
from avow.language.contract import Port
from avow.language.terms import Role, Variable
from avow.ros.definitions import Definitions, Wire

FieldPath = tuple[str | int, ...]
"""``("pose", "x")``: a field, and the fields within it; ``("ranges", 0)``: an item of an array."""

NOTHING_KNOWN = Definitions({})


class Hold(StrEnum):
    """The tuples that a relation holds of, after several messages."""

    LATEST = "latest"
    """The tuple (or tuples) of the latest message: a position."""
    SEEN = "seen"
    """Every tuple that a message has brought so far: the places inspected."""


class Take(StrEnum):
    """The value taken from an array's items."""

    MIN = "min"
    MAX = "max"
    COUNT = "count"


class Gap(StrEnum):
    """Numbers that mean *no reading*, if the plan says so."""

    NAN = "nan"
    INF = "inf"


@dataclass(frozen=True, slots=True)
class Lookup:
    """The cell of a table in the row that a field names: the coordinates of the place with this id."""

    table: str
    key: FieldPath
    rows: Mapping[str, str] = field(hash=False)
    """Text of the key → text of the cell."""
    held: Wire | None = None
    """The type in which the node holds the cell."""


Argument = FieldPath | Lookup


@dataclass(frozen=True, slots=True)
class Fields:
    """Scalar, Collection and Function rules. For a function with a result, the last path is the result's, and
    `elsewhere` its value where no message has given one. `each` leads to a list of tuples in one message. `names` turns
    a message's word or number into the contract's."""

    variable: Variable
    topic: str
    paths: tuple[FieldPath, ...]
    names: Mapping[str, str] = field(default_factory=dict, hash=False)
    hold: Hold = Hold.LATEST
    each: FieldPath | None = None
    elsewhere: Value | None = None
    """For any other variable: its value if there is no reading."""
    initial: Value | None = None
    wires: tuple[Wire | None, ...] = ()
    """The type of the field at each path; None if nothing defines the message: then its digits are taken literally."""
    known: Definitions = field(default=NOTHING_KNOWN, hash=False, repr=False)
    """The definitions of messages within the message."""
    take: Take | None = None
    gaps: frozenset[Gap] = frozenset()
    kind: str = ""
    """The topic's type, if it is known."""
    frame: str = ""
    """The frame in which the contract speaks of its messages; empty: as they are."""

    def wire(self, at: int) -> Wire | None:
        """The type of the field at a path."""
        return self.wires[at] if at < len(self.wires) else None


EVENTS = "parameter_events"
"""The topic on which nodes of ROS 2 tell of their parameters."""


@dataclass(frozen=True, slots=True)
class Parameter(Fields):
    """A parameter of the node, or whether it has kept its value so far. The path is the node's name and its own."""

    of: Port = field(kw_only=True)


@dataclass(frozen=True, slots=True)
class Choice:
    """A value of an algebraic type: a field names the constructor, others are its arguments."""

    variable: Variable
    topic: str
    tag: FieldPath
    arguments: Mapping[str, tuple[Argument, ...]] = field(hash=False)
    """Constructor → the sources of its arguments."""
    names: Mapping[str, str] = field(default_factory=dict, hash=False)
    """The message's word → constructor."""
    initial: Value | None = None
    wires: Mapping[FieldPath, Wire] = field(default_factory=dict, hash=False)
    """The types of fields, if they are known."""
    kind: str = ""
    frame: str = ""


@dataclass(frozen=True, slots=True)
class Constant:
    """A value that no message changes, such as the scenario's map."""

    variable: Variable
    value: Value = field(hash=False)


@dataclass(frozen=True, slots=True)
class Previous:
    """The value that an output had before the step: while an event changes `source`, it is still the old one."""

    variable: Variable
    source: str
    """Qualified name of one of the node's own variables."""
    initial: Value | None = None


Rule = Fields | Choice | Constant | Previous


def of_latest(rule: Rule | None) -> bool:
    """Whether a value is determined by the latest message alone."""
    return not isinstance(rule, Fields) or rule.hold is Hold.LATEST


def heard_through(rule: Rule) -> str:
    """The variable whose messages give a rule's value; empty for a value of the scenario."""
    match rule:
        case Previous(source=name):
            return name
        case Constant():
            return ""
        case Fields(variable=variable) | Choice(variable=variable):
            return variable.qualified


def framed(rules: Iterable[Rule]) -> bool:
    """Whether the contract names the frame of a topic that is read."""
    return any(getattr(rule, "frame", "") for rule in rules)


def otherwise(one: Rule, other: Rule) -> bool:
    """Whether two rules read different values from a topic's messages, as far as the rules show it."""
    match one, other:
        case Fields() | Choice(), Fields() | Choice() if one.topic.lstrip("/") != other.topic.lstrip("/"):
            return True
        case Fields(), Fields():
            ways = [(rule.paths, rule.each, rule.take, rule.hold) for rule in (one, other)]
            names = any(one.names[word] != other.names[word] for word in one.names.keys() & other.names.keys())
            away = one.elsewhere != other.elsewhere and None not in (one.elsewhere, other.elsewhere)
            return ways[0] != ways[1] or names or away
        case Choice(), Choice():
            return (one.tag, one.arguments, one.names) != (other.tag, other.arguments, other.names)
        case Fields() | Choice(), Fields() | Choice():
            return True
        case _:  # one of them reads no message
            return False


def paths_of(rule: Fields | Choice) -> tuple[FieldPath, ...]:
    """The places in a message on which a rule's value depends."""
    if isinstance(rule, Fields):
        return rule.paths if rule.each is None else (rule.each,)
    places = (place for arguments in rule.arguments.values() for place in arguments)
    return tuple(dict.fromkeys((rule.tag, *(p.key if isinstance(p, Lookup) else p for p in places))))


def read_from_inputs(rules: Mapping[str, Rule], mapped: Iterable[str]) -> Iterator[tuple[str, str]]:
    """The outputs that the plan's mapping reads only from fields that give inputs, with these inputs: a node's input is
    no answer of it."""
    fields = {
        name: {(rule.topic.lstrip("/"), path) for path in paths_of(rule)}
        for name, rule in rules.items()
        if isinstance(rule, Fields | Choice)
    }
    inputs = [name for name in fields if name.startswith(f"{Role.INPUT}.")]
    for name in sorted(fields.keys() - {*inputs}):
        sources = [one for one in inputs if fields[one] & fields[name]]
        told = {place for one in sources for place in fields[one]}
        if sources and fields[name] <= told and not {name, *sources}.isdisjoint(mapped):
            yield name, ", ".join(sources)
