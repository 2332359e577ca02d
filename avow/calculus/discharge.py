"""Side conditions, checked by the solver: proved, refuted with a counterexample in the contract's terms, or unknown.

A consumer's assumption has to follow from its providers' guarantees at the same step (and their assumptions, which the
conclusion assumes), from the plan's environment assumptions, and, for a value that comes over a delayed edge, from its
initial value at the first step and from what held one step earlier at every later one. This is induction over steps
and, within a step, over the order in which values flow. It is sound as long as no assumption is used, at one step, to
prove itself. If proofs would do that, other proofs are searched for; without one, the rule is refused.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from avow.base.files import sha256
from avow.base.graphs import components, cycle_in
from avow.base.plain import circle
from avow.base.records import dataclass
from avow.base.tuning.effort import NARROW_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.derivation import Case, ClauseName, Derivation, Goal, LoopForm, Phase, Rule, Settled, SideCondition
from avow.calculus.entailment import NotProved, implied, kept_answers
from avow.calculus.induction import INVARIANT, Deeper, further, steps
from avow.calculus.variables import Frame, bearing, closest, indexed
from avow.formulas.formula import free_variables
from avow.language.terms import Term

Hypotheses = dict[str, Term]
Premises = tuple[tuple[str, ...], tuple[str, ...]]
"""The nodes whose contracts may be used: at the same step, and one step earlier."""


@dataclass(frozen=True, slots=True)
class Bounds:
    """Bounds on one solver query."""

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
    """All side conditions of a goal with their answers."""

    goal: Goal
    settled: Mapping[SideCondition, Settled]
    loops: tuple[Loop, ...]

    @property
    def verdict(self) -> Verdict:
        """The verdict of the whole derivation, up to its hypotheses."""
        verdicts = {answer.verdict for answer in self.settled.values()}
        if Verdict.REFUTED in verdicts or any(loop.form is LoopForm.CIRCULAR for loop in self.loops):
            return Verdict.REFUTED
        return Verdict.UNKNOWN if verdicts - {Verdict.PROVED} else Verdict.PROVED


Progress = Callable[[str, Settled], None]
"""Called with the goal's name and a side condition's answer, which may still change if proofs are circular."""


@dataclass(frozen=True, slots=True)
class Claim:
    """A side condition's obligation: its digest, and whether it is requested."""

    digest: str
    wanted: bool


def settle(
    frame: Frame,
    goal: Goal,
    bounds: Bounds | None = None,
    report: Progress | None = None,
    claims: Mapping[SideCondition, Claim] | None = None,
) -> Answers:
    """Check every side condition of a derivation, and judge its loops. For `claims` that are not requested, the earlier
    result that they were not proved is enough (`avow.calculus.entailment`)."""
    bounds = bounds or Bounds()
    solver = _Solver(frame, frozenset(goal.nodes), bounds, frozenset(goal.root.assumed))
    settled: dict[SideCondition, Settled] = {}
    kept = kept_answers()
    for condition in goal.conditions:
        claim = claims.get(condition) if claims is not None else None
        mark = sha256(f"{goal.name} {claim.digest} {bounds.effort} {bounds.seed}") if claim is not None else ""
        before = kept.find(mark) if kept is not None and claim is not None and not claim.wanted else None
        if isinstance(before, NotProved):
            settled[condition] = Settled(condition, before.verdict, (), before.used, before.used_before)
            continue
        answer = settled[condition] = solver.condition(condition)
        if kept is not None and mark and answer.verdict is not Verdict.PROVED and not answer.circle:
            kept.now[mark] = NotProved(answer.verdict, answer.used, answer.used_before)
        if report is not None:
            report(goal.name, settled[condition])
    settled = _break_circles(solver, settled)
    if frame.left_out:  # a counterexample need not satisfy the clauses left out
        settled = {
            c: s if s.circle or s.verdict is Verdict.PROVED else replace(s, verdict=Verdict.UNKNOWN)
            for c, s in settled.items()
        }
    loops = tuple(_loop(frame, goal, part, settled) for part in goal.root.walk() if part.rule is Rule.R4)
    return Answers(goal, settled, loops)


