"""A clause under watch, and the violations that an event shows."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field
from enum import StrEnum
from fractions import Fraction
from typing import TYPE_CHECKING, Any

from avow.base.records import dataclass
from avow.base.suggestions import nearest
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.evaluation.evaluate import NotEvaluable
from avow.evaluation.truth import judge, judge_open
from avow.formulas.conditions import conditions
from avow.formulas.formula import conjunction
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
    """The results of one clause over a trace."""

    judged: int = 0
    """Held, broken, or undecided since no calculation gave an answer."""
    broken: int = 0
    excused: int = 0
    undecided: int = 0
    order: int = 0
    """Answers for which it is undecided what they answered."""
    early: int = 0
    """Answers before every variable of the clause had a value."""
    awaited: dict[str, None] = field(default_factory=dict)
    """The variables that had no value then."""
    unreadable: int = 0
    """Messages with one of its outputs that could not be read."""
    nameless: int = 0
    """Messages of a topic that other nodes publish too, without a record of their publisher."""
    partial: int = 0
    """Answers that were never complete, and whose parts alone do not decide them."""
    supposed: int = 0
    """Answers that held before any message of a variable, as with its initial value: neither for nor against."""
    forgotten: int = 0
    """Steps not decided, since steps before them were not seen."""
    overdue: int = 0
    """Steps at which a response that had missed its deadline was still missing: no further breaches."""
    open: int = 0
    """Runs at whose end a response was still required, or may have been, or the latest inputs had no answer yet."""
    left: int = 0
    """A bit for each condition that these inputs meet."""
    unanswered: int = 0
    """Inputs without an answer, although later ones had one."""
    published: int = 0
    """Answers: publications of its outputs, where those that make one answer count once."""
    conditions: int = 1
    """The number of conditions under which it demands something; 0: it always does."""
    met: int = 0
    """A bit for each of them that was met at least once."""

    ages: dict[str, float] = field(default_factory=dict)
    """The greatest age of each input when an answer came, in seconds."""

    hidden: bool = False
    """It speaks of a variable that no message shows."""
    unpaired: bool = False
    """It speaks of inputs and outputs, and the plan does not say which input an answer answered."""

    @property
    def decided(self) -> int:
        return self.judged - self.undecided

    @property
    def triggered(self) -> bool:
        """Whether each of its conditions was met at least once."""
        return self.met + 1 == 1 << self.conditions

    @property
    def asked(self) -> int:
        """The number of answers that had to be decided."""
        return self.published - self.supposed - self.overdue

    def withdrawn(self, reason: str) -> None:
        """All judgements so far are undecided after all, except breaches, which were reported."""
        self.undecided = self.judged - self.broken
        self.reason = self.reason or reason

    def too_early(self, awaited: Iterable[str]) -> None:
        """An answer has come before these variables had a value."""
        self.early += 1
        self.awaited.update(dict.fromkeys(awaited))

    def unsure(self, reason: str, several: int = 1) -> None:
        """It is undecided what one answer, or several, answered."""
        self.order += several
        if reason.endswith(UNSAID):
            self.awaited[reason.removesuffix(UNSAID)] = None
        if not self.reason or self.reason.endswith(UNSAID):  # an initial value helps, and others keep what else does
            self.reason = reason

    def aged(self, now: float, heard: Mapping[str, float], names: Iterable[str]) -> None:
        """An answer has come; `heard`: when its inputs had come, including those of these names."""
        for name in names:
            self.aging(name, now - heard[name])

    def aging(self, name: str, age: float) -> None:
        """An input had this age, in seconds, when an answer came. Negative: it came later, and has none."""
        if age >= self.ages.get(name, 0.0):
            self.ages[name] = age

    def unnamed(self, topic: str) -> None:
        """A message has come that is by no node that publishes its topic in the contract, as far as it is recorded."""
        self.published += 1
        self.nameless += 1
        self.reason = (
            self.reason or f"a message of {topic} is by no node that publishes it in the contract (`_publisher`)"
        )

    reason: str = ""
    """Why it is not judged at all, or the first reason why a judgement was undecided."""


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
        (tally.nameless, "of an unknown publisher {}"),
        (tally.partial, "part of an incomplete answer {}"),
        (tally.forgotten, "undecided, since earlier steps were not seen {}"),
        (tally.unanswered, "unanswered inputs {}"),
        (tally.supposed, "held before any message of a variable {}"),
    ]
    told = ", ".join(words.format(count) for count, words in parts if count)
    told += f"; {old(tally.ages)}" if tally.ages else ""
    told += f"{'; ' if told else ''}an answer was open at the end" if tally.open else ""
    return f"published {tally.published} times" + (f": {told}" if told else "")


UNSAID = " may have had no value yet"
DEPENDS = "it depends on which input the answer answered"


def silent_topic(topic: str, heard: Iterable[str]) -> str:
    """`heard`: the topics of the trace that nobody listens to."""
    near = nearest(topic, (f"/{name.lstrip('/')}" for name in heard), alike=0.75)
    return "".join((f"no message came on {topic}", *(f": did you mean `{name}`?" for name in near)))


def remedies(tally: Tally, silent: Mapping[str, str], unread: Mapping[str, str]) -> str:
    """Proposals for the plan, so that a clause of which too little was decided is monitored. No initial value would
    help for `silent`, the variables whose topic had no message, and for `unread`, those of which a message could not be
    read, and why."""
    share = int(100 * tally.decided / tally.asked) / 100 if tally.asked else 0
    wanted = dict.fromkeys((*tally.awaited, *tally.reason.split()))
    late = ", ".join(n for n in tally.awaited if n not in silent and n not in unread)
    gone = ", ".join(dict.fromkeys(silent[name] for name in wanted if name in silent))
    wrong = "; ".join(f"{name}: {unread[name]}" for name in wanted if name in unread)
    said = f"give its value before the first message, mapping: {{{late.partition(',')[0]}: {{…, initial: …}}}}"
    parts = (
        (gone, f"no message came on {gone}: correct the topic in the contract, or record it"),
        (wrong, f"a message could not be read: {wrong}"),
        (late, f"{late} had no value when answers came (a latched topic, or a late publisher): {said}"),
        (tally.order and tally.unpaired, "pair answers with inputs by a stamp or a key (`answers`)"),
        (tally.reason == DEPENDS, "pair answers by a stamp or a key, or measure a shorter latency (`answers`)"),
        (tally.partial, "its outputs come on several topics, not always together: judge at each, `when: any`"),
    )
    mends = "; and ".join(words for applies, words in parts if applies)
    less = LEAST_SHARE <= share < 1 and tally.triggered and not unread
    return "; or ".join(filter(None, (mends, f"accept a smaller share, decided: {share:g}" if less else "")))


def too_old(ages: Mapping[str, float], limit: Fraction | None) -> str:
    """Which input was older than the plan's `max_age` when an answer came; empty if none was."""
    aged = next((of for of, age in ages.items() if limit is not None and age > limit), None)
    return f"{aged} was {ages[aged]:.6g} s old when an answer came: too old (`max_age`)" if aged is not None else ""


