"""Solving ``pattern == value`` for the variables of the pattern: ``move(x, y)``, ``i + 1``, ``(x, 3)``."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from avow.evaluation.compiler import Compiler, Env, NotEvaluable, member_of
from avow.formulas import values
from avow.formulas.renaming import bound_names
from avow.formulas.values import Data
from avow.language.enclosures import Irrational
from avow.language.roots import quotient
from avow.language.sorts import IntegerSort, NaturalSort
from avow.language.terms import Arithmetic, Construct, Negative, SequenceTerm, Term, TupleTerm, Variable, Widen

Match = Callable[[Env, Any], bool]
"""Whether the value matches the pattern; if so, binds the pattern's variables."""


def pattern(compiler: Compiler, term: Term, unbound: set[str]) -> Match | None:
    """How to match a value, or None if the term has no unique inverse. Removes names that it binds from `unbound`."""
    open_names = bound_names(term) & unbound
    if not open_names:
        code = compiler.code(term)
        return lambda env, value: bool(code(env) == value)
    match term:
        case Variable():
            return _variable(compiler, term, unbound)
        case Construct(constructor=constructor, arguments=arguments):
            inner = patterns(compiler, arguments, unbound)
            if inner is None:
                return None
            several = inner
            return lambda env, value: (
                isinstance(value, Data) and value.constructor == constructor and several(env, value.arguments)
            )
        case TupleTerm(items=items):
            return patterns(compiler, items, unbound)
        case SequenceTerm(items=items):
            inner = patterns(compiler, items, unbound)
            if inner is None:
                return None
            several, size = inner, len(items)
            return lambda env, value: (
                isinstance(value, values.SequenceValue) and len(value.items) == size and several(env, value.items)
            )
        case Widen(term=inside):
            narrow = pattern(compiler, inside, unbound)
            if narrow is None:
                return None
            whole = narrow

            def of_whole(env: Env, value: Any) -> bool:
                if isinstance(value, Irrational):
                    below: Any = math.floor(value)
                    return bool(value == below)  # which is false, or cannot be told
                return value.denominator == 1 and whole(env, int(value))

            return of_whole
        case Negative(term=inside):
            positive = pattern(compiler, inside, unbound)
            if positive is None:
                return None
            plain = positive
            return lambda env, value: plain(env, -value)
        case Arithmetic():
            return _arithmetic(compiler, term, unbound)
        case _:  # no unique inverse: it binds nothing
            return None


def patterns(compiler: Compiler, terms: Sequence[Term], unbound: set[str]) -> Match | None:
    """Match a tuple against several patterns; one that binds a variable precedes one that uses it."""
    left = list(enumerate(terms))
    order: list[tuple[int, Match]] = []
    free = set(unbound)
    while left:
        for position, (at, term) in enumerate(left):
            trial = set(free)
            found = pattern(compiler, term, trial)
            if found is not None:
                free = trial
                order.append((at, found))
                del left[position]
                break
        else:
            return None
    unbound &= free
    steps = tuple(order)
    if len(steps) == 1:
        only = steps[0][1]
        return lambda env, value: only(env, value[0])

    def match(env: Env, value: Any) -> bool:
        return all(each(env, value[at]) for at, each in steps)

    return match


def _variable(compiler: Compiler, variable: Variable, unbound: set[str]) -> Match:
    slot = compiler.bind(variable)
    unbound.discard(variable.name)
    belongs = member_of(variable.sort, compiler.domains)
    if belongs is None:

        def bind(env: Env, value: Any) -> bool:
            env[slot] = value
            return True

        return bind
    test = belongs

    def bind_within(env: Env, value: Any) -> bool:
        if not test(value):
            return False
        env[slot] = value
        return True

    return bind_within


def _arithmetic(compiler: Compiler, term: Arithmetic, unbound: set[str]) -> Match | None:
    on_left = bool(bound_names(term.left) & unbound)
    if on_left and bound_names(term.right) & unbound:
        return None
    unknown, known = (term.left, term.right) if on_left else (term.right, term.left)
    operator = term.operator
    if operator == "/" and not on_left:
        return None
    inner = pattern(compiler, unknown, unbound)
    if inner is None:
        return None
    match_inner, other = inner, compiler.code(known)
    whole = isinstance(term.sort, IntegerSort | NaturalSort)

    def match(env: Env, value: Any) -> bool:
        fixed = other(env)
        match operator:
            case "+":
                return match_inner(env, value - fixed)
            case "-":
                return match_inner(env, value + fixed if on_left else fixed - value)
            case "/":
                if fixed == 0:
                    raise NotEvaluable("division by zero")
                return match_inner(env, value * fixed)
            case _:  # *
                if fixed == 0:
                    if value == 0:
                        raise NotEvaluable("a product with zero leaves its other factor open")
                    return False
                if whole:
                    return value % fixed == 0 and match_inner(env, value // fixed)
                return match_inner(env, quotient(value, fixed))

    return match
