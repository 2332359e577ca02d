"""Steers inputs to where a subject decides: from what it compares in some cases to cases in which it compares equal.

As coverage-guided fuzzers do that trace comparisons. Of a comparison of numbers the difference of its sides is what is
to be nought: each number and length of a case is turned a little to see whether and how fast the difference moves with
it, and then as far as it takes (the secant method: one step where it is linear). Of texts the other side is put into
each text. A case in which something new is compared, or something comes out the other way, is steered from in its turn.

What is found are cases to be tried, and no more: they are judged as all others are.
"""

from __future__ import annotations

import itertools
import math
import random
import time
from collections import Counter, deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.isolation.scout import Sight
from avow.isolation.subject import SubjectFailed
from avow.language.sorts import Sort, StringSort

from . import tuning
from .convention import Case
from .generate import Impossible, Inputs, Source
from .knobs import Knob, at, knobs, put
from .pools import STEP, variants
from .shrink import OutOfTime

if TYPE_CHECKING:
    from .bench import Bench


Look = Callable[[Sequence[Inputs]], list[tuple[Sight, ...]]]
"""What the subject compares of each of some inputs."""

Place = tuple[int, int]
"""Of a comparison: where in the program, and the how manieth time (from the last: -1)."""

Seen = dict[Place, Sight]


