"""Runs a generated test as Avow does: under Hypothesis, with the unit under test in a process of its own.

The test's import finds a stand-in, which calls that process; the test's own strategies, assumptions and steps decide
the inputs. Each case is judged by exact evaluation (and Z3 if that cannot answer), for every guarantee and condition at
once; the test's assertions on the same case have to agree. If a guarantee fails, Hypothesis runs the test again to find
the simplest case.
"""

from __future__ import annotations

import contextlib
import itertools
import os
import pickle
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from hypothesis import HealthCheck, Phase, given, reject, seed, settings, target
from hypothesis.errors import FailedHealthCheck, Flaky, Unsatisfiable, UnsatisfiedAssumption
from hypothesis.internal.conjecture import providers
from hypothesis.stateful import get_state_machine_test

from avow.base.process import Stopwatch, adopt_orphans
from avow.base.tuning.running import SUBJECT_PATIENCE
from avow.evaluation.running import Keeper
from avow.formulas.temporal.cells import Records
from avow.formulas.values import Value
from avow.isolation import judge
from avow.isolation.subject import SubjectFailed
from avow.language.sorts import FunctionSort, RealSort, Sort

from . import tuning
from .convention import (
    EXACT,
    SPECIAL,
    Case,
    Inputs,
    Malformed,
    as_plain,
    as_value,
    asked_with,
    pairs,
    received,
    sent,
    told,
    valuation,
)
from .exchange import QUESTION, Answer, Met, Pairs, Question, Tried
from .export import MACHINE
from .generated import loaded, observed
from .judging import guarantee, judged
from .tuning import APART, BATCH, REJECTED_CASES, SHRINKING_SECONDS
from .unit import Unit

# Hypothesis looks for constants in the source of all modules that it takes for the user's. Here these are Avow's own,
# and only if it is not installed as a package: slow, useless, and the same seed would draw other cases elsewhere.
setattr(providers, "is_local_module_file", lambda path: False)  # noqa: B010 - it is not exported

Trace = list[Case]


class _Stop(BaseException):
    """The cases end early; the text is the reason. Hypothesis passes it through, or raises `Flaky` instead."""


class _Broken(Exception):  # noqa: N818 - it is what Hypothesis shrinks
    """The guarantee (or crash) that is being simplified fails here."""


