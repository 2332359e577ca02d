"""Side conditions, put to the solver: proved, refuted with a counterexample in the contract's words, or unknown.

A consumer's assumption has to follow from what its providers guarantee (and assume: the conclusion is under that) at
the same step, from the plan's environment assumptions, and, for a value that comes over a delayed edge, from its
initial value at the first step and from what held one step earlier at every later one. This is induction over steps
and, within a step, over the order in which values flow; it is sound as long as no assumption is used, at one step, to
prove itself. Where proofs would do that, others are looked for; where there are none, the rule is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace

from avow.base.files import sha256
from avow.base.graphs import components, cycle_in
from avow.base.records import dataclass
from avow.base.tuning.effort import NARROW_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.derivation import Case, ClauseName, Derivation, Goal, LoopForm, Phase, Rule, Settled, SideCondition
from avow.calculus.entailment import implied
from avow.calculus.induction import INVARIANT, Deeper, further, steps
from avow.calculus.kept_answers import keep_not_proved, not_proved_before
from avow.calculus.repair import Offer, environment, initial_values, offers, providers
from avow.calculus.variables import Facts, Frame, bearing, closest, indexed
from avow.formulas.formula import free_variables
from avow.language.terms import Term

Hypotheses = dict[str, Term]


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds on one question to the solver."""

    effort: int = 10_000
    seed: int = 0


@dataclass(frozen=True, slots=True)
class Loop:
    """A loop of the derivation, and the form in which R4's missing premise is met."""

    members: tuple[str, ...]
    form: LoopForm
    cycle: tuple[str, ...]
    note: str


@dataclass(frozen=True, slots=True)
class Answers:
    """All side conditions of a goal, settled."""

    goal: Goal
    settled: Mapping[SideCondition, Settled]
    loops: tuple[Loop, ...]

    @property
    def verdict(self) -> Verdict:
        """Whether the whole derivation stands (up to its hypotheses)."""
        verdicts = {answer.verdict for answer in self.settled.values()}
        if Verdict.REFUTED in verdicts or any(loop.form is LoopForm.CIRCULAR for loop in self.loops):
            return Verdict.REFUTED
        return Verdict.UNKNOWN if verdicts - {Verdict.PROVED} else Verdict.PROVED


Told = Callable[[str, Settled], None]
"""What hears of a goal's side condition, by the goal's name: the answer may change yet where proofs go in a circle."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A side condition's obligation: its digest, and whether it is asked for."""

    digest: str
    wanted: bool


def settle(
    frame: Frame,
    goal: Goal,
    bounds: Bounds | None = None,
    told: Told | None = None,
    claims: Mapping[SideCondition, Claim] | None = None,
) -> Answers:
    """Discharge every side condition of a derivation, and judge its loops. Of `claims` that are not asked for it is
    enough to know that they were not proved before (`avow.calculus.kept_answers`)."""
    bounds = bounds or Bounds()
    solver = _Solver(frame, frozenset(goal.nodes), bounds, frozenset(goal.root.assumed))
    settled: dict[SideCondition, Settled] = {}
    for condition in goal.conditions:
        claim = claims.get(condition) if claims is not None else None
        mark = sha256(f"{goal.name} {claim.digest} {bounds.effort} {bounds.seed}") if claim is not None else ""
        before = not_proved_before(mark) if claim is not None and not claim.wanted else None
        if before is not None:
            settled[condition] = Settled(condition, before.verdict, (), before.used, before.used_before)
            continue
        answer = settled[condition] = solver.condition(condition)
        if answer.verdict is not Verdict.PROVED and not answer.circle:
            keep_not_proved(mark, answer.verdict, answer.used, answer.used_before)
        if told is not None:
            told(goal.name, settled[condition])
    settled = _break_circles(solver, settled)
    if frame.left_out:  # an example that keeps to all that was said need not keep to that
        settled = {
            c: s if s.circle or s.verdict is Verdict.PROVED else replace(s, verdict=Verdict.UNKNOWN)
            for c, s in settled.items()
        }
    loops = tuple(_loop(frame, goal, part, settled) for part in goal.root.walk() if part.rule is Rule.R4)
    return Answers(goal, settled, loops)


