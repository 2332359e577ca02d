"""One discharge: exploration, our own answers, then those of other engines, and the report."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.given import summarized
from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.diagnostics import Rejected
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.ltl import TooLarge
from avow.isolation.observed import Observed, Seen
from avow.isolation.outside import Outside

from . import ajpf_tool
from .ajpf_tool import Installation
from .beliefs import TooDeep
from .checker import Checker, OutOfTime, Property, asks_for_percepts
from .explore import explore
from .instances import Instantiation, instances
from .options import Setup, read
from .replay import Run, replay, sampled
from .settle import ENGINE, Frame, Settled, outcome
from .society import system
from .tuning import GRACE, SAMPLED_RUNS
from .words import Wording, explain


def settle(job: Job, limits: Limits, version: str) -> Report:
    """An outcome for each obligation. `version` is the backend's."""
    try:
        setup = read(job)
    except Rejected as error:
        why = f"the agent cannot be checked: {summarized(job, error.diagnostics)}"
        return Report.alike(job, Verdict.ERROR, why, ENGINE, version)
    run = _Run(setup, instances(job, setup), limits)
    run.explore_all()
    frame = Frame(setup, run.made, run.results, run.counterexamples, run.bound)
    claims = {claim.guarantee: claim for claim in frame.made.claims}
    outcomes = tuple(outcome(o, claims[o.name], frame) for o in job.obligations)
    return Report(outcomes, ENGINE, version, (), run.logs, tuple(run.observed))


EXCLUDED = (
    "it holds by the fairness assumptions only, and from some reachable state no fair run goes on: the percepts that "
    "they name cannot be drawn there"
)


