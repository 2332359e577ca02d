"""Invariants of a system that nobody wrote down, where induction over steps needs one: found, and then shown.

Z3's Spacer only finds them (`avow.solving.invariants`). One counts where it is true at the first step, is kept by every
step, and implies the claim at the next; it is then an entry of the certificate like any other, which the kernel
establishes by its own questions.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from avow.base.diagnostics import Rejected
from avow.base.tuning.bounds import DEEPEST_INDUCTION, LONGEST_RUN, LONGEST_UNROLLING
from avow.base.tuning.effort import DEEPER_EFFORT, INVARIANT_EFFORT
from avow.base.verdict import Verdict
from avow.calculus.entailment import implied
from avow.calculus.induction import BEFORE, Deeper, Steps, deeper
from avow.calculus.variables import Frame
from avow.formulas.formula import free_variables, negation, substitute
from avow.formulas.temporal.cell import CELL, Cell
from avow.kernel.statements import Claimed, Wiring
from avow.language.contract import Contract
from avow.language.load import parse_formula
from avow.language.printer import show_term
from avow.language.terms import Past, Role, Term, Variable
from avow.solving.invariants import Found, invariant

Written = tuple[str, ...]
"""A formula, and the values of the system (``out.count.n``) that its names v0, v1, … stand for."""


_BEFORE = " one step before"
INVARIANT = "invariant "
"""Begins what an invariant is called among hypotheses and claims; no clause is called so."""


def label(written: Written) -> str:
    """What an invariant is called."""
    return INVARIANT + show(written)


def show(written: Written) -> str:
    return _named(written, [name.partition(".")[2] for name in written[1:]])


def in_words(frame: Frame, written: Written) -> str:
    """An invariant for people: what is remembered is told by the record that it is kept for."""
    cells = {called: (node, cell) for of in ("", *frame.observed) for node, called, cell in frame.own_cells(of)}
    names = [name.partition(".")[2] for name in written[1:]]
    return _named(written, [_remembered(frame, *cells[name]) if name in cells else name for name in names])


def _named(written: Written, names: Sequence[str]) -> str:
    return re.sub(
        r"\bv(\d+)\b", lambda found: names[int(found[1])] if int(found[1]) < len(names) else found[0], written[0]
    )


def _remembered(frame: Frame, node: str, cell: Cell) -> str:
    """What a step leaves in a cell."""
    record = cell.record
    if record is None:
        return cell.name.replace(CELL, "")
    if record.limit is not None:
        return f"(age in {show_term(frame.placed(node, record), 'rcl')})"
    kept = record.arguments[0] if record.operator in _OF_NOW else record
    shown = show_term(frame.placed(node, kept), "rcl")
    return shown if isinstance(kept, Variable) or record.operator in _CALLED else f"({shown})"


_OF_NOW = (Past.PREVIOUS, Past.ROSE, Past.FELL, Past.CHANGED)
"""Records for which the argument's value is kept."""

_CALLED = (Past.ONCE, Past.HISTORICALLY)


def further(frame: Frame, asked: Steps, effort: int, seed: int, claim_name: str) -> Deeper:
    """What settles a claim that holds at the first step and that one step of induction does not keep: induction over a
    few steps, an invariant, or a run that breaks it; longer ones where Spacer says that there is one."""
    each = min(effort, DEEPER_EFFORT)
    found = deeper(asked, each, seed, claim_name, range(2, DEEPEST_INDUCTION + 1))
    if found.proved is not None or found.run is not None:
        return found
    guess = _guessed(asked, effort)
    if guess.invariant is not None and (by := _inductive(frame, asked, guess.invariant, effort, seed)) is not None:
        return by
    longest = LONGEST_RUN if guess.broken else LONGEST_UNROLLING
    return deeper(asked, each, seed, claim_name, range(DEEPEST_INDUCTION + 1, longest + 1))


def _guessed(asked: Steps, effort: int) -> Found:
    """Deterministic: Spacer's steps bound it."""
    state: dict[Variable, Variable] = {v: v for v in asked.constant}
    terms = (asked.claim, *asked.ever.values(), *asked.last.values(), *asked.initial.values())
    for v in frozenset[Variable]().union(*map(free_variables, terms)):
        if v.name.endswith(BEFORE):
            state[v] = Variable(v.role, v.name.removesuffix(BEFORE), v.sort)
    goes_on = [*asked.ever.values()]
    last = [*asked.last.values(), negation(asked.claim)]
    return invariant([*asked.initial.values(), *goes_on], goes_on, last, state, min(effort, INVARIANT_EFFORT))


def _inductive(frame: Frame, asked: Steps, found: Term, effort: int, seed: int) -> Deeper | None:
    """A proof of the claim by an invariant, where it is one: it holds at the first step, is kept, and implies it."""
    written = write(frame, found)
    if written is None:
        return None
    held = {label(written) + _BEFORE: asked.shifted(found, 1)}
    first = implied({**asked.ever, **asked.initial}, found, effort=effort, seed=seed)
    kept = implied({**asked.ever, **held}, found, effort=effort, seed=seed)
    later = implied({**asked.last, **held}, asked.claim, effort=effort, seed=seed)
    if {first.verdict, kept.verdict, later.verdict} != {Verdict.PROVED}:
        return None
    # what keeps it did so a step before
    before = (n if n.endswith(_BEFORE) else n + _BEFORE for n in (*first.needed, *kept.needed))
    needed = (n for n in (*later.needed, *before) if not n.startswith("initial "))
    return Deeper(tuple(dict.fromkeys(needed)), steps=1, engine=later.engine, by=written)


def write(frame: Frame, term: Term) -> Written | None:
    """A formula over a system's variables as text; None where one of these is no value of a port or a memory."""
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
    """The formula of a text over ``node.port``, as the kernel's claims are; None where it is none any more."""
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


def with_lemmas(told: Wiring, contract: Contract, lemmas: Iterable[Written]) -> Wiring:
    """A system with the claims of some lemmas: of those that say something of it as it is now."""
    found = ((label(each), read(each, contract, told)) for each in lemmas)
    more = tuple((Claimed.REQUIREMENT, "", name, term) for name, term in found if term is not None)
    return replace(told, formulas=(*told.formulas, *more))


def _inputs(frame: Frame) -> Mapping[Variable, str]:
    """The environment's variables, and a port that reads each."""
    return {frame.input(e.node, e.port): f"{Role.INPUT}.{e.node}.{e.port}" for e in frame.graph.environment}