def would_hold(frame: Frame, goal: Goal, settled: Settled) -> tuple[tuple[Phase, tuple[Offer, ...]], ...]:
    """For each case of a side condition that is refuted: the clauses with any one of which it would be proved.

    Nothing is offered where values run in a circle through the consumer within one step: what would be proved there
    might be circular.
    """
    condition = settled.condition
    solver = _Solver(frame, frozenset(goal.nodes), Bounds(), frozenset(goal.root.assumed))
    consumer = condition.consumer
    attempts = tuple(solver.attempts(condition, [*condition.providers], solver.selected))
    same, before = attempts[-1]
    if settled.circle or any(consumer in frame.graph.ancestors(name, solver.selected) for name in same):
        return ()
    found: list[tuple[Phase, tuple[Offer, ...]]] = []
    for case in settled.cases:
        if case.verdict is not Verdict.REFUTED and case.counterexample is None:
            continue
        hypotheses, claim = solver.question(condition, case.phase, same, before, True)
        near = [name for name in condition.providers if name in same]
        places = [*providers(frame, dict.fromkeys((*near, *same)))]
        if case.phase is Phase.INITIAL:
            places = [*initial_values(frame, consumer), *places]
        if case.phase is Phase.LATER:
            direct = [name for name in condition.providers if solver.feeds(name, consumer, delayed=True)]
            places = [*providers(frame, direct, 1), *places, *environment(frame, (*before, consumer), 1)]
        places += environment(frame, (*same, consumer))
        spoken = set().union(*map(free_variables, (claim, *hypotheses.values())))
        found.append(
            (case.phase, offers(frame, hypotheses, claim, (p for p in places if not spoken.isdisjoint(p.ports))))
        )
    return tuple(found)


