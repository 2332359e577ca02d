"""Composition by Pacti (github.com/pacti-org/pacti), on linear contracts: where both apply, both say the same.

Pacti answers another question: it computes the weakest assumptions it can find on the inputs of the whole under which
every node's assumptions hold, and refuses only where it finds none. Avow asks whether they hold under the assumptions
that the nodes themselves make. So: where Pacti had to assume no more than they do, Avow proves it; where it assumes
more, Avow refutes it as it stands, and proves it once that much is assumed; where Pacti finds nothing, Avow refutes.
The guarantees are compared by Z3, here and not by Avow: all of them, and after Pacti has eliminated inner values.
"""

from __future__ import annotations

import random
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.base.verdict import Verdict
from avow.calculus.composition import Composition, compose
from avow.calculus.discharge import Bounds
from avow.solving.z3_module import z3

from .make import make, node

pytestmark = pytest.mark.needs_pacti

Number = int | float | Fraction


@dataclass(frozen=True)
class Linear:
    """``sum of coefficients times variables <= bound``."""

    coefficients: Mapping[str, Fraction]
    bound: Fraction

    def z3(self) -> Any:
        terms = [z3.Q(c.numerator, c.denominator) * z3.Real(v) for v, c in self.coefficients.items()]
        return z3.Sum([z3.RealVal(0), *terms]) <= z3.Q(self.bound.numerator, self.bound.denominator)

    def rcl(self, inputs: Iterable[str]) -> str:
        """What is subtracted stands on the other side."""
        known = set(inputs)
        sides: tuple[list[str], list[str]] = ([], [])
        for name, c in self.coefficients.items():
            port = f"in.{name}" if name in known else f"out.{name}"
            sides[c < 0].append(f"{_decimal(abs(c))} * {port}")
        sides[self.bound > 0].append(_decimal(abs(self.bound)))
        if self.bound < 0:
            sides[0].append(sides[0].pop())
        return " <= ".join(" + ".join(side) or "0" for side in sides)

    def data(self) -> dict[str, Any]:
        return {"coefficients": {v: float(c) for v, c in self.coefficients.items()}, "constant": float(self.bound)}


@dataclass(frozen=True)
class Part:
    name: str
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    assumed: tuple[Linear, ...]
    guaranteed: tuple[Linear, ...]

    def rcl(self) -> str:
        clauses = [f"A a{k}: {each.rcl(self.inputs)}" for k, each in enumerate(self.assumed)]
        clauses += [f"G g{k}: {each.rcl(self.inputs)}" for k, each in enumerate(self.guaranteed)]
        return node(self.name, _ports(self.inputs), _ports(self.outputs), *clauses)

    def pacti(self) -> Any:
        from pacti.contracts import PolyhedralIoContract

        given = {
            "input_vars": list(self.inputs),
            "output_vars": list(self.outputs),
            "assumptions": [each.data() for each in self.assumed],
            "guarantees": [each.data() for each in self.guaranteed],
        }
        return PolyhedralIoContract.from_dict(given, simplify=False)


def _ports(names: Iterable[str]) -> str:
    return ", ".join(f"{name} : REAL" for name in names)


def _decimal(number: Fraction) -> str:
    assert number.denominator & (number.denominator - 1) == 0, "exact in binary, so that Pacti's floats are exact too"
    text = f"{float(number):.12f}".rstrip("0")
    return text + "0" if text.endswith(".") else text


def at_most(bound: Number, **coefficients: Number) -> Linear:
    return Linear({v: Fraction(c) for v, c in coefficients.items() if c}, Fraction(bound))


def at_least(bound: Number, **coefficients: Number) -> Linear:
    return at_most(-bound, **{v: -c for v, c in coefficients.items()})


def within(low: Number, high: Number, **coefficients: Number) -> tuple[Linear, Linear]:
    return at_least(low, **coefficients), at_most(high, **coefficients)


# -- both compositions -------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Told:
    """What Pacti says: None where it finds no contract."""

    assumed: tuple[Linear, ...]
    guaranteed: tuple[Linear, ...]


