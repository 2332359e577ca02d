// Generated: NavigationImpl used from outside. Do not edit.
module {:options "--function-syntax:3"} NavigationProbe {
  import Types
  import Contract
  import Implementation = NavigationImpl

  method Call(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool) returns (out_at: (real, real) -> bool)
    requires Contract.one_position(in_position)
    requires Contract.was_somewhere(in_last)
    requires Implementation.Env(in_position, in_command, in_last)
    ensures Contract.arrives(in_command, out_at)
    ensures Contract.stays(in_command, in_last, out_at)
    ensures Contract.somewhere(out_at)
  { out_at := Implementation.Step(in_position, in_command, in_last); }

  lemma EnvAlways(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool)
    requires Contract.one_position(in_position)
    requires Contract.was_somewhere(in_last)
    ensures Implementation.Env(in_position, in_command, in_last)
  { }
}
