"""The plan's options as rules for every variable of a node; every error has its place in the plan."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.backend_kit.box import BOX, Box, read_box
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.files import inside
from avow.base.plain import listed
from avow.base.suggestions import nearest, suggest
from avow.formulas.formula import free_variables
from avow.formulas.values import FunctionValue, Value
from avow.language.contract import Node, Port, Topic
from avow.language.sorts import BOOL, FunctionSort
from avow.language.terms import Role
from avow.ros.bags import Event, Origin, is_bag, publisher
from avow.ros.calls import CALL, is_part, named, pairing, part_topic
from avow.ros.definitions import Definitions, Message, NoField, Wire
from avow.ros.sources import definitions
from avow.system.graph import dataflow
from avow.system.plan import Edge, Located, System

from . import observing
from .guarding import FALLBACK, Fallback, bounded, fallbacks
from .pace import NO_TIME, RATE, By, Leeway, Rate, duration
from .pairing import NUMBER, Answers
from .parameters import concerns, constant, kept, parameter
from .reading import Undecided, from_text, shown
from .rules import Choice, Constant, FieldPath, Fields, Previous, Rule, of_latest, otherwise, read_from_inputs
from .traces import carried
from .tuning import DECIDED_SHARE
from .wires import MappingError, parts_of, table_of


@dataclass(frozen=True, slots=True)
class Setup:
    """How one node is observed. `hidden`: variables that cannot be observed, and why."""

    node: Node
    rules: Mapping[str, Rule]
    hidden: Mapping[str, str]
    when: str = "outputs"
    """When a clause is judged: the option of that name."""
    known: Definitions = field(default_factory=lambda: Definitions({}))
    """The message types."""
    answers: Answers | None = None
    """How answers are paired with inputs; None: not specified."""
    decided: float = DECIDED_SHARE
    """The share of publications that has to be decided before a run is evidence."""
    named: tuple[tuple[str, str], ...] = ()
    """The contract's topics, by their full names, and their types."""
    fresh: Mapping[str, Fraction] = field(default_factory=dict)
    """How long each of these variables may be silent, in seconds."""
    rates: Mapping[str, Rate] = field(default_factory=dict)
    """The rate at which each of these variables has to come."""
    max_age: Fraction | None = None
    """The greatest age in seconds of an answer's inputs at which it is evidence."""
    losses: int | None = None
    """The number of messages that may have been lost; None: any number."""
    filtered: frozenset[str] = frozenset()
    """The topics (without their leading slash) whose messages a filter passes on only while nothing is broken."""
    fallback: Mapping[str, Fallback] = field(default_factory=dict)
    """Some of these topics: the fields with which a message is passed on that is otherwise withheld."""
    box: Box = field(default_factory=Box)
    """Bounds of the inputs, which are an assumption of `node`, `BOX`, too."""
    leeway: Leeway = field(default_factory=Leeway)
    time: By = By.RECEIPT
    """The clock by which its messages are timed."""
    shared: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Each output whose topic other nodes publish too: the full names of all its publishers."""
    placed: str = ""
    """The node's full name; empty if nobody asks who published."""

    def whose(self, name: str, event: Event) -> bool | None:
        """Whether an event's message is the node's own, for a variable that it carries; None if that is not known. A
        message without a name is taken for the node's own if the contract has no other publisher; so is any that a
        filter guards."""
        by, output = publisher(event), name.startswith(f"{Role.OUTPUT}.")
        if (concerned := concerns(self.rules[name], event)) is not None:
            return concerned
        if name in self.shared:
            return by == self.placed if by in self.shared[name] else None
        if output and same_topic(self.carried[name].topic) in self.filtered:
            return by != FALLBACK
        return None if self.strange(by) and output else True

    def strange(self, by: str) -> bool:
        """Whether this is the name of a node, and not of this one."""
        return bool(by and self.placed) and by != self.placed

    @property
    def carried(self) -> dict[str, Fields | Choice]:
        """The rules of the variables that messages carry."""
        return {name: rule for name, rule in self.rules.items() if isinstance(rule, Fields | Choice)}

    @property
    def kinds(self) -> dict[str, str]:
        """The types of the topics that are listened to (without their leading slash), as far as they are known."""
        return {same_topic(rule.topic): rule.kind for rule in self.carried.values() if rule.kind}

    def unmarked(self, names: Collection[str], typed: bool) -> str:
        """Why the inputs and outputs among these cannot be paired, as far as known. `typed`: all fields are known."""
        answers, carried = self.answers, {n: rule for n, rule in self.carried.items() if n in names}
        if not set() < carried.keys() & self.heard < carried.keys():
            return ""
        if answers is None:
            proposed = pairing({rule.topic: rule.kind for rule in self.carried.values()}, self.known)
            return f"the plan does not say which input an answer answered: add `answers: {proposed}`, or another way"
        alone = [name for name, rule in carried.items() if not is_part(rule.topic)]
        if answers.by == "call" and not answers.others and alone:
            return f"{alone[0]} is part of no call: pair the others by latency (`answers: {{by: call, others: …}}`)"
        for name, rule in carried.items() if typed else ():
            way = answers.input if name in self.heard else answers.output
            message = self.known.get(rule.kind)
            try:
                if way not in ((), (CALL,), (NUMBER,)) and message is not None and not self.known.missing(message):
                    self.known.at(message, way)
            except NoField as error:
                return f"{error}, and answers are paired by {answers.by}: name the field (`input`, `output`), {_PAIR}"
        return ""

    @property
    def heard(self) -> frozenset[str]:
        """The inputs that messages carry, and that may change during a run."""
        inputs = ((name, rule) for name, rule in self.carried.items() if name.startswith(f"{Role.INPUT}."))
        return frozenset(name for name, rule in inputs if not constant(rule))

    @property
    def topics(self) -> tuple[str, ...]:
        """The names of the topics that are listened to, each once, in the order of the variables."""
        return tuple(dict.fromkeys(rule.topic for rule in self.carried.values()))


