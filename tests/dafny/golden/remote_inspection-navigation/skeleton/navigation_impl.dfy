// A skeleton: copy it into the system's models/ and fill it in. Nothing is ever written over it there.
include "navigation_spec.dfy"
module {:options "--function-syntax:3"} NavigationImpl refines NavigationSpec {
  predicate Env(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool) { true }

  lemma EnvNotEmpty() returns (in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool)
  {
    // give inputs that meet every assumption
  }

  method Step(in_position: (real, real) -> bool, in_command: Types.CommandSet, in_last: (real, real) -> bool) returns (out_at: (real, real) -> bool)
  {
    // set the outputs; name the witnesses of existential guarantees, for example
    // assert Contract.guarantee_ex1(…, witness);
  }
}
