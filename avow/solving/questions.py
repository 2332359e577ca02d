"""Questions to the solver: satisfiable? entailed? Every answer is bounded in effort, and checked.

`solve` asks whether some formulas hold together, `entails` whether some imply another. A model is shown, and a
refutation reported, only after it has been replayed: its values substituted, and the formulas proved true under every
interpretation of partial operations outside their domains. A model that is not replayed is `unknown`.

A total function over an infinite domain has no finite description in general; where the solver finds no model,
functions with finitely many exceptions (a table and a default) are tried: a solution among them is a model.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import field, replace
from itertools import chain
from typing import Literal as OneOf
from typing import assert_never

from avow.base.records import dataclass
from avow.base.tuning.effort import (
    ANOTHER_SOLVER_EFFORT,
    CLOSER_LOOKS,
    FIRST_LOOK_EFFORT,
    QUESTION_EFFORT,
    QUESTION_SHARE,
    RESTART,
    RESTARTS,
    ROUNDS,
)
from avow.base.verdict import Counterexample, Verdict
from avow.formulas.formula import conjunction, free_variables, negation
from avow.formulas.sequences import flatten
from avow.formulas.values import FunctionValue, Value
from avow.formulas.written import show_values
from avow.language.definedness import defined
from avow.language.sorts import BOOL, FunctionSort, OpaqueSort, SequenceSort
from avow.language.subterms import subterms
from avow.language.terms import Apply, Quantified, Term, Variable
from avow.solving import smtlib
from avow.solving.checking import BOUNDED, Answer, Engine, Status, check, with_small_numbers
from avow.solving.limits import NO_ANSWER, allowed, budget, spent, tried, until
from avow.solving.models import Model
from avow.solving.replay import is_partial, replay
from avow.solving.translation import Expr, Meaning, Translator, Unsupported, same_session
from avow.solving.z3_module import z3


@dataclass(frozen=True, slots=True)
class Solution:
    """The answer to one question about terms. `values`, with `sat`, have been replayed.

    `core` (with `unsat`) are the labels of a minimal set of formulas that conflict.
    """

    status: Status
    values: Mapping[Variable, Value] = field(default_factory=dict)
    core: tuple[str, ...] = ()
    reason: str = ""
    engine: str = "z3"
    seconds: float = 0.0


@dataclass(frozen=True, slots=True)
class Entailment:
    """Whether hypotheses imply a goal. `needed` are the labels of the hypotheses that a proof depends on: without any,
    the goal is valid; `vacuous` says that the hypotheses contradict each other."""

    verdict: Verdict
    counterexample: Counterexample | None = None
    values: Mapping[Variable, Value] = field(default_factory=dict)
    needed: tuple[str, ...] = ()
    vacuous: bool = False
    reason: str = ""
    engine: str = "z3"
    seconds: float = 0.0


Values = OneOf["shown", "if any", "unused", "never"]
"""The use of a solution's values: shown to people, with small numbers; the same, but they may be missing (polynomials
can have solutions without an exact decimal); or not used. With `never` only a contradiction matters: the solver's own
`sat` ends the search, and is not replayed, except if it is one of bounds."""


@dataclass(frozen=True, slots=True)
class _Asked:
    """A question: see `solve`. `free`: the variables whose values are wanted."""

    labelled: Mapping[str, Term]
    free: tuple[Variable, ...]
    given: Mapping[Variable, Value]
    effort: int
    seed: int
    values: Values

    def fixed(self, translator: Translator) -> dict[Variable, Meaning]:
        """The given values, as meanings."""
        return {variable: translator.value(value, variable.sort) for variable, value in self.given.items()}


def _in_order(variables: Iterable[Variable]) -> tuple[Variable, ...]:
    """Each variable once, by name: a set's order differs from run to run, and with it the solver's steps."""
    return tuple(sorted(set(variables), key=lambda v: (v.qualified, repr(v.sort))))


# -- terms -------------------------------------------------------------------------------------------------------------


def solve(
    formulas: Mapping[str, Term] | Iterable[Term],
    *,
    effort: int = QUESTION_EFFORT,
    seed: int = 0,
    variables: Iterable[Variable] = (),
    given: Mapping[Variable, Value] | None = None,
    values: Values = "shown",
) -> Solution:
    """Can all formulas hold together? With labels, `unsat` names a minimal conflicting set of them.

    `variables` are further variables whose values are wanted; `given` fixes the values of some. Unsupported constructs,
    time-outs and models that cannot be replayed are `unknown`, with the reason. `values`: how a solution is used, see
    `Values`.
    """
    start = time.monotonic()
    labelled = dict(formulas) if isinstance(formulas, Mapping) else {str(k): f for k, f in enumerate(formulas)}
    free = _in_order(chain(variables, *(free_variables(f) for f in labelled.values())))
    granted = allowed(effort)
    with same_session(), budget(effort * QUESTION_SHARE):
        if not allowed(effort):
            return Solution("unknown", reason=NO_ANSWER)
        fixed = {v: given[v] for v in _in_order(given)} if given else {}
        asked = _Asked(labelled, free, fixed, effort, seed, values)
        try:
            solution = _within_bounds(asked) or _solve(Translator(), asked)
        except Unsupported as error:
            solution = Solution("unknown", reason=f"Avow cannot express {error.what} for the solver")
        except z3.Z3Exception as error:
            solution = Solution("unknown", reason=f"Z3: {error}")
        if solution.status == "unknown" and values != "shown" and _has_solution(asked):
            solution = Solution("sat")
        patient = solution.status == "unknown" and not given and effort >= ANOTHER_SOLVER_EFFORT
        if patient and allowed(effort):
            solution = _second_opinion(labelled, effort) or solution
    reason = tried(solution.reason, granted) if solution.status == "unknown" else solution.reason
    return replace(solution, reason=reason, seconds=time.monotonic() - start)


def entails(
    hypotheses: Mapping[str, Term] | Iterable[Term],
    goal: Term,
    *,
    effort: int = QUESTION_EFFORT,
    seed: int = 0,
    variables: Iterable[Variable] = (),
    given: Mapping[Variable, Value] | None = None,
    whether: bool = False,
) -> Entailment:
    """Do the hypotheses imply the goal, for all values of the free variables? `whether`: only a proof matters, and
    `refuted` means that the solver has a model, which is neither replayed nor shown."""
    labelled = (
        dict(hypotheses) if isinstance(hypotheses, Mapping) else {f"H{k}": h for k, h in enumerate(hypotheses, start=1)}
    )
    denied = "the goal is false"
    while denied in labelled:
        denied += "!"
    asked = {**labelled, denied: negation(goal)}
    values: Values = "never" if whether else "shown"
    solution = solve(asked, effort=effort, seed=seed, variables=variables, given=given, values=values)
    match solution.status:
        case "unsat":
            needed = tuple(label for label in solution.core if label != denied)
            vacuous = bool(solution.core) and denied not in solution.core
            found = Entailment(Verdict.PROVED, needed=needed, vacuous=vacuous)
        case "sat":
            shown = None if whether else Counterexample(show_values(solution.values))
            found = Entailment(Verdict.REFUTED, shown, solution.values)
        case "unknown":
            found = Entailment(Verdict.UNKNOWN, reason=solution.reason)
        case _:
            assert_never(solution.status)
    return replace(found, engine=solution.engine, seconds=solution.seconds)


def _solve(translator: Translator, question: _Asked) -> Solution:
    labelled, given, effort, seed = question.labelled, question.given, question.effort, question.seed
    fixed = question.fixed(translator)
    free = [v for v in question.free if v not in fixed]
    tracked = [(label, translator.term(formula, fixed)) for label, formula in labelled.items()]
    background = [*translator.background(free), *translator.opaque_facts()]
    ordinary = [v for v in free if not isinstance(v.sort, FunctionSort)]
    functions = [v for v in free if isinstance(v.sort, FunctionSort)]

    whole = [*background, *(expr for _, expr in tracked)]
    numbers = [translator.variable(v) for v in ordinary]

    def build(meanings: Mapping[Variable, Meaning]) -> list[Expr]:
        parts = [translator.term(formula, {**fixed, **meanings}) for formula in labelled.values()]
        return [*translator.opaque_facts(), *parts]

    def replayed(answer: Answer, engine: str, *, simple: bool) -> Solution | None:
        """The values of its model, if they can be read and replayed."""
        either = (True, False) if answer.reason == BOUNDED else (True,)
        for smaller in (False, True) if question.values == "unused" else either:
            one = with_small_numbers(translator, whole, numbers, answer, seed=seed) if smaller else answer
            values = _read(one.model, free) if one.model is not None else None
            if values is None or (simple and not all(map(_is_simple, values.values()))):
                continue
            if replay(labelled.values(), {**values, **given}):
                return Solution("sat", values, engine=engine)
        return None

    def asked(effort: float, seed: int, engine: Engine = "smt") -> tuple[Answer, Solution | None]:
        """An engine's answer, and its solution, if it counts. Where only bounds of values are known, they are made
        closer at a model that does not."""
        limit, name = max(1, int(effort)), "z3" if engine == "smt" else "z3, qsat"
        for look in range(CLOSER_LOOKS):
            answer = check(translator, background, effort=limit, seed=seed, tracked=tracked, engine=engine)
            found = judged(answer, engine, name)
            if found is not None or answer.model is None or answer.reason != BOUNDED or look == CLOSER_LOOKS - 1:
                break
            closer = translator.facts_near(whole, answer.model.evaluate)
            background.extend(closer)
            whole.extend(closer)
        return answer, found

    def judged(answer: Answer, engine: Engine, name: str) -> Solution | None:
        if answer.status == "unsat":
            return Solution("unsat", core=answer.core, engine=name)
        if question.values == "never" and answer.reason != BOUNDED:
            return Solution("sat", engine=name) if answer.status == "sat" else None
        return replayed(answer, name, simple=engine == "smt")

    reason = ""
    for plain, tables in ROUNDS:
        if functions and (plain, tables) == ROUNDS[-1]:
            for another in range(seed + 1, seed + 1 + RESTARTS):  # other seeds, each for a short time
                answer, solution = asked(effort * RESTART, another)
                if solution is not None:
                    return solution
        first = functions and plain == ROUNDS[0][0]
        answer, solution = asked(min(effort * plain, FIRST_LOOK_EFFORT) if first else effort * plain, seed)
        if solution is not None:
            return solution
        reason = answer.reason
        if functions:
            limit = max(1, int(effort * tables))
            found = search_tables(translator, build, ordinary, functions, effort=limit, seed=seed)
            never = question.values == "never"
            if found is not None and (never or replay(labelled.values(), {**found, **given})):
                return Solution("sat", found, engine="z3, functions as tables")
            solution = replayed(answer, "z3", simple=False)
        else:
            answer, solution = asked(effort * tables, seed, "qsat")
        if solution is not None:
            return solution
        if answer.model is not None:
            reason = "the solver's model could not be replayed"
    return Solution("unknown", reason=reason or NO_ANSWER)


def _within_bounds(asked: _Asked) -> Solution | None:
    """If there are sequences or divisions: values for which nothing outside a sequence matters, and no division by
    zero. Sequences are encoded as functions; if these formulas are contradictory, so are the original ones."""
    labelled, proof = asked.labelled, asked.values == "never"
    if not any(is_partial(formula) for formula in labelled.values()):
        return None
    inside = conjunction(map(defined, labelled.values()))
    sequences = [v for v in asked.free if isinstance(v.sort, SequenceSort) and v not in asked.given]
    flat = flatten({**labelled, _INSIDE: inside}, sequences)
    formulas = flat.formulas if flat else {**labelled, _INSIDE: inside}
    variables = _in_order(flat.variables(asked.free)) if flat else asked.free
    translator, within = Translator(), replace(asked, labelled=formulas, free=variables, effort=asked.effort // 3)
    found = None if proof else _solve(translator, within)
    if found is not None and found.status == "sat":
        values = flat.values(found.values) if flat else found.values
        if values is not None and replay(labelled.values(), {**values, **asked.given}):
            return Solution("sat", values, engine=found.engine)
    if flat is None:
        return None
    anywhere = _solve(Translator(), replace(within, labelled={label: flat.formulas[label] for label in labelled}))
    return anywhere if anywhere.status == "unsat" else None


_INSIDE = "within the bounds"


def _has_solution(asked: _Asked) -> bool:
    """Whether formulas without quantifiers, functions and sequences hold together where they have a value: for these,
    the solver's answer is right even if the solution cannot be written down."""
    formulas = asked.labelled.values()
    parts = [part for formula in formulas for part in subterms(formula)]
    if any(isinstance(part, Quantified | Apply) or isinstance(part.sort, SequenceSort) for part in parts):
        return False
    if any(isinstance(v.sort, FunctionSort | OpaqueSort) for v in asked.free):
        return False
    try:
        translator = Translator()
        fixed = asked.fixed(translator)
        facts = [translator.term(part, fixed) for formula in formulas for part in (formula, defined(formula))]
        whole = [*translator.background(v for v in asked.free if v not in fixed), *facts]
        return check(translator, whole, effort=asked.effort, seed=asked.seed).status == "sat"
    except (Unsupported, z3.Z3Exception):
        return False


