"""One question to Z3 about expressions, bounded in (processor) time: the engines under `avow.solving.questions`."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal as OneOf

import z3

from avow.solving.limits import allowed, watchdog
from avow.solving.models import Model
from avow.solving.translation import Expr, Translator
from avow.tuning.bounds import SMALL_NUMBER
from avow.tuning.effort import QUESTION_MS, SMALLER_MODEL_MS, WALL_CLOCK

Status = OneOf["sat", "unsat", "unknown"]

Engine = OneOf["smt", "qsat"]


@dataclass(frozen=True, slots=True)
class Answer:
    """Z3's answer to one question about expressions. `core` are the labels of tracked assertions that conflict."""

    status: Status
    model: Model | None = None
    core: tuple[str, ...] = ()
    reason: str = ""
    seconds: float = 0.0


def z3_version() -> str:
    return str(z3.get_version_string())


def check(
    translator: Translator,
    assertions: Iterable[Expr],
    *,
    timeout_ms: int = QUESTION_MS,
    seed: int = 0,
    tracked: Iterable[tuple[str, Expr]] = (),
    engine: Engine = "smt",
) -> Answer:
    """Are the assertions satisfiable together? With `unsat`, `core` is a minimal set of tracked labels (each is needed,
    as far as the solver can tell in time). Crashes of the solver are `unknown`.

    The engine `qsat` decides quantified linear arithmetic, where the usual one mostly gives up; it knows no functions.
    """
    start = time.monotonic()
    assertions, tracked = list(assertions), list(tracked)
    try:
        status, model, core, reason = _ask(translator, assertions, tracked, timeout_ms, seed, engine)
        if status == "unsat" and len(core) > 1:
            core = _minimal(translator, assertions, tracked, core, timeout_ms, seed, engine)
    except z3.Z3Exception as error:
        status, model, core, reason = "unknown", None, (), f"Z3: {error}"
    found = Model(translator, model) if model is not None else None
    order = [label for label, _ in tracked if label in core]
    return Answer(status, found, tuple(dict.fromkeys(order)), reason, time.monotonic() - start)


def with_small_numbers(
    translator: Translator, assertions: Iterable[Expr], numbers: Iterable[Expr], answer: Answer, *, seed: int = 0
) -> Answer:
    """The answer, or the same with a model whose numbers are small, if there is one and it is found at once: people
    are to read it, and 21238 looks as if it meant something."""
    numbers = [number for number in numbers if z3.is_arith(number)]
    if answer.model is None or all(map(_is_small, map(answer.model.evaluate, numbers))):
        return answer
    assertions = list(assertions)
    for least, most in ((0, 9), (-9, 9), (-SMALL_NUMBER, SMALL_NUMBER)):
        within = [z3.And(least <= number, number <= most) for number in numbers]
        again = check(translator, [*assertions, *within], timeout_ms=SMALLER_MODEL_MS, seed=seed)
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
    timeout_ms: int,
    seed: int,
    engine: Engine,
) -> tuple[Status, object | None, tuple[str, ...], str]:
    timeout_ms = allowed(timeout_ms)
    if timeout_ms <= 0:
        return "unknown", None, (), "no answer in time"
    if engine == "qsat":
        with limited(translator, timeout_ms):
            return _ask_qsat(translator, assertions, tracked, timeout_ms)
    solver = z3.Solver(ctx=translator.context)
    configured(solver, timeout_ms, seed)
    solver.add(*assertions)
    switches = {}
    for number, (label, expr) in enumerate(tracked):
        switch = z3.Bool(f"track!{number}", translator.context)
        solver.add(z3.Implies(switch, expr))
        switches[switch.get_id()] = (switch, label)
    with limited(translator, timeout_ms):
        result = solver.check(*(switch for switch, _ in switches.values()))
    if result == z3.sat:
        return "sat", solver.model(), (), ""
    if result == z3.unsat:
        return "unsat", None, tuple(switches[s.get_id()][1] for s in solver.unsat_core()), ""
    return "unknown", None, (), _reason(solver)


def configured(solver: z3.Solver, timeout_ms: int, seed: int) -> None:
    """Set a solver's limits and seed."""
    solver.set("timeout", _wall(timeout_ms))
    solver.set("random_seed", seed)
    # Its Gröbner bases of non-linear integer terms cannot be interrupted: Z3 would hang.
    solver.set("smt.arith.nl.grobner", False)


