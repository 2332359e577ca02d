"""Monitors compiled for lines of text: an event that is like one that was judged before is not judged again.

The engine (`engine`) judges. What it found is remembered by what its verdict depends on: of each variable of the
clauses that are due, the text of its message, or the region of numbers in which its reading lies. An event with a
remembered verdict only moves the counters and the latest messages; what was broken is told again. For any other event
the engine is brought up to date and judges it; so the verdicts are the engine's.

The code for each shape of line (`shapes`) is generated; it holds numbers, and no text of a contract or a trace.
"""

from __future__ import annotations

import itertools
import math
import re
from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path as File
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.formulas.values import Value
from avow.ros.bags import WHOLE

from .coverage import Tally
from .engine import Monitor
from .numbers import Decimal
from .options import same_topic
from .pace import SEQUENCE
from .regions import regions
from .rules import Choice, Fields, Hold, Lookup, Path, Previous
from .shapes import Shape, scanner, shape
from .timed import Timed
from .traces import event_of, not_text
from .tuning import CHUNK, EVENT_CHARACTERS, REMEMBERED, SHAPES_KEPT
from .watched import Fault, Violation, Watched, time_text

Token = int
"""Stands for a variable's value: equal tokens of a variable, equal truth of every clause."""

Match = re.Match[bytes]
Handler = Callable[[Match], Any]
"""False: the engine has to judge the event; True: all is well; else what is to be told, by monitors."""


@dataclass(slots=True)
class _Plan:
    """What one topic's messages do to one monitor, where nothing but their values matters."""

    monitor: Monitor
    names: tuple[str, ...]
    """The variables that the topic carries."""
    due: tuple[Watched, ...]
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
class _Watch:
    """One monitor, and the tokens of its variables."""

    monitor: Monitor
    slots: dict[str, int]
    tokens: list[Token | None]
    values: list[Value | None]
    """What the tokens stand for, as far as it was looked at."""
    regional: dict[str, list[float]]
    plans: dict[str, _Plan | None] = field(default_factory=dict)
    """By topic; None: the engine judges all its events."""


@dataclass(slots=True)
class _Topic:
    """What was passed over since the engine was last up to date."""

    name: str
    count: int = 0
    """Events that the engine has not counted."""
    last: Match | None = None
    """The latest, if the engine has not read it."""