def _is_simple(value: Value) -> bool:
    return not isinstance(value, FunctionValue) or (len(value.table) <= 1 and value.default is not True)


_TABLES = ((0, True), (1, True), (2, True), (3, True), (1, False), (2, False))
"""The number of exceptions of the functions, and whether relations are false elsewhere: the simplest first."""


def search_tables(
    translator: Translator,
    build: Callable[[Mapping[Variable, Meaning]], list[Expr]],
    ordinary: Iterable[Variable],
    functions: Iterable[Variable],
    *,
    effort: int,
    seed: int = 0,
) -> dict[Variable, Value] | None:
    """Values of the variables for which the result of `build` is satisfiable, with functions that are tables of few
    entries. A best effort: None proves nothing, and a result has to be replayed."""
    ordinary, functions = tuple(ordinary), sorted(functions, key=lambda v: v.qualified)
    deadline = until(effort)
    for number, (size, sparse) in enumerate(_TABLES if functions else _TABLES[:1]):
        left = deadline - spent()
        if left < 1:
            return None
        limit = max(min(120, max(50, effort)), int(left / min(3, len(_TABLES) - number)))
        values = _with_tables(translator, build, ordinary, functions, size, sparse, limit, seed)
        if values is not None:
            return values
    return None


def _read(model: Model, free: Iterable[Variable]) -> dict[Variable, Value] | None:
    try:
        return model.values(free)
    except Unsupported:
        return None


