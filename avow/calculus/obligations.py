"""Composition and requirement obligations: what has to be shown for the system's derivations to stand.

Pure generation here (`composition_obligations`, `requirement_obligations`); the questions are put to the solver in
`discharge`. Each obligation is made from a `Task`, which says how it is settled.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import chain
from typing import Protocol

from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.optional import complete
from avow.base.records import dataclass
from avow.base.verdict import Outcome
from avow.calculus import questions
from avow.calculus.certificates import Certificates, existence_scope, requirement_scope
from avow.calculus.composition import Composition, argument, asked, compose, composed
from avow.calculus.derivation import ClauseName, Derivation, Goal, Rule, SideCondition
from avow.calculus.discharge import Bounds, Claim
from avow.calculus.existence import circles, joined, loops, start_name
from avow.calculus.hypotheses import Resting
from avow.calculus.requirements import requirement_question
from avow.calculus.rules import ONE_OUTPUT, PERSISTENCE
from avow.calculus.subsystem_contracts import innermost
from avow.calculus.variables import Frame
from avow.evidence.claims import Reestablished
from avow.evidence.obligation import SYSTEM_LEVEL, Kind, Obligation
from avow.formulas.formula import digest
from avow.kernel.check import Established
from avow.kernel.statements import Claimed
from avow.language.definitions import show_clause
from avow.language.printer import show_term
from avow.sanity.claims import triggers
from avow.solving.limits import effort_told, from_seconds
from avow.system.plan import Endpoint, Requirement, System


class TimeLimits(Protocol):
    """What of `avow.backend_kit.protocol.Limits` is used here."""

    @property
    def seconds(self) -> float: ...

    @property
    def seed(self) -> int: ...


@dataclass(frozen=True, slots=True)
class Task:
    """An obligation, and the question that settles it."""

    obligation: Obligation
    ask: questions.Question

    @property
    def because(self) -> str:
        """The plan's reason, which is all that settles it: no part of what it says. Empty where a question does."""
        return self.ask.because if isinstance(self.ask, questions.ArgumentQuestion) else ""


def composition_obligations(system: System) -> tuple[Obligation, ...]:
    """Every composition obligation of a system. Pure. Raises Rejected for a plan whose formulas are wrong."""
    return tuple(task.obligation for task in _tasks(composed(system)))


def requirement_obligations(system: System) -> tuple[Obligation, ...]:
    """An obligation for each requirement that has a formula or a temporal property; one in prose has none: it is
    linked, and the assurance case shows it as linked. Raises Rejected for a formula that is wrong."""
    return tuple(task.obligation for task in _requirements(composed(system)))


def all_obligations(composition: Composition) -> tuple[Obligation, ...]:
    """Both, of derivations that are made already."""
    return tuple(task.obligation for task in all_tasks(composition))


def all_tasks(composition: Composition) -> tuple[Task, ...]:
    """As `all_obligations`, with what settles each."""
    return (*_tasks(composition), *_requirements(composition))


def discharge(system: System, obligations: Sequence[Obligation], limits: TimeLimits) -> tuple[Outcome, ...]:
    """Settle obligations made by the two functions above, one outcome for each, in their order."""
    return settle_all(compose(system), obligations, limits)


def settle_all(composition: Composition, obligations: Sequence[Obligation], limits: TimeLimits) -> tuple[Outcome, ...]:
    """As `discharge`, of derivations that are made already (they remember what was settled)."""
    return tuple(settle_each(composition, obligations, Bounds(from_seconds(limits.seconds), limits.seed)))


def settle_each(composition: Composition, obligations: Sequence[Obligation], bounds: Bounds) -> Iterator[Outcome]:
    """As `settle_all`, each outcome as soon as it is there."""
    made = tuple(_tasks(composition))
    resting = Resting(composition, {task.obligation.name: task.obligation for task in made})
    tasks = {task.obligation.id: task for task in (*made, *_requirements(composition))}
    composition.claims = _claimed(made, frozenset(obligation.id for obligation in obligations))
    for obligation in obligations:
        task = tasks.get(obligation.id)
        if task is None:
            outcome = questions.vanished(obligation.id)
        else:
            answer = task.ask(composition, bounds)
            goal = getattr(task.ask, "goal", None) if obligation.kind is Kind.COMPOSITION else None
            outcome = answer.outcome(obligation.id, resting.behind(answer, goal))
        yield replace(outcome, details={**outcome.details, **effort_told(bounds.effort)})


def _claimed(made: Sequence[Task], wanted: frozenset[str]) -> dict[str, dict[SideCondition, Claim]]:
    found: dict[str, dict[SideCondition, Claim]] = {}
    for task in made:
        if isinstance(task.ask, questions.SideQuestion):
            claim = Claim(task.obligation.digest, task.obligation.id in wanted)
            found.setdefault(task.ask.goal, {})[task.ask.condition] = claim
    return found


