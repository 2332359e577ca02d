"""The plan's options as rules for every variable of a node; every problem has its place in the plan."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Node, Port
from avow.language.load import parse_term
from avow.language.sorts import (
    BOOL,
    BoolSort,
    DataSort,
    EnumSort,
    FunctionSort,
    IntegerSort,
    NaturalSort,
    OpaqueSort,
    RealSort,
    Sort,
    StringSort,
    TupleSort,
    components,
)
from avow.language.terms import Apply, Not, Quantified, Quantifier, Role, Term, Variable
from avow.system.graph import Edge, dataflow
from avow.system.plan import Located, System, Table
from avow.system.schema import suggest

from .reading import MappingError, convert, from_text
from .rules import (
    Argument,
    Choice,
    Constant,
    Fields,
    Hold,
    InOrder,
    Lookup,
    Path,
    Previous,
    Rule,
)

NAME = "rosmonitoring"


@dataclass(frozen=True, slots=True)
class Setup:
    """How one node is observed. `hidden`: variables that nothing lets us observe, and why."""

    node: Node
    rules: Mapping[str, Rule]
    hidden: Mapping[str, str]
    when: str = "outputs"
    """When a clause is judged: the option of that name."""

    @property
    def topics(self) -> tuple[str, ...]:
        """The names of the topics that are listened to, each once, in the order of the variables."""
        names = (rule.topic for rule in self.rules.values() if isinstance(rule, Fields | InOrder | Choice))
        return tuple(dict.fromkeys(names))


def setup(system: System, node: Node, options: Located | None) -> tuple[Setup, tuple[Diagnostic, ...]]:
    """The rules for a node, by the plan's options, the contract's topics, the connections and the scenario."""
    work = _Work(system, node, options)
    work.unknown_names()
    for port in (*node.inputs, *node.outputs):
        work.port(port)
    work.shared_topics()
    data = options.data if options is not None and isinstance(options.data, Mapping) else {}
    return Setup(node, work.rules, work.hidden, str(data.get("when", "outputs"))), tuple(work.faults)


def same_topic(name: str) -> str:
    """A topic's name without the leading slash: ROS's names are resolved, the contract's need not be."""
    return name.lstrip("/")


class _Fault(Exception):  # noqa: N818 - it is what was found wrong
    def __init__(self, message: str, *path: str | int, hint: str | None = None) -> None:
        super().__init__(message)
        self.path = path
        self.hint = hint


