"""Records: tuples whose items have names, in every engine."""

from __future__ import annotations

import random
from fractions import Fraction
from itertools import product

import pytest
from helpers import some

from avow.base.verdict import Verdict
from avow.evaluation.evaluate import compile_term
from avow.formulas.formula import conjunction, digest, sort_digest
from avow.formulas.tuples import untupled
from avow.formulas.values import Element, Value
from avow.formulas.written import value_term
from avow.kernel.solvers import BUDGET, Reply, ask_z3
from avow.kernel.text import Text
from avow.language.contract import Contract
from avow.language.format import format_text
from avow.language.load import check_text, parse_formula
from avow.language.sorts import TupleSort
from avow.language.subterms import subterms
from avow.language.terms import Compare, Term, TupleTerm, Variable
from avow.language.translate import to_rcl
from avow.sanity.analysis import analyse
from avow.solving.questions import solve

CONTEXT = "Pose : [x, y : REAL]; Other : [r, phi : REAL]; Stamped : [frame : {map, odom}, pose : Pose, id : NATURAL];"
PORTS = (
    "inputs( p, q : Pose, s : Stamped, goals : NATURAL --> Pose, track : <Pose>, pair : (REAL, REAL), o : Other ) "
    "outputs( b : BOOL, z : Pose ) topics()"
)


def read(clauses: str, context: str = "") -> Contract:
    contract, found = check_text(f"context {{ {CONTEXT} {context} }} node n {{ {PORTS} {clauses} }}", "n.rcl")
    assert contract is not None, [f"{d.span}: {d.message}" for d in found]
    return contract


def formula(text: str) -> Term:
    contract = read("guarantee( out.b )")
    return parse_formula(text, contract.nodes[0], contract)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("in.p.z > 1", "RCL312"),
        ("p.z > 1", "RCL312"),
        ("b.x", "RCL312"),
        ("pair.x > 1", "RCL312"),
        ("s.pose.z > 1", "RCL312"),
        ("goals(1).z > 1", "RCL312"),
        ("p == o", "RCL302"),
        ("p == pair", "RCL302"),
        ("p == (1, 2, 3)", "RCL302"),
        ("exists(t in Pose | t.z > 1)", "RCL312"),
        ("Pose.x > 1", "RCL205"),
        ("p.x", "RCL301"),
    ],
)
def test_what_is_wrong_is_told_once(text: str, code: str) -> None:
    _, found = check_text(f"context {{ {CONTEXT} }} node n {{ {PORTS} guarantee( {text} ) }}", "n.rcl")
    assert [d.code for d in found if d.is_error] == [code]


@pytest.mark.parametrize(
    ("type_", "code"),
    [
        ("[x : REAL, x : BOOL]", "RCL214"),
        ("[f : REAL --> REAL]", "RCL310"),
        ("[x : Colour]", "RCL208"),
        ("[r : Self]", "RCL212"),
        ("[x : REAL", "RCL120"),
    ],
)
def test_a_wrong_type_is_told_once(type_: str, code: str) -> None:
    text = f"context {{ Self : {type_}; }} node n {{ inputs() outputs( b : BOOL ) topics() guarantee( b ) }}"
    _, found = check_text(text, "n.rcl")
    assert [d.code for d in found if d.is_error] == [code]


def test_the_names_count() -> None:
    """Fields in another order, or with other names, are another type: messages are read by name."""
    one, two, three = TupleSort((), ("x", "y")), TupleSort((), ("y", "x")), TupleSort(())
    assert len({one, two, three}) == len(set(map(sort_digest, (one, two, three)))) == 3


def test_the_layout_and_the_contract_read_back() -> None:
    text = (
        "define near(k, l : Pose) = k.x - l.x < 1; "
        "guarantee( (near(in.p, goals(s.id)) or track(0).y > 1) -> z == (1, 2) ) "
        "guarantee( exists(t in Pose | t in in.track and t != in.s.pose) )"
    )
    contract = read(text)
    again, faults = check_text(to_rcl(contract), "n.rcl")
    assert again is not None, faults
    assert again.nodes == contract.nodes
    laid = format_text(f"context {{ P : [ x,y:REAL , q : [ a:BOOL ] ]; }} node n {{ {PORTS} {text} }}", "n.rcl")
    assert "P : [x, y : REAL, q : [a : BOOL]];" in laid
    assert format_text(laid, "n.rcl") == laid


