"""Is a contract worth verifying? The sanity claims of a node (`avow.sanity.claims`), decided by the solver.

`proved` is always good and `refuted` always bad (see the table in `avow.sanity.claims`). A refutation carries a
replayed counterexample in the contract's terms, or the smallest conflicting sets of clauses, or both. A claim that the
solver cannot decide stays `unknown`. An example that a claim needs may have the values that a scenario gives inputs.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from typing import assert_never

from avow.base.diagnostics import Severity
from avow.base.remembered import by_identity
from avow.base.tuning.effort import CONSISTENT_EFFORT
from avow.base.verdict import Counterexample, Outcome, Verdict
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.formulas.formula import conjunction, disjunction, free_variables, negation, substitute
from avow.formulas.temporal.cells import remembers
from avow.formulas.values import Value
from avow.formulas.written import show_values
from avow.language.contract import ClauseKind, Node
from avow.language.sorts import FunctionSort, IntegerSort, NaturalSort, RealSort
from avow.language.subterms import histories
from avow.language.terms import Compare, Not, Role, Term, Variable
from avow.sanity.claims import Claim, Property, claims, triggers
from avow.sanity.conflicts import conflicts
from avow.sanity.over_runs import OverRuns
from avow.sanity.realizability import possible, realizable
from avow.sanity.results import Bounds, Finding, Patience, SanityResult, as_outcome, listing, never_demanded
from avow.sanity.witness_search import Formulas, Group, Realizability, groups
from avow.solving.limits import spent
from avow.solving.questions import solve
from avow.solving.second import CONTRADICTED, doubted
from avow.solving.sizes import in_every_size
from avow.solving.translation import new_session

Given = Mapping[Variable, Value]


@new_session()
def analyse(
    node: Node,
    *,
    scenario: Given | None = None,
    bounds: Bounds | None = None,
    wanted: Collection[str] | None = None,
) -> tuple[SanityResult, ...]:
    """Decide a node's claims, in order; with `wanted`, only the claims of these names are reported. Earlier claims are
    decided all the same: claims that stay open leave less effort for later ones, and no answer may depend on `wanted`.
    `scenario` fixes some inputs of an example that is not found otherwise.
    """
    bounds = bounds or Bounds()
    steps = _Analysis(_of_one_step(node), scenario or {}, bounds)
    analysis = OverRuns(node, Patience(bounds.effort), bounds.seed) if remembers(node) else steps
    likely = {clause.name for clause in node.guarantees if clause.chance is not None}
    results = []
    asked = claims(node)
    chosen = [k for k, claim in enumerate(asked) if wanted is None or claim.name in wanted]
    for claim in asked[: max(chosen, default=-1) + 1]:
        start = time.monotonic()
        finding = (steps if claim.subject in likely else analysis).settle(claim)
        results.append(SanityResult.of(node.name, claim, finding, time.monotonic() - start))
    return tuple(results[k] for k in chosen)


def outcomes(
    node: Node,
    obligations: Mapping[str, str],
    *,
    scenario: Given | None = None,
    bounds: Bounds | None = None,
) -> tuple[Outcome, ...]:
    """For the pipeline: one outcome for each obligation id, given its claim's name (an unknown name is an error)."""
    wanted = set(obligations.values())
    found = analyse(node, scenario=scenario, bounds=bounds, wanted=wanted)
    results = {result.name: result for result in found}
    return tuple(as_outcome(identity, node.name, name, results.get(name)) for identity, name in obligations.items())


def _of_one_step(node: Node) -> Node:
    """The node without the clauses about other steps: guarantees with a probability are about one."""
    if not remembers(node):
        return node
    kept = [tuple(c for c in clauses if not histories(c.formula)) for clauses in (node.assumptions, node.guarantees)]
    return replace(node, assumptions=kept[0], guarantees=kept[1])


