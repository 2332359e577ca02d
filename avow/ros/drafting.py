"""A first contract and plan from a running graph or a recording: nodes, ports, topics, types and the mapping, for a
person to correct. The draft states what exists; it does not guess what a node guarantees.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, assert_never

from avow.base.graphs import components, cycles_in
from avow.base.tuning.shown import DRAFTED_FIELDS, DRAFTED_WORDS
from avow.ros.bags import message_of
from avow.ros.calls import is_part, named, pairing
from avow.ros.definitions import FLOATS, INTEGERS, Array, Definitions, Message, Nested, Scalar, Wire, definition_file
from avow.ros.listing import Listed, Listing
from avow.ros.quality import Recorded

Path = tuple[str, ...]

_LISTENS = "it only listens, and a node without outputs has no guarantee"
_TOOLS = {
    r"/(rosout|record_\d+|rosbag2?_.*|play_\d+)": "records, plays or logs",
    r"/(rqt_.*|rviz2?(_.*)?|_ros2cli.*|rostopic_.*|foxglove_bridge.*)": "shows what others publish",
}
"""Nodes that are tools, and their purpose."""
_PLUMBING = re.compile(r"/(rosout|rosout_agg|parameter_events|clock)\Z|.*/_|.*/parameter_(descriptions|updates)\Z")
"""Topics for ROS's internal use."""


@dataclass(slots=True)
class Seen:
    """The values in a record of one field: for comments, never for a contract."""

    count: int = 0
    least: float = math.inf
    greatest: float = -math.inf
    odd: Counter[str] = field(default_factory=Counter)
    """NaN, infinities and empty arrays."""
    words: dict[str, None] = field(default_factory=dict)

    def note(self, value: Any) -> None:
        self.count += 1
        if isinstance(value, str):
            if len(self.words) <= DRAFTED_WORDS:
                self.words[value[:40]] = None
        elif isinstance(value, list):
            if not value:
                self.odd["empty"] += 1
        elif isinstance(value, float) and not math.isfinite(value):
            self.odd["NaN" if math.isnan(value) else "inf"] += 1
        elif isinstance(value, int | float):
            self.least, self.greatest = min(self.least, value), max(self.greatest, value)

    def says_nothing(self) -> bool:
        """Whether there was no reading at all."""
        return self.count > 0 and self.odd.total() == self.count

    def __str__(self) -> str:
        parts = []
        if self.least <= self.greatest:
            parts.append(f"{self.least:g}" if self.least == self.greatest else f"{self.least:g} … {self.greatest:g}")
        parts += [f"{count} × {word}" for word, count in self.odd.items()]
        if self.words:
            more = ", …" if len(self.words) > DRAFTED_WORDS else ""
            parts.append(", ".join(json.dumps(w, ensure_ascii=False) for w in [*self.words][:DRAFTED_WORDS]) + more)
        return ", ".join(parts)


@dataclass(frozen=True, slots=True)
class Drafted:
    """The texts of a draft."""

    contract: str
    plan: str
    unknown: tuple[str, ...]
    """The files that are not known, of the types of topics that have no ports."""


@dataclass(frozen=True, slots=True)
class Given:
    """The input of a draft. `origin`: in words; `traces`: paths in the folder, each with its digest; `graph`: the
    digest of the graph's text, if there is one."""

    name: str
    origin: str
    listing: Listing
    known: Definitions
    keywords: frozenset[str]
    ros2: bool = False
    distro: str | None = None
    traces: Mapping[str, str] = field(default_factory=dict)
    graph: str | None = None
    messages: Mapping[str, str] = field(default_factory=dict)
    """The files of definitions that the draft has, by their paths below `msg`."""
    seen: Mapping[tuple[str, Path], Seen] = field(default_factory=dict)
    unsaid: frozenset[str] = frozenset()
    """Nodes that are drafted as publishers without the record's confirmation."""
    ends: tuple[Recorded, ...] = ()
    """Publishers and subscribers with their quality of service."""


@dataclass(frozen=True, slots=True)
class _Port:
    """A value that a topic carries: the port's name and type, and how it is read."""

    name: str
    type_name: str
    mapping: str
    comment: str


UNNAMED = "/robot"
"""The node that is drafted with the topics whose names identify no node."""


