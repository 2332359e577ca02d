"""The argument for a requirement as a list: goals, strategies, solutions, contexts, assumptions, justifications.

A requirement is a goal; a rule's application, an entailment or a person's linking is a strategy; a node's guarantees
are sub-goals; evidence is a solution. What nothing supports stays a goal without anything under it. In modules, with a
number for each element, `avow.report.gsn` has it.
"""

from __future__ import annotations

from avow.assurance.model import Case, DerivationView, EvidenceView, ObligationView, RequirementView
from avow.assurance.naming import derivation_claim, requirement_claim, short
from avow.base.records import dataclass
from avow.evidence.obligation import Kind
from avow.evidence.status import Status, weigh


@dataclass(frozen=True, slots=True)
class Element:
    """`kind` is one of GSN's six, as a word; `below` what stands under it: elements, and claims by their names."""

    kind: str
    title: str
    text: str
    status: Status | None = None
    below: tuple[Element | str, ...] = ()


class Arguments:
    """The arguments of a case."""

    def __init__(self, case: Case) -> None:
        self.case = case
        self.views = {view.id: view for view in case.obligations}
        self.derivations = {derivation_claim(d.derivation.name): d for d in case.derivations}
        self.requirements = {requirement_claim(r.id): r for r in case.requirements}

    def rows(self, requirement: str, most: int) -> list[tuple[int, Element]]:
        """(depth, element) of a requirement's argument, so many at most; a claim is told where it is met first."""
        found: list[tuple[int, Element]] = []
        seen = set[str]()
        stack: list[tuple[int, Element | str]] = [(0, requirement_claim(requirement))]
        while stack and len(found) < most:
            depth, item = stack.pop()
            if isinstance(item, str):
                if item in seen:
                    continue
                seen.add(item)
                item = self.claim(item)
            found.append((min(depth, 12), item))
            stack += [(depth + 1, part) for part in reversed(item.below)]
        return found

    def claim(self, name: str) -> Element:
        """What a claim's name stands for."""
        if name in self.requirements:
            return self._requirement(self.requirements[name])
        if name in self.derivations:
            return _derivation(self.derivations[name])
        view = self.views.get(name)
        return self._obligation(view) if view else Element("goal", short(name), "no such claim", Status.MISSING)

    def _requirement(self, view: RequirementView) -> Element:
        parts: list[Element | str] = [Element("assumption", "Hypothesis", text) for text in view.hypotheses[:6]]
        if len(view.hypotheses) > 6:
            parts.append(Element("assumption", "Hypotheses", f"and {len(view.hypotheses) - 6} more"))
        if view.formal:
            parts.append(Element("context", "Formula", view.formal))
        if view.obligations:
            title = "Entailment" if view.formula else "Model checking"
            text = "The requirement's formula is decided on the composed contracts"
            parts.append(Element("strategy", title, text, below=view.obligations))
        rest = [name for name in view.rests_on if name not in view.obligations]
        parts += [name for name in rest if name in self.derivations]
        if others := tuple(name for name in rest if name not in self.derivations):
            what = "the formula speaks of" if view.formal else "a person says to amount to the requirement"
            parts.append(Element("strategy", "Contracts", f"What the nodes guarantee is what {what}", below=others))
        return Element("goal", view.id, view.words, view.status, tuple(parts))

    def _obligation(self, view: ObligationView) -> Element:
        parts: list[Element | str] = []
        if view.handled:
            finding = next(f for f in self.case.findings if view.id in f.obligations and f.how == view.handled)
            who = f" ({finding.who})" if finding.who else ""
            said = f"{finding.how} as {finding.verdict}: {finding.reason}{who}"
            parts.append(Element("justification", finding.how.capitalize(), said))
        parts += map(_solution, _one_a_method(view))
        # a guarantee's other supports (its contract's sanity) are told only where they fail: an argument, no inventory
        guarantee = view.obligation.kind is Kind.GUARANTEE
        parts += [name for name in view.rests_on if not guarantee or name in view.below]
        return Element("goal", short(view.id), view.obligation.claim, view.standing, tuple(parts))


def _derivation(view: DerivationView) -> Element:
    d = view.derivation
    conditions = ", ".join(condition.text for condition in d.side_conditions)
    context = [Element("justification", "Side conditions", conditions)] if conditions else []
    context += [Element("assumption", "Conditional", text) for text in view.conditional]
    return Element("strategy", f"{d.name}: rule {d.rule}", d.conclusion, view.status, (*context, *view.rests_on))


def _solution(item: EvidenceView) -> Element:
    record = item.entry.evidence
    return Element("solution", record.method, record.summary, weigh(record).status)


def _one_a_method(view: ObligationView) -> tuple[EvidenceView, ...]:
    """The newest record of each method; a refutation is never left out."""
    records = (((item.entry.evidence.method, weigh(item.entry.evidence).refuted), item) for item in view.counting)
    return tuple(dict(records).values())