def by_pacti(parts: Sequence[Part], *, keep: bool = False) -> Told | None:
    """The parts in this order, providers first. Values that another part reads are eliminated, unless `keep`."""
    whole = parts[0].pacti()
    for number, part in enumerate(parts[1:], start=1):
        later = {name for p in parts[number + 1 :] for name in p.inputs}
        made = [name for p in parts[: number + 1] for name in p.outputs]
        inner = {name for p in parts for name in p.inputs}
        kept = [name for name in made if keep or name in later or name not in inner]
        try:
            whole = whole.compose(part.pacti(), vars_to_keep=kept)
        except ValueError:  # IncompatibleArgsError is one
            return None
    found = whole.to_machine_dict()
    return Told(_read(found["assumptions"]), _read(found["guarantees"]))


def _read(terms: Sequence[Mapping[str, Any]]) -> tuple[Linear, ...]:
    """Pacti computes with floats: what it gives is rounded to what it must have meant."""

    def exact(value: float) -> Fraction:
        return Fraction(value).limit_denominator(10_000)

    return tuple(Linear({v: exact(c) for v, c in t["coefficients"].items()}, exact(t["constant"])) for t in terms)


def by_avow(folder: Path, parts: Sequence[Part], world: Sequence[Linear] = ()) -> Composition:
    """`world`: what is known of the inputs of the whole, as what a node that provides them all guarantees."""
    text = "".join(part.rcl() for part in parts)
    if world:
        fed = outer(parts)
        text += Part("world", (), fed, (), tuple(world)).rcl()
    return compose(make(folder, text))


def outer(parts: Sequence[Part]) -> tuple[str, ...]:
    made = {name for part in parts for name in part.outputs}
    return tuple(dict.fromkeys(name for part in parts for name in part.inputs if name not in made))


def verdict(composition: Composition) -> Verdict:
    return composition.stands(composition.whole, Bounds())


def implies(given: Iterable[Linear], wanted: Iterable[Linear], *, some: Iterable[str] = ()) -> bool:
    """By Z3; `some`: values of which it is enough that there are such."""
    solver = z3.Solver()
    solver.add(*(each.z3() for each in given))
    goal = z3.And([z3.BoolVal(True), *(each.z3() for each in wanted)])
    names = [z3.Real(name) for name in some]
    solver.add(z3.Not(z3.Exists(names, goal) if names else goal))
    answer = solver.check()
    assert answer != z3.unknown
    return bool(answer == z3.unsat)


def assumed(composition: Composition, parts: Sequence[Part]) -> list[Linear]:
    """What Avow's conclusion leaves assumed of the inputs of the whole."""
    by_name = {part.name: part for part in parts}
    return [by_name[name.node].assumed[int(name.clause[1:])] for name in composition.whole.root.assumed]


def suffices(told: Told, parts: Sequence[Part]) -> bool:
    """Whether what Pacti assumes is enough for every node's assumptions, node after node."""
    given = list(told.assumed)
    for part in parts:  # providers come first
        if not implies(given, part.assumed):
            return False
        given += part.guaranteed
    return True


def compare(folder: Path, parts: Sequence[Part]) -> str:
    """Holds both against each other; how they relate."""
    ours, told, kept = by_avow(folder / "as-it-is", parts), by_pacti(parts), by_pacti(parts, keep=True)
    stands = verdict(ours)
    assert stands in (Verdict.PROVED, Verdict.REFUTED)
    if told is None:
        return "both refuse" if stands is Verdict.REFUTED else "only Avow accepts"
    if not suffices(told, parts):
        assert stands is Verdict.REFUTED, "Z3 says so too"
        return "Pacti loses an assumption"
    mine = assumed(ours, parts)
    guaranteed = [each for part in parts for each in part.guaranteed]
    inner = {name for part in parts for name in part.inputs} - set(outer(parts))
    assert implies(told.assumed, mine), "Pacti's assumptions are at least the nodes'"
    assert implies([*told.assumed, *guaranteed], told.guaranteed), "Avow's guarantees are at least Pacti's"
    exact = implies([*told.assumed, *told.guaranteed], guaranteed, some=inner)
    if kept is not None:
        assert implies([*kept.assumed, *guaranteed], kept.guaranteed)
        assert implies([*kept.assumed, *kept.guaranteed], guaranteed), "the same, where nothing is eliminated"
    if implies(mine, told.assumed):
        assert stands is Verdict.PROVED, "Pacti assumes no more than the nodes do"
        return "both accept" if exact else "both accept, Pacti guarantees less"
    if stands is Verdict.PROVED:
        return "both accept, Pacti assumes more than is needed"
    assert verdict(by_avow(folder / "assumed", parts, told.assumed)) is Verdict.PROVED, "under what Pacti found"
    return "Pacti assumes more"


