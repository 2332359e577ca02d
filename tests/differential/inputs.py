"""Inputs for a generated contract: at, below and above each of its constants."""

from __future__ import annotations

import random
from collections.abc import Iterator
from fractions import Fraction
from itertools import product
from typing import TYPE_CHECKING, Any

from differential.language import FIELDS, INPUTS, dafny, num
from differential.oracle import Table

if TYPE_CHECKING:
    from differential.contracts import Contract

COLOURS = ("red", "orange", "green")


def literal(found: Any, sort: str) -> str:
    """A value in Dafny."""
    match sort:
        case "R" | "I" | "N":
            return dafny(num(found, sort))
        case "B":
            return "true" if found else "false"
        case "C":
            return f"Types.Colour.{found}"
        case "D":
            parts = ", ".join(literal(a, s) for a, s in zip(found[1:], FIELDS[found[0]], strict=True))
            return f"Types.Command.{found[0]}" + (f"({parts})" if parts else "")
        case "S":
            return f"[{', '.join(map(str, found))}]"
        case "P":
            return f"({found[0]}, Types.Colour.{found[1]})"
    text = literal(found.default, "B" if sort == "M" else "I")
    for at, value in found.items():
        text = f"if z == {at} then {literal(value, 'B' if sort == 'M' else 'I')} else {text}"
    return f"((z: nat) => {text})"


def constants(tree: Any) -> Iterator[Fraction]:
    if isinstance(tree, tuple) and len(tree) == 3 and tree[0] == "num":
        yield tree[2]
    elif isinstance(tree, tuple | list):
        for part in tree:
            yield from constants(part)


def grid(made: Contract, rng: random.Random, most: int = 700) -> list[dict[str, Any]]:
    """Inputs at, below and above every constant; all of them where they are few, else so many of them."""
    found = sorted(
        {Fraction(0), Fraction(1), *constants([made.program, *made.assumptions.values(), *made.guarantees.values()])}
    )
    whole = sorted({int(c) + d for c in found for d in (-1, 0, 1)} | {7, -5})
    reals = sorted(
        {c + d for c in found for d in (Fraction(-1, 8), 0, Fraction(1, 8))} | {Fraction(100), Fraction(-9, 2)}
    )
    naturals = [n for n in whole if n >= 0]
    few = [0, 1, *rng.sample(whole, min(3, len(whole)))]
    moves = [("move", Fraction(x), n) for x in rng.sample(reals, 2) for n in (0, 2)]
    pools: dict[str, list[Any]] = {
        "R": reals, "I": whole, "N": naturals, "B": [True, False], "C": list(COLOURS),
        "D": [("halt",), *(("mark", n) for n in naturals[:4]), *moves],
        "M": [Table(dict.fromkeys(points, True), False) for points in ((), (0,), (1,), (0, 2), tuple(naturals))],
        "L": [Table({}, 0), Table({0: 2, 1: -1}, 3), *(Table({rng.choice(naturals): n}, 1) for n in few)],
        "S": [(), (0,), (1, 2), (3, 0, 1), *((n,) for n in few), (few[-1], few[-2], 0)],
        "P": [(n, c) for n in few for c in COLOURS],
    }  # fmt: skip
    wanted = [pools[INPUTS[n]] for n in made.inputs]
    size = 1
    for pool in wanted:
        size *= len(pool)
    names = [f"in.{n}" for n in made.inputs]
    if size <= most:
        return [dict(zip(names, case, strict=True)) for case in product(*wanted)]
    return [{n: rng.choice(pool) for n, pool in zip(names, wanted, strict=True)} for _ in range(most)]
