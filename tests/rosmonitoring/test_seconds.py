"""Clauses with limits in seconds, monitored: silence breaks one at its deadline, clocks are no better than they are."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from drawn.memory import TIMED_NODE, B, timed_formula, timed_response, word_of
from reference.meaning import Meaning, Word

from avow.backends.rosmonitoring.engine import Monitor
from avow.backends.rosmonitoring.options import Setup
from avow.backends.rosmonitoring.pace import Leeway, Silence
from avow.backends.rosmonitoring.traces import read_trace
from avow.backends.rosmonitoring.watched import Fault, Violation
from avow.base.diagnostics import Rejected
from avow.formulas.formula import free_variables
from avow.formulas.temporal.ages import ELAPSED, Side
from avow.formulas.temporal.responses import in_the_past
from avow.language.contract import Clause, ClauseKind
from avow.language.printer import show_term
from avow.language.sorts import BOOL
from avow.language.subterms import histories, timed
from avow.language.terms import FALSE, TRUE, History, Implies, Literal, Past, Term

from .test_other_steps import Make, found, made

Event = dict[str, Any]


def at(time: float, **values: Any) -> Event:
    topic = "o" if "b" in values else "i"
    return {"topic": topic, "time": time, **({"n": 0} | values if topic == "i" else values)}


def told(make: Make, clauses: str, *events: Event) -> list[tuple[Fault, str, str]]:
    monitor = Monitor(found(made(make, *clauses.split("\n"))))
    broken: list[Violation] = []
    for event in events:
        broken += monitor.step(event)
    return [(v.fault, v.clause, v.time) for v in broken]


WITHIN = "guarantee g ( rose(in.a) -> within[1 s](out.b) )"
OTHER = {"topic": "elsewhere", "time": 9.0}


def test_an_answer_in_time(make_system: Make) -> None:
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True), at(1.9, b=True), OTHER]
    assert told(make_system, WITHIN, *events) == []


def test_silence_breaks_a_response_at_its_deadline(make_system: Make) -> None:
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True)]
    assert told(make_system, WITHIN, *events, {**OTHER, "time": 2.04}) == []  # a message may be on its way
    assert told(make_system, WITHIN, *events, {**OTHER, "time": 2.05}) == []  # as late as one may be
    assert told(make_system, WITHIN, *events, {**OTHER, "time": 2.06}, OTHER) == [(Fault.GUARANTEE, "g", "2")]
    assert told(make_system, WITHIN, *events, at(2.04, b=True), OTHER) == []
    assert told(make_system, WITHIN, *events, at(3, b=True)) == [(Fault.GUARANTEE, "g", "2")]


def test_a_response_right_after_its_limit_is_late(make_system: Make) -> None:
    heard = "guarantee g ( in.a -> within[0 s](out.b or not arrived(in.a)) )"
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True), {**OTHER, "time": 9}]
    assert told(make_system, heard, *events) == [(Fault.GUARANTEE, "g", "1")]
    assert told(make_system, heard, *events[:3], at(1, b=True), events[3]) == []


def test_the_time_before_which_nobody_need_look(make_system: Make) -> None:
    """It is never after the deadline itself, which is a float seldom, and the first of all clauses' deadlines."""
    short = "guarantee h ( rose(in.a) -> within[50 ms](out.b) )"
    monitor = Monitor(found(made(make_system, WITHIN, short, "guarantee k ( fell(in.a) -> next(out.b) )")))
    assert monitor.deadline == math.inf
    for event in (at(0, a=False), at(0.01, b=False), at(0.05, a=True)):
        monitor.step(event)
    assert monitor.deadline == math.nextafter(0.1, 0)
    assert Fraction(monitor.deadline) < Fraction(1, 10) < Fraction(0.1)
    monitor.step(at(0.1, b=True))
    assert monitor.deadline == math.inf


@pytest.mark.parametrize(
    ("moments", "at", "after", "broken"),
    [  # when it may change; when it does not hold, at a time and right after it
        ([3, 1, Fraction(2)], {2, 3}, set(), 2),
        ([3, 1, Fraction(2)], set(), {1, 3}, 1),
        ([3, 1, Fraction(2)], {1}, {0}, 0),
        ([0, -1, Fraction(-1, 2)], {0, -1, Fraction(-1, 2)}, {-1}, None),  # of the step itself it was asked already
        ([Fraction(1, 3), "x", None], {Fraction(1, 3)}, {1}, Fraction(1, 3)),
        ([2], {1}, {1}, None),
        ([], {1}, {1}, None),
    ],
)
def test_when_silence_breaks_it(moments: list[Any], at: set[int], after: set[int], broken: Fraction | None) -> None:
    never = {Side.AT: at, Side.AFTER: after}
    holds = {s: (lambda memory, s=s: memory[ELAPSED.qualified] not in never[s]) for s in Side}
    silence = Silence(holds, (lambda memory: iter(moments),), None, Leeway())
    assert silence.broken({}) == broken


