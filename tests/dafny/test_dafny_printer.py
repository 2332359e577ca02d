"""What is generated: goldens, hostile names, totality, and agreement with Z3 about the meaning of formulas."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import pytest

from avow.backend_kit.protocol import Job, Limits
from avow.backends.dafny import BACKEND
from avow.backends.dafny.dafny_tool import dafny
from avow.backends.dafny.judge import _about_nothing
from avow.backends.dafny.modules import Generated, generate
from avow.backends.dafny.printer import RESERVED, Names, NotExpressible, Vocabulary, identifier, print_clause
from avow.backends.dafny.runner import Run, verify
from avow.base.verdict import Verdict
from avow.isolation.outside import Outside
from avow.language import terms as t
from avow.language.contract import Clause, ClauseKind, Contract, Node, Port
from avow.language.load import check_text, load_contract
from avow.language.operators import OPERATORS
from avow.language.sorts import BOOL, INTEGER, REAL, Constructor, DataSort, EnumSort, FunctionSort, OpaqueSort
from avow.solving.questions import entails

MakeJob = Callable[..., Job]
CONTRACTS = Path(__file__).resolve().parents[2] / "contracts"
GOLDEN = Path(__file__).parent / "golden"
REFRESH = "AVOW_REFRESH"


def everything(node: Node) -> Generated:
    return generate(node, [c.name for c in node.guarantees])


def test_each_situation_has_a_name_of_its_own_and_no_answer_is_no_good_answer() -> None:
    """A guarantee with two situations, each with a quantifier; a question that Dafny rejects answers nothing."""
    text = """node n { inputs( s : <INTEGER>, x : INTEGER ) outputs( b : BOOL ) topics()
    guarantee e ( out.b <=> exists(j in INTEGER | j in in.s and j == in.x) ) }"""
    made = everything(check_text(text, "n.rcl")[0].node("n"))
    assert made.conditions.count("e") > 1
    named = re.findall(r"predicate (?:method )?(\w+)", made.situations)
    assert len(named) == len(set(named)) > 1
    rejected = Run((), 2, (), (), None, "duplicate", None)
    assert _about_nothing(rejected, made) == ({"e"}, frozenset())


@pytest.mark.parametrize(
    ("system", "node"),
    [
        ("remote_inspection", "agent"),
        ("remote_inspection", "radiationSensor"),
        ("remote_inspection", "navigation"),
        ("remote_inspection_published", "agent"),
    ],
)
def test_golden_files(make_job: MakeJob, system: str, node: str) -> None:
    job = make_job(CONTRACTS / system / "system.rcl", node, implementation="x.dfy")
    files = BACKEND.export(job)
    assert files == BACKEND.export(job)
    folder = GOLDEN / f"{system}-{node}"
    if os.environ.get(REFRESH):
        for name, text in files.items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text, encoding="utf-8")
    kept = {p.relative_to(folder).as_posix(): p.read_text(encoding="utf-8") for p in folder.rglob("*") if p.is_file()}
    assert kept == dict(files)


def test_every_ensures_line_is_on_the_map() -> None:
    made = everything(load_contract([CONTRACTS / "remote_inspection/system.rcl"]).node("agent"))
    for text, ensures in ((made.spec, made.ensures), (made.probe, made.probe_ensures)):
        for number, name in ensures:
            assert text.split("\n")[number - 1].strip().startswith(f"ensures Contract.{name}(")
    assert len(made.ensures) == 5


HOSTILE = [
    *("method", "ensures", "real", "in", "array2", "bv8", "Types", "Contract", "Step", "Env", "Main", "Nth"),
    *(
        "_x",
        "Ω",
        "u03a9",
        "x'",
        "a-b",
        "*/",
        "\n}",
        '"',
        "{:axiom}",
        "1",
        "",
        "𝔸",
        "x__y",
        "in_r",
        "assume false;",
        "a b",
    ),
]


def test_names_are_injective_and_plain() -> None:
    names = Names()
    made = [names("port", name) for name in HOSTILE]
    assert len(set(made)) == len(HOSTILE)
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_']*", name) for name in made)
    assert not set(made) & RESERVED
    assert [names("port", name) for name in HOSTILE] == made
    assert identifier("ordinary_name'") == "ordinary_name'"


def hostile_node() -> Node:
    """Every port, type, constructor, bound variable, clause and the node itself has a name that Dafny cannot take."""
    enum = EnumSort("datatype", ("method", "ensures", "red'", "Ω"))
    data = DataSort("*/ }", (Constructor("assume false;", (REAL, INTEGER)), Constructor("case", ())))
    opaque = OpaqueSort("{:axiom}")
    ports = [
        Port(t.Role.INPUT, name, sort, "T")
        for name, sort in (
            ("lemma", enum), ('"', data), ("\n", opaque), ("in_r", REAL), ("f", FunctionSort((REAL, enum), BOOL)),
            ("forall", BOOL),
        )
    ]  # fmt: skip
    outputs = [Port(t.Role.OUTPUT, name, sort, "T") for name, sort in (("lemma", enum), ("r", REAL), ("returns", BOOL))]
    bound = [t.Variable(t.Role.BOUND, name, REAL) for name in ("in_r", "out_r", "then", "x'")]
    f = ports[4].variable
    from avow.language.terms import Apply, EnumValue

    body = t.And(
        (
            t.Compare("<=", bound[0], bound[1]),
            Apply(f, (bound[2], EnumValue("Ω", enum)), BOOL),
            t.Compare("==", bound[3], ports[3].variable),
            ports[5].variable,
        )
    )
    formula = t.Quantified(t.Quantifier.EXISTS, tuple(bound), body)
    claim = t.Quantified(t.Quantifier.FORALL, (bound[0],), t.Compare("==", bound[0], bound[0]))
    same = t.Compare("==", outputs[0].variable, ports[0].variable)
    return Node(
        "method */ {\n",
        tuple(ports),
        tuple(outputs),
        (),
        (Clause(ClauseKind.ASSUMPTION, "requires", 1, formula, 'a sentence */ \n } assume false; "'),),
        (
            Clause(ClauseKind.GUARANTEE, "Contract", 1, claim),
            Clause(ClauseKind.GUARANTEE, "ensures true {}", 2, same, "\u2028assume"),
            Clause(ClauseKind.GUARANTEE, "Contract_all1", 3, t.Not(t.Not(same))),
        ),
    )


@pytest.mark.slow
@pytest.mark.needs_dafny
def test_hostile_names_still_make_valid_dafny() -> None:
    made = everything(hostile_node())
    files = {made.types_file: made.types, made.contract_file: made.contract, made.spec_file: made.spec}
    assert all(re.fullmatch(r"[\w.]+", name, re.ASCII) for name in files)
    run = verify(files, Limits(seconds=120), Outside((dafny(),)))
    assert run.code == 0, run.output
    assert run.members is not None
    assert all(m.outcome == "correct" for m in run.members)
    assert len(made.ensures) == 3


WORDS = """
    abstract and array as assert assume axiom bool break by calc case catch char class const continue def default do
    else elif ensures enum exists expect export extends extern false final float for forall foreach free fresh from
    function ghost global goto hide if import in include int interface invariant is iterator label lambda least lemma
    length let limit lt map match method modifies modify module multiset namespace nat new nil none not null object of
    old opaque open operator or override package predicate print private proctype protected public pure raise reads
    real requires return returns reveal reveals self seq set some static string struct super switch then this throw to
    total trait true try type union unit until use using val var when where while with witness yield yields None Some
    True False Map Set Seq String Int Real Bool Type System M Impl Spec Check a b x y r
