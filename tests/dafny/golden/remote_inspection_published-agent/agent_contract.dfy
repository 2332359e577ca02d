// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.
include "types.dfy"
module {:options "--function-syntax:3"} Contract {
  import Types

  // assumption A1: The Radiation Status that it receives is either red, orange, or green
  predicate A1(in_radiationStatus: Types.RadStat)
  { in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange || in_radiationStatus == Types.RadStat.green }

  // guarantee G1: If the Robot is at, and has inspected waypoint i, and the radiation level was not dangerous, then it will move to the next waypoint or to waypoint 0 (the exit) if there is no next waypoint.
  predicate G1_all3(in_wayP: (real, real) -> nat, i: nat, x: real, y: real, x'': real, y'': real)
  { (in_wayP(x'', y'') != (i + 1)) && (in_wayP(x, y) == 0) }
  predicate G1_ex2(in_wayP: (real, real) -> nat, out_command: Types.CommandSet, i: nat, x: real, y: real)
  { ((in_wayP(x, y) == (i + 1)) || (forall x'': real, y'': real :: G1_all3(in_wayP, i, x, y, x'', y''))) && (out_command == Types.CommandSet.move(x, y)) }
  predicate G1_all1(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, out_command: Types.CommandSet, x': real, y': real, i: nat)
  { ((in_at(x', y') == true) && (in_wayP(x', y') == i) && (in_inspected(i) == true) && !(in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange)) ==> (exists x: real, y: real :: G1_ex2(in_wayP, out_command, i, x, y)) }
  predicate G1(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, out_command: Types.CommandSet)
  { forall x': real, y': real, i: nat :: G1_all1(in_wayP, in_at, in_radiationStatus, in_inspected, out_command, x', y', i) }

  // guarantee G2: And, if the Robot is at, and has not inspected, waypoint i, then inspect it.
  predicate G2_all1(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_inspected: (nat) -> bool, out_command: Types.CommandSet, x': real, y': real, i: nat)
  { ((in_at(x', y') == true) && (in_wayP(x', y') == i) && (in_inspected(i) == false)) ==> (out_command == Types.CommandSet.inspect(i)) }
  predicate G2(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_inspected: (nat) -> bool, out_command: Types.CommandSet)
  { forall x': real, y': real, i: nat :: G2_all1(in_wayP, in_at, in_inspected, out_command, x', y', i) }

  // guarantee G3: And, if the Robot inspects a waypoint and the radiation level is dangerous, or there are no more waypoints, then return to the original waypoint (the exit)
  predicate G3_ex2(in_wayP: (real, real) -> nat, i: nat, x: real, y: real)
  { in_wayP(x, y) == (i + 1) }
  predicate G3_ex3(in_wayP: (real, real) -> nat, out_command: Types.CommandSet, x'': real, y'': real)
  { (in_wayP(x'', y'') == 0) && (out_command == Types.CommandSet.move(x'', y'')) }
  predicate G3_all1(in_wayP: (real, real) -> nat, in_radiationStatus: Types.RadStat, out_command: Types.CommandSet, x': real, y': real, i: nat)
  { ((in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) || !(exists x: real, y: real :: G3_ex2(in_wayP, i, x, y))) ==> (exists x'': real, y'': real :: G3_ex3(in_wayP, out_command, x'', y'')) }
  predicate G3(in_wayP: (real, real) -> nat, in_radiationStatus: Types.RadStat, out_command: Types.CommandSet)
  { forall x': real, y': real, i: nat :: G3_all1(in_wayP, in_radiationStatus, out_command, x', y', i) }
}