def _reason(solver: z3.Solver) -> str:
    """Why it gave up, for people."""
    reason = str(solver.reason_unknown()).strip("()")
    return "no answer in time" if reason in _IN_TIME else f"the solver gave up: {reason}" if reason else "no answer"


_IN_TIME = ("canceled", "interrupted", "interrupted from keyboard", "timeout", "max. memory exceeded")


@contextlib.contextmanager
def limited(translator: Translator, timeout_ms: int) -> Iterator[None]:
    """What is asked of the translator's context within the block ends with its limit."""
    with watchdog(timeout_ms, translator.context.interrupt) as interrupted:
        yield
    if interrupted.is_set():
        # An interrupt that came too late to end the search would end what is asked of this context next.
        z3.Solver(ctx=translator.context).check()


def _wall(timeout_ms: int) -> int:
    """Z3 counts wall-clock time: its limit is only for where the watchdog cannot help."""
    return max(1, int(timeout_ms)) * WALL_CLOCK * 2


def _ask_qsat(
    translator: Translator, assertions: Sequence[Expr], tracked: Sequence[tuple[str, Expr]], timeout_ms: int
) -> tuple[Status, object | None, tuple[str, ...], str]:
    everything = [*assertions, *(expr for _, expr in tracked)]
    tactic = "nlqsat" if _real_polynomials(everything) else "qsat"
    solver = z3.TryFor(z3.Tactic(tactic, ctx=translator.context), _wall(timeout_ms)).solver()
    solver.add(*everything)
    result = solver.check()
    if result == z3.sat:
        return "sat", solver.model(), (), ""
    if result == z3.unsat and _arithmetic_only(everything):
        return "unsat", None, tuple(label for label, _ in tracked), ""
    return "unknown", None, (), _reason(solver)


def _arithmetic_only(exprs: Iterable[Expr]) -> bool:
    """Whether only numbers and truth values occur: where qsat is complete, and its `unsat` taken."""
    return all(z3.is_bool(e) or z3.is_arith(e) for e in _parts(exprs)) and not any(map(_is_applied, _parts(exprs)))


def _real_polynomials(exprs: Iterable[Expr]) -> bool:
    """Whether only reals and truth values occur, and reals are multiplied: another engine knows about these."""
    parts = list(_parts(exprs))
    plain = all(z3.is_bool(e) or z3.is_real(e) for e in parts) and not any(map(_is_applied, parts))
    divided = any(z3.is_div(e) and not z3.is_rational_value(e.arg(1)) for e in parts)
    return (
        plain and not divided and any(z3.is_mul(e) and sum(not _is_number(a) for a in e.children()) > 1 for e in parts)
    )


def _is_number(expr: Expr) -> bool:
    return bool(z3.is_rational_value(expr))


def _is_applied(expr: Expr) -> bool:
    return bool(z3.is_app(expr) and expr.num_args() and expr.decl().kind() == z3.Z3_OP_UNINTERPRETED)


def _parts(exprs: Iterable[Expr]) -> Iterator[Expr]:
    """Every subexpression once, without quantifiers themselves."""
    seen: set[int] = set()
    stack = list(exprs)
    while stack:
        expr = stack.pop()
        if expr.get_id() in seen:
            continue
        seen.add(expr.get_id())
        if z3.is_quantifier(expr):
            stack.append(expr.body())
        else:
            yield expr
            stack.extend(expr.children())


def _minimal(
    translator: Translator,
    assertions: Sequence[Expr],
    tracked: Sequence[tuple[str, Expr]],
    core: tuple[str, ...],
    timeout_ms: int,
    seed: int,
    engine: Engine,
) -> tuple[str, ...]:
    """Drop what is not needed, one label at a time."""
    kept = list(core)
    for label in core:
        rest = [(name, expr) for name, expr in tracked if name in kept and name != label]
        status, _, smaller, _ = _ask(translator, assertions, rest, min(timeout_ms, 2_000), seed, engine)
        if status == "unsat":
            kept = [name for name in kept if name in smaller]
    return tuple(kept)
