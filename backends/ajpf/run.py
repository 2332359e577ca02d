"""One discharge: exploration, our own answers, then those of other engines, and the report."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
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
from .ajpf_tool import AjpfResult, Installation
from .asking import ask
from .beliefs import TooDeep
from .checker import Checker, OutOfTime, Property, asks_for_percepts
from .explore import explore
from .instances import Instantiation, instances
from .options import Setup, read
from .replay import Run, replay, sampled
from .settle import Frame, Settled, outcome
from .society import system
from .tuning import GRACE, SAMPLED_RUNS
from .words import Wording, explain

ENGINE = "Avow's own Gwendolen checker"

_SAID = {
    AjpfResult.HOLDS: Verdict.CHECKED,
    AjpfResult.VIOLATED: Verdict.REFUTED,
    AjpfResult.INCONCLUSIVE: Verdict.UNKNOWN,
    AjpfResult.TIMEOUT: Verdict.UNKNOWN,
    AjpfResult.ERROR: Verdict.ERROR,
}


def settle(job: Job, folder: Path, limits: Limits, version: str) -> Report:
    """An outcome for each obligation. `version` is the backend's."""
    try:
        setup = read(job)
    except Rejected as error:
        why = f"the agent cannot be checked: {summarized(job, error.diagnostics)}"
        return Report.alike(job, Verdict.ERROR, why, ENGINE, version)
    run = _Run(setup, instances(job, setup), folder, limits)
    frame = run.frame()
    claims = {claim.guarantee: claim for claim in frame.made.claims}
    outcomes = tuple(outcome(o, claims[o.name], frame) for o in job.obligations)
    return Report(outcomes, frame.engine, run.version(version), run.command, run.logs, tuple(run.observed))


class _Run:
    """The results so far."""

    def __init__(self, setup: Setup, made: Instantiation, folder: Path, limits: Limits) -> None:
        self.setup = setup
        self.made = made
        self.wording = Wording(setup.rows, made.words, setup.instances)
        self.folder = folder
        self.limits = limits
        self.deadline = time.monotonic() + limits.seconds
        self.results: dict[str, Settled] = {}
        self.counterexamples: dict[str, Counterexample] = {}
        self.bound: dict[str, Any] = {}
        self.checkers: dict[str, Checker] = {}
        """Property's key → the checker with the state space that it was checked on."""
        self.engine = ENGINE
        self.logs: dict[str, str] = {}
        self.command: tuple[str, ...] = ()
        self.observed: dict[Observed, None] = {}
        self.ajpf = ajpf_tool.find() if setup.semantics == "mcapl" else None

    def version(self, own: str) -> str:
        if self.setup.engine == "ajpf":
            return self.ajpf.version if self.ajpf else ""
        return own

    def left(self) -> float:
        return max(0.0, self.deadline - time.monotonic())

    def frame(self) -> Frame:
        self.own()
        if self.setup.engine == "ajpf":
            self.ask_ajpf()
        return Frame(self.setup, self.made, self.results, self.counterexamples, self.engine, self.bound)

    # Our own engine

    def own(self) -> None:
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
        refutes = (p.forbidden is None or result.answered) and not p.indecisive
        answer = Verdict.CHECKED if result.holds else Verdict.REFUTED
        verdict, reason = self.judged(p, answer, refutes)
        return Settled(verdict, reason, answer, result.vacuous, result.immediate, result.valid, refutes)

    def judged(self, p: Property, verdict: Verdict, refutes: bool) -> tuple[Verdict, str]:
        """The meaning of a property's answer for its guarantee. A forbidden formula may hold long after the trigger,
        for another reason: that is a refutation only if it is the answer to the trigger (`Result.answered`)."""
        if verdict is Verdict.REFUTED and p.indecisive:
            return Verdict.UNKNOWN, p.indecisive
        if verdict is not Verdict.REFUTED or refutes or p.forbidden is None:
            return verdict, ""
        banned = self.wording.say(p.forbidden)
        reason = (
            f"what is forbidden ({banned}) comes in some runs, and may have another reason than the trigger: "
            "say when it must not come by a property of the plan that `forbids` it"
        )
        return Verdict.UNKNOWN, reason

    def explain(self) -> None:
        """A run for the first refuted property of each guarantee, and of each further property. If AJPF is installed,
        AIL repeats these runs, and some of each state space by which properties hold."""
        groups = [claim.properties for claim in self.made.claims] + [ps for _, ps in self.made.extras]
        runs: list[tuple[str, Run]] = []
        for group in groups:
            refuted = next((p for p in group if self.results[p.key].verdict is Verdict.REFUTED), None)
            if refuted is not None and (run := self.explained(refuted)) is not None:
                runs.append((refuted.key, run))
        if self.setup.engine in ("auto", "ajpf") and self.ajpf is not None and not self.setup.environment_class:
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
        agreed = 0
        for (key, _), answer in zip(runs, answers, strict=True):
            if answer.said is AjpfResult.ERROR:
                self.unanswered(answer.observed)
                self.bound["replay"] = f"not replayed by {name}: {answer.reason}"
                return
            self.observed.update(dict.fromkeys(answer.observed))
            if key:
                self.logs[f"{key}.replay.txt"] = answer.log
            if answer.said is AjpfResult.VIOLATED:
                reason = f"contradictory: {name} does not do {_of(key)}: {answer.reason}"
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

    # Others

    def unanswered(self, observed: Iterable[Observed]) -> None:
        """Record what was read for a second opinion that failed: it may succeed once that changes. What cannot be
        recorded is left out, as none of our answers depends on it."""
        self.observed.update(dict.fromkeys(o for o in observed if o.kind is not Seen.OUTSIDE))

    def ask_ajpf(self) -> None:
        """AJPF's answers instead of ours. Vacuity and runs in words stay our own engine's."""
        self.engine = "AJPF"
        if self.ajpf is None:
            reason = f"AJPF is not here: {ajpf_tool.INSTALL}"
            self.results = {p.key: Settled(Verdict.NOT_RUN, reason) for p in self.made.properties}
            self.counterexamples = {}
            return
        answers = ask(self.ajpf, self.setup, self.made.properties, self.left(), self.limits.megabytes)
        named = {answer.framework for answer in answers.values() if answer.framework}
        self.bound["ajpf"] = f"{self.ajpf.version}, {' and '.join(sorted(named)) or 'which did not name itself'}"
        self.observed.update(dict.fromkeys(o for answer in answers.values() for o in answer.observed))
        kept = sum(answer.kept for answer in answers.values())
        if kept:
            self.bound["ajpf"] += f"; {kept} of {len(answers)} answers kept of an earlier run with the same files"
        for p in self.made.properties:
            answer = answers[p.key]
            if answer.log:
                self.logs[f"{p.key}.ajpf.txt"] = answer.log
            if answer.said is AjpfResult.VIOLATED and self.setup.environment.fair:
                reason = "AJPF knows no fairness: a run on which it fails may be unfair"
                answer = replace(answer, said=AjpfResult.INCONCLUSIVE, reason=reason)
            own = self.results[p.key]
            verdict, reason = self.judged(p, _SAID[answer.said], own.refutes and own.answer is not None)
            opinions = {} if own.answer is None else {ENGINE: str(own.answer)}
            self.results[p.key] = replace(own, verdict=verdict, reason=reason or answer.reason, opinions=opinions)


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
