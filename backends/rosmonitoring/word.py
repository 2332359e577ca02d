"""The steps of clauses that speak of other steps, if a stamp, key, call or order says which messages belong together.

Each topic keeps the order of its publisher; there is no order between topics. So a step consists of the messages with
one key on all topics of the clauses, inputs before outputs, and the steps have the order of the messages of each topic:
this sequence is the word. Messages that no step contains before the next one (one was lost, came twice, or has no key)
may have been a step that was not seen.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.formulas.formula import free_variables
from avow.language.contract import Clause
from avow.language.subterms import histories, timed
from avow.language.terms import Role

from .options import Setup, same_topic
from .pairing import Answers, Pairing, time_of
from .parameters import constant
from .reading import Reader
from .rules import Previous, of_latest
from .tuning import KEYS_KEPT

if TYPE_CHECKING:
    from .engine import Monitor
    from .watched import Violation


@dataclass(frozen=True, slots=True, eq=False)
class Message:
    """One message of the word's topics."""

    topic: str
    event: Mapping[str, Any]
    index: int
    place: int
    """The place in the trace."""
    readers: tuple[tuple[str, Reader], ...]
    """The variables that it carries."""
    missed: bool
    """Others of its topic before it were lost, or come later, according to their numbers."""
    key: object = None


@dataclass(frozen=True, slots=True)
class Step:
    inputs: tuple[Message, ...]
    outputs: tuple[Message, ...]
    whole: bool
    """It is a step; otherwise these messages belong to no step, and some steps may not have been seen."""

    @property
    def missed(self) -> bool:
        return not self.whole or any(message.missed for message in (*self.inputs, *self.outputs))


@dataclass(slots=True)
class Word:
    """Puts messages in the order of the word. It keeps at most `KEYS_KEPT` messages of each topic."""

    answers: Answers
    topics: Mapping[str, bool]
    """The topics of the clauses, and whether each carries outputs."""
    answered: OrderedDict[int, Mapping[str, tuple[int, ...]]] = field(default_factory=OrderedDict)
    """As `Pairing.answered`."""
    _queues: dict[str, deque[Message]] = field(default_factory=dict)
    _where: dict[object, set[str]] = field(default_factory=dict)
    """For each key, the topics on which it waits."""
    _gone: OrderedDict[object, None] = field(default_factory=OrderedDict)
    """The latest keys that no longer wait, or came twice."""

    def __post_init__(self) -> None:
        self._queues = {topic: deque() for topic in self.topics}

    def hears(self, message: Message) -> Iterator[Step]:
        """The steps that are known now that a message has come."""
        topic, queue = message.topic, self._queues[message.topic]
        key = self._key(message)
        where = self._where.setdefault(key, set())
        if key in self._gone or topic in where:  # twice on one topic: it is unknown which of the two is meant
            self._forget(key)
            key = object()
            where = self._where.setdefault(key, set())
        where.add(topic)
        queue.append(replace(message, key=key))
        if len(where) == len(self.topics):
            yield from self._reach(key, self.topics)
        elif len(queue) > KEYS_KEPT:
            yield from self._unpaired([queue.popleft()])

    def later(self, topic: str, time: Fraction) -> int:
        """The number of messages that wait and are later than a time."""
        return sum(time_of(message.event) > time for message in self._queues[topic])

    def finish(self, *, uneven: bool) -> Iterator[Step]:
        """The run is over. Inputs without an answer are in order among themselves, unless the topics are `uneven`."""
        left = {topic: queue for topic, queue in self._queues.items() if queue}
        if not any(self.topics[topic] for topic in left) and not uneven:
            for key in [message.key for queue in left.values() for message in queue]:
                if self._where.get(key, set()) >= {t for t, output in self.topics.items() if not output}:
                    yield from self._reach(key, left)
        yield from self._unpaired([message for queue in self._queues.values() for message in queue])
        for queue in self._queues.values():
            queue.clear()

    def waits(self, event: int) -> bool:
        """Whether a message of this event or an earlier one belongs to no step yet."""
        return any(queue and queue[0].index <= event for queue in self._queues.values())

    def _key(self, message: Message) -> object:
        answers, output = self.answers, self.topics[message.topic]
        key = Pairing.key(message.event, answers.output if output else answers.input)
        return object() if key is None else key

    def _reach(self, key: object, topics: Mapping[str, object]) -> Iterator[Step]:
        """The step of a key, preceded by the messages that can no longer be part of a step."""
        passed: list[Message] = []
        taken: list[Message] = []
        for topic in topics:
            queue = self._queues[topic]
            while (message := queue.popleft()).key != key:
                passed.append(message)
            taken.append(message)
        yield from self._unpaired(passed)
        self._forget(key)
        inputs = tuple(message for message in taken if not self.topics[message.topic])
        outputs = tuple(message for message in taken if self.topics[message.topic])
        pairs = ((n, time_of(o.event), time_of(i.event)) for o in outputs for i in inputs for n, _ in i.readers)
        if any(self.answers.precedes(*pair, self.answers.jitter) for pair in pairs):
            yield from self._unpaired(taken)
            return
        given = {name: (message.place,) for message in inputs for name, _ in message.readers}
        for message in outputs:
            self.answered[message.place] = given
        while len(self.answered) > KEYS_KEPT:
            self.answered.popitem(last=False)
        yield Step(inputs, outputs, whole=True)

    def _unpaired(self, messages: list[Message]) -> Iterator[Step]:
        by_key: dict[object, list[Message]] = {}
        for message in messages:
            by_key.setdefault(message.key, []).append(message)
        for key, some in by_key.items():
            self._forget(key)
            outputs = tuple(message for message in some if self.topics[message.topic])
            yield Step(tuple(message for message in some if message not in outputs), outputs, whole=False)

    def _forget(self, key: object) -> None:
        self._where.pop(key, None)
        self._gone[key] = None
        self._gone.move_to_end(key)
        while len(self._gone) > KEYS_KEPT:
            self._gone.popitem(last=False)


