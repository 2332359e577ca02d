"""`sin`, `cos` and `atan2`: their enclosures against long decimals, what solvers assume of them, and what engines make
of formulas with them against the reference, which computes them otherwise."""

from __future__ import annotations

import math
import random
import re
from collections import Counter
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path

import pytest
from drawn.formulas import NATURAL, REAL, Formulas, Knobs, Type
from helpers import avow, some

from avow.backends.dafny.modules import generate
from avow.backends.rosmonitoring.judged import _compiled
from avow.base.verdict import Verdict
from avow.evaluation.evaluate import NotEvaluable, evaluate
from avow.formulas.formula import free_variables, negation
from avow.formulas.values import SequenceValue
from avow.language import enclosures
from avow.language import facts as of_solvers
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.definedness import demanded
from avow.language.enclosures import Irrational, Number
from avow.language.load import check_text, parse_formula
from avow.language.printer import show_term
from avow.language.roots import quotient, root
from avow.language.subterms import subterms
from avow.solving.questions import entails, solve
from avow.solving.second import contradicted
from avow.solving.smtlib import ask_cvc5, formulas_script

from . import decimals
from .meaning import NEAR, Meaning
from .test_square_roots import NODE, claim, engines, node, situations

# -- numbers -----------------------------------------------------------------------------------------------------------


def some_rational(source: random.Random) -> Fraction:
    """Of any size; some near a multiple of a quarter turn."""
    size = source.choice((1, 3, 40))
    found = Fraction(source.randint(-(10**size), 10**size), source.randint(1, 10 ** source.choice((0, 2, 30))))
    if source.random() < 0.2:
        turns, near = source.randint(-9, 9), Fraction(source.randint(-9, 9), 10 ** source.randint(1, 90))
        return (Fraction(decimals.pi()) * turns / 2).limit_denominator(10**60) + near
    return found


@pytest.mark.parametrize("bits", [64, 128, 512, 2048])
def test_enclosures_hold_the_number_and_are_close(bits: int) -> None:
    source, wrong = random.Random(bits), Fraction(1, 10**200)
    for _ in range(100):
        x, y = some_rational(source), some_rational(source)
        for made, decimal in (
            (enclosures.sine(x), decimals.sine(x)),
            (enclosures.cosine(x), decimals.cosine(x)),
            (enclosures.angle(y, x), decimals.angle(y, x)) if x or y else (Fraction(0), Fraction(0)),
        ):
            if not isinstance(made, Irrational):
                assert abs(made - decimal) < wrong
                continue
            low, high = (Fraction(end, 2**bits) for end in made.within(bits))
            assert low - wrong <= decimal <= high + wrong, (x, y)
            assert high - low < Fraction(2) ** (60 - bits) * (1 + abs(x)), (x, y)


def some_number(source: random.Random, depth: int) -> tuple[Number, Fraction]:
    """A number, and what it is in long decimals. Raises NotEvaluable, for instance if it would be a quotient by 0."""
    if depth == 0:
        small = Fraction(source.randint(-9, 9), source.randint(1, 4))
        return small, small
    (a, x), (b, y) = some_number(source, depth - 1), some_number(source, depth - 1)
    match source.choice(("+", "-", "*", "/", "max", "abs", "sqrt", "sin", "sin", "cos", "cos", "atan2", "atan2")):
        case "+":
            return a + b, x + y
        case "-":
            return a - b, x - y
        case "*":
            return a * b, x * y
        case "/":
            return quotient(a, b), x / y if y else y
        case "max":
            return max(a, b), max(x, y)
        case "abs":
            return abs(a), abs(x)
        case "sqrt":
            return root(a), Fraction(math.isqrt(int(x * 10**520)), 10**260) if x > 0 else x
        case "sin":
            return enclosures.sine(a), decimals.sine(x)
        case "cos":
            return enclosures.cosine(a), decimals.cosine(x)
        case _:
            return enclosures.angle(a, b), decimals.angle(x, y) if x or y else x


def test_arithmetic_and_order_are_exact() -> None:
    source, told = random.Random(1), Counter[str]()
    for _ in range(800):
        try:
            (a, x), (b, y) = some_number(source, source.randint(1, 3)), some_number(source, 2)
            if abs(x - y) < NEAR:
                assert a == b
                told["equal"] += 1
                continue
            assert (a < b, a <= b, a > b, a >= b, a == b, a != b) == (x < y, x < y, x > y, x > y, False, True)
            assert abs(abs(a) - abs(x)) < NEAR
            assert math.floor(a) == math.floor(x)
            assert math.ceil(a) == math.ceil(x)
            assert math.isclose(float(a), float(x), rel_tol=1e-12, abs_tol=1e-12)
            told["told apart"] += isinstance(a, Irrational) or isinstance(b, Irrational)
        except NotEvaluable as reason:
            told[reason.reason] += 1
    assert told["told apart"] > 400, told
    assert sum(n for reason, n in told.items() if "do not tell" in reason) < 20, told