@dataclass(slots=True)
class _Work:
    system: System
    node: Node
    options: Located | None
    rules: dict[str, Rule] = field(default_factory=dict)
    hidden: dict[str, str] = field(default_factory=dict)
    faults: list[Diagnostic] = field(default_factory=list)

    def mapping(self) -> Mapping[str, Any]:
        return _mapping(self.options)

    def unknown_names(self) -> None:
        known = {p.variable.qualified for p in (*self.node.inputs, *self.node.outputs)}
        for name in self.mapping():
            if name not in known:
                self.fault(f"{self.node.name} has no variable {name!r}", name, hint=suggest(name, sorted(known)))

    def fault(self, message: str, *path: str | int, hint: str | None = None) -> None:
        span = self.options.at("mapping", *path) if self.options is not None else None
        where = ".".join(str(p) for p in path)
        self.faults.append(Diagnostic("MON101", f"mapping.{where}: {message}", span, hint=hint))

    def port(self, port: Port) -> None:
        name = port.variable.qualified
        try:
            found = self.rule(port)
        except _Fault as error:
            self.fault(str(error), name, *error.path, hint=error.hint)
            self.hidden[name] = str(error)
            return
        if isinstance(found, str):
            self.hidden[name] = found
        else:
            self.rules[name] = found

    def shared_topics(self) -> None:
        """Hides a variable that would be read by the order of fields from a message that carries another like it: both
        might be given one field's value, and nobody would notice."""
        found = {n: r for n, r in self.rules.items() if isinstance(r, Fields | InOrder | Choice)}
        for name, rule in found.items():
            if not isinstance(rule, InOrder):
                continue
            for other_name, other in found.items():
                if (
                    other_name != name
                    and other.variable.role is rule.variable.role
                    and same_topic(other.topic) == same_topic(rule.topic)
                    and _look_alike(other.variable.sort, rule.variable.sort)
                ):
                    why = f"the topic {rule.topic} carries {name} and {other_name}"
                    self.hidden[name] = f"{why}, and the plan does not name the field of {name}"
                    self.rules.pop(name, None)

    def rule(self, port: Port) -> Rule | str:
        """The rule, or why there is none."""
        name = port.variable.qualified
        entry = self.mapping().get(name)
        if isinstance(entry, Mapping) and not entry.keys() & {"scenario", "previous", "constructor"}:
            _keys(entry, port.sort)
        topic = _topic(self.node, port)
        edge = self.edge(port)
        if isinstance(entry, Mapping) and entry.get("scenario"):
            return self.scenario(port)
        if isinstance(entry, Mapping) and "previous" in entry:
            return self.previous(port, entry)
        if entry is None and topic is None:
            if edge is not None and edge.delayed and edge.source.node == self.node.name:
                return Previous(port.variable, f"out.{edge.source.port}", self.first(port, edge))
            if edge is None and self.interpretation(port) is not None:
                return self.scenario(port)
        if edge is not None and edge.source.node != self.node.name:
            source = self.system.contract.node(edge.source.node)
            topic = topic or _topic(source, source.output(edge.source.port))
            if entry is None:
                entry = self.neighbour(edge)
        if isinstance(entry, Mapping):
            topic = entry.get("topic", topic)
        if topic is None:
            return f"no topic of {self.node.name} matches {name}, and the plan does not map it"
        return self.observed(port, topic, entry)

    def observed(self, port: Port, topic: str, entry: Any) -> Rule | str:
        sort, variable = port.sort, port.variable
        if isinstance(sort, OpaqueSort):
            return f"{variable.qualified} is of an unspecified sort"
        if isinstance(entry, str):
            entry = {"field": entry}
        elif isinstance(entry, list):
            entry = {"fields": entry}
        entry = entry or {}
        initial = self.literal(entry, "initial", variable)
        if isinstance(sort, DataSort) and "constructor" in entry:
            return self.choice(sort, variable, topic, entry, initial)
        if isinstance(sort, DataSort) and not ("field" in entry or "fields" in entry):
            constructors = ", ".join(c.name for c in sort.constructors)
            return f"the plan does not say how a message names one of {constructors}"
        elsewhere: Value | None = None
        if isinstance(sort, FunctionSort) and sort.result != BOOL:
            if "elsewhere" not in entry:
                return f"{variable.qualified} is a total function, and the plan does not say its value `elsewhere`"
            elsewhere = _read(entry["elsewhere"], sort.result, "elsewhere")
        hold = Hold(entry.get("hold", "latest"))
        if hold is Hold.SEEN and initial is None and isinstance(sort, FunctionSort) and sort.result == BOOL:
            initial = FunctionValue({}, False)
        names = entry.get("values", {})
        if "field" in entry or "fields" in entry:
            paths = tuple(map(path, [entry["field"]] if "field" in entry else entry["fields"]))
            wanted = 1
            if isinstance(sort, FunctionSort):
                wanted = len(sort.parameters) + (sort.result != BOOL)
            elif isinstance(sort, TupleSort) and len(paths) > 1:  # a field for each part; one field holds them all
                wanted = len(sort.items)
            if len(paths) != wanted:
                raise _Fault(f"{wanted} field{'s are' if wanted > 1 else ' is'} wanted, not {len(paths)}", "fields")
            each = path(entry["each"]) if "each" in entry else None
            return Fields(variable, topic, paths, names, hold, each, elsewhere, initial)
        return InOrder(variable, topic, names, hold, elsewhere, initial)

    def choice(
        self, sort: DataSort, variable: Variable, topic: str, entry: Mapping[str, Any], initial: Value | None
    ) -> Rule:
        known = {c.name: c for c in sort.constructors}
        given = {**{k: v for k, v in entry.items() if k in known}, **entry.get("arguments", {})}
        for key in (*entry, *entry.get("arguments", {})):
            if key not in known and key not in _KEYS:
                raise _Fault(f"{sort.name} has no constructor {key!r}", key, hint=suggest(key, known))
        arguments: dict[str, tuple[Argument, ...]] = {}
        for name, constructor in known.items():
            places = given.get(name, [] if not constructor.parameters else None)
            if places is None:
                continue
            if not isinstance(places, list) or len(places) != len(constructor.parameters):
                raise _Fault(f"{name} takes {len(constructor.parameters)} arguments", name)
            arguments[name] = tuple(self.argument(place, name, k) for k, place in enumerate(places))
        names = entry.get("values", {})
        for word in names.values():
            if word not in known:
                raise _Fault(f"{sort.name} has no constructor {word!r}", "values", hint=suggest(word, known))
        return Choice(variable, topic, path(entry["constructor"]), arguments, names, initial)

    def argument(self, place: Any, constructor: str, at: int) -> Argument:
        if isinstance(place, str):
            return path(place)
        if not isinstance(place, Mapping) or not {"table", "key", "by", "column"} <= place.keys():
            raise _Fault("a field, or {table, key, by, column}, is wanted", constructor, at)
        table = self.table(place["table"], constructor, at)
        for column in (place["by"], place["column"]):
            if column not in table.columns:
                hint = suggest(column, table.columns)
                raise _Fault(f"the table {table.name} has no column {column!r}", constructor, at, hint=hint)
        rows = dict(zip(table.column(place["by"]), table.column(place["column"]), strict=True))
        return Lookup(table.name, path(place["key"]), rows)

    def table(self, name: str, *place: str | int) -> Table:
        scenario = self.system.plan.scenario
        try:
            if scenario is not None:
                return scenario.table(name)
        except KeyError:
            pass
        known = [t.name for t in scenario.tables] if scenario else []
        raise _Fault(f"the scenario has no table {name!r}", *place, hint=suggest(name, known))

    def interpretation(self, port: Port) -> tuple[str, tuple[str, ...]] | None:
        scenario = self.system.plan.scenario
        if scenario is None:
            return None
        for name in (f"{self.node.name}.{port.name}", port.variable.qualified):
            if name in scenario.interpret:
                return scenario.interpret[name]
        return None

    def scenario(self, port: Port) -> Rule:
        found = self.interpretation(port)
        if found is None or not isinstance(port.sort, FunctionSort):
            raise _Fault("the plan's scenario does not interpret it", "scenario")
        table, columns = self.table(found[0]), found[1]
        relation = port.sort.result == BOOL
        sorts = port.sort.parameters if relation else (*port.sort.parameters, port.sort.result)
        entry = self.mapping().get(port.variable.qualified)
        elsewhere: Value = False
        if not relation:
            if not isinstance(entry, Mapping) or "elsewhere" not in entry:
                raise _Fault("a total function needs its value `elsewhere`", "scenario")
            elsewhere = _read(entry["elsewhere"], port.sort.result, "elsewhere")
        at = [table.columns.index(c) for c in columns]
        points: dict[tuple[Value, ...], Value] = {}
        try:
            for row in table.rows:
                values = tuple(from_text(row[k], s) for k, s in zip(at, sorts, strict=True))
                points[values if relation else values[:-1]] = True if relation else values[-1]
        except MappingError as error:
            raise _Fault(f"table {table.name}: {error}", "scenario") from None
        return Constant(port.variable, FunctionValue(points, elsewhere))

    def previous(self, port: Port, entry: Mapping[str, Any]) -> Rule:
        source = str(entry["previous"])
        name = source.removeprefix("out.")
        known = {p.name: p for p in self.node.outputs}
        if name not in known:
            raise _Fault(f"there is no output {source!r}", "previous", hint=suggest(name, known))
        if known[name].sort != port.sort:
            raise _Fault(f"{source} is of another type", "previous")
        edge = self.edge(port)
        initial = self.literal(entry, "initial", port.variable)
        if initial is None and edge is not None and edge.delayed:
            initial = self.first(port, edge)
        return Previous(port.variable, f"out.{name}", initial)

    def literal(self, entry: Mapping[str, Any], key: str, variable: Variable) -> Value | None:
        return _read(entry[key], variable.sort, key) if entry.get(key) is not None else None

    def edge(self, port: Port) -> Edge | None:
        if port.role is not Role.INPUT:
            return None
        try:
            graph = dataflow(self.system)
        except Rejected:
            return None
        return next((e for e in graph.feeding(self.node.name) if e.target.port == port.name), None)

    def first(self, port: Port, edge: Edge) -> Value | None:
        """A delayed edge's first value, if the plan fixes one: a value as text, or an empty relation's formula."""
        if edge.initial is None:
            return None
        source = self.system.contract.node(edge.source.node)
        try:
            term = parse_term(edge.initial, source, self.system.contract, edge.span)
        except Rejected:
            return None
        if term.sort == port.sort and not isinstance(port.sort, FunctionSort):
            try:
                return evaluate(term, {})
            except NotEvaluable:
                return None
        return FunctionValue({}, False) if _says_empty(term, edge.source.port) else None

    def neighbour(self, edge: Edge) -> Any:
        """What the providing node's own monitor says of the same topic."""
        for method in self.system.plan.node(edge.source.node).methods:
            if method.backend == NAME:
                entry = _mapping(method.options).get(f"out.{edge.source.port}")
                return {k: v for k, v in entry.items() if k != "initial"} if isinstance(entry, Mapping) else entry
        return None


