"""Which input did this answer answer? Order of arrival is not order of cause: each topic has its own connection.

By `arrival`, an answer is held against the values that came before it: for traces that one process wrote in order. By
`key` or `stamp`, against those of the message that bears the same key. By `latency`, each input may have had any value
that was current from `latency + jitter` before the answer to `jitter` after it, independently: what holds for all
combinations holds, what is broken for all is broken, and anything else is undecided. By `call`, against the request of
the same call; by `order`, the k-th against the k-th, where there are as many of both. Independence takes in more
combinations than there were, so that both verdicts are right as long as the two bounds are.
"""

from __future__ import annotations

import itertools
from bisect import insort
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from operator import itemgetter
from typing import Any

from avow.formulas.values import Value, show

from .numbers import Decimal, NotANumber, exact
from .reading import at
from .rules import Path
from .tuning import COMBINATIONS, KEYS_KEPT
from .wires import MappingError, seconds


@dataclass(frozen=True, slots=True)
class Answers:
    """The plan's `answers`. `by`: arrival, key, stamp, call, order or latency."""

    by: str
    because: str = ""
    input: Path = ()
    output: Path = ()
    latency: Fraction = Fraction(0)
    jitter: Fraction = Fraction(0)


@dataclass(slots=True)
class Asked:
    """An answer that waits for its inputs."""

    about: Any
    """What is to be judged, as the engine knows it."""
    event: Mapping[str, Any]
    index: int
    values: dict[str, Value]
    """Of all but the inputs."""
    inputs: tuple[str, ...]
    time: Fraction
    key: object = None
    since: dict[str, float] = field(default_factory=dict)
    """When the oldest message came that each input's value may be of."""