@pytest.mark.parametrize(("after", "elapsed"), [(-3, 0), (0, 0), (98, 98), (99, 100), (101, 100), (102, 102)])
def test_a_step_that_is_nearly_in_time_is_in_time(after: int, elapsed: int) -> None:
    silence = Silence({}, (), Fraction(1), Leeway(jitter=Fraction(1, 100)))
    silence.passed(Fraction(5))
    assert silence.elapsed == 0  # nothing was before
    silence.latest = Fraction(5)
    silence.passed(5 + Fraction(after, 100))
    assert silence.elapsed == Fraction(elapsed, 100)


def test_times_that_go_back(make_system: Make) -> None:
    events = [at(10, a=False), at(10.1, b=False), at(11, a=True)]
    assert told(make_system, WITHIN, *events, at(10.995, b=True), OTHER) == []  # a clock's jitter
    assert told(make_system, WITHIN, *events, at(5, a=False), {**OTHER, "time": 50}) == []  # a new run
    assert told(make_system, WITHIN, *events, at(5, a=False), at(6, a=True), {**OTHER, "time": 50}) == [
        (Fault.GUARANTEE, "g", "7")
    ]


def test_a_node_that_dies_breaks_its_pace(make_system: Make) -> None:
    pace = "guarantee g ( TRUE )\nguarantee steps ( steps(at most 500 ms) )"
    answers = [at(0, b=True), at(0.5, b=True), at(0.9, b=False)]
    assert told(make_system, pace, *answers, {**OTHER, "time": 1.4}) == []
    assert told(make_system, pace, *answers, OTHER) == [(Fault.GUARANTEE, "steps", "1.4")]
    every = pace.replace("at most", "every")
    assert told(make_system, every, at(0, b=True), at(0.495, b=True), at(1.002, b=True)) == []
    assert told(make_system, every, at(0, b=True), at(0.3, b=True)) == [(Fault.GUARANTEE, "steps", "0.3")]


def test_a_sensor_that_dies_or_never_lived(make_system: Make) -> None:
    alive = "assume alive ( once[1 s](arrived(in.a)) )\nguarantee g ( TRUE )"
    assert told(make_system, alive, at(0, a=True), at(0.9, a=True), at(1.9, a=True)) == []
    assert told(make_system, alive, at(0, a=True), at(0.9, a=True), OTHER) == [(Fault.ASSUMPTION, "alive", "1.9")]
    assert told(make_system, alive, {**OTHER, "time": 3}, OTHER) == [(Fault.ASSUMPTION, "alive", "4")]


def test_what_was_promised_while_a_sensor_lives_is_not_laid_at_the_node_when_it_died(make_system: Make) -> None:
    both = "assume alive ( once[1 s](arrived(in.a)) )\n" + WITHIN
    events = [at(0, a=False), at(0.1, b=False), at(1, a=True)]
    assert [f for f, _, _ in told(make_system, both, *events, at(5, b=True))] == [Fault.ASSUMPTION, Fault.EXCUSED]


def tallied(make: Make, clauses: str, *events: Event) -> dict[str, tuple[int, int, int]]:
    """Of each clause, how often it was held, broken, undecided."""
    monitor = Monitor(found(made(make, *clauses.split("\n"))))
    for event in events:
        monitor.step(event)
    return {name: (t.decided - t.broken, t.broken, t.undecided) for name, t in monitor.tallies.items()}


