"""Recorded and live events: JSON lines in ROSMonitoring's shape, ROS 1 and ROS 2 bags, standard input."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from avow.base.codec import once
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.ros import bags
from avow.ros.bags import NOWHERE, Carried, Event, Origin, is_bag

from .numbers import Decimal, NotANumber, exact
from .tuning import EVENT_CHARACTERS, LATEST_TIME


@dataclass(frozen=True, slots=True)
class Recorded:
    """One event of a trace. `index` counts events from 1, `line` lines of the file (0 in a bag)."""

    index: int
    line: int
    event: Event


_DECODER = json.JSONDecoder(parse_float=Decimal, object_pairs_hook=once)


def parse_event(text: str) -> Event:
    """One JSON object. Raises ValueError saying what is wrong and, if it is the JSON, with the column."""
    try:
        found = _DECODER.decode(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(found, dict):
        raise ValueError("an event is a JSON object")
    return found


def _wrong_time(event: Event) -> str:
    """What is wrong with the time of a recorded event, if anything is: ROSMonitoring writes one with every event, as
    seconds, and a record without it was cut or put together by hand."""
    raw = event.get("time")
    if raw is None:
        return "the event has no `time`: seconds, as a number"
    text = raw.text if isinstance(raw, Decimal) else "-"
    if text[0] != "-" and len(text) < 40 and text.find(".") <= 12 and "e" not in text.lower():
        return ""  # as nearly all are; kept out of the cache of values that are seen again
    try:
        time = exact(raw)
        if time > LATEST_TIME:
            return f"`time` is in seconds, and after {LATEST_TIME:.0e} of them: {json.dumps(raw, default=str)[:60]}"
        return "" if time >= 0 else f"`time` is negative: {raw}"
    except NotANumber:
        return f"`time` is no number of seconds: {json.dumps(raw, default=str)[:60]}"


def event_of(line: str, name: str, number: int) -> Event | None:
    """The event of one line of a trace; None of a blank one. Raises Rejected."""
    if not line or line.isspace():
        return None
    if len(line) > EVENT_CHARACTERS:
        raise Rejected(_fault(name, number, 1, f"the line is longer than {EVENT_CHARACTERS} characters"))
    try:
        event = parse_event(line)
    except json.JSONDecodeError as error:
        raise Rejected(_fault(name, number, error.colno, f"this is not JSON: {error.msg}")) from None
    except ValueError as error:
        raise Rejected(_fault(name, number, 1, str(error))) from None
    if not isinstance(topic := event.get("topic"), str) or not topic:
        raise Rejected(_fault(name, number, max(1, line.find('"topic"') + 1), "the event has no `topic`: a name"))
    if wrong := _wrong_time(event):
        raise Rejected(_fault(name, number, max(1, line.find('"time"') + 1), wrong))
    return event


def not_text(name: str) -> Rejected:
    """What is told of a file that is not UTF-8."""
    return Rejected(_fault(name, 1, 1, "the file is not UTF-8 text"))


def read_lines(
    lines: Iterable[str], name: str, chosen: Callable[[int], bool] = lambda index: True
) -> Iterator[Recorded]:
    """Events from lines of text, those whose numbers are chosen; blank lines are skipped. Raises Rejected at the first
    line that is no event."""
    index = 0
    for number, line in enumerate(lines, start=1):
        index += bool(line) and not line.isspace()
        if chosen(index) and (event := event_of(line, name, number)) is not None:
            yield Recorded(index, number, event)


def read_trace(
    path: Path,
    origin: Origin = NOWHERE,
    wanted: Callable[[str], bool] = lambda topic: True,
    chosen: Callable[[int], bool] = lambda index: True,
) -> Iterator[Recorded]:
    """The events of a file (JSON lines, ROS 1 bag) or folder (ROS 2 bag), those whose numbers are chosen. `wanted`: the
    topics whose messages of a bag are of interest, and are counted. Raises Rejected."""
    if is_bag(path):
        for index, (event, _) in enumerate(messages(path, origin, wanted), start=1):
            if chosen(index):
                yield Recorded(index, 0, event)
        return
    try:
        with path.open(encoding="utf-8-sig", errors="strict", newline="\n") as file:
            yield from read_lines(file, str(path), chosen)
    except UnicodeDecodeError:
        raise not_text(str(path)) from None
    except OSError as error:
        raise Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}")) from None


def carried(path: Path, origin: Origin = NOWHERE) -> Carried:
    """As `avow.ros.bags.carried`. Raises Rejected."""
    with _told():
        return bags.carried(path, origin)


def messages(
    path: Path, origin: Origin = NOWHERE, wanted: Callable[[str], bool] = lambda topic: True
) -> Iterator[tuple[Event, int]]:
    """As `avow.ros.bags.messages`. Raises Rejected."""
    with _told():
        yield from bags.messages(path, origin, wanted)


@contextmanager
def _told() -> Iterator[None]:
    try:
        yield
    except bags.NoBag as wrong:
        raise Rejected(Diagnostic("MON202" if wrong.missing else "MON203", str(wrong), hint=wrong.hint)) from None


def digest_trace(path: Path) -> str:
    """SHA-256 of a trace: of the file, or of the names and contents of a bag folder's files. Raises OSError."""
    whole = hashlib.sha256()
    files = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
    for file in files:
        if path.is_dir():
            whole.update(file.relative_to(path).as_posix().encode() + b"\0")
        with file.open("rb") as stream:
            if len(files) == 1 and not path.is_dir():
                return hashlib.file_digest(stream, "sha256").hexdigest()
            whole.update(hashlib.file_digest(stream, "sha256").digest())
    return whole.hexdigest()


def _fault(name: str, line: int, column: int, message: str) -> Diagnostic:
    return Diagnostic("MON204", message, Span(name, line, column, line, column + 1))
