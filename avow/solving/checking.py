"""One question to Z3 about expressions, bounded in effort: the engines under `avow.solving.questions`."""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any, assert_never
from typing import Literal as OneOf

from avow.base.records import dataclass
from avow.base.tools import package_version
from avow.base.tuning.bounds import SMALL_NUMBER
from avow.base.tuning.effort import QUESTION_EFFORT, QUESTION_STEPS, SMALLER_MODEL_EFFORT
from avow.solving.limits import NO_ANSWER, allowed, net, spend, steps
from avow.solving.models import Model
from avow.solving.translation import Expr, Translator
from avow.solving.z3_module import z3
from avow.solving.z3_sorts import Sorts, parts_of

Status = OneOf["sat", "unsat", "unknown"]

Engine = OneOf["smt", "qsat"]


@dataclass(frozen=True, slots=True)
class Answer:
    """Z3's answer to one question about expressions. `core` are the labels of tracked assertions that conflict. An
    `unknown` has a model if it is one of bounds only."""

    status: Status
    model: Model | None = None
    core: tuple[str, ...] = ()
    reason: str = ""
    seconds: float = 0.0


def z3_version() -> str:
    """As the kernel's solvers and `avow doctor` name it: Z3's own text lacks the last number."""
    return package_version("z3-solver")


def check(
    translator: Translator,
    assertions: Iterable[Expr],
    *,
    effort: int = QUESTION_EFFORT,
    seed: int = 0,
    tracked: Iterable[tuple[str, Expr]] = (),
    engine: Engine = "smt",
) -> Answer:
    """Are the assertions satisfiable together? With `unsat`, `core` is a minimal set of tracked labels (each is needed,
    as far as the solver can tell with similar effort). A crash of the solver is `unknown`.

    The engine `qsat` decides quantified linear arithmetic, where the usual one mostly gives up; it has no functions.
    """
    start = time.monotonic()
    assertions, tracked = list(assertions), list(tracked)
    try:
        status, model, core, reason = _ask(translator, assertions, tracked, effort, seed, engine)
        if status == "unsat" and len(core) > 1:
            core = _minimal(translator, assertions, tracked, core, effort, seed, engine)
    except z3.Z3Exception as error:
        if "unknown parameter" in str(error):
            raise RuntimeError(f"Z3: {error}") from error  # a fault of ours: as an answer it would go unnoticed
        status, model, core, reason = "unknown", None, (), f"Z3: {error}"
    found = Model(translator, model) if model is not None else None
    order = [label for label, _ in tracked if label in core]
    return Answer(status, found, tuple(dict.fromkeys(order)), reason, time.monotonic() - start)


def with_small_numbers(
    translator: Translator, assertions: Iterable[Expr], numbers: Iterable[Expr], answer: Answer, *, seed: int = 0
) -> Answer:
    """The answer, or the same with a model whose numbers are small, if one exists and is found at once: people read it,
    and 21238 looks as if it meant something."""
    numbers = [number for number in numbers if z3.is_arith(number)]
    if answer.model is None or all(map(_is_small, map(answer.model.evaluate, numbers))):
        return answer
    assertions = list(assertions)
    for least, most in ((0, 9), (-9, 9), (-SMALL_NUMBER, SMALL_NUMBER)):
        within = [z3.And(least <= number, number <= most) for number in numbers]
        again = check(translator, [*assertions, *within], effort=SMALLER_MODEL_EFFORT, seed=seed)
        if again.model is not None:
            return again
    return answer


def _is_small(value: Expr) -> bool:
    if z3.is_int_value(value):
        return abs(int(value.as_long())) <= SMALL_NUMBER
    if z3.is_rational_value(value):
        return abs(int(value.numerator_as_long())) <= SMALL_NUMBER * int(value.denominator_as_long())
    return True


