"""Contracts and programs with one small change, most of which make another of them."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

from differential.inputs import COLOURS
from differential.language import Expr, arith, num

Known = Callable[[str], list[Expr]]
"""What of a sort may stand in a value's place."""


def near_miss(tree: Any, rng: random.Random, known: Known) -> Any:
    """The tree with one change, if there is something to change."""
    spots = list(_spots(tree, (), rng, known))
    if not spots:
        return tree
    at, new = rng.choice(spots)
    return _replaced(tree, at, new)


def _spots(tree: Any, at: tuple[int, ...], rng: random.Random, known: Known) -> Iterator[tuple[tuple[int, ...], Any]]:
    if not isinstance(tree, tuple | list):
        return
    if isinstance(tree, tuple) and tree:
        yield from ((at, new) for new in _changes(tree, rng, known))
    for k, part in enumerate(tree):
        yield from _spots(part, (*at, k), rng, known)


def _changes(e: Any, rng: random.Random, known: Known) -> Iterator[Any]:
    match e:
        case ("num", sort, value):
            step = Fraction(1, 8) if sort == "R" and rng.random() < 0.5 else Fraction(1)
            new = value + rng.choice((step, -step))
            if sort != "N" or new >= 0:
                yield ("num", sort, new)
        case ("cmp", sort, comparators, *items) if items[0][1] in "RIN":
            k = rng.randrange(len(comparators))
            swap = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "<=", "!=": ">"}[comparators[k]]
            if len(comparators) == 1 or swap not in {"<=", "<"} or comparators[0][0] == "<":
                yield ("cmp", sort, (*comparators[:k], swap, *comparators[k + 1 :]), *items)
        case ("and", sort, *parts):
            yield ("or", sort, *parts)
            yield parts[0]
        case ("or", sort, *parts):
            yield ("and", sort, *parts)
        case ("-", sort, a, b):
            yield ("-", sort, b, a)
            yield ("+", sort, a, b)
        case ("/", "R", a, b):
            yield ("*", "R", a, b)
        case ("elem", "C", name):
            yield ("elem", "C", rng.choice([c for c in COLOURS if c != name]))
        case ("if", test, then, otherwise):
            yield ("if", test, otherwise, then)
            yield ("if", ("not", "B", test), then, otherwise)
        case ("in", sort, *parts):
            yield ("!in", sort, *parts)
        case ("seq", sort, a, b, *more):
            yield ("seq", sort, b, a, *more)
        case ("var", sort, name):
            others = [v for v in known(sort) if v[2] != name and v[2].startswith("in.")]
            if name.startswith("in.") and others:
                yield rng.choice(others)
        case ("update", name, at, new):
            yield ("update", name, arith("+", at, num(1)), new)


def _replaced(tree: Any, at: tuple[int, ...], new: Any) -> Any:
    if not at:
        return new
    parts = [_replaced(p, at[1:], new) if k == at[0] else p for k, p in enumerate(tree)]
    return tuple(parts) if isinstance(tree, tuple) else parts
