"""One discharge: exploration, our own answers, then those of other engines, and the report."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from avow.backend_kit.given import told
from avow.backend_kit.protocol import Job, Limits, Report
from avow.base.diagnostics import Rejected
from avow.base.files import read_text
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.ltl import TooLarge
from avow.isolation.observed import Observed, Seen, as_here
from avow.isolation.outside import Outside
from avow.isolation.tracing import remedy, traces

from . import ajpf_tool, spin, spin_tool
from .ajpf_tool import Answer, Said
from .asking import ask
from .beliefs import TooDeep
from .checker import Checker, OutOfTime, Property, asks_for_percepts
from .explore import Graph, System, explore
from .instances import Instantiation, instances
from .lazy import open_part
from .options import Setup, read
from .partial import Reduction, reduction, unfolded
from .replay import replay
from .settle import Frame, Settled, outcome
from .society import system
from .tuning import GRACE, LAZY_SHARE, LAZY_STATES, PART_STATES, SPIN_SECONDS, SPIN_SHARE
from .words import Wording, explain

ENGINE = "Avow's own Gwendolen checker"

_SAID = {
    Said.HOLDS: Verdict.CHECKED,
    Said.VIOLATED: Verdict.REFUTED,
    Said.INCONCLUSIVE: Verdict.UNKNOWN,
    Said.TIMEOUT: Verdict.UNKNOWN,
    Said.ERROR: Verdict.ERROR,
}


def settle(job: Job, folder: Path, limits: Limits, version: str) -> Report:
    """An outcome for each obligation. `version` is the backend's."""
    try:
        setup = read(job)
    except Rejected as error:
        why = f"the agent cannot be checked: {told(job, error.diagnostics)}"
        return Report.alike(job, Verdict.ERROR, why, ENGINE, version)
    run = _Run(setup, instances(job, setup), folder, limits)
    frame = run.frame()
    claims = {claim.guarantee: claim for claim in frame.made.claims}
    outcomes = tuple(outcome(o, claims[o.name], frame) for o in job.obligations)
    return Report(outcomes, frame.engine, run.version(version), run.command, run.logs, tuple(run.observed))