def old(ages: Mapping[str, float]) -> str:
    """``inputs at most 0.12 s old (in.r), 3.1 s (in.at)``."""
    shown = [f"{age:.3g} s{' old' if k == 0 else ''} ({name})" for k, (name, age) in enumerate(ages.items())]
    return f"inputs at most {', '.join(shown)}" if shown else ""


class Fault(StrEnum):
    """The kind of fault that an event showed."""

    GUARANTEE = "guarantee broken: this node"
    EXCUSED = "guarantee not met, with an assumption broken: not this node"
    ASSUMPTION = "assumption broken: environment"
    PROVIDER = "assumption broken: by a node that provides it"
    SILENT = "silent for longer than the plan allows"
    RATE = "messages outside the rate that the plan allows"
    MAPPING = "message outside its mapping"


Heard = Mapping[str, tuple[int, str]]
"""Variable → the place in the trace of the latest message that carried it, and its publisher, if recorded."""


@dataclass(frozen=True, slots=True)
class Part:
    """One output of an answer."""

    values: Mapping[str, Value] | None
    """Its value and the values known when it came, except the other outputs; None: it could not be read."""
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
    """For a clause that was broken: the message that each variable's value is from."""
    cause: str = ""
    """For an assumption that another node's message broke: ``sensor.nonneg at event 7 caused guard.nonneg at event 8``,
    or why no first breach is known."""
    origin: str = ""
    """For such an assumption: the clause that was broken first (``sensor.nonneg``), if it is known."""

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
    triggers: tuple[Callable[[Mapping[str, Value]], Value], ...]
    witness: Callable[[Mapping[str, Value]], dict[str, Value] | None]
    tally: Tally
    outputs: frozenset[str] = frozenset()
    """The outputs that must all be published again before it is judged: they are the parts of one answer."""
    fresh: dict[object, dict[str, Part]] = field(default_factory=dict)
    """The parts of answers that are not complete yet, by the key that the parts of one answer share (`answers`)."""
    asked: tuple[str, ...] = ()
    """By order: the inputs that its answers were paired with."""
    scattered: bool = False
    """A message of one of several outputs was lost: it is no longer known which parts are of one answer."""
    held: tuple[tuple[str, str], ...] = ()
    """(previous value, its source): for one of several outputs, the value in the answer before, whichever of the
    outputs comes first in this one."""
    memory: dict[str, Value] = field(default_factory=dict)
    """The held values."""
    key: tuple[int, ...] | None = None
    truth: bool | None = None
    inputs: tuple[str, ...] = ()
    """The observed inputs that its answers are compared with."""
    paired: tuple[str, ...] = ()
    """The observed inputs that an answer has to be paired with."""
    steps: Memory | None = None
    """Its memory, if it speaks of other steps."""

    @property
    def statement(self) -> str:
        """The clause, for people."""
        return self.clause.sentence or self.clause.text or show_term(self.clause.formula, "unicode")

    def truth_of(self, values: Mapping[str, Value]) -> bool | None:
        """Whether it holds of the values; None if neither evaluation nor Z3 can decide."""
        try:
            return bool(self.holds(values if self.steps is None else self.steps.at(values)))
        except NotEvaluable as error:
            known = values if self.steps is None else self.steps.known(values)
            answer = judge(self.clause.formula, known, effort=JUDGE_EFFORT)
            if answer is None and not self.tally.reason:
                self.tally.reason = (self.steps.unknown if self.steps is not None else "") or error.reason
            return answer

    def met(self, values: Mapping[str, Value], unknown: bool = False) -> int:
        """A bit for each condition that is known to be met (if `unknown`: or that cannot be evaluated)."""
        found = 0
        for k, trigger in enumerate(self.triggers):
            try:
                found |= bool(trigger(values)) << k
            except NotEvaluable:
                found |= unknown << k
        return found

    def only_supposed(self) -> None:
        """No message ever gave the value of the step before: its initial value is no observation."""
        tally = self.tally
        held = tally.decided - tally.broken
        tally.supposed += held
        tally.judged -= held
        tally.met = 0