def setup(
    system: System, node: Node, options: Located | None, known: Definitions | None = None
) -> tuple[Setup, tuple[Diagnostic, ...]]:
    """The rules for a node, by the plan's options, the contract's topics, the messages' definitions, the connections
    and the scenario. `known`: the definitions, if they have been read already."""
    wrong: tuple[Diagnostic, ...] = ()
    if known is None:
        known, wrong = known_types(system, _traces_of(system, options))
    work = _Work(system, node, options, known, faults=list(wrong))
    work.unknown_names()
    for port in (*node.inputs, *node.outputs):
        work.port(port)
    work.shared_fields()
    for name, told in read_from_inputs(work.rules, work.mapping()):
        work.fault(f"it is read from the message that gives {told}", name, hint="name what the node publishes")
    data = observing.data_of(options)
    named, leeway = tuple((_called(system, node, t), t.ros_type) for t in node.topics), work.leeway(data)
    answers = work.answers(data.get("answers"), leeway.jitter)
    node = kept(system, node, work.rules, known)
    box, wrong = read_box(data.get(BOX, {}), node, system.plan.root, "MON101", options.at(BOX) if options else None)
    work.faults += wrong
    work.heard(BOX, () if wrong else data.get(BOX))  # a clause about what no message carries is not judged
    fallback = fallbacks(data, work.rules, known, work.wrong)
    made = Setup(
        bounded(node, box, work.wrong), work.rules, work.hidden, str(data.get("when", "outputs")), known, answers,
        float(data.get("decided", DECIDED_SHARE)), named, work.fresh(data.get("fresh")), work.rates(data.get("rate")),
        work.duration("max_age", data["max_age"]) if "max_age" in data else None, data.get("losses"), work.filtered(),
        fallback, box, leeway, By(str(data.get("time", By.RECEIPT))), work.shared,
        system.plan.ros.names.placed(node.name).name,
    )  # fmt: skip
    return made, tuple(work.faults)


def usable(system: System, node: Node, options: Located | None) -> Setup:
    """As `setup`. Raises Rejected if there are errors."""
    made, faults = setup(system, node, options)
    if faults:
        raise Rejected(*faults)
    return made


