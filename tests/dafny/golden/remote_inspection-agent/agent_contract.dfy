// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.
include "types.dfy"
module {:options "--function-syntax:3"} Contract {
  import Types

  // assumption exit_known: The map knows the exit, waypoint 0
  predicate exit_known_ex1(in_wayP: (real, real, nat) -> bool, x: real, y: real)
  { in_wayP(x, y, 0) }
  predicate exit_known(in_wayP: (real, real, nat) -> bool)
  { exists x: real, y: real :: exit_known_ex1(in_wayP, x, y) }

  // assumption one_waypoint: The robot is at no more than one waypoint at a time
  predicate one_waypoint_all1(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, x: real, y: real, x': real, y': real, i: nat, j: nat)
  { (in_at(x, y) && in_wayP(x, y, i) && in_at(x', y') && in_wayP(x', y', j)) ==> (i == j) }
  predicate one_waypoint(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool)
  { forall x: real, y: real, x': real, y': real, i: nat, j: nat :: one_waypoint_all1(in_wayP, in_at, x, y, x', y', i, j) }

  // guarantee next_waypoint: If the robot is at waypoint i and has inspected it, and the radiation is not dangerous, then it moves to the next waypoint, or to waypoint 0 if there is no next
  predicate next_waypoint_ex3(in_wayP: (real, real, nat) -> bool, i: nat, x'': real, y'': real)
  { in_wayP(x'', y'', i + 1) }
  predicate next_waypoint_ex2(in_wayP: (real, real, nat) -> bool, out_command: Types.CommandSet, i: nat, x: real, y: real)
  { (in_wayP(x, y, i + 1) || (in_wayP(x, y, 0) && !(exists x'': real, y'': real :: next_waypoint_ex3(in_wayP, i, x'', y'')))) && (out_command == Types.CommandSet.move(x, y)) }
  predicate next_waypoint_all1(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase, out_command: Types.CommandSet, x': real, y': real, i: nat)
  { (in_at(x', y') && in_wayP(x', y', i) && in_inspected(i) && !(in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) && (in_phase == Types.Phase.exploring)) ==> (exists x: real, y: real :: next_waypoint_ex2(in_wayP, out_command, i, x, y)) }
  predicate next_waypoint(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase, out_command: Types.CommandSet)
  { forall x': real, y': real, i: nat :: next_waypoint_all1(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command, x', y', i) }

  // guarantee inspect_here: If the robot is at waypoint i and has not inspected it, and the radiation is not dangerous, then it inspects it
  predicate inspect_here_all1(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase, out_command: Types.CommandSet, x': real, y': real, i: nat)
  { (in_at(x', y') && in_wayP(x', y', i) && !in_inspected(i) && !(in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) && (in_phase == Types.Phase.exploring)) ==> (out_command == Types.CommandSet.inspect(i)) }
  predicate inspect_here(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase, out_command: Types.CommandSet)
  { forall x': real, y': real, i: nat :: inspect_here_all1(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command, x', y', i) }

  // guarantee exit_on_danger: If the radiation is dangerous, or the mission is over, then the robot moves to the exit, waypoint 0
  predicate exit_on_danger_ex1(in_wayP: (real, real, nat) -> bool, out_command: Types.CommandSet, x: real, y: real)
  { in_wayP(x, y, 0) && (out_command == Types.CommandSet.move(x, y)) }
  predicate exit_on_danger(in_wayP: (real, real, nat) -> bool, in_radiationStatus: Types.RadStat, in_phase: Types.Phase, out_command: Types.CommandSet)
  { ((in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) || (in_phase == Types.Phase.leaving)) ==> (exists x: real, y: real :: exit_on_danger_ex1(in_wayP, out_command, x, y)) }

  // guarantee abandon: Dangerous radiation ends the mission, and it stays ended (REQ3)
  predicate abandon(in_radiationStatus: Types.RadStat, in_phase: Types.Phase, out_phase: Types.Phase)
  { ((in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) || (in_phase == Types.Phase.leaving)) ==> (out_phase == Types.Phase.leaving) }

  // guarantee end_of_mission: Without danger the mission goes on until the last waypoint has been inspected
  predicate end_of_mission_ex2(in_wayP: (real, real, nat) -> bool, i: nat, x'': real, y'': real)
  { in_wayP(x'', y'', i + 1) }
  predicate end_of_mission_ex1(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_inspected: (nat) -> bool, x': real, y': real, i: nat)
  { in_at(x', y') && in_wayP(x', y', i) && in_inspected(i) && !(exists x'': real, y'': real :: end_of_mission_ex2(in_wayP, i, x'', y'')) }
  predicate end_of_mission(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase, out_phase: Types.Phase)
  { (!(in_radiationStatus == Types.RadStat.red || in_radiationStatus == Types.RadStat.orange) && (in_phase == Types.Phase.exploring)) ==> ((out_phase == Types.Phase.leaving) <==> (exists x': real, y': real, i: nat :: end_of_mission_ex1(in_wayP, in_at, in_inspected, x', y', i))) }
}
