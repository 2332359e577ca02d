// A skeleton: copy it into the system's models/ and fill it in. Nothing is ever written over it there.
include "agent_spec.dfy"
module {:options "--function-syntax:3"} AgentImpl refines AgentSpec {
  predicate Env(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase) { true }

  lemma EnvNotEmpty() returns (in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase)
  {
    // give inputs that meet every assumption
  }

  method Step(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase) returns (out_command: Types.CommandSet, out_phase: Types.Phase)
  {
    // set the outputs; name the witnesses of existential guarantees, for example
    // assert Contract.guarantee_ex1(…, witness);
  }
}
