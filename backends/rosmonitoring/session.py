"""Monitors for several nodes at once, and what they found as data for people and machines."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy.typing as npt

from avow.backend_kit.box import BOX
from avow.backend_kit.given import misshapen
from avow.base.diagnostics import Diagnostic, Rejected
from avow.base.suggestions import suggest
from avow.formulas.formula import free_variables
from avow.language.contract import ClauseKind
from avow.language.terms import Role
from avow.ros.bags import PUBLISHER, Event, is_bag, recorded
from avow.ros.definitions import Definitions
from avow.system.plan import System

from .answers import unheard
from .backend import SCHEMA
from .batch import of_arrays, of_messages
from .blame import Blame
from .columns import Columns
from .engine import Monitor
from .guarding import FALLBACK
from .notes import readable
from .observing import NAME, method_of
from .options import Setup, known_types, origin, same_topic, setup
from .pace import Passage
from .rules import NOTHING_KNOWN
from .traces import Services, opened, transforms
from .watched import Fault, Tally, Violation, remedies, too_old

RAW = "_mon"
"""The suffix of a filtered topic's name under which its node publishes."""

WITHHELD = (Fault.GUARANTEE, Fault.EXCUSED, Fault.MAPPING)
"""The faults that keep a message from being passed on, not those of other causes (broken assumptions, silences)."""


def raw(topic: str) -> str:
    return f"{topic}{RAW}"


def filtered(setups: Iterable[Setup]) -> frozenset[str]:
    """The topics that are filtered. Raises Rejected if the plan names none, or if a guarantee on a filtered topic is
    not judged by a message of that topic alone, as it comes."""
    wrong: list[Diagnostic] = []
    found: set[str] = set()
    for one in setups:
        if not one.filtered:
            continue
        found |= one.filtered
        name = one.node.name
        if one.answers is not None and one.answers.by != "arrival":
            hint = "answers: {by: arrival, because: …}"
            wrong.append(Diagnostic("MON307", f"{name}: which input an answer answered shows only later", hint=hint))
        for clause in one.node.guarantees:
            outputs = {v.qualified for v in free_variables(clause.formula) if v.role is Role.OUTPUT}
            topics = {same_topic(rule.topic) for name, rule in one.carried.items() if name in outputs}
            if topics & one.filtered and len(topics) > 1:
                text = f"{name}.{clause.name} speaks of several topics, {' and '.join(sorted(topics))}"
                hint = "the first of them would be passed on before it can be judged"
                wrong.append(Diagnostic("MON307", text, hint=hint))
    if not found:
        wrong.append(Diagnostic("MON307", "the plan filters nothing", hint="rosmonitoring: {filter: [out.command]}"))
    if wrong:
        raise Rejected(*wrong)
    return frozenset(found)


def outside(monitor: Monitor) -> bool:
    """Whether the node's inputs are not known to be in the plan's box."""
    found = [w for w in monitor.assumptions if monitor.setup.box.terms and w.clause.name == BOX]
    return any(not (monitor.values.keys() >= {*w.names} and w.truth_of(monitor.values)) for w in found)


def _report_withheld(monitors: Iterable[Monitor], counts: Mapping[str, int]) -> None:
    """A record behind a filter holds what its node published, and what was passed on. If fewer messages were passed on,
    the filter met the guarantees, and the record is no evidence about the node."""
    for monitor in monitors:
        for topic in sorted(monitor.setup.filtered):
            passage = monitor.timing.passages.get(topic, Passage())
            published, passed = counts.get(raw(topic), 0), counts.get(topic, 0) - passage.replaced
            if published > passed:
                reason = f"{published - passed} of {published} messages of {topic} were withheld by a filter"
                monitor.backwards = monitor.backwards or reason


