"""Enclosures against closed forms, sampled solutions and exact iteration; verdicts with seeded faults."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest

from avow.backend_kit.protocol import Limits, Report
from avow.backends.reach import BACKEND
from avow.backends.reach.expressions import Misread, Name, parse, value
from avow.backends.reach.maps import Map
from avow.backends.reach.truth import Span
from avow.base.diagnostics import Diagnostic
from avow.base.verdict import Outcome, Verdict
from avow.conformance.seeded import Seeded, settle

pytest.importorskip("codac", reason="the extra motion")

from avow.backends.reach.flow import Motion, Step, Stuck
from avow.backends.reach.intervals import Interval, outward
from avow.backends.reach.series import Series, around, interval


@pytest.fixture(autouse=True)
def _rounding() -> Iterator[None]:
    """Whatever is enclosed: afterwards the process rounds to nearest, and reads decimals rightly."""
    yield
    assert float("1.2") == 1.2


NODE = """\
node mover {{
  inputs( u : REAL, b : BOOL ) outputs( y : REAL, z : REAL, on : BOOL ) topics()
  assume range ( abs(in.u) <= 1 )
  guarantee g ( {} )
}}
"""
FALLING = {"ode": {"x": "-x + u"}, "initial": {"x": [0, 2]}, "horizon": 2, "step": 0.05}
TWO = {"ode": {"x": "-x", "c": "1"}, "initial": {"x": [-1, 1], "c": 0}, "outputs": {"out.z": "c"}}
FILTER = {"map": {"x": "0.9 * x + 0.1 * u", "w": "x"}, "initial": {"x": 0, "w": 0}}
PORTS = {"inputs": {"u": "in.u"}, "outputs": {"out.y": "x", "out.z": "x / 2 + u"}}


def run(folder: Path, formula: str, **options: Any) -> Report:
    case = Seeded("n", NODE.format(formula), {**PORTS, **options}, {"g": Verdict.UNKNOWN})
    job = case.written(BACKEND, folder / "system")
    assert not BACKEND.check(job)
    return settle(BACKEND, job, folder / "made", Limits())


def judged(folder: Path, formula: str, **options: Any) -> Outcome:
    (outcome,) = run(folder, formula, **options).outcomes
    return outcome


@pytest.mark.parametrize(
    ("formula", "options", "expected"),
    [
        ("out.y <= 2.01", FALLING, Verdict.CHECKED),
        ("-1.1 <= out.y and (out.y <= 2.5 or out.y > 1.4)", FALLING, Verdict.CHECKED),
        ("out.y < 2", FALLING, Verdict.REFUTED),
        ("not (out.y > 3) and abs(out.z) <= 2.1", FALLING, Verdict.CHECKED),
        ("out.y >= -0.8", FALLING, Verdict.REFUTED),
        ("out.y >= -0.99", {**FALLING, "horizon": 1}, Verdict.CHECKED),
        ("out.y <= 2.01 or in.b", FALLING, Verdict.CHECKED),
        ("in.b", FALLING, Verdict.UNKNOWN),
        ("out.on", FALLING, Verdict.UNKNOWN),
        ("out.y <= 3", {**FALLING, "ode": {"x": "-x + u / 2"}, "initial": {"x": [-1, 1]}}, Verdict.PROVED),
        ("out.y <= 3", {**FALLING, "ode": {"x": "x * x"}, "initial": {"x": 1}}, Verdict.REFUTED),
        ("out.y >= 0", {**FALLING, "ode": {"x": "x * x"}, "initial": {"x": 1}}, Verdict.UNKNOWN),
        ("out.y <= 9", {**FALLING, "ode": {"x": "1 / (x - 1)"}}, Verdict.UNKNOWN),
        ("out.y <= 9", {**FALLING, "ode": {"x": "sqrt(x) - x"}}, Verdict.UNKNOWN),
        ("abs(out.y) <= 1", FILTER, Verdict.PROVED),
        ("abs(out.y) <= 1.1 and out.z <= 2", FILTER, Verdict.PROVED),
        ("out.y <= 0.5", FILTER, Verdict.REFUTED),
        ("out.y <= 0.5", {**FILTER, "steps": 4}, Verdict.CHECKED),
        ("abs(out.y) <= 50", {**FILTER, "map": {"x": "x + u", "w": "x"}, "steps": 50}, Verdict.CHECKED),
        ("abs(out.y) <= 500", {**FILTER, "map": {"x": "x + u", "w": "x"}}, Verdict.UNKNOWN),
        ("abs(out.y) <= 50", {**FILTER, "map": {"x": "x + u", "w": "x"}, "steps": 51}, Verdict.REFUTED),
        ("out.z <= 1000", {**FILTER, "map": {"x": "x / 2", "w": "w + 1"}, "outputs": {"out.z": "w"}}, Verdict.UNKNOWN),
        ("out.y <= 1", {**FILTER, "map": {"x": "x / 2", "w": "x"}, "initial": {"x": 8, "w": 0}}, Verdict.REFUTED),
        ("out.z <= 9", {**FALLING, **TWO}, Verdict.CHECKED),
        ("out.y < out.z", {**FILTER, "map": {"x": "10**9 * (x + u)", "w": "x"}}, Verdict.REFUTED),
    ],
)
@pytest.mark.slow
@pytest.mark.needs_motion
def test_verdicts(formula: str, options: dict[str, Any], expected: Verdict, tmp_path: Path) -> None:
    found = judged(tmp_path, formula, **options)
    assert found.verdict is expected, found.summary
    limits = [hypothesis.name for hypothesis in found.rests_on]
    wanted = {Verdict.CHECKED: ["mover/assumption/initial", "horizon"], Verdict.PROVED: ["mover/assumption/initial"]}
    assert limits == wanted.get(expected, [])


def test_what_is_open_is_placed_in_time_and_value(tmp_path: Path) -> None:
    options = {**FALLING, "initial": {"x": 0}, "ode": {"x": "u"}, "inputs": {"u": "in.u"}}
    found = judged(tmp_path, "out.y != 0.93", **options)
    assert found.verdict is Verdict.UNKNOWN
    assert "from 0.9 to 0.95 s: out.y from -0.95 to 0.95" in found.summary
    assert judged(tmp_path / "2", "in.u > 2 -> out.y > 7", **FALLING).vacuous


def test_boxes_are_kept(tmp_path: Path) -> None:
    report = run(tmp_path, "out.y <= 3", **FALLING)
    head, *lines = report.logs["enclosure.csv"].splitlines()
    assert head == "from (s),to (s),x min,x max,out.y min,out.y max,out.z min,out.z max"
    assert len(lines) == 40
    assert report.logs["enclosure.svg"].count("<rect") == 2 * 41


@pytest.mark.parametrize(
    ("assumed", "formula"),
    [("in.u * in.u <= 0.01", "out.y <= 1.2"), ("(if in.u <= 0.5 then 3 else 7) != in.u", "in.u <= 0.6")],
)
def test_assumptions_that_bound_no_box(assumed: str, formula: str, tmp_path: Path) -> None:
    """Neither does a counterexample break them, nor does a comparison within them bound an input."""
    contract = NODE.replace("abs(in.u) <= 1", f"abs(in.u) <= 1 and {assumed}").format(formula)
    motion = {**PORTS, **FALLING, "ode": {"x": "-x + 2 * u"}, "initial": {"x": 0}}
    job = Seeded("n", contract, motion, {"g": Verdict.UNKNOWN}).written(BACKEND, tmp_path / "system")
    (found,) = settle(BACKEND, job, tmp_path / "made", Limits()).outcomes
    assert found.verdict is (Verdict.UNKNOWN if "out" in formula else Verdict.REFUTED), found.summary


def test_an_input_without_bounds_is_named(tmp_path: Path) -> None:
    case = Seeded(
        "n", NODE.replace("abs(in.u)", "in.u").format("out.y <= 3"), {**PORTS, **FALLING}, {"g": Verdict.UNKNOWN}
    )
    job = case.written(BACKEND, tmp_path / "system")
    (found,) = settle(BACKEND, job, tmp_path / "made", Limits()).outcomes
    assert found.verdict is Verdict.UNKNOWN
    assert "in.u has no bounds" in found.summary


def test_without_the_extra_it_is_not_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from importlib.metadata import PackageNotFoundError

    def missing(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr("avow.base.tools.package_version", missing)
    found = judged(tmp_path, "out.y <= 3", **FALLING)
    assert found.verdict is Verdict.NOT_RUN
    assert "pip install 'avow[motion]'" in found.summary


def test_the_tool_does_its_one_line_job() -> None:
    assert [tool.trial() for tool in BACKEND.tools() if tool.trial] == [""]


def test_each_fault_is_reported(tmp_path: Path) -> None:
    def faults(**options: Any) -> list[Diagnostic]:
        case = Seeded("n", NODE.format("out.y > 0"), {**PORTS, **options}, {"g": Verdict.ERROR})
        found = BACKEND.check(case.written(BACKEND, tmp_path))
        assert all(d.span is not None and d.span.line > 1 for d in found)
        return list(found)

    wrong = {
        "ode": {"x": "-y + u", "u": "x ^ 2"},
        "initial": {"x": [2, 1], "q": 0},
        "inputs": {"u": "in.b", "w": "in.uu"},
        "outputs": {"out.on": "x", "out.y": "exp(x)"},
        "horizon": 10,
    }
    found = faults(**wrong)
    codes = sorted(d.code for d in found)
    assert codes == ["REACH101"] * 4 + ["REACH102"] * 4 + ["REACH103"] * 3
    assert [d.code for d in faults(**{**FILTER, "map": {"x": "x * u", "w": 0}})] == ["REACH104"]
    assert [d.code for d in faults(**{**FALLING, "map": {"x": "x"}})] == ["REACH101"]
    assert [d.code for d in faults(**{**FALLING, "step": 1e-9})] == ["REACH101"]


@pytest.mark.parametrize(
    "text", ["x +", "x.y", "__import__('os')", "x if x else x", "(" * 5000, "x ** x", "x ** 99", "[x]", "\0"]
)
def test_what_is_no_term(text: str) -> None:
    with pytest.raises(Misread):
        parse(text, {"x": Name("x")})


# -- soundness ---------------------------------------------------------------------------------------------------------


def steps(
    equations: dict[str, str], initial: list[tuple[float, float]], horizon: str, step: str, **inputs: Any
) -> list[Step]:
    names = {name: Name(name) for name in (*equations, *inputs)}
    terms = {name: parse(text, names) for name, text in equations.items()}
    boxes = {name: interval(Fraction(low)) | interval(Fraction(high)) for name, (low, high) in inputs.items()}
    box = tuple(interval(Fraction(low)) | interval(Fraction(high)) for low, high in initial)
    return [*Motion(terms, boxes).steps(box, Fraction(horizon), Fraction(step))]


@pytest.mark.parametrize(
    ("equations", "initial", "exact"),
    [
        ({"x": "-x"}, [1], lambda t: [math.exp(-t)]),
        ({"x": "v", "v": "-x"}, [1, 0], lambda t: [math.cos(t), -math.sin(t)]),
        ({"x": "-x ** 2"}, [1], lambda t: [1 / (1 + t)]),
        ({"x": "-x * sqrt(x)"}, [4], lambda t: [4 / (1 + t) ** 2]),
        ({"c": "1", "x": "cos(c) / 2", "y": "sin(c)"}, [0, 0, 0], lambda t: [t, math.sin(t) / 2, 1 - math.cos(t)]),
        ({"x": "1 / x"}, [1], lambda t: [math.sqrt(1 + 2 * t)]),
        ({"x": "x ** 3 / (-2)"}, [1], lambda t: [1 / math.sqrt(1 + t)]),
    ],
)
def test_closed_forms_lie_inside(equations: dict[str, str], initial: list[float], exact: Any) -> None:
    """Between the ends of a step, too. At its end the enclosure is tight."""
    for step in steps(equations, [(x, x) for x in initial], "4", "0.1"):
        for share in (0, 0.37, 1):
            at = float(step.start) + share * float(step.end - step.start)
            for x, box in zip(exact(at), step.during, strict=True):
                assert box.lb() - 1e-12 <= x <= box.ub() + 1e-12
        for x, box in zip(exact(float(step.end)), step.after, strict=True):
            assert box.lb() - 1e-12 <= x <= box.ub() + 1e-12
            assert box.ub() - box.lb() < 1e-3


SYSTEMS: list[tuple[dict[str, str], list[tuple[float, float]]]] = [
    ({"x": "v", "v": "-a"}, [(0, 0), (0, 2)]),
    ({"x": "v", "v": "-sin(x) - v / 5 + a / 2"}, [(-0.3, 0.4), (0, 0.2)]),
    ({"x": "v", "v": "(1 - x ** 2) * v - x + a / 10"}, [(1, 1.1), (0, 0.1)]),
    ({"x": "-x * y + a / 20", "y": "x / (1 + y ** 2) - y"}, [(0.5, 0.8), (0, 0.1)]),
    ({"x": "cos(p)", "y": "sin(p)", "p": "a"}, [(0, 0.1), (0, 0.1), (-0.1, 0.1)]),
]


@pytest.mark.slow
@pytest.mark.parametrize("which", range(len(SYSTEMS)))
def test_no_sampled_solution_leaves_the_enclosures(which: int) -> None:
    """A thousand solutions of each, with inputs that change at random times: integrated with steps so short that the
    error is far below the margin, which is far below the widths."""
    import numpy as np

    equations, initial = SYSTEMS[which]
    found = steps(equations, initial, "2", "0.05", a=(-1, 1))
    draw, size = np.random.default_rng(which), 1_000
    state = [draw.choice([low, high, draw.uniform(low, high)], size) for low, high in initial]
    source = {name: compile(text, name, "eval") for name, text in equations.items()}

    def slope(at: list[Any], a: Any) -> list[Any]:
        known = {**dict(zip(equations, at, strict=True)), "a": a, "sin": np.sin, "cos": np.cos, "sqrt": np.sqrt}
        return [eval(code, {}, known) + 0 * a for code in source.values()]

    def moved(at: list[Any], by: list[Any], h: float) -> list[Any]:
        return [x + h * v for x, v in zip(at, by, strict=True)]

    a, h = draw.uniform(-1, 1, size), 0.05 / 20
    for step in found:
        for _ in range(20):
            a = np.where(draw.random(size) < 0.1, draw.choice([-1.0, 1.0, *draw.uniform(-1, 1, 3)], size), a)
            k1 = slope(state, a)
            k2 = slope(moved(state, k1, h / 2), a)
            k3 = slope(moved(state, k2, h / 2), a)
            k4 = slope(moved(state, k3, h), a)
            total = [p + 2 * q + 2 * r + s for p, q, r, s in zip(k1, k2, k3, k4, strict=True)]
            state = moved(state, total, h / 6)
            for x, box in zip(state, step.during, strict=True):
                assert box.lb() - 1e-9 <= x.min()
                assert x.max() <= box.ub() + 1e-9
        for x, box in zip(state, step.after, strict=True):
            assert box.lb() - 1e-9 <= x.min()
            assert x.max() <= box.ub() + 1e-9


def test_maps_against_exact_iteration() -> None:
    """The box is the least: each of its sides is reached by a run from corners, and no run leaves it."""
    draw = random.Random(3)
    number = lambda: Fraction(draw.randint(-12, 12), 10)  # noqa: E731
    for _ in range(60):
        known = {name: Name(name) for name in "xyu"}
        text = {name: f"({number()}) * x + ({number()}) * y + ({number()}) * u + ({number()})" for name in "xyz"}
        terms = {name: parse(each, known) for name, each in text.items()}
        states = {name: terms[name] for name in "xy"}
        map_ = Map.of(states, {"z": terms["z"]}, ("u",))
        initial, inputs = (
            (Span(Fraction(-1), Fraction(1)), Span(Fraction(0), Fraction(2))),
            (Span(Fraction(-1), Fraction(1)),),
        )
        boxes = map_.boxes(initial, inputs)
        runs = [({"x": x, "y": y}, us) for x in (-1, 1) for y in (0, 2) for us in range(16)]
        for k in range(4):
            box = next(boxes)
            ends = []
            for state, us in runs:
                given = {**state, "u": Fraction(1 if us >> k & 1 else -1)}
                state |= {name: value(term, given, Fraction) for name, term in states.items()}
                ends.append([*state.values(), value(terms["z"], {**state, "u": given["u"]}, Fraction)])
            for at, span in enumerate(box):
                assert (min(e[at] for e in ends), max(e[at] for e in ends)) == (span.low, span.high)


def test_floating_point_numbers_around_a_fraction() -> None:
    for number in (
        Fraction(1, 3),
        Fraction(1, 10),
        Fraction(1, 2),
        Fraction(10) ** 400,
        -(Fraction(10) ** 400),
        Fraction(1, 10**400),
    ):
        low, high = around(number)
        assert low <= number <= high
        assert (
            low == high or math.nextafter(math.nextafter(low, high), high) == high or math.nextafter(low, high) == high
        )


def test_a_solution_that_ends_is_stuck() -> None:
    with pytest.raises(Stuck):
        steps({"x": "x ** 2"}, [(1, 1)], "2", "0.05")
    with outward():
        assert Series(((interval(Fraction(2)),),)).sqrt().of[0][0].lb() < math.sqrt(2) + 1e-9


@pytest.mark.slow
@pytest.mark.needs_motion
@pytest.mark.parametrize("seed", range(12))
def test_verdicts_on_maps_against_runs(seed: int, tmp_path: Path) -> None:
    """What is proved holds in each of 500 runs with extreme inputs, and what a run breaks is never supported."""
    draw = random.Random(seed)
    factors = [[draw.randint(-8, 8) / 10 for _ in range(4)] for _ in range(2)]
    text = ["{} * x + {} * w + {} * u + {}".format(*row) for row in factors]
    limit = draw.randint(1, 60) / 10
    formula = draw.choice(["abs(out.y) <= {0}", "in.u >= 0 -> out.y + out.z <= {0}", "max(out.y, out.z) < {0}"])
    greatest = 0.0
    holds = {
        "a": lambda y, z, u: abs(y),
        "i": lambda y, z, u: y + z if u >= 0 else -1e9,
        "m": lambda y, z, u: max(y, z),
    }[formula[0]]
    for _ in range(500):
        x, w = draw.choice([-1.0, 1.0]), 0.0
        for _ in range(40):
            u = draw.choice([-1.0, 1.0])
            x, w = (a * x + b * w + c * u + d for a, b, c, d in factors)
            greatest = max(greatest, holds(x, x / 2 + w, u))
    options = {"map": {"x": text[0], "w": text[1]}, "initial": {"x": [-1, 1], "w": 0}, "steps": 40}
    outputs = {"out.y": "x", "out.z": "x / 2 + w"}
    found = judged(tmp_path, formula.format(limit), **options, outputs=outputs)
    if greatest > limit + 1e-9:
        assert not found.verdict.supports, found.summary
    if found.verdict is Verdict.REFUTED:
        assert found.counterexample is not None


def test_a_box_that_is_left_again_proves_nothing(tmp_path: Path) -> None:
    motion = {"ode": {"x": "-x + 2 * u"}, "initial": {"x": [-1, 1]}, "horizon": 3, "step": 0.05}
    assert judged(tmp_path / "1", "out.y <= 3", **motion).verdict is Verdict.CHECKED
    assert judged(tmp_path / "2", "out.y <= 1.5", **motion).verdict is Verdict.REFUTED


def test_the_processor_rounds_as_codac_needs_it_only_where_it_computes(tmp_path: Path) -> None:
    """codac's import sets another rounding for the whole process, in which 1.2 is read as 1.2000000000000002."""
    run(tmp_path, "out.y <= 3", **FALLING)
    assert (float("1.2"), 0.1 + 0.7, 1 / 3) == (1.2, 0.7999999999999999, 0.3333333333333333)
    assert (near := Interval(1) / 3).lb() == near.ub(), "codac's intervals would be wrong outside"
    with outward():
        assert (third := Interval(1) / 3).lb() < third.ub()
