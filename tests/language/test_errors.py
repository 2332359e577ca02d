"""Bad contracts: every error with its code and place, all in one run."""

from __future__ import annotations

import re

import pytest

from avow.base.codes import LANGUAGE, sections
from avow.language.load import check_text

FRAME = """\
context { Stat : {red, green}; Cmd : {move(REAL, REAL), stop}; At : REAL x REAL --> BOOL; Limit = 3; }
node n {
  inputs( at : At, r : REAL, k : NATURAL, both : BOOL, sq : <REAL> )
  outputs( stat : Stat, cmd : Cmd, both : BOOL )
  topics()
  guarantee( %s )
}
"""


def errors(text: str) -> list[str]:
    contract, found = check_text(text, "f")
    assert (contract is None) == any(d.is_error for d in found)
    return [f"{d.code} {d.message} [{d.hint}]" for d in found if d.is_error]


@pytest.mark.parametrize("code", [c for c in sections()[LANGUAGE].values() if c.example], ids=lambda c: c.code)
def test_every_code_has_an_example_that_triggers_it(code) -> None:  # type: ignore[no-untyped-def]
    found = check_text(code.text, "f")[1]
    assert code.code in {d.code for d in found}
    assert all(d.severity is sections()[LANGUAGE][d.code].severity for d in found)
    assert {d.code for d in found if d.is_error} <= {code.code, *_FOLLOWING.get(code.code, ())}
    for d in found:
        assert d.span is not None
        assert d.code in sections()[LANGUAGE]


_FOLLOWING = {"RCL104": ("RCL113",), "RCL006": ("RCL101", "RCL107", "RCL111", "RCL105")}


def test_codes_without_example_are_few() -> None:
    assert {c.code for c in sections()[LANGUAGE].values() if not c.example} == {
        "RCL002",
        "RCL003",
        "RCL004",
        "RCL007",
        "RCL206",
    }


