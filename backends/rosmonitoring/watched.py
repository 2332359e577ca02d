"""A clause under watch, and what is told of an event that shows something wrong."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.base.tuning.effort import JUDGE_EFFORT
from avow.evaluation.evaluate import NotEvaluable
from avow.evaluation.truth import judge, judge_open
from avow.formulas.values import Value, show
from avow.language.contract import Clause
from avow.language.printer import show_term
from avow.language.terms import Implies, Quantified, Quantifier, Term, Variable

from .coverage import Tally
from .numbers import NotANumber, exact

if TYPE_CHECKING:
    from .memory import Memory


class Fault(StrEnum):
    """What an event showed to be wrong."""

    GUARANTEE = "guarantee broken: this node"
    EXCUSED = "guarantee not met, with an assumption broken: not this node"
    ASSUMPTION = "assumption broken: environment"
    PROVIDER = "assumption broken: by a node that provides it"
    SILENT = "silent for longer than the plan allows"
    RATE = "messages outside the rate that the plan allows"
    MAPPING = "message outside its mapping"


Heard = Mapping[str, tuple[int, str]]
"""Variable → the place in the trace of the latest message that carried it, and who published that, where it says so."""


@dataclass(frozen=True, slots=True)
class Part:
    """One output of an answer."""

    values: Mapping[str, Value] | None
    """It, and what was known when it came but for the other outputs; None: it could not be read."""
    heard: Heard
    time: Fraction


@dataclass(frozen=True, slots=True)
class Answer:
    """An answer whose parts came apart: its outputs' values, and their messages."""

    key: object
    values: Mapping[str, Value]
    heard: Heard


@dataclass(frozen=True, slots=True)
class Violation:
    """One judgement against the trace. `index` counts events from 1; `time` is the event's own, as text."""

    fault: Fault
    node: str
    clause: str
    index: int
    time: str
    values: tuple[tuple[str, str], ...]
    bindings: tuple[tuple[str, str], ...]
    explanation: str
    heard: Heard = field(default_factory=dict, compare=False)
    """Of a clause that was broken: which message each variable's value was of."""
    cause: str = ""
    """Of an assumption that was broken by what a node said: ``sensor.nonneg at event 7 caused guard.nonneg at event
    8``, or why no first breach is known."""

    def text(self) -> str:
        about = ", ".join(f"{n} = {v}" for n, v in (*self.bindings, *self.values))
        at = f"event {self.index}" + (f" (t = {self.time})" if self.time else "")
        said = f"{self.explanation}; {self.cause}" if self.cause else self.explanation
        return f"{at}: {self.fault}: {self.node}.{self.clause}: {said}" + (f" [{about}]" if about else "")


