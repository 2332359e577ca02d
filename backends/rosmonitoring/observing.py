"""One entry of the plan's `mapping`, and the definition of the topic's messages, as a rule for a variable. An input is
read in the same way as the outputs that it is linked to."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from avow.base.diagnostics import Hinted, Rejected
from avow.base.suggestions import nearest, suggest
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import FunctionValue, Value
from avow.language import sorts as s
from avow.language.contract import Node, Port
from avow.language.load import parse_term
from avow.language.terms import Apply, Not, Quantified, Quantifier, Role, Term, Variable
from avow.ros.definitions import INTEGERS, SCALARS, Array, Definitions, Message, Nested, NoField, Scalar, Wire
from avow.system.graph import dataflow
from avow.system.plan import Edge, Endpoint, Located, Plan, System, Table

from .reading import SOURCES, Undecided, decide, fitting_fields, shown, words
from .rules import NOTHING_KNOWN, Argument, Choice, FieldPath, Fields, Gap, Hold, Lookup, Rule, Take
from .wires import MappingError, converter, fits, parts_of, whole


class Wrong(Hinted):
    """An error in the plan; `path` leads from the variable's entry to its place."""

    def __init__(self, message: str, *path: str | int, hint: str | None = None) -> None:
        super().__init__(message, hint)
        self.path = path


@dataclass(frozen=True, slots=True)
class Observed:
    """A port that a topic's messages carry."""

    plan: Plan
    port: Port
    topic: str
    message: Message | str
    """Its definition, or the type's name if nothing defines it."""
    known: Definitions
    frame: str
    """The frame in which the contract speaks of it; empty: as it is."""

    @property
    def variable(self) -> Variable:
        return self.port.variable

    @property
    def kind(self) -> str:
        """The type of the topic's messages, as far as it is known."""
        return self.message if isinstance(self.message, str) else self.message.name


def observe(at: Observed, entry: Mapping[str, Any]) -> Rule | str:
    """The rule, or why the variable cannot be observed. Raises Wrong, and Undecided if the plan must name fields."""
    sort, variable = at.port.sort, at.variable
    if isinstance(sort, s.OpaqueSort):
        return f"{variable.qualified} is of an unspecified sort"
    initial = literal(entry["initial"], sort, "initial") if entry.get("initial") is not None else None
    if isinstance(sort, s.DataSort) and "constructor" in entry:
        return _choice(at, sort, entry, initial)
    named = "field" in entry or "fields" in entry
    if isinstance(sort, s.DataSort) and not named:
        constructors = ", ".join(c.name for c in sort.constructors)
        return f"the plan does not say how a message names one of {constructors}"
    result = sort.result if isinstance(sort, s.FunctionSort) and sort.result != s.BOOL else None
    if result is not None and "elsewhere" not in entry:
        return f"{variable.qualified} is a total function, and the plan does not say its value `elsewhere`"
    elsewhere = entry.get("elsewhere")
    default = None if elsewhere is None else literal(elsewhere, result or sort, "elsewhere")
    hold = Hold(entry.get("hold", "latest"))
    if hold is Hold.SEEN and initial is None and isinstance(sort, s.FunctionSort) and sort.result == s.BOOL:
        initial = FunctionValue({}, False)
    take = Take(entry["take"]) if "take" in entry else None
    gaps = frozenset(gap for gap in Gap if entry.get(gap.value) == "none")
    paths = _paths(entry, sort) if named else _decided(at, entry)
    each = path(entry["each"]) if "each" in entry else None
    wires, names = _wires(at, paths, each, entry, take)
    rule = Fields(
        variable, at.topic, paths, names, hold, each, default, initial, wires, at.known if wires else NOTHING_KNOWN,
        take, gaps, at.kind, at.frame,
    )  # fmt: skip
    _check_gaps(rule)
    return rule


def _paths(entry: Mapping[str, Any], sort: s.Sort) -> tuple[FieldPath, ...]:
    """The fields that the plan names. Raises Wrong."""
    key = "field" if "field" in entry else "fields"
    paths = tuple(map(path, [entry["field"]] if key == "field" else entry["fields"]))
    wanted = len(parts_of(sort))
    if isinstance(sort, s.TupleSort) and len(paths) > 1:  # one field for each part, or one for all of them
        wanted = len(sort.items)
    if len(paths) != wanted:
        raise Wrong(f"{wanted} field{'s are' if wanted > 1 else ' is'} wanted, not {len(paths)}", "fields")
    return paths


