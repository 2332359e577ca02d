"""Units of ports: sums and comparisons of one unit, products of any."""

from __future__ import annotations

import pytest

from avow.language.format import format_text
from avow.language.load import check_text
from avow.language.translate import to_rcl
from avow.language.units import unit

NODE = """node n {{
  inputs( d, r : REAL in m, t : REAL in s, v : REAL in m/s, w : REAL in rad/s, f : REAL in N, k : REAL,
          i : NATURAL in s )
  outputs( x : REAL in m, y : REAL in m/s )
  topics()
  define far(a : REAL) = x > a;
  guarantee g ( {} )
}}
"""


@pytest.mark.parametrize(
    "formula",
    [
        "x == d + v * t",
        "y == d / t and y < 3 and x + 1 > -0.5 * r",
        "y == w * r",
        "x == k and y == k and x == k * d",
        "f * d / t > 5 and i + t > 3",
        "x < previous(d, 0) and max(abs(x), 2 * r) > min(d, 3)",
        "exists(z in REAL | z > x and z > y)",
        "t > 2 s and x < v * 3 s and k > 1 h",
        "x in {d, 3} and far(2 * d) and x == (if y > 3 then r else 0)",
        "x * x == d * r",
        "within[2 s](x > d)",
    ],
)
def test_formulas_of_one_unit(formula: str) -> None:
    contract, found = check_text(NODE.format(formula), "f.rcl")
    assert contract is not None, found
    assert check_text(to_rcl(contract), "f.rcl")[0] == contract


@pytest.mark.parametrize(
    ("formula", "units"),
    [
        ("x == d + t", "m s"),
        ("x == d * t", "m m*s"),
        ("y == w", "m/s rad/s"),
        ("y == w * t", "m/s rad"),
        ("x < previous(y, 0)", "m m/s"),
        ("max(abs(x), 2 * r) > 1 / t", "m 1/s"),
        ("x in {3, t}", "m s"),
        ("x == (if d > 0 then t else 0)", "m s"),
        ("forall(z in REAL | z > x -> x > t)", "m s"),
        ("far(t)", "m s"),
        ("once[2 s](x > i)", "m s"),
        ("0 <= x <= y", "m m/s"),
        ("x > 2 s", "m s"),
        ("x < w * 3 s + 1 min", "rad s"),
        ("not (mod(i, 2) == x)", "s m"),
    ],
)
def test_different_units(formula: str, units: str) -> None:
    _, found = check_text(NODE.format(formula), "f.rcl")
    (one,) = [d for d in found if d.is_error]
    assert one.code == "RCL223"
    assert [part.rpartition(" is in ")[2] for part in one.message.split(" and `")] == units.split()
    assert one.span is not None


def test_units_as_texts() -> None:
    assert unit("N") == unit("kg*m/s/s") == {"kg": 1, "m": 1, "s": -2}
    assert unit("Hz") == {"s": -1}
    assert unit("m/km") is None
    tidy = format_text(NODE.format("x > 3").replace("m/s", "m / s"), "f.rcl")
    assert "v : REAL in m/s," in tidy
