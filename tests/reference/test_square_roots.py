"""Square roots: their arithmetic against long decimals, and what engines make of formulas with them against the
reference, which computes roots otherwise."""

from __future__ import annotations

import math
import operator
import random
from collections import Counter
from collections.abc import Iterator
from decimal import Decimal, localcontext
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from drawn.formulas import NATURAL, REAL, Formulas, Knobs, Type
from helpers import avow, some

from avow.backends.dafny.modules import generate
from avow.backends.rosmonitoring.judged import _compiled
from avow.base.verdict import Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, negation
from avow.formulas.values import SequenceValue
from avow.kernel.solvers import Reply, ask_z3
from avow.kernel.text import Text, Untranslatable
from avow.language import terms as t
from avow.language.contract import Node
from avow.language.definedness import demanded
from avow.language.enclosures import Enclosed, Number
from avow.language.load import check_text, parse_formula
from avow.language.printer import show_term
from avow.language.roots import Surd, quotient, root
from avow.language.subterms import subterms
from avow.solving.questions import entails, solve

from .meaning import Meaning

NODE = """node n {{ inputs( x, y : REAL, k : NATURAL, s : <REAL>, speed : REAL in m/s )
outputs( z : REAL, d : REAL in m ) topics() {} }}"""


def node(guarantees: str = "guarantee( z == 0 )") -> Node:
    contract, found = check_text(NODE.format(guarantees), "n.rcl")
    assert contract is not None, found
    return contract.nodes[0]


def claim(text: str) -> t.Term:
    """With the condition that it has a value."""
    return node(f"guarantee( {text} )").guarantees[0].formula


# -- numbers -----------------------------------------------------------------------------------------------------------


def decimal(number: Number) -> Decimal:
    summands = number.summands if isinstance(number, Surd) else [Fraction(number) * abs(Fraction(number))]
    roots = ((Decimal(abs(q).numerator) / Decimal(q.denominator)).sqrt() for q in summands)
    return sum((r if q > 0 else -r for q, r in zip(summands, roots, strict=True)), Decimal(0))


def some_number(source: random.Random, depth: int) -> Number:
    if depth == 0:
        small = Fraction(source.randint(0, 9), source.randint(1, 4))
        return source.choice((small, -small, root(small)))
    one, other = some_number(source, depth - 1), some_number(source, depth - 1)
    sign = source.choice("+-*/am")
    if sign == "/" and other == 0:
        return one
    acts = {"+": operator.add, "-": operator.sub, "*": operator.mul, "/": quotient, "m": max}
    found = root(abs(one)) if sign == "a" else acts[sign](one, other)
    return one if isinstance(found, Enclosed) else found  # of those `test_angles` has its own tests


def test_arithmetic_and_order_are_exact() -> None:
    source, surds = random.Random(1), 0
    tiny = Decimal(10) ** -80
    with localcontext() as context:
        context.prec = 120
        for _ in range(3_000):
            a, b = some_number(source, 2), some_number(source, 2)
            difference = decimal(a) - decimal(b)
            same = abs(difference) < tiny
            assert (a == b, a != b) == (same, not same)
            assert (hash(a) == hash(b)) or not same
            assert (a < b, a <= b) == (not same and difference < 0, same or difference < 0)
            assert abs(decimal(a + b) - decimal(a) - decimal(b)) < tiny
            assert abs(decimal(a * b) - decimal(a) * decimal(b)) < tiny
            assert math.floor(a) - tiny <= decimal(a) < math.floor(a) + 1 + tiny
            assert math.isclose(float(a), float(decimal(a)))
            surds += isinstance(a, Surd)
    assert surds > 500


def test_what_is_near_is_not_equal() -> None:
    """A rational number is never the root of two, however near it is."""
    near = Fraction(math.isqrt(2 * 10**400), 10**200)
    assert near < root(2) < near + Fraction(1, 10**200)
    assert near != root(2)
    assert root(2) * root(2) == 2
    assert str(root(8) - root(3) - 1) == "sqrt(8) - 1 - sqrt(3)"


# -- formulas ----------------------------------------------------------------------------------------------------------

NAMES = {"in.x": REAL, "in.y": REAL, "in.k": NATURAL, "in.s": Type("seq", parts=(REAL,)), "out.z": REAL}
KNOBS = Knobs(roots=True, terms=3, quantified=0.15)