_KEYS = frozenset(("topic", "type", "constructor", "arguments", "values", "initial"))
_FIELD_KEYS = ("topic", "type", "field", "fields", "each", "hold", "values", "elsewhere", "initial")
_FUNCTION_KEYS = ("each", "hold", "elsewhere")


def _keys(entry: Mapping[str, Any], sort: Sort) -> None:
    """Refuses what would be passed over in silence. Raises _Fault."""
    for key in entry:
        if key not in _FIELD_KEYS:
            raise _Fault(f"there is no {key!r} here", key, hint=suggest(key, _FIELD_KEYS))
        if key in _FUNCTION_KEYS and not isinstance(sort, FunctionSort):
            raise _Fault(f"{key!r} is for functions and relations", key)
    if "field" in entry and "fields" in entry:
        raise _Fault("either 'field' or 'fields'", "fields")
    parts = tuple(components(sort))
    words = sorted({m for part in parts if isinstance(part, EnumSort) for m in part.members})
    if words and not any(isinstance(part, StringSort | DataSort) for part in parts):
        for name, word in entry.get("values", {}).items():
            if word not in words:
                raise _Fault(f"{word!r} is no element that could be meant", "values", name, hint=suggest(word, words))


def _mapping(options: Located | None) -> Mapping[str, Any]:
    data = options.data if options is not None else None
    found = data.get("mapping") if isinstance(data, Mapping) else None
    return found if isinstance(found, Mapping) else {}


