"""The part of a state space that one property needs: runs are followed only as long as they may still violate it, and a
bad prefix ends the search. So an unbounded agent may still get an answer."""

from __future__ import annotations

import time
from array import array
from typing import Any

from avow.formulas.lasso import monitor
from avow.formulas.ltl import Automaton

from .builtin import Crash
from .checker import Property, label_states
from .explore import Graph, System
from .mind import Table
from .psl import Formula, Not, atoms, automaton_of, compiled
from .tuning import TAIL


class _Part:
    """States by their numbers, with the successors found so far."""

    def __init__(self, system: System) -> None:
        self.system = system
        self.table: Table[Any] = Table()
        self.states, self.number = self.table.all, self.table.number
        self.successors: dict[int, tuple[int, ...]] = {}

    def after(self, number: int) -> tuple[int, ...]:
        found = self.successors.get(number)
        if found is None:
            reached = self.system.successors(self.states[number])
            found = self.successors[number] = tuple(dict.fromkeys(map(self.number, reached)))
        return found

    def graph(self, initial: tuple[int, ...]) -> Graph:
        offsets, targets = array("i", [0]), array("i")
        for number in range(len(self.states)):
            targets.extend(self.successors.get(number, ()))
            offsets.append(len(targets))
        why = "only as far as the property is open"
        return Graph(self.system, self.states, initial, offsets, targets, why, settles=True)


def open_part(system: System, wanted: Property, states: int, seconds: float) -> Graph | None:
    """The states in which the property is neither satisfied nor violated for good, and their neighbours: enough to
    decide it. None if the bounds are met first. Raises ltl.TooLarge, TooDeep."""
    if system.environment.fair:
        return None
    deadline = time.monotonic() + seconds
    automaton = automaton_of(Not(wanted.formula))
    places = {atom: at for at, atom in enumerate(dict.fromkeys(atoms(wanted.formula)))}
    tests = [compiled(leaf, places) for leaf in automaton.leaves]
    useful, lost = monitor(automaton).live, _lost(automaton)
    part = _Part(system)
    labels: list[int] = []

    def fits(node: int, number: int) -> bool:
        yes, no = automaton.positive[node], automaton.negative[node]
        return labels[number] & yes == yes and not labels[number] & no

    def label_new() -> None:
        for label in label_states(system, part.states[len(labels) :], tuple(places)):
            labels.append(sum(1 << at for at, test in enumerate(tests) if test(label)))

    try:
        initial = tuple(dict.fromkeys(map(part.number, system.start())))
        label_new()
        level = {(s, n) for s in initial for n in automaton.initial if n in useful and fits(n, s)}
        seen = set(level)
        while level:
            bad = next((s for s, n in level if n in lost), None)
            if bad is not None:
                return part.graph(initial) if _followed(part, bad) else None
            if len(part.states) > states or time.monotonic() > deadline:
                return None
            following = [(t, n) for s, n in level for t in part.after(s)]
            label_new()
            level = {(t, m) for t, n in following for m in automaton.successors[n] if m in useful and fits(m, t)} - seen
            seen |= level
    except Crash:
        return None
    return part.graph(initial)


def _followed(part: _Part, number: int) -> bool:
    """Whether the run that always takes the first successor comes back to a state."""
    seen: set[int] = set()
    while number not in seen and len(seen) < TAIL:
        seen.add(number)
        number = part.after(number)[0]
    return number in seen


def _lost(automaton: Automaton[Formula]) -> frozenset[int]:
    """Nodes that accept every continuation: a run that reaches one violates the property for good."""
    return frozenset(
        n
        for n, following in enumerate(automaton.successors)
        if not automaton.positive[n]
        and not automaton.negative[n]
        and n in following
        and all(n in accepting for accepting in automaton.accepting)
    )
