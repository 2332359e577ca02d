"""Trials judged by a guarantee's own formula, in exact arithmetic: a trial is a run of one step, or of several."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from avow.backend_kit.programs.judging import Formula
from avow.base.records import dataclass
from avow.base.tuning.effort import JUDGE_EFFORT
from avow.evaluation.evaluate import Evaluator, NotEvaluable, compile_term
from avow.evaluation.running import Keeper
from avow.formulas.conditions import Condition, conditions
from avow.formulas.formula import conjunction, free_variables, negation, substitute
from avow.formulas.temporal.cell import Cell
from avow.formulas.temporal.cells import Records
from avow.formulas.temporal.responses import due, pending, responding
from avow.formulas.traversal import transform
from avow.formulas.values import Value
from avow.kernel.rates import Trial
from avow.language.contract import Chance, Clause
from avow.language.operators import definition
from avow.language.printer import show_term
from avow.language.sorts import BOOL, FunctionSort
from avow.language.subterms import histories, ports_of, subterms
from avow.language.terms import (
    TRUE,
    And,
    Conditional,
    Implies,
    Not,
    Operation,
    Or,
    Past,
    Quantified,
    Quantifier,
    Role,
    Term,
    Variable,
)
from avow.solving.questions import solve

from .binding import Interpretation, interpreted
from .tuning import CASES

Step = Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Claim:
    """A guarantee, prepared for judging. `conditions` are those under which it demands something, with their text; a
    guarantee without conditions demands something of every trial. `unseen` are assumptions whose inputs are not in the
    data.
    """

    holds: Formula
    conditions: tuple[Formula, ...]
    demands: Evaluator | None
    """Whether, for a step's inputs, some outputs would violate it; None if that cannot be evaluated."""
    assumptions: tuple[Formula, ...]
    unseen: tuple[str, ...]
    missing: tuple[str, ...]
    """Ports that the guarantee mentions and that are bound to no column."""
    reads: frozenset[str]
    """The ports and columns that have values and are read."""
    remembers: bool
    cells: tuple[Cell, ...]
    waits: Formula | None
    """A response whose time is not over is missing; None if the guarantee is no response with a limit."""
    interpreted: tuple[str, ...]
    """The texts of the interpretations that it, or an assumption, needs."""
    chance: Chance | None = None
    """Of a guarantee with a probability."""
    within: tuple[Formula, ...] = ()
    """The conditions inside the claim of a guarantee with a probability: they leave no trial out, but each has to be
    met in some."""

    @property
    def trial(self) -> Trial | None:
        """What the probability is of; None if the guarantee has none."""
        if self.chance is None:
            return None
        return Trial.RUN if self.chance.per_run else Trial.STEP


@dataclass(frozen=True, slots=True)
class Judged:
    """The result of a trial. `met`: the indices of the conditions that were met; `asked`: the guarantee demanded
    something; `broken`: the step that violates it; `open`: it ends before an answer is due; `excused`: an assumption
    did not hold, before any violation; `undecided`: why it could not be decided."""

    met: frozenset[int] = frozenset()
    asked: bool = False
    broken: int | None = None
    open: bool = False
    excused: bool = False
    undecided: str = ""
    lost: str = ""
    """How a simulator ended without a recording: counted as a failure, but no counterexample."""
    shown: tuple[tuple[str, str], ...] = ()
    """What the monitors show of the failure, and why it is one."""
    why: str = ""
    within: frozenset[int] = frozenset()
    """As `met`, for `Claim.within`."""


def claim(clause: Clause, assumptions: Iterable[Clause], meanings: Iterable[Interpretation], known: set[str]) -> Claim:
    """`known`: the names of ports and columns that have values. The trials of a guarantee with a probability are those
    that meet what is given, and no others are left out."""
    known_meanings, records = tuple(meanings), Records()

    def ready(name: str, formula: Term) -> Formula:
        return Formula.made(name, records.clause(formula) if histories(formula) else formula)

    assumptions = tuple(assumptions)
    formulas, chance = (clause.spoken, *(each.formula for each in assumptions)), clause.chance
    formula = interpreted(clause.spoken, known_meanings)
    assumed = {each.name: interpreted(each.formula, known_meanings) for each in assumptions}
    waiting = pending(formula) if (found := responding(formula)) and found[2].operator is not Past.UNTIL else None
    unseen = [name for name, term in assumed.items() if not _ports(term) <= known]
    judged_terms = (formula, *(term for name, term in assumed.items() if name not in unseen))
    waits = None if waiting is None else Formula.made(clause.name, records.term(waiting))
    asked = _conditions(formula, assumed) if chance is None else ()
    if chance is not None and chance.given != TRUE:
        asked = (interpreted(chance.given, known_meanings),)
    return Claim(
        ready(clause.name, formula),
        tuple(ready(_named(condition, formula), condition) for condition in asked),
        _demands(formula) if chance is None else None,
        tuple(ready(name, term) for name, term in assumed.items() if name not in unseen),
        tuple(unseen),
        tuple(sorted(_ports(formula) - known)),
        frozenset(name for term in judged_terms for name in _ports(term) & known),
        any(histories(term) for term in judged_terms),
        tuple(records.cells),
        waits,
        tuple(one.text for one in known_meanings if any(interpreted(each, [one]) != each for each in formulas)),
        chance,
        tuple(ready(_named(each, formula), each) for each in _conditions(formula, assumed)) if chance else (),
    )