class Compiled:
    """Feed it a trace with `run`. `told` is given what the monitors find at one event, and may explain it; `heard` is
    told of topics, and how many events of them there were."""

    def __init__(
        self,
        monitors: Sequence[Monitor],
        told: Callable[[list[Violation]], Iterable[Violation]] = lambda found: found,
        heard: Callable[[str, int], None] = lambda topic, count: None,
    ) -> None:
        self._told = told
        self._heard = heard
        self._watches = [_watch(monitor) for monitor in monitors]
        self._fresh = itertools.count(1 << 40)
        self._shapes: list[Shape] = []
        self._known: dict[tuple[int, int, str], dict[Any, Token]] = {}
        """(shape, monitor, variable) → the texts of its values → its token."""
        self._topics: dict[str, _Topic] = {}
        self._clock = [-math.inf, math.inf]
        """An event that is not later than the one, or not earlier than the other, is the engine's."""
        self._last = [b""]
        """The text of the latest event's time, where that was later than any before it."""
        self._scan, self._handlers = self._compile()

    # -- reading ---------------------------------------------------------------------------------------------------

    def run(self, path: File) -> Iterator[tuple[int, list[Violation]]]:
        """Judge the lines of a file: the line, and what was found there; nothing of lines where all is well, but once
        in each megabyte (so that whoever waits can look at the clock). Raises Rejected."""
        line = 0
        try:
            with path.open("rb") as stream:
                for chunk in _chunks(stream, str(path)):
                    at = 0
                    while at < len(chunk):
                        before, handlers = len(self._shapes), self._handlers
                        done = line
                        for line, match in enumerate(self._scan.finditer(chunk, at), done + 1):
                            known = handlers[match.lastindex](match)
                            if known is True:
                                continue
                            found = self._again(known) if known else self._slow(match, str(path), line)
                            if found:
                                yield line, found
                            if len(self._shapes) != before:
                                break
                        at = match.end()
                    self._flush()
                    yield line, []
        except OSError as error:
            raise Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}")) from None

    def _slow(self, match: Match, name: str, line: int) -> list[Violation]:
        """The engine judges, and what it finds is remembered."""
        text = match.group(0)[:-1]
        try:
            words = text.decode("utf-8-sig" if line == 1 else "utf-8")
        except UnicodeDecodeError:
            raise not_text(name) from None
        event = event_of(words, name, line)
        if event is None:
            return []
        self._flush()
        raw = event.get("topic")
        topic = raw if isinstance(raw, str) else ""
        before = [[*watch.tokens] for watch in self._watches]
        plans = [self._plan(watch, topic) for watch in self._watches]
        tallies = [[_state(watched.tally) for watched in plan.due] if plan else [] for plan in plans]
        self._heard(topic, 1)
        found = [violation for watch in self._watches for violation in watch.monitor.step(event)]
        which, groups = self._shaped(text, topic) if raw is topic else (-1, None)
        for watch, plan, old, tally in zip(self._watches, plans, before, tallies, strict=True):
            unreadable = {
                v.clause for v in found if v.fault is Fault.MAPPING and v.node == watch.monitor.setup.node.name
            }
            self._look(watch, set(plan.names) - unreadable if plan else set(), which, groups)
            if plan is not None:
                _remember(watch, plan, old, tally, found)
        self._last[0] = b""
        self._clock[0] = max((watch.monitor.timing.newest for watch in self._watches), default=-math.inf)
        self._clock[1] = min((watch.monitor.timing.deadline for watch in self._watches), default=math.inf)
        return list(self._told(found)) if found else []

    def _again(self, known: list[tuple[Violation, ...]]) -> list[Violation]:
        """What was told before of an event like the latest."""
        self._count()
        found: list[Violation] = []
        raw = self._last[0].decode()
        time = time_text(Decimal(raw) if "." in raw else int(raw))
        monitors = {watch.monitor.setup.node.name: watch.monitor for watch in self._watches}
        for violation in itertools.chain.from_iterable(known):
            monitor = monitors[violation.node]
            monitor.tallies[violation.clause].broken += 1
            monitor.tallies[violation.clause].excused += violation.fault is Fault.EXCUSED
            found.append(replace(violation, index=monitor.events, time=time))
        return list(self._told(found))

    # -- the engine's state ------------------------------------------------------------------------------------------

    def _count(self) -> None:
        """Count what was passed over."""
        for topic in self._topics.values():
            count, topic.count = topic.count, 0
            if not count:
                continue
            for watch in self._watches:
                watch.monitor.events += count
                plan = watch.plans.get(same_topic(topic.name))
                if plan is None:
                    continue
                watch.monitor.relevant += count
                for watched in plan.due:
                    watched.tally.published += count
                    watched.tally.judged += count
                    for name in watched.inputs:
                        if plan.ages.get(name, 0.0) > watched.tally.ages.get(name, -1.0):
                            watched.tally.ages[name] = plan.ages[name]
            self._heard(topic.name, count)

    def _flush(self) -> None:
        """Bring the engine up to date with what was passed over."""
        self._count()
        # in the order of the lines, since one topic may be written in two ways: `/scan` and `scan`
        last = sorted((t.last.start(), t, t.last) for t in self._topics.values() if t.last is not None)
        waiting = [topic for _, topic, _ in last]
        if not waiting:
            return
        events = [event_of(match.group(0)[:-1].decode(), "", 0) for _, _, match in last]
        for watch in self._watches:
            for topic, event in zip(waiting, events, strict=True):
                if event is not None and watch.plans.get(same_topic(topic.name)) is not None:
                    watch.monitor.caught_up(event)
            watch.monitor.settle_previous()
            for name, at in watch.slots.items():
                watch.values[at] = watch.monitor.values.get(name)
        for topic in waiting:
            topic.last = None

    def _look(self, watch: _Watch, read: set[str], which: int, groups: tuple[bytes, ...] | None) -> None:
        """Set the tokens by what the engine now knows; `read`: the variables of this event's message."""
        values = watch.monitor.values
        for name, at in watch.slots.items():
            value = values.get(name)
            if value is None:
                watch.tokens[at] = None
            elif name in read and groups is not None:
                watch.tokens[at] = self._token(watch, name, which, groups)
            elif value is not watch.values[at]:
                watch.tokens[at] = next(self._fresh)
            watch.values[at] = value
        for name, rule in watch.monitor.setup.rules.items():
            if isinstance(rule, Previous) and values.get(name) is values.get(rule.source):
                watch.tokens[watch.slots[name]] = watch.tokens[watch.slots[rule.source]]

    def _token(self, watch: _Watch, name: str, which: int, groups: tuple[bytes, ...]) -> Token | None:
        at = watch.slots[name]
        texts = _texts(self._shapes[which], watch.monitor.setup.rules[name])
        found = tuple(groups[k - 1] for k in texts)
        if _seen(watch.monitor.setup.rules[name]):
            same = watch.monitor.values[name] is watch.values[at]
            self._tokens(which, watch, name)[found if len(found) > 1 else found[0]] = 0
            return watch.tokens[at] if same else next(self._fresh)
        if name in watch.regional and len(texts) == 1 and texts[0] in self._shapes[which].numbers:
            place = bisect(watch.regional[name], float(found[0]))
            return place if place % 2 == 0 else next(self._fresh)
        known = self._tokens(which, watch, name)
        if not found:
            return next(self._fresh)
        key = found if len(found) > 1 else found[0]
        if key not in known:
            if len(known) >= REMEMBERED:
                known.clear()
            known[key] = next(self._fresh)
        return known[key]

    def _tokens(self, which: int, watch: _Watch, name: str) -> dict[Any, Token]:
        return self._known.setdefault((which, self._watches.index(watch), name), {})

    # -- plans and shapes --------------------------------------------------------------------------------------------

    def _plan(self, watch: _Watch, topic: str) -> _Plan | None:
        key = same_topic(topic)
        if key not in watch.plans:
            watch.plans[key] = _plan(watch, key)
        return watch.plans[key]

    def _shaped(self, text: bytes, topic: str) -> tuple[int, tuple[bytes, ...] | None]:
        for which, each in enumerate(self._shapes):
            if each.topic == topic and (match := re.fullmatch(each.pattern, text)):
                return which, match.groups()
        if len(self._shapes) >= SHAPES_KEPT or any(self._refused(watch, topic) for watch in self._watches):
            return -1, None
        leads = [leads for watch in self._watches for leads in self._leads(watch, topic)]
        new = shape(text, topic, lambda path: path == SEQUENCE or any(lead(path) for lead in leads))
        if new is None:
            return -1, None
        self._shapes.append(new)
        self._scan, self._handlers = self._compile()
        match = re.fullmatch(new.pattern, text)
        return (len(self._shapes) - 1, match.groups()) if match else (-1, None)

    def _refused(self, watch: _Watch, topic: str) -> bool:
        """Whether the engine has to see every event of the topic."""
        return watch.monitor.listens(topic) and self._plan(watch, topic) is None

    def _leads(self, watch: _Watch, topic: str) -> Iterator[Callable[[Path], bool]]:
        plan = self._plan(watch, topic)
        for name in plan.names if plan else ():
            yield _leads(watch.monitor.setup.rules[name])

    def _compile(self) -> tuple[re.Pattern[bytes], dict[int | None, Handler]]:
        scan, offsets = scanner(self._shapes)
        handlers: dict[int | None, Handler] = {scan.groups: lambda match: False}
        for which, (each, offset) in enumerate(zip(self._shapes, offsets, strict=True)):
            handlers[offset + len(each.paths)] = self._handler(which, each, offset)
        return scan, handlers

    def _handler(self, which: int, made: Shape, offset: int) -> Handler:
        """The code for one shape of line."""
        topic = self._topics.setdefault(made.topic, _Topic(made.topic))
        scope: dict[str, Any] = {"bisect": bisect, "clock": self._clock, "topic": topic, "last": self._last}
        timed = Timed()
        checks, acts = timed.checks, timed.acts
        loud: list[str] = []
        used: set[int] = set()
        for number, watch in enumerate(self._watches):
            plan = self._plan(watch, made.topic)
            if plan is None:
                continue
            scope[f"tok{number}"] = watch.tokens
            fresh: dict[int, str] = {}
            for name in plan.names:
                at = watch.slots[name]
                rule = watch.monitor.setup.rules[name]
                texts = _texts(made, rule)
                if not texts:
                    return lambda match: False
                used.update(texts)
                variable = f"x{number}_{at}"
                key = f"a{texts[0]}" if len(texts) == 1 else "(" + ", ".join(f"a{k}" for k in texts) + ")"
                if name in watch.regional and len(texts) == 1 and texts[0] in made.numbers:
                    scope[f"b{number}_{at}"] = watch.regional[name]
                    checks += [f"{variable} = bisect(b{number}_{at}, float({key}))", f"if {variable} & 1: return False"]
                    fresh[at] = variable
                    continue
                scope[f"k{number}_{at}"] = self._tokens(which, watch, name)
                if _seen(rule):
                    checks.append(f"if {key} not in k{number}_{at}: return False")
                    continue
                checks += [f"{variable} = k{number}_{at}.get({key})", f"if {variable} is None: return False"]
                fresh[at] = variable
            if plan.due:
                scope |= {f"quiet{number}": plan.quiet, f"loud{number}": plan.loud}
                parts, more = (
                    "".join(f"{fresh.get(at, f'tok{number}[{at}]')}, " for at in slots)
                    for slots in (plan.key, plan.excuse)
                )
                checks += [
                    f"v{number} = None",
                    f"if ({parts}) not in quiet{number}:",
                    f"    v{number} = loud{number}.get(({more}))",
                    f"    if v{number} is None: return False",
                ]
                loud.append(f"v{number}")
            acts += [f"tok{number}[{at}] = {variable}" for at, variable in fresh.items()]
            inputs = tuple(dict.fromkeys(name for watched in plan.due for name in watched.inputs))
            timed.add(watch.monitor.timing, plan.names, (inputs, plan.ages), made, str(number), scope)
            for name, rule in watch.monitor.setup.rules.items():
                if isinstance(rule, Previous) and rule.source in plan.names:
                    acts.append(f"tok{number}[{watch.slots[name]}] = tok{number}[{watch.slots[rule.source]}]")
        used |= {made.time, *timed.used}
        groups = sorted(used)
        names = ", ".join(f"a{k}" for k in groups)
        time = f"a{made.time}"
        code = [
            f"{names} = match.group({', '.join(str(offset + k) for k in groups)})",
            f"t = float({time})",
            "if not clock[0] < t < clock[1]:",
            f"    if {time} != last[0] or t != clock[0] or t >= clock[1]: return False",
            *checks,
            *acts,
            f"last[0] = {time}",
            "clock[0] = t",
            "topic.count += 1",
            "topic.last = match",
            *([f"if {' or '.join(loud)}: return [v for v in ({', '.join(loud)},) if v]"] if loud else []),
            "return True",
        ]
        exec("def handle(match):\n" + "".join(f"    {each}\n" for each in code), scope)
        handle: Handler = scope["handle"]
        return handle