def drawn(seed: int) -> tuple[t.Term, random.Random]:
    """TRUE where the type of an empty sequence cannot be told."""
    source = random.Random(seed)
    contract, _ = check_text(NODE.format(f"guarantee( {Formulas(source, KNOBS).formula(2, NAMES, 2)} )"), "n.rcl")
    return (t.TRUE if contract is None else contract.nodes[0].guarantees[0].formula), source


def situations(source: random.Random, count: int) -> Iterator[dict[str, Any]]:
    numbers = [Fraction(n, d) for n, d in ((-2, 1), (0, 1), (1, 4), (1, 1), (2, 1), (9, 2))]
    for _ in range(count):
        yield {
            **{name: source.choice(numbers) for name in ("in.x", "in.y", "out.z")},
            "in.k": source.randint(0, 3),
            "in.s": tuple(source.choices(numbers, k=source.randint(0, 2))),
        }


def literal(value: Any, variable: t.Variable) -> t.Term:
    if isinstance(value, tuple):
        return t.SequenceTerm(tuple(t.Literal(v, variable.sort.item) for v in value), variable.sort)  # type: ignore
    return t.Literal(value, variable.sort)


def engines(formula: t.Term, values: dict[str, Any], effort: int) -> tuple[bool, str, Reply | None]:
    """Whether evaluation decides a formula for some values; the answers of the solver and of the kernel where equations
    fix the values (None: it has no text). What any decides is what the reference says."""
    held = Meaning().met(demanded(formula), [values])
    shown, decided = f"{show_term(formula, 'rcl')} {values}", True
    try:
        assert evaluate(formula, {**values, "in.s": SequenceValue(values["in.s"])}) is held, shown
    except NotEvaluable:
        decided = False
    fixed = [t.Compare("==", v, literal(values[v.qualified], v)) for v in free_variables(formula)]
    answer = solve([formula, *fixed], effort=effort).status
    assert answer in ("sat" if held else "unsat", "unknown"), shown
    text = Text()
    try:
        parts = [text.formula(p, lambda v: (f"|{v.qualified}|", v.sort)) for p in (formula, *fixed)]
    except Untranslatable:
        return decided, answer, None
    said = ask_z3(text.script(parts), 1_000_000)
    assert said in (Reply.SAT if held else Reply.UNSAT, Reply.UNKNOWN), shown
    return decided, answer, said


@pytest.mark.parametrize("seeds", some([range(k, k + 20) for k in range(0, 1200, 20)], 1, slow=10))
def test_engines_agree_with_the_reference(seeds: range) -> None:
    """What any decides is right; and they decide most."""
    told: Counter[str] = Counter()
    for seed in seeds:
        formula, source = drawn(seed)
        if not any(isinstance(p, t.Operation) and p.operator == "sqrt" for p in subterms(formula)):
            continue
        for values in situations(source, 3):
            decided, answer, said = engines(formula, values, 2_000)
            told["evaluated" if decided else "not evaluated"] += 1
            told[f"solver {answer != 'unknown'}"] += 1
            told["no text" if said is None else f"kernel {said is not Reply.UNKNOWN}"] += 1
    assert told["evaluated"] >= 10 * told["not evaluated"], told
    assert told["solver True"] >= 10 * told["solver False"], told
    assert told["kernel True"] >= 10 * told["kernel False"], told


BOX = "-3 <= x <= 3 and -4 <= y <= 4"


@pytest.mark.parametrize(
    ("given", "goal", "verdict"),
    [
        (BOX, "norm(x, y) <= 5", Verdict.PROVED),
        (BOX, "norm(x, y) < 5", Verdict.REFUTED),
        ("TRUE", "norm(x + z, y + x) <= norm(x, y) + norm(z, x)", Verdict.PROVED),
        ("z == sqrt(x)", "x >= 0 and z * z == x", Verdict.PROVED),
        ("z >= 0", "exists(r in REAL | r >= 0 and sqrt(r) == z)", Verdict.PROVED),
        ("TRUE", "forall(r in REAL | 0 <= r <= 4 -> sqrt(r) <= 2)", Verdict.PROVED),
        ("TRUE", "forall(r in REAL | 0 <= r <= 4 -> sqrt(r) < 2)", Verdict.REFUTED),
        ("TRUE", "exists(r in REAL | r >= 0 and sqrt(r) == -1)", Verdict.REFUTED),
        ("forall(i in indices(s) | 0 <= s(i) <= 4)", "forall(i in indices(s) | sqrt(s(i)) <= 2)", Verdict.PROVED),
        ("z == sqrt(sqrt(x))", "z == 0 or z == 1 or x > 0", Verdict.PROVED),
    ],
)
@pytest.mark.parametrize("whether", [False, True])
def test_entailment(given: str, goal: str, verdict: Verdict, whether: bool) -> None:
    assert entails([claim(given)], claim(goal), whether=whether).verdict is verdict