@pytest.mark.parametrize("digits", [20, 100, 500])
def test_what_is_near_is_not_equal(digits: int) -> None:
    low, high = (Fraction(end, 2**2048) for end in enclosures.Enclosed("sin", 1).within(2048))
    step = Fraction(1, 10**digits)
    assert low - step < enclosures.sine(1) < high + step
    assert not enclosures.sine(1) < low - step
    assert enclosures.sine(1) != low - step


def test_what_cannot_be_told_is_no_guess() -> None:
    """Whether they are equal, or which one is greater: and nothing is looked up by them."""
    whole = enclosures.sine(1) * enclosures.sine(1) + enclosures.cosine(1) * enclosures.cosine(1)
    for ask in (
        lambda: whole == 1, lambda: whole != 1, lambda: whole < 1, lambda: whole <= 1, lambda: math.floor(whole),
        lambda: hash(whole), lambda: {1: 2}.get(whole), lambda: max(whole, 1), lambda: quotient(1, whole - 1),
        lambda: enclosures.angle(0, 1) == enclosures.angle(whole - 1, 1),
    ):  # fmt: skip
        with pytest.raises(NotEvaluable):
            ask()
    assert whole < 2
    assert whole == whole


def test_exact_values() -> None:
    assert [enclosures.sine(0), enclosures.cosine(0), enclosures.angle(0, Fraction(1, 3))] == [0, 1, 0]
    half, quarter = enclosures.angle(0, -1), enclosures.angle(1, 0)
    assert 3 < half < 4
    assert 1 < quarter < 2
    assert -2 < enclosures.angle(-1, 0) < -1
    assert -4 < enclosures.angle(-Fraction(1, 10**9), -1) < -3
    with pytest.raises(NotEvaluable, match="the angle of a vector without length"):
        enclosures.angle(0, Fraction(0))


# -- what solvers assume -----------------------------------------------------------------------------------------------


def samples(source: random.Random, count: int) -> Iterator[dict[str, Fraction]]:
    """Values of the variables of the facts, as they are: by long decimals."""
    spoken = [Fraction(number) for number in re.findall(r"\d\.\d+", of_solvers._TEXT.read_text("utf-8"))]
    edges = [*(Fraction(n, 2) for n in range(-4, 5)), *map(Fraction, (0, 0, 1, -1)), *spoken, *(-n for n in spoken)]
    for k in range(count):
        quarter = Fraction(decimals.pi()) / 4
        near = [quarter * n + Fraction(source.randint(-2, 2), 10 ** source.randint(3, 12)) for n in range(-9, 10)]
        x, y, u, v = (source.choice((*edges, *near, Fraction(source.randint(-99, 99), 7))) for _ in range(4))
        if k % 3 == 0:
            y = source.choice((y, Fraction(0)))
            u, v = source.choice(((x, -y), (-x, y), (2 * x, 2 * y), (-x, -y), (x, y)))
        yield {
            "in.x": x,
            "in.y": y,
            "in.u": u,
            "in.v": v,
            "out.s": decimals.sine(x),
            "out.c": decimals.cosine(x),
            "out.p": decimals.sine(u),
            "out.q": decimals.cosine(u),
            "out.a": decimals.angle(y, x) if x or y else Fraction(7),
            "out.b": decimals.angle(v, u) if u or v else Fraction(-7),
        }


def holds(name: str, values: dict[str, Fraction]) -> bool:
    return Meaning().met(of_solvers.facts()[name][1], [values])


@pytest.mark.parametrize("name", ["angle", "angles", "vector", "vectors", "turned", "polar"])
def test_what_solvers_assume_is_so(name: str) -> None:
    for values in samples(random.Random(3), 400):
        if name == "polar":
            angle = values["out.a"]
            values |= {"out.s": decimals.sine(angle), "out.c": decimals.cosine(angle)}
        assert holds(name, values), values


