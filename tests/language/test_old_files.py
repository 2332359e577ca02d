"""What people who know the paper, earlier versions of its tool, or another notation would write: accepted, or answered
by one message for each slip that says what to write instead."""

from __future__ import annotations

import pytest

from avow.language.format import format_text
from avow.language.load import check_text

# The paper's listings, as typed there.
CONTEXT = """\
context{
 WayP : REAL x REAL --> NATURAL ;
 RadStat : {red, orange, green} ;
 CommandSet : { move(REAL, REAL), inspect(NATURAL) };
 PositionType : REAL x REAL --> BOOL ;
 AtType: REAL x REAL --> BOOL;
 InspectedType :  NATURAL --> BOOL;
 SensorsType : {}; }
"""
AGENT = """\
node agent{

inputs( wayP : WayP, at : AtType, radiationStatus : RadStat, inspected : InspectedType )

outputs( command : CommandSet  )

topics( gazebo_radiation_plugin/Snapshot command matches(out.command),
gazebo_radiation_plugin/Snapshot inspected matches(in.inspected),
gazebo_radiation_plugin/Snapshot at matches(in.at),
gazebo_radiation_plugin/Snapshot wayPNow matches(in.wayP),
gazebo_radiation_plugin/Snapshot radiationStatus matches(in.radiationStatus) )

assume( in.radiationStatus in {red, orange, green} )

guarantee(forall(x', y' in REAL, i in NATURAL |
  in.at(x', y') == TRUE and in.wayP(x', y') == i and in.inspected(i) == TRUE and in.radiationStatus !in {red, orange} ->
  exists(x, y in REAL | (in.wayP(x, y) == i + 1  or
    (forall( x'', y'' in REAL | in.wayP(x'', y'') != i+1 and in.wayP(x, y) == 0))) and out.command == move(x, y) )) )

guarantee(forall(x', y' in REAL, i in NATURAL |
  in.at(x', y') == TRUE and in.wayP(x', y') == i and in.inspected(i) == FALSE -> out.command == inspect(i) ) )

guarantee(forall(x', y' in REAL, i in NATURAL |
  in.radiationStatus in {red, orange} or not exists( x, y in REAL | in.wayP(x, y) == i + 1 )
  -> exists (x'', y'' in REAL | in.wayP(x'', y'') == 0 and out.command == move(x'', y'') ) ) )
}
"""
# As earlier versions of its tool had them: bare names, `A`, `G`, `;` for `|`, spaces anywhere.
BARE = """\
node sensor
{
inputs( r : REAL , command : CommandSet)
outputs( radiationStatus : RadStat, inspected : InspectedType  )

topics(plugins/Reading r matches(r),
plugins/Command command matches(command), plugins/Inspection inspected matches(inspected),
string radiationStatus matches(radiationStatus) )

A( 0 <= r )
G(
forall( i in NATURAL ; command == inspect(i) ->
(inspected(i) == TRUE
and 0 <= r < 120 -> radiationStatus == green
and 250 <= r -> radiationStatus == red )
)
)
}
"""
PAPER = CONTEXT + AGENT


@pytest.mark.parametrize(
    "text",
    [
        PAPER,
        PAPER.replace("\n", "\r\n"),
        PAPER.replace("\n", "\r"),
        "\ufeff" + PAPER,
        PAPER.replace(" ", "\t"),
        PAPER.strip(),
        PAPER.replace("\n", " "),
        PAPER.replace("\n", "\n\n\n"),
        PAPER.replace("| ", ";").replace(" |", ";"),
        PAPER.replace("guarantee", "G").replace("assume", "A"),
        AGENT + CONTEXT,
        CONTEXT + BARE,
        PAPER.replace("guarantee(", "guarantee /* three */ (").replace("node agent{", "node agent // it\n{"),
    ],
    ids=range(13),
)
def test_accepted(text: str) -> None:
    contract, found = check_text(text, "f")
    assert contract is not None, [f"{d.span} {d.message}" for d in found if d.is_error]
    assert check_text(format_text(text, "f"), "f")[0] == contract


def node(formula: str = "o", *, before: str = "", **parts: str) -> str:
    inside = {"inputs": "r : REAL, st : Stat", "outputs": "o : BOOL", "topics": "", **parts}
    lists = " ".join(f"{name}( {inside[name]} )" for name in ("inputs", "outputs", "topics"))
    return f"context {{ Stat : {{red, green}}; {before} }}\nnode n {{ {lists} guarantee( {formula} ) }}\n"