@pytest.mark.parametrize("text", ["sqrt(x) == 5", "sqrt(x) <= 5", "z == sqrt(x)"])
def test_no_engine_gives_a_negative_number_a_root(text: str) -> None:
    """The claim is false there; without its condition, nothing is proved of what it would be."""
    negative = claim("x < 0")
    assert entails([negative], negation(claim(text))).verdict is Verdict.PROVED
    raw = parse_formula(text, node())
    for each in (raw, negation(raw)):
        assert entails([negative], each, whether=True).verdict is not Verdict.PROVED
    values = {"in.x": Fraction(-1), "out.z": Fraction(1)}
    assert evaluate(claim(text), values) is False
    with pytest.raises(NotEvaluable, match="the square root of a negative number"):
        evaluate(raw, values)


def test_an_irrational_model_ends_the_search() -> None:
    """It cannot be written down: no other solver is asked for a contradiction, which it would seek for minutes."""
    formulas = [claim("z == sqrt(x)"), claim("x == 2")]
    shown = solve(formulas)
    assert (shown.status, shown.reason) == ("unknown", "the solver's model could not be replayed")
    assert solve(formulas, values="if any").status == "sat"
    assert solve([*formulas, claim("z > 1.5")]).status == "unsat"


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("z <= norm(x, y)", "out.z <= sqrt(in.x * in.x + in.y * in.y)"),
        ("z <= norm((x, y, 2))", "out.z <= sqrt(in.x * in.x + in.y * in.y + 2 * 2)"),
        ("z <= dot((x, y), (1, k))", "out.z <= in.x * 1 + in.y * in.k"),
        ("z <= sqrt(x)", "in.x >= 0 and out.z <= sqrt(in.x)"),
        ("x > 1 -> z <= sqrt(x)", "in.x > 1 -> out.z <= sqrt(in.x)"),
        ("z <= sqrt(k + abs(x))", "out.z <= sqrt(in.k + abs(in.x))"),
    ],
)
def test_what_is_written_out(text: str, written: str) -> None:
    assert " ".join(show_term(claim(text), "rcl").split()) == written


@pytest.mark.parametrize(
    ("text", "clash"),
    [
        ("d == sqrt(d * d)", ""),
        ("d == sqrt(d)", ""),
        ("d == sqrt(speed * speed)", "`out.d` is in m"),
        ("d == norm(d, d)", ""),
    ],
)
def test_the_root_of_a_unit(text: str, clash: str) -> None:
    _, found = check_text(NODE.format(f"guarantee( {text} )"), "n.rcl")
    said = [d.message for d in found if d.code == "RCL223"]
    assert bool(said) == bool(clash), found
    assert all(clash in message for message in said)


def test_what_has_no_square_roots_says_so(tmp_path: Path) -> None:
    made = generate(node("guarantee root ( z == sqrt(k) )"), ["root"])
    assert made.uncovered == (("root", "'sqrt': its language has no square roots"),)
    file = tmp_path / "n.rcl"
    file.write_text(NODE.format("guarantee root ( z == norm(x, y) ) guarantee other ( z == x )"), "utf-8")
    fretish = avow("translate", "--to", "fretish", file.name, cwd=tmp_path)
    assert "n.root: FRETish cannot say `sqrt`" in fretish.stderr


def test_a_monitor_measures_the_distance_from_a_root() -> None:
    margin = _compiled(parse_formula("z <= sqrt(x)", node()))
    assert margin({"out.z": Fraction(1), "in.x": Fraction(2)}) == pytest.approx(math.sqrt(2) - 1)