@pytest.mark.parametrize(
    ("clause", "events", "broken"),
    [
        ("once[5 s](in.a) -> out.b", [(0, "a0"), (0.1, "b0"), (1, "a1"), (1.2, "a0"), (1.3, "b0"), (7, "b0")], ["1.3"]),
        ("once[5 s](in.a) -> out.b", [(0, "a1"), (0.1, "a0"), (0.2, "b0"), (5.3, "b0")], ["0.2"]),
        ("held[1 s](in.a) -> out.b", [(0, "b0"), (0, "a0"), (0.1, "b0"), (0.2, "a1"), (1.7, "b1")], ["1.2"]),
        ("held[1 s](in.a) -> out.b", [(0, "a1"), (0.1, "b0"), (0.5, "a1"), (1, "a1"), (2.2, "b1")], ["1"]),
        ("held[1 s](in.a) -> out.b", [(0, "a1"), (0.1, "b0"), (0.5, "a0"), (0.6, "a1"), (1.2, "b0"), (1.3, "a0")], []),
        ("not once[1 s](in.a) -> not out.b", [(0, "a1"), (0.1, "b1"), (4, "a0"), (5.5, "b0")], ["5"]),
        (
            "rose(in.a) and once[1 s](in.a) -> out.b",
            [(0, "a0"), (0.1, "b0"), (1, "a1"), (1.1, "b0"), (2, "b0")],
            ["1.1"],
        ),
    ],
)
def test_timers_follow_each_message(clause: str, events: list[Any], broken: list[str], make_system: Make) -> None:
    given = [at(time, **{said[0]: said[1] == "1"}) for time, said in events]
    found = told(make_system, f"guarantee g ( {clause} )", *given, OTHER)
    assert [time for _, _, time in found] == broken


def test_what_depends_on_steps_and_on_time_is_undecided(make_system: Make) -> None:
    mixed = "guarantee g ( once[5 s](held[2 steps](in.a)) or out.b )"
    events = [at(0, a=False), at(0.1, b=True), at(0.2, b=True), at(0.3, a=True), at(0.4, b=True), at(0.5, b=True)]
    monitor = Monitor(found(made(make_system, mixed)))
    assert [v for event in events for v in monitor.step(event)] == []
    tally = monitor.tallies["g"]
    assert (tally.decided, tally.undecided + tally.forgotten) == (2, 2)


def test_what_came_a_little_late_is_neither_held_nor_broken(make_system: Make) -> None:
    short = "guarantee g ( rose(in.a) -> within[20 ms](out.b) )"
    events = [at(0, b=False), at(0, a=False), at(1, a=True)]
    assert tallied(make_system, short, *events, at(1.02, b=True), OTHER) == {"g": (3, 0, 0)}
    assert tallied(make_system, short, *events, at(1.021, b=True), OTHER) == {"g": (2, 0, 1)}
    assert tallied(make_system, short, *events, at(1.07, b=True), OTHER) == {"g": (2, 0, 1)}
    assert tallied(make_system, short, *events, at(1.08, b=True), OTHER)["g"][1:] == (1, 0)
    pace = "guarantee g ( TRUE )\nguarantee steps ( steps(at most 20 ms) )"
    assert tallied(make_system, pace, *(at(k * 0.069, b=True) for k in range(9)))["steps"] == (1, 0, 8)
    alive = "assume alive ( once[100 ms](arrived(in.a)) )\nguarantee g ( in.a -> out.b )"
    late = [at(0, a=True), at(0.12, a=True), at(0.13, b=False)]
    assert told(make_system, alive, *late) == [(Fault.GUARANTEE, "g", "0.13")]  # an assumption gets the benefit


def test_a_response_to_inputs_is_judged_from_their_first_message_on(make_system: Make) -> None:
    """Before the node has said anything, its response has not come: that nothing is due is known, that it is late is
    not, since its topic may not have been recorded."""
    before = [at(k / 10, a=False) for k in range(9)]
    answered = [at(0.95, b=False), at(1, a=True), at(1.2, b=True), OTHER]
    assert tallied(make_system, WITHIN, *before, *answered) == {"g": (12, 0, 0)}
    assert tallied(make_system, WITHIN, at(0, b=False), *before, *answered) == {"g": (12, 0, 0)}
    assert tallied(make_system, WITHIN, *before, at(1, a=True), at(1.2, b=True), OTHER) == {"g": (11, 0, 0)}
    dead = [*before, at(1, a=True), at(3, a=True)]
    assert told(make_system, WITHIN, *dead, OTHER) == []
    assert tallied(make_system, WITHIN, *dead, OTHER) == {"g": (10, 0, 1)}
    assert told(make_system, WITHIN, at(0, b=False), *dead, OTHER)[0] == (Fault.GUARANTEE, "g", "2")
    late = [*before, at(1, a=True), at(1.5, b=False), at(3, a=True)]
    assert told(make_system, WITHIN, *late, OTHER)[0] == (Fault.GUARANTEE, "g", "2")