@pytest.mark.parametrize(
    ("name", "sound", "wrong"),
    [
        ("angle", "0.6366197 * x <= s", "0.6366198 * x <= s"),
        ("angle", "3.1415927 <= x", "3.1415 <= x"),
        ("angle", "1 - x * x / 2 <= c", "1 - x * x / 3 <= c"),
        ("angle", "-1.5707963 <= x and x <= 1.5707963 -> 0 < c", "-1.571 <= x and x <= 1.5707963 -> 0 < c"),
        ("angles", "abs(s + p) <= abs(x + u)", "abs(s + p) <= abs(x - u)"),
        ("angles", "u <= 1.5707963 -> s < p", "u <= 3 -> s < p"),
        ("vector", "-3.1415927 < a and", "-3.1415927 < a and a < 3.14159 and"),
        ("vector", "a < 0.785398175", "a < 0.785398"),
        ("vectors", "y == -v and y != 0 -> a == -b", "y == -v -> a == -b"),
        ("turned", "0 < x and 0 < u ->", "0 < x and 0 != u ->"),
        ("turned", "(y < 0 and v < 0)", "(y < 0 and v > 0)"),
    ],
)
def test_a_wrong_fact_would_be_noticed(
    name: str, sound: str, wrong: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    text, file = of_solvers._TEXT.read_text("utf-8"), tmp_path / "facts.rcl"
    assert text.count(sound) == 1
    file.write_text(text.replace(sound, wrong), "utf-8")
    monkeypatch.setattr(of_solvers, "_TEXT", file)
    of_solvers.facts.cache_clear()
    try:
        assert not all(holds(name, values) for values in samples(random.Random(3), 2_500))
    finally:
        of_solvers.facts.cache_clear()


# -- formulas ----------------------------------------------------------------------------------------------------------

NAMES = {"in.x": REAL, "in.y": REAL, "in.k": NATURAL, "in.s": Type("seq", parts=(REAL,)), "out.z": REAL}
KNOBS = Knobs(roots=True, angles=True, terms=3, quantified=0.1)


def drawn(seed: int) -> tuple[t.Term, random.Random]:
    """A formula with a sine, a cosine or an angle."""
    source = random.Random(seed)
    while True:
        contract, _ = check_text(NODE.format(f"guarantee( {Formulas(source, KNOBS).formula(2, NAMES, 2)} )"), "n.rcl")
        formula = t.TRUE if contract is None else contract.nodes[0].guarantees[0].formula
        if any(isinstance(p, t.Operation) and p.operator in t.CIRCULAR for p in subterms(formula)):
            return formula, source


@pytest.mark.parametrize("seeds", some([range(k, k + 8) for k in range(0, 800, 8)], 1, slow=12))
def test_engines_agree_with_the_reference(seeds: range) -> None:
    """What any decides is right; and evaluation decides most. A solver is asked with values given, where bounds are
    close, with values fixed by equations, where they are not, and without any."""
    told: Counter[str] = Counter()
    for seed in seeds:
        formula, source = drawn(seed)
        for values in situations(source, 3):
            decided, _, said = engines(formula, values, 500)
            told["evaluated" if decided else "not evaluated"] += 1
            told["no text" if said is None else f"kernel {said}"] += 1
            known = {**values, "in.s": SequenceValue(values["in.s"])}
            free = {v: known[v.qualified] for v in free_variables(formula)}
            answer = solve([formula], given=free, effort=1_000).status
            held = Meaning().met(demanded(formula), [values])
            assert answer in ("sat" if held else "unsat", "unknown"), f"{show_term(formula, 'rcl')} {values}"
            told[f"with values given {answer != 'unknown'}"] += 1
    assert told["evaluated"] > 10 * told["not evaluated"], told
    assert told["with values given True"] > 5 * told["with values given False"], told
    assert told["kernel unsat"], told


@pytest.mark.parametrize("seeds", some([range(k, k + 8) for k in range(5000, 5400, 8)], 1, slow=8))
def test_a_solution_is_one_by_evaluation(seeds: range) -> None:
    """Whatever solvers find holds for the evaluator, and what they exclude is false wherever one looks."""
    told: Counter[str] = Counter()
    for seed in seeds:
        formula, source = drawn(seed)
        shown = show_term(formula, "rcl")
        for asked in (formula, negation(formula)):
            found = solve([asked], effort=1_000)
            told[found.status] += 1
            if found.status == "sat":
                values = {v.qualified: value for v, value in found.values.items()}
                try:
                    assert evaluate(demanded(asked), values) is True, (shown, values)
                except NotEvaluable:
                    told["not evaluated"] += 1
            if found.status == "unsat":
                assert not contradicted([asked]), shown
                for values in situations(source, 20):
                    assert not Meaning().met(demanded(asked), [values]), (shown, values)
    assert told["sat"] > told["unknown"], told
    assert told["not evaluated"] < 0.2 * told["sat"], told


BOX = "-1 <= x <= 1 and 0.5 <= y <= 2"
PROVED, REFUTED, UNKNOWN = Verdict.PROVED, Verdict.REFUTED, Verdict.UNKNOWN


@pytest.mark.parametrize(
    ("given", "goal", "verdict"),
    [
        ("TRUE", "sin(x) * sin(x) + cos(x) * cos(x) == 1", PROVED),
        ("TRUE", "-1 <= sin(x + y) <= 1 and abs(cos(x * y)) <= 1", PROVED),
        (BOX, "cos(x) >= 0.5 and y * cos(x) > 0", PROVED),
        (BOX, "cos(x) >= 0.6", REFUTED),
        ("0 < x < 3", "sin(x) > 0", PROVED),
        ("0 < x < 3.2", "sin(x) > 0", REFUTED),
        ("z == y * cos(x) and y >= 0", "-y <= z <= y", PROVED),
        ("x == -y", "sin(x) == -sin(y) and cos(x) == cos(y)", PROVED),
        ("0 <= x < y <= 1", "sin(x) < sin(y) and cos(y) < cos(x)", PROVED),
        ("0.9 <= x <= 1.1", "sin(x) < 0.9", PROVED),
        ("0.9 <= x <= 1.1", "sin(x) < 0.89", REFUTED),
        ("abs(x - y) <= 0.01", "abs(sin(x) - sin(y)) <= 0.01", PROVED),
        ("x == 1", "0.84 < sin(x) < 0.85", PROVED),
        ("TRUE", "0.84 < sin(1) < 0.85 and 0.54 < cos(-1) < 0.55", PROVED),
        ("TRUE", "0.84 < sin(cos(0) + atan2(0, 2)) < 0.85", PROVED),
        ("TRUE", "sin(10000000000000000000000) < 0", PROVED),
        ("TRUE", "3.14159265358 < atan2(0, -2) < 3.1415926536", PROVED),
        ("x > 0 or y != 0", "-3.15 <= atan2(y, x) <= 3.15", PROVED),
        (BOX, "0 < atan2(y, x) < 3.1416", PROVED),
        ("1 <= x <= 2 and abs(y) <= x", "abs(atan2(y, x)) < 0.7854", PROVED),
        (BOX, "sin(atan2(y, x)) > 0 and norm(x, y) * cos(atan2(y, x)) == x", PROVED),
        ("TRUE", "atan2(y, x) == atan2(y, x)", REFUTED),
        ("z == atan2(y, x)", "x != 0 or y != 0", PROVED),
        ("TRUE", "forall(r in REAL | sin(r) <= 1)", UNKNOWN),
        ("TRUE", "exists(r in REAL | sin(r) > 2)", UNKNOWN),
        ("TRUE", "exists_unique(r in REAL | sin(r) == r)", UNKNOWN),
        ("forall(i in indices(s) | sin(x) <= s(i))", "length(s) > 0 -> s(0) >= -1", PROVED),
    ],
)
@pytest.mark.parametrize("whether", [False, True])
def test_entailment(given: str, goal: str, verdict: Verdict, whether: bool) -> None:
    assert entails([claim(given)], claim(goal), whether=whether, effort=3_000).verdict is verdict


@pytest.mark.parametrize("text", ["atan2(y, x) == 5", "atan2(y, x) <= 5", "z == atan2(y, x)", "sin(atan2(y, x)) < 2"])
def test_no_engine_gives_no_vector_an_angle(text: str) -> None:
    """The claim is false there; without its condition, nothing is proved of what it would be."""
    none = claim("x == 0 and y == 0")
    assert entails([none], negation(claim(text))).verdict is Verdict.PROVED
    raw = parse_formula(text, node())
    values = {"in.x": Fraction(0), "in.y": Fraction(0), "out.z": Fraction(1)}
    assert evaluate(claim(text), values) is False
    with pytest.raises(NotEvaluable, match="the angle of a vector without length"):
        evaluate(raw, values)
    if "sin" not in text:
        for each in (raw, negation(raw)):
            assert entails([none], each, whether=True, effort=300).verdict is not Verdict.PROVED


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("z <= atan2(y, x)", "(in.y != 0 or in.x != 0) and out.z <= atan2(in.y, in.x)"),
        ("x > 0 -> z <= atan2(y, x)", "in.x > 0 -> out.z <= atan2(in.y, in.x)"),
        ("y != 0 and z <= atan2(y, x)", "in.y != 0 and out.z <= atan2(in.y, in.x)"),
        ("z <= atan2(y, 1)", "out.z <= atan2(in.y, 1.0)"),
        ("z <= sin(k) + cos(x)", "out.z <= sin(in.k) + cos(in.x)"),
    ],
)
def test_what_is_written_out(text: str, written: str) -> None:
    assert " ".join(show_term(claim(text), "rcl").split()) == written


