"""Random clauses that speak of other steps, of the node ``in.a``, ``in.n`` -> ``out.b`` (with limits in seconds: of
``in.a``, ``in.x`` -> ``out.b``), and runs of it."""

from __future__ import annotations

import random
from fractions import Fraction

from reference.meaning import Step, Word

from avow.formulas.formula import free_variables, substitute
from avow.language.load import parse_formula
from avow.language.sorts import NATURAL as NATURAL_SORT
from avow.language.terms import History, Implies, Literal, Term

from .formulas import BOOL, NATURAL, REAL, Formulas, Knobs, Names, node_of

NODE = node_of({"a": BOOL, "n": NATURAL}, {"b": BOOL})
TIMED_NODE = node_of({"a": BOOL, "x": REAL}, {"b": BOOL})
A, N = (port.variable for port in NODE.inputs)
X = TIMED_NODE.inputs[1].variable
B = NODE.outputs[0].variable
NAMES: Names = {"in.a": BOOL, "out.b": BOOL, "in.n": NATURAL}
TIMED_NAMES: Names = {"in.a": BOOL, "out.b": BOOL, "in.x": REAL}
_PAST = Knobs(
    ("not", "and", "or", "->", "<=>"), 0.0, 0.0, 0.6, terms=0, arithmetic=False, builtin=False, partial=False
)  # fmt: skip
_TIMED = Knobs(_PAST.connectives, 0.0, 0.0, 0.7, True, terms=0, arithmetic=False, builtin=False, partial=False)


def formula(rng: random.Random, depth: int) -> Term:
    return parse_formula(Formulas(rng, _PAST).formula(depth, NAMES), NODE, remembers=True)


def timed_formula(rng: random.Random, depth: int) -> Term:
    return parse_formula(Formulas(rng, _TIMED).formula(depth, TIMED_NAMES), TIMED_NODE, remembers=True)


def response(rng: random.Random) -> tuple[Term, History]:
    """A trigger, which may speak of the past, and a response to it."""
    return _parts(parse_formula(Formulas(rng, _PAST).response(1, NAMES), NODE, remembers=True, clause=True))


def timed_response(rng: random.Random, depth: int) -> tuple[Term, History]:
    return _parts(
        parse_formula(Formulas(rng, _TIMED).response(depth, TIMED_NAMES), TIMED_NODE, remembers=True, clause=True)
    )


def _parts(term: Term) -> tuple[Term, History]:
    assert isinstance(term, Implies)
    assert isinstance(term.right, History)
    return term.left, term.right


def clause(rng: random.Random) -> Term:
    """A clause with few states, which speaks of a port, and of no number."""
    while True:
        found = Implies(*response(rng)) if rng.random() < 0.5 else formula(rng, rng.randrange(1, 3))
        found = substitute(found, {N: Literal(1, NATURAL_SORT)})
        if free_variables(found):
            return found


def run_of(rng: random.Random, length: int = 9) -> list[Step]:
    return [{"in.a": rng.random() < 0.6, "out.b": rng.random() < 0.5, "in.n": rng.randrange(4)} for _ in range(length)]


def word_of(rng: random.Random, length: int = 7) -> Word:
    steps = [
        {"in.a": rng.random() < 0.6, "out.b": rng.random() < 0.5, "in.x": Fraction(rng.randrange(4)),
         "in.arrived a": rng.random() < 0.5}
        for _ in range(length)
    ]  # fmt: skip
    times = [0]
    for _ in range(length - 1):
        times.append(times[-1] + rng.choice((0, 1, 1, 2, 3)))
    return Word(steps, times)