class _Run:
    """The results so far."""

    def __init__(self, setup: Setup, made: Instantiation, limits: Limits) -> None:
        self.setup = setup
        self.made = made
        self.wording = Wording(setup.rows, made.words, setup.instances)
        self.limits = limits
        self.deadline = time.monotonic() + limits.seconds
        self.results: dict[str, Settled] = {}
        self.counterexamples: dict[str, Counterexample] = {}
        self.bound: dict[str, Any] = {}
        self.checkers: dict[str, Checker] = {}
        """Property's key → the checker with the state space that it was checked on."""
        self.logs: dict[str, str] = {}
        self.observed: list[Observed] = []
        self.ajpf = ajpf_tool.find() if setup.semantics == "mcapl" else None

    def left(self) -> float:
        return max(0.0, self.deadline - time.monotonic())

    def explore_all(self) -> None:
        """Results for every property; if a bound was met, a violation within it still counts. Properties about percepts
        have a state space of their own (`interpreter.Agent`)."""
        self.bound |= {"states": 0, "transitions": 0, "exhaustive": True}
        for probed in (False, True):
            properties = [p for p in self.made.properties if asks_for_percepts(p) is probed]
            if properties or (not probed and not self.made.properties):
                self.explored(properties, probed)
        self.explain()

    def explored(self, properties: Sequence[Property], probed: bool) -> None:
        setup = self.setup
        agents = system(setup.programs, setup.environment, setup.semantics, probed=probed)
        graph = explore(agents, states=setup.states, seconds=self.left(), megabytes=self.limits.megabytes)
        self.bound["states"] += len(graph)
        self.bound["transitions"] += graph.transitions
        if graph.unfinished is not None:
            self.bound |= {"exhaustive": False, "unfinished": graph.unfinished}
            self.deadline += self.limits.seconds * GRACE
        try:
            checker = Checker(graph, properties)
        except (TooDeep, RecursionError):
            reason = "the agent's terms or reasoning rules nest too deeply, or ask for too much"
            self.results |= {p.key: Settled(Verdict.UNKNOWN, reason) for p in properties}
            return
        for p in properties:
            self.results[p.key] = self.one(checker, p)
            self.checkers[p.key] = checker

    def one(self, checker: Checker, p: Property) -> Settled:
        try:
            result = checker.check(p, self.deadline)
        except OutOfTime:
            return Settled(Verdict.UNKNOWN, f"no time left of {self.limits.seconds:g} s")
        except (TooLarge, RecursionError):
            return Settled(Verdict.UNKNOWN, "the property's automaton is too large")
        unfinished = checker.graph.unfinished
        if result.holds and unfinished is not None:
            return Settled(Verdict.UNKNOWN, f"not refuted, but the state space is unfinished: {unfinished}")
        answer = Verdict.CHECKED if result.holds else Verdict.REFUTED
        reason = self.doubt(p, result.answered) if not result.holds else EXCLUDED if result.excluded else ""
        verdict = Verdict.UNKNOWN if reason else answer
        return Settled(verdict, reason, answer, result.vacuous, result.immediate, result.valid)

    def doubt(self, p: Property, answered: bool) -> str:
        """Why a run on which the property fails does not refute its guarantee, if so. A forbidden formula may hold long
        after the trigger, for another reason: that refutes only if it is the answer to the trigger."""
        if p.indecisive or p.forbidden is None or answered:
            return p.indecisive
        return (
            f"what is forbidden ({self.wording.say(p.forbidden)}) comes in some runs, and may have another reason than "
            "the trigger: say when it must not come by a property of the plan that `forbids` it"
        )

    def explain(self) -> None:
        """A run for the first refuted property of each guarantee, and of each further property. If AJPF is installed,
        AIL repeats these runs, and some of each state space by which properties hold."""
        groups = [claim.properties for claim in self.made.claims] + [ps for _, ps in self.made.extras]
        runs: list[tuple[str, Run]] = []
        for group in groups:
            refuted = next((p for p in group if self.results[p.key].verdict is Verdict.REFUTED), None)
            if refuted is not None and (run := self.explained(refuted)) is not None:
                runs.append((refuted.key, run))
        if self.ajpf is not None:
            runs += [("", run) for run in self.samples()]
            self.replay(self.ajpf, runs)

    def explained(self, refuted: Property) -> Run | None:
        checker = self.checkers[refuted.key]
        lasso = checker.lasso(refuted)
        if lasso is None:  # the reduced and the whole graph disagree: never expected, never ignored
            self.results[refuted.key] = Settled(Verdict.ERROR, "the checker contradicts itself")
            return None
        found = explain(checker.graph, lasso, refuted, self.wording)
        self.counterexamples[refuted.key] = found
        self.logs[f"{refuted.key}.trace.txt"] = _trace(found)
        return checker.graph, lasso

    def samples(self) -> Iterator[Run]:
        for graph in {id(checker): checker.graph for checker in self.checkers.values()}.values():
            for lasso in sampled(graph, SAMPLED_RUNS):
                yield graph, lasso

    def replay(self, ajpf: Installation, runs: Sequence[tuple[str, Run]]) -> None:
        """AIL repeats the runs: if one differs, our interpreter disagrees with AIL's for this program, and there is no
        verdict on anything."""
        name = f"AIL ({ajpf.version})"
        if not runs:
            return
        outside = Outside((ajpf.tool,))
        with tempfile.TemporaryDirectory(prefix="avow-ail-") as folder:
            answers = replay(ajpf, self.setup, [run for _, run in runs], Path(folder), outside)
        self.observed = list(outside.observed())
        agreed = 0
        for (key, _), answer in zip(runs, answers, strict=True):
            if answer.fault:
                # nothing of ours depends on it, so that what cannot be recorded is left out; it may succeed later
                self.observed = [o for o in self.observed if o.kind is not Seen.OUTSIDE]
                self.bound["replay"] = f"not replayed by {name}: {answer.fault}"
                return
            if key:
                self.logs[f"{key}.replay.txt"] = answer.log
            if answer.difference is not None:
                reason = f"contradictory: {name} does not do {_of(key)}: {answer.difference}"
                self.results = {
                    each: replace(r, verdict=Verdict.ERROR, reason=reason) for each, r in self.results.items()
                }
                self.counterexamples = {}
                return
            agreed += 1
            if key:
                result = self.results[key]
                self.results[key] = replace(result, opinions={**result.opinions, name: "does the same run"})
        self.bound["replay"] = f"{name} does {agreed} runs as the checker does"


def _of(key: str) -> str:
    return f"the run that refutes {key}" if key else "a run that the checker explored"


def _trace(found: Counterexample) -> str:
    lines = [found.text(), ""]
    for at, step in enumerate(found.trace):
        mark = "loop starts here: " if at == found.loop else ""
        lines.append(f"{at:4} {mark}{'; '.join(f'{name}: {value}' for name, value in step)}")
    if found.loop is not None:
        lines.append(f"     … and from step {found.loop} again, for ever")
    return "\n".join(lines) + "\n"