class _Run:
    """What becomes known, step by step."""

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
        """Property's key → what knows the state space that it was checked on."""
        self.reductions: dict[str, Reduction] = {}
        """Property's key → by what the state space of its checker was made smaller, if it was."""
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
        checkers = self.own()
        if checkers and self.setup.engine in ("auto", "spin"):
            self.ask_spin(checkers)
        if self.setup.engine == "ajpf":
            self.ask_ajpf()
        return Frame(self.setup, self.made, self.results, self.counterexamples, self.engine, self.bound)

    # Our own engine

    def own(self) -> list[Checker]:
        """Results for every property; where a bound was met, a violation within it still counts. The checkers of the
        whole state spaces: properties that ask for percepts have one of their own (`interpreter.Agent`)."""
        whole = []
        self.bound |= {"states": 0, "transitions": 0, "exhaustive": True}
        for probed in (False, True):
            properties = [p for p in self.made.properties if asks_for_percepts(p) is probed]
            if properties or (not probed and not self.made.properties):
                checker = self.explored(properties, probed)
                whole += [checker] if checker is not None and checker.graph.unfinished is None else []
        self.explain()
        return whole if self.bound["exhaustive"] else []

    def explored(self, properties: Sequence[Property], probed: bool) -> Checker | None:
        setup = self.setup
        agents = system(setup.programs, setup.environment, setup.semantics, probed=probed)
        reduced = reduction(agents, properties)
        if reduced is not None:
            self.bound["partial_order"] = "independent turns of agents in one order"

        def reached(states: int) -> Graph:
            megabytes = self.limits.megabytes
            return explore(agents, states=states, seconds=self.left(), megabytes=megabytes, reduced=reduced)

        graph = reached(min(LAZY_STATES, setup.states))
        if graph.unfinished is not None:
            properties = [p for p in properties if not self.settled_early(agents, p)]
            if not properties:
                return None
            if len(graph) > LAZY_STATES:
                graph = reached(setup.states)
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
            return None
        for p in properties:
            self.results[p.key] = self.one(checker, p)
            self.checkers[p.key] = checker
            if reduced is not None:
                self.reductions[p.key] = reduced
        return checker

    def settled_early(self, agents: System, p: Property) -> bool:
        """Whether the property was decided on the part of the state space that it needs (`lazy.open_part`)."""
        try:
            part = open_part(agents, p, min(PART_STATES, self.setup.states), self.left() * LAZY_SHARE)
        except (TooDeep, TooLarge, RecursionError):
            return False
        if part is None:
            return False
        self.bound["states"] += len(part)
        self.bound["transitions"] += part.transitions
        self.checkers[p.key] = Checker(part, [p])
        self.results[p.key] = self.one(self.checkers[p.key], p)
        return True

    def one(self, checker: Checker, p: Property) -> Settled:
        try:
            result = checker.check(p, self.deadline)
        except OutOfTime:
            return Settled(Verdict.UNKNOWN, f"no time left of {self.limits.seconds:g} s")
        except (TooLarge, RecursionError):
            return Settled(Verdict.UNKNOWN, "the property's automaton is too large")
        unfinished = checker.graph.unfinished
        if result.holds and unfinished is not None and not checker.graph.settles:
            return Settled(Verdict.UNKNOWN, f"not refuted, but the state space is unfinished: {unfinished}")
        refutes = (p.forbidden is None or result.answered) and not p.indecisive
        answer = Verdict.CHECKED if result.holds else Verdict.REFUTED
        verdict, reason = self.judged(p, answer, refutes)
        return Settled(verdict, reason, answer, result.vacuous, result.immediate, result.valid, refutes)

    def judged(self, p: Property, verdict: Verdict, refutes: bool) -> tuple[Verdict, str]:
        """What an answer for a property says of its guarantee. What is forbidden after the trigger may come much later,
        for another reason: a refutation it is only where it is the answer to the trigger (`Result.answered`)."""
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
        """A run for the first refuted property of each guarantee, and of each further property."""
        groups = [claim.properties for claim in self.made.claims] + [ps for _, ps in self.made.extras]
        outside = Outside((self.ajpf.tool,) if self.ajpf is not None else ())
        with tempfile.TemporaryDirectory(prefix="avow-ail-") as ail:
            for group in groups:
                refuted = next((p for p in group if self.results[p.key].verdict is Verdict.REFUTED), None)
                if refuted is not None:
                    self.explained(refuted, Path(ail), outside)

    def explained(self, refuted: Property, ail: Path, outside: Outside) -> None:
        checker = self.checkers[refuted.key]
        lasso = checker.lasso(refuted)
        if lasso is None:  # the reduced and the whole graph disagree: never to happen, never to be passed over
            self.results[refuted.key] = Settled(Verdict.ERROR, "the checker contradicts itself")
            return
        graph = checker.graph
        if refuted.key in self.reductions:
            graph, lasso = unfolded(self.reductions[refuted.key], graph, lasso)
        found = explain(graph, lasso, refuted, self.wording)
        self.counterexamples[refuted.key] = found
        self.logs[f"{refuted.key}.trace.txt"] = _trace(found)
        if self.setup.engine in ("auto", "ajpf") and self.ajpf is not None and not self.setup.environment_class:
            name = f"AIL ({self.ajpf.version})"
            if traces():
                answer = replay(self.ajpf, self.setup, graph, lasso, ail, outside)
                self.replayed(name, refuted, answer)
            else:
                self.bound["replay"] = f"not replayed by {name}: {self.untraced()}"

    def replayed(self, name: str, refuted: Property, answer: Answer) -> None:
        """The run that refutes, done again by the real AIL: if that goes another way, our interpreter is not AIL's for
        this program, and there is no verdict on anything."""
        result = self.results[refuted.key]
        if answer.said is Said.ERROR:
            self.unanswered(answer.observed)
            self.bound["replay"] = f"not replayed by {name}: {answer.reason}"
            return
        self.logs[f"{refuted.key}.replay.txt"] = answer.log
        self.observed.update(dict.fromkeys(answer.observed))
        if answer.said is Said.HOLDS:
            opinions = {**result.opinions, name: "does the same run"}
            self.results[refuted.key] = replace(result, opinions=opinions)
            return
        reason = f"contradictory: {name} does not do the run that refutes {refuted.key}: {answer.reason}"
        self.results = {key: replace(r, verdict=Verdict.ERROR, reason=reason) for key, r in self.results.items()}
        self.counterexamples = {}

    # Others

    def ask_spin(self, checkers: Sequence[Checker]) -> None:
        if self.setup.engine == "auto" and spin_tool.version() is not None and not traces():
            self.bound["spin"] = f"no second opinion: {self.untraced()}"
            return
        name = f"Spin {spin_tool.version()}"
        answers: dict[str, bool] = {}
        seconds = min(self.left() * SPIN_SHARE, SPIN_SECONDS) if self.setup.engine == "auto" else self.left()
        deadline = time.monotonic() + seconds
        outside = Outside((spin_tool.tool(),))
        with tempfile.TemporaryDirectory() as temporary:
            try:
                for checker in checkers:
                    seconds = max(0.0, deadline - time.monotonic())
                    answers |= spin.opinions(checker, checker.properties, Path(temporary), seconds, outside)
            except spin.NoOpinion as error:
                self.unanswered(outside.observed())
                self.bound["spin"] = f"no second opinion: {error.reason}"
                if self.setup.engine == "spin":
                    verdict = Verdict.NOT_RUN if spin_tool.version() is None else Verdict.UNKNOWN
                    reason = f"the plan wants Spin's opinion: {error.reason} ({spin_tool.tool().install})"
                    self.results = {key: replace(r, verdict=verdict, reason=reason) for key, r in self.results.items()}
                return
            self.logs["spin.pml"] = read_text(Path(temporary) / "agent.pml")
        self.observed.update(dict.fromkeys(outside.observed()))
        for key, holds in answers.items():
            self.second(key, name, Said.HOLDS if holds else Said.VIOLATED)
        self.engine += f" and {name}"
        self.bound["spin"] = "asked of the program, by a translation of its own"

    def unanswered(self, observed: Iterable[Observed]) -> None:
        """What was looked at for a second opinion that did not come: it may come once that is another. What cannot be
        recorded is left out, as no answer of ours rests on it."""
        self.observed.update(dict.fromkeys(o for o in observed if o.kind is not Seen.OUTSIDE))

    def untraced(self) -> str:
        """Why another tool is not asked beside our own engine: its answer would be an undeclared input, and ours is
        none."""
        self.observed[as_here(Seen.TRACER)] = None
        return f"what it reads cannot be recorded ({remedy()})"

    def second(self, key: str, name: str, said: Said) -> None:
        """Note another engine's answer; a contradiction is an error, never a vote."""
        result = self.results[key]
        opinions = {**result.opinions, name: str(said)}
        own, other = result.answer, _SAID[said]
        decided = (Verdict.CHECKED, Verdict.REFUTED)
        if own in decided and other in decided and own is not other:
            reason = f"{ENGINE} says {own}, {name} says {said}"
            self.results[key] = replace(result, verdict=Verdict.ERROR, reason=reason, opinions=opinions)
        else:
            self.results[key] = replace(result, opinions=opinions)

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
            if answer.said is Said.VIOLATED and self.setup.environment.fair:
                reason = "AJPF knows no fairness: a run on which it fails may be unfair"
                answer = replace(answer, said=Said.INCONCLUSIVE, reason=reason)
            own = self.results[p.key]
            verdict, reason = self.judged(p, _SAID[answer.said], own.refutes and own.answer is not None)
            opinions = {} if own.answer is None else {ENGINE: str(own.answer)}
            self.results[p.key] = replace(own, verdict=verdict, reason=reason or answer.reason, opinions=opinions)


def _trace(found: Counterexample) -> str:
    lines = [found.text(), ""]
    for at, step in enumerate(found.trace):
        mark = "loop starts here: " if at == found.loop else ""
        lines.append(f"{at:4} {mark}{'; '.join(f'{name}: {value}' for name, value in step)}")
    if found.loop is not None:
        lines.append(f"     … and from step {found.loop} again, for ever")
    return "\n".join(lines) + "\n"
