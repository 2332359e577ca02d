"""Runs of a node's own class: from its start, step after step, with inputs that its memory and the last ones suggest.

Each step is judged as a case of its own, with the memory that the class really had. A run ends where the assumptions
allow no input that is found, and begins anew; what breaks a guarantee is cut down to as few steps as still break it.
"""

from __future__ import annotations

import itertools
import json
import math
import random
import time
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

from avow.formulas.temporal.cells import longest_limits
from avow.formulas.values import Data, Element, SequenceValue, Value
from avow.isolation.scout import Sight
from avow.isolation.subject import SubjectFailed, SubjectProcess
from avow.language.sorts import REAL, IntegerSort, NaturalSort, RealSort, Sort

from . import steer, tuning
from .bench import Bench, _Enough
from .convention import SPECIAL, Case, Malformed, asked_with, kept_runs, outputs, pairs, received, told, valuation
from .exchange import Answer, Pairs, Question, Tried
from .export import KEPT
from .generate import Impossible, Inputs, Source
from .shrink import OutOfTime

Trace = list[tuple[Inputs, dict[str, Value]]]

WHOLE = tuple(s * 2**n + d for n in (7, 8, 15, 16, 31, 32, 63) for s in (1, -1) for d in (-1, 0))
"""The ends of ROS' own integers: what wraps there wraps nowhere else."""