def test_a_run_begins_anew_for_all_clauses_at_once(make_system: Make) -> None:
    """Else an assumption that was broken since the times went back would be forgotten at a guarantee's first step."""
    both = "assume alive ( once[1 s](arrived(in.a)) )\nguarantee g ( held[2 s](in.a) -> out.b )"
    alive = [at(t, a=True) for t in (7.9, 8.8, 9.4)]
    events = [at(10, a=True), at(10.1, b=True), at(5, a=True), at(7, a=True), at(7, b=False), *alive, at(9.5, b=False)]
    faults = [(fault, clause) for fault, clause, _ in told(make_system, both, *events)]
    assert (Fault.ASSUMPTION, "alive") in faults
    assert (Fault.EXCUSED, "g") in faults
    assert (Fault.GUARANTEE, "g") not in faults


@pytest.mark.parametrize("time", ["1e400", "1e13", "9" * 400, "9" * 30 + ".5"])
def test_a_time_that_is_none(time: str, tmp_path: Path, make_system: Make) -> None:
    trace = tmp_path / "t.jsonl"
    trace.write_text(f'{{"topic": "o", "time": {time}, "b": true}}\n')
    with pytest.raises(Rejected, match="time"):
        list(read_trace(trace))
    assert told(make_system, WITHIN, {**at(0, b=True), "time": int("9" * 400)}) == []  # live: never an exception


HEAD = """
node n {
  inputs( a : BOOL, x : REAL )
  outputs( b : BOOL )
  topics( m/I i matches(in.a), m/I i matches(in.x), m/O o matches(out.b) )
  guarantee g ( in.a -> in.x >= 0 or out.b )
}"""


def by_message(rng: random.Random, word: Word) -> tuple[Word, list[str]]:
    """The word's steps as single messages: after the first, each changes the inputs or the output."""
    steps, topics = [{**word.steps[0], "in.arrived a": True}], ["io"]
    for step in word.steps[1:]:
        topics.append(rng.choice("iio"))
        changed = ("in.a", "in.x") if topics[-1] == "i" else ("out.b",)
        steps.append({**steps[-1], **{n: step[n] for n in changed}, "in.arrived a": topics[-1] == "i"})
    return Word(steps, word.times), topics


def disagreement(known: Setup, rng: random.Random) -> tuple[int, list[str]]:
    """How many clauses of a random word of single messages were judged; which of them the monitor judges otherwise than
    the definitions over all positions do: its first breach, or, if its steps are answers, each verdict and breach."""
    depth = rng.choice((1, 2, 2, 3))
    term, (word, topics) = timed_formula(rng, depth), by_message(rng, word_of(rng))
    if late := rng.random() < 0.3:  # inputs before the first answer
        topics[0] = "i"
    trigger, response = timed_response(rng, depth - 1)
    judged, wrong = 0, list[str]()
    for whole in (term, Implies(trigger, response)):
        about, asked = free_variables(whole), free_variables(trigger)
        of_inputs = whole is not term and bool(asked) and asked <= {p.variable for p in TIMED_NODE.inputs}
        every = of_inputs or any(h.operator is Past.ARRIVED for h in histories(whole))
        if timed(whole) is None or B not in about or not about & {p.variable for p in TIMED_NODE.inputs}:
            continue
        past = in_the_past(whole)
        over_time = [h for h in histories(past) if in_time(h)]
        if late and (every or any(B in free_variables(h) for h in over_time)):
            continue
        inner = {part.operator for h in over_time for part in histories(h)}
        if not late and not every and inner & {Past.ROSE, Past.FELL, Past.CHANGED}:
            continue  # the parts of the first step come one after the other: an edge of one is before the other
        over_steps = [h for h in histories(past) if not in_time(h) and h.operator is not Past.ARRIVED]
        if not every and any(in_time(part) for h in over_steps for part in histories(h)):
            continue  # what it says of steps and of time depends on each other
        monitor = Monitor(replace(known, node=replace(known.node, guarantees=(_guarantee(whole),))))
        tally, told, verdicts = monitor.tallies["g"], list[Violation](), dict[int, bool | None]()
        for k, (step, time, topic) in enumerate(zip(word.steps, word.times, topics, strict=True)):
            parts = {"i": {"a": step["in.a"], "x": int(step["in.x"])}, "o": {"b": step["out.b"]}}
            for each in topic[::-1] if every else topic:
                told += monitor.step({"topic": each, "time": time, **parts[each]})
            if "o" in topic and not tally.overdue:
                broken = any(v.index == monitor.events and "no step" not in v.explanation for v in told)
                verdicts[k] = None if tally.undecided + tally.forgotten else not broken
        if tally.reason or not (
            every or "out.b" in monitor.clauses
        ):  # refused by name, or the same the other way round
            continue
        judged += 1
        if every:
            first = Meaning().broken(whole, word)
            expected = [] if first is None else [str(word.positions[first].start)]
            right = [v.time for v in told][:1] == expected
        else:
            right = agrees(Answered(past, word, [k for k, topic in enumerate(topics) if "o" in topic]), verdicts, told)
        if not right:
            wrong.append(f"{show_term(whole, 'rcl')}: {verdicts}, {told} of {word}, {topics}")
    return judged, wrong