def reestablished(certificates: Certificates, obligation: str) -> Reestablished | None:
    """What the kernel says of an obligation (by its id) from the certificates kept; None where it does not establish
    it. Nothing is searched for."""
    _, _, kind, name = obligation.split("/", 3)
    if kind == Kind.REQUIREMENT:
        scope = requirement_scope(name)
        return _all_told(obligation, [certificates.kept_for(scope, Claimed.REQUIREMENT, name)], scope)
    if certificates.parts(name):
        possible = certificates.kept_existence(name)
        return _all_told(obligation, possible or (None,), existence_scope(name))
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


def _tasks(composition: Composition) -> Iterator[Task]:
    for goal in composition.goals:
        yield from _goal_tasks(composition, goal)
    yield from _environment_tasks(composition)
    yield from _start_tasks(composition)
    yield from _joint_tasks(composition)


def _goal_tasks(composition: Composition, goal: Goal) -> Iterator[Task]:
    frame, meanings = composition.frame_of(goal), composition.meanings_of(goal)
    selected = frozenset(goal.nodes)
    plan = asked(frame.system, goal.name)
    span = plan.span if plan else None
    for finding in goal.findings:
        yield Task(
            _obligation(
                frame.system,
                f"{goal.name}.rule",
                f"{goal.name}: the rule that the plan names fits the selected nodes",
                "",
                sha256(f"rule\n{finding.message}"),
                (),
                finding.span,
            ),
            questions.RuleQuestion(finding.message),
        )
    providers = dict.fromkeys(name for condition in goal.conditions for name in condition.providers)
    given = {name: _given(frame, name) for name in providers}
    for condition in goal.conditions:
        clause = frame.node(condition.consumer).clause(condition.clause)
        yield Task(
            _obligation(
                frame.system,
                f"{goal.name}.{condition.consumer}.{condition.clause}",
                f"{goal.name}: {_sources(condition)} what {condition.consumer} assumes in {condition.clause}",
                _implication(frame, condition, given),
                sha256(
                    "side\n"
                    + "\n".join(
                        [
                            meanings.cone(condition.consumer, selected),
                            meanings.environment(),
                            digest(clause.formula),
                        ]
                    )
                ),
                tuple(
                    dict.fromkeys(
                        (innermost(str(condition.about)), *chain(*(given[p].guarantees for p in condition.providers)))
                    )
                ),
                clause.span,
            ),
            questions.SideQuestion(goal.name, condition),
        )
    for part in goal.root.walk():
        if part.rule is Rule.R4:
            yield Task(
                _obligation(
                    frame.system,
                    _loop_name(composition, goal, part),
                    f"{goal.name}: the assumptions around the loop of {_listed(part.nodes)} do not hold up one another",
                    "",
                    sha256(f"loop\n{meanings.all(selected)}\n{argument(composition, goal.name, 'entered')}"),
                    tuple(str(c.about) for c in part.side_conditions),
                    span,
                ),
                questions.LoopQuestion(goal.name, part.nodes, argument(composition, goal.name, "entered")),
            )
    if goal.needs_persistence:
        listed = _listed(goal.nodes)
        wiring = sha256("\n".join(sorted(meanings.cone(node, selected) for node in goal.nodes)))
        for key, name, text in (("persistence", "persistence", PERSISTENCE), ("one_output", "one-output", ONE_OUTPUT)):
            reason = argument(composition, goal.name, key)
            yield Task(
                _obligation(
                    frame.system,
                    f"{goal.name}.{name}",
                    f"{goal.name}: {text.format(listed)}",
                    "",
                    sha256(f"{key}\n{wiring}"),
                    (),
                    span,
                ),
                questions.ArgumentQuestion(key, reason, goal.name),
            )