@dataclass(slots=True)
class Steering:
    """`allowed`: whether inputs meet the assumptions. `left`: how many more cases it may come up with."""

    sorts: Mapping[str, Sort]
    look: Look
    allowed: Callable[[Inputs], bool]
    doubles: bool
    left: int = tuning.STEERED
    ways: list[Inputs] = field(default_factory=list)
    """Cases that were steered from."""
    _turned: Counter[Any] = field(default_factory=Counter)
    _outcomes: set[tuple[int, int]] = field(default_factory=set)
    """(place, which way it came out)."""
    _known: set[str] = field(default_factory=set)

    def cases(self, bases: Iterable[Inputs]) -> Iterator[list[Inputs]]:
        """Cases to be tried, a few at a time."""
        every = list(bases)
        waiting = deque(base for base, seen in zip(every, self._looked(every), strict=True) if self._new(seen))
        waiting.extend(every[: not waiting])  # nothing is compared of any: perhaps of what is beside one
        while waiting and self.left > 0 and len(self.ways) < tuning.STEERED_FROM:
            base = waiting.popleft()
            self.ways.append(base)
            found: list[Inputs] = []
            for case in self._from(base):
                if repr(case) not in self._known and self.allowed(case):
                    self._known.add(repr(case))
                    found.append(case)
            found = found[: self.left]
            self.left -= len(found)
            for case, seen in zip(found, self._looked(found), strict=True):
                if self._new(seen):
                    waiting.append(case)
            if found:
                yield found

    def _looked(self, cases: Sequence[Inputs]) -> list[Seen]:
        return [places(sights) for sights in self.look(cases)] if cases else []

    def _new(self, seen: Seen) -> bool:
        """Whether something is compared, or comes out, as never before."""
        ways = {(place[0], _way(sight)) for place, sight in seen.items()}
        new = not ways <= self._outcomes
        self._outcomes |= ways
        return new

    def _from(self, base: Inputs) -> Iterator[Inputs]:
        (seen,) = self._looked([base])
        self._new(seen)
        every = knobs(base, self.sorts)
        for knob in every:
            yield from (put(base, knob, choice) for choice in knob.choices() if choice != at(base, knob))
        yield from self._texts(base, [k for k in every if isinstance(k.sort, StringSort)], seen)
        yield from self._numbers(base, [k for k in every if k.numeric], seen)

    # -- texts -------------------------------------------------------------------------------------------

    def _texts(self, base: Inputs, texts: list[Knob], seen: Seen) -> Iterator[Inputs]:
        said = [side for sight in seen.values() for side in (sight.right, sight.left) if isinstance(side, str)]
        for knob in texts:
            for text in dict.fromkeys(said):
                if self._turned[knob.path] < tuning.STEERED_TEXTS and not self._turned[knob.path, text]:
                    self._turned[knob.path] += 1
                    self._turned[knob.path, text] += 1
                    yield from (put(base, knob, other) for other in (text, *variants(text)))
            yield put(base, knob, "1")  # what may be read as a number
            yield from self._parts(base, knob, seen)
            longer = [int(n) for s in seen.values() for n in (s.left, s.right) if isinstance(n, Fraction)]
            for length in dict.fromkeys(n for n in longer if 2 < n <= 5000):
                if self._turned[knob.path, length] == 0 and self._turned[knob.path, "long"] < tuning.STEERED_TEXTS:
                    self._turned[knob.path, length] += 1
                    self._turned[knob.path, "long"] += 1
                    yield from (put(base, knob, "x" * (length + more)) for more in (-1, 0, 1))
                    yield from (put(base, knob, text) for text in _padded(f"{at(base, knob)}", length + 1))

    def _parts(self, base: Inputs, knob: Knob, seen: Seen) -> Iterator[Inputs]:
        """A part of a text that is compared by itself is put right where it stands, also one that is read as a
        number."""
        now = f"{at(base, knob)}"
        pairs = [pair for s in seen.values() for pair in ((s.left, s.right), (s.right, s.left))]
        for one, other in dict.fromkeys((_spelled(one), wanted) for one, wanted in pairs):
            for part in _wanted(other):
                for text in dict.fromkeys(_with_part(now, one, part)):
                    turned = (knob.path, "part", text)
                    if text != now and not self._turned[turned] and self._turned[turned[:2]] < tuning.STEERED_TEXTS:
                        self._turned[turned] += 1
                        self._turned[turned[:2]] += 1
                        case = put(base, knob, text)
                        yield case
                        (then,) = self._looked([case])
                        if _agreeing(then) > _agreeing(seen):  # on from here: other parts are yet to be put right
                            yield from self._parts(case, knob, then)

    # -- numbers -----------------------------------------------------------------------------------------

    def _numbers(self, base: Inputs, numbers: list[Knob], seen: Seen) -> Iterator[Inputs]:
        apart = {place: d for place, sight in seen.items() if (d := _difference(sight)) is not None}
        wanted = {place for place in apart if self._turned[place[0]] < tuning.STEERED_PLACES}
        if not wanted:
            return
        moving = self._moving(base, numbers, {place: apart[place] for place in wanted})
        for place, ways in moving.items():
            for knob, slope in ways:
                if self._turned[place[0]] < tuning.STEERED_PLACES and self._turned[place, knob.path] < 2:
                    self._turned[place[0]] += 1
                    self._turned[place, knob.path] += 1
                    yield from self._steered(base, knob, place, apart[place], slope)
                    yield from _by_bits(base, knob, seen[place])

    def _moving(
        self, base: Inputs, numbers: list[Knob], apart: Mapping[Place, Fraction]
    ) -> dict[Place, list[tuple[Knob, Fraction]]]:
        """The numbers with which each difference moves, and how fast."""
        found: dict[Place, list[tuple[Knob, Fraction]]] = {place: [] for place in apart}
        still = list(numbers)
        for turn in tuning.TURNS:
            tried = [(knob, self._by(base, knob, Fraction(turn))) for knob in still]
            made = [(knob, case) for knob, case in tried if case is not None]
            moved: set[Knob] = set()
            for (knob, _), seen in zip(made, self._looked([case for _, case in made]), strict=True):
                for place, before in apart.items():
                    now = _difference(seen[place]) if place in seen else None
                    if now is not None and now != before:
                        found[place].append((knob, (now - before) / turn))
                        moved.add(knob)
            still = [knob for knob in still if knob not in moved]
        return found

    def _by(self, base: Inputs, knob: Knob, distance: Fraction) -> Inputs | None:
        now = at(base, knob)
        fitting = knob.fitting(Fraction(now) + distance) if isinstance(now, int | Fraction) else None
        return put(base, knob, fitting) if fitting is not None else None

    def _steered(self, base: Inputs, knob: Knob, place: Place, apart: Fraction, slope: Fraction) -> Iterator[Inputs]:
        """At and beside the value of one number at which the two sides meet."""
        now = at(base, knob)
        assert isinstance(now, int | Fraction)
        here, goal = Fraction(now), Fraction(now)
        for _ in range(tuning.STEERED_STEPS):
            goal = _short(here - apart / slope)
            near = goal if not knob.whole else Fraction(round(goal))
            case = put(base, knob, number) if (number := knob.fitting(near)) is not None else None
            (seen,) = self._looked([case]) if case is not None else ({},)
            then = _difference(seen[place]) if place in seen else None
            goal = near
            if then is None or then in (0, apart) or near == here:
                break
            slope, here, apart = (then - apart) / (near - here), near, then
        for beside in _beside(goal, knob.whole, self.doubles):
            fitting = knob.fitting(beside)
            if fitting is not None:
                yield put(base, knob, fitting)


def repeats(cases: Iterable[tuple[Sight, ...]], most: int) -> int:
    """How often the same is to be asked until what a subject counts comes to where it compares equal, from what was
    seen as it was asked a few times; 0 where nothing is seen to count."""
    asked = [places(sights) for sights in cases]
    found = 0
    for place in asked[-1] if asked else ():
        apart = [d for seen in asked[1:] if place in seen and (d := _difference(seen[place])) is not None]
        steps = {now - before for before, now in itertools.pairwise(apart)}
        if len(apart) < len(asked) - 1 or not steps:
            continue
        step = max(steps, key=abs)
        steady = max(abs(step - other) for other in steps) * 1000 <= abs(step)
        if step and steady and 0 < -apart[-1] / step <= most:
            found = max(found, math.ceil(-apart[-1] / step) + 5)
    return found


