"""Composition and requirement obligations: what has to be shown for the system's derivations to hold.

Each obligation is made from a `Task`, which says how it is answered (`avow.calculus.discharge` calls the solver). The
hypotheses of an answer are given as other obligations, which the assurance case then requires.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain

from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.remembered import by_identity
from avow.base.verdict import Hypothesis, HypothesisKind, Outcome, Verdict
from avow.calculus import questions
from avow.calculus.certificates import Certificates, existence_scope, requirement_scope
from avow.calculus.chance import likely
from avow.calculus.composition import Composition, argument, asked, composed
from avow.calculus.derivation import Derivation, Goal, Rule, SideCondition
from avow.calculus.discharge import Bounds, Claim
from avow.calculus.questions import Answer
from avow.calculus.required import requirement_question, unshown
from avow.calculus.requirements import supports
from avow.calculus.rules import ONE_OUTPUT, PERSISTENCE
from avow.calculus.subsystem_contracts import innermost
from avow.calculus.variables import OBSERVED, Frame
from avow.calculus.wiring import circles, joined, loops, start_name
from avow.evidence.claims import Reestablished
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.formulas.formula import digest, node_digest
from avow.kernel.certificate import How
from avow.kernel.check import Established, Needed
from avow.kernel.statements import Claimed
from avow.language.definitions import show_clause
from avow.language.printer import show_term
from avow.language.subterms import ports_of
from avow.language.terms import Role
from avow.sanity.claims import node_key, triggers
from avow.solving.limits import effort_told
from avow.system.plan import Requirement, System


@dataclass(frozen=True, slots=True)
class Task:
    """An obligation, and the question that answers it."""

    obligation: Obligation
    ask: questions.Question

    @property
    def because(self) -> str:
        """The plan's reason, which answers the obligation but is not part of the claim; empty if it needs no reason."""
        return (
            self.ask.because if isinstance(self.ask, questions.ArgumentQuestion | questions.EnvironmentQuestion) else ""
        )


def composition_obligations(system: System) -> tuple[Obligation, ...]:
    """Every composition obligation of a system. Pure. Raises Rejected if the plan's formulas are wrong."""
    return tuple(task.obligation for task in _tasks(composed(system)))


def all_tasks(composition: Composition) -> tuple[Task, ...]:
    """The obligations for existing derivations, and one for each requirement with a formula or a temporal property,
    each with its question. A requirement in prose has none: the assurance case shows it as linked. Raises Rejected if a
    formula is wrong."""
    return (*_tasks(composition), *_requirements(composition))


def settle_each(composition: Composition, obligations: Sequence[Obligation], bounds: Bounds) -> Iterator[Outcome]:
    """One outcome for each obligation, in order, each as soon as it is known. The derivations cache the answers."""
    made = _tasks(composition)
    resting = _resting(composition, made)
    tasks = {task.obligation.id: task for task in (*made, *_requirements(composition))}
    composition.claims = _claimed(made, frozenset(obligation.id for obligation in obligations))
    for obligation in obligations:
        task = tasks.get(obligation.id)
        if task is None:
            outcome = Outcome(obligation.id, Verdict.ERROR, "the system as it stands has no such obligation")
        else:
            answer = task.ask(composition, bounds)
            goal = getattr(task.ask, "goal", None) if obligation.kind is Kind.COMPOSITION else None
            required = obligation.name if obligation.kind is Kind.REQUIREMENT else ""
            outcome = answer.outcome(obligation.id, resting.behind(answer, goal, required))
        yield replace(outcome, details={**outcome.details, **effort_told(bounds.effort)})


def _claimed(made: Sequence[Task], wanted: frozenset[str]) -> dict[str, dict[SideCondition, Claim]]:
    found: dict[str, dict[SideCondition, Claim]] = {}
    for task in made:
        if isinstance(task.ask, questions.SideQuestion):
            claim = Claim(task.obligation.digest, task.obligation.id in wanted)
            found.setdefault(task.ask.goal, {})[task.ask.condition] = claim
    return found