def main() -> None:
    """``run.py CHANNEL SECONDS SEED``, in a folder with the test and the pickled request."""
    channel, seconds, start = int(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
    os.set_inheritable(channel, False)
    adopt_orphans()
    judge.say(channel, Bench(pickle.loads(Path(QUESTION).read_bytes()), seconds, start).answer())


class Bench:
    """One node's contract, a unit under test, and the counts of the cases tried."""

    def __init__(self, asked: Question, seconds: float, start: int) -> None:
        self.asked, self.seed = asked, start
        self.spent, self.end = Stopwatch(), seconds
        self.inputs = {p.name: p.sort for p in asked.inputs}
        self.outputs = {p.name: p.sort for p in asked.outputs}
        self.doubles = asked.numbers != EXACT
        records = Records()
        self.assumptions = tuple(judged(c.name, c.formula, records) for c in asked.assumptions)
        self.begins = tuple(judged(c.name, c.formula, records) for c in asked.begins)
        self.guarantees = {c.name: guarantee(c.name, c.formula, records) for c in asked.guarantees}
        self.keeper = Keeper(records.cells)
        self.runs_counted = bool(records.cells)
        self.unit = Unit(asked, min(SUBJECT_PATIENCE, max(1.0, seconds / 4)))
        self.valid = self.rejected = self.undecided = self.replayed = self.runs = 0
        self.traces: dict[str, Trace] = {}
        """Guarantee → a run up to the step that violates it; for a function, its one step."""
        self.trace: Trace = []
        self.crash: str = ""
        self.crash_trace: Trace = []
        self.silent = self.differs = ""
        self.unsteady: Inputs | None = None
        self.shrinking: str | None = None
        """The guarantee whose failure is being simplified; empty: the crash; None while cases are counted."""
        self.simplified: set[str] = set()
        self._why: str | None = None
        """Why the cases ended early, if they did."""
        self._over = False
        """Whether the run is over: a state machine does not continue after a failed assertion."""
        self.memory: dict[str, Value] = {}
        self._drawn: Inputs = {}
        self.found: dict[str, Value] | None = None
        self._starts: list[Inputs] = []
        self._hits: dict[str, list[int]] = {}
        self._tables: dict[int, tuple[Any, Value]] = {}
        self._module = loaded(self)
        self._runs = hasattr(self._module, MACHINE)

    # -- the generated test ------------------------------------------------------------------------------

    def outputs_here(self, found: Mapping[str, Value]) -> dict[str, Any]:
        """Outputs as the generated test has them."""
        table = getattr(self._module, "Table", None)
        return {name: as_plain(value, table) for name, value in found.items()}

    def ask_here(self) -> dict[str, Value]:
        """The unit's outputs for the drawn inputs, if these certainly satisfy the assumptions."""
        if not self._assumed(self._drawn):
            reject()
        self.found = self.unit.advance(self._drawn)
        return self.found

    def _run_test(self, phases: tuple[Phase, ...]) -> None:
        """The generated test's cases, each judged by `case`."""
        chosen = settings(
            max_examples=tuning.MORE_CASES * self.asked.cases,
            stateful_step_count=self.asked.length,
            phases=phases,
            database=None,  # Avow's ledger keeps what refuted
            deadline=None,
            print_blob=False,
            report_multiple_bugs=False,
            suppress_health_check=list(HealthCheck),
        )
        machine = getattr(self._module, MACHINE, None)
        if machine is not None:
            seed(self.seed)(get_state_machine_test(observed(machine, self), settings=chosen))()
            return
        (test,) = (made for name, made in vars(self._module).items() if name.startswith("test_"))

        def one(*nothing: Any, **drawn: Any) -> None:
            self.begin()
            self.case(drawn, lambda: test.hypothesis.inner_test(*nothing, **drawn))
            if self.found is None:
                reject()

        seed(self.seed)(chosen(given(**test.hypothesis._given_kwargs)(one)))()

    def begin(self) -> None:
        """A run begins."""
        self._end_run()
        self.trace, self._over = [], False
        self.keeper.restart()
        self._hits = {name: list(g.hits) for name, g in self.guarantees.items()}
        if self.asked.subject.driven:
            try:
                self.memory = self.unit.begin()
            except SubjectFailed as error:
                self._crashed(str(error), [])
            if any(begun.holds(valuation(self.memory, {})) is False for begun in self.begins):
                self._crashed("__init__ leaves other values than the plan's `initial` ones", [(self.memory, {})])

    def _end_run(self) -> None:
        if self.trace and self.shrinking is None:
            self.runs += 1
            for name, each in self.guarantees.items():
                before = self._hits.get(name, each.hits)
                each.run_hits = [n + (now > was) for n, now, was in zip(each.run_hits, each.hits, before, strict=True)]

    def case(self, drawn: Mapping[str, Any], test: Callable[[], None]) -> None:
        """One case, or one step of a run: the test is called, and the result is judged."""
        if self._over:
            return
        if self.spent() > self.end:
            raise self._stop("time")
        if self.shrinking is None and self.valid >= self.asked.cases and self._all_met():
            raise self._stop()
        self.found = None
        complaint = ""
        try:
            names = self.asked.names
            self._drawn = self.memory | {
                port: self._value(drawn[names[port]], sort)
                for port, sort in self.inputs.items()
                if names[port] in drawn
            }
            test()
        except UnsatisfiedAssumption:
            pass
        except SubjectFailed as error:
            self._crashed(str(error), [*self.trace, (self._drawn, {})])
        except Exception as error:  # any exception of the test's own lines counts as a complaint
            complaint = str(error) or type(error).__name__
        if self.found is None:
            self.rejected += self.shrinking is None
            if self.rejected > REJECTED_CASES * max(self.valid, 50):
                raise self._stop("assumptions")
            return
        self._judge(self._drawn, self.found, complaint)

    def _stop(self, why: str = "") -> _Stop:
        self._why = why
        return _Stop(why)

    def _value(self, given: Any, sort: Sort) -> Value:
        """The contract's value; a large table of the scenario comes in half of the cases."""
        if not isinstance(sort, FunctionSort):
            return as_value(given, sort)
        if id(given) not in self._tables:
            self._tables[id(given)] = (given, as_value(given, sort))
        return self._tables[id(given)][1]

    def _all_met(self) -> bool:
        """Whether each condition was met, or too many cases were tried."""
        unmet = any(0 in each.hits for each in self.guarantees.values())
        return not unmet or self.valid >= tuning.MORE_CASES * self.asked.cases

    def _judge(self, inputs: Inputs, found: dict[str, Value], complaint: str) -> None:
        values = self.keeper.at(valuation(inputs, found))
        self.trace.append((inputs, found))
        self.keeper.advance(valuation(inputs, found))
        self.memory = self.unit.memory(found)
        if self.shrinking is not None:
            broken = [name for name, each in self.guarantees.items() if each.judged.holds(values) is False]
            for name in broken:  # a simpler case may violate others, which no case violated before
                if name not in self.simplified:
                    self.traces.setdefault(name, list(self.trace))
            if self.shrinking in broken:
                self.traces[self.shrinking] = list(self.trace)
                raise _Broken
            return
        self.valid += 1
        self._over = self._runs and bool(complaint)
        if len(self.trace) == 1 and len(self._starts) < APART:
            self._starts.append(inputs)
        held = {name: g.judged.holds(values) for name, g in self.guarantees.items()}
        for name, each in self.guarantees.items():
            for k, trigger in enumerate(each.triggers):
                each.hits[k] += trigger.holds(values) is True
                if not each.hits[k] and each.parts[k] and not self._runs:
                    target(sum(part.holds(values) is True for part in each.parts[k]), label=f"{name} {k}")
            each.undecided += held[name] is None
            if held[name] is False:
                self.traces.setdefault(name, list(self.trace))
        asserted = [held[name] for name in held if name not in self.asked.untranslated]
        if None not in asserted and bool(complaint) is not (False in asserted):
            self.differs = self.differs or f"{told(inputs, found)}: {complaint or 'it asserts nothing against it'}"
        if len(self.traces) == len(self.guarantees):
            raise self._stop()

    def _crashed(self, why: str, trace: Trace) -> None:
        if self.shrinking:
            reject()
        self.crash, self.crash_trace = why, trace
        raise _Broken if self.shrinking == "" else self._stop("crash")

    # -- judging -----------------------------------------------------------------------------------------

    def _assumed(self, inputs: Inputs) -> bool:
        values = self.keeper.at(valuation(inputs, {}))
        held = [assumption.holds(values) for assumption in self.assumptions]
        self.undecided += None in held and False not in held
        return all(one is True for one in held)

    # -- results -----------------------------------------------------------------------------------------

    def answer(self) -> Answer:
        stopped, apart = "", list[tuple[Pairs, str]]()
        try:
            self._replay_kept()
            stopped = self._sweep()
            self._hold()
            while waiting := self.traces.keys() - self.simplified:
                self._simplify(next(name for name in self.traces if name in waiting))
            if self.crash and not self.unit.process.silent and not self.unit.process.fault:
                self._simplify("")
            if not self.crash and not self.unit.process.fault:
                with contextlib.suppress(_Stop):
                    self.unsteady = self.unsteady or self._asked_again()
                    apart = self._asked_apart() if self.doubles else []
                stopped = stopped or ("again" if self.spent() > self.end else "")
        finally:
            fault = self.unit.process.close()
        if self.differs and not fault:
            fault = f"the generated test and Avow judge a case differently, which is a fault of Avow ({self.differs})"
        trace = tuple(pairs(*step) for step in self.crash_trace)
        unit = self.asked.subject
        return Answer(
            self.valid, self.replayed, self.rejected, self.undecided, stopped, tuple(sorted(unit.left_out)),
            self.unit.process.observed(), self.unit.process.isolation, tuple(apart),
            pairs(self.unsteady, {}) if self.unsteady is not None else None, self.silent or self.unit.process.silent,
            (trace[-1] if trace else (), self.crash) if self.crash else None, trace if unit.source else None,
            self.runs if self.runs_counted else None, {name: self._tried(name) for name in self.guarantees}, fault,
        )  # fmt: skip

    def _sweep(self) -> str:
        """Run the cases that count; the reason if they ended early."""
        self._why = None
        try:
            self._run_test((Phase.generate, Phase.target))
        except (_Stop, Flaky):
            if self._why is None:
                raise
            return self._why
        except (Unsatisfiable, FailedHealthCheck):
            return "assumptions"
        finally:
            self._end_run()
            self.trace = []
        return ""

    def _simplify(self, name: str) -> None:
        """Find the simplest run that violates a guarantee (or in which the unit fails), within the time, and repeat it
        in a process of its own."""
        first, end = self.traces.get(name, []), self.end
        self.simplified.add(name)
        self.shrinking, self.end = name, min(end, self.spent() + SHRINKING_SECONDS)
        with contextlib.suppress(_Broken, _Stop, Flaky, Unsatisfiable, FailedHealthCheck):
            self._run_test((Phase.generate, Phase.shrink))
        self.shrinking, self.end = None, end
        if not name:
            return
        for trace in (self.traces[name], first):
            with self._twin():
                again = self._replayed((inputs for inputs, _ in trace), name)
            if again:
                self.traces |= again
                return
        self.unsteady = self.traces.pop(name)[-1][0]

    @contextlib.contextmanager
    def _twin(self) -> Iterator[Unit]:
        """Another process of the unit, used in its place."""
        first, self.unit = self.unit, Unit(self.asked, self.unit.patience)
        try:
            yield self.unit
        finally:
            twin, self.unit = self.unit.process, first
            twin.close()
            first.process.fault = first.process.fault or twin.fault
            self.silent = self.silent or twin.silent

    def _replayed(self, steps: Iterable[Inputs], *names: str) -> dict[str, Trace]:
        """For each guarantee that the run of these steps violates, the run up to there, as far as the assumptions allow
        it."""
        trace: Trace = []
        broken: dict[str, Trace] = {}
        self.keeper.restart()
        with contextlib.suppress(SubjectFailed):
            memory = self.unit.begin()
            for step in steps:
                inputs = {**step, **memory}
                if inputs.keys() != self.inputs.keys() or not self._assumed(inputs):
                    break
                found = self.unit.advance(inputs)
                trace.append((inputs, found))
                values = self.keeper.at(valuation(inputs, found))
                for name in names:
                    if name not in broken and self.guarantees[name].judged.holds(values) is False:
                        broken[name] = list(trace)
                if len(broken) == len(names):
                    break
                self.keeper.advance(valuation(inputs, found))
                memory = self.unit.memory(found)
        return broken

    def _replay_kept(self) -> None:
        """Run the earlier counterexamples that are still valid cases; they come first, with any seed."""
        for run in self.asked.kept:
            steps: list[Inputs] = []
            with contextlib.suppress(Malformed, KeyError, ValueError, TypeError, AttributeError):
                for step in run:
                    steps.append({n: received(step[n], sort, n) for n, sort in self.inputs.items() if n in step})
            if len(steps) == len(run):
                self.replayed += 1
                self.traces = {**self._replayed(steps, *self.guarantees), **self.traces}

    def _hold(self) -> None:
        """Repeat the first inputs of a few runs, so that counters and delays expire."""
        for inputs in self._starts if self._runs and not self.crash else ():
            left = [name for name in self.guarantees if name not in self.traces]
            if left and self.spent() < self.end:
                self.traces |= self._replayed(itertools.repeat(inputs, tuning.LONGEST_RUN), *left)

    def _asked_again(self) -> Inputs | None:
        """Inputs to which another process, given the same requests from its start, gives another answer, or, called
        often, one that violates a guarantee: answers that depend on clock, chance, memory addresses or the number of
        calls are not a function of the recorded inputs."""
        requests = self.unit.requests
        short = (
            [] if self.asked.subject.driven else sorted(requests, key=lambda request: len(str(request)))[: BATCH // 2]
        )
        twice = [request for request in short for _ in range(2)]
        with self._twin() as twin:
            for before in _batches(requests):
                if self.spent() > self.end:
                    raise _Stop("again")
                for inputs, _ in twin.differing(before):
                    return inputs
            end = min(self.end, self.spent() + tuning.SECONDS_OFTEN)
            for before in itertools.islice(itertools.cycle(_batches(twice)), tuning.ASKED_OFTEN // BATCH):
                for inputs, reply in twin.differing(before) if self.spent() < end else ():
                    if self._breaks(inputs, reply):
                        return inputs
        return None

    def _breaks(self, inputs: Inputs, reply: Any) -> bool:
        """Whether a function's reply to these inputs violates a guarantee, or is unreadable."""
        try:
            found = self.unit.read(reply)
        except SubjectFailed:
            return True
        self.keeper.restart()
        return any(g.judged.holds(self.keeper.at(valuation(inputs, found))) is False for g in self.guarantees.values())

    def _asked_apart(self) -> list[tuple[Pairs, str]]:
        """Each REAL input in turn is NaN, infinite or the negative zero, with a few cases' other inputs."""
        found: dict[str, tuple[Pairs, str]] = {}
        reals = [n for n, s in self.inputs.items() if n not in self.asked.subject.held and isinstance(s, RealSort)]
        with self._twin():
            for inputs in self._starts:
                for name, (word, text) in itertools.product(reals, SPECIAL.items()):
                    if self.spent() > self.end:
                        raise _Stop("again")
                    zero = {**inputs, name: Fraction(0)}
                    self.keeper.restart()
                    why = self._wrong_apart(zero, name, text) if self._assumed(zero) else ""
                    if why:
                        found.setdefault(why, (asked_with(zero, name, word), why))
        return list(found.values())

    def _wrong_apart(self, inputs: Inputs, name: str, text: str) -> str:
        """Guarantees about an input without a value cannot be judged; the negative zero is zero."""
        try:
            self.unit.begin()
            found = self.unit.advance(inputs, {name: text})
        except SubjectFailed as error:
            return str(error)
        values = self.keeper.at(valuation(inputs, found))
        about = [g for g in self.guarantees.values() if text == SPECIAL["-0"] or name not in g.judged.ports]
        return "; ".join(f"{g.judged.name} is broken" for g in about if g.judged.holds(values) is False)

    def _tried(self, name: str) -> Tried:
        each = self.guarantees[name]
        counts = zip(each.triggers, each.hits, each.run_hits, strict=True)
        found = Tried(tuple(Met(t.text, *met) for t, *met in counts), each.undecided)
        trace = self.traces.get(name)
        if trace is None:
            return found
        if self.asked.subject.driven:
            case: Any = [self.unit.step_of(inputs) for inputs, _ in trace]
        else:
            steps = [{n: sent(v, doubles=False) for n, v in inputs.items()} for inputs, _ in trace]
            case = steps if self.runs_counted else steps[0]
        shown = tuple(pairs(*step) for step in trace)
        return replace(found, failure=shown[-1], trace=shown if len(shown) > 1 else (), case=case)


def _batches(requests: Sequence[tuple[Any, Any]]) -> list[Sequence[tuple[Any, Any]]]:
    return [requests[at : at + BATCH] for at in range(0, len(requests), BATCH)]