def origin(system: System) -> Origin:
    """The plan's sources of message types."""
    return Origin(system.plan.ros.distro, system.plan.messages)


def known_types(system: System, traces: Iterable[Path]) -> tuple[Definitions, tuple[Diagnostic, ...]]:
    """The message types that the plan's files, its distribution and the bags among some traces define. Unreadable bags
    are left to the judging of the trace."""
    known, wrong = definitions(system.plan.messages, system.plan.ros.distro)
    for path in traces:
        if is_bag(path):
            try:
                known = Definitions({**carried(path, origin(system)).known, **known.messages})
            except Rejected:
                continue
    return known, wrong


def _traces_of(system: System, options: Located | None) -> tuple[Path, ...]:
    """The traces that a method names and that exist."""
    paths = (inside(system.plan.root, name) for name in observing.recordings(options))
    return tuple(path for path in paths if path is not None and path.exists())


def resolved(system: System, node: Node, topic: str) -> str:
    """The topic's full name when the robot runs; as it is written if only the first slash is missing."""
    whole = system.plan.ros.names.topic(node.name, topic)
    return topic if whole == f"/{topic}" else whole


def _called(system: System, node: Node, topic: Topic) -> str:
    """As `resolved`; a part of a call has a topic of its own."""
    return part_topic(resolved(system, node, topic.name), topic.ros_type)


def same_topic(name: str) -> str:
    """A topic's name without the leading slash: ROS's names are resolved, the contract's may not be."""
    return name.lstrip("/")


