"""The exact monitor: judges the clauses of one node over events. The cost of an event does not grow with their number.

A snapshot maps each variable to its latest value. A clause is judged, by the values then known, when events have
brought a value of each of its outputs (the node has answered); a clause about inputs, when an event brings any of them.
It is not judged until every variable has a value. A guarantee that fails while an assumption is broken is attributed to
the environment, not to the node.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

from avow.evaluation.truth import as_shown
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import remembers
from avow.formulas.values import Value
from avow.language.contract import Clause, ClauseKind
from avow.ros.bags import GONE, LIVE, LOST, PUBLISHER, publisher
from avow.ros.frames import TREE, Tree

from . import answers
from .latest import Doubts, SoFar, hear, judge_latest, not_met, overdue, pass_between, soonest, verdict_of
from .memory import watching
from .options import Setup, same_topic
from .pace import SIMULATED, By, Clock, Passage, Timing
from .pairing import NUMBER, Asked, Choices, Pairing, Replies, Ticks, backwards, ticks, time_of
from .reading import Reader, reader
from .rules import EVENTS, Choice, Constant, Fields, Previous, framed, heard_through, of_latest
from .tuning import OPEN_QUESTIONS, TOPICS_KEPT
from .watched import Answer, Fault, Heard, Part, Tally, Violation, Watched, shown, time_text
from .wires import MappingError, Unplaced
from .word import Message, Word, follow, word_of


@dataclass(slots=True)
class Monitor:
    """Feed it events with `step`. `guarantees`: the names of those to judge (by default all that are written)."""

    setup: Setup
    guarantees: Iterable[str] | None = None
    events: int = 0
    relevant: int = 0
    tallies: dict[str, Tally] = field(default_factory=dict)
    values: dict[str, Value] = field(default_factory=dict)
    heard: set[str] = field(default_factory=set)
    """The topics of the messages so far."""
    at: dict[str, tuple[int, str]] = field(default_factory=dict)
    """The message that each variable's value is from, as in `Heard`."""
    versions: dict[str, int] = field(default_factory=dict)
    _readers: dict[str, list[tuple[str, Reader]]] = field(default_factory=dict)
    previous: list[tuple[str, str]] = field(default_factory=list)
    clauses: dict[str, list[Watched]] = field(default_factory=dict)
    """The clauses that are judged when a variable is published."""
    assumptions: list[Watched] = field(default_factory=list)
    timing: Timing = field(init=False)
    pairing: Pairing | None = None
    """Answers and the inputs that they are paired with; None: the latest."""
    doubts: Doubts | None = None
    """The breaches that wait, if these are the latest: set once an event came from a running graph."""
    paired: frozenset[str] = frozenset()
    """The observed inputs."""
    prompt: bool = False
    """Breaches are reported when they are seen, even if they may be withdrawn (`by_order`)."""
    by_order: dict[str, Watched] = field(default_factory=dict)
    """The clauses whose verdict may be about messages that do not belong together, which is known only at the end."""
    in_doubt: list[Violation] = field(default_factory=list)
    """Their breaches."""
    numbers: dict[str, int] = field(default_factory=dict)
    """By order: the number of the node's messages of each topic so far."""
    unnumbered: bool = False
    """By order: a message was lost, according to its topic's numbers."""
    word: Word | None = None
    """The order of the steps, if clauses speak of other steps and `answers` determines it."""
    assumed: tuple[str, ...] = ()
    """The variables of the assumptions."""
    backwards: str = ""
    """Where the events' times contradict the order in which they came, if the plan relies on that order."""
    _latest: Fraction | None = None
    unread: dict[str, str] = field(default_factory=dict)
    """The variables of which a message could not be read, and why the first could not."""
    tree: Tree | None = None
    """The transforms of the run, if the contract names frames."""
    supposed: set[str] = field(default_factory=set)
    """The variables that have an initial value of the plan, and no message yet."""
    questions: int = OPEN_QUESTIONS
    _constant: list[Watched] = field(default_factory=list)
    """Clauses that no message changes: judged once, at the first event."""
    _remembering: list[Watched] = field(default_factory=list)
    """Clauses that speak of other steps."""
    _timed: list[Watched] = field(default_factory=list)
    """Those of them that also speak of the time between steps, assumptions first."""
    _clock: Clock | None = None
    """The clock, if it is not the times of the events."""
    since: dict[str, float] = field(default_factory=dict)
    """When the message came that each variable's value is from, in the word."""
    so_far: SoFar | None = None
    """For a node whose clauses speak of other steps."""

    def __post_init__(self) -> None:
        self.timing = Timing(self.setup.fresh, self.setup.rates)
        self._clock = None if self.setup.time is By.RECEIPT else Clock(self.setup.time)
        self._observe()
        given, self.paired = self.setup.answers, self.setup.heard
        spoken = (v.qualified for a in self.setup.node.assumptions for v in free_variables(a.formula))
        self.assumed = tuple(dict.fromkeys(name for name in spoken if name in self.setup.rules))
        node = self.setup.node
        written = (c.name for c in node.guarantees if not c.unwritten and c.chance is None)
        wanted = set(written if self.guarantees is None else self.guarantees)
        watched = [c for c in node.clauses if c.kind is ClauseKind.ASSUMPTION or c.name in wanted]
        self.word = word_of(self.setup, watched)
        if self.word is None and given is not None and given.by != "arrival":
            self.pairing = Pairing(given)
            if given.by == "latency" or given.others:
                self.pairing.begins({n: v for n, v in self.values.items() if n in self.paired})
        else:
            self.so_far = SoFar(self.setup.leeway.jitter) if remembers(node) else None
        for clause in watched:
            self._watch(clause)

    def _observe(self) -> None:
        self.tree = Tree() if framed(self.setup.rules.values()) else None
        for name, rule in self.setup.rules.items():
            self.versions[name] = self.versions.get(name, 0) + 1
            match rule:
                case Constant(value=value):
                    self.values[name] = value
                case Previous(source=source, initial=initial):
                    self.previous.append((name, source))
                    self.values |= {} if initial is None else {name: initial}
                case Fields() | Choice():
                    read = reader(rule, self.tree, self.setup.known)
                    self._readers.setdefault(same_topic(rule.topic), []).append((name, read))
                    self.values |= {} if rule.initial is None else {name: rule.initial}
                    if rule.initial is not None and of_latest(rule):
                        self.supposed.add(name)  # an empty set of tuples seen so far is an observation
        for name, source in self.previous:
            if name not in self.values and source in self.values:
                self.values[name] = self.values[source]

    def listens(self, topic: str) -> bool:
        """Whether a topic's messages concern the node, or its time."""
        known = same_topic(topic)
        timed = known == SIMULATED and self.setup.time is By.SIM
        return known in self._readers or timed or (known in TREE and self.tree is not None)

    def step(self, event: Mapping[str, Any], place: int = 0) -> list[Violation]:
        """Judge one event, at a place of the trace (by default, its number). Never raises, whatever the event
        contains."""
        self.events += 1
        if self._clock is None:
            return answers.sure(self, self._step(event, place))
        found: list[Violation] = []
        now = self.events
        for number, each, where in self._clock.ready(now, event, place or now):
            self.events = number
            found += self._step(each, where)
        self.events = now
        return answers.sure(self, found)

    def _step(self, event: Mapping[str, Any], place: int) -> list[Violation]:
        topic = event.get("topic")
        readers = self._readers.get(same_topic(topic)) if isinstance(topic, str) else None
        if isinstance(topic, str) and len(self.heard) < TOPICS_KEPT:
            self.heard.add(same_topic(topic))
        if self.tree is not None and isinstance(topic, str) and same_topic(topic) in TREE and not self.tree.whole:
            self.tree.hear(same_topic(topic), event)
        if LIVE in event and self.by_arrival and self.doubts is None:
            self.doubts = Doubts.beginning(self.values)
        if LOST in event or GONE in event:
            return self._gap(event, same_topic(str(topic)))
        if readers and (self.setup.shared or PUBLISHER in event or same_topic(str(topic)) == EVENTS):
            readers = answers.own(self, readers, event)
        names = [name for name, _ in readers or ()]
        if readers is not None and self.so_far is not None and self._timed:
            self.so_far.hears(time_of(event), self._timed)
        found = self._tick(event, set(names))
        if readers is None or not isinstance(topic, str):
            return found
        self.relevant += 1
        missed = self.timing.hear(event, same_topic(topic), names)
        by = "arrival" if self.setup.answers is None else self.setup.answers.by
        if by == "order" and names:
            number = self.numbers[same_topic(topic)] = self.numbers.get(same_topic(topic), 0) + 1
            self.unnumbered = self.unnumbered or missed
            event = event if self.unnumbered else {**event, NUMBER: number}
        if self.word is not None and same_topic(topic) in self.word.topics:
            message = Message(same_topic(topic), event, self.events, place, tuple(readers), missed)
            follow(self, self.word.hears(message), found)
            return found
        if missed:
            self.miss(set(names))
            if by in ("arrival", "order"):
                answers.scatter(w for name in names for w in self.clauses.get(name, ()))
        if self.setup.answers is not None and by == "arrival" and not self.backwards and "time" in event:
            now, before = time_of(event), self._latest
            self.backwards, self._latest = backwards(now, before, self.events), now
        self.conclude(self.read(event, place, readers, found), event, found)
        if self.pairing is not None and self.pairing.waiting:
            self.settle(ticks(time_of(event)), found)
        return found

    def _gap(self, event: Mapping[str, Any], topic: str) -> list[Violation]:
        """Messages of a topic were not heard, or nobody publishes it any more."""
        found = self._tick(event, frozenset())
        if not self.listens(topic):
            return found
        passage = self.timing.passages.setdefault(topic, Passage())
        passage.gap, passage.unheard = True, passage.unheard or str(event.get(LOST, ""))
        for name in self.carried(topic):
            answers.unknown(self, name, event)
        return found

    def read(
        self, event: Mapping[str, Any], place: int, readers: Sequence[tuple[str, Reader]], found: list[Violation]
    ) -> dict[str, bool]:
        """A message's variables, and whether they could be read."""
        updated = dict[str, bool]()
        self.at.update(dict.fromkeys((name for name, _ in readers), (place or self.events, publisher(event))))
        for name, read in readers:
            old = self.values.get(name)
            try:
                new = read(event, old)
            except MappingError as error:
                if self.tallies and not isinstance(error, Unplaced):  # a node without clauses to judge misses no value
                    found.append(self.violation(Fault.MAPPING, name, event, str(error)))
                self.unread.setdefault(name, str(error))
                answers.unknown(self, name, event)
                updated[name] = False
                continue
            self.supposed.discard(name)
            updated[name] = True
            answers.saw(self, name, event, new)
            if old is None or new != old:
                self.values[name] = new
                self.versions[name] += 1
        return updated

    def conclude(self, updated: Mapping[str, bool], event: Mapping[str, Any], found: list[Violation]) -> None:
        """Judge the clauses that are due now that these variables have new values (if they could be read)."""
        hear(self._remembering, (name for name, readable in updated.items() if readable))
        while self._constant:
            self._judge(self._constant.pop(), event, found)
        for watched, answer in self._due(updated, event, found):
            values = self.known(watched, answer)
            if watched.paired or answers.accused(self, watched, values):
                answers.ask(self, watched, values, answer, event)
            else:
                self._aged(watched, event)
                self._judge(watched, event, found, answer)
            for name, source in watched.held:
                watched.memory.pop(name, None)
                if source in values:
                    watched.memory[name] = values[source]
        if self.pairing is not None and any(v.fault is Fault.ASSUMPTION and v.index == self.events for v in found):
            for replies in self.pairing.replies.values():
                replies.pardon(self.pairing.key(event, self.pairing.answers.input))
        pass_between(self, self._timed, updated, time_of(event))
        self.settle_previous()

    @property
    def by_arrival(self) -> bool:
        """Whether an answer is compared with the values that came before it."""
        return self.pairing is None and self.word is None

    @property
    def kept(self) -> Pairing | None:
        """Messages of inputs, and answers that wait for them."""
        return self.pairing if self.doubts is None else self.doubts.pairing

    @property
    def exact(self) -> Pairing | Word | None:
        """The pairing or word that knows which messages an answer answered."""
        return self.word or self.pairing

    def waits(self, event: int) -> bool:
        """Whether an answer of this event or an earlier one is not judged yet, or in doubt."""
        waiting = any(known is not None and known.waits(event) for known in (self.kept, self.word))
        return waiting or any(v.index <= event for v in self.in_doubt[:1])

    def known(self, watched: Watched, answer: Answer | None) -> Mapping[str, Value]:
        """The values by which an answer is judged: the latest, except those of the step before, and those of its own
        parts."""
        values = self.values
        if watched.held:
            held = {name for name, _ in watched.held}
            values = {**{n: v for n, v in values.items() if n not in held}, **watched.memory}
        return values if answer is None else {**values, **answer.values}

    def _aged(self, watched: Watched, event: Mapping[str, Any]) -> None:
        heard = self.timing.heard if self.word is None else self.since
        watched.tally.aged(float(time_of(event)), heard, [name for name in watched.inputs if name in heard])

    def tick(self, event: Mapping[str, Any]) -> list[Violation]:
        """Time has passed: deadlines do not wait for a message."""
        passed = event if self._clock is None else self._clock.passed(event)
        return [] if passed is None else self._tick(passed, frozenset())

    def _tick(self, event: Mapping[str, Any], names: Set[str]) -> list[Violation]:
        """Time has passed, with or without a message of these variables."""
        late = self.timing.passes(event, names)
        found = [self.violation(Fault.SILENT if silent else Fault.RATE, n, event, wrong) for n, wrong, silent in late]
        if self.doubts is not None and self.doubts.pairing.waiting:
            self.settle(ticks(time_of(event)), found)
        for watched, deadline in overdue(self._timed, event):
            if self.so_far is not None:
                self.so_far.note(watched)
            not_met(self, watched, self.values, {**event, "time": deadline}, found, "; no step came in time")
        return found

    @property
    def deadline(self) -> float:
        return min(self.timing.deadline, soonest(self._timed)) if self._clock is None else math.inf

    def settle_previous(self) -> None:
        """An answer is over: its values are now those of the step before."""
        for name, source in self.previous:
            value = self.values.get(source)
            if source in self.at:
                self.at[name] = self.at[source]
            if value is None:
                if source in self.at and name in self.values:
                    self.forget(name)
            elif self.values.get(name) is not value:
                self.values[name] = value
                self.versions[name] += 1

    @property
    def silent(self) -> dict[str, str]:
        """The variables whose topic has had no message, and the topic."""
        return {n: rule.topic for n, rule in self.setup.carried.items() if same_topic(rule.topic) not in self.heard}

    # -- for `columns`, which take over events that change only values -------------------------------------------------

    @property
    def by_values(self) -> bool:
        """Whether a verdict depends on values alone, the latest or those that an answer answered, and does not affect
        the next."""
        return self.so_far is None and self._clock is None

    def reader_of(self, name: str) -> Reader:
        """The reader of a variable that messages carry."""
        return next(read for readers in self._readers.values() for of, read in readers if of == name)

    def carried(self, topic: str) -> tuple[str, ...]:
        """The variables that a topic's messages carry."""
        return tuple(name for name, _ in self._readers.get(same_topic(topic), ()))

    def caught_up(self, event: Mapping[str, Any], place: int) -> None:
        """Take over the latest of some events of one topic, all of which could be read."""
        topic = same_topic(str(event["topic"]))
        self.at.update(dict.fromkeys(self.carried(topic), (place, publisher(event))))
        self.timing.caught_up(event, topic, self.carried(topic))
        self.supposed.difference_update(self.carried(topic))
        for name, read in self._readers[topic]:
            old = self.values.get(name)
            new = read(event, old)
            if old is None or new != old:
                self.values[name] = new
                self.versions[name] += 1
        if self._latest is not None:
            self._latest = max(self._latest, time_of(event))

    def finish(self) -> list[Violation]:
        """Judge the answers that still wait, once the run is over."""
        found: list[Violation] = []
        self.backwards = self.backwards or ("" if self._clock is None else self._clock.finish())
        if self.kept is not None:
            self.settle(None, found)
        why = answers.uneven(self)
        self.backwards = self.backwards or ("" if self.pairing is None else self.pairing.late) or why
        if self.word is not None:
            follow(self, self.word.finish(uneven=bool(why)), found)
        for watched in self.about(self.clauses):
            answers.finish(self, watched, found)
            watched.tally.left = self._left(watched)
            watched.tally.open += bool(watched.tally.left) if watched.steps is None else watched.steps.open
            if any(of not in self.at for name in watched.names if (of := heard_through(self.setup.rules[name]))):
                watched.only_supposed()
            if watched in self._timed and (why := self.timing.standing):
                watched.tally.withdrawn(why)
        found = answers.sure(self, found, over=True)
        found, self.in_doubt = [*self.in_doubt, *found], []
        return answers.withdraw(self, found) if self.backwards else found

    def _left(self, watched: Watched) -> int:
        """A bit for each condition that the latest inputs meet, if one of them came after the latest answer."""
        said = max((self.at[name][0] for name in watched.outputs if name in self.at), default=0)
        later = any(self.at[name][0] > said for name in watched.inputs if name in self.at)
        if not (later and watched.outputs and watched.steps is None):
            return 0
        return watched.met({n: value for n, value in self.values.items() if n not in watched.outputs})

    def settle(self, now: Ticks | None, found: list[Violation]) -> None:
        """Judge the answers whose inputs are known at a time (None: the run is over)."""
        assert self.kept is not None
        for asked, choices in self.kept.ready(now):
            self.judge_answer(asked, choices, found)

    def judge_answer(self, asked: Asked, choices: Choices, found: list[Violation]) -> None:
        answers.judge_answer(self, asked, choices, found)

    def verdict(self, watched: Watched, values: Mapping[str, Value]) -> Fault | str | None:
        return verdict_of(watched, self.assumptions, values)

    def _due(
        self, readable: Mapping[str, bool], event: Mapping[str, Any], found: list[Violation]
    ) -> list[tuple[Watched, Answer | None]]:
        """The clauses to be judged now that these variables have new values (if they could be read), each with its
        answer. A part of an answer that is published again before the answer is complete is judged by itself."""
        touched: dict[int, tuple[Watched, dict[str, bool]]] = {}
        for name in readable:
            for watched in self.clauses.get(name, ()):
                touched.setdefault(id(watched), (watched, {}))[1][name] = readable[name]
        due: list[tuple[Watched, Answer | None]] = []
        for watched, names in touched.values():
            if watched.outputs:
                due += [(watched, answer) for answer in answers.came(self, watched, names, event, found)]
                continue
            watched.tally.published += 1
            if all(names.values()):
                due.append((watched, None))
            else:
                watched.tally.unreadable += 1
        if self.so_far is not None:  # whether a guarantee was promised depends on the assumptions' verdicts
            due.sort(key=lambda one: one[0].clause.kind is not ClauseKind.ASSUMPTION)
        return due

    def judge_part(
        self, watched: Watched, parts: Mapping[str, Part], event: Mapping[str, Any], found: list[Violation]
    ) -> None:
        answers.judge_part(self, watched, parts, event, found)

    def spoken(self, watched: Watched) -> tuple[str, ...]:
        """The variables of a clause and of the assumptions."""
        return (*watched.names, *(n for assumed in self.assumptions for n in assumed.names))

    def about(self, names: Iterable[str]) -> tuple[Watched, ...]:
        """The clauses that are judged when one of these variables is published."""
        return tuple({id(w): w for name in names for w in self.clauses.get(name, ())}.values())

    def forget(self, name: str) -> None:
        self.versions[name] += 1
        self.values.pop(name, None)

    def _watch(self, clause: Clause) -> None:
        tally = self.tallies[clause.name] = Tally()
        found = watching(self.setup, clause, tally, self.previous, self.values, self.pairing is not None)
        if found is None:
            return
        watched, triggers = found
        if watched.steps is not None:
            self._remembering.append(watched)
            self._timed += [watched] if watched.steps.silence is not None else []
        if answers.doubtful(self, watched):
            self.by_order[clause.name] = watched
        for name in triggers:
            self.clauses.setdefault(name, []).append(watched)
        if not triggers:
            self._constant.append(watched)
        if self.pairing is not None and self.pairing.answers.by in ("key", "stamp", "call") and watched.paired:
            keyed = frozenset(watched.paired) - self.pairing.answers.timed(watched.outputs, watched.paired, "")
            self.pairing.replies[id(watched)] = Replies(watched, keyed)
        if clause.kind is ClauseKind.ASSUMPTION:
            self.assumptions.append(watched)

    def _judge(
        self, watched: Watched, event: Mapping[str, Any], found: list[Violation], answer: Answer | None = None
    ) -> None:
        judge_latest(self, watched, event, found, answer)

    def miss(self, names: Set[str]) -> None:
        """Messages of these variables were lost, or could not be read."""
        for watched in (*self.assumptions, *self._remembering):
            if not names.isdisjoint(watched.names):
                self.lose(watched)

    def lose(self, watched: Watched) -> None:
        """A step of a clause was not seen."""
        if watched.steps is not None:
            watched.steps.forget()
        if self.so_far is not None and watched.clause.kind is ClauseKind.ASSUMPTION:
            self.so_far.unsure = True

    def violation(
        self, fault: Fault, clause: str, event: Mapping[str, Any], explanation: str, watched: Watched | None = None,
        snapshot: Mapping[str, Value] | None = None,
    ) -> Violation:  # fmt: skip
        values, pairs = shown(watched, snapshot) if watched is not None and snapshot is not None else ((), ())
        if watched is not None and snapshot is not None and watched.steps is None:
            explanation += as_shown(watched.clause.formula, snapshot)
        heard = self.heard_of(watched.names) if watched is not None else {}
        name, time = self.setup.node.name, time_text(event.get("time"))
        return Violation(fault, name, clause, self.events, time, values, pairs, explanation, heard)

    def heard_of(self, names: Iterable[str]) -> Heard:
        return {name: self.at[name] for name in names if name in self.at}