def _watch(monitor: Monitor) -> _Watch:
    rules = monitor.setup.rules
    formulas = [clause.formula for clause in monitor.setup.node.clauses]
    found = {name: regions(rule, formulas) for name, rule in rules.items()}
    # the step before is the source's value: alike only where both are only compared, with the same numbers
    found |= {rule.source: None for rule in rules.values() if isinstance(rule, Previous)}
    slots = {name: at for at, name in enumerate(rules)}
    regional = {name: bounds for name, bounds in found.items() if bounds is not None}
    return _Watch(monitor, slots, [None] * len(slots), [None] * len(slots), regional)


def _plan(watch: _Watch, topic: str) -> _Plan | None:
    """What the topic does; None where more than the latest values matters."""
    monitor = watch.monitor
    names = monitor.carried(topic)
    if not names or not monitor.by_values:
        return None
    due: dict[int, Watched] = {id(w): w for name in names for w in monitor.triggered_by(name)}
    for watched in due.values():
        if watched.held or watched.paired or not watched.outputs <= set(names):
            return None
    spoken = dict.fromkeys(name for watched in due.values() for name in watched.names)
    more = dict.fromkeys((*spoken, *monitor.assumed))
    return _Plan(
        monitor, names, tuple(due.values()), tuple(map(watch.slots.__getitem__, spoken)),
        tuple(map(watch.slots.__getitem__, more)),
    )  # fmt: skip


