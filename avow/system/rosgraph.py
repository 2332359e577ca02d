"""Step 1 of the paper as data: a ROS graph, and how the system model was made from it.

A graph is read from DOT as rqt_graph writes it, from the output of ``rosnode info`` or ``ros2 node info``, or from
plain lines ``a -> b : topic``. The plan says which of its nodes were dropped, which make up a compound node, and which
nodes of the model are on no ROS graph; `account` compares the two, so that no node is lost in between.
"""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected, Severity, Span
from avow.base.files import read_regular
from avow.base.grammars import lark_of, misfit
from avow.base.records import dataclass
from avow.base.suggestions import suggest
from avow.base.tuning.sizes import ROS_GRAPH_BYTES
from avow.ros.drafting import is_plumbing
from avow.ros.listing import is_info, parse_info
from avow.system.graph import Graph
from avow.system.plan import System

_DOT = re.compile(r"(?>\s|(?://|#)[^\n]*|/\*.*?\*/)*+(?:strict\s+)?(?:di)?graph\b[^{>]*\{", re.DOTALL | re.IGNORECASE)
_LINE = re.compile(r"\s*(/?[\w/.-]+)\s*->\s*(/?[\w/.-]+)\s*(?::\s*(\S+))?\s*\Z")


@dataclass(frozen=True, slots=True)
class RosGraph:
    """Nodes without their leading slash; arcs (publisher, subscriber, topic)."""

    nodes: tuple[str, ...]
    arcs: tuple[tuple[str, str, str], ...]


@dataclass(frozen=True, slots=True)
class Account:
    """How a ROS graph became a system model."""

    graph: RosGraph
    home: dict[str, str]
    """ROS node → node of the model."""
    dropped: dict[str, str]
    external: dict[str, str]
    findings: tuple[Diagnostic, ...]


def read_ros_graph(path: Path) -> RosGraph:
    """Raises Rejected, located, for a file in none of the known forms."""
    try:
        data = read_regular(path)[: ROS_GRAPH_BYTES + 1]
        text = data.decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise Rejected(_fault(path, 1, f"the ROS graph cannot be read: {error}")) from None
    if len(data) > ROS_GRAPH_BYTES:
        raise Rejected(_fault(path, 1, f"the ROS graph has more than {ROS_GRAPH_BYTES} bytes"))
    if _DOT.match(text):
        return _from_dot(text, path)
    if is_info(text):
        return _from_info(text)
    return _from_lines(text, path)


def account(system: System, dataflow: Graph) -> Account | None:
    """The plan's `model` checked against its ROS graph; None without a graph. Raises Rejected for an unreadable one."""
    model = system.plan.model.data
    if not isinstance(model, dict) or "graph" not in model:
        return None
    graph = read_ros_graph(system.plan.root / str(model["graph"]))
    dropped: dict[str, str] = dict(model.get("dropped", {}))
    external: dict[str, str] = dict(model.get("external", {}))
    compound = {name: [m] if isinstance(m, str) else list(m) for name, m in dict(model.get("compound", {})).items()}
    known = {node.name for node in system.contract.nodes if not node.relay}
    at = system.plan.model.at
    called = {system.plan.ros.names.placed(name).name.lstrip("/"): name for name in known}
    home: dict[str, str] = {node: called.get(node, node) for node in graph.nodes if node in called or node in known}
    findings: list[Diagnostic] = []
    for name, members in compound.items():
        for k, member in enumerate(members):
            bare = member.lstrip("/")
            if bare not in graph.nodes:
                hint = suggest(bare, graph.nodes)
                message = f"model.compound.{name}: {member!r} is not on the ROS graph"
                findings.append(Diagnostic("PLAN127", message, at("compound", name, k), hint=hint))
            elif home.get(bare, name) != name:
                message = f"model.compound.{name}: {member!r} belongs to {home[bare]} already"
                findings.append(Diagnostic("PLAN127", message, at("compound", name, k)))
            home[bare] = name
    gone = {name.lstrip("/"): why for name, why in dropped.items()}
    for name in gone:
        if name not in graph.nodes:
            message = f"model.dropped: {name!r} is not on the ROS graph"
            findings.append(
                Diagnostic("PLAN127", message, at("dropped", name), Severity.WARNING, suggest(name, graph.nodes))
            )
        elif name in home:
            message = f"model.dropped: {name!r} is also part of {home[name]}"
            findings.append(Diagnostic("PLAN127", message, at("dropped", name)))
    lost = [node for node in graph.nodes if node not in home and node not in gone]
    if lost:
        message = f"on the ROS graph, and neither dropped nor part of a node of the model: {', '.join(lost)}"
        hint = f"model: {{dropped: {{{lost[0]}: why}}}}, or {{compound: {{NODE: [{lost[0]}]}}}}"
        findings.append(Diagnostic("PLAN127", message, at("graph"), Severity.WARNING, hint))
    made = set(home.values()) | set(external)
    for node in system.contract.nodes:
        if node.name not in made and not node.relay:
            message = f"{node.name} is not on the ROS graph, is no compound and is not external"
            findings.append(Diagnostic("PLAN127", message, at("graph"), Severity.WARNING))
    findings += _flows(graph, home, dataflow, at("graph"))
    return Account(graph, home, gone, external, tuple(findings))