def _decided(at: Observed, entry: Mapping[str, Any]) -> tuple[FieldPath, ...]:
    if isinstance(at.message, str):
        about = f"nothing defines the messages {at.message}" if at.message else "the topic's type is unknown"
        raise Undecided(f"{about} of the topic {at.topic}, and the plan does not name the field", SOURCES)
    if "each" in entry or "take" in entry:
        raise Undecided("`each` and `take` want the fields named")
    return decide(at.port.sort, at.message, at.known, entry.get("values", {}))


def _wires(
    at: Observed, paths: tuple[FieldPath, ...], each: FieldPath | None, entry: Mapping[str, Any], take: Take | None
) -> tuple[tuple[Wire | None, ...], Mapping[str, str]]:
    """The type of each field by the definition, and the meaning of the message's words and numbers. Raises Wrong."""
    names: dict[str, str] = dict(entry.get("values", {}))
    enums = (part for part in s.components(at.port.sort) if isinstance(part, s.EnumSort))
    _check_crossed(names, [member for part in enums for member in part.members])
    message = at.message
    if isinstance(message, str):
        return (), names
    if missing := at.known.missing(message):
        raise Undecided(f"nothing defines {', '.join(missing)}, of which {message.name} is made", SOURCES)
    try:
        if each is not None:
            wire, _ = at.known.at(message, each)
            if not isinstance(wire, Array) or not isinstance(wire.item, Nested):
                raise Wrong(f"{shown(each)} is {wire}, and no array of messages", "each")
            message = at.known.messages[wire.item.name]
        found = [at.known.at(message, way) for way in paths]
    except NoField as error:
        near = error.hint or fitting_fields(at.port.sort, message, at.known)
        raise Wrong(str(error), "field" if "field" in entry else "fields", hint=near) from None
    sort = at.port.sort
    sorts = sort.items if isinstance(sort, s.TupleSort) and len(paths) > 1 else parts_of(sort)
    for way, (wire, holder), part in zip(paths, found, sorts, strict=True):
        if take is not None:
            _check_take(way, wire, part, take, at.known)
            continue
        if not fits(part, wire, at.known) and not isinstance(part, s.DataSort):
            text = f"{shown(way) or 'the message'} is {wire}, which cannot be read as {_said(part)}"
            raise Wrong(text, "field", hint=fitting_fields(part, message, at.known))
        if isinstance(part, s.EnumSort) and isinstance(wire, Scalar):
            names = words(part, wire, holder, entry.get("values", {}))
            _check_words(way, wire, part, holder, names, bool(entry.get("values")))
    return tuple(wire for wire, _ in found), names


def _check_words(
    way: FieldPath, wire: Scalar, sort: s.EnumSort, holder: Message, names: Mapping[str, str], given: bool
) -> None:
    if wire.name not in INTEGERS:
        return
    own = words(sort, wire, holder, {})
    for number, element in names.items():
        if not number.removeprefix("-").isdigit():
            constants = [name for name, kind, _ in holder.constants if kind == wire.name]
            hint = suggest(number, constants)
            raise Wrong(f"{number!r} is neither a number nor a constant of {holder.name}", "values", number, hint=hint)
        if own.get(number, element) != element:
            hint = f"leave {number} out of `values`, or give the elements other names"
            meant = f"by its name in {holder.name} it means {own[number]}"
            raise Wrong(f"{number} is to mean {element}, and {meant}", "values", number, hint=hint)
    left = [member for member in sort.members if member not in names.values()]
    if left and not given:
        raise Wrong(
            f"{shown(way)} is {wire}, and no number is known for {', '.join(left)}",
            "values",
            hint=f"values: {{0: {left[0]}, …}}, or the names of {holder.name}'s constants",
        )


def _check_crossed(names: Mapping[str, str], elements: Sequence[str]) -> None:
    """A word that is an element's own name means that element. Raises Wrong."""
    own = {element.casefold(): element for element in elements}
    for word, element in names.items():
        meant = own.get(word.casefold(), element)
        if meant != element:
            hint = f"leave {word} out of `values`, or give the elements other names"
            raise Wrong(f"{word!r} is to mean {element}, and {meant} is an element too", "values", word, hint=hint)


def _check_take(way: FieldPath, wire: Wire, sort: s.Sort, take: Take, known: Definitions) -> None:
    if not isinstance(wire, Array):
        raise Wrong(f"{shown(way)} is {wire}, and no array", "take")
    if take is Take.COUNT:
        if not isinstance(sort, s.RealSort | s.IntegerSort | s.NaturalSort):
            raise Wrong(f"`count` is a number, and not {_said(sort)}", "take")
    elif not isinstance(sort, s.RealSort | s.IntegerSort | s.NaturalSort) or not fits(sort, wire.item, known):
        raise Wrong(f"the items of {shown(way)} are {wire.item}, which cannot be read as {_said(sort)}", "take")