@dataclass(slots=True)
class _Solver:
    frame: Frame
    selected: frozenset[str]
    bounds: Bounds
    kept: frozenset[ClauseName]
    """Assumptions that the conclusion leaves assumed: a node's own may be used for its other ones."""

    def condition(self, condition: SideCondition, allowed: frozenset[str] | None = None) -> Settled:
        """Settle one side condition; `allowed`: the nodes whose contracts may be used at the same step.

        The nearest hypotheses are tried first: they make the proof that a reader expects, and the question small.
        """
        allowed = self.selected if allowed is None else allowed
        direct = [p for p in condition.providers if p in allowed]
        attempts = self.attempts(condition, direct, allowed)
        widest = next(attempts)
        if (close := self.close(condition, *widest)) is not None:
            return close
        asked: list[tuple[tuple[Phase, ...], list[tuple[Hypotheses, Term]]]] = []
        patient = False
        # Of a node far down a chain all of it are ancestors: wider questions are written down only where one is asked.
        left = [(widest, False)]
        for number, (attempt, wide) in enumerate(left):
            widest = attempt
            phases = self.phases(condition, attempt[1])
            found = (phases, [self.question(condition, phase, *attempt, wide) for phase in phases])
            if found not in asked:
                asked.append(found)
                patient = 0 < number == len(left) - 1
                answer = self.asked(condition, *found, patient=patient)
                if answer.verdict is Verdict.PROVED:
                    return answer
            if number == 0:
                left += [(each, True) for each in attempts] or [(widest, True)]
        if not patient:  # the last one that was another question
            answer = self.asked(condition, *asked[-1], patient=True)
            if answer.verdict is Verdict.PROVED:
                return answer
        # Only the widest hypotheses refute: narrower ones may just have left something out.
        return self.by_itself(condition, *widest) or self.deeper(condition, answer, *widest)

    def asked(
        self,
        condition: SideCondition,
        phases: tuple[Phase, ...],
        questions: Sequence[tuple[Hypotheses, Term]],
        *,
        patient: bool,
    ) -> Settled:
        """Only the widest question is worth the whole time: what a narrower one cannot settle, that may."""
        effort = self.bounds.effort if patient else min(self.bounds.effort, NARROW_EFFORT)
        pairs = zip(phases, questions, strict=True)
        return _settled(condition, tuple(self.ask(p, *q, effort, whether=not patient) for p, q in pairs))

    def phases(self, condition: SideCondition, before: tuple[str, ...]) -> tuple[Phase, ...]:
        """One question, or one about the first step and one about every later."""
        remembering = self.frame.remembering(self.selected)
        return (Phase.INITIAL, Phase.LATER) if before or condition.delayed or remembering else (Phase.SAME_STEP,)

    def close(self, condition: SideCondition, same: tuple[str, ...], before: tuple[str, ...]) -> Settled | None:
        """A proof from what speaks of the goal's variables alone, if there is one. A provider of a thousand consumers
        guarantees a thousand things, of which each consumer needs a few."""
        cases: list[Case] = []
        for phase in self.phases(condition, before):
            goal, parts = (
                self.frame.clause(condition.consumer, condition.clause),
                self.parts(condition, phase, same, before),
            )
            hypotheses = closest(parts, goal)
            if len(hypotheses) == sum(len(part.terms) for part in parts):
                return None  # these are all: the first attempt asks just that
            case = self.ask(phase, hypotheses, goal, min(self.bounds.effort, NARROW_EFFORT), whether=True)
            if case.verdict is not Verdict.PROVED:
                return None
            cases.append(case)
        return _settled(condition, tuple(cases))

    def parts(
        self, condition: SideCondition, phase: Phase, same: tuple[str, ...], before: tuple[str, ...]
    ) -> list[Facts]:
        """All that may be used in a phase."""
        found = [self.frame.promised(node) for node in same]
        if phase is Phase.LATER:
            found += [self.frame.promised(node, 1) for node in before]
        found += [self.frame.surroundings(), indexed(self.own(condition.consumer))]
        if phase is Phase.LATER:
            found.append(self.frame.surroundings(1))
        elif phase is Phase.INITIAL:
            found.append(self.frame.beginnings(self.selected))
        return found

    def by_itself(self, condition: SideCondition, same: tuple[str, ...], before: tuple[str, ...]) -> Settled | None:
        """Where a node feeds itself at the same step, and what it guarantees would show what it assumes: circular."""
        consumer = condition.consumer
        if not self.feeds(consumer, consumer, delayed=False):
            return None
        guaranteed = {
            f"{consumer}.{g.name}": self.frame.clause(consumer, g.name) for g in self.frame.node(consumer).guarantees
        }
        cases: list[Case] = []
        for phase in self.phases(condition, before):
            hypotheses, goal = self.question(condition, phase, same, before, True)
            cases.append(self.ask(phase, hypotheses | guaranteed, goal, NARROW_EFFORT))
        answer = _settled(condition, tuple(cases))
        if answer.verdict is not Verdict.PROVED:
            return None
        return replace(answer, verdict=Verdict.REFUTED, circle=(consumer,))

    def deeper(
        self, condition: SideCondition, settled: Settled, same: tuple[str, ...], before: tuple[str, ...]
    ) -> Settled:
        """A later step at which the assumption may be false refutes nothing before that step is shown to be reached:
        from the initial values, by as many steps as it takes; else it is only induction that fails."""
        first = next((case for case in settled.cases if case.phase is Phase.INITIAL), None)
        later = next((case for case in settled.cases if case.phase is Phase.LATER), None)
        if first is None or later is None or later.verdict is not Verdict.REFUTED:
            return settled
        found = Deeper()
        if first.verdict is Verdict.PROVED:
            frame = self.frame
            asked = steps(
                frame,
                self.frame.contracts(tuple(dict.fromkeys((*before, *self.selected_in_order))), 0)
                | frame.environment()
                | frame.memory(),
                self.frame.contracts(same) | frame.environment() | frame.memory() | self.own(condition.consumer),
                frame.initials(self.selected) | frame.blank(),
                frame.clause(condition.consumer, condition.clause),
            )
            found = further(frame, asked, self.bounds.effort, self.bounds.seed, str(condition.about))
        if found.proved is not None:
            case = Case(
                Phase.LATER,
                Verdict.PROVED,
                found.proved,
                engine=found.engine,
                depth=found.steps,
                invariant=found.by,
            )
        elif found.run is not None:
            case = replace(later, counterexample=found.run)
        else:
            case = replace(later, verdict=Verdict.UNKNOWN, reason="induction over steps fails")
        return _settled(condition, tuple(case if one is later else one for one in settled.cases))

    @property
    def selected_in_order(self) -> tuple[str, ...]:
        return tuple(node for node in self.frame.graph.nodes if node in self.selected)

    def attempts(
        self, condition: SideCondition, direct: list[str], allowed: frozenset[str]
    ) -> Iterator[tuple[tuple[str, ...], tuple[str, ...]]]:
        """Ever wider sets of nodes whose contracts serve as hypotheses: at the same step, and one step earlier."""
        consumer = condition.consumer
        near = tuple(p for p in direct if p != consumer and self.feeds(p, consumer, delayed=False))
        before = tuple(p for p in condition.providers if self.feeds(p, consumer, delayed=True))
        first = before if condition.delayed else ()
        yield near, first
        tried = {(near, first)}
        ancestors = self.frame.graph.ancestors(consumer, allowed)
        # What holds one step earlier holds of every selected node: each step's assumptions come before the next's.
        earlier = tuple(
            dict.fromkeys(
                edge.source.node
                for node in (*ancestors, consumer)
                for edge in self.frame.graph.feeding(node)
                if edge.delayed and edge.source.node in self.selected
            )
        )
        remembering = self.frame.remembering(self.selected)
        everything = tuple(dict.fromkeys((*earlier, *ancestors, consumer))) if earlier or remembering else ()
        for attempt in ((ancestors, first), (ancestors, earlier), (ancestors, everything)):
            if attempt not in tried:
                tried.add(attempt)
                yield attempt

    def feeds(self, provider: str, consumer: str, *, delayed: bool) -> bool:
        return any(e.source.node == provider and e.delayed is delayed for e in self.frame.graph.feeding(consumer))

    def ask(self, phase: Phase, hypotheses: Hypotheses, goal: Term, patience: int, *, whether: bool = False) -> Case:
        """`whether`: what does not prove it is looked at no further."""
        answer = implied(hypotheses, goal, effort=patience, seed=self.bounds.seed, whether=whether)
        return Case(
            phase,
            answer.verdict,
            answer.needed,
            answer.counterexample,
            answer.vacuous,
            answer.reason,
            answer.engine,
        )

    def question(
        self, condition: SideCondition, phase: Phase, same: tuple[str, ...], before: tuple[str, ...], wide: bool
    ) -> tuple[Hypotheses, Term]:
        goal = self.frame.clause(condition.consumer, condition.clause)
        hypotheses = self.frame.contracts(same)
        around = self.frame.environment(0) | self.frame.memory(0) | self.own(condition.consumer)
        if phase is Phase.LATER:
            hypotheses |= self.frame.contracts(before, 1)
            around |= self.frame.environment(1) | self.frame.memory(1)
        elif phase is Phase.INITIAL:
            around |= self.frame.initials(self.selected) | self.frame.blank()
        spoken = free_variables(goal).union(*map(free_variables, hypotheses.values()))
        hypotheses |= bearing(around, spoken, direct=not wide)
        return hypotheses, goal

    def own(self, consumer: str) -> Hypotheses:
        """What a consumer assumes that stays assumed."""
        names = (ClauseName(consumer, clause.name) for clause in self.frame.node(consumer).assumptions)
        return {str(name): self.frame.clause(name.node, name.clause) for name in names if name in self.kept}


