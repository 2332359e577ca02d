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
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value, show

from .numbers import Decimal, NotANumber, exact
from .reading import at
from .rules import Path
from .tuning import COMBINATIONS, KEYS_KEPT, LATEST_TIME
from .wires import MappingError, seconds

if TYPE_CHECKING:
    from .watched import Heard, Watched


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

    about: tuple[Watched, Heard]
    """The clause, and the messages that make the answer."""
    event: Mapping[str, Any]
    index: int
    values: dict[str, Value]
    """Of all but the inputs."""
    inputs: tuple[str, ...]
    time: Fraction
    key: object = None
    since: dict[str, float] = field(default_factory=dict)
    """When the oldest message came that each input's value may be of."""
    messages: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """The places in the trace of the messages that each input's value may be of."""


@dataclass(frozen=True, slots=True)
class _Said:
    """One message of an input. `value` None: it could not be read."""

    time: Fraction
    key: object
    value: Value | None
    place: int


@dataclass(slots=True)
class _Seen:
    """The latest messages of one input, in the order of their coming (by latency: of time), and by their keys."""

    messages: deque[_Said] = field(default_factory=deque)
    by_key: dict[object, list[_Said]] = field(default_factory=dict)
    count: int = 0
    """Of all, also of those that are no longer kept."""

    def keep(self, said: _Said) -> None:
        self.messages.append(said)
        self.by_key.setdefault(said.key, []).append(said)
        if len(self.messages) > KEYS_KEPT:
            old = self.messages.popleft()
            alike = self.by_key[old.key]
            alike.remove(old)
            if not alike:
                del self.by_key[old.key]


