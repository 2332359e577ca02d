"""What a generated test stands on: it draws inputs, asks the subject, and judges the outputs against the contract.

The subject runs in a process of its own (`host`); its answers are data. Judging is exact: evaluation over finite
tables, and Z3 where that cannot answer; what neither can tell is counted as undecided, never as passed.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from math import inf
from pathlib import Path
from typing import Any

from hypothesis import Phase, assume, given, seed
from hypothesis import strategies as st
from hypothesis.errors import FailedHealthCheck, Flaky, Unsatisfiable

from avow.base.codec import from_text
from avow.base.files import text_or_nothing
from avow.base.process import adopt_orphans
from avow.base.tuning.running import SUBJECT_PATIENCE
from avow.evaluation.running import Keeper
from avow.formulas.temporal.cells import Records
from avow.formulas.values import Value
from avow.isolation import judge
from avow.isolation.scout import Scout, Sight
from avow.isolation.subject import SubjectFailed, SubjectProcess
from avow.language.sorts import RealSort, Sort

from . import steer
from .convention import (
    EXACT,
    SPECIAL,
    Case,
    Malformed,
    asked_with,
    kept_inputs,
    outputs,
    pairs,
    rounded,
    sent_inputs,
    system_root,
    table_rows,
    told,
    valuation,
)
from .exchange import Answer, Met, Pairs, Question, Tried, decode
from .export import KEPT
from .generate import Failing, Generator, Impossible, Inputs, Source
from .judging import Trigger, blamed, guarantee, judged
from .pools import constants, pools
from .shrink import OutOfTime, configuration, smallest
from .tuning import AFTER_COUNTING, APART, ASKED_AGAIN, BATCH, CASE_BYTES, COUNTED, EDGES, SCOUT_PATIENCE, TRIED


class Bench:
    """One node's contract, a subject, and the counts of what was tried."""

    def __init__(self, asked: Question, folder: Path) -> None:
        self.asked = asked
        self.cases = asked.cases
        self.seed = asked.seed
        self.doubles = asked.numbers != EXACT
        self.inputs_sorts: dict[str, Sort] = {p.name: decode(p.sort) for p in asked.inputs}
        self.output_sorts: dict[str, Sort] = {p.name: decode(p.sort) for p in asked.outputs}
        records = Records()
        self.formulas = [decode(c.formula) for c in (*asked.assumptions, *asked.guarantees)]
        formulas = iter(self.formulas)
        self.assumptions = tuple(judged(c.name, next(formulas), c.text, records) for c in asked.assumptions)
        self.guarantees = {c.name: guarantee(c.name, next(formulas), c.text, records) for c in asked.guarantees}
        self.keeper = Keeper(records.cells)
        self.remembers = bool(records.cells)
        root = system_root(asked, folder)
        path = root / asked.subject.file
        self._written = constants(text_or_nothing(path))
        self.generator = self.generating(frozenset(), frozenset())
        names = ("hypothesis", *(f"{asked.system}/{asked.node}/guarantee/{c.name}" for c in asked.guarantees))
        self.subject = SubjectProcess(path, asked.subject.function, SUBJECT_PATIENCE, root, names)
        self._aims = tuple(self._aim(t) for g in self.guarantees.values() for t in g.triggers)
        self._kept = kept_inputs(folder / KEPT, self.inputs_sorts)
        self.replayed = 0
        self.valid = self.edges = self.rejected = self.undecided = 0
        self.crash: tuple[Inputs, str] | None = None
        self.silent = ""
        """Why a second process of the subject's gave no answer, where that says nothing of the subject."""
        self.end: float | None = None
        self._said: list[tuple[Inputs, Any]] = []
        self.tried: list[Inputs] = []
        """Some of the cases that were tried, for others to be steered from."""
        self.repeated = 0
        self.counted = COUNTED
        self.only_after: dict[str, int] = {}
        self.turned: Mapping[str, Sort] = self.inputs_sorts
        """The inputs that may be turned."""
        self.scout = Scout(self.subject.path, self.subject.function, SCOUT_PATIENCE, root)
        self.unsteady: Inputs | None = None
        self.apart: list[tuple[Pairs, str]] = []

    @classmethod
    def load(cls, path: Path) -> Bench:
        """From the generated ``contract.json``. Raises Unreadable."""
        return cls(from_text(Question, path.read_bytes()), path.parent)

    def generating(self, numbers: frozenset[Fraction], texts: frozenset[str]) -> Generator:
        """What makes inputs from the constants of contract, scenario and subject, these among them."""
        known = (self._written[0] | numbers, self._written[1] | texts)
        rows = table_rows(self.asked.scenario, self.inputs_sorts)
        return Generator(self.inputs_sorts, pools(self.formulas, rows, known))

    # -- for the generated test ----------------------------------------------------------------------------------------

    @property
    def inputs(self) -> st.SearchStrategy[Inputs]:
        """Inputs that meet the assumptions, mostly: who draws them rejects the others."""
        text = st.binary(min_size=CASE_BYTES, max_size=CASE_BYTES)
        return text.map(lambda data: self.as_given(self.generator.case(Source(data), self.blamed, self._aims)))

    def as_given(self, inputs: Inputs) -> Inputs:
        return {name: rounded(value) for name, value in inputs.items()} if self.doubles else inputs

    def sent(self, inputs: Inputs) -> dict[str, Any]:
        return sent_inputs(inputs, doubles=self.doubles)

    def hold(self, name: str) -> None:
        """For pytest: nothing that is tried breaks the guarantee. Raises AssertionError, in contract words."""
        if broken := self._broken(name):
            raise AssertionError(broken)

    def run(self, inputs: Inputs) -> dict[str, Value]:
        """The subject's outputs. Raises SubjectFailed."""
        return self.outputs_of(self.subject.ask(self.sent(inputs)))

    def outputs_of(self, reply: Any) -> dict[str, Value]:
        if isinstance(reply, SubjectFailed):
            raise reply
        try:
            return outputs(reply, self.output_sorts)
        except Malformed as error:
            raise SubjectFailed(str(error)) from error
        except (ValueError, TypeError, KeyError, RecursionError) as error:
            raise SubjectFailed("the subject's answer cannot be read") from error

    # -- for Avow ------------------------------------------------------------------------------------------------------

    def main(self) -> int:
        """``python test_….py CHANNEL SECONDS SEED``: all guarantees, and the counts, for whoever holds the channel.
        Without these, for people: each guarantee in a line, and code 1 where one is broken."""
        if len(sys.argv) == 1:
            return self._told()
        channel, seconds, self.seed = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
        os.set_inheritable(channel, False)
        adopt_orphans()
        self.end = time.monotonic() + seconds
        self.subject.patience = min(SUBJECT_PATIENCE, max(1.0, seconds / 4))
        self.scout.patience = min(SCOUT_PATIENCE, self.subject.patience / 4)
        try:
            stopped = self._sweep()
            self.scout.close()
            failed = {name: self._shrunk(name) for name, g in self.guarantees.items() if g.failure is not None}
            smaller = {name: case for name, case in failed.items() if case is not None}
            self.only_after = steer.only_after(self, smaller)
            if self.crash is not None and not self.subject.fault:
                self.crash = self._shrunk_crash()
            elif not self.subject.fault:
                try:
                    self.unsteady = self.unsteady or self._asked_again()
                except OutOfTime:  # whether it answers the same is not known
                    stopped = stopped or "again"
                self.apart = self._asked_apart() if self.doubles else []
        finally:
            fault = self.subject.close()
        judge.say(channel, replace(self._report(stopped, smaller), fault=fault))
        return 0

    def _told(self) -> int:
        """What the generated tests find, guarantee by guarantee; the same cases as pytest would try."""
        try:
            found = {name: self._broken(name) for name in self.guarantees}
        finally:
            fault = self.subject.close()
        for name, broken in found.items():
            print(broken or f"{name}: no case breaks it")
        if fault:
            print(fault)
        return 1 if fault or any(found.values()) else 0

    def _broken(self, name: str) -> str:
        """What breaks the guarantee, with all that it takes to see it again; empty where nothing does."""

        @seed(self.seed)
        @configuration(self, tuple(Phase))
        @given(self.inputs)
        def every(inputs: Inputs) -> None:
            assume(self.assumed(inputs))
            try:
                found = self.run(inputs)
            except SubjectFailed as error:
                raise AssertionError(f"{name}: {error}, of {told(inputs, {})}") from error
            held = self.guarantees[name].judged.holds(self.values_of(inputs, found))
            if not held:
                what = "is broken:" if held is False else "cannot be judged of"
                raise AssertionError(f"{name} {what} {told(inputs, found)}")

        try:
            every()
        except AssertionError as broken:
            return str(broken)
        except (Flaky, Unsatisfiable, FailedHealthCheck) as fault:
            return f"{name}: {fault}"
        return ""

    def _sweep(self) -> str:
        """One pass for all guarantees; why it stopped early, if it did."""
        queue: list[Inputs] = []

        @seed(self.seed)
        @configuration(self, (Phase.generate,))
        @given(self.inputs)
        def every(inputs: Inputs) -> None:
            self._in_time()
            if not self.assumed(inputs):
                self.rejected += 1
                assume(False)
            queue.append(inputs)
            if len(self.tried) < AFTER_COUNTING:
                self.tried.append(inputs)
            if len(queue) == BATCH:
                cases = queue[:]
                queue.clear()
                self._try(cases)

        try:
            self._replay()
            steer.learn(self)
            self._edges()
            every()
            if queue:
                self._try(queue)
            steer.steer(self)
        except OutOfTime:
            return "time"
        except _Enough:
            return "enough"
        except (Unsatisfiable, FailedHealthCheck):
            return "assumptions"
        except Impossible as error:
            return f"no values: {error}"
        return ""

    def _replay(self) -> None:
        """What refuted a guarantee once, before all else, however few cases are wanted."""
        cases = [inputs for inputs in map(self.as_given, self._kept) if self.assumed(inputs)]
        self.replayed = len(cases)
        for case in cases:
            self._try([case], edge=True)
        self.edges -= len(cases)

    def _edges(self) -> None:
        """The cases at thresholds, before any is drawn."""
        made = map(self.as_given, self.generator.edges(self.blamed))
        cases = [inputs for inputs in made if self.assumed(inputs)]
        self.tried += cases[:: max(1, len(cases) // TRIED)][:TRIED]
        most = min(len(cases), max(2 * self.cases, EDGES))
        third = time.monotonic() + (self.end - time.monotonic()) / 3 if self.end is not None else inf
        for at in range(0, most, BATCH):
            if at < 2 * self.cases or time.monotonic() < third:  # where judging is slow, cases are still to be drawn
                self._try(cases[at : min(at + BATCH, most)], edge=True)

    def _try(self, cases: list[Inputs], edge: bool = False) -> None:
        """Ask the subject, and judge each guarantee of each answer."""
        for inputs, reply in zip(cases, self.subject.ask_all([*map(self.sent, cases)]), strict=False):
            if len(self._said) < ASKED_AGAIN:
                self._said.append((inputs, reply))
            self._in_time()
            self.valid += not edge
            self.edges += edge
            self._answered(inputs, reply, edge)

    def _answered(self, inputs: Inputs, reply: Any, edge: bool) -> None:
        try:
            found = self.outputs_of(reply)
        except SubjectFailed as error:
            self.crash = (inputs, str(error))
            raise _Enough from error
        self._judge(inputs, found, edge)
        if all(g.failure is not None for g in self.guarantees.values()):
            raise _Enough

    # -- looked at -----------------------------------------------------------------------------------------------------

    def starts(self) -> list[list[Inputs]]:
        """What is asked before the cases that are steered to; of a function nothing."""
        return [[]]

    def allowed(self, inputs: Inputs) -> bool:
        """Whether a case that is steered to may be tried."""
        return self.meets(inputs) is True

    def looked(self, start: list[Inputs], cases: Sequence[Inputs], *, on: bool = False) -> list[tuple[Sight, ...]]:
        """What the subject compares of each of some cases, which come after `start`; with `on` one after the other."""
        self._in_time()
        return self.scout.sights([self.sent(inputs) for inputs in cases])

    def tried_at(self, start: list[Inputs], cases: list[Inputs]) -> None:
        for at in range(0, len(cases), BATCH):
            self._try(cases[at : at + BATCH], edge=True)

    def repeat(self, start: list[Inputs], inputs: Inputs, times: int) -> None:
        """The same again and again; judged where the answer changes. Then others, once more."""
        before: Any = None
        for _ in range(0, times, BATCH):
            self._in_time()
            for reply in self.subject.ask_all([self.sent(inputs)] * BATCH):
                self.repeated += 1
                if reply != before:
                    self._answered(inputs, reply, edge=True)
                before = reply
        self.tried_at(start, self.tried[:AFTER_COUNTING])

    def _asked_again(self) -> Inputs | None:
        """The first inputs to which another process, asked the same from its start, gives another answer: what comes of
        clock, chance or place in memory is no function of what was recorded. The first cases only."""
        with self.twin() as twin:
            for at in range(0, len(self._said), BATCH):
                self._in_time()
                before = self._said[at : at + BATCH]
                again = twin.ask_all([self.sent(inputs) for inputs, _ in before])
                for (inputs, reply), other in zip(before, again, strict=False):
                    if other != reply and self._differ(reply, other):
                        return inputs
                if len(again) < len(before):
                    return before[len(again)][0]
        return None

    @contextlib.contextmanager
    def twin(self) -> Iterator[SubjectProcess]:
        """Another process of the subject's."""
        first = self.subject
        twin = SubjectProcess(first.path, first.function, first.patience, first.root, first.names)
        try:
            yield twin
        finally:
            twin.close()
            first.fault = first.fault or twin.fault
            self.silent = self.silent or twin.silent

    def _asked_apart(self) -> list[tuple[Pairs, str]]:
        """Each REAL input in its turn is what no REAL is, or the negative zero, beside a few cases' other inputs."""
        found: dict[str, tuple[Pairs, str]] = {}
        with self.twin() as twin:
            for inputs, _ in self._said[:: max(1, len(self._said) // APART)][:APART]:
                for name, (word, text) in itertools.product(inputs, SPECIAL.items()):
                    if isinstance(self.inputs_sorts[name], RealSort) and (self.end or inf) > time.monotonic():
                        asked = {**inputs, name: Fraction(0)}
                        why = self._wrong_apart(twin, asked, name, text) if self.assumed(asked) else ""
                        found.setdefault(why, (asked_with(asked, name, word), why))
        return [one for why, one in found.items() if why]

    def _wrong_apart(self, twin: SubjectProcess, asked: Inputs, name: str, text: str) -> str:
        """Of an input that has no value no guarantee that speaks of it can be judged; the negative zero is zero."""
        try:
            values = self.values_of(asked, self.outputs_of(twin.ask({**self.sent(asked), name: {"r": text}})))
        except SubjectFailed as error:
            return str(error)
        zero = text == SPECIAL["-0"]
        about = [g for g in self.guarantees.values() if zero or name not in g.judged.ports]
        return "; ".join(f"{g.judged.name} is broken" for g in about if g.judged.holds(values) is False)

    def _differ(self, one: Any, other: Any) -> bool:
        try:
            return self.outputs_of(one) != self.outputs_of(other)
        except SubjectFailed:
            return True

    def _in_time(self) -> None:
        if self.end is not None and time.monotonic() > self.end:
            raise OutOfTime

    def _judge(self, inputs: Inputs, found: dict[str, Value], edge: bool) -> None:
        values = self.values_of(inputs, found)
        for each in self.guarantees.values():
            hits = each.edge_hits if edge else each.hits
            for k, trigger in enumerate(each.triggers):
                hits[k] += trigger.whole.holds(values) is True
            if each.failure is not None:
                continue
            held = each.judged.holds(values)
            if held is None:
                each.undecided += 1
            elif not held:
                each.failure = (inputs, found)

    def _shrunk(self, name: str) -> Case | None:
        """The simplest case that breaks a guarantee, as far as Hypothesis finds it in time; None where it is none in
        another process."""
        each = self.guarantees[name]
        assert each.failure is not None

        def broken(inputs: Inputs) -> Case | None:
            try:
                found = self.run(inputs)
            except SubjectFailed:
                return None
            return (inputs, found) if each.judged.holds(self.values_of(inputs, found)) is False else None

        return smallest(self, each.failure, broken)

    def _shrunk_crash(self) -> tuple[Inputs, str]:
        assert self.crash is not None
        said = [self.crash[1]]

        def broken(inputs: Inputs) -> Case | None:
            try:
                self.run(inputs)
            except SubjectFailed as error:
                said[0] = str(error)
                return (inputs, {})
            return None

        if self.subject.silent:  # each further try would cost the whole patience
            return self.crash
        inputs, _ = smallest(self, (self.crash[0], {}), broken)
        return inputs, said[0]

    def _report(self, stopped: str, smaller: Mapping[str, Case]) -> Answer:
        return Answer(
            valid=self.valid,
            edges=self.edges,
            replayed=self.replayed,
            repeated=self.repeated,
            rejected=self.rejected,
            undecided=self.undecided,
            wanted=self.cases,
            stopped=stopped,
            left_out=self.asked.left_out,
            observed=self.subject.observed(),
            isolation=self.subject.isolation,
            apart=tuple(self.apart),
            unsteady=pairs(self.unsteady, {}) if self.unsteady is not None else None,
            silent=self.silent or self.subject.silent,
            crash=(pairs(self.crash[0], {}), self.crash[1]) if self.crash else None,
            crash_trace=None,
            runs=None,
            guarantees={name: self._tried(name, smaller.get(name)) for name in self.guarantees},
        )

    def _tried(self, name: str, smaller: Case | None) -> Tried:
        each = self.guarantees[name]
        counts = zip(each.triggers, each.hits, each.edge_hits, each.run_hits, strict=True)
        found = Tried(tuple(Met(t.whole.text, *met) for t, *met in counts), each.undecided)
        if smaller is None:
            return found
        asked = self.only_after.get(name, 0)
        return replace(found, failure=pairs(*smaller), case=sent_inputs(smaller[0]), asked=asked)

    # -- assumptions ---------------------------------------------------------------------------------------------------

    def assumed(self, inputs: Inputs) -> bool:
        met = self.meets(inputs)
        self.undecided += met is None
        return met is True

    def meets(self, inputs: Inputs) -> bool | None:
        """Whether the inputs meet the assumptions; None where it cannot be told."""
        values = self.values_of(inputs, {})
        unknown = False
        for assumption in self.assumptions:
            held = assumption.holds(values)
            if held is False:
                return False  # whatever cannot be told of the others
            unknown = unknown or held is None
        return None if unknown else True

    def blamed(self, inputs: Inputs) -> tuple[str, ...] | None:
        return blamed(self.assumptions, self.values_of(inputs, {}))

    def values_of(self, inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
        """What a step's formulas are judged of."""
        return self.keeper.at(valuation(inputs, found))

    def _aim(self, trigger: Trigger) -> Failing:
        """What to draw again for a trigger to be met; parts that speak of outputs cannot be aimed at."""

        def failing(inputs: Inputs) -> tuple[str, ...] | None:
            return blamed(trigger.parts, self.values_of(inputs, {}))

        return failing


class _Enough(BaseException):
    """Nothing more can be learnt."""