@pytest.mark.parametrize(
    ("formula", "message"),
    [
        ("stat == gren", r"RCL201 the name `gren` is not declared \[did you mean `green`\?\]"),
        ("in.stat == red", r"RCL203 node `n` has no input `stat` \[it is an output: write `out.stat`\]"),
        ("both", r"RCL202 `both` is both an input and an output of node `n` \[write `in.both` or `out.both`\]"),
        ("stat == r", r"RCL302 `==` between different types: Stat and REAL"),
        ('stat == "red"', r"RCL302 .* \[the values of Stat are red, green\]"),
        ("at == TRUE", r"RCL302 .* \[apply `at` to its 2 arguments first\]"),
        ("at(1)", r"RCL305 `at` takes 2 arguments and is given 1 \[its parameters are \(REAL, REAL\)\]"),
        ("at(1, 2, 3)", "RCL305"),
        ("at()", "RCL305 `at` takes 2 arguments and is given none"),
        ("at", r"RCL301 .*\[compare it each time"),
        ("cmd == move", "RCL305 `move` needs 2 arguments"),
        ("stat(3) == red", r"RCL304 `stat` is of type Stat"),
        ("r(3)", "RCL304 `r` is of type REAL"),
        ("red(1) == red", "RCL304 `red` is an element of Stat"),
        ("forall(r in REAL | r > 0)", r"RCL207 `r` is already an input \[choose another name, such as `r'`\]"),
        (
            "forall(a in REAL | exists(a in REAL | a > 0))",
            "RCL207 `a` is already a variable of an enclosing quantifier",
        ),
        ("forall(a, a in REAL | a > 0)", "RCL207"),
        ("forall(red in REAL | TRUE)", "RCL207 `red` is already an element"),
        ("forall(a in Rael | a > 0)", "RCL208 the type or set `Rael` is not declared"),
        ("forall(a in in.Stat | a == red)", r"RCL203 .*\[write `Stat` alone: it is a type\]"),
        ("forall(f in At | f(1, 2))", "RCL310"),
        ("k(1)", "RCL304"),
        ("cmd == move(1, red)", "RCL303 this argument of `move` must be of type REAL and is of type Stat"),
        ("stat < red", "RCL308"),
        ("r + stat > 1", "RCL308"),
        ("0 < r > 1", "RCL121 a chain of comparisons goes one way"),
        ("r != 1 < 2", "RCL121"),
        ("stat in Limit", "RCL307 `in` wants a set or a sequence"),
        ("r in REAL", "RCL307"),
        ("{1} == {2}", "RCL302 sets are not compared"),
        ("r == 1 / 0", "RCL309"),
        ("length(r) > 0", "RCL303 `length` is of a sequence"),
        ("sq(1.5) > 0", "RCL303 a position in a sequence"),
        ("other.stat == red", r"RCL205 .*\[write `out.stat`: a contract"),
        ("stat == Stat", "RCL204"),
        ("not r", "RCL301"),
        ("r and both", "RCL301"),
        ("stat == red and", r"RCL120 a formula is missing after `and`"),
        ("stat = red", r"RCL120 .*\[equality is written `==`\]"),
        ("stat not in {red}", r"RCL120 .*\[write `!in`, `!="),
        ("r <> 3", r"RCL120 .*\[unequal is written `!=`\]"),
        ("stat == red;", "RCL120"),
        ("r < 0,5", r"RCL120 .*.*numbers with a decimal point\]"),
        ("true", r"RCL201 .*\[write `TRUE`\]"),
        ("forall(a, b | a in REAL and b in REAL and a < b)", r"RCL120 .*\[write `forall\(x, y in REAL"),
        ("stat == red <-> both", r"RCL101 `<->` is not RCL \[write `<=>`\]"),
        ("in.r => out.both", r"RCL101 `=>` is not RCL \[write `->` \(if … then\), or `>=` \(at least\)\]"),
        ("r < 90%", r"RCL101 .*0\.9 for 90 percent\]"),
        ("stat == red && TRUE", r"RCL101 .*\[write `and`\]"),
        ("∀ stat", "RCL101"),
        ("stat == réd", "RCL107"),
        ("rose(in.both) -> within[in.k steps](stat == red)", r"RCL323 `in.k` is no limit.* \[write the number"),
        ("once[in.r](in.both)", "RCL323"),
        ("once[sqrt(2) s](in.both)", r"RCL323 `sqrt.2.` is no limit: .* by `\+ - \* /` only \[write the num"),
        ("forall(i in NATURAL | held[i steps](in.both))", "RCL323"),
        ("in.both since[< (Limit - 4) s] stat == red", "RCL323 `.Limit - 4.` is no limit: it is a number from 0"),
    ],
)
def test_messages(formula: str, message: str) -> None:
    found = errors(FRAME % formula)
    assert any(re.search(message, line) for line in found), found


def test_an_error_of_type_says_where_the_port_is_declared() -> None:
    """The mistake may be there: then each use is an error."""
    text = "node n {{ inputs( )\n outputs( v : {} )\n topics()\n guarantee g ( {} ) }}"
    for kind, formula in (
        ("BOOL", "out.v <= 1"),
        ("BOOL", "out.v + 1 > 2"),
        ("BOOL", "abs(out.v) > 2"),
        ("REAL", "out.v"),
    ):
        (fault,) = (d for d in check_text(text.format(kind, formula), "f")[1] if d.is_error)
        assert [(said, at.line) for said, at in fault.notes if at] == [(f"`v` is declared as {kind} here", 2)]


def test_a_limit_may_be_computed_from_constants() -> None:
    assert errors(FRAME % "rose(in.both) -> within[(2 * Limit - 1) steps](once[Limit / 2](in.both))") == []


@pytest.mark.parametrize("number", ["1500", "1.5", "-2", "0"])
@pytest.mark.parametrize("unit", ["mm", "m", "kg", "percent"])
@pytest.mark.parametrize(
    "formula", ["in.v < %s", "%s > in.v", "in.v < %s and in.v > 0", "in.v < %s/s", "(in.v - %s) < 1"]
)
def test_a_number_has_no_unit(number: str, unit: str, formula: str) -> None:
    text = "node n { inputs( v : REAL ) outputs( b : BOOL ) topics() guarantee g ( %s ) }"
    faults = [d for d in check_text(text % (formula % f"{number} {unit}"), "f")[1] if d.is_error]
    assert [d.hint for d in faults] == [
        f"only times have units (`500 ms`): write the number in the port's own unit, without `{unit}`"
    ]


