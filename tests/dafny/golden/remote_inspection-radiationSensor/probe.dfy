// Generated: RadiationSensorImpl used from outside. Do not edit.
module {:options "--function-syntax:3"} RadiationSensorProbe {
  import Types
  import Contract
  import Implementation = RadiationSensorImpl

  method Call(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool) returns (out_radiationStatus: Types.RadStat, out_inspected: (nat) -> bool)
    requires Contract.reading(in_r)
    requires Implementation.Env(in_r, in_command, in_before)
    ensures Contract.marks_inspected(in_command, in_before, out_inspected)
    ensures Contract.low(in_r, out_radiationStatus)
    ensures Contract.medium(in_r, out_radiationStatus)
    ensures Contract.high(in_r, out_radiationStatus)
  { out_radiationStatus, out_inspected := Implementation.Step(in_r, in_command, in_before); }

  lemma EnvAlways(in_r: real, in_command: Types.CommandSet, in_before: (nat) -> bool)
    requires Contract.reading(in_r)
    ensures Implementation.Env(in_r, in_command, in_before)
  { }
}
