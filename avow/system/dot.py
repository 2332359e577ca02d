"""Graphs in DOT, the form of Graphviz, rqt_graph and others: nodes with their attributes, and arcs."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from avow.base.grammars import lark_of
from avow.base.records import dataclass
from avow.base.tuning.sizes import ROS_GRAPH_ARCS


class Malformed(Exception):  # noqa: N818 - it names what the text is
    """No graph in DOT, or one beyond all measure; line and column count from 1."""

    def __init__(self, message: str, line: int = 1, column: int = 1) -> None:
        super().__init__(message)
        self.line, self.column = line, column


@dataclass(frozen=True, slots=True)
class DotGraph:
    """Nodes by their names, each with its attributes; arcs as (tail, head, label)."""

    nodes: dict[str, dict[str, str]]
    arcs: list[tuple[str, str, str]]


def parse(text: str) -> DotGraph:
    """Raises Malformed."""
    from lark.exceptions import UnexpectedInput

    found = DotGraph({}, [])
    try:
        grammar = Path(__file__).with_name("dot.lark")
        _inside(lark_of(grammar, "dot", ("start",), maybe_placeholders=False).parse(text), found, {}, {})
    except UnexpectedInput as error:
        rest = text[error.pos_in_stream or 0 :].split(maxsplit=1)
        if not rest or getattr(getattr(error, "token", None), "type", "") == "$END":
            raise Malformed("the graph ends too early for DOT", text.count("\n") + 1) from None
        raise Malformed(f"{rest[0][:40]!r} does not belong in a DOT graph", error.line, error.column) from None
    except RecursionError:
        raise Malformed("the graph is nested too deeply") from None
    return found


def _inside(tree: Any, found: DotGraph, nodes: Mapping[str, str], arcs: Mapping[str, str]) -> dict[str, None]:
    """The names of the nodes of a graph or subgraph; `nodes` and `arcs`: attributes that all there have so far."""
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
                    if len(found.arcs) + len(tails) * len(heads) > ROS_GRAPH_ARCS:
                        raise Malformed(f"the graph has more than {ROS_GRAPH_ARCS} arcs")
                    label = {**arcs, **given}.get("label", "")
                    found.arcs.extend((tail, head, label) for tail in tails for head in heads)
    return here


def _end(part: Any, found: DotGraph, nodes: Mapping[str, str], arcs: Mapping[str, str]) -> dict[str, None]:
    """What an arc begins or ends with: a node, whatever the port, or all nodes of a subgraph."""
    if part.data == "subgraph":
        return _inside(part, found, nodes, arcs)
    name = _text(part.children[0])
    found.nodes.setdefault(name, dict(nodes))
    return {name: None}


def _attributes(parts: Iterable[Any]) -> dict[str, str]:
    words = [word for part in parts for word in part.children]
    return {_text(name): _shown(value) for name, value in zip(words[::2], words[1::2], strict=True)}


def _shown(value: Any) -> str:
    """Of HTML what a reader sees."""
    text = _text(value)
    return html.unescape(re.sub(r"<[^<>]*>", "", text)) if value.children[0].type == "HTML" else text


def _text(word: Any) -> str:
    """In a string only `\\"` and a line that goes on are escapes; the others are the label's."""
    first = word.children[0]
    if first.type != "STRING":
        return first[1:-1] if first.type == "HTML" else str(first)
    return re.sub(r"\\(.)", _escaped, "".join(part[1:-1] for part in word.children), flags=re.DOTALL)


def _escaped(found: re.Match[str]) -> str:
    return {'"': '"', "\n": ""}.get(found[1], found[0])