class SequenceBench(Bench):
    """As `Bench`, of a class that is driven. `memory` are the inputs that the class holds itself."""

    def __init__(self, asked: Question, folder: Path) -> None:
        super().__init__(asked, folder)
        self.memory = asked.memory
        self.unread = tuple(name.removeprefix("out.") for name in asked.left_out if name.startswith("out."))
        self.turned = {n: s for n, s in self.inputs_sorts.items() if n not in self.memory}
        self.counted = tuning.COUNTED_STEPS
        self.others = {n: s for n, s in self.output_sorts.items() if n not in self.memory}
        self.traces: dict[str, Trace] = {}
        self._first: list[list[Inputs]] = []
        self._runs_kept = kept_runs(folder / KEPT)
        self._edges_left: Iterator[Inputs] = iter(())
        self._swept = False
        self.runs = 0
        self._steps = tuning.STEPS + min(2 * longest_limits(self.formulas), tuning.LONGEST_RUN)

    # -- the class ---------------------------------------------------------------------------------------

    def begin(self, subject: SubjectProcess) -> dict[str, Value]:
        """A new run of a new object; its memory."""
        self.keeper.restart()
        reply = self._asked(subject, {"steps": []})
        return self._held(reply["held"])

    def advance(self, subject: SubjectProcess, inputs: Inputs) -> dict[str, Value]:
        """One step; the outputs, with memory among them. Raises SubjectFailed."""
        (answer,) = self._asked(subject, {"on": True, "steps": [self._step_of(inputs)]})["steps"]
        if "error" in answer:
            raise SubjectFailed(f"the step raises {answer['why']}")
        try:
            found = outputs(_as_host(answer["value"], self.unread), self.others) if self.others else {}
            held = {n: v for n, v in answer["memory"].items() if n in self.output_sorts}
            return found | {n: received(_as_host(v), self.output_sorts[n], f"out.{n}") for n, v in held.items()}
        except (Malformed, ValueError, TypeError, KeyError) as error:
            raise SubjectFailed(str(error)) from error

    def _asked(self, subject: SubjectProcess, case: Mapping[str, Any]) -> Any:
        reply = subject.ask({"case": json.dumps(case)})
        if not isinstance(reply, str):
            raise SubjectFailed("the class cannot be driven")
        return json.loads(reply)

    def _held(self, data: Mapping[str, Any]) -> dict[str, Value]:
        try:
            return {n: received(_as_host(data[n]), self.inputs_sorts[n], f"in.{n}") for n in self.memory}
        except Malformed as error:
            raise SubjectFailed(f"in memory, {error}") from error

    def coded(self, value: Value) -> Any:
        """An input as the class gets it."""
        match value:
            case bool():
                return value
            case Fraction() if self.doubles:
                return {"f": float(value).hex()}
            case Fraction():
                return {"q": [str(value.numerator), str(value.denominator)]}
            case int():
                return {"i": str(value)}
            case Element(name=name):
                return name
            case SequenceValue(items=items):
                return {"l": [self.coded(item) for item in items]}
            case Data(constructor=constructor, arguments=arguments):
                return {"t": [constructor, *map(self.coded, arguments)]}
            case tuple():
                return {"t": [self.coded(item) for item in value]}
        raise Impossible(f"a step class is not given {value}")

    def decoded(self, data: Any, sort: Sort, name: str) -> Value:
        """What `coded` made data of. Raises Malformed."""
        return received(_as_host(data), sort, name)

    # -- looked at ---------------------------------------------------------------------------------------

    def starts(self) -> list[list[Inputs]]:
        """The beginnings of some runs."""
        return [run[:steps] for run, steps in zip(self._first, tuning.LED_TO, strict=False) if len(run) >= steps]

    def allowed(self, inputs: Inputs) -> bool:
        """What the assumptions say hangs on where the run is: `tried_at` asks them."""
        return True

    def looked(self, start: list[Inputs], cases: Sequence[Inputs], *, on: bool = False) -> list[tuple[Sight, ...]]:
        self._in_time()
        asked: list[dict[str, Any]] = []
        for inputs in cases:
            if not (on and asked):
                asked.append({"steps": [self._step_of(step) for step in start]})
            asked.append({"on": True, "steps": [self._step_of(inputs)]})
        seen = self.scout.sights([{"case": json.dumps(case)} for case in asked])
        held = seen[0] if seen else ()
        found = [sights for case, sights in zip(asked, seen, strict=True) if "on" in case]
        return [(*held, *found[0]), *found[1:]] if found and not start else found

    def tried_at(self, start: list[Inputs], cases: list[Inputs]) -> None:
        for case in cases:
            self._continued(start, [case])

    def repeat(self, start: list[Inputs], inputs: Inputs, times: int) -> None:
        self._continued(start, [*itertools.repeat(inputs, times), *self.tried[: self._steps]])

    def _continued(self, start: list[Inputs], cases: list[Inputs]) -> None:
        """A run of these steps, as far as the assumptions allow it."""
        trace: Trace = []
        try:
            memory = self.begin(self.subject)
        except SubjectFailed as error:
            self.crash = ({}, str(error))
            raise _Enough from error
        for number, step in enumerate((*start, *cases)):
            self._in_time()
            inputs = {**step, **memory}
            if self.assumed(inputs):
                memory = self._one(inputs, trace, drawn=False)
                self.edges += number >= len(start)
            elif number < len(start):
                break

    def _step_of(self, inputs: Inputs) -> dict[str, Any]:
        return {name: self.coded(value) for name, value in inputs.items() if name not in self.memory}

    # -- runs --------------------------------------------------------------------------------------------

    def _sweep(self) -> str:
        chance = random.Random(self.seed)
        try:
            for steps in self._runs_kept:
                self._replayed_run(steps)
            for each in self.guarantees.values():
                each.edge_hits = [0] * len(each.triggers)
            steer.learn(self)
            self._edges_left = iter([*map(self.as_given, self.generator.edges(self.blamed))])
            while self.valid < self.cases:
                self._run(chance)
                if self.rejected > tuning.REJECTED_CASES * max(self.valid, 50):
                    return "assumptions"
            self.tried_at([], [*itertools.islice(self._edges_left, tuning.EDGES // 3)])
            steer.steer(self)
        except OutOfTime:
            return "time"
        except _Enough:
            return "enough"
        except Impossible as error:
            return f"no values: {error}"
        return ""

    def _run(self, chance: random.Random) -> None:
        trace: Trace = []
        held = tuning.HELD_STEPS if chance.random() < 0.4 else 0.0
        if held and self.remembers:
            held = chance.choice((tuning.HELD_STEPS, *tuning.LONG_HELD_STEPS))
        before = {name: list(g.hits) for name, g in self.guarantees.items()}
        try:
            memory = self.begin(self.subject)
        except SubjectFailed as error:
            self.crash = ({}, str(error))
            raise _Enough from error
        for _ in range(self._steps):
            self._in_time()
            inputs = self._drawn(chance, memory, trace[-1][0] if trace else None, held)
            if inputs is None or self.valid >= self.cases:
                break
            if len(self.tried) < tuning.AFTER_COUNTING:
                self.tried.append(inputs)
            memory = self._one(inputs, trace)
        self.runs += bool(trace)
        for name, each in self.guarantees.items():
            each.run_hits = [
                n + (now > was) for n, now, was in zip(each.run_hits, each.hits, before[name], strict=True)
            ]
        if len(self._first) * self._steps < tuning.ASKED_AGAIN:
            self._first.append([inputs for inputs, _ in trace])

    def _one(self, inputs: Inputs, trace: Trace, *, drawn: bool = True) -> dict[str, Value]:
        """One step of a run, judged; the memory after it. Of one that is tried again nothing is counted."""
        try:
            found = self.advance(self.subject, inputs)
        except SubjectFailed as error:
            self.crash = (inputs, str(error))
            self.traces["crash"] = [*trace, (inputs, {})]
            raise _Enough from error
        trace.append((inputs, found))
        self.valid += drawn
        failed = {name for name, g in self.guarantees.items() if g.failure is not None}
        self._judge(inputs, found, not drawn)
        for name, each in self.guarantees.items():
            if each.failure is not None and name not in failed:
                self.traces[name] = list(trace)
        self.keeper.advance(valuation(inputs, found))
        if all(g.failure is not None for g in self.guarantees.values()):
            raise _Enough
        unheld = [n for n in self.memory if n not in found]
        return {n: found[n] for n in self.memory if n in found} | self._looked(unheld, self.subject)

    def _looked(self, names: list[str], subject: SubjectProcess) -> dict[str, Value]:
        if not names:
            return {}
        held = self._held(self._asked(subject, {"on": True, "steps": []})["held"])
        return {n: held[n] for n in names}

    def _drawn(
        self, chance: random.Random, memory: dict[str, Value], last: Inputs | None, held: float
    ) -> Inputs | None:
        """Inputs that the assumptions allow beside this memory; None where none are found."""
        for attempt in range(tuning.STEP_TRIES):
            if last is not None and held and chance.random() < held:
                inputs = {**last, **memory}
            else:
                edge = next(self._edges_left, None) if chance.random() < 0.5 else None
                data = Source(chance.randbytes(tuning.CASE_BYTES))
                inputs = edge or self.as_given(
                    self.generator.case(data, lambda drawn: self.blamed({**drawn, **memory}), self._aims)
                )
                inputs = {**self._nudged(chance, inputs, memory, last), **memory}
            if self.assumed(inputs):
                return inputs
            self.rejected += attempt == tuning.STEP_TRIES - 1
        return None

    def _nudged(self, chance: random.Random, inputs: Inputs, memory: dict[str, Value], last: Inputs | None) -> Inputs:
        """Now and then a number lies a threshold away from one that was there before, or at the end of a machine's."""
        before = [v for v in (*memory.values(), *(last or {}).values()) if isinstance(v, Fraction)]
        steps = self.generator.pools.edges.get(REAL, ())
        changed = dict(inputs)
        for name, sort in self.inputs_sorts.items():
            if isinstance(sort, RealSort) and before and steps and chance.random() < 0.4:
                step = chance.choice(steps)
                assert isinstance(step, Fraction)
                changed[name] = self._beside(chance, chance.choice(before) + abs(step))
            elif isinstance(sort, IntegerSort | NaturalSort) and chance.random() < 0.1:
                number = chance.choice(WHOLE)
                changed[name] = abs(number) if isinstance(sort, NaturalSort) else number
        return changed

    def _beside(self, chance: random.Random, number: Fraction) -> Fraction:
        if not self.doubles:
            return number
        try:
            near = float(number)
        except OverflowError:
            return Fraction(0)
        end = chance.choice((-math.inf, None, None, math.inf))
        near = near if end is None else math.nextafter(near, end)
        return Fraction(near) if math.isfinite(near) else Fraction(0)

    def _broken(self, name: str) -> str:
        if not self._swept:
            self._swept = True
            self._sweep()
        if self.crash is not None:
            return f"{name}: {self.crash[1]}{_run_told(', of ', self.traces.get('crash', []))}"
        broken = self.guarantees[name].failure is not None
        return f"{name} is broken{_run_told(': ', self.traces[name])}" if broken else ""

    # -- what was found ----------------------------------------------------------------------------------

    def _replayed_run(self, steps: tuple[Any, ...]) -> None:
        """What refuted a guarantee once, as far as its inputs are still allowed."""
        trace: Trace = []
        memory = self.begin(self.subject)
        for step in steps:
            try:
                given = {n: self.decoded(step[n], s, n) for n, s in self.inputs_sorts.items() if n in step}
            except (Malformed, KeyError, ValueError, TypeError, AttributeError):
                return
            inputs = {**self.as_given(given), **memory}
            if set(inputs) != set(self.inputs_sorts) or not self.assumed(inputs):
                return
            memory = self._one(inputs, trace, drawn=False)
        self.replayed += 1

    def _shrunk(self, name: str) -> Case | None:
        each = self.guarantees[name]
        assert each.failure is not None
        end = min(self.end or math.inf, time.monotonic() + tuning.SHRINKING_SECONDS)
        best = self.traces[name]
        alone = self._again([best[-1][0]], name)
        best = alone if alone is not None else self._shorter(best, name, end)
        while self.remembers and time.monotonic() < end:  # plainer steps may make others needless
            plainer = self._plainer(best, name, end)
            if plainer == best:
                break
            best = self._shorter(plainer, name, end)
        for trace in (best, self.traces[name]):
            again = self._afresh(trace, name)
            if again is not None:
                self.traces[name] = again
                return again[-1]
        self.unsteady = self.traces.pop(name)[-1][0]
        return None

    def _afresh(self, trace: Trace, name: str) -> Trace | None:
        """The run in a process that had no other before, if it breaks the guarantee there as well."""
        with self.twin() as twin:
            return self._again([inputs for inputs, _ in trace], name, twin)

    def _shorter(self, best: Trace, name: str, end: float) -> Trace:
        """The run without the steps that it does not take, as far as they are found one by one from its end."""
        tries, at = 0, len(best) - 2
        while at >= 0 and tries < tuning.SHRINKING_TRIES and time.monotonic() < end:
            tries += 1
            shorter = self._again([i for k, (i, _) in enumerate(best) if k != at], name)
            best = shorter if shorter is not None else best
            at = min(at, len(best) - 1) - 1
        return best

    def _plainer(self, best: Trace, name: str, end: float) -> Trace:
        """The run with simpler inputs, one after the other, the last step first: the simplest of all, those of the step
        before, whole numbers."""
        plain = self.as_given(self.generator.case(Source(b""), lambda _: None))
        for port in (p for p in plain if p not in self.memory):
            for at in reversed(range(len(best))):
                tried = [plain[port], best[at - 1][0][port]] if 0 < at < len(best) else [plain[port]]
                now = best[at][0][port] if at < len(best) else plain[port]
                tried += [Fraction(round(now))] if isinstance(now, Fraction) else []
                for value in tried[: tried.index(now)] if now in tried else tried:
                    if time.monotonic() > end:
                        return best
                    steps = [{**i, port: value} if k == at else i for k, (i, _) in enumerate(best)]
                    simpler = self._again(steps, name)
                    if simpler is not None:
                        best = simpler
                        break
        return best

    def _again(self, steps: list[Inputs], name: str, subject: SubjectProcess | None = None) -> Trace | None:
        """The run of these steps up to one that breaks the guarantee, if one does and all before it are allowed."""
        trace: Trace = []
        subject = subject or self.subject
        try:
            memory = self.begin(subject)
            for step in steps:
                inputs = {**step, **memory}
                if not self.assumed(inputs):
                    return None
                found = self.advance(subject, inputs)
                trace.append((inputs, found))
                if self.guarantees[name].judged.holds(self.values_of(inputs, found)) is False:
                    return trace
                self.keeper.advance(valuation(inputs, found))
                memory = self._looked([*self.memory], subject)
        except SubjectFailed:
            return None
        return None

    def _shrunk_crash(self) -> tuple[Inputs, str]:
        assert self.crash is not None
        return self.crash

    def _asked_again(self) -> Inputs | None:
        """The first inputs to which another process answers otherwise."""
        with self.twin() as twin:
            for run in self._first:
                self.begin(self.subject)
                self.begin(twin)
                for inputs in run:
                    self._in_time()
                    if self._said_by(self.subject, inputs) != self._said_by(twin, inputs):
                        return inputs
        return None

    def _said_by(self, subject: SubjectProcess, inputs: Inputs) -> Any:
        try:
            return self.advance(subject, inputs)
        except SubjectFailed as error:
            return str(error)

    def _asked_apart(self) -> list[tuple[Pairs, str]]:
        """Each REAL input in its turn is what no REAL is, in a first step."""
        found: dict[str, tuple[Pairs, str]] = {}
        reals = [n for n, s in self.inputs_sorts.items() if n not in self.memory and isinstance(s, RealSort)]
        for run in (r for r in self._first[:3] if r):
            for name, (word, text) in itertools.product(reals, SPECIAL.items()):
                why = self._wrong_first(run[0], name, text)
                if why:
                    found.setdefault(why, (asked_with(run[0], name, word), why))
        return list(found.values())

    def _wrong_first(self, inputs: Inputs, name: str, text: str) -> str:
        given = self._step_of(inputs) | {name: {"f": text}}
        try:
            self.begin(self.subject)
            (answer,) = self._asked(self.subject, {"on": True, "steps": [given]})["steps"]
            if "error" in answer:
                return f"the step raises {answer['why']}"
            outputs(_as_host(answer["value"], self.unread), self.others)
        except (SubjectFailed, Malformed) as error:
            return str(error)
        return ""

    def _report(self, stopped: str, smaller: Mapping[str, Case]) -> Answer:
        report = super()._report(stopped, smaller)
        crash = tuple(pairs(*step) for step in self.traces.get("crash", []))
        runs = self.runs if self.remembers else None
        return replace(report, runs=runs, crash_trace=crash if self.asked.source else None)

    def _tried(self, name: str, smaller: Case | None) -> Tried:
        found = super()._tried(name, smaller)
        if smaller is None:
            return found
        trace = self.traces[name]
        case = [{n: self.coded(v) for n, v in inputs.items()} for inputs, _ in trace]
        return replace(found, case=case, trace=tuple(pairs(*step) for step in trace) if len(trace) > 1 else ())


def _run_told(before: str, trace: Trace) -> str:
    """The steps that show it, where there are any."""
    return f"{before}{'; then '.join(told(*step) for step in trace)}" if trace else ""


def _as_host(data: Any, but: Collection[str] = ()) -> Any:
    """What a class returned, as a subject's process has it (`convention`); `but`: names of a dict that are left out."""
    match data:
        case {"f": str(text)}:
            number = float.fromhex(text)
            if not math.isfinite(number):
                return {"?": f"the number {number}"}
            return {"q": [str(part) for part in number.as_integer_ratio()]}
        case {"i": str(digits)}:
            return {"q": [digits, "1"], "w": True}
        case {"l": items} | {"t": items}:
            return {"t": [_as_host(item) for item in items]}
        case {"d": pairs}:
            return {"m": [[key, _as_host(value)] for key, value in pairs if key not in but]}
        case _:  # its own JSON
            return data
