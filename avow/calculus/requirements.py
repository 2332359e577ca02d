"""Requirements with a formula: does it follow from the contracts? Requirements with a temporal property: does it hold
on every run of the composed contracts?

A formula is proved for every step: from the guarantees that the plan names as its support if these suffice, from all
contracts otherwise; or by induction over steps, starting from the initial values.

A formula that holds whatever the nodes do, or only because its condition never arises, is satisfied by every design,
and a proof of it shows nothing. So a formula that the contracts imply gets the checks that the sanity analysis makes
for a guarantee: is it a tautology, or does it follow from the plan's assumptions alone; can each of its conditions
arise (`avow.sanity.claims.triggers`); do the contracts exclude any of its mutants (`avow.sanity.mutants`)? These checks
are about one step, which need not be reachable, so vacuity is only reported if it is proved. A temporal property is
checked the same way over the runs of the plan's scenario.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from itertools import product

from avow.base.diagnostics import Span
from avow.base.files import sha256
from avow.base.plain import listed
from avow.base.records import dataclass
from avow.base.tuning.bounds import PROPERTY_ATOMS, REQUIREMENT_MUTANTS
from avow.base.tuning.effort import CONSISTENT_EFFORT, QUICK_EFFORT
from avow.base.verdict import Counterexample, Verdict
from avow.calculus import chance
from avow.calculus.certificates import hint_of, labels
from avow.calculus.composition import Composition
from avow.calculus.derivation import Case, Phase, about_memory
from avow.calculus.discharge import Bounds
from avow.calculus.entailment import implied
from avow.calculus.finder import Hint
from avow.calculus.induction import BEFORE, INVARIANT, Written, further, in_words, steps
from avow.calculus.ltl import TooLong, violation
from avow.calculus.model_checking import cannot_run, explored, judge_property
from avow.calculus.questions import Answer, as_far_as_shown, certified
from avow.calculus.scenario import CannotRun
from avow.calculus.trials import composes
from avow.calculus.variables import Frame, Observed, framed, system_term
from avow.evidence.record import COMPOSES
from avow.formulas.formula import digest, free_variables, negation
from avow.language.contract import Clause
from avow.language.printer import show_term
from avow.language.terms import FALSE, Term
from avow.sanity.claims import triggers
from avow.sanity.mutants import mutants
from avow.solving.questions import Entailment, solve
from avow.system.formulas import environment_assumptions
from avow.system.plan import Requirement
from avow.system.temporal import (
    Operator,
    Property,
    State,
    Temporal,
    parse_property,
    show_property,
    states_of,
)


@dataclass(frozen=True, slots=True)
class FormulaQuestion:
    """Is the formula entailed at every step?"""

    name: str
    formula: Term
    text: str
    digest: str
    support: tuple[str, ...]
    unsaid: str = ""
    """Why there is no formula over one step, for a formula that mentions other steps."""
    required: bool = False
    """Whether the formula is a requirement's, which must not be vacuous; a demand of a refinement may follow from
    anything."""
    spoken: Term | None = None
    """What must not be vacuous, if it is not the formula."""
    likely: Mapping[str, Clause] = field(default_factory=dict)
    """The guarantees with a probability that the formula takes as kept."""

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        """Tries each method briefly first: one may be quick where another never succeeds. A run over the plan's
        scenario that violates the formula is searched for before any long attempt."""
        if self.unsaid:
            why = f"{self.unsaid}: nothing can be shown of it step by step; a `temporal` property is judged over runs"
            return Answer(Verdict.UNKNOWN, why)
        answer = as_far_as_shown(composition.frame, self.searched(composition, bounds))
        if not self.required or answer.verdict is not Verdict.PROVED or answer.vacuous:
            return answer
        frame, assumed = composition.frame, composition.assumed(self.name)
        kept = {
            name: system_term(frame, chance.over_system(c.spoken, name.partition(".")[0]))
            for name, c in self.likely.items()
        }
        known = self.known(frame, _every_guarantee(frame)) | kept
        spoken = self.spoken or self.formula
        why = _formula_says_nothing(frame, spoken, known, assumed, bounds)
        if answer.established is not None:
            more = composes(frame, system_term(frame, spoken), answer.established)
            answer = replace(answer, details={**answer.details, COMPOSES: more})
        why = why or (self.dead_condition(composition, bounds) if self.name in frame.observed else "")
        listed = answer.details.get("needed")
        labels = tuple(map(str, listed)) if isinstance(listed, list) else ()
        used = _guarantees(frame, labels)
        if why := why or self.unused_support(frame, used, labels, assumed):
            return _says_nothing(answer, why)
        inside = _inside(composition, self.name)
        unnamed = [n for n in used if self.support and n not in self.support and n.partition(".")[0] not in inside]
        told = f"; `supported_by` does not name {', '.join(unnamed)}: add what it rests on" if unnamed else ""
        return replace(answer, summary=answer.summary + told)

    def dead_condition(self, composition: Composition, bounds: Bounds) -> str:
        """Why a condition of a formula about other steps never comes about; otherwise empty. The condition's absence is
        asked for as a requirement is: it may follow only from one step to the next."""
        system, graph = composition.frame.system, composition.frame.graph
        brief = replace(bounds, effort=min(CONSISTENT_EFFORT, bounds.effort))
        for trigger in triggers(composition.frame.required[self.name]):
            absent = {self.name: negation(trigger)}
            apart = replace(composition, frame=framed(system, graph, environment_assumptions(system, graph), absent))
            asked = formula_question(apart.frame, self.name, ())
            answer = _Whether(asked.name, asked.formula, "", "", (), asked.unsaid).attempt(apart, brief)
            if answer.verdict is Verdict.PROVED and not asked.unsaid:
                return f"its condition never comes about: {show_term(trigger)} is excluded: {answer.summary}"
        return ""

    def unused_support(
        self, frame: Frame, used: Sequence[str], labels: Sequence[str], assumed: Mapping[str, Term]
    ) -> str:
        """Why the proof of a formula uses no guarantee, or none that the plan names as its support; otherwise empty."""
        needed = {label.removesuffix(" one step before") for label in labels} - {self.name}
        if not used and not self.likely and needed <= assumed.keys():
            if needed:
                alone = ", ".join(sorted(needed))
                return f"the formula follows from the assumptions alone, whatever the nodes guarantee: {alone}"
            if not _about_links(frame, frame.required[self.name]):
                return "the formula is a tautology over steps: it holds whatever the nodes do"
        if used and self.support and set(used).isdisjoint(self.support):
            return f"it needs none of the guarantees that supported_by names, but {', '.join(used)}: name these"
        return ""

    def searched(self, composition: Composition, bounds: Bounds) -> Answer:
        """The answer from the clauses that have formulas over one step."""
        quick = min(QUICK_EFFORT, bounds.effort)
        answer = self.attempt(composition, replace(bounds, effort=quick))
        if answer.verdict is not Verdict.UNKNOWN:
            return answer
        run, searched = self.broken_by_a_run(composition, bounds)
        if run is not None:
            return run
        if "step" not in answer.details and bounds.effort > quick:
            answer = self.attempt(composition, bounds, patient=True)
        if answer.verdict is not Verdict.UNKNOWN or not searched:
            return answer
        return replace(answer, summary=f"{answer.summary}; {searched}")

    def broken_by_a_run(self, composition: Composition, bounds: Bounds) -> tuple[Answer | None, str]:
        """A run of the composed contracts over the plan's scenario with a step at which the formula is false; otherwise
        how far the search went."""
        if composition.frame.system.plan.scenario is None:
            return None, ""
        always = Temporal(Operator.ALWAYS, (State(self.formula),))
        try:
            found = explored(composition.machine(bounds.seed, self.name), self.name, always, bounds, None)
        except CannotRun:
            return None, ""
        if found.verdict is Verdict.REFUTED and found.counterexample is not None:
            return replace(found, details={"genuine": True, "run": len(found.counterexample.trace)}), ""
        return None, f"no run of the {found.bound['steps']} kinds of steps looked at over the scenario makes it false"

    def attempt(self, composition: Composition, bounds: Bounds, *, patient: bool = False) -> Answer:
        """One round. The `patient` one, after a quick one, makes only the widest query of each kind, so that an
        undecided formula costs only a few times the limit."""
        frame = composition.frame
        everything = _every_guarantee(frame)
        goal = system_term(frame, self.formula)
        delayed = bool(frame.memory(of=self.name)) or any(edge.delayed for edge in frame.graph.edges)
        last: Entailment | None = None
        # Induction includes a proof at one step.
        glance = replace(bounds, effort=min(CONSISTENT_EFFORT, bounds.effort)) if delayed else bounds
        for clauses in dict.fromkeys((everything,) if patient else (self.support, everything)):
            if (everything and not clauses) or (patient and delayed):
                continue
            last = self.ask(self.known(frame, clauses), goal, glance, whether=delayed or clauses != everything)
            if last.verdict is Verdict.PROVED:
                return self.proved(composition, (last,), Phase.SAME_STEP, bounds)
        if delayed:
            return self.by_induction(composition, everything, goal, bounds, patient)
        assert last is not None
        return self.not_proved(last)

    def by_induction(
        self, composition: Composition, everything: tuple[str, ...], goal: Term, bounds: Bounds, patient: bool
    ) -> Answer:
        frame = composition.frame
        now = self.known(frame, everything)
        initial = frame.initials(frame.graph.nodes) | frame.blank(self.name)
        quick = replace(bounds, effort=min(QUICK_EFFORT, bounds.effort))
        first = self.ask(now | initial, goal, quick)
        if patient and first.verdict is Verdict.UNKNOWN:
            first = self.ask(now | initial, goal, bounds)
        if first.verdict is not Verdict.PROVED:
            return self.not_proved(first, "at the first step")
        itself = {f"{self.name} one step before": system_term(frame, self.formula, 1)}
        before = self.known(frame, everything, 1)
        later = first
        # Usually the formula alone is inductive; without the contracts one step before, the query is quick.
        for earlier in (itself | before,) if patient else (itself, itself | before):
            later = self.ask(now | earlier, goal, bounds, whether=earlier is itself)
            if later.verdict is Verdict.PROVED:
                return self.proved(composition, (first, later), Phase.LATER, bounds)
        if later.verdict is not Verdict.REFUTED:
            return self.not_proved(later)
        asked = steps(frame, now, now, initial, goal)
        more = further(frame, asked, bounds.effort, bounds.seed, self.name)
        if more.proved is not None:
            kept = Entailment(Verdict.PROVED, needed=more.proved, engine=more.engine)
            by = (more.by,) if more.by else ()
            return self.proved(composition, (first, kept), Phase.LATER, bounds, more.steps, by)
        if more.run is not None:
            summary = f"a run of {more.steps} steps makes {self.name} false"
            details: dict[str, object] = {"genuine": True, "run": more.steps}
            return Answer(Verdict.REFUTED, summary, more.run, bound={"steps": more.steps}, details=details)
        return self.induction_fails(later)

    def induction_fails(self, answer: Entailment) -> Answer:
        """The answer if some step does not preserve the formula and it is unknown whether that step is ever reached."""
        values = answer.counterexample.values if answer.counterexample is not None else ()
        summary = f"here induction fails, {self.name} is false, if such a step is reached (@before: one step before)"
        shown = Counterexample(values, summary)
        at = ", ".join(f"{name} = {value}" for name, value in values[:6])
        return Answer(
            Verdict.UNKNOWN,
            f"not inductive: {self.name} holds at the first step, but induction fails at {at or 'some step'}: that it "
            "is ever reached is not shown; a stronger invariant among the guarantees would settle it",
            shown,
            details={"genuine": False, "induction": "fails", "step": dict(values)},
        )

    def known(self, frame: Frame, clauses: tuple[str, ...], earlier: int = 0) -> dict[str, Term]:
        """The hypotheses about a step: these guarantees, all assumptions of their nodes, the environment assumptions,
        and the definitions of cells."""
        found: dict[str, Term] = {}
        for node, _, clause in (name.partition(".") for name in clauses):
            for name in (*(assumption.name for assumption in frame.node(node).assumptions), clause):
                found[f"{node}.{name}{' one step before' if earlier else ''}"] = frame.clause(node, name, earlier)
        return found | frame.environment(earlier) | frame.memory(earlier, self.name)

    def ask(self, hypotheses: Mapping[str, Term], goal: Term, bounds: Bounds, whether: bool = False) -> Entailment:
        return implied(hypotheses, goal, effort=bounds.effort, seed=bounds.seed, whether=whether)

    def proved(
        self,
        composition: Composition,
        answers: tuple[Entailment, ...],
        phase: Phase,
        bounds: Bounds,
        before: int = 1,
        by: tuple[Written, ...] = (),
    ) -> Answer:
        """`before`: the number of earlier steps needed to prove the next; `by`: invariants that were found."""
        needed = tuple(dict.fromkeys(label for answer in answers for label in answer.needed))
        how = "at the first step, and from one step to the next" if phase is Phase.LATER else "at every step"
        if before > 1:
            how = f"at the first {before} steps, and from each {before} steps to the next"
        named = [label for label in needed if not about_memory(label) and not label.startswith(INVARIANT)]
        summary = f"follows {how} from {', '.join(named) or 'the wiring and the types alone'}"
        details: dict[str, object] = {"needed": named, "phase": phase.value} | ({"k": before} if before > 1 else {})
        cases = [Case(phase, one.verdict, one.needed) for one in answers]
        hint = Hint(labels(needed)) if len(cases) == 1 else hint_of(cases[0], replace(cases[1], depth=before))
        found = composition.certificates.requirement(self.name, hint, bounds, by)
        fallen = composition.fallen(composition.whole) if found is None else ()
        shown = [in_words(composition.frame, one) for one in by]
        if shown and not fallen:  # otherwise it was found with hypotheses that may not be used
            details["invariants"] = shown
            summary += f"; by an invariant that was found: {' and '.join(shown)}"
        answer = Answer(Verdict.PROVED, summary, details=details, vacuous=any(answer.vacuous for answer in answers))
        return certified(answer, found, late=composition.certificates.late, fallen=fallen)

    def not_proved(self, answer: Entailment, when: str = "") -> Answer:
        details: dict[str, object] = {"genuine": True}
        if answer.verdict is Verdict.REFUTED and answer.counterexample is not None:
            text = f"the contracts allow {self.name} to be false{' ' + when if when else ''}"
            return Answer(Verdict.REFUTED, text, Counterexample(answer.counterexample.values, text), details=details)
        return Answer(Verdict.UNKNOWN, f"the solver gave up: {answer.reason}", details={"genuine": False})


class _Whether(FormulaQuestion):
    """As `FormulaQuestion`, without a certificate."""

    def proved(
        self, composition: Composition, answers: tuple[Entailment, ...], *rest: object, **more: object
    ) -> Answer:
        needed = dict.fromkeys(label for answer in answers for label in answer.needed if not about_memory(label))
        return Answer(Verdict.PROVED, f"it follows from {listed(tuple(needed), 6)}")


@dataclass(frozen=True, slots=True)
class TemporalQuestion:
    """Does every run have the property?"""

    name: str
    formula: Property
    text: str
    digest: str

    def __call__(self, composition: Composition, bounds: Bounds) -> Answer:
        try:
            judged = judge_property(composition.machine(bounds.seed), self.name, self.formula, bounds)
        except CannotRun as reason:
            judged = cannot_run(composition.frame, self.name, self.formula, reason)
        answer = as_far_as_shown(composition.frame, judged)
        if not answer.verdict.supports:
            return answer

        def holds(other: Property) -> bool:
            return judge_property(composition.machine(bounds.seed), self.name, other, bounds).verdict.supports

        frame, assumed = composition.frame, composition.assumed()
        answer = _says_nothing(answer, _property_says_nothing(frame, self.formula, holds, assumed, bounds))
        # every node's guarantees were used, which hold only if its assumptions are met
        return replace(answer, everything=True)


def _says_nothing(answer: Answer, why: str) -> Answer:
    """The answer, marked vacuous if a reason `why` is given."""
    return replace(answer, vacuous=True, summary=f"says nothing: {why}") if why else answer


def temporal_question(frame: Frame, name: str, text: str, span: Span | None) -> TemporalQuestion:
    """The question for a temporal property. Raises Rejected if it is wrong."""
    formula = parse_property(text, frame.system.contract, span)
    return TemporalQuestion(name, formula, show_property(formula), sha256(_meaning(formula)))


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


def _inside(composition: Composition, requirement: str) -> frozenset[str]:
    """The nodes of the derivations that a requirement names as its support."""
    wanted = (r.supported_by for r in composition.frame.system.plan.requirements if r.id == requirement)
    named = {name for names in wanted for name in names}
    return frozenset(n for g in composition.goals if g.name in named for n in composition.leaves(g, g.nodes))


def formula_question(frame: Frame, name: str, support: tuple[str, ...]) -> FormulaQuestion:
    """The question for a required formula; `support`: guarantees from which it should follow."""
    term = frame.required[name]
    known = frame.observed.get(name, Observed(term))
    text = show_term(system_term(frame, term))
    return FormulaQuestion(name, known.formula, text, digest(term), support, known.unsaid)


def _every_guarantee(frame: Frame) -> tuple[str, ...]:
    return tuple(f"{n.name}.{g.name}" for n in frame.system.contract.nodes for g in n.guarantees)


def _guarantees(frame: Frame, labels: tuple[str, ...]) -> list[str]:
    known = frozenset(_every_guarantee(frame))
    return [name for name in dict.fromkeys(label.removesuffix(" one step before") for label in labels) if name in known]


def _about_links(frame: Frame, formula: Term) -> bool:
    """Whether the formula speaks of two ports with values of one source."""
    sources = {v.name.removesuffix(BEFORE) for v in free_variables(system_term(frame, formula))}
    return len(sources) < len(free_variables(formula))


def _meaning(formula: Property) -> str:
    match formula:
        case State(term=term):
            return digest(term)
        case Temporal(operator=operator, parts=parts):
            return f"({operator} {' '.join(map(_meaning, parts))})"


def _formula_says_nothing(
    frame: Frame, formula: Term, known: Mapping[str, Term], assumed: Mapping[str, Term], bounds: Bounds
) -> str:
    """Why a formula that `known` implies is vacuous; otherwise empty. `formula` is over ``node.port``; `assumed` are
    the hypotheses that are not guarantees."""
    effort = min(CONSISTENT_EFFORT, bounds.effort)

    def proves(hypotheses: Mapping[str, Term], goal: Term) -> tuple[str, ...] | None:
        found = implied(hypotheses, goal, effort=effort, seed=bounds.seed, whether=True)
        return found.needed if found.verdict is Verdict.PROVED else None

    goal = system_term(frame, formula)
    if proves({}, formula) is not None:
        return "the formula is a tautology: it holds whatever the nodes do"
    if needed := proves(assumed, goal):
        return f"the formula follows from the assumptions alone, whatever the nodes guarantee: {listed(needed, 6)}"
    for trigger in triggers(goal):
        if (needed := proves(known, negation(trigger))) is not None:
            return f"its condition never comes about: {show_term(trigger)} is excluded by {listed(needed, 6)}"
    changed = mutants(goal)[:REQUIREMENT_MUTANTS]
    if all(proves(known, mutant.formula) is not None for mutant in changed):
        other = [mutant.change for mutant in changed if proves({"": goal}, mutant.formula) is None]
        if other:
            return f"it holds just as well when it is changed to say something else: {listed(other, 4)}"
    return ""


def _property_says_nothing(
    frame: Frame, formula: Property, holds: Callable[[Property], bool], assumed: Mapping[str, Term], bounds: Bounds
) -> str:
    """Why a temporal property that every run has is vacuous; otherwise empty. `holds` tells whether every run has
    another property."""
    if _tautological(frame, formula, assumed, bounds):
        return "the property holds of every run, whatever the nodes do"
    given = {frame.input(e.node, e.port) for e in frame.graph.environment}
    if all(free_variables(system_term(frame, state.term)) <= given for state in states_of(formula)):
        return "the property speaks of the environment alone: it holds whatever the nodes do"
    for condition, mutant in _without_demand(formula):
        try:
            if holds(mutant):
                return f"its condition never comes about on any run of the scenario: {condition}"
        except (CannotRun, TooLong):
            continue
    return ""


def _tautological(frame: Frame, formula: Property, assumed: Mapping[str, Term], bounds: Bounds) -> bool:
    """Whether no sequence of steps that the assumptions allow violates the property."""
    states = states_of(formula)
    if len(states) > PROPERTY_ATOMS:
        return False
    rows = [
        dict(zip(states, values, strict=True))
        for values in product((True, False), repeat=len(states))
        if _possible(frame, states, values, assumed, bounds)
    ]
    every = range(len(rows))
    try:
        return violation(formula, every, lambda _: every, lambda step, state: rows[step][state]) is None
    except TooLong:
        return False


def _possible(
    frame: Frame, states: Sequence[State], values: Sequence[bool], assumed: Mapping[str, Term], bounds: Bounds
) -> bool:
    terms = [system_term(frame, state.term) for state in states]
    wanted = {f"state {k}": t if v else negation(t) for k, (t, v) in enumerate(zip(terms, values, strict=True))}
    effort = min(CONSISTENT_EFFORT, bounds.effort)
    return solve({**assumed, **wanted}, effort=effort, seed=bounds.seed, values="never").status != "unsat"


def _without_demand(formula: Property) -> Iterator[tuple[str, Property]]:
    """For each condition under which the property demands something: the condition, and the property that it never
    arises."""
    match formula:
        case State(term=term):
            for trigger in triggers(term):
                yield show_term(trigger), State(negation(trigger))
        case Temporal(operator=Operator.IMPLIES, parts=(left, right)):
            yield show_property(left), Temporal(Operator.IMPLIES, (left, State(FALSE)))
            for condition, changed in _without_demand(right):
                yield condition, Temporal(Operator.IMPLIES, (left, changed))
        case Temporal(operator=Operator.ALWAYS | Operator.NEXT as operator, parts=(body,)):
            for condition, changed in _without_demand(body):
                yield condition, Temporal(operator, (changed,))
        case Temporal(operator=Operator.AND, parts=parts):
            for part in parts:
                yield from _without_demand(part)
        case _:  # it demands something without a condition
            return