def places(sights: Iterable[Sight]) -> Seen:
    """The comparisons among what was seen: of each place the first few and the last."""
    found: Seen = {}
    count: Counter[int] = Counter()
    for sight in sights:
        if sight.right is None:
            continue
        nth = count[sight.place]
        count[sight.place] += 1
        found[sight.place, nth if nth < 3 else -1] = sight
    return found


def constants(cases: Sequence[tuple[Sight, ...]]) -> tuple[frozenset[Fraction], frozenset[str]]:
    """The numbers and texts by which the subject decides, whatever its inputs were: what each place has had, where it
    had the same in all of these cases, or nearly."""
    had: dict[Any, Counter[Any]] = {}
    for sights in cases:
        count: Counter[tuple[int, str]] = Counter()
        for sight in sights:
            nth = count[sight.place, sight.what]
            count[sight.place, sight.what] += 1
            for side, value in (("left", sight.left), ("right", sight.right)):
                if value is not None:
                    key = (sight.place, value) if sight.place < 0 else (sight.place, sight.what, nth, side)
                    had.setdefault(key, Counter())[value] += 1
    steady = [v for values in had.values() if len(values) <= 1 + values.total() // 8 for v in values]
    texts = {value for value in steady if isinstance(value, str)}
    numbers = {value for value in steady if isinstance(value, Fraction)}
    numbers |= {Fraction(text) for text in texts if text.isdecimal() and len(text) < 20}
    return frozenset(numbers), frozenset(texts)


def _agreeing(seen: Seen) -> int:
    return sum(s.left == s.right or (s.what == "in" and f"{s.left}" in f"{s.right}") for s in seen.values())


def _spelled(side: Any) -> str | None:
    """As it stands in a text, if it can."""
    if isinstance(side, Fraction):
        return str(side.numerator) if side.denominator == 1 else None
    return side if isinstance(side, str) else None


def _wanted(side: Any) -> tuple[str, ...]:
    """What is put in the place of a part; of a whole number its neighbours, too."""
    spelled = _spelled(side)
    if isinstance(side, Fraction) and spelled is not None:
        return spelled, str(side.numerator - 1), str(side.numerator + 1)
    return (spelled,) if spelled is not None else ()


def _with_part(text: str, one: str | None, other: str) -> tuple[str, ...]:
    """The text with another part, at its first place and at its last."""
    if one is None or one not in text:
        return ()
    head, _, tail = text.rpartition(one) if one else (text, "", "")
    return (text.replace(one, other, 1), head + other + tail)


def _padded(text: str, length: int) -> tuple[str, str]:
    return text.rjust(length, "x"), text.ljust(length, "x")


def _by_bits(base: Inputs, knob: Knob, sight: Sight) -> Iterator[Inputs]:
    """With the bits turned in which the two sides differ: where some are masked, or turned, by the subject."""
    now, left, right = at(base, knob), sight.left, sight.right
    if knob.whole and isinstance(now, int) and isinstance(left, Fraction) and isinstance(right, Fraction):
        whole = left.denominator == right.denominator == 1
        fitting = knob.fitting(Fraction(now ^ left.numerator ^ right.numerator)) if whole else None
        if fitting is not None:
            yield put(base, knob, fitting)


def _difference(sight: Sight) -> Fraction | None:
    if isinstance(sight.left, Fraction) and isinstance(sight.right, Fraction):
        return sight.left - sight.right
    return None


def _way(sight: Sight) -> int:
    """Which way a comparison comes out."""
    left: Any = sight.left
    right: Any = sight.right
    return int(left > right) - int(left < right)


def _short(number: Fraction) -> Fraction:
    """A number that can be written: of what has more digits, the nearest double."""
    if number.denominator < 10**9:
        return number
    try:
        return Fraction(float(number))
    except OverflowError:
        return number


def _beside(number: Fraction, whole: bool, doubles: bool) -> Iterator[Fraction]:
    yield number
    yield from (number + d for d in (-1, 1))
    if whole:
        return
    yield from (number + d for d in (-STEP, STEP))
    try:
        near = float(number)
    except OverflowError:
        return
    if doubles:
        ends = (math.nextafter(near, -math.inf), near, math.nextafter(near, math.inf))
        yield from (Fraction(end) for end in ends if math.isfinite(end))


# -- what a bench does with it -----------------------------------------------------------------------------------------


def learn(bench: Bench) -> None:
    """Inputs are made from what the subject compares with in a few drawn cases, and from what its modules hold."""
    with suppress(Impossible):
        drawn = [_drawn(bench, random.Random(k).randbytes(tuning.CASE_BYTES)) for k in range(tuning.SAMPLED)]
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

        steering = Steering(bench.turned, looked, bench.allowed, bench.doubles, tuning.STEERED // len(starts))
        for cases in steering.cases([_drawn(bench, b""), *bench.tried]):
            bench.tried_at(start, [*map(bench.as_given, cases)])
        for base in steering.ways[: tuning.COUNTED_FROM]:
            times = repeats(bench.looked(start, [base] * tuning.ASKED_TO_COUNT, on=True), bench.counted)
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