def _ask(
    translator: Translator,
    assertions: Sequence[Expr],
    tracked: Sequence[tuple[str, Expr]],
    effort: int,
    seed: int,
    engine: Engine,
) -> tuple[Status, object | None, tuple[str, ...], str]:
    granted = _granted(effort)
    if granted <= 0:
        return "unknown", None, (), NO_ANSWER
    if engine == "qsat":
        return _ask_qsat(translator, assertions, tracked, granted)
    loaded = _Loaded.of(translator, assertions, tracked)
    answer = loaded.put(translator, loaded.switches, granted, seed)
    match answer.status:
        case "sat":
            return "sat", loaded.solver.model(), (), ""
        case "unsat":
            return "unsat", None, loaded.core(), ""
        case "unknown":
            return "unknown", loaded.solver.model() if answer.reason == BOUNDED else None, (), answer.reason
        case _:
            assert_never(answer.status)


def _granted(effort: int) -> int:
    """The part of its effort that a question may use; one that may use nothing is counted all the same, so that a loop
    of refused questions ends."""
    granted = allowed(effort)
    if granted <= 0:
        spend(QUESTION_STEPS)
    return granted


@dataclass(frozen=True, slots=True)
class _Loaded:
    """A solver that holds assertions, and tracked ones each behind a switch."""

    solver: Any
    switches: tuple[tuple[Expr, str], ...]
    """Each switch with its label."""

    @classmethod
    def of(cls, translator: Translator, assertions: Sequence[Expr], tracked: Sequence[tuple[str, Expr]]) -> _Loaded:
        solver = z3.Solver(ctx=translator.context)
        solver.add(*assertions)
        switches = []
        for number, (label, expr) in enumerate(tracked):
            switch = z3.Bool(f"track!{number}", translator.context)
            solver.add(z3.Implies(switch, expr))
            switches.append((switch, label))
        return cls(solver, tuple(switches))

    def put(self, translator: Translator, on: Iterable[tuple[Expr, str]], effort: int, seed: int) -> SolverResult:
        return put(translator, self.solver, effort, seed, *(switch for switch, _ in on))

    def core(self) -> tuple[str, ...]:
        """The labels that conflict, after `unsat`."""
        labels = {switch.get_id(): label for switch, label in self.switches}
        return tuple(labels[switch.get_id()] for switch in self.solver.unsat_core())


@dataclass(frozen=True, slots=True)
class SolverResult:
    """A solver's answer, and the reason why it gave up, for people."""

    status: Status
    reason: str = ""


BOUNDED = "the solver has a model, but knows only bounds of `sin`, `cos` and `atan2`"
"""The model may be none; it counts if it is replayed, with closer bounds at its values."""

BOUNDED_HANGS = 6
"""Questions with these terms hang so many times sooner: Z3 counts few steps of its algebraic numbers."""

HANGS = "the solver hangs"


