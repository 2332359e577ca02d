"""Recorded and live events: JSON lines in ROSMonitoring's shape, ROS 1 and ROS 2 bags, standard input."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from avow.base.diagnostics import Diagnostic, Rejected, Span

from .numbers import Decimal, NotANumber, exact
from .tuning import EVENT_CHARACTERS

Event = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Recorded:
    """One event of a trace. `index` counts events from 1, `line` lines of the file (0 in a bag)."""

    index: int
    line: int
    event: Event


_decoder = json.JSONDecoder(parse_float=Decimal)


def parse_event(text: str) -> Event:
    """One JSON object. Raises ValueError saying what is wrong and, if it is the JSON, with the column."""
    try:
        found = _decoder.decode(text)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    if not isinstance(found, dict):
        raise ValueError("an event is a JSON object")
    return found


def wrong_time(event: Event) -> str:
    """What is wrong with the time of a recorded event, if anything is: ROSMonitoring writes one with every event, as
    seconds, and a record without it was cut or put together by hand."""
    raw = event.get("time")
    if raw is None:
        return "the event has no `time`: seconds, as a number"
    if isinstance(raw, Decimal) and raw.text[0] != "-" and len(raw.text) < 40 and "e" not in raw.text.lower():
        return ""  # as nearly all are; kept out of the cache of values that are seen again
    try:
        return "" if exact(raw) >= 0 else f"`time` is negative: {raw}"
    except NotANumber:
        return f"`time` is no number of seconds: {json.dumps(raw, default=str)[:60]}"


def read_lines(lines: Iterable[str], name: str) -> Iterator[Recorded]:
    """Events from lines of text; blank lines are skipped. Raises Rejected at the first line that is no event."""
    index = 0
    for number, line in enumerate(lines, start=1):
        if line.isspace():
            continue
        if len(line) > EVENT_CHARACTERS:
            raise Rejected(_fault(name, number, 1, f"the line is longer than {EVENT_CHARACTERS} characters"))
        index += 1
        try:
            event = parse_event(line)
            if wrong := wrong_time(event):
                raise Rejected(_fault(name, number, max(1, line.find('"time"') + 1), wrong))
            yield Recorded(index, number, event)
        except json.JSONDecodeError as error:
            raise Rejected(_fault(name, number, error.colno, f"this is not JSON: {error.msg}")) from None
        except ValueError as error:
            raise Rejected(_fault(name, number, 1, str(error))) from None


def read_trace(path: Path) -> Iterator[Recorded]:
    """The events of a file (JSON lines, ROS 1 bag) or folder (ROS 2 bag). Raises Rejected."""
    if path.is_dir() or path.suffix in (".bag", ".db3", ".mcap"):
        yield from _bag(path)
        return
    try:
        with path.open(encoding="utf-8-sig", errors="strict", newline="\n") as file:
            yield from read_lines(file, str(path))
    except UnicodeDecodeError:
        raise Rejected(_fault(str(path), 1, 1, "the file is not UTF-8 text")) from None
    except OSError as error:
        raise Rejected(Diagnostic("MON201", f"cannot read {path}: {error.strerror or error}")) from None


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


def _bag(path: Path) -> Iterator[Recorded]:
    try:
        from rosbags.highlevel import AnyReader, AnyReaderError
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        hint = "pip install 'avow[bags]'"
        raise Rejected(Diagnostic("MON202", "reading bags needs the package rosbags", hint=hint)) from None
    try:
        with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
            messages = reader.messages()
            for index, (connection, time, raw) in enumerate(messages, start=1):
                message = reader.deserialize(raw, connection.msgtype)
                fields = _plain(message)
                event = {**fields, "topic": connection.topic, "time": time / 1e9}
                yield Recorded(index, 0, event)
    except AnyReaderError as error:
        raise Rejected(Diagnostic("MON203", f"{path} is no bag that can be read: {error}")) from None
    except (OSError, ValueError, KeyError, RuntimeError) as error:
        raise Rejected(Diagnostic("MON203", f"{path} cannot be read as a bag: {error}")) from None


def _plain(message: Any) -> Any:
    """A deserialised message as the JSON that ROSMonitoring would write of it."""
    fields = getattr(message, "__dataclass_fields__", None)
    if fields is not None:
        return {name: _plain(getattr(message, name)) for name in fields if not name.startswith("__")}
    if hasattr(message, "tolist"):
        # The shortest text of a float32 is what was meant by it; as a float64 it has digits that nobody wrote.
        return _floats(message) if getattr(message.dtype, "kind", "") == "f" else message.tolist()
    if isinstance(message, list | tuple):
        return [_plain(item) for item in message]
    return message


def _floats(array: Any) -> Any:
    if getattr(array, "ndim", 1) == 0:
        return Decimal(str(array))
    return [Decimal(str(item)) if item == item else float("nan") for item in array.ravel()]


def _fault(name: str, line: int, column: int, message: str) -> Diagnostic:
    return Diagnostic("MON204", message, Span(name, line, column, line, column + 1))
