"""Requirements that have a formula: does it follow from what is derived? Those with a temporal property: does every
run of the composed contracts have it?

A formula is proved of every step: from the guarantees that the plan names as its support where these suffice, from all
contracts otherwise; or by induction over steps, from the initial values on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from avow.calculus.answers import Answer, contracts, environment_claims, would_hold_if
from avow.calculus.composition import Composition
from avow.calculus.derivation import Phase, Settled
from avow.calculus.discharge import Bounds
from avow.calculus.entailment import QUICK_MS, implied
from avow.calculus.hierarchy import innermost
from avow.calculus.repair import environment, offers, providers
from avow.calculus.variables import Frame
from avow.evidence.obligation import SYSTEM_LEVEL, Kind
from avow.files import digest as sha256
from avow.language.contract import ClauseKind
from avow.language.printer import show_term
from avow.language.terms import Role, Term, Variable
from avow.logic.formula import digest, free_variables, substitute
from avow.logic.smt import Entailment
from avow.system.plan import Requirement
from avow.system.temporal import Property, State, Temporal, parse_property, parse_state, show_property
from avow.verdict import Counterexample, Verdict


@dataclass(frozen=True, slots=True)
class FormulaQuestion:
    """Is the formula entailed at every step?"""

    name: str
    formula: Term
    text: str
    digest: str
    support: tuple[str, ...]

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        """Every way is tried in short rounds first: what one way cannot show, at any length, another may in no time."""
        answer: Answer | None = None
        for limit in dict.fromkeys((min(QUICK_MS, bounds.milliseconds), bounds.milliseconds)):
            answer = self.attempt(composition, replace(bounds, milliseconds=limit))
            if answer.verdict is not Verdict.UNKNOWN or "step" in answer.details:
                return answer
        assert answer is not None
        return answer

    def attempt(self, composition: Composition, bounds: Bounds) -> Answer:
        frame = composition.frame
        everything = tuple(f"{n.name}.{g.name}" for n in frame.system.contract.nodes for g in n.guarantees)
        goal = system_term(frame, self.formula)
        last: Entailment | None = None
        for clauses in dict.fromkeys((self.support, everything)):
            if not clauses:
                continue
            last = self.ask(contracts(frame, clauses) | frame.environment(), goal, bounds)
            if last.verdict is Verdict.PROVED:
                return self.proved(composition, (last,), Phase.SAME_STEP, bounds)
        assert last is not None
        if not any(edge.delayed for edge in frame.graph.edges):
            return self.repaired(frame, goal, self.not_proved(last, genuine=True))
        return self.by_induction(composition, everything, goal, bounds)

    def repaired(self, frame: Frame, goal: Term, answer: Answer) -> Answer:
        """A refutation with what would make it hold; any other answer as it is."""
        if answer.verdict is not Verdict.REFUTED:
            return answer
        nodes = frame.graph.nodes
        everything = tuple(f"{n.name}.{g.name}" for n in frame.system.contract.nodes for g in n.guarantees)
        hypotheses = contracts(frame, everything) | frame.environment()
        spoken = free_variables(goal)
        near = [place for place in providers(frame, nodes) if not spoken.isdisjoint(place.ports)]
        found = offers(frame, hypotheses, goal, (*near, *environment(frame, nodes)))
        if not found:
            return answer
        listed = {"would_hold_if": [offer.data() for offer in found]}
        return replace(answer, summary=answer.summary + would_hold_if(found), details=answer.details | listed)

    def by_induction(self, composition: Composition, everything: tuple[str, ...], goal: Term, bounds: Bounds) -> Answer:
        frame = composition.frame
        now = contracts(frame, everything) | frame.environment()
        first = self.ask(now | frame.initials(frame.graph.nodes), goal, bounds)
        if first.verdict is not Verdict.PROVED:
            return self.not_proved(first, genuine=True, when="at the first step")
        itself = {f"{self.name} one step before": system_term(frame, self.formula, 1)}
        before = contracts(frame, everything, 1) | frame.environment(1)
        later = first
        for earlier in (
            itself,
            itself | before,
        ):  # mostly it keeps itself, and the contracts of a step less make it quick
            later = self.ask(now | earlier, goal, bounds)
            if later.verdict is Verdict.PROVED:
                return self.proved(composition, (first, later), Phase.LATER, bounds)
        return self.not_proved(later, genuine=False, when="at a later step (perhaps never reached)")

    def ask(self, hypotheses: Mapping[str, Term], goal: Term, bounds: Bounds) -> Entailment:
        return implied(hypotheses, goal, timeout_ms=bounds.milliseconds, seed=bounds.seed)

    def proved(self, composition: Composition, answers: tuple[Entailment, ...], phase: Phase, bounds: Bounds) -> Answer:
        needed = tuple(dict.fromkeys(label for answer in answers for label in answer.needed))
        beyond = [n for n in _guarantees(composition.frame, needed) if n not in self.support and self.support]
        how = "at the first step, and from one step to the next" if phase is Phase.LATER else "at every step"
        summary = f"follows {how} from {', '.join(needed) or 'the types alone'}"
        if beyond:
            summary += f" (not named as its support: {', '.join(beyond)})"
        return Answer(
            Verdict.PROVED,
            summary,
            hypotheses=rests_on(composition, needed, bounds),
            details={"needed": list(needed), "phase": phase.value},
            vacuous=any(answer.vacuous for answer in answers),
        )

    def not_proved(self, answer: Entailment, *, genuine: bool, when: str = "") -> Answer:
        details: dict[str, object] = {"genuine": genuine}
        if answer.verdict is Verdict.REFUTED and answer.counterexample is not None:
            told = f"the contracts allow {self.name} to be false{' ' + when if when else ''}"
            shown = Counterexample(answer.counterexample.values, told)
            if genuine:
                return Answer(Verdict.REFUTED, told, shown, details=details)
            return Answer(
                Verdict.UNKNOWN,
                f"not inductive: {shown.text()}; a stronger invariant among the guarantees would settle it",
                details=details | {"step": dict(shown.values)},
            )
        return Answer(Verdict.UNKNOWN, f"the solver gave up: {answer.reason}", details=details)


@dataclass(frozen=True, slots=True)
class TemporalQuestion:
    """Has every run the property?"""

    name: str
    formula: Property
    text: str
    digest: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        from avow.calculus.model_checking import judge
        from avow.calculus.scenario import CannotRun

        try:
            machine = composition.machine(bounds.seed)
        except CannotRun:
            machine = None  # the judge meets the same obstacle, and says what it means for the property
        answer = judge(composition.frame, self.name, self.formula, bounds, machine)
        if not answer.verdict.supports:
            return answer
        # every node was taken at its word, which it keeps only where its assumptions are met
        nodes = composition.frame.system.contract.nodes
        behind = rests_on(composition, tuple(f"{n.name}.{g.name}" for n in nodes for g in n.guarantees), bounds)
        return replace(answer, hypotheses=tuple(dict.fromkeys((*answer.hypotheses, *behind))))


def requirement_question(frame: Frame, requirement: Requirement) -> FormulaQuestion | TemporalQuestion | None:
    """The question behind a requirement; None where it is prose. Raises Rejected for a formula that is wrong."""
    contract = frame.system.contract
    if requirement.formula is not None:
        term = parse_state(requirement.formula, contract, requirement.formula_span)
        support = tuple(name for entry in requirement.supported_by for name in _expand(frame, entry))
        shown = show_term(system_term(frame, term))
        return FormulaQuestion(requirement.id, term, shown, digest(term), tuple(dict.fromkeys(support)))
    if requirement.temporal is not None:
        formula = parse_property(requirement.temporal, contract, requirement.formula_span)
        return TemporalQuestion(requirement.id, formula, show_property(formula), sha256(_meaning(formula)))
    return None


def system_term(frame: Frame, formula: Term, earlier: int = 0) -> Term:
    """A formula over ``node.port`` in system-level variables."""
    mapping: dict[Variable, Term] = {}
    for variable in free_variables(formula):
        node, _, port = variable.name.partition(".")
        find = frame.input if variable.role is Role.INPUT else frame.output
        mapping[variable] = find(node, port, earlier)
    return substitute(formula, mapping)


def rests_on(composition: Composition, labels: tuple[str, ...], bounds: Bounds) -> tuple[str, ...]:
    """The claims behind the labels of a proof: guarantees, discharged assumptions, environment assumptions.

    A guarantee holds only where its node's assumptions do. What these were proved from are guarantees of other nodes,
    which hold only where *their* assumptions do, and so on: all of it stands behind the proof.
    """
    frame = composition.frame
    settled: dict[str, dict[str, Settled]] = {}
    found: dict[str, None] = {}
    seen: set[str] = set()
    todo = list(reversed(labels))
    while todo:
        name = todo.pop().removesuffix(" one step before")
        if " " not in name:
            name = innermost(name)
        if name in seen:
            continue
        seen.add(name)
        found |= dict.fromkeys(environment_claims((name,)))
        node, dot, clause = name.partition(".")
        if not dot or " " in node or node not in frame.graph.nodes:
            continue
        if frame.node(node).clause(clause).kind is ClauseKind.GUARANTEE:
            found[f"{node}/{Kind.GUARANTEE}/{clause}"] = None
            todo += [f"{node}.{assumption.name}" for assumption in reversed(frame.node(node).assumptions)]
            continue
        shown = composition.where(node, clause)
        if shown is None:
            found[f"{SYSTEM_LEVEL}/{Kind.COMPOSITION}/environment.{name}"] = None
            continue
        goal, about = shown
        found[f"{SYSTEM_LEVEL}/{Kind.COMPOSITION}/{goal.name}.{about}"] = None
        if goal.name not in settled:
            answers = composition.settled(goal, bounds).settled
            settled[goal.name] = {str(condition.about): answer for condition, answer in answers.items()}
        todo += reversed(settled[goal.name][str(about)].needed)
    return tuple(found)


def _guarantees(frame: Frame, labels: tuple[str, ...]) -> list[str]:
    names = dict.fromkeys(label.removesuffix(" one step before") for label in labels)
    known = {f"{n.name}.{g.name}" for n in frame.system.contract.nodes for g in n.guarantees}
    return [name for name in names if name in known]


def _expand(frame: Frame, entry: str) -> tuple[str, ...]:
    node, dot, _ = entry.partition(".")
    if dot:
        return (entry,)
    if node in frame.graph.nodes:
        return tuple(f"{node}.{g.name}" for g in frame.node(node).guarantees)
    return ()


def _meaning(formula: Property) -> str:
    match formula:
        case State(term=term):
            return digest(term)
        case Temporal(operator=operator, parts=parts):
            return f"({operator} {' '.join(map(_meaning, parts))})"
