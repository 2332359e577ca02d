"""Finds the node at fault: a breach is traced along the graph, across delays, to the first clause that broke.

A node whose assumption fails on another node's message is not to blame, and neither is the environment: the other node
is, if that very message broke one of its guarantees; otherwise its own assumption may have been broken before. The
message is known from both ends: the guarantee's outputs and the assumption's inputs were read from it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import assert_never

from avow.language.contract import Node
from avow.language.subterms import ports_of
from avow.language.terms import Role
from avow.system.graph import dataflow
from avow.system.plan import Edge, System

from .engine import Monitor
from .tuning import BREACHES_KEPT, BREACHES_OPEN
from .watched import Fault, Violation


@dataclass(slots=True)
class _Origin:
    """Where a breach began, in words; empty until that is known. `event`: the number of the first event."""

    text: str = ""
    event: int = 0


@dataclass(slots=True)
class Blame:
    """Traces breaches to their origin; `with_causes` takes the violations of one event, of all nodes together."""

    system: System
    monitors: Mapping[str, Monitor]
    """The monitors by their nodes."""
    _feeding: dict[str, dict[str, Edge]] = field(default_factory=dict)
    _broken: dict[tuple[str, str], dict[int, _Origin]] = field(default_factory=dict)
    """(node, output) → its messages that broke a guarantee."""
    _assumed: dict[str, deque[tuple[Violation, _Origin]]] = field(default_factory=dict)
    """Node → its latest broken assumptions, and where each began."""
    _open: deque[tuple[Violation, _Origin]] = field(default_factory=deque)
    """Broken assumptions on a message of a node whose verdict is still open."""

    def __post_init__(self) -> None:
        for edge in dataflow(self.system).edges:
            self._feeding.setdefault(edge.target.node, {})[edge.target.port] = edge

    def with_causes(self, violations: Sequence[Violation], *, over: bool = False) -> Iterator[Violation]:
        """The same violations, with their causes. Those that wait for a verdict on another node's answer are reported
        later, at the latest once the run is `over`."""
        origins: list[tuple[Violation, _Origin]] = []
        for violation in violations:
            if violation.fault is Fault.ASSUMPTION:
                origins.append((violation, _Origin()))
                known = self._assumed.setdefault(violation.node, deque(maxlen=BREACHES_KEPT))
                known.append(origins[-1])
        for violation in violations:
            match violation.fault:
                case Fault.GUARANTEE:
                    self._note(violation, _Origin(f"{_place(violation)}{self._doubt(violation)}", violation.index))
                case Fault.EXCUSED if origin := self._excuse(violation):
                    self._note(violation, origin)
                case Fault.EXCUSED | Fault.ASSUMPTION | Fault.PROVIDER | Fault.SILENT | Fault.RATE | Fault.MAPPING:
                    # this makes no output of the node wrong
                    pass
                case _:
                    assert_never(violation.fault)
        self._open += origins
        settled = list(self._settle(late=False))
        if over or len(self._open) > BREACHES_OPEN:
            settled += self._settle(late=True)
        yield from (self._excused(v) for v in violations if v.fault is not Fault.ASSUMPTION)
        yield from settled

    def _excused(self, violation: Violation) -> Violation:
        """A violation with the cause of the broken assumption that excuses it, if that is known."""
        if violation.fault is not Fault.EXCUSED:
            return violation
        origin = self._excuse(violation)
        return replace(violation, cause=f"{origin.text} caused it" if origin is not None and origin.text else "")

    def _settle(self, *, late: bool) -> Iterator[Violation]:
        """The violations whose cause is known; `late`: also those whose cause will not be known."""
        waiting = 0
        while self._open and waiting < len(self._open):
            violation, origin = self._open.popleft()
            followed = self._followed(violation, origin, late=late)
            if followed is None:
                self._open.append((violation, origin))
                waiting += 1
            else:
                waiting = 0  # others may wait for it
                yield followed

    def _note(self, violation: Violation, origin: _Origin) -> None:
        for name, (message, _) in violation.heard.items():
            role, _, port = name.partition(".")
            if role == Role.OUTPUT:
                known = self._broken.setdefault((violation.node, port), {})
                known.setdefault(message, origin)
                if len(known) > BREACHES_KEPT:
                    del known[next(iter(known))]

    def _doubt(self, violation: Violation) -> str:
        monitor = self.monitors[violation.node]
        unsure = monitor.tallies[violation.clause].unpaired or monitor.backwards
        return " (if the order of arrival is that of cause)" if unsure else ""

    def _since(self, node: str, event: int) -> _Origin | None:
        """Where the assumption that was broken last before an event began to fail."""
        return next((origin for one, origin in reversed(self._assumed.get(node, ())) if one.index <= event), None)

    def _excuse(self, violation: Violation) -> _Origin | None:
        """Where the assumption that excuses a breach began to fail: by the inputs that the answer was paired with."""
        pairing = self.monitors[violation.node].exact
        given = [pairing.answered.get(message, {}) for message, _ in violation.heard.values()] if pairing else []
        found = next((origin for one in given if (origin := self._by(violation.node, one)) is not None), None)
        return found or self._since(violation.node, violation.index)

    def _by(self, node: str, given: Mapping[str, tuple[int, ...]]) -> _Origin | None:
        """Where the assumption that one of some messages broke began to fail."""
        for one, origin in reversed(self._assumed.get(node, ())):
            if any(message in given.get(name, ()) for name, (message, _) in one.heard.items()):
                return origin
        return None

    def _followed(self, violation: Violation, origin: _Origin, *, late: bool) -> Violation | None:
        """A broken assumption, with its cause; None while a verdict on that is still open, unless it is late."""
        node = self.monitors[violation.node].setup.node
        edges = {port: self._edges(violation, port) for port in _inputs(node, violation.clause)}
        here = _place(violation)
        if not any(edges.values()):
            origin.text, origin.event = f"{here} (environment)", violation.index
            return violation
        causes: list[_Origin] = []
        for port, feeding in edges.items():
            for edge in feeding:
                cause = self._cause(edge, violation, port)
                if cause is not None and not cause.text and not late:
                    return None
                causes += [cause] if cause is not None and cause.text else []
        if causes:
            first = min(causes, key=lambda cause: cause.event)
            origin.text, origin.event, why = first.text, first.event, f"{first.text} caused {here}"
        else:
            origin.text, origin.event = here, violation.index
            sources = list(dict.fromkeys(edge.source for feeding in edges.values() for edge in feeding))
            unseen = [str(source) for source in sources if source.node not in self.monitors]
            why = f"it came from {', '.join(map(str, sources))}, of which no guarantee was seen broken"
            if any(len(feeding) > 1 for feeding in edges.values()):
                why = f"it came from {' or '.join(map(str, sources))}: the publisher of the message is unknown"
            why += f" ({', '.join(unseen)} is not monitored)" if unseen else ""
            given = [f"in.{port}" for port, feeding in edges.items() if not feeding]
            why += f"; {', '.join(given)} came from the environment" if given else ""
        first_broken = origin.text.partition(" at event ")[0] if causes else ""
        return replace(violation, fault=Fault.PROVIDER, cause=why, origin=first_broken)

    def _edges(self, violation: Violation, port: str) -> list[Edge]:
        """The edges that feed an input: of several publishers, the message's own, or all if unknown."""
        edge = self._feeding.get(violation.node, {}).get(port)
        if edge is None:
            return []
        if not self.system.contract.node(edge.source.node).relay:
            return [edge]
        several = list(self._feeding.get(edge.source.node, {}).values())
        _, by = violation.heard.get(f"{Role.INPUT}.{port}", (0, ""))
        names = self.system.plan.ros.names
        return [e for e in several if by and names.placed(e.source.node).name == by] or several

    def _cause(self, edge: Edge, violation: Violation, port: str) -> _Origin | None:
        """Where a breach of the source that includes the message began (empty while its verdict is open); None if there
        is none."""
        monitor = self.monitors.get(edge.source.node)
        message, _ = violation.heard.get(f"{Role.INPUT}.{port}", (0, ""))
        if monitor is None or not message:
            return None
        known = self._broken.get((edge.source.node, edge.source.port), {}).get(message)
        if known is not None:
            return known
        if monitor.waits(violation.index):
            return _Origin()
        # a node that promised nothing, since its input was wrong, passes the fault on with this message
        if monitor.exact is not None:
            return self._by(edge.source.node, monitor.exact.answered.get(message, {}))
        latest = all(message >= other for other, _ in violation.heard.values())
        if latest and violation.heard and _failing(monitor):
            return self._since(edge.source.node, violation.index)
        return None


def _place(violation: Violation) -> str:
    return f"{violation.node}.{violation.clause} at event {violation.index}"


def _inputs(node: Node, clause: str) -> list[str]:
    return [v.name for v in ports_of(node.clause(clause).formula) if v.role is Role.INPUT]


def _failing(monitor: Monitor) -> bool:
    """Whether an assumption fails for the currently known values."""
    known = (a for a in monitor.assumptions if a.steps is None and monitor.values.keys() >= set(a.names))
    return any(assumed.truth_of(monitor.values) is False for assumed in known)
