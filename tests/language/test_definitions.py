"""Local definitions: written out for every engine, shown by name to people, and never taken for one another."""

from __future__ import annotations

import pytest

from avow.formulas.formula import digest
from avow.language.contract import Contract
from avow.language.definitions import expand, folded, show_clause
from avow.language.format import format_text
from avow.language.load import check_text, parse_formula
from avow.language.subterms import subterms
from avow.language.terms import History, Quantified

HEAD = "inputs( temp : NATURAL --> REAL, on : BOOL, s : <REAL> ) outputs( fan : BOOL, x : REAL ) topics()"


def read(node: str, context: str = "") -> Contract:
    text = (f"context {{ {context} }} " if context else "") + f"node n {{ {HEAD} {node} }}"
    contract, found = check_text(text, "n.rcl")
    assert contract is not None, [f"{d.span}: {d.message}" for d in found]
    return contract


def errors(node: str, context: str = "") -> list[tuple[str, str]]:
    text = (f"context {{ {context} }} " if context else "") + f"node n {{ {HEAD} {node} }}"
    _, found = check_text(text, "n.rcl")
    return [(d.code, d.message) for d in found if d.is_error]


SAME = [
    ("", "define hot(i : NATURAL) = in.temp(i) > 80;", "hot(3) -> fan", "in.temp(3) > 80 -> fan"),
    ("define hot(i : NATURAL) = in.temp(i) > 80;", "", "hot(3) -> fan", "in.temp(3) > 80 -> fan"),
    ("L = 80; define hot(r : REAL) = r > L;", "define h = hot(temp(0)) or on;",
     "h -> fan", "(temp(0) > 80 or on) -> fan"),
    ("", "define one(a : REAL) = a + 1;", "x == one(one(temp(0)))", "x == temp(0) + 1 + 1"),
    ("", "define long(b : BOOL) = held[3 steps](b);", "long(on) -> fan", "held[3 steps](on) -> fan"),
    ("", "define last = previous(x, 0);", "x >= last", "x >= previous(x, 0)"),
    ("", "define some(r : REAL) = exists(i in NATURAL | temp(i) > r);",
     "forall(i in NATURAL | some(temp(i)))", "forall(i in NATURAL | exists(k in NATURAL | temp(k) > temp(i)))"),
    ("", "define some = exists(i in NATURAL | temp(i) > 3);",
     "forall(i in NATURAL | some or temp(i) < 9)",
     "forall(i in NATURAL | exists(k in NATURAL | temp(k) > 3) or temp(i) < 9)"),
    ("define q(f : NATURAL --> REAL, k : NATURAL) = f(k);", "", "q(in.temp, 2) > 1", "temp(2) > 1"),
    ("define x2 = exists(fan in REAL | fan > in.temp(0));", "", "x2 -> out.fan",
     "exists(k in REAL | k > temp(0)) -> fan"),
    ("", "define near = {1, 2};", "x in near", "x in {1, 2}"),
    ("", "define first = s(0);", "length(s) > 0 -> first > 0", "length(s) > 0 -> s(0) > 0"),
    ("", "define inv(r : REAL) = 1 / r;", "x == inv(temp(0))", "x == 1 / temp(0)"),
    ("", "define rises(r : REAL) = r > previous(r, r);", "rises(temp(1)) -> next(fan)",
     "temp(1) > previous(temp(1), temp(1)) -> next(fan)"),
]  # fmt: skip


@pytest.mark.parametrize(("context", "own", "short", "long"), SAME)
def test_it_says_what_is_written_out(context: str, own: str, short: str, long: str) -> None:
    """With the conditions for having a value, and with the same digest of its meaning."""
    by_name = read(f"{own} guarantee g ( {short} )", context).nodes[0].clause("g")
    plain = read(f"guarantee g ( {long} )").nodes[0].clause("g")
    assert digest(by_name.formula) == digest(plain.formula)


