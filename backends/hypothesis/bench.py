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
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from fractions import Fraction
from math import inf
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, assume, given, seed, settings
from hypothesis import strategies as st
from hypothesis.errors import FailedHealthCheck, Flaky, Unsatisfiable
from hypothesis.internal.conjecture import providers

from avow.base.codec import from_text
from avow.base.files import text_or_nothing
from avow.base.process import adopt_orphans
from avow.evaluation.running import Keeper
from avow.formulas.temporal.cells import Records
from avow.formulas.values import Value, show
from avow.isolation import judge
from avow.isolation.subject import SubjectFailed, SubjectProcess
from avow.language.sorts import RealSort, Sort
from avow.tuning.running import SUBJECT_PATIENCE

from . import wire
from .beside import kept_inputs, system_root, table_rows
from .convention import Malformed, outputs, sent
from .exchange import Answer, Met, Pairs, Question, Tried
from .export import KEPT
from .generate import Failing, Generator, Impossible, Inputs, Source
from .judging import Trigger, blamed, guarantee, judged
from .machine import EXACT, SPECIAL, as_double, rounded
from .pools import constants, pools
from .tuning import APART, ASKED_AGAIN, BATCH, CASE_BYTES, SHRINKING_SECONDS

# Hypothesis looks for constants in the source of all modules that it takes for the user's. Here these are Avow's own,
# and only where it is not installed as a package: slow, of no use, and the same seed would draw other cases elsewhere.
if hasattr(providers, "is_local_module_file"):
    providers.is_local_module_file = lambda path: False


Case = tuple[Inputs, dict[str, Value]]
Apart = tuple[Pairs, str]
"""A case with an input that is no REAL, or the negative zero, in words, and what was wrong with the answer."""


class OutOfTime(BaseException):
    """The time for the whole is over; Hypothesis passes this through."""


