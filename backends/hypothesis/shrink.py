"""Making a failing case simpler, with Hypothesis, and how Hypothesis is set."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis.errors import FailedHealthCheck, Flaky, Unsatisfiable
from hypothesis.internal.conjecture import providers

from .convention import Case, told
from .generate import Inputs, Source
from .tuning import SHRINKING_SECONDS

if TYPE_CHECKING:
    from .bench import Bench


# Hypothesis looks for constants in the source of all modules that it takes for the user's. Here these are Avow's own,
# and only where it is not installed as a package: slow, of no use, and the same seed would draw other cases elsewhere.
if hasattr(providers, "is_local_module_file"):
    providers.is_local_module_file = lambda path: False


class OutOfTime(BaseException):
    """The time for the whole is over; Hypothesis passes this through."""


class _Broken(Exception):  # noqa: N818 - it is what Hypothesis shrinks
    """The guarantee that is looked at fails."""


def smallest(bench: Bench, first: Case, broken: Callable[[Inputs], Case | None]) -> Case:
    """The simplest case that is still broken, as far as it is found in time; at first each input by itself is made as
    plain as can be."""
    best = [first]
    limit = min(bench.end or float("inf"), time.monotonic() + SHRINKING_SECONDS)
    for name, value in bench.as_given(bench.generator.case(Source(b""), lambda _: None)).items():
        plainer = {**best[0][0], name: value}
        case = broken(plainer) if plainer != best[0][0] and bench.meets(plainer) else None
        best[0] = case or best[0]

    @seed(bench.seed)
    @configuration(bench, (Phase.generate, Phase.shrink))
    @given(bench.inputs)
    def one(inputs: Inputs) -> None:
        if time.monotonic() > limit:
            raise OutOfTime
        assume(bench.meets(inputs))
        case = broken(inputs)
        if case is not None:
            best[0] = min(best[0], case, key=lambda c: (len(told(*c)), told(*c)))
            raise _Broken

    with contextlib.suppress(_Broken, OutOfTime, Flaky, Unsatisfiable, FailedHealthCheck):
        one()
    return best[0]


def configuration(bench: Bench, phases: tuple[Phase, ...]) -> settings:
    """As many cases as the plan wants, without Hypothesis' own database or deadline."""
    return settings(
        max_examples=bench.cases,
        database=None,
        deadline=None,
        derandomize=False,
        phases=phases,
        report_multiple_bugs=False,
        print_blob=False,
        suppress_health_check=list(HealthCheck),
    )
