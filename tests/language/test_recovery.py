"""A fault in one node leaves the others checked: all faults in one round, and the warnings about sound nodes."""

from __future__ import annotations

import pytest

from avow.language.load import check_text

CONTEXT = "context { Colour : {red, green}; Limit = 3; Broken : {red2, red2}; }\n"
NODE = """\
node {name} {{
  inputs( r : REAL, s : <REAL> )
  outputs( colour{k} : Colour )
  topics( float64 r matches(in.r), geometry_msgs/Polygon s matches(in.s), string c matches(out.colour{k}) )
  assume fine{k} ( in.r >= 0 and length(in.s) > 0 )
  guarantee low{k} ( in.r < Limit -> out.colour{k} == green )
  guarantee high{k} ( in.r >= Limit -> out.colour{k} == red )
}}
"""
FAULTS = (
    ("== green", "== gren", "RCL201"),
    ("in.r < Limit", "in.rr < Limit", "RCL203"),
    ("in.r < Limit ->", "in.r < Limit =>", "RCL101"),
    ("in.r < Limit ->", "in.r < ->", "RCL120"),
    ("== green )", "== green", "RCL115"),
    ("guarantee low", "garantee low", "RCL113"),
    ("outputs(", "output(", "RCL113"),
    ("  topics( ", "  // topics( ", "RCL118"),
    ("-> out.colour", "-> in.s == out.colour", "RCL302"),
    ("in.r < Limit ->", "s(r) < Limit ->", "RCL303"),
    ("in.r < Limit ->", "in.r(1) < Limit ->", "RCL304"),
    ("s : <REAL>", "s : <REALS>", "RCL208"),
    ("matches(in.r)", "matches(in.q)", "RCL218"),
    ("guarantee high", "guarantee low", "RCL215"),
    ("in.r >= 0", "forall(r in REAL | r >= 0)", "RCL207"),
    ("float64 r", "flot64 r", "RCL217"),
)


def node(k: int, fault: tuple[str, str, str] | None) -> str:
    text = NODE.format(name=f"node{k}", k=k)
    if fault is not None:
        right, wrong, _ = fault
        assert right in text
        text = text.replace(right, wrong, 1)
    return text


def found(nodes: list[str]) -> list[list[tuple[str, int, int]]]:
    """For the context and for each node the codes said of it, with their lines and columns in it."""
    starts, line = [], CONTEXT.count("\n")
    for text in nodes:
        starts.append(line)
        line += text.count("\n")
    told: list[list[tuple[str, int, int]]] = [[] for _ in (None, *nodes)]
    for diagnostic in check_text(CONTEXT + "".join(nodes), "f")[1]:
        assert diagnostic.span is not None
        at = diagnostic.span.line - 1
        k = sum(start <= at for start in starts)
        told[k].append((diagnostic.code, at - (starts[k - 1] if k else 0), diagnostic.span.column))
    return told


def test_every_fault_of_every_node_is_told_in_one_round() -> None:
    told = found([node(k, fault) for k, fault in enumerate(FAULTS)])
    for (right, wrong, code), said in zip(FAULTS, told[1:], strict=True):
        assert [c for c, _, _ in said] == [code], f"{right} → {wrong}"
    assert [code for code, _, _ in told[0]] == ["RCL213"]


@pytest.mark.parametrize("at", range(len(FAULTS)))
def test_what_is_said_of_a_node_does_not_hang_on_the_others(at: int) -> None:
    """Each fault mended in turn: of the other nodes the same is said."""
    faulty = found([node(k, fault) for k, fault in enumerate(FAULTS)])
    mended = found([node(k, None if k == at else fault) for k, fault in enumerate(FAULTS)])
    assert [said for k, said in enumerate(mended) if k != at + 1] == [s for k, s in enumerate(faulty) if k != at + 1]
    assert mended[at + 1] == []


def test_warnings_about_a_sound_node_stay() -> None:
    unused = NODE.format(name="other", k=99).replace("s : <REAL>", "s : <REAL>, unused : BOOL")
    alone = found([unused])[1]
    assert alone
    for k, fault in enumerate(FAULTS):
        assert found([node(k, fault), unused])[2] == alone, fault
