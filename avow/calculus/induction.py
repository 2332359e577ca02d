"""Where one step of induction fails: more steps, from the initial values and backwards.

That a claim need not be kept by a step from *some* state says nothing yet: the state may never be reached. So the steps
are unrolled from the initial values: a run that gets to a state in which the claim is false refutes it. And the claim
may be kept by every step that comes after several at which it held (k-induction; Sheeran, Singh and Stålmarck 2000).
It is the theorem itself (`Sound` in proofs/kernel.dfy), with as many base questions as steps.
Where neither is found, the claim is unknown, and the state that induction stumbled on is shown as just that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from avow.base.records import dataclass
from avow.base.tuning.bounds import DEEPEST_INDUCTION
from avow.base.tuning.effort import QUICK_EFFORT
from avow.base.tuning.shown import STEP_VARIABLES
from avow.base.verdict import Counterexample, Verdict
from avow.calculus.entailment import implied
from avow.calculus.variables import Frame
from avow.formulas.formula import free_variables, substitute
from avow.formulas.temporal.cell import CELL
from avow.formulas.values import Value, show
from avow.language.sorts import FunctionSort
from avow.language.terms import Role, Term, Variable
from avow.solving.limits import effort_left, until
from avow.solving.questions import Entailment

BEFORE = "@before"
"""Ends the name of a value of the step before."""


@dataclass(frozen=True, slots=True)
class Deeper:
    """What more steps gave. `proved`: with the hypotheses needed; `run`: one that reaches a step at which the claim is
    false; neither: unknown."""

    proved: tuple[str, ...] | None = None
    run: Counterexample | None = None
    steps: int = 0
    """Of the proof, how many steps before; of the run, its length."""
    engine: str = ""
    by: tuple[str, ...] = ()
    """An invariant that nobody wrote down, by which it is proved (`avow.calculus.invariants`)."""


@dataclass(frozen=True, slots=True)
class Steps:
    """The contracts at several steps. `ever`: all that holds at a finished step, by label; `last`: what may be used at
    the step that the claim is about; `initial`: what holds before the first step."""

    ever: Mapping[str, Term]
    last: Mapping[str, Term]
    initial: Mapping[str, Term]
    claim: Term
    constant: frozenset[Variable]

    def shifted(self, term: Term, by: int) -> Term:
        """A formula, as it was so many steps earlier."""
        if by == 0:
            return term
        changing = free_variables(term) - self.constant
        return substitute(term, {v: Variable(v.role, v.name + BEFORE * by, v.sort) for v in changing})

    def run(self, length: int) -> dict[str, Term]:
        """What is known of a run of so many steps from the initial values on."""
        found = {label: self.shifted(term, length - 1) for label, term in self.initial.items()}
        return found | self.known(length - 1)

    def known(self, before: int) -> dict[str, Term]:
        """What is known of the last step, and of so many before it."""
        found = dict(self.last)
        for by in range(1, before + 1):
            found |= {_labelled(label, by): self.shifted(term, by) for label, term in self.ever.items()}
        return found

    def kept(self, before: int) -> dict[str, Term]:
        """That the claim held at each of so many steps before."""
        return {_labelled("the claim", by): self.shifted(self.claim, by) for by in range(1, before + 1)}


def steps(
    frame: Frame, ever: Mapping[str, Term], last: Mapping[str, Term], initial: Mapping[str, Term], claim: Term
) -> Steps:
    """`ever` and `last` are in the variables of the step itself (and of the one before), as the frame's clauses are."""
    constant = set()
    for endpoint in frame.graph.environment:
        variable = frame.input(endpoint.node, endpoint.port)
        if variable == frame.input(endpoint.node, endpoint.port, 1):
            constant.add(variable)
    return Steps(ever, last, initial, claim, frozenset(constant))


def deeper(asked: Steps, effort: int, seed: int, claim_name: str, lengths: range) -> Deeper:
    """Unroll to these lengths, and induct over more steps, in turn, with so much effort. The claim must have been
    proved at the first step."""
    end = until(effort)
    sure = 1  # so many steps from the beginning the claim is proved

    def ask(hypotheses: Mapping[str, Term]) -> Entailment | None:
        left = effort_left(end)
        return implied(hypotheses, asked.claim, effort=min(QUICK_EFFORT, left), seed=seed) if left > 50 else None

    for length in lengths:
        answer = ask(asked.run(length))
        if answer is None:
            return Deeper()
        if answer.verdict is Verdict.REFUTED:
            return Deeper(run=_run(answer.values, length, claim_name), steps=length, engine=answer.engine)
        sure = length if answer.verdict is Verdict.PROVED and sure == length - 1 else sure
        if sure == length <= DEEPEST_INDUCTION:
            answer = ask(asked.known(length) | asked.kept(length))
            if answer is not None and answer.verdict is Verdict.PROVED and not answer.vacuous:
                return Deeper(proved=_plain(answer.needed), steps=length, engine=answer.engine)
    return Deeper()


def _labelled(label: str, by: int) -> str:
    return f"{label} {'one step' if by == 1 else f'{by} steps'} before"


def _plain(labels: Sequence[str]) -> tuple[str, ...]:
    """However many steps before, as one step before: what a proof rests on is the same clause."""
    found: dict[str, None] = {}
    for label in labels:
        for by in range(2, DEEPEST_INDUCTION + 1):
            if label.endswith(f" {by} steps before"):
                label = label.removesuffix(f" {by} steps before") + " one step before"
        if not label.startswith("the claim "):
            found[label] = None
    return tuple(found)


def _run(values: Mapping[Variable, Value], length: int, claim: str) -> Counterexample:
    """A model of several steps as a run."""
    trace: list[tuple[tuple[str, str], ...]] = []
    for earlier in range(length - 1, -1, -1):
        shown: dict[str, str] = {}
        for variable, value in sorted(values.items(), key=lambda item: item[0].qualified):
            if CELL in variable.name:
                continue  # what is remembered follows from the steps before, which are shown
            base, times = variable.name, 0
            while base.endswith(BEFORE):
                base, times = base.removesuffix(BEFORE), times + 1
            name = f"in.{base}" if variable.role is Role.INPUT else base
            fixed = isinstance(variable.sort, FunctionSort) and times == 0
            if times == earlier or (fixed and variable.role is Role.INPUT):
                shown[name] = show(value)
        trace.append(tuple(shown.items())[:STEP_VARIABLES])
    last = trace[-1] if trace else ()
    return Counterexample(last, f"{claim} is false at step {length} of a run from the initial values", tuple(trace))
