"""Chains of operators as typed terms that are never deep, however long the chain.

``a + b + c`` is ``(a + b) + c`` and ``a -> b -> c`` is ``a -> (b -> c)``, as everywhere. A chain of thousands so made
would be a tree thousands of levels deep, on which Python's recursion (equality, hashing, every later pass) ends. A
chain of more than `CHAIN` operators therefore becomes the term of an equivalent text with parentheses. The laws used
are exact for booleans, integers and reals alike:

    a -> b -> c      is  (a and b) -> c
    a <=> b <=> c    is  a <=> (b <=> c)
    a + b - c + d    is  (a + b) - (c - d)
    a * b * c        is  a * (b * c)            but nothing of this kind holds of `/`

The result, printed and read again, is the same term: what prints without parentheses is the left spine, which is short.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

from avow.base.diagnostics import Span
from avow.base.tuning.bounds import CHAIN, CHAIN_BLOCK
from avow.language.conversions import widen
from avow.language.sorts import INTEGER, NATURAL, REAL
from avow.language.terms import And, Arithmetic, Iff, Implies, Term, Widen

_Place = Callable[[int, int], Span]
_Item = TypeVar("_Item")


def implication(parts: Sequence[Term], span: _Place) -> Term:
    """``p -> q -> r``; `span(i, k)` is the place of the parts from i to k."""
    last = len(parts) - 1
    *conditions, conclusion = parts
    inner = parts[-1]
    while isinstance(inner, Implies):  # it prints without parentheses, so it counts
        conditions.append(inner.left)
        inner = inner.right
    if len(conditions) > CHAIN:
        return Implies(And(tuple(conditions), span(0, last)), inner, span(0, last))
    result = conclusion
    for i in range(last - 1, -1, -1):
        result = Implies(parts[i], result, span(i, last))
    return result


def equivalence(parts: Sequence[Term], span: _Place) -> Term:
    """``p <=> q <=> r``."""
    chain: list[Term] = []
    inner = parts[0]
    while isinstance(inner, Iff):
        chain.append(inner.right)
        inner = inner.left
    chain = [inner, *reversed(chain), *parts[1:]]
    if len(chain) - 1 <= CHAIN:
        result = parts[0]
        for i, part in enumerate(parts[1:], 1):
            result = Iff(result, part, span(0, i))
        return result
    whole = span(0, len(parts) - 1)
    while len(chain) > 1:
        chain = [functools.reduce(lambda left, right: Iff(left, right, whole), block) for block in _blocks(chain)]
    return chain[0]


def arithmetic(operators: Sequence[str], operands: Sequence[Term], span: _Place) -> Term | None:
    """``a + b - c`` or ``a * b / c``, of numeric terms; None where it divides so often that it stays deep."""
    chain = [*_spine(operands[0], operators[0]), *zip(operators, operands[1:], strict=True)]
    if len(chain) - 1 <= CHAIN:
        result = operands[0]
        for i, (operator, operand) in enumerate(zip(operators, operands[1:], strict=True), 1):
            result = _combine(operator, result, operand, span(0, i))
        return result
    whole = span(0, len(operands) - 1)
    while len(chain) > CHAIN_BLOCK:
        shorter = _shorter_sum(chain, whole) if operators[0] in "+-" else _shorter_product(chain, whole)
        if len(shorter) == len(chain):
            break
        chain = shorter
    return None if len(chain) - 1 > CHAIN else _fold(chain, whole)


_Link = tuple[str, Term]
"""An operator and its right operand; the first of a chain has the operator that changes nothing."""


def _fold(chain: Sequence[_Link], span: Span) -> Term:
    result = chain[0][1]
    for operator, operand in chain[1:]:
        result = _combine(operator, result, operand, span)
    return result


def _combine(operator: str, left: Term, right: Term, span: Span) -> Arithmetic:
    if operator == "/" or REAL in (left.sort, right.sort):
        return Arithmetic(operator, widen(left), widen(right), REAL, span)
    natural = left.sort == NATURAL and right.sort == NATURAL and operator != "-"
    return Arithmetic(operator, left, right, NATURAL if natural else INTEGER, span)


def _spine(term: Term, operator: str) -> list[_Link]:
    """What stands without parentheses at the left of the chain that the term begins, when it is printed."""
    family = "+-" if operator in ("+", "-") else "*/"
    found: list[_Link] = []
    while True:
        inner = term.term if isinstance(term, Widen) else term
        if not (isinstance(inner, Arithmetic) and inner.operator in family):
            return [(family[0], term), *reversed(found)]
        found.append((inner.operator, inner.right))
        term = inner.left


def _shorter_sum(chain: Sequence[_Link], span: Span) -> list[_Link]:
    """The chain with each few neighbours put together. A minus before them turns the signs within."""
    made: list[_Link] = []
    for block in _blocks(chain):
        sign = block[0][0]
        turned = [(s if sign == "+" else "-" if s == "+" else "+", term) for s, term in block]
        made.append((sign, _fold(turned, span)))
    return made


def _shorter_product(chain: Sequence[_Link], span: Span) -> list[_Link]:
    """The chain with each few neighbours that are multiplied put together: ``x / d * e * f`` is ``x / d * (e * f)``."""
    made: list[_Link] = []
    run: list[_Link] = []
    for link in (*chain, ("/", chain[0][1])):
        if link[0] == "*":
            run.append(link)
            continue
        made += [("*", _fold(block, span)) for block in _blocks(run)]
        run = []
        made.append(link)
    return made[:-1]


def _blocks(items: Sequence[_Item]) -> Iterable[Sequence[_Item]]:
    return (items[i : i + CHAIN_BLOCK] for i in range(0, len(items), CHAIN_BLOCK))