"""


@pytest.mark.needs_dafny
@pytest.mark.slow
def test_any_word_may_be_the_name_of_a_clause_a_port_a_type_or_an_element() -> None:
    """The words that some language or other keeps for itself; one run for all of them."""
    words = WORDS.split()
    variables = [Port(t.Role.INPUT, word, EnumSort(word, (word, f"{word}x")), "T") for word in words]
    claims = tuple(
        Clause(ClauseKind.GUARANTEE, port.name, at, t.Compare("==", port.variable, port.variable))
        for at, port in enumerate(variables, start=1)
    )
    made = everything(Node("free", tuple(variables), (), (), (), claims))
    run = verify(
        {made.types_file: made.types, made.contract_file: made.contract}, Limits(seconds=120), Outside((dafny(),))
    )
    assert run.code == 0, run.output
    assert run.members is not None
    assert len(made.ensures) == len(words)


@pytest.mark.needs_dafny
@pytest.mark.nightly
def test_all_that_is_generated_for_the_case_studies_is_well_formed() -> None:
    for system in ("remote_inspection", "nasa_rover"):
        for node in load_contract([CONTRACTS / system / "system.rcl"]).nodes:
            made = everything(node)
            files = {made.types_file: made.types, made.contract_file: made.contract, made.spec_file: made.spec}
            run = verify(files, Limits(seconds=120), Outside((dafny(),)))
            assert run.code == 0, (node.name, run.output)
            assert all(m.outcome == "correct" for m in run.members or ())


def test_what_cannot_be_expressed_is_not_covered(make_job: MakeJob) -> None:
    text = """node n { inputs( s : STRING ) outputs( t : BOOL ) topics( )
      guarantee a ( in.s == "é" -> out.t ) guarantee b ( out.t ) }"""
    job = make_job(text, "n", implementation="x.dfy")
    spec = BACKEND.export(job)["n_spec.dfy"]
    assert "// Not here: guarantee a: Dafny has no counterpart for " in spec
    assert spec.count("ensures Contract.") == 1
    assert "ensures Contract.b(" in spec


def test_a_deep_formula_is_printed() -> None:
    x = t.Variable(t.Role.INPUT, "x", BOOL)
    term: t.Term = x
    for _ in range(1_000):
        term = t.Not(term)
    (predicate,) = print_clause("deep", term, Vocabulary(Names(), Names(), (x,)))
    assert predicate.body.count("!") == 1_000


def test_numbers_are_exact() -> None:
    def body(value: int | Fraction, sort: object) -> str:
        r = t.Variable(t.Role.INPUT, "r", REAL)
        term = t.Compare("==", r, t.Literal(value, sort))  # type: ignore[arg-type]
        return print_clause("c", term, Vocabulary(Names(), Names(), (r,)))[0].body.removeprefix("in_r == ")

    assert body(Fraction(1, 4), REAL) == "0.25"
    assert body(120, REAL) == "120.0"
    assert body(Fraction(-5, 2), REAL) == "(-2.5)"
    assert body(Fraction(1, 3), REAL) == "(1.0 / 3.0)"
    assert body(Fraction(1, 10**30), REAL) == "0." + "0" * 29 + "1"
    assert body(-3, INTEGER) == "(-3)"


FORMULAS = """
context {
  C : {red, green, blue};
  D : { move(REAL, REAL), look(NATURAL), stop };
  S : {};
  F : REAL x NATURAL --> BOOL;
}
node n {
  inputs( x : REAL, i : INTEGER, k : NATURAL, c : C, d : D, s : S, f : F, p : BOOL, q : BOOL, w : STRING )
  outputs( z : BOOL )
  topics( )
  guarantee yes_excluded_middle ( in.p or not in.p )
  guarantee yes_distribution ( (in.p and (in.q or out.z)) <=> ((in.p and in.q) or (in.p and out.z)) )
  guarantee yes_natural ( in.k >= 0 )
  guarantee yes_negative_natural ( -in.k <= 0 and -in.k + 1 == 1 - in.k and not (-in.k) in <1, 2> )
  guarantee no_negative_natural ( -in.k in <0, -1> )
  guarantee no_integer ( in.i >= 0 )
  guarantee yes_enum ( in.c in {red, green, blue} )
  guarantee no_enum ( in.c in {red, green} )
  guarantee yes_enum_different ( red != green )
  guarantee yes_free ( move(in.x, 1) != look(in.k) )
  guarantee yes_injective ( move(in.x, 1) == move(2, 1) -> in.x == 2 )
  guarantee no_injective ( move(in.x, 1) == move(2, 1) -> in.x == 3 )
  guarantee yes_density ( forall(a, b in REAL | (a < b) -> exists(m in REAL | a < m and m < b)) )
  guarantee yes_negation ( (not exists(a in NATURAL | in.f(in.x, a))) <=> forall(a in NATURAL | not in.f(in.x, a)) )
  guarantee no_swap ( (forall(a in NATURAL | exists(b in REAL | in.f(b, a)))
    -> exists(b in REAL | forall(a in NATURAL | in.f(b, a)))) )
  guarantee yes_unique ( (exists_unique(a in NATURAL | in.f(in.x, a))) -> not (in.f(in.x, 1) and in.f(in.x, 2)) )
  guarantee no_unique ( (exists(a in NATURAL | in.f(in.x, a))) -> not (in.f(in.x, 1) and in.f(in.x, 2)) )
  guarantee yes_fraction ( 0.1 + 0.2 == 0.3 )
  guarantee yes_chain ( (1 <= in.x < 2) -> (in.x >= 1 and in.x < 2) )
  guarantee no_division ( in.x / in.x == 1 )
  guarantee yes_division ( in.x / 2 + in.x / 2 == in.x )
  guarantee yes_arrow ( (in.p -> (in.q -> in.p)) )
  guarantee no_arrow ( ((in.p -> in.q) -> in.p) )
  guarantee yes_widen ( in.k + 0.5 > in.k )
  guarantee no_minus ( in.k - 1 >= 0 )
  guarantee yes_sequence ( 2 in <1, 2, 3> )
  guarantee no_sequence ( 4 in <1, 2, 3> )
  guarantee yes_length ( length(<1, 2, 3>) == 3 )
  guarantee yes_string ( "a\\"b" != "ab" )
  guarantee no_string ( in.w == "*/ { } assume false;" )
  guarantee yes_opaque ( exists(t in S | t == in.s) )
}
"""


def crosscheck_node(tmp_path: Path) -> Contract:
    path = tmp_path / "formulas.rcl"
    path.write_text(FORMULAS, encoding="utf-8")
    return load_contract([path])


@pytest.mark.needs_dafny
@pytest.mark.nightly
def test_dafny_and_z3_agree_on_meanings(tmp_path: Path) -> None:
    """One lemma a formula: what Z3 proves Dafny proves, what Z3 refutes it never does."""
    node = crosscheck_node(tmp_path).node("n")
    made = everything(node)
    assert made.uncovered == ()
    lemmas = ["module Check {", "  import Types", "  import Contract"]
    for line in made.spec.split("\n"):
        if line.strip().startswith("ensures Contract."):
            claim = line.strip().removeprefix("ensures ")
            name = claim.removeprefix("Contract.").split("(")[0]
            step = next(row for row in made.spec.split("\n") if row.strip().startswith("method Step("))
            parameters = step[step.index("(") + 1 : step.index(") returns (")]
            outputs = step[step.index("returns (") + 9 : -1]
            lemmas.append(f"  lemma L_{name}({parameters}, {outputs}) ensures {claim}\n  {{\n{_help(name)}  }}")
    files = {
        made.types_file: made.types,
        made.contract_file: made.contract,
        "check.dfy": "\n".join([*lemmas, "}", ""]),
    }
    run = verify(files, Limits(seconds=180), Outside((dafny(),)))
    assert run.members is not None, run.output
    proved = {m.name.removeprefix("L_"): m.outcome == "correct" for m in run.members if m.kind == "Impl"}
    assert len(proved) == len(node.guarantees)
    assert [m.name for m in run.members if m.kind != "Impl" and m.outcome != "correct"] == [], run.output
    for clause in node.guarantees:
        by_z3 = entails((), clause.formula, effort=10_000).verdict
        if clause.name.startswith("yes_"):
            assert by_z3 is not Verdict.REFUTED, clause.name
            assert proved[clause.name], (clause.name, run.output)
        else:
            assert by_z3 is not Verdict.PROVED, clause.name
            assert not proved[clause.name], clause.name


def _help(name: str) -> str:
    """The witnesses that Dafny wants named."""
    match name:
        case "yes_density":
            return (
                "    forall a: real, b: real ensures Contract.yes_density_all1(a, b) {\n"
                "      if a < b { assert Contract.yes_density_ex2(a, b, (a + b) / 2.0); }\n    }\n"
            )
        case "yes_opaque":
            return "    assert Contract.yes_opaque_ex1(in_s, in_s);\n"
        case "yes_unique":
            return (
                "    assert Contract.yes_unique_one1(in_x, in_f, 1) == in_f(in_x, 1);\n"
                "    assert Contract.yes_unique_one1(in_x, in_f, 2) == in_f(in_x, 2);\n"
            )
        case "yes_negation":
            return (
                "    forall a: nat ensures Contract.yes_negation_ex1(in_x, in_f, a) == in_f(in_x, a) {}\n"
                "    forall a: nat ensures Contract.yes_negation_all2(in_x, in_f, a) == !in_f(in_x, a) {}\n"
            )
        case _:
            return ""


def test_minus_a_natural_is_no_natural() -> None:
    """Dafny 2.3 takes `-n` for one, and finds fault with the generated predicate: nothing was ever proved then."""
    ports = "inputs( k : NATURAL, r : REAL ) outputs( b : INTEGER ) topics()"
    contract = check_text(f"node n {{ {ports} guarantee( out.b == -in.k or -in.r > -2 ) }}", "f")[0]
    assert contract is not None
    assert "(out_b == (0 - in_k)) || ((-in_r) > (-2.0))" in everything(contract.node("n")).contract


def test_false_is_false() -> None:
    x = t.Variable(t.Role.INPUT, "x", BOOL)
    assert print_clause("c", t.FALSE, Vocabulary(Names(), Names(), (x,)))[0].body == "false"


def test_an_assumption_about_an_output_is_refused() -> None:
    """Step's requirement can speak of the inputs only: nothing is generated that Dafny could not resolve."""
    text = "node n { inputs( a : BOOL ) outputs( b : BOOL ) topics() assume( in.a or out.b ) guarantee( out.b ) }"
    contract = check_text(text, "f")[0]
    assert contract is not None
    with pytest.raises(NotExpressible, match="assumption A1: it speaks of the output b"):
        generate(contract.nodes[0], ["G1"])


def test_a_function_is_of_the_type_of_what_it_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not of what it yields; one of three numbers is called once, one of any number two after two."""
    r, x = t.Variable(t.Role.INPUT, "r", REAL), t.Variable(t.Role.INPUT, "x", INTEGER)

    def said(name: t.Builtin, *parts: t.Variable) -> str:
        term = t.Compare("==", t.Operation(name, parts, INTEGER), t.Literal(0, INTEGER))
        return print_clause("c", term, Vocabulary(Names(), Names(), (r, x)))[0].body

    assert said(t.Builtin.ABS, r) == "Types.AbsReal(in_r) == 0"
    assert said(t.Builtin.ABS, x) == "Types.AbsInt(in_x) == 0"
    assert said(t.Builtin.MAX, x, x, x) == "Types.MaxInt(Types.MaxInt(in_x, in_x), in_x) == 0"
    of_three = {"max": replace(OPERATORS["max"], takes=(3, 3))}
    monkeypatch.setattr("avow.backends.dafny.printer.OPERATORS", {**OPERATORS, **of_three})
    assert said(t.Builtin.MAX, x, x, x) == "Types.MaxInt(in_x, in_x, in_x) == 0"
