"""The questions behind composition obligations, and the answers as outcomes with words for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import field, replace
from typing import Protocol, assert_never

from avow.base.files import sha256
from avow.base.optional import complete
from avow.base.plain import circle, listed
from avow.base.records import dataclass
from avow.base.tuning.effort import DEFEAT_EFFORT
from avow.base.verdict import Counterexample, Hypothesis, Link, Outcome, Verdict
from avow.calculus.composition import Composition
from avow.calculus.derivation import Case, LoopForm, Phase, Settled, SideCondition
from avow.calculus.discharge import Bounds
from avow.calculus.entailment import implied
from avow.calculus.induction import INVARIANT, in_words
from avow.calculus.variables import Frame
from avow.calculus.wiring import start_name
from avow.formulas.formula import negation
from avow.kernel.check import Established
from avow.language.printer import show_term
from avow.language.subterms import ports_of
from avow.sanity.claims import triggers
from avow.solving.questions import solve
from avow.solving.sizes import in_every_size
from avow.system.graph import to_delay


@dataclass(frozen=True, slots=True)
class Answer:
    """An `Outcome` whose obligation is not yet known."""

    verdict: Verdict
    summary: str
    counterexample: Counterexample | None = None
    within: tuple[Hypothesis, ...] = ()
    """Limits of a bounded answer."""
    bound: dict[str, object] = field(default_factory=dict)
    details: dict[str, object] = field(default_factory=dict)
    vacuous: bool = False
    link: Link = Link.GENERATED
    established: Established | None = None
    """The kernel's result: without it, no answer of the calculus is `proved`."""
    everything: bool = False
    """It depends on every guarantee of every node, and on whatever discharges their assumptions."""

    def outcome(self, obligation: str, rests_on: tuple[Hypothesis, ...] = ()) -> Outcome:
        return Outcome(
            obligation,
            self.verdict,
            self.summary,
            self.counterexample,
            (),
            self.bound,
            self.details,
            self.link,
            self.vacuous or (self.established is not None and self.established.vacuous),
            (*rests_on, *self.within),
        )


class Question(Protocol):
    """Answers one obligation."""

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer: ...


# -- side conditions ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class SideQuestion:
    """Does the consumer's assumption follow?"""

    goal: str
    condition: SideCondition

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        goal = composition.goal(self.goal)
        settled = composition.settled(goal, bounds).settled[self.condition]
        frame = composition.frame_of(goal)
        if settled.verdict is not Verdict.PROVED:
            return as_far_as_shown(frame, _side_answer(frame, settled))
        answer = _side_answer(frame, settled)
        found = composition.certificates.condition(goal, str(self.condition.about), bounds)
        fallen = composition.fallen(goal, self.condition.consumer) if found is None else ()
        return certified(answer, found, late=composition.certificates.late, fallen=fallen)


def certified(answer: Answer, found: Established | None, *, late: bool, fallen: Sequence[str] = ()) -> Answer:
    """The answer for a proof that was found: proved if the kernel establishes it. If not, and a Z3 query ran out of
    time (`late`), the verdict is `error`: a faster machine might answer. `fallen`: side conditions that do not hold,
    which may be the reason."""
    if found is None:
        text = f"a proof was found ({answer.summary}), but the kernel could not establish it"
        if fallen:
            text += f": these side conditions do not hold, and nothing may rest on them: {listed(fallen, 3)}"
        if late:
            text += ": a question to Z3 ran out of time before it ran out of steps; run again"
        return replace(answer, verdict=Verdict.ERROR if late else Verdict.UNKNOWN, summary=text, vacuous=False)
    details = answer.details | {"certificate": {"key": found.key, "solvers": found.solvers}}
    return replace(answer, established=found, details=details)


def as_far_as_shown(frame: Frame, answer: Answer) -> Answer:
    """The answer, with a refutation turned into unknown if a clause was left out that may exclude the step or run
    shown. A circular proof stays a refutation in any case."""
    if not frame.left_out or answer.verdict is not Verdict.REFUTED or "circle" in answer.details:
        return answer
    kept = {key: value for key, value in answer.details.items() if key != "run"}
    shown = answer.counterexample
    broken = None if shown is None else Counterexample(shown.values, _not_kept_to(frame), shown.trace, shown.loop)
    summary = f"{answer.summary.partition('; ')[0]}, but {_not_kept_to(frame)}"
    return replace(
        answer, verdict=Verdict.UNKNOWN, summary=summary, counterexample=broken, details=kept | {"genuine": False}
    )


