"""Recorded and live events: JSON lines in ROSMonitoring's shape, ROS 1 and ROS 2 bags, standard input."""

from __future__ import annotations

import functools
import gc
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from avow.base.codec import once
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.suggestions import nearby, nearest
from avow.ros import bags
from avow.ros.bags import NOWHERE, Carried, Event, Origin, enveloped, is_bag
from avow.ros.calls import CALL
from avow.ros.frames import TREE, Tree

from .tuning import CHUNK, EVENT_CHARACTERS, LATEST_TIME
from .wires import NotANumber, exact


@dataclass(frozen=True, slots=True)
class Recorded:
    """One event of a trace. `index` counts events from 1, `line` lines of the file (0 in a bag)."""

    index: int
    line: int
    event: Event


_DECODER = json.JSONDecoder(parse_float=str.encode, object_pairs_hook=once)


def parse_event(text: str) -> Event:
    """One JSON object. Raises ValueError with the reason and, if the JSON is wrong, the column."""
    try:
        found = _DECODER.decode(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(found, dict):
        raise ValueError("an event is a JSON object")
    return found


@dataclass(slots=True)
class _Open:
    """The calls of one service. `call`: that of the only request since none was open; None if that is not known."""

    number: int = 0
    call: str | None = None


@dataclass(slots=True)
class Services:
    """The events of ROSMonitoring's service monitors as parts of calls. Such an event does not identify its call. A
    response belongs to a request if no other call of the service was open since that request. Otherwise it gets a call
    of its own, without a request."""

    calls: dict[str, _Open] = field(default_factory=dict)
    events: int = 0

    def part(self, event: Event) -> Event:
        """A service's event as the part of a call, with the next number; another event as it is. Raises ValueError."""
        service = event.get("service")
        if "topic" in event or not isinstance(service, str):
            return event
        kind, *more = [name for name in ("request", "response") if name in event] or ("", "")
        if more:
            raise ValueError("the event of a service has either a `request` or a `response`")
        fields = event[kind] if isinstance(event[kind], dict) else {}  # in ROS 1 a message without fields is a text
        self.events += 1
        own, known = f"{service} {self.events}", self.calls.setdefault(service.lstrip("/"), _Open())
        if kind == "request":
            known.call = own if known.number == 0 and not _sorted_by_stamp(fields) else None
            known.number += 1
        else:
            if known.number == 1 and known.call is not None and not _sorted_by_stamp(fields):
                own = known.call
            known.number = max(0, known.number - 1)
        return {**enveloped(fields, f"{service}/_{kind}", 0), "time": event.get("time"), CALL: own}


def _sorted_by_stamp(fields: Event) -> bool:
    """Whether ROSMonitoring may have moved a message to the place of its stamp (`ordering`)."""
    return not {"header", "stamp"}.isdisjoint(fields)


def _wrong_time(event: Event) -> str:
    """The error in the time of a recorded event; empty if it is right. ROSMonitoring writes a time with every event, in
    seconds, and a record without it was cut or assembled by hand."""
    raw = event.get("time")
    if raw is None:
        return "the event has no `time`: seconds, as a number"
    try:
        time = exact(raw)
        if time > LATEST_TIME:
            return f"`time` is in seconds, and after {LATEST_TIME:.0e} of them: {_json(raw)}"
        return "" if time >= 0 else f"`time` is negative: {_json(raw)}"
    except NotANumber:
        return f"`time` is no number of seconds: {_json(raw)}"


_FORM = 'each line is one event, {"topic": "/x", "time": 0.1, …}, without [ ]; a bag is a folder, .mcap, .db3 or .bag'


def _json(raw: object) -> str:
    return raw.decode()[:60] if isinstance(raw, bytes) else json.dumps(raw, default=str)[:60]


def event_of(line: str, name: str, number: int, services: Services) -> Event | None:
    """The event of one line of a trace; None for a blank one. `services` receives the events of all lines in turn.
    Raises Rejected."""
    if not line or line.isspace():
        return None
    if len(line) > EVENT_CHARACTERS:
        raise Rejected(_fault(name, number, 1, f"the line is longer than {EVENT_CHARACTERS} characters"))
    try:
        event = services.part(parse_event(line))
    except json.JSONDecodeError as error:
        cut = error.msg.startswith("Unterminated") or not line[error.pos :].strip()
        why = "this is not JSON" + (": the line is cut off" if cut else "")
        raise Rejected(_fault(name, number, error.colno, why, _FORM)) from None
    except ValueError as error:
        raise Rejected(_fault(name, number, 1, str(error), _FORM)) from None
    topic = event.get("topic")
    nameless = "" if isinstance(topic, str) and topic else "the event has no `topic`: a name"
    for key, wrong in (("topic", nameless), ("time", _wrong_time(event))):
        if wrong:
            meant = next(iter([] if key in event else nearest(key, event)), key)
            hint = f"`{meant}`: did you mean `{key}`?" if meant != key else None
            raise Rejected(_fault(name, number, line.find(json.dumps(meant)) + 1 or 1, wrong, hint))
    return event


def _not_text(name: str) -> Rejected:
    """The error for a file that is not UTF-8."""
    return Rejected(_fault(name, 1, 1, "the file is not UTF-8 text"))


def read_lines(
    lines: Iterable[str], name: str, chosen: Callable[[int], bool] = lambda index: True
) -> Iterator[Recorded]:
    """The events of lines of text whose numbers are chosen; blank lines are skipped. Raises Rejected at the first line
    that is no event."""
    index, services = 0, Services()
    for number, line in enumerate(lines, start=1):
        index += bool(line) and not line.isspace()
        if chosen(index) and (event := event_of(line, name, number, services)) is not None:
            yield Recorded(index, number, event)


def read_trace(
    path: Path,
    origin: Origin = NOWHERE,
    wanted: Callable[[str], bool] = lambda topic: True,
    chosen: Callable[[int], bool] = lambda index: True,
) -> Iterator[Recorded]:
    """The events of a file (JSON lines, ROS 1 bag) or folder (ROS 2 bag) whose numbers are chosen. `wanted`: the topics
    of a bag whose messages are read and counted. Raises Rejected."""
    if is_bag(path):
        with opened():
            for index, (channel, time, raw) in enumerate(bags.recorded(path, origin, wanted), start=1):
                if chosen(index):
                    yield Recorded(index, 0, channel.event(time, raw))
        return
    try:
        with path.open(encoding="utf-8-sig", errors="strict", newline="\n") as file:
            yield from read_lines(file, str(path), chosen)
    except UnicodeDecodeError:
        raise _not_text(str(path)) from None
    except OSError as error:
        raise unread(path, error) from None


def transforms(path: Path, origin: Origin) -> Tree:
    """All transforms that a trace holds. Raises Rejected."""
    tree = Tree()
    for recorded in read_trace(path, origin, lambda topic: topic.removeprefix("/") in TREE):
        topic = str(recorded.event.get("topic")).removeprefix("/")
        if topic in TREE:
            tree.hear(topic, recorded.event)
    return tree


def unread(path: Path, error: OSError) -> Rejected:
    """The error for a trace that cannot be read."""
    return Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}", hint=nearby(path)))