def _environment_tasks(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    for assumed in frame.assumed:
        entry = next(e for e in frame.system.plan.environment if e.port == assumed.port)
        yield Task(
            _obligation(
                frame.system,
                f"environment.{assumed.port}",
                f"the environment gives {assumed.port} as assumed",
                show_term(assumed.formula),
                sha256(f"environment\n{composition.meanings.environment([assumed.port])}"),
                (),
                entry.span,
            ),
            questions.ArgumentQuestion("because", assumed.because, "environment"),
        )
    reasons = {entry.port: entry.because for entry in frame.system.plan.environment}
    for name in dict.fromkeys(ClauseName(*innermost(str(n)).split(".")) for n in composition.whole.root.assumed):
        node = frame.node(name.node)
        clause = node.clause(name.clause)
        ports = [v.name for v, _ in frame.behind(name.node, clause.formula)]
        if not ports or any(Endpoint(name.node, port) in frame.graph.by_target for port in ports):
            continue
        given = [reasons.get(frame.entry(name.node, port)) or "" for port in ports]
        because = "; ".join(dict.fromkeys(given)) if all(given) else ""
        yield Task(
            _obligation(
                frame.system,
                f"environment.{name}",
                f"the environment meets what {name.node} assumes in {name.clause}",
                show_clause(clause, node),
                sha256(f"environment\n{digest(frame.clause(name.node, name.clause))}"),
                (str(name),),
                clause.span,
            ),
            questions.ArgumentQuestion("environment", because, "environment"),
        )


def _start_tasks(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    everything = frozenset(frame.graph.nodes)
    for group in loops(frame):
        yield Task(
            _obligation(
                frame.system,
                start_name(group),
                f"the loop of {', '.join(group)} has a first element",
                "",
                sha256(f"start\n{composition.meanings.cone(group[0], everything)}"),
                (),
                frame.node(group[0]).span,
            ),
            questions.StartQuestion(group),
        )


def _joint_tasks(composition: Composition) -> Iterator[Task]:
    """Guarantees that feed one another at one instant may leave each other no room. Where values flow one way only,
    each node answers to what it gets, and its own realizability (a sanity obligation) is enough."""
    frame = composition.frame
    arcs = [(e.source.node, e.target.node) for e in frame.graph.edges if not e.delayed]
    for group in circles(frame):
        meaning = sha256("\n".join([*(composition.meanings.node(name) for name in group), *map(str, sorted(arcs))]))
        for name in group:
            for clause in frame.node(name).guarantees:
                situations = triggers(frame.clause(name, clause.name))
                if not situations:
                    continue
                yield Task(
                    _obligation(
                        frame.system,
                        f"joint.{name}.{clause.name}",
                        f"{', '.join(group)}, taken together at one instant, do not exclude what "
                        f"{name}.{clause.name} is about",
                        " and ".join(show_term(situation) for situation in situations),
                        sha256(
                            "\n".join(["joint", meaning, composition.meanings.environment(), *map(digest, situations)])
                        ),
                        (f"{name}.{clause.name}",),
                        clause.span,
                    ),
                    questions.JointQuestion(group, name, clause.name),
                )


def _requirements(composition: Composition) -> Iterator[Task]:
    frame = composition.frame
    everything = frozenset(frame.graph.nodes)
    for requirement in frame.system.plan.requirements:
        question = requirement_question(frame, requirement)
        if question is None:
            continue
        scenario = frame.system.plan.scenario
        yield Task(
            Obligation(
                frame.system.name,
                SYSTEM_LEVEL,
                Kind.REQUIREMENT,
                requirement.id,
                requirement.text,
                question.text,
                sha256(
                    "\n".join(
                        [
                            "requirement, with the assumptions behind it",
                            question.digest,
                            composition.meanings.all(everything),
                            scenario.digest if scenario and requirement.temporal else "",
                        ]
                    )
                ),
                supports(composition, requirement),
                requirement.span,
            ),
            question,
        )


def supports(composition: Composition, requirement: Requirement) -> tuple[str, ...]:
    """The guarantees that a requirement names as its support, directly, by node or by derivation."""
    found: dict[str, None] = {}
    for name in requirement.supported_by:
        owner, dot, _ = name.partition(".")
        goal = next((g for g in composition.goals if g.name == name), None)
        if goal is not None:
            nodes = composition.leaves(goal, goal.root.guaranteed)
        elif dot:
            found[name] = None
            continue
        else:
            nodes = (owner,)
        found.update({f"{n}.{g.name}": None for n in nodes for g in composition.frame.node(n).guarantees})
    return tuple(found)


def _obligation(
    system: System, name: str, claim: str, formula: str, meaning: str, clauses: tuple[str, ...], span: Span | None
) -> Obligation:
    return Obligation(system.name, SYSTEM_LEVEL, Kind.COMPOSITION, name, claim, formula, meaning, clauses, span)


def _sources(condition: SideCondition) -> str:
    if condition.providers:
        verb = "guarantees" if len(condition.providers) == 1 else "guarantee"
        return f"{' and '.join(condition.providers)} {verb}"
    return "the environment gives" if condition.environment else "it is always so,"


@dataclass(frozen=True, slots=True)
class _Given:
    """A provider's names, made once for all its consumers."""

    guarantees: tuple[str, ...]
    """Innermost names."""
    clauses: str
    """Of all clauses, as one conjunction."""


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
    """What an assumption of a node that is called ``loop`` cannot be called: no name of a node has a hyphen."""
    word = "loop-of" if "loop" in composition.frame_of(goal).graph.nodes else "loop"
    return f"{goal.name}.{word}.{joined(part.nodes)}"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names) if len(names) <= 12 else f"{len(names)} nodes"
