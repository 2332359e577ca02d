"""Contracts in any number whose faults are known, because they were put there.

A *shape* is a good contract with random numbers: realizable, nothing vacuous, redundant or unconstrained. What a fault
needs of it, the shape says itself: an input at which an output is forced, a condition that cannot come about, …
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from random import Random


@dataclass(frozen=True, slots=True)
class Shape:
    """A good contract. Each of `forced` is (a condition on allowed inputs, what holds of the outputs there)."""

    context: str
    inputs: str
    outputs: str
    assumptions: tuple[str, ...]
    guarantees: tuple[str, ...]
    forced: tuple[tuple[str, str], ...]
    never: str
    """A condition on the inputs that no allowed input meets."""
    excluded: str
    """An assumption that contradicts the others."""

    def text(self) -> str:
        clauses = [f"assume( {a} )" for a in self.assumptions] + [f"guarantee( {g} )" for g in self.guarantees]
        context = f"context {{ {self.context} }}\n" if self.context else ""
        head = f"node n {{\n  inputs( {self.inputs} )\n  outputs( {self.outputs} )\n  topics()\n  "
        return context + head + "\n  ".join(clauses) + "\n}\n"


def bands(r: Random) -> Shape:
    """A reading is classified."""
    cuts = sorted(r.sample(range(1, 1000), r.randint(1, 4)))
    scale = r.choice(["", ".5"])
    at = [f"{cut}{scale}" for cut in cuts]
    levels = [f"level{k}" for k in range(len(at) + 1)]
    edges = [f"in.r < {at[0]}", *(f"{a} <= in.r < {b}" for a, b in pairwise(at)), f"{at[-1]} <= in.r"]
    return Shape(
        f"Level : {{{', '.join(levels)}}};",
        "r : REAL",
        "v : Level",
        ("0 <= in.r", "in.r <= 2000"),
        tuple(f"{edge} -> out.v == {level}" for edge, level in zip(edges, levels, strict=True)),
        (
            ("in.r == 0.25", "out.v == level0"),
            ("in.r == 1500", f"out.v == {levels[-1]}"),
            *((f"in.r == {a}", f"out.v == {v}") for a, v in zip(at, levels[1:], strict=True)),
        ),
        r.choice(["in.r > 2001", "in.r < 0", "in.r * 2 > 4001 and in.r > 5"]),
        "in.r < -1",
    )


def clamp(r: Random) -> Shape:
    """A wish is kept within limits."""
    sort = r.choice(["REAL", "INTEGER"])
    low, high = r.randint(-50, 0), r.randint(1, 50)
    return Shape(
        f"Low = {low}; High = {high};",
        f"x : {sort}, on : BOOL",
        f"y : {sort}",
        ("-100 <= in.x <= 100",),
        (
            "in.on and in.x > High -> out.y == High",
            "in.on and in.x < Low -> out.y == Low",
            "in.on and Low <= in.x <= High -> out.y == in.x",
            "not in.on -> out.y == 0",
        ),
        (
            ("in.on and in.x == 60", "out.y == High"),
            ("not in.on and in.x == 3", "out.y == 0"),
            ("in.on and in.x == High", "out.y == in.x"),
        ),
        "in.on and in.x > 101",
        "in.x > 200",
    )


def commands(r: Random) -> Shape:
    """A command for each mode."""
    modes = ["idle", "travel", "work", "panic"][: r.randint(2, 4)]
    orders = r.sample(["stop", "go(in.x, in.y)", "take(in.n)", "take(in.n + 1)", "go(in.y, in.x + 1)"], len(modes))
    return Shape(
        f"Mode : {{{', '.join(modes)}}}; Order : {{stop, go(REAL, REAL), take(NATURAL)}};",
        "mode : Mode, x : REAL, y : REAL, n : NATURAL",
        "order : Order",
        ("in.x < in.y", "in.n > 2"),
        tuple(f"in.mode == {mode} -> out.order == {order}" for mode, order in zip(modes, orders, strict=True)),
        tuple(
            (f"in.mode == {mode} and in.n == 7", f"out.order == {order}")
            for mode, order in zip(modes, orders, strict=True)
        ),
        "in.n == 1",
        "in.y < in.x",
    )


def marks(r: Random) -> Shape:
    """What has been marked stays marked."""
    k = r.randint(3, 9)
    return Shape(
        "",
        "old : NATURAL --> BOOL, at : NATURAL",
        "new : NATURAL --> BOOL, known : BOOL",
        (f"in.at < {k}",),
        ("forall(i in NATURAL | out.new(i) <=> in.old(i) or i == in.at)", "out.known <=> in.old(in.at)"),
        (("in.at == 2", "out.new(2)"), (f"in.old({k})", f"out.new({k})"), ("in.old(in.at)", "out.known")),
        f"in.at == {k}",
        f"in.at > {k}",
    )


def append(r: Random) -> Shape:
    """A queue grows by one."""
    most = r.randint(2, 9)
    sort = r.choice(["REAL", "NATURAL"])
    return Shape(
        "",
        f"q : <{sort}>, x : {sort}",
        f"r : <{sort}>, full : BOOL",
        (f"length(in.q) <= {most}",),
        (
            "length(out.r) == length(in.q) + 1",
            "out.r(length(in.q)) == in.x and forall(i in NATURAL | i < length(in.q) -> out.r(i) == in.q(i))",
            f"out.full <=> length(in.q) == {most}",
        ),
        (("length(in.q) == 0", "out.r == <in.x>"), (f"length(in.q) == {most}", "out.full")),
        f"length(in.q) == {most + 1}",
        f"length(in.q) > {most + 2}",
    )


def split(r: Random) -> Shape:
    """A total is shared out."""
    k = r.randint(2, 9)
    return Shape(
        "",
        "t : REAL",
        "l : REAL, r : REAL",
        ("in.t >= 0",),
        ("out.l + out.r == in.t", f"out.l == {k} * out.r"),
        ((f"in.t == {k + 1}", "out.r == 1"), ("in.t == 0", "out.l == 0")),
        "in.t < -1",
        "in.t < 0",
    )


def missing(r: Random) -> Shape:
    """Natural subtraction."""
    k = r.randint(1, 5)
    return Shape(
        "",
        "have : NATURAL, want : NATURAL",
        "missing : NATURAL",
        (f"in.want <= {10 * k}",),
        ("in.want >= in.have -> out.missing == in.want - in.have", "in.want < in.have -> out.missing == 0"),
        (("in.have == 0 and in.want == 1", "out.missing == 1"), ("in.have == in.want + 1", "out.missing == 0")),
        f"in.want > {10 * k + 1} and in.have > 0",
        f"in.want > {11 * k}",
    )


def nearest(r: Random) -> Shape:
    """The least of a few readings."""
    n = r.randint(2, 6)
    return Shape(
        "",
        "range : NATURAL --> REAL",
        "min : REAL",
        (f"forall(i in NATURAL | i < {n} -> in.range(i) > 0)",),
        (
            f"forall(i in NATURAL | i < {n} -> out.min <= in.range(i))",
            f"exists(i in NATURAL | i < {n} and out.min == in.range(i))",
        ),
        ((f"forall(i in NATURAL | i < {n} -> in.range(i) == 3)", "out.min == 3"),),
        "in.range(0) < 0",
        "in.range(0) == 0",
    )


SHAPES: tuple[Callable[[Random], Shape], ...] = (bands, clamp, commands, marks, append, split, missing, nearest)


def _more(shape: Shape, *guarantees: str) -> Shape:
    return replace(shape, guarantees=(*shape.guarantees, *guarantees))


def good(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    return shape, set()


def contradictory(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    worse = replace(shape, outputs=f"{shape.outputs}, z : REAL")
    return _more(worse, "out.z > 3", "out.z < 2"), {"consistent"}


def unrealizable(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    condition, output = r.choice(shape.forced)
    return _more(shape, f"({condition}) -> not ({output})"), {"realizable"}


def vacuous(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    _, output = r.choice(shape.forced)
    return _more(shape, f"({shape.never}) -> ({output})"), {f"not-tautological-G{len(shape.guarantees) + 1}"}


def redundant(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    condition, output = r.choice(shape.forced)
    return _more(shape, f"({condition}) -> ({output})"), {f"not-redundant-G{len(shape.guarantees) + 1}"}


def doubled(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    k = r.randrange(len(shape.guarantees))
    return _more(shape, shape.guarantees[k]), {f"not-redundant-G{k + 1}", f"not-redundant-G{len(shape.guarantees) + 1}"}


def empty(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    _, output = r.choice(shape.forced)
    return _more(shape, f"({output}) or not ({output})"), {f"not-tautological-G{len(shape.guarantees) + 1}"}


def impossible(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    return replace(shape, assumptions=(*shape.assumptions, shape.excluded)), {"assumptions-satisfiable"}


def forgotten(shape: Shape, r: Random) -> tuple[Shape, set[str]]:
    return replace(shape, outputs=f"{shape.outputs}, z : REAL"), {"constrained-z"}


FAULTS = (good, contradictory, unrealizable, vacuous, redundant, doubled, empty, impossible, forgotten)


def seeded(seed: int) -> tuple[str, str, set[str]]:
    """A contract's description and text, and the faults (errors and warnings) that it has."""
    r = Random(seed)
    shape, fault = SHAPES[seed % len(SHAPES)], FAULTS[seed // len(SHAPES) % len(FAULTS)]
    made, faults = fault(shape(r), r)
    return f"{shape.__name__}, {fault.__name__}, seed {seed}", made.text(), faults