def _not_kept_to(frame: Frame) -> str:
    """Why a counterexample may be spurious: `Frame.left_out`."""
    return f"what has no formula of one step is left out, and may exclude it: {', '.join(frame.left_out)}"


def _side_answer(frame: Frame, settled: Settled) -> Answer:
    """The answer for a checked side condition."""
    condition = settled.condition
    details: dict[str, object] = {
        "consumer": condition.consumer,
        "clause": condition.clause,
        "providers": list(condition.providers),
        "needed": list(settled.needed),
        "trivial": settled.trivial,
        "cases": [
            {"phase": c.phase.value, "verdict": c.verdict.value, "needed": list(c.needed), "engine": c.engine}
            for c in settled.cases
        ],
    }
    if by := [in_words(frame, case.invariant) for case in settled.cases if case.invariant]:
        details["invariants"] = by
    bad = next((case for case in settled.cases if case.verdict is not Verdict.PROVED), None)
    if settled.circle:
        shown = circle(settled.circle)
        summary = f"circular: proved only from contracts whose own assumptions rest on it ({shown})"
        hint = "delay an edge of the cycle and give it an initial value"
        details["circle"] = list(settled.circle)
        return Answer(Verdict.REFUTED, f"{summary}; {hint}", Counterexample(explanation=summary), details=details)
    if bad is None:
        return Answer(Verdict.PROVED, _why(frame, settled), details=details, vacuous=settled.vacuous)
    if bad.verdict is Verdict.REFUTED or bad.counterexample is not None:
        fails = bad.verdict is not Verdict.REFUTED
        summary = _induction_fails(condition, bad) if fails else _why_not(condition, bad)
        details |= {"induction": "fails"} if fails else {}
        return Answer(bad.verdict, summary, _counterexample(bad, condition), details=details)
    return Answer(Verdict.UNKNOWN, f"the solver gave up: {bad.reason or 'no reason given'}", details=details)


def _why(frame: Frame, settled: Settled) -> str:
    if settled.vacuous:
        return f"holds only because these contradict one another: {', '.join(settled.needed)}"
    needed = ", ".join(label for label in settled.needed if not label.startswith(INVARIANT))
    found = [in_words(frame, case.invariant) for case in settled.cases if case.invariant]
    needed += f"; by an invariant that was found: {' and '.join(found)}" if found else ""
    if settled.trivial and not settled.needed:
        return "holds by the types alone: no guarantee carries it"
    if settled.trivial:
        return f"no guarantee carries it: follows from {needed}"
    if len(settled.cases) > 1:
        return f"at the first step and, if at one step then at the next: from {needed}"
    return f"follows from {needed}"


def _induction_fails(condition: SideCondition, case: Case) -> str:
    shown = case.counterexample.values[:6] if case.counterexample is not None else ()
    at = f" at {', '.join(f'{name} = {value}' for name, value in shown)}" if shown else ""
    return (
        f"not inductive: {condition.about} holds at the first step, but induction fails{at}: that such a step is ever "
        "reached is not shown"
    )


def _why_not(condition: SideCondition, case: Case) -> str:
    when = "" if case.phase is Phase.SAME_STEP else f" at {case.phase.value}"
    if case.counterexample is not None and case.counterexample.trace:
        when = f" at step {len(case.counterexample.trace)} of a run"
    if not condition.providers:
        return f"nothing makes {condition.about} hold{when}"
    return f"{', '.join(condition.providers)} may leave {condition.about} false{when}"


def _counterexample(case: Case, condition: SideCondition) -> Counterexample | None:
    found = case.counterexample
    if found is None:
        return None
    if found.trace:
        return found
    if case.verdict is not Verdict.REFUTED:
        text = f"here induction fails, {condition.about} is false, if such a step is reached (@before: one step before)"
        return Counterexample(found.values, text)
    when = "" if case.phase is Phase.SAME_STEP else f" ({case.phase.value}; @before is the value of the step before)"
    return Counterexample(found.values, f"{condition.about} is false{when}", found.trace, found.loop)


@dataclass(frozen=True, slots=True)
class RuleQuestion:
    """A rule that the plan names and that does not fit: refuted without a query."""

    message: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        return Answer(Verdict.REFUTED, self.message, Counterexample(explanation=self.message))