@dataclass(slots=True)
class Session:
    """The monitors of some nodes; feed it events with `step`."""

    system: System
    monitors: tuple[Monitor, ...]
    events: int = 0
    counts: dict[Fault, int] = field(default_factory=dict)
    unheard: dict[str, int] = field(default_factory=dict)
    """Topics of the trace that no monitor listens to, and their events."""
    withheld: dict[str, int] = field(default_factory=dict)
    """Topics with messages that were not passed on, and their number."""
    behind_filters: dict[str, int] = field(init=False)
    """The number of messages of filtered topics, as published and as passed on."""
    asked: frozenset[str] = frozenset()
    """The nodes to be monitored: those named, otherwise those with such a method in the plan, otherwise all."""
    services: Services = field(default_factory=Services)
    """The calls that ROSMonitoring reports live."""
    _blame: Blame | None = None

    def __post_init__(self) -> None:
        topics = (topic for monitor in self.monitors for topic in monitor.setup.filtered)
        self.behind_filters = {name: 0 for topic in topics for name in (topic, raw(topic))}

    def prompt(self) -> None:
        """Report breaches when they are seen, even if the end of the run may withdraw them."""
        for monitor in self.monitors:
            monitor.prompt = True

    def listens(self, topic: str) -> bool:
        return any(monitor.listens(topic) for monitor in self.monitors)

    def step(self, event: Mapping[str, Any]) -> Iterator[Violation]:
        topic = event.get("topic")
        self.heard(topic if isinstance(topic, str) else "", 1)
        yield from self.with_causes([v for monitor in self.monitors for v in monitor.step(event)])

    def offer(self, event: Mapping[str, Any]) -> tuple[list[Violation], Event | None]:
        """The violations in a message of a filtered topic, and what is passed on: the message, its fallback, or None.
        Monitors of other nodes receive only that."""
        topic = str(event["topic"])
        self.heard(topic, 1)
        own = [m for m in self.monitors if same_topic(topic) in m.setup.filtered]
        found = [v for monitor in own for v in monitor.step(event)]
        # faults of earlier messages may be reported only now, and those of this one only later
        passed = not any(v.fault in WITHHELD and v.index == m.events for m in own for v in found)
        passed = passed and not any(m.doubts is not None and m.doubts.latest == m.events for m in own)
        passed = passed and not any(map(outside, own))
        given: Event | None = event
        if not passed:
            self.withheld[topic] = self.withheld.get(topic, 0) + 1
            fields = next((f for m in own if (f := m.setup.fallback.get(same_topic(topic)))), {})
            # a message that cannot be read has no fields to replace
            given = {**event, **fields, PUBLISHER: FALLBACK} if fields and fields.keys() <= event.keys() else None
        others = given or {"topic": raw(topic), "time": event["time"]}
        found += [v for m in self.monitors if m not in own for v in m.step(others)]
        return list(self.with_causes(found)), given

    def tick(self, event: Mapping[str, Any]) -> Iterator[Violation]:
        """Time has passed without a message."""
        yield from self.with_causes([v for monitor in self.monitors for v in monitor.tick(event)])

    def heard(self, topic: str, count: int) -> None:
        """`count` events of a topic (without a name: of none) have come."""
        self.events += count
        if same_topic(topic) in self.behind_filters:
            self.behind_filters[same_topic(topic)] += count
        if topic and not self.listens(topic):
            self.unheard[topic] = self.unheard.get(topic, 0) + count

    def run(self, path: Path) -> Iterator[tuple[int, Violation]]:
        """Judge a whole trace: the violations, each with the line (0 in a bag) of its event. Raises Rejected."""
        return ((line, violation) for line, found in self.judged(path) for violation in found)

    def judged(self, path: Path) -> Iterator[tuple[int, list[Violation]]]:
        """As `run`: lines, and the violations there, often none, so that the caller can check the clock."""
        trees = [monitor.tree for monitor in self.monitors if monitor.tree is not None]
        if trees:
            recorded_tree = transforms(path, origin(self.system))
            for tree in trees:
                tree.fill(recorded_tree)
        columns = Columns(self.monitors, self.with_causes, self.heard)
        return self._whole(self._of_bag(path, columns) if is_bag(path) else columns.run(path))

    def _of_bag(self, path: Path, columns: Columns) -> Iterator[tuple[int, list[Violation]]]:
        with opened():
            batches = of_messages(recorded(path, origin(self.system), self.listens))
            yield from ((0, found) for _, found in columns.batches(batches))

    def arrays(self, topics: Mapping[str, Mapping[str, npt.NDArray[Any]]]) -> Iterator[tuple[int, Violation]]:
        """As `run`, for arrays: topic → field (`time` in seconds, `data`, `pose.x`) → a number for each message. The
        number of the event replaces the line."""
        batches = Columns(self.monitors, self.with_causes, self.heard).batches(of_arrays(topics))
        return ((line, violation) for line, found in self._whole(batches) for violation in found)

    def read(self, read: Callable[[int], bytes]) -> Iterator[tuple[int, Violation]]:
        """As `run`, for lines of standard input as they come, as `Columns.lines`. Raises Rejected, OSError."""
        lines = Columns(self.monitors, self.with_causes, self.heard).lines(read, "<stdin>")
        return ((line, violation) for line, found in self._whole(lines) for violation in found)

    def _whole(self, judged: Iterable[tuple[int, list[Violation]]]) -> Iterator[tuple[int, list[Violation]]]:
        """The same, followed by the violations found at the end of the run."""
        line = 0
        for line, found in judged:
            yield line, found
        yield line, list(self.finish())

    def with_causes(self, violations: list[Violation], *, over: bool = False) -> Iterator[Violation]:
        """The violations at one event, with their causes."""
        if not violations and not over:
            return
        if self._blame is None:
            self._blame = Blame(self.system, {m.setup.node.name: m for m in self.monitors})
        for violation in self._blame.with_causes(violations, over=over):
            self.counts[violation.fault] = self.counts.get(violation.fault, 0) + 1
            yield violation

    def finish(self) -> Iterator[Violation]:
        """The violations that are found only at the end of the run."""
        yield from self.with_causes([v for monitor in self.monitors for v in monitor.finish()], over=True)
        _report_withheld(self.monitors, self.behind_filters)

    def unmonitored(self) -> dict[str, str]:
        """The clauses of monitored nodes for which too few publications were decided, whose inputs were too old, or
        whose answers are not paired with inputs, each with a proposal for the plan, or the reason."""
        found = {}
        for monitor, name, kind, tally in self.clauses():
            if monitor.setup.node.name not in self.asked or tally.hidden:
                continue
            few = tally.decided < monitor.setup.decided * _asked(kind, tally)
            if wrong := unheard(monitor, name) or too_old(tally.ages, monitor.setup.max_age):
                found[f"{monitor.setup.node.name}.{name}"] = wrong
            elif tally.unpaired:
                found[f"{monitor.setup.node.name}.{name}"] = monitor.setup.unmarked(monitor.setup.carried, typed=False)
            elif not tally.decided or monitor.backwards or few:
                why = remedies(tally, monitor.silent, monitor.unread) or tally.reason
                found[f"{monitor.setup.node.name}.{name}"] = why
        return found

    @property
    def topics(self) -> tuple[str, ...]:
        """The topics that the monitors listen to."""
        every = (topic for monitor in self.monitors for topic in monitor.setup.topics)
        return tuple({same_topic(topic): topic for topic in every}.values())

    @property
    def kinds(self) -> dict[str, str]:
        """The types of these topics (without their leading slash), as far as they are known."""
        return {topic: kind for monitor in self.monitors for topic, kind in monitor.setup.kinds.items()}

    @property
    def known(self) -> Definitions:
        """The message types that the plan defines."""
        return self.monitors[0].setup.known if self.monitors else NOTHING_KNOWN

    @property
    def clean(self) -> bool:
        """No guarantee or assumption was broken, and every message could be read."""
        return not self.counts

    def clauses(self) -> Iterator[tuple[Monitor, str, ClauseKind, Tally]]:
        """Without those on parameters of which nothing was told."""
        for monitor in self.monitors:
            for clause in monitor.setup.node.clauses:
                tally = monitor.tallies.get(clause.name)
                if tally is not None and (tally.published or tally.reason or not tally.hidden):
                    yield monitor, clause.name, clause.kind, tally

    def summary(self) -> dict[str, Any]:
        """As JSON; its schema is in `docs/backends/rosmonitoring.md`."""
        nodes = []
        for monitor in self.monitors:
            clauses = [
                {
                    "name": clause.name,
                    "kind": str(clause.kind),
                    **{name: getattr(tally, counted) for name, counted in _COUNTED.items()},
                    "oldest": {of: round(age, 6) for of, age in tally.ages.items()},
                    "paired": not tally.unpaired,
                    "antecedent_met": tally.triggered,
                    "reason": tally.reason or monitor.backwards,
                }
                for clause in monitor.setup.node.clauses
                if (tally := monitor.tallies.get(clause.name)) is not None
            ]
            topics = {
                topic: {"lost": None if p.uncounted else p.lost, "out_of_order": p.disordered}
                for topic, p in monitor.timing.passages.items()
            }
            name = monitor.setup.node.name
            nodes.append({"node": name, "relevant": monitor.relevant, "clauses": clauses, "topics": topics})
        return {
            "system": self.system.name,
            "events": self.events,
            "clean": self.clean,
            "unmonitored": [*self.unmonitored()],
            "faults": {fault.name.lower(): count for fault, count in self.counts.items()},
            "nodes": nodes,
            "listened": list(self.topics),
            "unknown_topics": dict(self.unheard),
            "withheld": dict(self.withheld),
        }


