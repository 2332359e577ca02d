"""The timeline of a judged trace: the signals that its clauses speak of, and where a fault was found."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from avow.backend_kit import timeline as pictures
from avow.base.tuning.shown import TIMELINE_PORTS
from avow.formulas.formula import free_variables
from avow.formulas.values import Value, show
from avow.language.contract import Clause
from avow.language.sorts import IntegerSort, NaturalSort, RealSort, Sort
from avow.ros.bags import Origin

from .judged import as_float
from .options import Setup, same_topic
from .reading import Reader, reader
from .rules import framed, heard_through
from .traces import read_trace, transforms
from .tuning import TIMELINE_EVENTS, WORD_LENGTH
from .watched import Fault, Violation, time_text
from .wires import MappingError

_KINDS = {
    Fault.GUARANTEE: "broken",
    Fault.EXCUSED: "excused",
    Fault.ASSUMPTION: "assumption",
    Fault.PROVIDER: "assumption",
    Fault.SILENT: "silent",
    Fault.RATE: "rate",
    Fault.MAPPING: "unreadable",
}


@dataclass(slots=True)
class Marks:
    """Where a fault was found: (node, clause or variable) → marks by kind; their number is bounded."""

    found: dict[tuple[str, str], dict[str, pictures.Columns[pictures.Mark]]] = field(default_factory=dict)

    def note(self, violation: Violation) -> None:
        kind, at = _KINDS[violation.fault], max(violation.index, 1)
        columns = self.found.setdefault((violation.node, violation.clause), {})
        mark = pictures.Mark(kind, at, at, 1, violation.time)
        columns.setdefault(kind, pictures.Columns(pictures.joined_marks)).put(at, mark)

    def events(self) -> frozenset[int]:
        """The events at which they begin."""
        return frozenset(mark.first for kinds in self.found.values() for c in kinds.values() for mark in c.items())

    def of(self, node: str, name: str) -> tuple[pictures.Mark, ...]:
        return tuple(mark for columns in self.found.get((node, name), {}).values() for mark in columns.items())


@dataclass(frozen=True, slots=True)
class Signals:
    """The values of some variables in a trace, (node, variable) → its stretches."""

    found: Mapping[tuple[str, str], tuple[pictures.Stretch, ...]]
    start: str
    end: str
    every: int


def signals(
    setups: Iterable[Setup], path: Path, where: Origin, events: int, marks: Marks, listens: Callable[[str], bool]
) -> Signals:
    """Read a trace of `events` events once more, for its values; `listens` as when it was judged. If it is long, only a
    sample of the events is read, and those at which the marks begin. Raises Rejected."""
    every = max(1, -(-events // TIMELINE_EVENTS))
    readers: dict[str, list[tuple[Setup, str, Sort, Reader]]] = {}
    setups = tuple(setups)
    tree = transforms(path, where) if any(framed(setup.rules.values()) for setup in setups) else None
    for setup in setups:
        for name, rule in setup.carried.items():
            read = reader(rule, tree, setup.known)
            readers.setdefault(same_topic(rule.topic), []).append((setup, name, rule.variable.sort, read))
    found: dict[tuple[str, str], pictures.Columns[pictures.Stretch]] = {}
    start = end = ""
    marked = marks.events()
    for recorded in read_trace(path, where, listens, lambda index: _chosen(index, every) or index in marked):
        index = recorded.index
        if index > events:
            break
        end = time_text(recorded.event.get("time"))
        start = start or end
        for setup, name, sort, read in readers.get(same_topic(str(recorded.event.get("topic", ""))), ()):
            if not setup.whose(name, recorded.event):
                continue
            try:
                said = _said(read(recorded.event, None), sort, index)
            except MappingError:
                continue  # it has a mark
            found.setdefault((setup.node.name, name), pictures.Columns(pictures.joined_stretches)).put(index, said)
    return Signals({key: pictures.runs(each.items()) for key, each in found.items()}, start, end, every)


def timeline(
    name: str, events: int, heard: Signals, marks: Marks, clauses: Sequence[tuple[Setup, Clause]],
    named: Callable[[str, str], str],
) -> pictures.Timeline:  # fmt: skip
    """A lane for each of the clauses, for each assumption that was broken, and for each variable that they speak of."""
    wanted = {(setup.node.name, clause.name) for setup, clause in clauses}
    spoken = {
        (setup.node.name, heard_through(rule))
        for setup, clause in clauses
        for v in free_variables(clause.formula)
        if (rule := setup.rules.get(v.qualified)) is not None
    }
    setups = {setup.node.name: setup for setup, _ in clauses}
    spoken_of = [(node, name) for node, setup in setups.items() for name in setup.rules if (node, name) in spoken]
    told = [
        (setup.node.name, clause.name)
        for setup in setups.values()
        for clause in setup.node.clauses
        if (setup.node.name, clause.name) in wanted
        or (clause in setup.node.assumptions and marks.of(setup.node.name, clause.name))
    ]
    ports = [key for key in spoken_of if marks.of(*key)]
    ports += [key for key in spoken_of if key not in ports][: max(0, TIMELINE_PORTS - len(ports))]
    lanes = [pictures.Lane(named(*key), (), marks.of(*key)) for key in told]
    lanes += [pictures.Lane(named(*key), heard.found.get(key, ()), marks.of(*key)) for key in spoken_of if key in ports]
    return pictures.Timeline(name, max(events, 1), heard.start, heard.end, tuple(lanes), heard.every)


def _said(value: Value, sort: Sort, at: int) -> pictures.Stretch:
    if isinstance(sort, RealSort | IntegerSort | NaturalSort):
        number = as_float(value)  # type: ignore[arg-type]
        return pictures.Band(at, at, number, number)
    text = show(value)
    return pictures.Word(at, at, text if len(text) <= WORD_LENGTH else text[: WORD_LENGTH - 1] + "…")


def _chosen(index: int, every: int) -> bool:
    """Whether an event is sampled, by a hash of its number: a plain count would be in phase with alternating topics."""
    return every == 1 or (index * 2654435761 >> 16) % every == 0
