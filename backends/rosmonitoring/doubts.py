"""On a running graph each topic has its own connection: what is heard first need not have been said first.

So there a breach by the order of arrival waits until what was heard within `LIVE_APART` of it is known, and is told
where it is one whichever of these messages of other topics came before it; else it is undecided. What its clause
remembers of steps hangs on all that came before: where that is of several topics, a breach is undecided.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from avow.formulas.values import Value
from avow.language.contract import ClauseKind

from .options import same_topic
from .pairing import Answers, Asked, Pairing, ticks, time_of
from .rules import Choice, Fields
from .tuning import LIVE_APART
from .watched import Watched

if TYPE_CHECKING:
    from .engine import Monitor

REMEMBERS = "it speaks of other steps and of several topics, whose order a running graph does not tell"


@dataclass(slots=True)
class Doubts:
    """The breaches of one node that wait."""

    pairing: Pairing
    """The messages of each variable, and the breaches, as answers that may have answered any of those."""
    latest: int = 0
    """The event of the latest guarantee that was not met."""

    @staticmethod
    def beginning(values: Mapping[str, Value]) -> Doubts:
        """`values`: what is known before any message."""
        pairing = Pairing(Answers("latency", jitter=LIVE_APART))
        for name, value in values.items():
            pairing.saw(name, -1, -1.0, None, value, 0)
        return Doubts(pairing)

    def ask(self, monitor: Monitor, watched: Watched, values: Mapping[str, Value], event: Mapping[str, Any]) -> bool:
        """Whether a breach is not told yet."""
        topic = same_topic(str(event.get("topic", "")))
        spoken = [n for n in dict.fromkeys(monitor.spoken(watched)) if n in values or n not in watched.names]
        rules = monitor.setup.rules
        topics = {n: same_topic(r.topic) for n in spoken if isinstance(r := rules.get(n), Fields | Choice)}
        inputs = tuple(n for n, of in topics.items() if of != topic)
        guarantee = watched.clause.kind is ClauseKind.GUARANTEE
        remembers = watched.steps is not None or (monitor.so_far is not None and guarantee)
        if not inputs or (remembers and watched.clause.pace is not None):
            return False
        if guarantee:
            self.latest = monitor.events
        if remembers:
            if len(set(topics.values())) < 2:
                return False
            watched.tally.unsure(REMEMBERS)
            return True
        own = tuple(n for n in spoken if n not in inputs and n in values)
        now, heard, known = time_of(event), monitor.heard_of(watched.names), tuple(values[n] for n in own)
        asked = Asked(watched, event, monitor.events, own, known, inputs, ticks(now), float(now), None, heard, ())
        asked.needless = frozenset(inputs).difference(watched.names)
        self.pairing.ask(asked)
        return True