def reestablished(certificates: Certificates, obligation: str) -> Reestablished | None:
    """The kernel's result for an obligation (by its id) from the kept certificates, without a search; None if it does
    not establish it."""
    _, _, kind, name = obligation.split("/", 3)
    if kind == Kind.REQUIREMENT:
        scope, frame = requirement_scope(name), certificates.composition.frame
        if any(r.id == name and unshown(frame, r) for r in frame.system.plan.requirements):
            return None
        return _all_told(obligation, [certificates.kept_for(scope, Claimed.REQUIREMENT, name)], scope)
    if certificates.parts(name):
        scope = existence_scope(name)
        possible = certificates.existing(certificates.kept.get(scope), name)
        return _all_told(obligation, possible or (None,), scope)
    for goal in certificates.composition.goals:
        for part in goal.root.walk():
            if part.rule is Rule.R4 and name == _loop_name(certificates.composition, goal, part):
                about = [innermost(str(c.about)) for c in part.side_conditions]
                each = [certificates.kept_for(goal.name, Claimed.ASSUMPTION, one) for one in about]
                return _all_told(obligation, each, goal.name)
        for condition in goal.conditions:
            if name == f"{goal.name}.{condition.about}":
                found = certificates.kept_for(goal.name, Claimed.ASSUMPTION, innermost(str(condition.about)))
                return _all_told(obligation, [found], goal.name)
    return None


def _all_told(obligation: str, asked: Sequence[Established | None], scope: str) -> Reestablished | None:
    found = complete(asked)
    if found is None:
        return None
    return Reestablished(obligation, min((one.solvers for one in found), default=1), questions.common_key(found), scope)


# -- generation --------------------------------------------------------------------------------------------------------


@by_identity(8)
def _tasks(composition: Composition) -> tuple[Task, ...]:
    of_goals = (task for goal in composition.goals for task in _goal_tasks(composition, goal))
    rest = (*_environment_tasks(composition), *_start_tasks(composition), *_joint_tasks(composition))
    return (*of_goals, *rest)


def _goal_tasks(composition: Composition, goal: Goal) -> Iterator[Task]:
    frame, meanings = composition.frame_of(goal), composition.meanings_of(goal)
    selected = frozenset(goal.nodes)
    plan = asked(frame.system, goal.name)
    span = plan.span if plan else None
    for finding in goal.findings:
        claim = f"{goal.name}: the rule that the plan names fits the selected nodes"
        misfit = questions.RuleQuestion(finding.message)
        yield _task(frame, f"{goal.name}.rule", claim, ("rule", finding.message), misfit, span=finding.span)
    providers = dict.fromkeys(name for condition in goal.conditions for name in condition.providers)
    given = {name: _given(frame, name) for name in providers}
    for condition in goal.conditions:
        clause = frame.node(condition.consumer).clause(condition.clause)
        about = innermost(str(condition.about))
        yield _task(
            frame,
            f"{goal.name}.{condition.about}",
            f"{goal.name}: {_sources(condition)} what {condition.consumer} assumes in {condition.clause}",
            ("side", meanings.cone(condition.consumer, selected), meanings.environment(), digest(clause.formula)),
            questions.SideQuestion(goal.name, condition),
            formula=_implication(frame, condition, given),
            clauses=dict.fromkeys((about, *chain(*(given[p].guarantees for p in condition.providers)))),
            span=clause.span,
        )
    entered = argument(composition, goal.name, "entered")
    for part in goal.root.walk():
        if part.rule is Rule.R4:
            yield _task(
                frame,
                _loop_name(composition, goal, part),
                f"{goal.name}: the assumptions around the loop of {_listed(part.nodes)} do not hold up one another",
                ("loop", meanings.all(selected), entered),
                questions.LoopQuestion(goal.name, part.nodes, entered),
                clauses=(str(c.about) for c in part.side_conditions),
                span=span,
            )
    if goal.needs_persistence:
        listed = _listed(goal.nodes)
        wiring = sorted(meanings.cone(node, selected) for node in goal.nodes)
        for key, name, text in (("persistence", "persistence", PERSISTENCE), ("one_output", "one-output", ONE_OUTPUT)):
            claim, meaning = f"{goal.name}: {text.format(listed)}", (key, sha256("\n".join(wiring)))
            question = questions.ArgumentQuestion(key, argument(composition, goal.name, key), goal.name)
            yield _task(frame, f"{goal.name}.{name}", claim, meaning, question, span=span)