def _check_gaps(rule: Fields) -> None:
    """*No reading* has to be expressible in the contract. Raises Wrong."""
    sort = rule.variable.sort
    if (rule.gaps or rule.take in (Take.MIN, Take.MAX)) and rule.wires == ():
        key = "take" if rule.take else next(iter(rule.gaps)).value
        raise Wrong("the message's type has to be known for that", key, hint=SOURCES)
    silent = (
        rule.gaps and not isinstance(sort, s.FunctionSort) and rule.elsewhere is None and rule.take is not Take.COUNT
    )
    if silent:
        key = sorted(rule.gaps)[0].value
        message = f"{_said(sort)} has a value always: `none` wants a relation, or the value `elsewhere`"
        raise Wrong(message, key)
    if isinstance(sort, s.SequenceSort) and rule.gaps:
        raise Wrong("a sequence has no place for a missing reading", sorted(rule.gaps)[0].value)


def _said(sort: s.Sort) -> str:
    match sort:
        case s.EnumSort(members=members):
            return f"one of {{{', '.join(members)}}}"
        case s.DataSort(name=name):
            return name
        case s.SequenceSort(item=item):
            return f"<{_said(item)}>"
        case s.TupleSort(items=items):
            return f"({', '.join(map(_said, items))})"
        case _:  # BOOL, REAL, …
            return type(sort).__name__.removesuffix("Sort").upper()


def _choice(at: Observed, sort: s.DataSort, entry: Mapping[str, Any], initial: Value | None) -> Rule:
    known = {c.name: c for c in sort.constructors}
    given = {**{k: v for k, v in entry.items() if k in known}, **entry.get("arguments", {})}
    for key in (*entry, *entry.get("arguments", {})):
        if key not in known and key not in _CHOICE_KEYS:
            raise Wrong(f"{sort.name} has no constructor {key!r}", key, hint=suggest(key, known))
    arguments: dict[str, tuple[Argument, ...]] = {}
    wires: dict[FieldPath, Wire] = {}
    tag = path(entry["constructor"])
    _field(at, tag, sort, "constructor")
    for name, constructor in known.items():
        places = given.get(name, [] if not constructor.parameters else None)
        if places is None:
            continue
        if not isinstance(places, list) or len(places) != len(constructor.parameters):
            raise Wrong(f"{name} takes {len(constructor.parameters)} arguments", name)
        arguments[name] = tuple(_argument(at.plan, place, name, k) for k, place in enumerate(places))
        for k, (place, part) in enumerate(zip(arguments[name], constructor.parameters, strict=True)):
            if not isinstance(place, Lookup) and (wire := _field(at, place, part, name, k)) is not None:
                wires[place] = wire
    names = entry.get("values", {})
    for word in names.values():
        if word not in known:
            raise Wrong(f"{sort.name} has no constructor {word!r}", "values", hint=suggest(word, known))
    _check_crossed(names, list(known))
    return Choice(at.variable, at.topic, tag, arguments, names, initial, wires, at.kind, at.frame)


def _field(at: Observed, way: FieldPath, sort: s.Sort, *place: str | int) -> Wire | None:
    """The type of a field that is to be read as a value of the sort. Raises Wrong."""
    if isinstance(at.message, str):
        return None
    try:
        wire, _ = at.known.at(at.message, way)
    except NoField as error:
        raise Wrong(str(error), *place, hint=error.hint) from None
    if isinstance(sort, s.DataSort):  # a word or a number that names the constructor
        usable = isinstance(wire, Scalar) and (wire.name in INTEGERS or wire.name in ("string", "wstring"))
    else:
        usable = fits(sort, wire, at.known)
    if not usable:
        text = f"{shown(way)} is {wire}, which cannot be read as {_said(sort)}"
        raise Wrong(text, *place, hint=fitting_fields(sort, at.message, at.known))
    return wire