_COUNTED = {
    **{n: n for n in ("judged", "broken", "excused", "overdue", "undecided", "unanswered", "published", "decided")},
    "undecided_order": "order", "before_first": "early", "unreadable": "unreadable", "incomplete": "partial",
    "nameless": "nameless", "by_initial_value": "supposed", "after_unseen": "forgotten", "open_at_end": "open",
}  # fmt: skip
"""The name of a count in a summary, and in a tally."""


def _asked(kind: ClauseKind, tally: Tally) -> int:
    """The number of answers to be decided: for an assumption, without those before its first value."""
    return tally.asked - (tally.early if kind is ClauseKind.ASSUMPTION else 0)


def session(
    system: System, nodes: Sequence[str] = (), trace: Path | None = None, make: Callable[[Setup], Monitor] = Monitor
) -> Session:
    """Monitors for the named nodes, by default all, with the plan's mappings; if `trace` is a bag, also with its
    definitions of its messages. Raises Rejected."""
    known = {node.name: node for node in system.contract.nodes if not node.relay}  # wiring has no claims
    types, wrong = known_types(system, () if trace is None else (trace,))
    faults: list[Diagnostic] = list(wrong)
    monitors: list[Monitor] = []
    for name in nodes or known:
        if name not in known:
            raise Rejected(Diagnostic("MON104", f"there is no node '{name}'", hint=suggest(name, known)))
        options = method_of(system, name)
        if options is not None and (wrong := misshapen(SCHEMA, options, f"nodes.{name}: {NAME}")):
            faults += wrong
            continue
        found, problems = setup(system, known[name], options, types)
        faults += problems
        faults += readable(found, trace, origin(system)) if trace is not None and not problems else ()
        if not problems:
            monitors.append(make(found))
    if faults:
        raise Rejected(*dict.fromkeys(faults))  # several nodes may have the same topic
    planned = [n.node for n in system.plan.nodes if any(m.backend == NAME for m in n.methods)]
    return Session(system, tuple(monitors), asked=frozenset(nodes or planned or known))


def violation_json(violation: Violation) -> dict[str, Any]:
    said = {name: getattr(violation, name) for name in ("node", "clause", "time", "explanation", "cause")}
    known = {name: dict(getattr(violation, name)) for name in ("bindings", "values")}
    return {"fault": violation.fault.name.lower(), "event": violation.index, **said, **known}
