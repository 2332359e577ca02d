from __future__ import annotations

import contextlib
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from avow.backends.experiment.expression import Interval, Malformed, parse
from avow.backends.experiment.quantity import conversion, decimal, figure, show


def at(text: str, **columns: float | str) -> Interval:
    return parse(text).evaluate({name: Fraction(str(value)) for name, value in columns.items()})


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("x", "2"),
        ("x - y", "-1"),
        ("abs(x - y)", "1"),
        ("hypot(y, z)", "5"),
        ("hypot(x - y, z - z2)", "1"),
        ("max(x, abs(y - z), y)", "3"),
        ("max(x, z) - mean(x, z)", "1"),
        ("z - mean(x, z)", "1"),
        ("max(max(x, y) - mean(x, y), z - mean(y, z))", "0.5"),
    ],
)
def test_values_are_exact(text: str, value: str) -> None:
    assert at(text, x=2, y=3, z=4, z2=4) == Interval.of(Fraction(value))


def test_an_irrational_root_is_enclosed() -> None:
    value = at("hypot(x, y)", x=1, y=1)
    assert value.low**2 < 2 < value.high**2


@pytest.mark.parametrize(
    "text",
    ["", "1 +", "(1", "1)", "f(1)", "__import__('os')", "x.real", "x[0]", "1 if x else 2", "hypot()", "sqrt(1, 2)",
     "a b", "((" * 60 + "1" + "))" * 60, "-" * 200 + "1", "1" * 600, "lambda: 1", "x == 1", "2 ** 9", "x; y", "1e5"],
)  # fmt: skip
def test_other_text_is_refused(text: str) -> None:
    with pytest.raises(Malformed):
        parse(text)


@given(st.text(max_size=60))
def test_no_text_breaks_the_parser(text: str) -> None:
    try:
        parse(text)
    except Malformed as error:
        position = error.position
    else:
        position = 0
    assert 0 <= position <= len(text)


def test_no_negative_part_is_hidden_in_a_maximum() -> None:
    with pytest.raises(ValueError, match="negative"):
        at("max(x - y, z)", x=1, y=9, z=1)


@given(st.text(alphabet="xyz-+*/(), 1", max_size=30), st.sampled_from(["{}", "abs({})", "max({}, x)", "hypot({})"]))
def test_no_measure_is_the_same_in_every_run(inner: str, around: str) -> None:
    try:
        measure = parse(around.format(inner))
    except Malformed:
        return
    if not set(measure.columns) <= set("xyz"):
        return
    values = set()
    for row in ((1, 10, 100), (2, 40, 900), (900, 40, 2)):
        with contextlib.suppress(ValueError):
            values.add(measure.evaluate(dict(zip("xyz", map(Fraction, row), strict=True))).low)
    assert len(values) != 1 or "max" in around


@pytest.mark.parametrize("text", ["nan", "inf", "-Infinity", "0x10", "1_000", "1,5", "21 cm", "", "--1", "１", "1e999"])
def test_not_a_plain_decimal(text: str) -> None:
    assert decimal(text) is None


def test_figures_carry_their_rounding_and_unit() -> None:
    mean = figure("21.4 cm")
    assert mean is not None
    assert mean.half == Fraction(1, 20)
    metres = mean.within("m")
    assert metres is not None
    assert (metres.low, metres.high) == (Fraction("0.2135"), Fraction("0.2145"))
    assert mean.within("s") is None
    assert figure("4 mm").within("cm").high == Fraction("0.45")  # type: ignore[union-attr]
    assert conversion("parsec", "m") is None
    assert conversion("parsec", "parsec") == 1


def test_show_rounds_and_keeps_the_sign() -> None:
    assert [show(Fraction(v)) for v in ("0.25", "-1.50000", "3", "-0.00001", "2/3")] == [
        "0.25",
        "-1.5",
        "3",
        "0",
        "0.6667",
    ]