def in_time(term: Term) -> bool:
    """Whether it is an operator over all instants."""
    unlimited = isinstance(term, History) and term.operator in (Past.ONCE, Past.HISTORICALLY, Past.SINCE)
    return isinstance(term, History) and (unlimited if term.limit is None else not term.limit.steps)


class Answered:
    """The definition of a clause that is judged at answers: operators over instants are over all messages, the others
    over answers; between answers these keep their values, and their events are false."""

    def __init__(self, clause: Term, word: Word, answers: list[int]) -> None:
        self.clause, self.word, self.answers, self.meaning = clause, word, answers, Meaning()

    def at(self, position: int) -> bool:
        there = self.word.positions[position]
        steps = [k for k in self.answers if k <= there.step]
        return self._met(self.clause, position, steps, there.silent or there.step not in self.answers)

    def _met(self, term: Term, position: int, steps: list[int], between: bool) -> Any:
        def put(part: Term) -> Term:
            if isinstance(part, History):
                if in_time(part):
                    return TRUE if self.meaning.met(part, self.word, position) else FALSE
                if between and part.operator in (Past.ROSE, Past.FELL, Past.CHANGED):
                    return FALSE
                found = self.meaning.value(part, [self.word.steps[k] for k in steps], len(steps) - 1)
                return (TRUE if found else FALSE) if part.sort == BOOL else Literal(found, part.sort)
            return part.rebuild(tuple(map(put, part.children))) if part.children else part

        return self.meaning.met(put(term), [self.word[position]], 0)


def agrees(definition: Answered, verdicts: dict[int, bool | None], told: list[Violation]) -> bool:
    """Whether the verdicts at answers are right, and breaches between them: each is one, and none that comes with time
    alone is missing."""
    word, right = definition.word, True
    for k, said in verdicts.items():
        right = right and said is definition.at(word.places[k])
    late = {Fraction(v.time) for v in told if "no step" in v.explanation}
    first, last = definition.answers[:1], len(word.steps) - 1
    holds = {n: definition.at(n) for n, p in enumerate(word.positions) if first and p.step >= first[0]}
    right = right and all(
        any(p.start == t and not holds.get(n, True) for n, p in enumerate(word.positions)) for t in late
    )
    for n in holds:
        there = word.positions[n]
        if there.silent and n - 1 in holds and holds[n - 1] and not holds[n] and word.positions[n - 1].silent:
            later = [k for k in definition.answers if k > there.step]
            past = [k for k in definition.answers if k <= there.step]
            end = word.times[later[0]] if later else word.times[last]
            right = right and (end <= there.start or any(word.times[past[-1]] <= t <= end for t in late))
    return right


def _guarantee(formula: Term) -> Clause:
    return Clause(ClauseKind.GUARANTEE, "g", 1, formula)


@pytest.mark.parametrize(
    ("seed", "words"), [(0, 40), pytest.param(1, 300, marks=pytest.mark.slow)], ids=["few", "many"]
)
def test_verdicts_are_what_the_definitions_over_timed_words_say(seed: int, words: int, make_system: Make) -> None:
    known = found(make_system(HEAD, {"in.a": "a", "in.x": "x", "out.b": "b"}))
    rng = random.Random(seed)
    results = [disagreement(known, rng) for _ in range(words)]
    assert [fault for _, wrong in results for fault in wrong] == []
    assert sum(judged for judged, _ in results) > words / 8


def test_no_step_leaves_no_response_open(make_system: Make) -> None:
    monitor = Monitor(found(made(make_system, WITHIN)))
    monitor.step(OTHER)
    assert monitor.finish() == []
    assert monitor.tallies["g"].open == 0


@pytest.mark.parametrize("clause", ["historically[1 s](out.b)", "once[1 s](in.a)"])
def test_a_breach_at_a_step_is_not_told_again_of_the_silence_after_it(clause: str, make_system: Make) -> None:
    events = [at(0, a=False), at(0.5, b=False)]
    broken = told(make_system, f"guarantee g ( {clause} )", *events)
    assert broken
    assert told(make_system, f"guarantee g ( {clause} )", *events, OTHER, {**OTHER, "time": 20}) == broken
