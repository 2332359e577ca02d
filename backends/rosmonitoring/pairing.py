"""Pairs each answer with its inputs. Order of arrival is not causal order: each topic has its own connection.

By `arrival`, an answer is compared with the values that came before it: for traces that one process wrote in order. By
`key` or `stamp`, with those of the message that has the same key. By `latency`, each input may have had any value that
was current from `latency + jitter` before the answer to `jitter` after it, independently: what holds for all
combinations holds, what is broken for all is broken, and anything else is undecided. By `call`, with the request of the
same call, and with `others` by latency with inputs that are no part of its service or action. By `order`, the k-th with
the k-th: the engine numbers the messages of each topic (`NUMBER`), and the number is the key. Independence includes
more combinations than occurred, so that both verdicts are right as long as the two bounds are.
"""

from __future__ import annotations

import itertools
import math
from bisect import insort
from collections import OrderedDict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value, show
from avow.ros.bags import ENVELOPE

from .reading import Reader, at
from .rules import FieldPath
from .tuning import COMBINATIONS, KEYS_KEPT, LATEST_TIME, TICKS, UNANSWERED_KEPT
from .watched import UNSAID
from .wires import MappingError, NotANumber, exact, seconds

if TYPE_CHECKING:
    from .watched import Heard, Watched


NUMBER = "_number"
"""By order: the field with a message's number among those of its topic."""
AFTER = "in a loop, an input with the answer's key came after the answer: pair them in another way (`answers`)"
BEFORE = "the answer came before its input (by more than `jitter`): they do not belong together, or a time is wrong"
LOST = "a message was lost: the order of the others does not show which belong together"


@dataclass(frozen=True, slots=True)
class Answers:
    """The plan's `answers`. `by`: arrival, key, stamp, call, order or latency."""

    by: str
    because: str = ""
    input: FieldPath = ()
    output: FieldPath = ()
    latency: Fraction = Fraction(0)
    jitter: Fraction = Fraction(0)
    looped: frozenset[str] = frozenset()
    """The inputs that earlier answers of the node reach: a message after an answer may be made from it."""
    others: bool = False
    """By call: whether the other inputs are paired by latency."""
    calls: Mapping[str, str] = field(default_factory=dict)
    """With `others`: variable → the service or action of whose calls it is a part."""

    def timed(self, outputs: Collection[str], inputs: Iterable[str], key: object) -> frozenset[str]:
        """The inputs with which an answer is paired by latency."""
        if self.by == "latency":
            return frozenset(inputs)
        own = {self.calls.get(name) for name in outputs} - {None} if key is not None else set()
        return frozenset(name for name in inputs if self.calls.get(name) not in own) if self.others else frozenset()

    def precedes(self, name: str, answer: Ticks, came: Ticks, jitter: Ticks) -> bool:
        """Whether an answer is too early for a message of this input to be its cause. A time of `jitter` is allowed for
        clocks and recorders, except in a loop. All in one unit."""
        return came > answer + (0 if name in self.looped else jitter)


Ticks = int | Fraction
"""A time in units of 10^-20 seconds (`TICKS`), exact: an integer if the trace writes it in decimals."""


def ticks(seconds: Fraction) -> Ticks:
    found = seconds * TICKS
    return found.numerator if found.denominator == 1 else found


def ticks_at(event: Mapping[str, Any]) -> Ticks:
    """The `ticks` of an event's time; faster for plain digits."""
    try:
        whole, _, rest = event["time"].partition(b".")
        return int(whole + rest) * _SCALES[len(rest)]
    except (AttributeError, ValueError, IndexError):  # no digits, or with an exponent
        return ticks(time_of(event))


_SCALES: tuple[int, ...] = tuple(10 ** (20 - k) for k in range(21))


