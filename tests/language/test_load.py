"""Good contracts: what they mean."""

from __future__ import annotations

from pathlib import Path

import pytest
from drawn.contracts import CONTRACT

from avow.base.diagnostics import Diagnostic, Rejected, Span
from avow.language import sorts as s
from avow.language import terms as t
from avow.language.contract import Contract, Node
from avow.language.load import check_paths, check_text, load_contract, parse_formula, parse_term
from avow.language.printer import show_term


def load(text: str) -> Contract:
    contract, found = check_text(text, "t.rcl")
    assert contract is not None, [f"{d.span}: {d.message}" for d in found if d.is_error]
    return contract


@pytest.fixture(scope="module")
def contract() -> Contract:
    return load(CONTRACT)


@pytest.fixture(scope="module")
def node(contract: Contract) -> Node:
    return contract.node("n")


@pytest.fixture(scope="module")
def read(contract: Contract, node: Node):  # type: ignore[no-untyped-def]
    def parse(text: str) -> t.Term:
        return parse_formula(text, node, contract)

    return parse


@pytest.mark.parametrize("system", ["remote_inspection", "remote_inspection_published"])
def test_the_case_study_loads(root: Path, system: str) -> None:
    contract = load_contract([root / "contracts" / system / "system.rcl"])
    assert [n.name for n in contract.nodes if n.name == "agent"] == ["agent"]
    assert len(contract.nodes) == 4
    commands = dict(contract.types)["CommandSet"]
    assert isinstance(commands, s.DataSort)
    assert [c.name for c in commands.constructors] == ["move", "inspect"]
    assert dict(contract.types)["SensorsType"] == s.OpaqueSort("SensorsType")


def test_precedence_of_the_published_sensor(root: Path) -> None:
    """`->` binds looser than `and`: the guarantee is a chain of implications, not a conjunction of them."""
    contract = load_contract([root / "contracts" / "remote_inspection_published" / "system.rcl"])
    formula = contract.node("radiationSensor").guarantees[0].formula
    assert isinstance(formula, t.Quantified)
    assert isinstance(formula.body, t.Implies)
    inner = formula.body.right
    assert isinstance(inner, t.Implies)
    assert isinstance(inner.left, t.And)
    assert isinstance(inner.right, t.Implies)
    assert isinstance(inner.right.right, t.Implies)


def test_precedence(read) -> None:  # type: ignore[no-untyped-def]
    loosest_first = [
        ("b <=> b -> b or b and not b", t.Iff),
        ("b -> b or b and not b", t.Implies),
        ("b or b and not b", t.Or),
        ("b and not b", t.And),
        ("not b == b", t.Not),
    ]
    for text, kind in loosest_first:
        assert isinstance(read(text), kind), text
    chain = read("b -> b2 -> b")
    assert isinstance(chain, t.Implies)
    assert isinstance(chain.right, t.Implies)
    left = read("b <=> b2 <=> b")
    assert isinstance(left, t.Iff)
    assert isinstance(left.left, t.Iff)
    assert read("r - r - r > 0") == read("(r - r) - r > 0") != read("r - (r - r) > 0")
    assert read("r - r * r > 0") == read("r - (r * r) > 0")


def test_widening_is_explicit(read) -> None:  # type: ignore[no-untyped-def]
    less = read("in.r < in.i")
    assert isinstance(less, t.Compare)
    assert less.right == t.Widen(t.Variable(t.Role.INPUT, "i", s.INTEGER), s.REAL)
    assert read("in.r < 120").right == t.Literal(120, s.REAL)
    assert read("in.i < in.k").right == t.Variable(t.Role.INPUT, "k", s.NATURAL)
    assert read("in.k - 1 == in.i").left.sort == s.INTEGER
    assert read("in.k + 1 == in.i").left.sort == s.NATURAL
    division = read("in.k / 2 == in.r").left
    assert isinstance(division, t.Arithmetic)
    assert division.sort == s.REAL
    assert division.left == t.Widen(t.Variable(t.Role.INPUT, "k", s.NATURAL), s.REAL)


def test_chains(read) -> None:  # type: ignore[no-untyped-def]
    chain = read("0 <= r < 120")
    assert isinstance(chain, t.And)
    assert chain == read("0 <= r and r < 120")
    assert chain != read("0 <= r and r <= 120")


