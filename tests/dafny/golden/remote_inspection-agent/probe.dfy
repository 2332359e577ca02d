// Generated: AgentImpl used from outside. Do not edit.
module {:options "--function-syntax:3"} AgentProbe {
  import Types
  import Contract
  import Implementation = AgentImpl

  method Call(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase) returns (out_command: Types.CommandSet, out_phase: Types.Phase)
    requires Contract.exit_known(in_wayP)
    requires Contract.one_waypoint(in_wayP, in_at)
    requires Implementation.Env(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase)
    ensures Contract.next_waypoint(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command)
    ensures Contract.inspect_here(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_command)
    ensures Contract.exit_on_danger(in_wayP, in_radiationStatus, in_phase, out_command)
    ensures Contract.abandon(in_radiationStatus, in_phase, out_phase)
    ensures Contract.end_of_mission(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase, out_phase)
  { out_command, out_phase := Implementation.Step(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase); }

  lemma EnvAlways(in_wayP: (real, real, nat) -> bool, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool, in_phase: Types.Phase)
    requires Contract.exit_known(in_wayP)
    requires Contract.one_waypoint(in_wayP, in_at)
    ensures Implementation.Env(in_wayP, in_at, in_radiationStatus, in_inspected, in_phase)
  { }
}