@dataclass(slots=True)
class _Solver:
    frame: Frame
    selected: frozenset[str]
    bounds: Bounds
    kept: frozenset[ClauseName]
    """Assumptions that the conclusion leaves assumed: a node's own ones may be used to prove its other ones."""

    def condition(self, condition: SideCondition, allowed: frozenset[str] | None = None) -> Settled:
        """Check one side condition; `allowed`: the nodes whose contracts may be used at the same step, if only a proof
        matters.

        Hypotheses closest to the goal are tried first: they give the proof that a reader expects, and a small query. A
        provider of a thousand consumers has a thousand guarantees, of which each consumer needs a few; and all nodes of
        a chain are ancestors of its last one. Only the widest query refutes.
        """
        whether, allowed = allowed is not None, self.selected if allowed is None else allowed
        nearest = self.nearest(condition, allowed)
        answer = self.asked(condition, nearest, NARROW_EFFORT, closest_only=True, whether=True)
        if answer.verdict is Verdict.PROVED:
            return answer
        wider = self.wider(condition, nearest, allowed)
        for premises in wider:
            last = premises is wider[-1]
            effort = self.bounds.effort if last else NARROW_EFFORT
            answer = self.asked(condition, premises, effort, whether=whether or not last)
            if answer.verdict is Verdict.PROVED:
                return answer
        return self.by_itself(condition, wider[-1]) or self.deeper(condition, answer, wider[-1])

    def nearest(self, condition: SideCondition, allowed: frozenset[str]) -> Premises:
        """The providers alone."""
        consumer = condition.consumer
        same = (p for p in condition.providers if p in allowed and p != consumer)
        near = tuple(p for p in same if self.feeds(p, consumer, delayed=False))
        before = (p for p in condition.providers if self.feeds(p, consumer, delayed=True))
        return near, tuple(before) if condition.delayed else ()

    def wider(
        self, condition: SideCondition, nearest: Premises, allowed: frozenset[str] | None = None
    ) -> list[Premises]:
        """Larger and larger sets of nodes, up to all from which values flow to the consumer. The contracts one step
        earlier may be used for every selected node: each step's assumptions are proved before the next's."""
        graph, (_, first) = self.frame.graph, nearest
        ancestors = graph.ancestors(condition.consumer, self.selected if allowed is None else allowed)
        behind = (*ancestors, condition.consumer)
        edges = (edge for node in behind for edge in graph.feeding(node) if edge.delayed)
        earlier = tuple(dict.fromkeys(edge.source.node for edge in edges if edge.source.node in self.selected))
        stepwise = earlier or self.frame.remembering(self.selected)
        everything = tuple(dict.fromkeys((*earlier, *behind))) if stepwise else ()
        return list(dict.fromkeys([nearest, *((ancestors, before) for before in (first, earlier, everything))]))

    def feeds(self, provider: str, consumer: str, *, delayed: bool) -> bool:
        return any(e.source.node == provider and e.delayed is delayed for e in self.frame.graph.feeding(consumer))

    def asked(
        self,
        condition: SideCondition,
        premises: Premises,
        effort: int,
        *,
        closest_only: bool = False,
        whether: bool = False,
        further: Mapping[str, Term] | None = None,
    ) -> Settled:
        """`whether`: only a proof matters, so it stops at the first case without one."""
        cases: list[Case] = []
        effort = min(effort, self.bounds.effort)
        for phase in self.phases(condition, premises):
            hypotheses, goal = self.question(condition, phase, premises, closest_only=closest_only)
            answer = implied(
                hypotheses | dict(further or {}), goal, effort=effort, seed=self.bounds.seed, whether=whether
            )
            cases.append(
                Case(
                    phase,
                    answer.verdict,
                    answer.needed,
                    answer.counterexample,
                    answer.vacuous,
                    answer.reason,
                    answer.engine,
                )
            )
            if whether and answer.verdict is not Verdict.PROVED:
                break
        return _settled(condition, tuple(cases))

    def phases(self, condition: SideCondition, premises: Premises) -> tuple[Phase, ...]:
        """One query, or one about the first step and one about every later step."""
        remembering = self.frame.remembering(self.selected)
        stepwise = premises[1] or condition.delayed or remembering
        return (Phase.INITIAL, Phase.LATER) if stepwise else (Phase.SAME_STEP,)

    def question(
        self, condition: SideCondition, phase: Phase, premises: Premises, *, closest_only: bool = False
    ) -> tuple[Hypotheses, Term]:
        """The hypotheses of a phase, and the assumption that has to follow."""
        frame, (same, before) = self.frame, premises
        goal = frame.clause(condition.consumer, condition.clause)
        contracts = [frame.promised(node) for node in same]
        around = [frame.surroundings(), indexed(self.own(condition.consumer))]
        if phase is Phase.LATER:
            contracts += [frame.promised(node, 1) for node in before]
            around.append(frame.surroundings(1))
        elif phase is Phase.INITIAL:
            around.append(frame.beginnings(self.selected))
        if closest_only:
            return closest((*contracts, *around), goal), goal
        spoken = free_variables(goal).union(*(part.speaking for part in contracts))
        hypotheses = {label: fact for part in contracts for label, fact in part.terms.items()}
        return hypotheses | bearing({k: v for part in around for k, v in part.terms.items()}, spoken), goal

    def own(self, consumer: str) -> Hypotheses:
        """The consumer's assumptions that stay assumed."""
        names = (ClauseName(consumer, clause.name) for clause in self.frame.node(consumer).assumptions)
        return {str(name): self.frame.clause(name.node, name.clause) for name in names if name in self.kept}

    def by_itself(self, condition: SideCondition, premises: Premises) -> Settled | None:
        """The circular answer, if a node feeds itself at the same step and its guarantees prove its assumption."""
        consumer = condition.consumer
        if not self.feeds(consumer, consumer, delayed=False):
            return None
        guaranteed = {
            f"{consumer}.{g.name}": self.frame.clause(consumer, g.name) for g in self.frame.node(consumer).guarantees
        }
        answer = self.asked(condition, premises, NARROW_EFFORT, further=guaranteed)
        if answer.verdict is not Verdict.PROVED:
            return None
        return replace(answer, verdict=Verdict.REFUTED, circle=(consumer,))

    def deeper(self, condition: SideCondition, settled: Settled, premises: Premises) -> Settled:
        """A later step at which the assumption may be false refutes only if a run from the initial values reaches it;
        otherwise only the induction fails."""
        first = next((case for case in settled.cases if case.phase is Phase.INITIAL), None)
        later = next((case for case in settled.cases if case.phase is Phase.LATER), None)
        if first is None or later is None or later.verdict is not Verdict.REFUTED:
            return settled
        found = Deeper()
        if first.verdict is Verdict.PROVED:
            frame, (same, before) = self.frame, premises
            selected = (node for node in frame.graph.nodes if node in self.selected)
            always = frame.environment() | frame.memory()
            asked = steps(
                frame,
                frame.contracts(dict.fromkeys((*before, *selected))) | always,
                frame.contracts(same) | always | self.own(condition.consumer),
                frame.initials(self.selected) | frame.blank(),
                frame.clause(condition.consumer, condition.clause),
            )
            found = further(frame, asked, self.bounds.effort, self.bounds.seed, str(condition.about))
        if found.proved is not None:
            case = Case(
                Phase.LATER, Verdict.PROVED, found.proved, engine=found.engine, depth=found.steps, invariant=found.by
            )
        elif found.run is not None:
            case = replace(later, counterexample=found.run)
        else:
            case = replace(later, verdict=Verdict.UNKNOWN, reason="induction over steps fails")
        return _settled(condition, tuple(case if one is later else one for one in settled.cases))


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
    """Replace proofs that use, at one step, the contract of a node whose assumption they help to prove.

    Nodes are established one after the other, each from those before it. Nodes that cannot be established in any order
    are circular: their proofs do not count.
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
        shown = circle(circles[0])
        return Loop(part.nodes, LoopForm.CIRCULAR, circles[0], f"each assumption is proved from the next: {shown}")
    if all(answer.verdict is Verdict.PROVED for answer in answers):
        if not any(answer.used_before for answer in answers) and all(len(answer.cases) == 1 for answer in answers):
            note = "no member's assumption depends on what comes round the loop"
            return Loop(part.nodes, LoopForm.BOOTSTRAP, cycle, note)
        note = "the initial values satisfy the assumptions, and each round of the loop keeps them"
        return Loop(part.nodes, LoopForm.INITIAL, cycle, note)
    return Loop(part.nodes, LoopForm.OPEN, cycle, "some assumption of a member is not shown")