@pytest.mark.parametrize(("context", "own", "short", "long"), SAME)
def test_no_variable_hides_another(context: str, own: str, short: str, long: str) -> None:
    def look(term: object, bound: frozenset[str]) -> None:
        if isinstance(term, Quantified):
            names = {v.name for v in term.variables}
            assert not names & (bound | {"temp", "on", "s", "fan", "x"})
            bound |= names
        for child in getattr(term, "children", ()):
            look(child, bound)

    look(read(f"{own} guarantee g ( {short} )", context).nodes[0].clause("g").formula, frozenset())


@pytest.mark.parametrize(
    ("context", "node", "wrong"),
    [
        ("", "define a = b; define b = a; guarantee( a )", ["RCL212"]),
        ("", "define a = not a; guarantee( a )", ["RCL212"]),
        ("define a = b; define b = a;", "guarantee( a )", ["RCL212"]),
        ("", "define hot(i : NATURAL) = temp(i) > Limt; guarantee( hot(1) )", ["RCL201"]),
        ("define hot(i : NATURAL) = in.tmp(i) > 3;", "guarantee( hot(1) )", ["RCL203"]),
        ("define hot = on;", "guarantee( hot )", ["RCL201"]),
        ("", "define two(a : REAL) = a > 1; guarantee( two(1, 2) or two )", ["RCL305", "RCL305"]),
        ("", "define two(a : REAL) = a > 1; guarantee( two(TRUE) )", ["RCL303"]),
        ("", "define two(a : REAL) = a + 1; guarantee( two(1) )", ["RCL301"]),
        ("", "define on = TRUE; guarantee( on )", ["RCL210"]),
        ("", "define d = TRUE; define d = FALSE; guarantee( d )", ["RCL210"]),
        ("define d = TRUE; define d = FALSE;", "guarantee( d )", ["RCL210"]),
        ("define d = TRUE;", "define d = FALSE; guarantee( d )", ["RCL210"]),
        ("C : {d};", "define d = FALSE; guarantee( d == d )", ["RCL210"]),
        ("C : {d}; define d = FALSE;", "guarantee( d )", ["RCL211"]),
        ("define fan = in.on;", "guarantee( fan )", ["RCL202"]),
        ("", "define f(on : BOOL) = on; guarantee( f(TRUE) )", ["RCL207"]),
        ("", "define f(a, a : BOOL) = a; guarantee( f(TRUE, FALSE) )", ["RCL207"]),
        ("", "define f(a : Colour) = TRUE; guarantee( fan )", ["RCL208"]),
        ("", "define f = TRUE; guarantee( forall(f in BOOL | f) )", ["RCL207"]),
        ("", "define r = next(fan); guarantee( on -> r )", ["RCL321"]),
        ("", "define length = 3; guarantee( fan )", ["RCL209"]),
        ("", "guarantee( fan ) define late = TRUE;", ["RCL116"]),
        ("", "define d = TRUE guarantee( d )", ["RCL113"]),
        ("", "define = TRUE; guarantee( fan )", ["RCL120"]),
        ("", "define d(a) = TRUE; guarantee( fan )", ["RCL120"]),
    ],
)
def test_what_is_wrong_is_told_once(context: str, node: str, wrong: list[str]) -> None:
    assert [code for code, _ in errors(node, context)] == wrong


def test_a_fault_of_the_context_tells_where_it_is_used() -> None:
    text = "context { define hot = in.tmp > 3; } node n { inputs() outputs( b : BOOL ) topics() guarantee( hot ) }"
    _, found = check_text(text, "n.rcl")
    (fault,) = [d for d in found if d.is_error]
    assert fault.span is not None
    assert fault.span.line == 1
    assert fault.span.column == text.index("in.tmp") + 1
    assert [note for note, _ in fault.notes] == ["it is used in node `n` here"]


