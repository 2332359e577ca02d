"""Guarantees that compare two steps of a network: monotonicity, and how far an output moves."""

from __future__ import annotations

import random
from collections import Counter
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from perception.networks import drawn, network
from perception.test_onnx_verdicts import IDENTITY, NODE, TWO, TYPES, exact, judged

from avow.backend_kit.one_step import export
from avow.backends.onnx import BACKEND
from avow.backends.onnx.cases import Side
from avow.backends.onnx.intervals import bounds, slopes
from avow.backends.onnx.reading import Network, read_network
from avow.backends.onnx.two_steps import _copies
from avow.base.verdict import Verdict
from avow.conformance.seeded import Seeded

RISES = "in.x >= previous(in.x, in.x) and in.y == previous(in.y, in.y)"
MONOTONE = f"({RISES}) -> out.z >= previous(out.z, out.z)"
NEAR = "abs(in.x - previous(in.x, in.x)) <= 1 and in.y == previous(in.y, in.y)"
MORE = "in.y >= previous(in.y, 0) and in.x <= previous(in.x, 0)"
OTHER = f"previous(out.kind == other, FALSE) and {MORE} -> out.kind == other"
BENT = ([[1.0, -1.0], [2.0, 0.5]], [0.0, -3.0])


def bent(by: float) -> bytes:
    """relu(x - y) + by * relu(2x + y/2 - 3): its slope in x is 2 * by at the least, if that is negative."""
    return network(BENT, ([[1.0, by], [0.0, 1.0]], [0.0, 0.0]))


@pytest.mark.parametrize(
    ("net", "formula", "expected"),
    [
        (IDENTITY, MONOTONE, Verdict.PROVED),
        (bent(0.5), MONOTONE, Verdict.PROVED),
        (bent(-0.25), MONOTONE, Verdict.REFUTED),
        (bent(0.5), MONOTONE.replace("out.z >=", "out.z <="), Verdict.REFUTED),
        (bent(0.5), MONOTONE.replace("in.x >=", "in.x <=").replace("out.z >=", "out.z <="), Verdict.PROVED),
        (IDENTITY, f"({NEAR}) -> abs(out.z - previous(out.z, out.z)) <= 1.01", Verdict.PROVED),
        (bent(0.5), f"({NEAR}) -> abs(out.z - previous(out.z, out.z)) <= 2.01", Verdict.PROVED),
        (bent(0.5), f"({NEAR}) -> abs(out.z - previous(out.z, out.z)) <= 1.9", Verdict.REFUTED),
        (IDENTITY, "previous(out.near, FALSE) and in.y >= previous(in.y, 0) -> out.near", Verdict.PROVED),
        (IDENTITY, "previous(out.near, FALSE) and in.x >= previous(in.x, 0) -> out.near", Verdict.REFUTED),
        (IDENTITY, OTHER, Verdict.PROVED),
        (IDENTITY, "out.z >= previous(out.z, 3)", Verdict.REFUTED),  # at a first step already
    ],
)  # fmt: skip
def test_verdicts(net: bytes, formula: str, expected: Verdict, tmp_path: Path) -> None:
    assert judged(tmp_path, formula, net).verdict is expected


def test_a_slope_that_changes_its_sign_within_the_box_is_found_in_cells(tmp_path: Path) -> None:
    """relu(x) - 0.9 * relu(x - 5) + 0.5 * relu(x - 7): the bounds of the whole box do not exclude that it falls."""
    net = network(([[1.0, 0.0]] * 3, [0.0, -5.0, -7.0]), ([[1.0, -0.9, 0.5], [0.0] * 3], [0.0, 0.0]))
    assert judged(tmp_path / "1", MONOTONE, net).verdict is Verdict.PROVED
    net = network(([[1.0, 0.0]] * 3, [0.0, -5.0, -7.0]), ([[1.0, -1.1, 0.5], [0.0] * 3], [0.0, 0.0]))
    assert judged(tmp_path / "2", MONOTONE, net).verdict is Verdict.REFUTED


def test_a_counterexample_shows_both_steps(tmp_path: Path) -> None:
    found = judged(tmp_path, MONOTONE, bent(-0.75)).counterexample
    assert found is not None
    values = {name: Fraction(value) for name, value in found.values if "kind" not in name and "near" not in name}
    assert values["in.x"] > values["in.x before"]
    assert values["in.y"] == values["in.y before"]
    assert values["out.z"] < values["out.z before"]


@pytest.mark.parametrize("formula", ["once(out.near) -> out.z >= 0", "out.z >= previous(previous(out.z, 0), 0)"])
def test_what_speaks_of_more_steps_is_refused(formula: str, tmp_path: Path) -> None:
    found = judged(tmp_path, formula, IDENTITY)
    assert found.verdict is Verdict.UNKNOWN
    assert "detector.g speaks of others: write `previous` of values of this step," in found.summary