SLIPS = [
    # keywords
    ("NODE n { INPUTS() OUTPUTS( o : BOOL ) TOPICS() GUARANTEE( o ) }",
     ["write `node`", *(f"write `{w}`" for w in ("inputs", "outputs", "topics", "guarantee"))]),
    ("node n { input() output( o : BOOL ) topic() assumption( TRUE ) guarantees( o ) }",
     [f"write `{w}`" for w in ("inputs", "outputs", "topics", "assume", "guarantee")]),
    ("node n { inputs() outputs( o : BOOL ) topics() G1( o ) }", ["`guarantee G1( … )`"]),
    ("node n { inputs() outputs( o : BOOL ) topics() guarantee { o } }", ["write `guarantee( … )`"]),
    ("node n { inputs() outputs( o : BOOL ) topics() guarantee( o ); }",
     ["no sign stands between the parts of a node"]),
    ('node "n" { inputs() outputs( o : BOOL ) topics() guarantee( o ) }', ["without quotation marks"]),
    ("node my-node { inputs() outputs( o : BOOL ) topics() guarantee( o ) }", ["letters, digits and `_`"]),
    ("node n { topics(string chatter) guarantee( TRUE ) }",
     ["write `inputs( name : TYPE, … )`", "write `outputs( name : TYPE, … )`"]),
    ("types { A : {a}; }", ["both belong in one `context { … }`"]),
    ("Interface { a; }", ["write `node Interface {`"]),
    # declarations
    (node(before="A : Up | Down;"), ["a choice of values as `{a, b}`"]),
    (node(before="A := 3;"), ["`=` for a constant"]),
    (node(before="A : 3;"), ["a constant is declared with `=`"]),
    (node(before="A = REAL;"), ["a type is declared with `:`"]),
    (node(before="A : REAL -> BOOL;"), ["`A x B --> C`"]),
    (node(before="A : seq REAL;"), ["written `<REAL>`"]),
    (node(before="A : REAL*;"), ["written `<REAL>`"]),
    (node(before="Stat : {red, green};"), ["remove one of the two"]),
    (node(before="A : {a}").replace("{a} }", "{a} }"), ["end every declaration with `;`"]),
    # ports and topics
    (node(inputs="r : real, s : bool, t : float64, u : Nat, st : Stat"),
     ["did you mean `REAL`?", "did you mean `BOOL`?", "did you mean `REAL`?", "did you mean `NATURAL`?"]),
    (node(inputs="r : REAL; st : Stat"), ["separate them by commas"]),
    (node(inputs="r : Missing, st : Stat"), ["check this file with the one that declares it"]),
    (node(topics="std_msgs.Bool o matches(out.o)"), ["`std_msgs/…`"]),
    (node(topics="std_msgs::msg::Bool o matches(out.o)"), ["write `package/Type`"]),
    (node(topics="std_msgs/Bool / o matches(out.o)"), ["between type and name stands no slash"]),
    (node(topics="std_msgs/Bool o match(out.o)"), ["did you mean `matches`?"]),
    (node(topics="Bool o matches(out.o)"), ["did you mean `bool`?"]),
    # formulas
    (node("o == true"), ["write `TRUE`"]),
    (node("o AND r > 0"), ["write `and`"]),
    (node("o && r > 0"), ["write `and`"]),
    (node("o /\\ r > 0 \\/ o"), ["write `and`", "write `or`"]),
    (node("st \\in {red}"), ["write `in`"]),
    (node("st not in {red}"), ["write `!in`"]),
    (node("st = red"), ["equality is written `==`"]),
    (node("o := TRUE"), ["write `==` for equality"]),
    (node('st == "red"'), ["without quotation marks"]),
    (node("r => o"), ["write `->`"]),
    (node("r > 0 implies o"), ["write `->`"]),
    (node("if r > 0 then o"), ["if A then B"]),
    (node("forall(x, y | x in REAL and y in REAL and x > y)"), ["before the bar"]),
    (node("forall x in REAL | x > r"), ["write `forall(x in S | …)`"]),
    (node("forall(x : REAL | x > r)"), ["say what each variable ranges over before the bar"]),
    (node("exists_unique((x, y) in REAL x REAL | x > y)"), ["the variables stand without parentheses"]),
    (node("exists!(x in REAL | x > r)"), ["write `exists_unique(x in S | …)`"]),
    (node("∃! x"), ["write `exists_unique(x in S | …)`"]),
    (node("exists_1(x in REAL | x > r)"), ["write `exists_unique(x in S | …)`, not `exists_1`"]),
    (node("always(o)"), ["properties of whole runs stand in the plan"]),
    (node("o -- eventually\n"), ["write `// …`"]),
    ("# a note\n" + node(), ["write `// …`"]),
    (node("forall(w in in.Stat | w == red)"), ["write `Stat` alone"]),
    (node("r(2) > 0"), ["compare it"]),
]  # fmt: skip


@pytest.mark.parametrize(("text", "hints"), SLIPS, ids=[f"{i}" for i in range(len(SLIPS))])
def test_answered(text: str, hints: list[str]) -> None:
    """Each slip has its message, in order, at a place that is not empty; and nothing is said besides."""
    contract, found = check_text(text, "f")
    errors = [d for d in found if d.is_error]
    assert contract is None
    said = [f"{d.hint}" for d in errors]
    rest = iter(said)
    for hint in hints:
        assert any(hint in line for line in rest), (hint, said)
    assert len(errors) == len(hints), [f"{d.span} {d.message} [{d.hint}]" for d in errors]
    lines = text.split("\n")
    for error in errors:
        assert error.span is not None
        assert lines[error.span.line - 1][error.span.column - 1 :].strip() or error.span.line == len(lines)