def test_a_definition_of_a_context_means_what_each_node_has() -> None:
    text = "context { define high = in.x > 3; } " + " ".join(
        f"node {name} {{ inputs( x : {sort} ) outputs( b : BOOL ) topics() guarantee( b <=> high ) }}"
        for name, sort in (("n", "REAL"), ("m", "INTEGER"))
    )
    contract, found = check_text(text, "n.rcl")
    assert contract is not None, found
    one, other = (node.guarantees[0].formula for node in contract.nodes)
    assert one != other


def test_a_long_row_of_definitions_is_no_traceback() -> None:
    back = " ".join(f"define e{k} = e{k + 1};" for k in range(400)) + " define e400 = TRUE;"
    assert {code for code, _ in errors(f"{back} guarantee( e0 )")} <= {"RCL110"}


def test_formulas_of_other_files_may_use_them() -> None:
    contract = read(
        "define hot = temp(0) > 80; guarantee( hot -> fan )", "define big(r : REAL) = r > 9; define two = in.on;"
    )
    node = contract.nodes[0]
    assert parse_formula("hot and big(out.x)", node, contract) == parse_formula(
        "in.temp(0) > 80 and out.x > 9", node, contract
    )
    assert parse_formula("big(3)", None, contract) == parse_formula("3.0 > 9", None, contract)


def test_memory_where_there_is_one_step_only_is_refused() -> None:
    contract = read("define d = once(on); guarantee( d -> fan )")
    assert any(isinstance(part, History) for part in subterms(contract.nodes[0].guarantees[0].formula))
    with pytest.raises(Exception, match="`d` speaks of other steps"):
        parse_formula("d", contract.nodes[0], contract)


def test_people_see_the_name_and_what_it_stands_for() -> None:
    node = read("define hot(i : NATURAL) = temp(i) > 80; guarantee g ( forall(k in NATURAL | hot(k) -> fan) )").nodes[0]
    assert show_clause(node.clause("g"), node) == "∀ k ∈ ℕ · hot(k) → out.fan, where hot(i) = in.temp(i) > 80"


@pytest.mark.parametrize(("context", "own", "short", "long"), SAME)
def test_folding_undoes_writing_out(context: str, own: str, short: str, long: str) -> None:
    """Where it finds an instance: put back and written out again, the formula is as before."""
    node = read(f"{own} guarantee g ( {short} )", context).nodes[0]
    for definition in node.definitions:
        whole = expand(definition, definition.parameters)
        assert digest(whole) == digest(definition.body)
        shown = folded(definition.body, [definition])
        assert not definition.body.children or shown != definition.body


def test_the_layout_keeps_them() -> None:
    text = (
        "context {\n  define  near ( a:REAL,b : REAL )=abs( a-b )<1;\n}\n"
        "node n { inputs(x:REAL) outputs(y, z:REAL) topics() // here\n define d=near(x , y) and not near(x,z) ;\n"
        " define e = d /* kept */ or d; guarantee(d and e) }"
    )
    laid = format_text(text, "n.rcl")
    assert format_text(laid, "n.rcl") == laid
    assert "  define near(a : REAL, b : REAL) = abs(a - b) < 1;\n" in laid
    assert "  define d = near(x, y) and not near(x, z);\n" in laid
    assert "/* kept */" in laid
    body = " and ".join(["x + y > 1"] * 20)
    long = f"node n {{ inputs(x:REAL) outputs(y:REAL) topics() define d = {body}; guarantee(d) }}"
    assert format_text(format_text(long, "n.rcl"), "n.rcl") == format_text(long, "n.rcl")


def test_two_definitions_of_one_name_are_two() -> None:
    """What a clause says moves with the definition that it uses, and only with that."""
    text = "define d = temp(0) > {}; define e = temp(1) > 1; guarantee one ( d -> fan ) guarantee two ( e -> fan )"
    before, after = (read(text.format(k)).nodes[0] for k in (1, 2))
    assert digest(before.clause("one").formula) != digest(after.clause("one").formula)
    assert digest(before.clause("two").formula) == digest(after.clause("two").formula)
