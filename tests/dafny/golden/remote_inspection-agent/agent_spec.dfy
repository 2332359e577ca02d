// Generated: what an implementation of node agent must do. Do not edit.
include "agent_contract.dfy"
abstract module {:options "--function-syntax:3"} AgentSpec {
  import Types
  import Contract

  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.
  predicate Env(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase)

  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.
  lemma EnvNotEmpty() returns (in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase)
    ensures Contract.exit_known(in_wayP)
    ensures Contract.one_waypoint(in_wayP, in_at)
    ensures Env(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase)

  method Step(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase) returns (out_command: Types.CommandSet, out_phase: Types.Phase)
    requires Contract.exit_known(in_wayP)
    requires Contract.one_waypoint(in_wayP, in_at)
    requires Env(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase)
    ensures Contract.next_waypoint(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command)
    ensures Contract.inspect_here(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command)
    ensures Contract.exit_on_danger(in_wayP, in_radiationStatus, in_phase, out_command)
    ensures Contract.abandon(in_radiationStatus, in_phase, out_phase)
    ensures Contract.end_of_mission(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_phase)
}