def test_an_assumption_about_two_steps_is_refused(tmp_path: Path) -> None:
    contract = NODE.replace("guarantee g", "assume slow ( in.x <= previous(in.x, in.x) + 1 )\n  guarantee g")
    found = judged(tmp_path, "out.z <= 11", IDENTITY, contract)
    assert found.verdict is Verdict.UNKNOWN
    assert "assumption slow" in found.summary or "detector.slow" in found.summary


def test_no_query_is_written_for_two_steps(tmp_path: Path) -> None:
    case = Seeded("n", TYPES + NODE.format(MONOTONE), TWO, {"g": Verdict.UNKNOWN}, {"net.onnx": IDENTITY})
    assert export(BACKEND, case.written(BACKEND, tmp_path / "system")) == {}


# -- against exact values ----------------------------------------------------------------------------------------------


def read(path: Path, data: bytes) -> Network:
    path.write_bytes(data)
    return read_network(path)


def test_copies_and_rises_have_their_values(tmp_path: Path) -> None:
    draw = random.Random(3)
    for _ in range(20):
        net = read(tmp_path / "net.onnx", drawn(draw, 3, 5, 2))
        both = _copies(net)
        before, now = ([Fraction(draw.uniform(-3, 3)) for _ in range(3)] for _ in range(2))
        rises = [b - a for a, b in zip(before, now, strict=True)]
        first, second = exact(net, before), exact(net, now)
        found = exact(both, [*before, *now, *rises])
        wanted = [[first[k] for k in net.outputs], [second[k] for k in net.outputs]]
        assert [found[k] for k in both.outputs] == [*wanted[0], *wanted[1], *(
            b - a for a, b in zip(*wanted, strict=True)
        )]  # fmt: skip


def test_slopes_hold_between_any_two_points_of_a_cell(tmp_path: Path) -> None:
    """In exact arithmetic, of every neuron, for steps along one input."""
    draw = random.Random(5)
    for _ in range(40):
        net = read(tmp_path / "net.onnx", drawn(draw, 2, 4, 4, 1))
        low = [Fraction(draw.uniform(-2, 2)) for _ in range(2)]
        high = [end + Fraction(draw.choice((0.01, 0.5, 3.0))) for end in low]
        known = bounds(net, tuple((Side(a, False), Side(b, False)) for a, b in zip(low, high, strict=True)))
        for at in range(2):
            told = slopes(net, known, at)
            one = [a + Fraction(draw.random()) * (b - a) for a, b in zip(low, high, strict=True)]
            other = [*one]
            other[at] = low[at] + Fraction(draw.random()) * (high[at] - low[at])
            step = other[at] - one[at]
            for a, b, (least, most) in zip(exact(net, one), exact(net, other), told, strict=True):
                assert least <= (b - a) / step <= most


def brute(net: Network, seed: int, holds: Any) -> bool:
    """Whether some of many pairs of points break a claim by more than rounding."""
    draw = random.Random(seed)
    for _ in range(1_500):
        y = Fraction(draw.uniform(0, 10))
        x = Fraction(draw.choice((draw.uniform(0, 10), draw.uniform(0, 1), draw.uniform(9, 10))))
        further = min(Fraction(10), x + Fraction(draw.choice((0.01, 0.3, 1.0, draw.uniform(0, 10)))))
        one, other = (exact(net, [each, y])[net.outputs[0]] for each in (x, further))
        if not holds(other - one, further - x):
            return True
    return False


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["any", "rising", "mixed"])
def test_monotonicity_against_many_pairs(kind: str, tmp_path: Path) -> None:
    """What is proved, no pair breaks; and most is decided."""
    told: Counter[str] = Counter()
    for seed in range(10):
        draw = random.Random(f"{kind} {seed}")
        mean, spread = {"any": (0.0, 1.0), "rising": (1.0, 0.1), "mixed": (0.6, 0.6)}[kind]
        sizes = [(2, 4), (4, 3), (3, 2)]
        net = network(*(
            ([[draw.gauss(mean, spread) for _ in range(n)] for _ in range(m)], [draw.gauss(0, 3) for _ in range(m)])
            for n, m in sizes
        ))  # fmt: skip
        verdict = judged(tmp_path / str(seed), MONOTONE, net).verdict
        read_net = read(tmp_path / "net.onnx", net)
        broken = brute(read_net, seed, lambda rise, _: rise >= 0)
        assert not (verdict is Verdict.PROVED and broken), (kind, seed)
        told[verdict] += 1
    assert told[Verdict.UNKNOWN] <= 2, told
    assert told[Verdict.PROVED] == 10 or kind != "rising", told


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_how_far_an_output_moves_against_many_pairs(seed: int, tmp_path: Path) -> None:
    draw = random.Random(seed)
    net = drawn(draw, 2, 4, 3, 2)
    read_net = read(tmp_path / "net.onnx", net)
    most = Fraction(draw.choice((0.2, 1.0, 4.0)))
    formula = f"({NEAR}) -> abs(out.z - previous(out.z, out.z)) <= {float(most)}"
    verdict = judged(tmp_path / "system", formula, net).verdict
    broken = brute(read_net, seed, lambda rise, by: by > 1 or abs(rise) <= most)
    assert not (verdict is Verdict.PROVED and broken)
