"""What the events of one topic do to one monitor, as far as nothing but their values matters, for `monitors`.

Between two of the numbers that a contract names, all readings are alike: a variable that clauses only ever compare with
numbers matters through its place among these. The place is found in floating point, away from the numbers by more than
any rounding of reading and comparing; what lies nearer is left to exact calculation.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction

from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.values import Value
from avow.language.contract import ClauseKind
from avow.language.sorts import RealSort
from avow.language.terms import Compare, In, SequenceRange, SetTerm, Term, Variable
from avow.ros.bags import ENVELOPE, WHOLE
from avow.ros.definitions import FLOATS, Scalar

from ..coverage import Tally
from ..engine import Monitor
from ..rules import Choice, FieldPath, Fields, Hold, Lookup, Previous, Rule, heard_through
from ..tuning import REMEMBERED
from ..watched import Violation, Watched
from ..wires import LARGEST_SINGLE
from .shapes import Shape

Token = int
"""Stands for a variable's value: equal tokens of a variable, equal truth of every clause."""


@dataclass(slots=True)
class Plan:
    """What one topic's messages do to one monitor, where nothing but their values matters."""

    monitor: Monitor
    names: tuple[str, ...]
    """The variables that the topic carries."""
    due: tuple[Watched, ...]
    """The clauses that are judged by the latest values."""
    asked: tuple[Watched, ...]
    """Those whose answers wait for the inputs that they answered."""
    key: tuple[int, ...]
    """The slots of the variables that the due clauses speak of."""
    excuse: tuple[int, ...]
    """The slots of all that may matter where one of them is broken: the assumptions' too."""
    quiet: set[tuple[Token | None, ...]] = field(default_factory=set)
    """Where all of them held."""
    loud: dict[tuple[Token | None, ...], tuple[Violation, ...]] = field(default_factory=dict)
    """Where some were broken: what is told then."""
    ages: dict[str, float] = field(default_factory=dict)
    """The greatest age of each input when an answer came."""


@dataclass(slots=True)
class Watch:
    """One monitor, and the tokens of its variables."""

    monitor: Monitor
    slots: dict[str, int]
    tokens: list[Token | None]
    values: list[Value | None]
    """What the tokens stand for, as far as it was looked at."""
    sources: list[Value | bytes | None]
    """What the tokens stand for now, where answers are paired: a value, or the line of the message that has it."""
    regional: dict[str, list[float]]
    plans: dict[str, Plan | None] = field(default_factory=dict)
    """By topic; None: the engine judges all its events."""


def watch_of(monitor: Monitor) -> Watch:
    rules = monitor.setup.rules
    formulas = [clause.formula for clause in monitor.setup.node.clauses]
    found = {name: regions(rule, formulas) for name, rule in rules.items()}
    # the step before is the source's value: alike only where both are only compared, with the same numbers
    found |= {rule.source: None for rule in rules.values() if isinstance(rule, Previous)}
    slots = {name: at for at, name in enumerate(rules)}
    regional = {name: bounds for name, bounds in found.items() if bounds is not None}
    if monitor.pairing is not None:
        monitor.pairing.begin({name: read for name in rules if (read := monitor.reader(heard_through(rules[name])))})
    for watched in monitor.about(monitor.clauses):
        watched.alike.clear()  # the tokens of a run before are others
    nothing: list[None] = [None] * len(slots)
    return Watch(monitor, slots, [*nothing], [*nothing], [*nothing], regional)


def plan_of(watch: Watch, topic: str) -> Plan | None:
    """What the topic does; None where more than the latest values matters."""
    monitor = watch.monitor
    names = monitor.carried(topic)
    if not names or not monitor.by_values or not monitor.setup.shared.keys().isdisjoint(names):
        return None
    found = monitor.about(names)
    if any(watched.held or not watched.outputs <= set(names) for watched in found):
        return None
    answers = monitor.pairing.answers if monitor.pairing is not None else None
    if answers is not None and {*answers.input[:1], *answers.output[:1]} & {*ENVELOPE}:
        return None
    due = tuple(watched for watched in found if not watched.paired)
    asked = tuple(watched for watched in found if watched.paired)
    spoken = dict.fromkeys(name for watched in due for name in watched.names)
    more = dict.fromkeys((*spoken, *monitor.assumed))
    slots = watch.slots
    return Plan(monitor, names, due, asked, tuple(slots[name] for name in spoken), tuple(slots[name] for name in more))