ANGLES = """node n {{ inputs( x, y : REAL in m, v : REAL in m/s, t : REAL in rad, n : REAL )
outputs( d : REAL in m, h : REAL in rad ) topics() guarantee( {} ) }}"""


@pytest.mark.parametrize(
    ("text", "clash"),
    [
        ("h == atan2(y, x)", ""),
        ("h == atan2(v, x)", "`in.v` is in m/s"),
        ("d == atan2(y, x)", "`out.d` is in m"),
        ("d == x * cos(t)", ""),
        ("d == x * cos(n) + y * sin(0.5)", ""),
        ("d == x * cos(y)", "`cos` takes an angle in rad, and `in.y` is in m"),
        ("d == v * sin(h)", "`out.d` is in m"),
    ],
)
def test_units(text: str, clash: str) -> None:
    _, found = check_text(ANGLES.format(text), "n.rcl")
    said = [d.message for d in found if d.code == "RCL223"]
    assert bool(said) == bool(clash), found
    assert all(clash in message for message in said)


@pytest.mark.parametrize("call", ["sin(k)", "cos(k)", "atan2(k, 1)"])
def test_what_has_no_angles_says_so(tmp_path: Path, call: str) -> None:
    name = call.split("(")[0]
    made = generate(node(f"guarantee turned ( z == {call} )"), ["turned"])
    assert made.uncovered == (("turned", f"'{name}': its language has no sine, cosine or arc tangent"),)
    file = tmp_path / "n.rcl"
    file.write_text(NODE.format(f"guarantee turned ( z == {call} ) guarantee other ( z == x )"), "utf-8")
    fretish = avow("translate", "--to", "fretish", file.name, cwd=tmp_path)
    assert f"n.turned: FRETish cannot say `{name}`" in fretish.stderr


