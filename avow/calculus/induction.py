"""If one step of induction fails: more steps, from the initial values and backwards, or an invariant.

If a step from *some* state breaks a claim, the claim is not yet refuted: the state may be unreachable. So the steps are
unrolled from the initial values, and a run to a state in which the claim is false refutes it. Or every step after
several steps with the claim preserves it (k-induction; Sheeran, Singh and Stålmarck 2000): this is the theorem itself
(`Sound` in proofs/kernel.dfy), with as many base questions as steps. Otherwise the claim is unknown, and the state at
which induction fails is shown.

Z3's Spacer suggests invariants (`avow.solving.invariants`). One is used if it is true at the first step, every step
preserves it, and it implies the claim at the next; it is then an entry of the certificate like any other, which the
kernel establishes by its own questions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from avow.base.diagnostics import Rejected
from avow.base.records import dataclass
from avow.base.tuning.bounds import DEEPEST_INDUCTION, LONGEST_RUN, LONGEST_UNROLLING
from avow.base.tuning.effort import DEEPER_EFFORT, INVARIANT_EFFORT, QUICK_EFFORT
from avow.base.tuning.shown import STEP_VARIABLES
from avow.base.verdict import Counterexample, Verdict
from avow.calculus.entailment import implied
from avow.calculus.variables import Frame
from avow.formulas.formula import free_variables, negation, substitute
from avow.formulas.temporal.cell import CELL, Cell
from avow.formulas.values import Value, show
from avow.kernel.statements import Claimed, Wiring
from avow.language.contract import Contract
from avow.language.load import parse_formula
from avow.language.printer import show_term
from avow.language.sorts import FunctionSort
from avow.language.terms import Past, Role, Term, Variable
from avow.solving.invariants import Found, invariant
from avow.solving.limits import effort_left, until
from avow.solving.questions import Entailment

BEFORE = "@before"
"""Suffix of the name of a value of the step before."""


@dataclass(frozen=True, slots=True)
class Deeper:
    """The result of trying more steps. `proved`: the hypotheses that the proof needs; `run`: a run to a step at which
    the claim is false; neither: unknown."""

    proved: tuple[str, ...] | None = None
    run: Counterexample | None = None
    steps: int = 0
    """For a proof, the number of earlier steps; for a run, its length."""
    engine: str = ""
    by: tuple[str, ...] = ()
    """An invariant that was found and proves the claim."""


@dataclass(frozen=True, slots=True)
class Steps:
    """The contracts at several steps. `ever`: everything that holds at a finished step, by label; `last`: the
    hypotheses at the step that the claim is about; `initial`: what holds before the first step."""

    ever: Mapping[str, Term]
    last: Mapping[str, Term]
    initial: Mapping[str, Term]
    claim: Term
    constant: frozenset[Variable]

    def shifted(self, term: Term, by: int) -> Term:
        """A formula about the values so many steps earlier."""
        if by == 0:
            return term
        changing = free_variables(term) - self.constant
        return substitute(term, {v: Variable(v.role, v.name + BEFORE * by, v.sort) for v in changing})

    def run(self, length: int) -> dict[str, Term]:
        """The facts about a run of so many steps from the initial values."""
        found = {label: self.shifted(term, length - 1) for label, term in self.initial.items()}
        return found | self.known(length - 1)

    def known(self, before: int) -> dict[str, Term]:
        """The facts about the last step, and about so many steps before it."""
        found = dict(self.last)
        for by in range(1, before + 1):
            found |= {_labelled(label, by): self.shifted(term, by) for label, term in self.ever.items()}
        return found

    def kept(self, before: int) -> dict[str, Term]:
        """The claim at each of so many earlier steps."""
        return {_labelled("the claim", by): self.shifted(self.claim, by) for by in range(1, before + 1)}


def steps(
    frame: Frame, ever: Mapping[str, Term], last: Mapping[str, Term], initial: Mapping[str, Term], claim: Term
) -> Steps:
    """`ever` and `last` are over the variables of the step itself (and of the one before), like the frame's clauses."""
    constant = set()
    for endpoint in frame.graph.environment:
        variable = frame.input(endpoint.node, endpoint.port)
        if variable == frame.input(endpoint.node, endpoint.port, 1):
            constant.add(variable)
    return Steps(ever, last, initial, claim, frozenset(constant))


