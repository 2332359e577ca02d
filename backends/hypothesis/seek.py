"""Where a bench looks besides: at what its subject is seen to compare with, and at where it compares equal."""

from __future__ import annotations

import random
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING

from avow.isolation.scout import Sight
from avow.isolation.subject import SubjectFailed

from .cases import Case
from .generate import Impossible, Inputs, Source
from .shrink import OutOfTime
from .steer import Steering, constants, repeats
from .tuning import ASKED_TO_COUNT, CASE_BYTES, COUNTED_FROM, SAMPLED, STEERED

if TYPE_CHECKING:
    from .bench import Bench


def learn(bench: Bench) -> None:
    """Inputs are made from what the subject compares with in a few drawn cases, and from what its modules hold."""
    with suppress(Impossible):
        drawn = [_drawn(bench, random.Random(k).randbytes(CASE_BYTES)) for k in range(SAMPLED)]
        allowed = [case for case in drawn if bench.meets(case)] or drawn
        bench.generator = bench.generating(*constants(bench.looked([], allowed)))


def steer(bench: Bench) -> None:
    """Cases at which the subject compares equal, and as many of the same as it is seen to count. Takes half of what is
    left of the time: what the subject answered is asked again after it."""
    end = bench.end
    bench.end = (time.monotonic() + end) / 2 if end is not None else None
    try:
        with suppress(OutOfTime):
            _steer(bench)
    finally:
        bench.end = end


def _steer(bench: Bench) -> None:
    counted = 0
    starts = bench.starts()
    for start in starts:

        def looked(cases: Sequence[Inputs], start: list[Inputs] = start) -> list[tuple[Sight, ...]]:
            return bench.looked(start, cases)

        steering = Steering(bench.turned, looked, bench.allowed, bench.doubles, STEERED // len(starts))
        for cases in steering.cases([_drawn(bench, b""), *bench.tried]):
            bench.tried_at(start, [*map(bench.as_given, cases)])
        for base in steering.ways[:COUNTED_FROM]:
            times = repeats(bench.looked(start, [base] * ASKED_TO_COUNT, on=True), bench.counted)
            if times > counted:
                counted = times
                bench.repeat(start, base, times)


def only_after(bench: Bench, broken: Mapping[str, Case]) -> dict[str, int]:
    """The guarantees that these cases break only of a subject that has been asked so often: another process, asked one
    of them alone, answers rightly."""
    found: dict[str, int] = {}
    for name, (inputs, _) in broken.items() if bench.repeated else ():
        with bench.twin() as twin, suppress(SubjectFailed):
            values = bench.values_of(inputs, bench.outputs_of(twin.ask(bench.sent(inputs))))
            if bench.guarantees[name].judged.holds(values):
                found[name] = bench.repeated
    return found


def _drawn(bench: Bench, data: bytes) -> Inputs:
    return bench.as_given(bench.generator.case(Source(data), bench.blamed))