@dataclass(slots=True)
class Watched:
    clause: Clause
    names: tuple[str, ...]
    holds: Callable[[Mapping[str, Value]], Value]
    trigger: Callable[[Mapping[str, Value]], Value] | None
    witness: Callable[[Mapping[str, Value]], dict[str, Value] | None]
    tally: Tally
    outputs: frozenset[str] = frozenset()
    """Those that must all be published anew before it is judged: they are the parts of one answer."""
    fresh: dict[object, dict[str, Part]] = field(default_factory=dict)
    """The parts of answers that are not whole yet, by what the parts of one answer have in common (`answers`)."""
    counted: dict[str, int] = field(default_factory=dict)
    """By order: how many messages each output has had."""
    scattered: bool = False
    """A message of one of several outputs was lost: which parts are of one answer is not told any more."""
    held: tuple[tuple[str, str], ...] = ()
    """(previous value, its source): of one of several outputs, it is the value that the answer before had, whichever
    of the outputs comes first in this one."""
    memory: dict[str, Value] = field(default_factory=dict)
    """The held values."""
    key: tuple[int, ...] | None = None
    truth: bool | None = None
    inputs: tuple[str, ...] = ()
    """The observed inputs that its answers are held against."""
    paired: tuple[str, ...] = ()
    """The observed inputs that an answer has to be paired with."""
    alike: dict[tuple[int, ...], bool] = field(default_factory=dict)
    """Where it held, by tokens of values (codes of `columns`), and whether its antecedent was met there."""
    steps: Memory | None = None
    """What it remembers, where it speaks of other steps."""

    @property
    def said(self) -> str:
        """The clause, for people."""
        return self.clause.sentence or self.clause.text or show_term(self.clause.formula, "unicode")

    def truth_of(self, values: Mapping[str, Value], solver: bool) -> bool | None:
        """Whether it holds of the values; None where neither evaluation nor, if it may be asked, Z3 can tell."""
        try:
            return bool(self.holds(values if self.steps is None else self.steps.at(values)))
        except NotEvaluable as error:
            known = values if self.steps is None else self.steps.known(values)
            answer = judge(self.clause.formula, known, effort=JUDGE_EFFORT) if solver else None
            if answer is None and not self.tally.reason:
                self.tally.reason = (self.steps.unknown if self.steps is not None else "") or error.reason
            return answer

    def triggered(self, values: Mapping[str, Value]) -> bool:
        """Whether the antecedent is known to be met."""
        try:
            return self.trigger is None or bool(self.trigger(values))
        except NotEvaluable:
            return False

    def note_trigger(self, values: Mapping[str, Value]) -> None:
        """Where nobody can tell, the antecedent counts as met."""
        if self.tally.triggered or self.trigger is None:
            return
        try:
            self.tally.triggered = bool(self.trigger(values))
        except NotEvaluable:
            self.tally.triggered = True

    def only_supposed(self) -> None:
        """Nothing was ever heard of what the step before is to have given: its initial value is no observation."""
        tally = self.tally
        held = tally.decided - tally.broken
        tally.supposed += held
        tally.judged -= held
        tally.triggered = self.trigger is None


def trigger_of(formula: Term) -> Term | None:
    """What must hold somewhere for the formula to say anything: the antecedent, over all its variables."""
    variables: list[Variable] = []
    while isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL:
        variables.extend(formula.variables)
        formula = formula.body
    if not isinstance(formula, Implies):
        return None
    return Quantified(Quantifier.EXISTS, tuple(variables), formula.left) if variables else formula.left


def time_text(raw: Any) -> str:
    if isinstance(raw, Fraction):
        return show(raw)
    if isinstance(raw, int | float | bytes) and not isinstance(raw, bool):
        try:
            return show(exact(raw))
        except NotANumber:
            return ""
    return ""


Shown = tuple[tuple[str, str], ...]
"""Names and values, as text."""


def shown(watched: Watched, snapshot: Mapping[str, Value]) -> tuple[Shown, Shown]:
    """What a broken clause speaks of, and the bindings of its quantifiers that break it."""
    bindings: dict[str, Value] = {}
    try:
        if snapshot.keys() >= set(watched.names):
            known = snapshot if watched.steps is None else watched.steps.judged
            bindings = watched.witness(known) or {}
    except NotEvaluable:
        pass
    texts = ((n, show(snapshot[n])) for n in watched.names if n in snapshot)
    values = tuple((n, text if len(text) <= 200 else text[:199] + "…") for n, text in texts)
    return values, tuple((n, show(v)) for n, v in bindings.items())


def open_verdict(
    watched: Watched, assumptions: Sequence[Watched], values: Mapping[str, Value], solver: bool
) -> bool | None:
    """Whether a guarantee holds whatever is not known; None where that matters, or nobody can tell. Broken it is only
    where all assumptions are known to hold."""
    truth = judge_open(watched.clause.formula, values, effort=JUDGE_EFFORT)
    if truth is False:
        for assumed in assumptions:
            if any(n not in values for n in assumed.names) or assumed.truth_of(values, solver) is not True:
                return None
    return truth
