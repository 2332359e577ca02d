// Generated: what an implementation of node agent must do. Do not edit.
include "agent_contract.dfy"
abstract module {:options "--function-syntax:3"} AgentSpec {
  import Types
  import Contract

  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.
  predicate Env(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool)

  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.
  lemma EnvNotEmpty() returns (in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool)
    ensures Contract.A1(in_radiationStatus)
    ensures Env(in_wayP, in_at, in_radiationStatus, in_inspected)

  method Step(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool) returns (out_command: Types.CommandSet)
    requires Contract.A1(in_radiationStatus)
    requires Env(in_wayP, in_at, in_radiationStatus, in_inspected)
    ensures Contract.G1(in_wayP, in_at, in_radiationStatus, in_inspected, out_command)
    ensures Contract.G2(in_wayP, in_at, in_inspected, out_command)
    ensures Contract.G3(in_wayP, in_radiationStatus, out_command)
}
