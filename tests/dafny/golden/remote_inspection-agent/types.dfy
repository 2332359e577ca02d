// Generated: the types of the contract. Do not edit.
module {:options "--function-syntax:3"} Types {
  datatype RadStat = red | orange | green
  datatype Phase = exploring | leaving
  datatype CommandSet = move(move_0: real, move_1: real) | inspect(inspect_0: nat)
  // Partial operations: nothing is known of what they yield outside their domains.
  function DivideByZero(a: real): real
  function Divide(a: real, b: real): real { if b != 0.0 then a / b else DivideByZero(a) }
  function Beyond<T>(s: seq<T>, i: int): T
  function Nth<T>(s: seq<T>, i: int): T { if 0 <= i < |s| then s[i] else Beyond(s, i) }
  // The integers from a to b, both included.
  function Upto(a: int, b: int): seq<int>
    decreases b - a
  { if b < a then [] else [a] + Upto(a + 1, b) }
}