def _argument(plan: Plan, place: Any, constructor: str, at: int) -> Argument:
    if isinstance(place, str):
        return path(place)
    if not isinstance(place, Mapping) or not {"table", "key", "by", "column"} <= place.keys():
        raise Wrong("a field, or {table, key, by, column}, is wanted", constructor, at)
    table = named_table(plan, place["table"], constructor, at)
    for column in (place["by"], place["column"]):
        if column not in table.columns:
            hint = suggest(column, table.columns)
            raise Wrong(f"the table {table.name} has no column {column!r}", constructor, at, hint=hint)
    rows = dict(zip(table.column(place["by"]), table.column(place["column"]), strict=True))
    held = place.get("as")
    if held is not None and held not in SCALARS:
        raise Wrong(f"{held!r} is no type of ROS", constructor, at, hint=suggest(str(held), sorted(SCALARS)))
    return Lookup(table.name, path(place["key"]), rows, Scalar(held) if held is not None else None)


def named_table(plan: Plan, name: str, *place: str | int) -> Table:
    """A table of the scenario. Raises Wrong."""
    scenario = plan.scenario
    known = [t.name for t in scenario.tables] if scenario else []
    if scenario is None or name not in known:
        raise Wrong(f"the scenario has no table {name!r}", *place, hint=suggest(name, known))
    return scenario.table(name)


_CHOICE_KEYS = frozenset(("topic", "type", "constructor", "arguments", "values", "initial"))
_FIELD_KEYS = (
    "topic", "type", "field", "fields", "each", "hold", "values", "elsewhere", "initial", "take", "nan", "inf",
    "parameter",
)  # fmt: skip
_FUNCTION_KEYS = ("each", "hold")
_NAMED = (s.EnumSort, s.DataSort, s.StringSort)
"""The sorts whose values may have names of their own in a message."""


def check_keys(entry: Mapping[str, Any], sort: s.Sort) -> None:
    """Refuses keys that would have no effect. Raises Wrong."""
    for key in entry:
        if key not in _FIELD_KEYS:
            raise Wrong(f"there is no {key!r} here", key, hint=suggest(key, _FIELD_KEYS))
        if key in _FUNCTION_KEYS and not isinstance(sort, s.FunctionSort):
            raise Wrong(f"{key!r} is for functions and relations", key)
    if "field" in entry and "fields" in entry:
        raise Wrong("either 'field' or 'fields'", "fields")
    gaps = entry.keys() & {"nan", "inf"}
    if "elsewhere" in entry and not isinstance(sort, s.FunctionSort) and not gaps and "take" not in entry:
        raise Wrong("'elsewhere' is for functions, and for what may have no reading (`nan: none`, `take`)", "elsewhere")
    parts = tuple(s.components(sort))
    if "values" in entry and not any(isinstance(part, _NAMED) for part in parts):
        raise Wrong(f"'values' gives names to values, and {_said(sort)} has none", "values")
    members = sorted({m for part in parts if isinstance(part, s.EnumSort) for m in part.members})
    if members and not any(isinstance(part, s.StringSort | s.DataSort) for part in parts):
        for name, word in entry.get("values", {}).items():
            if word not in members:
                hint = suggest(word, members)
                raise Wrong(f"{word!r} is no element that could be meant", "values", name, hint=hint)


_INDEX = re.compile(r"\[(-?\d{1,6})\]")


def path(text: str) -> FieldPath:
    """``pose.x`` and ``ranges[0]`` as paths; an empty text is the whole message (or list item)."""
    found: list[str | int] = []
    for step in text.split(".") if text else ():
        indices = _INDEX.findall(step)
        name = _INDEX.sub("", step)
        found += [name] if name or not indices else []
        found += map(int, indices)
    return tuple(found)


def without_field(
    rules: Iterable[Fields | Choice], known: Definitions, text: str, options: Located | None
) -> NoField | None:
    """Why no message of the rules has a field at a path, as far as their types are known. A line of JSON may have more
    fields than its type, but hardly one whose name is nearly that of another."""
    names, way, missing = recordings(options), path(text), None
    bags = bool(names) and not any(name.endswith(".jsonl") for name in names)
    for message in (known.get(rule.kind) for rule in rules):
        if not way or message is None or known.missing(message):
            return None
        try:
            known.at(message, way)
            return None
        except NoField as error:
            fields = [each.name for each in message.fields]
            if not (bags or way[0] in fields or nearest(str(way[0]), fields)):
                return None
            missing = missing or error
    return missing


def literal(raw: Any, sort: s.Sort, key: str) -> Value:
    """A value that the plan gives. Raises Wrong."""
    try:
        return converter(sort)(raw)
    except MappingError as error:
        raise Wrong(str(error), key) from None


NAME = "rosmonitoring"