def test_names_and_roles(read, node: Node) -> None:  # type: ignore[no-untyped-def]
    assert read("b") == t.Variable(t.Role.INPUT, "b", s.BOOL)
    assert read("b2") == t.Variable(t.Role.OUTPUT, "b2", s.BOOL)
    assert read("in.o == out.o") == t.Compare("==", node.input("o").variable, node.output("o").variable)
    with pytest.raises(Rejected, match=r"both an input and an output.*RCL202"):
        read("o == in.o")


def test_constants_are_expanded(read) -> None:  # type: ignore[no-untyped-def]
    assert read("r < K") == read("r < 3")
    assert read("st in Q") == read("st in {red, green}")
    assert read("w in W") == read("w in {wa, wb}")
    assert read("st in RadStat") == read("st in {red, orange, green}")


def test_membership(read) -> None:  # type: ignore[no-untyped-def]
    assert read("st !in {red}") == t.Not(read("st in {red}")) == read("not st in {red}")
    inside = read("in.i in {1, 2.5}")
    assert isinstance(inside, t.In)
    assert isinstance(inside.item, t.Widen)
    assert isinstance(inside.collection, t.SetTerm)
    assert inside.collection.items == (t.Literal(1, s.REAL), read("r == 2.5").right)
    assert read("in.k in {}") == t.In(t.Variable(t.Role.INPUT, "k", s.NATURAL), read("in.k in {}").collection)


def test_domains_become_guards(read) -> None:  # type: ignore[no-untyped-def]
    assert read("forall(v in {1, 2} | v < r)") == read("forall(v in NATURAL | v in {1, 2} -> v < r)")
    assert read("exists(v in Q | st == v)") == read("exists(v in RadStat | v in {red, green} and st == v)")
    unique = read("exists_unique(v in ns, u in REAL | v < u)")
    assert isinstance(unique, t.Quantified)
    assert unique.quantifier is t.Quantifier.UNIQUE
    assert [v.name for v in unique.variables] == ["v", "u"]
    assert isinstance(unique.body, t.And)
    assert read("forall(v in W | w == v)").body == read("exists(v in W | w == v)").body
    later = read("forall(i' in NATURAL, j in <0 upto i'> | j <= i')")
    assert isinstance(later.body, t.Implies)
    assert read("forall(v in REAL ; v < r)") == read("forall(v in REAL | v < r)")


def test_sequences_and_tuples(read) -> None:  # type: ignore[no-untyped-def]
    assert isinstance(read("sq(0) < r").left, t.Index)
    assert read("length(sq) == 0").left.sort == s.NATURAL
    assert read("r < sq(0)") == read("r<sq(0)")
    assert read("<1, 2> == sq").left.sort == s.SequenceSort(s.REAL)
    assert read("sq == <>").right.sort == s.SequenceSort(s.REAL)
    assert read("k in <1 upto 5>").collection.sort == s.SequenceSort(s.NATURAL)
    assert read("p == (1, 2)").right.sort == s.TupleSort((s.REAL, s.NATURAL))
    assert read("<r, 1> == sq") == read("< r , 1 > == sq")


def test_items_come_to_one_sort(read) -> None:  # type: ignore[no-untyped-def]
    mixed = read("(r, 1) in {(1, 1), (1.5, 1), (1, 2.5)}")
    assert {i.sort for i in mixed.collection.items} == {s.TupleSort((s.REAL, s.REAL))}
    with pytest.raises(Rejected, match="RCL302"):
        read("in.k in {" + ", ".join(map(str, range(3000))) + ', "a"}')


