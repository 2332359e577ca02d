"""The sanity claims of a node whose clauses have state variables: about states that runs can reach, not all states.

A run reaches a state by steps at which all assumptions and guarantees hold. A formula that holds in no state holds in
no reached state; a possibility is shown at the end of a run from the first step.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import assert_never

from avow.base.diagnostics import Severity
from avow.base.tuning.bounds import RUN_TO_AN_EXAMPLE, VIABILITY_ROUNDS
from avow.base.verdict import Verdict
from avow.formulas.formula import conjunction, disjunction, free_variables, negation, substitute
from avow.formulas.temporal.cells import Remembering
from avow.formulas.temporal.clock import one_step
from avow.language.contract import ClauseKind, Node
from avow.language.subterms import histories
from avow.language.terms import Compare, Not, Role, Term, Variable
from avow.sanity.claims import Claim, Property, triggers
from avow.sanity.results import Finding, Patience, listing, never_demanded
from avow.sanity.viability import Viability, lasting, steps_of, told_apart, viable
from avow.solving.limits import spent
from avow.solving.questions import solve
from avow.solving.second import CONTRADICTED, contradicted, doubted

_TRIGGER = "trigger"


STEPS_OF_INDUCTION = 2
"""The number of consecutive steps at which a condition is false before it has to be false at the next."""


@dataclass(slots=True)
class OverRuns:
    """One node; its claims share the results about its states."""

    node: Node
    patience: Patience
    seed: int = 0
    serious: bool = True
    """Whether the current claim has severity error."""
    remembering: Remembering = field(init=False)
    _viable: Viability | None = None
    _empty: bool | None = None
    _ends: dict[int, bool] = field(default_factory=dict)
    _written: list[Mapping[str, Term]] = field(default_factory=list)
    """The facts before the first step of a run, then those of each step: the contract is kept, cells are updated."""

    @property
    def limit(self) -> int:
        """Effort for one query of this claim: the more went into claims that stayed open, the less."""
        return self.patience.effort(self.serious)

    def __post_init__(self) -> None:
        asked = tuple(
            replace(clause, name=f"{clause.name} {_TRIGGER}", formula=negation(trigger))  # false at every position
            for clause in self.node.guarantees
            for trigger in triggers(clause.formula)
        )
        self.remembering = told_apart(one_step(replace(self.node, guarantees=(*self.node.guarantees, *asked))))

    @property
    def assumptions(self) -> Mapping[str, Term]:
        return {c.name: c.formula for c in self.remembering.node.assumptions}

    @property
    def guarantees(self) -> Mapping[str, Term]:
        return {c.name: c.formula for c in self.remembering.node.guarantees if not c.name.endswith(_TRIGGER)}

    def settle(self, claim: Claim) -> Finding:
        self.serious, start, lost = claim.severity is Severity.ERROR, spent(), self.patience.lost
        found = self._settled(claim)
        if found.verdict is Verdict.UNKNOWN:
            self.patience.lost = max(self.patience.lost, lost + spent() - start)
        failed = claim.about is not Property.ASSUMPTIONS_SATISFIABLE and self._impossible(found)
        return replace(found, because="assumptions-satisfiable") if failed else found

    def _impossible(self, found: Finding) -> bool:
        """Whether a claim is false only because no run is allowed at all."""
        if found.verdict is not Verdict.REFUTED:
            return False
        if self._empty is None:
            self._empty = self._possible(self.assumptions, "").verdict is Verdict.REFUTED
        return self._empty

    def _settled(self, claim: Claim) -> Finding:
        unsaid = self.remembering.unsaid
        if unsaid:
            name, why = next(iter(unsaid.items()))
            return Finding(Verdict.UNKNOWN, f"{name} speaks of {why.reason}")
        spoken = {v for a in self.assumptions.values() for v in free_variables(a) if v.role is Role.OUTPUT}
        if spoken:
            return Finding(
                Verdict.UNKNOWN, f"an assumption speaks of {min(v.qualified for v in spoken)} at the same step"
            )
        match claim.about:
            case Property.REALIZABLE:
                return self._realizable()
            case Property.ASSUMPTIONS_SATISFIABLE:
                return self._satisfiable()
            case Property.CONSISTENT:
                together = {**self.assumptions, **self.guarantees}
                return self._possible(together, "no inputs and outputs meet {} at any step of a run")
            case Property.NOT_TAUTOLOGICAL | Property.NOT_REDUNDANT:
                return self._alone(claim)._said_already(claim)
            case Property.NOT_VACUOUS:
                return self._not_vacuous(claim.subject or "")
            case Property.CONSTRAINED:
                return self._constrained(claim.subject or "")
            case Property.DETERMINED:
                return self._determined(claim.subject or "")
            case Property.NEEDED:
                return self._needed(claim.subject or "")
            case Property.MEETABLE:
                return Finding(Verdict.UNKNOWN, "not asked of clauses that speak of other steps")
            case _:
                assert_never(claim.about)

    @property
    def viability(self) -> Viability:
        if self._viable is None:
            self._viable = viable(one_step(self.node), effort=2 * self.patience.effort(serious=True), seed=self.seed)
        return self._viable

    def _satisfiable(self) -> Finding:
        found = self._possible(self.assumptions, "no input meets {} at any step of a run")
        if found.verdict is not Verdict.PROVED or not any(histories(c.formula) for c in self.node.assumptions):
            return found
        for_ever = lasting(self.node, effort=2 * self.patience.effort(serious=True), seed=self.seed)
        match for_ever.verdict:
            case Verdict.PROVED:
                return found
            case Verdict.REFUTED:
                text = "every run of inputs comes to a step at which no input meets {}"
                return Finding(Verdict.REFUTED, text.format(listing(tuple(self.assumptions))), tuple(self.assumptions))
        return Finding(for_ever.verdict, f"whether inputs can meet them for ever is open: {for_ever.reason}")

    def _realizable(self) -> Finding:
        found = self.viability
        if found.verdict is Verdict.REFUTED:
            steps = f" in {steps_of(len(found.run.trace))}" if found.run is not None and found.run.trace else ""
            text = found.reason or f"the environment can bring it{steps} to where no output meets the guarantees"
            return Finding(found.verdict, text, found.clauses or tuple(self.guarantees), found.run)
        if found.verdict is Verdict.UNKNOWN and not self.node.inputs and not self.node.assumptions:
            for length in range(1, VIABILITY_ROUNDS + 1):
                if self._over(length):
                    if contradicted([conjunction(self._run(length).values())]):
                        return Finding(Verdict.ERROR, CONTRADICTED)
                    text = f"nothing comes in, and no run of {steps_of(length)} meets the guarantees"
                    return Finding(Verdict.REFUTED, text, tuple(self.guarantees))
        return Finding(found.verdict, found.reason)

    def _alone(self, claim: Claim) -> OverRuns:
        """The node with the clauses that the claim is about: the others would exclude runs that the claim needs."""
        clause = self.node.clause(claim.subject or "")
        if clause.kind is ClauseKind.GUARANTEE:
            whole = claim.about is Property.NOT_REDUNDANT
            return self if whole else OverRuns(replace(self.node, guarantees=(clause,)), self.patience, self.seed)
        these = self.node.assumptions if claim.about is Property.NOT_REDUNDANT else (clause,)
        return OverRuns(replace(self.node, assumptions=these, guarantees=()), self.patience, self.seed)

    def _said_already(self, claim: Claim) -> Finding:
        name = claim.subject or ""
        kind = self.node.clause(name).kind
        own = self.assumptions if kind is ClauseKind.ASSUMPTION else self.guarantees
        others: Mapping[str, Term] = {} if kind is ClauseKind.ASSUMPTION else self.assumptions
        if claim.about is Property.NOT_REDUNDANT:
            others = {**others, **{label: f for label, f in own.items() if label != name}}
        found = self._possible({**others, "": negation(own[name])}, "it follows from {}")
        needed = tuple(label for label in found.clauses if label)
        if found.verdict is not Verdict.REFUTED:
            return found
        text = f"it follows from {listing(needed)}" if needed else "it holds at every step of every run"
        return Finding(found.verdict, text, needed)

    def _not_vacuous(self, name: str) -> Finding:
        asked = [negation(c.formula) for c in self.remembering.node.guarantees if c.name == f"{name} {_TRIGGER}"]
        written = triggers(self.node.clause(name).formula)
        for trigger, shown in zip(asked, written, strict=True):
            found = self._possible({**self.assumptions, "its trigger": trigger}, "")
            if found.verdict is Verdict.REFUTED:
                clauses = tuple(c for c in found.clauses if c in self.assumptions)
                given = f" (given {listing(clauses)})" if clauses else ""
                return replace(
                    found, explanation=f"{never_demanded(shown, among=len(written))}{given}", clauses=clauses
                )
            if found.verdict is not Verdict.PROVED:
                return found
        return Finding(Verdict.PROVED)

    def _constrained(self, name: str) -> Finding:
        output = self.node.output(name).variable
        spoken = {label: f for label, f in self.guarantees.items() if output in free_variables(f)}
        if not any(output in free_variables(clause.formula) for clause in self.node.guarantees):
            return Finding(Verdict.REFUTED, f"no guarantee mentions out.{name}")
        if not spoken:
            return Finding(Verdict.UNKNOWN, "it is only remembered")
        another = Variable(Role.OUTPUT, f"{name} (another)", output.sort)
        other = disjunction(negation(substitute(f, {output: another})) for f in spoken.values())
        together = {**self.assumptions, **self.guarantees, "another value": other}
        text = f"wherever the guarantees hold, they hold for every other value of out.{name} too"
        found = self._possible(together, text)
        if found.verdict is not Verdict.REFUTED:
            return found
        remembered = any(output in free_variables(cell.now) for cell in self.remembering.cells)
        if remembered:
            return Finding(Verdict.UNKNOWN, "it is remembered, and may matter later")
        return Finding(found.verdict, text)

    def _determined(self, name: str) -> Finding:
        """Two outputs at one step of a run. If a cell depends on an output, one of them may turn out to be impossible
        later."""
        output = self.node.output(name).variable
        again = {
            v: Variable(Role.OUTPUT, f"{v.name} (another)", v.sort) for v in (p.variable for p in self.node.outputs)
        }
        together = {
            **self.assumptions,
            **self.guarantees,
            **{f"{label} again": substitute(f, again) for label, f in self.guarantees.items()},
            "different": Not(Compare("==", output, again[output])),
        }
        found = self._possible(together, "{} leave one value")
        if found.verdict is Verdict.REFUTED:
            return Finding(Verdict.PROVED)
        if found.verdict is not Verdict.PROVED:
            return found
        remembered = any(v.role is Role.OUTPUT for cell in self.remembering.cells for v in free_variables(cell.now))
        lost = remembered and self.viability.verdict is Verdict.REFUTED  # then no run continues for ever after either
        if remembered and not lost:
            if (lasting := self.viability.lasting) is not None:  # known after both values
                after = substitute(lasting, {cell.before: cell.now for cell in self.remembering.cells})
                stays = {"memory": lasting, "goes on": after, "goes on again": substitute(after, again)}
                both = together | stays
                answer = solve(both, effort=self.limit, seed=self.seed, values="unused")
                if answer.status == "unsat":
                    return Finding(*((Verdict.ERROR, CONTRADICTED) if doubted(answer, both) else (Verdict.PROVED,)))
                if answer.status == "sat":
                    return Finding(Verdict.REFUTED, f"the guarantees allow two values of out.{name} for ever")
            return Finding(Verdict.UNKNOWN, f"two values of out.{name} are possible at a step; one may matter later")
        text = f"the guarantees allow two values of out.{name} at a step of a run"
        return Finding(Verdict.REFUTED, text, because="realizable" if lost else None)

    def _needed(self, name: str) -> Finding:
        """Whether the node could keep its guarantees for ever without the assumption."""
        if self.viability.verdict is Verdict.REFUTED:
            return Finding(Verdict.PROVED, "the guarantees cannot be kept with it either", because="realizable")
        if self.viability.verdict is not Verdict.PROVED:
            return Finding(Verdict.UNKNOWN, "whether the guarantees can be kept with it is not shown")
        others = tuple(clause for clause in self.node.assumptions if clause.name != name)
        match OverRuns(replace(self.node, assumptions=others), self.patience, self.seed).viability.verdict:
            case Verdict.REFUTED:
                return Finding(Verdict.PROVED)
            case Verdict.PROVED:
                return Finding(Verdict.REFUTED, "every guarantee can be kept without it", (name,))
            case _:  # undecided
                return Finding(Verdict.UNKNOWN, "whether the guarantees could be kept without it is open")

    def _possible(self, formulas: Mapping[str, Term], excluded: str) -> Finding:
        """Can the formulas hold together at some step of a run whose earlier steps kept the contract?"""
        anywhere = solve(formulas, effort=self.limit, seed=self.seed, values="unused")
        if anywhere.status == "unsat":
            if doubted(anywhere, formulas):
                return Finding(Verdict.ERROR, CONTRADICTED)
            return Finding(Verdict.REFUTED, excluded.format(listing(anywhere.core)), anywhere.core)
        impossible: list[Term] | None = []
        core = set[str]()
        for length in range(RUN_TO_AN_EXAMPLE):
            here = {label: self._at(f, length) for label, f in formulas.items()}
            together = {**self._run(length), **here}
            answer = solve(together, effort=self.limit, seed=self.seed, values="unused")
            if answer.status == "sat":
                return Finding(Verdict.PROVED)
            if answer.status != "unsat":
                impossible = None
            if impossible is not None:
                impossible.append(conjunction(together.values()))
                core |= {label for label in answer.core if label in here}
                if self._over(length + 1):
                    if contradicted([*impossible, conjunction(self._run(length + 1).values())]):
                        return Finding(Verdict.ERROR, CONTRADICTED)
                    named = tuple(label for label in formulas if label in core)
                    return Finding(Verdict.REFUTED, excluded.format(listing(named)), named)
        open_still = f"not at the first {RUN_TO_AN_EXAMPLE} steps of a run; whether later is open"
        if self.viability.reachable is None:
            return Finding(Verdict.UNKNOWN, open_still)
        within = {**formulas, "memory": self.viability.reachable}
        ever = solve(within, effort=self.limit, seed=self.seed, values="unused")
        if ever.status == "unsat":
            if doubted(ever, within):
                return Finding(Verdict.ERROR, CONTRADICTED)
            named = tuple(label for label in ever.core if label != "memory")
            return Finding(Verdict.REFUTED, excluded.format(listing(named)), named)
        return Finding(Verdict.UNKNOWN, open_still)

    def never_met(self, name: str) -> bool:
        """Whether it is shown that some condition of a guarantee arises at no step of any run: it is false at the first
        steps, and by induction at every later one."""
        asked = [negation(c.formula) for c in self.remembering.node.guarantees if c.name == f"{name} {_TRIGGER}"]
        return any(self._never({**self.assumptions, "its trigger": trigger}) for trigger in asked)

    def _never(self, formulas: Mapping[str, Term]) -> bool:
        whole = conjunction(formulas.values())
        for length in range(STEPS_OF_INDUCTION):
            if not self._excluded({**self._run(length), "here": self._at(whole, length)}):
                return False
        first = {f"first {cell.name}" for cell in self.remembering.cells}
        length = STEPS_OF_INDUCTION
        going = {label: fact for label, fact in self._run(length).items() if label not in first}
        going |= {f"not yet {step}": negation(self._at(whole, step)) for step in range(length)}
        return self._excluded({**going, "here": self._at(whole, length)})

    def _excluded(self, facts: Mapping[str, Term]) -> bool:
        answer = solve(facts, effort=self.limit, seed=self.seed, values="unused")
        return answer.status == "unsat" and not doubted(answer, facts)

    def _run(self, length: int) -> Mapping[str, Term]:
        """The facts that a run of so many steps keeps the contract, and its cells. Each step is built once, so that it
        is translated once for all queries."""
        if not self._written:
            self._written.append({f"first {c.name}": self._at(c.begins(), 0) for c in self.remembering.cells})
        kept = conjunction((*self.assumptions.values(), *self.guarantees.values()))
        for step in range(len(self._written) - 1, length):
            facts = {f"step {step}": self._at(kept, step)}
            for cell in self.remembering.cells:
                after = Variable(Role.INPUT, f"{cell.name} after", cell.sort)
                moved = substitute(self._at(cell.leaves(after), step), {after: self._named(cell.before, step + 1)})
                facts[f"{cell.name} {step}"] = moved
            self._written.append(facts)
        return {label: fact for facts in self._written[: length + 1] for label, fact in facts.items()}

    def _over(self, length: int) -> bool:
        """Whether no run of so many steps keeps the contract."""
        if length not in self._ends:
            answer = solve(self._run(length), effort=self.limit, seed=self.seed, values="unused")
            self._ends[length] = answer.status == "unsat"
        return self._ends[length]

    def _at(self, formula: Term, step: int) -> Term:
        """The formula at a step of a run."""
        own = {v for v in free_variables(formula) if v.role is not Role.BOUND and not v.name.endswith(" after")}
        return substitute(formula, {v: self._named(v, step) for v in own})

    def _named(self, variable: Variable, step: int) -> Variable:
        return Variable(variable.role, f"{variable.name} at {step}", variable.sort)
