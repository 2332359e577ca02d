"""A running graph under the monitors: messages are judged and recorded, verdicts published as ROS diagnostics.

The evidence is the record, judged again by `avow verify`: a live verdict is only a message to its reader.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros.bags import LIVE, PUBLISHER, Event
from avow.ros.calls import is_part
from avow.ros.dds import carriers, domain_of

from ..answers import unheard
from ..session import RAW, Session, filtered
from ..tuning import LIVE_APART, LIVE_PAUSE, TOPICS_KEPT, VERDICTS_EVERY
from ..watched import Violation, coverage
from .dds import Dds
from .graphs import ERROR, OK, STALE, WARN, Graph, Heard, Status
from .ros1 import Ros1, master_of

UNORDERED = (
    "the topics of a running graph have no common order: by arrival, a breach is reported {} s later if it is one for "
    "every order of the messages, and is undecided otherwise ({})"
)


def follow(
    running: Session, graph: Graph, over: Callable[[], bool], record: Path | None, verdicts: str | None,
    warn: Callable[[str], None],
) -> Iterator[Violation]:  # fmt: skip
    """Judge the messages of a graph until it is `over`, and pass on those of filtered topics. Deadlines are by this
    machine's clock. Messages judged and recorded are marked `LIVE`. Raises Rejected if the record cannot be written."""
    running.prompt()
    with ExitStack() as stack:
        try:
            file = stack.enter_context(record.open("w", encoding="utf-8")) if record is not None else None
        except OSError as error:
            raise Rejected(Diagnostic("MON304", f"{record} cannot be written: {error.strerror}")) from None
        stack.enter_context(graph)
        if unsure := [m.setup.node.name for m in running.monitors if m.by_arrival and m.setup.heard]:
            warn(UNORDERED.format(float(LIVE_APART), ", ".join(unsure)))
        board = Board(running, graph, verdicts) if verdicts is not None else None
        trouble = Troubles(warn)
        ended: float | None = None
        while True:
            if ended is None and over():
                ended = time.time()  # messages until then are still judged
            heard = graph.inbox.get(LIVE_PAUSE if ended is None else 0)
            if ended is not None and (heard is None or heard.time > ended):
                break
            if heard is not None:
                event = trouble.event(heard)
                lines = [event]
                if heard.forward is not None:
                    said = {**event, "topic": heard.topic.removesuffix(RAW)}
                    found, passed = running.offer(said)
                    if passed is not None:
                        heard.forward({k: v for k, v in passed.items() if k != PUBLISHER and v is not said[k]})
                        lines.append(passed)
                else:
                    found = list(running.step(event))
                if file is not None:
                    file.writelines(json.dumps(line) + "\n" for line in lines)
                if board is not None and found:
                    board.broken(found)
                yield from found
            elif running.events:  # the run begins with its first message
                yield from running.tick({"time": time.time()})
            if board is not None:
                board.refresh()
        yield from running.finish()
        if board is not None:
            board.say()


class Troubles:
    """Messages that could not be read, and publishers that could not be heard; each is reported once."""

    def __init__(self, warn: Callable[[str], None]) -> None:
        self._warn = warn
        self._told: set[str] = set()

    def event(self, heard: Heard) -> Event:
        """The event of a message; an unreadable one has no fields, so that they are unknown. A trouble's has a mark."""
        if heard.read is None:
            self.tell(heard.trouble)
            return {"topic": heard.topic, "time": heard.time, LIVE: True, heard.mark: heard.trouble}
        try:
            return {**heard.read(), LIVE: True}
        except ValueError as error:
            self.tell(str(error))
            return {"topic": heard.topic, "time": heard.time, LIVE: True}

    def tell(self, text: str) -> None:
        if text not in self._told and len(self._told) < TOPICS_KEPT:
            self._told.add(text)
            self._warn(text)


class Board:
    """Publishes the verdicts on a topic: a status for each clause, at once if one is broken, or once a second."""

    def __init__(self, running: Session, graph: Graph, topic: str) -> None:
        self.running = running
        self._say = graph.diagnostics(topic, running.system.name)
        self._next = 0.0
        self._latest: dict[str, Violation] = {}

    def broken(self, found: list[Violation]) -> None:
        self._latest |= {f"{v.node}.{v.clause}": v for v in found}
        self._next = 0.0

    def refresh(self) -> None:
        """Publish the verdicts, if they are due."""
        if time.monotonic() >= self._next:
            self.say()

    def say(self) -> None:
        self._next = time.monotonic() + VERDICTS_EVERY
        self._say(list(self.standing()))

    def standing(self) -> Iterator[Status]:
        """The status of each clause, and of each other violation."""
        told = dict(self._latest)
        for monitor, clause, _, tally in self.running.clauses():
            name = f"{monitor.setup.node.name}.{clause}"
            latest = told.pop(name, None)
            lost = unheard(monitor, clause)
            counts = (("published", str(tally.published)), ("broken", str(tally.broken)))
            if latest is not None and tally.broken:
                yield Status(name, ERROR, latest.text(), counts)
            elif not tally.judged:
                yield Status(name, STALE, tally.reason or "not judged yet", counts)
            elif lost or tally.undecided or tally.order or tally.forgotten or tally.unanswered:
                yield Status(name, WARN, lost or coverage(tally), counts)
            else:
                yield Status(name, OK, coverage(tally), counts)
        for name, violation in told.items():
            yield Status(name, ERROR, violation.text())


def graph_of(
    text: str, running: Session, host: str, *, enforce: bool = False, warn: Callable[[str], None] = lambda text: None
) -> Graph:
    """``ros1``, ``ros1:http://host:11311``, ``ros2``, ``ros2:42`` (or ``dds``). `warn`: as `Ros1`. Raises
    Rejected."""
    heard = [topic for topic in running.topics if not is_part(topic)]
    filters = filtered(monitor.setup for monitor in running.monitors) if enforce else frozenset[str]()
    kind = text.partition(":")[0]
    graph: Graph
    if kind == "ros1":
        graph = Ros1(master_of(text), heard, host, filters, warn)
    elif enforce:
        raise Rejected(Diagnostic("MON307", "messages are filtered on ROS 1 alone", hint="--live ros1 --enforce"))
    elif kind in ("dds", "ros2"):
        try:
            domain = domain_of(text)
        except ValueError as error:
            raise Rejected(Diagnostic("MON303", str(error), hint="--live dds:0")) from None
        heard = [topic for topic in running.topics if carriers(topic, "")]
        graph = Dds(domain, heard, running.kinds, running.known, host)
    else:
        hint = "ros1, ros1:http://host:11311, ros2, or ros2:42"
        raise Rejected(Diagnostic("MON303", f"{text!r} is no graph that can be listened to", hint=hint))
    for topic in running.topics:
        if topic not in heard:
            graph.inbox.trouble(topic, f"{topic} is not heard on a running {kind} graph")
    return graph