def test_every_form_of_type() -> None:
    contract = load(
        "context { Fn : REAL x (NATURAL) --> REAL x REAL; Tu : (REAL, BOOL); Se : <(REAL, REAL)>; Op : {}; "
        "Da : {stop, go(REAL, Kind)}; Kind : {a, b}; Alias : Kind; Prod : REAL x REAL; }"
        "node x { inputs(at : REAL x REAL --> BOOL, c : {p, q}, s : STRING, f : {u, v} --> BOOL) outputs(x : Da) "
        "topics(geometry_msgs/msg/Pose at matches(in.at), uint8 c matches(c)) G( x != stop ) }"
    )
    types = dict(contract.types)
    kind = s.EnumSort("Kind", ("a", "b"))
    assert types["Fn"] == s.FunctionSort((s.REAL, s.NATURAL), s.TupleSort((s.REAL, s.REAL)))
    assert types["Se"] == s.SequenceSort(s.TupleSort((s.REAL, s.REAL)))
    assert types["Alias"] == kind
    assert types["Prod"] == s.TupleSort((s.REAL, s.REAL))
    node = contract.node("x")
    assert node.input("at").type_name == "REAL x REAL --> BOOL"
    assert node.input("c").sort == s.EnumSort("c", ("p", "q"))
    assert node.topics[0].ros_type == "geometry_msgs/msg/Pose"
    assert node.guarantees[0].name == "G1"
    assert isinstance(node.guarantees[0].formula, t.Compare)
    assert isinstance(node.guarantees[0].formula.right, t.Construct)


def test_a_set_written_twice_is_one_type() -> None:
    contract = load(
        "context { Cmd : {go, stop}; } node a { inputs() outputs(c : {go, stop}) topics() G(c == go) }"
        "node b { inputs(c : Cmd) outputs(b : BOOL) topics() G(b) }"
    )
    assert (
        contract.node("a").output("c").sort == contract.node("b").input("c").sort == s.EnumSort("Cmd", ("go", "stop"))
    )


def test_names_for_inline_sets_are_free() -> None:
    contract = load("context { c : {z}; } node a { inputs() outputs(c : {go, stop}) topics() G(out.c == go) }")
    sort = contract.node("a").output("c").sort
    assert isinstance(sort, s.EnumSort)
    assert sort.name == "c2"


def test_clause_names_and_sentences() -> None:
    contract = load(
        'node n { inputs(r : REAL) outputs(b : BOOL) topics() assume ok "fine \\"so\\"" (r > 0) A(r < 9)'
        ' guarantee "only a sentence" (b) G named (b) }'
    )
    node = contract.node("n")
    assert [(c.name, c.sentence) for c in node.clauses] == [
        ("ok", 'fine "so"'),
        ("A2", None),
        ("G1", "only a sentence"),
        ("named", None),
    ]
    assert node.clause("A2").text == "r < 9"
    assert str(node.clause("A2").span) == "t.rcl:1:86"


def test_several_files_are_one_contract(tmp_path: Path) -> None:
    (tmp_path / "a.rcl").write_text("context { C : {red, green}; }")
    (tmp_path / "b.rcl").write_text("node b { inputs(c : C) outputs(d : C) topics() G(d == c) }")
    (tmp_path / "c.rcl").write_text(
        "context { C : {red, green}; D = {green}; } node c { inputs() outputs(d : C) topics() G(d in D) }"
    )
    contract = load_contract([tmp_path / f"{x}.rcl" for x in "abc"])
    assert [n.name for n in contract.nodes] == ["b", "c"]
    (tmp_path / "c.rcl").write_text("context { C : {red}; }")
    with pytest.raises(Rejected, match="declared differently in another file"):
        load_contract([tmp_path / "a.rcl", tmp_path / "c.rcl"])


def test_files_that_are_no_texts(tmp_path: Path) -> None:
    cases = {
        "RCL002": [tmp_path / "absent.rcl", tmp_path],
        "RCL004": [tmp_path / "utf16.rcl", tmp_path / "latin.rcl"],
        "RCL005": [tmp_path / "nul.rcl"],
        "RCL003": [tmp_path / "large.rcl"],
    }
    (tmp_path / "utf16.rcl").write_bytes("node n".encode("utf-16"))
    (tmp_path / "latin.rcl").write_bytes(b"// fine\n// \xe9")
    (tmp_path / "nul.rcl").write_bytes(b"node\0")
    (tmp_path / "large.rcl").write_bytes(b" " * 5_000_000)
    for code, paths in cases.items():
        for path in paths:
            contract, found = check_paths([path])
            assert contract is None
            assert [d.code for d in found] == [code], path
    latin = check_paths([tmp_path / "latin.rcl"])[1][0]
    assert latin.span is not None
    assert (latin.span.line, latin.span.column) == (2, 4)


