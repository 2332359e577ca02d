"""Graphs in DOT are read as Graphviz reads them, and what is none is told with its place."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
from pathlib import Path

import pytest
from helpers import some

from avow.base.diagnostics import Rejected
from avow.system.rosgraph import Malformed, RosGraph, parse_dot, read_ros_graph

IDS = [
    "a",
    "b2",
    "Graphite",
    "nodes",
    "_",
    "é",
    '"a"',
    '"x y"',
    '"q\\"q"',
    '"b" + "2"',
    "-1.5",
    ".5",
    '"node"',
    '"a\\\nb"',
]
IDS += ['"\\N\\\\"', '"->{};[]"', "<h>", "<<i>t</i>>"]
SPACE = [" ", "\n", "\t", " /* } -> { */ ", " // [ {\n", "\n# [ {\n"]


def graph(rng: random.Random) -> str:
    """Words with anything between them: mostly a graph."""
    words = [rng.choice(["", "strict", "STRICT"]), rng.choice(["digraph", "DiGraph"]), rng.choice(["", "g", '"{"'])]
    return "".join(word + rng.choice(SPACE) for word in [*words, "{", *statements(rng, 3), "}"])


def statements(rng: random.Random, depth: int) -> list[str]:
    found: list[str] = []
    for _ in range(rng.randrange(5)):
        kind = rng.randrange(5)
        if kind == 0:
            found += [rng.choice(["node", "NODE", "edge", "graph"]), *attributes(rng)]
        elif kind == 1:
            found += [rng.choice(["rank", "label"]), "=", rng.choice(IDS)]
        else:
            chain = [end(rng, depth) for _ in range(rng.choice((1, 1, 2, 3)))]
            given = attributes(rng) if len(chain) > 1 or chain[0][0] in IDS else []
            found += [*chain[0], *(w for e in chain[1:] for w in ("->", *e)), *given]
        found += rng.choice(([], [";"]))
    return found


def end(rng: random.Random, depth: int) -> list[str]:
    if depth and rng.random() < 0.3:
        named = rng.choice(([], ["subgraph"], ["Subgraph", f"s{rng.randrange(10**9)}"]))
        return [*named, "{", *statements(rng, depth - 1), "}"]
    return [rng.choice(IDS), *rng.choice(([], [":", "p"], [":", "p", ":", "n"]))]


def attributes(rng: random.Random) -> list[str]:
    given = rng.sample(["shape=box", "shape = ellipse", 'shape="box"', "colour=red", 'label="x"', "label=<y>"], 2)
    return rng.choice(([], ["[", "]"], ["[", given[0], rng.choice(",;"), given[1], "]"], ["[", *given, "]", "[", "]"]))


def as_graphviz(text: str) -> tuple[dict[str, str], set[tuple[str, str]]] | None:
    told = subprocess.run(["dot", "-Tdot_json"], input=text.encode(), capture_output=True, check=False)
    if told.returncode:
        return None
    data = json.loads(told.stdout)
    nodes = {o["_gvid"]: o for o in data.get("objects", [])[data["_subgraph_cnt"] :]}
    arcs = {(nodes[e["tail"]]["name"], nodes[e["head"]]["name"]) for e in data.get("edges", [])}
    return {o["name"]: o.get("shape", "") for o in nodes.values()}, arcs


def as_read(text: str) -> tuple[dict[str, str], set[tuple[str, str]]] | None:
    try:
        found = parse_dot(text)
    except Malformed:
        return None
    shapes = {name: given.get("shape", "") for name, given in found.nodes.items()}
    return shapes, {(tail, head) for tail, head, _ in found.arcs}


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not here")
@pytest.mark.parametrize("seed", some(range(300), 10))
def test_it_is_read_as_graphviz_reads_it(seed: int) -> None:
    text = graph(random.Random(seed))
    assert as_read(text) == as_graphviz(text), text


def read(folder: Path, text: str) -> RosGraph:
    (folder / "graph").write_text(text)
    return read_ros_graph(folder / "graph")


@pytest.mark.parametrize(
    "text",
    [
        "digraph\n{ subgraph cluster_x { node [shape=box]; t } a -> t -> {b c} }",
        '/* graph { */ strict DIGRAPH "}" { t [shape=box, label=<<b>t</b>>] a:out -> t; t -> b:in:n; t -> c // -> d\n}',
        '\ufeffgraph g { "a" -- t_ [label="no"]; t_ [label="/" + "t"] t_ -- b -- a; t_ -- c; b [label="\\N"] }',
    ],
)
def test_topics_are_boxes_whatever_the_spelling(tmp_path: Path, text: str) -> None:
    found = read(tmp_path, text)
    assert {("a", "b", "t"), ("a", "c", "t")} <= {(one, other, topic.lstrip("/")) for one, other, topic in found.arcs}
    assert set(found.nodes) == {"a", "b", "c"}


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        ("digraph {\n a -> /b }", 2, "'/b' does not belong"),
        ("digraph {\n a ->", 2, "too early"),
        ('digraph {\n\n a -> "b }', 3, "does not belong"),
        ("digraph { /* a", 1, "does not belong"),
        ("digraph { a }\ndigraph { b }", 2, "does not belong"),
        ("digraph { a [label] }", 1, "does not belong"),
        ("digraph " + "{" * 20_000 + "}" * 20_000, 1, "too deeply"),
        ("/* */" * 50_000 + "x", 1, "neither DOT"),
        ("digraph { a [label=<" + "<" * 50_000 + ">] }", 1, "does not belong"),
    ],
    ids=range(9),
)
def test_what_is_no_graph_is_told_with_its_place(tmp_path: Path, text: str, line: int, said: str) -> None:
    with pytest.raises(Rejected, match=said) as told:
        read(tmp_path, text)
    (found,) = told.value.diagnostics
    assert found.code == "PLAN127"
    assert found.span is not None
    assert found.span.line == line