def _with_tables(
    translator: Translator,
    build: Callable[[Mapping[Variable, Meaning]], list[Expr]],
    ordinary: Sequence[Variable],
    functions: Sequence[Variable],
    size: int,
    sparse: bool,
    effort: int,
    seed: int,
) -> dict[Variable, Value] | None:
    """A model in which every function has at most `size` exceptions; a `sparse` relation is false everywhere else."""
    meanings: dict[Variable, Meaning] = {}
    parts: dict[Variable, tuple[list[tuple[list[Expr], Expr]], Expr]] = {}
    facts: list[Expr] = []
    for variable in functions:
        sort = variable.sort
        assert isinstance(sort, FunctionSort)
        points = []
        for _ in range(size):
            point = [translator.fresh("p", parameter) for parameter in sort.parameters]
            value = translator.fresh("v", sort.result)
            facts.extend(
                m for p, s in zip(point, sort.parameters, strict=True) if (m := translator.member(s, p)) is not None
            )
            points.append((point, value))
        falsity = sort.result == BOOL and sparse
        default = z3.BoolVal(False, translator.context) if falsity else translator.fresh("d", sort.result)
        results = [value for _, value in points] + ([] if falsity else [default])
        facts.extend(m for r in results if (m := translator.member(sort.result, r)) is not None)
        meanings[variable] = translator.table(points, default)
        parts[variable] = (points, default)
    facts.extend(translator.background(ordinary))
    facts.extend(build(meanings))
    # The usual engine first: its numbers are smaller.
    answer = check(translator, facts, effort=effort // 3, seed=seed)
    if answer.status == "unknown":
        answer = check(translator, facts, effort=effort * 2 // 3, engine="qsat")
    numbers = [translator.variable(v) for v in ordinary]
    for points, default in parts.values():
        numbers += [default, *(e for point, value in points for e in (*point, value))]
    model = with_small_numbers(translator, facts, numbers, answer, seed=seed).model
    if model is None:
        return None
    try:
        values = model.values(ordinary)
        for variable, (points, default) in parts.items():
            sort = variable.sort
            assert isinstance(sort, FunctionSort)
            rest = model.read(default, sort.result)
            table: dict[tuple[Value, ...], Value] = {}
            for point, value in points:
                at = tuple(model.read(p, s) for p, s in zip(point, sort.parameters, strict=True))
                table.setdefault(at, model.read(value, sort.result))
            values[variable] = FunctionValue({at: v for at, v in table.items() if v != rest}, rest)
    except Unsupported:
        return None
    return values


def _second_opinion(labelled: Mapping[str, Term], effort: int) -> Solution | None:
    """cvc5, if it is installed: only its `unsat` counts, since its models are not read."""
    try:
        script = smtlib.formulas_script(labelled)
    except Unsupported:
        return None
    answer = smtlib.ask_cvc5(script, effort=effort)
    return Solution("unsat", core=tuple(labelled), engine="cvc5") if answer == "unsat" else None