def conditions_of(formula: Term) -> tuple[Term, ...]:
    """The conditions without each of which the formula is vacuous, over all its variables: its antecedents, with each
    condition under which the rest demands something. None if it always demands something."""
    variables: list[Variable] = []
    given: list[Term] = []
    while isinstance(formula, Implies) or (isinstance(formula, Quantified) and formula.quantifier is Quantifier.FORALL):
        if isinstance(formula, Quantified):
            variables.extend(formula.variables)
            formula = formula.body
        else:
            given.append(formula.left)
            formula = formula.right
    ways = [conjunction((*given, condition.formula)) for condition in conditions(formula)]
    ways = ways or ([conjunction(given)] if given else [])
    return tuple(Quantified(Quantifier.EXISTS, tuple(variables), way) if variables else way for way in ways)


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
    """The values of a broken clause's variables, and the bindings of its quantifiers that break it."""
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


def open_verdict(watched: Watched, assumptions: Sequence[Watched], values: Mapping[str, Value]) -> bool | None:
    """Whether a guarantee holds for every value of the unknown variables; None if that depends on them, or cannot be
    decided. It is broken only if all assumptions are known to hold."""
    truth = judge_open(watched.clause.formula, values, effort=JUDGE_EFFORT)
    if truth is False:
        for assumed in assumptions:
            if any(n not in values for n in assumed.names) or assumed.truth_of(values) is not True:
                return None
    return truth