def common_key(found: Sequence[Established]) -> str:
    """The key of an answer made up of several claims (for a loop, the side conditions of its members); for one claim,
    its own key."""
    return found[0].key if len(found) == 1 else sha256("".join(one.key for one in found))


def made_up(answer: Answer, found: Sequence[Established] | None, *, late: bool) -> Answer:
    """The same as `certified`, for a proof made up of several claims."""
    if found is None:
        return certified(answer, None, late=late)
    certificate = {"key": common_key(found), "solvers": min((one.solvers for one in found), default=1)}
    return replace(answer, details=answer.details | {"certificate": certificate})


def _counted(found: tuple[Verdict, str]) -> Answer:
    """The answer for a claim that depends on how many elements an unspecified type has."""
    verdict, why = found
    return Answer(verdict, why, Counterexample(explanation=why) if verdict is Verdict.REFUTED else None)


# -- loops and start-up ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class LoopQuestion:
    """Is R4's missing premise met?"""

    goal: str
    members: tuple[str, ...]
    entered: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        goal = composition.goal(self.goal)
        loop = next(loop for loop in composition.settled(goal, bounds).loops if loop.members == self.members)
        details: dict[str, object] = {"form": loop.form.value, "cycle": list(loop.cycle)}
        match loop.form:
            case LoopForm.BOOTSTRAP | LoopForm.INITIAL:
                parts = (part for part in goal.root.walk() if part.nodes == self.members)
                about = [str(condition.about) for part in parts for condition in part.side_conditions]
                found = [composition.certificates.condition(goal, one, bounds) for one in about]
                proof = Answer(Verdict.PROVED, loop.note, details=details)
                return made_up(proof, complete(found), late=composition.certificates.late)
            case LoopForm.CIRCULAR:
                return Answer(Verdict.REFUTED, loop.note, Counterexample(explanation=loop.note), details=details)
            case _ if self.entered:
                return Answer(Verdict.JUSTIFIED, self.entered, details=details, link=Link.GUIDED)
            case LoopForm.ENTERED | LoopForm.OPEN:  # neither well-founded nor shown to be circular
                return Answer(Verdict.UNKNOWN, loop.note, details=details)
            case _:
                assert_never(loop.form)


@dataclass(frozen=True, slots=True)
class StartQuestion:
    """Does something come first in the loop?"""

    members: tuple[str, ...]

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        graph = composition.frame.graph
        stuck = [cycle for cycle in graph.deadlocks if set(cycle) <= set(self.members)]
        if stuck:
            shown = "; ".join(circle([n for n in cycle if n not in graph.relays]) for cycle in stuck)
            advice = to_delay(stuck[0], graph.edges, graph.relays)
            summary = f"start-up deadlock: {shown}: each waits for the one before it"
            return Answer(
                Verdict.REFUTED,
                f"{summary}; declare an edge delayed, with an initial value",
                Counterexample(explanation=summary),
                details={"cycles": [list(cycle) for cycle in stuck], "next": advice},
            )
        initials = composition.frame.initials(frozenset(self.members))
        solution = solve(initials, effort=bounds.effort, seed=bounds.seed)
        listed = ", ".join(initials)
        match solution.status:
            case "sat":
                counted = in_every_size(
                    {}, initials, what="the initial conditions", effort=bounds.effort, seed=bounds.seed
                )
                if counted[0] is not Verdict.PROVED:
                    return _counted(counted)
                proof = Answer(Verdict.PROVED, f"delayed edges start it: {listed}", details={"initial": list(initials)})
                found = composition.certificates.existence(start_name(self.members))
                made = made_up(proof, found, late=composition.certificates.late)
                return replace(made, established=found[0] if found else None)
            case "unsat":
                summary = f"no values are as the plan says: {', '.join(solution.core)}"
                return Answer(Verdict.REFUTED, summary, Counterexample(explanation=summary))
            case "unknown":
                return Answer(Verdict.UNKNOWN, f"whether there are such initial values: {solution.reason}")
            case _:
                assert_never(solution.status)


# -- arguments ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ArgumentQuestion:
    """Does the plan give a reason? Nothing more is checked: a person judges the reason."""

    key: str
    because: str
    goal: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        if self.because:
            return Answer(Verdict.JUSTIFIED, self.because, link=Link.GUIDED)
        return _without_reason(f"compose: {{{self.goal}: {{{self.key}: {{because: …}}}}}}")


def _without_reason(where: str) -> Answer:
    text = f"the plan gives no reason for it, so that what follows is conditional (to say why: {where})"
    return Answer(Verdict.UNKNOWN, text, link=Link.GUIDED)