def parsed(
    chunk: bytes, name: str, before: int, services: Services
) -> tuple[list[Event], Sequence[int], int, Rejected | None]:
    """The events of some whole lines, their line numbers, the number of lines, and the error at the line after these
    events. `before`: the number of earlier lines."""
    try:
        lines = chunk.decode("utf-8" if before else "utf-8-sig").split("\n")[:-1]
    except UnicodeDecodeError:
        return [], [], 0, _not_text(name)
    numbers: Sequence[int] = range(before + 1, before + len(lines) + 1)
    written = lines
    if not all(lines):
        numbers = [k for k, line in enumerate(lines, start=before + 1) if line and not line.isspace()]
        written = [lines[number - before - 1] for number in numbers]
    collects = gc.isenabled()
    gc.disable()  # thousands of new objects without a cycle: searching for one takes a third of the time
    try:
        events: list[Event] = _DECODER.decode(f"[{','.join(written)}]")  # far faster than line by line
        if len(events) == len(written) and _plain(events):
            return events, numbers, len(lines), None
    except (ValueError, RecursionError):
        pass
    finally:
        if collects:
            gc.enable()
    events = []
    at: list[int] = []
    for line, number in zip(written, numbers, strict=True):
        try:
            event = event_of(line, name, number, services)
        except Rejected as wrong:
            return events, at, len(lines), wrong
        if event is not None:
            events.append(event)
            at.append(number)
    return events, at, len(lines), None


def _plain(events: Sequence[Event]) -> bool:
    """Whether all events certainly have a topic and a time."""
    try:
        topics, times = [event["topic"] for event in events], [event["time"] for event in events]
    except (TypeError, KeyError, IndexError):
        return False
    if not set(map(type, topics)) <= {str} or not set(map(type, times)) <= {bytes, int}:
        return False
    return all(topics) and all(0 <= time < LATEST_TIME for time in map(float, times))


def chunks(more: Callable[[int], bytes], name: str) -> Iterator[bytes]:
    """Whole lines, at most about a megabyte at a time, as they come; the last one is ended. Raises Rejected."""
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


def carried(path: Path, origin: Origin = NOWHERE) -> Carried:
    """As `avow.ros.bags.carried`. Raises Rejected."""
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    with opened():
        return _carried(path, origin, tuple((file.name, file.stat().st_mtime_ns) for file in files if file.is_file()))


@functools.lru_cache(maxsize=8)
def _carried(path: Path, origin: Origin, _stamps: tuple[tuple[str, int], ...]) -> Carried:
    """Several nodes name one bag: it is opened once, until its files change."""
    return bags.carried(path, origin)


@contextmanager
def opened() -> Iterator[None]:
    """Raises Rejected if a file is no bag."""
    try:
        yield
    except bags.NoBag as wrong:
        raise Rejected(Diagnostic("MON203", str(wrong), hint=wrong.hint)) from None


def _fault(name: str, line: int, column: int, message: str, hint: str | None = None) -> Diagnostic:
    return Diagnostic("MON204", message, Span(name, line, column, line, column + 1), hint=hint)