def _look_alike(one: Sort, other: Sort) -> bool:
    """Whether a field might be read as (part of) a value of either sort."""
    return any(a == b or _ANYTHING in (a, b) for a in _contents(one) for b in _contents(other))


_ANYTHING = "anything"


def _contents(sort: Sort) -> frozenset[str]:
    """What fields a value is read from: numbers, truth values, or words."""
    match sort:
        case FunctionSort(parameters=parameters, result=result):
            parts = parameters if result == BOOL else (*parameters, result)
            return frozenset(word for part in parts for word in _contents(part))
        case TupleSort(items=items):
            return frozenset(word for item in items for word in _contents(item))
        case RealSort() | IntegerSort() | NaturalSort():
            return frozenset(("a number",))
        case BoolSort():
            return frozenset(("a truth value",))
        case EnumSort(members=members):
            return frozenset(f"word {member}" for member in members)
        case _:  # any message may be one
            return frozenset((_ANYTHING,))


def _topic(node: Node, port: Port) -> str | None:
    return next((t.name for t in node.topics if t.port == port), None)


def path(text: str) -> Path:
    """``pose.x`` as a path; an empty text is the whole message (or list item)."""
    return tuple(text.split(".")) if text else ()


def _read(raw: Any, sort: Any, key: str) -> Value:
    try:
        return convert(raw, sort, {})
    except MappingError as error:
        raise _Fault(str(error), key) from None


def _says_empty(term: Term, port: str) -> bool:
    """``forall(x, y in REAL | not out.at(x, y))``."""
    match term:
        case Quantified(
            quantifier=Quantifier.FORALL,
            variables=variables,
            body=Not(body=Apply(function=Variable(role=Role.OUTPUT, name=name), arguments=arguments)),
        ):
            return name == port and arguments == variables
        case _:  # not of the form that is looked for
            return False
