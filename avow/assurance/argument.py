"""The argument as a goal structure (GSN): goals, strategies, solutions, contexts, assumptions, justifications.

A requirement is a goal; a rule's application, an entailment or a person's linking is a strategy; a node's contract and
its guarantees are sub-goals; evidence is a solution. What nothing supports stays a goal without anything under it.
Data only: the report's page has it as a list.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from enum import StrEnum

from avow.assurance.model import Case, DerivationView, EvidenceView, ObligationView, RequirementView
from avow.assurance.naming import derivation_claim, requirement_claim, short
from avow.base.records import dataclass
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh


class Shape(StrEnum):
    """The kinds of element, by the letters that GSN gives them."""

    GOAL = "G"
    STRATEGY = "S"
    SOLUTION = "Sn"
    CONTEXT = "C"
    ASSUMPTION = "A"
    JUSTIFICATION = "J"


@dataclass(frozen=True, slots=True)
class Element:
    """`claim` is what it stands for: an obligation's id, ``requirement:…``; for a solution, the obligation's."""

    id: str
    shape: Shape
    title: str
    text: str
    status: Status | None = None
    claim: str = ""
    supported_by: tuple[str, ...] = ()
    in_context_of: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Argument:
    """Elements in the order in which they are first needed; `goals` are (requirement id, element id)."""

    elements: tuple[Element, ...]
    goals: tuple[tuple[str, str], ...]


def build_argument(case: Case) -> Argument:
    """The whole argument of a case; claims that support several goals are told once and pointed at."""
    return _Builder(case).build()


class _Builder:
    def __init__(self, case: Case) -> None:
        self.case = case
        self.elements: dict[str, Element] = {}
        self.numbers: dict[Shape, int] = {}
        self.by_claim: dict[str, str] = {}
        self.views = {view.id: view for view in case.obligations}
        self.derivations = {derivation_claim(d.derivation.name): d for d in case.derivations}
        self.requirements = {requirement_claim(r.id): r for r in case.requirements}

    def build(self) -> Argument:
        title = self.case.title
        root = self.add(Shape.GOAL, self.case.system, f"{title} meets its requirements")
        policy = self.add(Shape.CONTEXT, "Policy", f"{self.case.policy.name}: {self.case.policy.title}")
        self.change(root, in_context_of=(policy,))
        goals = tuple((r.id, self.requirement(r)) for r in self.case.requirements)
        if goals:
            strategy = self.add(Shape.STRATEGY, "Requirements", "Argument over each requirement")
            self.change(root, supported_by=(strategy,))
            self.change(strategy, supported_by=tuple(dict.fromkeys(name for _, name in goals)))
        return Argument(tuple(self.elements.values()), goals)

    def add(self, shape: Shape, title: str, text: str, status: Status | None = None, claim: str = "") -> str:
        number = self.numbers[shape] = self.numbers.get(shape, 0) + 1
        name = f"{shape}{number}"
        self.elements[name] = Element(name, shape, title, text, status, claim)
        return name

    def change(self, name: str, **parts: object) -> None:
        self.elements[name] = replace(self.elements[name], **parts)  # type: ignore[arg-type]

    def requirement(self, view: RequirementView) -> str:
        claim = requirement_claim(view.id)
        if claim in self.by_claim:
            return self.by_claim[claim]
        goal = self.add(Shape.GOAL, view.id, view.words, view.status, claim)
        self.by_claim[claim] = goal
        context = [self.add(Shape.ASSUMPTION, "Hypothesis", text) for text in view.hypotheses[:6]]
        if len(view.hypotheses) > 6:
            context.append(self.add(Shape.ASSUMPTION, "Hypotheses", f"and {len(view.hypotheses) - 6} more"))
        formal = view.formal
        if formal:
            context.append(self.add(Shape.CONTEXT, "Formula", formal))
        steps = []
        if view.obligations:
            text = "The requirement's formula is decided on the composed contracts"
            steps.append(self.strategy("Entailment" if view.formula else "Model checking", text, view.obligations))
        rest = [name for name in view.rests_on if name not in view.obligations]
        derived = [name for name in rest if name in self.derivations]
        steps += [self.derivation(self.derivations[name]) for name in derived]
        others = [name for name in rest if name not in self.derivations]
        if others:
            how = (
                "is what a person says to amount to the requirement" if not formal else "is what the formula speaks of"
            )
            steps.append(self.strategy("Contracts", f"What the nodes guarantee {how}", others))
        self.change(goal, supported_by=tuple(steps), in_context_of=tuple(context))
        return goal

    def strategy(self, title: str, text: str, claims: Iterable[str]) -> str:
        name = self.add(Shape.STRATEGY, title, text)
        self.change(name, supported_by=tuple(dict.fromkeys(self.claim(c) for c in claims)))
        return name

    def derivation(self, view: DerivationView) -> str:
        claim = derivation_claim(view.derivation.name)
        if claim in self.by_claim:
            return self.by_claim[claim]
        d = view.derivation
        name = self.add(Shape.STRATEGY, f"{d.name}: rule {d.rule}", d.conclusion, view.status, claim)
        self.by_claim[claim] = name
        conditions = ", ".join(condition.text for condition in d.side_conditions)
        context = [self.add(Shape.JUSTIFICATION, "Side conditions", conditions)] if conditions else []
        context += [self.add(Shape.ASSUMPTION, "Conditional", text) for text in view.conditional]
        self.change(name, in_context_of=tuple(context))
        below = []
        for rest in view.rests_on:
            below.append(self.derivation(self.derivations[rest]) if rest in self.derivations else self.claim(rest))
        self.change(name, supported_by=tuple(dict.fromkeys(below)))
        return name

    def claim(self, name: str) -> str:
        if name in self.by_claim:
            return self.by_claim[name]
        if name in self.requirements:
            return self.requirement(self.requirements[name])
        if name in self.derivations:
            return self.derivation(self.derivations[name])
        view = self.views.get(name)
        if view is None:
            self.by_claim[name] = self.add(Shape.GOAL, short(name), "no such claim", Status.MISSING, name)
            return self.by_claim[name]
        return self.obligation(view)

    def obligation(self, view: ObligationView) -> str:
        o = view.obligation
        title = short(o.id)
        goal = self.add(Shape.GOAL, title, o.claim, view.standing, o.id)
        self.by_claim[view.id] = goal
        solutions = tuple(self.solution(view, item) for item in _one_a_method(view.counting))
        # a guarantee's other supports (its contract's sanity) are drawn only where they fail: an argument, no inventory
        failing = [name for name in view.rests_on if name in view.below]
        others = view.rests_on if view.obligation.kind is not Kind.GUARANTEE else failing
        below = tuple(self.claim(name) for name in others)
        context: tuple[str, ...] = ()
        if view.handled:
            finding = next(f for f in self.case.findings if view.id in f.obligations and f.how == view.handled)
            said = f"{finding.how} as {finding.verdict}: {finding.reason}" + (
                f" ({finding.who})" if finding.who else ""
            )
            context = (self.add(Shape.JUSTIFICATION, finding.how.capitalize(), said),)
        supported = tuple(dict.fromkeys((*solutions, *below)))
        self.change(goal, supported_by=supported, in_context_of=context)
        return goal

    def solution(self, view: ObligationView, item: EvidenceView) -> str:
        record = item.entry.evidence
        return self.add(Shape.SOLUTION, record.method, record.summary, weigh(record).status, view.id)


def _one_a_method(views: Iterable[EvidenceView]) -> tuple[EvidenceView, ...]:
    """The newest record of each method; a refutation is never left out."""
    chosen: dict[tuple[str, bool], EvidenceView] = {}
    for view in views:
        chosen[view.entry.evidence.method, weigh(view.entry.evidence).refuted] = view
    return tuple(chosen.values())