def test_byte_order_mark_and_line_ends(tmp_path: Path) -> None:
    path = tmp_path / "dos.rcl"
    path.write_bytes(b"\xef\xbb\xbf" + CONTRACT.replace("\n", "\r\n").encode())
    contract = load_contract([path])
    assert contract.nodes == load(CONTRACT).nodes
    found = check_text("\ufeffnode\r\n  9", "f")[1]
    assert found[0].span is not None
    assert (found[0].span.line, found[0].span.column) == (2, 3)


# --- formulas of plans -----------------------------------------------------------------------------------------------


def test_formulas_over_the_whole_system(contract: Contract) -> None:
    term = parse_formula("n.b -> n.st2 == red and x < 2", None, contract, extra={"x": s.REAL})
    assert isinstance(term, t.Implies)
    assert term.left == t.Variable(t.Role.INPUT, "n.b", s.BOOL)
    assert isinstance(term.right, t.And)
    assert term.right.items[1].left == t.Variable(t.Role.BOUND, "x", s.REAL)  # type: ignore[union-attr]
    assert parse_formula("n.in.o == n.out.o", None, contract)
    assert parse_formula(show_term(term, "rcl"), None, contract, extra={"x": s.REAL}) == term


def test_roles_narrow_bare_names(contract: Contract, node: Node) -> None:
    only_out = frozenset((t.Role.OUTPUT,))
    term = parse_formula("o == o", node, contract, roles=only_out)
    assert isinstance(term, t.Compare)
    assert term.left == node.output("o").variable
    with pytest.raises(Rejected, match="RCL20"):
        parse_formula("b", node, contract, roles=only_out)
    with pytest.raises(Rejected, match="RCL203"):
        parse_formula("in.b", node, contract, roles=only_out)


def test_terms(contract: Contract, node: Node) -> None:
    assert parse_term("red", node, contract) == t.EnumValue("red", s.EnumSort("RadStat", ("red", "orange", "green")))
    assert parse_term("move(0, 1.5)", None, contract).sort == dict(contract.types)["Cmd"]
    assert parse_term("3", None, contract, sort=s.REAL) == t.Literal(3, s.REAL)
    assert parse_term("-3") == t.Literal(-3, s.INTEGER)
    with pytest.raises(Rejected, match="must be of type NATURAL"):
        parse_term("-3", None, contract, sort=s.NATURAL)


def test_formula_errors_are_placed_in_the_plan(contract: Contract, node: Node) -> None:
    with pytest.raises(Rejected) as caught:
        parse_formula("in.b and in.bb", node, contract, Span("plan.yaml", 7, 12, 7, 30))
    (found,) = caught.value.diagnostics
    assert isinstance(found, Diagnostic)
    assert str(found.span) == "plan.yaml:7:21"
    for text in ("", "  ", "in.b ==", ")", "b\0", "(" * 5000):
        with pytest.raises(Rejected) as caught:
            parse_formula(text, node, contract, Span("plan.yaml", 7, 12, 7, 30))
        assert all(d.span is not None and d.span.file == "plan.yaml" for d in caught.value.diagnostics), text


def test_ports_of_one_type_may_share_it() -> None:
    one, _ = check_text("node n { inputs( a, b : BOOL, s : <REAL> ) outputs( x : BOOL ) topics() guarantee( x ) }", "n")
    other, _ = check_text(
        "node n { inputs( a : BOOL, b : BOOL, s : <REAL> ) outputs( x : BOOL ) topics() guarantee( x ) }", "n"
    )
    assert one is not None
    assert other is not None
    assert one.nodes == other.nodes


def test_indices_are_the_positions_of_a_sequence() -> None:
    head = "node n { inputs( s : <REAL> ) outputs( x : BOOL ) topics() guarantee"
    short, _ = check_text(f"{head}( forall(i in indices(s) | s(i) > 0) ) }}", "n")
    long, _ = check_text(f"{head}( forall(i in <0 upto length(s) - 1> | s(i) > 0) ) }}", "n")
    assert short is not None
    assert long is not None
    assert short.nodes == long.nodes
