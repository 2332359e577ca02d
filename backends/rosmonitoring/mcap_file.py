"""Verdicts and margins as an MCAP, for Foxglove, PlotJuggler and whatever else reads JSON channels."""

from __future__ import annotations

import json
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Self

from avow.base.diagnostics import Diagnostic, Rejected

from .judged import Judgement

if TYPE_CHECKING:
    from .watched import Violation

_VALUES = {"held": 1, "excused": 0, "undecided": 0, "unpaired": 0, "broken": -1}
"""Plots show numbers: above 0 all is well, below it is not."""

_LAST = 2**64 - 1

_SCHEMAS = {
    "verdict": {"verdict": "string", "value": "integer", "event": "integer"},
    "margin": {"margin": "number", "event": "integer"},
    "finding": {"fault": "string", "about": "string", "text": "string", "event": "integer"},
}


class Recorder:
    """An MCAP that is being written: `/avow/NODE/CLAUSE/verdict`, `/avow/NODE/CLAUSE/margin`, `/avow/NODE/findings`."""

    def __init__(self, path: Path) -> None:
        """Raises Rejected where it cannot be written, or without the package mcap."""
        try:
            from mcap.writer import Writer
        except ImportError:
            hint = "pip install 'avow[monitor]'"
            raise Rejected(Diagnostic("MON301", "an MCAP needs the package mcap", hint=hint)) from None
        try:
            self._file: IO[bytes] = path.open("wb")
        except OSError as error:
            raise Rejected(Diagnostic("MON304", f"{path} cannot be written: {error.strerror}")) from None
        self._writer: Any = Writer(self._file)
        self._writer.start(library="avow")
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._counts: dict[str, int] = {}
        self._latest = 0
        self._logged = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._writer.finish()
        self._file.close()

    def judged(self, judgement: Judgement) -> None:
        topic = f"/avow/{judgement.node}/{judgement.clause}"
        self._latest = _nanoseconds(judgement.time)
        self._logged = max(self._logged, _nanoseconds(judgement.now))
        said = {"verdict": judgement.verdict, "value": _VALUES[judgement.verdict], "event": judgement.event}
        self._write(f"{topic}/verdict", "verdict", said)
        if judgement.margin is not None:
            self._write(f"{topic}/margin", "margin", {"margin": judgement.margin, "event": judgement.event})

    def found(self, violation: Violation) -> None:
        """Whatever was told, in words: also what is no clause's (a silence, a message that could not be read)."""
        with suppress(ValueError, ZeroDivisionError):  # of an event without a time: that of the latest
            self._latest = _nanoseconds(Fraction(violation.time))
        about = {"fault": violation.fault.name.lower(), "about": violation.clause, "text": violation.text()}
        self._write(f"/avow/{violation.node}/findings", "finding", {**about, "event": violation.index})

    def _write(self, topic: str, schema: str, message: dict[str, Any]) -> None:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schema(schema))
        number = self._counts[topic] = self._counts.get(topic, 0) + 1
        data = json.dumps(message).encode()
        self._logged = max(self._logged, self._latest)  # what is said later is logged later, of whatever event it is
        self._writer.add_message(self._channels[topic], self._logged, data, self._latest, number % 2**32)

    def _schema(self, name: str) -> int:
        if name not in self._schemas:
            fields = {of: {"type": kind} for of, kind in _SCHEMAS[name].items()}
            whole = {"title": f"avow.{name}", "type": "object", "properties": fields, "required": list(fields)}
            text = json.dumps({"$schema": "https://json-schema.org/draft/2020-12/schema", **whole})
            self._schemas[name] = self._writer.register_schema(f"avow.{name}", "jsonschema", text.encode())
        return self._schemas[name]


def _nanoseconds(time: Fraction) -> int:
    return min(max(int(time * 1_000_000_000), 0), _LAST)