def by_names(topics: Iterable[str], heard: Iterable[str]) -> dict[str, list[str]]:
    """The nodes that a record without publishers suggests, each with its topics: the node (of those that the record
    names in its log) whose name is a prefix of the topic's, otherwise the part before the topic's last."""
    nodes = sorted(heard, key=len, reverse=True)
    found: dict[str, list[str]] = {}
    for topic in topics:
        said = next((node for node in nodes if topic.startswith(f"{node}/")), "")
        found.setdefault(said or named(topic).rpartition("/")[0] or UNNAMED, []).append(topic)
    return found


def draft(given: Given) -> Drafted:
    """The contract and the plan."""
    return _Draft(given).made()


def is_plumbing(topic: str) -> bool:
    """Whether a topic is for ROS's internal use, or holds a client's view of a call whose server's view is drafted."""
    if is_part(topic):
        return topic.endswith(("/_request_sent", "/_response_received"))
    return _PLUMBING.match(topic) is not None


@dataclass(slots=True)
class _Draft:
    given: Given
    taken: set[str] = field(default_factory=set)
    types: dict[str, str] = field(default_factory=dict)
    """Declared types: name → definition."""
    elements: set[str] = field(default_factory=set)
    ports: dict[str, tuple[_Port, ...]] = field(default_factory=dict)
    """Topic → the values that it carries."""
    silent: dict[str, list[str]] = field(default_factory=dict)
    """Topic → the fields that never had a reading, and their values: they become no ports."""
    unknown: set[str] = field(default_factory=set)
    """The files that would define types that are not known."""
    told: bool = False
    """Whether the traces have been written in full."""

    def made(self) -> Drafted:
        nodes, dropped = self.nodes()
        topics = dict.fromkeys(t for n in nodes.values() for t in (*n.publishes, *n.subscribes) if not is_plumbing(t))
        spoken = {topic: topic.replace("/_", "_") if is_part(topic) else topic for topic in topics}
        short = _short(spoken.values(), self.given.keywords)
        for topic in topics:
            self.ports[topic] = tuple(self.of_topic(topic, short[spoken[topic]]))
        bodies = "\n".join(self.node(name, node) for name, node in nodes.items())
        context = "".join(f"  {name} : {what};\n" for name, what in self.types.items())
        head = (
            f"// Drafted from {self.given.origin}. It says what is there, and nothing of what the nodes promise:\n"
            "// replace each guarantee `to_write`, remove the ports that no clause needs, and say what is assumed.\n\n"
        )
        whole = head + (f"context {{\n{context}}}\n\n" if context else "") + bodies
        return Drafted(whole, self.plan(nodes, dropped), tuple(sorted(self.unknown)))

    def nodes(self) -> tuple[dict[str, Listed], dict[str, str]]:
        """The nodes to model, by their names in the contract; and those that are tools, with the reason."""
        kept: list[Listed] = []
        dropped: dict[str, str] = {}
        for node in self.given.listing.nodes:
            why = next((why for form, why in _TOOLS.items() if re.fullmatch(form, node.name)), None)
            answers = (*node.serves, *node.calls, *node.does, *node.orders)
            if why is None and node.subscribes and not answers and all(map(is_plumbing, node.publishes)):
                why = _LISTENS
            if why is None:
                kept.append(node)
            else:
                dropped[node.name] = why
        if not kept:
            kept = [node for node in self.given.listing.nodes if dropped.get(node.name) == _LISTENS]
        dropped = {name: why for name, why in dropped.items() if all(node.name != name for node in kept)}
        short = _short([node.name for node in kept], self.given.keywords)
        return {short[node.name]: node for node in kept}, dropped

    # -- ports ---------------------------------------------------------------------------------------------------------

    def of_topic(self, topic: str, short: str) -> Iterator[_Port]:
        kind = self.given.listing.types.get(topic, "")
        message = self.given.known.get(kind) if kind else None
        missing = self.given.known.missing(message) if message is not None else (kind,) if kind else ()
        self.unknown.update(definition_file(each)[0] for each in missing)
        if message is None or missing:
            return
        leaves = [leaf for leaf in self.given.known.leaves(message) if self.sort(leaf[1]) is not None]
        for path, wire, holder in leaves[:DRAFTED_FIELDS]:
            seen = self.given.seen.get((topic, path))
            if seen is not None and seen.says_nothing():
                self.silent.setdefault(topic, []).append(f"{'.'.join(path)} ({seen})")
                continue
            name = short if len(leaves) == 1 else f"{short}_{'_'.join(path)}"
            yield self.port(topic, self.free(name), path, wire, holder)

    def port(self, topic: str, name: str, path: Path, wire: Wire, holder: Message) -> _Port:
        dotted = ".".join(path)
        seen = self.given.seen.get((topic, path))
        said = f"{wire} {dotted}" + (f", recorded: {seen}" if seen is not None and str(seen) else "")
        if isinstance(wire, Array):
            take = "min" if isinstance(wire.item, Scalar) and wire.item.name in FLOATS else "count"
            mapping = f"{{field: {dotted}, take: {take}}}"
            hint = "; `nan: none, inf: none, elsewhere: …` leaves those out" if take == "min" else ""
            return _Port(name, self.sort(wire) or "", mapping, f"the {take} of {said}{hint}")
        constants = _constants(wire, path[-1], holder)
        if constants:
            return self.enumeration(name, dotted, constants, said)
        mapping = dotted
        if seen is not None and seen.odd:
            said += "; with `{nan: none, inf: none, elsewhere: …}` those are no reading"
        return _Port(name, self.sort(wire) or "", mapping, said)

    def enumeration(self, name: str, dotted: str, constants: Mapping[str, str], said: str) -> _Port:
        """A number whose meaning the definition gives."""
        elements: dict[str, str] = {}
        for constant, word in constants.items():
            element = word.lower()
            if element in self.elements | self.given.keywords or not element.isidentifier():
                element = f"{name}_{element}"
            self.elements.add(element)
            elements[constant] = element
        type_name = self.free(name[:1].upper() + name[1:])
        self.types[type_name] = f"{{{', '.join(elements.values())}}}"
        values = ", ".join(f"{constant}: {element}" for constant, element in elements.items())
        return _Port(name, type_name, f"{{field: {dotted}, values: {{{values}}}}}", said)

    def sort(self, wire: Wire) -> str | None:
        """The type in the contract; None if it is not drafted."""
        match wire:
            case Array(item=Scalar(name=name)) if name in FLOATS:
                return "REAL"
            case Array():
                return "NATURAL"
            case Scalar(name=name) if name in FLOATS or name in ("time", "duration"):
                return "REAL"
            case Scalar(name=name) if name in INTEGERS:
                return "NATURAL" if name.startswith("u") else "INTEGER"
            case Scalar(name="bool"):
                return "BOOL"
            case Scalar():
                return "STRING"
            case Nested():  # a message within a message: its fields are drafted
                return None
            case _:
                assert_never(wire)

    def free(self, name: str) -> str:
        found, count = name, 1
        while found in self.taken or found in self.given.keywords:
            count += 1
            found = f"{name}_{count}"
        self.taken.add(found)
        return found

    # -- texts ---------------------------------------------------------------------------------------------------------

    def node(self, name: str, node: Listed) -> str:
        published = [t for t in node.publishes if not is_plumbing(t)]
        heard = [t for t in node.subscribes if not is_plumbing(t) and t not in published]
        own = [t for t in node.subscribes if t in published]
        lines = [f"node {name} {{"]
        if node.name in self.given.unsaid:
            by = "the names of these topics suggest this node" if node.name != UNNAMED else "nor do these topics' names"
            lines.insert(0, f"// The record does not say who publishes: {by}. Correct it, or draft with --from-graph.")
        lines += [f"  // {topic}: it hears what it publishes itself, which wants a delayed connection" for topic in own]
        for topic in (*heard, *published):
            if topic in self.silent:
                lines.append(f"  // {topic}, left out for want of a reading: {', '.join(self.silent[topic])}")
        lines += self.side("inputs", heard) + self.side("outputs", published)
        topics = [*self.topics(heard, "in"), *self.topics(published, "out")]
        lines.append("  topics(" + ("\n    " + ",\n    ".join(topics) + "\n  )" if topics else " )"))
        if len(offered := {self.deadline(topic, True, node.name) for topic in published}) == 1 and any(offered):
            lines.append(f"  // steps( at most {offered.pop()} )  as it offers this deadline on all that it publishes")
        for topic in (t for t in heard if self.ports[t] and self.deadline(t, False, node.name)):
            name, asked = self.ports[topic][0].name, self.deadline(topic, False, node.name)
            formula = f"( once[{asked}](arrived(in.{name})) )"
            lines.append(f"  // assume alive_{name} {formula}  as it requests this deadline of {topic}")
        lines.append('  guarantee to_write "What this node promises is still to be written" ( TRUE )')
        return "\n".join([*lines, "}", ""])

    def deadline(self, topic: str, publishes: bool, node: str = "") -> str:
        """The shortest deadline of the node's end (or of any) of a topic, as a length of time; empty if there is
        none."""
        ends = (e for e in self.given.ends if (e.topic, e.publishes) == (topic, publishes) and e.quality.deadline)
        known = [e.quality.deadline or math.inf for e in ends if not node or e.node in ("", node)]
        least = min(known, default=math.inf)
        return "" if least == math.inf else f"{least * 1000:.6f}".rstrip("0").rstrip(".") + " ms"

    def side(self, word: str, topics: Iterable[str]) -> list[str]:
        ports = [port for topic in topics for port in self.ports[topic]]
        if not ports:
            return [f"  {word}( )"]
        last = len(ports) - 1
        return [
            f"  {word}(",
            *(
                f"    {p.name} : {p.type_name}{',' if k < last else ''}  // {_line(p.comment)}"
                for k, p in enumerate(ports)
            ),
            "  )",
        ]

    def topics(self, topics: Iterable[str], role: str) -> Iterator[str]:
        for topic in topics:
            kind = self.given.listing.types.get(topic) or "unknown/Type"
            if not self.ports[topic]:
                yield f"{kind} {named(topic)}"
            for port in self.ports[topic]:
                yield f"{kind} {named(topic)} matches({role}.{port.name})"

    def plan(self, nodes: Mapping[str, Listed], dropped: Mapping[str, str]) -> str:
        given = self.given
        lines = [
            f"# Drafted from {_line(given.origin)}: for you to correct.",
            f"system: {given.name}",
            *(["messages: [msg]"] if given.messages else []),
            "",
            "ros:",
            *([f"  distro: {given.distro}"] if given.distro else []),
            *(["  qos: models/qos.txt"] if given.listing.qos else []),
            "  nodes:",
            *(f"    {name}: {{name: {json.dumps(node.name)}}}" for name, node in nodes.items()),
        ]
        if given.graph is not None:
            lines += ["", "model:", f"  graph: {given.graph}"]
            if dropped:
                lines += ["  dropped:", *(f"    {json.dumps(name)}: {why}" for name, why in dropped.items())]
        lines += ["", *self.environment(nodes), *self.loops(nodes), "nodes:"]
        stamps = [arc for arc, topics in self.carried(nodes).items() if any(map(self.stamped, topics))]
        looped = {name for part in components(nodes, stamps) if len(part) > 1 for name in part}
        for name, node in nodes.items():
            lines += self.methods(name, node, name in looped)
        return "\n".join([*lines, ""])

    def environment(self, nodes: Mapping[str, Listed]) -> list[str]:
        published = {topic for node in nodes.values() for topic in node.publishes}
        open_ = dict.fromkeys(t for n in nodes.values() for t in n.subscribes if t not in published)
        ports = [(topic, port.name) for topic in open_ if topic in self.ports for port in self.ports[topic]]
        if not ports:
            return []
        return [
            "# environment:                         # what no node publishes: what may be assumed of it, and why",
            *(f"#   in.{name}: {{assume: {self.assumed(topic, name)}}}  # {topic}" for topic, name in ports),
            "",
        ]

    def assumed(self, topic: str, name: str) -> str:
        offered = self.deadline(topic, True)
        formula = f"once[{offered}](arrived(in.{name}))" if offered else "…"
        return f'"{formula}", because: "{"its publisher offers this deadline" if offered else "…"}"'

    def loops(self, nodes: Mapping[str, Listed]) -> list[str]:
        """For each loop the connection to delay: a person says what was there before the first step."""
        carried = self.carried(nodes)
        backs: dict[tuple[str, str], None] = {}
        parts = components(nodes, carried)
        while cycles := [c for part in parts for c in cycles_in(part, (arc for arc in carried if arc not in backs))]:
            backs |= {(cycle[-1], cycle[0]): None for cycle in cycles}
        said = ((a, p.name, b, topic) for a, b in backs for topic in carried[a, b] for p in self.ports[topic])
        lines = [
            f"#   - {{from: {a}.{p}, to: {b}.{p}, delayed: true, initial: …}}  # {topic}" for a, p, b, topic in said
        ]
        head = "# connections:                         # in a loop: say what was there before the first step"
        return [head, *lines, ""] if lines else []

    def carried(self, nodes: Mapping[str, Listed]) -> dict[tuple[str, str], list[str]]:
        """The topics from each node to each other."""
        heard = {t: [n for n, x in nodes.items() if t in x.subscribes] for t, ports in self.ports.items() if ports}
        found: dict[tuple[str, str], list[str]] = {}
        for name, node in nodes.items():
            for topic, other in ((t, b) for t in node.publishes for b in heard.get(t, ()) if b != name):
                found.setdefault((name, other), []).append(topic)
        return found

    def methods(self, name: str, node: Listed, looped: bool) -> list[str]:
        sides = (("in", node.subscribes), ("out", node.publishes))
        entries: dict[str, str] = {}
        for role, topics in sides:
            for topic in topics:
                if role == "out" or topic not in node.publishes:
                    entries |= {f"{role}.{port.name}": port.mapping for port in self.ports.get(topic, ())}
        lines = [f"  {name}:", "    criticality: medium"]
        if not entries:
            return [*lines, "    methods: []"]
        lines += ["    mapping:", *(f"      {key}: {value}" for key, value in entries.items())]
        lines += ["    methods:", "      - rosmonitoring:", f"          ros_version: ros{2 if self.given.ros2 else 1}"]
        if self.given.traces:
            lines.append(f"          traces: {self.recordings()}")
        if any(key.startswith("in.") for key in entries) and any(key.startswith("out.") for key in entries):
            lines += [
                "          # Which input did an answer answer? Until this is said, what is judged is no evidence:",
                f"          # answers: {self.answers(node, looped)}",
            ]
        return lines

    def recordings(self) -> str:
        """The traces: in full the first time, later by reference."""
        if self.told:
            return "*recordings"
        self.told = True
        told = (f"{{path: {json.dumps(path)}, sha256: {digest}}}" for path, digest in self.given.traces.items())
        return f"&recordings [{', '.join(told)}]"

    def stamped(self, topic: str) -> bool:
        return self.given.known.stamped(self.given.listing.types.get(topic, ""))

    def answers(self, node: Listed, looped: bool) -> str:
        topics = [t for t in (*node.subscribes, *node.publishes) if self.ports.get(t)]
        kinds = {t: self.given.listing.types.get(t, "") for t in topics}
        return pairing(kinds, self.given.known, looped=looped)