def _flows(graph: RosGraph, home: dict[str, str], dataflow: Graph, span: Span) -> Iterator[Diagnostic]:
    """Data that flows between two nodes of the model according to ROS only."""
    linked = {(edge.source.node, edge.target.node) for edge in dataflow.edges}
    linked |= {(one, end) for one, middle in linked for start, end in linked if start == middle in dataflow.relays}
    found: dict[tuple[str, str], dict[str, None]] = {}
    for publisher, subscriber, topic in graph.arcs:
        one, other = home.get(publisher), home.get(subscriber)
        if one and other and one != other and (one, other) not in linked and not is_plumbing(topic):
            found.setdefault((one, other), {})[topic] = None
    for (one, other), topics in found.items():
        message = f"ROS sends {', '.join(topics)} from {one} to {other}; the contracts connect nothing there"
        hint = "give each a port that `matches(…)` it; `avow init --messages FOLDER` drafts those of your own types"
        yield Diagnostic("PLAN127", message, span, Severity.NOTE, hint)


# -- forms -------------------------------------------------------------------------------------------------------------


def _from_dot(text: str, path: Path) -> RosGraph:
    """Boxes, and nodes named as rqt_graph names topics, are topics."""
    try:
        graph = parse_dot(text)
    except Malformed as error:
        raise Rejected(_fault(path, error.line, str(error), error.column)) from None
    topics = {name for name, given in graph.nodes.items() if given.get("shape") == "box" or name.startswith("t_")}
    called = {name: _shown(given.get("label", "\\N"), name) for name, given in graph.nodes.items()}
    bare = {name: label.lstrip("/") for name, label in called.items()}
    heard: dict[str, list[str]] = {}
    for tail, head, _ in graph.arcs:
        if tail in topics and head not in topics:
            heard.setdefault(tail, []).append(head)
    arcs: dict[tuple[str, str, str], None] = {}
    for tail, head, label in graph.arcs:
        if tail not in topics:
            ends = heard.get(head, ()) if head in topics else (head,)
            arcs |= dict.fromkeys((bare[tail], bare[e], called[head] if head in topics else label) for e in ends)
    return RosGraph(tuple(dict.fromkeys(bare[name] for name in graph.nodes if name not in topics)), tuple(arcs))


def _shown(label: str, name: str) -> str:
    """A label with its escapes; `\\N` is the node's name."""
    return re.sub(r"\\(.)", lambda found: name if found[1] == "N" else found[1], label)


def _from_info(text: str) -> RosGraph:
    found = parse_info(text)
    arcs = (
        (p.name.lstrip("/"), s.name.lstrip("/"), topic)
        for p in found.nodes
        for topic in p.publishes
        for s in found.nodes
        if topic in s.subscribes
    )
    return RosGraph(tuple(node.name.lstrip("/") for node in found.nodes), tuple(dict.fromkeys(arcs)))


def _from_lines(text: str, path: Path) -> RosGraph:
    nodes: dict[str, None] = {}
    arcs: dict[tuple[str, str, str], None] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        bare = line.split("#")[0].strip()
        if not bare:
            continue
        found = _LINE.match(bare)
        if found:
            one, other = found[1].lstrip("/"), found[2].lstrip("/")
            nodes.update({one: None, other: None})
            arcs[(one, other, found[3] or "")] = None
        elif re.fullmatch(r"/?[\w/.-]+", bare):
            nodes[bare.lstrip("/")] = None
        else:
            raise Rejected(_fault(path, number, "neither DOT, nor `ros2 node info`, nor a line `a -> b : topic`"))
    return RosGraph(tuple(nodes), tuple(arcs))