def put(translator: Translator, solver: Any, effort: float, seed: int | None = 0, *assumptions: Expr) -> SolverResult:
    """Check what a solver holds: every question to Z3 goes through here. Its steps bound it and are counted
    (`avow.solving.limits`); the clock only ends a call that hangs. Raises Z3Exception."""
    configured(solver, effort, seed)
    bounded = False
    if translator.session.roots:  # reading the assertions copies them, which costs time and can change the answer
        roots = translator.root_facts(solver.assertions())
        solver.add(*translator.facts_of(roots))
        if bounded := any(root.is_bounded for root in roots):
            solver.set(timeout=net(effort) // BOUNDED_HANGS)
    result = solver.check(*assumptions)
    charge(translator, solver)
    if result == z3.sat:
        return SolverResult("unknown", BOUNDED) if bounded else SolverResult("sat")
    if result == z3.unsat:
        return SolverResult("unsat")
    return SolverResult("unknown", _reason(solver))


def configured(solver: Any, effort: float, seed: int | None) -> None:
    """Set a solver's limit and seed; None for a solver without a seed."""
    options: dict[str, object] = {"rlimit": steps(effort), "timeout": net(effort)}
    if isinstance(solver, z3.Solver) and seed is not None:
        # Its Gröbner bases of non-linear integer terms cannot be interrupted: Z3 would hang.
        options |= {"random_seed": seed, "smt.arith.nl.grobner": False}
    solver.set(**options)


def charge(translator: Sorts, solver: Any = None) -> int:
    """Count the steps in the translator's context since the last call; any solver of the context can be used. Returns
    their number."""
    before = translator.session.steps
    count = translator.session.steps = _steps_of(solver or z3.Solver(ctx=translator.context))
    used = max(0, count - before)
    spend(QUESTION_STEPS + used)
    return used


def _steps_of(solver: Any) -> int:
    """The number of steps that the solver's context has counted so far."""
    found = solver.statistics()
    for k in range(len(found)):
        if z3.Z3_stats_get_key(found.ctx.ref(), found.stats, k) == "rlimit count":
            return int(z3.Z3_stats_get_uint_value(found.ctx.ref(), found.stats, k))
    return 0


def _reason(solver: Any) -> str:
    """The reason why it gave up, for people."""
    reason = str(solver.reason_unknown()).strip("()")
    if reason == "timeout":
        return HANGS
    return NO_ANSWER if reason in _USED_UP else f"the solver gave up: {reason}" if reason else "no answer"


_USED_UP = ("canceled", "interrupted", "interrupted from keyboard", "max. resource limit exceeded")


def _ask_qsat(
    translator: Translator, assertions: Sequence[Expr], tracked: Sequence[tuple[str, Expr]], effort: int
) -> tuple[Status, object | None, tuple[str, ...], str]:
    everything = [*assertions, *(expr for _, expr in tracked)]
    everything += translator.facts_of(translator.root_facts(everything))
    tactic = "nlqsat" if _real_polynomials(everything) else "qsat"
    solver = z3.Tactic(tactic, ctx=translator.context).solver()
    solver.add(*everything)
    answer = put(translator, solver, effort, None if tactic == "nlqsat" else 0)
    if answer.status == "sat" or answer.reason == BOUNDED:
        return answer.status, solver.model(), (), answer.reason
    if answer.status == "unsat" and _arithmetic_only(everything):
        return "unsat", None, tuple(label for label, _ in tracked), ""
    return "unknown", None, (), answer.reason


def _arithmetic_only(exprs: Iterable[Expr]) -> bool:
    """Whether only numbers and truth values occur: qsat is complete there, and its `unsat` is accepted."""
    return all(z3.is_bool(e) or z3.is_arith(e) for e in parts_of(exprs)) and not any(map(_is_applied, parts_of(exprs)))


def _real_polynomials(exprs: Iterable[Expr]) -> bool:
    """Whether only reals and truth values occur, and reals are multiplied: another engine supports these."""
    parts = list(parts_of(exprs))
    plain = all(z3.is_bool(e) or z3.is_real(e) for e in parts) and not any(map(_is_applied, parts))
    divided = any(z3.is_div(e) and not z3.is_rational_value(e.arg(1)) for e in parts)
    return (
        plain
        and not divided
        and any(z3.is_mul(e) and sum(not z3.is_rational_value(a) for a in e.children()) > 1 for e in parts)
    )


def _is_applied(expr: Expr) -> bool:
    return bool(z3.is_app(expr) and expr.num_args() and expr.decl().kind() == z3.Z3_OP_UNINTERPRETED)


def _minimal(
    translator: Translator,
    assertions: Sequence[Expr],
    tracked: Sequence[tuple[str, Expr]],
    core: tuple[str, ...],
    effort: int,
    seed: int,
    engine: Engine,
) -> tuple[str, ...]:
    """Drop unneeded labels, one at a time. One solver is used for all of them, as it learns; a new one only if it gives
    up."""
    kept, effort = list(core), min(effort, 2_000)
    loaded: _Loaded | None = None
    for label in core:
        rest = [(name, expr) for name, expr in tracked if name in kept and name != label]
        status: Status = "unknown"
        smaller: tuple[str, ...] = ()
        if engine == "smt":
            granted = _granted(effort)
            if granted > 0:
                if loaded is None:
                    loaded = _Loaded.of(translator, assertions, [pair for pair in tracked if pair[0] in core])
                names = {name for name, _ in rest}
                on = [pair for pair in loaded.switches if pair[1] in names]
                status = loaded.put(translator, on, granted, seed).status
                smaller = loaded.core() if status == "unsat" else ()
        if status == "unknown":
            status, _, smaller, _ = _ask(translator, assertions, rest, effort, seed, engine)
        if status == "unsat":
            kept = [name for name in kept if name in smaller]
    return tuple(kept)
