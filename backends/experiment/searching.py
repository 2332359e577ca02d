"""The search for a failing scenario: Hypothesis makes the distance to a breach small, and simplifies what fails."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import suppress
from fractions import Fraction

from hypothesis import HealthCheck, Phase, given, seed, settings, target
from hypothesis import strategies as st
from hypothesis.errors import Flaky

from avow.base.records import dataclass

from .profile import Parameter
from .tuning import CLIMB_RUNS, SEARCHED_STEPS, SHRINKING_RUNS

Cells = Mapping[str, str]


class _Enough(BaseException):
    """The runs are used up. Hypothesis passes it through, or raises `Flaky` instead."""


class _Failing(Exception):  # noqa: N818 - it is what Hypothesis shrinks
    """A run that fails."""


@dataclass(frozen=True, slots=True)
class Tried:
    distances: Mapping[str, float]
    """Guarantee → its least distance from a breach."""
    failed: bool


@dataclass(frozen=True, slots=True)
class Searched:
    runs: int
    """Up to the first failing run, or all."""
    shrinking: int
    failing: Cells | None
    """The simplest failing scenario: as few parameters as possible differ from their usual values, and by little."""


def search(parameters: tuple[Parameter, ...], attempt: Callable[[Cells], Tried], runs: int, start: int) -> Searched:
    """`attempt` makes a run of a scenario. Equal scenarios are tried once, so that an unsteady simulator cannot confuse
    the search."""
    tried: dict[tuple[int, ...], Tried] = {}
    failing: dict[tuple[int, ...], int] = {}
    offsets = [_offsets(parameter) for parameter in parameters]

    def cells(key: tuple[int, ...]) -> Cells:
        return {p.name: _value(p, offset) for p, offset in zip(parameters, key, strict=True)}

    def one(key: tuple[int, ...]) -> None:
        if key not in tried:
            first = next(iter(failing.values()), None)
            if len(tried) >= (runs if first is None else first + SHRINKING_RUNS):
                raise _Enough
            tried[key] = attempt(cells(key))
            if tried[key].failed:
                failing[key] = len(tried)
        for name, distance in tried[key].distances.items():
            target(-distance, label=name)
        if key in failing:
            raise _Failing

    chosen = settings(
        max_examples=CLIMB_RUNS,
        phases=(Phase.generate, Phase.target, Phase.shrink),
        database=None,  # the table of regressions keeps what failed
        deadline=None,
        print_blob=False,
        report_multiple_bugs=False,
        suppress_health_check=list(HealthCheck),
    )
    before = -1
    while not failing and before < len(tried) < runs:  # Hypothesis climbs once: begin anew elsewhere
        before = len(tried)
        with suppress(_Enough, _Failing, Flaky):
            seed(f"{start}/{before}")(chosen(given(st.tuples(*offsets))(one)))()
    simplest = min(failing, key=lambda key: (sum(map(bool, key)), sum(map(abs, key))), default=None)
    made = next(iter(failing.values()), len(tried))
    return Searched(made, len(tried) - made, None if simplest is None else cells(simplest))


def _offsets(parameter: Parameter) -> st.SearchStrategy[int]:
    """Steps from the usual value, which 0 stands for: Hypothesis simplifies numbers towards 0."""
    if parameter.values:
        return st.integers(0, len(parameter.values) - 1)
    usual = int(parameter.usual * SEARCHED_STEPS)
    return st.integers(-usual, SEARCHED_STEPS - usual)


def _value(parameter: Parameter, offset: int) -> str:
    if parameter.values:
        return parameter.values[offset]
    return parameter.at(Fraction(int(parameter.usual * SEARCHED_STEPS) + offset, SEARCHED_STEPS))