def _deeper(asked: Steps, effort: int, seed: int, claim_name: str, lengths: range) -> Deeper:
    """Alternately unroll to these lengths and try induction over more steps, within this effort. The claim must have
    been proved at the first step."""
    end = until(effort)
    sure = 1  # the number of steps from the beginning at which the claim is proved

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
    """The labels with any number of steps before written as one step before: the proof uses the same clause."""
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
            clock = variable.name.startswith(f"dt{CELL}")
            if CELL in variable.name and not clock:
                continue  # cells follow from the earlier steps, which are shown
            base, times = variable.name, 0
            while base.endswith(BEFORE):
                base, times = base.removesuffix(BEFORE), times + 1
            name = "dt" if clock else f"in.{base}" if variable.role is Role.INPUT else base
            fixed = isinstance(variable.sort, FunctionSort) and times == 0
            if times == earlier or (fixed and variable.role is Role.INPUT):
                shown[name] = show(value)
        trace.append(tuple(shown.items())[:STEP_VARIABLES])
    last = trace[-1] if trace else ()
    return Counterexample(last, f"{claim} is false at step {length} of a run from the initial values", tuple(trace))


# -- invariants --------------------------------------------------------------------------------------------------------

Written = tuple[str, ...]
"""A formula, and the values of the system (``out.count.n``) that its names v0, v1, … stand for."""


_BEFORE = " one step before"
INVARIANT = "invariant "
"""Prefix of the name of an invariant among hypotheses and claims; no clause name begins with it."""


def label(written: Written) -> str:
    """The name of an invariant."""
    return INVARIANT + _named(written, [name.partition(".")[2] for name in written[1:]])


def in_words(frame: Frame, written: Written) -> str:
    """An invariant in readable form: a state variable is written as the operator that it is kept for."""
    cells = {called: (node, cell) for of in ("", *frame.observed) for node, called, cell in frame.own_cells(of)}
    names = [name.partition(".")[2] for name in written[1:]]
    return _named(written, [_remembered(frame, *cells[name]) if name in cells else name for name in names])


def _named(written: Written, names: Sequence[str]) -> str:
    return re.sub(
        r"\bv(\d+)\b", lambda found: names[int(found[1])] if int(found[1]) < len(names) else found[0], written[0]
    )


def _remembered(frame: Frame, node: str, cell: Cell) -> str:
    """The value of a cell after a step, in readable form."""
    record = cell.record
    if record is None:
        return cell.name.replace(CELL, "")
    if record.limit is not None:
        return f"(age in {show_term(frame.placed(node, record), 'rcl')})"
    kept = record.arguments[0] if record.operator in _OF_NOW else record
    shown = show_term(frame.placed(node, kept), "rcl")
    return shown if isinstance(kept, Variable) or record.operator in _CALLED else f"({shown})"


_OF_NOW = (Past.PREVIOUS, Past.ROSE, Past.FELL, Past.CHANGED)
"""Operators for which the argument's value is kept."""

_CALLED = (Past.ONCE, Past.HISTORICALLY)


def further(frame: Frame, asked: Steps, effort: int, seed: int, claim_name: str) -> Deeper:
    """Decides a claim that holds at the first step but is not inductive over one step: by induction over a few steps,
    by an invariant, or by a run that violates it (a longer one if Spacer reports that there is one)."""
    each = min(effort, DEEPER_EFFORT)
    found = _deeper(asked, each, seed, claim_name, range(2, DEEPEST_INDUCTION + 1))
    if found.proved is not None or found.run is not None:
        return found
    guess = _guessed(asked, effort)
    if guess.invariant is not None and (by := _inductive(frame, asked, guess.invariant, effort, seed)) is not None:
        return by
    longest = LONGEST_RUN if guess.broken else LONGEST_UNROLLING
    return _deeper(asked, each, seed, claim_name, range(DEEPEST_INDUCTION + 1, longest + 1))