def judged(claim: Claim, steps: Sequence[Step]) -> Judged:
    """One trial, from its first step."""
    keeper, met, asked, waits, doubt, undecided = Keeper(claim.cells), set[int](), False, False, "", ""
    within = set[int]()
    for at, ports in enumerate(steps):
        values = keeper.at(ports)
        assumed = {formula.name: formula.holds(values) for formula in claim.assumptions}
        if False in assumed.values():
            return Judged(frozenset(met), excused=True)
        doubt = doubt or next(
            (f"assumption {name} has no value" for name, holds in assumed.items() if holds is None), ""
        )
        if _demanded(claim, values):
            asked = True
            met |= {n for n, condition in enumerate(claim.conditions) if condition.holds(values) is True}
        within |= {n for n, condition in enumerate(claim.within) if condition.holds(values) is True}
        held = claim.holds.holds(values)
        if held is False:
            return Judged(frozenset(met), True, broken=at, undecided=doubt, within=frozenset(within))
        undecided = undecided or (f"{claim.holds.name} has no value" if held is None else "")
        waits = claim.waits is not None and claim.waits.holds(values) is not False
        keeper.advance(ports)
    return Judged(frozenset(met), asked, open=waits, undecided=doubt or undecided, within=frozenset(within))


def _demands(formula: Term) -> Evaluator | None:
    """A formula may demand nothing for some inputs although it has no explicit condition."""
    outputs = [port for port in ports_of(formula) if port.role is Role.OUTPUT]
    if histories(formula) or any(isinstance(port.sort, FunctionSort) for port in outputs):
        return None
    others = {port: Variable(Role.BOUND, f"other {port.name}", port.sort) for port in outputs}
    broken = negation(substitute(formula, dict(others)))
    try:
        asked = compile_term(Quantified(Quantifier.EXISTS, tuple(others.values()), broken) if others else broken)
    except NotEvaluable:
        return None
    given = [port.qualified for port in ports_of(formula) if port.role is not Role.OUTPUT]
    known: dict[tuple[Value, ...], Value] = {}

    def demands(values: Mapping[str, Value]) -> Value:
        """As `asked`, computed once for equal inputs."""
        key = tuple(values[name] for name in given)
        if key not in known:
            known[key] = asked(values)
        return known[key]

    return demands


def _demanded(claim: Claim, values: Step) -> bool:
    try:
        return claim.demands is None or bool(claim.demands(values))
    except NotEvaluable:
        return True


def _conditions(formula: Term, assumed: Mapping[str, Term]) -> tuple[Term, ...]:
    """For a response, that its whole demand has become due; else the conditions that are possible under the
    assumptions."""
    response = due(formula)
    if response is None:
        chosen = transform(formula, lambda part: (isinstance(part, Operation) and definition(part)) or part)
        apart = conditions(conjunction(_by_cases(chosen, iter(range(CASES)))))
        found = dict.fromkeys(way for condition in apart for way in _ways(condition))
        return tuple(way for way in found if not _dead(way, assumed))
    if response.full == TRUE:
        return ()
    outer, full = response.outer, conjunction((response.full,))
    return (Quantified(Quantifier.EXISTS, outer, full) if outer else full,)


def _by_cases(formula: Term, left: Iterator[int], when: tuple[Term, ...] = ()) -> Iterator[Term]:
    """``y == (if b then s else t)`` as one part under b and one under ``not b``, if b is about inputs only."""
    choices = (part for part in subterms(formula) if isinstance(part, Conditional) and part.sort != BOOL)
    choice = next((c for c in choices if all(v.role is Role.INPUT for v in free_variables(c.condition))), None)
    if choice is None or next(left, None) is None:
        yield Implies(conjunction(when), formula) if when else formula
        return
    for test, chosen in ((choice.condition, choice.then), (negation(choice.condition), choice.otherwise)):
        body = transform(formula, lambda part, chosen=chosen: chosen if part == choice else part)  # type: ignore[misc]
        yield from _by_cases(body, left, (*when, test))


def _ways(condition: Condition) -> Iterator[Term]:
    """``a or b -> c`` demands c under a, and under b: a trial of a is not a trial of b."""
    choices = [(part, items) for part in condition.parts if (items := _choices(part))]
    if not choices or sum(len(items) for _, items in choices) > CASES:
        yield condition.formula
        return
    for choice, items in choices:
        for item in items:
            yield replace(condition, parts=tuple(item if part is choice else part for part in condition.parts)).formula


def _choices(condition: Term) -> tuple[Term, ...]:
    match condition:
        case Or(items=items):
            return items
        case Not(body=And(items=items)):
            return tuple(map(negation, items))
        case Implies(left=left, right=right):
            return negation(left), right
    return ()


def _dead(condition: Term, assumed: Mapping[str, Term]) -> bool:
    formulas = {**assumed, "": condition}
    plain = not any(histories(term) for term in formulas.values())
    return plain and solve(formulas, effort=JUDGE_EFFORT, values="unused").status == "unsat"


def _ports(formula: Term) -> set[str]:
    return {variable.qualified for variable in ports_of(formula)}


def _named(condition: Term, formula: Term) -> str:
    return _text(condition) if due(formula) is None else f"{_text(formula)} is due before the run ends"


def _text(formula: Term) -> str:
    return show_term(formula, "unicode").replace("\n", " ").replace("in.column ", "").replace("out.column ", "")