def test_a_field_of_what_is_written_down_is_that() -> None:
    contract = read("guarantee( first((1, 2)) < in.p.x )", "define first(a : Pose) = a.x;")
    (guarantee,) = contract.nodes[0].guarantees
    assert digest(guarantee.formula) == digest(formula("1.0 < in.p.x"))


# -- engines against each other ----------------------------------------------------------------------------------------

NUMBERS = tuple(map(Fraction, (0, 1, 2)))
ATOMS = (
    *("p.x < q.y", "p == q", "p.x == s.pose.y", "s.pose == p", "s.id > 1", "s.frame == map", "p == (1, 2)", "p != q"),
    *("exists(t in {p, q} | t.x > s.pose.x)", "(if p.x > 1 then p else q).y < 2", "p in {q, s.pose}"),
    *("forall(t in <p, q> | t.y <= 1)", "s == (odom, p, 2)", "abs(p.x - q.x) + abs(p.y - q.y) <= 1"),
)


@pytest.mark.parametrize("seed", some(range(25), 10, slow=15))
def test_evaluation_and_the_solver_agree(seed: int) -> None:
    rng = random.Random(seed)
    first, second, third = rng.sample(ATOMS, 3)
    about = formula(f"({first} or not ({second})) <=> ({third})")
    at = compile_term(about)
    inputs = sorted({v for v in subterms(about) if isinstance(v, Variable) and v.role == "in"}, key=lambda v: v.name)
    pairs = list(product(NUMBERS, repeat=2))
    for _ in range(4):
        s = (Element(rng.choice(("map", "odom"))), rng.choice(pairs), rng.randrange(4))
        values = {v: s if v.name == "s" else rng.choice(pairs) for v in inputs}
        expected = bool(at({v.qualified: value for v, value in values.items()}))
        answer = solve([about], effort=2_000, given=values, variables=())
        assert answer.status == ("sat" if expected else "unsat")
        here = conjunction((about, *(Compare("==", v, value_term(x, v.sort)) for v, x in values.items())))
        body = (text := Text()).formula(here, lambda v: (f"|{v.name}~0|", v.sort))
        assert ask_z3(text.script([body]), BUDGET) is (Reply.SAT if expected else Reply.UNSAT)
        apart = untupled({(True, "it"): about}, inputs)
        assert apart is not None
        put = {leaf: term for v in inputs for leaf, term in _leaves(apart.parts[v], values[v])}
        leaves = {leaf.qualified: value for leaf, value in put.items()}
        assert bool(compile_term(apart.formulas[True, "it"])(leaves)) is expected


def _leaves(term: Term, value: Value) -> list[tuple[Variable, Value]]:
    if isinstance(term, TupleTerm):
        assert isinstance(value, tuple)
        return [pair for part, each in zip(term.items, value, strict=True) for pair in _leaves(part, each)]
    assert isinstance(term, Variable)
    return [(term, value)]


def test_sanity_decides_contracts_with_records() -> None:
    good = read("guarantee( out.z.x == in.p.x and out.z.y > in.goals(3).y ) guarantee( b <=> p == z )").nodes[0]
    bad = read("guarantee( out.z.x == in.p.x and out.z == in.q ) guarantee( b )").nodes[0]
    assert [r.verdict for r in analyse(good, wanted=["realizable"])] == [Verdict.PROVED]
    assert [r.verdict for r in analyse(bad, wanted=["realizable"])] == [Verdict.REFUTED]


def test_plans_may_speak_of_fields() -> None:
    contract = read("guarantee( out.b )")
    one, other = (parse_formula(text, None, contract) for text in ("n.q.x > 1 and n.b", "n.in.q.x > 1 and n.out.b"))
    assert one == other
