"""A monitor that tells each judgement as it is made, with its margin: for those who plot."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Any

from avow.evaluation.evaluate import NotEvaluable, compile_term
from avow.formulas.values import Value
from avow.language.sorts import IntegerSort, NaturalSort, RealSort
from avow.language.terms import And, Compare, Term

from .coverage import Tally
from .engine import Monitor
from .pairing import Asked, Choices, time_of
from .tuning import TICKS
from .watched import Answer, Fault, Part, Violation, Watched


@dataclass(frozen=True, slots=True)
class Judgement:
    """Of one clause at one event: `held`, `broken`, `excused` (broken, with an assumption broken), `undecided`, or
    `unpaired` (undecided which input was answered). `margin`: see `_margin_of`."""

    node: str
    clause: str
    event: int
    time: Fraction
    verdict: str
    margin: float | None
    now: Fraction
    """When it was judged: later than `time` where the answer had to wait."""


Margin = Callable[[Mapping[str, Value]], float | None]


class Telling(Monitor):
    """The engine itself; `tell` gets each judgement."""

    tell: Callable[[Judgement], None] = staticmethod(lambda judgement: None)

    def __post_init__(self) -> None:
        self._margins: dict[str, Margin | None] = {}
        self._cases: list[float | None] = []
        self._now = Fraction(0)
        Monitor.__post_init__(self)

    @property
    def by_values(self) -> bool:
        """No event is passed over: each judgement is told."""
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
        self._tell(watched, before, self.events, time, self._margin(watched, values))

    def judge_part(
        self, watched: Watched, parts: Mapping[str, Part], event: Mapping[str, Any], found: list[Violation]
    ) -> None:
        before = replace(watched.tally)
        Monitor.judge_part(self, watched, parts, event, found)
        self._tell(watched, before, self.events, self._now, None)

    def verdict(self, watched: Watched, values: Mapping[str, Value]) -> Fault | str | None:
        margin = self._margin(watched, values)
        self._cases.append(margin)
        return Monitor.verdict(self, watched, values)

    def judge_answer(self, asked: Asked, choices: Choices, found: list[Violation]) -> None:
        watched = asked.watched
        before, self._cases = replace(watched.tally), []
        Monitor.judge_answer(self, asked, choices, found)
        known = [margin for margin in self._cases if margin is not None]
        margin = min(known) if known and len(known) == len(self._cases) else None
        self._tell(watched, before, asked.index, Fraction(asked.time) / TICKS, margin)

    def _margin(self, watched: Watched, values: Mapping[str, Value]) -> float | None:
        name = watched.clause.name
        if name not in self._margins:
            self._margins[name] = _margin_of(watched.clause.formula)
        margin = self._margins[name]
        return None if margin is None or any(n not in values for n in watched.names) else margin(values)

    def _tell(self, watched: Watched, before: Tally, event: int, time: Fraction, margin: float | None) -> None:
        verdict = _verdict_between(before, watched.tally)
        if verdict:
            self.tell(Judgement(self.setup.node.name, watched.clause.name, event, time, verdict, margin, self._now))


def _verdict_between(before: Tally, after: Tally) -> str:
    """What was judged, by what was counted; empty where nothing was."""
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
    """How far a comparison of numbers is from being broken, negative where it is: of ``a <= b`` and ``a < b``, b - a;
    of ``a == b``, minus their distance; of ``a != b``, their distance; of a conjunction, the least. None of any other
    formula. At 0 the operator decides."""
    match formula:
        case And(items=items):
            parts = [_margin_of(item) for item in items]
            known = [part for part in parts if part is not None]
            if len(known) < len(parts):
                return None
            return lambda values: _least([part(values) for part in known])
        case Compare(operator=operator, left=left, right=right) if isinstance(
            left.sort, RealSort | IntegerSort | NaturalSort
        ):
            try:
                one, other = compile_term(left), compile_term(right)
            except NotEvaluable:
                return None
            return lambda values: _distance(operator, one, other, values)
        case _:  # nothing with a threshold
            return None


def _least(found: list[float | None]) -> float | None:
    known = [one for one in found if one is not None]
    return min(known) if known and len(known) == len(found) else None


def _distance(
    operator: str, one: Callable[[Mapping[str, Value]], Value], other: Callable[[Mapping[str, Value]], Value],
    values: Mapping[str, Value],
) -> float | None:  # fmt: skip
    try:
        difference = Fraction(other(values)) - Fraction(one(values))  # type: ignore[arg-type]
    except NotEvaluable:
        return None
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
    """The nearest one, or the largest."""
    try:
        return float(number)
    except OverflowError:
        return 1e308 if number > 0 else -1e308