@dataclass(slots=True)
class _Work:
    system: System
    node: Node
    options: Located | None
    known: Definitions
    rules: dict[str, Rule] = field(default_factory=dict)
    hidden: dict[str, str] = field(default_factory=dict)
    shared: dict[str, tuple[str, ...]] = field(default_factory=dict)
    faults: list[Diagnostic] = field(default_factory=list)
    meant: set[str] = field(default_factory=set)
    """The variables whose names are probably misspelt in the mapping: that is reported, and what follows is not."""

    def mapping(self) -> Mapping[str, Any]:
        return observing.mapping_of(self.options)

    def unknown_names(self) -> None:
        known = {p.variable.qualified for p in (*self.node.inputs, *self.node.outputs)}
        for name in self.mapping():
            if name not in known:
                place = self.options.key("mapping", name) if self.options else None
                text = f"mapping.{name}: {self.node.name} has no variable {name!r}"
                self.faults.append(Diagnostic("MON101", text, place, hint=suggest(name, sorted(known))))
                self.meant |= {*nearest(name, known)}

    def duration(self, place: str, written: Any) -> Fraction:
        """A time of the options, in seconds; 0 with a recorded error if it is none."""
        try:
            return duration(str(written))
        except (ValueError, KeyError):
            self.wrong(f"{place}: {NO_TIME}, not {written}", *place.split(".", 1))
            return Fraction(0)

    def answers(self, entry: Any, jitter: Fraction) -> Answers | None:
        if not isinstance(entry, Mapping):
            return None
        by = str(entry.get("by", "latency"))
        said = {**entry, **entry.get("others", {})}
        parts = {n: r.topic for n, r in self.rules.items() if isinstance(r, Fields | Choice) and is_part(r.topic)}
        for name, rule in self.rules.items() if by not in ("arrival", "latency") else ():
            known = isinstance(rule, Fields | Choice) and of_latest(rule) and rule.initial is not None
            if known and name.startswith(f"{Role.INPUT}.") and (name in parts or "others" not in entry):
                text = f"by {by} it has no effect: an answer is judged with the message that it answered"
                self.fault(text, name, "initial", hint=f"leave it out, {_PAIR}")
        for end, role in (("input", Role.INPUT), ("output", Role.OUTPUT)) if by not in ("call", "order") else ():
            of = [r for r in self.rules.values() if isinstance(r, Fields | Choice) and r.variable.role is role]
            if end in entry and (lacks := observing.without_field(of, self.known, str(entry[end]), self.options)):
                self.wrong(f"answers.{end}: {lacks}", "answers", end, hint=lacks.hint)
        ends = ((p, observing.sources(self.system, self.node, p.name)) for p in self.node.inputs)
        looped = (
            p for p, found in ends if any(self.node.name in dataflow(self.system).upstream(s.node) for s in found)
        )
        usual = {"stamp": ("header", "stamp"), "call": (CALL,), "order": (NUMBER,)}.get(by, ())
        return Answers(
            by,
            str(said.get("because", "")),
            observing.path(str(entry["input"])) if "input" in entry else usual,
            observing.path(str(entry["output"])) if "output" in entry else usual,
            self.duration("answers.latency", said.get("latency", "0 s")),
            self.duration("answers.jitter", said["jitter"]) if "jitter" in said else jitter * (by != "latency"),
            frozenset(port.variable.qualified for port in looped),
            "others" in entry,
            {name: named(topic).partition("/_action/")[0] for name, topic in parts.items()},
        )

    def leeway(self, data: Mapping[str, Any]) -> Leeway:
        own = Leeway()
        return Leeway(
            self.duration("grace", data["grace"]) if "grace" in data else own.grace,
            self.duration("jitter", data["jitter"]) if "jitter" in data else own.jitter,
            data.get("instances", own.instances),
        )

    def fresh(self, entry: Any) -> dict[str, Fraction]:
        """The deadlines, of variables that messages carry."""
        return {name: self.duration(f"fresh.{name}", entry[name]) for name in self.heard("fresh", entry)}

    def rates(self, entry: Any) -> dict[str, Rate]:
        """The rates at which variables have to come."""
        found: dict[str, Rate] = {}
        for name in self.heard("rate", entry):
            written = RATE.fullmatch(str(entry[name]))
            hertz, share = (Fraction(part) for part in written.groups()) if written else (Fraction(0), Fraction(0))
            if hertz and share < 100:
                found[name] = Rate.of(hertz, share / 100, str(entry[name]))
            else:
                self.wrong(f"rate.{name}: a frequency and a share below 100 % are wanted: 10 Hz ± 20 %", "rate", name)
        return found

    def filtered(self) -> frozenset[str]:
        """The topics of the outputs that are filtered: messages must carry these, not calls."""
        names = observing.data_of(self.options).get("filter", ())
        outputs = {n: r for n, r in self.rules.items() if n.startswith("out.") and isinstance(r, Fields | Choice)}
        for at, name in enumerate(names):
            if name not in outputs or is_part(outputs[name].topic):
                hint = None if name in outputs else suggest(str(name), outputs)
                self.wrong(f"filter: {name} is no output that a topic's messages carry", "filter", at, hint=hint)
        return frozenset(same_topic(outputs[name].topic) for name in names if name in outputs)

    def heard(self, key: str, entry: Any) -> list[str]:
        """The variables of an option that messages carry; the others are errors."""
        observed = sorted(n for n, rule in self.rules.items() if isinstance(rule, Fields | Choice))
        for name in entry or ():
            if name not in observed:
                hint = suggest(name, observed)
                self.wrong(f"{key}.{name}: no message that is observed carries it", key, name, hint=hint)
        return [name for name in entry or () if name in observed]

    def fault(self, message: str, *path: str | int, hint: str | None = None) -> None:
        where = ".".join(str(p) for p in path)
        self.wrong(f"mapping.{where}: {message}", "mapping", *path, hint=hint)

    def wrong(self, text: str, *place: str | int, hint: str | None = None) -> None:
        """Records an error in the options, at its place in the plan."""
        self.faults.append(Diagnostic("MON101", text, self.options.at(*place) if self.options else None, hint=hint))

    def port(self, port: Port) -> None:
        name = port.variable.qualified
        try:
            found = self.rule(port)
        except observing.Wrong as error:
            if name in self.mapping() or name not in self.meant:
                self.fault(str(error), name, *error.path, hint=error.hint)
            self.hidden[name] = str(error)
            return
        if isinstance(found, str):
            self.hidden[name] = found
        else:
            self.rules[name] = found
            self.as_published(name, found)

    def as_published(self, name: str, rule: Rule) -> None:
        """A link states that both ends have one value: they must be read in the same way."""
        mapped = name in self.mapping()
        for source in observing.sources(self.system, self.node, name.partition(".")[2]) if mapped else ():
            node = self.system.contract.node(source.node)
            other = _Work(self.system, node, observing.method_of(self.system, node.name), self.known)
            if source.node == self.node.name or (entry := other.mapping().get(f"out.{source.port}")) is None:
                continue
            other.port(node.output(source.port))
            rule_there = other.rules.get(f"out.{source.port}")
            if rule_there is not None and otherwise(rule, rule_there):
                of = f"{observing.show_entry(entry)} of {getattr(rule_there, 'topic', 'no topic')}"
                text = f"{source}, to which it is linked, is read otherwise, as {of}"
                hint = "correct either; an input without a mapping is read as the output; or give them different names"
                self.fault(text, name, hint=hint)

    def shared_fields(self) -> None:
        """Refuses two inputs (or outputs) that are read from one field: the meaning of one is not specified."""
        taken: dict[tuple[str, FieldPath, Role], str] = {}
        for name, rule in self.rules.items():
            if not isinstance(rule, Fields) or name in self.mapping():
                continue
            for at in rule.paths:
                mine = (same_topic(rule.topic), at, rule.variable.role)
                other = taken.setdefault(mine, name)
                if other != name:
                    message = f"{other} and {name} would both be read from {rule.topic}, field {shown(at)}"
                    self.fault(message, name, hint=_FIELD_HINT)

    def rule(self, port: Port) -> Rule | str:
        """The rule, or why there is none."""
        name = port.variable.qualified
        entry = self.mapping().get(name)
        if isinstance(entry, Mapping) and not entry.keys() & {"scenario", "previous", "constructor"}:
            observing.check_keys(entry, port.sort)
        topic, kind = self.topic(self.node, port)
        edge = self.edge(port)
        if isinstance(entry, Mapping) and entry.get("scenario"):
            return self.scenario(port)
        if isinstance(entry, Mapping) and "previous" in entry:
            return self.previous(port, entry)
        if entry is None and topic is None:
            if edge is not None and edge.delayed and edge.source.node == self.node.name:
                first = observing.first_value(self.system, port, edge)
                return Previous(port.variable, f"out.{edge.source.port}", first)
            if edge is None and self.interpretation(port) is not None:
                return self.scenario(port)
        if edge is not None and edge.source.node != self.node.name:
            source = self.system.contract.node(edge.source.node)
            if topic is None:
                topic, kind = self.topic(source, source.output(edge.source.port))
            if entry is None:
                entry = observing.published(self.system, self.node, port.name)
        if isinstance(entry, Mapping):
            topic = resolved(self.system, self.node, entry["topic"]) if "topic" in entry else topic
        if "parameter" in (said := observing.written_out(entry)) or (port.parameter and topic is None):
            initial = observing.literal(said["initial"], port.sort, "initial") if "initial" in said else None
            return parameter(port, self.system, self.node, self.known, said.get("parameter", port.name), initial)
        if topic is None:
            return f"no topic of {self.node.name} matches {name}, and the plan does not map it"
        carriers = sorted({of.name for of in self.node.topics if of.port == port})
        if len(carriers) > 1 and not (isinstance(entry, Mapping) and "topic" in entry):
            return f"{listed(carriers)} carry {name}, and a monitor reads one: `mapping` says which"
        for several, who in self.system.plan.ros.shared:
            if port.role is Role.OUTPUT and same_topic(topic) == same_topic(several):
                self.shared[name] = who
        return self.observed(port, topic, kind, entry)

    def observed(self, port: Port, topic: str, kind: str | None, entry: Any) -> Rule | str:
        entry = observing.written_out(entry)
        try:
            message, frame = self.message(kind, entry), observing.frame_of(self.system, self.node, port)
            about = observing.Observed(self.system.plan, port, topic, message, self.known, frame)
            return observing.observe(about, entry)
        except Undecided as undecided:
            if self.asked(port):
                raise observing.Wrong(str(undecided), hint=undecided.hint or _FIELD_HINT) from None
            return f"{undecided}; {undecided.hint or _FIELD_HINT}"

    def topic(self, node: Node, port: Port) -> tuple[str | None, str | None]:
        """The name and the type of the topic that carries a port."""
        found = next((t for t in node.topics if t.port == port), None)
        return (None, None) if found is None else (_called(self.system, node, found), found.ros_type)

    def message(self, kind: str | None, entry: Mapping[str, Any]) -> Message | str:
        """The definition of the messages of a topic, or the type's name if it is not known."""
        kind = str(entry.get("type", kind or ""))
        return self.known.get(kind) or kind

    def asked(self, port: Port) -> bool:
        """Whether a method of the plan judges a clause about it."""
        return self.options is not None and any(port.variable in free_variables(c.formula) for c in self.node.clauses)

    def interpretation(self, port: Port) -> tuple[str, tuple[str, ...]] | None:
        scenario = self.system.plan.scenario
        return None if scenario is None else scenario.interpreted(self.node.name, port)

    def scenario(self, port: Port) -> Rule:
        if (found := self.interpretation(port)) is None or not isinstance(port.sort, FunctionSort):
            raise observing.Wrong("the plan's scenario does not interpret it", "scenario")
        table, columns = observing.named_table(self.system.plan, found[0], "scenario"), found[1]
        entry = self.mapping().get(port.variable.qualified)
        elsewhere: Value = False
        if port.sort.result != BOOL:
            if not isinstance(entry, Mapping) or "elsewhere" not in entry:
                raise observing.Wrong("a total function needs its value `elsewhere`", "scenario")
            elsewhere = observing.literal(entry["elsewhere"], port.sort.result, "elsewhere")
        at = [table.columns.index(c) for c in columns]
        wires = self.wires(port, entry) or [None] * len(at)
        parts = list(zip(at, parts_of(port.sort), wires, strict=True))
        try:
            points = [tuple(from_text(row[k], sort, wire) for k, sort, wire in parts) for row in table.rows]
        except MappingError as error:
            raise observing.Wrong(f"table {table.name}: {error}", "scenario") from None
        return Constant(port.variable, FunctionValue(table_of(points, port.sort), elsewhere))

    def wires(self, port: Port, entry: Any) -> tuple[Wire | None, ...]:
        """The types in which a port's messages carry its values: a map of decimals that a node reads as binary numbers
        has the latter as its values."""
        topic, kind = self.topic(self.node, port)
        fields = {k: v for k, v in entry.items() if k in ("fields", "type")} if isinstance(entry, Mapping) else {}
        if topic is None or not isinstance(self.message(kind, fields), Message):
            return ()
        rule = self.observed(port, topic, kind, {**fields, "elsewhere": None})
        return rule.wires if isinstance(rule, Fields) else ()

    def previous(self, port: Port, entry: Mapping[str, Any]) -> Rule:
        source = str(entry["previous"])
        name = source.removeprefix("out.")
        known = {p.name: p for p in self.node.outputs}
        if name not in known:
            raise observing.Wrong(f"there is no output {source!r}", "previous", hint=suggest(name, known))
        if known[name].sort != port.sort:
            raise observing.Wrong(f"{source} is of another type", "previous")
        told = entry.get("initial")
        initial = None if told is None else observing.literal(told, port.sort, "initial")
        if initial is None and (edge := self.edge(port)) and edge.delayed:
            initial = observing.first_value(self.system, port, edge)
        return Previous(port.variable, f"out.{name}", initial)

    def edge(self, port: Port) -> Edge | None:
        try:
            feeding = dataflow(self.system).feeding(self.node.name) if port.role is Role.INPUT else ()
        except Rejected:
            return None
        return next((e for e in feeding if e.target.port == port.name), None)


_PAIR = "or pair by `latency` or `arrival` (in a second method, for these `guarantees:` alone)"
_FIELD_HINT = "name the field under `mapping`, for instance `in.x: pose.x`"