def _fault(path: Path, line: int, message: str, column: int = 1) -> Diagnostic:
    return Diagnostic("PLAN127", message, Span(str(path), line, column, line, column + 1))


# -- DOT ---------------------------------------------------------------------------------------------------------------


class Malformed(Exception):  # noqa: N818 - it names what the text is
    """Not a graph in DOT, or one nested too deeply; line and column count from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1) -> None:
        super().__init__(message)
        self.line, self.column = line, column


@dataclass(frozen=True, slots=True)
class DotGraph:
    """Nodes by name, each with its attributes; arcs as (tail, head, label)."""

    nodes: dict[str, dict[str, str]]
    arcs: list[tuple[str, str, str]]


def parse_dot(text: str) -> DotGraph:
    """Nodes with their attributes, and arcs. Raises Malformed."""
    from lark.exceptions import UnexpectedInput

    found = DotGraph({}, [])
    try:
        grammar = Path(__file__).with_name("dot.lark")
        _inside(lark_of(grammar, "dot", ("start",), maybe_placeholders=False).parse(text), found, {}, {})
    except UnexpectedInput as error:
        word, _ = misfit(error, text)
        if not word:
            raise Malformed("the graph ends too early for DOT", text.count("\n") + 1) from None
        raise Malformed(f"{word[:40]!r} does not belong in a DOT graph", error.line, error.column) from None
    except RecursionError:
        raise Malformed("the graph is nested too deeply") from None
    return found


def _inside(tree: Any, found: DotGraph, nodes: Mapping[str, str], arcs: Mapping[str, str]) -> dict[str, None]:
    """The names of the nodes of a graph or subgraph; `nodes` and `arcs`: the attributes common to all so far."""
    here: dict[str, None] = {}
    for statement in tree.children:
        match getattr(statement, "data", ""):
            case "defaults":
                kind, *given = statement.children
                nodes = {**nodes, **_attributes(given)} if kind.type == "NODE" else nodes
                arcs = {**arcs, **_attributes(given)} if kind.type == "EDGE" else arcs
            case "chain":
                parts = [part for part in statement.children if part.data != "attributes"]
                given = _attributes(part for part in statement.children if part.data == "attributes")
                ends = [_end(part, found, nodes, arcs) for part in parts]
                here |= {name: None for end in ends for name in end}
                if parts[0].data == "node" and len(parts) == 1:
                    found.nodes[next(iter(ends[0]))] |= given
                for tails, heads in pairwise(ends):
                    label = {**arcs, **given}.get("label", "")
                    found.arcs.extend((tail, head, label) for tail in tails for head in heads)
    return here


def _end(part: Any, found: DotGraph, nodes: Mapping[str, str], arcs: Mapping[str, str]) -> dict[str, None]:
    """An end of an arc: a node, whatever the port, or all nodes of a subgraph."""
    if part.data == "subgraph":
        return _inside(part, found, nodes, arcs)
    name = _text(part.children[0])
    found.nodes.setdefault(name, dict(nodes))
    return {name: None}


def _attributes(parts: Iterable[Any]) -> dict[str, str]:
    words = [word for part in parts for word in part.children]
    return {_text(name): _seen(value) for name, value in zip(words[::2], words[1::2], strict=True)}


def _seen(value: Any) -> str:
    """The text of HTML that a reader sees."""
    text = _text(value)
    return html.unescape(re.sub(r"<[^<>]*>", "", text)) if value.children[0].type == "HTML" else text


def _text(word: Any) -> str:
    """In a string only `\\"` and a continued line are escapes; the others belong to the label."""
    first = word.children[0]
    if first.type != "STRING":
        return first[1:-1] if first.type == "HTML" else str(first)
    return re.sub(r"\\(.)", _escaped, "".join(part[1:-1] for part in word.children), flags=re.DOTALL)


def _escaped(found: re.Match[str]) -> str:
    return {'"': '"', "\n": ""}.get(found[1], found[0])