@pytest.mark.parametrize(
    ("wrong", "hint"), [("tan(x)", "`atan2`"), ("sin(x, y)", ""), ("atan2(x)", ""), ("cos(s)", "")]
)
def test_what_is_no_call_is_an_error(wrong: str, hint: str) -> None:
    contract, found = check_text(NODE.format(f"guarantee( z == {wrong} )"), "n.rcl")
    assert contract is None
    assert all(d.span for d in found)
    assert hint in str(found[0].hint)


def test_a_monitor_measures_the_distance_from_a_sine() -> None:
    margin = _compiled(parse_formula("z <= sin(x)", node()))
    assert margin({"out.z": Fraction(1), "in.x": Fraction(2)}) == pytest.approx(math.sin(2) - 1)


def test_other_questions_have_no_word_of_them() -> None:
    """And a second solver gets the facts that Z3 gets."""
    plain = formulas_script([claim("z <= sqrt(x)")])
    assert not any(word in plain for word in ("sin", "cos", "atan2", "3.14", "6366197"))
    asked = formulas_script([claim("z == sin(x) and z > 1")])
    assert "6366197" in asked
    assert ask_cvc5(asked) in ("unsat", None)


def test_what_can_only_be_enclosed_is_no_value_of_a_port() -> None:
    """Nothing outside of evaluation looks it up, or remembers it; a comparison of it is one of numbers."""
    values = {"in.x": Fraction(1), "in.y": Fraction(0), "out.z": Fraction(1)}
    for text in ("sin(x)", "sin(x) + z"):
        term = parse_formula(f"z == {text}", node())
        assert isinstance(term, t.Compare)
        assert evaluate(term, values) is False
        with pytest.raises(NotEvaluable, match="a number that can only be enclosed"):
            evaluate(term.right, values)
        with pytest.raises(NotEvaluable, match="a number that can only be enclosed"):
            evaluate(t.TupleTerm((term.right,), s.TupleSort((s.REAL,))), values)
    assert evaluate(parse_formula("z == sin(y) + 1", node()), values) is True
