"""A clause under watch, and what is told of an event that shows something wrong."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.base.records import dataclass
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.evaluation.evaluate import NotEvaluable
from avow.evaluation.truth import judge, judge_open
from avow.formulas.values import Value, show
from avow.language.contract import Clause
from avow.language.printer import show_term
from avow.language.terms import Implies, Quantified, Quantifier, Term, Variable

from .tuning import LEAST_SHARE
from .wires import NotANumber, exact

if TYPE_CHECKING:
    from .memory import Memory


@dataclass(slots=True)
class Tally:
    """What became of one clause over a trace."""

    judged: int = 0
    """Held, broken, or undecided since no calculation told."""
    broken: int = 0
    excused: int = 0
    undecided: int = 0
    order: int = 0
    """Answers of which it is undecided what they answered."""
    early: int = 0
    """Answers before everything that it speaks of had a value."""
    awaited: dict[str, None] = field(default_factory=dict)
    """What had no value then."""
    unreadable: int = 0
    """Messages with one of its outputs that could not be read."""
    nameless: int = 0
    """Messages of a topic that other nodes publish too, which do not say whose they are."""
    partial: int = 0
    """Answers that were never whole, and that their parts alone do not decide."""
    supposed: int = 0
    """Answers that held by an initial value of the plan, before any message: neither for nor against."""
    forgotten: int = 0
    """Steps not decided, since steps before them went by unseen."""
    overdue: int = 0
    """Steps at which what had missed its deadline before was still missing: no breaches of their own."""
    open: int = 0
    """Runs at whose end a response was still demanded, or may have been."""
    published: int = 0
    """Answers: publications of its outputs, those that make one answer counted once."""
    triggered: bool = False
    """Its antecedent held at least once (or it has none)."""

    ages: dict[str, float] = field(default_factory=dict)
    """The greatest age of each input when an answer came, in seconds."""

    hidden: bool = False
    """It speaks of something that no message shows."""
    unpaired: bool = False
    """It speaks of inputs and outputs, and nobody has said which input an answer answered."""

    @property
    def decided(self) -> int:
        return self.judged - self.undecided

    @property
    def asked(self) -> int:
        """Answers that were to be decided."""
        return self.published - self.supposed - self.overdue

    def withdrawn(self, reason: str) -> None:
        """What was judged so far is undecided after all; breaches were told."""
        self.undecided = self.judged - self.broken
        self.reason = self.reason or reason

    def too_early(self, awaited: Iterable[str]) -> None:
        """An answer has come before these variables had a value."""
        self.early += 1
        self.awaited.update(dict.fromkeys(awaited))

    def unsure(self, reason: str, several: int = 1) -> None:
        """Of an answer, or of several, it is undecided what it answered."""
        self.order += several
        self.reason = self.reason or reason

    def aged(self, now: float, heard: Mapping[str, float], names: Iterable[str]) -> None:
        """An answer has come; `heard`: when its inputs had, those of these names among them."""
        for name in names:
            self.aging(name, now - heard[name])

    def aging(self, name: str, age: float) -> None:
        """An input was so old when an answer came."""
        if age > self.ages.get(name, -1.0):
            self.ages[name] = max(age, 0.0)

    def unnamed(self, topic: str) -> None:
        """A message of a topic that other nodes publish too has come, which does not say whose it is."""
        self.published += 1
        self.nameless += 1
        self.reason = self.reason or f"several nodes publish {topic}, and a message does not say whose it is"

    reason: str = ""
    """Why it is not judged at all, or the first reason why it was once undecided."""


def coverage(tally: Tally) -> str:
    """``published 201 times: held 198, broken 1 (1 excused), before the first value 2``."""
    held = tally.decided - tally.broken
    parts = [
        (held, "held {}"),
        (tally.broken, "broken {}" + (f" ({tally.excused} excused)" if tally.excused else "")),
        (tally.overdue, "still overdue {}"),
        (tally.undecided, "undecided {}"),
        (tally.order, "undecided which input was answered {}"),
        (tally.early, "before the first value {}"),
        (tally.unreadable, "unreadable {}"),
        (tally.nameless, "whose it was is not told {}"),
        (tally.partial, "not part of a whole answer {}"),
        (tally.forgotten, "undecided, since steps before went by unseen {}"),
        (tally.supposed, "held by the plan's initial value, before any message {}"),
    ]
    told = ", ".join(words.format(count) for count, words in parts if count)
    told += f"; {old(tally.ages)}" if tally.ages else ""
    told += f"{'; ' if told else ''}a response was open at the end" if tally.open else ""
    return f"published {tally.published} times" + (f": {told}" if told else "")


def remedies(tally: Tally) -> str:
    """What the plan may say so that a clause of which too little was decided is monitored."""
    share = int(100 * tally.decided / tally.asked) / 100 if tally.asked else 0
    late = ", ".join(tally.awaited)
    first = (
        f"{late} had no value when answers came (a latched topic, or a late publisher): say what it was "
        f"before its first message, mapping: {{{next(iter(tally.awaited))}: {{…, initial: …}}}}"
        if late
        else ""
    )
    unpaired = "pair answers with inputs by a stamp or a key (`answers`)" if tally.order and tally.unpaired else ""
    less = f"say that less is enough, decided: {share:g}" if LEAST_SHARE <= share < 1 else ""
    return "; or ".join(part for part in (first, unpaired, less) if part)


def old(ages: Mapping[str, float]) -> str:
    """``inputs at most 0.12 s old (in.r), 3.1 s (in.at)``."""
    shown = [f"{age:.3g} s{' old' if k == 0 else ''} ({name})" for k, (name, age) in enumerate(ages.items())]
    return f"inputs at most {', '.join(shown)}" if shown else ""


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