def remember(
    watch: Watch, plan: Plan, old: list[Token | None], tallies: list[tuple[int, ...]], found: list[Violation]
) -> None:
    """Keep what an event has shown, if it was nothing but that clauses held or were broken."""
    own = {watch.slots[name] for name in plan.names}
    broken: set[str] = set()
    for watched, then in zip(plan.due, tallies, strict=True):
        if id(watched) in watch.monitor.settled:
            return  # an answer that waited was judged, too
        now = counts_of(watched.tally)
        if now[:2] != (then[0] + 1, then[1] + 1) or now[3:] != then[3:]:
            return
        if now[2] != then[2]:
            broken.add(watched.clause.name)
            if any(name in watch.regional for name in watched.names):
                return  # what is told has the reading itself
            if watched.clause.kind is ClauseKind.ASSUMPTION and not set(watched.names) <= set(plan.names):
                return  # whose message it was is told by the engine
    told = tuple(
        replace(v, heard={name: at for name, at in v.heard.items() if name in plan.names})
        for v in found
        if v.node == watch.monitor.setup.node.name
    )
    if {v.clause for v in told} != broken:
        return

    def key(slots: tuple[int, ...]) -> tuple[Token | None, ...]:
        return tuple(watch.tokens[at] if at in own else old[at] for at in slots)

    if None in key(plan.key):
        return
    if len(plan.quiet) + len(plan.loud) >= REMEMBERED:
        plan.quiet.clear()
        plan.loud.clear()
    if told:
        plan.loud[key(plan.excuse)] = told
    else:
        plan.quiet.add(key(plan.key))


def counts_of(tally: Tally) -> tuple[int, ...]:
    return (
        tally.published, tally.judged, tally.broken, tally.undecided, tally.order, tally.early, tally.unreadable,
        tally.partial, tally.supposed, tally.forgotten,
    )  # fmt: skip


def is_seen(rule: object) -> bool:
    return isinstance(rule, Fields) and rule.hold is Hold.SEEN


def leads(rule: object) -> Callable[[FieldPath], bool]:
    """Whether what lies at a path is read by a rule."""
    wanted: list[FieldPath] = []
    match rule:
        case Fields(each=None, paths=paths):
            wanted += paths
        case Fields(each=each):
            wanted += [each] if each is not None else []
        case Choice(tag=tag, arguments=arguments):
            wanted.append(tag)
            for places in arguments.values():
                wanted += [place.key if isinstance(place, Lookup) else place for place in places]
        case _:  # no message carries it
            pass
    return below(wanted)


def below(wanted: Iterable[FieldPath]) -> Callable[[FieldPath], bool]:
    """Whether something lies at one of these paths of a message, or within it."""
    # which item `ranges[-1]` is depends on how many there are: all of them count
    wanted = [tuple(itertools.takewhile(lambda step: isinstance(step, str) or step >= 0, path)) for path in wanted]
    wanted += [(place, *path) for path in wanted for place in ("data", WHOLE)]
    return lambda path: any(path[: len(way)] == way for way in wanted)


def texts_of(made: Shape, rule: object) -> tuple[int, ...]:
    return made.groups(leads(rule))


def regions(rule: Rule, formulas: Iterable[Term]) -> list[float] | None:
    """Ascending bounds: a reading whose `bisect` among them is even lies in a region all of whose readings make the
    same formulas true; one whose place is odd is too near to a number to tell. None where the variable is not only
    compared."""
    if not isinstance(rule, Fields) or not isinstance(rule.variable.sort, RealSort) or rule.take or len(rule.paths) > 1:
        return None
    wire = rule.wire(0)
    if wire is not None and not (isinstance(wire, Scalar) and wire.name in FLOATS):
        return None
    found: set[Fraction] = set()
    for formula in formulas:
        for number in _compared(formula, rule.variable):
            if number is None:
                return None
            found.add(number)
    try:
        near = [(float(n), abs(float(n)) * 2.0**-20 + 1e-40) for n in found]
    except OverflowError:
        return None
    spans = [(middle - room, middle + room) for middle, room in near]
    return _merged([(-math.inf, -LARGEST_SINGLE / 2), *spans, (LARGEST_SINGLE / 2, math.inf)])


def _merged(spans: list[tuple[float, float]]) -> list[float]:
    bounds: list[float] = []
    for low, high in sorted(spans):
        if bounds and low <= bounds[-1]:
            bounds[-1] = max(bounds[-1], high)
        else:
            bounds += [low, high]
    return bounds


def _compared(term: Term, variable: Variable) -> Iterator[Fraction | None]:
    """The numbers that the variable is compared with; None where it occurs in another way."""
    match term:
        case Variable():
            if term.qualified == variable.qualified:
                yield None
        case Compare(left=left, right=right) if _is(left, variable) or _is(right, variable):
            yield number_of(right if _is(left, variable) else left)
        case In(item=item, collection=SetTerm(items=items)) if _is(item, variable):
            yield from map(number_of, items)
        case In(item=item, collection=SequenceRange(low=low, high=high)) if _is(item, variable):
            yield from (number_of(low), number_of(high))
        case _:  # compares nothing itself
            for child in term.children:
                yield from _compared(child, variable)


def _is(term: Term, variable: Variable) -> bool:
    return isinstance(term, Variable) and term.qualified == variable.qualified


def number_of(term: Term) -> Fraction | None:
    """The value of a term without variables."""
    try:
        value = evaluate(term, {})
    except NotEvaluable:
        return None
    return Fraction(value) if isinstance(value, int | Fraction) and not isinstance(value, bool) else None