# -- examples after those of Pacti's own repository --------------------------------------------------------------------


def series(second: tuple[Linear, ...]) -> tuple[Part, ...]:
    """The getting-started page: a sensor-like part before one that wants its input in a range."""
    one = Part("one", ("i",), ("o",), within(-2, 2, i=1), (at_most(0, o=1, i=-1), at_most(2, i=1, o=-2)))
    return one, Part("two", ("o",), ("p",), second, (at_most(0, p=1, o=-1),))


def clock(steps: int, dwell: Number = 0) -> tuple[Part, ...]:
    """After issue 171, and the schedules of the space mission: times that add up, t >= 0 wanted of each."""
    parts = []
    for k in range(steps):
        t, d, u = f"t{k}", f"d{k}", f"t{k + 1}"
        wants = (at_least(0, **{t: 1}), at_least(dwell, **{d: 1}))
        parts.append(Part(f"step{k}", (t, d), (u,), wants, within(0, 0, **{u: 1, t: -1, d: -1})))
    return tuple(parts)


def battery(need: Number, full: Number | None = None) -> tuple[Part, ...]:
    """After the space mission's power viewpoint: charging at some 3 a second, then a task that uses 1 to 2."""
    charge = Part(
        "charge",
        ("soc0", "d0"),
        ("soc1",),
        (*within(0, 100, soc0=1), at_least(10, d0=1)),
        (*within(0, 0.5, soc1=1, soc0=-1, d0=-3), *([at_most(full, soc1=1)] if full else [])),
    )
    task = Part(
        "task",
        ("soc1", "d1"),
        ("soc2",),
        (at_least(need, soc1=1), *within(1, 4, d1=1)),
        (at_least(0, soc2=1, soc1=-1, d1=2), at_most(0, soc2=1, soc1=-1, d1=1)),
    )
    return charge, task


def fuel() -> tuple[Part, ...]:
    """After the fuel system: a pump, a load and a heat exchanger, with tolerances; no part assumes much."""
    pump = Part(
        "pump",
        ("tin",),
        ("tep", "wep"),
        within(250, 300, tin=1),
        (*within(2, 4, tep=1, tin=-1), *within(70, 80, wep=1)),
    )
    load = Part("load", ("wep",), ("hl",), within(0, 100, wep=1), within(-1, 1, hl=8, wep=-1))
    exchange = Part(
        "exchange",
        ("tep", "hl"),
        ("tout",),
        (*within(250, 310, tep=1), at_most(11, hl=1)),
        within(-5, 5, tout=1, tep=-1, hl=-1),
    )
    return pump, load, exchange