@dataclass(slots=True, eq=False)
class Asked:
    """An answer that waits for its inputs."""

    watched: Watched
    event: Mapping[str, Any]
    index: int
    known: Mapping[str, Value]
    """The values that its verdict depends on, except the inputs."""
    inputs: tuple[str, ...]
    time: Ticks
    seconds: float
    """The same, as a float."""
    key: object
    heard: Heard
    """The messages that make the answer."""
    places: tuple[int, ...]
    """Their places in the trace."""
    since: dict[str, float] = field(default_factory=dict)
    """For each input, when the oldest message came that its value may be from."""
    messages: dict[str, tuple[int, ...]] = field(default_factory=dict)
    """For each input, the places in the trace of the messages that its value may be from."""
    needless: frozenset[str] = frozenset()
    """The inputs that only assumptions speak of: there is a verdict even if they have no message yet, or an unreadable
    one."""
    unsaid: set[str] = field(default_factory=set)
    """Those of them that may have no message yet."""
    number: int = 0
    """Its number among all that were asked."""
    timed: frozenset[str] = frozenset()
    """The inputs that it is paired with by latency."""


@dataclass(slots=True, eq=False)
class InputMessage:
    """One message of an input. `value` None: it could not be read; an event: it has not been read yet."""

    time: Ticks
    seconds: float
    key: object
    value: Value | Mapping[str, Any] | None
    place: int
    used: bool = False
    """An answer was paired with it, as the only one of its key."""


@dataclass(slots=True)
class Replies:
    """Which inputs of one guarantee got no answer, although a later one did."""

    watched: Watched
    inputs: frozenset[str]
    """Those that are paired by their keys."""
    came: OrderedDict[object, set[str]] = field(default_factory=OrderedDict)
    """For each key, the inputs that have come, while others have not."""
    waiting: OrderedDict[object, None] = field(default_factory=OrderedDict)
    """The keys of inputs that are later than all answered ones."""
    passed: OrderedDict[object, None] = field(default_factory=OrderedDict)
    """The keys of earlier ones without an answer."""
    answered: OrderedDict[object, None] = field(default_factory=OrderedDict)

    def heard(self, name: str, keys: Iterable[object]) -> None:
        alone, came = len(self.inputs) == 1, self.came
        for key in keys if name in self.inputs else ():
            if key is None:
                continue
            if not alone:
                came.setdefault(key, set()).add(name)
            if (alone or len(came[key]) == len(self.inputs)) and key not in self.passed:
                came.pop(key, None)
                self.waiting[key] = None
                if key in self.answered:
                    self.answer((key,))
            _bound(came, self.waiting)

    def answer(self, keys: Iterable[object]) -> None:
        for key in keys:
            self.answered[key] = None
            self.passed.pop(key, None)
            if key in self.waiting:
                earlier = self.waiting.popitem(last=False)[0]
                while earlier is not key and earlier != key:
                    self.passed[earlier] = None
                    earlier = self.waiting.popitem(last=False)[0]
            _bound(self.passed, self.answered)
        self.watched.tally.unanswered = len(self.passed)

    def pardon(self, key: object) -> None:
        """An assumption does not hold of this input: it needs no answer."""
        self.answered[key] = None
        self.waiting.pop(key, None)


def _bound(*kept: OrderedDict[object, Any]) -> None:
    for keys in kept:
        if len(keys) > UNANSWERED_KEPT:
            keys.popitem(last=False)


Choices = list[list[InputMessage]] | str
"""The messages of each input that an answer may have answered, or why there are none."""