def _environment_tasks(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    read = sorted({endpoint.node for endpoint in frame.graph.environment})

    @functools.cache
    def around(given: bool) -> str:
        """All that the answer depends on besides the claim, if the plan gives a reason; otherwise it is open."""
        parts = (node_key(composition.surroundings), *map(composition.read_of, read)) if given else ()
        return sha256("\n".join(parts))

    for assumed in frame.assumed:
        yield _task(
            frame,
            f"environment.{assumed.port}",
            f"the environment gives {assumed.port} as assumed",
            ("environment", composition.meanings.environment([assumed.port]), around(bool(assumed.because))),
            questions.EnvironmentQuestion(assumed.because, f"environment {assumed.port}"),
            formula=show_term(assumed.formula),
            span=next(e for e in frame.system.plan.environment if e.port == assumed.port).span,
        )
    for entry in frame.system.plan.environment:
        if entry.constant:
            yield _task(
                frame,
                f"environment.{entry.constancy}",
                f"the environment gives {entry.port} the same value at every step",
                ("constant", entry.port, around(True)),
                questions.EnvironmentQuestion(entry.stays or f"{entry.port} is the same at every step"),
                span=entry.span,
            )
    reasons = {entry.port: entry.because for entry in frame.system.plan.environment}
    for requirement in frame.system.plan.requirements:
        if requirement.probability is not None and (because := requirement.probability.independent):
            names = f"these fail independently of each other: {', '.join(likely(frame.system, requirement))}"
            yield _task(
                frame,
                f"independent.{requirement.id}",
                names,
                ("independent", names, requirement.probability.words),
                questions.EnvironmentQuestion(because),
                span=requirement.span,
            )
    for name, ports in composition.left_to_environment():
        node = frame.node(name.node)
        clause = node.clause(name.clause)
        given = [reasons.get(frame.entry(name.node, port)) or "" for port in ports]
        because = "; ".join(dict.fromkeys(given)) if all(given) else ""
        yield _task(
            frame,
            f"environment.{name}",
            f"the environment meets what {name.node} assumes in {name.clause}",
            ("environment", digest(frame.clause(name.node, name.clause)), around(bool(because))),
            questions.EnvironmentQuestion(because, str(name)),
            formula=show_clause(clause, node),
            clauses=(str(name),),
            span=clause.span,
        )


def _start_tasks(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    everything = frozenset(frame.graph.nodes)
    for group in loops(frame):
        claim = f"the loop of {', '.join(group)} has a first element"
        meaning = ("start", composition.meanings.cone(group[0], everything))
        question = questions.StartQuestion(group)
        yield _task(frame, start_name(group), claim, meaning, question, span=frame.node(group[0]).span)


def _joint_tasks(composition: Composition) -> Iterator[Task]:
    """Guarantees of nodes that feed one another at one instant may be inconsistent. If values flow one way only, each
    node responds to its inputs, and its own realizability (a sanity obligation) is enough."""
    frame = composition.frame
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges if not e.delayed]
    for group in circles(frame):
        meaning = sha256("\n".join([*(composition.meanings.node(name) for name in group), *map(str, sorted(arcs))]))
        for name, clause in ((n, guarantee) for n in group for guarantee in frame.node(n).guarantees):
            situations = triggers(frame.clause(name, clause.name))
            if not situations:
                continue
            about = f"{name}.{clause.name}"
            yield _task(
                frame,
                f"joint.{about}",
                f"{', '.join(group)}, taken together at one instant, do not exclude what {about} is about",
                ("joint", meaning, composition.meanings.environment(), *map(digest, situations)),
                questions.JointQuestion(group, name, clause.name),
                formula=" and ".join(show_term(situation) for situation in situations),
                clauses=(about,),
                span=clause.span,
            )


def _requirements(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    scenario = frame.system.plan.scenario
    everything = composition.meanings.all(frozenset(frame.graph.nodes))
    for requirement in frame.system.plan.requirements:
        question = requirement_question(composition, requirement)
        if question is None:
            continue
        tried = scenario.digest if scenario and requirement.temporal else ""
        yield _task(
            frame,
            requirement.id,
            requirement.text,
            ("requirement, with the assumptions behind it", question.digest, everything, tried),
            question,
            kind=Kind.REQUIREMENT,
            formula=question.text,
            clauses=supports(composition, requirement),
            span=requirement.span,
        )


def _task(
    frame: Frame,
    name: str,
    claim: str,
    meaning: Iterable[str],
    ask: questions.Question,
    *,
    kind: Kind = Kind.COMPOSITION,
    formula: str = "",
    clauses: Iterable[str] = (),
    span: Span | None = None,
) -> Task:
    """`meaning`: the texts that the digest covers."""
    mark, system = sha256("\n".join(meaning)), frame.system.name
    return Task(Obligation(system, SYSTEM_LEVEL, kind, name, claim, formula, mark, tuple(clauses), span), ask)


def _sources(condition: SideCondition) -> str:
    if condition.providers:
        verb = "guarantees" if len(condition.providers) == 1 else "guarantee"
        return f"{' and '.join(condition.providers)} {verb}"
    return "the environment gives" if condition.environment else "it is always so,"


@dataclass(frozen=True, slots=True)
class _Given:
    """A provider's clause names, computed once for all its consumers."""

    guarantees: tuple[str, ...]
    """Innermost names."""
    clauses: str
    """The names of all clauses, as one conjunction."""


def _given(frame: Frame, name: str) -> _Given:
    node = frame.node(name)
    names = tuple(innermost(f"{name}.{g.name}") for g in node.guarantees)
    return _Given(names, " ∧ ".join(f"{name}.{c.name}" for c in node.clauses))


def _implication(frame: Frame, condition: SideCondition, given: Mapping[str, _Given]) -> str:
    goal = show_term(frame.clause(condition.consumer, condition.clause))
    parts = [text for p in condition.providers if (text := given[p].clauses)]
    parts += [f"environment {port}" for port in condition.environment]
    return f"{' ∧ '.join(parts)} ⇒ {goal}" if parts else goal


def _loop_name(composition: Composition, goal: Goal, part: Derivation) -> str:
    """A name that no assumption of a node named ``loop`` can have: names of nodes have no hyphen."""
    word = "loop-of" if "loop" in composition.frame_of(goal).graph.nodes else "loop"
    return f"{goal.name}.{word}.{joined(part.nodes)}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 12 else f"{len(names)} nodes"


# -- what answers rest on ----------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class _Resting:
    """What an answer of the calculus depends on, as hypotheses that the case discharges: obligations, by digest.
    `obligations`: the composition's, by name."""

    composition: Composition
    obligations: Mapping[str, Obligation]

    def behind(self, answer: Answer, goal: str | None, required: str = "") -> tuple[Hypothesis, ...]:
        """The hypotheses of an answer about a side condition of a derivation, or about a requirement (`goal` None)."""
        found: dict[Hypothesis, None] = {}
        if answer.everything:
            found |= dict.fromkeys(self.everything())
        if answer.established is not None:
            for need in answer.established.hypotheses:
                if goal is None or need.kind in (How.ENVIRONMENT, How.TOGETHER):
                    found |= dict.fromkeys(self.needed(need, goal))
            if goal is None:
                shown = (self.named(Claimed.ASSUMPTION, mark, node) for node, mark in answer.established.shown if node)
                found |= dict.fromkeys(self.discharging(*name.split(".")) for name in shown)
            found |= dict.fromkeys(self.constants(answer.established, required))
        for requirement in (r for r in self.composition.frame.system.plan.requirements if r.id == required):
            found |= dict.fromkeys(self.likely(requirement))
        return tuple(found)

    def likely(self, requirement: Requirement) -> Iterator[Hypothesis]:
        """The guarantees of whose probabilities the requirement's is composed."""
        for name in likely(self.composition.frame.system, requirement):
            yield from self.guarantee(*name.split("."))
        if requirement.probability is not None and requirement.probability.independent:
            yield self.composed(f"independent.{requirement.id}")

    def constants(self, established: Established, required: str) -> Iterator[Hypothesis]:
        """Hypotheses that inputs mentioned in a proof's clauses do not change, if the plan declares them constant."""
        frame, known = self.composition.frame, self.composition.certificates.known
        declared = [entry for entry in frame.system.plan.environment if entry.constant]
        if not declared:  # the marks of all claims together grow with the square of the nodes
            return
        about = frame.required.get(required)
        spoken = [] if about is None else [v.name.rsplit(".", 1) for v in ports_of(about) if "." in v.name]
        marks = {digest for _, digest in established.shown} | {need.digest for need in established.hypotheses}
        for claim in (claim for mark in (*marks, established.goal) for claim in known.by_digest.get(mark, ())):
            if claim.kind in (Claimed.GUARANTEE, Claimed.ASSUMPTION):
                formula = frame.system.contract.node(claim.node).clause(claim.name).formula
                spoken += [[claim.node, v.name] for v in ports_of(formula) if v.role is Role.INPUT]
        read = {frame.entry(node, port) for node, port in spoken if node in frame.graph.nodes}
        yield from (self.composed(f"environment.{entry.constancy}") for entry in declared if entry.port in read)

    def everything(self) -> Iterator[Hypothesis]:
        """Every guarantee, what discharges every assumption, and hypotheses that their values belong to one step."""
        frame = self.composition.frame
        for node in frame.system.contract.nodes:
            yield from (h for clause in node.guarantees for h in self.guarantee(node.name, clause.name))
            yield from (self.discharging(node.name, clause.name) for clause in node.assumptions)
        yield from (self.composed(f"environment.{assumed.port}") for assumed in frame.assumed)
        yield from (self.composed(f"environment.{e.constancy}") for e in frame.system.plan.environment if e.constant)
        yield from self.together(frame.graph.nodes, None, optional=True)

    def needed(self, need: Needed, goal: str | None) -> Iterable[Hypothesis]:
        match need.kind:
            case How.GUARANTEE:
                name = self.named(Claimed.GUARANTEE, need.digest, need.node)
                return self.guarantee(*name.split("."))
            case How.ENVIRONMENT:
                assumed = self.composition.certificates.known.find(need.digest, Claimed.ENVIRONMENT, need.node)
                if assumed is not None:
                    return (self.composed(f"environment.{assumed.name}"),)
                name = self.named(Claimed.ASSUMPTION, need.digest, need.node)
                return (self.discharging(*name.split(".")),)
            case How.TOGETHER:
                return self.together(need.conds, goal)
            case How.OPEN | How.SHOWN | How.POSSIBLE | How.DEFINED:
                return ()

    def named(self, kind: Claimed, digest: str, node: str) -> str:
        found = self.composition.certificates.known.find(digest, kind, node)
        assert found is not None, "the kernel has looked it up"
        return f"{found.node}.{found.name}"

    def guarantee(self, node: str, clause: str) -> tuple[Hypothesis, ...]:
        """The guarantee's obligation; none for a node that represents a topic's wiring."""
        owner = self.composition.frame.system.contract.node(node)
        if owner.relay:
            return ()
        mark = node_digest(owner, owner.clause(clause))
        return (Hypothesis(HypothesisKind.CLAIM, f"{node}/{Kind.GUARANTEE}/{clause}", mark),)

    def discharging(self, node: str, clause: str) -> Hypothesis:
        """The obligation that discharges an assumption of a node."""
        shown = self.composition.where(node, clause)
        if shown is not None:
            goal, about = shown
            return self.composed(f"{goal.name}.{about}")
        return self.composed(f"environment.{node}.{clause}")

    def composed(self, name: str) -> Hypothesis:
        """A composition obligation; if there is none of that name, an assumption that a person has to accept."""
        obligation = self.obligations.get(name)
        if obligation is not None:
            return Hypothesis(HypothesisKind.CLAIM, obligation.local_id, obligation.digest)
        return Hypothesis(
            HypothesisKind.ASSUMPTION, f"{SYSTEM_LEVEL}/assumption/{name}", sha256(name), f"nothing settles {name}"
        )

    def together(self, nodes: Iterable[str], goal: str | None, *, optional: bool = False) -> tuple[Hypothesis, ...]:
        """Persistence and one output for each input, for a derivation over these nodes: preferably the given one, then
        one for which the plan gives reasons, then any."""
        wanted, composition = frozenset(nodes), self.composition
        if any(name.startswith(OBSERVED) for name in wanted):
            wanted = frozenset(composition.frame.graph.nodes)
        covering = [
            g
            for g in composition.goals
            if f"{g.name}.persistence" in self.obligations and wanted <= set(composition.leaves(g, g.nodes))
        ]

        def rank(name: str) -> tuple[bool, bool]:
            return name != goal, not all(argument(composition, name, key) for key in ("persistence", "one_output"))

        chosen = min((g.name for g in covering), key=rank, default=None)
        if chosen is not None:
            return tuple(self.composed(f"{chosen}.{part}") for part in ("persistence", "one-output"))
        return () if optional else (self.composed(f"together({','.join(sorted(wanted))})"),)


def _resting(composition: Composition, tasks: Iterable[Task]) -> _Resting:
    return _Resting(composition, {task.obligation.name: task.obligation for task in tasks})


def discharged_by(composition: Composition) -> dict[str, tuple[Hypothesis, ...]]:
    """For each node what discharges its assumptions: every use of its guarantees depends on these."""
    resting = _resting(composition, _tasks(composition))
    return {
        node.name: tuple(dict.fromkeys(resting.discharging(node.name, clause.name) for clause in node.assumptions))
        for node in composition.frame.system.contract.nodes
    }