EXAMPLES: Mapping[str, tuple[tuple[Part, ...], str]] = {
    "series": (series((at_most(0.25, o=1), at_least(-1, o=1))), "Pacti assumes more"),
    "series, wide enough": (series((at_most(2, o=1), at_least(-2, o=1))), "both accept"),
    "series, a hair too narrow": (
        series((at_most(Fraction(2**10 - 1, 2**9), o=1), at_least(-2, o=1))),
        "Pacti assumes more",
    ),
    "series, nothing tells": (
        (
            Part("one", ("i",), ("o",), within(-2, 2, i=1), within(-3, 3, o=1)),
            Part("two", ("o",), ("p",), within(-1, 0.25, o=1), (at_most(0, p=1, o=-1),)),
        ),
        "both refuse",
    ),
    "side by side": (
        (
            Part("function", ("i",), ("o",), within(-2, 2, i=1), within(1, 1, o=1, i=-2)),
            Part("power", ("temp",), ("p",), (at_most(90, temp=1),), (at_most(2.125, p=1),)),
        ),
        "both accept",
    ),
    "clock": (clock(2), "both accept"),
    "clock of six": (clock(6), "both accept"),
    "clock that runs back": (clock(3, dwell=-1), "Pacti assumes more"),
    "battery": (battery(25), "both accept"),
    "battery, exactly enough": (battery(30), "both accept"),
    "battery, too little": (battery(30.5), "Pacti assumes more"),
    # that it is never more than full says something of the inputs; with the value in between, Pacti drops that
    "battery, never more than full": (battery(25, 1000), "both accept, Pacti guarantees less"),
    "fuel": (fuel(), "both accept"),
    "a guarantee about an input": (  # after issue 341: what one guarantees bounds its own input
        (
            Part("one", ("a",), ("b",), (at_most(2, a=1),), (*within(0, 0, b=1, a=-1), at_most(1.5, b=1))),
            Part("two", ("b",), ("c",), (at_most(2, b=1),), within(0, 0, c=1, b=-1)),
        ),
        "both accept",
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_after_pactis_own(tmp_path: Path, name: str) -> None:
    parts, expected = EXAMPLES[name]
    assert compare(tmp_path, parts) == expected


@pytest.mark.slow
def test_feedback_is_refused_by_pacti_whatever_it_says(tmp_path: Path) -> None:
    """Pacti composes no loop into which a constrained input leads. Avow refuses the circular one alone."""
    loop = (
        Part("a", ("y",), ("x",), (at_most(1, y=1),), (at_most(1, x=1),)),
        Part("b", ("x",), ("y",), (at_most(1, x=1),), (at_most(1, y=1),)),
    )
    assert compare(tmp_path / "circular", loop) == "both refuse"
    free = (loop[0], Part("b", ("x",), ("y",), (), (at_most(1, y=1),)))
    assert compare(tmp_path / "entered", free) == "only Avow accepts"


# -- random chains, forks and joins ------------------------------------------------------------------------------------

SYSTEMS = 60


def random_parts(seed: int) -> tuple[Part, ...]:
    """Two or three parts: a chain, one that feeds two, or two that feed one; small whole numbers and halves."""
    chance = random.Random(seed)
    shape = chance.choice(["chain", "long", "fork", "join"])
    reads: list[tuple[str, ...]] = {
        "chain": [("e",), ("x0",)],
        "long": [("e",), ("x0",), ("x1",)],
        "fork": [("e",), ("x0",), ("x0", "f")],
        "join": [("e",), ("f",), ("x0", "x1")],
    }[shape]
    parts = []
    for number, inputs in enumerate(reads):
        limits: list[Linear] = []
        for name in inputs:
            low = chance.randint(-4, 1)
            limits += within(low, low + chance.randint(2, 9), **{name: 1})
        if len(inputs) == 2 and chance.random() < 0.5:
            limits.append(at_most(chance.randint(3, 9), **{inputs[0]: 1, inputs[1]: chance.choice([-1, 1])}))
        out = f"x{number}"
        gain = {name: Fraction(chance.choice([-2, -1, 1, 1, 2, 3]), chance.choice([1, 2])) for name in inputs}
        offset = chance.randint(-2, 2)
        if chance.random() < 0.7:
            formulas = within(offset, offset + chance.randint(0, 2), **{out: 1, **{n: -c for n, c in gain.items()}})
        else:
            formulas = within(offset, offset + chance.randint(0, 3), **{out: 1})
        parts.append(Part(f"n{number}", inputs, (out,), tuple(limits), formulas))
    return tuple(parts)


@pytest.mark.slow
def test_random_parts(tmp_path: Path) -> None:
    counts: dict[str, int] = {}
    for seed in range(SYSTEMS):
        relation = compare(tmp_path / str(seed), random_parts(seed))
        counts[relation] = counts.get(relation, 0) + 1
    print(counts)
    assert counts.get("only Avow accepts", 0) == 0, counts
    assert min(counts.get(each, 0) for each in ("both accept", "both refuse", "Pacti assumes more")) >= 3, counts