@dataclass(slots=True)
class _Seen:
    """The latest messages of one input, in the order of arrival (by latency: of time), and by their keys."""

    messages: deque[InputMessage] = field(default_factory=deque)
    by_key: dict[object, list[InputMessage]] = field(default_factory=dict)

    def keep(self, message: InputMessage) -> None:
        self.messages.append(message)
        self.by_key.setdefault(message.key, []).append(message)
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
    times: dict[str, _Seen] = field(default_factory=dict)
    """With `others`: the same messages in the order of time."""
    waiting: dict[int, Asked] = field(default_factory=dict)
    """The answers by their numbers."""
    asked: int = 0
    """The number of answers that were asked."""
    answered: OrderedDict[int, Mapping[str, tuple[int, ...]]] = field(default_factory=OrderedDict)
    """The place of an answer's message → the places of the messages that it was paired with."""
    readers: Mapping[str, Reader] = field(default_factory=dict, repr=False)
    """For each variable whose events are kept, its reader."""
    replies: dict[int, Replies] = field(default_factory=dict)
    """By key, stamp and call: the replies to a guarantee's inputs, by the id of the watched clause."""
    settled: Ticks | None = None
    """By latency: no input of this time or an earlier one may come any more."""
    late: str = ""
    """Why the run is no evidence: an input came too late."""
    latency: Ticks = field(init=False)
    jitter: Ticks = field(init=False)
    _awaited: dict[object, list[Asked]] = field(default_factory=dict)
    """The answers that wait for each key."""
    _touched: list[object] = field(default_factory=list)
    """The keys of the messages that came since answers were last judged."""
    _early: dict[int, Asked] = field(default_factory=dict)
    """The answers, by their numbers, to whose timed inputs later messages may belong."""

    def __post_init__(self) -> None:
        self.latency, self.jitter = ticks(self.answers.latency), ticks(self.answers.jitter)
        self.times = self.times if self.answers.others else self.seen

    def input(self, name: str) -> _Seen:
        """The messages of an input, of which there may be none yet."""
        return self.seen.setdefault(name, _Seen())

    def later(self, name: str, time: Fraction) -> int:
        """The number of messages of an input that are later than a time, as far as they are kept."""
        return sum(message.time > ticks(time) for message in self.input(name).messages)

    def heard(self, name: str, keys: Sequence[object]) -> None:
        for replies in self.replies.values():
            replies.heard(name, keys)

    def replied(self, watched: Watched, keys: Iterable[object]) -> None:
        if id(watched) in self.replies:
            self.replies[id(watched)].answer(keys)

    def begins(self, values: Mapping[str, Value]) -> None:
        """The values before any message: at no time and no place, so that they have no age."""
        for name, value in values.items():
            self.times.setdefault(name, _Seen()).messages.append(
                InputMessage(-2 * LATEST_TIME * TICKS, math.inf, None, value, 0)
            )

    def saw(
        self, name: str, time: Ticks, seconds: float, key: object, value: Value | Mapping[str, Any] | None, place: int
    ) -> InputMessage:
        """A message of an input, at a place of the trace."""
        message = InputMessage(time, seconds, key, value, place)
        if self.answers.by != "latency":
            known = self.input(name)
            self._touched.append(message.key)
            self.heard(name, (key,))
            if any(one.used and self._differ(name, one, message) for one in known.by_key.get(message.key, ())):
                self.late = self.late or f"a message of {name} has the key of one that was answered before"
            known.keep(message)
        if self.answers.by == "latency" or self.answers.others:
            self._sort(name, message)
        return message

    def _sort(self, name: str, message: InputMessage) -> None:
        """Keep a message in the order of time."""
        time, messages = message.time, self.times.setdefault(name, _Seen()).messages
        if self.settled is not None and time <= self.settled:
            self.late = self.late or (
                f"a message of {name} has the time {show(Fraction(time) / TICKS)}, and comes after answers up to then "
                "were judged: by latency, a trace has to be in the order of time"
            )
        if messages and messages[-1].time > time:
            insort(messages, message, key=_time)
        else:
            messages.append(message)
        # messages older than every open window, except the last of them, are no longer needed
        first = next(iter(self.waiting.values()), messages[-1]).time
        since = first - self.latency - 2 * self.jitter
        while len(messages) > 1 and messages[1].time <= since:
            messages.popleft()

    def _differ(self, name: str, one: InputMessage, other: InputMessage) -> bool:
        """Whether two messages have different values (an unreadable one always differs)."""
        values = self.value_of(name, one), self.value_of(name, other)
        return None in values or values[0] != values[1]

    def ask(self, asked: Asked) -> None:
        """An answer has come."""
        self.asked += 1
        asked.number = self.asked
        self.waiting[asked.number] = asked
        asked.timed = self.answers.timed(asked.watched.outputs, asked.inputs, asked.key)
        if asked.timed or self.answers.by == "latency":
            self._early[asked.number] = asked
        self._awaited.setdefault(asked.key, []).append(asked)
        self._touched.append(asked.key)

    def waits(self, event: int) -> bool:
        """Whether an answer of this event or an earlier one is not judged yet."""
        return any(asked.index <= event for asked in self.waiting.values())

    def ready(self, now: Ticks | None) -> Iterator[tuple[Asked, Choices]]:
        """The answers whose inputs are known at a time (None: the run is over), each with the messages of each input
        that it may have answered, or why there are none."""
        for asked in self._whole(now):
            del self.waiting[asked.number]
            self._early.pop(asked.number, None)
            self._awaited[asked.key].remove(asked)
            if not self._awaited[asked.key]:
                del self._awaited[asked.key]
            if asked.timed or self.answers.by == "latency":
                self.settled = max(self.settled or 0, asked.time + self.jitter)
            found: Choices = []
            for name in asked.inputs:
                one = self.current(name, asked) if name in asked.timed else self._same_key(name, asked)
                if isinstance(one, str):
                    found = one
                    break
                found.append(one)  # type: ignore[union-attr]
            for place in asked.places:
                self.answer(place, asked.messages)
            yield asked, found

    def answer(self, place: int, messages: Mapping[str, tuple[int, ...]]) -> None:
        """An answer's message was paired with these messages of inputs."""
        self.answered[place] = {**self.answered.get(place, {}), **messages}
        if len(self.answered) > KEYS_KEPT:
            self.answered.popitem(last=False)

    def _whole(self, now: Ticks | None) -> Iterator[Asked]:
        """The answers that await nothing more, in the order in which they came."""
        waiting, touched = self.waiting, {*self._touched}
        self._touched.clear()
        if now is None:
            return iter([*waiting.values()])
        timely = [*itertools.takewhile(lambda asked: now > asked.time + self.jitter, self._early.values())]
        if self.answers.by == "latency":
            return iter(timely)
        for asked in timely:
            del self._early[asked.number]
        late = itertools.takewhile(lambda asked: asked.number <= self.asked - KEYS_KEPT, waiting.values())
        ready = (*timely, *(asked for key in touched for asked in self._awaited.get(key, ())))
        whole = [asked for asked in ready if asked.number not in self._early and self._known(asked)]
        return iter(sorted({asked.number: asked for asked in (*late, *whole)}.values(), key=_number))

    def _known(self, asked: Asked) -> bool:
        """Whether all messages that an answer is paired with have come."""
        inputs = () if asked.key is None else (name for name in asked.inputs if name not in asked.timed)
        return all(name in self.seen and asked.key in self.seen[name].by_key for name in inputs)

    def cases(self, asked: Asked, choices: list[list[InputMessage]]) -> list[dict[str, Value]] | str:
        """The combinations of values that an answer may have answered, or why there are none."""
        distinct: list[list[Value | None]] = []
        for name, alike in zip(asked.inputs, choices, strict=True):
            values: list[Value | None] = [None] * (name in asked.unsaid)
            for message in alike:
                value = self.value_of(name, message)
                if value is None and name not in asked.needless:
                    return f"a message of {name} could not be read"
                if value not in values:
                    values.append(value)
            if len(values) > 1 and name not in asked.timed:
                return f"several messages of {name} have the key"
            distinct.append(values)
        if (count := math.prod(map(len, distinct))) > COMBINATIONS:
            return f"{count} combinations of inputs may have been answered"
        pairs = (zip(asked.inputs, values, strict=True) for values in itertools.product(*distinct))
        return [{**asked.known, **{name: value for name, value in one if value is not None}} for one in pairs]

    def value_of(self, name: str, message: InputMessage) -> Value | None:
        if isinstance(message.value, Mapping):
            message.value = self.readers[name](message.value, None)
        return message.value

    def current(self, name: str, asked: Asked) -> list[InputMessage] | str:
        start = asked.time - self.latency - self.jitter
        end = asked.time + self.jitter
        current: list[InputMessage] = []
        before = False
        for message in self.times[name].messages if name in self.times else ():
            if message.time <= start:
                current, before = [message], True
                asked.since[name] = message.seconds
            elif message.time <= end:
                current.append(message)
        if not before and name in asked.needless:
            asked.unsaid.add(name)
        elif not current:
            return EARLY
        elif not before:
            return f"{name}{UNSAID}"
        asked.messages[name] = tuple(message.place for message in current)
        return current

    def _same_key(self, name: str, asked: Asked) -> list[InputMessage] | str:
        if asked.key is None:
            return LOST if self.answers.by == "order" else "the answer has no key"
        known = self.seen.get(name)
        if known is None:
            return f"no message of {name} came"
        alike = known.by_key.get(asked.key)
        if not alike:
            field = " (`_call` in JSON lines)" if self.answers.by == "call" else ""
            said = f"no message of {name} has the answer's {self.answers.by}{field}"
            return f"{said}: it was lost or bears none, or `answers` pairs wrongly"
        if any(self.answers.precedes(name, asked.time, one.time, self.jitter) for one in alike):
            return AFTER if name in self.answers.looped else BEFORE
        if len(alike) == 1:
            alike[0].used = True
            asked.since[name] = alike[0].seconds
            asked.messages[name] = (alike[0].place,)
            return alike
        asked.since[name] = min(message.seconds for message in alike)
        asked.messages[name] = tuple(message.place for message in alike)
        return [*alike]

    @staticmethod
    def key(event: Mapping[str, Any], path: FieldPath) -> object:
        """The key by which a message is paired; None if it has none."""
        if not path:
            return None
        try:
            raw: Any = event
            for step in path if path[0] not in ENVELOPE else ():
                raw = raw[step]
        except (KeyError, IndexError, TypeError):  # it may be elsewhere
            raw = event
        try:
            raw = at(event, path) if raw is event else raw
            if raw.__class__ is dict:
                return _stamp(raw), "s"
        except MappingError:
            return None
        return raw.decode() if isinstance(raw, bytes) else str(raw) if isinstance(raw, list) else raw


def _stamp(raw: Mapping[str, Any]) -> int | Fraction:
    """A time in nanoseconds."""
    second, rest = raw.get("sec", raw.get("secs")), raw.get("nanosec", raw.get("nsecs"))
    if second.__class__ is int and rest.__class__ is int and len(raw) == 2:
        return int(second) * 10**9 + int(rest)
    return seconds(raw) * 10**9


def backwards(now: Fraction, latest: Fraction | None, number: int) -> str:
    """By arrival, the order of the events is taken as causal order: the contradiction, if times run backwards."""
    if latest is None or now >= latest:
        return ""
    return (
        f"event {number} has the time {show(now)} and an earlier one {show(latest)}: the order of arrival is "
        "not that of cause (`answers: {by: arrival}`)"
    )


EARLY = "before the first input"

_time, _number = attrgetter("time"), attrgetter("number")


def time_of(event: Mapping[str, Any]) -> Fraction:
    """An event's time in seconds; 0 if it has none (a recorded one always has)."""
    try:
        found = exact(event.get("time"))
    except NotANumber:
        return Fraction(0)
    if not -LATEST_TIME <= found <= LATEST_TIME:
        return Fraction(0)
    return Fraction(found) if found.__class__ is int else found  # type: ignore[return-value]
