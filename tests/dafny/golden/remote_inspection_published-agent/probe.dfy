// Generated: AgentImpl used from outside. Do not edit.
module {:options "--function-syntax:3"} AgentProbe {
  import Types
  import Contract
  import Implementation = AgentImpl

  method Call(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool) returns (out_command: Types.CommandSet)
    requires Contract.A1(in_radiationStatus)
    requires Implementation.Env(in_wayP, in_at, in_radiationStatus, in_inspected)
    ensures Contract.G1(in_wayP, in_at, in_radiationStatus, in_inspected, out_command)
    ensures Contract.G2(in_wayP, in_at, in_inspected, out_command)
    ensures Contract.G3(in_wayP, in_radiationStatus, out_command)
  { out_command := Implementation.Step(in_wayP, in_at, in_radiationStatus, in_inspected); }

  lemma EnvAlways(in_wayP: (real, real) -> nat, in_at: (real, real) -> bool, in_radiationStatus: Types.RadStat, in_inspected: (nat) -> bool)
    requires Contract.A1(in_radiationStatus)
    ensures Implementation.Env(in_wayP, in_at, in_radiationStatus, in_inspected)
  { }
}
