"""Monitors compiled for lines of text: an event that is like one that was judged before is not judged again.

The engine (`engine`) judges. What it found is remembered by what its verdict depends on: of each variable of the
clauses that are due, the text of its message, or the region of numbers in which its reading lies. An event with a
remembered verdict only moves the counters and the latest messages; what was broken is told again. For any other event
the engine is brought up to date and judges it; so the verdicts are the engine's.

The code for each shape of line (`shapes`) is generated; it holds numbers, and no text of a contract or a trace.
"""

from __future__ import annotations

import itertools
import json
import math
import re
from bisect import bisect
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected
from avow.ros.bags import LIVE, Event

from ..engine import Monitor
from ..numbers import Decimal
from ..options import same_topic
from ..pace import SEQUENCE
from ..rules import FieldPath, Previous
from ..traces import event_of, not_text
from ..tuning import BATCH, CHUNK, EVENT_CHARACTERS, REMEMBERED, SHAPES_KEPT, TEXT_BYTES
from ..watched import Fault, Violation, time_text
from .noted import Paired, Timed
from .plans import Plan, Token, Watch, below, counts_of, is_seen, leads, plan_of, remember, texts_of, watch_of
from .shapes import Shape, scanner, shape

Match = re.Match[bytes]
Handler = Callable[[Match, int], Any]
"""Of a line and its number. False: the engine has to judge the event; True: all is well; else what is to be told, by
monitors: a list of what was found now, or a tuple of what was told of another event like it."""


