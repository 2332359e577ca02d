"""Programs that keep something from step to step, and contracts that remember: the steps of a node as triples.

An invariant over what the program keeps and what the contract remembers is shown to hold first and to be kept; it is
then known before every step. Guesses that runs of the program do not contradict are tried beside the plan's own.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

from avow.backend_kit.protocol import Job
from avow.backend_kit.stepping import Held, Invariant, Stepping, guesses, stepping
from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.base.records import dataclass
from avow.base.suggestions import did_you_mean
from avow.evaluation.compiler import member_of
from avow.evaluation.evaluate import NotEvaluable, compile_term, evaluate
from avow.formulas.formula import free_variables
from avow.formulas.temporal.cells import longest_limits, remembers
from avow.language.contract import Clause, ClauseKind, Node
from avow.language.printer import show_sort

from .checker import Checked
from .names import Names, vocabulary
from .runs import Runner, Seen, Step, look
from .syntax import Memory, Source
from .triples import Triple, triples
from .tuning import GUESSES, LONGEST_RUN
from .typing import Scope, fit, rejected, term
from .wp import Condition, TooLarge, conditions


def steps_of(job: Job, source: Source) -> Stepping | None:
    """The steps of the job's node with this program; None where neither remembers anything. Raises Rejected."""
    stated = _stated(job)
    if not source.memory and not stated and not remembers(job.node):
        return None
    held = tuple(_held(each, job) for each in source.memory)
    return stepping(job.node, (o.name for o in job.obligations), held, stated, job.contract)


def _stated(job: Job) -> tuple[tuple[str, Span], ...]:
    given = job.options.get("invariants") or ()
    texts = (given,) if isinstance(given, str) else tuple(given) if isinstance(given, Sequence) else ()
    place = job.method.options
    if isinstance(given, str):
        return ((given, place.at("invariants")),)
    return tuple((str(text), place.at("invariants", k)) for k, text in enumerate(texts))


def _held(memory: Memory, job: Job) -> Held:
    names = Names(vocabulary(job.contract, job.node))
    types = names.vocabulary.types
    if memory.sort not in types:
        raise Rejected(
            Diagnostic(
                "HOARE200", f"there is no type `{memory.sort}`", memory.span, hint=did_you_mean(memory.sort, [*types])
            )
        )
    sort = types[memory.sort]
    initial = fit(term(memory.initial, Scope(names)), sort, memory.span)
    try:
        value = None if free_variables(initial) else evaluate(initial, {})
    except NotEvaluable:
        value = None
    fits = member_of(sort, {})
    if value is None or (fits is not None and not fits(value)):
        message = f"what `{memory.name.name}` is first has to be a constant of {show_sort(sort)}"
        raise rejected("HOARE300", message, memory.span)
    return Held(memory.name.name, sort, initial)


def kept(invariant: Invariant, name: str, steps: Stepping, node: Node, checked: Checked) -> tuple[Triple, ...]:
    """{assumptions and invariants} program {the invariant, of what the step leaves}: `node` has the assumptions."""
    formula = steps.after(invariant.formula)
    clause = Clause(ClauseKind.GUARANTEE, name, 0, formula, None, invariant.text, invariant.span or node.span)
    return triples("", clause, node, checked)


@dataclass(frozen=True, slots=True)
class Established:
    """Invariants that hold before every step, and why others of the plan's are not among them."""

    invariants: tuple[Invariant, ...]
    lacking: tuple[str, ...]


def establish(
    stated: Sequence[Invariant],
    guessed: Sequence[Iterator[Invariant]],
    steps: Stepping,
    checked: Checked,
    proves: Callable[[Condition], bool],
) -> Established:
    """The largest part of the stated invariants, and of guesses, that hold first and that together each step keeps. Of
    each guess there are forms, of which the first that lasts is taken."""
    lacking: list[str] = []

    def begins(each: Invariant) -> bool:
        return proves(Condition("first", (), steps.first(each.formula), "it holds before the first step"))

    left: list[Invariant] = []
    for each in stated:
        if begins(each):
            left.append(each)
        else:
            lacking.append(f"not shown that `{each.text}` holds before the first step")
    forms = [filter(begins, form) for form in guessed]
    now = [next(form, None) for form in forms]
    while True:
        known = [*left, *(each for each in now if each is not None)]
        node = steps.knowing(known)
        lost = [each for each in known if not _is_kept(each, steps, node, checked, proves)]
        if not lost:
            return Established(tuple(known), tuple(lacking))
        lacking += [f"not shown that a step keeps `{each.text}`" for each in left if each in lost]
        left = [each for each in left if each not in lost]
        now = [next(forms[k], None) if each in lost else each for k, each in enumerate(now)]


def _is_kept(
    invariant: Invariant,
    steps: Stepping,
    node: Node,
    checked: Checked,
    proves: Callable[[Condition], bool],
) -> bool:
    try:
        return all(
            proves(condition)
            for triple in kept(invariant, "invariant", steps, node, checked)
            for condition in conditions(triple.as_stated, checked.program.body)
        )
    except TooLarge:
        return False


def knowing(job: Job, steps: Stepping, invariants: Sequence[Invariant]) -> Job:
    """The job of the larger node, in which invariants are known before every step."""
    return replace(job, node=steps.knowing(invariants))


def remembered(
    steps: Stepping, checked: Checked, wanted: Sequence[Clause], proves: Callable[[Condition], bool]
) -> tuple[Seen, Established]:
    """What runs from the start show of some guarantees, and the invariants that hold."""
    try:
        limits = longest_limits(clause.formula for clause in steps.own.clauses)
        seen = look(Runner(steps.own, steps, checked, wanted), min(limits, LONGEST_RUN))
    except NotEvaluable:
        seen = Seen()
    if seen.fault is not None or len(seen.broken) == len(wanted) > 0:  # nothing is left to be proved
        return seen, Established((), ())
    memories = [dict(pairs) for pairs in dict.fromkeys(tuple(sorted(m.items())) for m in seen.memories)]
    forms = [(each for each in family if not _contradicted(each, memories)) for family in guesses(steps)]
    found = establish(steps.invariants, forms[:GUESSES], steps, checked, proves)
    told = tuple(f"a run contradicts `{each.text}`" for each in steps.invariants if _contradicted(each, memories))
    return seen, replace(found, lacking=told or found.lacking)


def _contradicted(invariant: Invariant, memories: Sequence[Step]) -> bool:
    """Whether a memory that a run came to breaks it."""
    try:
        holds = compile_term(invariant.formula)
    except NotEvaluable:
        return False
    for memory in memories:
        try:
            if holds(memory) is False:
                return True
        except NotEvaluable:
            continue
    return False
