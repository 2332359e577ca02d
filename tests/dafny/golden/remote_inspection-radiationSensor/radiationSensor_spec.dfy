// Generated: what an implementation of node radiationSensor must do. Do not edit.
include "radiationSensor_contract.dfy"
abstract module {:options "--function-syntax:3"} RadiationSensorSpec {
  import Types
  import Contract

  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.
  predicate Env(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool)

  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.
  lemma EnvNotEmpty() returns (in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool)
    ensures Contract.reading(in_r)
    ensures Env(in_r, in_command, in_before)

  method Step(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool) returns (out_radiationStatus: Types.RadStat, out_inspected: (nat) -> bool)
    requires Contract.reading(in_r)
    requires Env(in_r, in_command, in_before)
    ensures Contract.marks_inspected(in_command, in_before, out_inspected)
    ensures Contract.low(in_r, out_radiationStatus)
    ensures Contract.medium(in_r, out_radiationStatus)
    ensures Contract.high(in_r, out_radiationStatus)
}
