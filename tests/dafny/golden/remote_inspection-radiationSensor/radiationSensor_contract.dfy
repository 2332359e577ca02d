// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.
include "types.dfy"
module {:options "--function-syntax:3"} Contract {
  import Types

  // assumption reading: The radiation reading is greater than or equal to 0
  predicate reading(in_r: real)
  { 0.0 <= in_r }

  // guarantee marks_inspected: If the command is to inspect waypoint i, then waypoint i is inspected; nothing else changes
  predicate marks_inspected_all1(in_command: Types.CommandSet, in_before: (nat) -> bool, out_inspected: (nat) -> bool, i: nat)
  { out_inspected(i) <==> (in_before(i) || (in_command == Types.CommandSet.inspect(i))) }
  predicate marks_inspected(in_command: Types.CommandSet, in_before: (nat) -> bool, out_inspected: (nat) -> bool)
  { forall i: nat :: marks_inspected_all1(in_command, in_before, out_inspected, i) }

  // guarantee low: Low radiation is green
  predicate low(in_r: real, out_radiationStatus: Types.RadStat)
  { ((0.0 <= in_r) && (in_r < 120.0)) ==> (out_radiationStatus == Types.RadStat.green) }

  // guarantee medium: Medium radiation is orange
  predicate medium(in_r: real, out_radiationStatus: Types.RadStat)
  { ((120.0 <= in_r) && (in_r < 250.0)) ==> (out_radiationStatus == Types.RadStat.orange) }

  // guarantee high: High radiation is red
  predicate high(in_r: real, out_radiationStatus: Types.RadStat)
  { (250.0 <= in_r) ==> (out_radiationStatus == Types.RadStat.red) }
}
