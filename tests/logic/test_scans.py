"""What a contract says of a whole scan: the least of it, the nearest, whether it is sorted; and brute force on short
scans against what is said of generated contracts."""

from __future__ import annotations

import random
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise, product
from typing import Any

import pytest
from helpers import some
from reference.meaning import holds

from avow.base.verdict import Verdict
from avow.evaluation.evaluate import compile_term
from avow.formulas.formula import conjunction, free_variables
from avow.formulas.values import SequenceValue
from avow.language import terms as t
from avow.language.contract import Node
from avow.language.load import parse_formula
from avow.language.printer import show_term
from avow.language.sorts import NATURAL, REAL
from avow.sanity import witness_candidates, witness_search
from avow.sanity.extremes import Extreme, bounded, measures
from avow.sanity.realizability import realizable
from avow.sanity.witness_candidates import Candidates
from avow.sanity.witness_search import Realizability

from .contracts import node

ALL, ANY = "forall(i in indices(s) | {})", "exists(i in indices(s) | {})"
LEAST = (ALL.format("m <= s(i)"), ANY.format("m == s(i)"))
GREATEST = (ALL.format("k >= s(i)"), ANY.format("k == s(i)"))
SORTED = "forall(i, j in indices(s) | i < j -> s(i) <= s(j))"
SOME = "length(s) > 0"
NEAR = ANY.format("s(i) < t")

KNOWN: list[tuple[str, str, tuple[str, ...], bool]] = [
    ("the least", SOME, LEAST, True),
    ("the least of nothing", "TRUE", LEAST, False),
    ("the least, by what there is not", SOME, ("not " + ANY.format("m > s(i)"), LEAST[1]), True),
    ("the least, or 10", "TRUE", ("length(s) == 0 -> m == 10", f"{SOME} -> {LEAST[0]} and {LEAST[1]}"), True),
    ("the least, by NATURAL", SOME, ("forall(i in NATURAL | i < length(s) -> m <= s(i))", LEAST[1]), True),
    ("the least of the near", NEAR, (ALL.format("s(i) < t -> m <= s(i)"), ANY.format("s(i) < t and m == s(i)")), True),
    ("less than all, and one of them", SOME, (ALL.format("m < s(i)"), LEAST[1]), False),
    ("less than all", "TRUE", (ALL.format("m < s(i)"),), True),
    ("the least with a margin", SOME, (ALL.format("m <= s(i) - t"), ANY.format("m + t == s(i)")), True),
    ("the least within its bounds", ALL.format("0 <= s(i) <= 30") + f" and {SOME}", (*LEAST, "0 <= m <= 30"), True),
    ("the least, and more", ALL.format("0 <= s(i) <= 30") + f" and {SOME}", (*LEAST, "0 < m"), False),
    ("the greatest", SOME, GREATEST, True),
    ("the range", SOME, (*LEAST, *GREATEST, "w == k - m"), True),
    ("between least and greatest", SOME, (*LEAST, *GREATEST, "m < w < k"), False),
    ("where the least is", SOME, ("at < length(s)", ALL.format("s(at) <= s(i)")), True),
    ("the first least", SOME, ("at < length(s)", ALL.format("s(at) <= s(i) and (i < at -> s(at) < s(i))")), True),
    ("the last least", SOME, ("at < length(s)", ALL.format("s(at) <= s(i) and (i > at -> s(at) < s(i))")), True),
    ("the only least", SOME, ("at < length(s)", ALL.format("i != at -> s(at) < s(i)")), False),
    ("the least and where", SOME, (LEAST[0], "at < length(s) and s(at) == m"), True),
    ("the first near", NEAR, ("at < length(s)", "s(at) < t", ALL.format("i < at -> s(i) >= t")), True),
    ("the last near", NEAR, ("at < length(s)", "s(at) < t", ALL.format("i > at -> s(i) >= t")), True),
    ("the closest", SOME, ("at < length(s)", ALL.format("abs(s(at) - t) <= abs(s(i) - t)")), True),
    ("all are far", "TRUE", ("b <=> " + ALL.format("s(i) > t"),), True),
    ("one is near", "TRUE", ("b <=> " + ANY.format("s(i) < t"),), True),
    ("it is sorted", "TRUE", (f"b <=> {SORTED}",), True),
    ("sorted: the first", f"{SOME} and {SORTED}", ("m == s(0)", LEAST[0]), True),
    ("not sorted: the first", SOME, ("m == s(0)", LEAST[0]), False),
]  # fmt: skip