def test_all_errors_of_a_file_in_one_run() -> None:
    text = """\
context { A : {a, b}; B : ; C : {c} D : Missing; }
node first {
  inputs( x : A )
  outputs( y : A, z : Nope )
  topics( Bool y matches(out.yy) )
  assume( x == )
  guarantee( y == q and x == 3 and w > 1 )
  guarantee( (y == a )
  guarantee( y == a ) )
}
node second {
  inputs(), outputs( y : A ) topics()
  guarantee( y == c2 )
node third { inputs() outputs( y : A ) topics() guarantee( y == cc ) }
"""
    found = [d for d in check_text(text, "f")[1] if d.is_error]
    places = [(d.span.line, d.code) for d in found if d.span is not None]
    assert places == [
        (1, "RCL120"),
        (1, "RCL113"),
        (1, "RCL208"),
        (4, "RCL208"),
        (5, "RCL217"),
        (5, "RCL218"),
        (6, "RCL120"),
        (7, "RCL201"),
        (7, "RCL302"),
        (7, "RCL201"),
        (8, "RCL115"),
        (9, "RCL113"),
        (11, "RCL115"),
        (12, "RCL113"),
        (13, "RCL201"),
        (14, "RCL201"),
    ]


def test_a_broken_declaration_causes_no_further_errors() -> None:
    text = """\
context { A : {a, b ; B : {c}; }
node n { inputs( x : A, y : ) outputs( z : B ) topics() guarantee( x == a and y == b and z == c and q ) }
"""
    found = errors(text)
    assert len(found) == 3, found  # the brace, the type of y, and q


def test_the_prototypes_files() -> None:
    """`types` and `constants` for `context`, no inputs: said once each, and the rest of the file is still checked."""
    text = """\
constants { Way = {wayA, origin}; }
types { Windy : Way --> BOOL; }
node Agent {
  topics( string status )
  assume( )
  guarantee( forall(w in in.Way | in.windy(w) == TRUE ) ) -- remains
}
"""
    found = errors(text)
    assert sum("belong in one `context" in line for line in found) == 2
    assert sum("RCL118" in line for line in found) == 2
    assert any("`--` does not begin a comment" in line for line in found)
    assert any("this assumption says nothing" in line for line in found)
    assert not any("windy" in line for line in found), "the inputs are missing, which has been said"
    assert len(found) == 6


@pytest.mark.slow
@pytest.mark.parametrize(
    "text",
    [
        "(" * 10_000,
        FRAME % ("(" * 10_000 + "TRUE" + ")" * 10_000),
        FRAME % ("not " * 10_000 + "TRUE"),
        FRAME % ("r / k * " * 10_000 + "1 > 0"),
        FRAME % ("-(" * 10_000 + "1" + ")" * 10_000 + " > 0"),
        "context { A : " + "<" * 10_000 + "REAL" + ">" * 10_000 + "; }",
        "context {" * 10_000,
        "x" * 3_000_000,
        "9" * 100_000,
        '"' * 100_001,
        "/*" * 100_000,
        "node " * 100_000,
        *(
            FRAME % (sign * 100_000)
            for sign in ("\u200b", "（", "§ ", "é§", "[", "s[0] ", "'a' ", "“", "`", "a::", "..", "\\a ")
        ),
        *(FRAME % (words * 30_000) for words in ("(node) ", "inputs.r ", "b and < 3 ", "forall(x in REAL ", "#a ")),
        *(text * 100_000 for text in ("# a\n", "\r", "a b {", "G x ", "node node {", "node n { in( [ ' “ ")),
        "\x00\x01\xff" * 1000,
        "\ud800",
    ],
    ids=lambda t: f"{t[:12]!r}×{len(t)}",
)
def test_hostile_texts_are_diagnosed(text: str) -> None:
    contract, found = check_text(text, "f")
    assert contract is None
    assert 0 < len(found) <= 201
    assert max(len(d.message) for d in found) < 500
    assert all(d.span is not None for d in found)


