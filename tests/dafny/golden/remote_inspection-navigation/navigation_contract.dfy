// Generated: one predicate for each clause of the contract, and one for each quantifier's body. Do not edit.
include "types.dfy"
module {:options "--function-syntax:3"} Contract {
  import Types

  // assumption one_position: There is a unique (x, y) that is the robot's estimated position
  predicate one_position_one1(in_position: (real, real) -> bool, x: real, y: real)
  { in_position(x, y) }
  predicate one_position(in_position: (real, real) -> bool)
  { (exists x: real, y: real :: one_position_one1(in_position, x, y)) && (forall x: real, y: real, x_other: real, y_other: real :: one_position_one1(in_position, x, y) && one_position_one1(in_position, x_other, y_other) ==> x == x_other && y == y_other) }

  // assumption was_somewhere: All places that it last reported lie within the tolerance of one place
  predicate was_somewhere_all2(in_last: (real, real) -> bool, a: real, b: real, x: real, y: real)
  { in_last(x, y) ==> ((((a - 0.25) <= x) && (x <= (a + 0.25))) && (((b - 0.25) <= y) && (y <= (b + 0.25)))) }
  predicate was_somewhere_ex1(in_last: (real, real) -> bool, a: real, b: real)
  { forall x: real, y: real :: was_somewhere_all2(in_last, a, b, x, y) }
  predicate was_somewhere(in_last: (real, real) -> bool)
  { exists a: real, b: real :: was_somewhere_ex1(in_last, a, b) }

  // guarantee arrives: If the robot is told to move to (x, y), then it reports that it is at (x, y), to within the tolerance
  predicate arrives_all1(in_command: Types.CommandSet, out_at: (real, real) -> bool, x: real, y: real)
  { (in_command == Types.CommandSet.move(x, y)) ==> out_at(x, y) }
  predicate arrives(in_command: Types.CommandSet, out_at: (real, real) -> bool)
  { forall x: real, y: real :: arrives_all1(in_command, out_at, x, y) }

  // guarantee stays: While it inspects, the robot stays where it is
  predicate stays_all2(in_last: (real, real) -> bool, out_at: (real, real) -> bool, x: real, y: real)
  { out_at(x, y) <==> in_last(x, y) }
  predicate stays_all1(in_command: Types.CommandSet, in_last: (real, real) -> bool, out_at: (real, real) -> bool, i: nat)
  { (in_command == Types.CommandSet.inspect(i)) ==> (forall x: real, y: real :: stays_all2(in_last, out_at, x, y)) }
  predicate stays(in_command: Types.CommandSet, in_last: (real, real) -> bool, out_at: (real, real) -> bool)
  { forall i: nat :: stays_all1(in_command, in_last, out_at, i) }

  // guarantee somewhere: All places that it reports lie within the tolerance of one place
  predicate somewhere_all2(out_at: (real, real) -> bool, a: real, b: real, x: real, y: real)
  { out_at(x, y) ==> ((((a - 0.25) <= x) && (x <= (a + 0.25))) && (((b - 0.25) <= y) && (y <= (b + 0.25)))) }
  predicate somewhere_ex1(out_at: (real, real) -> bool, a: real, b: real)
  { forall x: real, y: real :: somewhere_all2(out_at, a, b, x, y) }
  predicate somewhere(out_at: (real, real) -> bool)
  { exists a: real, b: real :: somewhere_ex1(out_at, a, b) }
}