def method_of(system: System, node: str) -> Located | None:
    """The options of the first method of this backend for a node."""
    return next((m.options for m in system.plan.node(node).methods if m.backend == NAME), None)


def data_of(options: Located | None) -> Mapping[str, Any]:
    """The data of a method's options; empty if there is no such method."""
    return options.data if options is not None and isinstance(options.data, Mapping) else {}


def mapping_of(options: Located | None) -> Mapping[str, Any]:
    found = data_of(options).get("mapping")
    return found if isinstance(found, Mapping) else {}


def recordings(options: Located | None) -> dict[str, str]:
    """The traces that a method names, in order, each with its digest if the plan has it, otherwise an empty text."""
    named = data_of(options).get("traces")
    found: dict[str, str] = {}
    for entry in named if isinstance(named, list) else ():
        match entry:
            case str(path):
                found[path] = ""
            case {"path": str(path)}:
                found[path] = str(entry.get("sha256", ""))
    return found


def outside(options: Located | None, recording: str) -> Mapping[str, str]:
    """The assumptions outside of which a recording was made on purpose, or inputs from the environment, and why."""
    named = data_of(options).get("traces")
    entries = (entry for entry in named if isinstance(entry, Mapping)) if isinstance(named, list) else ()
    return next((entry.get("outside", {}) for entry in entries if entry.get("path") == recording), {})


def sources(system: System, node: Node, port: str) -> list[Endpoint]:
    """The outputs that an input receives: one of each publisher, if the topic has several."""
    try:
        graph = dataflow(system)
    except Rejected:
        return []
    heard = [e for e in graph.feeding(node.name) if e.target.port == port]
    each = (graph.feeding(e.source.node) if e.source.node in graph.relays else (e,) for e in heard)
    return [edge.source for edges in each for edge in edges]


def frame_of(system: System, node: Node, port: Port) -> str:
    """The frame of its topic, otherwise of the topic of an output that it receives."""
    ends = [(node, port)]
    for at in sources(system, node, port.name) if port.role is Role.INPUT else ():
        other = system.contract.node(at.node)
        ends.append((other, other.output(at.port)))
    return next((t.frame for owner, end in ends for t in owner.topics if t.port == end and t.frame), "")


def published(system: System, node: Node, port: str) -> Any:
    """The plan's entry for the outputs that an input receives, without initial values. Raises Wrong if these are read
    in different ways."""
    found: dict[str, tuple[Endpoint, Any]] = {}
    for source in sources(system, node, port):
        entry = mapping_of(method_of(system, source.node)).get(f"out.{source.port}")
        entry = {k: v for k, v in entry.items() if k != "initial"} if isinstance(entry, Mapping) else entry
        if entry is not None:
            found.setdefault(json.dumps(written_out(entry), sort_keys=True, default=str), (source, entry))
    if len(found) > 1:
        (one, first), (other, second), *_ = found.values()
        raise Wrong(f"it hears {one}, read as {show_entry(first)}, and {other}, read as {show_entry(second)}")
    return next((entry for _, entry in found.values()), None)


def show_entry(entry: Any) -> str:
    return entry if isinstance(entry, str) else json.dumps(entry, default=str)


def written_out(entry: Any) -> Mapping[str, Any]:
    if isinstance(entry, str | list):
        return {"field" if isinstance(entry, str) else "fields": entry}
    found: Mapping[str, Any] = entry or {}
    return found


def first_value(system: System, port: Port, edge: Edge) -> Value | None:
    """A delayed edge's first value, if the plan sets one: a value as text, or the formula of an empty relation."""
    if edge.initial is None:
        return None
    source = system.contract.node(edge.source.node)
    try:
        term = parse_term(edge.initial, source, system.contract, edge.span)
        if not isinstance(term.sort, s.BoolSort) or isinstance(port.sort, s.BoolSort):
            value = evaluate(term, {})
            # any kind of number: 1 is a REAL's first value as well as 1.0
            return whole(value) if isinstance(port.sort, s.RealSort) and type(value) is int else value
    except (Rejected, NotEvaluable):
        return None
    return FunctionValue({}, False) if _says_empty(term, edge.source.port) else None


def _says_empty(term: Term, port: str) -> bool:
    """``forall(x, y in REAL | not out.at(x, y))``."""
    match term:
        case Quantified(
            quantifier=Quantifier.FORALL, variables=bound, body=Not(body=Apply(function=f, arguments=args))
        ):
            return isinstance(f, Variable) and (f.role, f.name) == (Role.OUTPUT, port) and args == bound
        case _:  # of another form
            return False