@dataclass(slots=True)
class Pairing:
    """The inputs that have been seen, and the answers that wait for theirs."""

    answers: Answers
    seen: dict[str, _Seen] = field(default_factory=dict)
    waiting: deque[Asked] = field(default_factory=deque)
    asked: dict[int, tuple[int, Asked]] = field(default_factory=dict)
    """By what is judged: how many answers, and the last of them."""
    answered: dict[int, Mapping[str, tuple[int, ...]]] = field(default_factory=dict)
    """The place of an answer's message → those of the messages that it was held against."""
    settled: Fraction | None = None
    """By latency: no input of this time or an earlier one may come any more."""
    late: str = ""
    """Why it is no evidence: one came."""

    def saw(self, name: str, event: Mapping[str, Any], value: Value | None, place: int) -> None:
        """A message of an input, which stands at a place of the trace."""
        known = self.seen.setdefault(name, _Seen())
        known.count += 1
        now = time_of(event)
        if self.answers.by != "latency":
            key = known.count if self.answers.by == "order" else self._key(event, self.answers.input)
            known.keep(_Said(now, key, value, place))
            return
        if self.settled is not None and now <= self.settled:
            self.late = self.late or (
                f"a message of {name} has the time {show(now)}, and comes after answers up to then were judged: by "
                "latency, a trace has to be in the order of time"
            )
        insort(known.messages, _Said(now, None, value, place), key=_time)
        # what is older than any window that is still open, but for the last of it, can no longer be asked for
        first = self.waiting[0].time if self.waiting else known.messages[-1].time
        since = first - self.answers.latency - 2 * self.answers.jitter
        while len(known.messages) > 1 and known.messages[1].time <= since:
            known.messages.popleft()

    def ask(
        self, about: tuple[Watched, Heard], event: Mapping[str, Any], index: int, values: dict[str, Value],
        inputs: tuple[str, ...], *, waits: bool = True,
    ) -> None:  # fmt: skip
        """An answer has come. One that does not wait to be judged counts among the others all the same."""
        of = id(about[0])
        count = self.asked[of][0] + 1 if of in self.asked else 1
        key = count if self.answers.by == "order" else self._key(event, self.answers.output)
        asked = Asked(about, event, index, values, inputs, time_of(event), key)
        self.asked[of] = count, asked
        if waits:
            self.waiting.append(asked)

    def waits(self, event: int) -> bool:
        """Whether an answer of this event or an earlier one is not judged yet."""
        return any(asked.index <= event for asked in self.waiting)

    def uneven(self) -> str:
        """Why the answers need not be paired rightly; empty where they are. By order, what came after the last answer
        need not have been answered yet."""
        if self.late:
            return self.late
        for count, asked in self.asked.values() if self.answers.by == "order" else ():
            for name in asked.inputs:
                known = self.seen.get(name, _Seen())
                late = sum(said.time > asked.time for said in known.messages)
                if count not in (known.count, known.count - late):
                    return (
                        f"{known.count} messages of {name} and {count} answers: which answer was to which is not told "
                        "by their order (`answers: {by: order}`)"
                    )
        return ""

    def ready(self, now: Fraction | None) -> Iterator[tuple[Asked, list[dict[str, Value]] | str]]:
        """The answers whose inputs are known by a time (None: the run is over), each with the combinations of values
        that it may have answered, or why there are none."""
        while self.waiting and (now is None or self._passed(self.waiting[0], now)):
            asked = self.waiting.popleft()
            if self.answers.by == "latency":
                self.settled = max(self.settled or Fraction(0), asked.time + self.answers.jitter)
            found = self._values(asked)
            for message, _ in asked.about[1].values():
                self.answered[message] = asked.messages
            while len(self.answered) > KEYS_KEPT:
                del self.answered[next(iter(self.answered))]
            yield asked, found

    def _passed(self, asked: Asked, now: Fraction) -> bool:
        if self.answers.by == "latency":
            return now > asked.time + self.answers.jitter
        known = all(name in self.seen and asked.key in self.seen[name].by_key for name in asked.inputs)
        return known or len(self.waiting) > KEYS_KEPT

    def _values(self, asked: Asked) -> list[dict[str, Value]] | str:
        choices: list[list[Value]] = []
        for name in asked.inputs:
            found = self._latency(name, asked) if self.answers.by == "latency" else self._same_key(name, asked)
            if isinstance(found, str):
                return found
            choices.append(found)
        if all(len(values) == 1 for values in choices):
            return [{**asked.values, **{name: one for name, (one,) in zip(asked.inputs, choices, strict=True)}}]
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
        current: list[_Said] = []
        before = False
        for said in self.seen[name].messages if name in self.seen else ():
            if said.time <= start:
                current, before = [said], True
                asked.since[name] = float(said.time)
            elif said.time <= end:
                current.append(said)
        if not current:
            return EARLY
        if not before:
            return f"{name} may have had no value yet"
        asked.messages[name] = tuple(said.place for said in current)
        distinct: list[Value] = []
        for said in current:
            if said.value is None:
                return f"a message of {name} could not be read"
            if said.value not in distinct:
                distinct.append(said.value)
        return distinct

    def _same_key(self, name: str, asked: Asked) -> list[Value] | str:
        if asked.key is None:
            return "the answer has no key"
        alike = self.seen[name].by_key.get(asked.key, ()) if name in self.seen else ()
        if not alike:
            return f"no message of {name} bears the answer's {self.answers.by}"
        asked.since[name] = float(min(said.time for said in alike))
        asked.messages[name] = tuple(said.place for said in alike)
        value = alike[-1].value
        if value is None:
            return f"a message of {name} could not be read"
        same = len(alike) == 1 or all(said.value == value for said in alike)
        return [value] if same else f"several messages of {name} bear the key"

    def _key(self, event: Mapping[str, Any], path: Path) -> object:
        if not path:
            return None
        try:
            raw = at(event, path)
        except MappingError:
            return None
        try:
            key = seconds(raw) if isinstance(raw, Mapping) else raw.text if isinstance(raw, Decimal) else raw
        except MappingError:
            return None
        return str(key) if isinstance(key, list) else key


def backwards(now: Fraction, latest: Fraction | None, number: int) -> str:
    """By arrival, the order of the events is that of cause: what times that run backwards say otherwise."""
    if latest is None or now >= latest:
        return ""
    return (
        f"event {number} has the time {show(now)} and an earlier one {show(latest)}: this is not the order of cause "
        "(`answers: {by: arrival}`)"
    )


EARLY = "before the first input"

_time = attrgetter("time")


def time_of(event: Mapping[str, Any]) -> Fraction:
    """An event's time in seconds; 0 where it says none (which a recorded one always does)."""
    try:
        found = exact(event.get("time"))
    except NotANumber:
        return Fraction(0)
    if not -LATEST_TIME <= found <= LATEST_TIME:
        return Fraction(0)
    return Fraction(found) if found.__class__ is int else found  # type: ignore[return-value]