def follow(monitor: Monitor, steps: Iterable[Step], found: list[Violation]) -> None:
    """Judge the given steps of the word."""
    now = monitor.events
    for step in steps:
        if step.missed:
            monitor.miss({*monitor.setup.rules})
        for part in (step.inputs, step.outputs):
            updated: dict[str, bool] = {}
            for message in part:
                monitor.events = message.index
                updated |= monitor.read(message.event, message.place, message.readers, found)
                monitor.since |= dict.fromkeys(updated, float(time_of(message.event)))
            if step.whole and part:
                monitor.conclude(updated, part[-1].event, found)
        if not step.whole:
            _pass(monitor, {name for message in (*step.inputs, *step.outputs) for name, _ in message.readers})
    monitor.events = now


def _pass(monitor: Monitor, names: set[str]) -> None:
    """Messages with these variables are part of no step: the values after them are unknown."""
    for watched in monitor.about(names):
        watched.tally.published += 1
        watched.tally.unsure(ALONE)
        watched.memory.clear()
    inputs = all(name.startswith(f"{Role.INPUT}.") for name in names)
    for watched in monitor.about(monitor.clauses) if inputs else ():
        watched.tally.unanswered += bool(watched.outputs and watched.inputs) and names.issuperset(watched.inputs)
    for name in names | {name for name, source in monitor.previous if source in names}:
        if of_latest(monitor.setup.rules[name]):
            monitor.forget(name)


def word_of(setup: Setup, clauses: Iterable[Clause]) -> Word | None:
    """The word of some clauses that are judged together; None if it judges none that speaks of other steps."""
    if setup.answers is None or setup.answers.by == "arrival":
        return None
    told = [clause for clause in clauses if not undetermined(setup, clause)]
    if not any(histories(clause.formula) for clause in told):
        return None
    return Word(setup.answers, topics_of(setup, {v.qualified for c in told for v in free_variables(c.formula)}))


def topics_of(setup: Setup, names: Iterable[str]) -> dict[str, bool]:
    """The topics that carry the given variables, and whether these are outputs."""
    sources = [rule.source if isinstance(rule := setup.rules.get(name), Previous) else name for name in names]
    carried = setup.carried
    return {
        same_topic(carried[name].topic): name.startswith(f"{Role.OUTPUT}.")
        for name in sorted(sources)
        if name in carried and not constant(carried[name])
    }


def undetermined(setup: Setup, clause: Clause) -> str:
    """Why `answers` (other than by arrival) does not determine the steps of a clause; empty if it does."""
    if not histories(clause.formula):
        return ""
    assert setup.answers is not None
    if setup.answers.by == "latency" or setup.answers.others:
        return "it refers to other steps, whose order `answers: {latency: …}` does not determine"
    if timed(clause.formula) is not None:
        return "it has limits in seconds, which are judged with `answers: {by: arrival}` only"
    if setup.when != "outputs":
        return f"it refers to other steps, and with `when: {setup.when}` a message may belong to several steps"
    names = setup.carried
    if not setup.shared.keys().isdisjoint(names):
        return "it refers to other steps, and several nodes publish one of its topics: the step of a message is unknown"
    sides = [topics_of(setup, [n for n in names if n.startswith(f"{Role.OUTPUT}.") is out]) for out in (False, True)]
    both = sorted(sides[0].keys() & sides[1].keys())
    return f"it refers to other steps, and {both[0]} carries inputs and outputs" if both else ""


ALONE = "a message has no counterparts, or they came in another order: a step may have gone by unseen"