class _Analysis:
    """One node under analysis. Each claim is decided once and reused by others."""

    def __init__(self, node: Node, scenario: Given, bounds: Bounds) -> None:
        self.node = node
        self.scenario = scenario
        self.patience = Patience(bounds.effort)
        self.serious = True
        self.seed = bounds.seed
        self.inputs = tuple(port.variable for port in node.inputs)
        self.outputs = tuple(port.variable for port in node.outputs)
        self.assumptions = {c.name: c.formula for c in node.assumptions}
        self.guarantees = {c.name: c.formula for c in node.guarantees if c.chance is None}
        self.known: dict[str, Finding] = {}
        self.claims = {claim.name: claim for claim in claims(node)}
        self.answer: Realizability | None = None

    def settle(self, claim: Claim) -> Finding:
        if claim.name not in self.known:
            asked, self.serious = self.serious, claim.severity is Severity.ERROR
            start, lost = spent(), self.patience.lost
            try:
                found = self.known[claim.name] = self._settle(claim)
            finally:
                self.serious = asked
            if found.verdict is Verdict.UNKNOWN:
                self.patience.lost = max(self.patience.lost, lost + spent() - start)
        return self.known[claim.name]

    @property
    def limit(self) -> int:
        """Effort for one query of the current claim."""
        return self.patience.effort(self.serious)

    def _settle(self, claim: Claim) -> Finding:
        subject = claim.subject or ""
        methods: dict[Property, Callable[[str], Finding]] = {
            Property.ASSUMPTIONS_SATISFIABLE: lambda _: self._satisfiable(),
            Property.CONSISTENT: lambda _: self._in_every_size(self._consistent()),
            Property.REALIZABLE: lambda _: self._in_every_size(self._realizable(), "consistent"),
            Property.NOT_TAUTOLOGICAL: self._not_tautological,
            Property.NOT_VACUOUS: self._not_vacuous,
            Property.NOT_REDUNDANT: self._not_redundant,
            Property.CONSTRAINED: self._constrained,
            Property.DETERMINED: self._determined,
            Property.NEEDED: self._needed,
        }
        return methods[claim.about](subject)

    def _other(self, name: str) -> Finding:
        return self.settle(self.claims[name])

    # -- the whole contract --------------------------------------------------------------------------------------------

    def _satisfiable(self) -> Finding:
        return self._possible(self.assumptions, "no input meets {} together", "no input meets {}")

    def _in_every_size(self, finding: Finding, because: str = "") -> Finding:
        """The finding, turned into a refutation if it fails for some number of elements of the unspecified types."""
        if finding.verdict in (Verdict.REFUTED, Verdict.ERROR):
            return finding
        verdict, reason = in_every_size(
            self.assumptions, self.guarantees, what="the guarantees", effort=self.limit, seed=self.seed
        )
        clauses = tuple(self.guarantees) if verdict is Verdict.REFUTED else ()
        if verdict is Verdict.PROVED:
            return finding
        return Finding(verdict, reason, clauses, because=self._if_refuted(because))

    def _consistent(self) -> Finding:
        together = {**self.assumptions, **self.guarantees}
        texts = ("no inputs and outputs meet {} together", "no inputs and outputs meet {}")
        finding = self._possible(together, *texts, limit=CONSISTENT_EFFORT)
        if finding.verdict is Verdict.UNKNOWN and self.limit > CONSISTENT_EFFORT:
            answer = self._realizability()
            if answer.verdict is Verdict.PROVED:
                allowed = self._other("assumptions-satisfiable")
                return Finding(allowed.verdict, allowed.explanation, engine=answer.engine)
            finding = self._possible(together, *texts)
        if finding.verdict is Verdict.REFUTED and self._other("assumptions-satisfiable").verdict is Verdict.REFUTED:
            return replace(finding, because="assumptions-satisfiable")
        return finding

    def _realizability(self) -> Realizability:
        if self.answer is None:
            start = spent()
            limit = 2 * self.patience.effort(serious=True)
            self.answer = self._ask(self.assumptions, self.guarantees, limit)
            if self.answer.verdict is Verdict.UNKNOWN:
                self.patience.lose(spent() - start)
        return self.answer

    def _realizable(self) -> Finding:
        answer = self._realizability()
        if answer.verdict is Verdict.PROVED:
            allowed = self._other("assumptions-satisfiable")
            if allowed.verdict is Verdict.ERROR:
                return replace(allowed, because="assumptions-satisfiable")
            if allowed.verdict is Verdict.REFUTED:
                return Finding(Verdict.PROVED, "vacuously: no input is allowed", because="assumptions-satisfiable")
            given = f"given {listing(answer.needed)}" if answer.needed else ""
            return Finding(Verdict.PROVED, given, answer.needed, engine=answer.engine)
        if answer.verdict is not Verdict.REFUTED:
            return Finding(Verdict.UNKNOWN, answer.reason, engine=answer.engine)
        found = conflicts(
            self.inputs,
            self.outputs,
            self.assumptions,
            self.guarantees,
            answer,
            effort=2 * self.patience.full,
            seed=self.seed,
        )
        listed = tuple((conflict.clauses, conflict.counterexample()) for conflict in found)
        if not listed:
            shown = Counterexample(show_values(answer.inputs), "no output meets the guarantees here")
            return Finding(Verdict.REFUTED, shown.explanation, answer.group, shown, engine=answer.engine)
        # A conflict between guarantees is more informative than one guarantee that cannot be met by itself.
        clauses, shown = next((pair for pair in listed if len(pair[0]) > 1), listed[0])
        because = "consistent" if self._other("consistent").verdict is Verdict.REFUTED else None
        text = f"for some inputs no output meets {listing(clauses)}"
        return Finding(Verdict.REFUTED, text, clauses, shown, listed, because, answer.engine)

    # -- one clause ----------------------------------------------------------------------------------------------------

    def _not_tautological(self, name: str) -> Finding:
        clause = self.node.clause(name)
        if clause.kind is ClauseKind.ASSUMPTION:
            return self._fails_somewhere({}, clause.formula, "every input meets it: it assumes nothing", "")
        finding = self._fails_somewhere(
            self.assumptions,
            clause.spoken,
            "it holds of all inputs and outputs: it demands nothing",
            "it follows from {}: it demands nothing of any output",
        )
        if finding.verdict is not Verdict.REFUTED:
            return finding
        return replace(finding, because=self._if_refuted("assumptions-satisfiable"))

    def _not_vacuous(self, name: str) -> Finding:
        if (chance := self.node.clause(name).chance) is not None:
            together = {**self.assumptions, **self.guarantees, "its condition": chance.given, name: chance.claim}
            return self._possible(together, "{} cannot hold together", "{} cannot hold")
        impossible = []
        undecided: Finding | None = None
        broken = self._example(f"not-tautological-{name}")  # a guarantee is broken only if its condition holds
        asked = triggers(self.guarantees[name])
        for trigger in asked:
            if _meets(broken, (*self.assumptions.values(), trigger)):
                continue
            finding = self._possible(
                {**self.assumptions, "its trigger": trigger}, "{} cannot hold together", "{} cannot hold"
            )
            if finding.verdict is Verdict.REFUTED:
                impossible.append((trigger, finding))
            elif finding.verdict is Verdict.ERROR:
                return finding
            elif finding.verdict is not Verdict.PROVED:
                undecided = finding
        if impossible:
            trigger, first = impossible[0]
            empty = self._other("assumptions-satisfiable").verdict is Verdict.REFUTED
            because = "assumptions-satisfiable" if empty else self._if_refuted(f"not-tautological-{name}")
            clauses = tuple(c for c in first.clauses if c in self.assumptions)
            text = never_demanded(trigger, among=len(asked))
            text += f" (given {listing(clauses)})" if clauses else ""
            return Finding(Verdict.REFUTED, text, (name, *clauses), because=because, engine=first.engine)
        return undecided or Finding(Verdict.PROVED)

    def _not_redundant(self, name: str) -> Finding:
        kind = self.node.clause(name).kind
        others = self.assumptions if kind is ClauseKind.ASSUMPTION else {**self.assumptions, **self.guarantees}
        others = {other: formula for other, formula in others.items() if other != name}
        formula = self.node.clause(name).formula
        whole = "assumptions-satisfiable" if kind is ClauseKind.ASSUMPTION else "consistent"
        broken = self._example(f"not-tautological-{name}")
        if broken and _meets({**self._example(whole), **broken}, (*others.values(), negation(formula))):
            return Finding(Verdict.PROVED)
        finding = self._fails_somewhere(others, formula, "it is true by itself", "it follows from {}")
        if finding.verdict is not Verdict.REFUTED:
            return finding
        return replace(finding, because=self._if_refuted(whole) or self._if_refuted(f"not-tautological-{name}"))

    def _needed(self, name: str) -> Finding:
        if weaker := self._if_refuted(f"not-tautological-{name}") or self._if_refuted(f"not-redundant-{name}"):
            return Finding(Verdict.REFUTED, "it rules out nothing that the others do not", (name,), because=weaker)
        because = self._if_refuted("assumptions-satisfiable")
        unused = Finding(Verdict.REFUTED, "every guarantee can be met without it", (name,), because=because)
        if self._other("realizable").verdict is Verdict.PROVED and name not in self._realizability().needed:
            return unused
        # Only the inputs that it rules out matter: it is not needed if each of them has an output.
        outside = {label: negation(f) if label == name else f for label, f in self.assumptions.items()}
        answer = self._ask(outside, self.guarantees, 2 * self.limit, doubtful=True)
        match answer.verdict:
            case Verdict.REFUTED:
                return Finding(Verdict.PROVED, engine=answer.engine)
            case Verdict.PROVED:
                return replace(unused, engine=answer.engine)
            case _:  # undecided
                return Finding(Verdict.UNKNOWN, "whether the guarantees could be met without it is open")

    # -- one output ----------------------------------------------------------------------------------------------------

    def _constrained(self, name: str) -> Finding:
        output = self.node.output(name).variable
        everything = conjunction(self.guarantees.values())
        if output not in free_variables(everything):
            return Finding(Verdict.REFUTED, f"no guarantee mentions out.{name}")
        again = Variable(Role.OUTPUT, f"{name} (another)", output.sort)
        changed = [substitute(f, {output: again}) for f in self.guarantees.values() if output in free_variables(f)]
        finding = self._possible(
            {**self.assumptions, **self.guarantees, "another value": disjunction(map(negation, changed))}, "", ""
        )
        if finding.verdict is not Verdict.REFUTED:
            return finding
        text = f"wherever the guarantees hold, they hold for every other value of out.{name} too"
        blamed = [f"not-tautological-{g}" for g, f in self.guarantees.items() if output in free_variables(f)]
        because = self._if_refuted("consistent") or next((b for b in blamed if self._if_refuted(b)), None)
        return replace(finding, explanation=text, clauses=(), because=because)

    def _determined(self, name: str) -> Finding:
        output = self.node.output(name).variable
        alone = Group({}, (output,))
        # Outputs connected to this one by shared guarantees may differ too; all others stay the same.
        group = next((g for g in groups(self.guarantees, self.outputs) if output in g.outputs), alone)
        again = {v: Variable(Role.OUTPUT, f"{v.name} (another)", v.sort) for v in group.outputs}
        question = {
            **self.assumptions,
            **self.guarantees,
            **{f"{label} again": substitute(f, again) for label, f in group.guarantees.items()},
            "different": Not(Compare("==", output, again[output])),
        }
        for given in ({}, self.scenario) if self.scenario else ({},):  # an answer without the scenario is stronger
            answer = solve(question, effort=self.limit, seed=self.seed, given=given, values="if any")
            if answer.status == "unsat" and not given:
                if doubted(answer, question):
                    return Finding(Verdict.ERROR, CONTRADICTED)
                return Finding(Verdict.PROVED, engine=answer.engine, because=self._if_refuted("consistent"))
            if answer.status == "sat":
                values = {v: value for v, value in {**answer.values, **given}.items() if v.role is not Role.BOUND}
                text = f"the guarantees allow both values of out.{name}"
                shown = Counterexample(show_values(values)) if values else None
                because = self._if_refuted(f"constrained-{name}")
                return Finding(Verdict.REFUTED, text, counterexample=shown, because=because, engine=answer.engine)
        if self._by_definitions(question, self.limit // 2):
            because = self._if_refuted(f"constrained-{name}")
            return Finding(Verdict.REFUTED, f"the guarantees allow two values of out.{name}", because=because)
        return Finding(Verdict.UNKNOWN, answer.reason, engine=answer.engine)

    # -- asking --------------------------------------------------------------------------------------------------------

    def _ask(self, assumed: Formulas, wanted: Formulas, effort: int, *, doubtful: bool = False) -> Realizability:
        return realizable(self.inputs, self.outputs, assumed, wanted, effort=effort, seed=self.seed, doubtful=doubtful)

    def _if_refuted(self, name: str) -> str | None:
        return name if name in self.claims and self._other(name).verdict is Verdict.REFUTED else None

    def _example(self, name: str) -> Given:
        """Values that show another claim; empty if there is no such claim, or none are known."""
        return self._other(name).example if name in self.claims else {}

    def _possible(self, formulas: Mapping[str, Term], several: str, one: str, limit: int | None = None) -> Finding:
        """Can the formulas hold together? If not, `several` or `one` is the text for the smallest set that cannot."""
        limit = min(limit or self.limit, self.limit)
        answer = solve(formulas, effort=limit, seed=self.seed, values="unused")
        if answer.status == "unknown" and self.scenario:
            within = solve(formulas, effort=limit, seed=self.seed, given=self.scenario)
            # An example in the scenario counts; the absence of one proves nothing.
            answer = within if within.status == "sat" else answer
        if answer.status == "unknown" and self._by_definitions(formulas, limit // 2):
            return Finding(Verdict.PROVED)
        match answer.status:
            case "sat":
                return Finding(Verdict.PROVED, engine=answer.engine, example=answer.values)
            case "unsat" if doubted(answer, formulas):
                return Finding(Verdict.ERROR, CONTRADICTED)
            case "unsat":
                text = several if len(answer.core) > 1 else one
                return Finding(Verdict.REFUTED, text.format(listing(answer.core)), answer.core, engine=answer.engine)
            case "unknown":
                return Finding(Verdict.UNKNOWN, answer.reason, engine=answer.engine)
            case _:
                assert_never(answer.status)

    def _by_definitions(self, formulas: Mapping[str, Term], limit: int) -> bool:
        """Whether these hold together, for functions without a finite table."""
        return _are_endless(formulas.values()) and possible(formulas, effort=limit, seed=self.seed)

    def _fails_somewhere(self, hypotheses: Mapping[str, Term], formula: Term, alone: str, implied: str) -> Finding:
        """Is there a case where the hypotheses hold and the formula does not? `alone` and `implied` are the texts if
        not."""
        finding = self._possible({**hypotheses, "": negation(formula)}, "", "")
        if finding.verdict is not Verdict.REFUTED:
            return finding
        needed = tuple(label for label in finding.clauses if label)
        text = implied.format(listing(needed)) if needed else alone
        return replace(finding, explanation=text, clauses=needed)


def _are_endless(formulas: Iterable[Term]) -> bool:
    """Whether they mention functions that need not have a finite table."""
    sorts = {v.sort for formula in formulas for v in free_variables(formula)}
    parameters = {p for sort in sorts if isinstance(sort, FunctionSort) for p in sort.parameters}
    return any(isinstance(p, RealSort | IntegerSort | NaturalSort) for p in parameters)


def _meets(values: Mapping[Variable, Value], formulas: Iterable[Term]) -> bool:
    """Whether formulas hold for values that were found for another claim: then no query is needed."""
    named = {variable.qualified: value for variable, value in values.items()}
    try:
        return len(named) == len(values) > 0 and all(_compiled(formula)(named) is True for formula in formulas)
    except NotEvaluable:
        return False


@by_identity(500)
def _compiled(formula: Term) -> Evaluator:
    """The formula as an evaluator. Raises NotEvaluable."""
    return compile_term(formula)