@dataclass(slots=True)
class Pairing:
    """The inputs that have been seen, and the answers that wait for theirs."""

    answers: Answers
    seen: dict[str, deque[tuple[Fraction, object, Value | None]]] = field(default_factory=dict)
    """Input → (when, key, value; None: it could not be read), in the order of time."""
    waiting: deque[Asked] = field(default_factory=deque)
    counts: dict[str, int] = field(default_factory=dict)
    """Input → how many messages."""
    asked: dict[int, tuple[int, Asked]] = field(default_factory=dict)
    """By what is judged: how many answers, and the last of them."""
    settled: Fraction | None = None
    """By latency: no input of this time or an earlier one may come any more."""
    late: str = ""
    """Why it is no evidence: one came."""

    def saw(self, name: str, event: Mapping[str, Any], value: Value | None) -> None:
        known = self.seen.setdefault(name, deque())
        self.counts[name] = self.counts.get(name, 0) + 1
        key = self.counts[name] if self.answers.by == "order" else self._key(event, self.answers.input)
        if self.answers.by == "latency":
            now = time_of(event)
            if self.settled is not None and now <= self.settled:
                self.late = self.late or (
                    f"a message of {name} has the time {show(now)}, and comes after answers up to then were judged: by "
                    "latency, a trace has to be in the order of time"
                )
            insort(known, (now, key, value), key=itemgetter(0))
            # what is older than any window that is still open, but for the last of it, can no longer be asked for
            first = self.waiting[0].time if self.waiting else known[-1][0]
            since = first - self.answers.latency - 2 * self.answers.jitter
            while len(known) > 1 and known[1][0] <= since:
                known.popleft()
            return
        known.append((time_of(event), key, value))
        if len(known) > KEYS_KEPT:
            known.popleft()

    def ask(
        self, about: Any, event: Mapping[str, Any], index: int, values: dict[str, Value], inputs: tuple[str, ...],
        *, waits: bool = True,
    ) -> None:  # fmt: skip
        """An answer has come. One that does not wait to be judged counts among the others all the same."""
        count = self.asked[id(about)][0] + 1 if id(about) in self.asked else 1
        key = count if self.answers.by == "order" else self._key(event, self.answers.output)
        asked = Asked(about, event, index, values, inputs, time_of(event), key)
        self.asked[id(about)] = count, asked
        if waits:
            self.waiting.append(asked)

    def uneven(self) -> str:
        """Why the answers need not be paired rightly; empty where they are. By order, what came after the last answer
        need not have been answered yet."""
        if self.late:
            return self.late
        for count, asked in self.asked.values() if self.answers.by == "order" else ():
            for name in asked.inputs:
                whole = self.counts.get(name, 0)
                late = sum(when > asked.time for when, _, _ in self.seen.get(name, ()))
                if count not in (whole, whole - late):
                    return (
                        f"{whole} messages of {name} and {count} answers: which answer was to which is not told by "
                        "their order (`answers: {by: order}`)"
                    )
        return ""

    def ready(self, now: Fraction | None) -> Iterator[tuple[Asked, list[dict[str, Value]] | str]]:
        """The answers whose inputs are known by a time (None: the run is over), each with the combinations of values
        that it may have answered, or why there are none."""
        while self.waiting:
            asked = self.waiting[0]
            found = self._values(asked)
            due = now is None or self._passed(asked, now)
            if not due:
                return
            self.waiting.popleft()
            if self.answers.by == "latency":
                self.settled = max(self.settled or Fraction(0), asked.time + self.answers.jitter)
            yield asked, found

    def _passed(self, asked: Asked, now: Fraction) -> bool:
        if self.answers.by == "latency":
            return now > asked.time + self.answers.jitter
        known = all(any(key == asked.key for _, key, _ in self.seen.get(name, ())) for name in asked.inputs)
        return known or len(self.waiting) > KEYS_KEPT

    def _values(self, asked: Asked) -> list[dict[str, Value]] | str:
        choices: list[list[Value]] = []
        for name in asked.inputs:
            found = self._latency(name, asked) if self.answers.by == "latency" else self._same_key(name, asked)
            if isinstance(found, str):
                return found
            choices.append(found)
        count = 1
        for values in choices:
            count *= len(values)
        if count > COMBINATIONS:
            return f"{count} combinations of inputs may have been answered"
        return [
            {**asked.values, **dict(zip(asked.inputs, values, strict=True))} for values in itertools.product(*choices)
        ]

    def _latency(self, name: str, asked: Asked) -> list[Value] | str:
        start = asked.time - self.answers.latency - self.answers.jitter
        end = asked.time + self.answers.jitter
        current: list[Value | None] = []
        before = False
        for when, _, value in sorted(self.seen.get(name, ()), key=lambda one: one[0]):
            if when <= start:
                current, before = [value], True
                asked.since[name] = float(when)
            elif when <= end:
                current.append(value)
        if not current:
            return EARLY
        if not before:
            return f"{name} may have had no value yet"
        if any(value is None for value in current):
            return f"a message of {name} could not be read"
        distinct: list[Value] = []
        for value in current:
            if value is not None and value not in distinct:
                distinct.append(value)
        return distinct

    def _same_key(self, name: str, asked: Asked) -> list[Value] | str:
        if asked.key is None:
            return "the answer has no key"
        alike = [(when, value) for when, key, value in self.seen.get(name, ()) if key == asked.key]
        found = [value for _, value in alike]
        if not found:
            return f"no message of {name} bears the answer's {self.answers.by}"
        asked.since[name] = float(min(when for when, _ in alike))
        if found[-1] is None:
            return f"a message of {name} could not be read"
        return [found[-1]] if all(value == found[-1] for value in found) else f"several messages of {name} bear the key"

    def _key(self, event: Mapping[str, Any], path: Path) -> object:
        if not path:
            return None
        try:
            raw = at(event, path)
        except MappingError:
            return None
        try:
            return seconds(raw) if isinstance(raw, Mapping) else raw.text if isinstance(raw, Decimal) else raw
        except MappingError:
            return None


EARLY = "before the first input"


def time_of(event: Mapping[str, Any]) -> Fraction:
    """An event's time in seconds; 0 where it says none (which a recorded one always does)."""
    try:
        return Fraction(exact(event.get("time")))
    except NotANumber:
        return Fraction(0)