class Bench:
    """One node's contract, a subject, and the counts of what was tried."""

    def __init__(self, asked: Question, folder: Path) -> None:
        self.asked = asked
        self.cases = asked.cases
        self.seed = asked.seed
        self.doubles = asked.numbers != EXACT
        self.inputs_sorts: dict[str, Sort] = {p.name: wire.decode(p.sort) for p in asked.inputs}
        self.output_sorts: dict[str, Sort] = {p.name: wire.decode(p.sort) for p in asked.outputs}
        records = Records()
        self.formulas = [wire.decode(c.formula) for c in (*asked.assumptions, *asked.guarantees)]
        assumed, promised = self.formulas[: len(asked.assumptions)], self.formulas[len(asked.assumptions) :]
        self.assumptions = tuple(
            judged(c.name, formula, c.text, records) for c, formula in zip(asked.assumptions, assumed, strict=True)
        )
        self.guarantees = {
            c.name: guarantee(c.name, formula, c.text, records)
            for c, formula in zip(asked.guarantees, promised, strict=True)
        }
        self.keeper = Keeper(records.cells)
        self.remembers = bool(records.cells)
        root = system_root(asked, folder)
        path = root / asked.subject.file
        rows = table_rows(asked.scenario, self.inputs_sorts)
        self.generator = Generator(self.inputs_sorts, pools(self.formulas, rows, constants(text_or_nothing(path))))
        self.subject = SubjectProcess(path, asked.subject.function, SUBJECT_PATIENCE, root)
        self._aims = tuple(self._aim(t) for g in self.guarantees.values() for t in g.triggers)
        self._kept = kept_inputs(folder / KEPT, self.inputs_sorts)
        self.replayed = 0
        self.valid = self.edges = self.rejected = self.undecided = 0
        self.crash: tuple[Inputs, str] | None = None
        self.silent = ""
        """Why a second process of the subject's gave no answer, where that says nothing of the subject."""
        self.end: float | None = None
        self._said: list[tuple[Inputs, Any]] = []
        self.unsteady: Inputs | None = None
        self.apart: list[Apart] = []

    @classmethod
    def load(cls, path: Path) -> Bench:
        """From the generated ``contract.json``. Raises Unreadable."""
        return cls(from_text(Question, path.read_bytes()), path.parent)

    # -- for the generated test ----------------------------------------------------------------------------------------

    @property
    def inputs(self) -> st.SearchStrategy[Inputs]:
        """Inputs that meet the assumptions, mostly: `check` rejects the others."""

        text = st.binary(min_size=CASE_BYTES, max_size=CASE_BYTES)
        return text.map(lambda data: self._given(self.generator.case(Source(data), self._blamed, self._aims)))

    def _given(self, inputs: Inputs) -> Inputs:
        return {name: rounded(value) for name, value in inputs.items()} if self.doubles else inputs

    def _sent(self, inputs: Inputs) -> dict[str, Any]:
        return as_double(_sent(inputs)) if self.doubles else _sent(inputs)

    def configured(self, test: Callable[..., None]) -> Callable[..., None]:
        """As many cases as the plan wants, from the plan's seed, without Hypothesis' own database or deadline."""
        return seed(self.seed)(self._configuration(tuple(Phase))(test))

    def check(self, name: str, inputs: Inputs) -> None:
        """The guarantee holds of what the subject makes of the inputs. Raises AssertionError, in contract words."""
        assume(self._assumed(inputs))
        found = self.run(inputs)
        held = self.guarantees[name].judged.holds(self._values(inputs, found))
        if held is None:
            raise AssertionError(f"{name} cannot be judged of {told(inputs, found)}")
        if not held:
            raise AssertionError(f"{name} is broken: {told(inputs, found)}")

    def run(self, inputs: Inputs) -> dict[str, Value]:
        """The subject's outputs. Raises SubjectFailed."""
        return self._outputs(self.subject.ask(self._sent(inputs)))

    def _outputs(self, reply: Any) -> dict[str, Value]:
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
        try:
            stopped = self._sweep()
            failed = {name: self._shrunk(name) for name, g in self.guarantees.items() if g.failure is not None}
            smaller = {name: case for name, case in failed.items() if case is not None}
            if self.crash is not None and not self.subject.fault:
                self.crash = self._shrunk_crash()
            elif not self.subject.fault:
                self.unsteady = self.unsteady or self._asked_again()
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
        @self.configured
        @given(self.inputs)
        def every(inputs: Inputs) -> None:
            self.check(name, inputs)

        try:
            every()
        except (AssertionError, SubjectFailed, Unsatisfiable, FailedHealthCheck) as fault:
            return f"{name}: {fault}"
        return ""

    def _sweep(self) -> str:
        """One pass for all guarantees; why it stopped early, if it did."""
        queue: list[Inputs] = []

        @seed(self.seed)
        @self._configuration((Phase.generate,))
        @given(self.inputs)
        def every(inputs: Inputs) -> None:
            self._in_time()
            if not self._assumed(inputs):
                self.rejected += 1
                assume(False)
            queue.append(inputs)
            if len(queue) == BATCH:
                cases = queue[:]
                queue.clear()
                self._try(cases)

        try:
            self._replay()
            self._edges()
            every()
            if queue:
                self._try(queue)
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
        cases = [inputs for inputs in map(self._given, self._kept) if self._assumed(inputs)]
        self.replayed = len(cases)
        for case in cases:
            self._try([case], edge=True)
        self.edges -= len(cases)

    def _edges(self) -> None:
        """The cases at thresholds, before any is drawn; no more than twice as many."""
        made = map(self._given, self.generator.edges(self._blamed))
        cases = [inputs for inputs in made if self._assumed(inputs)]
        most = min(len(cases), 2 * self.cases)
        for at in range(0, most, BATCH):
            self._try(cases[at : min(at + BATCH, most)], edge=True)

    def _try(self, cases: list[Inputs], edge: bool = False) -> None:
        """Ask the subject, and judge each guarantee of each answer."""
        for inputs, reply in zip(cases, self.subject.ask_all([*map(self._sent, cases)]), strict=False):
            if len(self._said) < ASKED_AGAIN:
                self._said.append((inputs, reply))
            self._in_time()
            try:
                found = self._outputs(reply)
            except SubjectFailed as error:
                self.crash = (inputs, str(error))
                raise _Enough from error
            self.valid += not edge
            self.edges += edge
            self._judge(inputs, found, edge)
            if all(g.failure is not None for g in self.guarantees.values()):
                raise _Enough

    def _asked_again(self) -> Inputs | None:
        """The first inputs to which another process, asked the same from its start, gives another answer: what comes of
        clock, chance or place in memory is no function of what was recorded. The first cases only."""
        with self._twin() as twin:
            for at in range(0, len(self._said), BATCH):
                if self.end is not None and time.monotonic() > self.end:
                    break
                before = self._said[at : at + BATCH]
                again = twin.ask_all([self._sent(inputs) for inputs, _ in before])
                for (inputs, reply), other in zip(before, again, strict=False):
                    if other != reply and self._differ(reply, other):
                        return inputs
                if len(again) < len(before):
                    return before[len(again)][0]
        return None

    @contextlib.contextmanager
    def _twin(self) -> Iterator[SubjectProcess]:
        """Another process of the subject's."""
        twin = SubjectProcess(self.subject.path, self.subject.function, self.subject.patience, self.subject.root)
        try:
            yield twin
        finally:
            twin.close()
            self.silent = self.silent or twin.silent

    def _asked_apart(self) -> list[Apart]:
        """Each REAL input in its turn is what no REAL is, or the negative zero, beside a few cases' other inputs."""
        found: dict[str, Apart] = {}
        with self._twin() as twin:
            for inputs, _ in self._said[:: max(1, len(self._said) // APART)][:APART]:
                for name, (word, text) in itertools.product(inputs, SPECIAL.items()):
                    if isinstance(self.inputs_sorts[name], RealSort) and (self.end or inf) > time.monotonic():
                        asked = {**inputs, name: Fraction(0)}
                        why = self._wrong_apart(twin, asked, name, text) if self._assumed(asked) else ""
                        found.setdefault(why, (_with(asked, name, word), why))
        return [one for why, one in found.items() if why]

    def _wrong_apart(self, twin: SubjectProcess, asked: Inputs, name: str, text: str) -> str:
        """Of an input that has no value no guarantee that speaks of it can be judged; the negative zero is zero."""
        try:
            values = self._values(asked, self._outputs(twin.ask({**self._sent(asked), name: {"r": text}})))
        except SubjectFailed as error:
            return str(error)
        zero = text == SPECIAL["-0"]
        about = [g for g in self.guarantees.values() if zero or name not in g.judged.ports]
        return "; ".join(f"{g.judged.name} is broken" for g in about if g.judged.holds(values) is False)

    def _differ(self, one: Any, other: Any) -> bool:
        try:
            return self._outputs(one) != self._outputs(other)
        except SubjectFailed:
            return True

    def _in_time(self) -> None:
        if self.end is not None and time.monotonic() > self.end:
            raise OutOfTime

    def _judge(self, inputs: Inputs, found: dict[str, Value], edge: bool) -> None:
        values = self._values(inputs, found)
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
            return (inputs, found) if each.judged.holds(self._values(inputs, found)) is False else None

        return self._smallest(each.failure, broken)

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
        inputs, _ = self._smallest((self.crash[0], {}), broken)
        return inputs, said[0]

    def _smallest(self, first: Case, broken: Callable[[Inputs], Case | None]) -> Case:
        best = [first]
        limit = min(self.end or float("inf"), time.monotonic() + SHRINKING_SECONDS)

        @seed(self.seed)
        @self._configuration((Phase.generate, Phase.shrink))
        @given(self.inputs)
        def one(inputs: Inputs) -> None:
            if time.monotonic() > limit:
                raise OutOfTime
            assume(self._assumed(inputs))
            case = broken(inputs)
            if case is not None:
                best[0] = min(best[0], case, key=lambda c: (len(told(*c)), told(*c)))
                raise _Broken

        with contextlib.suppress(_Broken, OutOfTime, Flaky, Unsatisfiable, FailedHealthCheck):
            one()
        return best[0]

    def _report(self, stopped: str, smaller: Mapping[str, Case]) -> Answer:
        return Answer(
            valid=self.valid,
            edges=self.edges,
            replayed=self.replayed,
            rejected=self.rejected,
            undecided=self.undecided,
            wanted=self.cases,
            stopped=stopped,
            left_out=self.asked.left_out,
            observed=self.subject.observed(),
            isolation=self.subject.isolation,
            apart=tuple(self.apart),
            unsteady=_pairs(self.unsteady, {}) if self.unsteady is not None else None,
            silent=self.silent or self.subject.silent,
            crash=(_pairs(self.crash[0], {}), self.crash[1]) if self.crash else None,
            crash_trace=None,
            runs=None,
            guarantees={name: self._tried(name, smaller.get(name)) for name in self.guarantees},
        )

    def _tried(self, name: str, smaller: Case | None) -> Tried:
        each = self.guarantees[name]
        counts = zip(each.triggers, each.hits, each.edge_hits, each.run_hits, strict=True)
        found = Tried(tuple(Met(t.whole.text, *met) for t, *met in counts), each.undecided)
        return replace(found, failure=_pairs(*smaller), case=_sent(smaller[0])) if smaller is not None else found

    # -- assumptions ---------------------------------------------------------------------------------------------------

    def _assumed(self, inputs: Inputs) -> bool:
        values = self._values(inputs, {})
        unknown = False
        for assumption in self.assumptions:
            held = assumption.holds(values)
            if held is False:
                return False  # whatever cannot be told of the others
            unknown = unknown or held is None
        self.undecided += unknown
        return not unknown

    def _blamed(self, inputs: Inputs) -> tuple[str, ...] | None:
        return blamed(self.assumptions, self._values(inputs, {}))

    def _values(self, inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
        """What a step's formulas are judged of."""
        return self.keeper.at(valuation(inputs, found))

    def _aim(self, trigger: Trigger) -> Failing:
        """What to draw again for a trigger to be met; parts that speak of outputs cannot be aimed at."""

        def failing(inputs: Inputs) -> tuple[str, ...] | None:
            return blamed(trigger.parts, self._values(inputs, {}))

        return failing

    def _configuration(self, phases: tuple[Phase, ...]) -> settings:
        return settings(
            max_examples=self.cases,
            database=None,
            deadline=None,
            derandomize=False,
            phases=phases,
            report_multiple_bugs=False,
            print_blob=False,
            suppress_health_check=list(HealthCheck),
        )


class _Enough(BaseException):
    """Nothing more can be learnt."""


class _Broken(Exception):  # noqa: N818 - it is what Hypothesis shrinks
    """The guarantee that is looked at fails."""


def valuation(inputs: Inputs, found: Mapping[str, Value]) -> dict[str, Value]:
    """Qualified names to values."""
    return {f"in.{n}": v for n, v in inputs.items()} | {f"out.{n}": v for n, v in found.items()}


def told(inputs: Inputs, found: Mapping[str, Value]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in _pairs(inputs, found))


def _pairs(inputs: Inputs, found: Mapping[str, Value]) -> Pairs:
    return tuple((name, show(value)) for name, value in valuation(inputs, found).items())


def _with(inputs: Inputs, name: str, word: str) -> Pairs:
    """The inputs, of which one is what the word says."""
    return tuple((n, word if n == f"in.{name}" else value) for n, value in _pairs(inputs, {}))


def _sent(inputs: Inputs) -> dict[str, Any]:
    return {name: sent(value) for name, value in inputs.items()}