def scan(assumption: str, guarantees: tuple[str, ...]) -> Node:
    return node(
        "inputs( s : <REAL>, t : REAL ) outputs( m : REAL, k : REAL, w : REAL, at : NATURAL, b : BOOL ) | "
        f"assume( {assumption} ) " + " ".join(f"guarantee( {g} )" for g in guarantees)
    )


def asked(about: Node, effort: int) -> Realizability:
    return realizable(
        [port.variable for port in about.inputs],
        [port.variable for port in about.outputs],
        {clause.name: clause.formula for clause in about.assumptions},
        {clause.name: clause.formula for clause in about.guarantees},
        effort=effort,
    )


@pytest.mark.parametrize(("name", "assumption", "guarantees", "good"), some(KNOWN, 1, slow=5))
def test_it_is_said_of_a_scan(name: str, assumption: str, guarantees: tuple[str, ...], good: bool) -> None:
    answer = asked(scan(assumption, guarantees), 4_000)
    assert answer.verdict is (Verdict.PROVED if good else Verdict.REFUTED), name


# -- brute force -------------------------------------------------------------------------------------------------------


OPEN = {83, 106, 107, 129, 279}
"""Contracts that are realizable, and not found to be: their outputs hang together by more than an extreme."""


def random_scan(rng: random.Random) -> Node:
    """A contract that says of each or some element of a scan how it and two outputs compare."""

    def atom() -> str:
        left, right = rng.choice((("m", "s(i)"), ("k", "s(i)"), ("s(i)", "m"), ("m", "1"), ("s(i)", "1"), ("m", "k")))
        return f"{left} {rng.choice(('<', '<=', '==', '>=', '>'))} {right}"

    def demand() -> str:
        form, join = rng.choice(((ALL, "->"), (ALL, "or"), (ALL, "->"), (ANY, "and"), (ANY, "and")))
        parts = [atom() for _ in range(rng.choice((1, 1, 1, 2, 2, 3)))]
        whole = form.format(f" {join} ".join(parts))
        return f"{atom()} -> {whole}".replace("s(i)", "k", 1) if rng.random() < 0.1 else whole

    assumption = rng.choice((SOME, SOME, "TRUE", ANY.format("s(i) < 1"), ALL.format("s(i) > 0")))
    clauses = " ".join(f"guarantee( {demand()} )" for _ in range(rng.randint(1, 4)))
    return node(f"inputs( s : <REAL> ) outputs( m : REAL, k : REAL ) | assume( {assumption} ) {clauses}")


SCANS = [SequenceValue(items) for length in range(4) for items in product(map(Fraction, range(3)), repeat=length)]


def allowed(about: Node, scan: SequenceValue) -> bool:
    return all(holds(clause.formula, {"in.s": scan.items}) for clause in about.assumptions)


def has_output(about: Node, scan: SequenceValue) -> bool:
    """Whether some outputs do. They are compared with the elements, 1, and one another: so it is enough to try these
    numbers, and two numbers between each, below and above all."""
    edges = sorted({*map(Fraction, scan.items), Fraction(1)})
    gaps = [(a + (b - a) * part / 3) for a, b in pairwise(edges) for part in (1, 2)]
    values = (*edges, *gaps, edges[0] - 1, edges[0] - 2, edges[-1] + 1, edges[-1] + 2)
    whole = conjunction(clause.formula for clause in about.guarantees)
    return any(holds(whole, {"in.s": scan.items, "out.m": m, "out.k": k}) for m, k in product(values, repeat=2))