@dataclass(frozen=True, slots=True)
class EnvironmentQuestion:
    """Does the plan give a reason for what it assumes about the environment? Can all these assumptions hold together
    for ever, and can each guarantee's condition still arise? Otherwise everything that follows is vacuous."""

    because: str
    label: str = ""
    """The label of the assumption (`Composition.assumed`); empty if the assumption is that an input is constant."""

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        if not self.because:
            return _without_reason("environment: {in.<port>: {assume: …, because: …}}")
        found = composition.lasting(bounds)
        if found.verdict is Verdict.REFUTED:
            text = f"vacuous: no environment meets for ever all that is assumed of it: {found.explanation}"
            return Answer(Verdict.JUSTIFIED, text, link=Link.GUIDED, vacuous=True)
        if not found.verdict.supports:
            text = f"whether an environment can meet for ever all that is assumed of it is open: {found.explanation}"
            return Answer(found.verdict, text, link=Link.GUIDED)
        excluded = next(self._excluded(composition), None) if self.label else None
        excluded = excluded or next(iter(composition.excluded_over_runs(bounds)), None)
        if excluded is not None:
            text = f"vacuous: what {excluded} is about can never come about where this is so"
            return Answer(Verdict.JUSTIFIED, text, link=Link.GUIDED, vacuous=True)
        return Answer(Verdict.JUSTIFIED, self.because, link=Link.GUIDED)

    def _excluded(self, composition: Composition) -> Iterator[str]:
        """The guarantees whose condition this assumption makes impossible, while their nodes' contracts do not."""
        frame, environment = composition.frame, composition.assumed()
        about = ports_of(environment[self.label])
        for node in (name for name in frame.graph.nodes if not self.label.startswith(f"{name}.")):
            for guarantee in frame.node(node).guarantees:
                for situation in triggers(frame.clause(node, guarantee.name)):
                    if not set(about) & set(ports_of(situation)):
                        continue
                    known = composition.restricting(node, situation) | environment
                    answer = implied(known, negation(situation), effort=DEFEAT_EFFORT, whether=True)
                    if answer.verdict is Verdict.PROVED and self.label in answer.needed:
                        yield f"{node}.{guarantee.name}"


# -- joint models ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class JointQuestion:
    """Can the situation that a guarantee is about arise when all guarantees of a cycle hold at one instant?"""

    members: tuple[str, ...]
    node: str
    clause: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        frame = composition.frame
        if frame.left_out:
            return Answer(Verdict.UNKNOWN, f"it is unknown whether there is room: {_not_kept_to(frame)}")
        hypotheses = frame.contracts(self.members) | frame.environment() | frame.memory()
        about = f"{self.node}.{self.clause}"
        shown: list[str] = []
        for situation in triggers(frame.clause(self.node, self.clause)):
            answer = implied(hypotheses, negation(situation), effort=bounds.effort, seed=bounds.seed)
            details: dict[str, object] = {"needed": list(answer.needed), "situation": show_term(situation)}
            own = all(label.startswith(f"{self.node}.") for label in answer.needed)
            if answer.verdict is Verdict.PROVED and own and not answer.vacuous:
                shown.append("its own contract excludes it already (a sanity finding): composing adds nothing to that")
                continue
            if answer.verdict is Verdict.PROVED:
                carriers = ", ".join(answer.needed) or "the types"
                if answer.vacuous:
                    summary = f"the guarantees contradict one another at one instant: {carriers}"
                else:
                    summary = f"degenerate: at one instant, {carriers} exclude what {about} is about"
                hint = "a value of the step before is meant: declare the edge delayed"
                shape = Counterexample(explanation=summary)
                return Answer(Verdict.REFUTED, f"{summary}; {hint}", shape, details=details)
            if answer.verdict is not Verdict.REFUTED:
                return Answer(Verdict.UNKNOWN, f"the solver gave up: {answer.reason}", details=details)
            what = f"what {about} is about"
            counted = in_every_size(hypotheses, {what: situation}, what=what, effort=bounds.effort, seed=bounds.seed)
            if counted[0] is not Verdict.PROVED:
                return _counted(counted)
            shown.append(answer.counterexample.text() if answer.counterexample else "")
        room = Answer(Verdict.PROVED, f"there is room: {'; '.join(shown)}")
        found = composition.certificates.existence(f"joint.{about}")
        return made_up(room, found, late=composition.certificates.late)
