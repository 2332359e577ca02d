// Generated: what an implementation of node navigation must do. Do not edit.
include "navigation_contract.dfy"
abstract module {:options "--function-syntax:3"} NavigationSpec {
  import Types
  import Contract

  // The implementer's: what else is assumed of the inputs (reported as an added assumption), or true.
  predicate Env(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool)

  // The implementer's: inputs that meet every assumption, so that nothing is proved of no case at all.
  lemma EnvNotEmpty() returns (in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool)
    ensures Contract.one_position(in_position)
    ensures Contract.was_somewhere(in_last)
    ensures Env(in_position, in_command, in_last)

  method Step(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool) returns (out_at: (real, real) -> bool)
    requires Contract.one_position(in_position)
    requires Contract.was_somewhere(in_last)
    requires Env(in_position, in_command, in_last)
    ensures Contract.arrives(in_command, out_at)
    ensures Contract.stays(in_command, in_last, out_at)
    ensures Contract.somewhere(out_at)
}