def test_nesting_up_to_the_limit_works() -> None:
    for text in ("(" * 145 + "TRUE" + ")" * 145, "not " * 145 + "TRUE"):
        assert errors(FRAME % text) == []


def test_a_name_with_two_meanings_is_not_guessed() -> None:
    text = (
        "context {{ C : {{go, stop}}; L = 3; }} node n {{ inputs(go : BOOL, L : REAL) outputs(c : C) topics() G({}) }}"
    )
    assert any("RCL202 `go` is an element of a type, and an input" in e for e in errors(text.format("c == go")))
    assert any("RCL202 `L` is a constant, and an input" in e for e in errors(text.format("L > 1")))
    assert errors(text.format("in.go -> c == stop and in.L > 1")) == []


def test_circles_among_constants_and_types() -> None:
    assert any("RCL212" in e for e in errors("context { A = B + 1; B = A + 1; }"))
    assert any("RCL212" in e for e in errors("context { A : B; B : A; }"))
    assert any("RCL212" in e for e in errors("context { A : <A>; }"))


TOPICS = "node n {{ inputs(a : REAL, b : REAL) outputs(o : BOOL) topics( {} ) guarantee( o <=> a < b ) }}"


def test_several_variables_on_one_topic() -> None:
    for sound in (
        "p/T t matches(in.a), p/T t matches(in.b), bool o matches(out.o)",
        "p/T t matches(in.a), p/msg/T t matches(in.b), p/T t matches(out.o)",
    ):
        contract, found = check_text(TOPICS.format(sound), "f")
        assert contract is not None
        assert [d.code for d in found] == []
        assert [(t.name, t.port.name) for t in contract.nodes[0].topics if t.port is not None][:2] == [
            ("t", "a"),
            ("t", "b"),
        ]


@pytest.mark.parametrize(
    ("topics", "message"),
    [
        (
            "p/T t matches(in.a), p/U t matches(in.b)",
            "RCL216 the topic `t` is listed twice, as p/T and as p/U [correct one of them:",
        ),
        ("p/T t matches(in.a), p/srv/T t matches(in.b)", "RCL216 the topic `t` is listed twice, as p/T and as p/srv/T"),
        ("p/T t matches(in.a), p/T t matches(in.a)", "RCL216 the topic `t` is listed twice"),
        ("p/T t matches(in.a), p/T t", "RCL216 the topic `t` is listed twice"),
        ("p/T t, p/T t", "RCL216 the topic `t` is listed twice"),
    ],
)
def test_what_is_ambiguous_about_a_topic(topics: str, message: str) -> None:
    (found,) = errors(TOPICS.format(topics))
    assert found.startswith(message)


def test_a_brace_that_is_missing_is_told_as_that() -> None:
    (found,) = errors("node n inputs( a : BOOL ) outputs( b : BOOL ) topics() guarantee g ( in.a ) }")
    assert found == "RCL113 expected `{` after the node's name and not `inputs` [write `{` there]"


def test_a_variable_on_two_topics_is_worth_a_warning() -> None:
    contract, found = check_text(TOPICS.format("p/T t matches(in.a), p/U u matches(in.a)"), "f")
    assert contract is not None
    assert "two topics carry `in.a`: `t` and `u`" in {d.message for d in found if d.code == "RCL411"}


def test_one_mistake_made_again_and_again_hides_no_other() -> None:
    text = "node n { inputs( a : REAL ) outputs( b : REAL ) topics( )\n" + "  guarantee ( in.a § out.b )\n" * 300
    _, found = check_text(f"{text}  guarantee ( out.c > 0 ) }}", "f.rcl")
    signs = [d.message for d in found if "§" in d.message]
    assert len(signs) == 5
    assert "(300 times, of which 5 are shown)" in signs[0]
    assert "RCL006" not in {d.code for d in found}
    assert any("`c`" in d.message for d in found)