@dataclass(slots=True)
class _Topic:
    """What was passed over since the engine was last up to date."""

    name: str
    count: int = 0
    """Events that the engine has not counted."""
    last: Match | None = None
    """The latest, if the engine has not read it."""
    line: int = 0
    """Its line."""


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
        self._watches = [watch_of(monitor) for monitor in monitors]
        self._by_values = any(monitor.by_values for monitor in monitors)
        """Else the engine judges all that is listened to, and nothing of it is remembered."""
        self._blank = [0]
        """How many lines so far are no events."""
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
        self._line = 0
        """How many lines have been read."""
        for monitor in monitors:
            monitor.catch_up = self._flush

    # -- reading ---------------------------------------------------------------------------------------------------

    def run(self, path: Path) -> Iterator[tuple[int, list[Violation]]]:
        """Judge the lines of a file, as `lines` does. Raises Rejected."""
        try:
            with path.open("rb") as stream:
                yield from self.lines(stream.read1, str(path))
        except OSError as error:
            raise Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}")) from None

    def lines(self, read: Callable[[int], bytes], name: str) -> Iterator[tuple[int, list[Violation]]]:
        """Judge the lines of a stream, which `read` gives as they come (none at its end): the line, and what was found
        there; nothing of lines where all is well, but once in each megabyte (so that whoever waits can look at the
        clock). Raises Rejected, OSError."""
        for chunk in _chunks(read, name):
            yield from self._judged(chunk, name)

    def events(self, events: Iterable[tuple[Event, int]]) -> Iterator[tuple[int, list[Violation]]]:
        """Judge the messages of a bag, each with its size in bytes, as lines that would say the same; large ones by the
        engine. Raises Rejected."""
        pending = iter(events)
        while several := list(itertools.islice(pending, BATCH)):
            lines: list[str] = []
            for event, size in several:
                line = _line_of(event, size)
                if line is not None:
                    lines.append(line)
                    continue
                yield from self._judged("".join(lines).encode(), "")
                lines.clear()
                self._line += 1
                yield self._line, self._engine(event, None, self._line)
            yield from self._judged("".join(lines).encode(), "")

    def _judged(self, chunk: bytes, name: str) -> Iterator[tuple[int, list[Violation]]]:
        """Judge some whole lines, which come after those before."""
        at, line = 0, self._line
        while at < len(chunk):
            before, handlers = len(self._shapes), self._handlers
            done = line
            for line, match in enumerate(self._scan.finditer(chunk, at), done + 1):
                known = handlers[match.lastindex](match, line)
                if known is True:
                    continue
                found = self._again(known, line) if known else self._slow(match, name, line)
                if found:
                    yield line, found
                if len(self._shapes) != before:
                    break
            at = match.end()
        self._line = line
        self._flush()
        yield line, []

    def _slow(self, match: Match, name: str, line: int) -> list[Violation]:
        """The engine judges, and what it finds is remembered."""
        text = match.group(0)[:-1]
        try:
            words = text.decode("utf-8-sig" if line == 1 else "utf-8")
        except UnicodeDecodeError:
            raise not_text(name) from None
        event = event_of(words, name, line)
        if event is None:
            self._blank[0] += 1
            return []
        return self._engine(event, text, line)

    def _engine(self, event: Event, text: bytes | None, line: int) -> list[Violation]:
        """The engine judges an event; what it finds is remembered for others with a text like its own."""
        self._flush()
        raw = event.get("topic")
        topic = raw if isinstance(raw, str) else ""
        if self._by_values and LIVE in event and any(watch.monitor.by_arrival for watch in self._watches):
            self._by_values = False  # from now on answers wait for what is heard after them
            self._shapes.clear()
            self._scan, self._handlers = self._compile()
        if not self._by_values and any(watch.monitor.listens(topic) for watch in self._watches):
            self._heard(topic, 1)
            found = [violation for watch in self._watches for violation in watch.monitor.step(event, line)]
            self._passed()
            return list(self._told(found)) if found else []
        plans = [self._plan(watch, topic) for watch in self._watches]
        before = [[*watch.tokens] for watch in self._watches]
        tallies = [[counts_of(watched.tally) for watched in plan.due] if plan else [] for plan in plans]
        for watch in self._watches:
            watch.monitor.settled.clear()
        self._heard(topic, 1)
        found = [violation for watch in self._watches for violation in watch.monitor.step(event, line)]
        self._blank[0] = line - max((watch.monitor.events for watch in self._watches), default=line)
        which, groups = self._shaped(text, topic) if raw is topic and text is not None else (-1, None)
        for watch, plan, old, tally in zip(self._watches, plans, before, tallies, strict=True):
            unreadable = {
                v.clause for v in found if v.fault is Fault.MAPPING and v.node == watch.monitor.setup.node.name
            }
            self._look(watch, set(plan.names) - unreadable if plan else set(), which, groups)
            if plan is not None:
                remember(watch, plan, old, tally, found)
        self._passed()
        return list(self._told(found)) if found else []

    def _passed(self) -> None:
        """The engine has judged an event: later ones are passed over only from its time on."""
        self._last[0] = b""
        self._clock[0] = max((watch.monitor.timing.newest for watch in self._watches), default=-math.inf)
        self._clock[1] = min((watch.monitor.deadline for watch in self._watches), default=math.inf)

    def _again(self, known: list[list[Violation] | tuple[Violation, ...]], line: int) -> list[Violation]:
        """What was told before of an event like the latest, and what was found in answers that waited for it."""
        self._count()
        found: list[Violation] = []
        raw = self._last[0].decode()
        time = time_text(Decimal(raw) if "." in raw else int(raw))
        monitors = {watch.monitor.setup.node.name: watch.monitor for watch in self._watches}
        for some in known:
            if isinstance(some, list):
                found += some
                continue
            for violation in some:
                monitor = monitors[violation.node]
                monitor.tallies[violation.clause].broken += 1
                monitor.tallies[violation.clause].excused += violation.fault is Fault.EXCUSED
                heard = {name: (line, by) for name, (_, by) in violation.heard.items()}
                found.append(replace(violation, index=monitor.events, time=time, heard=heard))
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
                for watched in plan.asked:
                    watched.tally.published += count
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
        last = sorted((t.line, t, t.last) for t in self._topics.values() if t.last is not None)
        waiting = [topic for _, topic, _ in last]
        if not waiting:
            return
        events = [(event_of(match.group(0)[:-1].decode(), "", 0), line) for line, _, match in last]
        for watch in self._watches:
            for topic, (event, line) in zip(waiting, events, strict=True):
                if event is not None and watch.plans.get(same_topic(topic.name)) is not None:
                    watch.monitor.caught_up(event, line)
            watch.monitor.settle_previous()
            for name, at in watch.slots.items():
                watch.values[at] = watch.monitor.values.get(name)
        for topic in waiting:
            topic.last = None

    def _look(self, watch: Watch, read: set[str], which: int, groups: tuple[bytes, ...] | None) -> None:
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
        watch.sources[:] = watch.values

    def _token(self, watch: Watch, name: str, which: int, groups: tuple[bytes, ...]) -> Token | None:
        at = watch.slots[name]
        texts = texts_of(self._shapes[which], watch.monitor.setup.rules[name])
        found = tuple(groups[k - 1] for k in texts)
        if is_seen(watch.monitor.setup.rules[name]):
            same = watch.monitor.values[name] is watch.values[at]
            self._tokens(which, watch, name)[found if len(found) > 1 else found[0]] = 0
            return watch.tokens[at] if same else next(self._fresh)
        if name in watch.regional and len(texts) == 1 and texts[0] in self._shapes[which].numbers:
            place = bisect(watch.regional[name], float(found[0]))
            if place % 2 == 0:
                return place
        known = self._tokens(which, watch, name)
        if not found:
            return next(self._fresh)
        key = found if len(found) > 1 else found[0]
        if key not in known:
            if len(known) >= REMEMBERED:
                known.clear()
            known[key] = next(self._fresh)
        return known[key]

    def _tokens(self, which: int, watch: Watch, name: str) -> dict[Any, Token]:
        return self._known.setdefault((which, self._watches.index(watch), name), {})

    # -- plans and shapes --------------------------------------------------------------------------------------------

    def _plan(self, watch: Watch, topic: str) -> Plan | None:
        key = same_topic(topic)
        if key not in watch.plans:
            watch.plans[key] = plan_of(watch, key)
        return watch.plans[key]

    def _shaped(self, text: bytes, topic: str) -> tuple[int, tuple[bytes, ...] | None]:
        for which, each in enumerate(self._shapes):
            if each.topic == topic and (match := re.fullmatch(each.pattern, text)):
                return which, match.groups()
        if len(self._shapes) >= SHAPES_KEPT or any(self._refused(watch, topic) for watch in self._watches):
            return -1, None
        wanted = [lead for watch in self._watches for lead in self._leads(watch, topic)]
        new = shape(text, topic, lambda path: path == SEQUENCE or any(lead(path) for lead in wanted))
        if new is None:
            return -1, None
        self._shapes.append(new)
        self._scan, self._handlers = self._compile()
        match = re.fullmatch(new.pattern, text)
        return (len(self._shapes) - 1, match.groups()) if match else (-1, None)

    def _refused(self, watch: Watch, topic: str) -> bool:
        """Whether the engine has to see every event of the topic."""
        return watch.monitor.listens(topic) and self._plan(watch, topic) is None

    def _leads(self, watch: Watch, topic: str) -> Iterator[Callable[[FieldPath], bool]]:
        plan = self._plan(watch, topic)
        for name in plan.names if plan else ():
            yield leads(watch.monitor.setup.rules[name])
        if plan is not None and watch.monitor.pairing is not None:
            answers = watch.monitor.pairing.answers
            yield below(path for path in (answers.input, answers.output) if path)

    def _compile(self) -> tuple[re.Pattern[bytes], dict[int | None, Handler]]:
        scan, offsets = scanner(self._shapes)
        handlers: dict[int | None, Handler] = {scan.groups: _never}
        for which, (each, offset) in enumerate(zip(self._shapes, offsets, strict=True)):
            handlers[offset + len(each.paths)] = self._handler(which, each, offset)
        return scan, handlers

    def _handler(self, which: int, made: Shape, offset: int) -> Handler:
        """The code for one shape of line."""
        topic = self._topics.setdefault(made.topic, _Topic(made.topic))
        scope: dict[str, Any] = {"bisect": bisect, "clock": self._clock, "topic": topic, "last": self._last}
        scope["blank"] = self._blank
        timed = Timed()
        checks, acts = timed.checks, timed.acts
        loud: list[str] = []
        used: set[int] = set()
        for number, watch in enumerate(self._watches):
            plan = self._plan(watch, made.topic)
            if plan is None:
                continue
            scope[f"tok{number}"] = watch.tokens
            paired = Paired(watch, plan, made, str(number), scope)
            if not paired.possible:
                return _never
            acts += paired.settles
            loud += paired.found
            fresh: dict[int, str] = {}
            for name in plan.names:
                at = watch.slots[name]
                rule = watch.monitor.setup.rules[name]
                texts = texts_of(made, rule)
                if not texts:
                    return _never
                used.update(texts)
                variable = f"x{number}_{at}"
                key = f"a{texts[0]}" if len(texts) == 1 else "(" + ", ".join(f"a{k}" for k in texts) + ")"
                if name in watch.regional and len(texts) == 1 and texts[0] in made.numbers:
                    scope[f"b{number}_{at}"] = watch.regional[name]
                    scope[f"k{number}_{at}"] = self._tokens(which, watch, name)
                    checks += [
                        f"{variable} = bisect(b{number}_{at}, float({key}))",
                        f"if {variable} & 1:",  # at a number of the contract, or beside it: only the same text is alike
                        f"    {variable} = k{number}_{at}.get({key})",
                        f"    if {variable} is None: return False",
                    ]
                    fresh[at] = variable
                    continue
                scope[f"k{number}_{at}"] = self._tokens(which, watch, name)
                if is_seen(rule):
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
            paired.add(checks, acts, fresh)
            used |= paired.used
            inputs = tuple(dict.fromkeys(name for watched in plan.due for name in watched.inputs))
            timed.add(watch.monitor.timing, plan.names, (inputs, plan.ages), made, str(number), scope)
            for name, rule in watch.monitor.setup.rules.items():
                if isinstance(rule, Previous) and rule.source in plan.names:
                    acts.append(f"tok{number}[{watch.slots[name]}] = tok{number}[{watch.slots[rule.source]}]")
                    acts += paired.copied(watch.slots[name], watch.slots[rule.source])
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
            "topic.line = line",
            *([f"if {' or '.join(loud)}: return [v for v in ({', '.join(loud)},) if v]"] if loud else []),
            "return True",
        ]
        exec("def handle(match, line):\n" + "".join(f"    {each}\n" for each in code), scope)
        handle: Handler = scope["handle"]
        return handle


def _never(match: Match, line: int) -> bool:
    """The engine judges."""
    return False


def _line_of(event: Event, size: int) -> str | None:
    """A message as the line that a trace would have of it; None of a large one."""
    try:
        return f"{json.dumps(event)}\n" if size < TEXT_BYTES else None
    except (TypeError, ValueError):  # it holds what JSON cannot
        return None


def _chunks(more: Callable[[int], bytes], name: str) -> Iterator[bytes]:
    """Whole lines, at most about a megabyte at a time, as they come; the last one ended."""
    rest: list[bytes] = []
    length = 0
    while True:
        read = more(CHUNK)
        if not read:
            if rest:
                yield b"".join((*rest, b"\n"))
            return
        end = read.rfind(b"\n")
        if end < 0:
            rest.append(read)
            length += len(read)
            if length > 4 * EVENT_CHARACTERS:
                raise Rejected(Diagnostic("MON204", f"{name}: a line is longer than {EVENT_CHARACTERS} characters"))
            continue
        yield b"".join((*rest, read[: end + 1]))
        rest = [read[end + 1 :]] if end + 1 < len(read) else []
        length = len(read) - end - 1