@pytest.mark.parametrize("seed", some(range(400), 3, slow=3))
def test_brute_force_agrees(seed: int) -> None:
    about = random_scan(random.Random(seed))
    answer = asked(about, 2_000)
    stuck = [scan for scan in SCANS if allowed(about, scan) and not has_output(about, scan)]
    if answer.verdict is Verdict.REFUTED:
        (scan,) = answer.inputs.values() or (SequenceValue(()),)
        assert isinstance(scan, SequenceValue)
        assert allowed(about, scan)
        assert not has_output(about, scan)
    else:
        assert answer.verdict is (Verdict.UNKNOWN if stuck or seed in OPEN else Verdict.PROVED), stuck


# -- what it rests on --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(20))
def test_the_best_position_exists_and_is_one(seed: int) -> None:
    """Of each short scan exactly one position meets the axiom, where a position meets the guard."""
    rng = random.Random(seed)
    last, greatest = rng.random() < 0.5, rng.random() < 0.5
    s, i, c = node("inputs( s : <REAL> ) outputs( b : BOOL ) | guarantee( b )").inputs[0].variable, POSITION, CONSTANT
    element = t.Index(s, i, REAL)
    near = t.Compare(rng.choice(("<", "==")), element, t.Literal(Fraction(rng.randrange(3)), REAL))
    guard = t.And((t.Compare("<", i, t.Length(s, NATURAL)), *rng.choice(((), (near,)))))
    choice = Extreme(c, i, guard, element, greatest, last)
    meets = compile_term(choice.axiom())
    for scan in SCANS:
        places = [k for k in range(len(scan.items)) if holds(guard, {"in.s": scan.items, i.qualified: k})]
        good = [k for k in range(len(scan.items)) if meets({"in.s": scan, c.qualified: k})]
        best = sorted(places, key=lambda k: (scan.items[k] * (-1 if greatest else 1), -k if last else k))
        assert good == (best[:1] if places else list(range(len(scan.items))))


POSITION, CONSTANT = t.Variable(t.Role.BOUND, "i", NATURAL), t.Variable(t.Role.BOUND, "c", NATURAL)


def inside(text: str, sort: str = "NATURAL") -> tuple[t.Variable, t.Term]:
    """The position i, and what is said of it."""
    ports = node("inputs( s : <REAL>, k : NATURAL, t : REAL ) outputs( m : REAL, at : NATURAL ) | guarantee( TRUE )")
    whole = parse_formula(f"exists(i in {sort}, j in NATURAL | {text})", ports)
    assert isinstance(whole, t.Quantified)
    return whole.variables[0], whole.body


@pytest.mark.parametrize(
    ("guard", "finite"),
    [
        *((f"i {sign} k + 1", sign in ("<", "<=")) for sign in ("<", "<=", ">", ">=", "!=")),
        *((f"k + 1 {sign} i", sign in (">", ">=")) for sign in ("<", "<=", ">", ">=", "!=")),
        *((f"not (i {sign} k + 1)", sign in (">", ">=")) for sign in ("<", "<=", ">", ">=", "==")),
        *((f"not (k + 1 {sign} i)", sign in ("<", "<=")) for sign in ("<", "<=", ">", ">=", "==")),
        ("i in indices(s)", True),
        ("i in <0 upto k>", True),
        ("i in <1, k>", True),
        ("k > 0 and (t < 1 or t > 3) and i < 3", True),
        ("k > 0 or i < 3", False),
        ("j < 3", False),
        ("not (j > 3)", False),
        ("j in <0 upto 3> and i > j", False),
        ("i in <0 upto i>", False),
        ("i < i + 1", False),
        ("not (i > i + k)", False),
    ],
)
def test_a_guard_is_met_by_finitely_many_positions_if_it_bounds_them(guard: str, finite: bool) -> None:
    assert bounded(*inside(guard)) is finite


