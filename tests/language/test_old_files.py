"""Contracts as the paper and earlier versions of its tool write them are accepted."""

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