def _guessed(asked: Steps, effort: int) -> Found:
    """Deterministic: bounded by Spacer's steps, not by time."""
    state: dict[Variable, Variable] = {v: v for v in asked.constant}
    terms = (asked.claim, *asked.ever.values(), *asked.last.values(), *asked.initial.values())
    for v in frozenset[Variable]().union(*map(free_variables, terms)):
        if v.name.endswith(BEFORE):
            state[v] = Variable(v.role, v.name.removesuffix(BEFORE), v.sort)
    goes_on = [*asked.ever.values()]
    last = [*asked.last.values(), negation(asked.claim)]
    return invariant([*asked.initial.values(), *goes_on], goes_on, last, state, min(effort, INVARIANT_EFFORT))


def _inductive(frame: Frame, asked: Steps, found: Term, effort: int, seed: int) -> Deeper | None:
    """A proof of the claim by a suggested invariant, if it holds at the first step, is preserved, and implies the
    claim."""
    written = write(frame, found)
    if written is None:
        return None
    held = {label(written) + _BEFORE: asked.shifted(found, 1)}
    first = implied({**asked.ever, **asked.initial}, found, effort=effort, seed=seed, whether=True)
    kept = implied({**asked.ever, **held}, found, effort=effort, seed=seed, whether=True)
    later = implied({**asked.last, **held}, asked.claim, effort=effort, seed=seed, whether=True)
    if {first.verdict, kept.verdict, later.verdict} != {Verdict.PROVED}:
        return None
    # hypotheses of preservation are about the step before
    before = (n if n.endswith(_BEFORE) else n + _BEFORE for n in (*first.needed, *kept.needed))
    needed = (n for n in (*later.needed, *before) if not n.startswith("initial "))
    return Deeper(tuple(dict.fromkeys(needed)), steps=1, engine=later.engine, by=written)


def write(frame: Frame, term: Term) -> Written | None:
    """A formula over a system's variables as text; None if some variable is not the value of a port or a cell."""
    named = _inputs(frame)
    names: list[str] = []
    short: dict[Variable, Variable] = {}
    for k, v in enumerate(sorted(free_variables(term), key=lambda v: (v.qualified, repr(v.sort)))):
        names.append(named.get(v, f"{Role.OUTPUT}.{v.name}"))
        if v.role is not Role.BOUND and v not in named:
            return None
        short[v] = Variable(Role.BOUND, f"v{k}", v.sort)
    return (show_term(substitute(term, short), "rcl"), *names)


def read(written: Written, contract: Contract, wiring: Wiring) -> Term | None:
    """The formula of a text over ``node.port``, like the kernel's claims; None if it no longer fits the contract."""
    formula, *names = written
    meant: dict[str, Variable] = {}
    for k, name in enumerate(names):
        role, _, rest = name.partition(".")
        at, _, port = rest.partition(".")
        place = wiring.ports.get((Role(role), at, port)) if role in (Role.INPUT, Role.OUTPUT) else None
        if place is None:
            return None
        meant[f"v{k}"] = Variable(Role(role), rest, place.sort)
    try:
        term = parse_formula(formula, None, contract, extra={name: v.sort for name, v in meant.items()})
    except Rejected:
        return None
    return substitute(term, {Variable(Role.BOUND, name, v.sort): v for name, v in meant.items()})


def with_lemmas(system: Wiring, contract: Contract, lemmas: Iterable[Written]) -> Wiring:
    """A system with the claims of those lemmas that still fit it."""
    found = ((label(each), read(each, contract, system)) for each in lemmas)
    more = tuple((Claimed.REQUIREMENT, "", name, term) for name, term in found if term is not None)
    return replace(system, formulas=(*system.formulas, *more))


def _inputs(frame: Frame) -> Mapping[Variable, str]:
    """The environment's variables, and a port that reads each."""
    return {frame.input(e.node, e.port): f"{Role.INPUT}.{e.node}.{e.port}" for e in frame.graph.environment}
