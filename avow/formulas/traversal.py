"""Walking terms of any depth.

Contracts are data from outside: a formula nested ten thousand deep must not end in a RecursionError. A recursive
function is written as a generator that *yields* its recursive calls and returns its result; `run` keeps the stack.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, TypeVar

from avow.language.terms import (
    And,
    Apply,
    Arithmetic,
    Compare,
    Construct,
    EnumValue,
    Iff,
    Implies,
    In,
    Index,
    Length,
    Literal,
    Negative,
    Not,
    Or,
    Quantified,
    SequenceRange,
    SequenceTerm,
    SetTerm,
    Term,
    TupleTerm,
    Variable,
    Widen,
    children,
)
from avow.language.terms import subterms as subterms

T = TypeVar("T")

Steps = Generator[Any, Any, T]
"""A recursive computation of a T that yields the `Steps` of its recursive calls and is sent their results."""


def run(steps: Steps[T]) -> T:
    """The result of a recursive computation, whatever its depth."""
    stack: list[Steps[Any]] = [steps]
    value: Any = None
    while stack:
        try:
            call = stack[-1].send(value)
        except StopIteration as done:
            stack.pop()
            value = done.value
        else:
            stack.append(call)
            value = None
    result: T = value
    return result


def depth(term: Term) -> int:
    """Levels of nesting; an atom has 1."""
    deepest = 0
    stack = [(term, 1)]
    while stack:
        current, level = stack.pop()
        deepest = max(deepest, level)
        stack.extend((child, level + 1) for child in children(current))
    return deepest


def rebuild(term: Term, parts: tuple[Term, ...]) -> Term:
    """The term with other direct subterms, given in the order of `children`."""
    match term:
        case Literal() | EnumValue() | Variable():
            return term
        case Construct():
            return Construct(term.constructor, parts, term.sort, term.span)
        case Apply():
            return Apply(parts[0], parts[1:], term.sort, term.span)
        case Index():
            return Index(parts[0], parts[1], term.sort, term.span)
        case Length():
            return Length(parts[0], term.sort, term.span)
        case Widen():
            return Widen(parts[0], term.sort, term.span)
        case Negative():
            return Negative(parts[0], term.sort, term.span)
        case Arithmetic():
            return Arithmetic(term.operator, parts[0], parts[1], term.sort, term.span)
        case Compare():
            return Compare(term.operator, parts[0], parts[1], term.span)
        case Implies():
            return Implies(parts[0], parts[1], term.span)
        case Iff():
            return Iff(parts[0], parts[1], term.span)
        case TupleTerm():
            return TupleTerm(parts, term.sort, term.span)
        case SequenceTerm():
            return SequenceTerm(parts, term.sort, term.span)
        case SetTerm():
            return SetTerm(parts, term.sort, term.span)
        case And():
            return And(parts, term.span)
        case Or():
            return Or(parts, term.span)
        case SequenceRange():
            return SequenceRange(parts[0], parts[1], term.sort, term.span)
        case In():
            return In(parts[0], parts[1], term.span)
        case Not():
            return Not(parts[0], term.span)
        case Quantified():
            return Quantified(term.quantifier, term.variables, parts[0], term.span)


def transform(term: Term, function: Callable[[Term], Term]) -> Term:
    """Rebuild from the leaves up, `function` applied to every rebuilt subterm.

    It knows nothing of scopes: a function that touches variables has to tell free from bound ones itself.
    """

    def steps(current: Term) -> Steps[Term]:
        parts: list[Term] = []
        for child in children(current):
            part: Term = yield steps(child)
            parts.append(part)
        return function(rebuild(current, tuple(parts)) if parts else current)

    return run(steps(term))
