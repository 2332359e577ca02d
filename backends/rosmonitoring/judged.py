"""A monitor that reports each judgement as it is made, with its margin, for plots. As an MCAP, the judgements can be
read by Foxglove, PlotJuggler, and other readers of JSON channels."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import IO, Any, Self

from avow.base.diagnostics import Diagnostic, Rejected
from avow.evaluation.evaluate import NotEvaluable, compile_number, compile_term
from avow.formulas.values import Value
from avow.language.sorts import IntegerSort, NaturalSort, RealSort
from avow.language.terms import And, Compare, Iff, Implies, Not, Or, Term

from .engine import Monitor
from .pairing import Asked, Choices, time_of
from .tuning import TICKS
from .watched import Answer, Fault, Part, Tally, Violation, Watched


@dataclass(frozen=True, slots=True)
class Judgement:
    """The judgement of one clause at one event: `held`, `broken`, `excused` (broken, with an assumption broken),
    `undecided`, or `unpaired` (undecided which input was answered). `margin`: see `_margin_of`."""

    node: str
    clause: str
    event: int
    time: Fraction
    verdict: str
    margin: float | None
    now: Fraction
    """When it was judged, in seconds: later than `time` if the answer had to wait."""


Margin = Callable[[Mapping[str, Value]], float | None]


class ReportingMonitor(Monitor):
    """The engine itself; `report` receives each judgement."""

    report: Callable[[Judgement], None] = staticmethod(lambda judgement: None)

    def __post_init__(self) -> None:
        self._margins: dict[str, Margin | None] = {}
        self._cases: list[float | None] = []
        self._now = Fraction(0)
        Monitor.__post_init__(self)

    @property
    def by_values(self) -> bool:
        """No event is skipped: each judgement is reported."""
        return False

    def step(self, event: Mapping[str, Any], place: int = 0) -> list[Violation]:
        self._now = time_of(event)
        return Monitor.step(self, event, place)

    def _judge(
        self, watched: Watched, event: Mapping[str, Any], found: list[Violation], answer: Answer | None = None
    ) -> None:
        values = {**self.known(watched, answer)}
        before = replace(watched.tally)
        Monitor._judge(self, watched, event, found, answer)
        time = self._now if self.word is None else time_of(event)
        self._report(watched, before, self.events, time, self._margin(watched, values))

    def judge_part(
        self, watched: Watched, parts: Mapping[str, Part], event: Mapping[str, Any], found: list[Violation]
    ) -> None:
        before = replace(watched.tally)
        Monitor.judge_part(self, watched, parts, event, found)
        self._report(watched, before, self.events, self._now, None)

    def verdict(self, watched: Watched, values: Mapping[str, Value]) -> Fault | str | None:
        self._cases.append(self._margin(watched, values))
        return Monitor.verdict(self, watched, values)

    def judge_answer(self, asked: Asked, choices: Choices, found: list[Violation]) -> None:
        watched = asked.watched
        before, self._cases = replace(watched.tally), []
        Monitor.judge_answer(self, asked, choices, found)
        known = [margin for margin in self._cases if margin is not None]
        margin = min(known) if known and len(known) == len(self._cases) else None
        self._report(watched, before, asked.index, Fraction(asked.time) / TICKS, margin)

    def _margin(self, watched: Watched, values: Mapping[str, Value]) -> float | None:
        name = watched.clause.name
        if name not in self._margins:
            self._margins[name] = _margin_of(watched.clause.formula)
        margin = self._margins[name]
        return None if margin is None or any(n not in values for n in watched.names) else margin(values)

    def _report(self, watched: Watched, before: Tally, event: int, time: Fraction, margin: float | None) -> None:
        verdict = _verdict_between(before, watched.tally)
        if verdict:
            self.report(Judgement(self.setup.node.name, watched.clause.name, event, time, verdict, margin, self._now))


def _verdict_between(before: Tally, after: Tally) -> str:
    """The verdict that the change of the counts shows; empty if nothing was judged."""
    if after.excused > before.excused:
        return "excused"
    if after.broken > before.broken:
        return "broken"
    if after.undecided > before.undecided:
        return "undecided"
    if after.order > before.order:
        return "unpaired"
    return "held" if after.judged > before.judged else ""


def _margin_of(formula: Term) -> Margin | None:
    """The distance of a formula from being broken, negative if it is (max-min semantics: G. Fainekos and G. Pappas,
    2009): ``b - a`` for ``a <= b`` and for ``a < b``, minus the numbers' distance for ``a == b``, their distance for
    ``a != b``; the least for a conjunction, the greatest for a disjunction. A part without comparison of numbers is
    infinitely far. At 0 the operator decides. None if the whole is infinitely far, or cannot be evaluated."""
    try:
        margin = _compiled(formula)
    except NotEvaluable:
        return None

    def finite(values: Mapping[str, Value]) -> float | None:
        try:
            found = margin(values)
        except NotEvaluable:
            return None
        return found if math.isfinite(found) else None

    return finite


def _compiled(formula: Term) -> Callable[[Mapping[str, Value]], float]:
    """As `_margin_of`, with infinities. It and its result raise NotEvaluable."""
    match formula:
        case And(items=items) | Or(items=items):
            parts, choose = [_compiled(item) for item in items], min if isinstance(formula, And) else max
            return lambda values: choose(part(values) for part in parts)
        case Not(body=body):
            inner = _compiled(body)
            return lambda values: -inner(values)
        case Implies(left=left, right=right):
            return _compiled(Or((Not(left), right)))
        case Iff(left=left, right=right):
            return _compiled(And((Implies(left, right), Implies(right, left))))
        case Compare(operator=operator, left=left, right=right) if isinstance(
            left.sort, RealSort | IntegerSort | NaturalSort
        ):
            one, other = compile_number(left), compile_number(right)
            return lambda values: _distance(operator, one, other, values)
        case _:  # no threshold
            holds = compile_term(formula)
            return lambda values: math.inf if holds(values) else -math.inf


def _distance(
    operator: str, one: Callable[[Mapping[str, Value]], Value], other: Callable[[Mapping[str, Value]], Value],
    values: Mapping[str, Value],
) -> float:  # fmt: skip
    difference: Any = other(values) - one(values)  # type: ignore[operator]
    match operator:
        case "<=" | "<":
            margin = difference
        case ">=" | ">":
            margin = -difference
        case "==":
            margin = -abs(difference)
        case _:  # !=
            margin = abs(difference)
    return as_float(margin)


def as_float(number: Fraction | int) -> float:
    """The nearest double, or the largest."""
    try:
        return float(number)
    except OverflowError:
        return 1e308 if number > 0 else -1e308


_VALUES = {"held": 1, "excused": 0, "undecided": 0, "unpaired": 0, "broken": -1}
"""Plots show numbers: above 0 is held, below 0 is broken."""

_LAST = 2**64 - 1

_SCHEMAS = {
    "verdict": {"verdict": "string", "value": "integer", "event": "integer"},
    "margin": {"margin": "number", "event": "integer"},
    "finding": {"fault": "string", "about": "string", "text": "string", "event": "integer"},
}


class Recorder:
    """Writes an MCAP: `/avow/NODE/CLAUSE/verdict`, `/avow/NODE/CLAUSE/margin`, `/avow/NODE/findings`."""

    def __init__(self, path: Path) -> None:
        """Raises Rejected if it cannot be written, or without the package mcap."""
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
        """A violation in words, including one of no clause (a silence, an unreadable message)."""
        with suppress(ValueError, ZeroDivisionError):  # for an event without a time: that of the latest
            self._latest = _nanoseconds(Fraction(violation.time))
        about = {"fault": violation.fault.name.lower(), "about": violation.clause, "text": violation.text()}
        self._write(f"/avow/{violation.node}/findings", "finding", {**about, "event": violation.index})

    def _write(self, topic: str, schema: str, message: dict[str, Any]) -> None:
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "json", self._schema(schema))
        number = self._counts[topic] = self._counts.get(topic, 0) + 1
        data = json.dumps(message).encode()
        self._logged = max(self._logged, self._latest)  # log times do not go back, whatever event a message is about
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