def _settled(condition: SideCondition, cases: tuple[Case, ...]) -> Settled:
    verdicts = [case.verdict for case in cases]
    if Verdict.REFUTED in verdicts:
        verdict = Verdict.REFUTED
    elif all(v is Verdict.PROVED for v in verdicts):
        verdict = Verdict.PROVED
    else:
        verdict = Verdict.UNKNOWN
    used: dict[str, None] = {}
    used_before: dict[str, None] = {}
    for case in cases:
        for label in case.needed:
            owner = label.split(".")[0]
            if label.startswith(("environment ", "initial ", "memory ", INVARIANT)):
                continue
            if owner == condition.consumer and not label.endswith(" one step before"):
                continue  # its own, and still assumed in the conclusion
            (used_before if label.endswith(" one step before") else used)[owner] = None
    return Settled(condition, verdict, cases, tuple(used), tuple(used_before))


def _break_circles(solver: _Solver, settled: dict[SideCondition, Settled]) -> dict[SideCondition, Settled]:
    """Where proofs use, at one step, the contract of a node whose assumption they serve to prove: find others.

    Nodes are established one after the other, each from those before it. What can be established in no order is
    circular: its proofs do not count.
    """
    consumers = tuple(dict.fromkeys(condition.consumer for condition in settled))
    arcs = [(used, answer.condition.consumer) for answer in settled.values() for used in answer.used]
    found = dict(settled)
    for group in components(consumers, arcs):
        if len(group) < 2:
            continue
        waiting = list(group)
        established = solver.selected - set(group)
        progress = True
        while waiting and progress:
            progress = False
            for node in list(waiting):
                mine = [condition for condition in settled if condition.consumer == node]
                answers = {condition: solver.condition(condition, established) for condition in mine}
                if all(answer.verdict is Verdict.PROVED for answer in answers.values()):
                    found |= answers
                    established |= {node}
                    waiting.remove(node)
                    progress = True
        circle = cycle_in(waiting, arcs) or tuple(waiting)
        for condition, answer in settled.items():
            if condition.consumer in waiting and answer.verdict is Verdict.PROVED and set(answer.used) & set(waiting):
                found[condition] = replace(answer, verdict=Verdict.REFUTED, circle=circle)
    return found


def _loop(frame: Frame, goal: Goal, part: Derivation, settled: Mapping[SideCondition, Settled]) -> Loop:
    members = set(part.nodes)
    answers = [settled[condition] for condition in part.side_conditions]
    arcs = [(e.source.node, e.target.node) for e in part.linking if e.source.node in members]
    cycle = cycle_in(part.nodes, arcs)
    circles = [answer.circle for answer in answers if answer.circle]
    if circles:
        shown = " → ".join((*circles[0], circles[0][0]))
        return Loop(part.nodes, LoopForm.CIRCULAR, circles[0], f"each assumption is proved from the next: {shown}")
    if all(answer.verdict is Verdict.PROVED for answer in answers):
        if not any(answer.used_before for answer in answers) and all(len(answer.cases) == 1 for answer in answers):
            note = "no member's assumption depends on what comes round the loop"
            return Loop(part.nodes, LoopForm.BOOTSTRAP, cycle, note)
        note = "the initial values satisfy the assumptions, and each round of the loop keeps them"
        return Loop(part.nodes, LoopForm.INITIAL, cycle, note)
    return Loop(part.nodes, LoopForm.OPEN, cycle, "some assumption of a member is not shown")