def _remember(
    watch: _Watch, plan: _Plan, old: list[Token | None], tallies: list[tuple[int, ...]], found: list[Violation]
) -> None:
    """Keep what an event has shown, if it was nothing but that clauses held or were broken."""
    own = {watch.slots[name] for name in plan.names}
    broken: set[str] = set()
    for watched, then in zip(plan.due, tallies, strict=True):
        now = _state(watched.tally)
        if now[:2] != (then[0] + 1, then[1] + 1) or now[3:] != then[3:]:
            return
        if now[2] != then[2]:
            broken.add(watched.clause.name)
            if any(name in watch.regional for name in watched.names):
                return  # what is told has the reading itself
    told = tuple(v for v in found if v.node == watch.monitor.setup.node.name)
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


def _state(tally: Tally) -> tuple[int, ...]:
    return (
        tally.published, tally.judged, tally.broken, tally.undecided, tally.order, tally.early, tally.unreadable,
        tally.partial, tally.supposed, tally.forgotten,
    )  # fmt: skip


def _seen(rule: object) -> bool:
    return isinstance(rule, Fields) and rule.hold is Hold.SEEN


def _leads(rule: object) -> Callable[[Path], bool]:
    """Whether what lies at a path is read by a rule."""
    wanted: list[Path] = []
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
    # which item `ranges[-1]` is depends on how many there are: all of them count
    wanted = [tuple(itertools.takewhile(lambda step: isinstance(step, str) or step >= 0, path)) for path in wanted]
    wanted += [(place, *path) for path in wanted for place in ("data", WHOLE)]
    return lambda path: any(path[: len(way)] == way for way in wanted)


def _texts(made: Shape, rule: object) -> tuple[int, ...]:
    return made.groups(_leads(rule))


def _chunks(stream: Any, name: str) -> Iterator[bytes]:
    """Whole lines, about a megabyte at a time, the last one ended."""
    rest = b""
    while True:
        read = stream.read(CHUNK)
        if not read:
            if rest:
                yield rest + b"\n"
            return
        end = read.rfind(b"\n")
        if end < 0:
            rest += read
            if len(rest) > 4 * EVENT_CHARACTERS:
                raise Rejected(Diagnostic("MON204", f"{name}: a line is longer than {EVENT_CHARACTERS} characters"))
            continue
        yield rest + read[: end + 1]
        rest = read[end + 1 :]
