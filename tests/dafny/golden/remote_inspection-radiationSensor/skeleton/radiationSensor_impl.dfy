// A skeleton: copy it into the system's models/ and fill it in. Nothing is ever written over it there.
include "radiationSensor_spec.dfy"
module {:options "--function-syntax:3"} RadiationSensorImpl refines RadiationSensorSpec {
  predicate Env(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool) { true }

  lemma EnvNotEmpty() returns (in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool)
  {
    // give inputs that meet every assumption
  }

  method Step(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool) returns (out_radiationStatus: Types.RadStat, out_inspected: (nat) -> bool)
  {
    // set the outputs; name the witnesses of existential guarantees, for example
    // assert Contract.guarantee_ex1(…, witness);
  }
}