def _constants(wire: Wire, name: str, holder: Message) -> dict[str, str]:
    """The constants that give the meaning of an integer, each with its word: those whose names begin with the field's;
    otherwise all, if the message has only one such number."""
    if not isinstance(wire, Scalar) or wire.name not in INTEGERS:
        return {}
    kinds = [(constant, value) for constant, kind, value in holder.constants if kind == wire.name]
    prefix = f"{name.upper()}_"
    mine = {c: (c.removeprefix(prefix), value) for c, value in kinds if c.startswith(prefix)}
    if not mine and [f.wire for f in holder.fields].count(wire) == 1:
        mine = {c: (c, value) for c, value in kinds}
    values = [value for _, value in mine.values()]
    return {c: word for c, (word, _) in mine.items()} if len(mine) > 1 and len(set(values)) == len(values) else {}


def _short(names: Iterable[str], keywords: frozenset[str]) -> dict[str, str]:
    """For each ROS name one that the contract may use: its last part, with the parts before it if they are needed to
    distinguish two."""
    every = list(names)
    parts = {name: re.sub(r"[^A-Za-z0-9_/]", "_", name).strip("/").split("/") for name in every}
    found: dict[str, str] = {}
    for name in every:
        depth = 1
        while depth < len(parts[name]) and any(
            other != name and parts[other][-depth:] == parts[name][-depth:] for other in every
        ):
            depth += 1
        word = "_".join(parts[name][-depth:])
        word = word if word[:1].isalpha() or word[:1] == "_" else f"n{word}"
        word = f"{word}_" if word in keywords else word
        while word in found.values():
            word += "_"
        found[name] = word
    return found


def _line(text: str) -> str:
    """Text of a record as part of one line."""
    return " ".join(text.split())


def watch(known: Definitions, types: Mapping[str, str]) -> tuple[dict[tuple[str, Path], Seen], Callable[[Any], None]]:
    """The values in a record of each field that may be drafted, and a function to call with each of its messages."""
    seen: dict[tuple[str, Path], Seen] = {}
    paths: dict[str, list[Path]] = {}
    for topic, kind in types.items():
        message = known.get(kind)
        if message is None or known.missing(message) or is_plumbing(topic):
            continue
        leaves = [path for path, wire, _ in known.leaves(message) if isinstance(wire, Scalar | Array)]
        paths[topic] = leaves[:DRAFTED_FIELDS]
        seen |= {(topic, path): Seen() for path in paths[topic]}

    def note(event: Any) -> None:
        for path in paths.get(event["topic"], ()):
            value = message_of(event, str(path[0]))
            for step in path:
                value = value.get(step) if isinstance(value, dict) else None
            seen[event["topic"], path].note(value)

    return seen, note
