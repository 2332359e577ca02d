"""The normal form keeps the meaning; matching finds what a person would; nothing is torn apart or lost."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from avow.backends.ajpf import psl
from avow.backends.ajpf.mapping import Mapper, NotCovered, Row, clauses, to_formula
from avow.backends.ajpf.matching import match
from avow.backends.ajpf.psl_parser import parse_psl
from avow.backends.ajpf.shape import TooComplex, shape
from avow.evaluation.evaluate import evaluate
from avow.formulas.renaming import bound_names
from avow.formulas.values import Element, FunctionValue
from avow.language import terms as t
from avow.language.load import check_text, parse_formula
from avow.language.sorts import BOOL, NATURAL, REAL, EnumSort, FunctionSort

CONTRACT, PROBLEMS = check_text(
    """
context { Map : REAL x REAL x NATURAL --> BOOL; Grid : REAL x REAL --> NATURAL; At : REAL x REAL --> BOOL;
  Light : {red, amber, green}; Seen : NATURAL --> BOOL; Command : { go(REAL, REAL), look(NATURAL) }; }
node n {
  inputs( map : Map, grid : Grid, at : At, light : Light, seen : Seen, ready : BOOL )
  outputs( command : Command )
  topics()
  guarantee g ( TRUE )
}
""",
    "n.rcl",
)
SORTS = {"x": REAL, "y": REAL, "i": NATURAL, "j": NATURAL}


def formula(text, **sorts):
    assert CONTRACT is not None, PROBLEMS
    return parse_formula(text, CONTRACT.node("n"), CONTRACT, None, sorts)


def row(text, target):
    names = {name: sort for name, sort in SORTS.items() if f"({name} in" not in text and f"{name}, y in" not in text}
    names = {name: sort for name, sort in names.items() if f"{name} in REAL" not in text}
    pattern = shape(formula(text, **names))
    return Row(text, pattern, bound_names(pattern), parse_psl(target))


def mapper(*rows, decide=lambda term: None, values=(1, 2, 3)):
    return Mapper([row(*r) for r in rows], decide, lambda variable: values)


def mapped(text, *rows, **options):
    return psl.show(to_formula(mapper(*rows, **options).map(shape(formula(text)))))


LIGHT = EnumSort("Light", ("red", "amber", "green"))
P = t.Variable(t.Role.INPUT, "p", FunctionSort((NATURAL,), BOOL))
R = t.Variable(t.Role.INPUT, "r", FunctionSort((NATURAL, NATURAL), BOOL))
B = t.Variable(t.Role.INPUT, "b", BOOL)
E = t.Variable(t.Role.INPUT, "e", LIGHT)
VALUES = {0: None, 1: None, 2: None}


@st.composite
def terms(draw, depth=4, scope=()):
    number = st.sampled_from([*scope, t.Literal(0, NATURAL), t.Literal(1, NATURAL)])
    kind = draw(st.sampled_from("pprbeqc" if depth == 0 else "prbeqcnaoimQQQ"))
    below = terms(depth - 1, scope) if depth else None
    match kind:
        case "p":
            return t.Apply(P, (draw(number),), BOOL)
        case "r":
            return t.Apply(R, (draw(number), draw(number)), BOOL)
        case "b":
            return draw(st.sampled_from([B, t.Literal(True, BOOL), t.Compare("==", B, t.Literal(False, BOOL))]))
        case "e":
            members = tuple(t.EnumValue(m, LIGHT) for m in draw(st.lists(st.sampled_from(LIGHT.members), max_size=2)))
            return t.In(E, t.SetTerm(members, t.SetSort(LIGHT)))
        case "q":
            return t.Compare(draw(st.sampled_from(["==", "!="])), E, t.EnumValue("red", LIGHT))
        case "c":
            return t.Compare(draw(st.sampled_from(["==", "!=", "<", "<=", ">", ">="])), draw(number), draw(number))
        case "n":
            return t.Not(draw(below))
        case "a":
            return t.And((draw(below), draw(below)))
        case "o":
            return t.Or((draw(below), draw(below)))
        case "i":
            return t.Implies(draw(below), draw(below))
        case "m":
            return t.Iff(draw(below), draw(below))
    names = [t.Variable(t.Role.BOUND, f"v{len(scope) + n}", NATURAL) for n in range(draw(st.integers(1, 2)))]
    inner = draw(terms(depth - 1, (*scope, *names)))
    return t.Quantified(draw(st.sampled_from([t.Quantifier.FORALL, t.Quantifier.EXISTS])), tuple(names), inner)


@pytest.mark.slow
@settings(max_examples=300, deadline=None)
@given(terms(), st.sets(st.integers(0, 2)), st.sets(st.tuples(st.integers(0, 2), st.integers(0, 2))), st.booleans())
def test_the_normal_form_means_the_same(term, ones, pairs, truth):
    valuation = {
        "in.p": FunctionValue({(n,): True for n in ones}, False),
        "in.r": FunctionValue(dict.fromkeys(pairs, True), False),
        "in.b": truth,
        "in.e": Element("amber"),
    }
    domains = {NATURAL: (0, 1, 2)}
    try:
        normal = shape(term)
    except TooComplex:
        return
    assert evaluate(normal, valuation, domains=domains) == evaluate(term, valuation, domains=domains)
    assert shape(normal) == normal or evaluate(shape(normal), valuation, domains=domains) == evaluate(
        normal, valuation, domains=domains
    )


def test_rows_match_up_to_names_order_and_written_forms():
    rows = [
        ("in.at(x, y) and in.map(x, y, i)", "B(ag, at(i))"),
        ("in.light !in {red, amber}", "B(ag, safe)"),
        ("exists(x, y in REAL | in.grid(x, y) == i + 1)", "B(ag, next(i))"),
    ]
    text = "exists(a, b in REAL | TRUE == in.map(a, b, 4) and not in.light in {amber, red} and in.at(a, b) != FALSE)"
    assert mapped(text, *rows) in ("(B(ag, safe)) & B(ag, at(4))", "B(ag, safe) & B(ag, at(4))")
    assert (
        mapped("exists(p, q in REAL | 4 == in.grid(q, p))", ("exists(x, y in REAL | in.grid(x, y) == i)", "T")) == "T"
    )
    assert mapped("exists(p, q in REAL | 4 == in.grid(p, q))", *rows) == "B(ag, next(3))"


def test_conjuncts_that_share_a_variable_must_be_covered_together():
    rows = [("in.at(x, y)", "B(ag, at)"), ("in.map(x, y, i)", "B(ag, mapped(i))")]
    with pytest.raises(NotCovered, match="joins parts"):
        mapped("exists(x, y in REAL | in.at(x, y) and in.map(x, y, 1))", *rows)
    # mapped to T, a part is given up openly
    rows[0] = ("in.at(x, y)", "T")
    assert mapped("exists(x, y in REAL | in.at(x, y) and in.map(x, y, 1))", *rows) == "B(ag, mapped(1))"


def test_one_variable_of_a_pattern_is_one_thing():
    pattern = row("in.at(x, x)", "T")
    assert not list(match(pattern.pattern, formula("in.at(1, 2)"), pattern.variables, {}))
    assert list(match(pattern.pattern, shape(formula("in.at(1, 1)")), pattern.variables, {}))


def test_bound_variables_do_not_escape():
    pattern = row("forall(x in REAL | in.at(x, y))", "T")
    term = shape(formula("forall(a in REAL | in.at(a, a))"))
    assert not list(match(pattern.pattern, term, pattern.variables, {}))


def test_negation_of_a_row():
    assert mapped("not in.ready", ("in.ready", "B(ag, p) & B(ag, q)")) == "~(B(ag, p) & B(ag, q))"
    assert mapped("not in.ready", ("in.ready", "B(ag, p)"), ("not in.ready", "B(ag, n)")) == "B(ag, n)"


def test_indices_within_are_expanded():
    rows = [("in.seen(i)", "B(ag, seen(i))")]
    assert mapped("exists(k in NATURAL | in.seen(k))", *rows) == "B(ag, seen(1)) || B(ag, seen(2)) || B(ag, seen(3))"
    assert mapped("forall(k in NATURAL | not in.seen(k + 1))", *rows, values=(1,)) == "~B(ag, seen(2))"
    with pytest.raises(NotCovered, match="no finite range"):
        mapped("exists(k in NATURAL | in.seen(k))", *rows, values=None)


def test_alternatives_under_a_quantifier_come_apart():
    rows = [
        ("in.map(x, y, i) and out.command == go(x, y)", "D(ag, go(i))"),
        ("forall(x, y in REAL | not in.map(x, y, i))", "B(ag, end(i))"),
    ]
    text = (
        "exists(x, y in REAL | (in.map(x, y, 5) or (in.map(x, y, 0) and not exists(u, v in REAL | in.map(u, v, 5))))"
        " and out.command == go(x, y))"
    )
    assert mapped(text, *rows) in (
        "D(ag, go(5)) || (D(ag, go(0)) & B(ag, end(5)))",
        "D(ag, go(5)) || (B(ag, end(5)) & D(ag, go(0)))",
    )


def test_what_the_scenario_decides():
    def decide(term):
        return False if "value=5" in repr(term) else None

    rows = [("in.map(x, y, i) and out.command == go(x, y)", "D(ag, go(i))")]
    text = "exists(x, y in REAL | in.map(x, y, 5) and out.command == go(x, y))"
    assert mapped(text, *rows, decide=decide) == "F"
    assert mapped(text.replace("5", "6"), *rows, decide=decide) == "D(ag, go(6))"


def test_uncovered_parts_are_named():
    with pytest.raises(NotCovered, match="no mapping for"):
        mapped("in.ready and in.light == green", ("in.ready", "T"))
    with pytest.raises(NotCovered) as caught:
        mapped("exists_unique(x, y in REAL | in.at(x, y))")
    assert caught.value.span is not None


def test_clauses_tell_inputs_from_outputs():
    made = mapper(("in.ready", "B(ag, ready)"), ("out.command == look(i)", "D(ag, look(i))")).map(
        shape(formula("out.command == look(1) <=> in.ready"))
    )
    assert sorted(tuple(sorted((psl.show(u.formula), u.output) for u in clause)) for clause in clauses(made)) == [
        (("B(ag, ready)", False), ("~D(ag, look(1))", True)),
        (("D(ag, look(1))", True), ("~B(ag, ready)", False)),
    ]
