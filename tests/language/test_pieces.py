"""A contract read node by node, most of it kept from earlier runs, is the contract read whole, places and lints too."""

from __future__ import annotations

import dataclasses
import random
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
from helpers import some

from avow.base.notes import cache_folder, sealed
from avow.base.remembered import Shelf, by_identity
from avow.language.contract import Node
from avow.language.load import _whole
from avow.language.pieces import by_pieces
from avow.language.source import Source
from avow.language.subterms import subterms

ROOT = Path(__file__).parents[2]
CONTEXT = """// avow: allow RCL405
context {
  Mode : {idle, busy(NATURAL)};
  LIMIT = 3;
  Near = {1, 2};
  define calm(i : INTEGER) = in.x >= i and LIMIT > 1;
  define unused = TRUE;
}
"""
NODES = [
    """  node a { // its first line
  inputs( x : INTEGER, m : Mode )
  outputs( y : INTEGER )
  topics( pkg/Int at matches(in.x), pkg/Int to matches(out.y) )
  define high = in.x > LIMIT;
  assume in1 "x is not large" ( in.x < 100 )
  guarantee ( calm(2) and high -> out.y == in.x + LIMIT )
  guarantee g2 ( forall(i in Near | in.x == i -> out.y > i) )
}
""",
    """node b {
  inputs( y : INTEGER ) outputs( z : REAL ) topics()
  // avow: allow RCL403
  guarantee ( in.y == 1 -> 1 == in.y )
  guarantee late ( once[2 steps](in.y > 1) -> out.z >= 0.5 or out.z < 1 and out.z > 0 )
}
""",
    """
/* of c */ // avow: allow RCL402
node c {
  inputs( z : REAL, unheard : BOOL )
  outputs( w : BOOL )
  topics()
  guarantee ( in.z > 1 -> out.w )
}
""",
    """node d {
  inputs( z : REAL ) outputs( v : BOOL ) topics( pkg/Bool v )
  guarantee ( out.v <=> in.z > 0.25 )
  guarantee says "a \\"node x {\\" in a sentence" ( out.v or not out.v )
}
""",
]


WORDS = [("x", "u"), ("node b", "node bb"), ("Near", "Far"), ("y", "z"), (": BOOL", ": { red, green }")]
ODD = ["node", "node e {", "}", "/*", "context {", '"', "  node'", "µ", "define d = 1;"]


