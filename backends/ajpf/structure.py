"""Labelled graphs, made smaller up to stuttering, and the search for a fair accepting lasso in one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from avow.base.graphs import strong_components
from avow.formulas.lasso import Fair, Lasso, accepted_run
from avow.formulas.ltl import Automaton

from .psl import Formula


@dataclass(frozen=True, slots=True)
class Kripke:
    """States by numbers, their successors, and a label for each: a bit set. Runs are endless: one that comes to a state
    without successors is none."""

    initial: tuple[int, ...]
    successors: Sequence[Sequence[int]]
    labels: Sequence[int]

    def __len__(self) -> int:
        return len(self.labels)


def reduce(graph: Kripke) -> Kripke:
    """A smaller graph with the same runs up to stuttering (and up to nothing else: endless stuttering stays).

    States of one label that reach each other become one with a loop; a state whose only way leads to a state of its
    own label becomes that state. Properties without "next" do not see the difference.
    """
    labels, successors = graph.labels, graph.successors

    def alike(node: int) -> list[int]:
        label = labels[node]
        return [t for t in successors[node] if labels[t] == label]

    number = [-1] * len(labels)
    new_successors: list[tuple[int, ...]] = []
    new_labels: list[int] = []
    seen: dict[tuple[int, bool, tuple[int, ...]], int] = {}
    pending: list[tuple[int, list[int], bool]] = []
    # Components come after those that they reach along equal labels, so "only way leads to its own label" is known.
    for component in strong_components(range(len(labels)), alike):
        label = labels[component[0]]
        members = set(component)
        loop = len(component) > 1 or component[0] in successors[component[0]]
        outside = [t for node in component for t in successors[node] if t not in members]
        same = {number[t] for t in outside if labels[t] == label}
        different = any(labels[t] != label for t in outside)
        if not loop and not different and len(same) == 1:
            target = next(iter(same))
        else:
            target = len(pending)
            pending.append((label, outside, loop))
        for node in component:
            number[node] = target
    merged = list(range(len(pending)))
    for at, (label, outside, loop) in enumerate(pending):
        targets = sorted({number[t] for t in outside} | ({at} if loop else set()))
        key = (label, loop, tuple(t for t in targets if t != at))
        known = seen.setdefault(key, at)
        merged[at] = known
        new_labels.append(label)
        new_successors.append(tuple(targets))
    initial = tuple(dict.fromkeys(merged[number[s]] for s in graph.initial))
    successors_now = [tuple(dict.fromkeys(merged[t] for t in targets)) for targets in new_successors]
    return _reachable(Kripke(initial, successors_now, new_labels))


def _reachable(graph: Kripke) -> Kripke:
    order: dict[int, int] = {s: i for i, s in enumerate(graph.initial)}
    queue = list(graph.initial)
    for node in queue:
        for target in graph.successors[node]:
            if target not in order:
                order[target] = len(order)
                queue.append(target)
    return Kripke(
        tuple(range(len(graph.initial))),
        [tuple(order[t] for t in graph.successors[node]) for node in queue],
        [graph.labels[node] for node in queue],
    )


def find_lasso(graph: Kripke, automaton: Automaton[Formula], fair: Sequence[Fair] = ()) -> Lasso | None:
    """A fair run of the graph that the automaton accepts, or None if there is none."""
    following, labels = graph.successors.__getitem__, graph.labels.__getitem__
    return accepted_run(graph.initial, following, labels, automaton, fair)