def test_of_all_whole_numbers_below_one_none_is_the_least() -> None:
    position, guard = inside("i < 3", "INTEGER")
    assert not bounded(position, guard)
    assert not Extreme(replace(CONSTANT, sort=position.sort), position, guard, position, True, False).exists(
        frozenset()
    )


@pytest.mark.parametrize(
    ("demand", "found"),
    [
        ("m <= s(i)", [("in.s(i)", False, False)]),
        ("m >= s(i)", [("in.s(i)", True, False)]),
        ("s(i) > m", [("in.s(i)", False, False)]),
        ("not (m > s(i))", [("in.s(i)", False, False)]),
        ("m <= t - s(i)", [("in.t - in.s(i)", False, False)]),
        ("m - s(i) <= t", [("in.s(i)", False, False)]),
        ("-(m + s(i)) < t", [("in.s(i)", False, False)]),
        ("m <= -s(i)", [("-in.s(i)", False, False)]),
        ("m + s(i) < t", [("in.s(i)", True, False)]),
        ("s(i) - m < t", [("in.s(i)", True, False)]),
        ("m == s(i)", []),
        ("t <= s(i)", []),
        ("m <= t", []),
        ("m <= s(i) and at >= i", [("in.s(i)", False, True), ("i", True, True)]),
        ("m <= s(i) and at <= i", [("in.s(i)", False, False), ("i", False, False)]),
    ],
)
def test_a_demand_suggests_what_decides_it(demand: str, found: list[tuple[str, bool, bool]]) -> None:
    position, said = inside(demand)
    outputs = frozenset(v for v in free_variables(said) if v.role is t.Role.OUTPUT)
    suggested = measures(position, said, outputs)
    assert [(show_term(term, "rcl"), greatest, last) for term, greatest, last in suggested] == found


def test_an_endless_guard_has_no_best() -> None:
    """Of the numbers above 3 none is the greatest."""
    above = t.Compare(">", POSITION, t.Literal(3, NATURAL))
    assert not bounded(POSITION, above)
    assert not bounded(POSITION, t.Compare("<", POSITION, t.Arithmetic("+", POSITION, t.Literal(1, NATURAL), NATURAL)))
    endless = Extreme(CONSTANT, POSITION, above, POSITION, True, False)
    assert not endless.exists(frozenset())


def test_a_constant_is_chosen_once() -> None:
    bound = t.Compare("<", POSITION, t.Literal(3, NATURAL))
    choice = Extreme(CONSTANT, POSITION, bound, POSITION, True, False)
    assert choice.exists(frozenset())
    assert not choice.exists({CONSTANT})
    assert not replace(choice, guard=t.And((bound, t.Compare("<", CONSTANT, POSITION)))).exists(frozenset())


def test_another_axiom_than_that_of_the_choice_proves_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """An axiom by which the best of an empty scan lies in it makes everything true of the empty scan."""
    honest = Extreme.axiom
    about = scan("TRUE", LEAST)

    def bold(self: Extreme) -> t.Term:
        whole = honest(self)
        assert isinstance(whole, t.Implies)
        return whole.right

    found = witness_candidates.candidates

    def seeded(*given: Any) -> Candidates:
        drawn = found(*given)
        drawn.axioms[:] = [bold(drawn.extremes[axiom]) if axiom in drawn.extremes else axiom for axiom in drawn.axioms]
        return drawn

    for quicker in ("_direct", "_refute"):
        monkeypatch.setattr(witness_search.Search, quicker, lambda *_: None)
    assert asked(scan(SOME, LEAST), 2_000).verdict is Verdict.PROVED
    monkeypatch.setattr(witness_search, "candidates", seeded)
    assert asked(about, 2_000).verdict is not Verdict.PROVED