def told(value: Any) -> Any:
    """All of it, with what does not count in equality."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return type(value).__name__, [told(getattr(value, f.name)) for f in dataclasses.fields(value)]
    if isinstance(value, Mapping):
        return {key: told(each) for key, each in value.items()}
    return [told(each) for each in value] if isinstance(value, tuple | list) else value


def edited(text: str, draw: random.Random) -> str:
    """One edit of a text, sensible or not."""
    lines = text.split("\n")
    at = draw.randrange(len(lines))
    match draw.randrange(9):
        case 0:
            lines.insert(at, draw.choice(["", "// a remark", "/* two\n   lines */", "// avow: allow RCL401, RCL999"]))
        case 1:
            lines[at] += draw.choice([" ", " // a remark", " /* node q { */", " // avow: allow RCL402"])
        case 2:
            lines[at] = lines[at].replace(draw.choice("0123456789"), draw.choice("0123456789"))
        case 3:
            lines[at] = lines[at].replace(*draw.choice(WORDS))
        case 4:
            del lines[at]
        case 5:
            lines[at] = lines[at].replace(draw.choice("(){}->;"), "", 1)
        case 6:
            lines.insert(at, draw.choice(ODD))
        case 7:
            lines[at : at + 2] = [draw.choice(["", " "]).join(lines[at : at + 2])]
        case _:
            begins = [i for i, line in enumerate(lines) if line.startswith("node")] or [at]
            lines.insert(draw.choice(begins), lines.pop(draw.choice(begins)))
    return "\n".join(lines)


def texts(draw: random.Random) -> Iterator[list[Source]]:
    """A contract of two files after each of some edits, most of which leave it right."""
    nodes, context = list(NODES), CONTEXT
    extra = "node z { inputs() outputs( o : Mode ) topics() guarantee( o == idle ) }\n"
    for _ in range(25):
        files = [Source("one.rcl", context + "".join(nodes)), Source("two.rcl", extra)]
        yield files[: draw.randint(1, 2)]
        which = draw.randrange(len(nodes))
        if draw.random() < 0.3:
            draw.shuffle(nodes)
        elif draw.random() < 0.1:
            context = edited(context, draw)
        else:
            kept, nodes[which] = nodes[which], edited(nodes[which], draw)
            yield [Source("one.rcl", context + "".join(nodes)), Source("two.rcl", extra)]
            if draw.random() < 0.6:
                nodes[which] = kept
        if draw.random() < 0.1:
            nodes, context = list(NODES), CONTEXT


@pytest.mark.parametrize("seed", some(range(4), 1, slow=3))
def test_it_is_the_contract_read_whole(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    draw, read = random.Random(seed), 0
    if seed % 2:  # more warnings than are kept
        monkeypatch.setattr("avow.language.source.DIAGNOSTICS", 1)
    off = frozenset({"RCL404"}) if seed % 2 else frozenset[str]()
    for sources in texts(draw):
        shelf = Shelf(tmp_path, "code")
        found = by_pieces([Source(s.file, s.text) for s in sources], off, shelf)
        shelf.keep()
        if found is not None:
            read += 1
            assert told(found) == told(_whole(sources, off, False))
    assert read > 8


@pytest.mark.parametrize("contract", sorted(ROOT.glob("contracts/*/*.rcl")), ids=lambda path: path.parent.name)
def test_what_is_shipped_is_read_node_by_node(contract: Path, tmp_path: Path) -> None:
    whole = told(_whole([Source("x.rcl", contract.read_text())], frozenset(), False))
    for _ in range(2):
        shelf = Shelf(tmp_path, "code")
        assert told(by_pieces([Source("x.rcl", contract.read_text())], frozenset(), shelf)) == whole
        shelf.keep()


def counted(monkeypatch: pytest.MonkeyPatch, *nodes: str, folder: Path, given: str = "code", file: str = "f") -> int:
    """How many nodes are read anew."""
    import avow.language.pieces as pieces

    count, real = 0, pieces._piece

    def piece(*args: Any) -> Any:
        nonlocal count
        count += 1
        return real(*args)

    with monkeypatch.context() as patched:
        patched.setattr(pieces, "_piece", piece)
        shelf = Shelf(folder, given)
        assert by_pieces([Source(file, CONTEXT + "".join(nodes))], frozenset(), shelf) is not None
        shelf.keep()
    return count


def test_an_edit_of_one_node_reads_one_node(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    a, b, _, d = NODES
    assert counted(monkeypatch, a, b, d, folder=tmp_path) == 3
    assert counted(monkeypatch, d, b, a, folder=tmp_path) == 0
    assert counted(monkeypatch, a, b.replace("0.5", "0.25"), d, folder=tmp_path) == 1
    assert counted(monkeypatch, a.replace("{ //", "{\n\n //"), b.replace("0.5", "0.25"), d, folder=tmp_path) == 1
    assert counted(monkeypatch, a, b, d, folder=tmp_path, given="other code") == 3
    assert counted(monkeypatch, a, b, d, folder=tmp_path, given="other code", file="g") == 3
    assert counted(monkeypatch, a, b, d, folder=tmp_path / "elsewhere", given="other code", file="g") == 3


@pytest.mark.parametrize("fault", ["edited", "cut", "empty", "moved", "another's", "a folder"])
def test_only_what_this_user_wrote_there_is_believed(
    fault: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    counted(monkeypatch, *NODES[:2], folder=tmp_path)
    (path,) = (cache_folder() / "texts").glob("*/*")
    data = path.read_bytes()
    match fault:
        case "edited":
            path.write_bytes(data[:-40] + bytes([data[-40] ^ 1]) + data[-39:])
        case "cut":
            path.write_bytes(data[: len(data) // 2])
        case "empty":
            path.write_bytes(b"")
        case "moved":
            path.write_bytes(sealed(path.with_name("other"), data[32:]))
        case "another's":
            monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "another"))
            there = cache_folder() / "texts" / path.parent.name / path.name
            there.parent.mkdir(parents=True)
            there.write_bytes(data)
        case _:
            path.unlink()
            path.mkdir()
    assert counted(monkeypatch, *NODES[:2], folder=tmp_path) == 2


def test_a_kept_answer_is_of_that_object_alone(tmp_path: Path) -> None:
    asked = []

    @by_identity(10)
    def size(node: Node) -> int:
        asked.append(node)
        return sum(1 for clause in node.clauses for _ in subterms(clause.formula))

    for at in range(3):
        shelf = Shelf(tmp_path, "code")
        found = by_pieces([Source("f", NODES[1])], frozenset(), shelf)
        assert found is not None
        (node,) = found[0].nodes
        shelf.recall(size, node)
        assert size(node) == 24
        other = dataclasses.replace(node, guarantees=node.guarantees[:1])
        shelf.recall(size, other)
        assert size(other) == 7
        assert asked.count(node) == 1, "in the first run only"
        assert len(asked) == at + 2
        shelf.keep()
